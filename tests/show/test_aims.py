"""Targets that were moved while a robot walked."""

import json

import numpy as np
import pytest

from chilopod import load_robot, planar
from chilopod.record import Recording
from chilopod.show import replay
from chilopod.show.scene.film import Film
from chilopod.show.scene.frames import scene
from helpers.html_page import Page

ROBOT = load_robot("aoi2022-planar")
FIRST, SECOND, THIRD = (0.2, 0.0), (0.3, 0.4), (0.35, 0.0)


@pytest.fixture(scope="module")
def record():
    """Straight on past a target, which is then put to the side, taken away, and put ahead; another one stays."""
    walk = planar.start([ROBOT, ROBOT], target=FIRST, record=Recording(rate=50.0))
    for until, place in ((1.01, SECOND), (1.5, (np.nan, np.nan)), (1.6, THIRD)):
        walk.advance(until)
        walk.aim([place, FIRST])
    walk.advance(3.0)
    walk.halt(np.array([True, False]))
    walk.advance(3.2)
    return walk.to_dataset()


def test_every_target_has_its_turn_and_its_arrival(record):
    moved, stayed = scene(record, ["a", "b"]).aims
    assert [aim.place for aim in moved] == [FIRST, SECOND, THIRD]
    assert [aim.since for aim in moved] == [0.0, 1.02, 1.62]
    first, none, third = (aim.reached for aim in moved)
    np.testing.assert_allclose([first, third], (np.array([0.2, 0.35]) - 0.15) / ROBOT.gait.speed, rtol=1e-3)
    assert none is None
    assert [aim.place for aim in stayed] == [FIRST]


def test_a_robot_that_was_halted_stands_there_and_says_how_far_it_came(record):
    shown = scene(record, ["a", "b"])
    halted, arrived = shown.outcomes
    assert (halted.text, halted.kind, halted.time) == ("2 of 3 targets", "ended", 3.0)
    assert arrived.text == "arrived at 0.5 s"
    np.testing.assert_array_equal(shown.frames.spine[-1, 0], shown.frames.spine[150, 0])


def test_replays_and_films_take_them(record):
    told = json.loads(Page(replay(record, titles=["a", "b"], heading="Course").html).data)["robots"]
    assert [aim["place"] for aim in told[0]["aims"]] == [list(FIRST), list(SECOND), list(THIRD)]
    assert Film(record, titles=["a", "b"], heading="Course", fps=10).mp4()
