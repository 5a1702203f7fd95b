"""The whole robot's walks as the paper arranges them: its Fig. "curved", "absolute" and "different"."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from chilopod.paper.robot.equal_distance import onset_of_bend
from chilopod.paper.robot.rows import printed_radii
from chilopod.paper.robot.table import ONSET, percent, printed_spring
from chilopod.paper.robot.walk_measures import onset_with_error, radius_at
from chilopod.paper.robot.walks import RobotWalks
from chilopod.report.figures import robot_durations
from chilopod.report.figures.curved_trials import INVERSE_UNIT, errorbars, springs_above
from chilopod.report.kit import style
from chilopod.report.kit.panel import Panel
from chilopod.report.kit.words import SPRING_UNIT, k, listing, number, typeset
from chilopod.tasks.radius_law import in_settled_curve, is_curved

Array = NDArray[np.float64]

_WALKS = (style.Layout("AB;CD", 7.4), style.Layout("A;B;C;D", 13.6))
_ONE = (style.Layout("A", 4.0), style.Layout("A", 4.4))
_THREE = (style.Layout("AB;CC", 7.6), style.Layout("A;B;C", 12.6))
_JOINTS = tuple(zip((style.BLACK, *style.CURVES), "os^vD", strict=False))
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
            f"estimate for its robot is {printed_spring('pitchfork', 'robot_critical_k1'):g}.",
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
            f"the order {listing(str(joint) for joint in order)}, the most first; the critical mode of the planar "
            "model has 1, 3, 4, 2 and 5.",
        ),
        data=found.base,
    )


def different(found: RobotWalks) -> Panel:
    """The paper's Fig. "different"."""
    said = []
    for title, (name, data) in _variants(found).items():
        point, paper = onset_with_error(data)[0], printed_spring("variants", name, "robot_critical_k1")
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
            f"Bars in C are what counts as within, {percent(ONSET)}; with all springs alike the body undulates. At "
            "equal springs (A) a variant that sets in at a softer spring turns more widely by that alone; so the table "
            f"compares radii at equal distance from each one's own onset {k(1)}* (B)."
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
    """Of every variant and reading of it, by what they are called here: the paper's name, and the trials."""
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
        walk = examples.sel(spring=spring)
        for joint, (color, _) in zip(walk.joint.values, _JOINTS, strict=False):
            angle = np.rad2deg(walk.joint_angle.sel(joint=joint).values)
            axes[letter].plot(walk.time.values, angle, color=color, lw=0.9, label=f"joint {joint}")
        axes[letter].set_ylim(-high, high)
        axes[letter].set_xlabel("time (s)")
        axes[letter].set_ylabel("yaw joint angle (deg)")
        axes[letter].set_title(f"{letter}  {what}, {k(1)} = {spring:g} {SPRING_UNIT}")
        axes[letter].margins(x=0.0)
        style.grid(axes[letter])
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
        mean, error = means(np.where(here, angles, np.nan))
        errorbars(axes, inverse, mean, error, style.BLUE, marker, f"to the {side}")
        if fit:
            grid = np.linspace(1.0 / fit.critical, inverse.max(), 200)
            label = f"square root from {number(fit.critical, 3)}" if sign > 0.0 else None
            axes.plot(
                grid, sign * np.rad2deg(fit.angle(grid)), color=style.VERMILLION, linestyle=_DASHED, lw=1.3, label=label
            )
    here = base.direction.values == "straight"
    mean, error = means(np.where(here, angles, np.nan))
    errorbars(axes, inverse, mean, error, style.GREY, "D", "straight")
    onset_ = printed_spring("pitchfork", "robot_critical_k1")
    axes.axvline(1.0 / onset_, color=style.ORANGE, lw=1.4, label=f"robot's onset, {onset_:g}")
    axes.set_xlim(0.0, 1.06 * inverse.max())
    springs_above(axes, (75.0, 41.0, 28.0, 21.0, 15.0))
    axes.set_xlabel(f"1/{k(1)} ({INVERSE_UNIT})")
    axes.set_ylabel("mean angle of joint 1 (deg)")
    axes.set_title("C  Joint 1")
    axes.legend(loc="upper left")
    style.grid(axes)


def _draw_radius(axes: Axes, found: RobotWalks) -> None:
    base = found.base
    inverse = 1.0 / base.spring.values
    radius, error = means(np.where(in_settled_curve(base), base.axis_radius.values, np.nan))
    errorbars(axes, inverse, radius, error, style.BLUE, "o", "twin")
    wanted = printed_radii()
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
    axes.set_ylim(0.0, 1.1 * np.nanmax([*(radius + np.nan_to_num(error)), *wanted.values()]))
    axes.set_xlim(0.02, 1.06 * inverse.max())
    springs_above(axes, (41.0, 28.0, 21.0, 17.0, 15.0))
    axes.set_xlabel(f"1/{k(1)} ({INVERSE_UNIT})")
    axes.set_ylabel("radius of the body axis (m)")
    axes.set_title("D  Radius")
    axes.legend(loc="upper right")
    style.grid(axes)


def _draw_joints(found: RobotWalks, narrow: bool) -> Figure:
    figure, by_letter = style.figure(*_ONE, narrow)
    axes, base = by_letter["A"], found.base
    inverse = 1.0 / base.spring.values
    for joint, (color, marker) in zip(base.joint.values, _JOINTS, strict=False):
        mean, error = means(np.abs(np.rad2deg(base.mean_angle.sel(joint=joint).values)))
        errorbars(axes, inverse, mean, error, color, marker, f"joint {joint}")
        axes.plot(inverse, mean, color=color, lw=1.0)
    axes.set_xlim(0.0, 1.06 * inverse.max())
    axes.set_ylim(bottom=0.0)
    springs_above(axes, _MARKED)
    axes.set_xlabel(f"1/{k(1)} ({INVERSE_UNIT})")
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
        axes[letter].set_ylim(0.0, 3.0)
        axes[letter].set_ylabel("radius of the body axis (m)")
        style.grid(axes[letter])
    springs_above(axes["A"], (34.0, 28.0, 21.0, 17.0, 15.0, 12.0))
    axes["A"].set_xlabel(f"1/{k(1)} ({INVERSE_UNIT})")
    axes["A"].set_title("A  Radius over the spring")
    axes["B"].set_xlim(left=0.0)
    axes["B"].set_xlabel(f"1/{k(1)} − 1/{k(1)}* ({INVERSE_UNIT})")
    axes["B"].set_title("B  Radius, like with like")
    handles, labels = axes["A"].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2 if narrow else 5)
    _draw_onsets(axes["C"], found)
    return figure


def _draw_onsets(axes: Axes, found: RobotWalks) -> None:
    lines = [
        ("base series (fitted)", printed_spring("pitchfork", "robot_critical_k1"), onset_with_error(found.base)[0]),
        *(
            (title, printed_spring("variants", name, "robot_critical_k1"), onset_with_error(data)[0])
            for title, (name, data) in _variants(found).items()
        ),
        ("all springs alike", printed_spring("uniform", "robot_critical_k"), found.uniform.attrs["critical_k"]),
    ]
    for row, (_, paper, twin) in enumerate(lines):
        ends = [paper * (1.0 - ONSET), paper * (1.0 + ONSET)]
        axes.plot(ends, [row, row], color=style.PALE, lw=9, zorder=1, solid_capstyle="butt")
        axes.plot(paper, row, "D", color=style.ORANGE, markersize=7, label=None if row else "robot, paper")
        if np.isfinite(twin):
            axes.plot(twin, row, "o", color=style.BLUE, markersize=7, label=None if row else "twin")
    axes.set_yticks(range(len(lines)), [typeset(name) for name, *_ in lines])
    axes.invert_yaxis()
    axes.set_xlim(0.0, 45.0)
    axes.set_ylim(len(lines) - 0.5, -0.7)
    axes.set_xlabel(f"onset ({SPRING_UNIT})")
    axes.set_title("C  Onset of curved walks")
    axes.legend(loc="upper left")
    style.grid(axes, "x")


def means(values: Array) -> tuple[Array, Array]:
    """Mean and standard error over the last axis, of what is not NaN; the error is NaN for fewer than two."""
    counts = np.isfinite(values).sum(axis=-1)
    filled = np.where(np.isfinite(values), values, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(counts > 0, filled.sum(axis=-1) / counts, np.nan)
        spread = np.where(np.isfinite(values), (values - mean[..., None]) ** 2, 0.0).sum(axis=-1) / (counts - 1)
        return mean, np.where(counts > 1, np.sqrt(spread / counts), np.nan)
