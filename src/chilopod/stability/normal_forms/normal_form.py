"""Normal-form coefficients at a bifurcation, from evaluations of the return map.

Near the critical orbit the return map H is sampled along the critical mode, bent by its quadratic part outside the
critical space; this gives the terms of second and third order on the critical space (Kuznetsov, *Elements of Applied
Bifurcation Theory*, sections 5.4, 8.7 and 9.2). Only H is needed: no derivatives of the right-hand side by hand and no
symbolic algebra. The series of H determine the amplitude at which it is sampled, so any units give the same digits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.flows.balance import numerical_balance
from chilopod.stability.normal_forms.amplitude import Fit, NormalFormStatus, fitted
from chilopod.stability.normal_forms.center_manifold import CriticalOrbit, ReturnedStates, images

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
_START = 0.2  # first amplitude of the search, relative to the scale of the states


@dataclass(frozen=True)
class NormalForm:
    """Leading coefficients of the map over one period of the orbit, or over two at a period doubling, on the critical
    space.

    With a the amplitude along the unit critical mode: real multiplier +1, a -> a + quadratic a^2 + cubic a^3. A
    multiplier -1 of the return map: the same, of the first map that has +1 again. That is the map over one period where
    a period is an even number of returns (a pitchfork that breaks a symmetry in time). Else it is the map over two
    periods (a period doubling): where one period maps a to -a + b a^2 + d a^3, ``cubic`` is -2 (b^2 + d), and
    ``quadratic`` is zero. Neimark-Sacker (state = 2 Re(a mode)): |a| -> |a| + cubic |a|^3,
    while the phase of a advances by that of the multiplier + rotation |a|^2.

    A mode k times as long (through a change of units) has amplitudes 1/k as large, so coefficients k times (quadratic)
    and k^2 times as large (cubic, rotation).

    Attributes
    ----------
    status
        Status of the numbers. If it is neither FOUND nor LINEAR they are NaN with infinite errors, except at the
        resonances 1:3 and 1:4, where they belong to Kuznetsov's normal form but decide nothing alone.
    quadratic, cubic
        Coefficients. A negative ``cubic`` bounds the growth: supercritical.
    rotation
        Change of phase in rad per period; 0 unless the critical multipliers are complex.
    quadratic_error, cubic_error, rotation_error
        Bounds on their errors: noise of the map, truncation, and error of the orbit.
    amplitude
        Largest amplitude at which the map was sampled for these numbers.
    resonance
        Number k, 1 to 4, if the pair is exp(+-2 pi i / k) within its uncertainty; else None.
    resonant, resonant_error
        Coefficient of conj(a)^2 (1:3) or conj(a)^3 (1:4) of one return; it turns with the phase of the mode.
        ratio
        At 1:4: A = -i C / |D| of Kuznetsov, section 9.5.3, with C and D the coefficients of a |a|^2 and conj(a)^3.
    """

    status: NormalFormStatus
    quadratic: float = np.nan
    quadratic_error: float = np.inf
    cubic: float = np.nan
    cubic_error: float = np.inf
    rotation: float = 0.0
    rotation_error: float = 0.0
    amplitude: float = np.nan
    resonance: int | None = None
    resonant: complex | None = None
    resonant_error: float | None = None
    ratio: complex | None = None


def normal_form(
    mapped: ReturnedStates,
    at: CriticalOrbit,
    *,
    noise: float = 0.0,
    uncertainty: float = 0.0,
    scale: ArrayLike | None = None,
    orbit_error: float | None = None,
) -> NormalForm:
    """Normal form on the centre manifold of a critical orbit.

    Parameters
    ----------
    mapped, at
        Return map of several states, shape (k, n), and the critical orbit.
    noise, uncertainty
        Relative errors of the map, beside round-off and the noise of the samples, and of its derivative.
    scale
        Sizes of the states, shape (n,), where the search for an amplitude starts; by default the size of the orbit.
    orbit_error
        Error of the orbit along the mode; by default from its residual and the noise, large near a singular
        H - 1.
    """
    values, errors = _uncertainties(at.jacobian, max(uncertainty, noise, 16.0 * np.finfo(float).eps))
    own = [int(np.abs(values - one).argmin()) for one in (at.multiplier, at.multiplier.conjugate())]
    others = np.delete(np.arange(values.size), own)
    if (np.abs(np.abs(values[others]) - 1.0) <= errors[others]).any():
        return NormalForm(NormalFormStatus.SEVERAL_CRITICAL)
    resonance = None
    if not at.real:  # where the terms z^(k-1) of the conjugate are resonant as well: Kuznetsov, sections 9.5.1 to 9.5.4
        upper = complex(at.multiplier.real, abs(at.multiplier.imag))
        near = (k for k in (1, 2, 3, 4) if abs(upper - np.exp(2j * np.pi / k)) <= errors[own[0]])
        resonance = next(near, None)
    if resonance in (1, 2):
        return NormalForm(NormalFormStatus.STRONG_RESONANCE, resonance=resonance)
    # An overflow far out is a valid result.
    with np.errstate(all="ignore"):
        fit = fitted(mapped, at, noise, resonance, _start(at, scale))
    if fit is None:
        return NormalForm(NormalFormStatus.OUT_OF_REACH, resonance=resonance)
    if at.real:
        return _of_full_period(fit, mapped, at, noise, orbit_error)
    cubic = at.returns * np.conj(at.multiplier) * fit.cubic
    error = at.returns * fit.cubic_error
    real, turning, radius = float(cubic.real), float(cubic.imag), fit.sampled.radius
    form = NormalForm(fit.status, 0.0, 0.0, real, error, turning, error, radius, resonance=resonance)
    return form if resonance is None else _with_resonant_terms(form, fit, at, resonance)


def _uncertainties(jacobian: Array, relative: float) -> tuple[NDArray[np.complex128], Array]:
    """Eigenvalues of a matrix and bounds on their errors, shape (n,) both, for a relative error of the matrix.

    Norms are those of the balanced matrix, so that units do not matter.
    """
    units = numerical_balance(jacobian)
    balanced = jacobian * units / units[:, None]
    values, right = np.linalg.eig(balanced)
    try:
        left = np.linalg.inv(right).conj().T
    except np.linalg.LinAlgError:
        left = np.full(right.shape, np.inf)
    error = relative * np.linalg.norm(balanced)
    # To first order the condition gives each error, but even for a defective pair it is at most the square root.
    condition = np.linalg.norm(right, axis=0) * np.linalg.norm(left, axis=0)
    return values.astype(np.complex128), np.minimum(error * condition, np.sqrt(error))


def _start(at: CriticalOrbit, scale: ArrayLike | None) -> float:
    """First amplitude of the search; the result does not depend on it."""
    mode = np.abs(at.right)
    if scale is not None:
        known = mode > 0.0
        return _START * float((np.abs(np.asarray(scale, dtype=np.float64))[known] / mode[known]).min())
    orbit = float(np.abs(at.state).max())
    # An orbit at the origin gives no scale: the search may then take many steps up or down.
    return orbit / float(mode.max()) if orbit > 0.0 else _START


def _loose_by(mapped: ReturnedStates, at: CriticalOrbit, noise: float, quadratic: float, cubic: float) -> float:
    """Error along the mode of an orbit with this residual, where H - 1 is singular.

    At a distance d from the symmetric orbit of a pitchfork the residual is at least cubic d^3, with an apparent
    quadratic term 3 cubic d; beside a transcritical point it is quadratic d^2.
    """
    image = None if at.multiplier.real < 0.0 else images(mapped, at, np.zeros((1, at.state.size)))
    if image is None:
        return 0.0
    rounding = max(noise, 2.0 * np.finfo(float).eps) * np.abs(at.state)
    missed = float(abs(image[0] @ at.left)) + float(np.abs(at.left) @ rounding)
    if missed == 0.0:
        return 0.0
    by_cubic = float(1.5 * np.cbrt(missed / cubic)) if cubic > 0.0 else np.inf
    # A quadratic term that no near pitchfork explains bounds the error more closely.
    return min(by_cubic, 2.0 * float(np.sqrt(missed / quadratic))) if quadratic > 6.0 * cubic * by_cubic else by_cubic


def _of_full_period(
    fit: Fit, mapped: ReturnedStates, at: CriticalOrbit, noise: float, orbit_error: float | None
) -> NormalForm:
    """Coefficients of the map with multiplier +1 from those of one return at a real multiplier."""
    quadratic, quadratic_error = fit.sampled.term((2, 0))
    cubic, cubic_error = fit.cubic.real, fit.cubic_error
    fourth, fourth_error = fit.sampled.term((4, 0))
    off = orbit_error
    if off is None:
        off = _loose_by(mapped, at, noise, abs(quadratic), abs(cubic) + cubic_error)
    if off > 0.0:
        quadratic_error += 3.0 * (abs(cubic) + cubic_error) * off
        cubic_error += 4.0 * (abs(fourth) + fourth_error) * off
    k = at.returns
    if at.multiplier.real < 0.0:
        # a -> -a + c a^3 twice: a -> a - 2 c a^3.
        times = k if k % 2 == 0 else 2 * k
        return NormalForm(fit.status, 0.0, 0.0, -times * cubic, times * cubic_error, amplitude=fit.sampled.radius)
    cubic = k * cubic + k * (k - 1) * quadratic.real**2
    cubic_error = k * cubic_error + k * (k - 1) * (2.0 * abs(quadratic) + quadratic_error) * quadratic_error
    quadratic_value, quadratic_error = k * quadratic.real, k * quadratic_error
    return NormalForm(fit.status, quadratic_value, quadratic_error, cubic, cubic_error, amplitude=fit.sampled.radius)


def _with_resonant_terms(form: NormalForm, fit: Fit, at: CriticalOrbit, resonance: int) -> NormalForm:
    """The terms conj(a)^2 and conj(a)^3 of one return."""
    resonant, error = fit.sampled.term((0, resonance - 1))
    ratio = None
    if resonance == 4 and abs(resonant) > error:
        ratio = complex(-1j * fit.cubic / abs(resonant))
    form = replace(form, status=NormalFormStatus.STRONG_RESONANCE, ratio=ratio)
    return replace(form, resonant=complex(resonant), resonant_error=float(error))
