"""Targets: the circle to them, and those there is no circle to."""

import math

import numpy as np
import pytest

from chilopod.errors import ParameterError, UnitError
from chilopod.steering import Target


@pytest.mark.parametrize("bearing", [0.1, 0.7, -0.7, 1.5, 0.5 * math.pi])
def test_the_circle_starts_along_the_heading_and_ends_at_the_target(bearing):
    target = Target(bearing, 1.3)
    centre = np.array([0.0, math.copysign(target.radius, bearing)])
    assert np.hypot(*(target.position - centre)) == pytest.approx(target.radius, rel=1e-12)
    assert np.hypot(*target.position) == pytest.approx(1.3)


def test_the_paper_s_targets():
    """R / (2 sin psi); the paper prints 0.88 m and 1.2 m."""
    assert Target.parse("45 deg, 1.3 m").radius == pytest.approx(0.91924, abs=1e-5)
    assert Target.parse("40 deg, 150 cm").radius == pytest.approx(1.16679, abs=1e-5)
    assert str(Target.parse("40deg,1.5 m")) == "40 deg, 1.5 m"


def test_straight_ahead_is_a_circle_without_end():
    assert Target(0.0, 1.0).radius == math.inf


@pytest.mark.parametrize(
    ("bearing", "distance", "match"),
    [
        (45.0, 1.3, "in front.*-90 to 90 deg; a number without a unit is in rad"),
        (-math.pi, 1.0, "in front"),
        (math.nan, 1.0, "in front"),
        (0.5, 0.0, "a distance"),
        (0.5, -1.0, "a distance"),
        (0.5, 0.15, "a distance"),  # on the robot already
        (0.5, math.inf, "a distance"),
        (0.5, math.nan, "a distance"),
    ],
)
def test_targets_that_there_is_no_circle_to(bearing, distance, match):
    with pytest.raises(ParameterError, match=match):
        Target(bearing, distance)


def test_texts_that_are_no_targets():
    with pytest.raises(ParameterError, match=r"must be a target.*45 deg, 1\.3 m"):
        Target.parse("45 deg")
    for text in ("45 deg, 1.3 s", "45 m, 1.3 m", "here, there"):
        with pytest.raises(UnitError, match="target"):
            Target.parse(text)
