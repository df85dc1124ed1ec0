"""The benchmark's report: one HTML file with pictures, curves and tables inside, that needs no network."""

from __future__ import annotations

import base64
import html
import io
import json
import math
import os
import re

import numpy

from bench_environment import BENCH_FOLDER, SCENES_FOLDER
from bench_errors import (HIGHEST_ERROR, LOWEST_ERROR, curve_of, error_map, exposure_of, median_curve, png_bytes,
                          read_exr, tone_mapped)
from bench_runs import write_bytes, write_text

# Key, title, digits, factor.
ERROR_COLUMNS = [
    ("rmse", "RMSE", 3, 1.0), ("relmse", "relMSE", 3, 1.0), ("relmse_trimmed", "relMSE, trimmed", 3, 1.0),
    ("flip", "HDR-FLIP", 3, 1.0), ("time_ratio_rmse", "time ratio (RMSE)", 3, 1.0),
    ("time_ratio_relmse_trimmed", "time ratio (trimmed)", 3, 1.0),
    ("seconds_to_first_rmse", "s to the first's RMSE", 3, 1.0), ("slope", "slope", 2, 1.0)]
COST_COLUMNS = [
    ("noise_rmse", "noise", 3, 1.0), ("noise_rmse_but_ten", "noise but ten pixels", 3, 1.0),
    ("noise_relmse_trimmed", "noise, trimmed relMSE", 3, 1.0), ("mean_ratio", "mean / reference's", 4, 1.0),
    ("spp", "spp", 3, 1.0), ("precompute_seconds", "precompute s", 3, 1.0), ("first_pass_seconds", "first pass s", 3, 1.0),
    ("wall_seconds", "wall s", 3, 1.0), ("peak_rss_bytes", "peak MiB", 3, 2.0 ** -20)]
LOWER_WINS = ("rmse", "relmse", "relmse_trimmed", "flip")


def number(value: float | None, digits: int) -> str:
    if value is None or not math.isfinite(value):
        return "–"
    if abs(value) >= 1e5 or 0.0 < abs(value) < 1e-4:
        return f"{value:.{digits - 1}e}"
    return f"{value:#.{digits}g}".rstrip(".")


def parts(value, digits: int, factor: float) -> tuple[str, str]:
    """A median and its interval as texts; the interval is empty where there is none."""
    if not isinstance(value, dict):
        return number(None if value is None else value * factor, digits), ""
    middle = value["median"]
    if middle is None:
        return "–", ""
    if value["lowest"] is None or value["lowest"] == value["highest"]:
        return number(middle * factor, digits), ""
    ends = [number(value[key] * factor, digits) for key in ("lowest", "highest")]
    return number(middle * factor, digits), "" if ends[0] == ends[1] else " … ".join(ends)


def median_of(entry: dict, key: str) -> float | None:
    value = entry.get(key)
    return value["median"] if isinstance(value, dict) else value


# ---- Markdown

def markdown(results: dict) -> str:
    lines = [headline(results), ""]
    columns = ERROR_COLUMNS + COST_COLUMNS
    titles = ["scene", "method", "runs", *(title for _, title, _, _ in columns)]
    lines += ["| " + " | ".join(titles) + " |", "|" + "---|" * len(titles)]
    for entry in results["summaries"]:
        cells = []
        for key, _, digits, factor in columns:
            middle, interval = parts(entry.get(key), digits, factor)
            cells.append(f"{middle} ({interval})" if interval else middle)
        failed = f", {len(entry['failures'])} FAILED" if entry["failures"] else ""
        name = entry["method"].replace("|", "\\|")
        lines.append(f"| {entry['scene']} | {name} | {entry['runs']}{failed} | " + " | ".join(cells) + " |")
    return "\n".join(lines + [f"\n{line}" for line in warnings(results)])


def headline(results: dict) -> str:
    time = f"{results['seconds']:g} s of wall time each"
    seeds = results["seeds"]
    return (f"{results['size'][0]}x{results['size'][1]} pixels, {time}, {seeds} seed{'s' if seeds > 1 else ''}"
            f"{interval_text(results)}; time ratios against {results['methods'][0]['name']}")


def interval_text(results: dict) -> str:
    sure = {f"{100 * entry['rmse']['confidence']:.0f} %" for entry in results["summaries"]
            if "rmse" in entry and entry["rmse"]["count"] > 1}
    return f"; medians, intervals of {', '.join(sorted(sure))} confidence" if sure else ""


def warnings(results: dict) -> list[str]:
    lines = []
    for entry in results["summaries"]:
        where = f"{entry['scene']}, {entry['method']}"
        lines += [f"FAILED: {where}: {failure}" for failure in dict.fromkeys(entry["failures"])]
        nonfinite = entry.get("nonfinite_samples")
        if nonfinite and nonfinite["highest"] > 0:
            lines.append(f"note: {where}: up to {nonfinite['highest']:.0f} non-finite samples left out")
        wall = entry.get("wall_seconds")
        if wall and wall["highest"] > results["seconds"] + max(1.0, 0.05 * results["seconds"]):
            lines.append(f"note: {where}: took up to {wall['highest']:.1f} s where {results['seconds']:g} s were given")
        own = (results["references"].get(entry["scene"], {}).get("made") or {}).get("standard_error_rmse")
        if own and "rmse" in entry and entry["rmse"]["median"] < 3.0 * own:
            lines.append(f"note: {where}: the reference's own standard error, {own:.3g}, is no longer small")
    return lines


# ---- HTML

def table(entries: list[dict], columns: list) -> str:
    best = {key: min((median_of(entry, key) for entry in entries if median_of(entry, key) is not None), default=None)
            for key in LOWER_WINS}
    rows = []
    for entry in entries:
        cells = [f"<td>{html.escape(entry['method'])}</td>"]
        for key, _, digits, factor in columns:
            middle, interval = parts(entry.get(key), digits, factor)
            middle_value = median_of(entry, key)
            mark = ' class="best"' if middle_value is not None and middle_value == best.get(key) else ""
            cells.append(f"<td{mark}>{middle}{f'<small>{interval}</small>' if interval else ''}</td>")
        failed = f'<small class="failed">{len(entry["failures"])} failed</small>' if entry["failures"] else ""
        cells.insert(1, f"<td>{entry['runs']}{failed}</td>")
        rows.append(f"<tr>{''.join(cells)}</tr>")
    heads = "".join(f"<th>{html.escape(title)}</th>" for title in ["method", "runs", *(c[1] for c in columns)])
    return f'<div class="scroll"><table><thead><tr>{heads}</tr></thead><tbody>{"".join(rows)}</tbody></table></div>'


def overview(results: dict, scenes: list[str]) -> str:
    """Trimmed relMSE and RMSE of every scene and method, the best marked."""
    names = [method["name"] for method in results["methods"]]
    blocks = []
    for key, title in [("rmse", "RMSE"), ("relmse_trimmed", "relMSE without the worst 0.1 % of pixels")]:
        rows = []
        for scene in scenes:
            of_scene = [entry for entry in results["summaries"] if entry["scene"] == scene]
            values = {entry["method"]: median_of(entry, key) for entry in of_scene}
            known = [value for value in values.values() if value is not None]
            cells = "".join(f'<td{best_mark(values.get(name), known)}>{number(values.get(name), 3)}</td>'
                            for name in names)
            rows.append(f'<tr><td><a href="#{html.escape(scene)}">{html.escape(scene)}</a></td>{cells}</tr>')
        heads = "".join(f"<th>{html.escape(name)}</th>" for name in names)
        blocks.append(f"<h3>{title}, medians</h3><div class='scroll'><table><thead><tr><th>scene</th>{heads}</tr>"
                      f"</thead><tbody>{''.join(rows)}</tbody></table></div>")
    return f'<section id="overview"><h2>Overview</h2>{"".join(blocks)}{failures(results)}</section>'


def best_mark(value: float | None, known: list[float]) -> str:
    return ' class="best"' if value is not None and value == min(known) else ""


def failures(results: dict) -> str:
    lines = warnings(results)
    items = "".join(f"<li class=\"{'failed' if line.startswith('FAILED') else 'soft'}\">{html.escape(line)}</li>"
                    for line in lines)
    return f"<ul>{items}</ul>" if lines else ""


def description(scene: str) -> str:
    """The first line of the generator's docstring."""
    path = os.path.join(SCENES_FOLDER, scene + ".py")
    if not os.path.isfile(path):
        return ""
    with open(path, encoding="utf-8") as file:
        match = re.search(r'"""(.+?)(?:\n\n|""")', file.read(), re.DOTALL)
    return " ".join(match[1].split()) if match else ""


def reference_text(entry: dict) -> str:
    made = entry.get("made") or {}
    if not made:
        return "Reference: " + os.path.basename(entry["file"]) + ", of unknown origin."
    text = f"Reference: {', '.join(made.get('methods', []))}, {made.get('seconds', 0):g} s each"
    if made.get("standard_error_rmse") is not None:
        text += f"; its own standard error {made['standard_error_rmse']:.2g} (RMSE)"
    return text + "."


class SceneReport:
    """Pictures, curves and table of one scene."""

    def __init__(self, results: dict, scene: str, out: str, crop: tuple[int, int, int, int] | None) -> None:
        self.results, self.scene, self.out = results, scene, out
        self.entry = results["references"][scene]
        self.records = [record for record in results["runs"] if record["scene"] == scene and "failure" not in record]
        self.reference = read_exr(self.entry["file"])
        self.crop = crop

    def html(self) -> str:
        entries = [entry for entry in self.results["summaries"] if entry["scene"] == self.scene]
        name = html.escape(self.scene)
        return (f'<section id="{name}"><h2>{name}</h2><p class="soft">{html.escape(description(self.scene))} '
                f'{html.escape(reference_text(self.entry))}</p>{table(entries, ERROR_COLUMNS)}'
                f'<div id="viewer-{name}"></div>'
                f'<div class="curves">{self.curves()}</div>{table(entries, COST_COLUMNS)}</section>')

    def data(self) -> dict:
        """What the page's script shows: the first run of every method, and the reference."""
        exposure = exposure_of(self.reference)
        pictures, values = [], []
        for name, picture in self.first_runs():
            values.append(picture)
            pictures.append({"name": name, "picture": encoded(tone_mapped(picture, exposure)),
                             "error": encoded(coloured(error_map(picture, self.reference)))})
        pictures.append({"name": "reference", "picture": encoded(tone_mapped(self.reference, exposure)), "error": None})
        height, width = self.reference.shape[:2]
        return {"name": self.scene, "size": [width, height], "pictures": pictures,
                "crop": list(self.crop or interesting_crop(values, self.reference))}

    def curves(self) -> str:
        from matplotlib import pyplot
        figure = self.draw_curves()
        output = io.StringIO()
        figure.savefig(output, format="svg", metadata={"Date": None})
        pyplot.close(figure)
        return re.sub(r"^.*?(?=<svg)", "", output.getvalue(), flags=re.DOTALL)

    def write_pictures(self, folder: str) -> None:
        """SCENE_curves.png and SCENE_pictures.png: the first run of every method side by side."""
        from matplotlib import pyplot
        figure = self.draw_curves()
        figure.savefig(os.path.join(folder, f"{self.scene}_curves.png"), dpi=80, metadata={"Software": None})
        pyplot.close(figure)
        exposure = exposure_of(self.reference)
        row = [tone_mapped(picture, exposure) for _, picture in self.first_runs()]
        if row:
            write_bytes(os.path.join(folder, f"{self.scene}_pictures.png"), png_bytes(numpy.concatenate(row, axis=1)))

    def first_runs(self) -> list[tuple[str, numpy.ndarray]]:
        """Seed 0 (or the first that succeeded) of every method that has one."""
        found = []
        for method in self.results["methods"]:
            runs = sorted((r for r in self.records if r["method"] == method["name"]), key=lambda r: r["seed"])
            if runs:
                found.append((method["name"], read_exr(os.path.join(self.out, runs[0]["picture"]))))
        return found

    def draw_curves(self):
        from matplotlib import pyplot
        figure, axes = pyplot.subplots(1, 2, figsize=(11.4, 4.2), layout="constrained")
        for axis, error, title in zip(axes, ["rmse", "relmse_trimmed"], ["RMSE", "relMSE, worst 0.1 % left out"]):
            lines = [self.draw_method(axis, error, number_, method["name"])
                     for number_, method in enumerate(self.results["methods"])]
            axis.set(xscale="log", yscale="log", xlabel="seconds since the process's start", ylabel=title)
            draw_guide(axis, [line for line in lines if line], -0.5 if error == "rmse" else -1.0)
            axis.grid(True, which="major", linewidth=0.5, color="#d5dae0")
            axis.spines[["top", "right"]].set_visible(False)
            if any(lines):
                axis.legend(fontsize=8.5, frameon=False)
        return figure

    def draw_method(self, axis, error: str, place: int, name: str):
        """Thin lines for the runs, a thick one for their median; returns that one's points."""
        runs = [record for record in self.records if record["method"] == name]
        middle = median_curve(runs, error)
        if middle is None:
            return None
        colour = f"C{place % 10}"
        for record in runs:
            axis.plot(*curve_of(record, error), color=colour, linewidth=0.6, alpha=0.4)
        slopes = [entry.get("slope") for entry in self.results["summaries"]
                  if entry["scene"] == self.scene and entry["method"] == name]
        label = f"{name} (slope {slopes[0]['median']:.2f})" if error == "rmse" and slopes and slopes[0] else name
        axis.plot(*middle, "o" if len(middle[0]) == 1 else "-", color=colour, linewidth=2.2, label=label)
        return middle


def draw_guide(axis, lines: list, power: float) -> None:
    """A dotted line of the slope that independent samples of finite variance have."""
    if not lines:
        return
    first, last = min(line[0][0] for line in lines), max(line[0][-1] for line in lines)
    top = max(line[1][0] for line in lines)
    if last > first:
        axis.plot([first, last], [top, top * (last / first) ** power], ":", color="#8893a0", linewidth=1.3,
                  label=f"slope {power:g}")


def encoded(pixels: numpy.ndarray) -> str:
    return base64.b64encode(png_bytes(pixels)).decode()


def coloured(places: numpy.ndarray) -> numpy.ndarray:
    import matplotlib
    return (matplotlib.colormaps["inferno"](places)[..., :3] * 255.0 + 0.5).astype(numpy.uint8)


def gradient() -> str:
    import matplotlib
    from matplotlib.colors import to_hex
    return ", ".join(to_hex(matplotlib.colormaps["inferno"](k / 12.0)) for k in range(13))


def interesting_crop(pictures: list[numpy.ndarray], reference: numpy.ndarray) -> tuple[int, int, int, int]:
    """Three eighths as wide and high as the picture, where relative errors of all methods are largest on average.

    A pixel's error counts up to the top of the scale only: a single dot must not decide.
    """
    height, width = reference.shape[:2]
    rows, columns = max(1, height * 3 // 8), max(1, width * 3 // 8)
    if not pictures:
        return 0, 0, columns, rows
    total = sum(error_map(picture, reference) for picture in pictures)
    sums = numpy.zeros((height + 1, width + 1))
    sums[1:, 1:] = total.cumsum(axis=0).cumsum(axis=1)
    window = sums[rows:, columns:] - sums[:-rows, columns:] - sums[rows:, :-columns] + sums[:-rows, :-columns]
    top, left = numpy.unravel_index(numpy.argmax(window), window.shape)
    return int(left), int(top), int(left) + columns, int(top) + rows


def methods_of(results: dict) -> str:
    return "".join(f"<li>{html.escape(method['name'])}: <code>{html.escape(' '.join(method['options']))}</code></li>"
                   for method in results["methods"])


def write_report(results: dict, out: str, path: str, crop=None, pictures: str | None = None) -> None:
    """results: as in results.json; pictures are read from the folder `out`. `pictures`: a folder for PNG files."""
    import matplotlib
    matplotlib.use("Agg")
    matplotlib.rcParams.update({"svg.fonttype": "path", "svg.hashsalt": "nephroid", "font.size": 9.5})
    scenes = list(dict.fromkeys(entry["scene"] for entry in results["summaries"]))
    reports = [SceneReport(results, scene, out, crop) for scene in scenes]
    if pictures:
        os.makedirs(pictures, exist_ok=True)
        for scene_report in reports:
            scene_report.write_pictures(pictures)
    with open(os.path.join(BENCH_FOLDER, "report_template.html"), encoding="utf-8") as file:
        page = file.read()
    links = "".join(f'<a href="#{html.escape(name)}">{html.escape(name)}</a>'
                    for name in ["overview", *scenes, "notes"])
    fillings = {"SUMMARY": f'<p class="soft">{html.escape(headline(results))}</p>', "LINKS": links,
                "OVERVIEW": overview(results, scenes), "SECTIONS": "".join(report.html() for report in reports),
                "METHODS": methods_of(results), "GRADIENT": gradient(), "LOW": f"{LOWEST_ERROR:g}",
                "HIGH": f"{HIGHEST_ERROR:g}",
                "DATA": json.dumps([report.data() for report in reports]).replace("</", "<\\/")}
    write_text(path, re.sub(r"@([A-Z]+)@", lambda match: fillings[match[1]], page))
