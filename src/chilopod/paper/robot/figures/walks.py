"""Walks of the whole robot as the paper arranges them (Fig. "curved", "absolute", "different"), and their duration."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from chilopod.paper import printed, shapes, statements
from chilopod.paper.measures import onset_of_bend, onset_point, radius_at
from chilopod.paper.robot.rows import duration_rows
from chilopod.paper.robot.walks import RobotWalks
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import SPRING_UNIT, k, listing, number, typeset
from chilopod.statistics import means
from chilopod.tasks.radius_law import in_settled_curve, is_curved

_VARIANTS = tuple(zip((style.BLACK, style.BLUE, style.GREEN, style.ORANGE, style.GREY), "os^Dv", strict=True))
_SPRINGS = tuple(zip((style.BLUE, style.VERMILLION, style.GREEN, style.ORANGE), "os^D", strict=True))
_SIDES = {
    "left": (style.BLUE, "o", "to the left"),
    "right": (style.BLUE, "s", "to the right"),
    "straight": (style.GREY, "D", "straight"),
}


def panels(found: RobotWalks) -> Iterator[Panel]:
    """All figures, in the paper's order."""
    yield walks(found)
    yield joints(found)
    if found.uniform is not None:
        yield different(found, found.uniform)
    yield durations(found)


def walks(found: RobotWalks) -> Panel:
    """The paper's Fig. "curved", A to D."""
    base, fit = found.base, found.fit
    here = is_curved(base)
    lefts, rights = (int((base.direction == side).sum()) for side in ("left", "right"))
    unsettled = int((base.moved.values > 0.1).sum())
    said = f"{number(fit.critical, 3)} ± {number(fit.estimate.error, 1)}" if fit else "no point"
    straight, curved = found.examples.spring.values
    return Panel(
        name="robot-walks",
        title="The robot in three dimensions: curved walks below the critical spring",
        draw=_draw_walks(found),
        alt=f"A and B: joint angles over time at {k(1)} = {straight:g} and {curved:g}. C: mean angle of joint 1 over "
        f"1/{k(1)} with the fitted square root. D: radius of the body axis with the two radii that the paper prints.",
        text=(
            f"The paper's base series with its own springs: {base.sizes['repeat']} walks of the twin from straight on "
            f"at each of {base.sizes['spring']} values of {k(1)}, 90\u00a0s each, angles averaged over the last "
            f"5\u00a0s as in the paper. {int(here.sum())} of {here.size} end in a curve, {lefts} to the left and "
            f"{rights} to the right. The square-root fit to those that have settled puts the onset at {said} "
            f"{SPRING_UNIT}; the paper's estimate for its robot is {printed.ONSET.value:g}.",
            "These are the data that the twin's unknown constants were fitted to (the printed onset, the two printed "
            "radii, which springs walk straight and which do not; and the walking speed), so agreement here is no "
            "surprise. What follows was not fitted."
            + (
                f" In {unsettled} {'walk' if unsettled == 1 else 'walks'} the bend still moved by more than 0.1 rad in "
                "the last seconds."
                if unsettled
                else ""
            ),
        ),
        data=base,
    )


def joints(found: RobotWalks) -> Panel:
    """The paper's Fig. "absolute"."""
    softest = np.abs(found.base.mean_angle.isel(spring=0)).mean("repeat").values
    order = [int(joint) + 1 for joint in np.argsort(-softest)]
    return Panel(
        name="robot-joints",
        title="The robot in three dimensions: all joints of the curved walk",
        draw=_draw_joints(found),
        alt=f"Mean absolute angles of all joints over 1/{k(1)}.",
        text=(
            "Mean absolute angle of every joint (means and standard errors). At the softest spring the joints bend in "
            f"the order {listing(str(joint) for joint in order)}, the most first; the critical mode of the paper's "
            f"planar model has {listing(map(str, printed.MODE_ORDER))}.",
        ),
        data=found.base,
    )


def different(found: RobotWalks, uniform: xr.Dataset) -> Panel:
    """The paper's Fig. "different"."""
    said = []
    for title, (name, data) in _variants(found).items():
        point, paper = onset_point(data).value, printed.onset(name).value
        said.append(f"{typeset(title)} {number(point, 3) if np.isfinite(point) else 'none'} (robot: {paper:g})")
    each = [data.assign_coords(variant=name) for name, data in _all(found).items()]
    data = xr.concat(each, "variant", join="outer", combine_attrs="drop_conflicts")
    return Panel(
        name="robot-different",
        title="The robot in three dimensions: other springs, strides and phases",
        draw=_draw_different(found, uniform),
        alt=f"A: radius over 1/{k(1)} of the robot as built and of three variants. B: the same over the distance from "
        "each one's own onset. C: where curved walks set in, twin beside robot.",
        text=(
            "Nothing here was fitted. Where curved walks set in by the paper's method, in "
            f"{SPRING_UNIT}: {listing(said)}. "
            f"Bars in C are what counts as within, {printed.ONSET.band.condition}; with all springs alike the straight "
            "walk ends by an undulation or by a slow bend, from multipliers. At equal springs (A) a variant that sets "
            f"in at a softer spring turns more widely by that alone; so the table compares radii at equal distance "
            f"from each one's own onset {k(1)}* (B)."
            + (
                " The paper does not say whether the leg tips swing as high with the shorter stride, or lower in "
                "proportion: both are shown."
                if found.lower_steps
                else ""
            ),
        ),
        data=data.drop_vars(("direction", "status")),
    )


def _variants(found: RobotWalks) -> dict[str, tuple[str, xr.Dataset]]:
    """Variants and their readings by the names of this module: the paper's name, and the trials."""
    named: dict[str, tuple[str, xr.Dataset]] = {}
    for name, data in found.variants.items():
        named[name] = (name, data)
        if name in found.lower_steps:
            named[f"{name.removeprefix('stride ')}, lower steps"] = (name, found.lower_steps[name])
    return named


def _all(found: RobotWalks) -> dict[str, xr.Dataset]:
    return {"as built": found.base, **{title: data for title, (_, data) in _variants(found).items()}}


def durations(found: RobotWalks) -> Panel:
    """Onset, radii and shares of curved walks over the duration of the walks."""
    data, settled = found.durations, onset_point(found.base).value
    alone = f", {number(settled, 3)} {SPRING_UNIT}" if np.isfinite(settled) else ""
    times = listing(f"{each:g}" for each in data.duration.values)
    said = "; ".join(f"{row.statement.quantity.partition(',')[0]} {row.result.words}" for row in duration_rows(data))
    return Panel(
        name="robot-durations",
        title="The robot in three dimensions: what if its walks had been shorter",
        draw=_draw_durations(data),
        alt=f"A: where curved walks set in, by walks of {times} s. B: the two radii that the paper prints. C: the "
        "share of walks that curve at some springs.",
        text=(
            "The paper does not say how long its robot walked before the angles were averaged. These are the walks of "
            f"the base series, {data.attrs['repeats']} at each spring, cut after {times}\u00a0s. A bend takes its "
            f"time, the longer the closer {k(1)} is to the onset. So all curved walks count here, also those that have "
            f"not settled, and the last onset may differ from that of settled walks alone{alone}.",
            f"What the table asks, and whether it is met: {typeset(said)}.",
        ),
        data=data,
    )


@style.in_layouts(*shapes.WALKS)
def _draw_walks(axes: style.Mosaic, found: RobotWalks) -> None:
    shapes.draw_examples(axes, found.examples)
    base, fit, paper = found.base, found.fit, printed.ONSET.value
    inverse = 1.0 / base.spring.values
    # The legend stands above the line.
    axes["C"].axvline(1.0 / paper, ymax=0.58, color=style.ORANGE, lw=1.4, label=f"robot's onset, {paper:g}")
    law = (style.VERMILLION, f"square root from {number(fit.critical, 3)}" if fit else "")
    shapes.draw_fork(axes["C"], base, _SIDES, fit, law)
    axes["C"].set_xlim(0.0, 1.06 * inverse.max())
    shapes.over_compliance(axes["C"], (75.0, 41.0, 28.0, 21.0, 15.0))
    radius, error = means(base.axis_radius.values, in_settled_curve(base))
    shapes.errorbars(axes["D"], inverse, radius, error, style.BLUE, "o", "twin")
    shapes.draw_robot_radii(axes["D"], [1.0 / spring for spring in printed.RADII])
    highest = np.nanmax([*(radius + np.nan_to_num(error)), *(each.value for each in printed.RADII.values())])
    axes["D"].set(ylim=(0.0, 1.1 * highest), xlim=(0.02, 1.06 * inverse.max()))
    shapes.over_compliance(axes["D"], (41.0, 28.0, 21.0, 17.0, 15.0))


@style.in_layouts(*shapes.JOINTS)
def _draw_joints(axes: style.Mosaic, found: RobotWalks) -> None:
    inverse = 1.0 / found.base.spring.values
    angles = np.rad2deg(np.abs(found.base.mean_angle).mean("repeat").transpose("spring", "joint").values)
    shapes.draw_joints(axes["A"], found.base, True, inverse, angles)
    axes["A"].set_xlim(0.0, 1.06 * inverse.max())
    axes["A"].set_ylim(bottom=0.0)
    shapes.over_compliance(axes["A"], (75.0, 41.0, 28.0, 21.0, 17.0, 15.0))


@style.in_layouts(style.Layout("AB;CC", 7.6), style.Layout("A;B;C", 12.6))
def _draw_different(axes: style.Mosaic, found: RobotWalks, uniform: xr.Dataset) -> None:
    for (name, data), (color, marker) in zip(_all(found).items(), _VARIANTS, strict=False):
        inverse = 1.0 / data.spring.values
        found_here = [radius_at(data, float(spring)) for spring in data.spring.values]
        radius, error = np.array([(each.value, each.error) for each in found_here]).T
        away = inverse - 1.0 / onset_of_bend(data)
        for letter, place, shown in (("A", inverse, inverse > 0.0), ("B", away, away > 0.0)):
            points = place[shown], radius[shown], error[shown]
            shapes.errorbars(axes[letter], *points, color, marker, typeset(name), joined=True)
    for letter in "AB":
        shapes.finish(axes[letter], ylim=(0.0, 3.0), ylabel="radius of the body axis (m)")
    shapes.over_compliance(axes["A"], (34.0, 28.0, 21.0, 17.0, 15.0, 12.0))
    axes["A"].set_title("A  Radius over the spring")
    axes["B"].set_xlim(left=0.0)
    axes["B"].set(xlabel=f"1/{k(1)} − 1/{k(1)}* ({shapes.INVERSE_UNIT})", title="B  Radius, like with like")
    axes.legend_below("A", 5, 2)
    _draw_onsets(axes["C"], found, uniform)


def _draw_onsets(axes: Axes, found: RobotWalks, uniform: xr.Dataset) -> None:
    found_at = [
        ("base series (fitted)", printed.ONSET, onset_point(found.base).value),
        *((title, printed.onset(name), onset_point(data).value) for title, (name, data) in _variants(found).items()),
        *((f"alike, {name}", printed.UNIFORM, float(uniform.end.sel(mode=name))) for name in uniform.mode.values),
    ]
    shapes.draw_bands(axes, [(title, paper.value, paper.band) for title, paper, _ in found_at])
    twin = [at for *_, at in found_at]
    axes.plot(twin, range(len(twin)), "o", color=style.BLUE, markersize=7, label="twin")
    axes.set(xlim=(0.0, 45.0), xlabel=f"onset ({SPRING_UNIT})", title="C  Onset of curved walks")
    axes.legend(loc="upper left")


@style.in_layouts(style.Layout("ABC", 3.6), style.Layout("A;B;C", 9.6))
def _draw_durations(axes: style.Mosaic, data: xr.Dataset) -> None:
    times = data.duration.values
    axes["A"].axhspan(printed.ONSET.band.low, printed.ONSET.band.high, color=style.PALE, zorder=0)
    shapes.errorbars(axes["A"], times, data.onset.values, data.onset_error.values, style.BLUE, "o", joined=True)
    axes["A"].set(ylabel=f"onset ({SPRING_UNIT})", title="A  Where curved walks set in")
    for (spring, radius), (color, marker) in zip(printed.RADII.items(), _SPRINGS, strict=False):
        at, label = data.sel(spring=spring), f"{k(1)} = {spring:g}"
        axes["B"].axhspan(radius.band.low, radius.band.high, color=style.PALE, zorder=0)
        radii, errors = at.axis_radius.values, at.axis_radius_error.values
        shapes.errorbars(axes["B"], times, radii, errors, color, marker, label, joined=True)
    axes["B"].set(ylabel="radius of the body axis (m)", title="B  Radius")
    springs = sorted({*printed.RADII, *statements.SLOWEST.values()})
    # Shares of several springs are often equal: each curve is thinner than those below it.
    for i, (spring, (color, marker)) in enumerate(zip(springs, _SPRINGS, strict=False)):
        share, label = 100.0 * data.curved.sel(spring=spring).values, f"{k(1)} = {spring:g}"
        axes["C"].plot(times, share, color=color, marker=marker, lw=3.4 - 0.8 * i, ms=10.0 - 2.0 * i, label=label)
    axes["C"].set(ylabel="walks that curve (%)", title="C  Share that curves")
    for letter, each in axes.items():
        top = 1.1 * max(each.dataLim.y1, np.nextafter(0.0, 1.0))
        each.set(ylim=(-4.0, 104.0) if letter == "C" else (0.0, top), xlim=(0.0, 1.05 * times.max()))
        shapes.finish(each, legend="upper right" if letter == "B" else None, xlabel="walks last (s)")
    axes["C"].legend(ncols=2, loc="lower right", bbox_to_anchor=(1.0, 0.05), columnspacing=1.0, handlelength=1.5)
