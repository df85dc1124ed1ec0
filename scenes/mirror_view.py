#!/usr/bin/env python3
"""A caustic seen in a mirror: camera, flat mirror (alpha 0.01), Lambert floor, half ring (alpha 0.02), lamp.

The half ring turns its back to the camera and hides the caustic that it throws; the mirror behind shows it. The lamp
is beside and behind the mirror's plane, so that the mirror throws no light of its own.
"""

import math
import sys

from generator import run
from gltf_writer import GltfBuilder
from shapes import arc_band, box, floor, quad, rounded_band_profile

RING_ALPHA = 0.02
MIRROR_ALPHA = 0.01
MIRROR_HALF_WIDTH = 1.0
MIRROR_BOTTOM, MIRROR_TOP = 0.08, 1.25
MIRROR_PLACE = -1.15
FRAME_WIDTH = 0.06


def mirror():
    """Faces +Z, a little before its frame."""
    return quad((-MIRROR_HALF_WIDTH, MIRROR_BOTTOM, MIRROR_PLACE), (2.0 * MIRROR_HALF_WIDTH, 0.0, 0.0),
                (0.0, MIRROR_TOP - MIRROR_BOTTOM, 0.0))


def frame():
    """A board behind the mirror that stands out on all sides; its bottom's centre is the origin."""
    return box((2.0 * (MIRROR_HALF_WIDTH + FRAME_WIDTH), MIRROR_TOP - MIRROR_BOTTOM + 2.0 * FRAME_WIDTH, 0.03))


def build(alpha: float = RING_ALPHA) -> GltfBuilder:
    builder = GltfBuilder()
    gold = builder.add_material("half ring", (1.0, 0.78, 0.34), metallic=1.0, roughness=math.sqrt(alpha))
    silver = builder.add_material("mirror", (0.95, 0.95, 0.95), metallic=1.0, roughness=math.sqrt(MIRROR_ALPHA))
    lambert = builder.add_material("floor", (0.7, 0.7, 0.7), metallic=0.0, roughness=1.0, specular=0.0)
    wood = builder.add_material("frame", (0.35, 0.2, 0.1), metallic=0.0, roughness=1.0, specular=0.0)
    profile = rounded_band_profile(inner=0.75, outer=0.82, bottom=0.002, top=0.602, bevel=0.03,
                                   wall_cells=4, corner_cells=3)
    half_ring = builder.add_mesh("half ring", arc_band(profile, columns=110, angle=math.pi), gold)
    builder.add_node("floor", mesh=builder.add_mesh("floor", floor(6.0), lambert))
    builder.add_node("mirror", mesh=builder.add_mesh("mirror", mirror(), silver))
    builder.add_node("frame", translation=(0.0, MIRROR_BOTTOM - FRAME_WIDTH, MIRROR_PLACE - 0.025),
                     mesh=builder.add_mesh("frame", frame(), wood))
    # The arc runs from +Z over +X to -Z; turned so that its middle points away from the lamp, to the camera.
    turn = math.radians(-48.0)
    builder.add_node("half ring", rotation=(0.0, math.sin(turn / 2.0), 0.0, math.cos(turn / 2.0)), mesh=half_ring)
    builder.add_light("lamp", "point", 50.0, position=(-2.7, 2.3, -1.28))
    builder.add_perspective_camera("camera", (0.6, 1.85, 3.2), (0.02, 0.43, -0.5), math.radians(29.0), 4.0 / 3.0)
    return builder


if __name__ == "__main__":
    sys.exit(run(__file__, __doc__, build, RING_ALPHA))
