"""Systems from anything that has a flow, and how sure their multipliers are."""

import itertools
from functools import partial
from math import exp, pi
from types import SimpleNamespace

import numpy as np
import pytest

from chilopod.errors import AnalysisError, ChilopodError, ParameterError
from chilopod.stability import (
    Multipliers,
    PeriodicSystem,
    SystemLike,
    begin,
    exponents,
    find_orbit,
    from_map,
    from_rhs,
    locate,
    multipliers,
    sweep,
)
from chilopod.stability.floquet import full_period
from chilopod.stability.interface import offers, spatial_symmetries
from chilopod.stability.returns import carried, flow_with_error, whole_period
from helpers.systems import duffing, linear


class Own:
    """A user's own class: a forced, damped oscillator with its exact flow, x'' + 2 d x' + x = cos t written out."""

    def __init__(self, rate=-0.4, spin=0.7):
        self.rate, self.spin = rate, spin

    dimension = 2
    period = 2 * pi
    symmetry = None

    def matrix(self, t):
        c, s = np.cos(self.spin * t), np.sin(self.spin * t)
        return np.exp(self.rate * t) * np.array([[c, s], [-s, c]])

    def path(self, t):
        return np.array([1.0 + np.sin(t), np.cos(t)])

    def flow(self, x, t0, t1):
        matrix = self.matrix(t1 - t0)
        return self.path(t1) + matrix @ (x - self.path(t0)), matrix


def known(rate, spin):
    return np.exp(2 * pi * np.array([rate + 1j * abs(spin), rate - 1j * abs(spin)]))


def test_own_class_is_a_system():
    assert isinstance(Own(), SystemLike)
    found = multipliers(Own(), [0.0, 0.0])
    np.testing.assert_allclose(found.orbit, [1.0, 1.0], atol=1e-14)
    assert multipliers(Own(), [1.0, 1.0]).error_bound < 1e-12  # of an exact flow it is round-off
    np.testing.assert_allclose(np.sort_complex(found.values), np.sort_complex(known(-0.4, 0.7)), rtol=1e-12)
    assert found.stable
    assert exponents(Own(), [0.0, 0.0]).values[0] == pytest.approx(-0.4 + 0.3j, rel=1e-12)


def test_own_class_is_located_and_followed():
    (point,) = locate(lambda mu: Own(rate=mu), (-0.3, 0.2), orbit=[0.9, 1.2], normal_form=False)
    assert abs(point.value) <= point.error_bound < 1e-10
    np.testing.assert_allclose(point.orbit, [1.0, 1.0], atol=1e-12)


def test_optional_attributes_are_used():
    class Better(Own):
        orbit = np.array([1.0, 1.0])

        def flow_with_error(self, x, t0, t1):
            return *self.flow(x, t0, t1), 1e-5

    found = multipliers(Better())
    # Condition 1 (normal), 2-norm of a matrix whose entries are off by 1e-5, safety 4: about 1e-4 at most.
    assert 1e-5 < found.error_bound < 2e-4
    assert [m.values.tolist() for m in sweep([Better(), Better(-0.1)])] == [
        multipliers(b).values.tolist() for b in (Better(), Better(-0.1))
    ]
    assert sweep([]) == []


def test_a_capability_that_is_none_is_missing():
    class Without(Own):
        flow_with_error = flow_states = flow_many = can_flow_with = None
        spatial_symmetry = orbit = None

    plain = PeriodicSystem(2, 2 * pi, Own().flow)
    for system in (Own(), Without(), plain, whole_period(Without())):
        assert not any(offers(system, name) for name in ("flow_many", "flow_states", "flow_with_error"))
        assert spatial_symmetries(system) == ()
        with pytest.raises(AnalysisError, match="has no known periodic orbit"):
            multipliers(system)
    found = multipliers(Without(), [1.0, 1.0])
    assert found.values.tolist() == multipliers(Own(), [1.0, 1.0]).values.tolist()
    assert found.error_bound == multipliers(Own(), [1.0, 1.0]).error_bound


def test_a_capability_may_belong_to_the_instance():
    system = PeriodicSystem(2, 2 * pi, Own().flow, flow_with_error=lambda x, t0, t1: (*Own().flow(x, t0, t1), 1e-5))
    for each in (system, whole_period(system)):
        assert offers(each, "flow_with_error")
        assert not offers(each, "flow_states")


@pytest.mark.parametrize("noise", [1e-12, 1e-8, 1e-4])
def test_error_of_a_flow_that_gives_none_is_estimated_by_splitting(noise):
    """A flow with errors that depend on the interval, as those of a step-controlled integrator do."""

    class Noisy(Own):
        def flow(self, x, t0, t1):
            state, matrix = super().flow(x, t0, t1)
            wrong = noise * np.random.default_rng(int(1e6 * (t0 + 3 * t1))).uniform(-1, 1, (2, 2))
            return state, matrix + wrong

    found = multipliers(Noisy(), [1.0, 1.0])
    error = np.abs(np.sort_complex(found.values) - np.sort_complex(known(-0.4, 0.7))).max()
    assert noise / 1000 < error <= found.error_bound
    assert found.error_bound < 1e3 * noise


def test_a_flow_may_return_the_same_arrays():
    state, matrix = np.zeros(2), np.zeros((2, 2))
    own = Own()

    def flow(x, t0, t1):
        state[:], matrix[:] = own.flow(x, t0, t1)
        return state, matrix

    def tangents(x, directions, t0, t1):
        return flow(x, t0, t1)[0], matrix @ directions

    x, systems = np.array([0.3, 0.4]), [PeriodicSystem(2, own.period, each) for each in (own.flow, flow)]
    for mine, other in zip(*(flow_with_error(each, x, 0.0, own.period) for each in systems), strict=True):
        np.testing.assert_array_equal(mine, other)
    states = [
        carried(each, np.array([x, 2.0 * x]), 0.0, 1.0) for each in (own, SimpleNamespace(flow_tangents=tangents))
    ]
    np.testing.assert_array_equal(*states)


def test_half_period_squares_to_the_full_period():
    def moves(t0, t1):
        return np.diag(np.exp(np.array([0.05, -0.3]) * (t1 - t0)))

    mirrored, plain = linear(moves, 2, 2.0, symmetry=[[-1.0, 0.0], [0.0, 1.0]]), linear(moves, 2, 2.0)
    half, full = multipliers(mirrored), multipliers(plain)
    np.testing.assert_allclose(half.half_period, [-exp(0.05), exp(-0.3)], rtol=1e-14)
    np.testing.assert_allclose(half.values, full.values, rtol=1e-13)
    assert full.half_period is None
    assert not half.stable


@pytest.mark.parametrize(
    ("symmetry", "message"),
    [
        (np.eye(3), r"wrong shape \(3, 3\)"),
        ([1.0, -1.0], "wrong shape"),
        ([[0.0, 1.0], [-1.0, 0.5]], "must have a finite order"),
        ([[1.0, 1.0], [0.0, 1.0]], "must have a finite order"),
        ([[np.nan, 0.0], [0.0, 1.0]], "must be finite"),
        (np.zeros((2, 2)), "must have a finite order"),
    ],
)
@pytest.mark.parametrize("name", ["symmetry", "spatial_symmetry"])
def test_symmetries_are_checked(name, symmetry, message):
    with pytest.raises(ParameterError, match=message) as error:
        PeriodicSystem(2, 1.0, Own().flow, **{name: symmetry})
    assert error.value.field == name


@pytest.mark.parametrize(
    "flow",
    [
        lambda x, t0, t1: (x, np.eye(3)),
        lambda x, t0, t1: (np.zeros(3), np.eye(2)),
        lambda x, t0, t1: (x, [[1.0, 0.0], [0.0]]),
        lambda x, t0, t1: (x, np.full((2, 2), np.nan)),
        lambda x, t0, t1: (x + np.inf, np.eye(2)),
    ],
    ids=["matrix", "state", "ragged", "nan", "infinite"],
)
def test_a_broken_flow_is_one_line(flow):
    system = PeriodicSystem(2, 1.0, flow, orbit=np.zeros(2))
    with pytest.raises(ChilopodError) as error:
        multipliers(system)
    assert error.value.field == "flow"
    assert "\n" not in str(error.value)


def test_no_orbit_to_be_found():
    system = PeriodicSystem(1, 1.0, lambda x, t0, t1: (x + (t1 - t0), np.eye(1)))
    with pytest.raises(AnalysisError, match="no periodic orbit found"):
        find_orbit(system, [0.0])
    with pytest.raises(AnalysisError, match="has no known periodic orbit"):
        multipliers(system)


def test_a_search_that_fails_where_a_function_overflows_names_it():
    def rhs(t, x):
        return [x[1], 2.0 * np.cos(t) - 0.2 * x[1] - x[0] - np.log1p(np.exp(300.0 * x[0])) / 300.0]

    system = from_rhs(rhs, 2, 2.0 * np.pi)
    with pytest.raises(AnalysisError, match="of its size\\): the right-hand side overflows: exp of"):
        find_orbit(system, [0.5, 0.5])


def test_a_map_may_overflow_in_a_search_whose_error_names_the_value():
    """The map x -> 1 - a x^2 + 0.3 x has no fixed point below a = -0.1225."""
    quadratic = lambda a: from_map(lambda x: ([1.0 - a * x[0] ** 2 + 0.3 * x[0]], [[0.3 - 2.0 * a * x[0]]]), 1)  # noqa: E731
    for search in (partial(begin, quadratic, -0.4), partial(locate, quadratic, (-0.4, 1.4))):
        with pytest.raises(AnalysisError, match=r"^orbit: at -0\.4 no periodic orbit found near the guess"):
            search([0.6])


@pytest.mark.parametrize("method", ["taylor", "implicit"])
@pytest.mark.parametrize(("rate", "said"), [(360.0, None), (500.0, "deviations grow"), (690.0, "deviations grow")])
def test_multipliers_beyond_double_precision_are_named_without_a_warning(method, rate, said):
    """Squares of the multiplier exp(rate) overflow, and then products with the sizes of states do."""
    system = from_rhs(lambda t, x: [rate * x[0] + np.cos(2.0 * np.pi * t)], 1, 1.0, method=method)
    if said is None:
        assert multipliers(system, [0.0]).values == pytest.approx([np.exp(rate)], rel=1e-9)
    else:
        with pytest.raises(AnalysisError, match=said):
            multipliers(system, [0.0])


@pytest.mark.parametrize("name", ["flow", "flow_with_error"])
def test_a_flow_takes_a_list(name):
    """States that decay by exp(-1), by every method."""
    rhs = lambda t, x: [-x[0]]  # noqa: E731
    untraceable = lambda t, x: [-x[0] if x[0] > 0.0 else -1.0 * x[0]]  # noqa: E731
    systems = [from_rhs(rhs, 1, 1.0, method=method) for method in ("automatic", "taylor", "implicit")]
    systems += [from_rhs(untraceable, 1, 1.0), from_map(lambda x: ([np.exp(-1.0) * x[0]], [[np.exp(-1.0)]]), 1)]
    for system in systems:
        state, derivative, *_ = getattr(system, name)([2.0], 0.0, 1.0)
        assert (state, derivative) == (pytest.approx([2.0 / np.e]), pytest.approx(np.array([[1.0 / np.e]])))


def test_a_defective_matrix_has_a_useless_but_honest_bound():
    """A Jordan block: a perturbation e moves its eigenvalues by sqrt(e)."""

    def flow(x, t0, t1):
        derivative = np.array([[1.0, t1 - t0], [0.0, 1.0]])
        return derivative @ x, derivative

    system = PeriodicSystem(2, 1.0, flow, orbit=np.zeros(2))
    found = multipliers(system)
    assert np.abs(found.values - 1).max() <= found.error_bound
    assert found.error_bound > 1e-8
    assert not found.stable


def test_a_double_multiplier_whose_left_vector_is_infinite_warns_of_nothing():
    system = from_map(
        lambda x: ([-3.0 * x[0] - 4.0 / 9.0 * x[1], 9.0 * x[0] + x[1]], [[-3.0, -4.0 / 9.0], [9.0, 1.0]]), 2
    )
    found = multipliers(system, [0.0, 0.0])
    assert np.abs(found.values + 1.0).max() <= found.error_bound


def test_the_derivative_of_a_map_may_overflow():
    system = from_map(lambda x: ([1e200 * x[0]], [[1e200]]), 1)
    assert system.flow(np.zeros(1), 0.0, 2.0)[1] == np.inf


@pytest.mark.parametrize("guess", ["text", [1.0, 2.0], [[0.0]], 0.0, [np.nan], None])
def test_a_guess_that_is_no_state_is_one_line(guess):
    system = PeriodicSystem(1, 1.0, lambda x, t0, t1: (x, np.eye(1)))
    with pytest.raises(ChilopodError) as error:
        multipliers(system, guess)
    assert str(error.value).startswith("orbit")
    assert "\n" not in str(error.value)


def test_a_sweep_in_threads_is_that_of_one_after_the_other():
    def rhs(t, x, d):
        return [x[1], -(d + 0.3 * np.cos(t)) * x[0] - 0.1 * x[1]]

    systems = [from_rhs(rhs, 2, 2 * pi, args=(delta,), orbit=[0.0, 0.0]) for delta in np.linspace(0.1, 2.0, 12)]
    assert [m.values.tolist() for m in sweep(systems)] == [multipliers(s).values.tolist() for s in systems]


@pytest.mark.parametrize(
    ("values", "bounds", "stable"),
    [
        ([0.5, 0.9], [0.01, 0.01], True), ([1.2, 0.5], [0.01, 0.01], False), ([1.0 - 1e-9, 0.5], [1e-7, 1e-9], None),
        ([1.0 + 1e-9, 0.5], [1e-7, 1e-9], None), ([1.2, 0.5], [0.01, 2.0], False), ([0.5], [np.inf], None),
        ([1.0], [0.0], None), ([np.nan], [0.0], None),
    ],
)  # fmt: skip
def test_a_verdict_within_the_errors_is_undecided(values, bounds, stable):
    found = Multipliers(np.array(values, complex), None, max(bounds), np.array(bounds), np.zeros(1), 1.0)
    assert found.stable is stable


@pytest.mark.parametrize("guess", list(itertools.product((-3.0, -1.5, 0.5, 1.0, 3.0), (-3.0, 0.0, 0.6, 3.0))))
def test_corrections_stay_where_the_motion_is(guess):
    """Far outside a flow takes any number of steps: some guesses took a minute."""
    system = duffing(2.5, -np.eye(2))
    asked = []

    def flow(x, t0, t1):
        asked.append(np.abs(x).max())
        return system.flow(x, t0, t1)

    orbit = find_orbit(PeriodicSystem(2, 2.0 * np.pi, flow, symmetry=-np.eye(2)), guess)
    np.testing.assert_allclose(orbit.state, [1.901458, 0.634591], atol=1e-6)
    assert max(asked) < 1e5


def test_a_flow_of_volumes_alone_does_not_make_a_system_stiff():
    system = linear(lambda t0, t1: np.diag([0.5, 0.1]) ** (t1 - t0), 2, flow_volume=lambda x, t0, t1: (-3.0, 0.0))
    np.testing.assert_allclose(multipliers(system).values, [0.5, 0.1], rtol=1e-12)


def test_tiny_multipliers_have_the_larger_bound():
    found = full_period(np.array([1e-9, 1e-12], complex), np.array([1e-16, 1e-8]), 1, np.zeros(2), 1.0)
    assert found.error_bound == 1e-8


def rotating(t, x, a=-0.1, b=0.37):
    """z' = i z + e^{it} g(e^{-it} z), g(w) = (a + ib) (w - 1) - |w - 1|^2 (w - 1): the orbit e^{it} has the multipliers
    exp(2 pi (a +- ib)), and is symmetric in time to every rotation."""
    c, s = np.cos(t), np.sin(t)
    u, v = c * x[0] + s * x[1] - 1.0, c * x[1] - s * x[0]
    r = u * u + v * v
    p, q = a * u - b * v - r * u, b * u + a * v - r * v
    return [-x[1] + c * p - s * q, x[0] + s * p + c * q]


def turn(order):
    c, s = np.cos(2.0 * pi / order), np.sin(2.0 * pi / order)
    return np.array([[c, s], [-s, c]])


@pytest.mark.parametrize("order", [2, 3, 4, 6])
def test_symmetries_in_time_of_any_order(order):
    """S x(T / k) = x(0), as of the motion e^{it}."""
    system = from_rhs(rotating, 2, 2.0 * pi, symmetry=turn(order))
    orbit = find_orbit(system, [0.9, 0.1])
    np.testing.assert_allclose(orbit.state, [1.0, 0.0], atol=1e-12)
    assert orbit.image.returns == order
    found = multipliers(system, [0.9, 0.1])
    np.testing.assert_allclose(found.values[0], np.exp(2.0 * pi * (-0.1 + 0.37j)), atol=found.error_bound + 1e-15)


def test_a_symmetry_that_the_flow_does_not_have_is_refused():
    backward = turn(3).T
    with pytest.raises(ParameterError, match=r"symmetry: must be a symmetry .*allowed: S with S f\(t \+ T/k, x\)"):
        from_rhs(rotating, 2, 2.0 * pi, symmetry=backward)
    system = PeriodicSystem(2, 2.0 * pi, from_rhs(rotating, 2, 2.0 * pi).flow, symmetry=backward)
    with pytest.raises(AnalysisError, match="symmetry: must be one of the motion"):
        find_orbit(system, [0.9, 0.1])


def test_units_of_states_hundreds_of_orders_apart():
    """A decay by e^-628 beside a slow one: its eigenvector, in balanced units, has entries whose squares vanish."""
    found = multipliers(from_rhs(lambda t, x: [-100.0 * x[0], -0.2 * x[1] + x[0]], 2, 2.0 * pi), [0.0, 0.0])
    np.testing.assert_allclose(found.values[0], exp(-0.4 * pi), atol=found.error_bound)
    assert np.isfinite(found.error_bounds).all()
