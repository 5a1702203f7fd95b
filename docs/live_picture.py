"""The picture of the live page: ``python docs/live_picture.py`` writes ``docs/images/live.webp``.

It needs a Chromium. The first spring is below the pitchfork, and the walk has settled on the curve of the branch.
"""

from __future__ import annotations

import io
import shutil
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

from chilopod.analysis.parameters import stiffness
from chilopod.live import Live, wishes
from chilopod.output import write_atomic
from chilopod.robot import load_robot

SIZE = {"width": 1280, "height": 800}
PATIENCE = 120_000  # ms


def picture(page: Page, live: Live) -> bytes:
    """The page, settled."""
    page.goto(live.address)
    page.get_by_text("pitchfork at").first.wait_for(timeout=PATIENCE)
    for wish in (wishes.Spring(0, stiffness(8.0)), wishes.Set("speed", 10.0)):
        live.wish(wish)
    page.get_by_text("Settled on").first.wait_for(timeout=PATIENCE)
    live.wish(wishes.Set("speed", 1.0))
    page.wait_for_timeout(1500)
    written = io.BytesIO()
    Image.open(io.BytesIO(page.screenshot())).convert("RGB").save(written, "WEBP", quality=80, method=6)
    return written.getvalue()


if __name__ == "__main__":
    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if path is None:
        raise SystemExit("there is no Chromium here")
    live = Live(load_robot("aoi2022-planar"), port=0)
    try:
        with sync_playwright() as started:
            chromium = started.chromium.launch(executable_path=path, args=["--enable-unsafe-swiftshader"])
            shown = picture(chromium.new_page(viewport=SIZE), live)
        print(write_atomic(Path(__file__).parent / "images" / "live.webp", shown))
    finally:
        live.close()
