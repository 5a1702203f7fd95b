"""Targets that move while a robot walks, as replays and films show them."""

import json
import runpy
from pathlib import Path

import numpy as np
import pytest

from chilopod import load_robot, planar
from chilopod.record import Recording
from chilopod.report.scene.film import movie
from chilopod.report.scene.frames import scene
from chilopod.report.scene.goals import goals
from chilopod.report.scene.replay import replay

Page = runpy.run_path(str(Path(__file__).parents[1] / "html_page.py"))["Page"]
ROBOT = load_robot("aoi2022-planar")
FIRST, SECOND, THIRD = (0.2, 0.0), (0.3, 0.4), (0.35, 0.0)


def course(halts=True):
    """Straight on past a target, which is then put to the side, taken away, and put ahead."""
    walk = planar.start([ROBOT, ROBOT], target=FIRST, record=Recording(rate=50.0))
    nowhere = [np.nan, np.nan]
    for until, places in ((1.01, [SECOND, FIRST]), (1.5, [nowhere, FIRST]), (1.6, [THIRD, FIRST])):
        walk.advance(until)
        walk.aim(places)
    walk.advance(3.0)
    if halts:
        walk.halt(np.array([True, False]))
    walk.advance(3.2)
    return walk.to_dataset()


@pytest.fixture(scope="module")
def record():
    return course()


def test_every_target_has_its_time_and_its_arrival(record):
    moved, stayed = goals(record)
    assert [goal.place for goal in moved] == [FIRST, SECOND, THIRD]
    assert [(goal.since, goal.until) for goal in moved] == [(0.0, 1.02), (1.02, 1.52), (1.62, np.inf)]
    speed = ROBOT.gait.speed
    arrivals = [(place[0] - 0.15) / speed for place in (FIRST, THIRD)]
    np.testing.assert_allclose([goal.arrival for goal in moved], [arrivals[0], np.nan, arrivals[1]], rtol=1e-3)
    assert [(goal.place, goal.since, goal.until) for goal in stayed] == [(FIRST, 0.0, np.inf)]
    stages = [[goal.stage(time) for goal in moved] for time in (0.1, 0.9, 1.2, 1.55, 1.7, 3.1)]
    assert stages == [
        ["present", "ahead", "ahead"],
        ["reached", "ahead", "ahead"],
        ["behind", "present", "ahead"],
        ["behind", "missed", "ahead"],
        ["behind", "missed", "present"],
        ["behind", "missed", "reached"],
    ]


def test_a_robot_that_was_halted_has_finished(record):
    finished, arrived = scene(record, ["a", "b"]).outcomes
    assert (finished.text, finished.kind, finished.time) == ("finished at 3.0 s", "ended", 3.0)
    assert arrived.text == "arrived at 0.5 s"
    cut, _ = scene(record.sel(time=slice(0.0, 3.0)), ["a", "b"]).outcomes
    assert cut == finished
    last, _ = scene(course(halts=False), ["a", "b"]).outcomes
    assert (last.text, last.kind) == ("arrived at 2.1 s", "arrived")


def test_replays_and_films_show_targets_in_their_places(record, tmp_path):
    told = json.loads(Page(replay(record, titles=["a", "b"], heading="Course")).data)["robots"]
    assert [goal["place"] for goal in told[0]["goals"]] == [list(FIRST), list(SECOND), list(THIRD)]
    assert [goal["until"] for goal in told[0]["goals"]] == [1.02, 1.52, None]
    assert told[0]["goals"][1]["arrival"] is None
    assert movie(record, tmp_path / "course.mp4", titles=["a", "b"], heading="Course", fps=10).stat().st_size > 0
