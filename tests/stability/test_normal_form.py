"""The normal form from a map alone: errors that hold, any units, and a reason where there is none."""

import numpy as np
import pytest

from chilopod.errors import AnalysisError
from chilopod.stability import Event, Kind, from_map, from_rhs, locate
from chilopod.stability.normal_forms.manifold import CriticalOrbit
from chilopod.stability.normal_forms.normal_form import NormalFormStatus, normal_form
from chilopod.stability.points import Criticality, criticality, kind_at_plus_one
from chilopod.stability.returns import ReturnMap


def at_origin(jacobian, multiplier, right=None, left=None, returns=1):
    n = len(jacobian)
    first = np.eye(n)[0]
    return CriticalOrbit(
        np.zeros(n),
        ReturnMap(np.zeros(n), np.array(jacobian, dtype=float), 0.0, returns, 1.0),
        complex(multiplier),
        np.asarray(first if right is None else right, dtype=complex),
        np.asarray(first if left is None else left, dtype=complex),
    )


def pair(angle):
    """A turn by an angle, its multiplier and vectors; z = x + iy is twice the amplitude over sqrt 2."""
    c, s = np.cos(angle), np.sin(angle)
    mode = np.array([1.0, -1j]) / np.sqrt(2)
    return at_origin([[c, -s], [s, c]], np.exp(1j * angle), mode, mode)


def in_plane(image_of):
    """A map of the plane from one of complex numbers."""

    def mapped(states):
        z = image_of(states[:, 0] + 1j * states[:, 1])
        return np.stack([z.real, z.imag], axis=1)

    return mapped


def assert_holds(found, error, expected, within):
    assert abs(found - expected) <= error <= within * abs(expected)


@pytest.mark.parametrize("size", [1e-12, 1e-3, 1.0, 1e9])
def test_the_amplitude_is_found_on_every_scale(size):
    form = normal_form(lambda x: x / np.sqrt(1.0 + 2.0 * (x / size) ** 2), at_origin([[1.0]], 1.0))
    assert form.status is NormalFormStatus.FOUND
    assert_holds(form.cubic, form.cubic_error, -1.0 / size**2, 1e-7)
    assert kind_at_plus_one(form) is Kind.PITCHFORK


def test_the_scale_may_be_given():
    form = normal_form(lambda x: x - (x / 1e-7) ** 3, at_origin([[1.0]], 1.0), scale=[1e-7])
    assert_holds(form.cubic, form.cubic_error, -1e21, 1e-9)


def test_units_of_the_states_do_not_matter():
    """A coupling that leaves the mode and comes back, in states whose units differ by up to 1e18."""
    random = np.random.default_rng(3)
    jacobian = np.array([[1.0, 0.0, 0.0], [0.0, 0.4, 0.3], [0.0, -0.2, 0.5]])

    def mapped(x):
        a, b, c = x.T
        return np.stack([a + a * b - a**3, 0.4 * b + 0.3 * c + a**2, -0.2 * b + 0.5 * c - 0.7 * a**2], axis=1)

    stretch = np.linalg.solve(np.eye(2) - jacobian[1:, 1:], [1.0, -0.7])
    for units in [np.ones(3), *10.0 ** random.uniform(-9, 9, (6, 3))]:
        at = at_origin(units[:, None] * jacobian / units, 1.0)
        form = normal_form(lambda x, units=units: mapped(x / units) * units, at)
        assert_holds(form.cubic, form.cubic_error, (stretch[0] - 1.0) / units[0] ** 2, 1e-7)


def test_a_term_that_only_the_bent_curve_sees():
    def mapped(x):
        return np.stack([x[:, 0] + x[:, 0] * x[:, 1], 0.5 * x[:, 1] + x[:, 0] ** 2], axis=1)

    form = normal_form(mapped, at_origin(np.diag([1.0, 0.5]), 1.0))
    assert_holds(form.cubic, form.cubic_error, 2.0, 1e-9)


@pytest.mark.parametrize(("returns", "times"), [(1, 2), (2, 2), (3, 6), (4, 4)])
def test_returns_at_minus_one(returns, times):
    """An even number of returns is the period; after an odd one two periods are needed for a multiplier +1."""
    form = normal_form(lambda x: -x + 0.7 * x**3, at_origin([[-1.0]], -1.0, returns=returns))
    assert_holds(form.cubic, form.cubic_error, -times * 0.7, 1e-7)


@pytest.mark.parametrize("returns", [1, 2, 3])
def test_returns_at_plus_one(returns):
    def mapped(x):
        return x + 0.3 * x**2 - 0.5 * x**3

    form = normal_form(mapped, at_origin([[1.0]], 1.0, returns=returns), orbit_error=0.0)
    over_a_period = np.polynomial.Polynomial([0.0, 1.0])
    for _ in range(returns):
        over_a_period = mapped(over_a_period)
    assert_holds(form.quadratic, form.quadratic_error, over_a_period.coef[2], 1e-7)
    assert_holds(form.cubic, form.cubic_error, over_a_period.coef[3], 1e-7)
    assert kind_at_plus_one(form) is Kind.TRANSCRITICAL


def test_an_orbit_off_by_a_little_beside_a_pitchfork_is_not_transcritical():
    """x - x^3 around a point beside its fixed point has a quadratic term, and returns to round-off all the same."""
    off = 1e-6
    image = ReturnMap(np.array([off]), np.array([[1.0 - 3.0 * off**2]]), 0.0, 1, 1.0)
    at = CriticalOrbit(np.array([off]), image, 1.0 + 0j, np.ones(1), np.ones(1))
    form = normal_form(lambda x: x - x**3, at)
    assert abs(form.quadratic) <= form.quadratic_error < 1e-3
    assert kind_at_plus_one(form) is Kind.PITCHFORK


def test_a_map_that_cannot_be_evaluated_far_out():
    def mapped(x):
        if (np.abs(x) > 1e-5).any():
            raise AnalysisError("diverges")
        return x - x**3 / 1e-8

    form = normal_form(mapped, at_origin([[1.0]], 1.0))
    assert_holds(form.cubic, form.cubic_error, -1e8, 1e-4)


def nowhere(x):
    raise AnalysisError("diverges")


def kinked(x):
    return x - x * np.abs(x) ** 0.5


def noisy(x):
    return x * (1.0 + 1e-2 * np.sin(1e5 * x / np.abs(x).max(initial=1e-300)))


def test_a_map_without_values_has_no_normal_form():
    form = normal_form(nowhere, at_origin([[1.0]], 1.0))
    assert form.status is NormalFormStatus.OUT_OF_REACH
    assert np.isnan(form.cubic)
    assert criticality(form) is Criticality.NOT_COMPUTED
    assert kind_at_plus_one(form) is Kind.BRANCH_POINT


@pytest.mark.parametrize("mapped", [kinked, noisy])
def test_of_a_map_that_is_no_power_series_nothing_is_claimed(mapped):
    form = normal_form(mapped, at_origin([[1.0]], 1.0))
    assert not abs(form.cubic) > form.cubic_error
    assert kind_at_plus_one(form) is Kind.BRANCH_POINT


def test_a_linear_map_is_called_so():
    calls = []

    def mapped(x):
        calls.append(len(x))
        return -x

    form = normal_form(mapped, at_origin([[-1.0]], -1.0))
    assert form.status is NormalFormStatus.LINEAR
    assert abs(form.cubic) <= form.cubic_error
    assert sum(calls) <= 32


def undefined_beyond(x, border):
    if (np.abs(x) > border).any():
        raise AnalysisError("diverges")
    return -x


def kinked_beyond(x, border):
    return -np.minimum(x, border)


def jumping_beyond(x, border):
    return np.where(np.abs(x) < border, -x, 5.0 + x)


@pytest.mark.parametrize("border", [0.3, 1e-3, 1e-9])
@pytest.mark.parametrize("mapped", [undefined_beyond, kinked_beyond, jumping_beyond])
def test_a_map_that_is_linear_up_to_a_border_is_called_so(mapped, border):
    form = normal_form(lambda x: mapped(x, border), at_origin([[-1.0]], -1.0))
    assert form.status is NormalFormStatus.LINEAR
    assert 0.99 * form.amplitude <= border  # samples lie below the amplitude
    assert abs(form.cubic) <= form.cubic_error


@pytest.mark.parametrize("ramp", [0.0, 0.1, 0.3])
def test_a_current_mode_converter_has_an_affine_return_map(ramp):
    """The clock closes the switch, and the current opens it at 2 - ramp t, as far as both happen in every period."""
    on = Event(lambda t, x: np.sin(2.0 * np.pi * (t - 0.1)), lambda t, x: [x[0], 1.0], direction=1)
    off = Event(
        lambda t, x: x[0] - 2.0 + ramp * ((t - 0.1) % 1.0) + 100.0 * (x[1] - 1.0), lambda t, x: [x[0], 0.0], direction=1
    )

    def converter(slope):
        return from_rhs(lambda t, x: [np.where(x[1] > 0.5, 1.0, -slope), 0.0 * x[1]], 2, 1.0, events=[on, off])

    (point,) = locate(converter, (0.7, 2.0), orbit=[1.6, 0.0])
    assert point.value == pytest.approx(1.0 + 2.0 * ramp, abs=1e-12)
    assert point.normal_form.status is NormalFormStatus.LINEAR
    assert point.criticality is Criticality.UNDECIDED
    assert abs(point.coefficient) <= point.coefficient_error < 1e-6


@pytest.mark.parametrize("other", [-1.0, 1.0])
def test_a_second_critical_multiplier(other):
    jacobian = np.diag([1.0, other, 0.3])
    form = normal_form(lambda x: x @ jacobian - x**3, at_origin(jacobian, 1.0))
    assert form.status is NormalFormStatus.SEVERAL_CRITICAL
    assert criticality(form) is Criticality.NOT_COMPUTED


@pytest.mark.parametrize("k", [3, 4])
def test_strong_resonances_claim_no_verdict(k):
    """z' = nu (z + c z |z|^2) + d conj(z)^(k-1): Kuznetsov, sections 9.5.3 and 9.5.4."""
    c, d = -0.3 + 0.2j, 0.4 - 0.7j
    nu = np.exp(2j * np.pi / k)
    form = normal_form(
        in_plane(lambda z: nu * (z + c * z * np.abs(z) ** 2) + d * z.conj() ** (k - 1)), pair(2 * np.pi / k)
    )
    assert (form.status, form.resonance) == (NormalFormStatus.STRONG_RESONANCE, k)
    assert criticality(form) is Criticality.NOT_COMPUTED
    assert np.isnan(form.cubic)


@pytest.mark.parametrize(("k", "sign"), [(1, 1.0), (2, -1.0)])
def test_at_one_to_one_and_one_to_two_there_is_no_cubic_coefficient(k, sign):
    """A Jordan block but for round-off: its eigenvalues are 1e-8 apart, and not known any better."""
    jacobian = sign * np.array([[1.0, 1.0], [-1e-16, 1.0]])
    values, right = np.linalg.eig(jacobian)
    left = np.linalg.inv(right).conj().T
    at = at_origin(jacobian, values[0] / abs(values[0]), right[:, 0], left[:, 0])
    form = normal_form(lambda x: x @ jacobian.T - x**3, at)
    assert (form.status, form.resonance) == (NormalFormStatus.STRONG_RESONANCE, k)
    assert np.isnan(form.cubic)
    assert criticality(form) is Criticality.NOT_COMPUTED


@pytest.mark.parametrize("distance", [1e-1, 1e-2, 1e-3, 1e-4, 1e-6])
def test_beside_one_to_three_the_errors_grow(distance):
    """z' = nu z + d conj(z)^2 + ...: the cubic term that d makes has the distance to 1:3 in its denominator."""
    angle, c, d = 2 * np.pi / 3 + distance, -0.3 + 0.2j, 0.4 - 0.7j
    nu = np.exp(1j * angle)
    form = normal_form(in_plane(lambda z: nu * (z + c * z * np.abs(z) ** 2) + d * z.conj() ** 2), pair(angle))
    # z = u + h conj(u)^2 with h (conj(nu)^2 - nu) = d; on returning, 2 d conj(u) conj(h) u^2.
    h = d / (nu.conj() ** 2 - nu)
    expected = 2 * (c + nu.conj() * 2 * d * h.conj())
    assert abs(form.cubic - expected.real) <= form.cubic_error
    assert abs(form.rotation - expected.imag) <= form.rotation_error < 0.01 * abs(expected)


@pytest.mark.parametrize("distance", [1e-3, 1e-6, 3e-7, 1e-7])
def test_beside_one_to_two_the_errors_include_those_of_the_modes(distance):
    """A slanted turn by nearly pi, whose modes rounding turns; coefficients from modes in closed form (Kuznetsov)."""
    c, s, quadratic, cubic = -np.cos(distance), np.sin(distance), 0.9, 0.4
    slant = np.array([[1.0, 0.7], [0.0, 1.0]])
    turn = slant @ np.array([[c, -s], [s, c]]) @ np.linalg.inv(slant)
    half, one = (turn[0, 0] - turn[1, 1]) / 2.0, np.eye(2)
    root = 1j * np.sqrt(-half * half - turn[0, 1] * turn[1, 0])
    nu = np.trace(turn) / 2.0 + root
    mode, left = np.array([turn[0, 1], root - half]), np.array([turn[1, 0], root - half])
    mode = mode / np.linalg.norm(mode)
    left = left / (left @ mode)

    def twice(u, v):
        return np.array([0.0, 2.0 * quadratic * u[0] * v[0]])

    third = np.array([0.0, 6.0 * cubic * mode[0] ** 2 * mode[0].conj()])
    third = third + 2.0 * twice(mode, np.linalg.solve(one - turn, twice(mode, mode.conj())))
    third += twice(mode.conj(), np.linalg.solve(nu**2 * one - turn, twice(mode, mode)))
    expected = left @ third / nu / 2.0

    def family(p):
        def image(x):
            slope = 2.0 * quadratic * x[0] + 3.0 * cubic * x[0] ** 2
            bent = [0.0, quadratic * x[0] ** 2 + cubic * x[0] ** 3]
            return (1.0 + p) * turn @ x + bent, (1.0 + p) * turn + [[0.0, 0.0], [slope, 0.0]]

        return from_map(image, 2, orbit=np.zeros(2), scale=np.ones(2))

    (point,) = locate(family, (-0.1, 0.1))
    assert abs(point.coefficient - expected.real) <= point.coefficient_error
    assert abs(point.rotation - expected.imag) <= point.rotation_error < 1e-6
