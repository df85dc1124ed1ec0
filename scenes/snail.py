#!/usr/bin/env python3
"""After Figure 1 of Li et al. 2022: a metal snail (alpha 0.01) on a floor (alpha 0.3), point light in front.

The shell grows along a logarithmic spiral, ribbed lengthwise and across; its grooves focus, its bulges spread. The
paper's dim environment is a dim panel of 10 x 10 m overhead: glTF scenes hold no environment here.
"""

import math
import sys

from generator import run
from gltf_writer import Geometry, GltfBuilder
from shapes import ellipsoid, floor, merge, quad, traced_sheet, tube

SHELL_ALPHA = 0.01
FLOOR_ALPHA = 0.3
TURNS = 3.6
GROWTH = math.log(2.1) / (2.0 * math.pi)  # the shell is 2.1 times as large after a turn
SHELL_RADIUS = 0.46  # of the last turn's middle line about the axis, metres
TUBE = 0.62  # the tube's radius over that
RISE = 0.62  # how far a turn stands out along the axis, over that: the apex is drawn out
AXIS_HEIGHT = 0.86


def shell() -> Geometry:
    """Around the Z axis, the apex towards +Z; the mouth is closed by a dome."""
    last = 2.0 * math.pi * TURNS

    def position(u, v):
        theta = last * v
        size = SHELL_RADIUS * math.exp(GROWTH * (theta - last))
        angle = 2.0 * math.pi * u
        # So shallow that the grooves between them are nearly flat and focus at the floor.
        ribs = 1.0 + 0.0145 * math.sin(9.0 * angle) + 0.0045 * math.sin(22.0 * theta)
        radius = TUBE * size * ribs
        out = size + radius * math.cos(angle)
        # Turned so that the mouth points down to the body.
        direction = theta - last - 0.62 * math.pi
        return (out * math.cos(direction), out * math.sin(direction),
                RISE * (SHELL_RADIUS - size) + radius * math.sin(angle))

    return traced_sheet(lambda u, v: position(-u, v), columns=44, rows=250, closed=True)


def body() -> Geometry:
    """The foot along X, the head raised towards -X, and two pairs of horns."""
    def spine(v):
        x = 0.95 - 2.05 * v
        raised = max(0.0, v - 0.62) / 0.38
        return (x, 0.115 + 0.44 * raised * raised * (3.0 - 2.0 * raised), 0.0)

    def radius(v, angle):
        ends = math.sqrt(max(1e-4, 1.0 - (2.0 * v - 1.0) ** 6))
        tail = min(1.0, 0.12 + 1.9 * v)
        return 0.165 * ends * tail * (1.0 - 0.18 * max(0.0, v - 0.7)) * (1.0 + 0.02 * math.sin(3.0 * angle + 60.0 * v))

    def horn(side, reach, height, width):
        start = (-1.02, 0.6, side * 0.05)
        end = (start[0] - reach, start[1] + height, start[2] + side * 0.13)

        def line(v):
            bend = 0.07 * math.sin(math.pi * v)
            return (start[0] + v * (end[0] - start[0]) - bend, start[1] + v * (end[1] - start[1]),
                    start[2] + v * (end[2] - start[2]))

        return [tube(line, lambda v, _: width * (1.0 - 0.5 * v), columns=10, rows=10),
                ellipsoid(end, (1.5 * width,) * 3, columns=16, rows=8)]

    parts = [tube(spine, radius, columns=36, rows=90)]
    for side in (-1.0, 1.0):
        parts += horn(side, 0.14, 0.32, 0.026) + horn(side, 0.17, 0.03, 0.018)
    return merge(parts)


def build(alpha: float = SHELL_ALPHA) -> GltfBuilder:
    builder = GltfBuilder()
    gold = builder.add_material("shell", (1.0, 0.78, 0.34), metallic=1.0, roughness=math.sqrt(alpha))
    silver = builder.add_material("body", (0.93, 0.92, 0.9), metallic=1.0, roughness=math.sqrt(alpha))
    grey = builder.add_material("floor", (0.6, 0.6, 0.62), metallic=0.0, roughness=math.sqrt(FLOOR_ALPHA))
    glow = builder.add_material("panel", (0.0, 0.0, 0.0), metallic=0.0, roughness=1.0, specular=0.0,
                                emission=(0.85, 0.93, 1.0), emission_strength=0.12)
    builder.add_node("floor", mesh=builder.add_mesh("floor", floor(8.0), grey))
    builder.add_node("shell", translation=(0.12, AXIS_HEIGHT, -0.12), mesh=builder.add_mesh("shell", shell(), gold))
    builder.add_node("body", mesh=builder.add_mesh("body", body(), silver))
    panel = builder.add_mesh("panel", quad((-5.0, 6.0, -5.0), (10.0, 0.0, 0.0), (0.0, 0.0, 10.0)), glow)
    builder.add_node("panel", mesh=panel)
    # Low: the shell sends its light down to a floor that the lamp itself only grazes.
    builder.add_light("lamp", "point", 170.0, position=(-2.7, 1.3, 4.9))
    builder.add_perspective_camera("camera", (-0.9, 2.3, 4.3), (-0.05, 0.42, 0.35), math.radians(33.0), 4.0 / 3.0)
    return builder


if __name__ == "__main__":
    sys.exit(run(__file__, __doc__, build, SHELL_ALPHA))
