"""The page in which the planar robot walks: its motion is that of the planar model."""

import json
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from chilopod import load_robot
from chilopod.errors import AnalysisError
from chilopod.planar import initial_states, simulate
from chilopod.show.play import motion, play
from chilopod.show.play.page import theory
from chilopod.steering import SpringLaw
from helpers.command_line import run

BENT = (0.03, -0.01, 0.02, 0.0, 0.01)  # rad
BEHIND = (-0.9, 0.9)  # m: out of the scanner's view at first
END = 20.0  # s
PAGE_OF_DOCS = Path(__file__).parents[2] / "docs" / "play.md"
LAG = """new Promise((done) => {{
  const usual = window.requestAnimationFrame, by = (id) => document.getElementById(id);
  by("speed").value = "4";
  by("restart").click();
  play.robot.setSpring(0, 40 * play.data.unit);
  window.requestAnimationFrame = (frame) => {{
    let now = performance.now();
    window.requestAnimationFrame = () => 0;
    for (let left = 6; left > 0; left -= {0}) frame(now += 1000 * {0});
    // The first arrow key sets the target beside the middle of the picture.
    by("floor").dispatchEvent(new KeyboardEvent("keydown", {{ key: "ArrowUp" }}));
    const [x, y] = play.robot.target, [mx, my] = play.robot.place()[play.data.modules >> 1];
    window.requestAnimationFrame = usual;
    usual(frame);
    done(Math.hypot(mx - x, my - y + 0.1));
  }};
}})"""


@dataclass(frozen=True)
class InView:
    """Law of the first spring that sees what the paper's scanner sees, as the referee of a course lets it."""

    law: SpringLaw

    def events(self, gait):
        return self.law.events(gait)

    def act(self, event, seen):
        hidden = (seen.distance > 4.095) | (np.abs(seen.bearing) > np.radians(120.0))
        bearing, distance = (np.where(hidden, np.nan, each) for each in (seen.bearing, seen.distance))
        return self.law.act(event, replace(seen, bearing=bearing, distance=distance))


@pytest.fixture(scope="module")
def robot():
    return load_robot("aoi2022-planar").override("springs.stiffness[0]", "8 N*mm/deg")


@pytest.fixture(scope="module")
def page(robot, tmp_path_factory):
    path = tmp_path_factory.mktemp("play") / "play.html"
    path.write_text(play(robot), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def browser(page, browser):
    browser.open(page)
    return browser


def walked(robot, law):
    """Pose and joint angles in the end, of a walk by the planar model."""
    how = {"controller": InView(law), "target": BEHIND} if law else {}
    data = simulate(robot, END, initial=initial_states(robot, joint_angles=BENT), tolerance=1e-13, **how)
    ends = (data[name].values[-1, 0] for name in ("position", "heading", "joint_angle"))
    return np.concatenate([np.atleast_1d(each) for each in ends])


@pytest.mark.parametrize("steers", [False, True])
def test_the_motion_is_that_of_the_planar_model(robot, browser, steers):
    adjustable = robot.override("springs.adjustable[0]", True)
    law = SpringLaw.of(adjustable, theory(robot)[1]) if steers else None
    found = browser.run(
        f"""(() => {{
          const robot = planarRobot(play.data, 1e-13);
          robot.restart({json.dumps(BENT)});
          robot.target = {json.dumps(BEHIND if steers else None)};
          robot.steersSpring = true;
          for (let step = 1; step <= 2000; step++) robot.advance(step * 0.01);
          const n = play.data.modules;
          return [...robot.state.subarray(2 * n + 1), ...robot.state.subarray(3, n + 2)];
        }})()"""
    )
    np.testing.assert_allclose(found, walked(adjustable, law), atol=1e-9, rtol=0.0)


def test_the_page_asks_for_nothing_and_finds_nothing_wrong(page, browser):
    browser.run("new Promise((done) => setTimeout(done, 300))")
    assert browser.requested() == [page.as_uri()]
    assert browser.complaints() == []
    assert browser.run("play.frames") > 0
    assert page.stat().st_size < 100_000


def test_the_page_is_used_without_eyes_and_without_a_mouse(browser):
    assert browser.nameless() == []
    browser.run("document.getElementById('floor').focus()")
    for key in ("keyDown", "keyUp"):
        browser("Input.dispatchKeyEvent", type=key, key="ArrowUp", code="ArrowUp", windowsVirtualKeyCode=38)
    assert browser.run("play.robot.target !== null")
    browser("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=1, mobile=False)
    assert browser.run("document.documentElement.scrollWidth") <= 390
    browser("Emulation.clearDeviceMetricsOverride")
    browser.run("document.getElementById('none').click()")


def test_the_picture_follows_alike_at_any_rate_of_frames(browser):
    often, rarely = (browser.run(LAG.format(pause)) for pause in (1.0 / 60.0, 0.1))
    assert 0.02 < rarely < 0.15
    assert rarely == pytest.approx(often, abs=0.03)


def test_what_the_page_says(browser):
    say = "(() => {{ {} return play.words(); }})()"
    by = "document.getElementById"
    stiff = browser.run(say.format(f"{by}('restart').click(); play.robot.setSpring(0, 40 * play.data.unit);"))
    assert stiff.startswith("The straight walk is stable: the first spring is stiffer than 11.99 N·mm/deg.")
    soft = browser.run(say.format("play.robot.setSpring(0, 8 * play.data.unit); play.walk(60);"))
    assert soft.startswith("The straight walk is unstable: the first spring is softer than 11.99 N·mm/deg. The body is")
    assert re.search(r"bent by \d+° to the (left|right)\.$", soft)
    there = browser.run(say.format(f"{by}('left').click(); for (let i = 0; i < 60; i++) play.walk(1);"))
    assert there.endswith("The robot has arrived at its target.")
    folded = browser.run(say.format("play.robot.setSpring(0, 2.5 * play.data.unit); play.walk(200);"))
    assert folded == "A joint is bent by more than a right angle. The walk has ended: restart it."


@pytest.mark.parametrize(
    ("query", "spring", "note"),
    [
        ("?k1=8", 8.0, ""),
        ("?k1=51.25&seed=0", 51.25, ""),
        ("?seed=2.5", 8.0, "seed = 2.5 (allowed: 0 to 2147483648, now 2)"),
        ("?k1=1e9", 51.25, "k1 = 1e9 (allowed: 2.05 to 51.25, now 51.25)"),
        (
            "?k1=nonsense&seed=-3",
            8.0,
            "seed = -3 (allowed: 0 to 2147483648, now 0), k1 = nonsense (allowed: 2.05 to 51.25, now 8)",
        ),
    ],
)
def test_the_address_sets_the_spring(page, browser, query, spring, note):
    browser("Page.navigate", url=page.as_uri() + query)
    browser.run("new Promise((done) => setTimeout(done, 300))")
    assert browser.run("play.robot.springs[0] / play.data.unit") == pytest.approx(spring)
    assert browser.run("document.getElementById('note').textContent") == (
        f"Wrong in the address: {note}." if note else ""
    )


def test_the_numbers_of_the_motion_are_those_of_the_robot(robot):
    found = motion(robot)
    assert found["modules"] == 6
    assert found["springs"] == list(robot.springs.stiffness)
    assert [event["side"] for event in found["legYaw"]["events"]] == [0, 1]


@pytest.mark.parametrize(
    ("asked", "part"),
    [
        ((), "the search for a pitchfork was given up after 0 s; allowed: fewer or heavier modules"),
        (("--out", "/dev/null/x.html"), "/dev/null/x.html: --out: cannot be written"),
    ],
)
def test_what_cannot_be_a_page_is_refused_in_a_line(asked, part, monkeypatch):
    monkeypatch.setattr("chilopod.show.play.page._SEARCH", 0.0)
    code, _, err = run("play", *asked)
    assert code == 2
    assert err.count("\n") == 1
    assert part in err


def test_a_robot_without_a_radius_law_is_named(robot, monkeypatch):
    def law(*_):
        raise AnalysisError("subcritical: it jumps", field="branch")

    monkeypatch.setattr("chilopod.show.play.page.radius_laws", law)
    with pytest.raises(
        AnalysisError, match=r"^robot = 'aoi2022-planar': subcritical: it jumps; allowed: one whose turns"
    ):
        play(robot)


def test_the_command_writes_one_file_and_replaces_none(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run("play", "--json")[0] == 0
    assert (tmp_path / "play.html").read_text(encoding="utf-8").startswith("<!doctype html>")
    size = f"about {(tmp_path / 'play.html').stat().st_size / 1000:.0f} kB"
    for said in (run("play", "--help")[1], PAGE_OF_DOCS.read_text(encoding="utf-8")):
        assert size in " ".join(said.split())
    code, _, err = run("play")
    assert code == 2
    assert "play.html" in err
    assert "--force" in err
    code, _, err = run("play", "--out", "none.html", "--set", "springs.stiffness=1 N*m/rad", "--set", "body.modules=2")
    assert code == 2
    assert err.count("\n") == 1
