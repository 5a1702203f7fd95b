"""What counts as within in the table of the robot, and its lines about springs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from chilopod import units
from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.paper.printed import printed_stiffness
from chilopod.paper.scatter import Answer, near
from chilopod.paper.table import RobotRow

FITTED, PREDICTED, CHECKED = "fitted", "predicted", "checked"

ONSET = 0.10
"""Relative tolerance of every spring at which straight walks end: of the base series, its variants, uniform springs."""

RADIUS = 0.10
"""Of the two radii that are printed."""

UNCHANGED = 0.15
"""Of a variant's radius that is "almost unchanged"."""

SPEED = 0.10
"""Of the walking speed."""

ARRIVAL = 0.15
"""Of the earliest arrival."""

K_HAT = 0.15
"""Of the spring whose walk has the radius of the circle to a target."""

VERDICTS: Mapping[Answer, str] = {True: "within", False: "outside", None: "undecided"}
"""In words: undecided is what the scatter of the trials leaves open."""


Planar = Mapping[str, str]
"""What the planar model does, in words, by the keys of :func:`chilopod.paper.robot.beside.planar_words`."""


def spring_row(
    quantity: str,
    paper: float,
    twin: tuple[float, float],
    tolerance: float,
    kind: str,
    planar: str,
) -> RobotRow:
    """A spring (N*mm/deg) that is to be near the paper's.

    Parameters
    ----------
    quantity, kind, planar
        See :class:`RobotRow`.
    paper
        What it prints.
    twin
        Value and standard error; NaN if the trials determine none, and no error known.
    tolerance
        Relative.
    """
    value, error = twin
    return RobotRow(
        quantity,
        f"{paper:g} {PAPER_UNIT}",
        f"{with_error(value, error, 1)} {PAPER_UNIT} ({100.0 * (value / paper - 1.0):+.0f} %)"
        if np.isfinite(value)
        else "not determined by trials",
        planar,
        kind,
        VERDICTS[near(value, error, paper, tolerance)],
        percent(tolerance),
    )


def with_error(value: float, error: float, digits: int) -> str:
    """A number and, if it is known and not zero, its standard error, with so many decimals."""
    return f"{value:.{digits}f}" + (f" ± {error:.{digits}f}" if error > 0.0 else "")


def percent(part: float) -> str:
    """A tolerance in words."""
    return f"{100.0 * part:.0f} %"


def printed_spring(*keys: str) -> float:
    """A spring that the paper prints, N*mm/deg."""
    return units.from_si(printed_stiffness(*keys), PAPER_UNIT)
