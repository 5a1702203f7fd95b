"""C to F of the paper's figure of its Floquet analysis: critical springs, the mode, and the undulation."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from chilopod.paper import printed
from chilopod.paper.shapes import finish
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.scene.outline import chain, draw_heading, draw_joints, draw_modules, turned_about_tail
from chilopod.show.words import SPRING_UNIT, k, listing, minus, number, signed, spans, spring, typeset

_ROUNDING = printed.MODE[0].tolerance
_DRAWN_BEND = 75.0  # degrees from head to tail: the mode leaves the size free
_SNAPSHOTS = 8
_DRAWN_ANGLE = 35.0  # degrees, of the joint that bends most


def variants(data: xr.Dataset) -> Panel:
    """Panel of the paper's variants."""
    model, robot = data.critical_k1.values, data.robot_printed.values
    names = [typeset(str(name)) for name in data.variant.values]
    ours, theirs = (100.0 * (values / values[0] - 1.0) for values in (model, robot))
    same_order = list(np.argsort(model)) == list(np.argsort(robot))
    listed = listing(
        f"{signed(ours[row])}\u00a0% for {names[row]} (robot {signed(theirs[row])}\u00a0%)"
        for row in range(1, len(names))
    )
    return Panel(
        name="variants",
        letter="C",
        title="Critical k₁ of the paper's variants",
        draw=_draw_variants(data),
        alt="Critical front spring for four variants, planar model beside robot: "
        + listing(f"{name} {number(a)} against {b:g}" for name, a, b in zip(names, model, robot, strict=True))
        + f" {SPRING_UNIT}.",
        text=(
            "The front spring below which the straight walk is lost, as built and with one thing changed: "
            f"{listing(names[1:])}. Filled dots are computed here for the planar model. Open diamonds are not: they "
            "are what the paper reports of its robot, from a square-root law fitted to trials.",
            f"Why {number(model[0], 2)} and not {robot[0]:.0f}? The planar model bends at {spring(model[0])}, the "
            f"real robot at about {spring(robot[0], 2)}. The paper's own planar model has "
            f"{printed.CRITICAL_K1.value:g} as well, so this is no failure to reproduce it: the simple model needs a "
            "softer spring than the robot does, and the paper leaves open why. In the model feet follow their path "
            "exactly, never touch the floor in the air, and rub like dampers; a robot's legs give way, may drag, and "
            "rub dry.",
            "What carries over is the direction of the changes, drawn in the second panel: "
            + listed
            + (". Model and robot put the four in the same order." if same_order else "."),
        ),
        data=data,
    )


@style.in_layouts(style.Layout("AB", 3.9, widths=(1.25, 1.0)), style.Layout("A;B", 7.4))
def _draw_variants(axes: style.Mosaic, data: xr.Dataset) -> None:
    names = [re.sub(r" (?=\d)", "\n", typeset(str(name))) for name in data.variant.values]
    rows = np.arange(len(names))
    both = np.array([data.critical_k1.values, data.robot_printed.values])
    changes = 100.0 * (both / both[:, :1] - 1.0)
    for letter, shown, away, side in (("A", both, 9, "left"), ("B", changes, -9, "right")):
        for values, shift, color, marker, fill, line, digits, label in (
            (shown[0], -0.17, style.BLUE, "o", style.BLUE, "-", 3, "planar model, computed"),
            (shown[1], 0.17, style.ORANGE, "D", "white", (0, (3, 2)), 2, "robot, paper"),
        ):
            axes[letter].hlines(rows + shift, 0.0, values, color=color, lw=1.6, linestyle=line)
            look: dict[str, Any] = {"color": color, "markersize": 8, "markeredgewidth": 1.8, "markerfacecolor": fill}
            axes[letter].plot(values, rows + shift, marker, label=label, **look)
            for value, row in list(zip(values, rows + shift, strict=True))[letter == "B" :]:
                text = number(value, digits) if letter == "A" else f"{signed(value)} %"
                style.note(axes[letter], text, (value, row), (away, 0), ha=side, va="center")
        axes[letter].set_yticks(rows, names if axes.narrow or letter == "A" else [""] * len(names))
        axes[letter].tick_params(axis="y", length=0)
        finish(axes[letter], "x", ylim=(rows[-1] + 0.55, -0.55))
    axes["A"].set(xlim=(0.0, 1.2 * both.max()), title="Critical value", xlabel=f"critical k₁ ({SPRING_UNIT})")
    axes["B"].set_xlim(1.45 * min(changes.min(), -5.0), max(1.2 * changes.max(), 3.0))
    axes["B"].set(title="Change from as built", xlabel="change of critical k₁ (%)")
    axes["B"].axvline(0.0, color=style.BLACK, lw=0.8)
    axes.figure.legend(*axes["A"].get_legend_handles_labels(), loc="outside upper left", ncols=1 if axes.narrow else 2)


def modules(data: xr.Dataset) -> Panel:
    """Panel of longer and shorter robots."""
    counts, values, says = data.modules.values, data.critical_k1.values, data.says.values
    found = ~np.isnan(values)
    above, sub = ([int(count) for count in counts[says == word]] for word in ("supercritical", "subcritical"))
    missing = [int(count) for count in counts[~found]]
    long = values[found & (counts > 6)]
    level = (
        f"From 7 modules on it stays between {number(long.min())} and {spring(long.max(), 3)}; the paper says "
        f"{printed.LITTLE_CHANGE.words}. "
        if long.size
        else ""
    )
    return Panel(
        name="modules",
        letter="D",
        title="Critical k₁ over the number of modules",
        draw=_draw_modules(data),
        alt=f"Critical front spring for {counts[0]} to {counts[-1]} modules, between {number(np.nanmin(values))} and "
        f"{spring(np.nanmax(values), 3)}; open markers where the pitchfork is subcritical.",
        text=(
            f"The same critical spring for shorter and longer robots made of the same modules. {level}"
            + (f"For {spans(missing)} modules the straight walk is not lost through a pitchfork." if missing else ""),
            "The marker tells what the paper's linear analysis cannot: how the straight walk is lost. Supercritical "
            "(filled): the bend sets in gently and grows as the spring softens. Subcritical (open): just below the "
            "critical spring there is no slightly bent walk to settle on, the robot goes over to a strong bend at "
            "once, and just above it the straight walk survives only small pushes. Here it is supercritical for "
            f"{spans(above) if above else 'no'} modules and subcritical for {spans(sub) if sub else 'none'}.",
        ),
        data=data,
    )


@style.in_layouts(style.Layout("A", 3.6), style.Layout("A", 3.6))
def _draw_modules(axes_by: style.Mosaic, data: xr.Dataset) -> None:
    axes = axes_by["A"]
    counts, values, says = data.modules.values, data.critical_k1.values, data.says.values
    axes.plot(counts, values, color=style.GREY, lw=0.9, zorder=1)
    for word, marker, fill in (("supercritical", "o", style.BLUE), ("subcritical", "s", "white")):
        those = says == word
        if those.any():
            look: dict[str, Any] = {"color": style.BLUE, "markersize": 8.0, "markeredgewidth": 1.8}
            axes.plot(counts[those], values[those], marker, label=word, markerfacecolor=fill, **look)
    built = data.attrs["built"]
    for value in values[(counts == built) & ~np.isnan(values)]:
        line = {"arrowstyle": "-", "color": style.BLACK, "lw": 0.8, "shrinkB": 6}
        words, at = f"this robot: {number(value, 4)}", (built, float(value))
        style.note(axes, words, at, (0, -34), ha="center", va="top", arrowprops=line)
    missing = counts[np.isnan(values)]
    if missing.size:
        zero = np.zeros(missing.size)
        axes.plot(missing, zero, "x", color=style.BLACK, markersize=8, clip_on=False, label="no pitchfork")
    finish(axes, "y", xlabel="number of modules", ylabel=f"critical {k(1)} ({SPRING_UNIT})")
    axes.set(ylim=(0.0, 1.3 * np.nanmax(values)), xlim=(counts[0] - 0.6, counts[-1] + 0.6))
    axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    axes.xaxis.set_major_locator(MaxNLocator(9 if axes_by.narrow else 20, integer=True))
    axes.legend(loc="upper right", ncols=1 if axes_by.narrow else 3)


def mode(data: xr.Dataset) -> Panel:
    """Panel of the mode of the pitchfork, beside the paper's five numbers and as a bent body."""
    computed, paper = data.computed.values, data.printed.values
    known, off = not np.isnan(paper).any(), np.abs(computed - paper)
    beyond = [str(joint) for joint in data.joint.values[off > _ROUNDING]]
    inside = f"All {len(off)} are inside."
    if beyond:
        inside = f"Joint {listing(beyond)} of this robot lies outside, by {float(off.max() - _ROUNDING):.4f} at most."
    compared = f"The paper prints two decimals, so {_ROUNDING:g} either way is what rounding allows (the grey band)."
    prints = f"; the paper prints {', '.join(f'{value:.2f}' for value in paper)}" if known else ""
    same_sign = bool((np.sign(computed) == np.sign(computed[0])).all())
    return Panel(
        name="mode",
        letter="E",
        title="The mode: how the body bends",
        draw=_draw_mode(data),
        alt=f"Joint components of the critical mode: {', '.join(number(value, 4) for value in computed)}{prints}. "
        "Beside it the body bent that way, to the left and to the right.",
        text=(
            f"At the critical spring, k₁ = {spring(data.attrs['value'])}, one small bend of the body neither grows nor "
            f"dies out: the mode. Its {len(computed)} numbers are the shares of the joints from front to rear, scaled "
            "so that their squares add up to 1.",
            f"{compared} {inside}" if known else f"The paper prints no mode for {len(computed) + 1} modules.",
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


@style.in_layouts(
    style.Layout("AC;BC", 5.2, heights=(1.5, 1.0), widths=(1.15, 1.0)),
    style.Layout("A;B;C", 10.8, heights=(1.2, 0.9, 1.9)),
)
def _draw_mode(axes: style.Mosaic, data: xr.Dataset) -> None:
    computed, paper, joints = data.computed.values, data.printed.values, data.joint.values
    known = not np.isnan(paper).any()
    _bars(axes["A"], joints, computed, "computed")
    if known:
        axes["A"].plot(joints, paper, "_", color=style.BLACK, markersize=26, markeredgewidth=2, label="paper")
    axes["A"].axhline(0.0, color=style.BLACK, lw=0.8)
    axes["A"].margins(y=0.25)
    axes["A"].set(ylabel="component", title="Shares of the joints")
    axes["A"].legend(loc="upper right", ncols=2)
    band, thousandths = 1e3 * _ROUNDING, 1e3 * (computed - paper)
    axes["B"].axhspan(-band, band, color=style.PALE, label="rounding")
    axes["B"].axhline(0.0, color=style.BLACK, lw=0.8)
    if known:
        axes["B"].plot(joints, thousandths, "o", color=style.BLUE, markersize=7, label="this robot")
    reach = max(1.4 * band, 1.2 * np.nanmax(np.abs(thousandths)) if known else 0.0)
    axes["B"].set(ylim=(-reach, reach), xlim=(joints[0] - 0.6, joints[-1] + 0.6), title="Computed less printed")
    axes["B"].set(xlabel="joint, from the front", ylabel="difference (thousandths)")
    axes["B"].legend(loc="upper center", bbox_to_anchor=(0.5, -0.32), ncols=3, columnspacing=1.0, handletextpad=0.3)
    axes["B"].set_xticks(joints)
    _bent_body(axes["C"], computed)
    axes["C"].set_title("The body bent that way")


def _bars(axes: Axes, joints: np.ndarray, values: np.ndarray, label: str = "") -> None:
    axes.bar(joints, values, width=0.55, color=style.SKY, label=label or None)
    for joint, value in zip(joints, values, strict=True):
        style.note(axes, number(value), (joint, max(value, 0.0)), (0, 7 if label else 3), ha="center")
    axes.set_xticks(joints)


def _bent_body(axes: Axes, components: np.ndarray) -> None:
    """The straight body and the body bent by a mode to either side, all on one tail; a module has unit length."""
    style.bare(axes)
    angles = np.radians(_DRAWN_BEND) * components / np.abs(components).sum()
    straight = turned_about_tail(*chain(np.zeros_like(angles), 1.0))
    draw_modules(axes, straight[0], straight[1], 1.0, fc="white", ec=style.GREY, ls="--", lw=0.9)
    top = 0.0
    for sign, color, side in ((-1.0, style.VERMILLION, "left"), (1.0, style.BLUE, "right")):
        centres, headings, joints = turned_about_tail(*chain(sign * angles, 1.0))
        draw_modules(axes, centres, headings, 1.0, fc=color, ec=color, alpha=0.75, lw=1.0)
        draw_joints(axes, joints, style.BLACK)
        draw_heading(axes, centres[0], headings[0], 1.0, color)
        tip = centres[0] + 1.25 * np.array([np.cos(headings[0]), np.sin(headings[0])])
        axes.text(tip[0], tip[1], f"turns\n{side}", ha="center", va="bottom" if tip[1] > 0.0 else "top")
        top = max(top, abs(tip[1]))
    draw_heading(axes, straight[0][0], 0.0, 1.0, style.GREY)
    axes.text(straight[0][0, 0] + 0.6, -0.3, "straight,\nunstable", va="top", ha="left", fontsize=style.SMALL)
    axes.set(xlim=(-0.7, len(components) + 2.0), ylim=(-top - 1.3, top + 1.3))


def uniform(data: xr.Dataset) -> Panel:
    """Panel of uniform springs: the undulation at a Neimark-Sacker point."""
    period, turns = data.attrs["oscillation_period_s"], data.phase.values[-1] / (2.0 * np.pi)
    runs = "from head to tail" if turns < 0.0 else "from tail to head"
    return Panel(
        name="uniform",
        letter="F",
        title="Uniform springs: the body undulates",
        draw=_draw_uniform(data),
        alt=f"Amplitudes and phases of the joints in the undulation, and {_SNAPSHOTS} body shapes over one cycle of "
        f"{number(period)} s: a wave that runs {runs}.",
        text=(
            f"If all springs are softened together, the straight walk is lost at k = {spring(data.attrs['value'], 5)}, "
            "and not into a curve: a pair of exponents crosses with a frequency of "
            f"{number(data.attrs['frequency_rad_s'], 4)} rad/s, so the body swings, once in {number(period)} s or "
            f"about {period / data.attrs['gait_period_s']:.0f} gait cycles. This is the bifurcation the paper compares "
            'with as "Hopf"; with the gait\'s own period counted it is a Neimark-Sacker bifurcation'
            + (f", here {data.attrs['criticality']}." if data.attrs["criticality"] else "."),
            f"Each joint {'lags' if turns < 0.0 else 'leads'} the one in front of it; over the body that adds up to "
            f"{number(abs(turns), 2)} of a full turn, a wave that runs {runs}. The drawings show it over one cycle, "
            f"front to the right, with the largest joint angle drawn as {_DRAWN_ANGLE:.0f}°; how far the body swings "
            "in the end is beyond this analysis.",
            "The paper prints no value of its planar model here, only the robot's, so there is nothing to compare "
            "this value with.",
        ),
        data=data,
    )


@style.in_layouts(style.Layout("AB;CC", 6.4, heights=(1.0, 1.25)), style.Layout("A;B;C", 9.6, heights=(0.8, 0.8, 1.9)))
def _draw_uniform(axes: style.Mosaic, data: xr.Dataset) -> None:
    joints, degrees = data.joint.values, np.degrees(data.phase.values)
    _bars(axes["A"], joints, data.amplitude.values)
    axes["A"].margins(y=0.15)
    axes["A"].set(ylabel="amplitude (unit norm)", title="How far each joint swings")
    axes["B"].plot(joints, degrees, "o-", color=style.BLUE, markersize=7)
    for joint, value in zip(joints, degrees, strict=True):
        style.note(axes["B"], minus(f"{value:.0f}°"), (joint, value), (7, 4))
    axes["B"].margins(x=0.14, y=0.16)
    axes["B"].set_xticks(joints)
    finish(axes["B"], "y", ylabel="phase (degrees)", title="Phase relative to joint 1")
    for letter in "AB":
        axes[letter].set_xlabel("joint, from the front")
    _snapshots(axes["C"], data, columns=1 if axes.narrow else 2)
    axes["C"].set_title("Body shapes over one cycle")


def _snapshots(axes: Axes, data: xr.Dataset, columns: int) -> None:
    style.bare(axes)
    amplitude = np.radians(_DRAWN_ANGLE) * data.amplitude.values / data.amplitude.values.max()
    half = 0.5 * (len(amplitude) + 1)
    rows = _SNAPSHOTS // columns
    across, down = 2.0 * half + 4.0, 0.9 + 0.24 * half
    for index in range(_SNAPSHOTS):
        share = index / _SNAPSHOTS
        centres, headings, joints = chain(amplitude * np.cos(2.0 * np.pi * share + data.phase.values), 1.0)
        shift = np.array([(index // rows) * across, -(index % rows) * down])
        draw_modules(axes, centres + shift, headings, 1.0, fc=style.SKY, ec=style.BLUE, lw=1.0)
        draw_joints(axes, joints + shift, style.BLACK, size=3.0)
        draw_heading(axes, centres[0] + shift, headings[0], 1.0, style.BLACK)
        moment = f"{share * data.attrs['oscillation_period_s']:.1f} s"
        axes.text(shift[0] - half - 0.5, shift[1], moment, ha="right", va="center", fontsize=style.SMALL)
    axes.set(xlim=(-half - 2.2, (columns - 1) * across + half + 1.0), ylim=(-(rows - 0.3) * down, 0.7 * down))
