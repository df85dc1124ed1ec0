#!/usr/bin/env python3
"""Tests what the benchmark scripts share (apps/bench/bench_runs.py), with a stand-in for `render`. Python 3 alone."""

from __future__ import annotations

import argparse
import json
import os
import stat
import subprocess
import sys
import tempfile
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "apps", "bench"))
import bench_runs  # noqa: E402: the folder must be known before
import tradeoff_knobs  # noqa: E402
import tradeoff_page  # noqa: E402

# Counts its calls, and does what the file `behaviour` beside it says.
STAND_IN = """#!{python}
import json, os, sys, time
folder = os.path.dirname(os.path.abspath(__file__))
open(os.path.join(folder, "calls"), "a").write("x")
behaviour = open(os.path.join(folder, "behaviour")).read()
words = sys.argv[1:]
option = lambda name: words[words.index(name) + 1]
if behaviour == "fail":
    sys.exit("error: something: is wrong; do another thing")
if behaviour == "hang":
    time.sleep(60)
error = float("nan") if behaviour == "nan" else 0.25
open(option("-o"), "w").write("a picture")
json.dump({{"passes": [{{"seconds": 1.0, "spp": 1.0}}], "error": {{"rmse": error, "relmse": 0.1, "relmse_trimmed": 0.1}}}},
          open(option("--stats"), "w"))
"""


class Runs(unittest.TestCase):
    def setUp(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.render = self.path("render")
        with open(self.render, "w") as file:
            file.write(STAND_IN.format(python=sys.executable))
        os.chmod(self.render, stat.S_IRWXU)
        for name in ("scene.glb", "reference.exr"):
            self.put(name, name)
        self.behave("work")
        self.arguments = argparse.Namespace(render=self.render, out=self.path("out"), size=(32, 24), threads=None,
                                            max_depth=None)
        os.makedirs(self.path("out/runs"))

    def path(self, name: str) -> str:
        return os.path.join(self.folder.name, name)

    def put(self, name: str, text: str) -> None:
        with open(self.path(name), "w") as file:
            file.write(text)

    def behave(self, how: str) -> None:
        self.put("behaviour", how)

    def calls(self) -> int:
        return os.path.getsize(self.path("calls"))

    def run_once(self, method: str = "path", seed: int = 0, longest: float = 30.0) -> dict:
        return bench_runs.one_run(self.arguments, self.path("scene.glb"), self.path("reference.exr"),
                                  bench_runs.Method(method), seed, ["--time", "1"], longest, bench_runs.Hashes())

    def test_a_finished_run_is_not_repeated(self) -> None:
        first, second = self.run_once(), self.run_once()
        self.assertFalse(first["reused"])
        self.assertTrue(second["reused"])
        self.assertEqual(first["statistics"], second["statistics"])
        self.assertGreater(first["wall_seconds"], 0.0)
        self.assertEqual(self.calls(), 1)

    def test_other_settings_scenes_and_executables_are_other_runs(self) -> None:
        self.run_once()
        self.run_once(seed=1)
        self.run_once("guided:a=1")
        self.put("scene.glb", "another")
        self.run_once()
        with open(self.render, "a") as file:
            file.write("# another\n")
        self.run_once()
        self.assertEqual(self.calls(), 5)

    def test_a_failed_run_is_told_and_repeated(self) -> None:
        self.behave("fail")
        record = self.run_once()
        self.assertIn("something: is wrong", record["failure"])
        self.assertEqual(os.listdir(self.path("out/runs")), [])
        self.behave("work")
        self.assertNotIn("failure", self.run_once())

    def test_a_run_without_a_finite_error_failed(self) -> None:
        self.behave("nan")
        self.assertIn("no finite error", self.run_once()["failure"])

    def test_a_hanging_run_is_ended(self) -> None:
        self.behave("hang")
        self.assertIn("still running", self.run_once(longest=0.5)["failure"])


class Words(unittest.TestCase):
    def test_methods(self) -> None:
        method = bench_runs.Method("paper=guided:preset=paper:bounces=1")
        self.assertEqual(method.name, "paper")
        self.assertEqual(method.options(), ["-i", "guided", "--set", "preset=paper", "--set", "bounces=1"])
        self.assertEqual(bench_runs.Method("guided:preset=paper").name, "guided:preset=paper")
        self.assertEqual([m.name for m in bench_runs.parse_methods("path,a=guided")], ["path", "a"])
        for wrong in ("", "path,path", "guided:", "guided:x", "=guided", "a b"):
            with self.assertRaises(argparse.ArgumentTypeError, msg=wrong):
                bench_runs.parse_methods(wrong)

    def test_scenes(self) -> None:
        self.assertEqual([bench_runs.scene_name(path) for path in bench_runs.parse_scenes("ring,sphere")],
                         ["ring", "sphere"])
        self.assertGreaterEqual(len(bench_runs.parse_scenes("all")), 13)
        for wrong in ("none_such", "ring,ring"):
            with self.assertRaises(argparse.ArgumentTypeError, msg=wrong):
                bench_runs.parse_scenes(wrong)


def document_of(data: bytes) -> dict:
    return json.loads(data[20:20 + int.from_bytes(data[12:16], "little")])


def structure(path: str) -> tuple:
    """Of a .glb: bytes of its buffer, counts of accessors, names of nodes and materials."""
    with open(path, "rb") as file:
        document = document_of(file.read())
    return (document["buffers"], [accessor["count"] for accessor in document["accessors"]],
            [node["name"] for node in document["nodes"]], [material["name"] for material in document["materials"]])


class Scenes(unittest.TestCase):
    def test_generators_write_what_is_committed(self) -> None:
        """Last bits may differ between machines' sines, and with them the length of numbers: structure counts."""
        for path in bench_runs.parse_scenes("all"):
            with tempfile.TemporaryDirectory() as folder:
                made = os.path.join(folder, "made.glb")
                subprocess.run([sys.executable, "-B", path[:-len(".glb")] + ".py", made], check=True)
                self.assertEqual(structure(made), structure(path), path)

    def test_light_radius(self) -> None:
        with open(bench_runs.parse_scenes("ring")[0], "rb") as file:
            data = file.read()
        wide = tradeoff_knobs.with_light_radius(data, 0.25)
        self.assertEqual(int.from_bytes(wide[8:12], "little"), len(wide))
        lights = document_of(wide)["extensions"]["KHR_lights_punctual"]["lights"]
        self.assertEqual([light["extras"] for light in lights], [{"radius": 0.25}])
        self.assertEqual(wide[-1000:], data[-1000:])
        point = tradeoff_knobs.with_light_radius(wide, 0.0)
        self.assertNotIn(b"radius", point)
        with open(bench_runs.parse_scenes("cornell")[0], "rb") as file:
            self.assertRaises(ValueError, tradeoff_knobs.with_light_radius, file.read(), 0.1)


def trade(scene: str, errors: dict[str, float]) -> dict:
    """A sweep of one knob with default "b": trimmed relMSE at equal time by value."""
    points = [{"value": value, "integrator": "guided", "equal": "time", "failures": [],
               "relmse_trimmed": {"median": error, "lowest": None, "highest": None}} for value, error in errors.items()]
    return {"scene": scene, "knob": "knob", "meaning": "what it does", "default": "b", "points": points}


class Factors(unittest.TestCase):
    def test_factors_are_against_the_default_and_in_words(self) -> None:
        sweeps = [trade("one", {"a": 4.0, "b": 1.0, "c": 0.81}), trade("two", {"a": 9.0, "b": 1.0, "c": 1.44})]
        text = tradeoff_page.factors({"sweeps": sweeps})
        self.assertIn("| `knob=a` | –, – | –, – | –, – | 2, 3 | worse |", text)
        self.assertIn("| 0.9, 1.2 | depends on the scene |", text)
        self.assertNotIn("knob=b", text)

    def test_what_was_not_measured_gives_no_verdict(self) -> None:
        one, two = trade("one", {"a": 4.0, "b": 1.0}), {**trade("two", {"a": 1.0}), "knob": "other"}
        self.assertIn("| 2, – | worse |", tradeoff_page.factors({"sweeps": [one, two]}))
        text = tradeoff_page.factors({"sweeps": [trade("one", {"a": 4.0})]})
        self.assertIn("| `knob=a` | – | – | – | – |  |", text)

    def test_written_advice_stays(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "page.md")
            self.assertEqual(tradeoff_page.written_advice(path), "")
            for text, kept in (("# Page\n\n## In short\nx\n", ""), ("# Page\n## Advice\nDo.\n\n## In short\nx\n",
                                                                   "## Advice\nDo.\n")):
                with open(path, "w") as file:
                    file.write(text)
                self.assertEqual(tradeoff_page.written_advice(path), kept)

    def test_verdicts(self) -> None:
        for deviations, words in (([1.0, 1.04], "no different"), ([1.0, 1.2], "no better"), ([0.8, 1.0], "better"),
                                  ([1.1, 1.2], "worse"), ([0.8, 1.2], "depends on the scene")):
            self.assertEqual(tradeoff_page.verdict(deviations), words)


if __name__ == "__main__":
    unittest.main()
