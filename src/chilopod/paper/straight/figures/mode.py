"""E: the mode of the pitchfork, beside the paper's five numbers and as a bent body."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from chilopod.paper.printed import MODE
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.scene.outline import chain, draw_heading, draw_joints, draw_modules, turned_about_tail
from chilopod.show.words import listing, number, spring

_WIDE = style.Layout("AC;BC", 5.2, heights=(1.5, 1.0), widths=(1.15, 1.0))
_NARROW = style.Layout("A;B;C", 10.8, heights=(1.2, 0.9, 1.9))
_ROUNDING = MODE[0].tolerance
_DRAWN_BEND = 75.0  # degrees from head to tail: the mode leaves the size free


def panel(data: xr.Dataset) -> Panel:
    """The mode beside the paper's."""
    computed, printed = data.computed.values, data.printed.values
    known = ~np.isnan(printed)
    off = np.abs(computed - printed)[known]
    if not known.any():
        compared = f"The paper prints no mode for {len(computed) + 1} modules."
    else:
        beyond = [joint for joint, value in zip(data.joint.values[known], off, strict=True) if value > _ROUNDING]
        compared = (
            f"The paper prints two decimals, so {_ROUNDING:g} either way is what rounding allows (the grey band). "
        )
        if beyond:
            worst = float(off.max() - _ROUNDING)
            compared += (
                f"Joint {listing(str(joint) for joint in beyond)} of this robot lies outside, by {worst:.4f} at most."
            )
        else:
            compared += f"All {len(off)} are inside."
    same_sign = bool((np.sign(computed) == np.sign(computed[0])).all())
    return Panel(
        name="mode",
        letter="E",
        title="The mode: how the body bends",
        draw=lambda narrow: _draw(data, narrow),
        alt="Joint components of the critical mode: "
        + ", ".join(number(value, 4) for value in computed)
        + ("; the paper prints " + ", ".join(f"{value:.2f}" for value in printed) if known.any() else "")
        + ". Beside it the body bent that way, to the left and to the right.",
        text=(
            f"At the critical spring, k₁ = {spring(data.attrs['value'])}, one small bend of the body neither grows nor "
            f"dies out: the mode. Its {len(computed)} numbers are the shares of the joints from front to rear, scaled "
            "so that their squares add up to 1.",
            compared,
            (
                "All have one sign, so the body bends into one arc and the robot walks a curve; the same arc mirrored "
                "is just as likely. "
                if same_sign
                else "They differ in sign: the body bends one way at the front and the other way behind. "
            )
            + f"The size of the bend is not part of the mode; it is drawn with {_DRAWN_BEND:.0f}° in all."
            + (f" The pitchfork is {data.attrs['criticality']}." if data.attrs["criticality"] else ""),
        ),
        data=data,
    )


def _draw(data: xr.Dataset, narrow: bool) -> Figure:
    figure, axes = style.figure(_WIDE, _NARROW, narrow)
    computed, printed, joints = data.computed.values, data.printed.values, data.joint.values
    _components(axes["A"], joints, computed, printed)
    _differences(axes["B"], data)
    bent_body(axes["C"], computed, _DRAWN_BEND)
    axes["C"].set_title("The body bent that way")
    return figure


def _components(axes: Axes, joints: np.ndarray, computed: np.ndarray, printed: np.ndarray) -> None:
    axes.set_title("Shares of the joints")
    axes.bar(joints, computed, width=0.55, color=style.SKY, label="computed")
    for joint, value in zip(joints, computed, strict=True):
        style.note(axes, number(value), (joint, max(value, 0.0)), (0, 7), ha="center")
    if not np.isnan(printed).all():
        axes.plot(joints, printed, "_", color=style.BLACK, markersize=26, markeredgewidth=2, label="paper")
    axes.axhline(0.0, color=style.BLACK, lw=0.8)
    axes.set_xticks(joints)
    axes.margins(y=0.25)
    axes.set_ylabel("component")
    axes.legend(loc="upper right", ncols=2)


def _differences(axes: Axes, data: xr.Dataset) -> None:
    axes.set_title("Computed less printed")
    joints = data.joint.values
    difference = data.computed.values - data.printed.values
    axes.axhspan(-1e3 * _ROUNDING, 1e3 * _ROUNDING, color=style.PALE, label="rounding")
    axes.axhline(0.0, color=style.BLACK, lw=0.8)
    if not np.isnan(difference).all():
        axes.plot(joints, 1e3 * difference, "o", color=style.BLUE, markersize=7, label="this robot")
    reach = 1e3 * _ROUNDING * 1.4
    if not np.isnan(difference).all():
        reach = max(reach, 1.2e3 * np.nanmax(np.abs(difference)))
    axes.set(ylim=(-reach, reach), xlim=(joints[0] - 0.6, joints[-1] + 0.6))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xticks(joints)
    axes.set(xlabel="joint, from the front", ylabel="difference (thousandths)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.32), ncols=3, columnspacing=1.0, handletextpad=0.3)


def bent_body(axes: Axes, components: np.ndarray, total: float) -> None:
    """Draw the straight body and the body bent by a mode to either side, all on one tail.

    Parameters
    ----------
    axes
        Becomes a drawing; a module has unit length in it.
    components
        Joint components of the mode.
    total
        Sum of the absolute joint angles, degrees.
    """
    style.bare(axes)
    angles = np.radians(total) * components / np.abs(components).sum()
    straight = turned_about_tail(*chain(np.zeros_like(angles), 1.0))
    draw_modules(axes, straight[0], straight[1], 1.0, fc="white", ec=style.GREY, ls="--", lw=0.9)
    heads = []
    for sign, color, side in ((-1.0, style.VERMILLION, "left"), (1.0, style.BLUE, "right")):
        centres, headings, joints = turned_about_tail(*chain(sign * angles, 1.0))
        draw_modules(axes, centres, headings, 1.0, fc=color, ec=color, alpha=0.75, lw=1.0)
        draw_joints(axes, joints, style.BLACK)
        draw_heading(axes, centres[0], headings[0], 1.0, color)
        ahead = np.array([np.cos(headings[0]), np.sin(headings[0])])
        tip = centres[0] + 1.25 * ahead
        axes.text(
            tip[0], tip[1], f"turns\n{side}", ha="center", va="bottom" if tip[1] > 0.0 else "top", color=style.BLACK
        )
        heads.append(tip)
    draw_heading(axes, straight[0][0], 0.0, 1.0, style.GREY)
    axes.text(straight[0][0, 0] + 0.6, -0.3, "straight,\nunstable", va="top", ha="left", fontsize=style.SMALL)
    top = max(abs(tip[1]) for tip in heads)
    axes.set(xlim=(-0.7, len(components) + 2.0), ylim=(-top - 1.3, top + 1.3))
