#!/usr/bin/env python3
"""Draws the specular paths that the path-cut search finds on the Ring scene: docs/pathcut_ring.png.

Usage: draw_paths.py --bin FOLDER [--output FILE.png] [--work FOLDER] [--seconds 240] [--receivers 6000] [--keep]

FOLDER holds the executables `render` and `pathcut_paths`. Needs numpy and matplotlib, for instance

    python3 -m venv build/paths/venv && build/paths/venv/bin/pip install numpy matplotlib
    build/paths/venv/bin/python apps/bench/draw_paths.py --bin build/release/bin

All panels look straight down, with the lamp to the left. Left: the floor as `render -i path` sees it. Middle: how many
exact visible paths of one reflection each receiver has. Right: some of these paths, from the lamp over the ring to the
floor. The dashed curve is what neither knows of: the caustic of a cylinder by the mirror equation (Coddington), where
its light reaches the floor from the ring's straight wall.

Counts include the paths over the ring's round edges: nearly all of the inside sees one in the far edge (or the wall
below it), and beyond the shadow a grazing one in the near edge. The latter start some way behind the shadow's border,
for the edge has only five facets, and the flattest directions are below the facets' own horizons.

Also checks all exact paths against the shape of the ring, and prints the largest deviations. --keep: use the picture
and the paths of an earlier run, if they are in the work folder.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from PIL import Image  # Comes with matplotlib.

BENCH_FOLDER = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.normpath(os.path.join(BENCH_FOLDER, "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "scenes"))
import ring  # noqa: E402

# As scenes/ring.py has them, metres.
LAMP = np.array([-2.2, 2.35, 2.8])
INNER, OUTER, TOP, BOTTOM, BEVEL = 1.0, 1.09, 0.502, 0.002, 0.04

HALF_WIDTH = 1.2  # Of what the camera sees.
PIXELS = 300
CAMERA = "top"
COLOURS = ["#3b4cc0", "#37a8c9", "#6cc24a", "#f2c230", "#e4572e"]  # 0, 1, 2, 3, 4 or more paths.
PATHS_SHOWN = 12


# ---- coordinates: x away from the lamp, y to the left of that, seen from above

AWAY = -LAMP[[0, 2]] / np.linalg.norm(LAMP[[0, 2]])


def plan(points):
    """World space to the picture's plane."""
    points = np.asarray(points, dtype=float)
    x, z = points[..., 0], points[..., 2]
    return np.stack([x * AWAY[0] + z * AWAY[1], x * AWAY[1] - z * AWAY[0]], axis=-1)


# ---- what is drawn

def run(command, **options):
    try:
        return subprocess.run(command, check=True, **options)
    except (OSError, subprocess.CalledProcessError) as error:
        sys.exit(f"error: {command[0]}: {error}")


def write_scene(path):
    """The Ring scene with a camera above it."""
    builder = ring.build()
    up = (AWAY[1], 0.0, -AWAY[0])
    builder.add_orthographic_camera(CAMERA, (0.0, 10.0, 0.0), (0.0, 0.0, 0.0), HALF_WIDTH, HALF_WIDTH, up=up)
    builder.write(path)


def make_data(arguments):
    """The picture (rows from the top) and the receivers on the floor with their paths."""
    os.makedirs(arguments.work, exist_ok=True)
    scene, picture, paths = [os.path.join(arguments.work, name) for name in ("ring_top.glb", "ring_top.png",
                                                                             "ring_paths.json")]
    write_scene(scene)
    if not (arguments.keep and os.path.exists(paths)):
        with open(paths, "wb") as output:
            run([os.path.join(arguments.bin, "pathcut_paths"), scene, "--camera", CAMERA, "--size",
                 f"{PIXELS}x{PIXELS}", "--receivers", str(arguments.receivers)], stdout=output)
    if not (arguments.keep and os.path.exists(picture)):
        run([os.path.join(arguments.bin, "render"), "-q", "-i", "path", "--camera", CAMERA, "--size",
             f"{PIXELS}x{PIXELS}", "--time", str(arguments.seconds), "--spp", "1000000", "-o", picture, scene])
    with open(paths, encoding="utf-8") as file:
        receivers = json.load(file)["receivers"]
    # Others lie on the ring, or far away on the floor where the ring mirrors it.
    receivers = [r for r in receivers if r["object"] == "floor" and np.abs(plan(r["position"])).max() < HALF_WIDTH]
    return smoothed(plt.imread(picture)[..., :3]), receivers


def exact_paths(receiver):
    return [p for p in receiver["paths"] if p["exact"]]


# ---- checks

def from_core(points):
    """Radius and height from the middle of the ring's profile, and how far they are beyond its core.

    The profile is a rectangle with round corners: all that is closer than BEVEL to a smaller rectangle, the core.
    """
    offset = np.stack([np.hypot(points[..., 0], points[..., 2]) - 0.5 * (INNER + OUTER),
                       points[..., 1] - 0.5 * (TOP + BOTTOM)], axis=-1)
    return offset, np.abs(offset) - (np.array([0.5 * (OUTER - INNER), 0.5 * (TOP - BOTTOM)]) - BEVEL)


def ring_normal(point):
    """Unit normal of the exact ring at the point of its surface that is nearest."""
    offset, beyond = from_core(point)
    direction = np.maximum(beyond, 0.0) * np.sign(offset)
    normal = np.array([direction[0] * point[0], 0.0, direction[0] * point[2]]) / math.hypot(point[0], point[2])
    normal[1] = direction[1]
    return unit(normal)


def depth_in_ring(start, end):
    """How deep a segment runs in the ring, metres; zero where it only touches."""
    _, beyond = from_core(start + np.linspace(0.0, 1.0, 2000)[:, None] * (end - start))
    distance = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1) + np.minimum(beyond.max(axis=-1), 0.0) - BEVEL
    return max(0.0, -distance.min())


def unit(v):
    return v / np.linalg.norm(v)


def check(receivers):
    """Equal angles at the ring, and nothing through it.

    The straight walls' normals are exact. In the round corners triangles lie up to BEVEL (1 - cos 9 degrees) = 0.49 mm
    inside, and 0.03 mm more for the ring's 432 columns; normals between their vertices are not quite the corner's.
    """
    angles, on_wall, depths = [], [], []
    for receiver in receivers:
        floor = np.array(receiver["position"])
        for path in exact_paths(receiver):
            vertex = np.array(path["vertices"][0])
            half = unit(unit(LAMP - vertex) + unit(floor - vertex))
            normal = ring_normal(vertex)
            angles.append(math.degrees(math.atan2(np.linalg.norm(np.cross(half, normal)), half @ normal)))
            on_wall.append(BOTTOM + BEVEL < vertex[1] < TOP - BEVEL)
            depths.append(max(depth_in_ring(floor, vertex), depth_in_ring(vertex, LAMP)))
    angles, on_wall = np.array(angles), np.array(on_wall)
    print(f"{len(angles)} exact paths of {len(receivers)} receivers")
    print(f"half vector and the ring's normal: at most {angles[on_wall].max():.5f} degrees apart on the straight "
          f"walls, {angles[~on_wall].max():.5f} in the round corners")
    print(f"deepest in the ring: {1e3 * max(depths):.3f} mm")


def mirror_equation_caustic():
    """Where a cylinder's reflection of the lamp focuses, in plan; NaN where the straight wall sends nothing there.

    The cylinder is vertical, so the paths' plan is that of a flat mirror curve, whatever their slope.
    """
    phi = np.linspace(-math.pi, math.pi, 20001)
    wall = INNER * np.stack([np.cos(phi), np.sin(phi)], axis=-1)
    lamp = plan(LAMP)
    incident = wall - lamp
    distance = np.linalg.norm(incident, axis=-1)
    incident /= distance[:, None]
    normal = -wall / INNER
    cosine = -(incident * normal).sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        image = 1.0 / (2.0 / (INNER * cosine) - 1.0 / distance)
        height = LAMP[1] * image / (distance + image)
    curve = wall + image[:, None] * (incident + 2.0 * cosine[:, None] * normal)
    used = (cosine > 0.0) & (image > 0.0) & (height > BOTTOM + BEVEL) & (height < TOP - BEVEL)
    # The way in passes over the near wall.
    near = np.array([first_crossing(lamp, w) for w in wall])
    used &= LAMP[1] + near * (height - LAMP[1]) > TOP
    curve[~used] = np.nan
    return curve


def first_crossing(lamp, wall):
    """Part of the way from the lamp to a point of the inner circle at which the plan leaves the near wall."""
    way = wall - lamp
    a, b, c = way @ way, lamp @ way, lamp @ lamp - INNER * INNER
    return (-b - math.sqrt(max(b * b - a * c, 0.0))) / a


# ---- drawing

def smoothed(picture):
    """A slight blur (one pixel): the path tracer finds the caustic by chance, and single dots distract."""
    for axis in (0, 1):
        padded = np.pad(picture, [(1, 1) if a == axis else (0, 0) for a in range(3)], mode="edge")
        before, after = [np.take(padded, range(k, k + picture.shape[axis]), axis=axis) for k in (0, 2)]
        picture = 0.25 * before + 0.5 * picture + 0.25 * after
    return picture


def draw_picture(axes, picture, brightness=1.0):
    axes.imshow(np.clip(picture * brightness, 0.0, 1.0), extent=[-HALF_WIDTH, HALF_WIDTH, -HALF_WIDTH, HALF_WIDTH],
                interpolation="bilinear")


def draw_caustic(axes, **style):
    curve = mirror_equation_caustic()
    axes.plot(curve[:, 0], curve[:, 1], **style)


def draw_ring(axes):
    for radius in (INNER, OUTER):
        axes.add_patch(plt.Circle((0.0, 0.0), radius, fill=False, color="#d9b25c", linewidth=0.8))


def draw_counts(axes, receivers):
    positions = plan([r["position"] for r in receivers])
    counts = np.array([min(len(exact_paths(r)), len(COLOURS) - 1) for r in receivers])
    for count, colour in enumerate(COLOURS):
        chosen = counts == count
        label = f"{count}" if count + 1 < len(COLOURS) else f"{count} or more"
        axes.scatter(*positions[chosen].T, s=3.5, color=colour, linewidths=0, label=label)
    legend = axes.legend(loc="lower left", fontsize=7, markerscale=3, title="paths", title_fontsize=7, framealpha=0.85,
                         borderpad=0.3, labelspacing=0.25, handletextpad=0.1)
    legend.set_zorder(10)


def spread_out(receivers, wanted):
    """Receivers far from each other, each the farthest from all before it; those with many paths first."""
    candidates = [r for r in receivers if exact_paths(r) and np.linalg.norm(plan(r["position"])) < 0.93 * INNER]
    chosen = []
    for minimum, share in ((4, 0.4), (2, 0.75), (1, 1.0)):
        some = [r for r in candidates if len(exact_paths(r)) >= minimum]
        while some and len(chosen) < round(share * wanted):
            others = plan([r["position"] for r in chosen]) if chosen else np.zeros((1, 2))
            positions = plan([r["position"] for r in some])
            distances = np.linalg.norm(positions[:, None] - others[None], axis=-1).min(axis=-1)
            chosen.append(some[int(distances.argmax())])
    return chosen


def draw_paths(axes, receivers):
    palette = plt.get_cmap("tab20").colors[::2] + plt.get_cmap("tab20").colors[1::2]
    lamp = plan(LAMP)
    for receiver, colour in zip(spread_out(receivers, PATHS_SHOWN), palette):
        floor = plan(receiver["position"])
        for path in exact_paths(receiver):
            vertex = plan(path["vertices"][0])
            axes.plot(*np.stack([lamp, vertex]).T, color=colour, linewidth=0.4, alpha=0.8)
            axes.plot(*np.stack([vertex, floor]).T, color=colour, linewidth=0.95)
        axes.plot(*floor, "o", color=colour, markersize=4.2, markeredgecolor="white", markeredgewidth=0.6)
    axes.plot(*lamp, "o", color="#ffd84a", markersize=8, markeredgecolor="black", markeredgewidth=0.8)
    axes.annotate(f"lamp, {LAMP[1]:.2f} m\nabove the floor", lamp, xytext=(2, -26), textcoords="offset points",
                  fontsize=7, ha="left", color="#333333")


def draw(picture, receivers, path):
    left = plan(LAMP)[0] - 0.15
    widths = [2.0 * HALF_WIDTH, 2.0 * HALF_WIDTH, HALF_WIDTH - left]
    figure, panels = plt.subplots(1, 3, figsize=(12.0, 3.35), dpi=150, width_ratios=widths)
    figure.subplots_adjust(left=0.006, right=0.994, top=0.915, bottom=0.01, wspace=0.025)
    draw_picture(panels[0], picture)
    # Grey, so that the colours stand out.
    grey = picture.mean(axis=-1, keepdims=True).repeat(3, axis=-1)
    draw_picture(panels[1], grey, 0.5)
    draw_picture(panels[2], grey, 0.6)
    draw_counts(panels[1], receivers)
    draw_paths(panels[2], receivers)
    for axes in panels[1:]:
        draw_ring(axes)
    draw_caustic(panels[1], color="black", linewidth=1.1, linestyle=(0, (4, 2)))
    draw_caustic(panels[2], color="white", linewidth=0.9, linestyle=(0, (4, 2)))
    titles = ["The floor from above, path traced", "Exact visible paths of one reflection, per receiver",
              "Some of these paths, from the lamp over the ring to the floor; dashed: caustic by the mirror equation"]
    for axes, title in zip(panels, titles):
        axes.set_title(title, fontsize=8, pad=4)
        axes.set(xlim=(-HALF_WIDTH, HALF_WIDTH), ylim=(-HALF_WIDTH, HALF_WIDTH), xticks=[], yticks=[])
        axes.set_aspect("equal")
    panels[2].set_xlim(left, HALF_WIDTH)
    figure.canvas.draw()
    # The lowest three bits are noise of the path tracer, and most of the file.
    rgb = np.asarray(figure.canvas.buffer_rgba())[..., :3]
    rounded = np.minimum((rgb.astype(int) + 4) // 8 * 8, 255).astype(np.uint8)
    Image.fromarray(rounded).save(path, optimize=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", required=True)
    parser.add_argument("--output", default=os.path.join(ROOT, "docs", "pathcut_ring.png"))
    parser.add_argument("--work", default=os.path.join(ROOT, "build", "paths"))
    parser.add_argument("--seconds", type=float, default=240.0)
    parser.add_argument("--receivers", type=int, default=6000)
    parser.add_argument("--keep", action="store_true")
    arguments = parser.parse_args()
    picture, receivers = make_data(arguments)
    check(receivers)
    draw(picture, receivers, arguments.output)
    print(arguments.output)


if __name__ == "__main__":
    main()
