"""Trials: names, files, and what a seed does."""

import dataclasses

import numpy as np
import pytest

from chilopod import load_robot
from chilopod.errors import ParameterError
from chilopod.steering import LegYawController, Target
from chilopod.trials import NONE, Disturbance, Trial, run, together

ROBOT = load_robot("aoi2022-planar")
WHOLE = load_robot("aoi2022")
BASE = Trial(ROBOT, 2.0, seed=3, target=Target(0.7, 1.3), controller=LegYawController(), rate=20.0)


def test_everything_that_makes_a_trial_is_in_its_name():
    others = [
        dataclasses.replace(BASE, **change)
        for change in (
            {"robot": ROBOT.set_from_text(["springs.stiffness[0]=12 N*mm/deg"])},
            {"duration": 2.5},
            {"seed": 4},
            {"joint_angles": (0.1, 0.0, 0.0, 0.0, 0.0)},
            {"target": Target(0.7, 1.4)},
            {"target": None},
            {"controller": LegYawController(limit=0.1)},
            {"controller": None},
            {"disturbance": Disturbance(friction=0.03)},
            {"rate": 25.0},
            {"forces": True},
        )
    ]
    names = {BASE.file_name, *(each.file_name for each in others)}
    assert len(names) == 1 + len(others)
    # The robot's own name and the provenance of its numbers change no walk.
    renamed = dataclasses.replace(BASE, robot=ROBOT.with_(name="other", provenance={}))
    assert renamed.file_name == BASE.file_name


def test_records_are_read_back_and_damaged_ones_walked_again(tmp_path):
    trials = [dataclasses.replace(BASE, seed=seed) for seed in range(4)]
    walked = run(trials, tmp_path)
    files = [tmp_path / trial.file_name for trial in trials]
    whole = [file.read_bytes() for file in files]
    files[0].write_bytes(whole[0][: len(whole[0]) // 2])
    files[1].write_bytes(b"")
    files[2].write_bytes(b"no record")
    kept = files[3].stat().st_mtime_ns
    again = run(trials, tmp_path)
    assert all(a.equals(b) for a, b in zip(walked, again, strict=True))
    assert [file.read_bytes() for file in files] == whole
    assert files[3].stat().st_mtime_ns == kept
    assert {file.name for file in tmp_path.iterdir()} == {file.name for file in files}


def test_the_same_trial_twice_is_walked_once():
    first, second = run([BASE, BASE])
    assert first is second


def test_batches_change_nothing():
    trials = [dataclasses.replace(BASE, seed=seed, target=None, controller=None) for seed in range(40)]
    many = together(run(trials))
    (one,) = run([trials[37]])
    np.testing.assert_array_equal(one.position.values[:, 0], many.position.values[:, 37])


def test_disturbances_are_as_large_as_they_say():
    trials = [Trial(ROBOT, 0.01, seed, disturbance=Disturbance()) for seed in range(400)]
    start = together(run(trials)).isel(time=0)
    spread = Disturbance()
    assert float(start.joint_angle.std()) == pytest.approx(spread.joint_angle, rel=0.1)
    assert float(start.heading.std()) == pytest.approx(spread.heading, rel=0.2)
    assert abs(float(start.heading.mean())) < 0.2 * spread.heading
    undisturbed = together(run([Trial(ROBOT, 0.01, seed, disturbance=NONE) for seed in range(2)]))
    assert float(np.abs(undisturbed.joint_angle).max()) == 0.0


def test_a_disturbance_cannot_be_negative():
    with pytest.raises(ParameterError, match="friction"):
        Disturbance(friction=-0.1)


def test_a_trial_of_the_twin_is_not_one_of_the_planar_model():
    one = Trial(WHOLE, 1.0)
    other = Trial(WHOLE, 1.0, engine="twin")
    assert one.file_name != other.file_name
    assert other.file_name.startswith("twin-")
