"""How the live page feels: frames a second, from a key to the frame that shows it, what it takes of a core, and memory.

Not part of `make bench`: it needs a Chromium and an idle machine. Rewrites a table in README.md. The browser draws
without a graphics card, on the same machine. ``--minutes 20`` watches memory for so long.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import shutil
import sys
import time
from pathlib import Path
from statistics import median
from typing import Any

from chilopod.live import Live
from chilopod.live.wishes import Set
from chilopod.robot import load_robot

from _timing import machine, table, write_section

SOFTWARE_WEBGL = "--enable-unsafe-swiftshader"
FRAMES = """seconds => new Promise(done => {
  let count = 0; const begin = performance.now();
  const next = () => {
    if (performance.now() - begin > 1000 * seconds) done(count / seconds);
    else { count++; requestAnimationFrame(next); }
  };
  requestAnimationFrame(next);
})"""
# From a key that softens the first spring to the frame after its new value stands on the page.
REACTS = """key => new Promise(done => {
  const stiffness = () => /first spring, ([\\d.]+)/.exec(document.body.innerText)?.[1];
  const before = stiffness(), begin = performance.now();
  const seen = new MutationObserver(() => {
    if (stiffness() === before) return;
    seen.disconnect(); requestAnimationFrame(() => done(performance.now() - begin));
  });
  seen.observe(document.body, {subtree: true, childList: true, characterData: true});
  document.body.dispatchEvent(new KeyboardEvent("keydown", {key, code: "Key" + key.toUpperCase(), bubbles: true}));
})"""
ROBOTS = {"planar": "aoi2022-planar", "twin": "aoi2022"}


def resident() -> float:
    """MB of this process."""
    status = Path("/proc/self/status").read_text()
    return int(next(line for line in status.splitlines() if line.startswith("VmRSS")).split()[1]) / 1e3


def measured(chromium: Any, engine: str, width: int, height: int) -> tuple[str, ...]:
    """A row of the table."""
    live = Live(load_robot(ROBOTS[engine]), engine, port=0)
    try:
        live.wish(Set("speed", 1.0))
        page = chromium.new_page(viewport={"width": width, "height": height})
        page.goto(live.address)
        page.get_by_text("pitchfork at").first.wait_for(timeout=600_000)
        time.sleep(3.0)
        reacts = []
        for _ in range(12):
            reacts.append(page.evaluate(REACTS, "z"))
            time.sleep(0.7)
        time.sleep(8.0)  # what is computed beside it
        frames, busy, cpu = live.frames, live.busy, time.process_time()
        shown = page.evaluate(FRAMES, 10.0)
        frames, busy, cpu = (
            (now - then) / 10.0
            for now, then in zip((live.frames, live.busy, time.process_time()), (frames, busy, cpu), strict=True)
        )
        page.close()
        return (
            engine,
            f"{width} x {height}",
            f"{shown:.0f}",
            f"{frames:.0f}",
            f"{median(reacts):.0f} ms",
            f"{max(reacts):.0f} ms",
            f"{100.0 * busy:.0f} %",
            f"{100.0 * cpu:.0f} %",
        )
    finally:
        live.close()


def remembered(chromium: Any, minutes: float) -> str:
    """What a long visit does to memory."""
    live = Live(load_robot(ROBOTS["planar"]), port=0)
    try:
        page = chromium.new_page(viewport={"width": 800, "height": 500})
        page.goto(live.address)
        page.get_by_text("pitchfork at").first.wait_for(timeout=600_000)
        live.wish(Set("speed", 10.0))
        samples = []
        begin = time.monotonic()
        settle = min(120.0, 30.0 * minutes)
        while (passed := time.monotonic() - begin) < 60.0 * minutes + settle:
            page.keyboard.press("z" if int(passed / 20.0) % 2 else "x")
            time.sleep(5.0)
            heap = page.evaluate("() => performance.memory.usedJSHeapSize / 1e6")
            samples.append((passed, resident(), heap))
            print(f"{passed:6.0f} s  server {samples[-1][1]:.0f} MB, page {heap:.0f} MB", file=sys.stderr)
        rest = [each for each in samples if each[0] > settle]
        third = max(1, len(rest) // 3)
        first, last = (
            [median(each[column] for each in part) for column in (1, 2)] for part in (rest[:third], rest[-third:])
        )
        return (
            f"In {minutes:g} minutes at ten times real time, with a spring that is changed every five seconds: server "
            f"{first[0]:.0f} MB in the first third, {last[0]:.0f} MB in the last; page {first[1]:.0f} MB and "
            f"{last[1]:.0f} MB."
        )
    finally:
        live.close()


def main() -> None:
    from playwright.sync_api import sync_playwright

    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--minutes", type=float, default=20.0)
    minutes = asked.parse_args().minutes
    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if path is None:
        raise SystemExit("there is no Chromium here")
    with sync_playwright() as started:
        chromium = started.chromium.launch(executable_path=path, args=[SOFTWARE_WEBGL])
        rows = [
            measured(chromium, *each) for each in (("planar", 1280, 800), ("planar", 800, 500), ("twin", 1280, 800))
        ]
        memory = remembered(chromium, minutes)
    head = ("engine", "window", "frames drawn a second", "frames sent", "key to frame, median", "slowest of 12")
    write_section("live", f"{machine()}\n\n{table((*head, 'walk and picture', 'whole process'), rows)}\n\n{memory}")


if __name__ == "__main__":
    main()
