"""Curved walks: the branch of periodic orbits that leaves the straight walk at its pitchfork, and how it turns.

The paper's linear analysis ends at the pitchfork; this follows the nonlinear model beyond it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from chilopod import units
from chilopod.errors import AnalysisError
from chilopod.planar import PlanarModel, powers
from chilopod.robot import Robot
from chilopod.stability import Kind
from chilopod.stability.branch import Branch, BranchPoint, follow, leave_pitchfork
from chilopod.studies.straight_walk import bifurcations, family

Array = NDArray[np.float64]

TOLERANCE = 1e-11
"""Of the nonlinear flow along a branch: orbits and radii are good to about 1e-10."""

GRAVITY = 9.80665
"""m/s^2, standard."""

_SUFFIX = {
    "axis_radius": "m",
    "path_radius": "m",
    "heading_rate": "rad_s",
    "speed": "m_s",
    "cost_of_transport": "",
    "multiplier": "",
}
_NODES = (
    16  # Gauss-Legendre, in every interval between two switches: after each one, motion settles within milliseconds
)


def curved_walks(
    robot: Robot,
    parameter: str,
    between: tuple[float, float],
    *,
    points: int = 60,
    side: int = 1,
    progress: Callable[[float, str], None] = lambda done, words: None,
) -> xr.Dataset:
    """Follow the curved walks from the pitchfork at the upper end of stability through an interval of a parameter.

    Parameters
    ----------
    robot
        The robot.
    parameter
        Dotted path of a spring, such as ``springs.stiffness[0]``.
    between
        Interval in SI units; the pitchfork must lie in it, and the branch ends where it leaves it.
    points
        At most so many points along the branch, special ones not counted.
    side
        +1: positive joint angles, a right turn; -1: the mirror image.
    progress
        Called with the part done (0 to 1) and a few words.

    Returns
    -------
    Dataset over point (along the branch): the parameter, ``stable``, ``special`` (kind, or empty), ``multiplier``
    (modulus of the largest), ``mean_angle`` over (point, joint), ``axis_radius`` (the paper's (N-1) L / sum |theta|),
    ``path_radius`` (from the drift per period), ``heading_rate`` (left positive), ``speed``, ``floor_power`` and
    ``leg_power`` (means over a period), ``cost_of_transport`` (leg power over weight times speed), and ``orbit`` over
    (point, state).

    Raises
    ------
    AnalysisError
        If there is no pitchfork in the interval.
    """
    forks = [each.point for each in bifurcations(robot, parameter, between) if each.point.kind is Kind.PITCHFORK]
    if not forks:
        raise AnalysisError("the straight walk has no pitchfork in this interval", field=parameter)
    make = family(robot, parameter)

    def coarse(value: float) -> PlanarModel:
        return PlanarModel(make(value).robot, TOLERANCE)

    unit = robot.unit_of(parameter)

    def shown(count: int, point: BranchPoint) -> None:
        progress(0.8 * count / points, f"{units.format(point.value, unit, digits=4)}")

    # The positive side of the mode is that of positive joint angles.
    fork = forks[-1]
    angles = fork.mode.real[3 : robot.body.modules + 2]
    start = leave_pitchfork(coarse, fork, side if angles.sum() >= 0 else -side)
    branch = follow(coarse, start, between, points=points, progress=shown)
    return _walked(robot, parameter, branch, coarse, lambda done: progress(0.8 + 0.2 * done, "radii and powers"))


def as_json(data: xr.Dataset) -> dict[str, Any]:
    """A branch as plain numbers; an infinite radius (straight on) is null."""

    def plain(value: float) -> float | None:
        return float(value) if np.isfinite(value) else None

    unit = data.parameter.attrs["units"]
    columns = ("axis_radius", "path_radius", "heading_rate", "speed", "cost_of_transport", "multiplier")
    return {
        "robot": data.attrs["robot"],
        "parameter": data.attrs["varied"],
        "unit": unit,
        "ending": data.attrs["ending"],
        "points": [
            {
                "value": float(at.parameter),
                "stable": bool(at.stable),
                "special": str(at.special.values) or None,
                "mean_joint_angles_rad": [float(angle) for angle in at.mean_angle],
                **{f"{name}_{_SUFFIX[name]}".rstrip("_"): plain(float(at[name])) for name in columns},
            }
            for at in (data.isel(point=i) for i in range(data.sizes["point"]))
        ],
    }


def _walked(
    robot: Robot,
    parameter: str,
    branch: Branch,
    model_at: Callable[[float], PlanarModel],
    progress: Callable[[float], None],
) -> xr.Dataset:
    """What the robot does on every orbit of a branch."""
    rows = []
    for index, point in enumerate(branch.points):
        rows.append(_walk(model_at(point.value), point.orbit))
        progress((index + 1) / len(branch.points))
    unit = robot.unit_of(parameter)
    joints = robot.body.modules - 1

    def column(name: str, what: str) -> tuple[tuple[str, ...], Array, dict[str, str]]:
        return ("point",), np.array([row[name] for row in rows]), {"units": what}

    return xr.Dataset(
        {
            "parameter": (("point",), np.array([units.from_si(p.value, unit) for p in branch.points]), {"units": unit}),
            "stable": (("point",), np.array([p.stable for p in branch.points])),
            "special": (
                ("point",),
                np.array([p.special.label if p.special else "" for p in branch.points], dtype=object),
            ),
            "multiplier": (("point",), np.array([abs(p.multipliers[0]) for p in branch.points])),
            "mean_angle": (("point", "joint"), np.array([row["mean_angle"] for row in rows]), {"units": "rad"}),
            "axis_radius": column("axis_radius", "m"),
            "path_radius": column("path_radius", "m"),
            "heading_rate": column("heading_rate", "rad/s"),
            "speed": column("speed", "m/s"),
            "floor_power": column("floor_power", "W"),
            "leg_power": column("leg_power", "W"),
            "cost_of_transport": column("cost_of_transport", "1"),
            "orbit": (("point", "state"), np.array([p.orbit for p in branch.points])),
        },
        coords={"joint": np.arange(1, joints + 1)},
        attrs={"robot": robot.name, "varied": parameter, "ending": branch.ending.label},
    )


def _walk(model: PlanarModel, orbit: Array) -> dict[str, object]:
    """Means over one period and the drift of one periodic walk."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    times = model.schedule.times
    state, now = orbit, 0.0
    angles = np.zeros(model.modules - 1)
    floor = legs = 0.0
    for start, end in zip(times[:-1], times[1:], strict=True):
        half = 0.5 * (end - start)
        for node, weight in zip(nodes, weights, strict=True):
            t = float(start + half * (1.0 + node))
            state, now = model.flow_states(state[None], now, t)[0], t
            share = half * weight / model.period
            power = powers(model, state, t)
            angles += share * state[3 : model.modules + 2]
            floor += share * power.floor
            legs += share * power.legs
    drift = model.drift(orbit)
    bent = float(np.abs(angles).sum())
    weight_force = model.robot.body.mass * GRAVITY
    return {
        "mean_angle": angles,
        "axis_radius": (model.modules - 1) * model.robot.module_length / bent if bent > 0.0 else np.inf,
        "path_radius": drift.radius,
        "heading_rate": drift.heading_rate,
        "speed": drift.speed,
        "floor_power": floor,
        "leg_power": legs,
        "cost_of_transport": legs / (weight_force * drift.speed),
    }
