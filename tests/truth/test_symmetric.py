"""Symmetric systems with known answers: rings, planes, and strong resonances."""

import math

import numpy as np
import pytest

from chilopod.stability import Criticality, Kind, PeriodicSystem, begin, follow, from_rhs, locate, multipliers
from helpers.systems import linear

FORCE, RATE = 0.4, 1.3
PERIOD = 2.0 * math.pi / RATE


def duffing_ring(cells):
    """Duffing cells x'' + 0.2 x' + x + x^3 = F cos w t - c (x_left + x_right - 2 x), all driven alike."""
    shift = np.roll(np.eye(cells), 1, axis=0)
    generators = [np.kron(each, np.eye(2)) for each in (shift, np.eye(cells)[::-1])]

    def rhs(t, x, c):
        place, speed = x[0::2], x[1::2]
        coupled = np.roll(place, 1) + np.roll(place, -1) - 2.0 * place
        slope = FORCE * np.cos(RATE * t) - 0.2 * speed - place - place * place * place - c * coupled
        return np.stack([speed, slope], axis=1).ravel()

    return lambda c: from_rhs(rhs, 2 * cells, PERIOD, args=(c,), spatial_symmetry=generators)


def one_cell(stiffness):
    """A cell beside which a mode of the ring grows: y'' + 0.2 y' + (1 + 3 x^2 - s) y = 0."""

    def rhs(t, x, s):
        own = FORCE * np.cos(RATE * t) - 0.2 * x[1] - x[0] - x[0] * x[0] * x[0]
        return [x[1], own, x[3], -0.2 * x[3] - (1.0 + 3.0 * x[0] * x[0] - s) * x[2]]

    return from_rhs(rhs, 4, PERIOD, args=(stiffness,), spatial_symmetry=np.diag([1.0, 1.0, -1.0, -1.0]))


def test_a_ring_of_five_driven_in_phase():
    """Wave number k has the stiffness s = 2 c (1 - cos(2 pi k / 5)) of one cell's mode, twice: so the ring has the
    crossings of a cell at s / (2 - 2 cos(2 pi k / 5)), all of them double."""
    single = locate(one_cell, (0.0, 6.0), orbit=[0.5, 0.0, 0.0, 0.0], normal_form=False)
    assert single.complete
    assert len(single) == 3
    factors = [2.0 - 2.0 * math.cos(2.0 * math.pi * k / 5.0) for k in (1, 2)]
    known = sorted(point.value / factor for point in single for factor in factors if point.value / factor < 1.2)
    found = locate(duffing_ring(5), (0.0, 1.2), orbit=np.tile([0.5, 0.0], 5))
    assert found.complete
    assert len(known) == len(found) == 4
    for point, value in zip(found, known, strict=True):
        assert abs(point.value - value) <= point.error_bound < 1e-9
        assert point.kind is Kind.PITCHFORK
        assert point.multiplicity == 2
        # Of a multiplier at +1 with the symmetry D5, branches grow along the mirror axes, without a quadratic term.
        assert point.symmetry is not None
        assert point.symmetry.quadratic == 0


def test_three_genes_that_repress_each_other_in_turn():
    """x_i' = a / (1 + x_{i-1}^4) - x_i: a wave that runs round the ring. The multipliers of a third of the period, the
    shift included, have those of the whole as their cubes."""
    shift = np.roll(np.eye(3), 1, axis=0)

    def system(symmetry):
        return from_rhs(lambda t, x: 6.0 / (1.0 + np.roll(x, 1) ** 4) - x, 3, None, guess_period=4.7, symmetry=symmetry)

    whole = multipliers(system(None), [3.8, 1.6, 0.5])
    third = multipliers(system(shift), [3.8, 1.6, 0.5])
    assert third.half_period is not None
    assert third.period == pytest.approx(whole.period, rel=1e-13)
    assert third.half_period**3 == pytest.approx(third.values, rel=1e-13)
    assert np.abs(third.values - whole.values).max() <= whole.error_bound + third.error_bound < 1e-11
    # The sum of all exponents is the mean of the divergence, -3.
    assert np.log(np.prod(whole.values.real)) == pytest.approx(-3.0 * whole.period, abs=1e-7)


def plane(p, turns=(0.0,)):
    """Oscillators that grow as exp(p t) and turn by given angles in a period of 1; those that do not turn are lines."""

    def moves(t0, t1):
        derivative = np.zeros((2 * len(turns), 2 * len(turns)))
        for i, turn in enumerate(turns):
            c, s = math.cos(turn * (t1 - t0)), math.sin(turn * (t1 - t0))
            derivative[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = math.exp(p * (t1 - t0)) * np.array([[c, -s], [s, c]])
        return derivative

    return linear(moves, 2 * len(turns))


@pytest.mark.parametrize(
    "turns", [(0.0,), (math.pi,), (1.0,), (1.0, 1.0), (0.7, 1.4), (0.3, 0.6, 0.9), (2.0 * math.pi / 3.0,)]
)
def test_everything_at_once(turns):
    """x' = p x, y' = p y, and several pairs at the same place, in resonance 1:1 and 1:2: none is lost."""
    found = locate(lambda p: plane(p, turns), (-1.0, 1.1))
    assert found.complete
    assert sum(point.multiplicity for point in found) == 2 * len(turns)
    for point in found:
        assert abs(point.value) <= point.error_bound + 1e-12
        assert point.error_bound < 1e-10
    angles = sorted({min(turn, 2.0 * math.pi - turn) for turn in turns if 0.0 < turn < math.pi})
    if angles:
        assert all(point.kind is Kind.NEIMARK_SACKER for point in found)


@pytest.mark.parametrize("order", [3, 4])
def test_strong_resonances_have_no_verdict(order):
    """z -> exp(p + 2 pi i / k) z / sqrt(1 + 2 |z|^2): at k of 3 and 4 the coefficient says nothing."""

    def family(p):
        def flow(x, t0, t1):
            share, turn = t1 - t0, 2.0 * math.pi / order * (t1 - t0)
            grow = math.exp(p * share)
            squares = (grow * grow - 1.0) / p if p else 2.0 * share
            inside = 1.0 + squares * (x @ x)
            rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
            derivative = grow * (np.eye(2) / math.sqrt(inside) - squares * np.outer(x, x) / inside**1.5)
            return grow / math.sqrt(inside) * rotation @ x, rotation @ derivative

        return PeriodicSystem(2, 1.0, flow, orbit=np.zeros(2))

    (point,) = locate(family, (-0.5, 0.6))
    assert point.kind is Kind.NEIMARK_SACKER
    assert abs(point.value) <= point.error_bound < 1e-12
    assert point.criticality is Criticality.NOT_COMPUTED
    assert point.normal_form is not None
    assert "resonance" in point.normal_form.status.name.lower()


def test_a_symmetry_does_not_hinder_an_orbit_whose_returns_magnify():
    """Two equal FitzHugh-Nagumo cells, time reversed: in step their returns magnify by up to three millions. Rounding
    is not symmetric, so what it leaves of asymmetry grows from node to node. Without the symmetry: the same values."""
    swap = np.kron(np.eye(2)[::-1], np.eye(2))

    def cell(u, v, other, forcing):
        return [v + u**3 / 3.0 - u - forcing - 0.1 * (other - u), -0.2 * (u + 0.3 - 0.8 * v)]

    def rhs(t, x, a):
        forcing = a * np.cos(0.9 * t)
        return cell(x[0], x[1], x[2], forcing) + cell(x[2], x[3], x[0], forcing)

    def family(a):
        return from_rhs(rhs, 4, 2.0 * np.pi / 0.9, args=(a,), spatial_symmetry=swap)

    orbit = [-0.87671416, -0.64733018] * 2
    found = locate(family, (0.2, 2.5), orbit=orbit, normal_form=False)
    assert found.complete
    np.testing.assert_allclose([point.value for point in found], [0.243981296, 1.185042918, 1.261124839], rtol=1e-8)
    start = begin(family, found[-1].value, found[-1].orbit)
    branch = follow(family, start, (start.value, 2.5), closely=False)
    assert branch.points[-1].value == 2.5
