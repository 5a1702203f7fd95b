"""The main job from end to end: every section, computed, drawn and written; and its page, as a reader opens it."""

import base64
import json
import re
from pathlib import Path

import numpy as np
import pytest

from chilopod.paper.fit_data import critical_mode_data, variant_settings
from chilopod.paper.registry import load_sections
from chilopod.paper.straight.sections import IDENTIFICATION
from chilopod.tasks.identify import planar
from helpers.html_page import Page as PAGE

HERE = Path(__file__).parent
REPLAYS = ["movie-1", "movie-2", "robot-movie-1", "robot-movie-2", "courses-movie"]
BROKEN = """Promise.all([...document.images].map(async (image) => {
  image.loading = "eager";
  await image.decode().catch(() => {});
  return image.naturalWidth > 1 ? null : image.alt;
}).concat([...document.querySelectorAll("video")].map(async (film) => {
  if (film.readyState < 1 && !film.error)
    await new Promise((done) => { film.onloadedmetadata = film.onerror = done; film.load(); });
  return film.duration > 0.2 ? null : film.src;
}))).then((found) => found.filter((each) => each !== null))"""
PLAYED = """new Promise((done) => {
  const look = () => clock.value.startsWith("0.0 s") ? requestAnimationFrame(look) : done(true);
  look();
})"""
SHOWN = """(play.textContent === "Pause" && play.click(), scrub.value = %s, scrub.dispatchEvent(new Event("input")),
  [clock.value, [...document.querySelectorAll("canvas")].map((each) => each.toDataURL())])"""


def test_every_section_is_computed_and_on_the_page(tiny):
    assert list(tiny.found.values) == list(load_sections())
    assert tiny.failures == {}
    drawn = {path.stem for path in (tiny.folder / "figures").iterdir()}
    page = PAGE((tiny.folder / "index.html").read_text(encoding="utf-8"))
    shown = [attrs["id"] for tag, attrs in page.tags if tag == "section" and attrs.get("class") == "figure"]
    assert drawn == {each for each in shown if not each.startswith("movies-")} | {"pitchfork"}
    without = {section.name for section, rows in tiny.found.rows.items() if not rows}
    assert without == {
        "exponents",
        "branch",
        "undulation",
        "movies",
        "robot-movies",
        "robot-spread",
        "robot-structures",
        "courses-movie",
    }


def test_no_text_of_a_figure_is_cut_or_tiny(tiny):
    """In both layouts of each, as a page shows them."""
    assert tiny.painted.count > 2000
    assert tiny.painted.cut == []
    assert tiny.painted.tiny == []


def test_nothing_of_the_page_is_missing_or_empty(tiny):
    html = (tiny.folder / "index.html").read_text(encoding="utf-8")
    page = PAGE(html)
    for address in (each for name in ("src", "href", "srcset", "poster") for each in page.attributes(name)):
        assert not re.match(r"(https?:)?//", address)
        if address.startswith("#"):
            assert address[1:] in page.attributes("id")
        elif not address.startswith("data:"):
            assert (tiny.folder / address).stat().st_size > 100, address
    assert re.findall(r"<(?:td|th|p|h\d|figcaption|li|dd)\b[^>]*>\s*</", html) == []
    assert re.findall(r"\bnan\b|\binf\b|None", page.text) == []


@pytest.mark.parametrize("name", REPLAYS)
def test_replays_stand_on_their_own_and_have_frames_that_differ(tiny, name):
    html = (tiny.folder / "movies" / f"{name}.html").read_text(encoding="utf-8")
    assert not re.search(r"(?:src|href)=\"(?!data:)|@import|url\(|https?://(?!www\.w3\.org/)", html)
    data = json.loads(PAGE(html).data)
    assert data["time"]["count"] > 10
    for robot in data["robots"]:
        packed = base64.b64decode(robot["pose"] if "pose" in robot else robot["points"])
        frames = np.frombuffer(packed, "<i2").reshape(data["time"]["count"], -1)
        moves = np.flatnonzero((np.diff(frames, axis=0) != 0).any(axis=1))
        assert len(moves) >= 10  # one fewer than frames
        assert len(moves) == moves[-1] + 1  # who has finished a course stands, and nobody else


def test_a_browser_finds_nothing_broken(tiny, browser):
    browser.open(tiny.folder / "index.html")
    assert browser.run(BROKEN) == []
    assert browser.run("document.images.length") == len(list((tiny.folder / "figures").glob("*.png")))
    assert browser.run("[...document.querySelectorAll('td, th')].filter((cell) => !cell.innerText.trim()).length") == 0
    # On a phone as well nothing sticks out.
    for width in (1200, 390):
        browser("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=False)
        assert browser.run("document.documentElement.scrollWidth") <= width
        assert browser.run(BROKEN) == []
    browser("Emulation.clearDeviceMetricsOverride")
    assert {address.partition(":")[0] for address in browser.requested()} <= {"file", "data"}
    assert browser.complaints() == []


@pytest.mark.parametrize("name", REPLAYS)
def test_a_browser_sees_replays_move(tiny, browser, name):
    browser.open(tiny.folder / "movies" / f"{name}.html")
    assert browser.run(PLAYED)
    (start, begun), (end, done) = browser.run(SHOWN % "0"), browser.run(SHOWN % "scrub.max")
    assert start != end
    assert all(one != other for one, other in zip(begun, done, strict=True))
    assert {address.partition(":")[0] for address in browser.requested()} <= {"file", "data"}
    assert browser.complaints() == []


def test_identification_finds_constants_it_was_not_started_from(tiny):
    data, robot = critical_mode_data(), tiny.found.context.robot
    residuals = planar.residuals(robot, data)
    assert np.abs(residuals).max() == pytest.approx(0.702, abs=0.001)
    starts = tiny.found[IDENTIFICATION].starts
    assert len(starts) == 3
    for constants in starts:
        off = planar.residuals(planar.with_constants(robot, constants), data)
        assert constants == pytest.approx(starts[0], rel=1e-4)
        assert np.abs(off).max() < 1.0
        assert (off**2).sum() < (residuals**2).sum()
    # The preset has what is found, to tenths of N*s/m and of mm.
    tenths = np.array([1.0, 1e3, 1e3])
    assert (starts[0] * tenths).round(1) == pytest.approx(tenths * [robot.get(path) for path in planar.FREE])


def test_the_profile_passes_through_the_best_fit_and_predicts(tiny):
    found = tiny.found[IDENTIFICATION]
    best = found.best.legs.forward_offset
    cost = np.interp(best, found.profile.forward_offset, found.profile.largest_residual)
    assert cost < np.abs(found.residuals).max()  # the profile makes the largest residual smallest
    assert found.allowed("legs.forward_offset")[0] < best < found.allowed("legs.forward_offset")[1]
    assert np.isfinite(found.profile.uniform).all()
    assert set(variant_settings()) < set(found.profile.data_vars)
    result = found.as_json()
    assert set(result["constants"]) == set(planar.FREE)
