"""The radius law, its inverse, and its silence outside."""

import math

import numpy as np
import pytest

from chilopod.errors import AnalysisError, ParameterError
from chilopod.steering import RadiusLaw


def curve(values):
    """A square-root law with a bend: 1/r^2 = 40 (0.7 - k) (1 + (0.7 - k))."""
    gap = 0.7 - np.asarray(values)
    with np.errstate(divide="ignore"):
        return 1.0 / np.sqrt(40.0 * gap * (1.0 + gap))


def law(count=30):
    values = np.linspace(0.7, 0.4, count)
    return RadiusLaw.of_branch(values, curve(values), np.ones(count, bool), "N*mm/deg")


def test_between_points_it_follows_the_curve():
    for value in (0.401, 0.55, 0.68, 0.699):
        assert law().radius(value) == pytest.approx(float(curve(value)), rel=2e-3)


def test_value_and_radius_are_inverse():
    found = law()
    for radius in (found.tightest, 0.3, 1.0, 10.0, 1e3):
        assert found.radius(found.value(radius)) == pytest.approx(radius, rel=1e-6)
    for value in (0.4, 0.5, 0.69):
        assert found.value(found.radius(value)) == pytest.approx(value, rel=1e-9)


def test_the_ends():
    found = law()
    assert found.value(math.inf) == found.pitchfork == 0.7
    assert found.radius(0.7) == found.radius(1.0) == math.inf


def test_outside_it_says_so():
    found = law()
    with pytest.raises(AnalysisError, match="must be at least the tightest radius"):
        found.value(0.9 * found.tightest)
    with pytest.raises(AnalysisError, match="tightest radius"):
        found.value(math.nan)
    with pytest.raises(ParameterError, match="at least the smallest value of the radius law"):
        found.radius(0.39)


def test_it_ends_where_the_walks_lose_stability_or_widen():
    values = np.linspace(0.7, 0.4, 30)
    stable = values > 0.5
    assert RadiusLaw.of_branch(values, curve(values), stable, "N*mm/deg").values[0] > 0.5
    widening = np.where(values > 0.55, curve(values), curve(0.55) + values)
    assert RadiusLaw.of_branch(values, widening, np.ones(30, bool), "N*mm/deg").values[0] > 0.54


def test_a_subcritical_branch_has_no_law():
    values = np.concatenate([np.linspace(0.7, 0.8, 10), np.linspace(0.79, 0.4, 20)])
    with pytest.raises(
        AnalysisError,
        match="branch: subcritical: beside the pitchfork the curved walks are unstable, and the robot jumps",
    ):
        RadiusLaw.of_branch(values, np.linspace(5.0, 0.3, 30), np.arange(30) > 10, "N*mm/deg")
