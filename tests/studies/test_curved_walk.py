"""Curved walks of the preset: the branch beyond the pitchfork, against long simulations and known symmetries."""

import numpy as np
import pytest

from chilopod.errors import AnalysisError
from chilopod.planar import PlanarModel
from chilopod.report import write_branch
from chilopod.robot import load_robot
from chilopod.studies import floquet
from chilopod.studies.curved_walk import as_json, curved_walks

ROBOT = load_robot("aoi2022-planar")


@pytest.fixture(scope="module")
def right():
    return curved_walks(ROBOT, floquet.K1, (floquet.stiffness(7.8), floquet.stiffness(20.0)), points=40)


def at(data, name, k1):
    order = np.argsort(data.parameter.values)
    # Towards the pitchfork the radius is a power: between points its logarithm is nearly straight over the root.
    x = np.sqrt(np.maximum(data.parameter.values[0] - data.parameter.values[order], 0.0))
    return float(np.exp(np.interp(-np.sqrt(data.parameter.values[0] - k1), -x, np.log(data[name].values[order]))))


def test_the_radius_of_the_body_axis(right):
    """Long simulations of an independent program: r = 1.095, 0.680, 0.544, 0.425, 0.318 m at these springs."""
    found = [at(right, "axis_radius", k1) for k1 in (11.9, 11.5, 11.0, 10.0, 8.0)]
    assert found == pytest.approx([1.095, 0.680, 0.544, 0.425, 0.318], rel=0.01)


def test_the_branch_is_stable_and_turns_right(right):
    assert right.stable.values[1:].all()
    assert right.special.values[0] == "pitchfork"
    assert (right.mean_angle.values[1:] > 0).all()
    assert (right.heading_rate.values[1:] < 0).all()


def test_powers_balance_over_a_period(right):
    assert right.leg_power.values == pytest.approx(-right.floor_power.values, rel=1e-5, abs=1e-9)


def test_left_is_the_mirror_image_of_right_half_a_period_later():
    left = curved_walks(ROBOT, floquet.K1, (floquet.stiffness(7.8), floquet.stiffness(20.0)), points=5, side=-1)
    point = left.isel(point=-1)
    model = PlanarModel(ROBOT.with_value(floquet.K1, floquet.stiffness(float(point.parameter))), tolerance=1e-11)
    half_way = model.flow_states(point.orbit.values[None], 0.0, model.period / 2)[0]
    mirrored = model.reflection @ half_way
    assert model.flow_states(mirrored[None], 0.0, model.period)[0] == pytest.approx(mirrored, abs=1e-9)
    there, here = model.drift(mirrored), model.drift(point.orbit.values)
    assert there.turn == pytest.approx(-here.turn, rel=1e-7)
    # Module 1 sways: its places at phase 0 and half a period later lie on circles that differ a little.
    assert there.radius == pytest.approx(here.radius, rel=1e-4)
    assert (point.mean_angle.values < 0).all()
    assert here.turn > 0


def test_a_disturbed_walk_settles_on_the_branch(right):
    point = right.isel(point=12)
    model = PlanarModel(ROBOT.with_value(floquet.K1, floquet.stiffness(float(point.parameter))), tolerance=1e-10)
    state = point.orbit.values + np.r_[np.zeros(3), 0.02 * np.ones(5), np.zeros(5)]
    for _ in range(1000):
        state = model.flow_states(state[None], 0.0, model.period)[0]
    assert state == pytest.approx(point.orbit.values, abs=1e-6)


def test_near_zero_forward_offset_the_branch_folds_back():
    robot = ROBOT.with_value("legs.forward_offset", 0.02)
    data = curved_walks(robot, floquet.K1, (floquet.stiffness(9.0), floquet.stiffness(20.0)), points=20)
    special = list(data.special.values)
    fold = special.index("fold")
    assert float(data.parameter[fold]) > float(data.parameter[0])
    assert not data.stable.values[1:fold].any()
    assert data.stable.values[fold + 1 :].all()


def test_no_pitchfork_is_said():
    with pytest.raises(AnalysisError, match="no pitchfork"):
        curved_walks(ROBOT, floquet.K1, (floquet.stiffness(20.0), floquet.stiffness(30.0)))


def test_written_and_printed(right, tmp_path):
    files = write_branch(right, tmp_path)
    assert all(file.stat().st_size > 0 for file in files)
    result = as_json(right)
    assert result["points"][0]["axis_radius_m"] is None
    assert result["points"][0]["special"] == "pitchfork"
    assert len(result["points"][3]["mean_joint_angles_rad"]) == 5
