#!/usr/bin/env python3
"""A large scene for load time, memory and throughput: a bumpy metal ball of many triangles on a floor.

Usage: big_mesh.py OUT.glb [--triangles 1000000]
"""

import argparse
import math
import os
import sys
from array import array

from gltf_writer import Geometry, GltfBuilder
from shapes import floor

BUMP_HEIGHT = 0.02  # of the radius
BUMPS = 14.0  # radians of bump phase per radian


def bumpy_ball(triangles: int) -> Geometry:
    """A unit ball whose radius is 1 + BUMP_HEIGHT sin(BUMPS theta) sin(BUMPS phi), with exact normals.

    The poles are left out (theta from 0.05 to pi - 0.05): a latitude-longitude grid has slivers there.
    """
    rows = max(2, round(math.sqrt(triangles / 4.0)))
    columns = max(3, round(triangles / (2.0 * rows)))
    geometry = Geometry()
    around = [(math.sin(phi), math.cos(phi), math.sin(BUMPS * phi), math.cos(BUMPS * phi))
              for phi in (2.0 * math.pi * column / columns for column in range(columns))]
    for row in range(rows + 1):
        add_circle(geometry, 0.05 + (math.pi - 0.1) * row / rows, around)
    for row in range(rows):
        first = row * columns
        for column in range(columns):
            following = (column + 1) % columns
            a, b = first + column, first + following
            c, d = b + columns, a + columns
            geometry.indices.extend((a, b, c, a, c, d))
    return geometry


def add_circle(geometry: Geometry, theta: float, around) -> None:
    """One circle of latitude; theta is measured from the south pole."""
    sine, cosine = math.sin(theta), math.cos(theta)
    wave, slope = BUMP_HEIGHT * math.sin(BUMPS * theta), BUMP_HEIGHT * BUMPS * math.cos(BUMPS * theta)
    scale = BUMP_HEIGHT * BUMPS / sine * math.sin(BUMPS * theta)
    positions, normals = array("f"), array("f")
    for sin_phi, cos_phi, sin_bump, cos_bump in around:
        radius = 1.0 + wave * sin_bump
        # Radial, polar and azimuthal parts of the gradient of |p| - radius(theta, phi).
        polar, azimuthal = -slope * sin_bump / radius, -scale * cos_bump / radius
        inverse = 1.0 / math.sqrt(1.0 + polar * polar + azimuthal * azimuthal)
        outwards = sine + polar * cosine
        positions.extend((radius * sine * sin_phi, -radius * cosine, radius * sine * cos_phi))
        normals.extend((inverse * (outwards * sin_phi + azimuthal * cos_phi),
                        inverse * (-cosine + polar * sine),
                        inverse * (outwards * cos_phi - azimuthal * sin_phi)))
    geometry.positions.extend(positions)
    geometry.normals.extend(normals)


def build(triangles: int) -> GltfBuilder:
    builder = GltfBuilder()
    metal = builder.add_material("ball", (0.95, 0.64, 0.54), metallic=1.0, roughness=math.sqrt(0.05))
    grey = builder.add_material("floor", (0.6, 0.6, 0.6), metallic=0.0, roughness=math.sqrt(0.5))
    builder.add_node("floor", mesh=builder.add_mesh("floor", floor(6.0), grey))
    builder.add_node("ball", translation=(0.0, 1.03, 0.0), mesh=builder.add_mesh("ball", bumpy_ball(triangles), metal))
    builder.add_light("lamp", "point", 100.0, position=(-2.5, 4.0, 2.0))
    builder.add_perspective_camera("camera", (0.6, 2.6, 4.6), (0.0, 0.8, 0.0), math.radians(38.0), 4.0 / 3.0)
    return builder


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("output")
    parser.add_argument("--triangles", type=int, default=1000000)
    arguments = parser.parse_args()
    if arguments.triangles < 12:
        parser.error("--triangles: at least 12")
    os.makedirs(os.path.dirname(os.path.abspath(arguments.output)), exist_ok=True)
    builder = build(arguments.triangles)
    builder.write(arguments.output)
    print(f"{arguments.output}: {builder.triangles} triangles")
    return 0


if __name__ == "__main__":
    sys.exit(main())
