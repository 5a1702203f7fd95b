"""Curved walks as trials, and the error of the paper's square-root fit: its Fig. "curved", "absolute", "different"."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from chilopod.frozen import Array
from chilopod.paper import printed, shapes
from chilopod.paper.curved.study import CurvedStudy, axis_radius, bend_order, fluctuation, on_branch
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import SPRING_UNIT, k, listing, number, signed, spring, typeset
from chilopod.statistics import means
from chilopod.tasks.radius_law import is_curved
from chilopod.trials import Disturbance

_STYLES = tuple(zip((style.BLACK, style.BLUE, style.GREEN, style.PURPLE), "os^D", strict=True))
_MARKED = (41.0, 15.0, 11.0, 9.0, 7.0)  # springs on a short scale
_SIDES = {"right": (style.BLACK, "o", "trials"), "left": (style.BLACK, "o", ""), "straight": (style.BLACK, "o", "")}


def panels(study: CurvedStudy) -> list[Panel]:
    """All figures."""
    return [walks(study), joints(study), onset(study), variants(study)]


def walks(study: CurvedStudy) -> Panel:
    """The paper's Fig. "curved", A to D."""
    trials, exact, fit = study.trials, study.trials.attrs["critical_k1"], study.fit
    here = is_curved(trials)
    lefts, rights = (int((trials.direction == side).sum()) for side in ("left", "right"))
    unsettled = int((~trials.settled).sum())
    straight, curved = (float(value) for value in study.examples.spring.values)
    stiff = trials.spring.values > exact
    wider, softest, stiffest = fluctuation(trials)
    tighter = [
        number(radius.value / float(axis_radius(study.branch, exact * at / printed.ONSET.value)), 2)
        for at, radius in printed.RADII.items()
    ]
    return Panel(
        name="curved-walks",
        title="Curved walks below the critical spring",
        draw=_draw_walks(study),
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
            "The paper sees its trials scatter more as the spring gets softer. Here the scatter at "
            f"{number(softest, 2)}, beside that at {spring(stiffest)}, is {wider}: uneven feet leave a straight walk "
            "straight and only move the critical spring of a trial a little, and the bend depends on that most where "
            "it rises steeply, beside the critical spring.",
        ),
        data=trials.drop_vars("end_state"),
    )


def joints(study: CurvedStudy) -> Panel:
    """The paper's Fig. "absolute"."""
    return Panel(
        name="curved-joints",
        title="All joints of the curved walk",
        draw=_draw_joints(study),
        alt=f"Mean absolute angles of all joints over 1/{k(1)}: zero up to the critical spring, then rising steeply.",
        text=(
            "Mean absolute angle of every joint, trials (means, standard errors) on the exact walks (lines). In the "
            f"trials that curve the joints bend in the order {listing(map(str, bend_order(study.trials)))}, the most "
            f"first; the critical mode of the paper's planar model has {listing(map(str, printed.MODE_ORDER))}.",
        ),
        data=study.trials.drop_vars("end_state"),
    )


def onset(study: CurvedStudy) -> Panel:
    """Distance of the paper's square-root fit from the point, and its causes."""
    fits, law, exact = study.fits, study.law, study.fits.attrs["exact_k1"]
    wide, near = fits.isel(softest=-1), fits.isel(softest=0)
    kinds = study.comparison.criticality
    other = [typeset(str(name)) for name in kinds.variant[kinds != kinds[0]].values]
    power = float(law.power.sel(softest=0.98 * exact, method="nearest"))
    return Panel(
        name="curved-onset",
        title="How sure the square-root fit is",
        draw=_draw_onset(study),
        alt=f"Critical spring by the fit over ranges of springs, from {number(near.critical_k1, 4)} to "
        f"{number(wide.critical_k1, 4)}, beside the exact {number(exact, 4)}; and the power with which the bend "
        f"grows, {number(power, 1)} instead of one half.",
        text=(
            "A square root is what a supercritical pitchfork promises close by. How close? Fitted to all trials it "
            f"gives {number(wide.critical_k1, 4)} ± {number(wide.trial_error, 1)} {SPRING_UNIT}, to "
            f"those of the two stiffest curved springs {number(near.critical_k1, 4)} ± "
            f"{number(near.trial_error, 1)}; the point itself is at {number(exact, 6)}. The error bars tell "
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


def variants(study: CurvedStudy) -> Panel:
    """The paper's Fig. "different"."""
    data = study.comparison
    names = [typeset(str(name)) for name in data.variant.values]
    each = [(name, data.isel(variant=row)) for row, name in enumerate(names)]
    changes = listing(f"{signed(100 * (float(at.equal_ratio) - 1), 1)}\u00a0% for {name}" for name, at in each[1:])
    fits = listing(
        f"{number(at.fitted_k1, 4)} instead of {number(at.exact_k1, 4)} for {name} (robot {number(at.robot_k1, 2)})"
        for name, at in each
    )
    most = names[int(np.abs(data.equal_ratio.values - 1.0).argmax())]
    stiff = int((data.fitted_k1 > data.exact_k1).sum())
    folded = [
        f"{name} (up to {spring(at.stiffest_k1, 4)})"
        for name, at in each
        if float(at.stiffest_k1) > float(at.exact_k1) * (1.0 + 1e-9)
    ]
    return Panel(
        name="curved-variants",
        title="Curved walks of the paper's variants",
        draw=_draw_variants(study),
        alt=f"Radius of the body axis for four variants, over 1/{k(1)} and over critical {k(1)} / {k(1)}, where the "
        "curves nearly fall together; and the critical spring of each, fitted and exact.",
        text=(
            "The paper finds that softer rear springs and slower walking move the onset and leave the radius almost as "
            "it is, and that a module phase of 180° leaves the onset and makes the radius smaller. In the model the "
            "radius depends on how far a spring lies below the critical one and on little else: at the same share of "
            f"each variant's own critical spring it changes by {changes}, most for {most}.",
            f"Fitted like the robot's, the critical springs come out as {fits}, in {SPRING_UNIT}: {stiff} of "
            f"{len(names)} too stiff, for the reason given above.",
            f"In {listing(folded)} the pitchfork is subcritical: the bend does not grow from zero but jumps, and for "
            "springs a little stiffer than the critical one straight and curved walks are both stable."
            if folded
            else "",
        ),
        data=data,
    )


def _along(study: CurvedStudy) -> tuple[Array, Array]:
    """1/k1 and mean angles (deg) of the exact walks from the point to the softest spring whose trials curve, denser
    towards the point, shape (points,) and (points, joint)."""
    softest = float(study.trials.spring.values[is_curved(study.trials).any(axis=1)].min())
    inverse = 1.0 / study.trials.attrs["critical_k1"]
    grid = inverse + (1.0 / softest - inverse) * np.linspace(0.0, 1.0, 120) ** 3
    return grid, np.rad2deg(on_branch(study.branch, "mean_angle", 1.0 / grid))


@style.in_layouts(*shapes.WALKS)
def _draw_walks(axes: style.Mosaic, study: CurvedStudy) -> None:
    shapes.draw_examples(axes, study.examples)
    trials, exact = study.trials, study.trials.attrs["critical_k1"]
    grid, angles = _along(study)

    start = 0.9 / trials.spring.values.max()
    for side, label in ((angles[:, 0], "exact"), (-angles[:, 0], None)):
        axes["C"].plot(grid, side, color=style.BLUE, label=label)
    axes["C"].plot([start, 1.0 / exact], [0.0, 0.0], color=style.BLUE)
    line = [1.0 / exact, grid[-1]], [0.0, 0.0]
    axes["C"].plot(*line, color=style.BLUE, lw=1.0, linestyle=(0, (1, 2)), label="unstable")
    axes["C"].plot(1.0 / exact, 0.0, "D", color=style.VERMILLION, label="pitchfork", zorder=5)
    shapes.draw_fork(axes["C"], trials, _SIDES, study.fit, (style.ORANGE, "square-root fit"))
    axes["C"].set_xlim(start, grid[-1] + 0.004)
    shapes.over_compliance(axes["C"], _MARKED)

    radius, error = means(trials.axis_radius.values, is_curved(trials))
    exact_radius = axis_radius(study.branch, 1.0 / grid[1:])
    axes["D"].plot(exact * grid[1:], exact_radius, color=style.BLUE, label="model, exact")
    shapes.errorbars(axes["D"], exact / trials.spring.values, radius, error, style.BLUE, "o", "model, trials")
    places = [printed.ONSET.value / each for each in printed.RADII]
    shapes.draw_robot_radii(axes["D"], places)
    for at, (name, value) in zip(places, printed.RADII.items(), strict=True):
        style.note(axes["D"], f"{k(1)} = {name:g}", (at, value.value), (0, 9), ha="center")
    axes["D"].set(xlim=(0.97, exact * grid[-1] + 0.04), ylim=(0.0, 1.6), xlabel=f"critical {k(1)} / {k(1)}")


@style.in_layouts(*shapes.JOINTS)
def _draw_joints(axes: style.Mosaic, study: CurvedStudy) -> None:
    trials, (grid, angles) = study.trials, _along(study)
    shapes.draw_joints(axes["A"], trials, is_curved(trials) | (trials.direction.values == "straight"), grid, angles)
    axes["A"].set_xlim(0.9 / trials.spring.values.max(), grid[-1] + 0.005)
    shapes.over_compliance(axes["A"], _MARKED if axes.narrow else (41.0, 20.0, 15.0, 13.0, 11.0, 10.0, 9.0, 8.0, 7.0))


@style.in_layouts(style.Layout("AB", 3.9), style.Layout("A;B", 7.4))
def _draw_onset(axes: style.Mosaic, study: CurvedStudy) -> None:
    fits, law, exact = study.fits, study.law, study.fits.attrs["exact_k1"]
    below, along = (100.0 * (1.0 - each.softest.values / exact) for each in (fits, law))
    axes["A"].semilogx(along, law.critical_k1.values, color=style.ORANGE, label="fit to exact walks, evenly spread")
    name = "fit to the trials"
    shapes.errorbars(axes["A"], below, fits.critical_k1.values, fits.trial_error.values, style.BLACK, "o", name)
    name = "the same springs, exact walks"
    look: dict[str, Any] = {"color": style.ORANGE, "markerfacecolor": "white", "markersize": 8.0, "zorder": 3.0}
    axes["A"].plot(below, fits.exact_walks.values, "o", label=name, **look)
    axes["A"].axhline(exact, color=style.VERMILLION, lw=1.2, label=f"pitchfork, {number(exact, 5)}")
    shapes.finish(
        axes["A"], legend="upper left", ylabel=f"critical {k(1)} ({SPRING_UNIT})", title="A  What the fit gives"
    )
    axes["A"].set_xlabel(f"softest spring fitted, below critical {k(1)} by (%)")
    axes["B"].semilogx(along, law.power.values, color=style.BLUE)
    for value, name in ((0.5, "square root"), (0.25, "fourth root")):
        axes["B"].axhline(value, color=style.GREY, lw=1.0, linestyle=shapes.DASHED)
        style.note(axes["B"], name, (along[0], value), (0, 4))
    shapes.finish(axes["B"], ylim=(0.2, 0.56), ylabel="power that the bend grows with", title="B  Why")
    axes["B"].set_xlabel(f"{k(1)} below its critical value by (%)")
    for each in axes.values():
        each.xaxis.set_major_formatter(lambda value, position: f"{value:g}")


@style.in_layouts(style.Layout("AB;CC", 6.6, heights=(1.5, 1.0)), style.Layout("A;B;C", 11.6))
def _draw_variants(axes: style.Mosaic, study: CurvedStudy) -> None:
    data = study.comparison
    for name, (color, marker) in zip(data.variant.values, _STYLES, strict=False):
        at, branch = data.sel(variant=name), study.branches[name]
        exact, here = float(at.exact_k1), np.isfinite(at.radius.values)
        springs, stiffest = exact * data.ratio.values[here], float(branch.parameter.max())
        line = springs.min() + (stiffest - springs.min()) * (1.0 - np.linspace(1.0, 0.0, 80) ** 3)
        radius, error = at.radius.values[here], at.radius_error.values[here]
        for letter, scale in (("A", 1.0), ("B", exact)):
            axes[letter].plot(scale / line, axis_radius(branch, line), color=color, lw=1.2)
            shapes.errorbars(axes[letter], scale / springs, radius, error, color, marker, typeset(str(name)))
    for letter in "AB":
        shapes.finish(axes[letter], ylim=(0.2, 1.0), ylabel="radius of the body axis (m)")
    axes["A"].set(xlabel=f"1/{k(1)} ({shapes.INVERSE_UNIT})", title=f"A  Over 1/{k(1)}")
    axes["B"].set(xlabel=f"critical {k(1)} / {k(1)}", title="B  Over its own critical spring")
    axes["B"].legend(loc="upper right")
    _draw_onsets(axes["C"], data, axes.narrow)


def _draw_onsets(axes: Axes, data: xr.Dataset, narrow: bool) -> None:
    rows = np.arange(data.sizes["variant"])
    open_: dict[str, Any] = {"color": style.ORANGE, "markerfacecolor": "white", "markeredgewidth": 1.6, "capsize": 2.5}
    label = "square-root fit to trials"
    axes.errorbar(data.fitted_k1, rows - 0.12, xerr=data.error, fmt="o", label=label, **open_)
    axes.plot(data.exact_k1, rows + 0.12, "D", color=style.VERMILLION, label="pitchfork")
    look: dict[str, Any] = {"color": style.BLUE, "lw": 3.0, "zorder": 1, "label": "curved walks last up to here"}
    axes.hlines(rows + 0.12, data.exact_k1, data.stiffest_k1, **look)
    axes.set_yticks(rows, [re.sub(r" (?=\d)", "\n", typeset(str(name))) for name in data.variant.values])
    axes.tick_params(axis="y", length=0)
    shapes.finish(axes, "x", ylim=(rows[-1] + 0.6, -0.6), xlabel=f"critical {k(1)} ({SPRING_UNIT})")
    axes.set_title("C  Where the bend sets in")
    axes.legend(loc="upper left", bbox_to_anchor=(-0.3 if narrow else 0.0, -0.26), ncols=1 if narrow else 3)
