"""The virtual environment that the benchmark scripts run in: made when missing, then entered."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys

BENCH_FOLDER = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(BENCH_FOLDER))
SCENES_FOLDER = os.path.join(ROOT, "scenes")


def enter(folder: str, requirements: str) -> None:
    """Goes on in the environment ROOT/folder, made from the requirements; nothing where it is the present one."""
    venv = os.path.join(ROOT, folder)
    python = os.path.join(venv, "bin", "python")
    if os.path.realpath(sys.prefix) == os.path.realpath(venv):
        return
    stamp = os.path.join(venv, "requirements.sha256")
    with open(requirements, "rb") as file:
        wanted = hashlib.sha256(file.read()).hexdigest()
    if not is_current(stamp, wanted):
        make(venv, python, requirements)
        with open(stamp, "w") as file:
            file.write(wanted)
    os.execv(python, [python, "-B", *sys.argv])


def is_current(stamp: str, wanted: str) -> bool:
    try:
        with open(stamp) as file:
            return file.read() == wanted
    except FileNotFoundError:
        return False


def make(venv: str, python: str, requirements: str) -> None:
    print(f"installing Python packages into {os.path.relpath(venv)}", file=sys.stderr, flush=True)
    for command in [[sys.executable, "-m", "venv", venv],
                    [python, "-m", "pip", "install", "-q", "--disable-pip-version-check", "-r", requirements]]:
        if subprocess.run(command).returncode != 0:
            print(f"error: {' '.join(command)} failed; it needs the package python3-venv and the network",
                  file=sys.stderr)
            sys.exit(1)


def enter_bench() -> None:
    """The environment with numpy, matplotlib, OpenEXR and FLIP."""
    enter(os.path.join("build", "bench-venv"), os.path.join(BENCH_FOLDER, "requirements.txt"))
