#!/usr/bin/env python3
"""Equal-time comparison of methods of `render`: error against a reference after the same wall time.

Usage: equal_time.py --render PATH --work FOLDER --scenes A.glb B.glb --methods path paper=guided:preset=paper
                     --time 20 --output RESULTS.json [--seeds 5] [--size 320x240] [--threads N] [--max-depth N]
                     [--reference-method guided:preset=paper] [--reference-time 600] [--plots FOLDER]
                     [--crop x0,y0,x1,y1]

A method is [NAME=]INTEGRATOR[:KEY=VALUE[,KEY=VALUE...]]; each KEY=VALUE becomes `--set KEY=VALUE`. Methods take turns
inside a seed, so that a change of the machine's load meets all of them; wall time counts from the process's start, with
loading, precomputation and writing. Everything else (depth, sampler, filter, threads) is alike for all.

A reference WORK/SCENE.SIZE.ref.exr is rendered with --reference-method if it is missing, with a seed of its own. Runs
that the work folder holds already, with the same settings, the same executable and the same scene, are not repeated;
failed ones are. The table (Markdown, on standard output) and the results say which runs failed; exit code 1 then.

Columns are medians over the seeds, with the full range in brackets. "time ratio": how many times longer the first
method would need for the same error, if RMSE falls with the square root of time. "slope": of log RMSE over the log of
the time since rendering began, fitted to the passes; -0.5 is what independent samples of finite variance give. Heavy
tails make RMSE a matter of luck. The trimmed relMSE (without the worst 0.1 % of pixels) is steadier, but flatters a
method that rarely finds the caustic and so misses its energy: look at both, and at the pictures.

Python 3 alone; --plots needs numpy and matplotlib. The crops' exposures differ: each PNG has its own, as `render` does.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import re
import statistics
import subprocess
import sys
import time

REFERENCE_SEED = 1000003
ERRORS = ["rmse", "relmse", "relmse_trimmed"]
# RMSE falls with the square root of time, so its square counts; relMSE is a square already.
POWERS = {"rmse": 2.0, "relmse": 1.0, "relmse_trimmed": 1.0}
# A run that takes this much longer than it was given hangs.
HANG_FACTOR, HANG_SECONDS = 3.0, 300.0
INTERRUPTED = 130  # render's exit code after SIGINT or SIGTERM, and ours


class BenchError(Exception):
    """A failure to report in one line."""


class Method:
    """One integrator with its parameters."""

    def __init__(self, text: str) -> None:
        head, _, tail = text.partition(":")
        name, has_name, integrator = head.partition("=")
        self.name = name if has_name else text
        self.integrator = integrator if has_name else head
        self.parameters = tail.split(",") if tail else []
        if not self.name or not re.fullmatch(r"[A-Za-z0-9_-]+", self.integrator):
            raise argparse.ArgumentTypeError(f"{text}: not [NAME=]INTEGRATOR[:KEY=VALUE,...]")
        for parameter in self.parameters:
            if not re.fullmatch(r"[^=]+=.+", parameter):
                raise argparse.ArgumentTypeError(f"{text}: '{parameter}' is not KEY=VALUE")

    def options(self) -> list[str]:
        return ["-i", self.integrator] + [word for parameter in self.parameters for word in ("--set", parameter)]


# ---- files

def scene_name(path: str) -> str:
    return os.path.splitext(os.path.basename(path))[0]


def file_name(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", text)


def digest(path: str) -> str:
    """A hash of a file's bytes."""
    result = hashlib.sha256()
    with open(path, "rb") as file:
        while block := file.read(1 << 20):
            result.update(block)
    return result.hexdigest()


def read_json(path: str):
    """What the file holds; None if there is none or it is not JSON."""
    try:
        with open(path) as file:
            return json.load(file)
    except (FileNotFoundError, ValueError):
        return None


def write_json(path: str, value) -> None:
    """Whole or not at all."""
    temporary = f"{path}.{os.getpid()}.tmp"
    with open(temporary, "w") as file:
        json.dump(value, file, indent=2)
        file.write("\n")
    os.replace(temporary, path)


# ---- running

def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def common_options(arguments) -> list[str]:
    options = ["-q", "--size", "x".join(map(str, arguments.size))]
    for name in ["threads", "max_depth"]:
        if getattr(arguments, name) is not None:
            options += ["--" + name.replace("_", "-"), str(getattr(arguments, name))]
    return options


def run_render(arguments, options: list[str], stem: str, seconds: float) -> str | None:
    """Renders to STEM.exr, .png and .json; returns what went wrong.

    The files get their names after success only: an interrupted run leaves nothing that looks finished.
    """
    unfinished = {extension: f"{stem}.part.{extension}" for extension in ("exr", "png", "json")}
    try:
        failure = run_process(arguments, options, unfinished, seconds)
        # The statistics last: they say that the run is complete.
        for extension, path in unfinished.items() if failure is None else []:
            os.replace(path, f"{stem}.{extension}")
    finally:
        for path in unfinished.values():
            if os.path.exists(path):
                os.remove(path)
    return failure


def run_process(arguments, options: list[str], outputs: dict[str, str], seconds: float) -> str | None:
    command = [arguments.render, *common_options(arguments), *options, "--time", str(seconds), "--stats",
               outputs["json"], "-o", outputs["exr"], "-o", outputs["png"]]
    try:
        result = subprocess.run(command, capture_output=True, text=True, errors="replace",
                                timeout=HANG_FACTOR * seconds + HANG_SECONDS)
    except subprocess.TimeoutExpired:
        return f"still running after {HANG_FACTOR * seconds + HANG_SECONDS:.0f} s, killed"
    if result.returncode == INTERRUPTED:
        raise KeyboardInterrupt
    if result.returncode != 0:
        lines = [line for line in result.stderr.splitlines() if line.strip()] or ["no message"]
        return f"exit code {result.returncode}: {lines[-1]}"
    return None


def reference_for(arguments, scene: str) -> str:
    """The scene's reference picture, rendered if it is missing."""
    stem = os.path.join(arguments.work, f"{scene_name(scene)}.{'x'.join(map(str, arguments.size))}.ref")
    made_of = {"scene_sha256": digest(scene), "max_depth": arguments.max_depth}
    if os.path.exists(stem + ".exr"):
        recorded = read_json(stem + ".settings.json")
        if recorded is None:
            say(f"{stem}.exr: taken as it is; nothing says how it was made")
        elif any(recorded.get(key) != value for key, value in made_of.items()):
            raise BenchError(f"{stem}.exr: made of another version of the scene or with another depth; delete it")
        return stem + ".exr"
    method = arguments.reference_method
    say(f"reference of {scene_name(scene)}: {method.name}, {arguments.reference_time:g} s")
    options = [*method.options(), "--seed", str(REFERENCE_SEED), scene]
    failure = run_render(arguments, options, stem, arguments.reference_time)
    if failure:
        raise BenchError(f"reference of {scene_name(scene)}: {failure}")
    write_json(stem + ".settings.json", {**made_of, "options": method.options(), "seconds": arguments.reference_time})
    return stem + ".exr"


def one_run(arguments, scene: str, reference: str, method: Method, seed: int, hashes: dict) -> dict:
    """The record of one run, reused if the same has been done before."""
    options = [*method.options(), "--seed", str(seed)]
    settings = [hashes[scene], hashes[reference], hashes[arguments.render], *common_options(arguments), *options,
                arguments.time]
    key = hashlib.sha256(json.dumps(settings).encode()).hexdigest()[:12]
    stem = os.path.join(arguments.work, "runs", f"{scene_name(scene)}.{file_name(method.name)[:60]}.{seed}.{key}")
    record = {"scene": scene_name(scene), "method": method.name, "seed": seed, "options": options,
              "picture": stem + ".png"}
    known = read_json(stem + ".json")
    record["reused"] = has_errors(known)
    if not record["reused"]:
        failure = run_render(arguments, [*options, "--reference", reference, scene], stem, arguments.time)
        known = None if failure else read_json(stem + ".json")
        if not has_errors(known):
            record["failure"] = failure or f"{stem}.json: no finite error against the reference"
            return record
    record["statistics"] = known
    return record


def has_errors(known) -> bool:
    """Whether these are the statistics of a run that was measured."""
    return bool(known) and bool(known.get("passes")) and all(is_number(known.get("error", {}).get(name))
                                                             for name in ERRORS)


def is_number(value) -> bool:
    return isinstance(value, (int, float)) and math.isfinite(value)


def run_all(arguments, references: dict[str, str]) -> list[dict]:
    hashes = {path: digest(path) for path in [arguments.render, *arguments.scenes, *references.values()]}
    jobs = [(scene, seed, method) for scene in arguments.scenes for seed in range(arguments.seeds)
            for method in arguments.methods]
    records = []
    for number, (scene, seed, method) in enumerate(jobs, start=1):
        start = time.monotonic()
        record = one_run(arguments, scene, references[scene], method, seed, hashes)
        records.append(record)
        say(f"[{number}/{len(jobs)}] {record['scene']}, {method.name}, seed {seed}: {outcome(record)}, "
            f"{time.monotonic() - start:.1f} s{' (done before)' if record['reused'] else ''}")
    return records


def outcome(record: dict) -> str:
    if "failure" in record:
        return "FAILED: " + record["failure"]
    known = record["statistics"]
    return (f"RMSE {known['error']['rmse']:.4g}, trimmed relMSE {known['error']['relmse_trimmed']:.4g}, "
            f"{mean_spp(known):.4g} spp")


# ---- what the statistics say

def mean_spp(known: dict) -> float:
    """Over all pixels: a deadline may leave single tiles behind."""
    return known["camera_samples"] / (known["width"] * known["height"])


def before_first_sample(known: dict) -> float:
    """Seconds from the process's start: libraries, loading, building, precomputation."""
    seconds = known["seconds"]
    return seconds["total"] - seconds["render"] - seconds["write"]


def fitted_slope(known: dict) -> float | None:
    """Of log RMSE over log seconds of rendering, by least squares over the passes; None for less than three passes."""
    start = before_first_sample(known)
    points = [(math.log(entry["seconds"] - start), math.log(entry["rmse"])) for entry in known["passes"]
              if entry["seconds"] > start and is_number(entry.get("rmse")) and entry["rmse"] > 0.0]
    if len(points) < 3:
        return None
    mean_x, mean_y = (statistics.fmean(point[axis] for point in points) for axis in range(2))
    spread = sum((x - mean_x) ** 2 for x, _ in points)
    return sum((x - mean_x) * (y - mean_y) for x, y in points) / spread if spread > 0.0 else None


def values_of(record: dict) -> dict:
    """The numbers of one run that are summarised."""
    known = record["statistics"]
    result = {name: known["error"][name] for name in ERRORS}
    result.update(spp=mean_spp(known), precompute_seconds=known["seconds"]["precompute"],
                  first_pass_seconds=known["passes"][0]["seconds"], total_seconds=known["seconds"]["total"],
                  peak_rss_bytes=known["peak_rss_bytes"], nonfinite_samples=known["nonfinite_samples"],
                  slope=fitted_slope(known))
    return result


def median_and_range(values: list) -> dict | None:
    numbers = [value for value in values if value is not None]
    if not numbers:
        return None
    return {"median": statistics.median(numbers), "lowest": min(numbers), "highest": max(numbers)}


def time_ratio(name: str, first: dict, other: dict) -> float | None:
    """How many times longer `first` would need for the error of `other`, by error^power ~ 1 / time."""
    if other[name] <= 0.0:
        return None
    return (first[name] / other[name]) ** POWERS[name] * first["total_seconds"] / other["total_seconds"]


def summarise(arguments, records: list[dict]) -> list[dict]:
    """One entry per scene and method."""
    result = []
    for scene in map(scene_name, arguments.scenes):
        of_scene = [record for record in records if record["scene"] == scene]
        values = {(record["method"], record["seed"]): values_of(record) for record in of_scene
                  if "failure" not in record}
        for method in arguments.methods:
            result.append(summary_of(arguments, scene, method.name, values, of_scene))
    return result


def summary_of(arguments, scene: str, name: str, values: dict, records: list[dict]) -> dict:
    seeds = range(arguments.seeds)
    own = [values[name, seed] for seed in seeds if (name, seed) in values]
    summary = {"scene": scene, "method": name, "runs": len(own),
               "failures": [record["failure"] for record in records if record["method"] == name
                            and "failure" in record]}
    if own:
        summary.update({key: median_and_range([value[key] for value in own]) for key in own[0]})
    first = arguments.methods[0].name
    first_values = [values[first, seed] for seed in seeds if (first, seed) in values]
    for error in ERRORS if own and first_values else []:
        middle = [{key: statistics.median(value[key] for value in group) for key in (error, "total_seconds")}
                  for group in (first_values, own)]
        # The range is that of runs of the same seed, which were neighbours in time.
        pairs = [time_ratio(error, values[first, seed], values[name, seed]) for seed in seeds
                 if (first, seed) in values and (name, seed) in values]
        spread = median_and_range(pairs) or {}
        summary[f"time_ratio_{error}"] = {"of_medians": time_ratio(error, *middle), "lowest": spread.get("lowest"),
                                          "highest": spread.get("highest")}
    return summary


# ---- report

def cell(value: dict | None, digits: int = 3, scale: float = 1.0) -> str:
    """A median with its range, or a ratio of medians with its range."""
    if value is None:
        return "-"
    middle = value.get("median", value.get("of_medians"))
    if middle is None:
        return "-"
    text = f"{middle * scale:#.{digits}g}".rstrip(".")
    if value["lowest"] is None or value["lowest"] == value["highest"]:
        return text
    return f"{text} ({value['lowest'] * scale:.{digits}g}..{value['highest'] * scale:.{digits}g})"


def markdown(arguments, summaries: list[dict]) -> str:
    first = arguments.methods[0].name
    lines = [f"{arguments.size[0]}x{arguments.size[1]}, {arguments.time:g} s of wall time each, {arguments.seeds} "
             f"seeds; median (lowest..highest); time ratios against {first}", ""]
    titles = ["scene", "method", "runs", "RMSE", "relMSE", "trimmed relMSE", "time ratio (RMSE)",
              "time ratio (trimmed relMSE)", "slope", "spp", "precompute s", "first pass s", "total s", "peak MiB"]
    lines += ["| " + " | ".join(titles) + " |", "|" + "---|" * len(titles)]
    for summary in summaries:
        cells = [cell(summary.get(key), digits, scale) for key, digits, scale in [
            ("rmse", 3, 1.0), ("relmse", 3, 1.0), ("relmse_trimmed", 3, 1.0), ("time_ratio_rmse", 3, 1.0),
            ("time_ratio_relmse_trimmed", 3, 1.0), ("slope", 2, 1.0), ("spp", 3, 1.0), ("precompute_seconds", 3, 1.0),
            ("first_pass_seconds", 3, 1.0), ("total_seconds", 3, 1.0), ("peak_rss_bytes", 4, 2.0**-20)]]
        failed = f", {len(summary['failures'])} FAILED" if summary["failures"] else ""
        name = summary["method"].replace("|", "\\|")
        lines.append(f"| {summary['scene']} | {name} | {summary['runs']}{failed} | " + " | ".join(cells) + " |")
    for summary in summaries:
        lines += [f"\nFAILED: {summary['scene']}, {summary['method']}: {failure}"
                  for failure in dict.fromkeys(summary["failures"])]
        nonfinite = summary.get("nonfinite_samples")
        if nonfinite and nonfinite["highest"] > 0:
            lines.append(f"\nnote: {summary['scene']}, {summary['method']}: up to {nonfinite['highest']:.0f} "
                         "non-finite samples left out")
    return "\n".join(lines)


def results_of(arguments, references: dict[str, str], records: list[dict], summaries: list[dict]) -> dict:
    return {"size": arguments.size, "seconds": arguments.time, "seeds": arguments.seeds, "threads": arguments.threads,
            "max_depth": arguments.max_depth, "render_sha256": digest(arguments.render),
            "methods": [{"name": method.name, "options": method.options()} for method in arguments.methods],
            "references": {scene_name(scene): {"file": path, "statistics": read_json(path[:-4] + ".json"),
                                               "settings": read_json(path[:-4] + ".settings.json")}
                           for scene, path in references.items()},
            "summaries": summaries, "runs": records}


# ---- pictures

class Plotting:
    """Error curves and crops, as PNG files of limited size; loads the libraries, which nothing else needs."""

    LARGEST_FILE = 400_000  # bytes
    STRIP_WIDTH = 1200  # pixels, all crops together
    LABEL_HEIGHT = 16
    CURVE_POINTS = 60

    def __init__(self, arguments) -> None:
        try:
            import matplotlib
            matplotlib.use("Agg")
            import matplotlib.pyplot
            import numpy
            import PIL.Image
            import PIL.ImageDraw
        except ImportError as error:
            raise BenchError(f"--plots: {error}; install numpy and matplotlib, or leave --plots out") from None
        self.pyplot, self.numpy, self.pil = matplotlib.pyplot, numpy, PIL
        self.arguments = arguments

    def draw(self, scene: str, reference: str, records: list[dict]) -> None:
        done = [record for record in records if record["scene"] == scene and "failure" not in record]
        if not done:
            say(f"{scene}: no run to draw")
            return
        self.draw_curves(scene, done)
        self.draw_strip(scene, reference, done)

    # ---- error over time

    def draw_curves(self, scene: str, done: list[dict]) -> None:
        figure, axes = self.pyplot.subplots(1, 2, figsize=(11.0, 4.5), layout="constrained")
        for axis, error, title in zip(axes, ["rmse", "relmse_trimmed"], ["RMSE", "relMSE, worst 0.1 % left out"]):
            for number, method in enumerate(self.arguments.methods):
                curves = [self.curve(record, error) for record in done if record["method"] == method.name]
                curves = [curve for curve in curves if len(curve[0])]
                if curves:
                    self.draw_method(axis, curves, f"C{number % 10}", method.name)
            axis.set(xscale="log", yscale="log", xlabel="seconds since the process's start", ylabel=title, title=scene)
            axis.grid(True, which="both", linewidth=0.3)
            if axis.lines:
                axis.legend(fontsize=8)
        figure.canvas.draw()
        picture = self.pil.Image.fromarray(self.numpy.asarray(figure.canvas.buffer_rgba())).convert("RGB")
        self.pyplot.close(figure)
        self.save(picture, f"{scene}.curves.png")

    def curve(self, record: dict, error: str):
        """Seconds and errors of a run's passes; zero errors cannot be drawn on a logarithmic axis."""
        points = [(entry["seconds"], entry[error]) for entry in record["statistics"]["passes"]
                  if is_number(entry.get(error)) and entry[error] > 0.0]
        return [point[0] for point in points], [point[1] for point in points]

    def draw_method(self, axis, curves, colour: str, name: str) -> None:
        numpy = self.numpy
        for seconds, errors in curves:
            axis.plot(seconds, errors, color=colour, linewidth=0.5, alpha=0.5)
        # Where all seeds have a value: a median of fewer would jump where one begins or ends.
        first, last = max(curve[0][0] for curve in curves), min(curve[0][-1] for curve in curves)
        if first >= last:
            middle = numpy.median([curve[1][-1] for curve in curves])
            axis.plot([numpy.median([curve[0][-1] for curve in curves])], [middle], "o", color=colour, label=name)
            return
        grid = numpy.geomspace(first, last, self.CURVE_POINTS)
        logarithms = [numpy.interp(numpy.log(grid), numpy.log(seconds), numpy.log(errors))
                      for seconds, errors in curves]
        axis.plot(grid, numpy.exp(numpy.median(logarithms, axis=0)), color=colour, linewidth=2.2, label=name)

    # ---- crops

    def draw_strip(self, scene: str, reference: str, done: list[dict]) -> None:
        """The same crop of seed 0 of every method and of the reference, side by side, names above."""
        seed_0 = {record["method"]: record["picture"] for record in done if record["seed"] == 0}
        files = [(method.name, seed_0.get(method.name, "")) for method in self.arguments.methods]
        files.append(("reference", reference[:-len(".exr")] + ".png"))
        pictures = [(name, self.pil.Image.open(path).convert("RGB")) for name, path in files if os.path.isfile(path)]
        if not pictures:
            return
        crop = self.arguments.crop or self.interesting_crop([picture for _, picture in pictures])
        # Small crops are enlarged by a whole factor, so that pixels stay pixels.
        width, height = crop[2] - crop[0], crop[3] - crop[1]
        factor = max(1, self.STRIP_WIDTH // len(pictures) // width)
        strip = self.pil.Image.new("RGB", ((width * factor + 4) * len(pictures) - 4,
                                           height * factor + self.LABEL_HEIGHT), "white")
        pen = self.pil.ImageDraw.Draw(strip)
        for number, (name, picture) in enumerate(pictures):
            left = number * (width * factor + 4)
            enlarged = picture.crop(crop).resize((width * factor, height * factor), self.pil.Image.Resampling.NEAREST)
            pen.text((left + 2, 2), self.shortened(pen, name, width * factor - 4), fill="black")
            strip.paste(enlarged, (left, self.LABEL_HEIGHT))
        self.save(strip, f"{scene}.crops.png")

    def shortened(self, pen, name: str, width: int) -> str:
        """The name, or as much of it as fits."""
        if pen.textlength(name) <= width:
            return name
        while name and pen.textlength(name + "...") > width:
            name = name[:-1]
        return name + "..."

    def interesting_crop(self, pictures) -> tuple[int, int, int, int]:
        """Half as wide and high as the picture, where the pictures differ most from the last one."""
        numpy = self.numpy
        values = [numpy.asarray(picture, dtype=float) for picture in pictures]
        difference = sum(((value - values[-1]) ** 2).sum(axis=2) for value in values)
        height, width = difference.shape
        rows, columns = max(1, height // 2), max(1, width // 2)
        sums = numpy.zeros((height + 1, width + 1))
        sums[1:, 1:] = difference.cumsum(axis=0).cumsum(axis=1)
        window = (sums[rows:, columns:] - sums[:-rows, columns:] - sums[rows:, :-columns] + sums[:-rows, :-columns])
        top, left = numpy.unravel_index(numpy.argmax(window), window.shape)
        return int(left), int(top), int(left) + columns, int(top) + rows

    def save(self, picture, name: str) -> None:
        """Fewer colours, then fewer pixels, until the file is small enough: noise does not compress."""
        path = os.path.join(self.arguments.plots, name)
        picture.save(path, optimize=True)
        colours = 256
        while os.path.getsize(path) >= self.LARGEST_FILE:
            if colours >= 64:
                picture.quantize(colours).save(path, optimize=True)
                colours //= 2
            else:
                colours = 256
                picture = picture.resize((picture.width * 2 // 3, picture.height * 2 // 3))
                picture.save(path, optimize=True)
        say(f"{path}: {os.path.getsize(path) / 1000:.0f} kB")


# ---- command line

def parse_size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"([1-9][0-9]*)[xX]([1-9][0-9]*)", text)
    if not match:
        raise argparse.ArgumentTypeError(f"{text}: not WIDTHxHEIGHT")
    return int(match[1]), int(match[2])


def parse_crop(text: str) -> tuple[int, int, int, int]:
    match = re.fullmatch(r"([0-9]+),([0-9]+),([0-9]+),([0-9]+)", text)
    crop = tuple(map(int, match.groups())) if match else (0, 0, 0, 0)
    if crop[0] >= crop[2] or crop[1] >= crop[3]:
        raise argparse.ArgumentTypeError(f"{text}: not x0,y0,x1,y1 with x0 < x1, y0 < y1")
    return crop


def positive_seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text}: not a positive number of seconds")
    return value


def positive_count(text: str) -> int:
    if not re.fullmatch(r"0*[1-9][0-9]*", text):
        raise argparse.ArgumentTypeError(f"{text}: not a positive whole number")
    return int(text)


class OneLineParser(argparse.ArgumentParser):
    def error(self, message: str):
        self.exit(2, f"error: {message}\n")


def parse_arguments():
    parser = OneLineParser(description=__doc__.splitlines()[0], epilog=__doc__.split("\n\n", 2)[2],
                           formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--render", required=True, help="the render executable")
    parser.add_argument("--work", required=True, help="folder for references and runs")
    parser.add_argument("--scenes", required=True, nargs="+", metavar="SCENE")
    parser.add_argument("--methods", required=True, nargs="+", type=Method, metavar="METHOD")
    parser.add_argument("--time", required=True, type=positive_seconds, help="seconds of wall time for every run")
    parser.add_argument("--output", required=True, help="JSON file for the results")
    parser.add_argument("--seeds", type=positive_count, default=5, help="how many (default %(default)s)")
    parser.add_argument("--size", type=parse_size, default=(320, 240))
    parser.add_argument("--threads", type=positive_count)
    parser.add_argument("--max-depth", type=positive_count)
    parser.add_argument("--reference-method", type=Method, default=Method("guided:preset=paper"))
    parser.add_argument("--reference-time", type=positive_seconds, default=600.0)
    parser.add_argument("--plots", metavar="FOLDER", help="curves and crops, PNG")
    parser.add_argument("--crop", type=parse_crop, help="what the crops show (default: where the pictures differ most)")
    return parser.parse_args()


def check(arguments) -> None:
    """What would otherwise fail after hours."""
    if not (os.path.isfile(arguments.render) and os.access(arguments.render, os.X_OK)):
        raise BenchError(f"{arguments.render}: not an executable")
    arguments.render = os.path.abspath(arguments.render)
    for scene in arguments.scenes:
        if not os.path.isfile(scene):
            raise BenchError(f"{scene}: no such file")
    for kind, names in [("scene", list(map(scene_name, arguments.scenes))),
                        ("method", [file_name(method.name)[:60] for method in arguments.methods])]:
        doubled = [name for name in names if names.count(name) > 1]
        if doubled:
            raise BenchError(f"{kind} {doubled[0]}: given twice; names must differ")
    for folder in [os.path.join(arguments.work, "runs"), os.path.dirname(os.path.abspath(arguments.output)),
                   *([arguments.plots] if arguments.plots else [])]:
        os.makedirs(folder, exist_ok=True)
    if arguments.crop and (arguments.crop[2] > arguments.size[0] or arguments.crop[3] > arguments.size[1]):
        raise BenchError(f"--crop: outside the picture of {arguments.size[0]}x{arguments.size[1]}")


def main() -> int:
    arguments = parse_arguments()
    try:
        check(arguments)
        plotting = Plotting(arguments) if arguments.plots else None
        references = {scene: reference_for(arguments, scene) for scene in arguments.scenes}
        records = run_all(arguments, references)
        summaries = summarise(arguments, records)
        write_json(arguments.output, results_of(arguments, references, records, summaries))
        print(markdown(arguments, summaries))
        for scene, reference in references.items() if plotting else []:
            plotting.draw(scene_name(scene), reference, records)
    except BenchError as error:
        say(f"error: {error}")
        return 1
    except OSError as error:
        say(f"error: {error.filename}: {error.strerror}")
        return 1
    except KeyboardInterrupt:
        say("interrupted; the runs that are done will be reused")
        return INTERRUPTED
    return 1 if any("failure" in record for record in records) else 0


if __name__ == "__main__":
    sys.exit(main())
