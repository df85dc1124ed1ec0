#!/usr/bin/env python3
"""Makes the benchmark's reference pictures: two integrators, many seeds, compared by blocks, and combined.

Usage: make_references.py [--scenes all] [--time 3600] [--integrators guided,bdpt:emission=casters] [--chunks 8]

Each integrator renders each scene for --time seconds, in --chunks runs of other seeds, which take turns. Where the
means of blocks of 16x16 pixels differ significantly (Welch's t-test over the runs, Sidak correction over blocks and
channels, 0.1 % for a whole scene), the two disagree: exit code 1, and the picture stays in the work folder. Otherwise
the mean of both, weighted by their precision over the whole picture, goes to scenes/references as
SCENE.WIDTHxHEIGHT.exr (16-bit floats), with a .json that tells how it was made and how large its own error is.

A dot is a pixel of one run that has more than half of the light that all runs of both integrators have there; the mean
of the others takes its place, in that run. The .json counts them. Runs that are done are not repeated.
"""

from __future__ import annotations

import argparse
import os
import sys
import time

import bench_environment

if __name__ == "__main__":
    bench_environment.enter_bench()

import numpy

from bench_errors import luminance, read_exr, write_half_exr
from bench_runs import (REFERENCES_FOLDER, BenchError, Hashes, OneLineParser, Progress, add_common_options,
                        check_render, exit_code, longest_run, made_of, one_run, parse_methods, positive_count,
                        positive_seconds, reference_stem, say, scene_name, write_json)

sys.path.insert(0, os.path.join(bench_environment.ROOT, "tests", "mitsuba"))
from statistics_tests import sidak_threshold, welch  # noqa: E402: the folder must be known before

BLOCK = 16  # pixels
SIGNIFICANCE = 0.001  # of a whole scene
TOLERANCE = 1e-3  # of the block's mean: both are rounded
# Of the picture's mean: light that one integrator finds with every sample and the other with one in a million (far tails
# of glossy metal) makes the latter look dark and sure for hours, where nobody can see it.
INVISIBLE = 1e-5
FIRST_SEED = 1000003  # none that a benchmark would use


def parse_arguments():
    parser = OneLineParser(description=__doc__.splitlines()[0], epilog=__doc__.split("\n\n", 2)[2],
                           formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--time", type=positive_seconds, default=3600.0,
                        help="seconds for each scene and integrator (default: 3600)")
    parser.add_argument("--integrators", dest="methods", type=parse_methods, default="guided,bdpt:emission=casters",
                        metavar="A,B", help="default: guided,bdpt:emission=casters")
    parser.add_argument("--chunks", type=positive_count, default=8, help="runs for each (default: 8)")
    parser.add_argument("--into", default=REFERENCES_FOLDER, metavar="FOLDER", help="default: scenes/references")
    add_common_options(parser, os.path.join("build", "references"))
    arguments = parser.parse_args()
    if len(arguments.methods) != 2 or arguments.chunks < 2:
        parser.error("two integrators and at least two chunks are needed")
    return arguments


def render_chunks(arguments, scene: str, hashes: Hashes, progress: Progress) -> dict[str, list[numpy.ndarray]]:
    """The runs' pictures by method."""
    pictures: dict[str, list[numpy.ndarray]] = {method.name: [] for method in arguments.methods}
    seconds = arguments.time / arguments.chunks
    for chunk in range(arguments.chunks):
        for place, method in enumerate(arguments.methods):
            what = f"{scene_name(scene)}, {method.name}, run {chunk + 1} of {arguments.chunks}"
            progress.begin(what)
            start = time.monotonic()
            # The two must not share their random numbers.
            seed = FIRST_SEED + 2 * chunk + place
            record = one_run(arguments, scene, None, method, seed, ["--time", f"{seconds:g}"], longest_run(seconds),
                             hashes)
            if "failure" in record:
                raise BenchError(f"{what}: {record['failure']}")
            pictures[method.name].append(read_exr(os.path.join(arguments.out, record["picture"])))
            progress.end(what, time.monotonic() - start, record["reused"])
    return pictures


def without_dots(pictures: numpy.ndarray) -> tuple[numpy.ndarray, int]:
    """pictures: [run, row, column, channel] of both integrators. Returns them with dots replaced, and how many were."""
    light = luminance(pictures)
    total = light.sum(axis=0)
    dots = light > 0.5 * total
    # With few runs, or where hardly any light is, chance alone makes halves.
    dots &= (light > 0.02 * light.mean()) & (len(pictures) >= 8)
    others = (pictures.sum(axis=0) - pictures) / (len(pictures) - 1)
    return numpy.where(dots[..., None], others, pictures), int(dots.sum())


def block_means(pictures: numpy.ndarray) -> numpy.ndarray:
    """[run, block, channel]; blocks at the right and lower edges may be smaller."""
    rows, columns = pictures.shape[1:3]
    return numpy.stack([pictures[:, y:y + BLOCK, x:x + BLOCK].mean(axis=(1, 2))
                        for y in range(0, rows, BLOCK) for x in range(0, columns, BLOCK)], axis=1)


def disagreements(first: numpy.ndarray, second: numpy.ndarray) -> tuple[list[str], float]:
    """A line for every block that differs significantly, and the smallest p times the number of tests."""
    means = [block_means(pictures) for pictures in (first, second)]
    blocks = means[0].shape[1]
    columns = -(-first.shape[2] // BLOCK)
    invisible = INVISIBLE * 0.5 * (first.mean() + second.mean())
    threshold = sidak_threshold(SIGNIFICANCE, 3 * blocks)
    lines, smallest = [], 1.0
    for block in range(blocks):
        for channel in range(3):
            values = [mean[:, block, channel].tolist() for mean in means]
            tolerance = TOLERANCE * 0.5 * (numpy.mean(values[0]) + numpy.mean(values[1])) + invisible
            difference, error, p = welch(*values, tolerance)
            smallest = min(smallest, p)
            if p < threshold:
                y, x = divmod(block, columns)
                lines.append(f"{'RGB'[channel]} of the block at {x * BLOCK},{y * BLOCK}: {numpy.mean(values[0]):.5g} "
                             f"and {numpy.mean(values[1]):.5g}, {difference / error:.1f} standard errors")
    return lines, min(1.0, smallest * 3 * blocks)


def precision(pictures: numpy.ndarray) -> float:
    """1 / the mean variance of the pixels of the mean picture: the worst of them are most of its error."""
    return 1.0 / max(1e-30, float((pictures.var(axis=0, ddof=1).mean(axis=-1) / len(pictures)).mean()))


def combine(first: numpy.ndarray, second: numpy.ndarray) -> tuple[numpy.ndarray, float, float]:
    """(the weighted mean, the weight of the first, the RMSE that the spread of the runs lets expect)."""
    of_first, of_second = precision(first), precision(second)
    weight = of_first / (of_first + of_second)
    variance = (weight ** 2 * first.var(axis=0, ddof=1) / len(first)
                + (1.0 - weight) ** 2 * second.var(axis=0, ddof=1) / len(second))
    mean = weight * first.mean(axis=0) + (1.0 - weight) * second.mean(axis=0)
    return mean, weight, float(numpy.sqrt(variance.mean()))


def make_reference(arguments, scene: str, hashes: Hashes, progress: Progress) -> bool:
    """Whether the two agree."""
    pictures = render_chunks(arguments, scene, hashes, progress)
    both, dots = without_dots(numpy.concatenate([numpy.stack(group).astype(float) for group in pictures.values()]))
    first, second = both[:arguments.chunks], both[arguments.chunks:]
    lines, corrected_p = disagreements(first, second)
    mean, weight, standard_error = combine(first, second)
    for line in lines[:10]:
        say(f"{scene_name(scene)}: {line}")
    folder = os.path.join(arguments.out, "disagreeing") if lines else arguments.into
    os.makedirs(folder, exist_ok=True)
    stem = reference_stem(folder, scene, arguments.size)
    methods = [method.name for method in arguments.methods]
    write_half_exr(stem + ".exr", mean, {"nephroid/scene": scene_name(scene), "nephroid/methods": ", ".join(methods)})
    write_json(stem + ".json", {
        **made_of(arguments, scene), "methods": methods, "seconds": arguments.time, "chunks": arguments.chunks,
        "weights": [weight, 1.0 - weight], "standard_error_rmse": standard_error, "dots": dots,
        "blocks": block_means(first).shape[1], "disagreeing": len(lines), "corrected_p": corrected_p,
        "means": [float(first.mean()), float(second.mean())], "render_sha256": hashes[arguments.render]})
    verdict = f"{len(lines)} BLOCKS DISAGREE" if lines else "agree"
    print(f"{scene_name(scene)}: means {first.mean():.5g} and {second.mean():.5g}, {verdict}; standard error "
          f"{standard_error:.3g}, weights {weight:.2f} and {1.0 - weight:.2f}, {dots} dots; {stem}.exr, "
          f"{os.path.getsize(stem + '.exr') / 1000:.0f} kB", flush=True)
    return not lines


def make_references(arguments) -> bool:
    """Whether the integrators agree on every scene."""
    check_render(arguments)
    hashes = Hashes()
    progress = Progress(len(arguments.scenes) * 2 * arguments.chunks)
    agree = [make_reference(arguments, scene, hashes, progress) for scene in arguments.scenes]
    progress.close()
    return all(agree)


def main() -> int:
    arguments = parse_arguments()
    return exit_code(lambda: make_references(arguments))


if __name__ == "__main__":
    sys.exit(main())
