"""Families that nobody can analyse: every search ends within its budget, with a status or with one line."""

import math

import numpy as np
import pytest

from chilopod.errors import AnalysisError, ChilopodError
from chilopod.stability import PeriodicSystem, locate
from helpers.systems import linear

BUDGET = 120
PERIOD = 2.0


def cantor(p):
    """The devil's staircase: continuous, and constant almost everywhere."""
    p, y, step = min(max(p, 0.0), 1.0), 0.0, 0.5
    for _ in range(50):
        p *= 3.0
        if p >= 2.0:
            y, p = y + step, p - 2.0
        elif p >= 1.0:
            return y + step
        step *= 0.5
    return y


SHAPES = {
    "nowhere smooth": lambda p: sum(0.7**k * math.cos(math.pi * 7.0**k * p) for k in range(18)),
    "staircase": lambda p: cantor(p) - 0.5,
    "noise": lambda p: (math.sin(p * 1e17) * 1e4) % 2.0 - 1.0,
    "sign": lambda p: math.copysign(1.0, p),
    "corner": abs,
    "corner below": lambda p: -abs(p),
    "root": lambda p: math.sqrt(abs(p)) - 0.5,
    "pole": lambda p: 1.0 / p,
    "double pole": lambda p: 1.0 / p**2,
    "ever faster": lambda p: math.sin(1.0 / p),
    "ever faster, smaller": lambda p: p * math.sin(1.0 / p),
    "flat": lambda p: math.copysign(math.exp(-1.0 / p**2), p),
    "nothing": lambda p: 0.0,
    "island": lambda p: math.nan if 0.1 < p < 0.2 else p - 0.3,
    "not a number": lambda p: math.nan,
    "half": lambda p: math.nan if p > 0.0 else p + 0.5,
    "infinite": lambda p: math.inf if p > 0.5 else p,
    "steps": lambda p: math.floor(10.0 * p) + 0.5,
    "steps on zero": lambda p: float(math.floor(10.0 * p)),
    "fast": lambda p: math.sin(200.0 * p),
    "too fast": lambda p: math.sin(1e5 * p),
    "tangent": lambda p: math.tan(3.0 * p),
    "huge": lambda p: 1e300 * p,
    "tiny": lambda p: 1e-300 * p,
    "eleventh power": lambda p: p**11,
    "twelfth power": lambda p: p**12,
    "plateau": lambda p: 0.0 if abs(p) < 0.3 else p - math.copysign(0.3, p),
    "rough line": lambda p: p + 1e-7 * math.sin(1e9 * p),
    "too flat": lambda p: 1e-18 * p,
    "small step": lambda p: 1e-3 if p > 0.123456789 else -1e-3,
    "steep": lambda p: 700.0 * p,
    "many": lambda p: math.sin(1.0 / (abs(p) + 1e-3)),
}
INTERVALS = [(-1.0, 1.0), (0.0, 1.0), (1e-300, 3e-300), (1e300, 1.5e300), (-1e308, 1e308), (5e-324, 2e-323)]


def lines(rate):
    """x' = rate x, y' = -y over a period of 1."""
    return linear(lambda t0, t1: np.diag(np.exp(np.array([rate, -1.0]) * (t1 - t0) / PERIOD)), 2, PERIOD)


def spiral(rate):
    """z' = (rate + i) z."""

    def moves(t0, t1):
        part = (t1 - t0) / PERIOD
        c, s = math.cos(part), math.sin(part)
        return np.exp(rate * part) * np.array([[c, -s], [s, c]])

    return linear(moves, 2, PERIOD)


def bent(rate):
    """x' = rate x - x^3: the orbits are not known, and come and go."""

    def flow(x, t0, t1):
        part = (t1 - t0) / PERIOD
        grow = np.exp(rate * part)
        inside = 1.0 + x[0] ** 2 * ((grow * grow - 1.0) / rate if rate else 2.0 * part)
        return np.array([x[0] * grow / np.sqrt(inside)]), np.array([[grow / inside**1.5]])

    return PeriodicSystem(1, PERIOD, flow)


def ends(build, shape, between, **options):
    """Whatever it is, the search ends as it should."""
    calls = 0

    def family(p):
        nonlocal calls
        calls += 1
        try:
            rate = shape(p)
        except (ArithmeticError, ValueError):  # 1 / 0, or too large
            rate = math.nan
        return build(rate)

    with np.errstate(all="ignore"):
        found, said = None, ""
        try:
            found = locate(family, between, budget=BUDGET, **options)
        except ChilopodError as refused:
            said = str(refused)
        assert "\n" not in said
        if found is not None:
            assert all(between[0] <= point.value <= between[1] for point in found)
            assert all(point.error_bound >= 0.0 for point in found)
            assert all("\n" not in remark for remark in found.remarks)
    # Beside the orbits of the search: refused ones, and those that describe what was found.
    assert calls < 12 * BUDGET


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("shape", SHAPES)
def test_every_search_ends(shape):
    for between in INTERVALS:
        ends(lines, SHAPES[shape], between)
    for between in INTERVALS[:2]:
        ends(spiral, SHAPES[shape], between)
        ends(bent, SHAPES[shape], between, orbit=[0.9])


def test_systems_of_another_kind_halfway():
    def other_dimension(p):
        return lines(0.1) if p < 0.5 else bent(0.1)

    changed = locate(other_dimension, (0.0, 1.0), orbit=[0.0, 0.0])
    assert any("changes its dimension" in remark for remark in changed.remarks)

    def no_period(p):
        if p < 0.5:
            return lines(-0.1)
        return PeriodicSystem(2, None, lines(-0.1).flow, velocity=lambda x: -x, guess_period=PERIOD)

    changed = locate(no_period, (0.0, 1.0), orbit=[0.0, 0.0])
    assert any("kind of period" in remark for remark in changed.remarks)
    assert not changed.complete


def test_an_orbit_that_is_nowhere():
    """x' = 1 + p^2 never comes back."""

    def family(p):
        return PeriodicSystem(1, PERIOD, lambda x, t0, t1: (x + (1.0 + p * p) * (t1 - t0), np.eye(1)))

    with pytest.raises(AnalysisError, match="no periodic orbit"):
        locate(family, (0.0, 1.0), orbit=[0.0])
