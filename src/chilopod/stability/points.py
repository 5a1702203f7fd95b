"""What a bifurcation point is, and what is said of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from chilopod.frozen import ReadOnlyArrays
from chilopod.labels import Labelled
from chilopod.notebook import block, table, words
from chilopod.stability.normal_forms.amplitude import Status
from chilopod.stability.normal_forms.normal_form import NormalForm
from chilopod.stability.symmetry.equivariants import SymmetricCrossing

Array = NDArray[np.float64]


class Kind(Labelled):
    """What happens at a bifurcation point; each member's ``sentence`` says it in words."""

    PITCHFORK = "pitchfork", "a symmetric orbit changes stability and a pair of mirrored orbits branches off"
    FOLD = "fold", "two orbits meet and vanish"
    TRANSCRITICAL = "transcritical", "the orbit crosses another one and they exchange stability"
    PERIOD_DOUBLING = "period doubling", "an orbit of twice the period branches off"
    NEIMARK_SACKER = "Neimark-Sacker", "an oscillation at a second frequency branches off: an invariant torus"
    BRANCH_POINT = "branch point", "another orbit branches off; the coefficients do not tell how"
    COLLISION = "collision", "of a conservative system, two multipliers meet at +1 or -1 and leave the unit circle"
    KREIN_COLLISION = "Krein collision", "of a conservative system, two pairs meet on the unit circle and leave it"
    HOPF = "Hopf", "an equilibrium changes stability and a cycle branches off"


class Criticality(Labelled):
    """Which way the new orbits go."""

    SUPERCRITICAL = (
        "supercritical",
        "the new orbits grow from zero past the point and take over the stability that the old one loses there",
    )
    SUBCRITICAL = (
        "subcritical",
        "the new orbits lie before the point and are less stable than the old one: past it the motion jumps away",
    )
    UNDECIDED = "undecided", "the coefficient is zero within its error"


_CLEAR = 3.0  # of its error, for a quadratic coefficient that makes a crossing of two orbits
_REAL = 1e-9  # imaginary part up to which a mode is shown as a real one
_NEGLIGIBLE = 0.3  # of the cubic term at the sampled amplitude: what the error of the quadratic one may leave open


def kind_at_plus_one(form: NormalForm) -> Kind:
    """What happens at a real multiplier +1 where the orbit goes on: transcritical with a quadratic term that is clearly
    there, pitchfork without one but with a cubic one, a branch point where the errors leave that open."""
    if form.status is not Status.FOUND:
        return Kind.BRANCH_POINT
    if abs(form.quadratic) > _CLEAR * form.quadratic_error:
        return Kind.TRANSCRITICAL
    cubic = abs(form.cubic) * form.amplitude
    if abs(form.cubic) > form.cubic_error and form.quadratic_error <= _NEGLIGIBLE * cubic:
        return Kind.PITCHFORK
    return Kind.BRANCH_POINT


def criticality(form: NormalForm) -> Criticality | None:
    """The verdict of a cubic coefficient; None where there is no normal form, or where other terms decide too."""
    if form.status not in (Status.FOUND, Status.LINEAR):
        return None
    if abs(form.cubic) <= form.cubic_error:
        return Criticality.UNDECIDED
    return Criticality.SUPERCRITICAL if form.cubic < 0 else Criticality.SUBCRITICAL


@dataclass(frozen=True)
class BifurcationPoint(ReadOnlyArrays):
    """A located bifurcation.

    Attributes
    ----------
    kind
        What it is.
    value
        Of the parameter.
    error_bound
        Bound on the error of ``value``: that of the critical multiplier over its rate of change, and the root finder's.
    orbit
        State on the critical orbit at time 0, or the equilibrium, shape (n,).
    mode
        Unit critical eigenvector, shape (n,), complex for Neimark-Sacker and Hopf.
    multiplier
        Critical multiplier of the return map (of the half period where that symmetry exists); of a Hopf point the
        eigenvalue i omega.
    frequency
        Angular frequency (1/s) of the critical mode: 0 for a real multiplier +1 of the period; the principal value
        otherwise.
    criticality, coefficient, coefficient_error
        Verdict and cubic coefficient a -> a + coefficient a^3 of the map over one period of the orbit, at a period
        doubling over two; a is the amplitude along the unit ``mode`` (Neimark-Sacker: state = 2 Re(a mode)). None where
        it has no meaning (fold, transcritical, branch point) or where there is no normal form. At a Hopf point the
        first Lyapunov coefficient l1 (Kuznetsov, section 3.5), with |a| -> |a| + 2 pi l1 |a|^3 over one period.
    rotation, rotation_error
        Where the mode turns (Neimark-Sacker), the phase per period that an amplitude adds, rad per amplitude^2.
    period
        Of the orbit.
    multiplicity
        How many multipliers are critical, both of a pair counted.
    modes
        Unit critical eigenvectors where there are several, shape (n, modes): where a symmetry makes them several, those
        along which new orbits branch off; else of the critical space some basis.
    symmetry
        What the spatial symmetries make of it, where the orbit has some.
    rate
        Of a Hopf point: how fast its eigenvalue moves, in 1/s per unit of the parameter.
    normal_form
        All that is known of the normal form, with a status that says why where it has no numbers; None where it was
        not asked for, and at folds.
    """

    kind: Kind
    value: float
    error_bound: float
    orbit: Array
    mode: NDArray[np.complex128]
    multiplier: complex
    frequency: float
    criticality: Criticality | None = None
    coefficient: float | None = None
    coefficient_error: float | None = None
    rotation: float | None = None
    rotation_error: float | None = None
    normal_form: NormalForm | None = None
    period: float = np.nan
    multiplicity: int = 1
    modes: NDArray[np.complex128] | None = None
    symmetry: SymmetricCrossing | None = None
    rate: complex | None = None

    @property
    def sentences(self) -> str:
        """What happens here and which way the new orbits go, in words."""
        said = [f"{self.kind.sentence}."]
        if self.criticality is not None:
            said.append(f"{self.criticality.label}: {self.criticality.sentence}.")
        if self.multiplicity > 1:
            said.append(f"{self.multiplicity} multipliers are critical at once.")
        return " ".join(each[0].upper() + each[1:] for each in said)

    def _repr_html_(self) -> str:
        hopf = self.kind is Kind.HOPF
        critical = "eigenvalue" if hopf else "multiplier of the return map"
        rows = [(critical, f"{self.multiplier:.6g}"), ("period", f"{self.period:.10g}")]
        if self.frequency:
            rows.append(("frequency of the mode (1/s)", f"{self.frequency:.10g}"))
        if self.coefficient is not None:
            name = "first Lyapunov coefficient" if hopf else "cubic coefficient"
            rows.append((name, f"{self.coefficient:.6g} ± {self.coefficient_error:.1e}"))
        real = np.abs(self.mode.imag).max() < _REAL
        mode = (
            (f"{x:.6g}", f"{share:.4g}")
            for x, share in zip(self.orbit, self.mode.real if real else self.mode, strict=True)
        )
        return block(
            f"{self.kind.label} at {self.value:.12g} (± {self.error_bound:.1e})",
            words(self.sentences),
            table(("", ""), rows),
            table(("equilibrium" if hopf else "orbit at time 0", "critical mode"), mode),
        )


def with_coefficients(point: BifurcationPoint, form: NormalForm) -> BifurcationPoint:
    """A point with what its normal form says, where that means something."""
    point = replace(point, normal_form=form)
    if point.kind in (Kind.FOLD, Kind.TRANSCRITICAL, Kind.BRANCH_POINT):
        return point
    verdict = criticality(form)
    if verdict is None:
        return point
    point = replace(point, criticality=verdict, coefficient=form.cubic, coefficient_error=form.cubic_error)
    if point.kind is Kind.NEIMARK_SACKER:
        point = replace(point, rotation=form.rotation, rotation_error=form.rotation_error)
    return point
