#!/usr/bin/env python3
"""Measures what each setting of `guided` trades: precompute seconds, memory and error, at equal samples and equal time.

Usage: tradeoff.py [--scenes ring,bumpy_plane,two_mirrors] [--knobs all] [--time 20] [--spp 64] [--seeds 3]
       tradeoff.py --page docs/tradeoffs.md     writes the page from the results that the folder holds; renders nothing

Each knob is swept with everything else at its default. Runs of all values take turns inside a seed. "Equal spp" runs
stop at --spp samples, "equal time" runs at --time seconds from the process's start. The knobs `alpha` (width of the
caster's lobe) and `light_radius` (metres) change the scene: each value has its own scene and reference in the folder,
and `path` is measured beside `guided`; scenes without a generator that takes --alpha, or without a point light, are
left out there, and said so. Writes FOLDER/tradeoff.json, one PNG per knob, and Markdown to standard output. Runs that
are done are not repeated, and what the folder has of other knobs and scenes, with the same time, samples and seeds, is
kept, whatever executable it is of; a failed run is reported, and the exit code is 1 then.
"""

from __future__ import annotations

import argparse
import os
import sys
import time

import bench_environment

if __name__ == "__main__":
    bench_environment.enter_bench()

import bench_errors
import tradeoff_page
from bench_runs import (BenchError, Hashes, Method, OneLineParser, Progress, add_common_options, add_reference_options,
                        check_render, exit_code, longest_run, one_run, parse_scenes, positive_count, positive_seconds,
                        read_json, reference_for, say, scene_name, write_json)
from tradeoff_knobs import KNOBS, SCENE_KNOBS, scene_variant

MEASURES = ["rmse", "relmse", "relmse_trimmed", "spp", "precompute_seconds", "first_pass_seconds", "wall_seconds",
            "peak_rss_bytes", "guide_bytes", "lobes", "cached_points"]


def parse_knobs(text: str) -> list[str]:
    names = list(KNOBS) if text == "all" else [word for word in text.split(",") if word]
    unknown = [name for name in names if name not in KNOBS]
    if unknown or not names:
        raise argparse.ArgumentTypeError(f"{', '.join(unknown) or 'none'}: not a knob; known: {', '.join(KNOBS)}")
    return names


def parse_arguments():
    parser = OneLineParser(description=__doc__.splitlines()[0], epilog=__doc__.split("\n\n", 2)[2],
                           formatter_class=argparse.RawDescriptionHelpFormatter)
    add_common_options(parser, os.path.join("build", "tradeoff"))
    parser.set_defaults(scenes=parse_scenes("ring,bumpy_plane,two_mirrors"))
    parser.add_argument("--knobs", type=parse_knobs, default="all", metavar="A,B", help="default: all")
    parser.add_argument("--time", type=positive_seconds, default=20.0, help="seconds of equal-time runs (default: 20)")
    parser.add_argument("--spp", type=positive_count, default=64, help="samples of equal-spp runs (default: 64)")
    parser.add_argument("--seeds", type=positive_count, default=3, help="how many (default: 3)")
    parser.add_argument("--hang", type=positive_seconds, default=1800.0,
                        help="seconds after which an equal-spp run counts as hanging (default: 1800)")
    add_reference_options(parser)
    parser.add_argument("--page", metavar="FILE.md", help="write this page and its pictures from the results")
    return parser.parse_args()


class Sweep:
    """One knob on one scene: points are (value, scene file, method)."""

    def __init__(self, arguments, knob: str, scene: str) -> None:
        self.knob, self.scene = knob, scene_name(scene)
        self.points: list[tuple[str, str, Method]] = []
        values = KNOBS[knob].values
        for value in values:
            if knob in SCENE_KNOBS:
                variant = scene_variant(knob, value, scene, os.path.join(arguments.out, "scenes"))
                self.points += [(value, variant, Method("guided")), (value, variant, Method("path"))]
            else:
                settings = "".join(f":{word}" for word in KNOBS[knob].settings(value))
                self.points.append((value, scene, Method(f"guided=guided{settings}")))


def sweeps_of(arguments) -> list[Sweep]:
    """Those that the scenes allow; the others are named."""
    sweeps = []
    for scene in arguments.scenes:
        for knob in arguments.knobs:
            try:
                sweeps.append(Sweep(arguments, knob, scene))
            except ValueError as error:
                say(f"{scene_name(scene)}, {knob}: left out: {error}")
    return sweeps


def run_sweep(arguments, sweep: Sweep, references: dict[str, str], hashes: Hashes, progress: Progress) -> dict:
    limits = {"spp": (["--spp", str(arguments.spp)], arguments.hang),
              "time": (["--time", f"{arguments.time:g}"], longest_run(arguments.time))}
    records: dict[tuple[str, str, str], list[dict]] = {}
    for seed in range(arguments.seeds):
        for value, scene, method in sweep.points:
            for kind, (limit, longest) in limits.items():
                what = f"{sweep.scene}, {sweep.knob}={value}, {method.integrator}, equal {kind}, seed {seed}"
                progress.begin(what)
                start = time.monotonic()
                record = one_run(arguments, scene, references[scene], method, seed, limit, longest, hashes)
                records.setdefault((value, method.integrator, kind), []).append(record)
                failure = record.get("failure")
                result = f"FAILED: {failure}" if failure else f"RMSE {record['statistics']['error']['rmse']:.4g}"
                progress.end(f"{what}: {result}", time.monotonic() - start, record["reused"], bool(failure))
    return {"scene": sweep.scene, "knob": sweep.knob, "meaning": KNOBS[sweep.knob].meaning,
            "default": KNOBS[sweep.knob].default, "render_sha256": hashes[arguments.render],
            "points": [{"value": value, "integrator": integrator, "equal": kind, **summary(group)}
                       for (value, integrator, kind), group in records.items()]}


def summary(records: list[dict]) -> dict:
    """Medians over the seeds with their intervals."""
    done = [record for record in records if "failure" not in record]
    result = {"runs": len(done), "failures": [record["failure"] for record in records if "failure" in record]}
    values = [measures_of(record) for record in done]
    result.update({name: bench_errors.median_with_interval([value[name] for value in values]) for name in MEASURES})
    return result


def measures_of(record: dict) -> dict:
    known = record["statistics"]
    guiding = known.get("guiding", {})
    values = {name: known["error"][name] for name in ("rmse", "relmse", "relmse_trimmed")}
    values.update(spp=bench_errors.mean_spp(known), precompute_seconds=known["seconds"]["precompute"],
                  first_pass_seconds=known["passes"][0]["seconds"], wall_seconds=record["wall_seconds"],
                  peak_rss_bytes=known["peak_rss_bytes"], guide_bytes=guiding.get("bytes"),
                  lobes=guiding.get("lobes"), cached_points=guiding.get("cached_points"))
    return values


def measure(arguments) -> dict:
    check_render(arguments)
    sweeps = sweeps_of(arguments)
    scenes = list(dict.fromkeys(scene for sweep in sweeps for _, scene, _ in sweep.points))
    references = {scene: reference_for(arguments, scene) for scene in scenes}
    hashes = Hashes()
    progress = Progress(sum(len(sweep.points) for sweep in sweeps) * 2 * arguments.seeds)
    path = os.path.join(arguments.out, "tradeoff.json")
    results = {"size": list(arguments.size), "seconds": arguments.time, "spp": arguments.spp, "seeds": arguments.seeds}
    results["sweeps"] = sweeps_measured_alike(read_json(path) or {}, results)
    for sweep in sweeps:
        new = run_sweep(arguments, sweep, references, hashes, progress)
        others = [old for old in results["sweeps"] if (old["scene"], old["knob"]) != (new["scene"], new["knob"])]
        results["sweeps"] = sorted([*others, new], key=lambda sweep: list(KNOBS).index(sweep["knob"]))
        # After every sweep: an interrupted measurement leaves something to look at.
        write_json(path, results)
    progress.close()
    return results


def sweeps_measured_alike(earlier: dict, settings: dict) -> list[dict]:
    """Those of earlier measurements with the same settings, to keep for other scenes and knobs."""
    alike = all(earlier.get(key) == value for key, value in settings.items())
    return [sweep for sweep in earlier.get("sweeps", []) if sweep["knob"] in KNOBS] if alike else []


def sweep_or_write_page(arguments) -> bool:
    """What the options ask for; whether every run succeeded."""
    if arguments.page:
        path = os.path.join(arguments.out, "tradeoff.json")
        results = read_json(path)
        if not results:
            raise BenchError(f"{path}: no results; run without --page first")
        tradeoff_page.write_page(results, arguments.page)
        say(f"{arguments.page}: written")
        return True
    results = measure(arguments)
    tradeoff_page.draw_all(results, arguments.out)
    print(tradeoff_page.tables(results))
    return not any(point["failures"] for sweep in results["sweeps"] for point in sweep["points"])


def main() -> int:
    arguments = parse_arguments()
    return exit_code(lambda: sweep_or_write_page(arguments))


if __name__ == "__main__":
    sys.exit(main())
