"""The command line that the generators with an `--alpha` share."""

from __future__ import annotations

import argparse
import os
import sys


def alpha_value(text: str) -> float:
    """A GGX width as the renderer takes it."""
    try:
        alpha = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text}: not a number") from None
    if not 0.0 <= alpha <= 1.0:
        raise argparse.ArgumentTypeError(f"{text}: must be from 0 to 1")
    return alpha


def run(script: str, description: str, build, default_alpha: float) -> int:
    """Writes what build(alpha) returns, by default beside the script; returns the exit code."""
    parser = argparse.ArgumentParser(description=description.strip().splitlines()[0])
    parser.add_argument("output", nargs="?", default=os.path.splitext(script)[0] + ".glb", metavar="OUT.glb",
                        help="default: beside the generator")
    parser.add_argument("--alpha", type=alpha_value, default=default_alpha,
                        help="GGX width of the caustic's reflectors (default %(default)s)")
    arguments = parser.parse_args()
    try:
        build(arguments.alpha).write(arguments.output)
    except OSError as error:
        print(f"error: {arguments.output}: {error.strerror}", file=sys.stderr)
        return 1
    return 0
