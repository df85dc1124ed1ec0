#!/usr/bin/env python3
"""A metal bowl (alpha 0.02) with milk in it under a point light: one and more reflections on the same concave mesh.

The wall bulges, is a little wavy and hides its lower part under a Lambert disk, the milk, which shows the caustics.
"""

import math
import sys

from generator import run
from gltf_writer import Geometry, GltfBuilder
from shapes import floor, traced_sheet

BOWL_ALPHA = 0.02
RADIUS = 1.0
THICKNESS = 0.04
MILK_HEIGHT = 0.3
RIM_ANGLE = math.radians(98.0)  # from the bottom, about the ball's centre


def bowl() -> Geometry:
    """Outside, rim and inside in one closed sheet; the ball that it is a part of stands 2 mm above the floor."""
    centre = RADIUS + 0.002

    def position(u, v):
        angle = 2.0 * math.pi * u
        # v from 0: outside bottom, rim at the middle, inside bottom at 1.
        half = 2.0 * v if v < 0.5 else 2.0 * (1.0 - v)
        polar = 0.01 + half * (RIM_ANGLE - 0.01)
        # The radius passes smoothly from outside to inside at the rim.
        turn = min(1.0, max(0.0, (v - 0.47) / 0.06))
        depth = THICKNESS * turn * turn * (3.0 - 2.0 * turn)
        wavy = 0.012 * math.sin(7.0 * angle + 3.0 * polar) * math.sin(polar) ** 4
        radius = RADIUS - depth + wavy
        flat = 0.8  # lower than a ball
        return (radius * math.sin(polar) * math.sin(angle), centre * flat - radius * flat * math.cos(polar) + 0.001,
                radius * math.sin(polar) * math.cos(angle))

    return traced_sheet(position, columns=120, rows=100, closed=True)


def disk(radius: float, height: float, corners: int) -> Geometry:
    """A horizontal disk that faces up."""
    geometry = Geometry()
    geometry.add_vertex((0.0, height, 0.0), (0.0, 1.0, 0.0))
    for k in range(corners):
        angle = 2.0 * math.pi * k / corners
        geometry.add_vertex((radius * math.sin(angle), height, radius * math.cos(angle)), (0.0, 1.0, 0.0))
    for k in range(corners):
        geometry.indices.extend((0, 1 + k, 1 + (k + 1) % corners))
    return geometry


def build(alpha: float = BOWL_ALPHA) -> GltfBuilder:
    builder = GltfBuilder()
    copper = builder.add_material("bowl", (0.97, 0.72, 0.55), metallic=1.0, roughness=math.sqrt(alpha))
    milk = builder.add_material("milk", (0.75, 0.74, 0.7), metallic=0.0, roughness=1.0, specular=0.0)
    lambert = builder.add_material("floor", (0.45, 0.45, 0.47), metallic=0.0, roughness=1.0, specular=0.0)
    builder.add_node("floor", mesh=builder.add_mesh("floor", floor(6.0), lambert))
    builder.add_node("bowl", mesh=builder.add_mesh("bowl", bowl(), copper))
    # Its edge is inside the wall, which is 4 cm thick.
    radius = (RADIUS - 0.5 * THICKNESS) * math.sqrt(1.0 - (1.0 - MILK_HEIGHT / (0.8 * RADIUS)) ** 2)
    builder.add_node("milk", mesh=builder.add_mesh("milk", disk(radius, MILK_HEIGHT, 96), milk))
    builder.add_light("lamp", "point", 50.0, position=(-1.9, 3.9, 1.9))
    builder.add_perspective_camera("camera", (0.4, 3.6, 2.9), (0.02, 0.42, 0.0), math.radians(31.0), 4.0 / 3.0)
    return builder


if __name__ == "__main__":
    sys.exit(run(__file__, __doc__, build, BOWL_ALPHA))
