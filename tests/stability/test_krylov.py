"""Directions in place of the derivative of the flow, and multipliers in subspaces of few directions."""

import numpy as np
import pytest
from scipy.linalg import expm

from chilopod.errors import AnalysisError, ParameterError
from chilopod.stability import Event, PeriodicSystem, from_rhs, multipliers
from chilopod.stability.krylov import closed_orbit, krylov_subspaces, leading_multipliers, tangent_map, tangent_sizes
from helpers import systems


def linear(generator, state=None):
    """x' = L x over the time 1; its flows are matrix exponentials, with the digits of scipy."""

    def moves(t0, t1):
        return expm((t1 - t0) * generator)

    def flow_tangents(x, directions, t0, t1):
        return moves(t0, t1) @ x, moves(t0, t1) @ directions

    known = {} if state is None else {"orbit": state}
    return systems.linear(moves, len(generator), flow_tangents=flow_tangents, **known)


def leading(generator, count):
    system = linear(generator)
    x = np.zeros(len(generator))
    return leading_multipliers(tangent_map(system, x), tangent_sizes(system, x, 1.0), count)


@pytest.mark.parametrize(
    ("rhs", "events"),
    [
        (lambda t, x: np.array([x[1], -x[0] - 0.1 * np.sign(x[1]) + np.cos(np.pi * t), x[0] * x[2]]), ()),
        (
            lambda t, x: np.array([x[1], -9.81 + 0.0 * x[0], np.sin(x[0])]),
            [Event(lambda t, x: x[0], lambda t, x: np.array([x[0], -0.8 * x[1], x[2] + x[1]]), -1)],
        ),
        (lambda t, x: np.array([x[1], np.floor(3 * x[0]), (t % 0.4) * x[0]]), ()),
    ],
    ids=["switch", "impact", "steps"],
)
def test_directions_go_the_way_of_the_derivative(rhs, events):
    """Through switches and events, by the saltation of each direction."""
    system = from_rhs(rhs, 3, 2.0, events=events)
    x = np.array([1.1, 0.3, -0.7])
    state, derivative = system.flow(x, 0.0, 2.0)
    assert np.abs(derivative - np.eye(3)).max() > 0.1
    for columns in (1, 2, 3, 7):
        directions = np.random.default_rng(columns).standard_normal((3, columns))
        there, images = system.flow_tangents(x, directions, 0.0, 2.0)
        assert np.abs(there - state).max() < 1e-13 * np.abs(state).max()
        assert np.abs(images - derivative @ directions).max() < 1e-12 * np.abs(derivative).max()


def test_subspaces_grow_until_they_are_invariant():
    random = np.random.default_rng(0)
    left, right = random.standard_normal((2, 60, 9))
    matrix = left @ right.T  # of rank 9: blocks of 4 are invariant after 4 + 9 directions
    for subspace in krylov_subspaces(lambda directions: matrix @ directions, random.standard_normal((60, 4))):
        v, m = subspace.basis, subspace.matrix.shape[0]
        assert np.abs(v.T @ v - np.eye(m)).max() < 1e-13
        assert np.linalg.norm(matrix @ v - v @ subspace.matrix) == pytest.approx(
            np.linalg.norm(subspace.coupling), rel=1e-9, abs=1e-12
        )
    assert m == 13
    assert subspace.coupling.size == 0
    known = np.linalg.eigvals(right.T @ left)
    found = np.linalg.eigvals(subspace.matrix)
    assert max(np.abs(found - value).min() for value in known) < 1e-11


@pytest.mark.parametrize("seed", range(15))
def test_bounds_hold_for_matrices_far_from_normal(seed):
    """Real and complex multipliers, some of them several times, with eigenvectors that are nearly dependent."""
    random = np.random.default_rng(seed)
    n, count = 60, int(random.integers(1, 7))
    rates = -np.sort(random.exponential(2.0, n // 2)) + random.uniform(-0.3, 0.5)
    if seed % 3 == 0:
        rates[: n // 10] = rates[0]
    turns = np.where(random.random(n // 2) < 0.5, 0.0, random.uniform(0.1, 3.0, n // 2))
    generator = np.zeros((n, n))
    for i, (rate, turn) in enumerate(zip(rates, turns, strict=True)):
        generator[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[rate, turn], [-turn, rate - (turn == 0.0) * 0.1]]
    known = [value for rate, turn in zip(rates, turns, strict=True) for value in pair(rate, turn)]
    spread = 10.0 ** random.uniform(0.0, 3.0)
    q, p = (np.linalg.qr(random.standard_normal((n, n)))[0] for _ in range(2))
    basis = q * np.geomspace(1.0, spread, n) @ p
    values, error, _ = leading(basis @ generator @ np.linalg.inv(basis), count)
    assert count <= values.size <= count + 1
    known = sorted(np.exp(known), key=abs, reverse=True)
    slack = 1e-12 * spread  # of scipy's exponential
    least = abs(known[values.size - 1])
    for value, bound in zip(values, error, strict=True):
        assert abs(value) >= least - bound - slack
        nearest = min(range(len(known)), key=lambda i: abs(known[i] - value))
        assert abs(known.pop(nearest) - value) <= bound + slack
    assert error.max() < 1e-6


def pair(rate, turn):
    return [rate + 1j * turn, rate - 1j * turn] if turn else [rate, rate - 0.1]


def test_a_multiplier_without_eigenvectors_of_its_own():
    """A Jordan block of three: digits are a third of those of the matrix, and the bound says so."""
    random = np.random.default_rng(0)
    generator = -np.diag(np.linspace(1.0, 20.0, 100))
    generator[:3, :3] = [[-0.2, 1.0, 0.0], [0.0, -0.2, 1.0], [0.0, 0.0, -0.2]]
    turn = np.linalg.qr(random.standard_normal((100, 100)))[0]
    values, error, _ = leading(turn @ generator @ turn.T, 3)
    off = np.abs(values - np.exp(-0.2))
    assert (off <= error).all()
    assert 1e-9 < off.max() < 1e-3
    assert error.max() < 1e-2


def test_newtons_method_in_a_subspace():
    """x' = L (x - c) + terms of third order that vanish in c; the orbit is at rest in c."""
    n = 40
    center = np.linspace(1.0, 2.0, n)

    def rhs(t, x):
        y = x - center
        return -np.linspace(0.05, 30.0, n) * y + 0.3 * (np.roll(y, 1) ** 3 - y**3) * np.cos(t)

    image, size = closed_orbit(from_rhs(rhs, n, 2 * np.pi), center + 0.3 * np.cos(np.arange(n)))
    assert np.abs(image.point - center).max() < 1e-14
    assert ((size >= 0.9) & (size <= 10.0)).all()


def test_no_orbit_near_the_guess():
    system = from_rhs(lambda t, x: 0.1 + 0.0 * x, 12, 1.0)
    with pytest.raises(AnalysisError, match="no correction closes the motion"):
        closed_orbit(system, np.ones(12))


def test_few_of_a_small_system():
    rates = np.array([-0.1, -0.2, -0.3, -0.4])
    system = from_rhs(
        lambda t, x: np.array([rates[0] * x[0], *(rates[1] * x[1:3] + [x[2], -x[1]]), -0.4 * x[3]]), 4, 1.0
    )
    every = multipliers(system, np.zeros(4))
    assert every.remarks == ()
    assert every.error_bounds.shape == (4,)
    for count, kept in [(1, 1), (2, 3), (3, 3), (4, 4)]:
        found = multipliers(system, np.zeros(4), leading=count)
        assert (found.values == every.values[:kept]).all()
        assert found.error_bounds.shape == (kept,)
        assert len(found.remarks) == (kept < 4)
    assert f"{np.exp(-0.4):.3g}" in multipliers(system, np.zeros(4), leading=3).remarks[0]


@pytest.mark.parametrize("count", [0, -1, 5, 2.5, "two"])
def test_how_many_has_to_be_a_number(count):
    system = from_rhs(lambda t, x: -x, 4, 1.0)
    with pytest.raises(ParameterError, match=r"leading.*allowed: 1 to 4"):
        multipliers(system, np.zeros(4), leading=count)


def test_a_large_system_without_directions():
    """It goes the way of the matrix."""
    factors = np.linspace(0.5, 0.1, 100)
    system = systems.linear(lambda t0, t1: np.diag(factors ** (t1 - t0)), 100)
    found = multipliers(system, leading=2)
    assert np.abs(found.values - factors[:2]).max() <= found.error_bound < 1e-12
    assert len(found.remarks) == 1


def test_a_large_stiff_system(monkeypatch):
    """Taylor series take too many steps: the directions go the way of the implicit flow."""
    for user in ("floquet", "orbits.orbit"):  # the implicit flow of 100 states takes half a minute
        monkeypatch.setattr(f"chilopod.stability.{user}.LARGE", 30)
    rates = np.geomspace(0.3, 1e5, 30)
    found = multipliers(from_rhs(lambda t, x: -rates * x, 30, 1.0), np.zeros(30), leading=2)
    np.testing.assert_allclose(found.values[:2], np.exp(-rates[:2]), atol=found.error_bound)
    assert found.error_bound < 1e-9


def test_a_known_orbit_that_is_none():
    generator = -np.diag(np.linspace(1.0, 20.0, 100))
    with pytest.raises(AnalysisError, match="must be a periodic orbit"):
        multipliers(linear(generator, np.ones(100)), leading=3)


def test_a_flow_of_wrong_shapes():
    system = PeriodicSystem(
        100,
        1.0,
        lambda x, t0, t1: (0.5 * x, 0.5 * np.eye(100)),
        flow_tangents=lambda x, directions, t0, t1: (0.5 * x, 0.5 * directions.T),
        orbit=np.zeros(100),
    )
    with pytest.raises(AnalysisError, match="flow_tangents: gives shapes"):
        leading_multipliers(tangent_map(system, np.zeros(100)), np.ones(100), 3)


def test_one_more_than_a_subspace_resolves():
    """Advection and diffusion, u_t = D u_xx - u_x + 11 u: the eigenvalues of its matrix are known, its eigenvectors lie
    almost along each other."""
    n, diffusion = 120, 0.02
    back, ahead = diffusion * (n + 1) ** 2 + 0.5 * (n + 1), diffusion * (n + 1) ** 2 - 0.5 * (n + 1)
    decay, units = 11.0 - back - ahead, np.sqrt(back / ahead) ** np.arange(n)
    beside = np.diag([np.sqrt(back * ahead)] * (n - 1), 1)

    def moves(t0, t1):
        return units[:, None] * expm((t1 - t0) * (beside + beside.T + decay * np.eye(n))) / units

    def flow_tangents(x, directions, t0, t1):
        return moves(t0, t1) @ x, moves(t0, t1) @ directions

    found = multipliers(systems.linear(moves, n, flow_tangents=flow_tangents, orbit=np.zeros(n)), leading=8)
    right = np.exp(decay + 2.0 * np.sqrt(back * ahead) * np.cos(np.pi * np.arange(1, 9) / (n + 1)))
    assert found.stable
    assert (np.abs(found.values - right) <= found.error_bounds).all()
    np.testing.assert_allclose(found.values, right, atol=1e-6)  # the own bounds of matrix exponentials are wide
