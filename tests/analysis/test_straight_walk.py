"""Stability of the straight walk and its bifurcations, in the robot's own terms."""

import numpy as np
import pytest

from chilopod.analysis import bifurcations, first_loss, straight_walk
from chilopod.analysis.parameters import ALL, K1, stiffness
from chilopod.errors import AnalysisError, ParameterError
from chilopod.robot import load_robot
from chilopod.stability import Kind

ROBOT = load_robot("aoi2022-planar")


def test_a_loss_of_another_kind_is_said():
    with pytest.raises(AnalysisError, match="Neimark-Sacker"):
        first_loss(ROBOT, ALL, (stiffness(2.0), stiffness(75.0)), Kind.PITCHFORK)


def test_coefficients_are_those_of_the_joint_angles():
    (point,) = bifurcations(ROBOT, K1, (stiffness(11.0), stiffness(13.0)))
    share = np.linalg.norm(point.point.mode[3:8])
    assert point.coefficient == pytest.approx(point.point.coefficient / share**2)
    assert np.linalg.norm(point.joint_components) == pytest.approx(1.0)
    assert point.error_bound < 1e-8


def test_modules_are_no_continuous_parameter():
    with pytest.raises(ParameterError, match=r"body\.modules"):
        bifurcations(ROBOT, "body.modules", (3.0, 8.0))


def test_stability_agrees_with_the_sign_of_the_leading_exponent():
    for k1 in (11.0, 13.0):
        found = straight_walk(ROBOT.with_value(K1, stiffness(k1)))
        assert found.stable is bool(found.exponents.values[0].real < 0) == (k1 > 12)
