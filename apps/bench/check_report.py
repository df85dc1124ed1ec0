#!/usr/bin/env python3
"""Opens a benchmark report in headless Chromium, without a network, and uses it: check_report.py REPORT.html

Fails (exit code 1) unless every picture loads, the comparer switches between pictures and between picture and error,
a click moves its border, a click on a crop changes the left picture, and no script error occurs.
--screenshot FILE.png keeps a picture of the page, --width and --height (pixels) its size.
"""

from __future__ import annotations

import argparse
import http.server
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time

TIME_LIMIT = 120  # seconds

# Runs before the page's own script.
CATCH_ERRORS = """<script>
window.scriptErrors = [];
window.addEventListener("error", event => window.scriptErrors.push(event.message || "a resource failed"), true);
</script>"""

# Runs after it; sends what it found to this program.
USE_PAGE = """<script>
(async () => {
  const failures = [], counts = { viewers: 0, images: 0, curves: document.querySelectorAll(".curves svg").length };
  const expect = (right, what) => { if (!right) failures.push(what); };
  const loaded = async (image, what) => {
    try { await image.decode(); } catch (error) { failures.push(what + ": " + error.message); return; }
    counts.images += 1;
    expect(image.naturalWidth > 1, what + ": no pixels");
  };
  for (const scene of SCENES) {
    const root = document.getElementById("viewer-" + scene.name), names = scene.pictures.map(p => p.name);
    const left = root.querySelector("img.over"), right = root.querySelector("img.under");
    const press = (key, value) => [...root.querySelectorAll("button[data-key]")]
      .find(button => button.dataset.key === key && button.dataset.value === value).click();
    counts.viewers += 1;
    for (const name of names) {
      press("left", name);
      press("mode", "picture");
      await loaded(left, scene.name + ", " + name);
      const before = left.src;
      press("mode", "error");
      await loaded(left, scene.name + ", error of " + name);
      expect(name === "reference" || left.src !== before, scene.name + ", " + name + ": the error is not shown");
      press("mode", "picture");
      expect(root.querySelector(".tag.left").textContent === name, scene.name + ": the left picture does not switch");
    }
    press("right", names[0]);
    await loaded(right, scene.name + ", right");
    expect(right.src.length === ("data:image/png;base64," + scene.pictures[0].picture).length,
           scene.name + ": the right picture does not switch");
    const crops = [...root.querySelectorAll(".crop")];
    expect(crops.length === names.length, scene.name + ": crops are missing");
    for (const crop of crops) await loaded(crop.querySelector("img"), scene.name + ", crop");
    crops[0].click();
    expect(root.querySelector(".tag.left").textContent === names[0], scene.name + ": a click on a crop does nothing");
    const stage = root.querySelector(".stage"), box = stage.getBoundingClientRect();
    stage.dispatchEvent(new PointerEvent("pointerdown", { clientX: box.left + 0.25 * box.width, buttons: 1 }));
    expect(left.style.clipPath.includes("75%"), scene.name + ": the border does not move: " + left.style.clipPath);
    press("left", names[0]);
    press("right", names[names.length - 1]);
    stage.dispatchEvent(new PointerEvent("pointerdown", { clientX: box.left + 0.5 * box.width, buttons: 1 }));
  }
  expect(counts.curves === SCENES.length, "curves are missing");
  failures.push(...window.scriptErrors);
  return { failures, counts };
})().catch(error => ({ failures: [String(error)], counts: {} }))
  .then(result => fetch("http://127.0.0.1:@PORT@/", { method: "POST", mode: "no-cors", body: JSON.stringify(result) }));
</script>"""


def browser() -> str:
    for name in ("chromium", "chromium-browser", "google-chrome"):
        path = shutil.which(name)
        if path:
            return path
    sys.exit("error: chromium: not installed; apt-get install chromium")


def command_for(page: str, profile: str, *options: str) -> list[str]:
    # No sandbox: it refuses to work for root, and the page is ours. No host name resolves: the page must be complete.
    return [browser(), "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--mute-audio",
            "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1", f"--user-data-dir={profile}", *options,
            "file://" + page]


class Listener(http.server.HTTPServer):
    """Takes one message from the page."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.message: dict | None = None
        self.timeout = 1.0


class Handler(http.server.BaseHTTPRequestHandler):
    def do_POST(self) -> None:
        self.server.message = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        self.send_response(204)
        self.end_headers()

    def log_message(self, *_) -> None:
        pass


def used_page(text: str, profile: str) -> dict | None:
    """What the page found when it used itself; None if it never told."""
    page = os.path.join(profile, "page.html")
    with Listener() as listener:
        script = USE_PAGE.replace("@PORT@", str(listener.server_port))
        with open(page, "w", encoding="utf-8") as file:
            file.write(text.replace("<head>", "<head>" + CATCH_ERRORS, 1).replace("</body>", script + "</body>", 1))
        # A port for debugging keeps the browser open until it is told to end.
        process = subprocess.Popen(command_for(page, profile, "--remote-debugging-port=0"), stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        try:
            end = time.monotonic() + TIME_LIMIT
            while listener.message is None and process.poll() is None and time.monotonic() < end:
                listener.handle_request()
        finally:
            process.terminate()
            process.wait()
        return listener.message


def take_screenshot(report: str, profile: str, output: str, width: int, height: int) -> None:
    command = command_for(os.path.abspath(report), profile, "--virtual-time-budget=20000",
                          f"--window-size={width},{height}", f"--screenshot={os.path.abspath(output)}")
    if subprocess.run(command, capture_output=True, timeout=TIME_LIMIT).returncode != 0 or not os.path.exists(output):
        sys.exit(f"error: {output}: chromium took no screenshot")


def outside_links(text: str) -> list[str]:
    """Addresses that the page would load; names of XML vocabularies are none."""
    return re.findall(r"""(?:src|href)\s*=\s*["'](?:https?:)?//[^"']*|url\(\s*["']?https?:[^)]*|@import[^;]*""", text)


def check(report: str, profile: str) -> tuple[list[str], dict]:
    with open(report, encoding="utf-8") as file:
        text = file.read()
    failures = [f"loads {link}" for link in outside_links(text)]
    result = used_page(text, profile)
    if result is None:
        return failures + [f"the page's script did not come to its end in {TIME_LIMIT} s"], {}
    return failures + result["failures"], result["counts"]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("report")
    parser.add_argument("--screenshot", metavar="FILE.png")
    parser.add_argument("--width", type=int, default=1280)
    parser.add_argument("--height", type=int, default=2400)
    arguments = parser.parse_args()
    if not os.path.isfile(arguments.report):
        sys.exit(f"error: {arguments.report}: no such file")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        failures, counts = check(arguments.report, profile)
        if arguments.screenshot:
            take_screenshot(arguments.report, profile, arguments.screenshot, arguments.width, arguments.height)
    for failure in failures:
        print(f"FAILED: {failure}", file=sys.stderr)
    print(f"{arguments.report}: {counts}, {'FAILED' if failures else 'as it should be'}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
