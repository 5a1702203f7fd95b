"""F: uniform springs, the undulation that a Neimark-Sacker point sets off."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from chilopod.robot import Robot
from chilopod.show import style
from chilopod.show.panel import Panel
from chilopod.show.scene.outline import chain, draw_heading, draw_joints, draw_modules
from chilopod.show.words import minus, number, spring

_WIDE = style.Layout("AB;CC", 6.4, heights=(1.0, 1.25))
_NARROW = style.Layout("A;B;C", 9.6, heights=(0.8, 0.8, 1.9))
_SNAPSHOTS = 8
_DRAWN_ANGLE = 35.0  # degrees, of the joint that bends most


def panel(data: xr.Dataset, robot: Robot) -> Panel:
    """The undulation that sets in."""
    period, turns = data.attrs["oscillation_period_s"], data.phase.values[-1] / (2.0 * np.pi)
    cycles = period / robot.gait.period
    runs = "from head to tail" if turns < 0.0 else "from tail to head"
    return Panel(
        name="uniform",
        letter="F",
        title="Uniform springs: the body undulates",
        draw=lambda narrow: _draw(data, narrow),
        alt=f"Amplitudes and phases of the joints in the undulation, and {_SNAPSHOTS} body shapes over one cycle of "
        f"{number(period)} s: a wave that runs {runs}.",
        text=(
            f"If all springs are softened together, the straight walk is lost at k = {spring(data.attrs['value'], 5)}, "
            "and not into a curve: a pair of exponents crosses with a frequency of "
            f"{number(data.attrs['frequency_rad_s'], 4)} rad/s, so the body swings, once in {number(period)} s or "
            f"about {cycles:.0f} gait cycles. This is the bifurcation the paper compares with as "
            '"Hopf"; with the gait\'s own period counted it is a Neimark-Sacker bifurcation'
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


def _draw(data: xr.Dataset, narrow: bool) -> Figure:
    figure, axes = style.figure(_WIDE, _NARROW, narrow)
    joints = data.joint.values
    axes["A"].set_title("How far each joint swings")
    axes["A"].bar(joints, data.amplitude.values, width=0.55, color=style.SKY)
    for joint, value in zip(joints, data.amplitude.values, strict=True):
        style.note(axes["A"], f"{value:.3f}", (joint, value), (0, 3), ha="center")
    axes["A"].margins(y=0.15)
    axes["A"].set_ylabel("amplitude (unit norm)")
    axes["B"].set_title("Phase relative to joint 1")
    degrees = np.degrees(data.phase.values)
    axes["B"].plot(joints, degrees, "o-", color=style.BLUE, markersize=7)
    for joint, value in zip(joints, degrees, strict=True):
        style.note(axes["B"], minus(f"{value:.0f}°"), (joint, value), (7, 4))
    axes["B"].margins(x=0.14, y=0.16)
    axes["B"].set_ylabel("phase (degrees)")
    style.grid(axes["B"], "y")
    for letter in "AB":
        axes[letter].set_xticks(joints)
        axes[letter].set_xlabel("joint, from the front")
    _snapshots(axes["C"], data, columns=1 if narrow else 2)
    return figure


def _snapshots(axes: Axes, data: xr.Dataset, columns: int) -> None:
    axes.set_title("Body shapes over one cycle")
    style.bare(axes)
    amplitude = np.radians(_DRAWN_ANGLE) * data.amplitude.values / data.amplitude.values.max()
    modules = len(amplitude) + 1
    rows = _SNAPSHOTS // columns
    across, down = modules + 4.0, 0.9 + 0.12 * modules
    for index in range(_SNAPSHOTS):
        share = index / _SNAPSHOTS
        centres, headings, joints = chain(amplitude * np.cos(2.0 * np.pi * share + data.phase.values), 1.0)
        shift = np.array([(index // rows) * across, -(index % rows) * down])
        draw_modules(axes, centres + shift, headings, 1.0, fc=style.SKY, ec=style.BLUE, lw=1.0)
        draw_joints(axes, joints + shift, style.BLACK, size=3.0)
        draw_heading(axes, centres[0] + shift, headings[0], 1.0, style.BLACK)
        axes.text(
            shift[0] - 0.5 * modules - 0.5,
            shift[1],
            f"{share * data.attrs['oscillation_period_s']:.1f} s",
            ha="right",
            va="center",
            fontsize=style.SMALL,
        )
    axes.set(
        xlim=(-0.5 * modules - 2.2, (columns - 1) * across + 0.5 * modules + 1.0),
        ylim=(-(rows - 1) * down - 0.7 * down, 0.7 * down),
    )
