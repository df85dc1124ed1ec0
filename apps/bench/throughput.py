#!/usr/bin/env python3
"""Path tracing throughput, side by side with Mitsuba 3.

Usage: throughput.py --render PATH_TO_RENDER [--python-with-mitsuba PYTHON] [--work FOLDER] [--output FILE.json]
                     [--size 640x480] [--spp 64] [--max-depth 12] [--runs 3] [--triangles 1000000]

Measures camera samples per second of `render -i path` and of Mitsuba's `path` (scalar_rgb, and llvm_ad_rgb where LLVM
is found) on scenes/ring.glb and on a scene of a million triangles. The renderers take turns, so that a change of the
machine's load meets all of them, and medians count. Only rendering is timed, not loading; LLVM's compilation happens
in a warm-up render before. Also reports our load time, BVH build time and peak memory on the large scene.

What is alike: scenes, resolution, samples per pixel, depth, all processors, independent samples for Mitsuba and each
one's default sampler otherwise. What is not: Russian roulette is each one's default (Mitsuba: from depth 5), and
Mitsuba's materials are its own nearest ones (rough conductor with the same alpha and F0; rough plastic for the floor,
which like ours is a diffuse base under a GGX coat).

Without --python-with-mitsuba, only our numbers. Python 3 alone; Mitsuba runs in the given interpreter.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time

BENCH_FOLDER = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.normpath(os.path.join(BENCH_FOLDER, "..", ".."))
MITSUBA_VARIANTS = ["scalar_rgb", "llvm_ad_rgb"]
MITSUBA_RR_DEPTH = 5
OURS = "render path"


class BenchError(Exception):
    """A failure to report in one line."""


# ---- the other interpreter: this script as Mitsuba's worker

def serve_mitsuba(arguments) -> int:
    """Loads a scene once, then renders it for every line on standard input and answers with a line of JSON.

    Answers carry the seconds of one render, from the call to the picture in memory.
    """
    sys.path.insert(0, os.path.join(ROOT, "tests", "mitsuba"))
    try:
        import mitsuba as mi
        mi.set_variant(arguments.variant)
        import convert
        import numpy
        start = time.perf_counter()
        scene = convert.load_scene(arguments.scene, *arguments.size, materials="builtin")
        load_seconds = time.perf_counter() - start
        integrator = convert.path_integrator(arguments.max_depth, MITSUBA_RR_DEPTH)
        if not arguments.variant.startswith("scalar"):
            numpy.array(mi.render(scene, integrator=integrator, spp=arguments.spp, seed=0))
    except Exception as error:  # whatever Mitsuba or LLVM does not like belongs in the report
        answer({"error": f"{type(error).__name__}: {str(error).strip().splitlines()[0]}"})
        return 0
    answer({"load_seconds": load_seconds, "version": mi.__version__})
    for seed, _ in enumerate(sys.stdin, start=1):
        start = time.perf_counter()
        # As an array: lazily evaluated variants have then really rendered.
        picture = numpy.array(mi.render(scene, integrator=integrator, spp=arguments.spp, seed=seed))
        answer({"seconds": time.perf_counter() - start, "mean": float(picture.mean())})
    return 0


def answer(value: dict) -> None:
    print("answer " + json.dumps(value), flush=True)


class MitsubaWorker:
    """A Mitsuba process that holds one scene in one variant."""

    def __init__(self, arguments, variant: str, scene: str) -> None:
        self.lazy = not variant.startswith("scalar")
        command = [arguments.python_with_mitsuba, "-B", os.path.abspath(__file__), "--serve-mitsuba", "--variant",
                   variant, "--scene", scene, "--size", "x".join(map(str, arguments.size)), "--spp",
                   str(arguments.spp), "--max-depth", str(arguments.max_depth)]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        stderr=subprocess.DEVNULL, text=True)
        self.ready = self.read()

    def read(self) -> dict:
        """The next answer; Mitsuba's own progress output is passed over."""
        for line in self.process.stdout:
            position = line.find("answer {")
            if position >= 0:
                return json.loads(line[position + len("answer "):])
        hint = "; an LLVM that is too old? DRJIT_LIBLLVM_PATH names another" if self.lazy else ""
        return {"error": f"the process ended with code {self.process.wait()}{hint}"}

    def render(self) -> dict:
        self.process.stdin.write("go\n")
        self.process.stdin.flush()
        return self.read()

    def close(self) -> None:
        self.process.stdin.close()
        self.process.wait()


# ---- ours

def render_ours(arguments, scene: str, seed: int) -> dict:
    """The statistics of one render."""
    with tempfile.TemporaryDirectory() as folder:
        statistics_file = os.path.join(folder, "statistics.json")
        command = [arguments.render, "-i", "path", "--spp", str(arguments.spp), "--seed", str(seed), "--size",
                   "x".join(map(str, arguments.size)), "--max-depth", str(arguments.max_depth), "--stats",
                   statistics_file, "-q", "-o", os.path.join(folder, "picture.exr"), scene]
        result = subprocess.run(command, capture_output=True, text=True)
        if result.returncode != 0:
            lines = [line for line in result.stderr.splitlines() if line] or ["no message"]
            raise BenchError(f"{arguments.render}: returned {result.returncode}: {lines[-1]}")
        with open(statistics_file) as file:
            return json.load(file)


# ---- measuring

def samples_of(arguments) -> int:
    return arguments.size[0] * arguments.size[1] * arguments.spp


def measure_scene(arguments, name: str, scene: str, notes: list[str]) -> dict:
    """Rates of every renderer in every run, taking turns."""
    workers = start_workers(arguments, scene, notes)
    rates: dict[str, list[float]] = {OURS: []}
    rates.update({variant: [] for variant in workers})
    ours = []
    try:
        render_ours(arguments, scene, 0)  # the first one reads the file from disk
        for run in range(1, arguments.runs + 1):
            ours.append(render_ours(arguments, scene, run))
            rates[OURS].append(ours[-1]["camera_samples"] / ours[-1]["seconds"]["render"])
            for variant, worker in workers.items():
                result = worker.render()
                if "error" in result:
                    raise BenchError(f"Mitsuba {variant} on {name}: {result['error']}")
                rates[variant].append(samples_of(arguments) / result["seconds"])
    finally:
        for worker in workers.values():
            worker.close()
    return {"scene": name, "samples_per_second": rates, "medians": medians(rates), "ours": summary(ours),
            "mitsuba_load_seconds": {variant: worker.ready["load_seconds"] for variant, worker in workers.items()}}


def start_workers(arguments, scene: str, notes: list[str]) -> dict[str, MitsubaWorker]:
    workers = {}
    for variant in MITSUBA_VARIANTS if arguments.python_with_mitsuba else []:
        worker = MitsubaWorker(arguments, variant, scene)
        if "error" in worker.ready:
            notes.append(f"Mitsuba {variant} left out: {worker.ready['error']}")
            worker.close()
        else:
            workers[variant] = worker
    return workers


def medians(rates: dict[str, list[float]]) -> dict[str, float]:
    return {name: statistics.median(values) for name, values in rates.items()}


def summary(runs: list[dict]) -> dict:
    """Medians of what our statistics say."""
    def of(key: str) -> float:
        return statistics.median(run["seconds"][key] for run in runs)

    return {"seconds_load": of("load"), "seconds_build": of("build"), "seconds_render": of("render"),
            "seconds_total": of("total"), "threads": runs[0]["threads"],
            "peak_rss_bytes": max(run["peak_rss_bytes"] for run in runs),
            "rays_per_second": statistics.median(run["rays"] / run["seconds"]["render"] for run in runs)}


def large_scene(arguments) -> str:
    """The large scene's file, made if it is not there yet."""
    path = os.path.join(arguments.work, f"big_mesh_{arguments.triangles}.glb")
    if not os.path.exists(path):
        command = [sys.executable, "-B", os.path.join(ROOT, "scenes", "big_mesh.py"), path, "--triangles",
                   str(arguments.triangles)]
        if subprocess.run(command, stdout=subprocess.DEVNULL).returncode != 0:
            raise BenchError(f"{path}: could not be made")
    return path


# ---- report

def print_report(arguments, results: list[dict], notes: list[str]) -> None:
    width, height = arguments.size
    print(f"{width}x{height}, {arguments.spp} spp, at most {arguments.max_depth} scatterings (Mitsuba's max_depth "
          f"{arguments.max_depth + 1}), medians of {arguments.runs} runs in turns, {results[0]['ours']['threads']} "
          "threads")
    print(f"Russian roulette: each one's default (Mitsuba: rr_depth {MITSUBA_RR_DEPTH}). Mitsuba's materials: "
          "roughconductor (metal), roughplastic (floor).\n")
    print(f"{'scene':24s} {'renderer':14s} {'samples/s':>12s} {'lowest':>12s} {'highest':>12s} {'ours is':>9s}")
    for result in results:
        for name, rates in result["samples_per_second"].items():
            median = result["medians"][name]
            factor = "" if name == OURS else f"{result['medians'][OURS] / median:8.2f}x"
            print(f"{result['scene']:24s} {name:14s} {median:12,.0f} {min(rates):12,.0f} {max(rates):12,.0f} "
                  f"{factor:>9s}")
    large = results[-1]["ours"]
    print(f"\n{results[-1]['scene']}: load {large['seconds_load']:.3f} s, build {large['seconds_build']:.3f} s, "
          f"peak memory {large['peak_rss_bytes'] / 2**20:.0f} MiB, {large['rays_per_second'] / 1e6:.2f} M rays/s")
    for note in dict.fromkeys(notes):
        print(f"note: {note}")


def parse_size(text: str) -> tuple[int, int]:
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text}: not WIDTHxHEIGHT") from None
    if width < 1 or height < 1:
        raise argparse.ArgumentTypeError(f"{text}: must be positive")
    return width, height


def parse_arguments():
    parser = argparse.ArgumentParser(description="Path tracing throughput, side by side with Mitsuba 3.")
    parser.add_argument("--render", help="the render executable")
    parser.add_argument("--python-with-mitsuba", metavar="PYTHON", help="an interpreter that has Mitsuba 3 and NumPy")
    parser.add_argument("--work", default=os.path.join(ROOT, "build", "bench"), help="folder for the large scene")
    parser.add_argument("--output", help="JSON file for the results")
    parser.add_argument("--size", type=parse_size, default=(640, 480))
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--max-depth", type=int, default=12)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--triangles", type=int, default=1000000)
    parser.add_argument("--serve-mitsuba", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--variant", help=argparse.SUPPRESS)
    parser.add_argument("--scene", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if not arguments.serve_mitsuba and not arguments.render:
        parser.error("--render is needed")
    return arguments


def main() -> int:
    arguments = parse_arguments()
    if arguments.serve_mitsuba:
        return serve_mitsuba(arguments)
    notes: list[str] = []
    try:
        os.makedirs(arguments.work, exist_ok=True)
        scenes = {"ring.glb": os.path.join(ROOT, "scenes", "ring.glb")}
        scenes[f"{arguments.triangles} triangles"] = large_scene(arguments)
        results = [measure_scene(arguments, name, path, notes) for name, path in scenes.items()]
    except (BenchError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    if not arguments.python_with_mitsuba:
        notes.append("Mitsuba left out: no --python-with-mitsuba")
    print_report(arguments, results, notes)
    if arguments.output:
        with open(arguments.output, "w") as file:
            json.dump({"size": arguments.size, "spp": arguments.spp, "max_depth": arguments.max_depth,
                       "mitsuba_rr_depth": MITSUBA_RR_DEPTH, "results": results, "notes": notes}, file, indent=2)
            file.write("\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
