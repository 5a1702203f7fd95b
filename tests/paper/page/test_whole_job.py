"""The main job from end to end: every section, computed, drawn and written; and its page, as a reader opens it."""

import base64
import json
import pickle
import re
from pathlib import Path

import numpy as np
import pytest

from chilopod.netcdf import netcdf
from chilopod.paper import statements
from chilopod.paper.curved import figures as curved_figures
from chilopod.paper.curved.sections import CURVED
from chilopod.paper.printed import critical_mode_data, variant_settings
from chilopod.paper.registry import load_sections
from chilopod.paper.straight.sections import IDENTIFICATION
from chilopod.paper.table import OfPlanar, Row
from chilopod.paper.turning.sections import TURNING
from chilopod.show import files, style
from chilopod.tasks.identify import planar_fit
from helpers.html_page import Page as PAGE

HERE = Path(__file__).parent
REPLAYS = ["movie-1", "movie-2", "robot-movie-1", "robot-movie-2", "courses-movie"]
CURVED_PANELS = {
    each.__name__: each
    for each in (curved_figures.walks, curved_figures.joints, curved_figures.onset, curved_figures.variants)
}
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
        "exponents", "branch", "undulation", "movies", "robot-movies", "robot-spread", "robot-strategies",
        "robot-structures",
        "robot-why-sets",
        "courses-movie", "scaling", "atlas",
    }  # fmt: skip


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
    assert not re.search(r"@import|url\(|Still to come|refresh", html)
    assert html.count("<script>") == html.count("<script") == 1  # the page's own
    assert re.findall(r"<(?:td|th|p|h\d|figcaption|li|dd)\b[^>]*>\s*</", html) == []
    assert re.findall(r"\bnan\b|\binf\b|None|\b[A-Z]\w+\(\w+=", page.text) == []


def test_every_film_can_be_drawn_by_another_process(tiny):
    films = [movie for section, value in tiny.found.values.items() for movie in section.films(value)]
    assert [pickle.loads(pickle.dumps(movie)).name for movie in films] == REPLAYS


@pytest.mark.parametrize("name", REPLAYS)
def test_replays_stand_on_their_own_and_have_frames_that_differ(tiny, name):
    html = (tiny.folder / "movies" / f"{name}.html").read_text(encoding="utf-8")
    assert not re.search(r"(?:src|href)=\"(?!data:)|@import|url\(|fetch\(|import\(|https?://(?!www\.w3\.org/)", html)
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
    residuals = planar_fit.residuals(robot, data)
    assert np.abs(residuals).max() == pytest.approx(0.702, abs=0.001)
    starts = tiny.found[IDENTIFICATION].starts
    assert len(starts) == 3
    for constants in starts:
        off = planar_fit.residuals(planar_fit.with_constants(robot, constants), data)
        assert constants == pytest.approx(starts[0], rel=1e-4)
        assert np.abs(off).max() < 1.0
        assert (off**2).sum() < (residuals**2).sum()
    # The preset has what is found, to tenths of N*s/m and of mm.
    tenths = np.array([1.0, 1e3, 1e3])
    assert (starts[0] * tenths).round(1) == pytest.approx(tenths * [robot.get(path) for path in planar_fit.FREE])


def test_the_profile_passes_through_the_best_fit_and_predicts(tiny):
    found = tiny.found[IDENTIFICATION]
    best = found.best.legs.forward_offset
    cost = np.interp(best, found.profile.forward_offset, found.profile.largest_residual)
    assert cost < np.abs(found.residuals).max()  # the profile makes the largest residual smallest
    assert found.allowed("legs.forward_offset")[0] < best < found.allowed("legs.forward_offset")[1]
    assert np.isfinite(found.profile.uniform).all()
    assert set(variant_settings()) < set(found.profile.data_vars)
    result = found.as_json()
    assert set(result["constants"]) == set(planar_fit.FREE)


def test_a_small_study_of_curved_walks_says_what_it_found(tiny):
    study, seen = tiny.found[CURVED], tiny.told[CURVED.sentence]
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    found = tiny.found.rows[CURVED]
    said = {row.quantity: row for row in found if isinstance(row, Row)}
    assert said["joints by how far they bend"].verdict == "agrees"
    beside = {row.statement: row.result.words for row in found if isinstance(row, OfPlanar)}
    assert beside[statements.STRAIGHT] == "straight from 41 N*mm/deg up"
    assert beside[statements.CURVED].startswith("curved up to 10 N*mm/deg, ")
    assert beside[statements.ONSET].endswith("; the point is at 11.99")
    points = [beside[each.onset].rpartition(" ")[2] for each in statements.VARIANTS.values()]
    assert points == ["8.92", "10.79", "11.34"]
    alike = [100 * (float(study.comparison.equal_spring[row]) - 1) for row in (1, 2, 3)]
    shown = [beside[each.radius].rpartition("; ")[2] for each in statements.VARIANTS.values()]
    assert shown == [f"{value:+.0f} % at the same spring" for value in alike]
    assert study.comparison.criticality.values.tolist() == ["supercritical"] * 2 + ["subcritical"] * 2
    assert study.comparison.stiffest_k1.values[-1] == pytest.approx(11.483, abs=0.001)
    assert study.comparison.exact_k1.values == pytest.approx([11.991, 8.919, 10.786, 11.344], abs=1e-3)
    exact, fitted = study.fits.attrs["exact_k1"], study.fits.critical_k1.values
    assert (fitted - exact > 0.2).all()
    assert (np.abs(fitted - study.fits.exact_walks) < 4.0 * study.fits.trial_error).all()
    assert float(study.agreement.max()) < 1e-6


@pytest.mark.parametrize("name", CURVED_PANELS)
def test_panels_of_curved_walks_say_what_is_drawn_and_store_it(tiny, name):
    panel = CURVED_PANELS[name](tiny.found[CURVED])
    assert panel.alt
    assert all(panel.text)
    assert "nan" not in " ".join((panel.alt, *panel.text))
    assert netcdf(panel.data)
    assert files.csv(panel.data).count("\n") > 5


def test_the_fork_shows_every_mean(tiny):
    study = tiny.found[CURVED]
    with style.house_style():
        axes = curved_figures.walks(study).draw(False).axes
    (fork,) = (each for each in axes if each.get_ylabel() == "mean angle of joint 1 (deg)")
    shown = np.concatenate([line.get_ydata() for line in fork.get_lines() if line.get_marker() == "o"])
    angles = np.rad2deg(study.trials.mean_angle.sel(joint=1))
    for side in ("left", "right"):
        here = study.trials.direction == side
        means = angles.where(here).mean("repeat").where(here.sum("repeat") > 1).values
        for mean in means[np.isfinite(means)]:
            assert np.nanmin(np.abs(shown - mean)) < 1e-9


@pytest.fixture(scope="module")
def turns(tiny):
    return TURNING.figures(tiny.found)


def test_paths_are_drawn_with_equal_scales(turns):
    by_name = {panel.name: panel for panel in turns}
    with style.house_style():
        for name, letters in (("turning", ("A ", "B ")), ("turning-without", ("A ", "B "))):
            axes = [each for each in by_name[name].draw(False).axes if each.get_title(loc="left").startswith(letters)]
            assert len(axes) == 2
            assert all(each.get_aspect() == 1.0 for each in axes)


def test_every_figure_has_a_name_of_its_own_words_and_a_table(turns):
    assert len({panel.name for panel in turns}) == len(turns) == 6
    for panel in turns:
        text = " ".join((panel.title, panel.alt, *panel.text))
        assert "nan" not in text and "  " not in text, panel.name  # noqa: PT018
        assert panel.alt.endswith(".")
        assert len(files.csv(panel.data).splitlines()) > 10


def test_the_shaded_springs_are_those_that_arrive(turns):
    panel = next(panel for panel in turns if panel.name == "turning-criteria")
    most = np.isfinite(panel.data.arrival.values).mean(axis=1) > 0.5
    arrived = panel.data.spring.values[most]
    assert f"{arrived.min():g} to {arrived.max():g}" in panel.text[0]
