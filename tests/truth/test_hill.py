"""Hill's equations without damping: edges of the tongues where they are known, and collisions of Krein's kind."""

from math import pi

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipj, ellipk, mathieu_a, mathieu_b

from chilopod.stability import Kind, from_rhs, locate
from chilopod.stability.unit_circle.crossings import SearchStatus

ORIGIN = [0.0, 0.0]


def mathieu(q, damping=0.0):
    def rhs(t, y, a):
        return [y[1], -(a - 2.0 * q * np.cos(2.0 * t)) * y[0] - 2.0 * damping * y[1]]

    return lambda a: from_rhs(rhs, 2, pi, args=(a,), orbit=ORIGIN)


def check(found, expected, closest=1e-12):
    assert found.status is SearchStatus.CONSERVATIVE
    assert [point.kind for point in found] == [Kind.COLLISION] * len(expected)
    for point, value in zip(found, expected, strict=True):
        assert abs(point.value - value) <= point.error_bound + 4e-15 * abs(value)
        assert point.error_bound <= closest * max(1.0, abs(value))


@pytest.mark.parametrize(
    ("q", "low", "high"),
    [
        (0.3, -0.5, 10.0),
        (1.0, -0.5, 10.0),
        (5.0, -6.0, 10.0),
        (10.0, -15.0, 0.0),
        (20.0, -32.0, -31.0),
        (20.0, -32.0, 60.0),  # bands that are 1e-8 of the interval, between multipliers of 1e7
        (30.0, -52.0, 60.0),
    ],
)
def test_tongues_of_mathieu(q, low, high):
    values = [float(mathieu_a(n, q)) for n in range(8)] + [float(mathieu_b(n, q)) for n in range(1, 8)]
    check(locate(mathieu(q), (low, high)), sorted(value for value in values if low < value < high))


@pytest.mark.parametrize(("q", "low", "high"), [(30.0, -52.0, -30.0), (50.0, -90.0, -50.0), (100.0, -185.0, 0.0)])
def test_bands_of_mathieu_too_narrow_for_the_digits(q, low, high):
    """Multipliers of 1e10 and more: their partners are lost, and the edges of a band may be the same number."""
    values = np.array([mathieu_a(n, q) for n in range(8)] + [mathieu_b(n, q) for n in range(1, 8)])
    found = locate(mathieu(q), (low, high), normal_form=False)
    assert not found.complete
    assert any("no better than" in remark for remark in found.remarks)
    for point in found:
        assert np.abs(values - point.value).min() <= min(point.error_bound, 1e-9)


def test_tongues_of_mathieu_in_q():
    """Along q at a = 10: edges where a_n(q) or b_n(q) is 10, by bisection of scipy's."""
    edges = []
    for value in [lambda q, n=n: mathieu_a(n, q) - 10.0 for n in range(8)] + [
        lambda q, n=n: mathieu_b(n, q) - 10.0 for n in range(1, 8)
    ]:
        grid = np.linspace(0.1, 30.0, 300)
        signs = np.sign([value(q) for q in grid])
        edges += [brentq(value, *grid[i : i + 2], xtol=1e-14) for i in np.flatnonzero(signs[1:] != signs[:-1])]
    found = locate(lambda q: mathieu(q)(10.0), (0.1, 30.0))
    assert found.status is SearchStatus.CONSERVATIVE
    assert [point.value for point in found] == pytest.approx(sorted(edges), rel=1e-10)


def test_a_tongue_as_narrow_as_a_millionth():
    """q = 0.001, by the series of DLMF 28.6."""
    edges = [4.0 - 1e-6 / 12.0 + 5e-12 / 13824.0, 4.0 + 5e-6 / 12.0 - 763e-12 / 13824.0]
    check(locate(mathieu(1e-3), (3.9, 8.0)), edges)


@pytest.mark.parametrize("damping", [1e-2, 1e-3, 1e-5])
def test_hardly_damped(damping):
    """With y = exp(-d t) u it is u'' = -(a - d^2 - 2 q cos 2t) u, and -1 of y is -exp(d pi) of u: by bisection."""

    def excess(a):
        matrix = mathieu(0.3)(a - damping**2).flow(np.zeros(2), 0.0, pi)[1]
        return np.trace(matrix) + 2.0 * np.cosh(damping * pi)

    expected = [brentq(excess, *ends, xtol=1e-15, rtol=1e-15) for ends in ((0.5, 0.9), (1.1, 1.5))]
    found = locate(mathieu(0.3, damping), (0.2, 2.0))
    assert found.complete
    assert [point.kind for point in found] == [Kind.PERIOD_DOUBLING] * 2
    for point, value in zip(found, expected, strict=True):
        assert abs(point.value - value) <= point.error_bound + 1e-12
        assert point.error_bound < 1e-10


def test_damped_and_strongly_driven():
    """As above, for both signs of the multiplier, by a scan of the undamped trace."""
    q, damping = 20.0, 0.05

    def excess(a, sign):
        matrix = mathieu(q)(a - damping**2).flow(np.zeros(2), 0.0, pi)[1]
        return np.trace(matrix) - sign * 2.0 * np.cosh(damping * pi)

    found = locate(mathieu(q, damping), (-20.0, 30.0), normal_form=False)
    assert found.complete
    assert len(found) == 8
    for point in found:
        sign = -1.0 if point.kind is Kind.PERIOD_DOUBLING else 1.0
        reach = 1e-10
        assert excess(point.value - reach, sign) * excess(point.value + reach, sign) < 0.0
        assert point.error_bound < reach


@pytest.mark.parametrize("switches", [(), (pi / 2, 3 * pi / 2)], ids=["found", "declared"])
def test_tongues_of_meissner(switches):
    """Trace 2 cos v cos w - (v/w + w/v) sin v sin w, v and w the phases of the two halves."""

    def trace(a):
        v, w = np.sqrt(np.array([a + 0.2, a - 0.2], dtype=complex))
        return float((2 * np.cos(v * pi) * np.cos(w * pi) - (v / w + w / v) * np.sin(v * pi) * np.sin(w * pi)).real)

    grid = np.linspace(0.1, 3.0, 2001)
    expected = [
        brentq(lambda a, target=target: trace(a) - target, left, right, xtol=1e-15, rtol=1e-15)
        for target in (-2.0, 2.0)
        for left, right in zip(grid, grid[1:], strict=False)
        if (trace(left) - target) * (trace(right) - target) < 0.0
    ]
    assert len(expected) == 6

    def meissner(t, y, a):
        return [y[1], -(a + 0.2 * np.sign(np.cos(t))) * y[0]]

    known = {"orbit": ORIGIN, "switch_times": switches}
    found = locate(lambda a: from_rhs(meissner, 2, 2 * pi, args=(a,), **known), (0.1, 3.0))
    check(found, sorted(expected))


M = 0.5
K, K_OTHER = float(ellipk(M)), float(ellipk(1.0 - M))


def lame(order):
    """y'' = -(h - n (n + 1) m sn^2 t) y over the period 2 K, with the Fourier series of m sn^2 (DLMF 22.11).

    All but 2 n + 1 of its tongues are closed.
    """
    nome = np.exp(-pi * K_OTHER / K)
    waves = [2.0 * pi**2 / K**2 * j * nome**j / (1.0 - nome ** (2 * j)) for j in range(1, 14)]

    def rhs(t, y, h):
        well = 1.0 - ellipe(M) / K - sum(wave * np.cos(j * pi * t / K) for j, wave in enumerate(waves, 1))
        return [y[1], -(h - order * (order + 1) * well) * y[0]]

    return lambda h: from_rhs(rhs, 2, 2.0 * K, args=(h,), orbit=ORIGIN)


def turn(h):
    """Phase of the multiplier of Lame's equation of order one above its upper edge, h = 1 + m + m sc^2(b | 1 - m): by
    Jacobi's zeta function (Whittaker & Watson, section 23.71)."""
    slope = np.sqrt((h - 1.0 - M) / M)
    b = brentq(lambda b: np.divide(*ellipj(b, 1.0 - M)[:2]) - slope, 0.0, K_OTHER * (1 - 1e-9), xtol=1e-15)
    sn, cn, dn, angle = ellipj(b, 1.0 - M)
    zeta = ellipeinc(angle, 1.0 - M) - ellipe(1.0 - M) * b / K_OTHER
    return pi + 2.0 * K * (dn * sn / cn - zeta - pi * b / (2.0 * K * K_OTHER))


def test_the_phase_of_lame_by_integration():
    for h in (1.5001, 2.0, 5.0):
        matrix = lame(1)(h).flow(np.zeros(2), 0.0, 2.0 * K)[1]
        assert np.trace(matrix) == pytest.approx(2.0 * np.cos(turn(h)), abs=1e-12)


def test_edges_and_closed_tongues_of_lame():
    closed = [brentq(lambda h, n=n: turn(h) - n * pi, 1.51, 12.0, xtol=1e-14) for n in (2, 3)]
    check(locate(lame(1), (0.2, 12.0)), [M, 1.0, 1.0 + M, *closed], closest=1e-11)


def test_edges_of_lame_of_order_two():
    root = 2.0 * np.sqrt(1.0 - M + M * M)
    edges = [2.0 * (1.0 + M) - root, 1.0 + M, 1.0 + 4.0 * M, 4.0 + M, 2.0 * (1.0 + M) + root]
    check(locate(lame(2), (0.5, 7.0)), edges)


LEVEL, CHANGE = np.array([[1.0, 0.1], [0.1, 6.0]]), np.array([[0.4, 0.7], [0.7, -0.3]])
# p at which pairs of multipliers meet on the circle and leave it, or come back: zeros of the discriminant of the
# polynomial in nu + 1/nu, from exponentials to 40 digits.
KREIN = [(3.6, [1.326241225023442038, 2.490745450235232365]), (2.0, [1.083767961466998730])]


def two_springs(p, period):
    """x'' = -(A + p B) x for half the period, -(A - p B) x for the other."""

    def rhs(t, x):
        s = p * np.sign(np.sin(2.0 * pi * t / period))
        return [
            x[2],
            x[3],
            -(1.0 + 0.4 * s) * x[0] - (0.1 + 0.7 * s) * x[1],
            -(0.1 + 0.7 * s) * x[0] - (6.0 - 0.3 * s) * x[1],
        ]

    return from_rhs(rhs, 4, period, orbit=np.zeros(4))


def exact_map(p, period):
    halves = [
        expm(np.block([[np.zeros((2, 2)), np.eye(2)], [-(LEVEL + s * p * CHANGE), np.zeros((2, 2))]]) * period / 2.0)
        for s in (1.0, -1.0)
    ]
    return halves[1] @ halves[0]


@pytest.mark.parametrize(("period", "expected"), KREIN)
def test_krein_collisions(period, expected):
    found = locate(lambda p: two_springs(p, period), (0.2, 3.0))
    assert found.status is SearchStatus.CONSERVATIVE
    assert [point.kind for point in found] == [Kind.KREIN_COLLISION] * len(expected)
    for point, value in zip(found, expected, strict=True):
        assert abs(point.value - value) <= point.error_bound < 1e-10
        assert abs(abs(point.multiplier) - 1.0) < 1e-5
        # By exact exponentials: stable on one side only.
        beside = [np.abs(np.linalg.eigvals(exact_map(value + step, period))).max() for step in (-1e-3, 1e-3)]
        assert min(beside) < 1.0 + 1e-9
        assert max(beside) > 1.0 + 1e-3
