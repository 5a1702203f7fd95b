"""A: the planar model, drawn from the robot file, and its gait."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator

from chilopod import units
from chilopod.robot import Robot
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.scene.outline import SLIMNESS, draw_modules
from chilopod.show.words import SPRING_UNIT, k, minus, number, round_down

Place = tuple[float, float]

_SIDES = ("left", "right")
_GUIDE: Any = {"color": style.GREY, "lw": 0.7, "linestyle": ":"}
_COLORS = (style.BLUE, style.ORANGE)
_WIDE = style.Layout("AA;BC", 6.0, heights=(1.0, 1.55), widths=(1.0, 1.15))
_NARROW = style.Layout("A;B;C", 8.6, heights=(0.9, 1.5, 1.7))


def panel(robot: Robot) -> Panel:
    """Schematic of the robot, which needs no computation."""
    data = legs(robot)
    standing = int(data.stands.sum())
    return Panel(
        name="schematic",
        letter="A",
        title="The model",
        draw=_draw(robot, data),
        alt=f"Top view of {robot.body.modules} modules in a row joined by {robot.body.modules - 1} sprung yaw joints, "
        f"one module enlarged with its measures, and a diagram of when each foot stands.",
        text=(
            f"The robot from above, drawn to scale from the robot file: {robot.body.modules} modules in a row, joined "
            f"by yaw joints that only a torsional spring holds straight ({k(1)} at the front to "
            f"{k(robot.body.modules - 1)} at the rear). No motor bends the body. Each foot is moved along its module "
            "in a fixed rhythm: back from the anterior extreme position (AEP) to the posterior one (PEP) while it "
            "stands, and forward through the air. Dots are feet that stand, dotted strokes those in the air.",
            "A standing foot that slips is held back in proportion to the speed of its slip; a foot in the air does "
            "nothing, so its way back is not part of the model. Where the body is drawn, its width is free. At the "
            f"moment shown (t = 0) {standing} of {2 * robot.body.modules} feet stand. On the straight walk, at "
            f"{number(1e3 * robot.gait.speed)}\u00a0mm/s, none of them slips and no spring is bent: whether that walk "
            "survives a small push is what everything below is about.",
        ),
        data=data,
    )


def legs(robot: Robot) -> xr.Dataset:
    """Place of every foot at t = 0 and time of its touch-down, over module and side."""
    gait, n = robot.gait, robot.body.modules
    phase = gait.leg_phases(n)
    stands = gait.stands(phase)
    centre = -robot.module_length * (np.arange(n) + 0.5)
    ahead = np.where(stands, gait.stroke(phase), np.nan)
    foot, both = centre[:, None] + robot.legs.forward_offset + ahead, ("module", "side")
    columns = {
        "phase": (both, phase, {"units": "1", "about": "at t = 0, in cycles; 0 is touch-down"}),
        "stands": (both, stands, {"about": "at t = 0"}),
        "touch_down": (both, (-phase % 1.0) * gait.period, {"units": "s"}),
        "foot_x": (both, foot, {"units": "m", "about": "at t = 0, from the front end, NaN in the air"}),
        "centre_x": (("module",), centre, {"units": "m", "about": "from the front end"}),
    }
    coords = {"module": np.arange(1, n + 1), "side": np.array(_SIDES, dtype=object)}
    return xr.Dataset(columns, coords, {"robot": robot.name, "period_s": gait.period, "stance_s": gait.stance})


@style.in_layouts(_WIDE, _NARROW)
def _draw(axes: style.Mosaic, robot: Robot, data: xr.Dataset) -> None:
    _whole(axes["A"], robot, data, axes.narrow)
    _one_module(axes["B"], robot)
    _gait(axes["C"], robot, data)


def _whole(axes: Axes, robot: Robot, data: xr.Dataset, narrow: bool) -> None:
    style.bare(axes)
    axes.set_title(
        "From above, at t = 0" + ("" if narrow else ": dots are standing feet, dotted strokes feet in the air")
    )
    length, b, n = robot.module_length, robot.legs.half_width, robot.body.modules
    centres = data.centre_x.values
    draw_modules(axes, np.column_stack([centres, np.zeros(n)]), np.zeros(n), length, fc=style.PALE, ec=style.BLACK)
    reach, body = max(b, 0.5 * SLIMNESS * length), robot.body.length
    for module in range(n):
        for side, sign in enumerate((1.0, -1.0)):
            _foot(axes, robot, centres[module], float(data.foot_x[module, side]), sign, _COLORS[side])
    for x, module in zip(centres, data.module.values, strict=True):
        axes.text(x, 0.0, str(module), ha="center", va="center", fontsize=style.SMALL)
    size = min(0.16 * length, 0.4 * b)
    few = n <= (7 if narrow else 12)
    for joint in range(1, n):
        x = -joint * length
        _spring(axes, x, 0.0, size)
        if few or joint in (1, n - 1):
            line = {"arrowstyle": "-", "color": style.GREY, "lw": 0.7, "shrinkA": 0, "shrinkB": 2}
            axes.annotate(k(joint), (x, 0.25 * reach), (x, 1.45 * reach), ha="center", va="bottom", arrowprops=line)
    style.arrow(axes, (0.0125 * body, 0.0), (0.0725 * body, 0.0), color=style.BLACK, lw=1.8)
    y, bar = -1.7 * reach, round_down(0.15 * body)
    axes.plot([-body, -body + bar], [y, y], color=style.BLACK, lw=3, solid_capstyle="butt")
    look: dict[str, Any] = {"va": "center", "fontsize": style.SMALL}
    axes.text(-body + 1.15 * bar, y, f"{number(100 * bar, 2)} cm", **look)
    axes.text(0.0, y, "walks this way →", ha="right", **look)
    low = y - (1.3 * reach if narrow else 0.0)
    axes.text(-0.5 * body, low, _springs(robot), ha="center", **look)
    axes.set(xlim=(-1.02 * body, 0.08 * body), ylim=(low - 0.6 * reach, 2.3 * reach))


def _springs(robot: Robot) -> str:
    """Springs in one line; if there are many different ones, the first three and the last."""
    values = [f"{units.from_si(value, 'N*mm/deg'):.4g}" for value in robot.springs.stiffness]
    last = len(values)
    if len(set(values)) == 1:
        return f"{k(1)} to {k(last)} = {values[0]} {SPRING_UNIT}" if last > 1 else f"{k(1)} = {values[0]} {SPRING_UNIT}"
    shown = values if last <= 6 else [*values[:3], "…", values[-1]]
    return f"{k(1)} to {k(last)} = {', '.join(shown)} {SPRING_UNIT}"


def _foot(axes: Axes, robot: Robot, centre: float, foot: float, sign: float, color: str) -> None:
    """Leg with its stroke; the foot is drawn while it stands."""
    middle, half, y = centre + robot.legs.forward_offset, 0.5 * robot.gait.stride, sign * robot.legs.half_width
    stroke = [middle - half, middle + half], [y, y]
    if np.isnan(foot):
        axes.plot(*stroke, color=style.GREY, lw=1.2, linestyle=(0, (1.5, 1.5)))
        return
    axes.plot(*stroke, color=color, lw=2.2, solid_capstyle="butt")
    axes.plot([middle, foot], [sign * 0.5 * SLIMNESS * robot.module_length, y], color=color, lw=1.2)
    axes.plot(foot, y, "o", color=color, markeredgecolor=style.BLACK, markersize=6, zorder=5)


def _spring(axes: Axes, x: float, y: float, size: float) -> None:
    turns = np.linspace(0.0, 2.5, 160)
    radius = size * (0.15 + 0.85 * turns / turns[-1])
    angle = 2.0 * np.pi * turns
    axes.add_patch(Circle((x, y), 1.1 * size, color="white", zorder=2))
    axes.plot(x + radius * np.cos(angle), y + radius * np.sin(angle), color=style.BLACK, lw=1.0, zorder=3)
    axes.plot(x, y, "o", color=style.BLACK, markersize=2, zorder=4)


def _one_module(axes: Axes, robot: Robot) -> None:
    style.bare(axes)
    axes.set_title("One module, enlarged")
    length, b, x0, stride = robot.module_length, robot.legs.half_width, robot.legs.forward_offset, robot.gait.stride
    side = 0.5 * SLIMNESS * length
    draw_modules(axes, np.zeros((1, 2)), np.zeros(1), length, fc=style.PALE, ec=style.BLACK)
    axes.plot(0.0, 0.0, "+", color=style.BLACK, markersize=9)
    axes.plot([-0.5 * length, 0.5 * length], [0.0, 0.0], "o", color="white", markeredgecolor=style.BLACK, markersize=6)
    reach = max(b, side)
    step, ends = 0.3 * max(reach, 0.3 * length), (x0 - 0.5 * stride, x0 + 0.5 * stride)
    for sign, color in ((1.0, _COLORS[0]), (-1.0, _COLORS[1])):
        axes.plot([x0, x0], [sign * side, sign * b], color=color, lw=1.2)
        axes.plot(ends, [sign * b] * 2, color=color, lw=3, solid_capstyle="butt")
        axes.plot(ends, [sign * b] * 2, "|", color=color, markersize=10, markeredgewidth=2)
    look: dict[str, Any] = {"va": "center", "fontsize": style.SMALL}
    behind = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
    axes.text(x0 - 0.7 * stride, b, "PEP", ha="right", bbox=behind, **look)
    axes.text(x0 + 0.7 * stride, b, "AEP", ha="left", **look)
    above, below = {"ha": "center", "va": "bottom"}, {"ha": "center", "va": "top"}
    top, low = reach + step, -reach - step
    _measure(axes, (ends[0], top), (ends[1], top), f"stride {_mm(stride)}", (x0, top + 0.3 * step), above)
    if x0 != 0.0:
        words = f"forward offset {_mm(x0)}"
        _measure(axes, (0.0, low), (x0, low), words, (0.5 * x0, low - 0.35 * step), below)
    axes.plot([0.0, 0.0], [0.0, low], **_GUIDE)
    axes.plot([x0, x0], [-b, low], **_GUIDE)
    low -= 2.0 * step
    words = f"module length {_mm(length)}"
    _measure(axes, (-0.5 * length, low), (0.5 * length, low), words, (0.0, low - 0.2 * step), below)
    x, at = -0.28 * length, (-0.31 * length, 0.5 * (b + side))
    _measure(axes, (x, 0.0), (x, b), f"half-width\n{_mm(b)}", at, {"ha": "right", "va": "center"})
    axes.plot([x, ends[0]], [b, b], zorder=0, **_GUIDE)
    axes.set(xlim=(-0.66 * length, 0.66 * length), ylim=(low - 1.6 * step, top + 1.6 * step))


def _measure(axes: Axes, start: Place, end: Place, label: str, at: Place, side: dict[str, Any]) -> None:
    style.arrow(axes, start, end, arrowstyle="|-|, widthA=0.25, widthB=0.25", color=style.BLACK, lw=1.0)
    axes.text(*at, label, fontsize=style.SMALL, **side)


def _gait(axes: Axes, robot: Robot, data: xr.Dataset) -> None:
    period, stance, n = robot.gait.period, robot.gait.stance, robot.body.modules
    axes.set_title("When each foot stands")
    names = []
    for side, color in enumerate(_COLORS):
        for module in range(n):
            row = side * (n + 0.6) + module
            names.append((row, f"{_SIDES[side]} {module + 1}" if n <= 12 or module % 2 == 0 else ""))
            start = float(data.touch_down[module, side])
            for shift in (0.0, -period):
                left, right = max(0.0, start + shift), min(period, start + shift + stance)
                if right > left:
                    axes.barh(row, right - left, left=left, height=0.66, color=color)
    axes.set_yticks([row for row, _ in names], [name for _, name in names])
    axes.tick_params(axis="y", length=0)
    axes.invert_yaxis()
    axes.set_xlim(0.0, period)
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.set_xlabel("time over one gait cycle (s)")
    axes.spines["left"].set_visible(False)


def _mm(value: float) -> str:
    return minus(f"{1e3 * value:.4g} mm")
