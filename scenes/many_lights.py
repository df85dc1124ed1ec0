#!/usr/bin/env python3
"""Caustics of 100 small lights: a wavy metal ring (alpha 0.02) on a Lambert floor under a garland of sphere lights.

The lights (5 mm, from red to blue) hang in two turns of a wave behind and beside the ring; each throws a caustic.
"""

import math
import sys

from generator import run
from gltf_writer import Geometry, GltfBuilder
from shapes import floor, traced_sheet

RING_ALPHA = 0.02
LIGHTS = 100
LIGHT_RADIUS = 0.005
DOME = 5.0  # metres from the origin
FIRST_COLOUR, LAST_COLOUR = (1.0, 0.45, 0.2), (0.25, 0.6, 1.0)


def ring() -> Geometry:
    """A standing band with round edges, 9 cm thick, whose inside and outside follow five waves."""
    def position(u, v):
        angle, around = 2.0 * math.pi * u, 2.0 * math.pi * v
        # A superellipse: nearly flat walls, round edges.
        sine, cosine = math.sin(around), math.cos(around)
        size = (sine ** 4 + cosine ** 4) ** -0.25
        radius = 0.9 + 0.07 * math.sin(5.0 * angle) + 0.045 * size * cosine
        return (radius * math.sin(angle), 0.232 + 0.23 * size * sine, radius * math.cos(angle))

    return traced_sheet(position, columns=180, rows=24, closed=True)


def build(alpha: float = RING_ALPHA) -> GltfBuilder:
    builder = GltfBuilder()
    metal = builder.add_material("ring", (0.96, 0.95, 0.93), metallic=1.0, roughness=math.sqrt(alpha))
    lambert = builder.add_material("floor", (0.7, 0.7, 0.7), metallic=0.0, roughness=1.0, specular=0.0)
    builder.add_node("floor", mesh=builder.add_mesh("floor", floor(6.0), lambert))
    builder.add_node("ring", mesh=builder.add_mesh("ring", ring(), metal))
    for number in range(LIGHTS):
        t = (number + 0.5) / LIGHTS
        angle = math.radians(150.0 + 130.0 * t)  # from +Z towards +X
        height = math.radians(36.0 + 5.0 * math.sin(4.0 * math.pi * t))
        position = (DOME * math.cos(height) * math.sin(angle), DOME * math.sin(height),
                    DOME * math.cos(height) * math.cos(angle))
        colour = tuple((1.0 - t) * a + t * b for a, b in zip(FIRST_COLOUR, LAST_COLOUR))
        builder.add_light(f"lamp {number + 1}", "point", 1.4, color=colour, radius=LIGHT_RADIUS, position=position)
    builder.add_perspective_camera("camera", (0.2, 3.5, 2.9), (0.0, 0.1, 0.05), math.radians(34.0), 4.0 / 3.0)
    return builder


if __name__ == "__main__":
    sys.exit(run(__file__, __doc__, build, RING_ALPHA))
