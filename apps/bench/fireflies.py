#!/usr/bin/env python3
"""Counts fireflies: pixels of a picture far above what a reference holds around them. JSON on standard output.

Usage: fireflies.py IMAGE.exr REFERENCE.exr [--factor 50] [--radius 2] [--worst 20]

A pixel is a firefly where its luminance exceeds FACTOR times the mean luminance of the reference in the window of
2 RADIUS + 1 pixels about it (the part of it inside the picture). The mean is taken as at least a hundredth of the
median luminance of the lit pixels of the image, so that black surroundings do not make every pixel one. Non-finite
pixels of the image are counted apart.

Needs numpy and OpenEXR (pip install numpy OpenEXR).
"""

from __future__ import annotations

import argparse
import json
import os
import sys

try:
    import numpy
    import OpenEXR
except ImportError as error:
    sys.exit(f"error: {error}; pip install numpy OpenEXR")

LUMINANCE = (0.2126, 0.7152, 0.0722)  # Rec. 709, as the renderer's
FLOOR = 0.01  # of the image's median


def read_luminance(path: str) -> numpy.ndarray:
    """Of the default layer, rows from the top."""
    if not os.path.isfile(path):  # OpenEXR would print a line of its own.
        sys.exit(f"error: {path}: no such file")
    try:
        with OpenEXR.File(path, separate_channels=True) as file:
            channels = file.channels()
            return sum(numpy.asarray(channels[name].pixels, numpy.float64) * weight
                       for name, weight in zip("RGB", LUMINANCE))
    except KeyError as error:
        sys.exit(f"error: {path}: channel {error}: not there; give a colour picture")
    except Exception as error:  # OpenEXR raises what its C++ library throws.
        sys.exit(f"error: {path}: {error}")


def window_mean(picture: numpy.ndarray, radius: int) -> numpy.ndarray:
    """Mean of the window about each pixel, cut off at the borders."""
    def window_sum(values):
        padded = numpy.pad(values, radius)
        windows = numpy.lib.stride_tricks.sliding_window_view(padded, (2 * radius + 1, 2 * radius + 1))
        return windows.sum(axis=(2, 3))
    return window_sum(picture) / window_sum(numpy.ones_like(picture))


def find_fireflies(image: numpy.ndarray, reference: numpy.ndarray, factor: float, radius: int, worst: int) -> dict:
    finite = numpy.isfinite(image)
    lit = image[finite & (image > 0.0)]
    floor = FLOOR * float(numpy.median(lit)) if lit.size else 0.0
    surroundings = numpy.maximum(window_mean(reference, radius), floor)
    ratio = numpy.zeros_like(image)
    numpy.divide(image, surroundings, out=ratio, where=finite & (surroundings > 0.0))
    rows, columns = numpy.nonzero(ratio > factor)
    order = numpy.argsort(-ratio[rows, columns], kind="stable")[:worst]
    pixels = [{"x": int(x), "y": int(y), "luminance": float(image[y, x]), "surroundings": float(surroundings[y, x]),
               "ratio": float(ratio[y, x])} for y, x in zip(rows[order], columns[order])]
    return {"count": int(rows.size), "share": rows.size / image.size, "nonfinite": int(image.size - finite.sum()),
            "floor": floor, "worst": pixels}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], epilog=__doc__.split("\n\n", 2)[2],
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("image")
    parser.add_argument("reference")
    parser.add_argument("--factor", type=float, default=50.0, help="default %(default)s")
    parser.add_argument("--radius", type=int, default=2, help="pixels (default %(default)s)")
    parser.add_argument("--worst", type=int, default=20, help="how many to list (default %(default)s)")
    arguments = parser.parse_args()
    if not (arguments.factor > 0.0 and arguments.radius >= 0 and arguments.worst >= 0):
        parser.error("--factor must be above zero, --radius and --worst not below")
    image, reference = read_luminance(arguments.image), read_luminance(arguments.reference)
    if image.shape != reference.shape:
        sys.exit(f"error: {arguments.reference}: {reference.shape[1]}x{reference.shape[0]} pixels, not "
                 f"{image.shape[1]}x{image.shape[0]} as {arguments.image}; render both with the same --size and --crop")
    if not numpy.isfinite(reference).all():
        sys.exit(f"error: {arguments.reference}: holds non-finite pixels; render it again")
    print(json.dumps({"image": arguments.image, "reference": arguments.reference, "factor": arguments.factor,
                      "radius": arguments.radius,
                      **find_fireflies(image, reference, arguments.factor, arguments.radius, arguments.worst)}, indent=1))


if __name__ == "__main__":
    main()
