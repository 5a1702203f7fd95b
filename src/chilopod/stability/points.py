"""What a bifurcation point is, and what is said of it."""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chilopod.frozen import ReadOnlyArrays

Array = NDArray[np.float64]


class Kind(enum.Enum):
    """What happens at a bifurcation point; each member's ``sentence`` says it in words."""

    PITCHFORK = "pitchfork", "a symmetric orbit changes stability and a pair of mirrored orbits branches off"
    FOLD = "fold", "two orbits meet and vanish"
    TRANSCRITICAL = "transcritical", "the orbit crosses another one and they exchange stability"
    PERIOD_DOUBLING = "period doubling", "an orbit of twice the period branches off"
    NEIMARK_SACKER = "Neimark-Sacker", "an oscillation at a second frequency branches off: an invariant torus"
    BRANCH_POINT = "branch point", "another orbit branches off; the coefficients do not tell how"

    def __init__(self, label: str, sentence: str) -> None:
        self.label = label
        self.sentence = sentence


class Criticality(enum.Enum):
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

    def __init__(self, label: str, sentence: str) -> None:
        self.label = label
        self.sentence = sentence


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
        State on the critical orbit at time 0, shape (n,).
    mode
        Unit critical eigenvector, shape (n,), complex for Neimark-Sacker.
    multiplier
        Critical multiplier of the return map (of the half period where that symmetry exists).
    frequency
        Angular frequency (1/s) of the critical mode: 0 for a real multiplier +1 of the period; the principal value
        otherwise.
    criticality, coefficient, coefficient_error
        Verdict and cubic coefficient a -> a + coefficient a^3 of the full-period map, a the amplitude along the unit
        ``mode`` (Neimark-Sacker: state = 2 Re(a mode)); None where it has no meaning (fold, transcritical, branch
        point).
    rotation
        Where the mode turns (Neimark-Sacker), the phase per period that an amplitude adds, rad per amplitude^2.
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
