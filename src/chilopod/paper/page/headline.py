"""First figure of the page: bends of planar model, twin and robot over the first spring, on one axis."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from chilopod.frozen import Array
from chilopod.paper import printed, shapes
from chilopod.paper.curved.study import CurvedStudy
from chilopod.paper.robot.walks import RobotWalks
from chilopod.robot import Robot
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import SPRING_UNIT, k, listing, number

_SIZES: Final = ((6.4, 4.1), (style.NARROW, 4.2))  # inches: beside sentences, and on a phone
_SHARES: Final = (0.4, 2.4)
_TICKS: Final = (0.5, 0.7, 1.0, 1.5, 2.0)
_LOOKS: Final[dict[str, dict[str, Any]]] = {
    "planar": {"color": style.BLUE, "marker": "o", "markersize": 6.0, "label": "planar model, trials"},
    "twin": {"color": style.GREEN, "marker": "s", "markersize": 5.5, "label": "robot in 3-D, trials"},
    "paper": {"color": style.ORANGE, "marker": "D", "markersize": 9.0, "label": "the paper's robot"},
}


def pitchfork(robot: Robot, curved: CurvedStudy | None, walks: RobotWalks | None) -> Panel:
    """Signed bend over k1/k1* of trials, exact walks and the paper's robot."""
    columns, points = _paper(robot), [("the paper's robot", printed.ONSET.value)]
    if curved is not None:
        exact = float(curved.trials.attrs["critical_k1"])
        points.append(("the planar model", exact))
        columns |= _trials(curved.trials, exact, "planar") | _branch(curved.branch, exact)
    if walks is not None:
        onset = walks.fit.critical if walks.fit else printed.ONSET.value
        points.append(("the robot in 3-D", onset))
        columns |= _trials(walks.base, onset, "twin")
    data = xr.Dataset(columns, attrs={"robot": robot.name})
    where = listing(f"{number(value, 4)} for {name}" for name, value in points)
    return Panel(
        name="pitchfork",
        title="One spring, two ways to turn",
        draw=lambda narrow: _draw(data, narrow),
        alt=f"Bend of the body, to the left above and to the right below, over {k(1)}/{k(1)}*: straight above 1, and "
        "below it two branches with trials on both.",
        text=(
            f"Bend of the body, the sum of its joint angles, over the first spring as a share of its critical value "
            f"{k(1)}*: {where}\u00a0{SPRING_UNIT}. Solid lines are stable walks of the planar model, dashed ones "
            "unstable. Every small mark is one walk that started straight, and chance chose its side. The paper prints "
            "two radii of its robot, which fix the size of a bend but not its side, and two springs that walk "
            "straight.",
        ),
        data=data,
    )


def _columns(what: str, share: Array, bend: Array) -> dict[str, Any]:
    return {f"{what}_share": (what, share, {"units": "1"}), f"{what}_bend": (what, np.rad2deg(bend), {"units": "deg"})}


def _paper(robot: Robot) -> dict[str, Any]:
    """Bends of the radii that the paper prints, to both sides, and of its straight walks."""
    reach = (robot.body.modules - 1) * robot.module_length
    bends = {spring: reach / radius.value for spring, radius in printed.RADII.items()}
    pairs = [(spring, sign * bend) for spring, bend in bends.items() for sign in (1.0, -1.0)]
    springs, signed = np.array([*pairs, *((spring, 0.0) for spring in printed.STRAIGHT)]).T
    return _columns("paper", springs / printed.ONSET.value, signed)


def _trials(data: xr.Dataset, critical: float, what: str) -> dict[str, Any]:
    """Bends of trials over spring and repeat that have settled."""
    angles = data.mean_angle.transpose("spring", "repeat", "joint").values
    sides = data.direction.transpose("spring", "repeat").values
    bends = np.abs(angles).sum(axis=-1) * np.select([sides == "left", sides == "right"], [1.0, -1.0], np.nan)
    bends = np.where(sides == "straight", -angles.sum(axis=-1), bends)
    shares = np.broadcast_to(data.spring.values[:, None] / critical, bends.shape)
    here = np.isfinite(bends)
    return _columns(what, shares[here], bends[here])


def _branch(branch: xr.Dataset, critical: float) -> dict[str, Any]:
    """Bends of the exact walks to the right, and mask of the stable ones."""
    columns = _columns("branch", branch.parameter.values / critical, np.abs(branch.mean_angle.values).sum(axis=-1))
    return {**columns, "branch_stable": ("branch", branch.stable.values.astype(int))}


def _draw(data: xr.Dataset, narrow: bool) -> Figure:
    figure = Figure(figsize=_SIZES[narrow], layout="constrained")
    axes = figure.add_subplot()
    _draw_walks(axes, data)
    for what, look in _LOOKS.items():
        if what in data.dims:
            edge: dict[str, Any] = {"mfc": "none", "mew": 1.8} if what == "paper" else {"mec": "white", "mew": 0.6}
            axes.plot(data[f"{what}_share"], data[f"{what}_bend"], linestyle="", zorder=4, **look, **edge)
    axes.set_xscale("log")
    axes.set_xticks(_TICKS, [f"{tick:g}" for tick in _TICKS])
    axes.minorticks_off()
    shapes.finish(axes, xlim=_SHARES, xlabel=f"first spring, {k(1)} / {k(1)}*", ylabel="bend of the body (deg)")
    for height, side in ((0.97, "left"), (0.03, "right")):
        place: dict[str, Any] = {"ha": "right", "va": "top" if side == "left" else "bottom", "color": style.GREY}
        axes.text(0.98, height, f"to the {side}", transform=axes.transAxes, **place)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=1 if narrow else 2)
    return figure


def _draw_walks(axes: Axes, data: xr.Dataset) -> None:
    """Straight walk and branches, stable ones solid."""
    solid: dict[str, Any] = {"color": style.BLUE, "lw": 2.2}
    dashed: dict[str, Any] = {"color": style.BLUE, "lw": 1.3, "linestyle": shapes.DASHED}
    axes.plot([1.0, _SHARES[1]], [0.0, 0.0], label="planar model, exact", **solid)
    axes.plot([_SHARES[0], 1.0], [0.0, 0.0], label="the same, unstable", **dashed)
    if "branch" in data.dims:
        for stable, look in ((data.branch_stable.values > 0, solid), (data.branch_stable.values == 0, dashed)):
            for sign in (1.0, -1.0):
                axes.plot(data.branch_share, np.where(stable, sign * data.branch_bend, np.nan), **look)
