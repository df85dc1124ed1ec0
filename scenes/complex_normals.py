#!/usr/bin/env python3
"""After Figure 14 of Li et al. 2022, their failure case: nearly specular metal (alpha 0.001) with complex normals.

A hammered plane: dents of 6 to 30 cm over one another turn the normal by 7 degrees (RMS), to and fro, so that each
point of the floor gets light by many paths that change within centimetres.
"""

import math
import sys

from generator import run
from gltf_writer import GltfBuilder
from shapes import Waves, add_leaning_plane

PLANE_ALPHA = 0.001
SIZE = 1.5
BUMPS = Waves([(0.0030, 17.3, 11.9, 0.4), (0.0027, -13.7, 21.1, 1.9), (0.0017, 31.7, -24.1, 4.1),
               (0.0015, 37.3, 29.9, 2.7), (0.0008, -61.1, 47.3, 0.9), (0.0007, 53.9, 71.3, 3.3),
               (0.0004, 97.1, -41.3, 5.2), (0.0004, 23.9, 101.7, 1.3)])


def build(alpha: float = PLANE_ALPHA) -> GltfBuilder:
    builder = GltfBuilder()
    add_leaning_plane(builder, SIZE, BUMPS, 112, (0.95, 0.93, 0.88), alpha, lean=8.0, height=0.79)
    builder.add_light("lamp", "point", 60.0, position=(-1.0, 3.6, 2.4))
    builder.add_perspective_camera("camera", (1.7, 2.9, 4.6), (0.2, 0.4, 0.2), math.radians(33.0), 4.0 / 3.0)
    return builder


if __name__ == "__main__":
    sys.exit(run(__file__, __doc__, build, PLANE_ALPHA))
