"""The two strategies of the paper beside each other: a pitchfork by one soft spring, Hopf by springs all alike."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from chilopod.analysis.parameters import PAPER_UNIT
from chilopod.paper.printed import CRITERION_NAMES
from chilopod.paper.scatter import Answer, Difference, difference, every
from chilopod.paper.turning.minima import SCALES, minima
from chilopod.paper.turning.trials import TurningTask
from chilopod.steering import LegYawController


def differences(pitchfork: TurningTask, hopf: TurningTask) -> dict[str, Difference]:
    """Smallest mean of every criterion with one strategy less that with the other, at the first instant.

    Both have the seeds 0, 1, ...: with as many repeats they are compared seed by seed, else as independent trials.
    """
    pairs = {name: (_smallest(pitchfork, name), _smallest(hopf, name)) for name in CRITERION_NAMES}
    return {name: difference(one, two, paired=one.size == two.size) for name, (one, two) in pairs.items()}


def all_lower(pitchfork: TurningTask, hopf: TurningTask) -> Answer:
    """True if all three minima of the pitchfork are the lower ones: no if any is higher beyond doubt."""
    return every(each.lower for each in differences(pitchfork, hopf).values())


def words(pitchfork: TurningTask, hopf: TurningTask) -> str:
    """Every criterion at its smallest with both, and whether the pitchfork's is lower, higher, or undecided."""
    ours, theirs = minima(pitchfork.criteria)["mean"], minima(hopf.criteria)["mean"]
    parts = []
    for name, apart in differences(pitchfork, hopf).items():
        factor, unit = SCALES[name]
        one, two = (factor * float(each.sel(criterion=name)) for each in (ours, theirs))
        parts.append(f"{CRITERION_NAMES[name]} {one:.3g} against {two:.3g} {unit}: {apart}")
    return "; ".join(parts)


def counted(pitchfork: TurningTask, hopf: TurningTask) -> str:
    """How many minima of the pitchfork are lower, how many higher, how many undecided."""
    answers = [each.lower for each in differences(pitchfork, hopf).values()]
    named = {"lower": True, "higher": False, "undecided": None}
    counts = {word: sum(each is answer for each in answers) for word, answer in named.items()}
    return ", ".join(f"{count} of {len(answers)} {word}" for word, count in counts.items() if count)


def softest_minima(hopf: TurningTask, point: float) -> tuple[str, bool]:
    """Where the criteria are smallest with all springs alike, beside the point below which the body undulates, and
    whether all of them are below it, in the unstable region."""
    at = minima(hopf.criteria).spring.sel(criterion=list(CRITERION_NAMES)).values
    places = " and ".join(f"{spring:g}" for spring in np.unique(at))
    return f"{places} {PAPER_UNIT}, the body undulates below {point:.2f}", bool((at < point).all())


def saturated(time: float) -> float:
    """The third criterion of legs that stand at their limit all the time, rad^2 s: as large as it gets."""
    return 2.0 * LegYawController().limit ** 2 * time


def saturation(*tasks: TurningTask) -> str:
    """How near the third criterion of all springs is to where it saturates: near it at every spring it says little."""
    full, unit = saturated(tasks[0].time), SCALES["effort"][1]
    means = np.concatenate([task.criteria.effort_mean.isel(instant=0).values for task in tasks])
    return (
        f"with all springs ε3 is {100.0 * np.nanmin(means) / full:.0f} to {100.0 * np.nanmax(means) / full:.0f} % of "
        f"the {full:.3g} {unit} of legs at their limit all the time"
    )


def _smallest(task: TurningTask, name: str) -> NDArray[np.float64]:
    """The trials at the spring of the smallest mean."""
    spring = float(minima(task.criteria).spring.sel(criterion=name))
    at = task.criteria[name].isel(instant=0)
    if np.isnan(spring):
        return np.full(at.sizes["repeat"], np.nan)
    trials: NDArray[np.float64] = at.sel(spring=spring).values
    return trials
