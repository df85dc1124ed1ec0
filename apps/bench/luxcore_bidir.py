#!/usr/bin/env python3
"""Bidirectional throughput beside LuxCore's BIDIRCPU, on a closed box of Lambert walls with a lamp.

Usage: luxcore_bidir.py --render PATH_TO_RENDER --python-with-luxcore PYTHON [--size 320x320] [--seconds 8]
                        [--max-depth 6] [--runs 3]

Prints million pairs of a camera and a light sub-path per second of `render -i bdpt` and of LuxCore (PyPI `pyluxcore`),
which take turns; medians count. Only rendering is timed. Both render for the same time with all processors.

What is alike: geometry, reflectances, lamp, camera, resolution, the Lambert model. What is not: LuxCore limits either
sub-path to --max-depth vertices, so that its connected paths may be twice as long, where ours limits whole paths; its
Russian roulette starts at depth 3 by default, ours after 4 scatterings; the pixel filter is left out in both.

LuxCore has to be started with its own tbbmalloc proxy preloaded, or it aborts: this script does so.
"""

from __future__ import annotations

import argparse
import glob
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time

BENCH_FOLDER = os.path.dirname(os.path.abspath(__file__))
SCENES_FOLDER = os.path.normpath(os.path.join(BENCH_FOLDER, "..", "..", "scenes"))

# Name, corner, two edges (front side: their cross product), reflectance.
WALLS = [
    ("floor", (-1, 0, 1), (2, 0, 0), (0, 0, -2), (0.73, 0.73, 0.73)),
    ("ceiling", (-1, 2, -1), (2, 0, 0), (0, 0, 2), (0.73, 0.73, 0.73)),
    ("back", (-1, 0, -1), (2, 0, 0), (0, 2, 0), (0.73, 0.73, 0.73)),
    ("left", (-1, 0, 1), (0, 0, -2), (0, 2, 0), (0.63, 0.06, 0.05)),
    ("right", (1, 0, -1), (0, 0, 2), (0, 2, 0), (0.15, 0.48, 0.09)),
    ("table", (-0.5, 0.6, 0.4), (0.9, 0, 0), (0, 0, -0.9), (0.5, 0.5, 0.5)),
]
LAMP = ("lamp", (-0.3, 1.995, -0.3), (0.6, 0, 0), (0, 0, 0.6))
LAMP_RADIANCE = 18.0
EYE, TARGET, FIELD_OF_VIEW = (0.0, 1.0, 4.9), (0.0, 1.0, 0.0), 30.0


def corners(corner, u, v):
    return [tuple(c + a * x + b * y for c, x, y in zip(corner, u, v)) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]


def write_gltf(path: str) -> None:
    sys.path.insert(0, SCENES_FOLDER)
    from gltf_writer import GltfBuilder
    from shapes import quad
    builder = GltfBuilder()
    for name, corner, u, v, color in WALLS:
        material = builder.add_material(name, color, specular=0.0)
        builder.add_node(name, mesh=builder.add_mesh(name, quad(corner, u, v), material))
    material = builder.add_material("lamp", (0.0, 0.0, 0.0), specular=0.0, emission=(1.0, 1.0, 1.0),
                                    emission_strength=LAMP_RADIANCE)
    builder.add_node("lamp", mesh=builder.add_mesh("lamp", quad(*LAMP[1:]), material))
    builder.add_perspective_camera("camera", EYE, TARGET, math.radians(FIELD_OF_VIEW), 1.0)
    builder.write(path)


def run_ours(options) -> float:
    with tempfile.TemporaryDirectory() as folder:
        scene, stats = os.path.join(folder, "box.glb"), os.path.join(folder, "stats.json")
        write_gltf(scene)
        subprocess.run([options.render, "-i", "bdpt", "--size", "%dx%d" % options.size, "--time", str(options.seconds),
                        "--max-depth", str(options.max_depth), "-q", "--stats", stats, "-o",
                        os.path.join(folder, "box.exr"), scene], check=True)
        with open(stats, encoding="utf-8") as file:
            numbers = json.load(file)
        return numbers["camera_samples"] / numbers["seconds"]["render"]


def serve_luxcore(options) -> int:
    """Runs in the interpreter that has pyluxcore; prints pairs of sub-paths per second."""
    import pyluxcore
    pyluxcore.Init()
    scene = pyluxcore.Scene()

    def parse(text, target):
        properties = pyluxcore.Properties()
        properties.SetFromString(text)
        target.Parse(properties)

    def vector(values):
        return " ".join(str(value) for value in values)

    parse("scene.camera.type = perspective\nscene.camera.lookat.orig = %s\nscene.camera.lookat.target = %s\n"
          "scene.camera.up = 0 1 0\nscene.camera.fieldofview = %g\n" % (vector(EYE), vector(TARGET), FIELD_OF_VIEW), scene)
    for name, corner, u, v, color in WALLS + [LAMP + ((0, 0, 0),)]:
        scene.DefineMesh(name + "_mesh", corners(corner, u, v), [(0, 1, 2), (0, 2, 3)], None, None, None, None)
        text = "scene.materials.%s.type = matte\nscene.materials.%s.kd = %s\n" % (name, name, vector(color))
        if name == "lamp":
            text += "scene.materials.lamp.emission = %s\n" % vector([LAMP_RADIANCE] * 3)
        parse(text + "scene.objects.%s.shape = %s_mesh\nscene.objects.%s.material = %s\n" % (name, name, name, name), scene)
    properties = pyluxcore.Properties()
    properties.SetFromString(
        "renderengine.type = BIDIRCPU\nsampler.type = SOBOL\nfilm.width = %d\nfilm.height = %d\nfilm.filter.type = NONE\n"
        "light.maxdepth = %d\npath.maxdepth = %d\nnative.threads.count = %d\n"
        % (*options.size, options.max_depth, options.max_depth, os.cpu_count()))
    session = pyluxcore.RenderSession(pyluxcore.RenderConfig(properties, scene))
    session.Start()
    time.sleep(1.0)  # Let all threads run.
    session.UpdateStats()
    name = "stats.renderengine.total.samplecount"
    begin, samples = time.perf_counter(), session.GetStats().Get(name).GetFloat()
    time.sleep(options.seconds)
    session.UpdateStats()
    rate = (session.GetStats().Get(name).GetFloat() - samples) / (time.perf_counter() - begin)
    session.Stop()
    print("rate %.6g" % rate, flush=True)
    os._exit(0)  # Without the library's own shutdown, which may hang.


def run_luxcore(options) -> float:
    environment = dict(os.environ)
    library = subprocess.run([options.python_with_luxcore, "-c", "import importlib.util as u; "
                              "print(u.find_spec('pyluxcore').submodule_search_locations[0])"],
                             check=True, capture_output=True, text=True).stdout.strip()
    proxies = glob.glob(os.path.join(os.path.dirname(library), "pyluxcore.libs", "libtbbmalloc_proxy*"))
    if proxies:
        environment["LD_PRELOAD"] = proxies[0]
    result = subprocess.run([options.python_with_luxcore, os.path.abspath(__file__), "--serve", "--size",
                             "%dx%d" % options.size, "--seconds", str(options.seconds), "--max-depth",
                             str(options.max_depth)], env=environment, capture_output=True, text=True, timeout=600)
    rates = [line for line in result.stdout.splitlines() if line.startswith("rate ")]
    if not rates:
        raise SystemExit("luxcore_bidir.py: LuxCore failed:\n" + result.stdout + result.stderr)
    return float(rates[0].split()[1])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--render")
    parser.add_argument("--python-with-luxcore")
    parser.add_argument("--size", type=lambda text: tuple(int(n) for n in text.split("x")), default=(320, 320))
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--max-depth", type=int, default=6)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        return serve_luxcore(options)
    if not options.render or not options.python_with_luxcore:
        parser.error("--render and --python-with-luxcore are needed")
    rates = {"render -i bdpt": [], "LuxCore BIDIRCPU": []}
    for _ in range(options.runs):
        rates["render -i bdpt"].append(run_ours(options))
        rates["LuxCore BIDIRCPU"].append(run_luxcore(options))
    for name, values in rates.items():
        print("%-18s %.3f million pairs of sub-paths/s (%.3f to %.3f)"
              % (name, statistics.median(values) / 1e6, min(values) / 1e6, max(values) / 1e6))
    return 0


if __name__ == "__main__":
    sys.exit(main())
