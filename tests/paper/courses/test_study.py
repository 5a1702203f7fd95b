"""The comparison, hardly anything of it: strategies on the same courses, the steps of the law, conditions."""

from dataclasses import replace

import numpy as np
import pytest

from chilopod.engine import Observation
from chilopod.paper.courses.steps import steps
from chilopod.paper.courses.study import PLANAR, ablated, compared, planar_conditions, prepared, under, whole_conditions
from chilopod.paper.section import Context, Size
from chilopod.steering import ON_COURSES
from chilopod.tasks.course import random_courses
from chilopod.trials import Trial, walked


@pytest.fixture(scope="module")
def context(kept):
    return Context(size=Size.TINY, folder=kept)


@pytest.fixture(scope="module")
def variable(context):
    return prepared(context)


def test_all_strategies_walk_the_same_courses(context, variable):
    data = compared(context, variable, PLANAR[Size.TINY])
    assert list(data.case.values) == list(ON_COURSES)
    assert data.seconds.notnull().all()
    assert (data.seconds <= 40.0 + 1e-6).all()
    goal = random_courses([1001])[0].goals[2]
    assert float(data.away.sel(course=1001, goal=3)) == pytest.approx(np.hypot(goal.x, goal.y))
    assert data.arrived.sel(case="variable").all()
    # What steers costs who steers.
    worked = data.goal_spring_work.sum(("course", "goal")), data.goal_drive_work.sum(("course", "goal"))
    assert [(each > 0.0).values.tolist() for each in worked] == [
        [name == "variable" for name in ON_COURSES],
        [name == "actuated" for name in ON_COURSES],
    ]
    # The spring for all is the one that reached most.
    tried = data.tried_arrived.where(data.tried_case == "pitchfork").values
    assert float(data.spring.sel(case="pitchfork")) == float(data.tried_spring[int(np.nanargmax(tried))])


def seen(bearing, bend, spring):
    """By one robot with a target 1 m away."""
    angles = np.full((1, 5), -bend / 5.0)
    stiffness = np.array([[spring, 2.3, 2.3, 2.3, 2.3]])
    away = np.array([np.nan if np.isnan(bearing) else 1.0])
    return Observation(0.0, np.array([bearing]), away, angles, np.zeros((1, 2)), stiffness)


def test_each_step_of_the_law_does_what_it_says(variable):
    law = variable.controller
    circle, bend, search, near, last = steps(law).values()
    assert last is law
    # Straight, with a target to the left: the spring of the circle; from then on as soft as it goes.
    ahead = seen(0.5, 0.0, 2.3)
    assert circle.spring(ahead) == pytest.approx(np.interp(2.0 * np.sin(0.5), law.curvatures, law.springs))
    assert [each.spring(ahead)[0] for each in (bend, search, near, last)] == [law.softest] * 4
    # Out of sight.
    lost = seen(np.nan, 0.0, 1.9)
    assert [each.spring(lost)[0] for each in (circle, bend, search)] == [1.9, 1.9, law.softest]
    # Beside the robot, within its tightest circle.
    beside = replace(seen(1.5, 1.5, 1.0), distance=np.array([0.3]))
    assert search.spring(beside)[0] < law.stiffest
    assert near.spring(beside)[0] == law.stiffest
    # A bend that is that of the circle all the way, and not that of a place ahead.
    bent = seen(0.5, law.arm * 2.0 * np.sin(0.5), 1.0)
    assert near.spring(bent) == pytest.approx(np.interp(2.0 * np.sin(0.5), law.curvatures, law.springs))
    assert last.spring(bent)[0] == law.softest


def test_conditions_change_the_robot_and_not_its_law(context, variable):
    chosen = [each for each in planar_conditions(context.robot) if each.name in ("as usual", "a slow actuator")]
    seeds = range(2000, 2001)
    data = under(context, variable, 15.0, chosen, seeds)
    assert dict(data.sizes) == {"condition": 2, "strategy": 2, "course": 1, "goal": 5}
    usual, slow = (data.seconds.sel(strategy="variable", condition=each.name).values for each in chosen)
    assert (usual != slow).any()
    fixed = data.seconds.sel(strategy="pitchfork").values
    assert (fixed[0] == fixed[1]).all()  # one spring for all has no actuator
    grown = ablated(context, variable, seeds)
    assert (grown.seconds.isel(case=-1) == data.seconds.sel(strategy="variable", condition="as usual")).all()


def test_a_floor_with_bumps_lifts_the_feet(context):
    (bumps,) = (each.engine for each in whole_conditions(context.whole) if "bumps" in each.name)
    flat, rough = (Trial(context.whole, 6.0, 0, rate=50.0, engine=engine, poses=True) for engine in ("twin", bumps))
    (level,), (uneven,) = walked([flat]), walked([rough])
    assert level.pose.values[0] == pytest.approx(uneven.pose.values[0], abs=1e-9)
    assert np.abs(level.position.values[-1] - uneven.position.values[-1]).max() > 1e-4
