"""Bifurcation points and their descriptions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from chilopod.frozen import Array, ComplexArray, ReadOnlyArrays, in_one_line
from chilopod.labels import Labelled
from chilopod.stability.normal_forms.normal_form import NormalForm, NormalFormStatus
from chilopod.stability.shown import Shown, bounded, number
from chilopod.stability.symmetry.isotypic import SymmetricCrossing


class Kind(Labelled):
    """Kind of a bifurcation point; each member's ``sentence`` describes it in words."""

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
        Unit critical eigenvector, shape (n,), complex for Neimark-Sacker and Hopf.
    multiplier
        Critical multiplier of the return map; at a Hopf point the eigenvalue i omega.
    frequency
        Angular frequency (1/s) of the critical mode: 0 for a multiplier +1 of the period, else the principal value.
    criticality
        Verdict of the coefficient, or the reason for a missing one.
    coefficient, coefficient_error
        Cubic coefficient a -> a + coefficient a^3 of the map over one period of the orbit, at a period doubling over
        two; a is the amplitude along the unit ``mode`` (Neimark-Sacker: state = 2 Re(a mode)). None if it has no
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


def with_coefficients(point: BifurcationPoint, form: NormalForm) -> BifurcationPoint:
    """A point with the coefficients of its normal form, if valid."""
    point = replace(point, normal_form=form)
    verdict = criticality(form)
    if point.kind in WITHOUT_CRITICALITY or not verdict.known:
        return point
    point = replace(point, criticality=verdict, coefficient=form.cubic, coefficient_error=form.cubic_error)
    if point.kind is Kind.NEIMARK_SACKER:
        point = replace(point, rotation=form.rotation, rotation_error=form.rotation_error)
    return point
