"""Crossings of the unit circle of families whose multipliers are known, or found by dense sampling."""

import itertools
import time

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import block_diag, expm
from scipy.optimize import brentq
from scipy.special import mathieu_a, mathieu_b

from chilopod.errors import ParameterError
from chilopod.flows.deadline import Deadline, SpentError
from chilopod.stability.spectrum import disturbed
from chilopod.stability.unit_circle.crossings import SearchStatus, find_crossings
from chilopod.stability.unit_circle.spectra import CircleEvent, Spectra, symmetric

MINUS, PLUS, PAIR = CircleEvent.MINUS, CircleEvent.PLUS, CircleEvent.PAIR


def family(matrix, error=1e-16):
    """Of matrices that are computed one at a time."""
    return lambda values: (np.array([matrix(value) for value in values]), np.full(values.size, error))


def diagonal(*rates):
    return family(lambda p: np.diag(np.exp([float(rate(p)) for rate in rates])))


def turned(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def symplectic(hamiltonian):
    """The flow over a time 1 of a Hamiltonian x^T H(p) x / 2."""

    def matrix(p):
        half = hamiltonian(p).shape[0] // 2
        form = np.block([[np.zeros((half, half)), np.eye(half)], [-np.eye(half), np.zeros((half, half))]])
        return expm(form @ hamiltonian(p))

    return family(matrix)


def mathieu(q, damping=0.0):
    """x'' + damping x' + (a - 2 q cos 2t) x = 0 over its period pi."""

    def matrices(values):
        def rhs(t, flat):
            x, v = flat.reshape(2, -1)
            a = np.repeat(values, 2)
            return np.concatenate([v, -(a - 2.0 * q * np.cos(2.0 * t)) * x - damping * v])

        start = np.stack([np.tile([1.0, 0.0], values.size), np.tile([0.0, 1.0], values.size)])
        end = solve_ivp(rhs, (0.0, np.pi), start.ravel(), method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        return np.moveaxis(end.reshape(2, values.size, 2), 0, 1), np.full(values.size, 1e-12)

    return matrices


def summary(found):
    return [(c.event, c.multiplicity, c.change) for c in found.crossings]


def places(found):
    return [c.value for c in found.crossings]


@pytest.mark.parametrize("gap", [0.05, 1e-2, 1e-3, 1e-5, 1e-7, 1e-9])
@pytest.mark.parametrize("slope", [2.0, -2.0])
def test_a_root_on_a_node_does_not_hide_its_neighbour(gap, slope):
    found = find_crossings(diagonal(lambda p: 2.0 * p, lambda p: 2.0 * slope * (p - gap)), -0.5, 0.5)
    assert found.status is SearchStatus.COMPLETE
    assert summary(found) == [(PLUS, 1, 1), (PLUS, 1, int(np.sign(slope)))]
    assert places(found) == pytest.approx([0.0, gap], abs=1e-15)


@pytest.mark.parametrize(
    ("matrix", "event", "number"),
    [
        (lambda p: np.exp(p - 0.3) * np.eye(2), PLUS, 2),
        (lambda p: -np.exp(p - 0.3) * np.eye(3), MINUS, 3),
        (lambda p: np.exp(p - 0.3) * turned(1.1), PAIR, 2),
        (lambda p: np.exp(p - 0.3) * np.kron(np.eye(2), turned(1.1)), PAIR, 4),
        (lambda p: np.exp(p - 0.3) * np.kron(np.eye(2) + np.eye(2, k=1), turned(1.1)), PAIR, 4),
        (lambda p: np.exp(p - 0.3) * turned(np.pi), MINUS, 2),
        (lambda p: np.exp(p - 0.3) * turned(np.pi / 2), PAIR, 2),
        (lambda p: np.exp(p - 0.3) * turned(2 * np.pi / 3), PAIR, 2),
    ],
    ids=["isotropic", "three", "pair", "two pairs", "1:1", "1:2", "1:4", "1:3"],
)
def test_crossings_of_any_multiplicity(matrix, event, number):
    found = find_crossings(family(matrix), -0.6, 1.1)
    assert (found.status, summary(found)) == (SearchStatus.COMPLETE, [(event, number, number)])
    assert places(found) == pytest.approx([0.3], abs=1e-8)  # of a defective pair only the square root is known


@pytest.mark.parametrize("size", [5, 6, 20])
def test_a_ring_loses_stability_in_pairs(size):
    ring = np.eye(size, k=1) + np.eye(size, k=1 - size)
    coupling = ring + ring.T - 2.0 * np.eye(size)
    found = find_crossings(family(lambda p: expm(p * np.eye(size) + coupling)), -1.0, 3.7)
    rates = 2.0 - 2.0 * np.cos(2.0 * np.pi * np.arange(size // 2 + 1) / size)
    expected = [(rate, 1 if k in (0, size / 2) else 2) for k, rate in enumerate(rates) if rate < 3.7]
    assert found.status is SearchStatus.COMPLETE
    assert places(found) == pytest.approx([rate for rate, _ in expected], abs=1e-12)
    assert summary(found) == [(PLUS, number, number) for _, number in expected]


def test_a_touch_and_an_exchange():
    found = find_crossings(diagonal(lambda p: -((p - 0.3) ** 2), lambda p: -1.0), 0.0, 1.0)
    assert (found.status, summary(found)) == (SearchStatus.COMPLETE, [(PLUS, 1, 0)])
    assert places(found) == pytest.approx([0.3], abs=1e-7)
    found = find_crossings(diagonal(lambda p: p - 0.3, lambda p: 0.6 - 2.0 * p), 0.0, 1.0)
    assert (found.status, summary(found)) == (SearchStatus.COMPLETE, [(PLUS, 2, 0)])


def test_real_multipliers_with_product_one_and_collisions_outside_are_no_crossings():
    found = find_crossings(diagonal(lambda p: 0.5 + p, lambda p: -0.8), 0.0, 1.0)
    assert (found.status, found.crossings) == (SearchStatus.COMPLETE, ())
    # Two real ones outside meet and become a pair.
    found = find_crossings(family(lambda p: expm(np.array([[0.3, 1.0], [0.4 - p, 0.3]]))), 0.38, 1.0)
    assert (found.status, found.crossings) == (SearchStatus.COMPLETE, ())


@pytest.mark.parametrize("seed", range(30))
def test_known_multipliers_in_a_slanted_basis_of_any_units(seed):
    """Trigonometric rates, real and complex multipliers, one of them twice at times; states and parameter scaled."""
    rng = np.random.default_rng(seed)
    events = list(rng.choice(np.array([MINUS, PLUS, PAIR]), size=rng.integers(1, 5)))
    shapes = [(rng.normal(size=3), rng.uniform(1.0, 9.0, 3), rng.uniform(0.0, 6.0, 3)) for _ in events]
    angles = [rng.uniform(0.3, 2.8) for _ in events]
    twice = rng.random() < 0.3
    if twice:
        events, shapes, angles = events + events[:1], shapes + shapes[:1], angles + angles[:1]
    rates = [lambda p, s=s: float(s[0] @ np.sin(s[1] * p + s[2])) for s in shapes]
    scale = 10.0 ** rng.integers(-12, 13)

    def blocks(p):
        for event, rate, angle in zip(events, rates, angles, strict=True):
            yield np.exp(rate(p)) * (turned(angle) if event is PAIR else np.eye(1) * (1 if event is PLUS else -1))

    size = block_diag(*blocks(0.0)).shape[0]
    basis = np.linalg.qr(rng.normal(size=(size, size)))[0] * rng.uniform(0.5, 2.0, size)
    units = 10.0 ** rng.uniform(-9.0, 9.0, size)
    inverse = np.linalg.inv(basis)
    matrices = family(lambda p: units[:, None] * (basis @ block_diag(*blocks(p / scale)) @ inverse) / units, 1e-14)

    expected = []
    grid = np.linspace(0.0, 1.0, 2001)
    for index, (event, rate) in enumerate(zip(events, rates, strict=True)):
        if twice and index == len(events) - 1:
            continue
        sizes = [rate(p) for p in grid]
        for i in np.flatnonzero(np.diff(np.sign(sizes))):
            number = (2 if event is PAIR else 1) * (2 if twice and index == 0 else 1)
            change = number if sizes[i] < 0 else -number
            expected.append((brentq(rate, grid[i], grid[i + 1]), (event, number, change)))
    expected.sort(key=lambda crossing: crossing[0])
    found = find_crossings(matrices, 0.0, scale)
    assert found.status is SearchStatus.COMPLETE
    assert summary(found) == [what for _, what in expected]
    assert np.array(places(found)) / scale == pytest.approx([where for where, _ in expected], abs=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_random_families_against_counting_everywhere(seed):
    rng = np.random.default_rng(seed)
    size = rng.integers(1, 8)
    a, b, c = rng.normal(size=(3, size, size)) / np.sqrt(size) * rng.uniform(0.3, 1.5)

    def matrices(values):
        p = values[:, None, None]
        return a * np.cos(5.0 * p) + b * np.sin(7.0 * p) + c * p, np.full(values.size, 1e-15)

    found = find_crossings(matrices, 0.0, 1.0)
    grid = (np.arange(4000) + 0.123) / 4000.5
    counts = (np.abs(np.linalg.eigvals(matrices(grid)[0])) > 1.0).sum(axis=1)
    explained = np.zeros(grid.size, dtype=int)
    for crossing in found.crossings:
        explained[grid > crossing.value] += crossing.change
    assert found.status is SearchStatus.COMPLETE
    np.testing.assert_array_equal(counts - counts[0], explained)


def test_the_borders_of_the_mathieu_equation():
    found = find_crossings(mathieu(0.5), -0.5, 5.0)
    known = [(PLUS, mathieu_a(0, 0.5)), (MINUS, mathieu_b(1, 0.5)), (MINUS, mathieu_a(1, 0.5))]
    known += [(PLUS, mathieu_b(2, 0.5)), (PLUS, mathieu_a(2, 0.5))]
    assert found.status is SearchStatus.CONSERVATIVE
    assert found.evaluations < 300
    assert places(found) == pytest.approx([float(value) for _, value in known], abs=1e-9)
    assert summary(found) == [(event, 2, (-1) ** (i + 1)) for i, (event, _) in enumerate(known)]
    assert all(crossing.collision for crossing in found.crossings)


def test_a_little_damping_is_no_conservative_family():
    found = find_crossings(mathieu(0.5, 0.01), 0.2, 0.7)
    assert (found.status, summary(found)) == (SearchStatus.COMPLETE, [(MINUS, 1, 1)])
    assert found.evaluations < 60


def test_krein_collisions():
    """Two modes of opposite signature, 1 and p, coupled by c, turn with frequencies w, w^2 a root of a quadratic whose
    discriminant vanishes where they meet."""
    coupling = 0.05

    def hamiltonian(p):
        h = np.diag([1.0, -p, 1.0, -p])
        h[0, 1] = h[1, 0] = coupling
        return h

    # (J H)^2 in the positions is [[-1, -c], [p c, -p^2]].
    ends = sorted(brentq(lambda p: (1.0 - p * p) ** 2 - 4.0 * coupling**2 * p, *ab) for ab in ((0.8, 1.0), (1.0, 1.2)))
    found = find_crossings(symplectic(hamiltonian), 0.7, 1.2)
    assert found.status is SearchStatus.CONSERVATIVE
    assert summary(found) == [(PAIR, 4, 2), (PAIR, 4, -2)]
    assert places(found) == pytest.approx(ends, abs=1e-9)


def test_modes_of_one_signature_pass_through_each_other():
    found = find_crossings(symplectic(lambda p: np.diag([1.0, p, 1.0, p])), 0.7, 1.2)
    assert (found.status, found.crossings) == (SearchStatus.CONSERVATIVE, ())


def test_first_integrals_are_left_aside():
    jordan = np.array([[1.0, 1.0], [0.0, 1.0]])
    basis = np.random.default_rng(1).normal(size=(5, 5))
    inside = lambda p: block_diag(jordan, np.exp(p - 0.33), np.exp(p - 0.6) * turned(2.0))  # noqa: E731
    found = find_crossings(family(lambda p: basis @ inside(p) @ np.linalg.inv(basis), 1e-14), 0.0, 1.0)
    assert (found.status, summary(found)) == (SearchStatus.COMPLETE, [(PLUS, 1, 1), (PAIR, 2, 2)])
    assert places(found) == pytest.approx([0.33, 0.6], abs=1e-8)
    assert any("+1 throughout" in remark for remark in found.remarks)


def test_multipliers_sixty_orders_apart():
    found = find_crossings(diagonal(lambda p: 70.0, lambda p: p - 70.0, lambda p: p - 0.3), 0.0, 1.0)
    assert (found.status, summary(found)) == (SearchStatus.COMPLETE, [(PLUS, 1, 1)])
    assert places(found) == pytest.approx([0.3], rel=1e-14)


@pytest.mark.parametrize("order", list(itertools.permutations((0, 1, 2))))
def test_a_small_multiplier_beside_a_huge_one_keeps_its_digits(order):
    """Errors move it by parts of its own size, in whatever order the states came: on some processors rounding alone
    moved it to anywhere."""
    rates = np.array([70.0, -0.3, -70.0])
    spectra = Spectra(diagonal(*(lambda p, rate=rate: rate for rate in rates[list(order)])), 10)
    found = spectra.disturbed(np.array([0.0]))[0]
    np.testing.assert_allclose(np.log(np.abs(found)), np.broadcast_to(rates, found.shape), rtol=0.0, atol=1e-12)


def test_tiny_multipliers_say_nothing_of_pairs_on_the_circle():
    """Whether they are real or a pair, rounding decides; two real ones with product 1 are no pair either way."""

    def matrix(p):
        tiny = np.diag([1.0, -1.0]) if p < 0.5 else turned(1.0)
        return block_diag(-np.exp(p), -np.exp(0.1 - p), 1e-17 * tiny)

    spectra = Spectra(family(matrix), 10)
    spectra.at(np.array([0.1, 0.9]))
    assert spectra.without_pair(0.1, 0.9)


def test_signs_of_subnormal_numbers():
    signs, logs = symmetric(np.array([[1e-310j, -1e-310j, 0.5], [-1e-310, -0.5, -2e300]]), 0)
    np.testing.assert_array_equal(signs, [1.0, -1.0])
    np.testing.assert_allclose(logs, [np.log(0.5) + 2 * np.log(1e-310), np.log(1e-310) + np.log(1e300)], rtol=1e-13)


@pytest.mark.parametrize("left_out", [0, 1, 2])
def test_the_function_of_a_missing_matrix_is_not_known(left_out):
    terms = np.array([[np.nan + 0j] * 3, [1.0, 2.0, 3.0]])
    signs, logs = symmetric(terms, left_out)
    np.testing.assert_array_equal(np.isnan([signs, logs]), [[True, False]] * 2)


@pytest.mark.parametrize(("low", "width"), [(0.0, 1e-300), (-1e300, 2e300), (1e6, 1e-3), (-1e-310, 3e-310)])
def test_parameters_of_any_scale(low, width):
    middle = low + 0.37 * width
    found = find_crossings(diagonal(lambda p: p / width - middle / width), low, low + width)
    assert (found.status, summary(found)) == (SearchStatus.COMPLETE, [(PLUS, 1, 1)])
    assert places(found) == pytest.approx([middle], rel=1e-15)


def test_many_multipliers_are_counted():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 60, 60)) / np.sqrt(60.0) * np.array([0.7, 0.3])[:, None, None]
    found = find_crossings(lambda p: (a + p[:, None, None] * b, np.full(p.size, 1e-15)), 0.0, 2.5)
    counts = [(np.abs(np.linalg.eigvals(a + p * b)) > 1.0).sum() for p in (0.0, 2.5)]
    assert found.status is SearchStatus.COMPLETE
    assert len(found.crossings) > 1
    assert sum(crossing.change for crossing in found.crossings) == counts[1] - counts[0]


def test_a_spent_limit_is_said_alone():
    """Not as uncertain multipliers: too few matrices are known to tell which of them rest on the circle."""

    def matrices(values):
        if values.max() > 0.05:
            raise SpentError("spent")
        return diagonal(lambda p: 1e-9)(values)

    found = find_crossings(matrices, 0.0, 1.0, affordable=lambda: 0)
    assert found.status is SearchStatus.BUDGET
    assert not found.remarks


def test_errors_of_multipliers_end_with_the_time(monkeypatch):
    """They take long for many states."""
    asked = []

    def slowly(*args):
        asked.append(time.sleep(0.1))
        return disturbed(*args)

    monkeypatch.setattr("chilopod.stability.unit_circle.spectra.disturbed", slowly)
    with Deadline(0.05):
        found = find_crossings(diagonal(*[lambda p, k=k: 1e-6 * (p - k / 8.0) for k in range(8)]), 0.0, 1.0)
    assert found.status is SearchStatus.BUDGET
    assert len(asked) <= 5


@pytest.mark.parametrize(
    ("low", "high", "budget"), [(1.0, 0.0, 100), (0.0, 0.0, 100), (0.0, np.inf, 100), (np.nan, 1.0, 100)]
)
def test_bad_arguments_are_one_line(low, high, budget):
    with pytest.raises(ParameterError) as error:
        find_crossings(diagonal(lambda p: p), low, high, budget=budget)
    assert "\n" not in str(error.value)
