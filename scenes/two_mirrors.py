#!/usr/bin/env python3
"""Caustics by two reflections: lamp, bumpy trough, curved sheet, floor (metal of alpha 0.02, Lambert floor).

A hood around the lamp leaves open only the cone towards the trough, so that neither the floor nor the sheet sees the
lamp. The trough sends a nearly parallel beam to the sheet, and the sheet sends it down to the floor between the two.
"""

import math
import sys

from generator import run
from gltf_writer import GltfBuilder
from shapes import Waves, bumpy_arc, floor, merge, quad

MIRROR_ALPHA = 0.02
TROUGH_RADIUS = 0.8
TROUGH_LENGTH = 2.0
AXIS_HEIGHT = 1.25
# A cylinder's focal line lies half a radius before its wall; a little nearer, the beam stays wide.
LAMP = (-0.47 * TROUGH_RADIUS, AXIS_HEIGHT, 0.0)
TROUGH_BUMPS = Waves([(0.006, 4.1, 6.3, 0.3), (0.004, -7.3, 5.1, 1.1), (0.002, 3.7, -13.1, 2.3)])

SHEET_RADIUS = 7.0
SHEET_LENGTH = 3.0
SHEET_BUMPS = Waves([(0.008, 23.1, 3.3, 0.9), (0.006, -29.7, 5.1, 2.9)])
# The sheet's middle, and where its normal points there: down and back to the trough.
SHEET_MIDDLE = (2.3, 1.3)
SHEET_NORMAL_ANGLE = math.radians(180.0 + 31.0)
SHEET_HALF_ANGLE = math.radians(6.4)

HOOD_DEPTH = 0.16
HOOD_HALF_HEIGHT = 0.14
HOOD_HALF_WIDTH = 0.07


def hood():
    """A box around the lamp without its side towards the trough; the lamp is at its inner end."""
    x, y, z = LAMP
    near, far = x - HOOD_DEPTH, x + 0.03
    bottom, top = y - HOOD_HALF_HEIGHT, y + HOOD_HALF_HEIGHT
    left, right = z - HOOD_HALF_WIDTH, z + HOOD_HALF_WIDTH
    along, up, across = (far - near, 0.0, 0.0), (0.0, top - bottom, 0.0), (0.0, 0.0, right - left)
    return merge([
        quad((far, bottom, right), tuple(-c for c in across), up),
        quad((near, bottom, right), along, up),
        quad((near, bottom, left), up, along),
        quad((near, top, left), across, along),
        quad((near, bottom, left), along, across),
    ])


def trough():
    """Open towards +X."""
    return bumpy_arc(TROUGH_RADIUS, TROUGH_LENGTH, math.radians(255.0), math.radians(105.0), TROUGH_BUMPS,
                     columns=48, rows=48)


def curved_sheet():
    """Concave towards the trough and the floor."""
    outwards = SHEET_NORMAL_ANGLE - math.pi
    return bumpy_arc(SHEET_RADIUS, SHEET_LENGTH, outwards + SHEET_HALF_ANGLE, outwards - SHEET_HALF_ANGLE,
                     SHEET_BUMPS, columns=40, rows=48)


def build(alpha: float = MIRROR_ALPHA) -> GltfBuilder:
    builder = GltfBuilder()
    copper = builder.add_material("trough", (0.97, 0.85, 0.72), metallic=1.0, roughness=math.sqrt(alpha))
    silver = builder.add_material("sheet", (0.96, 0.96, 0.95), metallic=1.0, roughness=math.sqrt(alpha))
    lambert = builder.add_material("floor", (0.75, 0.75, 0.75), metallic=0.0, roughness=1.0, specular=0.0)
    dark = builder.add_material("hood", (0.1, 0.1, 0.1), metallic=0.0, roughness=1.0, specular=0.0)
    glow = builder.add_material("panel", (0.0, 0.0, 0.0), metallic=0.0, roughness=1.0, specular=0.0,
                                emission=(1.0, 1.0, 1.0), emission_strength=2.0)
    outwards = SHEET_NORMAL_ANGLE - math.pi
    sheet_axis = (SHEET_MIDDLE[0] - SHEET_RADIUS * math.cos(outwards),
                  SHEET_MIDDLE[1] - SHEET_RADIUS * math.sin(outwards), 0.0)
    builder.add_node("floor", mesh=builder.add_mesh("floor", floor(8.0), lambert))
    builder.add_node("trough", translation=(0.0, AXIS_HEIGHT, 0.0), mesh=builder.add_mesh("trough", trough(), copper))
    builder.add_node("sheet", translation=sheet_axis, mesh=builder.add_mesh("sheet", curved_sheet(), silver))
    builder.add_node("hood", mesh=builder.add_mesh("hood", hood(), dark))
    # So faint and so large that it only shows the shapes.
    panel = builder.add_mesh("panel", quad((-2.0, 5.0, -2.0), (4.0, 0.0, 0.0), (0.0, 0.0, 4.0)), glow)
    builder.add_node("panel", mesh=panel)
    builder.add_light("lamp", "point", 60.0, position=LAMP)
    builder.add_perspective_camera("camera", (0.8, 2.6, 5.6), (0.95, 0.5, 0.1), math.radians(35.0), 4.0 / 3.0)
    return builder


if __name__ == "__main__":
    sys.exit(run(__file__, __doc__, build, MIRROR_ALPHA))
