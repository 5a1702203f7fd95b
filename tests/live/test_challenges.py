"""Challenges, and whether they were met."""

from dataclasses import replace

import numpy as np
import pytest

from chilopod.analysis.parameters import stiffness
from chilopod.engine import Status
from chilopod.live import Session, wishes
from chilopod.live.challenges import Left, Onset, Pole
from chilopod.live.theory import Theory
from chilopod.robot import load_robot

PLANAR = load_robot("aoi2022-planar")
KNOWN = Theory(PLANAR, stiffness(12.0))


@pytest.fixture
def seen():
    return Session(PLANAR).seen()


def at(seen, spring):
    return replace(seen, stiffness=stiffness(1.0) * np.array([spring, 41.0, 41.0, 41.0, 41.0]))


def test_the_onset_is_found_to_half_a_unit(seen):
    challenge = Onset()
    assert challenge.hides
    for spring, said in ((13.0, "softer"), (11.0, "stiffer")):
        challenge.answer(challenge.answers[0], at(seen, spring), KNOWN)
        assert said in challenge.said
        assert challenge.asks
    challenge.answer(challenge.answers[0], at(seen, 12.4), Theory(remark="computing", computing=True))
    assert "not known" in challenge.said
    challenge.answer(challenge.answers[0], at(seen, 12.4), KNOWN)
    assert challenge.done
    assert not challenge.asks


def test_the_pole_is_reached_by_the_spring_alone(seen):
    challenge = Pole()
    wish = challenge.begin(seen)
    assert wish.by_hand
    x, y = wish.place
    challenge.look(seen)  # before the wish is granted
    challenge.look(replace(seen, target=wish.place))
    assert "1.20 m" in challenge.said
    challenge.look(replace(seen, target=None, pose=np.array([x - 0.1, y, 0.0])))
    assert challenge.done


@pytest.mark.parametrize(
    ("helped", "said"),
    [({"steering": "leg-yaw"}, "gone"), ({"pulled": np.full(5, 0.1)}, "pulled"), ({"target": None}, "gone")],
)
def test_the_pole_counts_without_help_only(seen, helped, said):
    challenge = Pole()
    aimed = replace(seen, target=challenge.begin(seen).place)
    challenge.look(aimed)
    challenge.look(replace(aimed, **helped))
    assert said in challenge.said
    assert not challenge.done


def test_no_pole_is_set_up_for_a_robot_that_has_stopped():
    challenge = Pole()
    stopped = replace(Session(PLANAR).seen(), status=Status.OUT_OF_RANGE, pose=np.full(3, np.nan))
    assert challenge.begin(stopped) is None
    challenge.look(stopped)
    assert challenge.said.startswith("The robot has stopped.")


def test_left_twice_in_a_row_and_why():
    challenge, time = Left(), 0.0
    straight = Session(PLANAR).seen()

    def attempt(side, **helped):
        nonlocal time
        challenge.look(replace(straight, time=time + 50.0))
        challenge.look(replace(straight, time=time))
        bent = replace(straight, time=time + 1.0, mean_angles=np.full(5, -0.5 * side), turning=0.01)
        challenge.look(replace(bent, **helped))
        challenge.look(replace(bent, time=time + 2.0))  # counts once

    for side, row in ((1, 1), (-1, 0), (1, 1)):
        attempt(side)
        assert f"{row} of 2" in challenge.said
        assert not challenge.asks
    attempt(1, pulled=np.full(5, 0.1))
    assert "1 of 2" in challenge.said
    attempt(1)
    assert challenge.asks
    challenge.answer(challenge.answers[0], straight, KNOWN)
    assert challenge.said.startswith("No")
    challenge.answer(challenge.answers[-1], straight, KNOWN)
    assert challenge.done


def test_a_target_by_hand_is_reached_and_let_go_without_a_strategy():
    walking = Session(PLANAR)
    x, y, heading = walking.seen().pose
    walking.box.put(wishes.Target((float(x + 0.5 * np.cos(heading)), float(y + 0.5 * np.sin(heading))), by_hand=True))
    walking.obey()
    walking.walk_on(1.0)
    assert walking.seen().target is not None
    assert walking.seen().steering == ""
    np.testing.assert_array_equal(walking.seen().leg_yaw, 0.0)
    walking.walk_on(30.0)
    assert walking.seen().target is None
    assert any("arrived" in each for each in walking.messages())
