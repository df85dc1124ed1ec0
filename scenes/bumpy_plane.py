#!/usr/bin/env python3
"""Figure 10 of Li et al. 2022: a bumpy metal plane (alpha 0.005) on a Lambert floor under a point light.

The plane stands and throws a web of overlapping caustic filaments, with folds and cusps, onto the floor before it.
`--alpha 0.05` is the right half of the figure.
"""

import math
import sys

from generator import run
from gltf_writer import GltfBuilder
from shapes import Waves, bumpy_rectangle, floor

PLANE_ALPHA = 0.005
SIZE = 2.0
# Wavelengths of 0.4 to 1.0 m with frequencies of no common measure, curved enough to focus before the floor.
BUMPS = Waves([(0.0105, 5.3, 2.9, 0.4), (0.0080, -3.7, 7.1, 1.9), (0.0045, 9.7, -6.1, 4.1), (0.0025, 4.3, 13.9, 2.7)])


def build(alpha: float = PLANE_ALPHA) -> GltfBuilder:
    builder = GltfBuilder()
    metal = builder.add_material("plane", (0.98, 0.93, 0.83), metallic=1.0, roughness=math.sqrt(alpha))
    lambert = builder.add_material("floor", (0.7, 0.7, 0.7), metallic=0.0, roughness=1.0, specular=0.0)
    plane = builder.add_mesh("plane", bumpy_rectangle(SIZE, SIZE, BUMPS, columns=120, rows=120), metal)
    builder.add_node("floor", mesh=builder.add_mesh("floor", floor(8.0), lambert))
    # Leans forward by 4 degrees, its lower edge just above the floor.
    lean = math.radians(4.0)
    builder.add_node("plane", translation=(0.0, 1.02, -0.6), mesh=plane,
                     rotation=(math.sin(lean / 2.0), 0.0, 0.0, math.cos(lean / 2.0)))
    builder.add_light("lamp", "point", 60.0, position=(-1.1, 4.0, 2.4))
    builder.add_perspective_camera("camera", (1.9, 3.4, 5.3), (0.3, 0.62, 0.35), math.radians(35.0), 4.0 / 3.0)
    return builder


if __name__ == "__main__":
    sys.exit(run(__file__, __doc__, build, PLANE_ALPHA))
