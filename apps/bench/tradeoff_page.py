"""Plots, tables and the page docs/tradeoffs.md from what tradeoff.py measured."""

from __future__ import annotations

import math
import os

from bench_runs import write_text

PAGE_HEAD = """# What the settings of `guided` trade

{size} pixels, {seeds}. "Equal spp": {spp} samples a pixel, however long they
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
    if not value or value["median"] is None:
        return "–"
    middle = number(value["median"] * factor)
    ends = [number(value[key] * factor) for key in ("lowest", "highest") if value[key] is not None]
    return f"{middle} ({' … '.join(ends)})" if len(set(ends)) == 2 else middle


def number(value: float) -> str:
    return f"{value:.3g}"


def tables(results: dict) -> str:
    return "\n\n".join(f"{sweep['scene']}, {sweep['knob']}: {sweep['meaning']}\n\n{table(sweep)}"
                       for sweep in results["sweeps"])


# ---- plots

PANELS = [  # title, equal, key, factor
    ("trimmed relMSE, equal time", "time", "relmse_trimmed", 1.0),
    ("trimmed relMSE, equal spp", "spp", "relmse_trimmed", 1.0),
    ("precompute, s", "spp", "precompute_seconds", 1.0), ("guide, MiB", "spp", "guide_bytes", 2.0 ** -20)]


def draw_all(results: dict, folder: str, prefix: str = "") -> dict[str, str]:
    """One PNG for each knob, a row for each scene; their names by knob."""
    import matplotlib
    matplotlib.use("Agg")
    os.makedirs(folder, exist_ok=True)
    names = {}
    for knob, sweeps in by_knob(results).items():
        names[knob] = f"{prefix}{knob}.png"
        draw(sweeps, os.path.join(folder, names[knob]))
    return names


def by_knob(results: dict) -> dict[str, list[dict]]:
    knobs = dict.fromkeys(sweep["knob"] for sweep in results["sweeps"])
    return {knob: [sweep for sweep in results["sweeps"] if sweep["knob"] == knob] for knob in knobs}


def draw(sweeps: list[dict], path: str) -> None:
    """Errors at equal time and at equal spp, and the seconds and bytes that they cost, over the knob's values."""
    from matplotlib import pyplot
    figure, rows = pyplot.subplots(len(sweeps), len(PANELS), figsize=(13.2, 0.4 + 2.7 * len(sweeps)),
                                   layout="constrained", squeeze=False)
    for sweep, axes in zip(sweeps, rows):
        for axis, panel in zip(axes, PANELS):
            draw_panel(axis, sweep, *panel)
        axes[0].set_ylabel(sweep["scene"])
        if len(integrators_of(sweep)) > 1:
            axes[0].legend(fontsize=8, frameon=False)
    figure.suptitle(sweeps[0]["meaning"], fontsize=10)
    figure.savefig(path, dpi=70, metadata={"Software": None})
    pyplot.close(figure)


def draw_panel(axis, sweep: dict, title: str, equal: str, key: str, factor: float) -> None:
    values = values_of(sweep)
    ordered = are_numbers(values)
    logarithmic = ordered and all(float(value) > 0.0 for value in values)
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

def ratio(sweep: dict | None, value: str, equal: str, key: str) -> float | None:
    """The value's measure over the default's; None: not measured."""
    if sweep is None:
        return None
    own, default = (point_of(sweep, v, "guided", equal).get(key) for v in (value, sweep["default"]))
    if not own or not default or own["median"] is None or not default["median"]:
        return None
    return own["median"] / default["median"]


def factors(results: dict) -> str:
    """What each value other than the default does to time and error, as factors: all scenes, in their order."""
    scenes = list(dict.fromkeys(sweep["scene"] for sweep in results["sweeps"]))
    lines = [f"Factors against the default, on {', '.join(scenes)} (–: not measured): what changes when one setting "
             "does. Standard deviation: the root of the trimmed relMSE's factor.", "",
             "| setting | seconds before the first sample | seconds, equal spp | deviation, equal spp | deviation, "
             "equal time | |", "|---|---|---|---|---|---|"]
    for knob, own in by_knob(results).items():
        sweeps = [next((sweep for sweep in own if sweep["scene"] == scene), None) for scene in scenes]
        for value in values_of(own[0]):
            if own[0]["default"] in (None, value):
                continue
            deviations = roots([ratio(sweep, value, "time", "relmse_trimmed") for sweep in sweeps])
            columns = [[ratio(sweep, value, "spp", "precompute_seconds") for sweep in sweeps],
                       [ratio(sweep, value, "spp", "wall_seconds") for sweep in sweeps],
                       roots([ratio(sweep, value, "spp", "relmse_trimmed") for sweep in sweeps]), deviations]
            cells = [", ".join("–" if v is None else f"{v:.2g}" for v in column) for column in columns]
            lines.append(f"| `{knob}={value}` | {' | '.join(cells)} | {verdict(deviations)} |")
    return "\n".join(lines)


def roots(values: list[float | None]) -> list[float | None]:
    return [None if value is None else math.sqrt(value) for value in values]


def verdict(deviations: list[float | None]) -> str:
    """In words; differences of a twentieth are a matter of seeds."""
    known = [value for value in deviations if value is not None]
    if not known:
        return ""
    if min(known) >= 0.95:
        return "no different" if max(known) <= 1.05 else "worse" if min(known) > 1.05 else "no better"
    return "better" if max(known) <= 1.05 else "depends on the scene"


def findings(sweep: dict) -> str:
    """Measured: which value has the smallest error, and what the default has."""
    rows = [(value, integrator, point_of(sweep, value, integrator, "time").get("relmse_trimmed"))
            for value in values_of(sweep) for integrator in integrators_of(sweep)]
    rows = [(value, integrator, found["median"]) for value, integrator, found in rows if found]
    own = [row for row in rows if row[1] == "guided"]
    if not own:
        return ""
    if len(integrators_of(sweep)) > 1:
        gains = [(value, gain(rows, value)) for value in values_of(sweep)]
        return "`path`'s trimmed relMSE over `guided`'s: " + ", ".join(
            f"{number(factor)} at {value}" for value, factor in gains if factor is not None) + "."
    best = min(own, key=lambda row: row[2])
    text = f"Smallest trimmed relMSE at equal time: {number(best[2])}, at {best[0]}"
    default = next((row for row in own if row[0] == sweep["default"]), None)
    if default and default is not best:
        text += f" (the default {default[0]}: {number(default[2])})"
    return text + "."


def gain(rows: list, value: str) -> float | None:
    """path's error over guided's."""
    errors = {integrator: error for v, integrator, error in rows if v == value}
    return errors["path"] / errors["guided"] if len(errors) == 2 and errors["guided"] > 0.0 else None


ADVICE = "## Advice\n"


def written_advice(path: str) -> str:
    """What somebody has written under "Advice" on the page that is there; empty: nothing."""
    if not os.path.exists(path):
        return ""
    with open(path) as file:
        _, title, rest = file.read().partition(ADVICE)
    return title + rest.partition("\n## ")[0].rstrip("\n") + "\n" if title else ""


def write_page(results: dict, path: str) -> None:
    """The page, and its plots beside it; what people have written under "Advice" stays."""
    folder = os.path.dirname(os.path.abspath(path))
    names = draw_all(results, folder, "tradeoff_")
    seeds = results["seeds"]
    head = PAGE_HEAD.format(size="x".join(map(str, results["size"])), spp=results["spp"],
                            seeds="one seed" if seeds == 1 else f"{seeds} seeds, medians (intervals in brackets)",
                            seconds=f"{results['seconds']:g}")
    sections = [part for part in (head, written_advice(path), f"## In short\n{factors(results)}\n") if part]
    for knob, own in by_knob(results).items():
        default = f" Default: {own[0]['default']}." if own[0]["default"] else ""
        sections.append(f"## {knob}\n{own[0]['meaning'][0].upper()}{own[0]['meaning'][1:]}.{default}\n\n"
                        f"![{knob}]({names[knob]})\n")
        sections += [f"### {sweep['scene']}\n{findings(sweep)}\n\n{table(sweep)}\n" for sweep in own]
    write_text(path, "\n".join(sections))
