"""Stability of the straight walk of a robot, and its bifurcations as a parameter varies."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chilopod import stability, units
from chilopod.analysis.parameters import K1, check_parameter, searched_springs
from chilopod.errors import AnalysisError
from chilopod.frozen import ComplexArray, ReadOnlyArrays, read_only
from chilopod.notebook import Summary, axes_for
from chilopod.planar import PlanarModel
from chilopod.robot import Robot
from chilopod.stability import BifurcationPoint, Kind, Point2
from chilopod.stability.shown import bounded
from chilopod.stability.spectrum import VERDICTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_FEWEST_PARTS = 8
_A_PART = 5e-6  # s, of one state
_ENOUGH = 100  # modules
_LONGEST = 3600.0  # s


@dataclass(frozen=True, eq=False)
class StraightWalk(Summary, ReadOnlyArrays):
    """Stability of the straight walk.

    Attributes
    ----------
    robot, exponents
        Robot; exponents, modes and multipliers of its reduced system, 2N+1 of each, but fewer exponents and modes
        where the fastest die out too fast to be resolved.
    joint_components
        Joint angles of every mode, shape (modes, N-1), see :func:`joint_components`.
    """

    robot: Robot
    exponents: stability.Exponents
    joint_components: ComplexArray

    @property
    def stable(self) -> bool | None:
        """True if every disturbance dies out; None where the errors of the multipliers leave it undecided."""
        return self.exponents.multipliers.stable

    @property
    def verdict(self) -> str:
        """Stable, unstable or undecided."""
        return VERDICTS[self.stable]

    @property
    def moduli(self) -> NDArray[np.float64]:
        """Growth factor of every mode over one period, shape (modes,)."""
        return read_only(np.exp(self.exponents.values.real * self.robot.gait.period))

    def as_json(self) -> dict[str, Any]:
        """The result as plain numbers; complex ones as [real, imaginary]."""
        multipliers = self.exponents.multipliers
        half = multipliers.half_period
        modes = zip(_pairs(self.exponents.values), self.joint_components, strict=True)
        return {
            "robot": self.robot.name,
            "period_s": self.robot.gait.period,
            "stable": self.stable,
            "verdict": self.verdict,
            "exponents_per_s": _pairs(self.exponents.values),
            "multipliers": _pairs(multipliers.values),
            "half_period_multipliers": None if half is None else _pairs(half),
            "error_estimate": multipliers.error_bound,
            "modes": [{"exponent": exponent, "joint_components": _numbers(each)} for exponent, each in modes],
        }

    @property
    def title(self) -> str:
        """Verdict in words."""
        period = f"{self.robot.gait.period:g} s"
        return f"{self.robot.name}: the straight walk is {self.verdict} (period {period})"

    def _content(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        rows: list[Sequence[str]] = [("|multiplier|", "exponent (1/s)", "joint angles of the mode, front to rear")]
        modes = zip(self.moduli, self.exponents.values, self.joint_components, strict=True)
        for modulus, exponent, components in modes:
            rows.append((f"{modulus:.6g}", _in_words(exponent, 6), "  ".join(map(_in_words, components))))
        nearer = "; the largest is nearer to 1 than that" if self.stable is None else ""
        said = [f"multipliers are within {self.exponents.multipliers.error_bound:.1e}{nearer}"]
        if faster := self.exponents.multipliers.values.size - len(self.moduli):
            said.append(f"{faster} modes that die out faster are not resolved")
        return [], rows, said

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the multipliers beside the unit circle, see :meth:`chilopod.stability.Multipliers.plot`."""
        return self.exponents.multipliers.plot(axes)


@dataclass(frozen=True, eq=False)
class WalkBifurcation(Summary, ReadOnlyArrays):
    """A bifurcation of the straight walk as one parameter of the robot changes.

    Attributes
    ----------
    point, parameter, unit
        Kind and place of the point, in SI units (see :class:`chilopod.stability.BifurcationPoint`); dotted path of the
        parameter and the unit it is shown in.
    joint_components, coefficient
        Joint angles of the critical mode, shape (N-1,), see :func:`joint_components`; cubic coefficient per period
        (1/rad^2) for an amplitude measured along them.
    """

    point: stability.BifurcationPoint
    parameter: str
    unit: str
    joint_components: ComplexArray
    coefficient: float | None

    @property
    def value(self) -> float:
        """The parameter in ``unit``."""
        return units.from_si(self.point.value, self.unit)

    @property
    def error_bound(self) -> float:
        """Bound on the error of ``value``, in ``unit``."""
        # An error is a difference of two values, even in a unit with an offset.
        return abs(units.from_si(self.point.error_bound, self.unit))

    def as_json(self) -> dict[str, Any]:
        """The result as plain numbers; components are real for a real mode, else [real, imaginary]."""
        point = self.point
        return {
            "kind": point.kind.label,
            "parameter": self.parameter,
            "value": self.value,
            "unit": self.unit,
            "value_si": point.value,
            "error_bound_si": point.error_bound,
            "joint_components": _numbers(self.joint_components),
            "frequency_rad_s": point.frequency,
            "criticality": point.criticality.label if point.criticality.known else None,
            "coefficient": self.coefficient,
        }

    @property
    def title(self) -> str:
        """Kind and place in words."""
        unit = self.unit.replace("*", "·")
        value, error = bounded(self.value, self.error_bound).split(" ± ")
        return f"{self.point.kind.label} at {self.parameter} = {value} {unit} (± {error})"

    def _content(self) -> tuple[list[str], list[Sequence[str]], list[str]]:
        point, above = self.point, [f"{self.point.kind.sentence}."]
        if point.criticality.known:
            above.append(f"{point.criticality.label}: {point.criticality.sentence}.")
        above = [each[0].upper() + each[1:] for each in above]
        if self.coefficient is not None:
            above.append(f"Cubic coefficient of the normal form: {self.coefficient:.6g} /rad².")
        if point.frequency:
            cycle = 2.0 * math.pi / point.frequency
            above.append(f"The mode turns at {point.frequency:.6g} rad/s, a cycle of {cycle:.4g} s.")
        joints = [str(joint + 1) for joint in range(len(self.joint_components))]
        angles = map(_in_words, self.joint_components)
        return above, [("joint, front to rear", *joints), ("angle in the critical mode", *angles)], []

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the joint angles of the critical mode, front to rear."""
        axes, joints = axes_for(axes), np.arange(1, len(self.joint_components) + 1)
        axes.bar(joints, self.joint_components.real, 0.4, label="real part")
        if not _is_real(self.joint_components):
            axes.bar(joints + 0.4, self.joint_components.imag, 0.4, label="imaginary part")
            axes.legend()
        axes.set(xlabel="joint, front to rear", ylabel="angle in the critical mode", title=self.title)
        return axes


def straight_walk(robot: Robot, longest: float = _LONGEST) -> StraightWalk:
    """Floquet analysis of the straight walk in the planar model; AnalysisError if the expected time exceeds ``longest``
    (s), as for a hundred modules or very light ones."""
    model = PlanarModel(robot)
    # The period is cut into parts that contract by a factor of 1e6 at most, and matrices of this size are split along
    # them: this estimates the time within a factor of two on a present desktop.
    # Of a long chain the estimate itself takes minutes; one of fewer, heavier modules contracts less.
    enough = min(robot.body.modules, _ENOUGH)
    contraction = PlanarModel(robot.with_value("body.modules", float(enough))).contraction
    parts = max(_FEWEST_PARTS, 0.5 * contraction / math.log(1e6))
    seconds = _A_PART * parts * model.dimension**2.5
    if seconds > longest:
        fastest = f"the fastest of which dies out {contraction:.3g} e-folds a period or more"
        problem = f"the exponents would take about {_duration(seconds)}: {model.dimension} states, {fastest}"
        allowed = f"about {_duration(longest)}: fewer modules, or longer and heavier ones"
        raise AnalysisError(problem, field="body.modules", value=robot.body.modules, allowed=allowed)
    found = stability.exponents(model, resolved=True)
    components = np.array([joint_components(mode, robot.body.modules) for mode in found.modes.T])
    return StraightWalk(robot, found, components)


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.3g} s"
    return f"{seconds / 60.0:.3g} minutes" if seconds < 7200.0 else f"{seconds / 3600.0:.3g} hours"


def family(robot: Robot, parameter: str) -> Callable[[float], PlanarModel]:
    """The planar model as a function of one parameter in SI units; ParameterError if that does not vary continuously,
    or the planar model does not read it."""
    check_parameter(robot, parameter)
    # Where the symmetry of the gait itself changes, only the full period means the same on both sides.
    symmetric = parameter != "gait.side_phase"
    return lambda value: PlanarModel(robot.with_value(parameter, value), use_symmetry=symmetric)


def bifurcations(
    robot: Robot,
    parameter: str,
    between: tuple[float, float],
    normal_form: bool = True,
    remark: Callable[[str], None] = lambda sentence: None,
    seconds: float = math.inf,
) -> list[WalkBifurcation]:
    """Every bifurcation of the straight walk in an interval of a parameter, by rising parameter; none if stability does
    not change.

    Parameters
    ----------
    robot, parameter
        Robot, and dotted path, such as ``springs.stiffness[0]``; ``springs.stiffness`` moves all springs together.
    between
        The interval in SI units, rising.
    normal_form
        True to compute the coefficients and verdicts.
    remark
        Function that receives a sentence for every reason why points may be missing.
    seconds
        Time after which the search ends with the points found so far; motion far from a robot's scales may be slow to
        follow.
    """
    make = family(robot, parameter)
    unit = robot.unit_of(parameter)
    found = []
    located = stability.locate(make, between, normal_form=normal_form, seconds=seconds)
    if not located.complete:
        for sentence in (located.status.sentence, *located.remarks):
            remark(sentence)
    for point in located:
        components = joint_components(point.mode, robot.body.modules)
        coefficient = coefficient_of(point, robot.body.modules)
        found.append(WalkBifurcation(point, parameter, unit, components, coefficient))
    return found


def coefficient_of(point: BifurcationPoint | Point2, modules: int) -> float | None:
    """Cubic coefficient of a bifurcation of the straight walk for an amplitude of joint angles, 1/rad^2."""
    # The share of the unit mode that is joint angle turns an amplitude of the one into that of the other.
    share = float(np.linalg.norm(point.mode[_joints(modules)]))
    return None if point.coefficient is None else point.coefficient / share**2


def first_loss(
    robot: Robot, parameter: str, between: tuple[float, float] | None, kind: Kind | None, normal_form: bool = True
) -> WalkBifurcation:
    """Bifurcation at which the straight walk loses stability as a spring is softened from ``between[1]`` down; None is
    the interval of :func:`chilopod.analysis.parameters.searched_springs`. AnalysisError if there is none, it is of
    another kind (None is any kind), or the straight walk at ``between[1]`` is not known to be stable."""
    what, between = "loss of stability" if kind is None else kind.label, between or searched_springs(robot)
    spaced = np.geomspace if between[0] > 0.0 else np.linspace
    for low in spaced(between[1], between[0], 5)[1:]:
        # From the stiff end down, so that points far below, where the walk is unstable anyway, cost nothing.
        points = bifurcations(robot, parameter, (float(low), between[1]), normal_form=False)
        if points:
            stable = stability.multipliers(family(robot, parameter)(between[1])).stable
            if not stable:
                problem = f"the straight walk above the {points[-1].point.kind.label} is {VERDICTS[stable]}"
                raise AnalysisError(problem, field=parameter, value=interval_text(robot, parameter, between))
            if kind in (None, points[-1].point.kind):
                if not normal_form:
                    return points[-1]
                near = points[-1].point.value * np.array([1.0 - 1e-3, 1.0 + 1e-3])
                return bifurcations(robot, parameter, (float(near[0]), float(near[1])))[-1]
            problem = f"stability is lost by a {points[-1].point.kind.label}, not a {what}"
            raise AnalysisError(problem, field=parameter)
    searched = interval_text(robot, parameter, between)
    raise AnalysisError(f"no {what} in the interval", field=parameter, value=searched)


def interval_text(robot: Robot, parameter: str, between: tuple[float, float]) -> str:
    """An interval (SI units) in the unit that the parameter is written in."""
    return " to ".join(units.format(each, robot.unit_of(parameter), digits=4) for each in between)


def pitchfork(robot: Robot, normal_form: bool = True) -> WalkBifurcation:
    """Pitchfork at which the straight walk ends as k1 is softened, of all possible springs, see :func:`first_loss`."""
    return first_loss(robot, K1, None, Kind.PITCHFORK, normal_form)


def joint_components(mode: ComplexArray, modules: int) -> ComplexArray:
    """Joint angles of a mode, of unit norm; the phase is free, and the largest component is made real and positive."""
    part = mode[_joints(modules)]
    peak = part[np.abs(part).argmax()]
    norm = np.linalg.norm(part)
    if norm == 0.0:
        return part
    return np.asarray(part / norm * (np.abs(peak) / peak))


def _joints(modules: int) -> slice:
    return slice(3, modules + 2)


def _pairs(values: ComplexArray) -> list[Any]:
    return np.column_stack([values.real, values.imag]).tolist()


def _numbers(values: ComplexArray) -> list[Any]:
    return values.real.tolist() if _is_real(values) else _pairs(values)


def _is_real(values: ComplexArray) -> bool:
    return bool(np.abs(values.imag).max() < 1e-9)


def _in_words(value: complex, digits: int = 3) -> str:
    imaginary = "" if abs(value.imag) < 1e-9 else f"{value.imag:+.{digits}g}i"
    return f"{value.real:.{digits}g}{imaginary}"
