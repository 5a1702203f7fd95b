"""The whole robot's walks as the paper arranges them: its Fig. "curved", "absolute" and "different"."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from chilopod.paper import printed
from chilopod.paper.compliance import INVERSE_UNIT, draw_asked, draw_times, errorbars, means, over_compliance
from chilopod.paper.equal_distance import onset_of_bend
from chilopod.paper.robot.figures import durations as robot_durations
from chilopod.paper.robot.walks import RobotWalks
from chilopod.paper.walk_measures import onset_with_error, radius_at
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import SPRING_UNIT, k, listing, number, typeset
from chilopod.tasks.radius_law import in_settled_curve, is_curved

Array = NDArray[np.float64]

_WALKS = (style.Layout("AB;CD", 7.4), style.Layout("A;B;C;D", 13.6))
_ONE = (style.Layout("A", 4.0), style.Layout("A", 4.4))
_THREE = (style.Layout("AB;CC", 7.6), style.Layout("A;B;C", 12.6))
_VARIANTS = tuple(zip((style.BLACK, style.BLUE, style.GREEN, style.ORANGE, style.GREY), "os^Dv", strict=True))
_MARKED = (75.0, 41.0, 28.0, 21.0, 17.0, 15.0)
_DASHED = (0, (4, 2))


def panels(found: RobotWalks) -> Iterator[Panel]:
    """All figures, in the paper's order."""
    yield walks(found)
    yield joints(found)
    yield different(found)
    yield robot_durations.panel(found.durations)


def walks(found: RobotWalks) -> Panel:
    """The paper's Fig. "curved", A to D."""
    base, fit = found.base, found.fit
    here = is_curved(base)
    lefts, rights = (int((base.direction == side).sum()) for side in ("left", "right"))
    unsettled = int((base.moved.values > 0.1).sum())
    said = f"{number(fit.critical, 3)} ± {number(fit.bootstrap_error, 1)}" if fit else "no point"
    straight, curved = (float(value) for value in found.examples.spring.values)
    return Panel(
        name="robot-walks",
        title="The robot in three dimensions: curved walks below the critical spring",
        draw=lambda narrow: _draw_walks(found, narrow),
        alt=f"A and B: joint angles over time at {k(1)} = {straight:g} and {curved:g}. C: mean angle of joint 1 over "
        f"1/{k(1)} with the fitted square root. D: radius of the body axis with the two radii that the paper prints.",
        text=(
            f"The paper's base series with its own springs: {base.sizes['repeat']} walks of the twin from straight on "
            f"at each of {base.sizes['spring']} values of {k(1)}, 90\u00a0s each, angles averaged over the last "
            f"5\u00a0s as in the paper. {int(here.sum())} of {here.size} end in a curve, {lefts} to the left and "
            f"{rights} to the right. The square-root fit puts the onset at {said} {SPRING_UNIT}; the paper's "
            f"estimate for its robot is {printed.ONSET.value:g}.",
            "These are the data that the twin's unknown constants were fitted to (the printed onset, the two printed "
            "radii, which springs walk straight and which do not; and the walking speed), so agreement here is no "
            "surprise. What follows was not fitted."
            + (
                f" In {unsettled} walks the bend still moved by more than 0.1 rad in the last seconds."
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
        draw=lambda narrow: _draw_joints(found, narrow),
        alt=f"Mean absolute angles of all joints over 1/{k(1)}.",
        text=(
            "Mean absolute angle of every joint (means and standard errors). At the softest spring the joints bend in "
            f"the order {listing(str(joint) for joint in order)}, the most first; the critical mode of the paper's "
            f"planar model has {listing(map(str, printed.MODE_ORDER))}.",
        ),
        data=found.base,
    )


def different(found: RobotWalks) -> Panel:
    """The paper's Fig. "different"."""
    said = []
    for title, (name, data) in _variants(found).items():
        point, paper = onset_with_error(data)[0], printed.onset(name).value
        said.append(f"{typeset(title)} {number(point, 3) if np.isfinite(point) else 'none'} (robot: {paper:g})")
    return Panel(
        name="robot-different",
        title="The robot in three dimensions: other springs, strides and phases",
        draw=lambda narrow: _draw_different(found, narrow),
        alt=f"A: radius over 1/{k(1)} of the robot as built and of three variants. B: the same over the distance from "
        "each one's own onset. C: where curved walks set in, twin beside robot.",
        text=(
            "Nothing here was fitted. Where curved walks set in by the paper's method, in "
            f"{SPRING_UNIT}: {listing(said)}. "
            f"Bars in C are what counts as within, {printed.ONSET.band.asked}; with all springs alike the body "
            "undulates. At equal springs (A) a variant that sets in at a softer spring turns more widely by that "
            f"alone; so the table compares radii at equal distance from each one's own onset {k(1)}* (B)."
            + (
                " The paper does not say whether the leg tips swing as high with the shorter stride, or lower in "
                "proportion: both are shown."
                if found.lower_steps
                else ""
            ),
        ),
        data=xr.concat(
            [each.assign_coords(variant=name) for name, each in _all(found).items()],
            dim="variant",
            join="outer",
            combine_attrs="drop_conflicts",
        ).drop_vars(("direction", "status")),
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


def _draw_walks(found: RobotWalks, narrow: bool) -> Figure:
    figure, axes = style.figure(*_WALKS, narrow)
    examples = found.examples
    straight, curved = (float(value) for value in examples.spring.values)
    high = 1.05 * float(np.rad2deg(np.abs(examples.joint_angle)).max())
    for letter, spring, what in (("A", straight, "Straight"), ("B", curved, "Curved")):
        draw_times(axes[letter], examples.sel(spring=spring))
        axes[letter].set(ylim=(-high, high), title=f"{letter}  {what}, {k(1)} = {spring:g} {SPRING_UNIT}")
    axes["A"].legend(loc="upper left", ncols=2 if narrow else 3)
    _draw_fork(axes["C"], found)
    _draw_radius(axes["D"], found)
    return figure


def _draw_fork(axes: Axes, found: RobotWalks) -> None:
    base, fit = found.base, found.fit
    inverse = 1.0 / base.spring.values
    angles = np.rad2deg(base.mean_angle.sel(joint=1).values)
    for side, sign, marker in (("left", -1.0, "o"), ("right", 1.0, "s")):
        here = base.direction.values == side
        mean, error = means(angles, here)
        errorbars(axes, inverse, mean, error, style.BLUE, marker, f"to the {side}")
        if fit:
            grid = np.linspace(1.0 / fit.critical, inverse.max(), 200)
            label = f"square root from {number(fit.critical, 3)}" if sign > 0.0 else None
            axes.plot(
                grid, sign * np.rad2deg(fit.angle(grid)), color=style.VERMILLION, linestyle=_DASHED, lw=1.3, label=label
            )
    here = base.direction.values == "straight"
    mean, error = means(angles, here)
    errorbars(axes, inverse, mean, error, style.GREY, "D", "straight")
    onset_ = printed.ONSET.value
    axes.axvline(1.0 / onset_, color=style.ORANGE, lw=1.4, label=f"robot's onset, {onset_:g}")
    axes.set_xlim(0.0, 1.06 * inverse.max())
    over_compliance(axes, (75.0, 41.0, 28.0, 21.0, 15.0))
    axes.set(ylabel="mean angle of joint 1 (deg)", title="C  Joint 1")
    axes.legend(loc="upper left")
    style.grid(axes)


def _draw_radius(axes: Axes, found: RobotWalks) -> None:
    base = found.base
    inverse = 1.0 / base.spring.values
    radius, error = means(base.axis_radius.values, in_settled_curve(base))
    errorbars(axes, inverse, radius, error, style.BLUE, "o", "twin")
    wanted = {spring: radius.value for spring, radius in printed.RADII.items()}
    axes.plot(
        [1.0 / key for key in wanted],
        list(wanted.values()),
        "D",
        color=style.ORANGE,
        markerfacecolor="none",
        markeredgewidth=1.8,
        markersize=11,
        label="robot, paper",
        zorder=5,
    )
    axes.set(
        ylim=(0.0, 1.1 * np.nanmax([*(radius + np.nan_to_num(error)), *wanted.values()])),
        xlim=(0.02, 1.06 * inverse.max()),
    )
    over_compliance(axes, (41.0, 28.0, 21.0, 17.0, 15.0))
    axes.set(ylabel="radius of the body axis (m)", title="D  Radius")
    axes.legend(loc="upper right")
    style.grid(axes)


def _draw_joints(found: RobotWalks, narrow: bool) -> Figure:
    figure, by_letter = style.figure(*_ONE, narrow)
    axes, base = by_letter["A"], found.base
    inverse = 1.0 / base.spring.values
    for joint, (color, marker) in zip(base.joint.values, style.joint_styles(base.sizes["joint"]), strict=True):
        mean, error = means(np.abs(np.rad2deg(base.mean_angle.sel(joint=joint).values)))
        errorbars(axes, inverse, mean, error, color, marker, f"joint {joint}")
        axes.plot(inverse, mean, color=color, lw=1.0)
    axes.set_xlim(0.0, 1.06 * inverse.max())
    axes.set_ylim(bottom=0.0)
    over_compliance(axes, _MARKED)
    axes.set_ylabel("mean absolute angle (deg)")
    axes.legend(loc="upper left")
    style.grid(axes)
    return figure


def _draw_different(found: RobotWalks, narrow: bool) -> Figure:
    figure, axes = style.figure(*_THREE, narrow)
    for (name, data), (color, marker) in zip(_all(found).items(), _VARIANTS, strict=False):
        inverse = 1.0 / data.spring.values
        radius, error = np.array([radius_at(data, float(spring)) for spring in data.spring.values]).T
        away = inverse - 1.0 / onset_of_bend(data)
        for letter, place, shown in (("A", inverse, inverse > 0.0), ("B", away, away > 0.0)):
            errorbars(axes[letter], place[shown], radius[shown], error[shown], color, marker, typeset(name))
            axes[letter].plot(place[shown], radius[shown], color=color, lw=1.0)
    for letter in "AB":
        axes[letter].set(ylim=(0.0, 3.0), ylabel="radius of the body axis (m)")
        style.grid(axes[letter])
    over_compliance(axes["A"], (34.0, 28.0, 21.0, 17.0, 15.0, 12.0))
    axes["A"].set_title("A  Radius over the spring")
    axes["B"].set_xlim(left=0.0)
    axes["B"].set(xlabel=f"1/{k(1)} − 1/{k(1)}* ({INVERSE_UNIT})", title="B  Radius, like with like")
    handles, labels = axes["A"].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2 if narrow else 5)
    _draw_onsets(axes["C"], found)
    return figure


def _draw_onsets(axes: Axes, found: RobotWalks) -> None:
    found_at = [
        ("base series (fitted)", printed.ONSET, onset_with_error(found.base)[0]),
        *((title, printed.onset(name), onset_with_error(data)[0]) for title, (name, data) in _variants(found).items()),
        ("all springs alike", printed.UNIFORM, found.uniform.attrs["critical_k"]),
    ]
    draw_asked(axes, [(title, paper.value, paper.band) for title, paper, _ in found_at])
    twin = [at for *_, at in found_at]
    axes.plot(twin, range(len(twin)), "o", color=style.BLUE, markersize=7, label="twin")
    axes.set(xlim=(0.0, 45.0), xlabel=f"onset ({SPRING_UNIT})", title="C  Onset of curved walks")
    axes.legend(loc="upper left")
