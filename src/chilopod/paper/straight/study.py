"""The paper's Floquet analysis of the straight walk (its Fig. "Floquet analysis using simple two-dimensional model").

One function per panel; each returns an :class:`xarray.Dataset` with units in the attributes, in the paper's units
where a figure is drawn in them.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from chilopod import stability
from chilopod.analysis.parameters import ALL, K1, PAPER_UNIT, stiffness
from chilopod.analysis.straight_walk import WalkBifurcation, first_loss, pitchfork
from chilopod.errors import AnalysisError
from chilopod.paper import printed
from chilopod.planar import PlanarModel
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.stability import Kind


def exponent_sweep(robot: Robot, count: int = 120, progress: Progress = silent) -> xr.Dataset:
    """Floquet exponents as k1 falls (panel B), each followed through the sweep as one curve.

    Returns
    -------
    Dataset over (k1, exponent): ``real``, ``imaginary`` (1/s), and ``follows_critical``, whether a curve is the one
    that crosses.
    """
    ks = np.geomspace(75.0, 2.0, count)
    rows: list[NDArray[np.complex128]] = []
    for index, k in enumerate(ks):
        values = stability.exponents(PlanarModel(robot.with_value(K1, stiffness(float(k))))).values
        rows.append(values if not rows else _followed(rows, values, robot.gait.period))
        progress((index + 1) / count, f"k1 = {k:.1f} {PAPER_UNIT}")
    table = np.array(rows)
    # The curve that is in the left half-plane for stiff springs and in the right one for soft springs, on the real
    # axis.
    critical = (table.real[0] < 0.0) & (table.real[-1] > 0.0)
    return xr.Dataset(
        {
            "real": (("k1", "exponent"), table.real, {"units": "1/s"}),
            "imaginary": (("k1", "exponent"), table.imag, {"units": "1/s"}),
            "follows_critical": (("exponent",), critical),
        },
        coords={"k1": ("k1", ks, {"units": PAPER_UNIT})},
        attrs={"robot": robot.name, "about": "Floquet exponents of the straight walk, each followed as one curve"},
    )


def _followed(
    rows: list[NDArray[np.complex128]], values: NDArray[np.complex128], period: float
) -> NDArray[np.complex128]:
    """``values`` in the order that continues the curves so far most smoothly."""
    last = rows[-1]
    expected = last if len(rows) < 2 else 2 * last - rows[-2]
    difference = values[None, :] - expected[:, None]
    # Imaginary parts are known modulo 2 pi / T.
    turn = 2.0 * np.pi / period
    wrapped = (difference.imag + 0.5 * turn) % turn - 0.5 * turn
    # Fast exponents lie far apart and move fast; distances count relative to how fast a mode decays.
    cost = np.hypot(difference.real, wrapped) / (1.0 + np.abs(expected.real))[:, None]
    return values[linear_sum_assignment(cost)[1]]


def critical_mode(robot: Robot) -> xr.Dataset:
    """The pitchfork in k1 and its mode beside the paper's five numbers.

    Returns
    -------
    Dataset over joint: ``computed``, ``printed`` (NaN for another number of modules); the point itself in the
    attributes.
    """
    point = pitchfork(robot)
    components = point.joint_components.real
    paper = np.array([each.value for each in printed.MODE])
    if len(components) != len(paper):
        paper = np.full(len(components), np.nan)
    return xr.Dataset(
        {
            "computed": (("joint",), components),
            "printed": (("joint",), paper),
        },
        coords={"joint": np.arange(1, len(components) + 1)},
        attrs={"robot": robot.name, **_described(point)},
    )


def variants(robot: Robot, progress: Progress = silent) -> xr.Dataset:
    """Critical k1 for the paper's variants (panel C) beside what the paper says of model and robot.

    Returns
    -------
    Dataset over variant: ``critical_k1``, ``error_bound``, ``robot_printed`` (N*mm/deg).
    """
    robots = printed.variant_robots(robot)
    found = []
    for index, (name, each) in enumerate(robots.items()):
        progress(index / len(robots), name)
        point = pitchfork(each)
        found.append((point.value, point.error_bound, printed.onset(name).value))
    names, columns = ("critical_k1", "error_bound", "robot_printed"), np.array(found).T
    return xr.Dataset(
        {name: ("variant", each, {"units": PAPER_UNIT}) for name, each in zip(names, columns, strict=True)},
        coords={"variant": np.array(list(robots), dtype=object)},
        attrs={"robot": robot.name},
    )


def with_modules(robot: Robot, modules: int) -> Robot:
    """The robot with another number of modules of the same size and mass, the last spring repeated."""
    factor = modules / robot.body.modules
    return (
        robot.with_value("body.length", robot.body.length * factor)
        .with_value("body.mass", robot.body.mass * factor)
        .with_value("body.modules", modules)
    )


def module_counts(robot: Robot, counts: range = range(3, 21), progress: Progress = silent) -> xr.Dataset:
    """Critical k1 over the number of modules (panel D).

    Returns
    -------
    Dataset over modules: ``critical_k1``, ``error_bound`` (N*mm/deg; NaN where the straight walk does not lose
    stability through a pitchfork), ``says``.
    """
    values, bounds, says = [], [], []
    for index, count in enumerate(counts):
        try:
            point = pitchfork(with_modules(robot, count))
            values.append(point.value)
            bounds.append(point.error_bound)
            says.append(str(point.point.criticality.label if point.point.criticality.known else ""))
        except AnalysisError as error:
            values.append(np.nan)
            bounds.append(np.nan)
            says.append(error.problem)
        progress((index + 1) / len(counts), f"{count} modules")
    return xr.Dataset(
        {
            "critical_k1": (("modules",), np.array(values), {"units": PAPER_UNIT}),
            "error_bound": (("modules",), np.array(bounds), {"units": PAPER_UNIT}),
            "says": (("modules",), np.array(says, dtype=object)),
        },
        coords={"modules": np.array(list(counts))},
        attrs={"robot": robot.name},
    )


def uniform_springs(robot: Robot) -> xr.Dataset:
    """The bifurcation for uniform springs (the paper's "Hopf"): amplitudes and phases of the undulation along the body.

    Returns
    -------
    Dataset over joint: ``amplitude`` (unit norm), ``phase`` (rad, relative to joint 1, positive leads); the point in
    the attributes.
    """
    point = first_loss(robot, ALL, (stiffness(2.0), stiffness(75.0)), Kind.NEIMARK_SACKER)
    components = point.joint_components
    phase = np.unwrap(np.angle(components))
    return xr.Dataset(
        {
            "amplitude": (("joint",), np.abs(components)),
            "phase": (("joint",), phase - phase[0], {"units": "rad"}),
        },
        coords={"joint": np.arange(1, len(components) + 1)},
        attrs={
            "robot": robot.name,
            **_described(point),
            "frequency_rad_s": point.point.frequency,
            "oscillation_period_s": 2.0 * np.pi / point.point.frequency,
        },
    )


def _described(point: WalkBifurcation) -> dict[str, object]:
    return {
        "kind": point.point.kind.label,
        "parameter": point.parameter,
        "value": point.value,
        "unit": point.unit,
        "error_bound": point.error_bound,
        "criticality": point.point.criticality.label if point.point.criticality.known else "",
        "coefficient": point.coefficient if point.coefficient is not None else np.nan,
    }
