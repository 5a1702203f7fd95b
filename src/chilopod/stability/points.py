"""Bifurcation points and their descriptions: kind, modes, normal form and symmetry.

``described`` makes a point from a crossing of the unit circle and the orbit there. It takes the critical multiplier
with its eigenvectors (``_critical``) and, for a single one, the normal form (``_formed``). The kind follows from where
the circle is crossed; at +1 from the symmetry that the mode breaks, or from the normal form (``kind_at_plus_one``).
Several modes due to a symmetry are turned along the new orbits (``_modes``).
"""

from __future__ import annotations

import contextlib
import math
from bisect import bisect
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.polynomial import Legendre
from scipy.linalg import schur

from chilopod.errors import AnalysisError
from chilopod.flows.carrying import numerical_balance
from chilopod.flows.deadline import SpentError
from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays, in_one_line
from chilopod.labels import Labelled
from chilopod.stability.crossing_place import critical_multipliers
from chilopod.stability.interface import SystemLike, checked_flow, is_autonomous, sizes
from chilopod.stability.normal_forms.manifold import CriticalOrbit, StateMap
from chilopod.stability.normal_forms.normal_form import NormalForm, NormalFormStatus, normal_form
from chilopod.stability.orbits.orbit import Orbit
from chilopod.stability.returns import returned_states, velocity_at
from chilopod.stability.shown import Shown, bounded, number
from chilopod.stability.spectrum import EPSILON, Spectrum, phased, spectrum
from chilopod.stability.symmetry.groups import symmetric_basis
from chilopod.stability.symmetry.isotypic import Block, SymmetricCrossing, SymmetricKind, symmetric_crossing
from chilopod.stability.unit_circle.spectra import TARGETS, CircleEvent, Crossing


class Kind(Labelled):
    """Kind of a bifurcation point; each member's ``sentence`` describes it in words."""

    PITCHFORK = "pitchfork", "a symmetric orbit changes stability and a pair of mirrored orbits branches off"
    FOLD = "fold", "two orbits meet and vanish"
    TRANSCRITICAL = "transcritical", "the orbit crosses another one and they exchange stability"
    PERIOD_DOUBLING = "period doubling", "an orbit of twice the period branches off"
    NEIMARK_SACKER = "Neimark-Sacker", "an oscillation at a second frequency branches off: an invariant torus"
    BRANCH_POINT = "branch point", "another orbit branches off; the coefficients do not tell how"
    COLLISION = "collision", "of a conservative system, two multipliers meet at +1 or -1"
    KREIN_COLLISION = "Krein collision", "of a conservative system, two pairs meet on the unit circle and leave it"
    HOPF = "Hopf", "an equilibrium changes stability and a cycle branches off"


class Criticality(Labelled):
    """Direction of the new orbits, or why it is not known; each member's ``sentence`` describes it in words."""

    SUPERCRITICAL = (
        "supercritical",
        "the new orbits grow from zero past the point and are as stable as the old one was before it",
    )
    SUBCRITICAL = (
        "subcritical",
        "the new orbits lie before the point and are less stable than the old one; past it the motion may jump away",
    )
    UNDECIDED = "undecided", "the coefficient is zero within its error"
    NOT_DEFINED = "not defined", "a point of this kind has none: no cubic coefficient decides what happens"
    NOT_COMPUTED = "not computed", "the normal form was not asked for, or its status says why there is none"

    @property
    def known(self) -> bool:
        """True for the verdict of a coefficient."""
        return self not in (Criticality.NOT_DEFINED, Criticality.NOT_COMPUTED)


WITHOUT_CRITICALITY = (Kind.FOLD, Kind.TRANSCRITICAL, Kind.BRANCH_POINT, Kind.COLLISION, Kind.KREIN_COLLISION)
"""Kinds of points without a decisive cubic coefficient."""

_REAL = 1e-9  # largest imaginary part of a mode that is shown as real


def criticality(form: NormalForm) -> Criticality:
    """The verdict of a cubic coefficient, if it is known and decides alone."""
    if form.status not in (NormalFormStatus.FOUND, NormalFormStatus.LINEAR):
        return Criticality.NOT_COMPUTED
    if abs(form.cubic) <= form.cubic_error:
        return Criticality.UNDECIDED
    return Criticality.SUPERCRITICAL if form.cubic < 0 else Criticality.SUBCRITICAL


@dataclass(frozen=True, eq=False)
class BifurcationPoint(Shown, ReadOnlyArrays):
    """A located bifurcation.

    Attributes
    ----------
    kind
        Kind of the point.
    value, error_bound
        Value of the parameter, and a bound on its error: that of the critical multiplier over its rate of change.
    orbit
        State on the critical orbit at time 0, or the equilibrium, shape (n,).
    mode
        Critical eigenvector, shape (n,), complex for Neimark-Sacker and Hopf, of unit length; where the period belongs
        to the orbit, the mean square of the disturbance across the motion over a period is 1.
    multiplier
        Critical multiplier of the return map; at a Hopf point the eigenvalue i omega.
    frequency
        Angular frequency (1/s) of the critical mode: 0 for a multiplier +1 of the period, else the principal value.
    criticality
        Verdict of the coefficient, or the reason for a missing one.
    coefficient, coefficient_error
        Cubic coefficient a -> a + coefficient a^3 of the map over one period of the orbit, at a period doubling over
        two; a is the amplitude along ``mode`` (Neimark-Sacker: state = 2 Re(a mode)). None if it has no
        meaning or without a normal form. At a Hopf point the first Lyapunov coefficient l1 (Kuznetsov, section 3.5).
    rotation, rotation_error
        Change of the phase per period with the amplitude (Neimark-Sacker), rad per amplitude^2.
    period
        Period of the orbit.
    multiplicity
        Number of critical multipliers, counting both of a pair.
    modes
        Unit critical eigenvectors if there are several, shape (n, modes): directions of new orbits, else a basis.
    symmetry
        Consequences of the orbit's spatial symmetries, if any.
    rate
        Rate of change of the eigenvalue at a Hopf point, in 1/s per unit of the parameter.
    between
        Searched interval at a Hopf point, in which its first cycle lies.
    normal_form
        Normal form, with a status that explains missing numbers; None if not computed, and at folds.
    """

    kind: Kind
    value: float
    error_bound: float
    orbit: Array
    mode: ComplexArray
    multiplier: complex
    frequency: float
    criticality: Criticality = Criticality.NOT_COMPUTED
    coefficient: float | None = None
    coefficient_error: float | None = None
    rotation: float | None = None
    rotation_error: float | None = None
    normal_form: NormalForm | None = None
    period: float = np.nan
    multiplicity: int = 1
    modes: ComplexArray | None = None
    symmetry: SymmetricCrossing | None = None
    rate: complex | None = None
    between: tuple[float, float] = (-np.inf, np.inf)

    @property
    def sentences(self) -> str:
        """Sentences on the kind of the point and the direction of the new orbits."""
        said = [f"{self.kind.sentence}."]
        if self.criticality.known:
            said.append(f"{self.criticality.label}: {self.criticality.sentence}.")
        if self.multiplicity > 1:
            said.append(f"{self.multiplicity} multipliers are critical at once.")
        return " ".join(each[0].upper() + each[1:] for each in said)

    @property
    def row(self) -> tuple[str, str, str]:
        """Kind, value with bound, and direction of the new orbits, for tables in text."""
        way = self.criticality.label if self.criticality.known else ""
        return self.kind.label, bounded(self.value, self.error_bound), way

    def _lines(self) -> list[str]:
        hopf = self.kind is Kind.HOPF
        critical, of = ("eigenvalue", "cycles") if hopf else ("multiplier of the return map", "orbit")
        name, state = ("first Lyapunov", "equilibrium") if hopf else ("cubic", "orbit at time 0")
        lines = [
            f"BifurcationPoint: {self.kind.label} at {bounded(self.value, self.error_bound)}",
            self.sentences,
            f"{critical}: {number(self.multiplier, 6)}; period of the {of}: {self.period:.10g}",
        ]
        if self.symmetry is not None:
            lines.append(f"spatial symmetries: {self.symmetry.kind.label}: {self.symmetry.kind.sentence}")
        if self.frequency:
            lines.append(f"frequency of the mode: {self.frequency:.10g} rad per unit of time")
        if self.coefficient is not None and self.coefficient_error is not None:
            lines.append(f"{name} coefficient: {self.coefficient:.6g} ± {self.coefficient_error:.1e}")
        real = np.abs(self.mode.imag).max() < _REAL
        mode = in_one_line(self.mode.real if real else self.mode)
        return [*lines, f"{state}: {in_one_line(self.orbit)}", f"critical mode: {mode}"]


# Lobatto's nodes and weights on a part of a return: an event leaves some of them on either side.
_DEGREE = Legendre.basis(7)
_NODES = 0.5 + 0.5 * np.concatenate([[-1.0], _DEGREE.deriv().roots().real, [1.0]])
_WEIGHTS = 1.0 / (_NODES.size * (_NODES.size - 1) * _DEGREE(2.0 * _NODES - 1.0) ** 2)
# Where a part is cut: no event is there by symmetry, where round-off decides whether a state is before it or after it.
_CUT = math.sqrt(2.0) - 1.0
_LONGEST, _SHORTEST = 0.3, 1e-10  # longest part, and the length of one with an event
_SETTLED = 1e-9  # change of a part's share by cutting it, relative to that of the mean: far above its error
_MOST_PARTS = 512  # where the flow is not as accurate as that

_ASIDE, _ROUNDS = 0.05, 20  # distance of a second orbit, in sizes of the states, and number of its corrections
_CRITICAL = 1e-6  # distance from one of a critical multiplier, and relative singular value of its direction
_MEETING = 1e-3  # distance from one of multipliers that meet there: they move as the root of an error
_CLEAR = 3.0  # least quadratic coefficient, relative to its error, of a transcritical point
_NEGLIGIBLE = 0.3  # largest negligible error of the quadratic term, relative to the cubic one as sampled
_VANISHES = 1e-9  # residual, relative to the distance, that counts as zero


class ContinuumError(AnalysisError):
    """Orbits form a continuum at a crossing, which is no bifurcation point of one orbit."""


def described(
    system: SystemLike,
    place: tuple[float, float],
    orbit: Orbit,
    crossing: Crossing,
    block: Block | None,
    *,
    kind: Kind | None = None,
    with_normal_form: bool = True,
) -> BifurcationPoint:
    """Bifurcation point at a ``place``: a value of the parameter, and its error bound, to which round-off is added. The
    critical multipliers belong to the whole return map; their block and the kind of the point are given if known."""
    (value, error_bound), event, returns = place, crossing.event, orbit.image.returns
    # Another block may have a multiplier there too, such as the one of a family by energy.
    within = orbit.image.jacobian if block is None else block.basis @ (block.dual @ orbit.image.jacobian)
    spec = spectrum(replace(orbit.image, jacobian=within))
    critical = critical_multipliers(spec, crossing)
    simple = critical.size == (2 if event is CircleEvent.PAIR else 1)
    breaking = block is not None and not block.trivial
    # At +1 the normal form, or a broken symmetry, determines the kind.
    unknown = kind is None and event is CircleEvent.PLUS and not crossing.collision
    krein = crossing.collision and event is CircleEvent.PAIR
    meeting = crossing.collision and not krein
    if meeting and (shared := _shared_direction(within, TARGETS[event])) is not None:
        spec = replace(spec, right=np.where(np.arange(spec.values.size) == critical[0], shared[:, None], spec.right))
    nu, mode, left, frequency = _critical(system, orbit, spec, int(critical[0]), event)
    formed = simple and (with_normal_form or (unknown and not breaking)) and not crossing.collision
    form = _formed(system, orbit, event, nu, mode, left) if formed else None
    # No orbits branch off from a Krein collision, whatever the symmetries.
    symmetry = None if block is None or krein else symmetric_crossing(block, event, returns)
    several = not simple or (form is not None and form.status is NormalFormStatus.SEVERAL_CRITICAL)
    if unknown and several and _is_continuum(system, orbit, mode):
        count = int((np.abs(spec.values - 1.0) <= _CRITICAL).sum())
        said = f"orbits beside this one are periodic too: they form a continuum (multipliers at one: {count})"
        raise ContinuumError(said)
    apart = meeting and _have_own_modes(orbit.image.jacobian, crossing, block)
    axial = symmetry is not None and bool(symmetry.branches)
    single = simple or (meeting and not (apart or axial))
    modes = None if single else _modes(spec, crossing, orbit, block, None if apart else symmetry)
    if kind is None:
        kind = _kind(crossing, returns, form, symmetry if breaking else None)
        if kind is Kind.TRANSCRITICAL and modes is not None and symmetry is not None:
            kind, symmetry = _by_quadratic_term(system, orbit, modes, symmetry)
    verdict = Criticality.NOT_DEFINED if kind in WITHOUT_CRITICALITY else Criticality.NOT_COMPUTED
    error_bound += 4.0 * EPSILON * abs(value)
    point = BifurcationPoint(kind, value, error_bound, orbit.state, mode, nu, frequency, verdict, period=orbit.period)
    point = replace(point, multiplicity=critical.size, modes=modes, symmetry=symmetry)
    return _with_coefficients(point, form) if form is not None and with_normal_form else point


def _with_coefficients(point: BifurcationPoint, form: NormalForm) -> BifurcationPoint:
    """A point with the coefficients of its normal form, if valid."""
    point = replace(point, normal_form=form)
    verdict = criticality(form)
    if point.kind in WITHOUT_CRITICALITY or not verdict.known:
        return point
    point = replace(point, criticality=verdict, coefficient=form.cubic, coefficient_error=form.cubic_error)
    if point.kind is Kind.NEIMARK_SACKER:
        return replace(point, rotation=form.rotation, rotation_error=form.rotation_error)
    return point


def _critical(
    system: SystemLike, orbit: Orbit, spec: Spectrum, index: int, event: CircleEvent
) -> tuple[complex, ComplexArray, ComplexArray, float]:
    """A critical multiplier, of a pair that of positive frequency, right and left eigenvectors, and that frequency."""
    nu, mode, left = complex(spec.values[index]), spec.right[:, index], spec.left[:, index]
    peak = mode[np.abs(mode).argmax()]
    scale = np.abs(peak) / peak / mean_size(system, orbit.state, orbit.image.duration, mode)
    mode, left = mode * scale, left / scale.conjugate()
    if event is not CircleEvent.PAIR:
        turns = event is CircleEvent.MINUS and orbit.image.returns % 2
        return nu, mode, left, np.pi / orbit.period if turns else 0.0
    angle = float(np.angle(np.exp(1j * orbit.image.returns * np.angle(nu))))
    if angle < 0:
        nu, mode, left, angle = nu.conjugate(), mode.conj(), left.conj(), -angle
    return nu, mode, left, angle / orbit.period


def mean_size(system: SystemLike, state: Array, duration: float, mode: ComplexArray) -> float:
    """Root mean square of a mode over a return, across the motion; 1 for a given period, which fixes time 0."""
    if not is_autonomous(system):
        return 1.0
    # The flow carries the velocity as it carries the mode.
    times, moves = [0.0], [(state, np.stack([mode, velocity_at(system, state)], axis=1))]

    def mean_square(low: float, high: float) -> float:
        squares = []
        for time in (low * (1.0 - _NODES) + high * _NODES).tolist():
            at = bisect(times, time) - 1
            x, directions = moves[at]
            if times[at] < time:
                x, derivative = checked_flow(system, x, 0.0, (time - times[at]) * duration)
                directions = derivative @ directions
                times.insert(at + 1, time)
                moves.insert(at + 1, (x, directions))
            vector, velocity = directions.T
            across = vector - (vector @ velocity) / (velocity @ velocity) * velocity
            squares.append(float((np.abs(across) ** 2).sum()))
        return (high - low) * float(_WEIGHTS @ squares)

    mean = mean_square(0.0, 1.0)
    parts = [(0.0, 1.0, mean)]
    for _ in range(_MOST_PARTS):  # cut, down to an event if there is one
        if not parts:
            break
        low, high, before = parts.pop()
        middle = low + _CUT * (high - low)
        cut = [(a, b, mean_square(a, b)) for a, b in ((low, middle), (middle, high))]
        change = cut[0][2] + cut[1][2] - before
        mean += change
        length = high - low
        if length > _LONGEST or (abs(change) > _SETTLED * length * mean and length > _SHORTEST):
            parts += cut
    return math.sqrt(mean)


def _is_continuum(system: SystemLike, orbit: Orbit, mode: ComplexArray) -> bool:
    """True if all terms of the bifurcation equation vanish along a mode: an orbit beside this one, corrected across the
    critical space alone, returns to itself (Lyapunov-Schmidt reduction). Orbits of a linear map do so uncorrected."""
    size = sizes(system, orbit.state, orbit.image.duration)
    ahead = mode.real / size
    shift = _ASIDE * ahead / np.linalg.norm(ahead)
    matrix = orbit.image.jacobian * size / size[:, None] - np.eye(size.size)
    across, offs = np.linalg.pinv(matrix, rcond=_CRITICAL), [np.inf]
    with contextlib.suppress(AnalysisError), np.errstate(all="ignore"):
        for _ in range(_ROUNDS):
            x = orbit.state + size * shift
            residual = (returned_states(system, x[None], orbit.section)[0] - x) / size
            offs.append(float(np.abs(residual).max()))
            shift = shift - across @ residual
    return offs[-1] <= _VANISHES * _ASIDE < offs[1]


def _formed(
    system: SystemLike, orbit: Orbit, event: CircleEvent, nu: complex, mode: ComplexArray, left: ComplexArray
) -> NormalForm | None:
    """The normal form for one critical multiplier or pair; None if it cannot be computed."""
    image = orbit.image
    exact = nu / abs(nu) if event is CircleEvent.PAIR else complex(TARGETS[event])
    if event is not CircleEvent.PAIR:
        mode, left = mode.real.astype(np.complex128), left.real.astype(np.complex128)
    bounded = replace(image, error=np.nan_to_num(image.error, nan=0.0, posinf=0.0))
    scale = sizes(system, orbit.state, image.duration)
    mapped = partial(returned_states, system, section=orbit.section)
    return _computed(mapped, CriticalOrbit(orbit.state, bounded, exact, mode, left), scale)


def _computed(mapped: StateMap, at: CriticalOrbit, scale: Array | float = 1.0) -> NormalForm | None:
    with contextlib.suppress(AnalysisError, SpentError, ValueError):
        return normal_form(mapped, at, scale=scale)
    return None


def _by_quadratic_term(
    system: SystemLike, orbit: Orbit, modes: ComplexArray, symmetry: SymmetricCrossing
) -> tuple[Kind, SymmetricCrossing]:
    """Kind of a crossing at +1 whose symmetry allows quadratic terms, by their coefficients along the axial branches:
    transcritical if one is significant, pitchfork if all are negligible, else a branch point."""
    axes = [i for i, branch in enumerate(symmetry.branches) if not branch.reversed]
    kinds = {_along_axis(system, orbit, modes[:, i].real) for i in axes}
    if Kind.TRANSCRITICAL in kinds:
        return Kind.TRANSCRITICAL, symmetry
    if kinds == {Kind.PITCHFORK}:
        return Kind.PITCHFORK, replace(symmetry, kind=SymmetricKind.EQUIVARIANT_PITCHFORK)
    return Kind.BRANCH_POINT, symmetry


def _along_axis(system: SystemLike, orbit: Orbit, mode: Array) -> Kind:
    """Kind of a crossing at +1 among the states with the symmetries of an axial branch, where the multiplier is simple;
    a branch point if that cannot be computed."""
    x, image, size = orbit.state, orbit.image, sizes(system, orbit.state, orbit.image.duration)
    basis = symmetric_basis(system, x + mode / np.linalg.norm(mode / size), size)
    if basis is None:
        return Kind.BRANCH_POINT
    units, start = size / size[:, None], basis.T @ (x / size)
    jacobian = basis.T @ (image.jacobian * units) @ basis
    error = np.abs(basis.T) @ (np.nan_to_num(image.error, posinf=0.0) * units) @ np.abs(basis)
    within = replace(image, state=start, jacobian=jacobian, error=error, velocity=None, normal=None)
    spec = spectrum(within)
    right, left = (each[:, spec.nearest(1.0)].real.astype(np.complex128) for each in (spec.right, spec.left))

    def mapped(states: Array) -> Array:
        moved = returned_states(system, x + size * ((states - start) @ basis.T), orbit.section)
        return np.asarray(start + ((moved - x) / size) @ basis)

    return kind_at_plus_one(_computed(mapped, CriticalOrbit(start, within, 1.0 + 0.0j, right, left)))


def _kind(crossing: Crossing, returns: int, form: NormalForm | None, broken: SymmetricCrossing | None) -> Kind:
    if crossing.collision:
        return Kind.KREIN_COLLISION if crossing.event is CircleEvent.PAIR else Kind.COLLISION
    if crossing.event is CircleEvent.PAIR:
        return Kind.NEIMARK_SACKER
    if crossing.event is CircleEvent.MINUS:
        return Kind.PERIOD_DOUBLING if returns % 2 else Kind.PITCHFORK
    if broken is not None:
        return Kind.PITCHFORK if broken.quadratic == 0 else Kind.TRANSCRITICAL
    # The orbit exists on both sides, so it does not end in a fold here.
    return kind_at_plus_one(form)


def _modes(
    spec: Spectrum, crossing: Crossing, orbit: Orbit, block: Block | None, symmetry: SymmetricCrossing | None
) -> ComplexArray:
    """Modes of several critical multipliers: along axial branches, if any; real ones are an orthonormal basis."""
    critical = critical_multipliers(spec, crossing)
    if block is None or symmetry is None or not symmetry.branches or critical.size > 2 * block.dimension:
        vectors = spec.right[:, critical]
        if crossing.event is CircleEvent.PAIR:
            return vectors
        return np.linalg.svd(np.hstack([vectors.real, vectors.imag]))[0][:, : critical.size].astype(np.complex128)
    values, vectors = np.linalg.eig(block.reduced(orbit.image.jacobian))
    eigenvector = vectors[:, np.abs(values - spec.values[critical[0]]).argmin()]
    modes = phased(np.stack([block.mode(eigenvector, branch.direction) for branch in symmetry.branches], axis=1))
    return np.asarray(modes / np.linalg.norm(modes, axis=0))


def _have_own_modes(jacobian: Array, crossing: Crossing, block: Block | None) -> bool:
    """True if multipliers that meet at +1 or -1 have an eigenvector each; the two of a Jordan block share one."""
    matrix, target = jacobian if block is None else block.reduced(jacobian), TARGETS[crossing.event]
    units = numerical_balance(np.abs(matrix) + np.eye(len(matrix)))
    matrix = matrix * units / units[:, None] - target * np.eye(units.size)
    stretches = np.linalg.svd(matrix)[1]
    there = int((np.abs(np.linalg.eigvals(matrix)) <= _MEETING).sum())
    return int((stretches <= _CRITICAL * max(1.0, stretches[0])).sum()) >= max(there, 2)


def _shared_direction(jacobian: Array, target: float) -> ComplexArray | None:
    """The eigenvector of two multipliers that meet at +1 or -1, which ends their Jordan chain; None if they are not
    there. The direction of a family by energy, also to +1, belongs to no chain."""
    units = numerical_balance(np.abs(jacobian) + np.eye(len(jacobian)))
    scaled = jacobian * units / units[:, None]
    triangle, vectors, count = schur(scaled, sort=lambda re, im: math.hypot(re - target, im) <= _MEETING)
    if count < 2:
        return None
    chain = step = triangle[:count, :count] - target * np.eye(count)
    for _ in range(count - 2):  # a longer one at an extremum of the energy
        longer = chain @ step
        if np.linalg.norm(longer) <= _MEETING * np.linalg.norm(chain) * np.linalg.norm(step):
            break
        chain = longer
    return np.asarray(units * (vectors[:, :count] @ np.linalg.svd(chain)[0][:, 0]), dtype=np.complex128)


def kind_at_plus_one(form: NormalForm | None) -> Kind:
    """Kind at a real multiplier +1 if the orbit continues: transcritical with a significant quadratic term, pitchfork
    without one but with a cubic one, branch point if the errors leave that open."""
    if form is None or form.status is not NormalFormStatus.FOUND:
        return Kind.BRANCH_POINT
    if abs(form.quadratic) > _CLEAR * form.quadratic_error:
        return Kind.TRANSCRITICAL
    cubic = abs(form.cubic) * form.amplitude
    if abs(form.cubic) > form.cubic_error and form.quadratic_error <= _NEGLIGIBLE * cubic:
        return Kind.PITCHFORK
    return Kind.BRANCH_POINT
