"""Courses that are driven: the same records however they are walked, decisions from what was seen, always a verdict."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import xarray as xr

from chilopod import load_robot
from chilopod.engine import Command, Event
from chilopod.errors import AnalysisError, ParameterError
from chilopod.gym.policies import BASELINES
from chilopod.planar import PlanarWalk
from chilopod.steering import (
    ON_COURSES,
    ON_THE_WAY,
    STRATEGIES,
    VARIABLE,
    LegYawController,
    Strategy,
    Verdict,
    course_named,
    decisions,
)
from chilopod.tasks import Driver, drive, driver
from chilopod.tasks.course import patience_of
from chilopod.trials import run

ROBOT = load_robot("aoi2022-planar")
NEAR = course_named("10 deg, 0.6 m; -50 deg, 0.7 m", 15.0)


@pytest.fixture(scope="module")
def ready():
    return driver(ROBOT, VARIABLE)


@pytest.fixture(scope="module")
def done(ready):
    return drive(ready, NEAR, seed=1, repeats=2)


def test_decisions_follow_from_what_was_seen(done):
    """To the bit: the law uses nothing that a robot would not have."""
    for record in done.records:
        found = decisions(record, done.driver.controller, ROBOT.gait)
        assert len(found) == record.sizes["event"] > 20
        np.testing.assert_array_equal([each.leg_yaw[0] for each in found], record.command.values[:, 0])
        unchanged = np.full((1, ROBOT.body.modules - 1), np.nan)
        springs = [unchanged if each.stiffness is None else each.stiffness for each in found]
        np.testing.assert_array_equal(np.stack(springs)[:, 0], record.command_stiffness.values[:, 0])
        assert len({each.stiffness[0, 0] for each in found if each.stiffness is not None}) > 1


def test_a_course_is_the_same_alone_and_among_others(ready, done):
    others = [ready.trial(replace(NEAR, goals=NEAR.goals[::-1]), 7)]
    for record, again in zip(done.records, run([*others, *done.trials])[1:], strict=True):
        xr.testing.assert_identical(record, again)
    (alone,) = run(done.trials[1:])
    xr.testing.assert_identical(done.records[1], alone)


def test_a_course_is_the_same_if_the_walk_stops_at_every_look(ready, monkeypatch):
    foreseen = []
    foresee = PlanarWalk.foresee
    with monkeypatch.context() as patch:
        patch.setattr(PlanarWalk, "foresee", lambda walk, until: (foresee(walk, until), foreseen.append(until))[0])
        ahead = drive(ready, NEAR, seed=1, repeats=3)
    assert len(foreseen) > 10
    ends = np.concatenate([each.goal_end.values.ravel() for each in ahead.records])
    assert not np.isin(ends, foreseen).any()  # targets end between two commands
    monkeypatch.setattr(PlanarWalk, "foresee", lambda walk, until: None)
    for here, there in zip(ahead.records, drive(ready, NEAR, seed=1, repeats=3).records, strict=True):
        xr.testing.assert_identical(here, there)


def test_courses_are_kept_and_read_again(ready, done, tmp_path, monkeypatch):
    kept = [drive(ready, NEAR, seed=1, repeats=2, folder=tmp_path)]
    monkeypatch.setattr("chilopod.trials.batch.walked", None)  # nothing walks any more
    kept.append(drive(ready, NEAR, seed=1, repeats=2, folder=tmp_path))
    for each in kept:
        assert each.as_json() == done.as_json()
        for record, again in zip(done.records, each.records, strict=True):
            xr.testing.assert_equal(record, again)


def test_what_it_came_to(done):
    told = done.as_json()
    assert [walk["seed"] for walk in told["walks"]] == [1, 2]
    for walk, record in zip(told["walks"], done.records, strict=True):
        first, second = walk["targets"]
        assert first["begin_s"] == 0.0
        assert first["end_s"] == second["begin_s"]
        assert walk["time_s"] == second["end_s"] == pytest.approx(record.time.values[-1])
        assert walk["arrived"] == sum(goal["verdict"] == "arrived" for goal in walk["targets"]) > 0
        assert walk["spring_work_J"] == pytest.approx(first["spring_work_J"] + second["spring_work_J"])
        assert all(goal["path_m"] > 0.9 * goal["shortest_m"] > 0.0 for goal in walk["targets"])
    assert done.record.sizes["robot"] == 2


@dataclass(frozen=True)
class Tears:
    """Pulls itself to pieces after a time, s."""

    after: float

    def events(self, gait):
        return [Event("now", 0.0, 0.1)]

    def act(self, event, seen):
        return Command(joint_torque=np.full_like(seen.joint_angles, 1e6 if seen.time > self.after else 0.0))


def test_every_target_has_a_verdict(ready):
    """Also where the robot fails midway, and where there is no way."""
    far = course_named("0 deg, 0.4 m; 0 deg, 50 m; 0 deg, 2 m; 0 deg, 0.5 m", 8.0)
    straight = replace(ready, controller=LegYawController())
    torn = replace(ready, controller=Tears(4.0))
    reached, stopped, nothing = (
        drive(straight, far),
        drive(torn, far),
        drive(straight, replace(far, goals=far.goals[1:2])),
    )
    labels = [each.records[0].goal_verdict.values[0].tolist() for each in (reached, stopped, nothing)]
    arrived, far_off, stop = (each.label for each in (Verdict.ARRIVED, Verdict.TOO_FAR, Verdict.STOPPED))
    assert labels == [[arrived, far_off, far_off, arrived], [arrived, far_off, far_off, stop], [far_off]]
    assert [each.as_json()["walks"][0]["status"] for each in (reached, stopped)] == ["halted", "out of range"]
    assert nothing.as_json()["walks"][0]["steering_cost_of_transport"] is None


def test_a_robot_may_arrive_at_the_last_moment(ready):
    # Straight ahead it is 0.149 m before the target after 10 s, where the walk ends, and farther at the look before.
    way = 10.0 * ROBOT.gait.speed + 0.149
    walked = drive(replace(ready, controller=LegYawController()), course_named(f"0 deg, {way} m", 10.0)).records[0]
    assert walked.goal_verdict.item() == Verdict.ARRIVED.label
    assert walked.goal_nearest.item() == pytest.approx(0.149, abs=1e-6)


def test_the_nearest_place_may_be_that_where_the_target_is_put_up(ready):
    behind = course_named("170 deg, 0.4 m", 4.0)
    assert drive(replace(ready, controller=None), behind).records[0].goal_nearest.item() == pytest.approx(0.4)


def test_the_law_uses_the_actuator_that_there_is(ready, monkeypatch):
    monkeypatch.setattr("chilopod.tasks.course.radius_law", lambda *asked: ready.law)
    named = ["springs.adjustable[0]=true", "springs.softest=9 N*mm/deg"]
    found = driver(ROBOT.set_from_text(named), VARIABLE)
    assert found.controller.softest == pytest.approx(0.5157, abs=1e-4)
    assert ["are out of reach" in each for each in found.remarks] == [True]
    assert ["no actuator" in each for each in ready.remarks] == [True]


@pytest.mark.parametrize(
    ("changed", "strategy", "spring", "error", "words"),
    [
        (["springs.adjustable=false"], "variable", None, ParameterError, "must be true: strategy variable sets the"),
        (["legs.half_width=0.3 m"], "variable", None, AnalysisError, "no pitchfork.*narrower.* the strategy leg-yaw"),
        (["legs.half_width=0.3 m"], "actuated", None, AnalysisError, "no pitchfork"),
        ([], "pitchfork", None, ParameterError, "strategy pitchfork needs one stiffness"),
        ([], "variable", 0.3, ParameterError, "sets its own springs"),
    ],
)
def test_what_cannot_be_driven_is_refused(changed, strategy, spring, error, words):
    with pytest.raises(error, match=words):
        driver(ROBOT.set_from_text(changed), ON_COURSES[strategy], spring)


def test_names_are_no_strategies_and_courses(ready):
    with pytest.raises(ParameterError, match="strategy = 'variable': must be a strategy"):
        driver(ROBOT, "variable")
    with pytest.raises(ParameterError, match="course = 'slalom': must be a course"):
        drive(ready, "slalom")


def test_the_whole_robot_walks_a_course():
    whole = Driver(load_robot("aoi2022"), ON_COURSES["leg-yaw"], LegYawController(), None, "twin")
    done = drive(whole, course_named("0 deg, 0.25 m; 170 deg, 6 m", 1.5))
    assert done.engine == "twin"
    (record,) = done.records
    assert "pose" in record
    assert record.goal_verdict.values[0].tolist() == ["out of time", "out of reach"]
    assert done.as_json()["walks"][0]["targets"][0]["nearest_m"] == pytest.approx(0.25, abs=0.1)


def test_a_driver_walks_in_its_own_engine():
    ready = Driver(load_robot("aoi2022"), ON_COURSES["leg-yaw"], LegYawController(), None, "twin")
    assert ready.trial(NEAR).engine == "twin"
    assert driver(ROBOT, ON_COURSES["leg-yaw"]).engine == "planar"


@dataclass(frozen=True)
class Once(Strategy):
    """Strategy of a user: the spring of the tightest circle, and legs that yaw half as far."""

    needs_law = True

    def fitted(self, robot, spring=None):
        return robot.with_value("springs.stiffness[1]", 0.8 * robot.springs.stiffness[1]), ("a softer second spring",)

    def controller(self, robot, law):
        return LegYawController(limit=0.5 * LegYawController().limit), (f"circles of {law.tightest:.1f} m",)


def test_a_strategy_of_ones_own_is_a_class(ready):
    mine = driver(ROBOT, Once("mine", "softer behind"), law=ready.law)
    assert mine.remarks == ("a softer second spring", f"circles of {ready.law.tightest:.1f} m")
    (record,) = drive(mine, NEAR).records
    assert 0.0 < np.abs(record.leg_yaw).max() <= 0.5 * LegYawController().limit
    with pytest.raises(ParameterError, match="must be the radius law of the robot for strategy mine"):
        mine.strategy.prepare(ROBOT)
    own = mine.strategy.prepare(ROBOT, controller=LegYawController())
    assert own.controller == LegYawController()
    assert own.robot.springs.stiffness[1] < ROBOT.springs.stiffness[1]


def test_who_knows_which_strategies():
    assert list(STRATEGIES) == ["pitchfork", "hopf", "leg-yaw", "open-loop"]
    assert list(ON_COURSES) == ["variable", "pitchfork", "hopf", "leg-yaw", "actuated"]
    assert list(ON_THE_WAY) == ["variable", "leg-yaw", "actuated"]
    assert list(BASELINES) == ["variable", "leg-yaw"]


def test_leg_yaw_needs_no_pitchfork():
    wide = driver(ROBOT.set_from_text(["legs.half_width=0.3 m"]), ON_COURSES["leg-yaw"])
    assert wide.law is None
    assert ["is not known" in each for each in wide.remarks] == [True]


def test_patience_is_that_of_the_engine():
    assert [patience_of(engine) for engine in ("planar", "twin")] == [40.0, 70.0]
