"""The radius law of any engine, and what one walk of the twin comes to."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from chilopod import load_robot, planar
from chilopod.analysis.radius_law import radius_laws
from chilopod.errors import AnalysisError
from chilopod.steering import STRATEGIES, Target
from chilopod.tasks import radius_law, turn
from chilopod.tasks.radius_law import bent, end_of_walk
from chilopod.trials import Trial, mean_joint_angles, run, summaries
from chilopod.twin import simulate

ROBOT = load_robot("aoi2022")


def test_the_end_of_a_circle_is_its_radius():
    """Angles that do not change give the paper's radius, and module 1's pace is its speed."""
    record = simulate(ROBOT, 0.6, rate=50.0)
    time = np.arange(0.0, 20.0, 0.02)
    angle = 0.05 / 0.3 * time
    made = xr.Dataset(
        {
            "joint_angle": (("time", "robot", "joint"), np.full((time.size, 1, 5), 0.2)),
            "position": (("time", "robot", "axis"), 0.3 * np.stack([np.sin(angle), np.cos(angle)], -1)[:, None]),
            "status": ("robot", np.array(["walked"], dtype=object)),
        },
        coords={"time": time, "robot": [0], "joint": record.joint, "axis": record.axis},
    )
    end = end_of_walk(made, ROBOT)
    assert float(end.axis_radius) == pytest.approx(5 * 0.225)
    assert float(end.speed) == pytest.approx(0.05)
    assert end.direction.item() == "right"
    assert float(end.moved) == pytest.approx(0.0)


def test_the_last_five_seconds_are_the_same_everywhere():
    """What `walk` prints of a record and what the studies make of it: one window, one radius."""
    robot = load_robot("aoi2022-planar").set_from_text(["springs.stiffness[0]=8 N*mm/deg"])
    start = planar.initial_states(robot, joint_angles=0.1)
    record = planar.simulate(robot, 9.7, initial=start, rate=10.0).assign_attrs(robot=robot.name)
    (ended,), end = summaries(robot, record), end_of_walk(record, robot)
    np.testing.assert_array_equal(ended.joint_angles, end.mean_angle.values)
    assert ended.axis_radius == float(end.axis_radius)
    last = record.joint_angle.isel(robot=0).transpose("time", "joint").values[-50:]
    np.testing.assert_allclose(ended.joint_angles, last.mean(0), rtol=1e-13)
    assert ended.axis_radius == pytest.approx(5.0 * robot.module_length / np.abs(last.mean(0)).sum(), rel=1e-13)
    early = mean_joint_angles(record, 2.0, before=5.0).isel(robot=0).values
    np.testing.assert_allclose(early, record.joint_angle.isel(robot=0).values[-70:-50].mean(0), rtol=1e-13)


def in_time(factor):
    """The planar preset with another unit of time."""
    robot = load_robot("aoi2022-planar")
    for path, power in (("gait.stance", 1), ("gait.swing", 1), ("ground.friction", -1)):
        robot = robot.with_value(path, robot.get(path) * factor**power)
    return robot.with_value("springs.stiffness", robot.get("springs.stiffness") / factor**2)


def made_up(trial):
    """Record of a walk round a circle, whose bend sways, and grows by a part of 1 in 400 in each gait cycle."""
    robot, times = trial.robot, np.arange(round(trial.duration * trial.rate) + 1) / trial.rate
    cycles = times / robot.gait.period
    angles = 0.1 * np.exp(cycles / 400.0) + 0.03 * np.sin(2.0 * np.pi * cycles)
    way = 0.3 * np.stack([np.sin(0.1 * cycles), np.cos(0.1 * cycles)], -1)
    return xr.Dataset(
        {
            "joint_angle": (("time", "robot", "joint"), np.repeat(angles, 5).reshape(-1, 1, 5)),
            "position": (("time", "robot", "axis"), way[:, None]),
            "status": ("robot", np.array(["walked"], dtype=object)),
        },
        coords={"time": times, "robot": [0], "joint": [1, 2, 3, 4, 5], "axis": ["x", "y"]},
    )


@pytest.mark.parametrize("factor", [1e-3, 0.1, 10.0, 1e3])
def test_the_end_of_a_walk_does_not_depend_on_the_unit_of_time(factor):
    own, other = in_time(1.0), in_time(factor)
    ends = [end_of_walk(made_up(bent(robot)), robot) for robot in (own, other)]
    for name in ("axis_radius", "bend", "moved", "mean_angle"):
        np.testing.assert_allclose(ends[1][name], ends[0][name], rtol=1e-9)
    assert float(ends[1].speed) * factor == pytest.approx(float(ends[0].speed), rel=1e-9)
    assert [end.direction.item() for end in ends] == ["right", "right"]


def test_a_walk_whose_samples_do_not_show_its_angles_has_no_direction():
    robot = in_time(1.0)
    record = made_up(replace(bent(robot), rate=1.0 / robot.gait.period))
    assert end_of_walk(record, robot).direction.item() == ""


def test_means_of_a_slow_gait_are_those_of_a_whole_cycle():
    robot = in_time(20.0)
    record = made_up(replace(bent(robot), duration=3.0 * robot.gait.period))
    record["joint_angle"] = record.joint_angle - 0.1 * np.exp(record.time / robot.gait.period / 400.0) + 0.1
    (end,) = summaries(robot, record)
    np.testing.assert_allclose(end.joint_angles, 0.1, rtol=1e-12)


def test_a_bend_that_grows_slowly_has_not_settled():
    """By 4 % in ten seconds, as beside an onset; by a fifth in half of the walk."""
    robot = in_time(1.0)
    record = made_up(bent(robot))
    assert end_of_walk(record, robot).settled
    assert not end_of_walk(record, robot, 45.0).settled


def test_a_straight_walk_has_an_infinite_radius_everywhere():
    robot = load_robot("aoi2022-planar")
    record = planar.simulate(robot, 6.0, rate=10.0)
    (ended,), end = summaries(robot, record), end_of_walk(record, robot)
    assert ended.axis_radius == float(end.axis_radius) == np.inf
    assert ended.as_json()["axis_radius_m"] is None
    np.testing.assert_array_equal(robot.axis_radius([[0.0] * 5, [5e-324] * 5]), np.inf)
    assert np.isnan(robot.axis_radius([np.nan] + [0.1] * 4))


class Trying:
    """The planar model, as one that nobody has a theory of."""

    traits = replace(planar.traits, name="trying", exact=False)

    def __getattr__(self, name):
        return getattr(planar, name)

    def start(self, *given, **named):
        return Renamed(planar.start(*given, **named))


class Renamed:
    """A walk whose record says which engine it is of."""

    def __init__(self, walk):
        self.walk = walk

    def __getattr__(self, name):
        return getattr(self.walk, name)

    def to_dataset(self, **how):
        return self.walk.to_dataset(**how).assign_attrs(engine="trying")


@pytest.fixture
def trying(monkeypatch):
    monkeypatch.setattr(planar, "trying_engine", Trying(), raising=False)
    return "chilopod.planar:trying_engine"


def test_the_law_of_an_exact_engine_is_that_of_its_branch():
    robot = load_robot("aoi2022-planar")
    law, exact = radius_law(robot), radius_laws(robot).axis
    held = exact.values >= law.values[0]
    np.testing.assert_array_equal(law.values, exact.values[held])
    np.testing.assert_array_equal(law.radii, exact.radii[held])


def test_no_spring_of_the_law_folds_the_robot():
    """The settled walk at the softest spring of the branch keeps its joints below 90 deg, and no walk gets there."""
    robot = load_robot("aoi2022-planar")
    law, exact = radius_law(robot), radius_laws(robot).axis
    assert not (radius_laws(robot).walks.most_bent.values[: len(exact.values)] > 0.5 * np.pi).any()

    def folded(value):
        walker = robot.with_value("springs.stiffness[0]", float(value))
        ends = run([Trial(walker, 90.0, seed, rate=1.0) for seed in range(100, 110)])
        return [str(end.status.values[0]) for end in ends].count("out of range")

    assert folded(exact.values[0]) == 10
    assert folded(law.values[0]) == 0


def test_the_law_by_trials_is_that_of_the_branch_and_is_kept(trying, tmp_path):
    """Two ways to one law that share nothing but the model: walks of 90 s, and the continued branch."""
    robot = load_robot("aoi2022-planar").set_from_text(["springs.stiffness=18 N*mm/deg"])
    law, exact = radius_law(robot, trying, tmp_path), radius_laws(robot).axis
    assert len(list(tmp_path.glob("trying-*.nc"))) == 9
    for radius in (0.5, 0.7, 0.9):
        assert law.value(radius) == pytest.approx(exact.value(radius), rel=0.05)
    again = radius_law(robot, trying, tmp_path)
    np.testing.assert_array_equal(law.values, again.values)


def test_a_robot_that_jumps_has_no_law_and_turns():
    robot = load_robot("aoi2022-planar").set_from_text(["legs.forward_offset=20 mm"])
    target = Target(np.radians(45.0), 0.4)
    found = turn(robot, target, STRATEGIES["pitchfork"], duration=6.0)
    assert found.by_law is None
    assert found.stiffness < max(robot.springs.stiffness)
    straight = turn(robot, target, STRATEGIES["pitchfork"], max(robot.springs.stiffness), duration=6.0)
    assert found.criteria.nearest[0] < straight.criteria.nearest[0]
    for strategy, spring in (("pitchfork", "law"), ("open-loop", "auto")):
        with pytest.raises(AnalysisError, match=r"radius law.*subcritical.*allowed: a stiffness"):
            turn(robot, target, STRATEGIES[strategy], spring)
