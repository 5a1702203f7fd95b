"""The whole robot's turning tasks as the paper arranges them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from chilopod.paper.printed import printed
from chilopod.paper.robot.turning import RobotTurning
from chilopod.paper.robot.walk_measures import spring_for
from chilopod.paper.robot.walks import RobotWalks
from chilopod.paper.scatter import SURE
from chilopod.paper.turning import hopf
from chilopod.paper.turning.minima import NAMES, minima
from chilopod.paper.turning.trials import TurningTask, springs_by_outcome
from chilopod.report.figures.turning import draw_turning, draw_without
from chilopod.report.figures.turning_criteria import draw_comparison, draw_criteria
from chilopod.report.kit.panel import Panel
from chilopod.report.kit.words import SPRING_UNIT, k, listing, number, typeset
from chilopod.steering import Outcome

_TOP = (75, 41, 28, 21, 15, 10)
_TOP_HOPF = (75, 41, 21, 15, 11, 8.7)


def panels(found: RobotTurning, walks: RobotWalks | None) -> Iterator[Panel]:
    """All figures, in the paper's order."""
    yield turning(found)
    for letter in found.tasks:
        yield criteria(found, letter, walks)
    yield without(found)
    yield comparison(found)


def turning(found: RobotTurning) -> Panel:
    """Fig. "turning" A to D."""
    task = found.tasks["A"]
    return Panel(
        name="robot-turning",
        title="The robot in three dimensions: turning task A",
        draw=lambda narrow: draw_turning(found.robot, task, narrow),
        alt="The circle to the target; paths, distance and angle of the target over time with three springs.",
        text=(
            "The twin sees the target with its scanner, as the robot does, and yaws the legs of module 1 towards it; "
            f"nothing of this was fitted but the walking speed. {task.criteria.sizes['repeat']} walks with each of "
            f"three springs: {_became(task)}. The paper's robot bulged outside with 41, arrived with 21 and turned "
            f"inside with 15\u00a0{SPRING_UNIT}. The earliest arrival, when the criteria are taken, is at "
            f"{number(task.time)}\u00a0s; the robot took "
            f"{printed()['turning']['evaluation_time'].replace(' ', chr(160))}.",
        ),
        data=task.paths,
    )


def criteria(found: RobotTurning, letter: str, walks: RobotWalks | None) -> Panel:
    """Fig. "turning" E and "another"."""
    task, entry = found.tasks[letter], printed()["turning"]["tasks"][letter]
    own = spring_for(walks.base, task.target.radius)[0] if walks else float("nan")
    k_hat = own if np.isfinite(own) else float(entry["k_hat"].split()[0])
    low = minima(task.criteria)
    places = listing(
        f"{title.partition(',')[0]} at {number(float(low['at'].sel(criterion=name)), 3)}"
        for name, title in NAMES.items()
    )
    return Panel(
        name=f"robot-criteria-{letter.lower()}",
        title=f"The robot in three dimensions: the three criteria, task {letter}",
        draw=lambda narrow: draw_criteria(task, k_hat, narrow, _TOP),
        alt=f"Distance, angle and leg yaw over 1/{k(1)}: {places}.",
        text=(
            f"Means and standard errors of {task.criteria.sizes['repeat']} walks at {number(task.time)}\u00a0s. "
            f"{_all_became(task)}. The minima: {places}\u00a0{SPRING_UNIT}; the paper has all three around "
            f"{entry['k_hat'].split()[0]}. The dashed line is the spring whose settled walk has the radius of the "
            f"circle, {number(k_hat, 3)}\u00a0{SPRING_UNIT}"
            + (", by the twin's own walks." if np.isfinite(own) else ", by the paper.")
            + " The axis of ε3 does not start at zero.",
        ),
        data=task.criteria,
    )


def without(found: RobotTurning) -> Panel:
    """Fig. "without"."""
    data = found.without
    alone = data.isel(case=int(np.flatnonzero(~data.leg_yaw.values)[0]))
    helped = data.isel(case=int(np.flatnonzero(data.leg_yaw.values)[0]))
    left = int((alone.turned > 0.0).sum())
    trials = int(np.isfinite(alone.arrived).sum())
    return Panel(
        name="robot-without",
        title="The robot in three dimensions: with and without leg yaw",
        draw=lambda narrow: draw_without(data, narrow),
        alt="Paths of module 1 with and without leg yaw.",
        text=(
            f"Task A with {k(1)} = {float(alone.spring):g}\u00a0{SPRING_UNIT}. Without leg yaw "
            f"{int(np.nansum(alone.arrived))} of {trials} arrive, {left} turn left and {trials - left} right: the "
            f"bend takes its time, and chance has the side. With it {int(np.nansum(helped.arrived))} of "
            f"{int(np.isfinite(helped.arrived).sum())} arrive. The paper's robot: many of nine fail, all of five do "
            "not.",
        ),
        data=data,
    )


def comparison(found: RobotTurning) -> Panel:
    """Fig. "comparison"."""
    task = found.tasks["A"]
    return Panel(
        name="robot-hopf",
        title="The robot in three dimensions: pitchfork against Hopf",
        draw=lambda narrow: draw_comparison(task, found.hopf, narrow, _TOP_HOPF),
        alt="The three criteria over the spring for the two strategies.",
        text=(
            "Task A with all springs alike, the paper's five values, at the same time and with the same disturbances. "
            f"At best, pitchfork against Hopf: {typeset(hopf.words(task, found.hopf))}. In the paper all three are "
            f"lower for the pitchfork. {SURE:g} standard errors of the difference, seed by seed, decide here. The "
            f"third says little where it is nearly saturated: {typeset(hopf.saturation(task, found.hopf))}.",
        ),
        data=xr.concat(
            [each.criteria.assign_coords(strategy=each.criteria.attrs["strategy"]) for each in (task, found.hopf)],
            dim="strategy",
            join="outer",
            combine_attrs="drop_conflicts",
        ),
    )


def _became(task: TurningTask) -> str:
    """What became of most walks with each spring that is shown."""
    by_outcome = springs_by_outcome(task.criteria)
    return listing(
        f"most {label} with {float(each):g}"
        for each in task.paths.shown.values
        for label, those in by_outcome.items()
        if float(each) in those
    )


def _all_became(task: TurningTask) -> str:
    by_outcome = springs_by_outcome(task.criteria)
    words = {
        Outcome.OUTSIDE: "pass outside",
        Outcome.ARRIVED: "arrive",
        Outcome.INSIDE: "turn inside",
        Outcome.FAILED: "fail",
    }
    return "Most walks " + listing(
        f"{word} with {listing(f'{each:g}' for each in by_outcome[outcome.label])}"
        for outcome, word in words.items()
        if by_outcome[outcome.label]
    )
