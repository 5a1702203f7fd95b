"""Stiff systems: fast decays of 1e2 to 1e9 times the rate of the motion, against closed forms and scipy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from chilopod.errors import AnalysisError, ParameterError
from chilopod.flows.taylor.flow import TaylorFlow
from chilopod.stability import Event, Kind, exponents, find_orbit, from_rhs, locate, multipliers
from helpers.systems import van_der_pol


def oregonator(t, x):
    """Hairer and Wanner, *Solving Ordinary Differential Equations II*, section IV.10."""
    a, b, c = x
    return [77.27 * (b + a * (1.0 - 8.375e-6 * a - b)), (c - (1.0 + a) * b) / 77.27, 0.161 * (a - c)]


def robertson(t, x):
    """Robertson's reactions, fed periodically and washed out."""
    a, b, c = x
    slow, middle, fast = 0.04 * a, 1e4 * b * c, 3e7 * b * b
    return [middle - slow + 0.1 * (1.0 + np.cos(t) - a), slow - middle - fast - 0.1 * b, fast - 0.1 * c]


def returned_by_scipy(rhs, trace, orbit, period, args=()):
    """The state after a period, and the integral of the trace of the jacobian over it."""

    def both(t, y):
        return [*rhs(t, y[:-1], *args), trace(y[:-1])]

    y = np.append(orbit, 0.0)
    smallest = 1e-14 * np.append(np.abs(orbit), 1.0)
    found = solve_ivp(both, (0.0, period), y, "LSODA", rtol=1e-12, atol=smallest).y[:, -1]
    return found[:-1], found[-1]


@pytest.mark.parametrize(
    ("mu", "guess_period", "units"),
    [(100.0, 162.0, (1e9, 1e-9)), (100.0, 162.0, (1e-7, 1e-7)), (1000.0, 1610.0, (1.0, 1.0))],
)
def test_relaxation_oscillations(mu, guess_period, units):
    system = from_rhs(van_der_pol, 2, None, args=(mu, *units), guess_period=guess_period, method="implicit")
    found = exponents(system, np.array([2.0, 0.0]) * units)
    orbit, period = found.multipliers.orbit / units, found.multipliers.period
    state, log = returned_by_scipy(van_der_pol, lambda x: mu * (1.0 - x[0] ** 2), orbit, period, (mu,))
    np.testing.assert_allclose(state, orbit, rtol=1e-8)
    assert found.values.shape == (1,)
    assert found.values[0] * period == pytest.approx(log, rel=1e-9)
    # exp(-29000), or exp(-2887000): zero is within the bound of what the derivative has in its place.
    assert abs(found.multipliers.values[0]) <= found.multipliers.error_bound < 1e-7
    assert found.multipliers.stable


@pytest.mark.parametrize("state", [[1.219e-3, 2.879, 1.093e-3], [3.383e-3, 1.222, 1.918e-3]])
def test_exponents_do_not_depend_on_the_state_on_the_orbit(state):
    """From the first the least stretch of a whole return is round-off; from the second it falls within 0.4 of time."""

    def rhs(t, x):  # Field and Noyes (1974), as Tyson scales it
        a, b, c = x
        return [(8e-4 * b - a * b + a * (1.0 - a)) / 4e-2, (-8e-4 * b - a * b + c) / 4e-3, a - c]

    found = exponents(from_rhs(rhs, 3, None, guess_period=12.81, method="implicit"), state)
    np.testing.assert_allclose(found.values, [-1.22814586, -367.5193297], rtol=1e-8)  # of the Taylor flow


def test_period_by_either_method():
    """The Taylor series still get through a period."""
    (implicit, taylor) = (
        find_orbit(from_rhs(van_der_pol, 2, None, args=(30.0,), guess_period=50.0, method=method), [2.0, 0.0])
        for method in ("implicit", "taylor")
    )
    assert implicit.period == pytest.approx(taylor.period, rel=1e-13)
    assert (np.abs(implicit.image.jacobian - taylor.image.jacobian) <= implicit.image.error + taylor.image.error).all()


def test_oregonator():
    found = exponents(from_rhs(oregonator, 3, None, guess_period=303.0, method="implicit"), [1.9, 2.1, 1.7])
    orbit, period = found.multipliers.orbit, found.multipliers.period

    def trace(x):
        return 77.27 * (1.0 - 2.0 * 8.375e-6 * x[0] - x[1]) - (1.0 + x[0]) / 77.27 - 0.161

    state, log = returned_by_scipy(oregonator, trace, orbit, period)
    np.testing.assert_allclose(state, orbit, rtol=1e-6)
    assert found.values.sum() * period == pytest.approx(log, rel=1e-9)
    # The round-off of its fast rates, 25 000 /s in the mean, depends on the processor: the bound is 1.4e-11 on some and
    # 1.0e-9 on others. On each it holds, and tells that the orbit is stable.
    assert (np.abs(found.multipliers.values) <= found.multipliers.error_bound).all()
    assert found.multipliers.error_bound < 1e-7
    assert found.multipliers.stable


def test_robertson_by_either_method():
    implicit, taylor = (
        multipliers(from_rhs(robertson, 3, 2.0 * np.pi, method=method), [0.9, 2e-5, 0.1])
        for method in ("implicit", "taylor")
    )
    np.testing.assert_allclose(implicit.orbit, taylor.orbit, rtol=1e-12)
    bound = implicit.error_bound + taylor.error_bound
    assert (np.abs(implicit.values - taylor.values) <= bound).all()
    assert implicit.error_bound < 1e-11
    # The total amount is fed and washed out, whatever reacts.
    assert abs(implicit.values[0] - np.exp(-0.2 * np.pi)) <= implicit.error_bound


RATES = np.array([-0.3, -4.0, -20.0, -1e6])


def hidden_rates(generator, swap):
    """z' = L(t) z with upper triangular L of mean rates RATES, in coordinates x = M R(t) z that turn once a period."""
    mix = np.eye(4) + 0.4 * generator.standard_normal((4, 4))
    back = np.linalg.inv(mix)
    couplings = np.triu(generator.standard_normal((4, 4)), 1) * np.sqrt(RATES * RATES[:, None])
    wobble = swap * np.array([0.0, 1.0, -1.0, 1.0]) * RATES

    def rhs(t, x):
        c, s = np.cos(t), np.sin(t)
        a, b, d, e = back @ x
        z = np.array([c * a + s * d, c * b + s * e, c * d - s * a, c * e - s * b])
        p, q, u, v = couplings @ z + (RATES + wobble * c) * z
        return mix @ np.array([c * p - s * u - d, c * q - s * v - e, s * p + c * u + a, s * q + c * v + b])

    return rhs, mix


@pytest.mark.parametrize(("seed", "swap"), [(0, 0.0), (1, 0.5)])
def test_known_exponents_of_rates_six_orders_apart(seed, swap):
    rhs, mix = hidden_rates(np.random.default_rng(seed), swap)
    found = exponents(from_rhs(rhs, 4, 2.0 * np.pi, orbit=np.zeros(4), method="implicit"))
    np.testing.assert_allclose(found.values, RATES, rtol=1e-8)
    known = np.exp(2.0 * np.pi * RATES)
    assert (np.abs(found.multipliers.values - known) <= np.maximum(found.multipliers.error_bound, 1e-14)).all()
    # Round-off of the fastest rate is in all entries of the jacobian.
    assert found.multipliers.error_bound < 2.3e-16 * 1e6 * np.linalg.cond(mix) ** 2


@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e9])
def test_linear_flow_and_its_bound(scale):
    """x' = A x, rates of 1 to 1e6: the derivative is expm(A t), from the first transients on."""
    generator = np.random.default_rng(3)
    basis = generator.standard_normal((4, 4)) * np.array([1.0, scale, 1.0, 1.0 / scale])[:, None]
    for matrix in (
        basis @ np.diag([-1.0, -30.0, -1e4, -1e6]) @ np.linalg.inv(basis),
        basis @ np.block([[np.array([[-1.0, 5.0], [-5.0, -1.0]]), np.zeros((2, 2))]] * 2) @ np.linalg.inv(basis),
    ):
        system = from_rhs(lambda t, x, a=matrix: a @ x, 4, 1.0, method="implicit")
        for t in np.logspace(-7, 0, 15):
            _, derivative, bound = system.flow_with_error(np.zeros(4), 0.0, t)
            # expm squares as often as the norm asks for, and loses digits by that.
            known, wrong = (
                expm(matrix * t),
                1e-16 * t * np.abs(matrix).max() * np.abs(basis) @ np.abs(np.linalg.inv(basis)),
            )
            assert (np.abs(derivative - known) <= bound + wrong).all()
            assert (bound <= 1e-9 * np.abs(basis) @ np.abs(np.linalg.inv(basis))).all()


@pytest.mark.parametrize("rate", [1e2, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9])
def test_prothero_robinson(rate):
    """x' = -rate (x^3 - p^3) + p' has the orbit p: where collocation loses its order, the bound has to see it."""

    def p(t):
        return 2.0 + np.sin(t) * np.cos(2.0 * t + 1.0)

    def rhs(t, x):
        slope = np.cos(t) * np.cos(2.0 * t + 1.0) - 2.0 * np.sin(t) * np.sin(2.0 * t + 1.0)
        return -rate * (x**3 - p(t) ** 3) + slope

    system = from_rhs(rhs, 1, 2.0 * np.pi, method="implicit")
    orbit = find_orbit(system, [1.9])
    # Steps are long, so their error may be thousands of times the tolerance; what counts is that it is known.
    assert abs(orbit.state[0] - 2.0) <= orbit.error[0] + 1e-14
    assert orbit.error[0] <= 1e-8
    for decay in (0.1, 1.0, 10.0, 100.0):
        end = decay / (12.0 * rate)
        _, derivative, bound = system.flow_with_error(np.array([2.0]), 0.0, end)
        t = 0.5 * end * (1.0 + np.polynomial.legendre.leggauss(20)[0])
        mean = 0.5 * float((np.polynomial.legendre.leggauss(20)[1] * p(t) ** 2).sum())
        assert abs(derivative[0, 0] - np.exp(-3.0 * rate * end * mean)) <= bound[0, 0] + 4e-16 * decay * np.exp(-decay)
    t = np.linspace(0.0, 2.0 * np.pi, 65)[:-1]
    found = exponents(system, [1.9])
    assert found.values[0] == pytest.approx(-3.0 * rate * np.mean(p(t) ** 2), rel=1e-10)


@pytest.mark.parametrize("rate", [1.0, 30.0, 1e6])
def test_a_filter_driven_by_a_square_wave(rate):
    """x' = rate (sign sin t - x): x(0) = -tanh(pi rate / 2)."""
    system = from_rhs(lambda t, x: rate * (np.sign(np.sin(t)) - x), 1, 2.0 * np.pi, method="implicit")
    found = multipliers(system, [0.0])
    assert found.orbit[0] == pytest.approx(-np.tanh(0.5 * np.pi * rate), rel=1e-13)
    assert abs(found.values[0] - np.exp(-2.0 * np.pi * rate)) <= found.error_bound < 1e-13
    assert exponents(system, [0.0]).values[0] == pytest.approx(-rate, rel=1e-11)


@pytest.mark.parametrize("mix", [np.eye(3), np.array([[1.0, 0.3, 0.2], [-0.4, 1.0, 0.1], [0.2, -0.3, 1.0]])])
def test_locates_as_without_a_stiff_part(mix):
    """Duffing's oscillator with a fast follower that does not act back.

    In coordinates that mix the three, round-off of the rate 1e6 is in all entries of the jacobian. The place is as sure
    as the critical multiplier, by its rate of change.
    """
    back = np.linalg.inv(mix)
    mirror = mix @ np.diag([-1.0, -1.0, 1.0]) @ back

    def rhs(t, y, force):
        x, v, w = back @ y
        return mix @ np.array([v, -0.2 * v - x**3 + force * np.cos(t), -1e6 * (w - x * x)])

    def family(force):
        return from_rhs(rhs, 3, 2.0 * np.pi, args=(force,), symmetry=mirror, method="implicit")

    def plain(force):
        return from_rhs(
            lambda t, x: [x[1], -0.2 * x[1] - x[0] ** 3 + force * np.cos(t)], 2, 2.0 * np.pi, symmetry=-np.eye(2)
        )

    (known,) = locate(plain, (2.3, 2.5), orbit=[1.88, 0.64])
    (found,) = locate(family, (2.3, 2.5), orbit=mix @ [1.88, 0.64, 3.5])
    assert found.kind is known.kind is Kind.PITCHFORK
    assert abs(found.value - known.value) <= found.error_bound + known.error_bound
    assert found.criticality is known.criticality
    below = multipliers(plain(2.4), find_orbit(plain(2.4), [1.88, 0.64])).values[0]
    rate = (1.0 - abs(below)) / (known.value - 2.4)
    assert found.error_bound < 2.0 * multipliers(family(found.value), found.orbit).error_bound / rate < 1e-5


def test_taken_over_where_series_take_too_many_steps(monkeypatch):
    monkeypatch.setattr(TaylorFlow, "most_steps", 300)
    system = from_rhs(van_der_pol, 2, None, args=(100.0,), guess_period=162.0)
    assert not system.is_stiff(np.array([2.0, 0.0]), 0.0, 1.0)
    assert find_orbit(system, [2.0, 0.0]).period == pytest.approx(162.83707109237, rel=1e-12)
    assert system.is_stiff(np.array([2.0, 0.0]), 0.0, 162.0)
    with pytest.raises(AnalysisError, match=r"too many steps.*method='implicit'"):
        find_orbit(from_rhs(van_der_pol, 2, None, args=(100.0,), guess_period=162.0, method="taylor"), [2.0, 0.0])


def test_what_is_not_supported_is_said_in_one_line():
    bounce = [Event(lambda t, x: x[0], lambda t, x: [x[0], -x[1]])]
    with pytest.raises(ParameterError, match=r"method.*events or switches in the state"):
        from_rhs(lambda t, x: [x[1], -1.0 + 0.0 * t], 2, 1.0, events=bounce, method="implicit")
    with pytest.raises(ParameterError, match=r"method.*events or switches in the state"):
        from_rhs(lambda t, x: [x[1], -np.sign(x[0])], 2, 1.0, method="implicit")
    with pytest.raises(ParameterError, match=r"method.*traced"):
        from_rhs(lambda t, x: [x[1], -1.0 if x[0] > 0 else 1.0], 2, 1.0, method="implicit")
    with pytest.raises(ParameterError, match=r"method.*not known.*automatic, taylor, implicit"):
        from_rhs(lambda t, x: [x[1], -x[0]], 2, 1.0, method="bdf")


@pytest.mark.parametrize("rhs", [lambda t, x: x * x, lambda t, x: np.sqrt(x - 0.5) - x * 10.0])
def test_a_motion_that_ends_says_so(rhs):
    system = from_rhs(rhs, 1, 4.0, method="implicit")
    with pytest.raises(AnalysisError, match=r"beyond t = 1|not finite, at t = |beyond t = 0"):
        system.flow(np.array([1.0]), 0.0, 4.0)


@pytest.mark.parametrize("coupling", [np.cos, lambda t: np.sin(t) ** 2, lambda t: 1.0 - np.sin(t)])
def test_a_coupling_that_passes_zero_at_a_cut_of_the_period(coupling):
    """Its round-off is all of it there, so shorter steps are not more exact. The mode is that of the slow motion."""

    def rhs(t, x):
        return [-1e6 * (x[0] - coupling(t) * x[1]), -x[1] + 2.0 + 0.3 * np.sin(t)]

    found = exponents(from_rhs(rhs, 2, 2.0 * np.pi, method="implicit"), [0.5, 0.5])
    assert (np.abs(found.values - [-1.0, -1e6]) <= found.error_bound).all()
    assert (found.error_bound <= [1e-12, 1e-7]).all()
    np.testing.assert_allclose(found.modes[0, 0] / found.modes[1, 0], coupling(0.0), atol=2e-6)


def test_a_state_that_passes_zero_at_a_cut_of_the_period():
    system = from_rhs(lambda t, x: -1e6 * (x - np.cos(t)), 1, 2.0 * np.pi, method="implicit")
    found = exponents(system, [0.5])
    assert abs(found.values[0] + 1e6) <= found.error_bound[0] <= 1e-7
