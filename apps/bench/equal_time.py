#!/usr/bin/env python3
"""Equal-time comparison of integrators of `render`: error against a reference after the same wall time.

Usage: equal_time.py [--time 60] [--scenes all] [--integrators path,bdpt,ppg,guided] [--seeds 5] [--out FOLDER]

A scene is a name of scenes/ (ring, sphere, ...) or a file. An integrator is [NAME=]INTEGRATOR[:KEY=VALUE...], as in
paper=guided:preset=paper:bounces=1; each KEY=VALUE becomes `--set KEY=VALUE`. Methods take turns inside a seed, so that
a change of the machine's load meets all of them; wall time counts from the process's start, with loading,
precomputation and writing. Everything else (depth, sampler, filter, threads) is alike for all.

References come from scenes/references or the folder, or are rendered with --reference-method. Runs that the folder
holds already, with the same settings, executable and scene, are not repeated; failed ones are. Writes results.json and
report.html to the folder, and the table to standard output. Exit code 1 if a run failed: tables and report name it.
docs/benchmark.md explains the columns.
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
import report
from bench_runs import (BenchError, Hashes, OneLineParser, Progress, add_common_options, add_reference_options,
                        check_render, exit_code, longest_run, one_run, parse_methods, positive_count, positive_seconds,
                        read_json, reference_for, say, scene_name, write_json)


def parse_crop(text: str) -> tuple[int, int, int, int]:
    words = text.split(",")
    if len(words) != 4 or not all(word.isdigit() for word in words):
        raise argparse.ArgumentTypeError(f"{text}: not x0,y0,x1,y1")
    x0, y0, x1, y1 = map(int, words)
    if x0 >= x1 or y0 >= y1:
        raise argparse.ArgumentTypeError(f"{text}: not x0 < x1, y0 < y1")
    return x0, y0, x1, y1


def parse_arguments():
    parser = OneLineParser(description=__doc__.splitlines()[0], epilog=__doc__.split("\n\n", 2)[2],
                           formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--time", type=positive_seconds, default=60.0, help="seconds of wall time a run (default: 60)")
    parser.add_argument("--integrators", "--methods", dest="methods", type=parse_methods,
                        default="path,bdpt,ppg,guided", metavar="A,B", help="default: path,bdpt,ppg,guided")
    parser.add_argument("--seeds", type=positive_count, default=5, help="how many (default: 5)")
    add_common_options(parser, os.path.join("build", "equal_time"))
    add_reference_options(parser)
    parser.add_argument("--crop", type=parse_crop, metavar="x0,y0,x1,y1",
                        help="what the crops show (default: where errors are largest)")
    parser.add_argument("--with", dest="others", action="append", default=[], metavar="RESULTS.json",
                        help="results of apps/bench/peers.py to show beside ours; may be given again")
    parser.add_argument("--pictures", metavar="FOLDER",
                        help="write SCENE_curves.png and SCENE_pictures.png (seed 0 of every method) there, too")
    return parser.parse_args()


def run_all(arguments, references: dict[str, str], hashes: Hashes) -> list[dict]:
    jobs = [(scene, seed, method) for scene in arguments.scenes for seed in range(arguments.seeds)
            for method in arguments.methods]
    progress, records = Progress(len(jobs)), []
    for scene, seed, method in jobs:
        what = f"{scene_name(scene)}, {method.name}, seed {seed}"
        progress.begin(what)
        start = time.monotonic()
        record = one_run(arguments, scene, references[scene], method, seed, ["--time", str(arguments.time)],
                         longest_run(arguments.time), hashes)
        records.append(record)
        progress.end(f"{what}: {outcome(record)}", time.monotonic() - start, record["reused"], "failure" in record)
    progress.close()
    return records


def outcome(record: dict) -> str:
    if "failure" in record:
        return "FAILED: " + record["failure"]
    error = record["statistics"]["error"]
    return (f"RMSE {error['rmse']:.4g}, trimmed relMSE {error['relmse_trimmed']:.4g}, "
            f"{bench_errors.mean_spp(record['statistics']):.4g} spp")


def measure(out: str, records: list[dict], references: dict[str, str], hashes: Hashes,
            made_by: dict[str, str] | None = None) -> dict:
    """Adds FLIP to the records; returns the noise of every scene and method. references: by the scene's name.

    made_by: of scenes whose reference is one more run of a method, that method's name.
    """
    noise = {}
    for scene, path in references.items():
        reference = bench_errors.read_exr(path)
        done = [record for record in records if record["scene"] == scene and "failure" not in record]
        for record in done:
            bench_errors.add_flip(record, out, path, reference, hashes[path])
        for name in dict.fromkeys(record["method"] for record in done):
            pictures = [bench_errors.read_exr(os.path.join(out, r["picture"])) for r in done if r["method"] == name]
            if made_by and made_by.get(scene) == name:
                pictures.append(reference)
            noise[scene, name] = bench_errors.noise_of(pictures)
    return noise


def makers_of(arguments, references: dict[str, str]) -> dict[str, str]:
    """By scene: the method that made the reference, if that was for as long as the runs take."""
    maker = arguments.reference_method
    if not any(method.name == maker.name and method.options() == maker.options() for method in arguments.methods):
        return {}
    made = {scene: read_json(path[:-len(".exr")] + ".json") or {} for scene, path in references.items()}
    return {scene: maker.name for scene, how in made.items()
            if how.get("methods") == [maker.name] and how.get("seconds") == arguments.time}


def results_of(arguments, methods: list[dict], references: dict[str, str], records: list[dict], noise: dict) -> dict:
    names = [method["name"] for method in methods]
    return {"size": list(arguments.size), "seconds": arguments.time, "seeds": arguments.seeds,
            "threads": arguments.threads, "max_depth": arguments.max_depth, "methods": methods,
            "references": {scene: {"file": path, "made": read_json(path[:-len(".exr")] + ".json")}
                           for scene, path in references.items()},
            "summaries": bench_errors.summarise(list(references), names, records, noise), "runs": records}


def add_others(arguments, results: dict, noise: dict) -> dict:
    """Puts the runs of other renderers, measured against the same references, beside ours."""
    methods, records = list(results["methods"]), list(results["runs"])
    references = {scene: entry["file"] for scene, entry in results["references"].items()}
    for path in arguments.others:
        other = read_json(path)
        if not other or "runs" not in other:
            raise BenchError(f"{path}: not results of a benchmark")
        if other["size"] != results["size"] or other["seconds"] != results["seconds"]:
            raise BenchError(f"{path}: of another size or time; run peers.py with the same --size and --time")
        methods += other["methods"]
        folder = os.path.dirname(os.path.abspath(path))
        for record in other["runs"]:
            if record["scene"] in references:
                moved = {"picture": os.path.join(folder, record["picture"])} if "picture" in record else {}
                records.append({**record, **moved})
        noise.update({(entry["scene"], entry["method"]): {key: entry[key] for key in bench_errors.NOISES if key in entry}
                      for entry in other["summaries"]})
    return results_of(arguments, methods, references, records, noise)


def compare(arguments) -> bool:
    """Runs, measures and reports; whether every run succeeded."""
    check_render(arguments)
    width, height = arguments.size
    if arguments.crop and (arguments.crop[2] > width or arguments.crop[3] > height):
        raise BenchError(f"--crop: outside the picture of {width}x{height}")
    hashes = Hashes()
    references = {scene: reference_for(arguments, scene) for scene in arguments.scenes}
    records = run_all(arguments, references, hashes)
    by_name = {scene_name(scene): path for scene, path in references.items()}
    noise = measure(arguments.out, records, by_name, hashes, makers_of(arguments, by_name))
    methods = [{"name": method.name, "options": method.options()} for method in arguments.methods]
    results = results_of(arguments, methods, by_name, records, noise)
    results["render_sha256"] = hashes[arguments.render]
    if arguments.others:
        results = {**results, **add_others(arguments, results, noise)}
    write_json(os.path.join(arguments.out, "results.json"), results)
    page = os.path.join(arguments.out, "report.html")
    report.write_report(results, arguments.out, page, arguments.crop, arguments.pictures)
    print(report.markdown(results))
    say(f"report: {page}")
    return not any("failure" in record for record in records)


def main() -> int:
    arguments = parse_arguments()
    return exit_code(lambda: compare(arguments))


if __name__ == "__main__":
    sys.exit(main())
