#!/usr/bin/env python3
"""Opens a benchmark report in headless Chromium, without a network, and uses it: check_report.py REPORT.html

Fails (exit code 1) unless every picture loads, the comparer switches between pictures and between picture and error,
a click moves its border, a click on a crop changes the left picture, and no script error occurs.
--screenshot FILE.png keeps a picture of the page, --width and --height (pixels) its size.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile

# Chromium gives up on a page that is not finished after so many seconds.
TIME_LIMIT = 300

# Runs before the page's own script.
CATCH_ERRORS = """<script>
window.scriptErrors = [];
window.addEventListener("error", event => window.scriptErrors.push(event.message || "a resource failed"), true);
</script>"""

# Runs after it; leaves what it found in the page.
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
  const made = document.createElement("script");
  made.type = "application/json";
  made.id = "check-result";
  made.textContent = JSON.stringify({ failures, counts });
  document.body.append(made);
})().catch(error => window.scriptErrors.push(String(error)));
</script>"""


def browser() -> str:
    for name in ("chromium", "chromium-browser", "google-chrome"):
        path = shutil.which(name)
        if path:
            return path
    sys.exit("error: chromium: not installed; apt-get install chromium")


def run_browser(page: str, profile: str, *options: str) -> str:
    # No sandbox: it refuses to work for root, and the page is ours. No host name resolves: the page must be complete.
    command = [browser(), "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--mute-audio",
               "--host-resolver-rules=MAP * ~NOTFOUND", f"--user-data-dir={profile}", *options, "file://" + page]
    try:
        result = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=TIME_LIMIT)
    except subprocess.TimeoutExpired:
        sys.exit(f"error: {page}: chromium did not finish in {TIME_LIMIT} s")
    if result.returncode != 0:
        sys.exit(f"error: chromium: exit code {result.returncode}: {result.stderr.strip()[-300:]}")
    return result.stdout


def outside_links(text: str) -> list[str]:
    """Addresses that the page would load; names of XML vocabularies are none."""
    return re.findall(r"""(?:src|href)\s*=\s*["'](?:https?:)?//[^"']*|url\(\s*["']?https?:[^)]*|@import[^;]*""", text)


def check(report: str, profile: str) -> tuple[list[str], dict]:
    with open(report, encoding="utf-8") as file:
        text = file.read()
    failures = [f"loads {link}" for link in outside_links(text)]
    page = os.path.join(profile, "page.html")
    with open(page, "w", encoding="utf-8") as file:
        file.write(text.replace("<head>", "<head>" + CATCH_ERRORS, 1).replace("</body>", USE_PAGE + "</body>", 1))
    dump = run_browser(page, profile, "--virtual-time-budget=60000", "--dump-dom")
    found = re.search(r'<script type="application/json" id="check-result">(.*?)</script>', dump, re.DOTALL)
    if not found:
        return failures + ["the page's script did not come to its end"], {}
    result = json.loads(found[1])
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
    with tempfile.TemporaryDirectory() as profile:
        failures, counts = check(arguments.report, profile)
        if arguments.screenshot:
            run_browser(os.path.abspath(arguments.report), profile, "--virtual-time-budget=20000",
                        f"--window-size={arguments.width},{arguments.height}",
                        f"--screenshot={os.path.abspath(arguments.screenshot)}")
    for failure in failures:
        print(f"FAILED: {failure}", file=sys.stderr)
    print(f"{arguments.report}: {counts}, {'FAILED' if failures else 'as it should be'}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
