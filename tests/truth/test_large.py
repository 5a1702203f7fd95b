"""Large systems with known multipliers: chains and rings that their Laplacian takes apart into one or two states."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from chilopod.stability import find_orbit, from_rhs, multipliers

LEADING = 6


def assert_leading(found, known, resolution, off):
    """The multipliers that were found are the largest of the known ones, each used once, each within its bound, which
    is below ``resolution``; what is known is off by ``off`` of itself."""
    known = sorted(known, key=abs, reverse=True)
    assert LEADING <= len(found.values) <= LEADING + 1
    assert found.error_bounds.shape == found.values.shape
    assert (found.error_bounds <= resolution).all()
    assert f"the {len(found.values)} multipliers of largest modulus" in found.remarks[0]
    least = abs(known[len(found.values) - 1])
    for value, bound in zip(found.values, found.error_bounds, strict=True):
        assert abs(value) > least * (1.0 - 1e-9)
        nearest = min(range(len(known)), key=lambda i: abs(known[i] - value))
        assert abs(known.pop(nearest) - value) <= bound + off * abs(value)


# Oscillators whose springs stiffen in step


def hill_multipliers(stiffness, swing, damping, terms=300):
    """Both multipliers over pi of q'' + d q' + w (1 + s cos 2t) q = 0 from Hill's determinant of u'' + (a - 2 p cos 2t)
    u = 0, q = exp(-d t / 2) u: sin^2(pi v / 2) = D sin^2(pi a^(1/2) / 2) (Whittaker and Watson, section 19.42), for
    arrays of w and d."""
    a, p = stiffness - 0.25 * damping**2, -0.5 * swing * stiffness
    rows = np.arange(-terms, terms + 1)
    before, here = np.ones_like(a), np.ones_like(a)
    ratio = [p / (a - 4.0 * row**2) for row in rows]
    for upper, lower in zip(ratio, ratio[1:], strict=False):
        before, here = here, here - upper * lower * before
    # The rows left out at either end, 1 - p^2 / (2 j + 1)^4 each.
    here = here * np.exp(-(p**2) / (24.0 * terms**3))
    cosine = 1.0 - 2.0 * here * np.sin(0.5 * math.pi * np.sqrt(a + 0j)) ** 2
    root = np.sqrt(cosine**2 - 1.0 + 0j)
    decay = np.exp(-0.5 * math.pi * damping)
    return np.concatenate([decay * (cosine + root), decay * (cosine - root)])


def chain(masses, inner, outer, units):
    """x_i'' = (1 + 0.3 cos 2t) (0.25 (L x)_i - 0.6 x_i) + inner (L x')_i - outer x_i', L the second difference between
    walls; states are x / units, then x' / units."""

    def rhs(t, y):
        x, v = (units * y).reshape(2, masses)
        bent, slowed = (np.concatenate([a[1:], [0.0]]) - 2.0 * a + np.concatenate([[0.0], a[:-1]]) for a in (x, v))
        force = (1.0 + 0.3 * np.cos(2.0 * t)) * (0.25 * bent - 0.6 * x)
        return np.concatenate([v, force + inner * slowed - outer * v]) / units

    return from_rhs(rhs, 2 * masses, math.pi)


@pytest.mark.parametrize(("inner", "stable", "spread"), [(0.4, True, 0.0), (0.0, False, 6.0)])
def test_a_chain_of_a_hundred_masses(inner, stable, spread):
    """Damped alike all moduli but those in resonance agree, so that nothing less than the whole space has them."""
    masses = 100
    units = 10.0 ** np.random.default_rng(0).uniform(-spread, spread, 2 * masses)
    found = multipliers(chain(masses, inner, 0.1, units), np.zeros(2 * masses), leading=LEADING)
    eigenvalues = 2.0 - 2.0 * np.cos(math.pi * np.arange(1, masses + 1) / (masses + 1))
    assert_leading(
        found,
        hill_multipliers(0.6 + 0.25 * eigenvalues, 0.3, 0.1 + inner * eigenvalues),
        1e-12 if spread == 0.0 else 1e-9,
        2e-14,
    )
    assert found.stable == stable


# A ring of cells, all driven alike


def cell(t, x):
    return 0.3 * x - x**3 + np.cos(t)


def ring(cells, coupling, units):
    def rhs(t, y):
        x = units * y
        return (cell(t, x) + coupling * (np.roll(x, 1) - 2.0 * x + np.roll(x, -1))) / units

    return from_rhs(rhs, cells, 2.0 * math.pi, symmetry=-np.eye(cells))


@pytest.mark.parametrize("spread", [0.0, 9.0])
def test_a_ring_of_two_hundred_cells(spread):
    """In phase it is one cell; wave number k dies faster by the factor exp(-c T (2 - 2 cos(2 pi k / n)))."""
    cells, coupling = 200, 2.0
    units = 10.0 ** np.random.default_rng(0).uniform(-spread, spread, cells)

    def slope(t, y):
        return [cell(t, y[0]), 0.3 - 3.0 * y[0] ** 2]

    options = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-15}
    state = solve_ivp(slope, (0.0, 20.0 * math.pi), [0.6, 0.0], **options).y[0, -1]
    run = solve_ivp(slope, (0.0, math.pi), [state, 0.0], **options)
    assert run.y[0, -1] == pytest.approx(-state, rel=1e-10)
    eigenvalues = 2.0 - 2.0 * np.cos(2.0 * math.pi * np.arange(cells) / cells)
    half = -np.exp(run.y[1, -1] - coupling * math.pi * eigenvalues)
    guess = state + 0.1 * np.cos(np.arange(cells))
    found = multipliers(ring(cells, coupling, units), guess / units, leading=LEADING)
    assert_leading(found, half**2, 1e-15, 2e-12)
    assert np.abs(found.half_period - np.sort(half)[: len(found.values)]).max() < 1e-12
    assert np.abs(units * found.orbit - state).max() < 1e-10


def test_the_orbit_of_a_large_system_for_all_multipliers():
    """Newton's method without the matrix, then the matrix once."""
    cells, coupling = 120, 2.0
    found = find_orbit(ring(cells, coupling, np.ones(cells)), 0.6 + 0.1 * np.cos(np.arange(cells)))
    assert np.ptp(found.state) < 1e-13
    assert (np.abs(found.image.state - found.state) <= found.error + 1e-15).all()


# Van der Pol oscillators in step


def test_a_ring_of_van_der_pol_oscillators_in_step():
    """Coupled by their speeds: wave number k has the 2-state block J(t) - e_k on the diagonal of x', by scipy."""
    cells, coupling = 60, 0.3

    def rhs(t, y):
        x, v = y[:cells], y[cells:]
        return np.concatenate([v, (1.0 - x * x) * v - x + coupling * (np.roll(v, 1) - 2.0 * v + np.roll(v, -1))])

    system = from_rhs(rhs, 2 * cells, None, guess_period=6.6)
    guess = np.concatenate([2.0 + 0.05 * np.cos(np.arange(cells)), np.zeros(cells)])
    found = multipliers(system, guess, leading=LEADING)
    period = 6.663286859323130
    assert found.period == pytest.approx(period, rel=1e-12)
    state = found.orbit[[0, cells]]
    eigenvalues = coupling * (2.0 - 2.0 * np.cos(2.0 * math.pi * np.arange(5) / cells))

    def blocks(t, y):
        x, v = y[:2]
        moved = y[2:].reshape(5, 2, 2)
        slopes = (-1.0 - 2.0 * x * v) * moved[:, 0] + (1.0 - x * x - eigenvalues[:, None]) * moved[:, 1]
        return np.concatenate([[v, (1.0 - x * x) * v - x], np.stack([moved[:, 1], slopes], axis=1).ravel()])

    start = np.concatenate([state, np.tile(np.eye(2), (5, 1, 1)).ravel()])
    run = solve_ivp(blocks, (0.0, period), start, "DOP853", rtol=1e-13, atol=1e-15)
    pairs = np.linalg.eigvals(run.y[2:, -1].reshape(5, 2, 2))
    trivial = np.abs(pairs[0] - 1.0).argmin()
    assert abs(pairs[0, trivial] - 1.0) < 1e-10
    known = [pairs[0, 1 - trivial], *np.repeat(pairs[1:], 2, axis=0).ravel()]
    assert_leading(found, known, 1e-9, 1e-12)
    assert found.stable


def test_a_guess_of_twice_the_period():
    """Of a large system, too, the orbit has its own period."""
    cells = 60

    def rhs(t, y):
        x, v = y[:cells], y[cells:]
        return np.concatenate([v, (1.0 - x * x) * v - x + 4.0 * (np.roll(v, 1) - 2.0 * v + np.roll(v, -1))])

    guess = np.concatenate([np.full(cells, 2.0), np.zeros(cells)])
    found = multipliers(from_rhs(rhs, 2 * cells, None, guess_period=13.4), guess, leading=1)
    assert found.period == pytest.approx(6.663286859323130, rel=1e-12)
    assert found.stable
