"""The render executable as a user meets it: options, errors, exit codes, limits, signals, checkpoints."""

import argparse
import json
import os
import random
import re
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

SCENES = Path(__file__).resolve().parent.parent / "scenes"
RENDER = ""


def run(*arguments, cwd=None, timeout=120):
    return subprocess.run([RENDER, *map(str, arguments)], cwd=cwd, timeout=timeout, capture_output=True, text=True)


def exr_size(path):
    """Checks the magic number and that every scan line block is inside the file; returns the data window's size."""
    data = Path(path).read_bytes()
    assert data[:4] == b"\x76\x2f\x31\x01", f"{path} is no EXR file"
    position, window, compression = 8, None, None
    while data[position] != 0:
        name_end = data.index(0, position)
        type_end = data.index(0, name_end + 1)
        size = struct.unpack_from("<i", data, type_end + 1)[0]
        value = type_end + 5
        name = data[position:name_end]
        if name == b"dataWindow":
            window = struct.unpack_from("<4i", data, value)
        if name == b"compression":
            compression = data[value]
        position = value + size
    lines = window[3] - window[1] + 1
    lines_per_block = {0: 1, 2: 1, 3: 16}[compression]
    blocks = -(-lines // lines_per_block)
    for i in range(blocks):
        offset = struct.unpack_from("<Q", data, position + 1 + 8 * i)[0]
        assert 0 < offset < len(data), f"{path} is truncated"
        packed = struct.unpack_from("<i", data, offset + 4)[0]
        assert offset + 8 + packed <= len(data), f"{path} is truncated"
    return window[2] - window[0] + 1, lines


def wait_until_caught(process, sent) -> None:
    """Until the process has installed its handler of the signal: a loaded machine takes seconds to start a program."""
    deadline = time.monotonic() + 20.0
    while time.monotonic() < deadline:
        status = Path(f"/proc/{process.pid}/status").read_text()
        caught = int(re.search(r"^SigCgt:\s*([0-9a-f]+)", status, re.MULTILINE)[1], 16)
        if caught >> (sent - 1) & 1:
            return
        time.sleep(0.01)
    raise AssertionError(f"signal {sent} is not caught after 20 s")


class CommandLine(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.path = Path(self.folder.name)
        self.scene = SCENES / "cornell.glb"

    def tearDown(self):
        self.folder.cleanup()

    def render(self, *arguments, output="out.exr", code=0):
        result = run("-i", "path", "--size", "64x48", "-q", "-o", self.path / output, *arguments, self.scene)
        self.assertEqual(result.returncode, code, result.stderr)
        return result

    def pixels(self, name):
        return (self.path / name).read_bytes()

    def picture(self, name):
        """The pixel data without the header, whose attributes hold the render time."""
        data = self.pixels(name)
        position = 8
        while data[position] != 0:
            type_end = data.index(0, data.index(0, position) + 1)
            position = type_end + 5 + struct.unpack_from("<i", data, type_end + 1)[0]
        lines = exr_size(self.path / name)[1]
        blocks = -(-lines // 16)
        return data[position + 1 + 8 * blocks:]

    def assert_error(self, result, code, *words):
        self.assertEqual(result.returncode, code, result.stderr)
        lines = [line for line in result.stderr.splitlines() if line.startswith("error: ")]
        self.assertEqual(len(lines), 1, result.stderr)
        for word in words:
            self.assertIn(word, lines[0])

    def test_version_help_and_parameters(self):
        self.assertEqual(run("--version").returncode, 0)
        self.assertIn("--max-depth", run("--help").stdout)
        self.assertIn("sampler", run("--list-parameters").stdout)

    def test_info_renders_nothing(self):
        result = run("--info", SCENES / "ring.glb", cwd=self.path)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("caster", result.stdout)
        self.assertIn("point", result.stdout)
        self.assertEqual(list(self.path.iterdir()), [])

    def test_quality(self):
        def told(*arguments):
            self.render(*arguments, "--size", "8x6", "--max-depth", "2", "--stats", self.path / "s.json")
            return json.loads((self.path / "s.json").read_text())

        # Not guided: samples alone.
        self.assertEqual(told("--quality", "draft")["spp"], 16)
        self.assertEqual(told("--quality", "final", "--spp", "2")["spp"], 2)
        draft = told("-i", "guided", "--quality", "draft", "--set", "photons=5")
        self.assertEqual(draft["spp"], 16)
        default = told("-i", "guided")
        self.assertEqual(default["spp"], 64)
        self.assertEqual(draft["parameters"]["photons"], "5")
        self.assertLess(int(draft["parameters"]["cached_points"]), int(default["parameters"]["cached_points"]))

    def test_default_output_name(self):
        result = run("-i", "path", "--size", "16x16", "--spp", "1", self.scene, cwd=self.path)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(exr_size(self.path / "cornell.exr"), (16, 16))

    def test_usage_errors(self):
        scene = self.scene
        for arguments, word in [
            (["--spp", "0", scene], "--spp"),
            (["--size", "12", scene], "--size"),
            (["--size", "0x5", scene], "--size"),
            (["--crop", "1,2,3", "-i", "path", scene], "--crop"),
            (["--crop", "50,0,40,10", "-i", "path", "--size", "64x48", scene], "--crop"),
            (["-i", "nonsense", scene], "nonsense"),
            (["--quality", "best", scene], "draft, standard or final"),
            (["-i", "sms", scene], "not in this version"),
            (["-i", "ppg", "--set", "preset=2018", scene], "2019|2017"),
            (["-i", "ppg", "--set", "bsdf_fraction=0", scene], "learned"),
            (["--aov", "beauty", scene], "beauty"),
            (["--time", "-3", scene], "--time"),
            (["--resume", "-i", "path", scene], "--checkpoint"),
            (["-i", "path", "--set", "sampler", scene], "key=value"),
            (["-i", "path", "--set", "sampler=magic", scene], "sobol"),
            (["-i", "path", "--set", "colour=red", scene], "colour"),
            (["--no-such-option", scene], "no-such-option"),
            (["--inspect", "12", scene], "--inspect"),
            (["--inspect", "", scene], "--inspect"),
            (["--inspect", "1,2,3", scene], "--inspect"),
            (["--inspect", "1.5,2", scene], "--inspect"),
            (["--inspect", "1,2", "--time", "3", scene], "--time"),
            (["--inspect", "1,2", "--stats", "s.json", scene], "--stats"),
            (["--inspect", "64,10", "-i", "path", "--size", "64x48", scene], "x in 0..63"),
            (["--inspect=-1,10", "-i", "path", "--size", "64x48", scene], "x in 0..63"),
            (["--inspect", "10,10", "-i", "ppg", scene], "ppg"),
            (["--inspect", "10,10", "--crop", "20,20,40,40", "-i", "path", "--size", "64x48", scene], "x in 20..39"),
            (["--inspect", "0,0", "-i", "path", "--size", "64x48", scene], "another pixel"),
            ([], "scene"),
        ]:
            with self.subTest(arguments=arguments):
                self.assert_error(run(*arguments, cwd=self.path), 2, word)
        self.assertEqual(list(self.path.iterdir()), [])

    def test_input_errors(self):
        broken = self.path / "broken.glb"
        broken.write_bytes(self.scene.read_bytes()[:1000])
        for arguments in [["missing.glb"], [broken], ["--env", "missing.exr", self.scene], ["--camera", "nobody", self.scene],
                          ["--reference", "missing.exr", self.scene]]:
            with self.subTest(arguments=arguments):
                result = run("-i", "path", "-o", self.path / "x.exr", "--size", "64x48", *arguments, cwd=self.path)
                self.assert_error(result, 3)
        self.assertFalse((self.path / "x.exr").exists())

    def test_output_errors_come_before_rendering(self):
        start = time.monotonic()
        result = run("-i", "path", "--spp", "100000", "-o", self.path / "no/such/folder/x.exr", self.scene)
        self.assert_error(result, 4, "x.exr")
        self.assertLess(time.monotonic() - start, 5)
        self.assert_error(run("-i", "path", "-o", self.path / "x.jpg", self.scene), 4, ".exr or .png")

    def test_two_outputs_and_statistics(self):
        self.render("--spp", "5", "-o", self.path / "two.png", "--stats", self.path / "s.json", "--aov",
                    "albedo,normal,depth,caustic,variance,spp")
        self.assertEqual(exr_size(self.path / "out.exr"), (64, 48))
        self.assertEqual((self.path / "two.png").read_bytes()[:4], b"\x89PNG")
        for name in [b"albedo.R", b"normal.X", b"depth.Z", b"caustic.B", b"variance.G", b"spp.Y"]:
            self.assertIn(name, self.pixels("out.exr"))
        stats = json.loads((self.path / "s.json").read_text())
        for key in ["scene", "integrator", "version", "width", "height", "spp", "seed", "threads", "stop_reason", "seconds",
                    "rays", "camera_samples", "nonfinite_samples", "peak_rss_bytes", "passes", "parameters"]:
            self.assertIn(key, stats)
        self.assertEqual(set(stats["seconds"]), {"load", "build", "precompute", "render", "write", "total"})
        self.assertEqual((stats["spp"], stats["camera_samples"], stats["stop_reason"]), (5, 5 * 64 * 48, "spp"))
        self.assertEqual(stats["nonfinite_samples"], 0)

    def test_reference_gives_an_error_curve(self):
        self.render("--spp", "256", output="reference.exr")
        self.render("--spp", "32", "--seed", "5", "--reference", self.path / "reference.exr", "--stats", self.path / "s.json")
        stats = json.loads((self.path / "s.json").read_text())
        self.assertGreater(stats["error"]["rmse"], 0)
        self.assertGreater(stats["passes"][0]["rmse"], stats["passes"][-1]["rmse"])

    def test_same_bits_for_any_thread_count(self):
        self.render("--spp", "9", "--threads", "1", output="one.exr")
        self.render("--spp", "9", "--threads", "2", output="two.exr")
        self.render("--spp", "9", "--threads", "2", "--seed", "1", output="other.exr")
        self.assertEqual(self.picture("one.exr"), self.picture("two.exr"))
        self.assertNotEqual(self.picture("one.exr"), self.picture("other.exr"))

    def test_resumed_render_has_the_same_bits(self):
        checkpoint = self.path / "state"
        self.render("--spp", "21", output="whole.exr")
        for spp in [3, 10, 21]:
            self.render("--spp", spp, "--checkpoint", checkpoint, "--resume", output="parts.exr")
        self.assertEqual(self.picture("whole.exr"), self.picture("parts.exr"))

    def test_splats_have_the_same_bits_for_any_threads_and_after_resuming(self):
        scene = SCENES / "ring.glb"
        common = ["-i", "bdpt", "--set", "emission=casters", "--size", "80x60", "--crop", "11,7,69,51", "--aov",
                  "caustic,variance", "-q", scene]
        checkpoint = self.path / "state"
        for name, spps, more in [("one.exr", [21], ["--threads", 1]), ("two.exr", [21], ["--threads", 2]),
                                 ("parts.exr", [3, 10, 21], ["--checkpoint", checkpoint, "--resume"])]:
            for spp in spps:
                result = run("-o", self.path / name, "--spp", spp, *more, *common)
                self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(self.picture("one.exr"), self.picture("two.exr"))
        self.assertEqual(self.picture("one.exr"), self.picture("parts.exr"))

    def test_ppg_has_the_same_bits_for_any_threads_and_goes_on(self):
        common = ["-i", "ppg", "--size", "80x60", "--aov", "variance,spp,albedo", "-q", self.scene]
        for threads in [1, 2]:
            stats = self.path / "s.json"
            result = run("-o", self.path / f"{threads}.exr", "--spp", 12, "--threads", threads, "--stats", stats, *common)
            self.assertEqual(result.returncode, 0, result.stderr)
            learned = json.loads(stats.read_text())["ppg"]
            self.assertEqual(learned["lessons"], 3)
            self.assertGreater(learned["bytes"], 1000)
        self.assertEqual(self.picture("1.exr"), self.picture("2.exr"))
        # To more samples than planned at first: other passes, a whole picture all the same.
        for spp in [3, 7, 30]:
            stats = self.path / "s.json"
            result = run("-o", self.path / "parts.exr", "--spp", spp, "--checkpoint", self.path / "state", "--resume",
                         "--stats", stats, *common)
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertGreater(json.loads(stats.read_text())["spp"], 0)
        self.assertEqual(json.loads(stats.read_text())["passes"][-1]["spp"], 30)
        result = run("-o", self.path / "timed.exr", "--time", 1.5, "--set", "passes=discard", "--stats", stats, *common)
        self.assertEqual(result.returncode, 0, result.stderr)
        known = json.loads(stats.read_text())
        self.assertEqual(known["stop_reason"], "time")
        self.assertGreater(known["spp"], 0)

    def test_resume_refuses_another_render(self):
        checkpoint = self.path / "state"
        self.render("--spp", "2", "--checkpoint", checkpoint)
        for change in [["--seed", "3"], ["--max-depth", "4"], ["--crop", "0,0,8,8"], ["--set", "sampler=independent"]]:
            with self.subTest(change=change):
                self.assert_error(self.render("--checkpoint", checkpoint, "--resume", *change, code=5), 5, "another scene")
        data = bytearray(checkpoint.read_bytes())
        data[-100] ^= 1
        checkpoint.write_bytes(data)
        self.assert_error(self.render("--checkpoint", checkpoint, "--resume", code=5), 5, "damaged")
        checkpoint.write_bytes(data[: len(data) // 2])
        self.assert_error(self.render("--checkpoint", checkpoint, "--resume", code=5), 5, "truncated")

    def test_inspect_shows_the_sampling_and_renders_nothing(self):
        scene = SCENES / "ring.glb"
        common = ["--inspect", "37,20", "--spp", "1", "--max-depth", "3", "--size", "64x48", "--set", "cached_points=50", scene]
        result = run("-i", "guided", "-o", self.path / "out.exr", "-o", self.path / "two.png", *common)
        self.assertEqual(result.returncode, 0, result.stderr)
        line = [line for line in result.stderr.splitlines() if line.startswith("--inspect 37,20: ")]
        self.assertEqual(len(line), 1, result.stderr)
        for word in ["'floor'", "lobes", "guide fraction", "relative deviation"]:
            self.assertIn(word, line[0])
        pictures = ["density", "target", "difference"]
        self.assertEqual({path.name for path in self.path.iterdir()},
                         {"out.inspect.exr", "out.inspect-zoom.exr"} | {f"out.inspect-{name}.png" for name in pictures} |
                         {f"out.inspect-{name}-zoom.png" for name in pictures})
        self.assertEqual(exr_size(self.path / "out.inspect.exr"), (512, 512))
        self.assertEqual(exr_size(self.path / "out.inspect-zoom.exr"), (256, 256))
        for name in [b"density.Y", b"radiance.R", b"radiance.G", b"radiance.B", b"target.Y", b"difference.Y"]:
            self.assertIn(name, self.pixels("out.inspect.exr"))
        self.assertEqual(self.pixels("out.inspect-density.png")[:4], b"\x89PNG")

        common[common.index("--set"):-1] = []
        result = run("-i", "path", "-q", "-o", self.path / "path.exr", *common)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        self.assertTrue((self.path / "path.inspect.exr").exists())
        self.assertFalse((self.path / "path.inspect-zoom.exr").exists())

    def test_inspect_errors_of_output(self):
        result = run("--inspect", "1,2", "-o", self.path / "no/such/folder/x.exr", self.scene)
        self.assert_error(result, 4, "x.exr")

    def test_time_limit_counts_from_process_start(self):
        for seconds in [1, 3]:
            start = time.monotonic()
            self.render("--time", seconds, "--size", "320x240")
            self.assertLess(time.monotonic() - start, seconds + 1)
            self.assertGreater(time.monotonic() - start, 0.5 * seconds)

    def test_noise_limit(self):
        self.render("--noise", "0.2", "--stats", self.path / "s.json")
        self.assertEqual(json.loads((self.path / "s.json").read_text())["stop_reason"], "noise")

    def test_interrupt_leaves_a_whole_picture(self):
        for sent in [signal.SIGINT, signal.SIGTERM]:
            process = subprocess.Popen([RENDER, "-i", "path", "--spp", "1000000", "--size", "64x48", "-q", "-o",
                                        str(self.path / "out.exr"), "--checkpoint", str(self.path / "state"), str(self.scene)])
            wait_until_caught(process, sent)
            process.send_signal(sent)
            self.assertEqual(process.wait(timeout=20), 130)
            self.assertEqual(exr_size(self.path / "out.exr"), (64, 48))
            self.assertTrue((self.path / "state").exists())
            (self.path / "state").unlink()

    def test_kill_never_leaves_a_truncated_file(self):
        # Passes of one sample on a large picture: most of the time goes into writing picture and checkpoint.
        rng = random.Random(1)
        self.render("--spp", "1", "--size", "800x600")
        command = [RENDER, "-i", "path", "--spp", "1", "--size", "800x600", "-q", "-o", str(self.path / "out.exr"), "--max-depth",
                   "1", "--checkpoint", str(self.path / "state"), "--checkpoint-every", "0.001", str(self.scene)]
        start = time.monotonic()
        subprocess.run(command, check=True)
        duration = time.monotonic() - start
        for _ in range(50):
            process = subprocess.Popen(command)
            time.sleep(rng.uniform(0.2, 1.05) * duration)
            process.kill()
            process.wait()
            self.assertEqual(exr_size(self.path / "out.exr"), (800, 600))
        # Whatever a killed process left behind must not hinder the next one.
        for state in ([], ["--resume"]):
            self.assertEqual(subprocess.run(command + state).returncode, 0)

    def test_camera_by_index_and_name(self):
        self.render("--spp", "1", "--camera", "0")
        info = run("--info", self.scene).stdout
        name = info.split("camera 0 '")[1].split("'")[0]
        self.render("--spp", "1", "--camera", name)


class Crop(unittest.TestCase):
    def test_crop_has_the_bits_of_the_whole(self):
        with tempfile.TemporaryDirectory() as folder:
            whole, crop = Path(folder) / "whole.exr", Path(folder) / "crop.exr"
            scene = SCENES / "ring.glb"
            common = ["-i", "path", "--size", "80x60", "--spp", "6", "-q", scene]
            self.assertEqual(run("-o", whole, *common).returncode, 0)
            for region in ["17,5,63,41", "0,0,1,1", "79,59,80,60"]:
                stats = Path(folder) / "s.json"
                result = run("-o", crop, "--crop", region, "--reference", whole, "--stats", stats, *common)
                self.assertEqual(result.returncode, 0, result.stderr)
                # The renderer's own comparison: identical floats give an error of exactly zero.
                self.assertEqual(json.loads(stats.read_text())["error"]["rmse"], 0.0)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--render", required=True)
    options, rest = parser.parse_known_args()
    RENDER = os.path.abspath(options.render)
    unittest.main(argv=[sys.argv[0], *rest])
