"""Stability and bifurcations of periodic orbits, of any periodic system.

>>> from math import cos
>>> from chilopod.stability import from_rhs, multipliers
>>> mathieu = from_rhs(lambda t, y: [y[1], -(0.5 - 0.4 * cos(2 * t)) * y[0]], 2, 3.141592653589793, orbit=[0, 0])
>>> multipliers(mathieu).stable
False
"""

from chilopod.flows.called import NotAnalytic, UndeclaredSwitch
from chilopod.flows.deadline import SpentError
from chilopod.flows.rhs import Event
from chilopod.stability.branches.branch import Branch, BranchPoint, Start, begin, follow, switch
from chilopod.stability.codimension_two.curve2 import CodimensionTwo, Curve2, Point2, SpecialPoint2, Start2
from chilopod.stability.codimension_two.two_parameters import follow2, switch2
from chilopod.stability.continuation.tracer import Ending
from chilopod.stability.equilibria import Equilibrium, find_equilibrium
from chilopod.stability.floquet import Exponents, Multipliers, exponents, multipliers, sweep
from chilopod.stability.hopf import locate_hopf
from chilopod.stability.interface import Autonomous, Capabilities, SystemLike
from chilopod.stability.normal_forms.normal_form import NormalForm, NormalFormStatus
from chilopod.stability.orbits.orbit import Orbit, find_orbit
from chilopod.stability.points import BifurcationPoint, Criticality, Kind
from chilopod.stability.returns import ReturnMap, Section
from chilopod.stability.search.locate import Located, locate
from chilopod.stability.shown import Result
from chilopod.stability.symmetry.isotypic import AxialBranch, SymmetricCrossing, SymmetricKind
from chilopod.stability.system import PeriodicSystem, from_map, from_rhs
from chilopod.stability.unit_circle.crossings import SearchStatus

__all__ = [
    "Autonomous",
    "AxialBranch",
    "BifurcationPoint",
    "Branch",
    "BranchPoint",
    "Capabilities",
    "CodimensionTwo",
    "Criticality",
    "Curve2",
    "Ending",
    "Equilibrium",
    "Event",
    "Exponents",
    "Kind",
    "Located",
    "Multipliers",
    "NormalForm",
    "NormalFormStatus",
    "NotAnalytic",
    "Orbit",
    "PeriodicSystem",
    "Point2",
    "Result",
    "ReturnMap",
    "SearchStatus",
    "Section",
    "SpecialPoint2",
    "SpentError",
    "Start",
    "Start2",
    "SymmetricCrossing",
    "SymmetricKind",
    "SystemLike",
    "UndeclaredSwitch",
    "begin",
    "exponents",
    "find_equilibrium",
    "find_orbit",
    "follow",
    "follow2",
    "from_map",
    "from_rhs",
    "locate",
    "locate_hopf",
    "multipliers",
    "sweep",
    "switch",
    "switch2",
]
