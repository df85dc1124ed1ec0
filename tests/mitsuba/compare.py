#!/usr/bin/env python3
"""Compares the path tracer with Mitsuba 3 on small scenes that cover every feature (scenes.py).

Usage: compare.py --render PATH_TO_RENDER --work FOLDER [--only NAME ...] [--jobs 2] [--list]

Both render each scene with several seeds; the spread over seeds is the measure of noise. A scene passes where
 - the mean energies differ by less than 3 standard errors and less than 1 %, and
 - no block of pixels differs significantly in any channel (Welch's t-test, Sidak correction over blocks and channels).
A scene that fails is rendered again with other and more seeds, and only a second failure counts.
Prints one line per scene, writes FOLDER/NAME.png (ours, Mitsuba's, difference in standard errors) to look at, and
returns 1 on failure. Mitsuba's pictures are kept in FOLDER/cache, under a name that depends on all that made them.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import hashlib
import math
import multiprocessing
import os
import subprocess
import sys
import time
from dataclasses import dataclass, field

import numpy

import scenes
from gltf_writer import encode_png
from statistics_tests import mean_and_variance, sidak_threshold, welch

WIDTH, HEIGHT = 40, 30
BLOCK = 5  # pixels
SEEDS = 16
SIGNIFICANCE = 0.001  # of a whole scene
MAX_STANDARD_ERRORS = 3.0
MAX_RELATIVE_DIFFERENCE = 0.01
# Allowed systematic difference, relative: resampled environments, single precision.
TOLERANCE = 1e-3
CHANNELS = "RGB"


class CompareError(Exception):
    """A failure to report in one line."""


@dataclass
class Outcome:
    """What the comparison of one scene found; `failures` is empty where the two agree."""

    name: str
    line: str = ""
    failures: list[str] = field(default_factory=list)


@dataclass
class Job:
    scene_name: str
    render: str
    work: str


# ---- rendering

def our_pictures(job: Job, scene: scenes.ComparisonScene, seeds) -> numpy.ndarray:
    """One picture per seed: [seed, row, column, channel]."""
    pictures = []
    output = os.path.join(job.work, f"{scene.name}.exr")
    for seed in seeds:
        command = [job.render, "-i", "path", "--spp", str(scene.our_spp), "--seed", str(seed),
                   "--size", f"{WIDTH}x{HEIGHT}", "--max-depth", str(scene.max_depth), "--threads", "1",
                   "--set", "sampler=independent", "-q", "-o", output]
        if scene.environment:
            command += ["--env", os.path.join(job.work, scenes.ENVIRONMENT)]
        result = subprocess.run(command + [scene_file(job, scene)], capture_output=True, text=True)
        if result.returncode != 0:
            lines = [line for line in result.stderr.splitlines() if line] or ["no message"]
            raise CompareError(f"render returned {result.returncode}: {lines[-1]}")
        pictures.append(read_exr(output))
    return numpy.array(pictures)


def read_exr(path: str) -> numpy.ndarray:
    import mitsuba as mi
    bitmap = mi.Bitmap(path)
    names = [channel.name for channel in bitmap.struct_()]
    values = numpy.array(bitmap, dtype=float)
    if values.shape[:2] != (HEIGHT, WIDTH) or any(name not in names for name in CHANNELS):
        raise CompareError(f"{path}: {values.shape[1]}x{values.shape[0]} with channels {names}; expected "
                           f"{WIDTH}x{HEIGHT} with R, G, B")
    return values[:, :, [names.index(name) for name in CHANNELS]]


def mitsuba_pictures(job: Job, scene: scenes.ComparisonScene, seeds) -> numpy.ndarray:
    """The same from Mitsuba, or from the cache."""
    cached = os.path.join(job.work, "cache", f"{scene.name}-{cache_key(job, scene, seeds)}.npy")
    if os.path.exists(cached):
        return numpy.load(cached)
    import drjit
    import mitsuba as mi
    import convert
    environment = os.path.join(job.work, scenes.ENVIRONMENT) if scene.environment else None
    loaded = convert.load_scene(scene_file(job, scene), WIDTH, HEIGHT, "exact", environment)
    integrator = convert.path_integrator(scene.max_depth)
    # Python BSDFs hold the interpreter's lock: more threads would only fight for it. Not so when reading files, which
    # with one thread waits forever.
    threads = drjit.thread_count()
    drjit.set_thread_count(1)
    pictures = numpy.array([numpy.array(mi.render(loaded, integrator=integrator, spp=scene.mitsuba_spp, seed=seed))
                            for seed in seeds], dtype=float)
    drjit.set_thread_count(threads)
    temporary = f"{cached}.{os.getpid()}.tmp"
    with open(temporary, "wb") as file:
        numpy.save(file, pictures)
    os.replace(temporary, cached)
    return pictures


def cache_key(job: Job, scene: scenes.ComparisonScene, seeds) -> str:
    """Depends on everything that Mitsuba's pictures depend on."""
    import mitsuba as mi
    digest = hashlib.sha256(repr((mi.__version__, WIDTH, HEIGHT, scene.max_depth, scene.mitsuba_spp,
                                  list(seeds))).encode())
    folder = os.path.dirname(os.path.abspath(__file__))
    files = [os.path.join(folder, name) for name in ["convert.py", "glb.py", "gltf_bsdf.py", "gltf_spot.py"]]
    files.append(scene_file(job, scene))
    if scene.environment:
        files.append(os.path.join(job.work, scenes.ENVIRONMENT))
    for name in files:
        with open(name, "rb") as file:
            digest.update(hashlib.sha256(file.read()).digest())
    return digest.hexdigest()[:16]


def scene_file(job: Job, scene: scenes.ComparisonScene) -> str:
    return os.path.join(job.work, f"{scene.name}.glb")


# ---- comparison

def block_means(pictures: numpy.ndarray) -> numpy.ndarray:
    """[seed, block row, block column, channel]"""
    seeds, height, width, channels = pictures.shape
    return pictures.reshape(seeds, height // BLOCK, BLOCK, width // BLOCK, BLOCK, channels).mean((2, 4))


def compare_energy(ours: numpy.ndarray, theirs: numpy.ndarray, failures: list[str]) -> str:
    first, second = ours.mean((1, 2, 3)), theirs.mean((1, 2, 3))
    reference = mean_and_variance(second)[0]
    difference, error, _ = welch(first, second, TOLERANCE * abs(reference))
    relative = difference / reference if reference else math.inf
    errors = difference / error if error else math.inf
    text = f"energy {relative:+.3%} ({errors:+.2f} standard errors)"
    if not abs(errors) <= MAX_STANDARD_ERRORS or not abs(relative) <= MAX_RELATIVE_DIFFERENCE:
        failures.append(f"mean energy {first.mean():.6g}, Mitsuba's {second.mean():.6g}: {text}")
    return text


def compare_blocks(ours: numpy.ndarray, theirs: numpy.ndarray, failures: list[str]):
    """Text for the report, and the differences in standard errors [block row, block column, channel]."""
    first, second = block_means(ours), block_means(theirs)
    shape = first.shape[1:]
    z = numpy.zeros(shape)
    smallest = (1.0, None)
    significant = 0
    threshold = sidak_threshold(SIGNIFICANCE, int(numpy.prod(shape)))
    for index in numpy.ndindex(*shape):
        a, b = first[(slice(None), *index)], second[(slice(None), *index)]
        difference, error, p = welch(a, b, TOLERANCE * abs(float(b.mean())))
        z[index] = difference / error if error else 0.0 if difference == 0.0 else math.copysign(99.0, difference)
        significant += p < threshold
        if p < smallest[0]:
            smallest = (p, index)
    if significant:
        failures.append(f"{significant} of {z.size} block means differ; {block_report(first, second, z, *smallest)}")
    return f"worst block {z.flat[numpy.argmax(numpy.abs(z))]:+.2f} (p {smallest[0]:.1e}, limit {threshold:.1e})", z


def block_report(first, second, z, p: float, index) -> str:
    row, column, channel = index
    values = (slice(None), *index)
    got, expected = first[values].mean(), second[values].mean()
    relative = f"{(got / expected - 1.0):+.2%}" if expected else "more than nothing"
    return (f"worst: pixels x {column * BLOCK}..{(column + 1) * BLOCK - 1}, y {row * BLOCK}..{(row + 1) * BLOCK - 1}, "
            f"channel {CHANNELS[channel]}: {got:.6g}, Mitsuba's {expected:.6g} ({relative}, "
            f"{z[index]:+.1f} standard errors, p {p:.1e})")


def compare_scene(job: Job) -> Outcome:
    scene = next(s for s in scenes.SCENES if s.name == job.scene_name)
    outcome = Outcome(scene.name)
    start = time.monotonic()
    try:
        for attempt, seeds in enumerate([range(1, 1 + SEEDS), range(1001, 1001 + 2 * SEEDS)]):
            outcome.failures = []
            ours, theirs = our_pictures(job, scene, seeds), mitsuba_pictures(job, scene, seeds)
            if not numpy.all(numpy.isfinite(ours)):
                outcome.failures.append("our picture has values that are not finite")
                break
            energy = compare_energy(ours, theirs, outcome.failures)
            blocks, z = compare_blocks(ours, theirs, outcome.failures)
            write_side_by_side(os.path.join(job.work, f"{scene.name}.png"), ours.mean(0), theirs.mean(0), z)
            outcome.line = f"{energy}, {blocks}{', second attempt' if attempt else ''}"
            if not outcome.failures:
                break
    except CompareError as error:
        outcome.failures = [str(error)]
    outcome.line += f", {time.monotonic() - start:.1f} s"
    return outcome


# ---- pictures to look at

def write_side_by_side(path: str, ours: numpy.ndarray, theirs: numpy.ndarray, z: numpy.ndarray, zoom: int = 8) -> None:
    """Ours, Mitsuba's, and the blocks' differences: red where ours is brighter, blue where darker, full at 6."""
    bright = max(float(numpy.quantile(theirs, 0.98)), 1e-6)
    panels = [numpy.clip(picture / bright, 0.0, 1.0) for picture in (ours, theirs)]
    strongest = numpy.take_along_axis(z, numpy.abs(z).argmax(2)[..., None], 2)[..., 0]
    strongest = numpy.clip(strongest / 6.0, -1.0, 1.0).repeat(BLOCK, 0).repeat(BLOCK, 1)
    panels.append(numpy.stack([numpy.maximum(strongest, 0), numpy.zeros_like(strongest),
                               numpy.maximum(-strongest, 0)], -1))
    gap = numpy.ones((HEIGHT, 1, 3))
    image = numpy.concatenate([panels[0], gap, panels[1], gap, panels[2]], 1).repeat(zoom, 0).repeat(zoom, 1)
    encoded = numpy.where(image <= 0.0031308, 12.92 * image, 1.055 * image ** (1 / 2.4) - 0.055)
    pixels = (255.0 * encoded + 0.5).astype(numpy.uint8)
    with open(path, "wb") as file:
        file.write(encode_png(pixels.shape[1], pixels.shape[0], pixels.tobytes()))


# ---- running

def start_worker() -> None:
    """In each process."""
    import convert
    convert.set_up("scalar_rgb")


def prepare(work: str, chosen) -> None:
    import convert
    convert.set_up("scalar_rgb")
    os.makedirs(os.path.join(work, "cache"), exist_ok=True)
    scenes.write_environment(os.path.join(work, scenes.ENVIRONMENT))
    for scene in chosen:
        scene.build().write(os.path.join(work, f"{scene.name}.glb"))


def chosen_scenes(names) -> list[scenes.ComparisonScene]:
    known = {scene.name: scene for scene in scenes.SCENES}
    for name in names or []:
        if name not in known:
            raise CompareError(f"{name}: no such scene; there are {', '.join(known)}")
    return [known[name] for name in names] if names else scenes.SCENES


def main() -> int:
    parser = argparse.ArgumentParser(description="Compares the path tracer with Mitsuba 3.")
    parser.add_argument("--render", help="the render executable")
    parser.add_argument("--work", help="folder for scenes, pictures and the cache")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="these scenes only")
    parser.add_argument("--jobs", type=int, default=2, help="scenes at a time")
    parser.add_argument("--list", action="store_true", help="prints the scenes and what they cover")
    arguments = parser.parse_args()
    if arguments.list:
        for scene in scenes.SCENES:
            print(f"{scene.name:28s} {scene.what}")
        return 0
    if not arguments.render or not arguments.work:
        parser.error("--render and --work are needed")
    try:
        chosen = chosen_scenes(arguments.only)
        if not os.access(arguments.render, os.X_OK):
            raise CompareError(f"{arguments.render}: not an executable")
        prepare(arguments.work, chosen)
    except (CompareError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return run(arguments, chosen)


def run(arguments, chosen) -> int:
    jobs = [Job(scene.name, os.path.abspath(arguments.render), arguments.work) for scene in chosen]
    failed = 0
    # Spawned, not forked: a forked process would share the state of Mitsuba's threads.
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(arguments.jobs, context, start_worker) as pool:
        for outcome in pool.map(compare_scene, jobs):
            print(f"{'FAIL' if outcome.failures else 'ok  '} {outcome.name}: {outcome.line}", flush=True)
            for failure in outcome.failures:
                print(f"error: {outcome.name}: {failure}", file=sys.stderr, flush=True)
            failed += bool(outcome.failures)
    print(f"{len(chosen) - failed} of {len(chosen)} scenes agree with Mitsuba")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
