"""The parameters that the paper varies, and the unit in which its springs are written."""

from __future__ import annotations

from chilopod import units

K1 = "springs.stiffness[0]"
ALL = "springs.stiffness"
PAPER_UNIT = "N*mm/deg"


def stiffness(value: float) -> float:
    """A spring constant in N*mm/deg as SI."""
    return units.parse(f"{float(value)!r} {PAPER_UNIT}", "N*m/rad")
