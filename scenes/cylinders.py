#!/usr/bin/env python3
"""Figure 11 of Li et al. 2022: three bumpy metal cylinders over a glossy floor (alpha 0.01) before a diffuse wall.

The cylinders throw caustics onto the wall, directly (DS) and by the floor or each other (DSS); the floor shows the
wall's once more (SDS, SDSS). The paper's tiny spherical emitter is a point light here.
"""

import math
import sys

from generator import run
from gltf_writer import Geometry, GltfBuilder
from shapes import Waves, bumpy_arc, floor, merge, quad

CYLINDER_ALPHA = 0.01
RADIUS = 0.3
LENGTH = 1.2
COLUMNS, ROWS = 120, 27
WALL = -1.35
# (position, turn about Y, tilt about Z), metres and radians; the axis is X before.
PLACES = [((-1.25, 0.6, -0.55), 0.35, 0.14), ((0.1, 0.45, -0.25), -0.12, -0.05), ((1.3, 0.75, -0.6), -0.3, 0.12)]


def bumps(number: int) -> Waves:
    """Angular frequencies are whole numbers, so that the bumps close around the cylinder."""
    return Waves([(0.0055, 5.0, 8.3 + number, 0.7 + 2.1 * number), (0.0040, -7.0, 11.9 - number, 1.9 * number),
                  (0.0028, 11.0, 15.1, 2.3 + 1.3 * number)])


def cap(waves: Waves, z: float) -> Geometry:
    """The flat end of a bumpy cylinder around the Z axis."""
    geometry = Geometry()
    normal = (0.0, 0.0, 1.0 if z > 0.0 else -1.0)
    geometry.add_vertex((0.0, 0.0, z), normal)
    for column in range(COLUMNS):
        angle = 2.0 * math.pi * column / COLUMNS
        radius = RADIUS + waves(angle, z)[0]
        geometry.add_vertex((radius * math.cos(angle), radius * math.sin(angle), z), normal)
    for column in range(COLUMNS):
        a, b = 1 + column, 1 + (column + 1) % COLUMNS
        geometry.indices.extend((0, a, b) if z > 0.0 else (0, b, a))
    return geometry


def cylinder(number: int) -> Geometry:
    waves = bumps(number)
    side = bumpy_arc(RADIUS, LENGTH, 0.0, 2.0 * math.pi, waves, COLUMNS, ROWS)
    return merge([side, cap(waves, -0.5 * LENGTH), cap(waves, 0.5 * LENGTH)])


def rotation(turn: float, tilt: float):
    """The quaternion that brings the Z axis to X, tilts it about Z and turns it about Y."""
    half_turn, half_tilt = 0.5 * turn + 0.25 * math.pi, 0.5 * tilt
    # (turn + 90 degrees about Y) times (minus tilt about X): the tilt in the cylinder's own frame.
    sy, cy, sx, cx = math.sin(half_turn), math.cos(half_turn), -math.sin(half_tilt), math.cos(half_tilt)
    return (cy * sx, sy * cx, -sy * sx, cy * cx)


def build(alpha: float = CYLINDER_ALPHA) -> GltfBuilder:
    builder = GltfBuilder()
    colours = [(1.0, 0.78, 0.34), (0.95, 0.93, 0.88), (0.95, 0.64, 0.54)]
    glossy = builder.add_material("floor", (0.55, 0.56, 0.6), metallic=1.0, roughness=math.sqrt(alpha))
    lambert = builder.add_material("wall", (0.7, 0.7, 0.7), metallic=0.0, roughness=1.0, specular=0.0)
    builder.add_node("floor", mesh=builder.add_mesh("floor", floor(4.0), glossy))
    wall = quad((-4.0, -0.01, WALL), (8.0, 0.0, 0.0), (0.0, 5.0, 0.0))
    builder.add_node("wall", mesh=builder.add_mesh("wall", wall, lambert))
    for number, (position, turn, tilt) in enumerate(PLACES):
        name = f"cylinder {number + 1}"
        metal = builder.add_material(name, colours[number], metallic=1.0, roughness=math.sqrt(alpha))
        builder.add_node(name, translation=position, rotation=rotation(turn, tilt),
                         mesh=builder.add_mesh(name, cylinder(number), metal))
    # High above and near the wall's plane: it only grazes the wall, which the cylinders' light meets head-on.
    builder.add_light("lamp", "point", 120.0, position=(-0.4, 5.5, -0.65))
    builder.add_perspective_camera("camera", (0.0, 1.35, 5.6), (0.0, 0.8, -0.8), math.radians(31.0), 4.0 / 3.0)
    return builder


if __name__ == "__main__":
    sys.exit(run(__file__, __doc__, build, CYLINDER_ALPHA))
