#!/usr/bin/env python3
"""Nothing casts a caustic: Lambert walls, rough metal and rough coated shapes under a window of 2.4 x 1.6 m.

The control of the benchmark: guiding has nothing to find and must cost nothing.
"""

import math
import os
import sys

from gltf_writer import GltfBuilder
from shapes import box, floor, quad, sphere, traced_sheet

ROUGH_ALPHA = 0.3


def torus(major: float, minor: float):
    """Lies flat about the Y axis, its middle at the origin."""
    def position(u, v):
        angle, around = 2.0 * math.pi * u, 2.0 * math.pi * v
        radius = major + minor * math.cos(around)
        return (radius * math.sin(angle), minor * math.sin(around), radius * math.cos(angle))

    return traced_sheet(position, columns=64, rows=24, closed=True)


def build() -> GltfBuilder:
    builder = GltfBuilder()
    white = builder.add_material("white", (0.75, 0.74, 0.72), specular=0.0)
    blue = builder.add_material("blue", (0.2, 0.32, 0.55), specular=0.0)
    wood = builder.add_material("wood", (0.5, 0.33, 0.2), specular=0.0)
    metal = builder.add_material("rough metal", (0.9, 0.72, 0.4), metallic=1.0, roughness=math.sqrt(ROUGH_ALPHA))
    coated = builder.add_material("rough coat", (0.6, 0.15, 0.12), metallic=0.0, roughness=math.sqrt(ROUGH_ALPHA))
    glow = builder.add_material("window", (0.0, 0.0, 0.0), specular=0.0, emission=(0.9, 0.95, 1.0),
                                emission_strength=6.0)
    builder.add_node("floor", mesh=builder.add_mesh("floor", floor(2.5), wood))
    walls = [("back", quad((-2.5, 0, -1.5), (5, 0, 0), (0, 3, 0)), blue),
             ("right", quad((2.0, 0, 2.5), (0, 0, -4), (0, 3, 0)), white),
             ("ceiling", quad((-2.5, 3, -1.5), (5, 0, 0), (0, 0, 4)), white)]
    for name, geometry, material in walls:
        builder.add_node(name, mesh=builder.add_mesh(name, geometry, material))
    window = quad((-2.2, 0.9, 1.2), (0, 0, -2.4), (0, 1.6, 0))
    builder.add_node("window", mesh=builder.add_mesh("window", window, glow))
    builder.add_node("ball", translation=(-0.45, 0.5, -0.3),
                     mesh=builder.add_mesh("ball", sphere(0.498, 64, 32), metal))
    builder.add_node("torus", translation=(0.65, 0.17, 0.45),
                     mesh=builder.add_mesh("torus", torus(0.42, 0.165), coated))
    builder.add_node("block", translation=(1.0, 0.001, -0.7), rotation=(0.0, 0.2588190451, 0.0, 0.9659258263),
                     mesh=builder.add_mesh("block", box((0.7, 1.3, 0.7)), white))
    builder.add_perspective_camera("camera", (-0.2, 1.55, 4.4), (0.2, 0.65, -0.2), math.radians(32.0), 4.0 / 3.0)
    return builder


if __name__ == "__main__":
    build().write(sys.argv[1] if len(sys.argv) > 1 else os.path.join(os.path.dirname(__file__), "no_caustic.glb"))
