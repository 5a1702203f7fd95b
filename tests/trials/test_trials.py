"""Trials: names, files, and what a seed does."""

import dataclasses
import pickle
import threading

import numpy as np
import pytest
import xarray as xr

from chilopod import load_robot, planar, twin
from chilopod.engine import Command, Event
from chilopod.errors import AnalysisError, ParameterError
from chilopod.steering import Course, Goal, LegYawController, Target
from chilopod.trials import NONE, Disturbance, Trial, batch, batches, run, straight, summaries, together, walked

ROBOT = load_robot("aoi2022-planar")
FREE = ROBOT.override("springs.adjustable[0]", True)
WHOLE = load_robot("aoi2022")
BASE = Trial(ROBOT, 2.0, seed=3, target=Target(0.7, 1.3), controller=LegYawController(), rate=20.0)


@dataclasses.dataclass(frozen=True)
class YawAt:
    """The same leg yaw, at a phase of the gait cycle."""

    phase: float
    yaw: float

    def events(self, gait):
        return [Event("now", self.phase, 0.1)]

    def act(self, event, seen):
        return Command(leg_yaw=[self.yaw, self.yaw])


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


def test_the_same_trial_twice_is_walked_once():
    first, second = run([BASE, BASE])
    assert first is second


def test_batches_change_nothing():
    trials = [dataclasses.replace(BASE, seed=seed, target=None, controller=None) for seed in range(40)]
    many = together(run(trials))
    (one,) = run([trials[37]])
    np.testing.assert_array_equal(one.position.values[:, 0], many.position.values[:, 37])


def short_course(place):
    course = Course((Goal(*place, relative=True),), 4.0)
    return Trial(FREE, course.duration, 0, (), course, YawAt(0.0, 0.0), rate=10.0)


@pytest.mark.parametrize(
    "trials",
    [
        # The first ends just behind an event, by rounding, the second at one.
        [short_course((0.15 + 0.0967 * (end - 0.05), 0.0)) for end in (1.8, 3.0, 3.5)],
        [short_course((3.0, 0.0)), short_course((0.3, 0.0))],
        [short_course((0.3, 0.32)), short_course((0.2, 0.0))],
    ],
    ids=["at an event", "none in reach", "out of time"],
)
def test_a_course_has_the_same_record_alone_and_among_others(trials):
    for trial, record in zip(trials, walked(trials), strict=True):
        (alone,) = walked([trial])
        xr.testing.assert_identical(alone, record)


def test_robots_with_and_without_actuators_have_the_same_records_alone_and_together():
    trials = [Trial(robot, 0.1, disturbance=NONE) for robot in (ROBOT, FREE)]
    for trial, record in zip(trials, run(trials), strict=True):
        (alone,) = run([trial])
        xr.testing.assert_identical(alone, record)


@pytest.mark.parametrize("engine", ["planar", "twin"])
def test_a_record_has_the_end_of_a_walk_that_no_sample_is_of(engine):
    robot, start = (ROBOT, (0.1,)) if engine == "planar" else (WHOLE, (0.1,))
    coarse, fine, whole = (
        run([Trial(robot, 0.32, 0, start, disturbance=NONE, rate=rate, engine=engine)])[0] for rate in (7.0, 3.0, 50.0)
    )
    assert "end_position" not in whole
    end = whole.isel(time=-1)
    for record in (coarse, fine):
        np.testing.assert_allclose(record.end_position.values, end.position.values, atol=1e-5)
        np.testing.assert_allclose(record.end_joint_angle.values, end.joint_angle.values, atol=1e-5)
        (summary,) = summaries(robot, record)
        assert (summary.x, summary.y) == tuple(record.end_position.values[0])
    simulated = {"planar": planar, "twin": twin}[engine].simulate(robot, 0.32, rate=7.0)
    assert simulated.end_position.sizes == {"robot": 1, "axis": 2}


def test_a_mean_needs_samples_of_more_than_half_of_the_gait_cycle():
    def of(duration, rate):
        return summaries(ROBOT, run([Trial(ROBOT, duration, 0, (0.05,), disturbance=NONE, rate=rate)])[0])[0]

    assert np.isnan(of(6.5, 0.2).joint_angles).all()  # one sample
    assert np.isnan(of(6.5, 1.0 / ROBOT.gait.period).joint_angles).all()  # always of the same phase
    np.testing.assert_allclose(of(6.5, 2.0).joint_angles, of(6.5, 100.0).joint_angles, atol=0.01)
    assert np.isfinite(of(0.05, 100.0).joint_angles).all()


def test_a_robot_that_bends_after_its_last_sample_is_not_straight():
    (record,) = run([Trial(ROBOT, 0.8, 0, controller=YawAt(0.9, 0.2), disturbance=NONE, rate=2.0)])
    assert not record.joint_angle.values.any()
    assert not straight(record)


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


@pytest.mark.parametrize("foot", [(6, 1), (-1, 0), (0, 2), (0, -1), (1.0, 0), (1,), "ab", (True, False)])
def test_a_foot_without_grip_is_one_of_the_robot(foot):
    with pytest.raises(ParameterError, match="slick"):
        Trial(ROBOT, 1.0, disturbance=Disturbance(slick=foot))


def test_a_trial_of_the_twin_is_not_one_of_the_planar_model():
    one = Trial(WHOLE, 1.0)
    other = Trial(WHOLE, 1.0, engine="twin")
    assert one.file_name != other.file_name
    assert other.file_name.startswith("twin-")


def test_an_engine_that_is_not_there_or_does_not_know_the_robot_is_refused():
    with pytest.raises(ParameterError, match="did you mean 'twin'"):
        Trial(WHOLE, 1.0, engine="twn")
    with pytest.raises(ParameterError, match="must be given in the robot file"):
        Trial(ROBOT, 1.0, engine="twin")
    with pytest.raises(ParameterError, match="poses"):
        Trial(ROBOT, 1.0, poses=True)
    with pytest.raises(ParameterError, match=r"duration = .1e\+09 s"):
        Trial(ROBOT, 1e9)


def test_a_trial_names_its_engines_version(monkeypatch):
    trial = Trial(WHOLE, 1.0, engine="twin")
    assert "MuJoCo" in trial.text
    sent = pickle.dumps(trial)
    monkeypatch.setattr(twin, "traits", dataclasses.replace(twin.traits, version="MuJoCo of tomorrow"))
    # Who gets a trial sent finds out what it is there.
    assert pickle.loads(sent).file_name != trial.file_name
    assert pickle.loads(sent) == trial


def test_batches_are_as_large_as_cores_and_memory_allow():
    trials = [Trial(ROBOT, 1.0, seed) for seed in range(100)]
    assert [len(batch) for batch in batches(trials, on_cores=1)] == [32, 32, 32, 4]
    long = [dataclasses.replace(trial, duration=3000.0) for trial in trials]
    sizes = [len(batch) for batch in batches(long, on_cores=64)]
    assert sum(sizes) == 100
    assert 1 <= sizes[0] < 20
    longer = [dataclasses.replace(trial, duration=90_000.0) for trial in trials[:3]]
    assert [len(batch) for batch in batches(longer, on_cores=64)] == [1, 1, 1]


def test_batches_keep_apart_what_cannot_walk_together():
    other = dataclasses.replace(BASE, disturbance=NONE)
    quick = dataclasses.replace(BASE, controller=LegYawController(limit=0.01))
    stride = dataclasses.replace(BASE, robot=ROBOT.set_from_text(["gait.stride=2 cm"]))
    spring = dataclasses.replace(BASE, robot=ROBOT.set_from_text(["springs.stiffness[0]=12 N*mm/deg"]))
    assert [len(each) for each in batches([BASE, other, quick, stride, spring])] == [2, 1, 1, 1]


def test_records_do_not_depend_on_threads(monkeypatch):
    trials = [dataclasses.replace(BASE, seed=seed, duration=1.5) for seed in range(24)]
    records = []
    for threads in (1, 3):
        monkeypatch.setattr("numba.get_num_threads", lambda threads=threads: threads)
        records.append(walked(trials))
    for one, other in zip(*records, strict=True):
        assert one.identical(other)


def test_a_failure_in_a_thread_ends_the_others(monkeypatch):
    monkeypatch.setattr("numba.get_num_threads", lambda: 3)
    steered, times, faults = batch.steer, [], [AnalysisError("is broken", field="walk")]
    begun = threading.Barrier(3, timeout=60.0)

    def fails_in_one(walk, until, controller, *, progress, **options):
        begun.wait()
        if faults:
            raise faults.pop()
        try:
            steered(walk, until, controller, progress=progress, **options)
        finally:
            times.append(walk.time)

    monkeypatch.setattr(batch, "steer", fails_in_one)
    trials = [dataclasses.replace(BASE, seed=seed, duration=1000.0) for seed in range(24)]
    with pytest.raises(AnalysisError, match="is broken"):
        walked(trials)
    assert len(times) == 2
    assert max(times) < 900.0
