#!/usr/bin/env python3
"""The benchmark's scenes in Mitsuba 3 (path and ptracer), as an outside measure in the format of equal_time.py.

Usage: peers.py [--time 60] [--scenes all] [--integrators path,ptracer] [--seeds 5] [--out FOLDER]

Scenes are converted by tests/mitsuba/convert.py with Mitsuba's own materials. Metals and coats are `principled`, which
has our Fresnel term and GGX, but shadowing without correlated heights and another diffuse term below coats. So pictures
differ from ours however long they take: the column "noise" (spread over the seeds) is free of that, RMSE is not, and
"mean / reference's" tells how large it is. ptracer traces from the lights alone: of surfaces of metal the camera sees
little, of mirrors in mirrors nothing.

Each run is a process of its own that renders passes, each as long as all before but no longer than a tenth of the
time, until the time is over, counted from the process's start. Errors are measured against the references that
equal_time.py uses; missing ones are rendered. Writes FOLDER/results.json; show it with
`equal_time.py --with FOLDER/results.json` and the same --time, --size and --scenes. Finished runs are not repeated.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import resource
import sys
import time

PROCESS_START = time.monotonic()

import bench_environment  # noqa: E402: the clock first

RENDER_FLAG = "--render-one"
MITSUBA_FOLDER = os.path.join(bench_environment.ROOT, "tests", "mitsuba")

if __name__ == "__main__":
    if RENDER_FLAG not in sys.argv:
        bench_environment.enter_bench()

import numpy  # noqa: E402

from bench_runs import (Hashes, OneLineParser, Progress, add_common_options, add_reference_options,  # noqa: E402
                        check_render, exit_code, file_name, is_number, longest_run, positive_count, positive_seconds,
                        read_json, reference_for, run_process, scene_name, write_json)

INTEGRATORS = ("path", "ptracer")


# ---- one run: in Mitsuba's environment

def render_one(job: dict) -> None:
    """Renders in passes, and writes picture.exr and statistics as `render --stats` has them."""
    sys.path.insert(0, MITSUBA_FOLDER)
    import mitsuba
    import convert
    convert.set_up(job["variant"])
    if job["threads"]:
        import drjit
        drjit.set_thread_count(job["threads"])
    load_start = time.monotonic()
    scene = mitsuba.load_dict(convert_scene(convert, job))
    loaded = time.monotonic()
    # Depth as ours, where Mitsuba also counts the first segment; Russian roulette after four scatterings, as ours.
    integrator = mitsuba.load_dict({"type": job["integrator"], "max_depth": job["max_depth"] + 1, "rr_depth": 5})
    reference = numpy.array(mitsuba.Bitmap(job["reference"]).convert(
        mitsuba.Bitmap.PixelFormat.RGB, mitsuba.Struct.Type.Float32, False), dtype=numpy.float64)
    mean, passes = render_passes(mitsuba, scene, integrator, reference, job)
    rendered = time.monotonic()
    mitsuba.Bitmap(mean.astype(numpy.float32)).write(job["picture"])
    end = time.monotonic()
    height, width = mean.shape[:2]
    spp = passes[-1]["spp"]
    write_json(job["statistics"], {
        "scene": job["scene"], "integrator": job["integrator"], "version": "mitsuba " + mitsuba.__version__,
        "variant": job["variant"], "width": width, "height": height, "spp": spp, "seed": job["seed"],
        "camera_samples": spp * width * height, "nonfinite_samples": int((~numpy.isfinite(mean)).sum()),
        "peak_rss_bytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024, "passes": passes,
        "seconds": {"load": loaded - load_start, "build": 0.0, "precompute": 0.0, "render": rendered - loaded,
                    "write": end - rendered, "total": end - PROCESS_START},
        "error": {key: passes[-1][key] for key in ("rmse", "relmse", "relmse_trimmed")}})


def convert_scene(convert, job: dict) -> dict:
    """The scene's dictionary, with metals whose Fresnel term is ours."""
    class Peer(convert.Converter):
        def nearest_builtin(self, pbr, base, metallic, roughness, specular):
            if roughness ** 2 < convert.DELTA_ALPHA or (metallic <= 0.5 and specular == 0.0):
                return super().nearest_builtin(pbr, base, metallic, roughness, specular)
            # Its specular 0.5 is an F0 of 0.04.
            return convert.two_sided({"type": "principled", "base_color": convert.rgb(base), "metallic": metallic,
                                      "roughness": roughness, "specular": 0.5 * specular})

    return Peer(job["scene"], *job["size"], "builtin").scene


def render_passes(mitsuba, scene, integrator, reference, job: dict) -> tuple[numpy.ndarray, list[dict]]:
    total, samples, passes, size = 0.0, 0, [], 1
    while True:
        start = time.monotonic()
        # Seeds of passes and of runs must not meet.
        picture = mitsuba.render(scene, integrator=integrator, spp=size, seed=job["seed"] * 100003 + len(passes))
        total = total + size * numpy.array(picture, dtype=numpy.float64)
        samples += size
        now = time.monotonic()
        passes.append({"seconds": now - PROCESS_START, "spp": samples, **errors(total / samples, reference)})
        left = job["time"] - (time.monotonic() - PROCESS_START)
        per_sample = (now - start) / size
        if left < per_sample:
            return total / samples, passes
        size = max(1, int(min(left, 0.1 * job["time"]) / per_sample))
        size = min(size, max(1, samples))


def errors(picture: numpy.ndarray, reference: numpy.ndarray) -> dict[str, float]:
    """As bench_errors.measure, which needs packages that this environment does not have."""
    squared = (picture - reference) ** 2
    relative = numpy.sort((squared / (reference ** 2 + 0.01)).mean(axis=-1).ravel())
    return {"rmse": float(numpy.sqrt(squared.mean())), "relmse": float(relative.mean()),
            "relmse_trimmed": float(relative[:len(relative) - len(relative) // 1000].mean())}


# ---- all runs

def parse_integrators(text: str) -> list[str]:
    names = list(dict.fromkeys(word for word in text.split(",") if word))
    unknown = [name for name in names if name not in INTEGRATORS]
    if unknown or not names:
        raise argparse.ArgumentTypeError(f"{', '.join(unknown) or 'none'}: use path or ptracer")
    return names


def parse_arguments():
    parser = OneLineParser(description=__doc__.splitlines()[0], epilog=__doc__.split("\n\n", 2)[2],
                           formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--time", type=positive_seconds, default=60.0, help="seconds of wall time a run (default: 60)")
    parser.add_argument("--integrators", type=parse_integrators, default="path,ptracer", metavar="A,B",
                        help="default: path,ptracer")
    parser.add_argument("--seeds", type=positive_count, default=5, help="how many (default: 5)")
    parser.add_argument("--variant", default="scalar_rgb", metavar="NAME",
                        help="of Mitsuba; llvm_ad_rgb needs LLVM (default: scalar_rgb)")
    add_common_options(parser, os.path.join("build", "peers"))
    add_reference_options(parser, os.path.join("build", "equal_time", "references"))
    return parser.parse_args()


def mitsuba_python() -> str:
    """The interpreter of build/mitsuba, made as tests/run.sh makes it."""
    venv = os.path.join(bench_environment.ROOT, "build", "mitsuba")
    python = os.path.join(venv, "bin", "python")
    works = os.path.exists(python) and run_process([python, "-c", "import mitsuba, numpy"], 300.0) is None
    if not works:
        bench_environment.make(venv, python, os.path.join(MITSUBA_FOLDER, "requirements.txt"))
    return python


def one_run(arguments, python: str, scene: str, reference: str, integrator: str, seed: int, hashes: Hashes) -> dict:
    """The record of one run, taken from the folder if the same was done before."""
    job = {"scene": os.path.abspath(scene), "reference": os.path.abspath(reference), "integrator": integrator,
           "seed": seed, "size": list(arguments.size), "time": arguments.time, "variant": arguments.variant,
           "threads": arguments.threads, "max_depth": arguments.max_depth or 12}
    converters = [os.path.join(MITSUBA_FOLDER, name) for name in ("convert.py", "glb.py")]
    inputs = [hashes[path] for path in (scene, reference, os.path.abspath(__file__), *converters)]
    settings = {key: value for key, value in job.items() if key not in ("scene", "reference")}
    key = hashlib.sha256(json.dumps([inputs, settings]).encode()).hexdigest()[:12]
    name = f"mitsuba-{integrator}"
    stem = os.path.join(arguments.out, "runs", f"{scene_name(scene)}.{file_name(name)}.{seed}.{key}")
    record = {"scene": scene_name(scene), "method": name, "seed": seed, "options": [arguments.variant, integrator],
              "picture": os.path.relpath(stem + ".exr", arguments.out), "record": os.path.basename(stem) + ".json"}
    known = read_json(stem + ".json")
    record["reused"] = bool(known) and os.path.exists(stem + ".exr")
    if not record["reused"]:
        failure = run_job(python, {**job, "picture": stem + ".part.exr", "statistics": stem + ".part.json"},
                          stem, longest_run(arguments.time))
        known = None if failure else read_json(stem + ".json")
        if failure or not is_number(known["statistics"]["error"]["rmse"]):
            return {**record, "failure": failure or "no finite error against the reference"}
    return {**record, **known}


def run_job(python: str, job: dict, stem: str, longest: float) -> str | None:
    """Renders in a process of its own; what went wrong, or None and STEM.exr, STEM.json."""
    start = time.monotonic()
    try:
        failure = run_process([python, "-B", os.path.abspath(__file__), RENDER_FLAG, json.dumps(job)], longest)
        if failure:
            return failure
        wall_seconds = time.monotonic() - start
        statistics = read_json(job["statistics"])
        os.replace(job["picture"], stem + ".exr")
        write_json(stem + ".json", {"wall_seconds": wall_seconds, "statistics": statistics})
        return None
    finally:
        for path in (job["picture"], job["statistics"]):
            if os.path.exists(path):
                os.remove(path)


def run_all(arguments, references: dict[str, str], hashes: Hashes) -> list[dict]:
    python = mitsuba_python()
    jobs = [(scene, seed, integrator) for scene in arguments.scenes for seed in range(arguments.seeds)
            for integrator in arguments.integrators]
    progress, records = Progress(len(jobs)), []
    for scene, seed, integrator in jobs:
        what = f"{scene_name(scene)}, mitsuba {integrator}, seed {seed}"
        progress.begin(what)
        start = time.monotonic()
        record = one_run(arguments, python, scene, references[scene], integrator, seed, hashes)
        records.append(record)
        failure = record.get("failure")
        result = f"FAILED: {failure}" if failure else f"RMSE {record['statistics']['error']['rmse']:.4g}"
        progress.end(f"{what}: {result}", time.monotonic() - start, record["reused"], bool(failure))
    progress.close()
    return records


def compare(arguments) -> bool:
    """Runs, measures and reports; whether every run succeeded."""
    import equal_time
    import report
    check_render(arguments)
    hashes = Hashes()
    references = {scene: reference_for(arguments, scene) for scene in arguments.scenes}
    records = run_all(arguments, references, hashes)
    by_name = {scene_name(scene): path for scene, path in references.items()}
    noise = equal_time.measure(arguments.out, records, by_name, hashes)
    methods = [{"name": f"mitsuba-{name}", "options": [arguments.variant, name]} for name in arguments.integrators]
    results = equal_time.results_of(arguments, methods, by_name, records, noise)
    write_json(os.path.join(arguments.out, "results.json"), results)
    print(report.markdown(results))
    return not any("failure" in record for record in records)


def main() -> int:
    if RENDER_FLAG in sys.argv:
        render_one(json.loads(sys.argv[-1]))
        return 0
    arguments = parse_arguments()
    return exit_code(lambda: compare(arguments))


if __name__ == "__main__":
    sys.exit(main())
