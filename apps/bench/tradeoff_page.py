"""Plots, tables and the page docs/tradeoffs.md from what tradeoff.py measured."""

from __future__ import annotations

import os

from bench_runs import write_text
from report import number, parts

PAGE_HEAD = """# What the settings of `guided` trade

{size} pixels, {seeds} seeds, medians (intervals in brackets). "Equal spp": {spp} samples a pixel, however long they
take; "equal time": {seconds} s of wall time from the process's start, precomputation included. One setting changes at a
time, the others keep their defaults. trimmed: relMSE without the worst 0.1 % of the pixels. Lower is better everywhere
but in spp. `path` is measured where the scene changes.

Written by `python3 apps/bench/tradeoff.py --page docs/tradeoffs.md` from the results of
`python3 apps/bench/tradeoff.py`; docs/benchmark.md explains both.
"""
COLUMNS = [  # title, equal, key, factor
    ("precompute s", "spp", "precompute_seconds", 1.0), ("guide MiB", "spp", "guide_bytes", 2.0 ** -20),
    ("peak MiB", "spp", "peak_rss_bytes", 2.0 ** -20), ("seconds, equal spp", "spp", "wall_seconds", 1.0),
    ("RMSE, equal spp", "spp", "rmse", 1.0), ("trimmed, equal spp", "spp", "relmse_trimmed", 1.0),
    ("spp, equal time", "time", "spp", 1.0), ("RMSE, equal time", "time", "rmse", 1.0),
    ("trimmed, equal time", "time", "relmse_trimmed", 1.0)]


def point_of(sweep: dict, value: str, integrator: str, equal: str) -> dict:
    return next((point for point in sweep["points"] if point["value"] == value and point["integrator"] == integrator
                 and point["equal"] == equal), {})


def values_of(sweep: dict) -> list[str]:
    return list(dict.fromkeys(point["value"] for point in sweep["points"]))


def integrators_of(sweep: dict) -> list[str]:
    return list(dict.fromkeys(point["integrator"] for point in sweep["points"]))


# ---- tables

def table(sweep: dict) -> str:
    titles = [sweep["knob"], *(["integrator"] if len(integrators_of(sweep)) > 1 else []), *(c[0] for c in COLUMNS)]
    lines = ["| " + " | ".join(titles) + " |", "|" + "---|" * len(titles)]
    for value in values_of(sweep):
        for integrator in integrators_of(sweep):
            head = [f"**{value}**" if value == sweep["default"] else value]
            if len(integrators_of(sweep)) > 1:
                head.append(integrator)
            cells = [cell(point_of(sweep, value, integrator, equal).get(key), factor)
                     for _, equal, key, factor in COLUMNS]
            lines.append("| " + " | ".join(head + cells) + " |")
    for point in sweep["points"]:
        where = f"{sweep['knob']}={point['value']}, {point['integrator']}, equal {point['equal']}"
        lines += [f"\nFAILED: {where}: {failure}" for failure in dict.fromkeys(point["failures"])]
    return "\n".join(lines)


def cell(value: dict | None, factor: float) -> str:
    middle, interval = parts(value, 3, factor)
    return f"{middle} ({interval})" if interval else middle


def tables(results: dict) -> str:
    return "\n\n".join(f"{sweep['scene']}, {sweep['knob']}: {sweep['meaning']}\n\n{table(sweep)}"
                       for sweep in results["sweeps"])


# ---- plots

def draw_all(results: dict, folder: str, prefix: str = "") -> dict[tuple[str, str], str]:
    """One PNG per scene and knob; their names by (scene, knob)."""
    import matplotlib
    matplotlib.use("Agg")
    os.makedirs(folder, exist_ok=True)
    names = {}
    for sweep in results["sweeps"]:
        name = f"{prefix}{sweep['knob']}_{sweep['scene']}.png"
        draw(sweep, os.path.join(folder, name))
        names[sweep["scene"], sweep["knob"]] = name
    return names


def draw(sweep: dict, path: str) -> None:
    """Errors at equal time and at equal spp, and the seconds and bytes that they cost, over the knob's values."""
    from matplotlib import pyplot
    figure, axes = pyplot.subplots(1, 4, figsize=(13.2, 3.1), layout="constrained")
    values = values_of(sweep)
    ordered = are_numbers(values)
    logarithmic = ordered and all(float(value) > 0.0 for value in values)
    for axis, (title, equal, key, factor) in zip(axes, [
            ("trimmed relMSE, equal time", "time", "relmse_trimmed", 1.0),
            ("trimmed relMSE, equal spp", "spp", "relmse_trimmed", 1.0),
            ("precompute, s", "spp", "precompute_seconds", 1.0), ("guide, MiB", "spp", "guide_bytes", 2.0 ** -20)]):
        middles = []
        for place, integrator in enumerate(integrators_of(sweep)):
            middles += draw_line(axis, sweep, logarithmic, "o-" if ordered else "o", integrator, equal, key, factor,
                                 f"C{place}")
        if logarithmic:
            axis.set_xscale("log")
        else:
            axis.set_xticks(range(len(values)), values, rotation=45 if len(values) > 4 else 0)
        if "relmse" in key and middles and min(middles) > 0.0:
            axis.set_yscale("log")
        axis.set(xlabel=sweep["knob"], title=title)
        axis.title.set_fontsize(10)
        axis.grid(True, which="major", linewidth=0.4)
        axis.spines[["top", "right"]].set_visible(False)
    if len(integrators_of(sweep)) > 1:
        axes[0].legend(fontsize=8, frameon=False)
    figure.suptitle(f"{sweep['scene']}: {sweep['meaning']}", fontsize=10)
    figure.savefig(path, dpi=90, metadata={"Software": None})
    pyplot.close(figure)


def are_numbers(values: list[str]) -> bool:
    try:
        return all(isinstance(float(value), float) for value in values)
    except ValueError:
        return False


def draw_line(axis, sweep, logarithmic, style, integrator, equal, key, factor, colour) -> list[float]:
    """Medians with their intervals over the values, and a dotted line at the default; returns the medians."""
    places, middles, below, above = [], [], [], []
    for place, value in enumerate(values_of(sweep)):
        found = point_of(sweep, value, integrator, equal).get(key)
        if not found or found["median"] is None:
            continue
        places.append(float(value) if logarithmic else place)
        middles.append(found["median"] * factor)
        below.append((found["median"] - found["lowest"]) * factor)
        above.append((found["highest"] - found["median"]) * factor)
        if value == sweep["default"]:
            axis.axvline(places[-1], color="#9aa4b0", linewidth=0.9, linestyle=":")
    axis.errorbar(places, middles, yerr=[below, above], fmt=style, color=colour, markersize=4,
                  linewidth=1.6, elinewidth=0.8, capsize=2, label=integrator)
    return middles


# ---- the page

def findings(sweep: dict) -> str:
    """One measured sentence: which value has the smallest error, and what the default has."""
    rows = [(value, integrator, point_of(sweep, value, integrator, "time").get("relmse_trimmed"))
            for value in values_of(sweep) for integrator in integrators_of(sweep)]
    rows = [(value, integrator, found["median"]) for value, integrator, found in rows if found]
    own = [row for row in rows if row[1] == "guided"]
    if not own:
        return ""
    if len(integrators_of(sweep)) > 1:
        return " ".join(f"{sweep['knob']} {value}: {number(gain(rows, value), 3)} times `path`'s trimmed relMSE."
                        for value in values_of(sweep) if gain(rows, value) is not None)
    best = min(own, key=lambda row: row[2])
    text = f"Smallest trimmed relMSE at equal time: {number(best[2], 3)}, at {best[0]}"
    default = next((row for row in own if row[0] == sweep["default"]), None)
    if default and default is not best:
        text += f" (the default {default[0]}: {number(default[2], 3)})"
    return text + "."


def gain(rows: list, value: str) -> float | None:
    """guided's error over path's."""
    errors = {integrator: error for v, integrator, error in rows if v == value}
    return errors["guided"] / errors["path"] if len(errors) == 2 and errors["path"] > 0.0 else None


def write_page(results: dict, path: str) -> None:
    """The page, and its plots beside it."""
    folder = os.path.dirname(os.path.abspath(path))
    names = draw_all(results, folder, "tradeoff_")
    size = "x".join(map(str, results["size"]))
    sections = [PAGE_HEAD.format(size=size, seeds=results["seeds"], spp=results["spp"],
                                 seconds=f"{results['seconds']:g}")]
    for knob in dict.fromkeys(sweep["knob"] for sweep in results["sweeps"]):
        own = [sweep for sweep in results["sweeps"] if sweep["knob"] == knob]
        default = f" Default: {own[0]['default']}." if own[0]["default"] else ""
        sections.append(f"## {knob}\n{own[0]['meaning'][0].upper()}{own[0]['meaning'][1:]}.{default}\n")
        for sweep in own:
            picture = names[sweep["scene"], knob]
            sections.append(f"### {sweep['scene']}\n{findings(sweep)}\n\n![{knob}, {sweep['scene']}]({picture})\n\n"
                            f"{table(sweep)}\n")
    write_text(path, "\n".join(sections))
