#!/usr/bin/env python3
"""Figure 12 of Li et al. 2022: a metal ring (alpha 0.005) on a floor (alpha 0.5) under a point light.

The inner wall throws the nephroid that the renderer is named after.
"""

import math
import sys

from generator import run
from gltf_writer import GltfBuilder
from shapes import floor, revolve, rounded_band_profile

RING_ALPHA = 0.005
FLOOR_ALPHA = 0.5


def build(alpha: float = RING_ALPHA) -> GltfBuilder:
    builder = GltfBuilder()
    gold = builder.add_material("ring", (1.0, 0.78, 0.34), metallic=1.0, roughness=math.sqrt(alpha))
    grey = builder.add_material("floor", (0.7, 0.7, 0.7), metallic=0.0, roughness=math.sqrt(FLOOR_ALPHA))
    # 2 mm above the floor, so that no two surfaces lie in one plane.
    profile = rounded_band_profile(inner=1.0, outer=1.09, bottom=0.002, top=0.502, bevel=0.04,
                                   wall_cells=8, corner_cells=5)
    ring = builder.add_mesh("ring", revolve(profile, columns=432), gold)
    builder.add_node("floor", mesh=builder.add_mesh("floor", floor(6.0), grey))
    builder.add_node("ring", mesh=ring)
    # About 33 degrees up: the wall's light reaches the cusp at half the radius before it reaches the floor.
    builder.add_light("lamp", "point", 60.0, position=(-2.2, 2.35, 2.8))
    builder.add_perspective_camera("camera", (0.3, 4.0, 3.3), (0.05, 0.1, 0.0), math.radians(35.0), 4.0 / 3.0)
    return builder


if __name__ == "__main__":
    sys.exit(run(__file__, __doc__, build, RING_ALPHA))
