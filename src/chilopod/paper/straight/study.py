"""The paper's Floquet analysis of the straight walk (its Fig. "Floquet analysis using simple two-dimensional model").

One function per panel; each returns an :class:`xarray.Dataset` with units in the attributes, in the paper's units
where a figure is drawn in them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from chilopod import stability
from chilopod.analysis.map_axes import with_modules
from chilopod.analysis.parameters import ALL, K1, PAPER_UNIT, stiffness
from chilopod.analysis.straight_walk import WalkBifurcation, first_loss, pitchfork
from chilopod.errors import AnalysisError
from chilopod.paper import printed
from chilopod.paper.printed import critical_mode_data, variant_settings
from chilopod.paper.section import Context
from chilopod.planar import PlanarModel
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.stability import Kind
from chilopod.tasks.identify import Identification, identify_planar


def exponent_sweep(context: Context, progress: Progress = silent) -> xr.Dataset:
    """Floquet exponents as k1 falls (panel B), each followed through the sweep as one curve.

    Dataset over (k1, exponent): ``real``, ``imaginary`` (1/s), and ``follows_critical``, True for the curve that
    crosses zero.
    """
    robot = context.robot
    ks = np.geomspace(75.0, 2.0, context.size.of(160, 40, 12))
    rows: list[NDArray[np.complex128]] = []
    for index, k in enumerate(ks):
        values = stability.exponents(PlanarModel(robot.with_value(K1, stiffness(float(k))))).values
        rows.append(values if not rows else _followed(rows, values, robot.gait.period))
        progress((index + 1) / len(ks), f"k1 = {k:.1f} {PAPER_UNIT}")
    table = np.array(rows)
    # The curve that is in the left half-plane for stiff springs and in the right one for soft springs, on the real
    # axis.
    critical = (table.real[0] < 0.0) & (table.real[-1] > 0.0)
    columns = {
        "real": (("k1", "exponent"), table.real, {"units": "1/s"}),
        "imaginary": (("k1", "exponent"), table.imag, {"units": "1/s"}),
        "follows_critical": (("exponent",), critical),
    }
    attrs = {"robot": robot.name, "about": "Floquet exponents of the straight walk, each followed as one curve"}
    return xr.Dataset(columns, {"k1": ("k1", ks, {"units": PAPER_UNIT})}, attrs)


def _followed(
    rows: list[NDArray[np.complex128]], values: NDArray[np.complex128], period: float
) -> NDArray[np.complex128]:
    """``values`` in the order that continues the curves most smoothly."""
    last = rows[-1]
    expected = last if len(rows) < 2 else 2 * last - rows[-2]
    difference = values[None, :] - expected[:, None]
    # Imaginary parts are known modulo 2 pi / T.
    turn = 2.0 * np.pi / period
    wrapped = (difference.imag + 0.5 * turn) % turn - 0.5 * turn
    # Fast exponents lie far apart and move fast; distances count relative to how fast a mode decays.
    cost = np.hypot(difference.real, wrapped) / (1.0 + np.abs(expected.real))[:, None]
    return values[linear_sum_assignment(cost)[1]]


def critical_mode(context: Context, progress: Progress = silent) -> xr.Dataset:
    """The pitchfork in k1 and its mode beside the paper's five numbers.

    Dataset over joint: ``computed``, ``printed`` (NaN for another number of modules); the point itself in the
    attributes.
    """
    point = pitchfork(context.robot)
    components = point.joint_components.real
    paper = np.array([each.value for each in printed.MODE])
    if len(components) != len(paper):
        paper = np.full(len(components), np.nan)
    return _over_joints({"computed": ("joint", components), "printed": ("joint", paper)}, context.robot, point)


def variants(context: Context, progress: Progress = silent) -> xr.Dataset:
    """Critical k1 for the paper's variants (panel C) beside the paper's statements on the robot.

    Dataset over variant: ``critical_k1``, ``error_bound``, ``robot_printed`` (N*mm/deg).
    """
    robots = printed.variant_robots(context.robot)
    found = []
    for index, (name, each) in enumerate(robots.items()):
        progress(index / len(robots), name)
        point = pitchfork(each)
        found.append((point.value, point.error_bound, printed.onset(name).value))
    named = zip(("critical_k1", "error_bound", "robot_printed"), np.array(found).T, strict=True)
    columns = {name: ("variant", each, {"units": PAPER_UNIT}) for name, each in named}
    return xr.Dataset(columns, {"variant": np.array(list(robots), dtype=object)}, {"robot": context.robot.name})


def module_counts(context: Context, progress: Progress = silent) -> xr.Dataset:
    """Critical k1 over the number of modules (panel D).

    Dataset over modules: ``critical_k1``, ``error_bound`` (N*mm/deg; NaN where the straight walk does not lose
    stability through a pitchfork), ``says``; attribute ``built``, the number of the robot as built.
    """
    counts = range(3, context.size.of(21, 11, 8))
    found: list[tuple[float, float, str]] = []
    for index, count in enumerate(counts):
        try:
            point = pitchfork(with_modules(context.robot, count))
            kind = point.point.criticality
            found.append((point.value, point.error_bound, kind.label if kind.known else ""))
        except AnalysisError as error:
            found.append((np.nan, np.nan, error.problem))
        progress((index + 1) / len(counts), f"{count} modules")
    values, bounds, says = zip(*found, strict=True)
    columns = {
        "critical_k1": ("modules", np.array(values), {"units": PAPER_UNIT}),
        "error_bound": ("modules", np.array(bounds), {"units": PAPER_UNIT}),
        "says": ("modules", np.array(says, dtype=object)),
    }
    attrs = {"robot": context.robot.name, "built": context.robot.body.modules}
    return xr.Dataset(columns, {"modules": np.array(list(counts))}, attrs)


def uniform_springs(context: Context, progress: Progress = silent) -> xr.Dataset:
    """The bifurcation for uniform springs (the paper's "Hopf"): amplitudes and phases of the undulation along the body.

    Dataset over joint: ``amplitude`` (unit norm), ``phase`` (rad, relative to joint 1, positive leads); the point in
    the attributes.
    """
    robot = context.robot
    point = first_loss(robot, ALL, None, Kind.NEIMARK_SACKER)
    components = point.joint_components
    phase = np.unwrap(np.angle(components))
    columns = {"amplitude": ("joint", np.abs(components)), "phase": ("joint", phase - phase[0], {"units": "rad"})}
    rate = point.point.frequency
    times = {"oscillation_period_s": 2.0 * np.pi / rate, "gait_period_s": robot.gait.period}
    return _over_joints(columns, robot, point).assign_attrs(frequency_rad_s=rate, **times)


def identified(context: Context, progress: Progress = silent) -> Identification:
    """Constants that the paper does not print, from its printed numbers."""
    points = context.size.of(25, 7, 3)
    return identify_planar(context.robot, critical_mode_data(), points, variant_settings(), progress)


def _over_joints(columns: dict[str, Any], robot: Robot, point: WalkBifurcation) -> xr.Dataset:
    """Columns over joint, with the point in the attributes."""
    kind = point.point.criticality
    attrs = {
        "robot": robot.name,
        "kind": point.point.kind.label,
        "parameter": point.parameter,
        "value": point.value,
        "unit": point.unit,
        "error_bound": point.error_bound,
        "criticality": kind.label if kind.known else "",
        "coefficient": point.coefficient if point.coefficient is not None else np.nan,
    }
    return xr.Dataset(columns, {"joint": np.arange(1, len(point.joint_components) + 1)}, attrs)
