"""What `switch2` and `follow2` refuse where curves leave one another, and in which words."""

import numpy as np
import pytest

from chilopod.errors import AnalysisError, ParameterError
from chilopod.stability import BifurcationPoint, CodimensionTwo, Kind, SpecialPoint2, SpentError, follow2, switch2
from helpers.systems import doubling

BOX = ((-1.0, 1.0), (-1.0, 1.0))


def turning(fifth):
    start = BifurcationPoint(Kind.PERIOD_DOUBLING, 0.0, 0.0, np.zeros(1), np.ones(1, complex), -1.0 + 0j, np.pi)
    (point,) = follow2(doubling(fifth), start, BOX, second=-0.3, longest=0.3).special
    return point


def test_a_curve_leaves_for_the_side_where_folds_are():
    """Twice the map has e = -2 fifth, c = -2 (q - 0.1): folds are where the two have opposite signs."""
    for fifth in (-0.5, 0.5):
        (start,) = switch2(doubling(fifth), turning(fifth), BOX)
        assert (start.second - 0.1) * fifth < 0.0
        assert start.point.kind is Kind.FOLD


def test_a_coefficient_of_fifth_order_that_vanishes_too():
    point = turning(0.0)
    assert abs(point.next_coefficient) <= point.next_coefficient_error
    with pytest.raises(AnalysisError, match="zero within its error"):
        switch2(doubling(0.0), point, BOX)


@pytest.mark.parametrize(
    ("kind", "why"),
    [
        (CodimensionTwo.CUSP, "the curve of folds itself goes through it"),
        (CodimensionTwo.CHENCINER, "folds of tori"),
        (CodimensionTwo.RESONANCE_1_3, "1:3 resonance"),
    ],
)
def test_what_no_curve_is_switched_to_from(kind, why):
    one = np.ones(1, complex)
    point = SpecialPoint2(np.zeros(2), np.zeros(2), np.zeros(1), one, -1.0 + 0j, one, np.pi, kind=kind)
    with pytest.raises(ParameterError, match=why):
        switch2(doubling(0.5), point, BOX)


def test_arguments_and_budgets():
    point = turning(0.5)
    with pytest.raises(ParameterError, match="two intervals"):
        switch2(doubling(0.5), point, (0.0, 1.0))
    with pytest.raises(SpentError, match=r"flows .*budget.* were spent"):
        switch2(doubling(0.5), point, BOX, budget=3)
    (start,) = switch2(doubling(0.5), point, BOX)
    with pytest.raises(ParameterError, match="second"):
        follow2(doubling(0.5), start.point, BOX)
    with pytest.raises(AnalysisError, match="no curve of folds was found"):  # none is in the box
        switch2(doubling(0.5), point, ((-1.0, 1.0), (0.1, 1.0)))
