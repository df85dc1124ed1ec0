#!/usr/bin/env python3
"""After Figure 9 of Li et al. 2022 (Musa): a metal figure (alpha 0.01) before a background (alpha 0.2), point light.

A draped figure stands for the paper's model, which is not free: a body with folds, a head with a knot of hair. The
paper's environment is a dim panel of 8 x 8 m overhead.
"""

import math
import sys

from generator import run
from gltf_writer import Geometry, GltfBuilder
from shapes import ellipsoid, floor, merge, quad, traced_sheet, tube

FIGURE_ALPHA = 0.01
BACKGROUND_ALPHA = 0.2
WALL = -0.85
# (height, half width along X, half depth along Z), metres, from hem to neck.
BODY = [(0.002, 0.36, 0.31), (0.25, 0.31, 0.27), (0.6, 0.25, 0.22), (0.85, 0.27, 0.22), (1.05, 0.21, 0.17),
        (1.2, 0.19, 0.15), (1.38, 0.25, 0.18), (1.52, 0.25, 0.14), (1.6, 0.12, 0.1), (1.66, 0.072, 0.075),
        (1.74, 0.066, 0.072)]


def smooth_body(height: float):
    """Half width and depth at a height: cubic Hermite curves through BODY."""
    last = len(BODY) - 1
    k = max(i for i in range(last) if BODY[i][0] <= height or i == 0)

    def slope(i, c):
        low, high = BODY[max(i - 1, 0)], BODY[min(i + 1, last)]
        return (high[c] - low[c]) / (high[0] - low[0])

    span = BODY[k + 1][0] - BODY[k][0]
    t = (height - BODY[k][0]) / span
    start, end = t * t * (2.0 * t - 3.0) + 1.0, t * t * (3.0 - 2.0 * t)
    leave, arrive = t * (1.0 - t) ** 2, t * t * (t - 1.0)
    return [start * BODY[k][c] + end * BODY[k + 1][c] + span * (leave * slope(k, c) + arrive * slope(k + 1, c))
            for c in (1, 2)]


def figure() -> Geometry:
    top = BODY[-1][0]

    def position(u, v):
        height = BODY[0][0] + v * (top - BODY[0][0])
        half_width, half_depth = smooth_body(height)
        angle = 2.0 * math.pi * u
        # Folds run down the robe, turn about the body and fade out at the shoulders.
        cloth = max(0.0, 1.0 - height / 1.45) ** 0.7 if height < 1.45 else 0.0
        folds = cloth * (0.03 * math.sin(7.0 * angle + 2.4 * height + 0.6 * math.sin(3.0 * height))
                         + 0.0045 * math.sin(15.0 * angle - 5.0 * height))
        belt = 0.03 * math.sin(5.0 * angle + 14.0 * height) * math.exp(-((height - 1.2) / 0.16) ** 2)
        sway = 0.05 * math.sin(2.2 * height)
        scale = 1.0 + folds + belt
        return (sway + half_width * scale * math.sin(angle), height, half_depth * scale * math.cos(angle))

    return traced_sheet(position, columns=110, rows=88, closed=True)


def arm(side: float) -> Geometry:
    """From a shoulder over the elbow to the hand before the body; the left one is raised."""
    shoulder, elbow, hand = ((0.24, 1.47, 0.0), (0.4, 1.17, 0.02), (0.2, 1.08, 0.27))
    if side < 0.0:
        elbow, hand = (0.47, 1.3, 0.02), (0.5, 1.66, 0.08)

    def line(v):
        point = [(1 - v) ** 2 * a + 2 * v * (1 - v) * (2 * b - 0.5 * (a + c)) + v * v * c
                 for a, b, c in zip(shoulder, elbow, hand)]
        return (0.03 + side * point[0], point[1], point[2])

    def radius(v, angle):
        ends = math.sqrt(max(1e-3, 1.0 - (2.0 * v - 1.0) ** 8))
        return (0.078 - 0.038 * v) * ends * (1.0 + 0.05 * (1.0 - v) * math.sin(4.0 * angle + 20.0 * v))

    return tube(line, radius, columns=28, rows=44)


def head() -> Geometry:
    def hair(u, v):
        angle, polar = 2.0 * math.pi * u, math.pi * (0.002 + 0.996 * v)
        wave = 1.0 + 0.05 * math.sin(11.0 * angle + 6.0 * polar) * math.sin(polar)
        return (0.05 + 0.118 * wave * math.sin(polar) * math.sin(angle), 1.9 - 0.115 * wave * math.cos(polar),
                -0.02 + 0.125 * wave * math.sin(polar) * math.cos(angle))

    return merge([ellipsoid((0.05, 1.86, 0.015), (0.1, 0.135, 0.115), columns=40, rows=24),
                  traced_sheet(hair, columns=66, rows=24, closed=True),
                  ellipsoid((0.05, 1.97, -0.13), (0.06, 0.06, 0.06), columns=28, rows=16)])


def build(alpha: float = FIGURE_ALPHA) -> GltfBuilder:
    builder = GltfBuilder()
    bronze = builder.add_material("figure", (0.98, 0.74, 0.5), metallic=1.0, roughness=math.sqrt(alpha))
    grey = builder.add_material("background", (0.6, 0.6, 0.6), metallic=0.0, roughness=math.sqrt(BACKGROUND_ALPHA))
    glow = builder.add_material("panel", (0.0, 0.0, 0.0), metallic=0.0, roughness=1.0, specular=0.0,
                                emission=(0.85, 0.93, 1.0), emission_strength=0.06)
    # It ends before the lamp: right behind that, a bright spot out of sight would light all the rest.
    wall = quad((-2.7, -0.01, WALL), (8.7, 0.0, 0.0), (0.0, 7.0, 0.0))
    builder.add_node("floor", mesh=builder.add_mesh("floor", floor(6.0), grey))
    builder.add_node("wall", mesh=builder.add_mesh("wall", wall, grey))
    builder.add_node("figure", mesh=builder.add_mesh("figure", merge([figure(), head(), arm(1.0), arm(-1.0)]), bronze))
    panel = builder.add_mesh("panel", quad((-4.0, 6.0, -0.8), (8.0, 0.0, 0.0), (0.0, 0.0, 8.0)), glow)
    builder.add_node("panel", mesh=panel)
    # Beside the figure and near the wall, which it only grazes: the figure's light meets the wall head-on.
    builder.add_light("lamp", "point", 130.0, position=(-4.6, 1.7, -0.3))
    builder.add_perspective_camera("camera", (0.25, 1.5, 5.0), (-0.3, 0.98, -0.4), math.radians(27.0), 4.0 / 3.0)
    return builder


if __name__ == "__main__":
    sys.exit(run(__file__, __doc__, build, FIGURE_ALPHA))
