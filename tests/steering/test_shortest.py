"""The shortest way of bounded curvature, against ways that were driven, optimised ones, and cases on paper."""

import itertools
import math
from functools import partial

import numpy as np
import pytest
from scipy.optimize import NonlinearConstraint, minimize

from chilopod.errors import ParameterError
from chilopod.steering import shortest_path

RADIUS = 0.35
WORDS = [word for word in itertools.product((-1, 0, 1), repeat=3) if word[0] != word[1] != word[2]]


def driven(word, lengths):
    """Where somebody is who drives arcs to the right (-1), left (1) and straight lines (0), one after another."""
    place, heading = 0j, 0.0
    for turn, length in zip(word, lengths, strict=True):
        after = heading + turn * length / RADIUS
        if turn:
            place = place + RADIUS / turn * 1j * (np.exp(1j * heading) - np.exp(1j * after))
        else:
            place = place + length * np.exp(1j * heading)
        heading = after
    return np.stack([place.real, place.imag], -1)


@pytest.mark.parametrize("word", WORDS)
def test_no_way_that_was_driven_is_shorter(word):
    rng = np.random.default_rng(len(WORDS))
    lengths = rng.uniform(0.0, 2.0 * math.pi * RADIUS, (3, 1000))
    ends = driven(word, lengths)
    assert (shortest_path(ends, RADIUS, 0.0) <= lengths.sum(0) + 1e-7).all()
    aside = rng.uniform(-0.1, 0.1, ends.shape)
    assert (shortest_path(ends + aside, RADIUS) <= lengths.sum(0) + 5e-4).all()


@pytest.mark.parametrize(
    "place",
    [
        (1.0, 0.6),  # a straight line ends it
        (0.05, 0.34),  # in the middle of the circle
        (0.3, -0.1),  # in the way of an arc
        (-0.3, 0.2),  # behind: the disc on the circle
        (-0.6, -0.05),
    ],
)
def test_as_short_as_the_best_of_all_sequences(place):
    rng = np.random.default_rng(1)

    def left(word, lengths):
        return np.hypot(*(driven(word, lengths) - place))

    found = math.inf
    for word in WORDS:
        for start in rng.uniform(0.0, 2.0 * math.pi * RADIUS, (4, 3)):
            best = minimize(
                np.sum,
                start,
                method="SLSQP",
                bounds=[(0.0, 2.0 * math.pi * RADIUS)] * 3,
                constraints=NonlinearConstraint(partial(left, word), 0.0, 0.15),
            )
            if best.success and left(word, best.x) < 0.15 + 1e-6:
                found = min(found, best.fun)
    assert shortest_path(np.array(place), RADIUS, 0.15) == pytest.approx(found, abs=1e-5)


def test_cases_on_paper():
    def to(x, y, radius=RADIUS, arrival=0.0):
        return float(shortest_path(np.array([x, y]), radius, arrival))

    assert to(2.0, 0.0) == 2.0
    assert to(2.0, 0.0, arrival=0.15) == 2.0 - 0.15
    assert to(0.1, 0.1, arrival=0.15) == 0.0
    for turned in (0.1, 1.0, 3.0, 4.5):
        assert to(RADIUS * math.sin(turned), RADIUS * (1.0 - math.cos(turned))) == pytest.approx(RADIUS * turned)
    # Twice a right angle and a straight line beside the start.
    assert to(-1.0, 2.0 * RADIUS) == pytest.approx(1.0 + math.pi * RADIUS)
    # Straight behind: a circle until it looks there, by the half angle.
    assert to(-1.0, 0.0) == pytest.approx(1.0 + RADIUS * 2.0 * (math.pi - math.atan(1.0 / RADIUS)))
    # Centre of the turning circle: the centres of the two arcs and the place have distances 2, 1 and 2 radii.
    away = math.acos(7.0 / 8.0)
    assert to(0.0, RADIUS) == pytest.approx(RADIUS * (away + 2.0 * math.pi - math.acos(0.25)))
    # On the spot, and hardly at all.
    assert to(-0.3, 0.4, radius=0.0) == pytest.approx(0.5)
    assert to(-0.3, 0.4, radius=1e-9, arrival=0.15) == pytest.approx(0.35)
    assert to(1.0, 1e-5, radius=1e4) == pytest.approx(1.0)
    assert to(5000.0, 5000.0, radius=5000.0) == pytest.approx(2500.0 * math.pi)
    assert math.isnan(to(math.nan, 1.0))


def test_left_and_right_are_alike_and_places_come_in_any_shape():
    places = np.random.default_rng(2).uniform(-1.0, 1.0, (3, 7, 2))
    lengths = shortest_path(places, RADIUS)
    assert lengths.shape == (3, 7)
    assert (lengths == shortest_path(places * [1.0, -1.0], RADIUS)).all()
    assert lengths[1, 2] == shortest_path(places[1, 2], RADIUS)


@pytest.mark.parametrize("radius", [-1.0, math.nan, math.inf])
def test_radii_that_are_none(radius):
    place = np.array([1.0, 0.0])
    with pytest.raises(ParameterError, match="turning radius"):
        shortest_path(place, radius)
    with pytest.raises(ParameterError, match="arrival radius"):
        shortest_path(place, RADIUS, radius)


def test_a_disc_just_ahead_beside_the_tightest_circle():
    """The straight line ahead, and an arc with a straight line to the disc's centre, can be driven."""
    rng = np.random.default_rng(2)
    for radius in (0.0066, 0.0183, 0.24, 0.45):
        x, y = rng.uniform(0.15, 0.2, 200), rng.uniform(-0.03, 0.03, 200)
        kept = np.hypot(x, y) > 0.15
        x, y = x[kept], y[kept]
        away = np.hypot(x, np.abs(y) - radius)
        line = np.sqrt(np.maximum(away**2 - radius**2, 0.0))
        turned = np.arctan2(np.abs(y) - radius, x) + np.arctan2(radius, line)
        driven = np.where(line >= 0.15, radius * (turned % (2.0 * math.pi)) + line - 0.15, math.inf)
        ahead = x - np.sqrt(0.15**2 - y**2)
        found = shortest_path(np.stack([x, y], -1), radius)
        assert (found <= np.fmin(driven, ahead) + 1e-9).all()
