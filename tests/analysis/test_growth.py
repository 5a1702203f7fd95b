"""Growth of the leading disturbance of many robots at once."""

import numpy as np
import pytest

from chilopod import stability
from chilopod.analysis import straight_walk
from chilopod.analysis.growth import FATES, Fate, growth_rates
from chilopod.analysis.parameters import K1, stiffness
from chilopod.errors import ParameterError
from chilopod.planar import PlanarModel
from chilopod.robot import load_robot

ROBOT = load_robot("aoi2022-planar")
SOFT = ROBOT.with_value(K1, stiffness(6.0))


def test_rates_and_fates_are_those_of_one_robot():
    robots = [
        ROBOT,
        SOFT,
        ROBOT.with_value("springs.stiffness", stiffness(5.0)),
        SOFT.with_value("gait.side_phase", 2.0),
    ]
    found = growth_rates(iter(robots), len(robots))
    for index, robot in enumerate(robots):
        exponents = straight_walk(robot).exponents
        assert found.growth[index] == pytest.approx(exponents.values[0].real, rel=1e-9)
        assert found.frequency[index] == pytest.approx(abs(exponents.values[0].imag), rel=1e-9, abs=1e-9)
        assert found.unstable[index] == (np.abs(exponents.multipliers.values) > 1.0).sum()
    assert [FATES[index] for index in found.fate] == [Fate.STRAIGHT, Fate.BENDS, Fate.UNDULATES, Fate.BENDS]
    assert np.isnan(found.error).all()


def test_at_the_point_itself_the_bound_decides():
    point = stability.locate(lambda k: PlanarModel(ROBOT.with_value(K1, k)), (stiffness(9.0), stiffness(15.0)))[0]
    beside = [ROBOT.with_value(K1, point.value * (1.0 + step)) for step in (-1e-6, 0.0, 1e-6)]
    found = growth_rates(beside, 3)
    assert [FATES[index] for index in found.fate] == [Fate.BENDS, Fate.UNDECIDED, Fate.STRAIGHT]
    assert (found.error < 1e-9).all()
    assert abs(found.growth[1]) <= found.error[1]


def test_no_robot_and_no_result_are_fates_of_their_own():
    found = growth_rates([ParameterError("must be positive"), ROBOT, ROBOT.with_value("springs.stiffness", 1e9)], 3)
    assert [FATES[index] for index in found.fate] == [Fate.INVALID, Fate.STRAIGHT, Fate.FAILED]
    assert np.isnan(found.growth).tolist() == [True, False, True]
    assert found.unstable.tolist() == [-1, 0, -1]
