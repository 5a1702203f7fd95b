"""What would take too long is refused before it begins."""

import numpy as np
import pytest

from chilopod import load_robot
from chilopod.analysis import straight_walk
from chilopod.errors import AnalysisError, ParameterError
from chilopod.planar import PlanarModel
from chilopod.planar.step_count import MOST_STEPS, check_steps

PRESET = load_robot("aoi2022-planar")


@pytest.mark.parametrize(
    ("overrides", "field"),
    [
        (["gait.stance=1e-12 s", "gait.swing=1e-12 s"], "gait.stance, gait.swing"),
        (["body.yaw_inertia=1e-12 kg*m^2"], "ground.friction, body.yaw_inertia"),
        (["body.mass=1e-9 kg", "body.yaw_inertia=1 kg*m^2"], "ground.friction, body.mass"),
        (["springs.damping=1e9 N*m*s/rad"], "springs.damping"),
    ],
)
def test_walks_of_too_many_steps_name_what_makes_them(overrides, field):
    robot = PRESET.set_from_text(overrides)
    with pytest.raises(ParameterError, match="too fast to follow for 60 s") as caught:
        check_steps(robot, 60.0)
    assert caught.value.field == field


def test_a_day_of_the_paper_robot_is_none_of_them():
    check_steps(PRESET, 1e5)
    with pytest.raises(ParameterError):
        check_steps(PRESET.set_from_text(["body.mass=1 g"]), 1e5)


def test_no_motion_is_faster_than_that_of_modules_that_nothing_joins():
    for overrides in ([], ["springs.damping=1 N*m*s/rad"], ["body.modules=12"]):
        robot = PRESET.set_from_text(overrides)
        model, step = PlanarModel(robot), 1e-7
        derivative = (model.flow(model.orbit, 0.0, step)[1] - np.eye(model.dimension)) / step
        fastest = np.abs(np.linalg.eigvals(derivative)).max()
        seconds = 6.0 * MOST_STEPS / (robot.body.modules * fastest)
        with pytest.raises(ParameterError):
            check_steps(robot, seconds)


def test_exponents_of_very_many_states_say_how_long_they_would_take():
    with pytest.raises(AnalysisError, match=r"would take about .* hours: 201 states") as caught:
        straight_walk(PRESET.set_from_text(["body.modules=100"]))
    assert caught.value.field == "body.modules"
    with pytest.raises(AnalysisError, match=r"would take about .* minutes: 61 states.* allowed: about 30 s"):
        straight_walk(PRESET.set_from_text(["body.modules=30"]), longest=30.0)


def test_equations_that_no_memory_holds_are_refused():
    with pytest.raises(AnalysisError, match="a period has 800 intervals"):
        _ = PlanarModel(PRESET.set_from_text(["body.modules=200", "gait.module_phase=119.3 deg"])).contraction
