"""Walks from Python: the same as the command's, and bad input in one line."""

import numpy as np
import pytest

from chilopod import load_robot
from chilopod.errors import ParameterError
from chilopod.tasks import ends, walk
from chilopod.tasks.walk import Runs
from chilopod.trials import NONE, Disturbance, Trial, run

ROBOT = load_robot("aoi2022-planar").with_value("springs.stiffness[0]", 0.5)


def test_seeds_count_up_and_walk_as_trials_do():
    done = walk(ROBOT, 3.0, seed=4, repeats=2, joint_angles=[0.02])
    assert [trial.seed for trial in done.trials] == [4, 5]
    assert done.seeds == [4, 5]
    assert not done.straight
    assert done.foot_creep is None
    (record,) = run([Trial(ROBOT, 3.0, 5, (0.02,) * 5)])
    np.testing.assert_array_equal(done.record.joint_angle.values[:, 1], record.joint_angle.values[:, 0])
    told = done.as_json()
    assert (told["robot"], told["engine"], told["duration_s"], told["seeded"]) == (ROBOT.name, "planar", 3.0, True)
    assert [each["seed"] for each in told["walks"]] == [4, 5]


def test_what_walks_came_to_needs_no_record(monkeypatch):
    trials = Trial(ROBOT, 2.0).repeated(seed=4, repeats=3)
    came = []
    found = ends(trials, callback=lambda index, record: came.append((index, record.attrs["trial"])))
    assert sorted(came) == [(index, trial.text) for index, trial in enumerate(trials)]
    whole = walk(ROBOT, 2.0, seed=4, repeats=3)
    assert found.as_json() == whole.as_json()
    assert not found.straight
    # Where memory holds a walk, but not all of them.
    monkeypatch.setattr("chilopod.memory.available", lambda: 5.0 * trials[0].least_bytes)
    with pytest.raises(ParameterError, match=r"record: would take 174 kB of memory, and 145 kB are free"):
        walk(ROBOT, 2.0, seed=4, repeats=3)
    monkeypatch.setattr("chilopod.trials.batch._MOST_BYTES", 1.0)
    assert ends(trials).as_json() == whole.as_json()
    monkeypatch.setattr("chilopod.memory.available", lambda: 1e4)
    with pytest.raises(ParameterError, match="record: would take"):
        ends(trials)


def test_without_a_seed_it_stays_straight():
    done = walk(ROBOT, 3.0)
    assert done.straight
    assert done.seeds == [None]
    assert np.isinf(done.summaries[0].axis_radius)


def test_disturbances_only_with_a_seed():
    one, other = Trial(ROBOT, 3.0), Trial(ROBOT, 3.0, disturbance=Disturbance(missed=0.5))
    assert [trial.disturbance for trial in one.repeated()] == [NONE]
    assert [trial.disturbance for trial in one.repeated(0, 2)] == [Disturbance()] * 2
    assert [trial.disturbance for trial in other.repeated(0, 2)] == [other.disturbance] * 2


def test_feet_of_the_twin_creep():
    assert Runs((Trial(load_robot("aoi2022"), 1.0, engine="twin"),)).foot_creep > 1000.0


def test_a_twin_that_cannot_stand_has_no_creep():
    limp = load_robot("aoi2022").set_from_text(["twin.servo_stiffness=1e-12 N*m/rad"])
    assert Runs((Trial(limp, 1.0, engine="twin"),)).foot_creep is None


@pytest.mark.parametrize(
    ("more", "match"),
    [
        ({"repeats": 0}, "must be positive"),
        ({"repeats": 2}, "must be 1 without a seed"),
        ({"joint_angles": (0.1, 0.2)}, "must be one angle for each joint, not 2; allowed: 5, or one for all"),
        ({"joint_angles": (-1.6,)}, "must be smaller"),
        ({"joint_angles": (float("nan"),)}, "must be smaller"),
        ({"engine": "plana"}, "did you mean 'planar'"),
    ],
)
def test_bad_input_is_one_line(more, match):
    with pytest.raises(ParameterError, match=match):
        walk(ROBOT, 3.0, **more)
