"""Errors of pictures and what many runs say about them: FLIP, noise, slopes, medians, time ratios."""

from __future__ import annotations

import io
import math
import os
import statistics

import numpy
import OpenEXR

from bench_runs import BenchError, is_number, read_json, write_json

ERRORS = ["rmse", "relmse", "relmse_trimmed", "flip"]
NOISES = ["noise_rmse", "noise_rmse_but_ten", "noise_relmse_trimmed"]
# RMSE falls with the square root of time, so its square counts; relMSE is a square already.
POWERS = {"rmse": 2.0, "relmse": 1.0, "relmse_trimmed": 1.0}
LEAST_CONFIDENCE = 0.9
# The error pictures show |difference| / sqrt(reference^2 + 0.01) on this logarithmic scale.
LOWEST_ERROR, HIGHEST_ERROR = 1e-2, 1e1


# ---- pictures

def read_exr(path: str) -> numpy.ndarray:
    """Linear RGB, [row, column, channel], 32-bit floats."""
    try:
        with OpenEXR.File(path, separate_channels=True) as file:
            channels = file.channels()
            return numpy.stack([numpy.array(channels[name].pixels, dtype=numpy.float32) for name in "RGB"], axis=-1)
    except (RuntimeError, KeyError, OSError) as error:
        raise BenchError(f"{path}: cannot be read as an RGB picture: {error}") from None


def write_half_exr(path: str, picture: numpy.ndarray, attributes: dict[str, str]) -> None:
    """16-bit floats, compressed; whole or not at all."""
    if not numpy.isfinite(picture).all() or picture.max() > 65504.0:
        raise BenchError(f"{path}: values that 16-bit floats cannot hold")
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **attributes}
    halves = picture.astype(numpy.float16)
    temporary = f"{path}.{os.getpid()}.tmp.exr"
    with OpenEXR.File(header, {name: numpy.ascontiguousarray(halves[..., c]) for c, name in enumerate("RGB")}) as file:
        file.write(temporary)
    os.replace(temporary, path)


def luminance(picture: numpy.ndarray) -> numpy.ndarray:
    return picture @ numpy.array([0.2126, 0.7152, 0.0722], dtype=picture.dtype)


def exposure_of(reference: numpy.ndarray) -> float:
    """The factor that brings the 95th percentile of the luminance to 0.6, as `render` exposes its PNG files."""
    percentile = float(numpy.percentile(luminance(reference), 95.0))
    return 0.6 / percentile if percentile > 0.0 else 1.0


def tone_mapped(picture: numpy.ndarray, exposure: float) -> numpy.ndarray:
    """8-bit sRGB; values above 0.6 are compressed by an exponential shoulder."""
    values = numpy.maximum(numpy.nan_to_num(picture * exposure), 0.0)
    shoulder = 0.6 + 0.4 * (1.0 - numpy.exp(-(numpy.maximum(values, 0.6) - 0.6) / 0.4))
    values = numpy.where(values > 0.6, shoulder, values)
    encoded = numpy.where(values <= 0.0031308, 12.92 * values, 1.055 * numpy.power(values, 1.0 / 2.4) - 0.055)
    return (numpy.clip(encoded, 0.0, 1.0) * 255.0 + 0.5).astype(numpy.uint8)


def error_map(picture: numpy.ndarray, reference: numpy.ndarray) -> numpy.ndarray:
    """The root of a pixel's relMSE, as a place from 0 to 1 on the logarithmic scale."""
    squared = ((picture - reference) ** 2 / (reference ** 2 + 0.01)).mean(axis=-1)
    decades = math.log10(HIGHEST_ERROR / LOWEST_ERROR)
    return numpy.clip(numpy.log10(numpy.sqrt(squared) / LOWEST_ERROR + 1e-30) / decades, 0.0, 1.0)


def png_bytes(pixels: numpy.ndarray) -> bytes:
    from PIL import Image
    output = io.BytesIO()
    Image.fromarray(pixels).save(output, "PNG", optimize=True)
    return output.getvalue()


# ---- errors of one picture

def measure(picture: numpy.ndarray, reference: numpy.ndarray) -> dict[str, float]:
    """RMSE, relMSE and trimmed relMSE as `render --stats` has them."""
    difference = picture.astype(float) - reference
    relative = (difference ** 2 / (reference.astype(float) ** 2 + 0.01)).mean(axis=-1).ravel()
    kept = numpy.sort(relative)[:len(relative) - len(relative) // 1000]
    return {"rmse": float(numpy.sqrt((difference ** 2).mean())), "relmse": float(relative.mean()),
            "relmse_trimmed": float(kept.mean())}


def hdr_flip(picture: numpy.ndarray, reference: numpy.ndarray) -> float:
    """HDR-FLIP (Andersson et al. 2021), mean over the pixels, at the default 67 pixels per degree."""
    import flip_evaluator
    clean = [numpy.ascontiguousarray(numpy.maximum(numpy.nan_to_num(values), 0.0), dtype=numpy.float32)
             for values in (reference, picture)]
    return float(flip_evaluator.evaluate(*clean, "HDR", applyMagma=False)[1])


def add_flip(record: dict, out: str, reference_path: str, reference: numpy.ndarray, reference_hash: str) -> None:
    """Puts record['flip']; kept beside the run for the next time."""
    kept = os.path.join(out, "runs", record["record"][:-len(".json")] + ".flip.json")
    known = read_json(kept)
    if not known or known.get("reference_sha256") != reference_hash:
        picture = read_exr(os.path.join(out, record["picture"]))
        if picture.shape != reference.shape:
            raise BenchError(f"{reference_path}: {reference.shape[1]}x{reference.shape[0]} pixels, the runs have "
                             f"{picture.shape[1]}x{picture.shape[0]}")
        known = {"reference_sha256": reference_hash, "flip": hdr_flip(picture, reference),
                 "mean_ratio": float(picture.mean(dtype=float) / max(1e-30, reference.mean(dtype=float)))}
        write_json(kept, known)
    record["flip"], record["mean_ratio"] = known["flip"], known["mean_ratio"]


def noise_of(pictures: list[numpy.ndarray]) -> dict[str, float]:
    """The errors that the spread of independent pictures explains, without any reference; empty for a single picture.

    The RMSE, the RMSE without the ten worst pixels (dots), and the relMSE without the worst 0.1 % of the pixels.
    """
    if len(pictures) < 2:
        return {}
    stack = numpy.stack(pictures).astype(float)
    variance = numpy.var(stack, axis=0, ddof=1)
    relative = numpy.sort((variance / (stack.mean(axis=0) ** 2 + 0.01)).mean(axis=-1).ravel())
    squares = numpy.sort(variance.mean(axis=-1).ravel())
    return {"noise_rmse": float(numpy.sqrt(squares.mean())),
            "noise_rmse_but_ten": float(numpy.sqrt(squares[:-10].sum() / len(squares))),
            "noise_relmse_trimmed": float(relative[:len(relative) - len(relative) // 1000].mean())}


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
    result = {name: known["error"][name] for name in ERRORS if name != "flip"}
    result.update(flip=record["flip"], mean_ratio=record["mean_ratio"], spp=mean_spp(known),
                  precompute_seconds=known["seconds"]["precompute"], first_pass_seconds=known["passes"][0]["seconds"],
                  wall_seconds=record["wall_seconds"], peak_rss_bytes=known["peak_rss_bytes"],
                  nonfinite_samples=known["nonfinite_samples"], slope=fitted_slope(known))
    return result


# ---- medians

def interval_rank(count: int) -> tuple[int, float]:
    """(k, confidence): the k-th smallest and k-th largest of `count` values enclose the median so surely.

    The innermost order statistics of at least LEAST_CONFIDENCE, or the outermost: 1 - 2 P(fewer than k of `count`
    fair coins show heads).
    """
    def confidence(k: int) -> float:
        return 1.0 - 2.0 * sum(math.comb(count, j) for j in range(k)) / 2.0 ** count

    k = 1
    while 2 * (k + 1) <= count and confidence(k + 1) >= LEAST_CONFIDENCE:
        k += 1
    return k, max(0.0, confidence(k))


def median_with_interval(values: list) -> dict | None:
    numbers = sorted(value for value in values if value is not None)
    if not numbers:
        return None
    k, confidence = interval_rank(len(numbers))
    return {"median": statistics.median(numbers), "lowest": numbers[k - 1], "highest": numbers[-k],
            "confidence": confidence, "count": len(numbers)}


# ---- ratios

def time_ratio(name: str, first: dict, other: dict) -> float | None:
    """How many times longer `first` would need for the error of `other`, by error^power ~ 1 / time."""
    if other[name] <= 0.0:
        return None
    return (first[name] / other[name]) ** POWERS[name] * first["wall_seconds"] / other["wall_seconds"]


def median_curve(records: list[dict], error: str) -> tuple[numpy.ndarray, numpy.ndarray] | None:
    """(seconds since the process's start, error): the median over the runs of curves through their passes.

    Where all runs have a value only: a median of fewer would jump where one begins or ends.
    """
    curves = [curve for curve in (curve_of(record, error) for record in records) if len(curve[0])]
    if not curves:
        return None
    first, last = max(curve[0][0] for curve in curves), min(curve[0][-1] for curve in curves)
    if first >= last:
        return (numpy.array([numpy.median([curve[0][-1] for curve in curves])]),
                numpy.array([numpy.median([curve[1][-1] for curve in curves])]))
    grid = numpy.geomspace(first, last, 60)
    logarithms = [numpy.interp(numpy.log(grid), numpy.log(seconds), numpy.log(errors)) for seconds, errors in curves]
    return grid, numpy.exp(numpy.median(logarithms, axis=0))


def curve_of(record: dict, error: str) -> tuple[list[float], list[float]]:
    """Seconds and errors of a run's passes; zero errors cannot be drawn on a logarithmic axis."""
    points = [(entry["seconds"], entry[error]) for entry in record["statistics"]["passes"]
              if is_number(entry.get(error)) and entry[error] > 0.0]
    return [point[0] for point in points], [point[1] for point in points]


def seconds_to_reach(curve, target: float) -> float | None:
    """When the error falls to the target for good; None if it stays above."""
    if curve is None or curve[1][-1] > target:
        return None
    above = numpy.nonzero(curve[1] > target)[0]
    return float(curve[0][above[-1] + 1 if len(above) else 0])


# ---- summaries

def summarise(scenes: list[str], methods: list[str], records: list[dict], noise: dict) -> list[dict]:
    """One entry per scene and method; noise[scene, method] is what noise_of gives."""
    result = []
    for scene in scenes:
        of_scene = [record for record in records if record["scene"] == scene]
        done = {name: [r for r in of_scene if r["method"] == name and "failure" not in r] for name in methods}
        for name in methods:
            failures = [r["failure"] for r in of_scene if r["method"] == name and "failure" in r]
            entry = {"scene": scene, "method": name, "runs": len(done[name]), "failures": failures,
                     **noise.get((scene, name), {})}
            entry.update(medians_of(done[name]))
            entry.update(against_first(done[methods[0]], done[name]))
            result.append(entry)
    return result


def medians_of(records: list[dict]) -> dict:
    values = [values_of(record) for record in records]
    return {key: median_with_interval([value[key] for value in values]) for key in values[0]} if values else {}


def against_first(first: list[dict], own: list[dict]) -> dict:
    """Time ratios to the first method; their intervals are those of runs of the same seed, neighbours in time."""
    if not first or not own:
        return {}
    result = {}
    by_seed = [{record["seed"]: values_of(record) for record in records} for records in (first, own)]
    for error in POWERS:
        middle = [{key: statistics.median(v[key] for v in values.values()) for key in (error, "wall_seconds")}
                  for values in by_seed]
        pairs = [time_ratio(error, by_seed[0][seed], by_seed[1][seed]) for seed in by_seed[0] if seed in by_seed[1]]
        spread = median_with_interval(pairs) or {"lowest": None, "highest": None}
        result[f"time_ratio_{error}"] = {"median": time_ratio(error, *middle), "lowest": spread["lowest"],
                                         "highest": spread["highest"]}
        first_curve, curve = median_curve(first, error), median_curve(own, error)
        target = None if first_curve is None else float(first_curve[1][-1])
        result[f"seconds_to_first_{error}"] = None if target is None else seconds_to_reach(curve, target)
    return result
