#!/usr/bin/env python3
"""Figure 13 of Li et al. 2022: a metal sphere (alpha 0.001) on a floor (alpha 0.5) under a point light."""

import math
import sys

from generator import run
from gltf_writer import GltfBuilder
from shapes import floor, sphere

SPHERE_ALPHA = 0.001
FLOOR_ALPHA = 0.5


def build(alpha: float = SPHERE_ALPHA) -> GltfBuilder:
    builder = GltfBuilder()
    metal = builder.add_material("sphere", (1.0, 1.0, 1.0), metallic=1.0, roughness=math.sqrt(alpha))
    grey = builder.add_material("floor", (0.7, 0.7, 0.7), metallic=0.0, roughness=math.sqrt(FLOOR_ALPHA))
    ball = builder.add_mesh("sphere", sphere(0.5, columns=128, rows=64), metal)
    builder.add_node("floor", mesh=builder.add_mesh("floor", floor(4.0), grey))
    builder.add_node("sphere", translation=(0.0, 0.502, 0.0), mesh=ball)
    # Low: the sphere's lower half sends its light down to a floor that the lamp itself only grazes.
    builder.add_light("lamp", "point", 60.0, position=(-2.7, 0.42, 1.3))
    builder.add_perspective_camera("camera", (0.3, 1.9, 2.2), (-0.1, 0.25, 0.1), math.radians(44.0), 4.0 / 3.0)
    return builder


if __name__ == "__main__":
    sys.exit(run(__file__, __doc__, build, SPHERE_ALPHA))
