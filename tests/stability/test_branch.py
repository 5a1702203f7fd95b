"""Branches against curves that are known in closed form."""

import numpy as np
import pytest

from chilopod.errors import ParameterError
from chilopod.stability import Kind, from_rhs, locate
from chilopod.stability.branch import Ending, begin, follow, leave_pitchfork

PERIOD = 2.0


def gentle(mu):
    """x' = mu x - x^3: orbits x = sqrt(mu), multiplier exp(-2 mu T)."""
    return from_rhs(lambda t, x: mu * x - x**3, 1, PERIOD, orbit=[0.0], spatial_symmetry=[[-1.0]])


def abrupt(mu):
    """x' = mu x + x^3 - x^5: orbits x^2 = (1 +- sqrt(1 + 4 mu)) / 2, a fold at mu = -1/4, x^2 = 1/2."""
    return from_rhs(lambda t, x: mu * x + x**3 - x**5, 1, PERIOD, orbit=[0.0], spatial_symmetry=[[-1.0]])


@pytest.mark.parametrize("side", [1, -1])
def test_the_branch_of_a_supercritical_pitchfork(side):
    (fork,) = locate(gentle, (-0.1, 0.2))
    branch = follow(gentle, leave_pitchfork(gentle, fork, side), (-0.1, 0.2), step=0.05)
    assert branch.ending is Ending.LEFT_INTERVAL
    assert [point.special for point in branch.special_points] == [Kind.PITCHFORK]
    for point in branch.points[1:]:
        assert point.orbit[0] == pytest.approx(side * np.sqrt(point.value), abs=1e-9)
        assert point.multipliers[0] == pytest.approx(np.exp(-2 * point.value * PERIOD), abs=1e-9)
        assert point.stable


def test_the_branch_of_a_subcritical_pitchfork_folds_back():
    (fork,) = locate(abrupt, (-0.3, 0.2))
    branch = follow(abrupt, leave_pitchfork(abrupt, fork), (-0.3, 0.2), step=0.05)
    fork, fold = branch.special_points
    assert (fork.special, fold.special) == (Kind.PITCHFORK, Kind.FOLD)
    assert fold.value == pytest.approx(-0.25, abs=1e-9)
    assert fold.orbit[0] ** 2 == pytest.approx(0.5, abs=1e-6)
    turn = branch.points.index(fold)
    assert not any(point.stable for point in branch.points[1:turn])
    assert all(point.stable for point in branch.points[turn + 1 :])
    for point in branch.points[1:]:
        square = point.orbit[0] ** 2
        assert point.value == pytest.approx(square**2 - square, abs=1e-9)


def test_a_branch_goes_on_from_its_end():
    (fork,) = locate(gentle, (-0.1, 0.5))
    whole = follow(gentle, leave_pitchfork(gentle, fork), (-0.1, 0.5), points=8, step=0.05)
    half = follow(gentle, leave_pitchfork(gentle, fork), (-0.1, 0.5), points=4, step=0.05)
    assert half.ending is Ending.ENOUGH_POINTS
    rest = follow(gentle, half.points[-1], (-0.1, 0.5), points=4, step=0.05)
    for point in rest.points[1:]:
        assert point.orbit[0] == pytest.approx(np.sqrt(point.value), abs=1e-9)
    assert whole.points[4].value == half.points[-1].value


def test_a_branch_begins_at_a_known_orbit():
    start = begin(gentle, 0.1, [np.sqrt(0.1)], rising=False, width=0.3)
    branch = follow(gentle, start, (0.02, 0.2), step=0.02)
    assert branch.points[-1].value < 0.02
    assert branch.points[1].value < 0.1


def test_bad_arguments_are_named():
    start = begin(gentle, 0.1, [np.sqrt(0.1)], rising=True, width=0.3)
    with pytest.raises(ParameterError, match="between"):
        follow(gentle, start, (0.2, 0.1))
    with pytest.raises(ParameterError, match="points"):
        follow(gentle, start, (0.0, 0.2), points=0)
