"""Building a system from a right-hand side: what is warned of, what is refused, and how the derivative is had."""

import warnings
from math import cos, exp, fabs, pi, sin

import numba
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.special import bernoulli, factorial

from chilopod.errors import AnalysisError, ParameterError
from chilopod.flows import called
from chilopod.stability import Event, NotAnalytic, PeriodicSystem, UndeclaredSwitch, from_rhs, locate, multipliers


def oscillator(t, x):
    return [x[1], -x[0]]


def falling(t, x):
    return [x[1], -(x[0] ** 2)]


def hill(coefficient):
    return lambda t, x: [x[1], -coefficient(t) * x[0]]


# Jumps


@pytest.mark.parametrize("size", [1.0, 0.1, 0.01, 1e-4])
@pytest.mark.parametrize("background", [lambda t: 1.0, cos, lambda t: cos(t) + 0.3 * cos(5 * t)])
def test_undeclared_jump_is_warned_of(size, background):
    """By a branch, which cannot be traced: a jump of a function that can is crossed exactly, declared or not."""
    with pytest.warns(UndeclaredSwitch, match=r"jumps at t = 1\.2661\d*, 5\.0170\d*, not among"):
        from_rhs(hill(lambda t: background(t) + (size if cos(t) > 0.3 else -size)), 2, 2 * pi, orbit=[0, 0])


def test_each_undeclared_jump_is_listed():
    with pytest.warns(UndeclaredSwitch, match=r"t = 1, 1\.01, not among"):
        from_rhs(hill(lambda t: cos(t) + (1.0 < t % (2 * pi) < 1.01)), 2, 2 * pi)


def test_one_of_two_switches_declared():
    with pytest.warns(UndeclaredSwitch, match=r"t = 4\.71238\d*, not among"):
        from_rhs(hill(lambda t: 1.5 if cos(t) > 0 else 0.5), 2, 2 * pi, switch_times=[pi / 2])


def test_a_jump_that_multiplies_zero_on_the_orbit_is_found():
    """x = 0 never feels the jump, its neighbours do: the multiplier would be off."""
    with pytest.warns(UndeclaredSwitch):
        from_rhs(lambda t, x: [-x[0] * (2.0 if t % 2.0 > 0.7 else 1.0)], 1, 2.0, orbit=[0.0])


def test_a_declared_jump_is_cheaper_and_exact():
    calls = 0

    def rhs(t, x):
        nonlocal calls
        calls += 1
        return [-x[0] * (2.0 if t % 2.0 > 0.7 else 1.0)]

    def cost(system):
        nonlocal calls
        calls = 0
        matrix = system.flow(np.zeros(1), 0.0, 2.0)[1]
        return calls, abs(matrix[0, 0] - exp(-0.7 - 2.6))

    declared, error = cost(from_rhs(rhs, 1, 2.0, orbit=[0.0], switch_times=[0.7]))
    with pytest.warns(UndeclaredSwitch):
        system = from_rhs(rhs, 1, 2.0, orbit=[0.0])
    undeclared, larger = cost(system)
    assert undeclared > 2 * declared
    assert error < 1e-15
    assert error < larger


@pytest.mark.parametrize(
    "coefficient",
    [
        lambda t: 1 + cos(t),
        lambda t: 1 + cos(50 * t),
        lambda t: 1 + cos(200 * t),
        lambda t: 1 + exp(-(((t - 1) / 0.01) ** 2)),
        lambda t: 1 + np.tanh(1e3 * cos(t)),
        lambda t: 1 + abs(sin(t)),
        lambda t: 1.0,
        lambda t: 1e12 * (1 + cos(t)),
    ],
    ids=["slow", "fast", "faster", "pulse", "steep", "kink", "constant", "large"],
)
def test_no_false_alarm_for_continuous_coefficients(coefficient):
    from_rhs(hill(coefficient), 2, 2 * pi, orbit=[0, 0])  # warnings are errors here


def test_no_false_alarm_for_declared_switches():
    from_rhs(hill(lambda t: 1 + 0.5 * np.sign(cos(t))), 2, 2 * pi, switch_times=[pi / 2, 3 * pi / 2])
    from_rhs(hill(lambda t: t % 1.0), 2, 1.0)  # the ends of the period are always switches
    from_rhs(hill(lambda t: (t - 0.25) % 1.0), 2, 1.0, switch_times=np.array([0.25]))


def test_no_alarm_where_a_function_is_not_defined_everywhere():
    system = from_rhs(lambda t, x: [1 - x[0] ** 0.5 if x[0] > 0 else 1 / 0], 1, 2.0)
    with pytest.warns(NotAnalytic):
        found = multipliers(system, [1.1])
    assert found.orbit[0] == pytest.approx(1.0, abs=1e-12)
    assert abs(found.values[0] - exp(-1.0)) <= found.error_bound


# The derivative


@numba.njit
def cube_by_power(t, x):
    return np.array([x[1], -x[0] - 0.2 * x[1] - x[0] ** 3])


def test_a_compiled_power_is_exact():
    system = from_rhs(cube_by_power, 2, 2.0, orbit=[0, 0])
    plain = from_rhs(lambda t, x: [x[1], -x[0] - 0.2 * x[1] - x[0] * x[0] * x[0]], 2, 2.0, orbit=[0, 0])
    x = np.array([-0.7, 0.4])
    np.testing.assert_allclose(system.flow(x, 0.0, 2.0)[1], plain.flow(x, 0.0, 2.0)[1], rtol=1e-14)


@pytest.mark.parametrize("absolute", [abs, np.abs])
def test_a_modulus_is_traced(absolute):
    found = multipliers(from_rhs(lambda t, x: [-x[0] * absolute(2.0 + x[0])], 1, 1.5, orbit=[0.0]))
    assert abs(found.values[0] - exp(-3.0)) <= found.error_bound < 1e-14


def test_a_branch_on_the_state_is_differenced_and_warned_of():
    def absolute(v):
        return fabs(v) if v > 0 else -v

    system = from_rhs(lambda t, x: [-x[0] * absolute(2.0 + x[0])], 1, 1.5, orbit=[0.0])
    with pytest.warns(NotAnalytic, match="a branch"):
        found = multipliers(system)
    assert found.values[0] == pytest.approx(exp(-3.0), rel=1e-8)
    assert abs(found.values[0] - exp(-3.0)) <= found.error_bound < 1e-6


@pytest.mark.parametrize("kind", [float, complex])
def test_a_function_may_overwrite_its_argument_and_return_the_same_array(kind):
    """Whether it is traced (else it branches) or not, by a complex step or by differences."""
    kept = np.zeros(2, kind)

    def overwriting(t, x):
        x[0], x[1] = x[1], -(x[0] ** 3)
        kept[:] = x
        return kept

    def branching(t, x):
        return overwriting(t, x) if x[0].real < 1e9 else None

    right = from_rhs(lambda t, x: [x[1], -(x[0] ** 3)], 2, 1.0).flow(np.array([0.8, 0.3]), 0.0, 0.5)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotAnalytic)
        for rhs in (overwriting, branching):
            found = from_rhs(rhs, 2, 1.0).flow(np.array([0.8, 0.3]), 0.0, 0.5)
            for mine, other in zip(found, right, strict=True):
                np.testing.assert_allclose(mine, other, rtol=1e-8)


def test_a_function_that_rounds_within_is_refused(monkeypatch):
    def rhs(t, x):
        x, v = x.astype(np.float32).tolist()
        return [v, -x]

    monkeypatch.setattr(called, "_PATIENCE", 1000)
    with pytest.warns(NotAnalytic), pytest.raises(ParameterError, match=r"^rhs: must be computed in double precision"):
        from_rhs(rhs, 2, 1.0).flow(np.array([0.8, 0.3]), 0.0, 1.0)


@pytest.mark.parametrize("compiled", [False, True])
def test_not_analytic_in_one_part_of_the_period_only(compiled):
    """|x + 1| - 1 counts in the second half only; a complex step would drop its derivative in silence."""

    def rhs(t, x):
        slope = -1.0 * x
        if t % 2.0 > 1.0:
            slope[0] -= abs(x[0] + 1.0) - 1.0
        return slope

    system = from_rhs(numba.njit(rhs) if compiled else rhs, 1, 2.0, switch_times=[1.0], orbit=[0.0])
    with pytest.warns(NotAnalytic):
        found = multipliers(system)
    assert found.values[0] == pytest.approx(exp(-3.0), rel=1e-8)
    assert abs(found.values[0] - exp(-3.0)) <= found.error_bound


def test_complex_step_and_compiled_agree():
    @numba.njit
    def compiled(t, x, k):
        return np.array([x[1], -k * np.sin(x[0]) * (1 + 0.3 * np.cos(t)) - 0.1 * x[1]])

    def called(t, x, k):
        return compiled.py_func(t, x, k if t < 9.0 else 0.0)

    x = np.array([0.9, -0.2])
    ways = [
        from_rhs(compiled, 2, 2 * pi, args=(1.7,)),
        from_rhs(compiled.py_func, 2, 2 * pi, args=(1.7,)),
        from_rhs(called, 2, 2 * pi, args=(1.7,)),
    ]
    results = [way.flow(x, 0.2, 6.0) for way in ways]
    for state, derivative in results[1:]:
        np.testing.assert_allclose(state, results[0][0], rtol=1e-12)
        np.testing.assert_allclose(derivative, results[0][1], rtol=1e-11)
    many = ways[0].flow_states(np.array([x, 2 * x]), 0.2, 6.0)
    np.testing.assert_allclose(many[0], results[0][0], rtol=1e-12)


# Jumps with the state, and pulses, in functions that can only be called


def test_a_jump_with_the_state_in_a_branch_is_noticed():
    """x' = 1 below x = 1 and 3 above: the derivative 1 that is found should be 3, and the bound says so."""
    system = from_rhs(lambda t, x: [3.0 + 0 * x[0] if x[0].real > 1.0 else 1.0 + 0 * x[0]], 1, 2.0)
    with pytest.warns(UndeclaredSwitch, match="jumps somewhere in the state"):
        _, derivative, error = system.flow_with_error(np.zeros(1), 0.0, 2.0)
    assert abs(derivative[0, 0] - 3.0) <= error


@pytest.mark.parametrize("width", [0.1, 1e-2, 1e-3])
def test_a_pulse_in_a_branch_is_not_stepped_over(width):
    def rhs(t, x):
        if t > 5.0:
            return x
        z = (t - 1.1) / width
        return (-1 + 3 / width * np.exp(-0.5 * z * z) / np.sqrt(2 * pi)) * x

    found = multipliers(from_rhs(rhs, 1, 2.0, orbit=[0.0]))
    assert found.values[0] == pytest.approx(exp(1.0), rel=1e-10)
    assert abs(found.values[0] - exp(1.0)) <= found.error_bound


def test_a_traced_pulse_and_a_traced_jump_with_the_state():
    def rhs(t, x):
        return (-1 + 3e3 * np.exp(-0.5 * ((t - 1.1) / 1e-3) ** 2) / np.sqrt(2 * pi)) * x

    found = multipliers(from_rhs(rhs, 1, 2.0, orbit=[0.0]))
    # A time that is wrong by its last digit moves the peak, at a rate of 1200, by 7e-13.
    assert abs(found.values[0] - exp(1.0)) <= found.error_bound < 30.0 * 7e-13
    system = from_rhs(lambda t, x: [np.where(x[0] > 1.0, 3.0, 1.0)], 1, 2.0)
    _, derivative, error = system.flow_with_error(np.zeros(1), 0.0, 2.0)
    assert abs(derivative[0, 0] - 3.0) <= error < 1e-13


SHARP = {
    "friction": lambda t, x: np.tanh(50.0 * x),
    "friction at once": lambda t, x: np.tanh(1000.0 * x),
    "bump": lambda t, x: np.exp(-((200.0 * x) ** 2)),
    "gate": lambda t, x: 1.0 / (1.0 + np.exp(-200.0 * x)),
    "well": lambda t, x: np.cosh(50.0 * x) ** -2,
    "pulse": lambda t, x: 50.0 * np.exp(-((2500.0 * (t - 3.1)) ** 2)),
}


@pytest.mark.parametrize("term", SHARP.values(), ids=SHARP)
def test_a_function_that_saturates_is_not_stepped_over(term):
    def rhs(t, x):
        return [x[1], -0.2 * x[1] - x[0] ** 3 - 0.5 * term(t, x[0]) + np.cos(t)]

    start, period = np.array([1.0, 0.3]), 2.0 * pi
    state, derivative = from_rhs(rhs, 2, period).flow(start, 0.0, period)
    other = start
    for t0, t1, step in ((0.0, 3.05, 2e-3), (3.05, 3.15, 1e-4), (3.15, period, 2e-3)):  # the pulse is at 3.1
        run = solve_ivp(rhs, (t0, t1), other, method="DOP853", rtol=1e-13, atol=1e-13, max_step=step)
        other = run.y[:, -1]
    np.testing.assert_allclose(state, other, rtol=0.0, atol=1e-11)
    # Liouville: the determinant is that of the damping alone.
    assert np.linalg.det(derivative) == pytest.approx(exp(-0.2 * period), rel=1e-9)


@pytest.mark.parametrize("called", [False, True])
def test_states_in_any_units(called):
    """The multipliers of a driven pendulum with lengths and speeds in units 10^9 apart."""
    values = []
    for units in (np.ones(2), np.array([2.0**-30, 2.0**30])):

        def rhs(t, x, units=units):
            y = x / units
            slope = np.array([y[1], -1.7 * np.sin(y[0]) * (1 + 0.3 * np.cos(t)) - 0.1 * y[1]]) * units
            return slope if not called or t < 99.0 else x

        system = from_rhs(rhs, 2, 2 * pi)
        state, derivative = system.flow(np.array([0.9, -0.2]) * units, 0.0, 6.0)
        values.append((state / units, derivative * units / units[:, None]))
    np.testing.assert_allclose(values[1][0], values[0][0], rtol=1e-13)
    np.testing.assert_allclose(values[1][1], values[0][1], rtol=1e-12)


def test_a_called_flow_bounds_each_entry_in_its_own_units():
    sizes = np.array([1e-6, 1.0])
    generator = np.array([[-0.1, 1.0], [-1.0, -0.1]])

    def rhs(t, x):
        return generator @ (x / sizes) * sizes if t > -9.0 else x  # cannot be traced

    _, derivative, error = from_rhs(rhs, 2, 2 * pi).flow_with_error(sizes, 0.0, 2.0)
    exact = expm(2.0 * generator) * sizes[:, None] / sizes
    assert (np.abs(derivative - exact) <= error).all()
    assert (error <= 1e-9 * np.abs(exact)).all()


def test_a_jump_is_sought_about_an_orbit_of_any_size():
    def rhs(t, x):
        if abs(x[0]) > 0.1:
            return x * np.nan  # not defined far from the orbit
        return x * (1.0 if t % 1.0 < 0.3 else 2.0)

    with pytest.warns(UndeclaredSwitch, match=r"jumps at t = 0\.3, not among"):
        from_rhs(rhs, 1, 1.0, orbit=[1e-3])


# Time


@pytest.mark.parametrize("start", [0.0, 0.3, 0.7, 1.9, -3.1, 14.3])
def test_flow_over_a_period_from_any_time(start):
    system = from_rhs(lambda t, x: [-x[0] * (2.0 if t % 2.0 > 0.7 else 1.0)], 1, 2.0, orbit=[0.0], switch_times=[0.7])
    state, derivative = system.flow(np.array([3.0]), start, start + 2.0)
    assert derivative[0, 0] == pytest.approx(exp(-3.3), rel=1e-12)
    assert state[0] == pytest.approx(3 * exp(-3.3), rel=1e-12)


def test_the_function_is_never_asked_at_a_switch():
    asked = []

    def rhs(t, x):
        asked.append(t)
        return -1.0 * x if t < 9.0 else x  # a branch, or it would be traced and never asked again

    system = from_rhs(rhs, 1, 2.0, switch_times=[0.5, 1.25], orbit=[0.0])
    asked.clear()
    system.flow(np.zeros(1), 0.0, 2.0)
    assert asked
    assert not {0.0, 0.5, 1.25, 2.0} & set(asked)
    assert min(asked) > 0.0
    assert max(asked) < 2.0


# What is refused

REFUSED = {
    "dimension 0": (oscillator, 0, 1.0, {}, "dimension"),
    "dimension 2.5": (oscillator, 2.5, 1.0, {}, "dimension"),
    "dimension too large": (oscillator, 3, 1.0, {}, "rhs"),
    "dimension too small": (oscillator, 1, 1.0, {}, "rhs"),
    "returns nothing": (lambda t, x: None, 2, 1.0, {}, "rhs"),
    "returns a ragged list": (lambda t, x: [x, 1.0], 2, 1.0, {}, "rhs"),
    "returns a matrix": (lambda t, x: np.eye(2), 2, 1.0, {}, "rhs"),
    "returns single precision": (lambda t, x: np.array(oscillator(t, x), np.float32), 2, 1.0, {}, "rhs"),
    "not a function": (3.0, 2, 1.0, {}, "rhs"),
    "takes no args": (oscillator, 2, 1.0, {"args": (1.0,)}, "rhs"),
    "args no tuple": (oscillator, 2, 1.0, {"args": 1.0}, "args"),
    "period negative": (oscillator, 2, -1.0, {}, "period"),
    "period zero": (oscillator, 2, 0.0, {}, "period"),
    "period nan": (oscillator, 2, np.nan, {}, "period"),
    "period infinite": (oscillator, 2, np.inf, {}, "period"),
    "period text": (oscillator, 2, "one", {}, "period"),
    "tolerance zero": (oscillator, 2, 1.0, {"tolerance": 0.0}, "tolerance"),
    "tolerance nan": (oscillator, 2, 1.0, {"tolerance": np.nan}, "tolerance"),
    "tolerance one": (oscillator, 2, 1.0, {"tolerance": 1.0}, "tolerance"),
    "switch outside": (oscillator, 2, 1.0, {"switch_times": [1.0]}, "switch_times"),
    "switch negative": (oscillator, 2, 1.0, {"switch_times": [-0.1]}, "switch_times"),
    "switch nan": (oscillator, 2, 1.0, {"switch_times": [np.nan]}, "switch_times"),
    "switch text": (oscillator, 2, 1.0, {"switch_times": "ab"}, "switch_times"),
    "switch table": (oscillator, 2, 1.0, {"switch_times": [[0.1, 0.2]]}, "switch_times"),
    "orbit too long": (oscillator, 2, 1.0, {"orbit": [0, 0, 0]}, "orbit"),
    "orbit a number": (oscillator, 2, 1.0, {"orbit": 0.0}, "orbit"),
    "orbit nan": (oscillator, 2, 1.0, {"orbit": [0, np.nan]}, "orbit"),
    "orbit text": (oscillator, 2, 1.0, {"orbit": "zero"}, "orbit"),
    "symmetry shape": (oscillator, 2, 1.0, {"symmetry": [[1.0]]}, "symmetry"),
    "symmetry of no finite order": (oscillator, 2, 1.0, {"symmetry": [[0, 1], [-1, 1.1]]}, "symmetry"),
    "spatial symmetry stretched": (oscillator, 2, 1.0, {"spatial_symmetry": 2 * np.eye(2)}, "spatial_symmetry"),
    "no symmetry of it": (hill(cos), 2, 2 * pi, {"symmetry": -np.eye(2)}, "symmetry"),
    "no mirror of it": (falling, 2, 1.0, {"spatial_symmetry": -np.eye(2)}, "spatial_symmetry"),
}


def test_a_random_right_hand_side_is_named():
    """As what it is, not as one of another period."""
    random = np.random.default_rng(0)
    with pytest.raises(ParameterError, match=r"^rhs: gives other values at the same time and state$"):
        from_rhs(lambda t, x: [x[1], random.normal() - float(x[0])], 2, 1.0)


def test_advice_names_what_is_not_set_yet(monkeypatch):
    """Too many steps of the implicit method, and a tolerance of zero."""
    monkeypatch.setattr("chilopod.flows.implicit.flow._MOST_WORK", 0.0)
    monkeypatch.setattr("chilopod.flows.implicit.flow._FEWEST_STEPS", 3)
    system = from_rhs(lambda t, x: [x[1], 50.0 * (1 - x[0] ** 2) * x[1] - x[0]], 2, 80.0, method="implicit")
    with pytest.raises(AnalysisError, match=r"too many steps, though they are implicit") as refused:
        system.flow(np.array([2.0, 0.1]), 0.0, 80.0)
    assert "method" not in str(refused.value)
    with pytest.raises(ParameterError, match=r"method = 'implict': is not known; did you mean 'implicit'\?"):
        from_rhs(lambda t, x: [-x[0]], 1, 1.0, method="implict")
    with pytest.raises(ParameterError, match=r"allowed: above 0 to 0\.001$"):
        from_rhs(oscillator, 2, 1.0, tolerance=0.0)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4, 1e-6])
def test_a_cube_passes_zero_at_any_tolerance(tolerance):
    def cube(t, x):
        return [x[1], -0.2 * x[1] - x[0] ** 3 + 0.3 * np.cos(t)]

    found = multipliers(from_rhs(cube, 2, 2.0 * pi, tolerance=tolerance), [1.0, 0.2])
    exact = multipliers(from_rhs(cube, 2, 2.0 * pi), [1.0, 0.2])
    assert (np.abs(found.values - exact.values) <= found.error_bounds + exact.error_bounds).all()
    assert found.error_bounds.max() < tolerance


@pytest.mark.parametrize("case", REFUSED)
def test_bad_arguments_are_one_line(case):
    rhs, dimension, period, options, field = REFUSED[case]
    with pytest.raises(ParameterError) as error:
        from_rhs(rhs, dimension, period, **options)
    assert error.value.field == field
    assert str(error.value).startswith(field)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_right_hand_side_that_is_not_finite_ends(bad, compiled):
    def rhs(t, x):
        return np.array([bad, 0.0]) * (1.0 + 0.0 * x[0])

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of whatever kind: it is the error that counts
        system = from_rhs(numba.njit(rhs) if compiled else rhs, 2, 1.0, orbit=[0, 0])
        with pytest.raises(AnalysisError):
            multipliers(system)


def test_a_motion_that_diverges_is_one_line():
    system = from_rhs(lambda t, x: [x[0] * x[0], -x[1]], 2, 1.0)
    with pytest.raises(AnalysisError) as error:
        multipliers(system, [10.0, 0.0])
    assert "\n" not in str(error.value)


def test_a_state_that_is_no_orbit_is_refused():
    def rhs(t, x):
        return [-x[0] + cos(t)]

    with pytest.raises(AnalysisError, match="must be a periodic orbit"):
        multipliers(from_rhs(rhs, 1, 2 * pi, orbit=[0.0]))
    found = multipliers(from_rhs(rhs, 1, 2 * pi), [0.0])
    assert found.orbit[0] == pytest.approx(0.5, abs=1e-13)  # x = (cos t + sin t) / 2


def test_symmetries_that_hold_are_accepted():
    system = from_rhs(hill(lambda t: 1 + cos(2 * t)), 2, 2 * pi, symmetry=-np.eye(2), spatial_symmetry=-np.eye(2))
    assert isinstance(system, PeriodicSystem)
    np.testing.assert_array_equal(system.symmetry, -np.eye(2))


def test_a_search_warns_once():
    def family(p):
        return from_rhs(lambda t, x: [(p - 2.0) * (fabs(x[0]) if x[0] > 0 else -fabs(x[0]))], 1, 1.0)

    with pytest.warns(NotAnalytic) as said:
        locate(family, (0.5, 0.6), orbit=[0.0])
    assert len(said) == 1
    assert said[0].filename == __file__


def test_symmetries_are_checked_at_every_value_of_a_family():
    """Options of a family are kept, but a symmetry may hold at one value alone, and options may change."""

    def pushed(t, x, push, rate=0.0):
        return [x[1], cos(t) - 0.1 * x[1] - x[0] ** 3 + push + rate * x[0] * np.cos(0.5 * t)]

    mirror = -np.eye(2)

    def of(*args, **options):
        return from_rhs(pushed, 2, 2 * pi, args=args, **options)

    kept = of(0.0, symmetry=mirror)
    with pytest.raises(ParameterError, match=r"symmetry.*fails at t"):
        of(0.1, symmetry=mirror)
    with pytest.raises(ParameterError, match=r"period.*fails at t"):
        of(0.0, 0.1)
    assert of(0.1).symmetry is None
    mirror[:] = np.eye(2)  # in place: the system keeps its own
    assert np.array_equal(kept.symmetry, -np.eye(2))
    with pytest.raises(ParameterError, match=r"symmetry.*fails at t"):
        of(0.0, symmetry=mirror)
    start, end = np.array([0.3, -0.2]), of(0.25).flow(np.array([0.3, -0.2]), 0.0, 1.0)[0]
    own = solve_ivp(lambda t, x: pushed(t, x, 0.25), (0.0, 1.0), start, rtol=1e-12, atol=1e-12).y[:, -1]
    assert np.abs(end - own).max() < 1e-10  # another system of the family has its own flow
    assert [of(0.0, orbit=each).orbit[0] for each in ([1.0, 0.0], (2.0, 0.0), np.array([3, 0]))] == [1.0, 2.0, 3.0]


@pytest.mark.parametrize("harmonic", [1e3, 1e5])
def test_a_fast_harmonic_has_the_period(harmonic):
    """At round fractions of the period it is zero but for the round-off of its argument."""
    system = from_rhs(lambda t, x: [np.sin(harmonic * t) - x[0]], 1, 2 * pi)
    (multiplier,) = multipliers(system, [0.0]).values
    assert multiplier.real == pytest.approx(exp(-2 * pi), abs=1e-11)


# Quotients 0 / 0


POWERS = np.arange(41)
NUMBERS = bernoulli(40) / factorial(POWERS)  # of u / (exp(u) - 1)
MINUS = NUMBERS * (-1.0) ** POWERS
SINE = np.where(POWERS % 2, 0.0, (-1.0) ** (POWERS // 2)) / factorial(POWERS + 1)
QUOTIENTS = {
    "expm1": (lambda u, k: u / np.expm1(u), NUMBERS),
    "rate of an ion channel": (lambda u, k: 0.2 * u / (1 - np.exp(-u / 5)), MINUS / 5.0**POWERS),
    "parameters": (lambda u, k: k * u / (1.0 - np.exp(-u / k)), MINUS),
    "sums": (lambda u, k: (0.3 - 0.1 * (u + 3.0)) / (np.exp(0.3 - 0.1 * (u + 3.0)) - 1.0), MINUS / 10.0**POWERS),
    "Goldman's current": (lambda u, k: u * (2.0 - np.exp(-u)) / (1.0 - np.exp(-u)), MINUS + np.eye(41)[1]),
    "sine": (lambda u, k: np.sin(u) / u, SINE),
}


@pytest.mark.parametrize("place", [0.01, 0.2])
@pytest.mark.parametrize("name", QUOTIENTS)
def test_a_motion_passes_a_quotient_of_zeros(name, place):
    """It is smooth at zero, where rounding spoils its Taylor series; against the polynomial there."""
    quotient, numbers = QUOTIENTS[name]

    def system(quotient, method="taylor"):
        def rhs(t, x, k):
            return [-0.3 * x[0] + 0.1 * quotient(x[0] - place, k) + np.cos(t)]

        return from_rhs(rhs, 1, 2 * pi, args=(1.0,), method=method)

    found = multipliers(system(quotient, "automatic" if name == "sine" else "taylor"), [0.1])
    exact = multipliers(system(lambda u, k: np.polynomial.polynomial.polyval(u, numbers)), [0.1])
    assert abs(found.values[0] - exact.values[0]) <= found.error_bound + exact.error_bound <= 1e-12


@pytest.mark.parametrize("near", [1e-6, 1e-8])
def test_a_close_encounter_is_no_quotient_of_zeros(near):
    """Kepler's orbit comes back, however short the steps at its pericentre are: Taylor series stay."""

    def rhs(t, x):
        cubed = (x[0] ** 2 + x[1] ** 2) ** 1.5
        return [x[2], x[3], -x[0] / cubed, -x[1] / cubed]

    start = np.array([2.0 - near, 0.0, 0.0, np.sqrt(near / (2.0 - near))])
    found, taylor = (
        from_rhs(rhs, 4, None, guess_period=2 * pi, method=method).flow(start, 0.0, 2 * pi)
        for method in ("automatic", "taylor")
    )
    np.testing.assert_array_equal(found[0], taylor[0])
    np.testing.assert_array_equal(found[1], taylor[1])
    np.testing.assert_allclose(found[0], start, atol=1e-6)


def test_a_quotient_of_zeros_is_named_where_nothing_passes_it():
    """Beside an event, which the implicit method does not know; not so a pole."""
    event = Event(lambda t, x: x[0] - 5.0)
    for term, said in ((lambda u: np.sin(u) / u, "divides 0 by 0"), (lambda u: 1.0 / u, "a singularity|not finite")):
        system = from_rhs(lambda t, x, f=term: [f(x[0] - 0.1) + 1.0], 1, 2 * pi, events=[event])
        with pytest.raises(AnalysisError, match=said):
            system.flow(np.array([0.1]), 0.0, 1.0)
