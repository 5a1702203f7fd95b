"""Scaling law: critical springs of robots of one shape collapse in units of :func:`spring_scale`.

The equations of the planar model have the units of length, mass and time. Robots of one shape, that is with the same
ratios of lengths, phases and duty factor, and with springs in the same ratio, therefore bend at

    k1 = friction x speed x duty factor x module length x F(stride / module length, inertia),

where ``inertia`` is mass of a module / (2 x duty factor x friction x period): the time in which its standing feet stop
a module, over the period. This is exact. The law is that F hardly depends on either.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import xarray as xr

from chilopod.analysis.parameters import ALL, PAPER_UNIT, spring_scale, stiffness
from chilopod.analysis.straight_walk import pitchfork
from chilopod.errors import AnalysisError
from chilopod.paper.section import Context, Section
from chilopod.paper.shapes import DASHED, DOTTED, finish
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import SPRING_UNIT, number

CHAPTER = "An atlas for designers"
BUILT = "as built"
ROBOTS = {
    BUILT: {},
    "ten times as heavy": {"mass": 10.0},
    "half as long": {"length": 0.5},
    "five times as fast": {"time": 0.2},
    "a quarter of the friction": {"friction": 0.25},
    "half the stride": {"stride": 0.5},
}
"""Robots by what differs from the robot as built: factors of :func:`scaled`."""

_REST = (0.25, 8.0)  # other springs, in units of the scale; softer ones let the robot undulate first
_COLORS = (style.BLACK, *style.CURVES)
_MARKERS = "oDs^vP"


def scaled(
    robot: Robot, mass: float = 1.0, length: float = 1.0, time: float = 1.0, friction: float = 1.0, stride: float = 1.0
) -> Robot:
    """A robot of the same shape, but for its stride, with springs of the same stiffness in units of the scale."""
    factors = {
        "body.mass": mass,
        "body.yaw_inertia": mass * length**2,
        "body.length": length,
        "legs.forward_offset": length,
        "legs.half_width": length,
        "gait.stride": length * stride,
        "gait.stance": time,
        "gait.swing": time,
        "ground.friction": friction,
    }
    found = robot.with_value("body.yaw_inertia", robot.module_yaw_inertia)
    for path, factor in factors.items():
        found = found.with_value(path, found.get(path) * factor)
    stiffer = spring_scale(found) / spring_scale(robot)
    for joint, spring in enumerate(robot.springs.stiffness):
        found = found.with_value(f"{ALL}[{joint}]", spring * stiffer)
    return found


def inertia(robot: Robot) -> float:
    """Time in which standing feet stop a module, over the period of the gait."""
    gait = robot.gait
    return robot.module_mass / (2.0 * gait.duty * robot.ground.friction * gait.period)


def critical(robot: Robot) -> float:
    """Critical k1 in units of the scale; NaN if the straight walk does not lose its stability by a bend."""
    try:
        return pitchfork(robot, normal_form=False).point.value / spring_scale(robot)
    except AnalysisError:
        return np.nan


def predicted(robot: Robot, curves: xr.Dataset) -> float:
    """Critical k1 by the law, in units of the scale: the curve as built of a :func:`collapse`; NaN beyond its ends."""
    rest = robot.springs.stiffness[1] / spring_scale(robot)
    return float(np.interp(rest, curves.rest, curves.curve.sel(robot=BUILT), left=np.nan, right=np.nan))


def collapse(context: Context, progress: Progress = silent) -> xr.Dataset:
    """Critical k1 over the other springs for :data:`ROBOTS`, and over inertia for three strides.

    Dataset: ``curve`` over (robot, rest), and ``law`` over (stride, mass), in units of the scale; ``scale`` over robot;
    ``inertia`` over mass.
    """
    size, robot = context.size, context.robot
    rest = np.geomspace(*_REST, size.of(17, 9, 2))
    masses = np.geomspace(0.1, 1000.0, size.of(17, 9, 2))
    strides = 0.5, 1.0, 2.0
    steps = itertools.count(1)
    total = len(ROBOTS) * rest.size + len(strides) * masses.size

    def at(springs: float, **factors: float) -> float:
        found = scaled(robot, **factors)
        found = found.with_value(f"{ALL}[1:]", springs * spring_scale(found))
        progress(next(steps) / total, "critical springs of scaled robots")
        return critical(found)

    built = robot.springs.stiffness[1] / spring_scale(robot)
    curves = [[at(float(each), **factors) for each in rest] for factors in ROBOTS.values()]
    law = [[at(built, mass=float(mass), stride=stride) for mass in masses] for stride in strides]
    scales = [spring_scale(scaled(robot, **factors)) / stiffness(1.0) for factors in ROBOTS.values()]
    columns = {
        "curve": (("robot", "rest"), np.array(curves)),
        "scale": ("robot", np.array(scales), {"units": PAPER_UNIT}),
        "law": (("stride", "mass"), np.array(law)),
        "inertia": ("mass", [inertia(scaled(robot, mass=float(mass))) for mass in masses]),
    }
    return xr.Dataset(columns, {"robot": list(ROBOTS), "rest": rest, "mass": masses, "stride": list(strides)})


def panel(data: xr.Dataset) -> Panel:
    """Figure of the law."""
    apart = 100.0 * float(abs(data.curve / data.curve.sel(robot=BUILT) - 1.0).max())
    scale, own = data.scale.values, float(data.inertia.interp(mass=1.0))
    spread = f"{number(apart, 2)}\u00a0%"
    return Panel(
        name="scaling",
        title="One law for robots of all sizes",
        draw=_draw(data),
        alt=f"Critical springs of {len(ROBOTS)} robots, which differ {number(scale.max() / scale.min(), 2)} times, and "
        f"the same in units of friction, speed, duty factor and module length, where they agree to {spread}.",
        text=(
            "A shows the front spring at which the straight walk is lost, over the springs behind it, for robots that "
            "differ in mass, size, speed and floor. B shows the same curves in units of friction × speed × duty factor "
            f"× module length. They agree to {spread}.",
            "C shows where the law ends, at the springs behind as built. A module that its feet cannot stop within a "
            f"step bends with a stiffer spring. The robot as built has an inertia of {number(own, 2)}: mass of a "
            "module / (2 × duty factor × friction × period).",
        ),
        data=data,
    )


@style.in_layouts(style.Layout("AB;CC", 7.2), style.Layout("A;B;C", 10.6))
def _draw(axes: style.Mosaic, data: xr.Dataset) -> None:
    for row, (color, marker) in enumerate(zip(_COLORS, _MARKERS, strict=False)):
        each = data.isel(robot=row)
        look: dict[str, Any] = {"color": color, "marker": marker, "markersize": 4.0, "label": str(each.robot.values)}
        axes["A"].loglog(each.rest * each.scale, each.curve * each.scale, **look)
        axes["B"].plot(each.rest, each.curve, **look)
    finish(axes["A"], xlabel=f"springs behind it ({SPRING_UNIT})", ylabel=f"critical k₁ ({SPRING_UNIT})", title="A")
    finish(axes["B"], xlabel="springs behind it / scale", ylabel="critical k₁ / scale", title="B", ylim=(0.0, None))
    for stride, line in zip(data.stride.values, (DOTTED, "-", DASHED), strict=True):
        label = "stride as built" if stride == 1.0 else f"{stride:g} times the stride"
        axes["C"].semilogx(data.inertia, data.law.sel(stride=stride), color=style.BLACK, linestyle=line, label=label)
    axes["C"].axvline(float(data.inertia.interp(mass=1.0)), color=style.GREY, lw=1.0, label="inertia as built")
    labels: dict[str, Any] = {"xlabel": "inertia, m / (2βcT)", "ylabel": "critical k₁ / scale"}
    finish(axes["C"], title="C", ylim=(0.0, None), legend="upper left", **labels)
    axes.legend_below("A", 3)


SCALING: Section[xr.Dataset] = Section(
    "scaling", CHAPTER, "the scaling law of critical springs", collapse, panels=panel, beyond=True, headline=True
)
