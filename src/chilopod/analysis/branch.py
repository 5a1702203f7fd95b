"""Curved walks: the branch of periodic orbits that leaves the straight walk at its pitchfork.

The paper's linear analysis ends at the pitchfork; this module follows the nonlinear model beyond it.
"""

from __future__ import annotations

import io
import tomllib
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from chilopod import stability, units
from chilopod.analysis.straight_walk import WalkBifurcation, bifurcations, family, interval_text
from chilopod.engine import Status
from chilopod.errors import AnalysisError, ParameterError, nearest_name
from chilopod.flows.deadline import SpentError
from chilopod.frozen import Array
from chilopod.netcdf import UnsoundError, unsealed
from chilopod.notebook import finite
from chilopod.planar.along import FollowedModel, walk_means
from chilopod.planar.stretch import MOST_BENT
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.stability import Branch, BranchPoint, Criticality, Ending, Kind, SearchStatus, Start, follow, switch
from chilopod.stability.branches.branch import LONGEST
from chilopod.stability.spectrum import VERDICTS

TOLERANCE = 1e-10
"""Tolerance of the nonlinear flow along a branch; orbits are accurate to 1e-10 (the tests compare 1e-9 with 1e-14)."""

VERSION = 3
"""Version of the file of a branch, increased whenever the meaning of its data or their continuation changes."""

NO_PAIR = "the onset is transcritical, and no pair of mirrored walks leaves it, as side_phase is not 180 deg"

_KEYS = {
    **{"axis_radius": "axis_radius_m", "path_radius": "path_radius_m", "heading_rate": "heading_rate_rad_s"},
    **{"speed": "speed_m_s", "cost_of_transport": "cost_of_transport", "multiplier": "multiplier"},
}
_STABLE = {VERDICTS[stable]: stable for stable in VERDICTS}
# Properties that must agree to continue a branch; names may differ.
_SAME = "body", "springs", "legs", "gait", "ground"
_VERDICT = "criticality", "coefficient", "direction", "direction_confirms"


def _pitchfork(robot: Robot, parameter: str, between: tuple[float, float], seconds: float) -> WalkBifurcation:
    """Stiffest pitchfork in an interval; an AnalysisError if there is none, or the search takes too long."""
    searched, remarks = interval_text(robot, parameter, between), list[str]()
    try:
        found = bifurcations(robot, parameter, between, remark=remarks.append, seconds=seconds)
    except SpentError:  # before the first point
        found, remarks = [], [SearchStatus.BUDGET.sentence]
    forks = [each for each in found if each.point.kind is Kind.PITCHFORK]
    if SearchStatus.BUDGET.sentence in remarks and (seconds < np.inf or not forks):
        problem = f"the search for a pitchfork was given up{f' after {seconds:g} s' if seconds < np.inf else ''}"
        raise AnalysisError(problem, field=f"between {parameter}", value=searched, allowed="fewer or heavier modules")
    if not forks:
        uneven = not robot.gait.half_period_symmetric and any(each.point.kind is Kind.TRANSCRITICAL for each in found)
        problem = NO_PAIR if uneven else "the straight walk has no pitchfork in this interval"
        others = [f"{each.point.kind.label} at {units.format(each.point.value, each.unit, digits=6)}" for each in found]
        here = f"here are: {', '.join(others)}" if others else "`chilopod bifurcation` lists where the walk bends"
        allowed = f"an interval around a pitchfork; {here}"
        raise AnalysisError(problem, field=f"between {parameter}", value=searched, allowed=allowed)
    return forks[-1]


def curved_walks(
    robot: Robot,
    parameter: str,
    between: tuple[float, float],
    *,
    points: int = 60,
    longest: float = LONGEST,
    side: int = 1,
    progress: Progress = silent,
    seconds: float = np.inf,
) -> xr.Dataset:
    """Follow the curved walks from the stiffest pitchfork of the straight walk through an interval of a parameter.

    Parameters
    ----------
    robot, parameter
        Robot, and dotted path of a spring, such as ``springs.stiffness[0]``.
    between
        Interval in SI units that contains the pitchfork; the branch ends where it leaves the interval.
    points, longest
        Largest number of points along the branch, without special ones, and largest distance between two of them along
        the curve, over orbit (SI units) and parameter (over the width of the interval).
    side
        +1: positive joint angles, a right turn; -1: the mirror image.
    seconds
        Time for the search for the pitchfork, s, after which an AnalysisError ends it.

    Returns
    -------
    Dataset over point (along the branch): the parameter (``parameter_si`` in SI units), ``verdict`` (stable, unstable,
    undecided; out of range where a joint bends within the cycle by more than a right angle, at which engines end a
    walk), ``stable`` (whether that is the verdict), ``special`` (kind, or empty), ``multiplier`` (modulus of the
    largest), ``multiplier_real`` and ``multiplier_imag`` over (point, state), ``mean_angle`` over (point, joint),
    ``most_bent`` (largest angle of a joint within the cycle), ``axis_radius`` (the paper's (N-1) L / sum |theta|),
    ``path_radius`` (from the drift per period), ``heading_rate`` (left positive), ``speed``, ``floor_power`` and
    ``leg_power`` (means over a period), ``cost_of_transport`` (leg power over weight times speed), ``orbit`` over
    (point, state) and ``tangent`` over (point, component).

    Attributes hold the state for :func:`resumed`, and for the pitchfork its ``criticality`` by the normal form, its
    ``coefficient`` (1/rad^2), the ``direction`` in which the branch leaves it, and ``direction_confirms``, True if that
    agrees with the verdict. AnalysisError if there is no pitchfork in the interval.
    """
    fork = _pitchfork(robot, parameter, between, seconds)
    # The positive side of the mode is that of positive joint angles.
    angles = fork.point.mode.real[3 : robot.body.modules + 2]
    starts = switch(_followed(robot, parameter), fork.point)
    if len(starts) != 2:
        raise AnalysisError(f"{len(starts)} branches leave the straight walk there, not two", field=parameter)
    along, against = starts
    start = along if (side > 0) is bool(angles.sum() >= 0) else against
    branch = _follow(robot, parameter, start, between, points, longest, progress)
    attributes = {"side": side, **_verdict(robot, parameter, fork, branch)}
    return _walked(robot, parameter, between, branch, attributes)


def resumed(
    data: xr.Dataset,
    robot: Robot,
    parameter: str,
    between: tuple[float, float] | None = None,
    *,
    points: int = 60,
    longest: float = LONGEST,
    side: int | None = None,
    progress: Progress = silent,
) -> xr.Dataset:
    """Continue a branch of :func:`curved_walks`, :func:`resumed` or :func:`read_walks` from its end; the new points are
    equal to those of a single run. ParameterError if the branch belongs to another robot, parameter or side, or has
    left the interval.

    The robot's own value of the parameter does not matter, and ``side`` None is not compared. The other arguments are
    those of :func:`curved_walks`; the interval is by default that of the branch.
    """
    saved = Robot(**tomllib.loads(data.attrs["robot_toml"]))
    if data.attrs["varied"] != parameter:
        said, varied = "must be the parameter that the saved branch varies", data.attrs["varied"]
        raise ParameterError(said, field="parameter", value=parameter, allowed=varied)
    value = float(data.parameter_si[0])
    here, there = robot.with_value(parameter, value), saved.with_value(parameter, value)
    for name in _SAME:
        if getattr(here, name) != getattr(there, name):
            said = f"the saved branch belongs to another robot: {name} differs"
            raise ParameterError(said, field="robot", value=robot.name)
    if side is not None and side != data.attrs["side"]:
        problem, allowed = "must be the side to which the saved branch turns", str(data.attrs["side"])
        raise ParameterError(problem, field="side", value=side, allowed=allowed)
    given, between = between, (data.attrs["lowest_si"], data.attrs["highest_si"]) if between is None else between
    (low, high), end = sorted(between), float(data.parameter_si[-1])
    last = units.format(end, robot.unit_of(parameter), digits=6)
    ended = end == (low if data.tangent[-1, -1] < 0.0 else high)
    if ended or not low <= end <= high:
        problem = f"must contain {last}, the last point of the saved branch"
        problem = f"must go on beyond {last}, where the saved branch left its interval" if ended else problem
        shown = None if given is None else interval_text(robot, parameter, (low, high))
        raise ParameterError(problem, field="between", value=shown, allowed="a wider interval")
    start = _branch_of(data, _followed(saved, parameter)(value).scale)
    branch = _follow(saved, parameter, start, between, points, longest, progress)
    kept = {name: data.attrs[name] for name in _VERDICT}
    return _walked(saved, parameter, between, branch, {"side": data.attrs["side"], **kept})


def read_walks(path: str | Path) -> xr.Dataset:
    """Read a branch from its netCDF file; ParameterError if that is missing, damaged, edited or of another version."""
    path = Path(path)
    try:
        data = xr.load_dataset(io.BytesIO(unsealed(path)), engine="h5netcdf")
    except FileNotFoundError:
        missing, like = (path, f"*{path.suffix}") if path.parent.is_dir() else (path.parent, f"*/{path.name}")
        names = (found.relative_to(missing.parent).parts[0] for found in sorted(missing.parent.glob(like)))
        raise ParameterError("does not exist", source=str(missing), nearest=nearest_name(missing.name, names)) from None
    except UnsoundError as error:
        raise ParameterError(str(error), source=str(path)) from None
    if data.attrs.get("version") != VERSION:
        raise ParameterError("must hold a branch of curved walks of this version of chilopod", source=str(path))
    return data


def as_json(data: xr.Dataset) -> dict[str, Any]:
    """A branch as plain numbers; an infinite radius (straight on) is null."""
    return {
        "robot": data.attrs["robot"],
        "parameter": data.attrs["varied"],
        "unit": data.parameter.attrs["units"],
        "ending": data.attrs["ending"],
        "criticality": data.attrs["criticality"],
        "coefficient_per_rad2": finite(data.attrs["coefficient"]),
        "direction": data.attrs["direction"],
        "direction_confirms": data.attrs["direction_confirms"] == "yes",
        "points": [
            {
                "value": float(at.parameter),
                "stable": _STABLE.get(str(at.verdict.values)),
                "verdict": str(at.verdict.values),
                "special": str(at.special.values) or None,
                "mean_joint_angles_rad": [float(angle) for angle in at.mean_angle],
                **{key: finite(float(at[name])) for name, key in _KEYS.items()},
                "multipliers": np.column_stack([at.multiplier_real, at.multiplier_imag]).tolist(),
            }
            for at in (data.isel(point=i) for i in range(data.sizes["point"]))
        ],
    }


def _followed(robot: Robot, parameter: str) -> Callable[[float], FollowedModel]:
    make = family(robot, parameter)
    return lambda value: FollowedModel(make(value).robot, TOLERANCE)


def _follow(
    robot: Robot,
    parameter: str,
    start: Start | Branch,
    between: tuple[float, float],
    points: int,
    longest: float,
    progress: Progress,
) -> Branch:
    def shown(count: int, point: BranchPoint) -> None:
        progress(count / points, units.format(point.value, robot.unit_of(parameter), digits=4))

    how: Any = {"points": points, "longest": longest, "closely": False, "precision": TOLERANCE}
    return follow(_followed(robot, parameter), start, between, **how, progress=shown)


def _verdict(robot: Robot, parameter: str, fork: WalkBifurcation, branch: Branch) -> dict[str, Any]:
    """The normal form's verdict on the pitchfork, and the check against the direction of the branch."""
    make, critical = family(robot, parameter), fork.point.value
    gone = next((point.value for point in branch.points[1:] if point.value != critical), critical)

    def largest(value: float) -> float:
        """Modulus of the critical multiplier of the straight walk."""
        found = stability.multipliers(make(value))
        nu = found.values if found.half_period is None else found.half_period
        return float(np.abs(nu[np.abs(nu - fork.point.multiplier).argmin()]))

    # Supercritical: the curved walks exist where the straight one is unstable.
    beyond = largest(gone) > largest(2.0 * critical - gone)
    direction = Criticality.SUPERCRITICAL if beyond else Criticality.SUBCRITICAL
    verdict = fork.point.criticality
    return {
        "criticality": verdict.label if verdict.known else "",
        "coefficient": np.nan if fork.coefficient is None else fork.coefficient,
        "direction": direction.label if gone != critical else "",
        "direction_confirms": "yes" if gone != critical and verdict is direction else "no",
    }


def _branch_of(data: xr.Dataset, sizes: Array) -> Branch:
    """Branch of a dataset, to the last bit."""
    kinds = {kind.label: kind for kind in Kind}
    multipliers = data.multiplier_real.values + 1j * data.multiplier_imag.values
    numbers = data.parameter_si.values.tolist(), data.orbit.values, multipliers, data.tangent.values
    scale = np.append(sizes, float(data.attrs["scale"]))
    rows = zip(*numbers, data.special.values, strict=True)
    points = tuple(BranchPoint(x, orbit, nu, along, scale, kinds.get(str(kind))) for x, orbit, nu, along, kind in rows)
    (ending,) = (each for each in Ending if each.label == data.attrs["ending"])
    return Branch(points, ending, float(data.attrs["step"]))


def _stability(branch: Branch) -> list[bool | None]:
    """Stability of every orbit of a branch. Where its own multipliers are too near the circle, as beside a pitchfork,
    it is that of the other orbits up to the next special points, at which alone it changes."""
    # At a special point a multiplier is 1, and round-off decides its side.
    stable = [None if point.special else point.stable for point in branch.points]
    special = [i for i, point in enumerate(branch.points) if point.special]
    for a, b in pairwise([-1, *special, len(stable)]):
        decided = set(stable[a + 1 : b]) - {None}
        if len(decided) == 1 and not branch.remarks:
            stable[a + 1 : b] = [*decided] * (b - a - 1)
    return stable


def _walked(
    robot: Robot, parameter: str, between: tuple[float, float], branch: Branch, attributes: dict[str, Any]
) -> xr.Dataset:
    """Walk of the robot on every orbit of a branch."""
    points, make, unit = branch.points, _followed(robot, parameter), robot.unit_of(parameter)
    models = [make(point.value) for point in points]
    means = walk_means(models, [point.orbit for point in points])
    weight = np.array([model.robot.weight for model in models])
    speed = np.array([drift.speed for drift in means.drifts])
    multipliers = np.array([point.multipliers for point in points])
    pairs = zip(means.most_bent, _stability(branch), strict=True)
    verdicts = [Status.OUT_OF_RANGE.label if most > MOST_BENT else VERDICTS[stable] for most, stable in pairs]
    radius = [float(model.robot.axis_radius(angles)) for model, angles in zip(models, means.mean_angle, strict=True)]

    special = [point.special.label if point.special else "" for point in points]

    def column(values: Any, what: str | None = None) -> tuple[Any, ...]:
        return (("point",), np.asarray(values), {} if what is None else {"units": what})

    return xr.Dataset(
        {
            "parameter": column([units.from_si(point.value, unit) for point in points], unit),
            "verdict": column(np.array(verdicts, dtype=object)),
            "stable": column([verdict == VERDICTS[True] for verdict in verdicts]),
            "special": column(np.array(special, dtype=object)),
            "multiplier": column(np.abs(multipliers[:, 0])),
            "mean_angle": (("point", "joint"), means.mean_angle, {"units": "rad"}),
            "most_bent": column(means.most_bent, "rad"),
            "axis_radius": column(radius, "m"),
            "path_radius": column([drift.radius for drift in means.drifts], "m"),
            "heading_rate": column([drift.heading_rate for drift in means.drifts], "rad/s"),
            "speed": column(speed, "m/s"),
            "floor_power": column(means.floor_power, "W"),
            "leg_power": column(means.leg_power, "W"),
            "cost_of_transport": column(means.leg_power / (weight * speed), "1"),
            "parameter_si": column([point.value for point in points], robot.si_unit_of(parameter)),
            "orbit": (("point", "state"), np.array([point.orbit for point in points])),
            "multiplier_real": (("point", "state"), multipliers.real),
            "multiplier_imag": (("point", "state"), multipliers.imag),
            "tangent": (("point", "component"), np.array([point.tangent for point in points])),
        },
        coords={"joint": np.arange(1, robot.body.modules)},
        attrs={
            "version": VERSION,
            "robot": robot.name,
            "varied": parameter,
            "ending": branch.ending.label,
            **attributes,
            "lowest_si": float(between[0]),
            "highest_si": float(between[1]),
            "scale": branch.scale,
            "step": branch.step,
            "robot_toml": robot.to_toml(),
        },
    )
