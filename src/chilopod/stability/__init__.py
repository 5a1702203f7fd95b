"""Stability and bifurcations of periodic orbits, of any periodic system.

>>> from math import cos
>>> from chilopod.stability import from_rhs, multipliers
>>> mathieu = from_rhs(lambda t, y: [y[1], -(0.5 - 0.4 * cos(2 * t)) * y[0]], 2, 3.141592653589793, orbit=[0, 0])
>>> multipliers(mathieu).stable
False
"""

from chilopod.stability.branch import Branch, BranchPoint, Ending, begin, follow, leave_pitchfork, proceed
from chilopod.stability.called import NotAnalytic
from chilopod.stability.capabilities import (
    FlowsEach,
    FlowsMany,
    FlowsStates,
    FlowsWithError,
    KnowsOrbit,
    SpatiallySymmetric,
    Switches,
    SystemLike,
)
from chilopod.stability.floquet import Exponents, Multipliers, exponents, multipliers, sweep
from chilopod.stability.jumps import UndeclaredSwitch
from chilopod.stability.locate import locate
from chilopod.stability.points import BifurcationPoint, Criticality, Kind
from chilopod.stability.rhs import from_rhs
from chilopod.stability.system import PeriodicSystem, find_orbit

__all__ = [
    "BifurcationPoint",
    "Branch",
    "BranchPoint",
    "Criticality",
    "Ending",
    "Exponents",
    "FlowsEach",
    "FlowsMany",
    "FlowsStates",
    "FlowsWithError",
    "Kind",
    "KnowsOrbit",
    "Multipliers",
    "NotAnalytic",
    "PeriodicSystem",
    "SpatiallySymmetric",
    "Switches",
    "SystemLike",
    "UndeclaredSwitch",
    "begin",
    "exponents",
    "find_orbit",
    "follow",
    "from_rhs",
    "leave_pitchfork",
    "locate",
    "multipliers",
    "proceed",
    "sweep",
]
