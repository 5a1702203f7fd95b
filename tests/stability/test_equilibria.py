"""Equilibria, their Hopf points and the cycles that leave these, against closed forms and plain second computations."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from chilopod.errors import AnalysisError, ParameterError
from chilopod.stability import (
    Criticality,
    Ending,
    Event,
    Kind,
    PeriodicSystem,
    begin,
    find_equilibrium,
    follow,
    from_map,
    from_rhs,
    locate,
    locate_hopf,
    switch,
)
from chilopod.stability.equilibria import has_centre
from helpers.systems import in_units, lorenz, lorenz_rhs

LORENZ_HOPF = 470.0 / 19.0
SUPER, SUB, UNDECIDED = Criticality.SUPERCRITICAL, Criticality.SUBCRITICAL, Criticality.UNDECIDED


def lorenz_state(r):
    side = np.sqrt(8.0 / 3.0 * (r - 1.0))
    return np.array([side, side, r - 1.0])


def brusselator(b, states=(1.0, 1.0), time=1.0):
    def rhs(t, x):
        square = x[0] * x[0] * x[1]
        return [1.0 + square - (b + 1.0) * x[0], b * x[0] - square]

    return from_rhs(in_units(rhs, states, time), 2, None, guess_period=6.0 * time)


def oscillator(mu, cubic=-1.0, linear=0.0):
    """x'' = -x + (mu + cubic x^2) x': l1 = cubic / 4 at mu = 0 (Guckenheimer & Holmes, 3.4.11)."""
    return from_rhs(
        lambda t, x: [x[1], -x[0] + (mu + linear * mu * x[0] + cubic * x[0] ** 2) * x[1]], 2, None, guess_period=6.0
    )


def turning(growth, turns, *others):
    """The plane with r' = growth r, which turns evenly, and other states; functions of the state and r^2."""

    def rhs(t, x):
        square = x[0] * x[0] + x[1] * x[1]
        rate = growth(x, square)
        return [rate * x[0] - turns * x[1], turns * x[0] + rate * x[1], *(each(x, square) for each in others)]

    return from_rhs(rhs, 2 + len(others), None, guess_period=2.0 * np.pi / turns)


def tensor_l1(a, b, c):
    """l1 of x' = a x + b(x, x) / 2 + c(x, x, x) / 6 at a Hopf point, by Kuznetsov's formula 5.39 on full tensors."""
    values, vectors = np.linalg.eig(a)
    index = int(np.argmin(np.abs(values.real) + 1e9 * (values.imag <= 0.0)))
    omega, q = values[index].imag, vectors[:, index]
    values, vectors = np.linalg.eig(a.T)
    p = vectors[:, int(np.argmin(np.abs(values + 1j * omega)))]
    p = p / np.conj(np.vdot(p, q))

    def two(u, v):
        return np.einsum("ijk,j,k", b, u, v)

    three = np.einsum("ijkl,j,k,l", c, q, q, q.conj())
    mean = np.linalg.solve(a, two(q, q.conj()))
    second = np.linalg.solve(2j * omega * np.eye(len(a)) - a, two(q, q))
    return float((np.vdot(p, three) - 2.0 * np.vdot(p, two(q, mean)) + np.vdot(p, two(q.conj(), second))).real) / (
        2.0 * omega
    )


def lorenz_tensors(r):
    x, y, z = lorenz_state(r)
    b = np.zeros((3, 3, 3))
    b[1, 0, 2] = b[1, 2, 0] = -1.0
    b[2, 0, 1] = b[2, 1, 0] = 1.0
    return np.array([[-10.0, 10.0, 0.0], [r - z, -1.0, -x], [y, x, -8.0 / 3.0]]), b, np.zeros((3, 3, 3, 3))


def brusselator_tensors():
    b, c = np.zeros((2, 2, 2)), np.zeros((2, 2, 2, 2))
    b[0, 0, 0], b[0, 0, 1], b[0, 1, 0] = 4.0, 2.0, 2.0  # of x^2 y at (1, 2)
    c[0, 0, 0, 1] = c[0, 0, 1, 0] = c[0, 1, 0, 0] = 2.0
    b[1], c[1] = -b[0], -c[0]
    return np.array([[1.0, 1.0], [-2.0, -1.0]]), b, c


def roessler(a):
    return from_rhs(lambda t, x: [-x[1] - x[2], x[0] + a * x[1], 0.2 + x[2] * (x[0] - 5.7)], 3, None, guess_period=6.0)


def langford(b):
    def rhs(t, x):
        r = x[0] ** 2 + x[1] ** 2
        return [
            (x[2] - b) * x[0] - 3.5 * x[1],
            3.5 * x[0] + (x[2] - b) * x[1],
            0.6 + 0.95 * x[2] - x[2] ** 3 / 3.0 - r * (1.0 + 0.25 * x[2]) + 0.1 * x[2] * x[0] ** 3,
        ]

    return from_rhs(rhs, 3, None, guess_period=1.8)


def folding(mu):
    def rhs(t, x):
        return [x[1], -x[0] + (mu + 0.5) * x[1] - x[0] ** 2 * x[1], 0.8 - mu - x[2] ** 2]

    return from_rhs(rhs, 3, None, guess_period=6.0)


def resting(m):
    return from_rhs(lambda t, x: [x[1], m * x[1]], 2, None, guess_period=1.0)


class TestEquilibrium:
    @pytest.mark.parametrize("r", [2.0, 20.0, 28.0])
    def test_lorenz_is_at_the_closed_form_with_the_eigenvalues_of_the_plain_matrix(self, r):
        found = find_equilibrium(lorenz(r), lorenz_state(r) * [1.2, 0.9, 1.1])
        assert (np.abs(found.state - lorenz_state(r)) <= found.error).all()
        assert (found.error <= 1e-12 * r).all()
        plain = np.linalg.eigvals(lorenz_tensors(r)[0])
        for value, bound in zip(found.eigenvalues, found.error_bounds, strict=True):
            assert np.abs(plain - value).min() <= bound <= 1e-10
        assert found.stable is (r < LORENZ_HOPF)

    def test_from_afar_newton_is_damped(self):
        # Undamped from 3 the arctangent throws Newton's method farther out at every step.
        found = find_equilibrium(from_rhs(lambda t, x: [-np.arctan(x[0] - 0.5)], 1, None, guess_period=1.0), [3.5])
        assert found.state == pytest.approx([0.5], abs=1e-15)
        assert found.stable

    def test_at_the_origin_it_is_exactly_zero(self):
        found = find_equilibrium(oscillator(-0.3), [0.3, -0.2])
        assert (found.state == 0.0).all()
        assert found.stable

    def test_its_stability_is_printed(self):
        assert "    stable=True\n)" in str(find_equilibrium(oscillator(-0.3), [0.3, -0.2]))

    def test_on_the_axis_nothing_is_claimed(self):
        assert find_equilibrium(oscillator(0.0), [0.1, 0.0]).stable is None
        assert find_equilibrium(lorenz(LORENZ_HOPF), lorenz_state(24.7)).stable is None

    @pytest.mark.parametrize("power", [2, 3])
    def test_a_degenerate_one_is_found_beside_a_decay(self, power):
        """Newton's method comes nearer by a constant factor, until the derivative is singular."""
        found = find_equilibrium(from_rhs(lambda t, x: [x[0] ** power, -x[1]], 2, None, guess_period=1.0), [0.3, 0.2])
        assert abs(found.state[0]) < 1e-6
        assert (found.error == np.inf).all()
        assert found.stable is None

    @pytest.mark.parametrize("least", [1.0, 1e-9])
    def test_where_there_is_almost_one_none_is_found(self, least):
        system = from_rhs(lambda t, x: [(x[0] - 1.0) ** 2 + least, -x[1]], 2, None, guess_period=1.0)
        with pytest.raises(AnalysisError, match="no equilibrium found near the guess"):
            find_equilibrium(system, [1.1, 0.2])

    def test_a_singular_one_is_undecided(self):
        found = find_equilibrium(from_rhs(lambda t, x: [x[1], -x[1]], 2, None, guess_period=1.0), [0.1, 0.2])
        assert found.stable is None
        assert np.isinf(found.error).all()

    @pytest.mark.parametrize("units", [(1e6, 1e-6), (1e-6, 1e6)])
    @pytest.mark.parametrize("time", [1e-6, 1e6])
    def test_units_do_not_matter(self, units, time):
        found = find_equilibrium(brusselator(1.5, units, time), np.array([1.3, 1.0]) * units)
        assert found.state / units == pytest.approx([1.0, 1.5], rel=1e-14)
        assert found.eigenvalues * time == pytest.approx(np.roots([1.0, 0.5, 1.0]), rel=1e-12)

    def test_without_a_trace_derivatives_are_differences_with_errors(self):
        def velocity(x):
            return np.array(lorenz_rhs(0.0, x, 20.0))

        system = PeriodicSystem(3, None, lambda x, t0, t1: (x, np.eye(3)), velocity=velocity, guess_period=0.65)
        found, traced = (find_equilibrium(each, [7.0, 7.0, 18.0]) for each in (system, lorenz(20.0)))
        assert (np.abs(found.state - lorenz_state(20.0)) <= found.error).all()
        assert (np.abs(found.eigenvalues - traced.eigenvalues) <= found.error_bounds).all()
        assert (found.error_bounds < 1e-9).all()


class TestHopf:
    def test_lorenz(self):
        found = locate_hopf(lorenz, (20.0, 30.0), [7.0, 7.0, 19.0])
        assert found.complete
        (point,) = found
        assert point.kind is Kind.HOPF
        assert abs(point.value - LORENZ_HOPF) <= point.error_bound <= 1e-9
        assert abs(point.value - LORENZ_HOPF) <= 2e-12
        assert point.criticality is SUB
        # Of the characteristic polynomial at the point omega^2 = b (sigma + r).
        assert point.frequency == pytest.approx(np.sqrt(8.0 / 3.0 * (10.0 + LORENZ_HOPF)), rel=1e-12)
        assert abs(point.coefficient - tensor_l1(*lorenz_tensors(LORENZ_HOPF))) <= max(
            point.coefficient_error, 1e-11 * point.coefficient
        )

    def test_brusselator(self):
        (point,) = locate_hopf(brusselator, (1.0, 3.0), [1.0, 1.0])
        assert abs(point.value - 2.0) <= min(point.error_bound, 1e-13)
        assert point.frequency == pytest.approx(1.0, rel=1e-13)
        assert point.rate.real == pytest.approx(0.5, rel=1e-8)
        assert point.coefficient == pytest.approx(tensor_l1(*brusselator_tensors()), rel=1e-12)
        assert point.criticality is SUPER

    def test_roessler(self):
        # The coefficients c of s^3 + c2 s^2 + c1 s + c0 have c2 c1 = c0 at the point: by bisection.
        def equilibrium(a):
            x = (5.7 - np.sqrt(5.7**2 - 0.8 * a)) / 2.0
            return x, -x / a, x / a

        def matrix(a):
            x, _, z = equilibrium(a)
            return np.array([[0.0, -1.0, -1.0], [1.0, a, 0.0], [z, 0.0, x - 5.7]])

        def routh(a):
            _, c2, c1, c0 = np.poly(matrix(a))
            return c2 * c1 - c0

        low, high = 1e-3, 0.05
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if routh(low) * routh(middle) > 0.0 else (low, middle)
        (point,) = locate_hopf(roessler, (-0.4, 0.5), [0.0, 0.1, 0.1])
        assert point.value == pytest.approx(low, abs=1e-11)
        assert point.frequency == pytest.approx(np.abs(np.linalg.eigvals(matrix(low)).imag).max(), rel=1e-11)
        b = np.zeros((3, 3, 3))
        b[2, 0, 2] = b[2, 2, 0] = 1.0
        assert point.coefficient == pytest.approx(tensor_l1(matrix(low), b, np.zeros((3, 3, 3, 3))), rel=1e-8)
        assert point.criticality is SUPER

    def test_langford(self):
        # On the axis z = b, a root of 0.6 + 0.95 z - z^3 / 3; s = 0.95 - b^2. Radius: r' = (z - b) r, and with
        # z - b = w r^2 where s w = 1 + b / 4 it is r' = w r^3 for slow r; r^2 = 2 |amplitude|^2.
        (b,) = [root.real for root in np.roots([-1.0 / 3.0, 0.0, 0.95, 0.6]) if root.real > 1.0]
        (point,) = locate_hopf(langford, (0.5, 3.0), [0.0, 0.0, 2.0])
        assert point.value == pytest.approx(b, abs=1e-12)
        assert point.frequency == pytest.approx(3.5, rel=1e-13)
        assert point.coefficient == pytest.approx(2.0 * (1.0 + 0.25 * b) / (0.95 - b * b) / 3.5, rel=1e-11)
        assert point.rate == pytest.approx(-1.0, abs=1e-9)
        (start,) = switch(langford, point)
        assert start.rising is False
        branch = follow(langford, start, (0.5, 3.0), points=4)
        assert branch.points[-1].value < start.value < point.value
        assert branch.points[-1].stable

    @pytest.mark.parametrize("cubic", [-1.0, 1.0])
    def test_van_der_pol_either_way(self, cubic):
        (point,) = locate_hopf(lambda mu: oscillator(mu, cubic), (-1.0, 1.5), [0.1, 0.0])
        assert abs(point.value) <= point.error_bound <= 1e-12
        assert abs(point.coefficient - cubic / 4.0) <= point.coefficient_error <= 1e-12
        assert point.criticality is (SUPER if cubic < 0.0 else SUB)

    @pytest.mark.parametrize("between", [(-1.0, 1.5), (-0.7, 0.3), (-0.123, 2.0)])
    def test_a_coefficient_that_vanishes_there_is_undecided(self, between):
        def classic(mu):
            return from_rhs(lambda t, x: [x[1], -x[0] + mu * (1.0 - x[0] ** 2) * x[1]], 2, None, guess_period=6.0)

        (point,) = locate_hopf(classic, between, [0.1, 0.0])
        assert point.criticality is UNDECIDED
        with pytest.raises(ParameterError, match="side of its cycles"):
            switch(classic, point)

    @settings(max_examples=12, deadline=None)
    @given(
        alpha=st.sampled_from([-2.0, -0.3, 0.7, 5.0]),
        beta=st.floats(-5.0, 5.0),
        omega=st.sampled_from([0.01, 1.0, 37.0]),
        angle=st.floats(0.0, 3.0),
        scale=st.sampled_from([1e-6, 1.0, 1e6]),
        time=st.sampled_from([1e-6, 1.0, 1e6]),
    )
    def test_a_normal_form_in_other_coordinates(self, alpha, beta, omega, angle, scale, time):
        """z' = (p + i omega) z + (alpha + i beta) z |z|^2, y = S R (x + a quadratic change): l1 by the length of q."""
        c, s = np.cos(angle), np.sin(angle)
        stretch = np.array([1.0, 3.0]) * scale
        turn = np.array([[c, -s], [s, c]])

        def family(p):
            def rhs(t, y):
                u, v = y[0] / stretch[0], y[1] / stretch[1]
                a, b = c * u + s * v, -s * u + c * v
                # a = h - 0.4 k^2, b = k undo the change h = a + 0.4 b^2
                h = a + 0.4 * b * b
                r = h * h + b * b
                dh = p * h - omega * b + (alpha * h - beta * b) * r
                db = p * b + omega * h + (alpha * b + beta * h) * r
                da = dh - 0.8 * b * db
                return [stretch[0] * (c * da - s * db) / time, stretch[1] * (s * da + c * db) / time]

            return from_rhs(rhs, 2, None, guess_period=6.0 * time / omega)

        (point,) = locate_hopf(family, (-0.3 * omega, 0.4 * omega), np.zeros(2))
        mode = stretch[:, None] * turn @ np.array([1.0, -1.0j]) / 2.0  # state = 2 Re(z mode)
        exact = alpha / omega / float(np.linalg.norm(mode) ** 2)
        assert abs(point.value) <= point.error_bound <= 1e-10 * omega
        assert point.frequency == pytest.approx(omega / time, rel=1e-12)
        assert abs(point.coefficient - exact) <= point.coefficient_error + 1e-13 * abs(exact)
        assert point.coefficient == pytest.approx(exact, rel=1e-8)

    @pytest.mark.parametrize("seed", [0, 2, 9, 37, 43])
    def test_random_systems_have_the_points_of_a_fine_sweep(self, seed):
        """x' = (A + p A') x + cubic polynomial, in units of 1e-6 to 1e6: none more, none less, l1 by tensors."""
        random = np.random.default_rng(seed)
        n = int(random.integers(2, 6))
        a, slope = random.normal(size=(n, n)), 0.5 * random.normal(size=(n, n))
        b, c = random.normal(size=(n, n, n)), random.normal(size=(n, n, n, n))
        b = (b + b.transpose(0, 2, 1)) / 2.0
        c = sum(c.transpose(0, *(1 + np.array(order))) for order in itertools.permutations(range(3))) / 6.0
        units = 10.0 ** random.integers(-6, 7, size=n)

        def family(p):
            def rhs(t, x):
                y = x / units
                two = (y[:, None] * y).ravel()
                three = (two[:, None] * y).ravel()
                return units * ((a + p * slope) @ y + b.reshape(n, -1) @ two / 2.0 + c.reshape(n, -1) @ three / 6.0)

            return from_rhs(rhs, n, None, guess_period=6.0)

        found = locate_hopf(family, (-1.0, 1.3), np.zeros(n))
        assert found.complete
        values = np.linspace(-1.0, 1.3, 20001)
        unstable = (np.linalg.eigvals(a + values[:, None, None] * slope).real > 0.0).sum(axis=1)
        swept = values[:-1][np.abs(np.diff(unstable)) == 2]
        assert [point.value for point in found] == pytest.approx(swept, abs=2e-4)
        for point in found:
            matrix = a + point.value * slope
            here, modes = np.linalg.eig(matrix)
            critical = int(np.abs(here - 1j * point.frequency).argmin())
            assert abs(here[critical].real) <= abs(point.rate.real) * point.error_bound
            length = np.linalg.norm(units * modes[:, critical]) / np.linalg.norm(modes[:, critical])
            exact = tensor_l1(matrix, b, c) / length**2
            assert abs(point.coefficient - exact) <= point.coefficient_error + 1e-9 * abs(exact)

    def test_the_map_over_some_time_says_the_same(self):
        # The same function as one with a period: a Neimark-Sacker point of the flow over that time.
        time = 0.11
        (point,) = locate_hopf(lorenz, (20.0, 30.0), [7.0, 7.0, 19.0])
        (other,) = locate(lambda r: from_rhs(lorenz_rhs, 3, time, args=(r,)), (20.0, 30.0), lorenz_state(20.0))
        assert other.value == pytest.approx(point.value, abs=other.error_bound + point.error_bound)
        assert other.frequency == pytest.approx(point.frequency, rel=1e-11)
        assert other.coefficient == pytest.approx(point.coefficient * point.frequency * time, rel=1e-5)

    def test_two_of_them_and_one_that_only_touches(self):
        def both(mu):
            def rhs(t, x):
                first = -x[0] + mu * x[1] - x[0] ** 2 * x[1]
                return [x[1], first, x[3], -4.0 * x[2] + (mu - 0.3) * x[3] + x[2] ** 2 * x[3] + x[0] * x[1]]

            return from_rhs(rhs, 4, None, guess_period=6.0)

        found = locate_hopf(both, (-1.0, 1.5), [0.1, 0.0, 0.0, 0.0])
        assert found.complete
        assert [point.value for point in found] == pytest.approx([0.0, 0.3], abs=1e-12)
        assert [point.criticality for point in found] == [SUPER, SUB]
        (touch,) = touching = locate_hopf(lambda mu: oscillator(-mu * mu), (-1.0, 1.5), [0.1, 0.0])
        assert not touch.criticality.known
        assert any("touches" in remark for remark in touching.remarks)

    @pytest.mark.parametrize("gap", [0.0, 1e-8, 1e-6])
    def test_a_touch_that_may_be_two_crossings_leaves_the_search_incomplete(self, gap):
        found = locate_hopf(
            lambda m: turning(lambda x, square: m * m - gap * gap - square, 1.0), (-1.0, 1.1), [0.0, 0.0]
        )
        assert found.status.label == "incomplete"
        assert all(abs(abs(point.value) - gap) <= point.error_bound for point in found)
        assert any("touches the imaginary axis, or crosses it twice" in remark for remark in found.remarks)

    def test_a_pair_that_passes_zero_leaves_the_search_incomplete(self):
        """Eigenvalues m (1 +- i sqrt 3) / 2: two become unstable, and their frequency at 0 is 0."""

        def family(m):
            return from_rhs(
                lambda t, x: [x[1], -m * m * x[0] + m * x[1] - x[0] ** 2 - x[0] * x[1]], 2, None, guess_period=6.0
            )

        found = locate_hopf(family, (-1.0, 1.0), [0.0, 0.0])
        assert len(found) == 0
        assert not found.complete
        assert any("a pair of eigenvalues passes zero" in remark for remark in found.remarks)

    def test_two_real_eigenvalues_that_pass_zero_together_are_counted(self):
        def family(m):
            return from_rhs(lambda t, x: [m * x[0] - x[0] ** 3, m * x[1] - x[1] ** 3], 2, None, guess_period=6.0)

        found = locate_hopf(family, (-1.0, 1.0), [0.0, 0.0])
        assert found.complete
        assert any(remark.startswith("2 eigenvalues are zero") for remark in found.remarks)

    def test_a_double_pair_has_no_coefficient(self):
        def twice(mu):
            return from_rhs(
                lambda t, x: [
                    x[1], -x[0] + mu * x[1] - x[0] ** 2 * x[1], x[3], -x[2] + mu * x[3] - x[2] ** 2 * x[3]
                ], 4, None, guess_period=6.0,
            )  # fmt: skip

        found = locate_hopf(twice, (-1.0, 1.5), [0.1, 0.0, 0.0, 0.0])
        (point,) = found
        assert point.multiplicity == 4
        assert not point.criticality.known
        assert any("2 pairs" in remark for remark in found.remarks)
        with pytest.raises(ParameterError, match="2 pairs critical at once; allowed: a state on a cycle"):
            switch(twice, point)

    @pytest.mark.parametrize(
        ("family", "between", "guess", "values", "said"),
        [
            (folding, (-1.0, 1.5), [0.1, 0.0, 1.0], [-0.5], ["fold", "0.8"]),
            (lorenz, (0.5, 3.0), np.zeros(3), [], ["an eigenvalue is zero at 1:"]),
            (resting, (-2.0, -1.0), [0.1, 0.2], [], ["an eigenvalue is 0 throughout"]),
        ],
    )
    def test_where_equilibria_end_or_meet_or_are_not_alone_is_said(self, family, between, guess, values, said):
        found = locate_hopf(family, between, guess)
        assert [point.value for point in found] == pytest.approx(values, abs=1e-12)
        assert any(all(words in remark for words in said) for remark in found.remarks)

    def test_without_a_trace(self):
        def family(r):
            def rhs(t, x, r):
                return np.array(lorenz_rhs(t, x, r)) if x[0] < 1e9 else np.zeros(3)

            return from_rhs(rhs, 3, None, args=(r,), guess_period=0.65)

        (point,) = locate_hopf(family, (24.0, 25.0), lorenz_state(24.0))
        assert abs(point.value - LORENZ_HOPF) <= point.error_bound <= 1e-8
        exact = tensor_l1(*lorenz_tensors(LORENZ_HOPF))
        assert abs(point.coefficient - exact) <= point.coefficient_error <= 1e-4 * exact


class TestCycles:
    @pytest.mark.parametrize("cubic", [-1.0, 1.0])
    def test_amplitude_and_period_near_the_point(self, cubic):
        def family(mu):
            return oscillator(mu, cubic)

        (point,) = locate_hopf(family, (-1.0, 1.5), [0.1, 0.0])
        (start,) = switch(family, point)
        assert start.rising is (cubic < 0.0)
        assert (start.value > 0.0) is (cubic < 0.0)
        branch = follow(family, start, (-1.0, 1.5), points=8, longest=0.03)
        for each in branch.points:
            # x = A cos t: A^2 = 4 mu / -cubic to leading order, in x and y alike.
            assert float(each.orbit @ each.orbit) == pytest.approx(
                -4.0 * each.value / cubic, rel=abs(each.value) + 1e-6
            )
            assert each.period == pytest.approx(2.0 * np.pi, rel=each.value**2 / 8.0 + 1e-9)
            assert each.stable is (cubic < 0.0)
        assert abs(branch.points[-1].value) > 2.0 * abs(branch.points[0].value)

    def test_lorenz_goes_down_and_unstable(self):
        (point,) = locate_hopf(lorenz, (20.0, 30.0), [7.0, 7.0, 19.0])
        (start,) = switch(lorenz, point)
        branch = follow(lorenz, start, (20.0, 30.0), points=6)
        values = np.array([each.value for each in branch.points])
        assert (np.diff(values) < 0.0).all()
        assert (values < LORENZ_HOPF).all()
        assert all(each.stable is False for each in branch.points)
        # The multiplier leaves 1 by twice the growth rate of the equilibrium the other way: 1 + 2 rate T (rH - r).
        first = branch.points[0]
        growth = 2.0 * point.rate.real * (LORENZ_HOPF - first.value) * first.period
        assert first.multipliers[0].real - 1.0 == pytest.approx(growth, rel=0.02)
        assert first.period == pytest.approx(point.period, rel=1e-3)

    @pytest.mark.parametrize("units", [(1e6, 1e-6), (1e-6, 1e6), (1.0, 1.0)])
    @pytest.mark.parametrize("time", [1e-6, 1.0, 1e6])
    def test_units_do_not_matter(self, units, time):
        def family(b):
            return brusselator(b, units, time)

        (point,) = locate_hopf(family, (1.0, 3.0), np.array([1.0, 1.0]) * units)
        assert abs(point.value - 2.0) <= point.error_bound <= 1e-10
        (start,) = switch(family, point)
        assert start.rising
        assert 2.0 + 1e-6 < start.value < 2.001
        # The same cycle in plain units, by the value of the parameter alone.
        plain = begin(brusselator, start.value, start.orbit / units)
        assert start.period / time == pytest.approx(plain.period, rel=1e-9)
        branch = follow(family, start, (1.0, 3.0), points=4)
        assert branch.points[-1].value > start.value
        assert branch.points[-1].stable

    @pytest.mark.parametrize(("turns", "width"), [(10.0, 0.5), (1e3, 0.5), (1e3, 10.0), (1e4, 0.5)])
    def test_growth_that_is_slow_beside_the_turns_hides_no_bifurcation(self, turns, width):
        """r^2 = m; the rest z = 0 of z' = (r^2 - 0.05) z - z^3 loses stability at 0.05, in a pitchfork of cycles."""

        def family(m):
            assert abs(m) <= width
            return turning(lambda x, square: m - square, turns, lambda x, square: (square - 0.05) * x[2] - x[2] ** 3)

        (point,) = locate_hopf(family, (-width, width), np.zeros(3))
        (start,) = switch(family, point)
        assert 0.0 < start.value <= 0.01 * width
        cycles = follow(family, start, (-width, width))
        assert cycles.ending is Ending.LEFT_INTERVAL
        (fork,) = cycles.special_points
        assert fork.special is Kind.PITCHFORK
        assert fork.value == pytest.approx(0.05, abs=1e-10)
        assert cycles.points[0].stable

    @pytest.mark.parametrize("coefficient", [-0.01, 0.01])
    def test_a_term_of_fifth_order_that_soon_matters(self, coefficient):
        def family(m):
            return turning(lambda x, square: m + coefficient * square - square * square, 1e3)

        (point,) = locate_hopf(family, (-1.0, 1.0), np.zeros(2))
        (start,) = switch(family, point)
        cycles = follow(family, start, (-1.0, 1.0))
        assert cycles.ending is Ending.LEFT_INTERVAL
        folds = [each.value for each in cycles.special_points if each.special is Kind.FOLD]
        assert folds == pytest.approx([-(coefficient**2) / 4.0] * (coefficient > 0.0), abs=1e-10)

    @pytest.mark.parametrize(
        ("rhs", "n", "said"),
        [
            (lambda t, x, m: [x[1], -4.0 * x[0] + (m - x[0] ** 2) * x[1]], 2, "must be a Hopf point of this family"),
            (
                lambda t, x, m: [x[1] - 2.0, -x[0] + m * (x[1] - 2.0) - x[0] ** 3],
                2,
                "must be a Hopf point of this family",
            ),
            (lambda t, x, m: [x[1], -x[0] + (m - x[0] ** 2) * x[1], -x[2]], 3, r"wrong shape \(2,\); allowed: \(3,\)"),
        ],
    )
    def test_the_point_of_another_family_is_refused(self, rhs, n, said):
        (point,) = locate_hopf(oscillator, (-1.0, 1.5), [0.1, 0.0])
        with pytest.raises(ParameterError, match=said):
            switch(lambda m: from_rhs(rhs, n, None, args=(m,), guess_period=6.0), point)

    def test_cycles_beyond_the_searched_interval_are_refused(self):
        (point,) = locate_hopf(oscillator, (-1.0, 0.0), [0.1, 0.0])
        with pytest.raises(ParameterError, match="at an end of the searched interval, beyond which its cycles lie"):
            switch(oscillator, point)


class TestRefusals:
    @pytest.mark.parametrize(
        ("family", "guess", "kind", "said"),
        [
            (lambda m: from_rhs(lambda t, x: [x[1] ** 2 + 1.0, x[0]], 2, None, guess_period=1.0), [0.1, 0.0],
             AnalysisError, "no equilibrium found"),
            (lambda m: from_rhs(lambda t, x: [x[1], -x[0] + np.cos(t)], 2, 2 * np.pi), [0.1, 0.0],
             ParameterError, "must be a flow that does not depend on time; allowed: period=None, and no t in"),
            (lambda m: from_map(lambda x: (m * x, [[m]]), 1), [0.1],
             ParameterError, "must be a flow .*; a map has no equilibria: use `find_orbit` or `locate`"),
            (oscillator, [np.nan, 0.0], ParameterError, "must be finite"),
            (oscillator, [0.0], ParameterError, "wrong shape"),
            (oscillator, "here", ParameterError, "must be numbers"),
            (lambda m: from_rhs(lambda t, x: [x[1], -x[0] + m * x[1] - abs(x[1]) * x[1]], 2, None, guess_period=6.0),
             [0.1, 0.0], AnalysisError, "switching surface"),
            (lambda m: from_rhs(lambda t, x: [np.log(x[0])], 1, None, guess_period=1.0), [-1.0],
             AnalysisError, "not finite"),
            (lambda m: 1 / 0, [0.0], AnalysisError, "ZeroDivisionError"),
        ],
    )  # fmt: skip
    def test_bad_input_is_one_line(self, family, guess, kind, said):
        with pytest.raises(kind, match=said) as raised:
            locate_hopf(family, (-1.0, 1.0), guess)
        assert "\n" not in str(raised.value)

    def test_a_family_that_fails_on_the_way_is_a_remark(self):
        def failing(mu):
            if mu > 0.5:
                raise ValueError("too much")
            return oscillator(mu)

        found = locate_hopf(failing, (-1.0, 1.5), [0.0, 0.0])
        assert not found.complete
        assert len(found) == 1
        assert any("too much" in remark for remark in found.remarks)

    @pytest.mark.parametrize("off", [0.0, 1e-9, 1e-3])
    @pytest.mark.parametrize("r", [20.0, 24.0])
    def test_an_orbit_is_not_begun_at_an_equilibrium(self, r, off):
        with pytest.raises(AnalysisError, match=r"is an equilibrium, not an orbit.*locate_hopf") as raised:
            begin(lorenz, r, lorenz_state(r) * (1.0 + off * np.array([1.0, -0.5, 0.3])))
        assert "\n" not in str(raised.value)

    def test_other_failures_to_begin_are_said_as_before(self):
        with pytest.raises(AnalysisError) as raised:
            begin(lorenz, 20.0, [1.0, 30.0, -40.0])
        assert "equilibrium, not" not in str(raised.value)


def test_a_cycle_is_followed_in_steps_of_the_size_it_grows_to():
    """The size of the first cycle is 0.017, that of the last one 0.85."""

    def lure(alpha):
        return from_rhs(lambda t, x: [x[1], x[2], -alpha * x[2] - x[1] - x[0] + x[0] ** 2], 3, None, guess_period=6.0)

    (hopf,) = locate_hopf(lure, (0.5, 1.5), [0.0, 0.0, 0.0])
    assert abs(hopf.value - 1.0) <= hopf.error_bound < 1e-12
    (start,) = switch(lure, hopf)
    cycles = follow(lure, start, (0.56, 1.5))
    assert cycles.ending is Ending.LEFT_INTERVAL
    assert len(cycles.points) < 25
    (doubling,) = cycles.special_points
    assert doubling.special is Kind.PERIOD_DOUBLING
    assert doubling.value == pytest.approx(0.63030200616, abs=1e-10)


def test_the_oregonator_over_a_wide_interval():
    """Its equilibrium passes another one at a distance of 0.08 near f = 1, in a twentieth of the interval."""
    eps, delta, q = 0.04, 4e-4, 8e-4

    def rhs(t, x, f):
        first = (q * x[1] - x[0] * x[1] + x[0] * (1 - x[0])) / eps
        return [first, (-q * x[1] - x[0] * x[1] + f * x[2]) / delta, x[0] - x[2]]

    def growth(f):
        x = 0.5 * (1 - f - q + np.sqrt((1 - f - q) ** 2 + 4 * q * (1 + f)))
        y = f * x / (q + x)
        matrix = [
            [(1 - 2 * x - y) / eps, (q - x) / eps, 0.0],
            [-y / delta, -(q + x) / delta, f / delta],
            [1.0, 0.0, -1.0],
        ]
        return np.sort(np.linalg.eigvals(matrix).real)[-1]

    found = locate_hopf(lambda f: from_rhs(rhs, 3, None, args=(f,), guess_period=5.0), (0.3, 2.8), [0.7, 0.3, 0.7])
    assert found.complete
    expected = [brentq(growth, *each, xtol=1e-12) for each in ((0.45, 0.6), (2.1, 2.4))]
    assert [point.value for point in found] == pytest.approx(expected, abs=1e-9)
    assert all(
        abs(point.value - value) <= point.error_bound + 1e-11 for point, value in zip(found, expected, strict=True)
    )


def test_hopf_points_are_found_where_growth_soon_exceeds_all_numbers():
    def family(a):
        return from_rhs(lambda t, x: [a * x[0] - x[1] - x[0] ** 3, x[0] + a * x[1]], 2, None, guess_period=6.0)

    found = locate_hopf(family, (-1.0, 200.0), [0.0, 0.0])
    assert found.complete
    assert found.searched == (-1.0, 200.0)
    assert [abs(point.value) <= point.error_bound for point in found] == [True]


def test_a_rotation_that_is_slow_beside_the_decay_costs_no_more():
    """A radian of it is 1000 s, in which what decays at 0.4/s at one end of the interval would grow by e^400."""

    def slow(mu):
        def rhs(t, x):
            grown = mu - x[0] ** 2 - x[1] ** 2
            return [grown * x[0] - 1e-3 * x[1], 1e-3 * x[0] + grown * x[1]]

        return from_rhs(rhs, 2, None, guess_period=6.0)

    found = locate_hopf(slow, (-0.4, 0.4), [0.0, 0.0])
    assert found.complete
    assert found.evaluations < 200
    assert not found.remarks
    (point,) = found
    assert abs(point.value) <= point.error_bound < 1e-15
    assert abs(point.coefficient + 2000.0) <= point.coefficient_error < 1e-9


def test_a_point_on_the_border_of_two_parts_of_an_interval_is_listed_once():
    """The first part of an interval from 1 ends at 3.7."""
    (point,) = found = locate_hopf(lambda p: oscillator(p - 3.7), (1.0, 9.0), [0.0, 0.0])
    assert found.complete
    assert abs(point.value - 3.7) <= point.error_bound < 1e-9


@pytest.mark.parametrize("between", [(0.01, 1000.0), (0.5, 30.0)])
def test_the_brusselator_over_decades(between):
    def family(b):
        return from_rhs(
            lambda t, x: [1 - (b + 1) * x[0] + x[0] ** 2 * x[1], b * x[0] - x[0] ** 2 * x[1]], 2, None, guess_period=6.0
        )

    found = locate_hopf(family, between, [1.0, between[0]])
    assert found.complete
    assert found.searched == between
    assert [abs(point.value - 2.0) <= point.error_bound < 1e-9 for point in found] == [True]


def uncoupled(p, other):
    """Three oscillators of the frequencies 1, 1.7 and 2.3 with Hopf points at 1, 1 and another value."""

    def rhs(t, x):
        rates = []
        for k, (at, frequency) in enumerate(((1.0, 1.0), (1.0, 1.7), (other, 2.3))):
            a, b = x[2 * k], x[2 * k + 1]
            growth = p - at - a * a - b * b
            rates += [growth * a - frequency * b, frequency * a + growth * b]
        return rates

    return from_rhs(rhs, 6, None, guess_period=6.0)


@pytest.mark.parametrize("other", [1.1, 1.3, 1.6])
def test_two_pairs_that_cross_together_hide_no_third(other):
    found = locate_hopf(lambda p: uncoupled(p, other), (0.3, 2.0), np.zeros(6))
    assert found.complete
    assert [point.value for point in found] == pytest.approx([1.0, other], abs=1e-12)
    assert all(point.error_bound < 1e-12 for point in found)
    assert [point.multiplicity for point in found] == [4, 2]


def test_hopf_points_of_a_ring_of_36():
    """Lorenz 96 at rest: F = 1 / (cos a - cos 2a) at a = 2 pi j / 36, of which two are 1."""

    def ring(force):
        return from_rhs(
            lambda t, x: (np.roll(x, -1) - np.roll(x, 2)) * np.roll(x, 1) - x + force, 36, None, guess_period=2.0
        )

    angles = 2.0 * np.pi * np.arange(1, 18) / 36.0
    rates = np.cos(angles) - np.cos(2.0 * angles)
    expected = sorted({round(1.0 / rate, 12) for rate in rates if rate > 0.5})
    found = locate_hopf(ring, (0.3, 2.0), np.full(36, 0.3))
    assert found.complete
    for point, value in zip(found, expected, strict=True):
        assert abs(point.value - value) <= point.error_bound + 1e-12
        assert point.error_bound < 1e-10


def test_a_small_cycle_surrounds_an_equilibrium_that_oscillates_with_its_period():
    """Not so a spiking motion that is slow where no equilibrium is, or near one of another kind."""
    oscillator = from_rhs(lambda t, x: [x[1], 0.02 * x[1] - 4.0 * x[0] - x[0] ** 3], 2, None, guess_period=3.0)
    assert has_centre(oscillator, np.array([1e-3, 0.0]), np.pi)
    assert not has_centre(oscillator, np.array([1e-3, 0.0]), 6.0)
    fire = Event(lambda t, x: x[0] - 10.0, lambda t, x: [0.0 * x[0] - 10.0], 1)
    for drive in (1e-4, -1e-4):
        neuron = from_rhs(lambda t, x, drive=drive: [x[0] ** 2 + drive], 1, None, guess_period=300.0, events=[fire])
        assert not has_centre(neuron, np.array([0.0]), 300.0)


def fast_voltage(share):
    """FitzHugh and Nagumo's equations, whose voltage v is 1 / share times as fast: Hopf points at v^2 = 1 - 0.8 share.
    Between them one eigenvalue grows to 1 / share."""

    def family(current):
        def rhs(t, x):
            return [(x[0] - x[0] ** 3 / 3.0 - x[1] + current) / share, x[0] + 0.7 - 0.8 * x[1]]

        return from_rhs(rhs, 2, None, guess_period=3.0)

    v = np.sqrt(1.0 - 0.8 * share) * np.array([-1.0, 1.0])
    return family, (v + 0.7) / 0.8 - v + v**3 / 3.0


def test_hopf_points_between_which_growth_is_fast():
    family, values = fast_voltage(1e-5)
    found = locate_hopf(family, (0.25, 2.0), [-1.05, -0.45])
    assert found.complete
    assert [point.value for point in found] == pytest.approx(values, abs=1e-12)
    assert [point.frequency for point in found] == pytest.approx(2 * [np.sqrt(1e5 - 0.64)], rel=1e-9)


def test_a_hopf_point_where_rounding_of_the_state_is_as_large_as_the_last_digits_of_the_parameter():
    family, values = fast_voltage(1e-7)
    found = locate_hopf(family, (0.0, 0.29225814239355585), [-1.2, -0.6])
    assert found.complete
    assert [point.value for point in found] == pytest.approx(values[:1], abs=1e-12)
