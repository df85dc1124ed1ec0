"""Runs of `render` for the benchmark scripts: methods, scenes, references, resumption, progress."""

from __future__ import annotations

import argparse
import glob
import hashlib
import json
import math
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable

from bench_environment import ROOT, SCENES_FOLDER

REFERENCE_SEED = 1000003
REFERENCES_FOLDER = os.path.join(SCENES_FOLDER, "references")
# A run that takes this much longer than it was given hangs.
HANG_FACTOR, HANG_SECONDS = 3.0, 300.0
INTERRUPTED = 130  # render's exit code after SIGINT or SIGTERM, and ours


class BenchError(Exception):
    """A failure to report in one line."""


class Method:
    """One integrator with its settings: [NAME=]INTEGRATOR[:KEY=VALUE...]."""

    def __init__(self, text: str) -> None:
        head, *self.settings = text.split(":")
        name, has_name, integrator = head.partition("=")
        self.name = name if has_name else text
        self.integrator = integrator if has_name else head
        if not self.name or not re.fullmatch(r"[A-Za-z0-9_-]+", self.integrator):
            raise argparse.ArgumentTypeError(f"{text}: not [NAME=]INTEGRATOR[:KEY=VALUE...]")
        for setting in self.settings:
            if not re.fullmatch(r"[^=]+=.+", setting):
                raise argparse.ArgumentTypeError(f"{text}: '{setting}' is not KEY=VALUE")

    def options(self) -> list[str]:
        return ["-i", self.integrator] + [word for setting in self.settings for word in ("--set", setting)]


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


def write_bytes(path: str, data: bytes) -> None:
    """Whole or not at all."""
    temporary = f"{path}.{os.getpid()}.tmp"
    with open(temporary, "wb") as file:
        file.write(data)
    os.replace(temporary, path)


def write_text(path: str, text: str) -> None:
    """The same."""
    write_bytes(path, text.encode())


def write_json(path: str, value) -> None:
    write_text(path, json.dumps(value, indent=1) + "\n")


# ---- what the command line names

def parse_scenes(text: str) -> list[str]:
    """`all`, or names of scenes/ and paths, by commas."""
    if text == "all":
        return sorted(glob.glob(os.path.join(SCENES_FOLDER, "*.glb")))
    paths = []
    for word in filter(None, text.split(",")):
        known = os.path.join(SCENES_FOLDER, word + ".glb")
        path = known if os.path.isfile(known) else word
        if not os.path.isfile(path):
            raise argparse.ArgumentTypeError(f"{word}: neither a scene of scenes/ nor a file")
        paths.append(path)
    return without_doubles("scene", paths, scene_name)


def parse_methods(text: str) -> list[Method]:
    return without_doubles("method", [Method(word) for word in text.split(",") if word],
                           lambda method: file_name(method.name)[:60])


def without_doubles(kind: str, values: list, name_of) -> list:
    names = [name_of(value) for value in values]
    doubled = [name for name in names if names.count(name) > 1]
    if doubled or not values:
        raise argparse.ArgumentTypeError(f"{kind} {doubled[0]}: given twice; names must differ" if doubled
                                         else f"no {kind} given")
    return values


def parse_size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"([1-9][0-9]*)[xX]([1-9][0-9]*)", text)
    if not match:
        raise argparse.ArgumentTypeError(f"{text}: not WIDTHxHEIGHT")
    return int(match[1]), int(match[2])


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


def add_common_options(parser: argparse.ArgumentParser, out: str) -> None:
    """The options that all scripts share; out: the default folder for results, inside the repository."""
    parser.add_argument("--scenes", type=parse_scenes, default="all", metavar="A,B",
                        help="names of scenes/, or files (default: all)")
    parser.add_argument("--render", default=os.path.join(ROOT, "build", "release", "bin", "render"), metavar="BINARY",
                        help="default: build/release/bin/render")
    parser.add_argument("--out", default=os.path.join(ROOT, out), metavar="FOLDER", help=f"default: {out}")
    parser.add_argument("--size", type=parse_size, default=(320, 240), help="default: 320x240")
    parser.add_argument("--threads", type=positive_count)
    parser.add_argument("--max-depth", type=positive_count)


def check_render(arguments) -> None:
    if not (os.path.isfile(arguments.render) and os.access(arguments.render, os.X_OK)):
        raise BenchError(f"{arguments.render}: not an executable; build it or give --render")
    arguments.render = os.path.abspath(arguments.render)
    os.makedirs(os.path.join(arguments.out, "runs"), exist_ok=True)


# ---- progress

class Progress:
    """A bar on a terminal, lines elsewhere; on standard error."""

    WIDTH = 30

    def __init__(self, total: int) -> None:
        self.total, self.done, self.start = total, 0, time.monotonic()
        self.rendered, self.seconds = 0, 0.0
        self.bar = sys.stderr.isatty()

    def begin(self, what: str) -> None:
        if not self.bar:
            return
        filled = self.WIDTH * self.done // max(1, self.total)
        left = ""
        if self.rendered:
            seconds = int(self.seconds / self.rendered * (self.total - self.done))
            left = f", about {seconds // 3600}:{seconds // 60 % 60:02}:{seconds % 60:02} left"
        sys.stderr.write(f"\r\033[K[{'#' * filled}{'.' * (self.WIDTH - filled)}] {self.done}/{self.total} {what}{left}")
        sys.stderr.flush()

    def end(self, line: str, seconds: float, reused: bool, failed: bool = False) -> None:
        self.done += 1
        if not reused:
            self.rendered, self.seconds = self.rendered + 1, self.seconds + seconds
        if not self.bar or failed:
            clear = "\r\033[K" if self.bar else ""
            say(f"{clear}[{self.done}/{self.total}] {line}{' (done before)' if reused else f', {seconds:.1f} s'}")

    def close(self) -> None:
        if self.bar:
            sys.stderr.write("\r\033[K")


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def exit_code(work: Callable[[], bool]) -> int:
    """Of a script that does `work`, which says whether all went well; what goes wrong becomes one line."""
    try:
        return 0 if work() else 1
    except BenchError as error:
        say(f"error: {error}")
        return 1
    except OSError as error:
        say(f"error: {error.filename}: {error.strerror}")
        return 1
    except KeyboardInterrupt:
        say("interrupted; the runs that are done will be reused")
        return INTERRUPTED


# ---- running

def common_options(arguments) -> list[str]:
    options = ["-q", "--size", "x".join(map(str, arguments.size))]
    for name in ["threads", "max_depth"]:
        if getattr(arguments, name) is not None:
            options += ["--" + name.replace("_", "-"), str(getattr(arguments, name))]
    return options


def run_render(arguments, options: list[str], stem: str, longest: float) -> str | None:
    """Renders to STEM.exr and, at last, STEM.json {wall_seconds, statistics}; returns what went wrong.

    The files get their names after success only: an interrupted run leaves nothing that looks finished.
    longest: how many seconds the run may take before it counts as hanging.
    """
    picture, statistics = f"{stem}.part.exr", f"{stem}.part.json"
    command = [arguments.render, *common_options(arguments), *options, "--stats", statistics, "-o", picture]
    try:
        start = time.monotonic()
        failure = run_process(command, longest)
        wall_seconds = time.monotonic() - start
        if failure is None:
            known = read_json(statistics)
            if known is None:
                return f"{statistics}: no statistics"
            os.replace(picture, stem + ".exr")
            write_json(stem + ".json", {"wall_seconds": wall_seconds, "statistics": known})
        return failure
    finally:
        for path in (picture, statistics):
            if os.path.exists(path):
                os.remove(path)


def run_process(command: list[str], longest: float) -> str | None:
    try:
        result = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=longest)
    except subprocess.TimeoutExpired:
        return f"still running after {longest:.0f} s, killed"
    if result.returncode in (INTERRUPTED, -2):
        raise KeyboardInterrupt
    if result.returncode != 0:
        lines = [line for line in result.stderr.splitlines() if line.strip()] or ["no message"]
        return f"exit code {result.returncode}: {lines[-1]}"
    return None


def longest_run(seconds: float) -> float:
    return HANG_FACTOR * seconds + HANG_SECONDS


class Hashes:
    """Digests of files, each read once."""

    def __init__(self) -> None:
        self.known: dict[str, str] = {}

    def __getitem__(self, path: str) -> str:
        if path not in self.known:
            self.known[path] = digest(path)
        return self.known[path]


def one_run(arguments, scene: str, reference: str | None, method: Method, seed: int, limit: list[str], longest: float,
            hashes: Hashes) -> dict:
    """The record of one run, taken from the folder if the same was done before.

    limit: the options that end the run. With a reference, the statistics must hold finite errors.
    """
    options = [*method.options(), "--seed", str(seed), *limit]
    inputs = [hashes[path] for path in (scene, reference, arguments.render) if path]
    key = hashlib.sha256(json.dumps([inputs, common_options(arguments), options]).encode()).hexdigest()[:12]
    stem = os.path.join(arguments.out, "runs", f"{scene_name(scene)}.{file_name(method.name)[:60]}.{seed}.{key}")
    record = {"scene": scene_name(scene), "method": method.name, "seed": seed, "options": options,
              "picture": os.path.relpath(stem + ".exr", arguments.out), "record": os.path.basename(stem) + ".json"}
    known = read_json(stem + ".json")
    record["reused"] = is_complete(known, reference) and os.path.exists(stem + ".exr")
    if not record["reused"]:
        against = ["--reference", reference] if reference else []
        failure = run_render(arguments, [*options, *against, scene], stem, longest)
        known = None if failure else read_json(stem + ".json")
        if not is_complete(known, reference):
            record["failure"] = failure or "no finite error against the reference"
            return record
    record.update(known)
    return record


def is_complete(known, reference: str | None) -> bool:
    """Whether this is the record of a run that was finished and, against a reference, measured."""
    if not known or "wall_seconds" not in known:
        return False
    if reference is None:
        return True
    statistics = known.get("statistics", {})
    return bool(statistics.get("passes")) and all(is_number(statistics.get("error", {}).get(name))
                                                  for name in ("rmse", "relmse", "relmse_trimmed"))


def is_number(value) -> bool:
    return isinstance(value, (int, float)) and math.isfinite(value)


# ---- references

def reference_stem(folder: str, scene: str, size: tuple[int, int]) -> str:
    return os.path.join(folder, f"{scene_name(scene)}.{size[0]}x{size[1]}")


def made_of(arguments, scene: str) -> dict:
    """What a reference must have been made of to serve."""
    return {"scene_sha256": digest(scene), "max_depth": arguments.max_depth}


def reference_for(arguments, scene: str) -> str:
    """The scene's reference: of scenes/references, of the folder for references, or rendered now into that."""
    wanted = made_of(arguments, scene)
    own = arguments.references or os.path.join(arguments.out, "references")
    for folder in (REFERENCES_FOLDER, own):
        stem = reference_stem(folder, scene, arguments.size)
        if not os.path.exists(stem + ".exr"):
            continue
        recorded = read_json(stem + ".json")
        if recorded is None:
            say(f"{stem}.exr: taken as it is; nothing says how it was made")
        elif any(recorded.get(key) != value for key, value in wanted.items()):
            if folder == REFERENCES_FOLDER:
                say(f"{stem}.exr: of another version of the scene or another depth; not used")
                continue
            raise BenchError(f"{stem}.exr: made of another version of the scene or with another depth; delete it")
        return stem + ".exr"
    return render_reference(arguments, scene, wanted, own)


def render_reference(arguments, scene: str, wanted: dict, folder: str) -> str:
    stem = reference_stem(folder, scene, arguments.size)
    os.makedirs(os.path.dirname(stem), exist_ok=True)
    method, seconds = arguments.reference_method, arguments.reference_time
    say(f"reference of {scene_name(scene)}: {method.name}, {seconds:g} s")
    options = [*method.options(), "--seed", str(REFERENCE_SEED), "--time", str(seconds), scene]
    failure = run_render(arguments, options, stem, longest_run(seconds))
    if failure:
        raise BenchError(f"reference of {scene_name(scene)}: {failure}")
    write_json(stem + ".json", {**wanted, "methods": [method.name], "seconds": seconds, **read_json(stem + ".json")})
    return stem + ".exr"


def add_reference_options(parser: argparse.ArgumentParser, folder: str | None = None) -> None:
    """folder: for references, inside the repository, if not in the folder for results."""
    parser.add_argument("--references", metavar="FOLDER", default=os.path.join(ROOT, folder) if folder else None,
                        help=f"for references that scenes/references has not (default: {folder or 'OUT/references'})")
    parser.add_argument("--reference-method", type=Method, default=Method("guided"),
                        help="what renders a missing reference (default: guided)")
    parser.add_argument("--reference-time", type=positive_seconds, default=600.0,
                        help="seconds for a missing reference (default: 600)")
