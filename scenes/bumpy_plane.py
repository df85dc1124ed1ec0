#!/usr/bin/env python3
"""Figure 10 of Li et al. 2022: a bumpy metal plane (alpha 0.005) on a Lambert floor under a point light.

The plane stands and throws a web of overlapping caustic filaments, with folds and cusps, onto the floor before it.
`--alpha 0.05` is the right half of the figure.
"""

import math
import sys

from generator import run
from gltf_writer import GltfBuilder
from shapes import Waves, add_leaning_plane

PLANE_ALPHA = 0.005
SIZE = 2.0
# Wavelengths of 0.4 to 1.0 m with frequencies of no common measure, curved enough to focus before the floor.
BUMPS = Waves([(0.0105, 5.3, 2.9, 0.4), (0.0080, -3.7, 7.1, 1.9), (0.0045, 9.7, -6.1, 4.1), (0.0025, 4.3, 13.9, 2.7)])


def build(alpha: float = PLANE_ALPHA) -> GltfBuilder:
    builder = GltfBuilder()
    add_leaning_plane(builder, SIZE, BUMPS, 120, (0.98, 0.93, 0.83), alpha, lean=4.0, height=1.02)
    builder.add_light("lamp", "point", 60.0, position=(-1.1, 4.0, 2.4))
    builder.add_perspective_camera("camera", (1.9, 3.4, 5.3), (0.3, 0.62, 0.35), math.radians(35.0), 4.0 / 3.0)
    return builder


if __name__ == "__main__":
    sys.exit(run(__file__, __doc__, build, PLANE_ALPHA))
