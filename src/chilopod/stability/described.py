"""What happens where multipliers are known to be on the unit circle: kind, error bound, modes and normal form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from chilopod.errors import AnalysisError
from chilopod.stability.branches.fold import Fold
from chilopod.stability.floquet import Spectrum, phased, spectrum
from chilopod.stability.normal_forms.center_manifold import CriticalOrbit
from chilopod.stability.normal_forms.normal_form import NormalForm
from chilopod.stability.normal_forms.normal_form import normal_form as normal_form_of
from chilopod.stability.orbits import Orbit, bounded, from_known
from chilopod.stability.points import BifurcationPoint, Kind, kind_at_plus_one, with_coefficients
from chilopod.stability.returns import returned_states
from chilopod.stability.samples import Samples
from chilopod.stability.scales import sizes
from chilopod.stability.singular import past_singular
from chilopod.stability.symmetry.equivariants import Critical, SymmetricCrossing, symmetric_crossing
from chilopod.stability.symmetry.isotypic import Block
from chilopod.stability.unit_circle.crossings import Crossing
from chilopod.stability.unit_circle.spectra import Event

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_SAFETY = 1.5
_SLOPE_STEP = 1e-6  # of the interval
_TOUCH_STEP = 1e-3
_DRAWS = 8
_EPSILON = float(np.finfo(float).eps)

_TARGETS = {Event.MINUS: -1.0, Event.PLUS: 1.0}
_CRITICAL = {Event.MINUS: Critical.MINUS, Event.PLUS: Critical.PLUS, Event.PAIR: Critical.PAIR}


def describe(samples: Samples, crossing: Crossing, block: Block | None, with_normal_form: bool) -> BifurcationPoint:
    """A bifurcation point where multipliers cross.

    Parameters
    ----------
    samples
        The family.
    crossing
        Where, and how many.
    block
        In which block of the return map, if spatial symmetries split it.
    with_normal_form
        Whether to compute coefficients and a verdict.
    """
    # A mode that breaks a symmetry is no part of the orbit, which is regular among those that have it.
    regular = past_singular(samples, crossing) if block is None or block.trivial else None
    if regular is None:
        value, bound = crossing.value, 0.0
        orbit = _orbit(samples, value)
    else:
        value, bound, orbit = regular
    spec = spectrum(orbit.image)
    repeated = 1 if block is None else block.repeated
    critical = _nearest(spec, crossing.event, crossing.multiplier, crossing.multiplicity * repeated)
    nu = complex(spec.values[critical[0]])
    if regular is None:
        bound = _bound(samples, crossing, orbit, spec, critical)
    bound += 4.0 * _EPSILON * abs(value)
    mode, left = phased(spec.right[:, critical[0]], spec.left[:, critical[0]])
    frequency, k = 0.0, orbit.image.returns
    if crossing.event is Event.PAIR:
        angle = float(np.angle(np.exp(1j * k * np.angle(nu))))
        # Of a conjugate pair, the mode that turns with positive frequency.
        if angle < 0:
            nu, mode, left, angle = nu.conjugate(), mode.conj(), left.conj(), -angle
        frequency = angle / orbit.period
    elif crossing.event is Event.MINUS and k % 2:
        frequency = np.pi / orbit.period
    simple = critical.size == (2 if crossing.event is Event.PAIR else 1)
    form = None
    # At +1 the kind itself is told by the normal form, or by a symmetry that is broken.
    asked = with_normal_form or (crossing.event is Event.PLUS and (block is None or block.trivial))
    if simple and asked and not crossing.collision:
        exact = nu / abs(nu) if crossing.event is Event.PAIR else complex(_TARGETS[crossing.event])
        form = _form(samples, value, orbit, exact, mode, left)
    symmetry = None if block is None else symmetric_crossing(block, _CRITICAL[crossing.event])
    # Where an orbit is lost the point may be the fold that it ends in.
    lost = samples.end < samples.low + samples.width and value + bound >= samples.end
    point = BifurcationPoint(
        _kind(crossing, k, None if lost else form, block, symmetry),
        value,
        float(bound),
        orbit.state,
        mode,
        nu,
        frequency,
        period=orbit.period,
        multiplicity=critical.size,
        symmetry=symmetry,
    )
    if not simple:
        return replace(point, modes=_modes(spec, critical, orbit, block, symmetry))
    return with_coefficients(point, form) if form is not None and with_normal_form else point


def fold_point(fold: Fold, samples: Samples, with_normal_form: bool) -> BifurcationPoint:
    """The fold that a followed orbit ends in."""
    spec = spectrum(fold.image)
    critical = _nearest(spec, Event.PLUS, 1.0 + 0.0j, 1)[0]
    mode, left = phased(spec.right[:, critical], spec.left[:, critical])
    orbit = Orbit(fold.image.state, fold.image, np.zeros(fold.image.state.size))
    form = _form(samples, fold.value, orbit, 1.0 + 0.0j, mode, left) if with_normal_form else None
    return BifurcationPoint(
        Kind.FOLD,
        fold.value,
        fold.error_bound,
        fold.image.state,
        mode,
        complex(spec.values[critical]),
        0.0,
        normal_form=form,
        period=fold.image.period,
    )


def _orbit(samples: Samples, value: float) -> Orbit:
    """The orbit at a value, with error bounds."""
    sample = samples.at(np.array([value]))[0]
    system = samples.family(value)
    if samples.known:
        return from_known(system, sample.orbit)
    return bounded(system, sample.orbit, sample.image)


def _nearest(spec: Spectrum, event: Event, multiplier: complex, count: int) -> NDArray[np.intp]:
    """Indices of the multipliers that are critical, the nearest first."""
    if event is not Event.PAIR:
        return np.argsort(np.abs(spec.values - _TARGETS[event]), kind="stable")[:count]
    # Of both of a pair, the one asked for first.
    distance = np.minimum(np.abs(spec.values - multiplier), np.abs(spec.values - multiplier.conjugate()))
    order = np.lexsort((np.abs(spec.values - multiplier), np.round(distance, 12)))
    return order[:count]


def _bound(samples: Samples, crossing: Crossing, orbit: Orbit, spec: Spectrum, critical: NDArray[np.intp]) -> float:
    """Error of the value: of the critical multipliers over their rate of change."""
    width = 0.5 * (crossing.bracket[1] - crossing.bracket[0])
    matrix = orbit.image.jacobian
    if crossing.collision:
        return width + _collision_bound(samples, crossing, orbit)
    nu = spec.values[critical]
    off = np.abs(nu - _TARGETS[crossing.event]) if crossing.event is not Event.PAIR else np.abs(np.abs(nu) - 1.0)
    uncertain = float((spec.error[critical] + off).max())
    try:
        beside, step = _beside(samples, crossing.value, _SLOPE_STEP)
    except AnalysisError:
        return np.inf
    # d nu = left^H dH' right, which holds however close another multiplier is; of several, the slowest.
    left, right = spec.left[:, critical], spec.right[:, critical]
    if crossing.event is Event.PAIR:
        moved = np.einsum("ik,ij,jk->k", left.conj(), beside - matrix, right)
        slope = float(np.abs((nu.conj() * moved).real / np.abs(nu)).min()) / step
    else:
        slope = float(np.abs(np.linalg.eigvals(left.conj().T @ (beside - matrix) @ right)).min()) / step
    if crossing.change == 0 and crossing.multiplicity <= 2:
        touched = _touch_bound(samples, crossing, uncertain)
        return width + (min(touched, _SAFETY * uncertain / slope) if slope > 0.0 else touched)
    return width + (_SAFETY * uncertain / slope if slope > 0.0 else np.inf)


def _beside(samples: Samples, value: float, part: float) -> tuple[Array, float]:
    step = part * samples.width
    if value + step > samples.end:
        step = -step
    return samples.at(np.array([value + step]))[0].image.jacobian, abs(step)


def _touch_bound(samples: Samples, crossing: Crossing, uncertain: float) -> float:
    """Of a multiplier that touches the circle and turns back: its distance is a parabola."""
    step = _TOUCH_STEP * samples.width
    try:
        found = samples.at(np.clip(crossing.value + step * np.array([-1.0, 0.0, 1.0]), samples.low, samples.end))
    except AnalysisError:
        return np.inf
    away = []
    for each in found:
        values = np.linalg.eigvals(each.image.jacobian)
        away.append(float(np.abs(values[np.abs(values - crossing.multiplier).argmin()])))
    # The step is left out of the root: its square may be no number.
    bend = abs(away[0] - 2.0 * away[1] + away[2])
    return _SAFETY * step * float(np.sqrt(2.0 * uncertain / bend)) if bend > 0.0 else np.inf


def _collision_bound(samples: Samples, crossing: Crossing, orbit: Orbit) -> float:
    """Where two multipliers meet they move as a square root, but their product does not: det(H' - nu), or the squared
    difference of nu + 1/nu of two pairs, by how uncertain and how steep it is."""
    matrix = orbit.image.jacobian
    error = np.broadcast_to(orbit.image.error, matrix.shape) + 4.0 * _EPSILON * np.abs(matrix)
    random = np.random.default_rng(0)
    here = _collision(matrix, crossing)
    disturbed = [
        _collision(matrix + error * random.choice([-1.0, 1.0], matrix.shape), crossing) - here for _ in range(_DRAWS)
    ]
    beside, step = _beside(samples, crossing.value, _SLOPE_STEP)
    slope = abs(_collision(beside, crossing) - here) / step
    uncertain = 3.0 * float(np.abs(disturbed).max()) + abs(here)
    return _SAFETY * uncertain / slope if slope > 0.0 else np.inf


def _collision(matrix: Array, crossing: Crossing) -> float:
    values = np.linalg.eigvals(matrix).astype(np.complex128)
    if crossing.event is not Event.PAIR:
        near = np.argsort(np.abs(values - _TARGETS[crossing.event]))[:2]
        return float(np.prod(values[near] - _TARGETS[crossing.event]).real)
    sums = values + 1.0 / values
    critical = crossing.multiplier + 1.0 / crossing.multiplier
    a, *others = sums[np.argsort(np.abs(sums - critical))]
    # Both of a pair have the same sum: the next pair is two further on.
    return float(((a - others[1]) ** 2).real)


def _kind(
    crossing: Crossing, returns: int, form: NormalForm | None, block: Block | None, symmetry: SymmetricCrossing | None
) -> Kind:
    if crossing.collision:
        return Kind.KREIN_COLLISION if crossing.event is Event.PAIR else Kind.COLLISION
    if crossing.event is Event.PAIR:
        return Kind.NEIMARK_SACKER
    if crossing.event is Event.MINUS:
        return Kind.PERIOD_DOUBLING if returns % 2 else Kind.PITCHFORK
    if block is not None and symmetry is not None and not block.trivial:
        return Kind.PITCHFORK if symmetry.quadratic == 0 else Kind.TRANSCRITICAL
    # The orbit was sampled on both sides, so it does not end in a fold here.
    return kind_at_plus_one(form) if form is not None else Kind.BRANCH_POINT


def _modes(
    spec: Spectrum, critical: NDArray[np.intp], orbit: Orbit, block: Block | None, symmetry: SymmetricCrossing | None
) -> ComplexArray:
    """Of several critical multipliers: along the axial branches where a symmetry makes them several, else as they
    come."""
    if block is None or symmetry is None or not symmetry.branches or critical.size > 2 * block.dimension:
        return spec.right[:, critical]
    values, vectors = np.linalg.eig(block.reduced(orbit.image.jacobian))
    eigenvector = vectors[:, np.abs(values - spec.values[critical[0]]).argmin()]
    modes = np.stack([block.mode(eigenvector, branch.direction) for branch in symmetry.branches], axis=1)
    peaks = modes[np.abs(modes).argmax(axis=0), range(modes.shape[1])]
    unit: ComplexArray = modes * (np.abs(peaks) / peaks) / np.linalg.norm(modes, axis=0)
    return unit


def _form(
    samples: Samples, value: float, orbit: Orbit, multiplier: complex, mode: ComplexArray, left: ComplexArray
) -> NormalForm:
    system, image = samples.family(value), orbit.image
    if multiplier.imag == 0.0:
        mode, left = mode.real.astype(np.complex128), left.real.astype(np.complex128)
    at = CriticalOrbit(orbit.state, image.jacobian, multiplier, mode, left, image.returns)
    section = orbit.section
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.asarray(image.error) / np.abs(image.jacobian).max()
    uncertainty = float(np.nan_to_num(relative, nan=0.0, posinf=0.0).max())
    scale = sizes(system, orbit.state, orbit.period / image.returns)
    return normal_form_of(
        lambda states: returned_states(system, states, section), at, uncertainty=uncertainty, scale=scale
    )
