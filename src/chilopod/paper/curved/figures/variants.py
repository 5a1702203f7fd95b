"""The paper's Fig. "different": radius of the curved walk of its variants, and where each one's sets in."""

from __future__ import annotations

import re

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from chilopod.paper.compliance import INVERSE_UNIT, errorbars
from chilopod.paper.curved.study import CurvedStudy, axis_radius
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.words import SPRING_UNIT, k, listing, number, signed, spring, typeset

_LAYOUT = (style.Layout("AB;CC", 6.6, heights=(1.5, 1.0)), style.Layout("A;B;C", 11.6))
_STYLES = tuple(zip((style.BLACK, style.BLUE, style.GREEN, style.PURPLE), "os^D", strict=True))


def panel(study: CurvedStudy) -> Panel:
    """The figure of :func:`chilopod.paper.curved.study.compared`."""
    data = study.comparison
    names = [typeset(str(name)) for name in data.variant.values]
    changes = listing(
        f"{signed(100 * (float(at.equal_ratio) - 1), 1)}\u00a0% for {name}"
        for name, at in ((names[i], data.isel(variant=i)) for i in range(1, len(names)))
    )
    fits = listing(
        f"{number(float(at.fitted_k1), 4)} instead of {number(float(at.exact_k1), 4)} for {name} "
        f"(robot {number(float(at.robot_k1), 2)})"
        for name, at in ((name, data.isel(variant=i)) for i, name in enumerate(names))
    )
    most = names[int(np.abs(data.equal_ratio.values - 1.0).argmax())]
    stiff = int((data.fitted_k1 > data.exact_k1).sum())
    folded = [
        f"{name} (up to {spring(float(at.stiffest_k1), 4)})"
        for name, at in ((name, data.isel(variant=i)) for i, name in enumerate(names))
        if float(at.stiffest_k1) > float(at.exact_k1) * (1.0 + 1e-9)
    ]
    return Panel(
        name="curved-variants",
        title="Curved walks of the paper's variants",
        draw=lambda narrow: _draw(study, narrow),
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


def _draw(study: CurvedStudy, narrow: bool) -> Figure:
    figure, axes = style.figure(*_LAYOUT, narrow)
    data = study.comparison
    for name, (color, marker) in zip(data.variant.values, _STYLES, strict=False):
        at, branch = data.sel(variant=name), study.branches[name]
        exact = float(at.exact_k1)
        radius, error = at.radius.values, at.radius_error.values
        here = np.isfinite(radius)
        springs, radius, error = exact * data.ratio.values[here], radius[here], error[here]
        stiffest = float(branch.parameter.max())
        line = springs.min() + (stiffest - springs.min()) * (1.0 - np.linspace(1.0, 0.0, 80) ** 3)
        exact_radius = axis_radius(branch, line)
        for letter, scale in (("A", 1.0), ("B", exact)):
            axes[letter].plot(scale / line, exact_radius, color=color, lw=1.2)
            errorbars(axes[letter], scale / springs, radius, error, color, marker, typeset(str(name)))
    for letter, label, title in (
        ("A", f"1/{k(1)} ({INVERSE_UNIT})", f"A  Over 1/{k(1)}"),
        ("B", f"critical {k(1)} / {k(1)}", "B  Over its own critical spring"),
    ):
        axes[letter].set(ylim=(0.2, 1.0), xlabel=label, ylabel="radius of the body axis (m)", title=title)
        style.grid(axes[letter])
    axes["B"].legend(loc="upper right")
    _draw_onsets(axes["C"], study, narrow)
    return figure


def _draw_onsets(axes: Axes, study: CurvedStudy, narrow: bool) -> None:
    data = study.comparison
    rows = np.arange(data.sizes["variant"])
    axes.errorbar(
        data.fitted_k1,
        rows - 0.12,
        xerr=data.error,
        fmt="o",
        color=style.ORANGE,
        markerfacecolor="white",
        markeredgewidth=1.6,
        capsize=2.5,
        label="square-root fit to trials",
    )
    axes.plot(data.exact_k1, rows + 0.12, "D", color=style.VERMILLION, label="pitchfork")
    axes.hlines(
        rows + 0.12,
        data.exact_k1,
        data.stiffest_k1,
        color=style.BLUE,
        lw=3.0,
        zorder=1,
        label="curved walks last up to here",
    )
    axes.set_yticks(rows, [re.sub(r" (?=\d)", "\n", typeset(str(name))) for name in data.variant.values])
    axes.tick_params(axis="y", length=0)
    axes.set(ylim=(rows[-1] + 0.6, -0.6), xlabel=f"critical {k(1)} ({SPRING_UNIT})", title="C  Where the bend sets in")
    axes.legend(loc="upper left", bbox_to_anchor=(-0.3 if narrow else 0.0, -0.26), ncols=1 if narrow else 3)
    style.grid(axes, "x")
