"""Curved walks as trials: what the paper's Fig. "curved" and "absolute" show, and how sure its square-root fit is."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from chilopod.paper import printed
from chilopod.paper.compliance import draw_times, errorbars, means, over_compliance
from chilopod.paper.curved.study import CurvedStudy, axis_radius, bend_order, bent, fluctuation
from chilopod.paper.curved.trials import on_branch
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import SPRING_UNIT, k, listing, number, spring, typeset
from chilopod.trials import Disturbance

Array = NDArray[np.float64]

_WALKS = (style.Layout("AB;CD", 7.4), style.Layout("A;B;C;D", 13.6))
_JOINTS = (style.Layout("A", 4.0), style.Layout("A", 4.4))
_ONSET = (style.Layout("AB", 3.9), style.Layout("A;B", 7.4))
_DASHED = (0, (4, 2))
_MARKED = (41.0, 15.0, 11.0, 9.0, 7.0)  # springs on a short scale


def walks(study: CurvedStudy) -> Panel:
    """The paper's Fig. "curved", A to D."""
    trials, exact, fit = study.trials, study.trials.attrs["critical_k1"], study.fit
    here = bent(trials)
    lefts, rights = (int((trials.direction == side).sum()) for side in ("left", "right"))
    unsettled = int((~trials.settled).sum())
    straight, curved = (float(value) for value in study.examples.spring.values)
    stiff = trials.spring.values > exact
    if here.any():
        wider, softest, stiffest = fluctuation(trials)
    tighter = [
        number(radius.value / float(axis_radius(study.branch, exact * at / printed.ONSET.value)), 2)
        for at, radius in printed.RADII.items()
    ]
    return Panel(
        name="curved-walks",
        title="Curved walks below the critical spring",
        draw=lambda narrow: _draw_walks(study, narrow),
        alt=f"A and B: joint angles over time at {k(1)} = {straight:g} and {curved:g}. C: mean angle of joint 1 over "
        f"1/{k(1)}, trials on the exact branches to both sides. D: radius of the body axis, trials on the branch, the "
        "paper's robot well above.",
        text=(
            f"{trials.sizes['repeat']} walks from straight on at each of {trials.sizes['spring']} springs, every one "
            "with small errors of its joints and heading at the start and feet that differ by "
            f"{100.0 * Disturbance().friction:g} %. Of {here[stiff].size} walks with springs stiffer than "
            f"{spring(exact)} {int(here[stiff].sum())} end in a curve, of {here[~stiff].size} with softer ones "
            f"{int(here[~stiff].sum())}: {lefts} to the left and {rights} to the right."
            + (f" {unsettled} had not settled and are left out." if unsettled else " All had settled."),
            f"Panels A and B are single walks at {k(1)} = {number(straight, 2)} and {spring(curved, 2)}; the body "
            "sways within every gait cycle, hence the thick lines. In C and D dots and bars are means and standard "
            "errors over trials, lines the exact periodic walks that the trials settle on. The dashed line is the "
            "square-root law that the paper fits to its robot, fitted to these trials: it puts the point at "
            f"{number(fit.critical)}, {number(100 * (fit.critical / exact - 1), 2)} % too stiff.",
            "The open diamonds in D are the two radii that the paper prints of its robot, placed by their springs' "
            "share of the robot's own critical one. They are the robot's, not the model's: the model bends "
            f"{listing(tighter)} times as tightly there.",
            "The paper sees its trials scatter more as the spring gets softer. Here that is "
            f"{wider} at {number(softest, 2)} than at {spring(stiffest)}: uneven feet leave a straight walk straight "
            "and only move the critical spring of a trial a little, and the bend depends on that most where it rises "
            "steeply, beside the critical spring.",
        )
        if here.any()
        else ("No trial ended in a curve.",),
        data=_table(trials),
    )


def joints(study: CurvedStudy) -> Panel:
    """The paper's Fig. "absolute"."""
    return Panel(
        name="curved-joints",
        title="All joints of the curved walk",
        draw=lambda narrow: _draw_joints(study, narrow),
        alt=f"Mean absolute angles of all joints over 1/{k(1)}: zero up to the critical spring, then rising steeply.",
        text=(
            "Mean absolute angle of every joint, trials (means, standard errors) on the exact walks (lines). In the "
            f"trials that curve the joints bend in the order {listing(map(str, bend_order(study.trials)))}, the most "
            f"first; the critical mode of the paper's planar model has {listing(map(str, printed.MODE_ORDER))}.",
        ),
        data=_table(study.trials),
    )


def onset(study: CurvedStudy) -> Panel:
    """How far the paper's square-root fit lies from the point, and why."""
    fits, law, exact = study.fits, study.law, study.fits.attrs["exact_k1"]
    wide, near = fits.isel(softest=-1), fits.isel(softest=0)
    kinds = study.comparison.criticality
    other = [typeset(str(name)) for name in kinds.variant[kinds != kinds[0]].values]
    power = float(law.power.sel(softest=0.98 * exact, method="nearest"))
    return Panel(
        name="curved-onset",
        title="How sure the square-root fit is",
        draw=lambda narrow: _draw_onset(study, narrow),
        alt=f"Critical spring by the fit over ranges of springs, from {number(float(near.critical_k1), 4)} to "
        f"{number(float(wide.critical_k1), 4)}, beside the exact {number(exact, 4)}; and the power with which the bend "
        f"grows, {number(power, 1)} instead of one half.",
        text=(
            "A square root is what a supercritical pitchfork promises close by. How close? Fitted to all trials it "
            f"gives {number(float(wide.critical_k1), 4)} ± {number(float(wide.bootstrap_error), 1)} {SPRING_UNIT}, to "
            f"those of the two stiffest curved springs {number(float(near.critical_k1), 4)} ± "
            f"{number(float(near.bootstrap_error), 1)}; the point itself is at {number(exact, 6)}. The error bars tell "
            "how well another set of trials would repeat the fit, not how far the law is off: fitted to the exact "
            "walks of the same springs, without any noise, it is off as much (open dots). More trials do not help, "
            "only springs closer to the point do.",
            "The second panel shows why: 2 % below the point the bend of joint 1 grows with the power "
            f"{number(power, 2)} of the distance, not one half. The cubic term of this pitchfork is nearly zero"
            + (f" (with {listing(other)} it is on the other side of zero)" if other else "")
            + ", so the next one takes over at once, which alone would make it a fourth root.",
        ),
        data=xr.merge([fits, law.rename({name: f"law_{name}" for name in (*law.data_vars, "softest")})]),
    )


def _table(trials: xr.Dataset) -> xr.Dataset:
    return trials.drop_vars("end_state")


def _along(study: CurvedStudy, softest: float) -> tuple[Array, Array]:
    """1/k1 and mean angles (deg) of the exact walks, denser towards the point, shape (points,) and (points, joint)."""
    inverse = 1.0 / study.trials.attrs["critical_k1"]
    grid = inverse + (1.0 / softest - inverse) * np.linspace(0.0, 1.0, 120) ** 3
    return grid, np.rad2deg(on_branch(study.branch, "mean_angle", 1.0 / grid))


def _draw_walks(study: CurvedStudy, narrow: bool) -> Figure:
    figure, axes = style.figure(*_WALKS, narrow)
    straight, curved = study.examples.spring.values
    limits = (
        draw_times(axes["A"], study.examples.sel(spring=straight)),
        draw_times(axes["B"], study.examples.sel(spring=curved)),
    )
    low, high = min(limits[0][0], limits[1][0]), max(limits[0][1], limits[1][1])
    for letter, what in (("A", f"Straight, {k(1)} = {straight:g}"), ("B", f"Curved, {k(1)} = {curved:g}")):
        axes[letter].set(ylim=(low, high), title=f"{letter}  {what} {SPRING_UNIT}")
    axes["A"].legend(loc="upper left", ncols=2 if narrow else 3)

    trials, exact = study.trials, study.trials.attrs["critical_k1"]
    inverse, here = 1.0 / trials.spring.values, bent(trials)
    softest = float(trials.spring.values[here.any(axis=1)].min())
    grid, angles = _along(study, softest)
    _draw_fork(axes["C"], study, grid, angles[:, 0])

    radius, error = means(trials.axis_radius.values, here)
    axes["D"].plot(
        exact * grid[1:],
        axis_radius(study.branch, 1.0 / grid[1:]),
        color=style.BLUE,
        label="model, exact",
    )
    errorbars(axes["D"], exact * inverse, radius, error, style.BLUE, "o", "model, trials")
    robot = {printed.ONSET.value / spring: radius.value for spring, radius in printed.RADII.items()}
    axes["D"].plot(
        list(robot),
        list(robot.values()),
        "D",
        color=style.ORANGE,
        markerfacecolor="white",
        markeredgewidth=1.8,
        markersize=8,
        label="robot, paper",
    )
    for (at, value), name in zip(robot.items(), printed.RADII, strict=True):
        style.note(axes["D"], f"{k(1)} = {name:g}", (at, value), (0, 9), ha="center")
    axes["D"].set(
        xlim=(0.97, exact / softest + 0.04),
        ylim=(0.0, 1.6),
        xlabel=f"critical {k(1)} / {k(1)}",
        ylabel="radius of the body axis (m)",
        title="D  Radius",
    )
    axes["D"].legend(loc="upper right")
    style.grid(axes["D"])
    return figure


def _draw_fork(axes: Axes, study: CurvedStudy, grid: Array, exact_angle: Array) -> None:
    """Joint 1 to both sides, with the branch and the fitted law."""
    trials, exact, fit = study.trials, study.trials.attrs["critical_k1"], study.fit
    inverse = 1.0 / trials.spring.values
    start = 0.9 * inverse.min()
    for sign in (1.0, -1.0):
        axes.plot(grid, sign * exact_angle, color=style.BLUE, label="exact" if sign > 0 else None)
        law = np.concatenate([[1.0 / fit.critical], np.linspace(1.0 / fit.critical, grid[-1], 200)])
        axes.plot(
            law,
            sign * np.rad2deg(fit.angle(law)),
            color=style.ORANGE,
            linestyle=_DASHED,
            label="square-root fit" if sign > 0 else None,
        )
    axes.plot([start, 1.0 / exact], [0.0, 0.0], color=style.BLUE)
    axes.plot([1.0 / exact, grid[-1]], [0.0, 0.0], color=style.BLUE, lw=1.0, linestyle=(0, (1, 2)), label="unstable")
    angle = np.rad2deg(trials.mean_angle.sel(joint=1).values)
    for side in ("right", "left", "straight"):
        mean, error = means(angle, trials.direction.values == side)
        errorbars(axes, inverse, mean, error, style.BLACK, "o", "trials" if side == "right" else "")
    axes.plot(1.0 / exact, 0.0, "D", color=style.VERMILLION, label="pitchfork", zorder=5)
    axes.set_xlim(start, grid[-1] + 0.004)
    over_compliance(axes, _MARKED)
    axes.set(ylabel="mean angle of joint 1 (deg)", title="C  Joint 1")
    axes.legend(loc="upper left")
    style.grid(axes)


def _draw_joints(study: CurvedStudy, narrow: bool) -> Figure:
    figure, by_letter = style.figure(*_JOINTS, narrow)
    axes = by_letter["A"]
    trials, here = study.trials, bent(study.trials)
    inverse = 1.0 / trials.spring.values
    grid, angles = _along(study, float(trials.spring.values[here.any(axis=1)].min()))
    styles = style.joint_styles(trials.sizes["joint"])
    for index, (joint, (color, marker)) in enumerate(zip(trials.joint.values, styles, strict=True)):
        axes.plot(grid, np.abs(angles[:, index]), color=color, lw=1.3)
        counted = here | (trials.direction.values == "straight")
        mean, error = means(np.abs(np.rad2deg(trials.mean_angle.sel(joint=joint).values)), counted)
        errorbars(axes, inverse, mean, error, color, marker, f"joint {joint}")
    axes.set_xlim(0.9 * inverse.min(), grid[-1] + 0.005)
    over_compliance(axes, _MARKED if narrow else (41.0, 20.0, 15.0, 13.0, 11.0, 10.0, 9.0, 8.0, 7.0))
    axes.set_ylabel("mean absolute angle (deg)")
    axes.legend(loc="upper left")
    style.grid(axes)
    return figure


def _draw_onset(study: CurvedStudy, narrow: bool) -> Figure:
    figure, axes = style.figure(*_ONSET, narrow)
    fits, law, exact = study.fits, study.law, study.fits.attrs["exact_k1"]
    below = 100.0 * (1.0 - fits.softest.values / exact)
    along = 100.0 * (1.0 - law.softest.values / exact)
    axes["A"].semilogx(along, law.critical_k1.values, color=style.ORANGE, label="fit to exact walks, evenly spread")
    errorbars(
        axes["A"], below, fits.critical_k1.values, fits.bootstrap_error.values, style.BLACK, "o", "fit to the trials"
    )
    axes["A"].plot(
        below,
        fits.exact_walks.values,
        "o",
        color=style.ORANGE,
        markerfacecolor="white",
        markersize=8,
        zorder=3,
        label="the same springs, exact walks",
    )
    axes["A"].axhline(exact, color=style.VERMILLION, lw=1.2, label=f"pitchfork, {number(exact, 5)}")
    axes["A"].set(ylabel=f"critical {k(1)} ({SPRING_UNIT})", title="A  What the fit gives")
    axes["A"].legend(loc="upper left")
    axes["A"].set_xlabel(f"softest spring fitted, below critical {k(1)} by (%)")
    axes["B"].semilogx(along, law.power.values, color=style.BLUE)
    for value, name in ((0.5, "square root"), (0.25, "fourth root")):
        axes["B"].axhline(value, color=style.GREY, lw=1.0, linestyle=_DASHED)
        style.note(axes["B"], name, (along[0], value), (0, 4))
    axes["B"].set(
        ylim=(0.2, 0.56),
        ylabel="power that the bend grows with",
        xlabel=f"{k(1)} below its critical value by (%)",
        title="B  Why",
    )
    for each in axes.values():
        each.xaxis.set_major_formatter(lambda value, position: f"{value:g}")
        style.grid(each)
    return figure
