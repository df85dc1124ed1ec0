#!/usr/bin/env python3
"""A box of 2 m with coloured Lambert walls, a lamp in its ceiling, a rough metal block and a glossy dielectric one."""

import math
import os
import sys

from gltf_writer import GltfBuilder
from shapes import box, quad


def turn_about_y(degrees: float):
    """Quaternion (x, y, z, w) of a rotation about +Y."""
    half = math.radians(degrees) / 2.0
    return (0.0, math.sin(half), 0.0, math.cos(half))


def add_walls(builder: GltfBuilder) -> None:
    white = builder.add_material("white", (0.73, 0.73, 0.73), specular=0.0)
    red = builder.add_material("red", (0.63, 0.06, 0.05), specular=0.0)
    green = builder.add_material("green", (0.15, 0.48, 0.09), specular=0.0)
    walls = [
        ("floor", quad((-1, 0, 1), (2, 0, 0), (0, 0, -2)), white),
        ("ceiling", quad((-1, 2, -1), (2, 0, 0), (0, 0, 2)), white),
        ("back", quad((-1, 0, -1), (2, 0, 0), (0, 2, 0)), white),
        ("left", quad((-1, 0, 1), (0, 0, -2), (0, 2, 0)), red),
        ("right", quad((1, 0, -1), (0, 0, 2), (0, 2, 0)), green),
    ]
    for name, geometry, material in walls:
        builder.add_node(name, mesh=builder.add_mesh(name, geometry, material))


def build() -> GltfBuilder:
    builder = GltfBuilder()
    add_walls(builder)
    lamp = builder.add_material("lamp", (0.0, 0.0, 0.0), specular=0.0, emission=(1.0, 0.8, 0.5), emission_strength=18.0)
    metal = builder.add_material("metal", (0.95, 0.93, 0.88), metallic=1.0, roughness=0.35)
    coated = builder.add_material("coated", (0.25, 0.4, 0.7), metallic=0.0, roughness=0.15)
    builder.add_node("lamp", mesh=builder.add_mesh("lamp", quad((-0.3, 1.995, -0.3), (0.6, 0, 0), (0, 0, 0.6)), lamp))
    builder.add_node("tall block", translation=(-0.35, 0.001, -0.35), rotation=turn_about_y(18.0),
                     mesh=builder.add_mesh("tall block", box((0.6, 1.2, 0.6)), metal))
    builder.add_node("short block", translation=(0.38, 0.001, 0.3), rotation=turn_about_y(-17.0),
                     mesh=builder.add_mesh("short block", box((0.6, 0.6, 0.6)), coated))
    builder.add_perspective_camera("camera", (0.0, 1.0, 4.9), (0.0, 1.0, 0.0), math.radians(30.0), 1.0)
    return builder


if __name__ == "__main__":
    build().write(sys.argv[1] if len(sys.argv) > 1 else os.path.join(os.path.dirname(__file__), "cornell.glb"))
