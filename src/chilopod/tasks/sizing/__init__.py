"""Sizing: values of free numbers at which a robot does what is wished, checked in walks.

:func:`size` reads wishes and ranges, lets a :class:`chilopod.tasks.sizing.search.Search` find the nearest robot, and
asks it what stands in the way. The robot then walks from a bent start. A walk that does something else than what was
computed changes the outcome. The result is a :class:`chilopod.tasks.sizing.result.Sizing`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress

import numpy as np
import xarray as xr

from chilopod import units
from chilopod.analysis.map_axes import Axis, Given, axis
from chilopod.analysis.quantities import QUANTITIES, Measured, Onset, leading_mode, unit_of
from chilopod.errors import ChilopodError, ParameterError, concerning, known_names
from chilopod.progress import Progress, silent
from chilopod.robot import Robot
from chilopod.tasks.radius_law import CYCLES, PERIOD, bent, end_of_walk, is_curved
from chilopod.tasks.sizing.result import Sizing
from chilopod.tasks.sizing.search import Outcome, Search, Wish, parsed_wish
from chilopod.trials import run

_AS_COMPUTED = 0.02  # largest relative deviation of radius and speed of a planar walk from those computed
_SETTLED = 15.0  # settling times of a walk
_MOST = 1500.0  # gait cycles of a walk, 15 minutes of the paper's robot
_OF_ONSET = {"onset", "margin", "friction", "work", "coefficient"}


def size(
    robot: Robot,
    wishes: Mapping[str, float | str],
    free: Sequence[Given],
    onset: Onset = Onset(),  # noqa: B008 (frozen)
    *,
    twin: bool = False,
    budget: int = 1200,
    seed: int = 0,
    progress: Progress = silent,
) -> Sizing:
    """Find the values of free numbers at which a robot does what is wished, and let it walk.

    ParameterError if a wish or a range is not one, or two of the ranges change the same number; AnalysisError if a
    curved walk is wished, and none leaves the straight one with this gait.

    Parameters
    ----------
    robot, onset
        Robot whose other numbers stay, and the number that bends it.
    wishes
        Value of each wished quantity, SI or text with a unit; text that begins with ``<`` or ``>`` is a limit.
        Quantities are those of :data:`chilopod.analysis.quantities.QUANTITIES`.
    free
        Paths and ranges of the free numbers, as the axes of :func:`chilopod.analysis.map`, but without modules.
    twin
        True to let the robot walk in three dimensions too.
    budget, seed
        Most evaluations of robots, some 20 ms each, one half in the search and one to say what stands in the way; a
        branch of curved walks counts as 20. Seed of the scattered starts.
    """
    names = known_names([*wishes], QUANTITIES, "wishes")
    given = tuple(parsed_wish(robot, onset, name, wishes[name]) for name in names)
    axes = _axes(robot, free)
    if twin and robot.twin is None:
        raise ParameterError("needs a table [twin], which this robot lacks", field="twin", value=robot.name)
    if budget < 1:
        raise ParameterError("must be positive", field="budget", value=budget)
    search = Search(robot, given, axes, onset, budget, seed, progress)
    search.check()
    outcome = search.run()
    reasons, front = search.reasons(outcome)
    found, again = search.at(search.best), search.again
    if _OF_ONSET & {*names}:
        with suppress(ChilopodError):
            value = onset.in_words(found, "onset", again.onset(found), 6)
            reasons = [*reasons, f"the onset of {onset.parameter} is {value}"]
    values = np.array([wish.of(again, found) for wish in given])
    bound = search.bound() if outcome is Outcome.MET and search.is_root else np.nan
    progress(1.0, "walks")
    engines = ("planar", "twin")[: 1 + twin]
    cycles = _cycles(found, again)
    records = {name: run([bent(found, name, cycles)])[0] for name in engines}
    # A walk that has settled bends alike in its whole second half.
    walks = {name: end_of_walk(record, found, 0.5 * cycles * PERIOD) for name, record in records.items()}
    if outcome is Outcome.MET and not _as_computed(walks["planar"], found, again):
        outcome = Outcome.SLOW if cycles == _MOST else Outcome.OTHERWISE
    rows = np.array([[*search.numbers(u), *(wish.of(again, search.at(u)) for wish in given)] for u in front])
    return Sizing(
        _documented(robot, found, given, axes, onset, outcome), robot.name, given, onset, values, axes,
        search.numbers(search.best), bound, outcome, tuple(reasons), rows.reshape(-1, len(axes) + len(given)), walks,
        search.evaluations,
    )  # fmt: skip


def _axes(robot: Robot, free: Sequence[Given]) -> tuple[Axis, ...]:
    axes = tuple(axis(robot, each, "free") for each in free)
    taken: set[str] = set()
    for each in axes:
        if each.whole:
            raise ParameterError("must be a continuous number, not a count", field=f"free {each.path}")
        both = taken & each.numbers(robot)
        if both:
            said = f"must not change a number that another range changes: {', '.join(sorted(both))}"
            raise ParameterError(said, field=f"free {each.path}", value=each.path)
        taken |= each.numbers(robot)
        for end in (each.low, each.high):
            with concerning(f"free {each.path}"):
                each.change(robot, end)
    if not axes:
        raise ParameterError("must name a number with its range", field="free", value="nothing")
    return axes


def _cycles(robot: Robot, measured: Measured) -> float:
    """Gait cycles of a walk that starts bent, until it has settled."""
    try:
        return float(np.clip(_SETTLED * measured.settling(robot) / robot.gait.period, CYCLES, _MOST))
    except ChilopodError:
        return CYCLES


def _as_computed(end: xr.Dataset, robot: Robot, measured: Measured) -> bool:
    """True if a walk has the radius and the speed that are computed, or is straight where that is stable."""
    if leading_mode(robot).growth <= 0.0:
        return end.direction.item() == "straight"
    try:
        pairs = (end.axis_radius, measured.radius(robot)), (end.speed, measured.speed(robot))
    except ChilopodError:
        return not np.isfinite(end.axis_radius.item())
    near = all(abs(float(walked) / computed - 1.0) <= _AS_COMPUTED for walked, computed in pairs)
    return bool(is_curved(end)) and near


def _documented(
    robot: Robot, found: Robot, wishes: Sequence[Wish], axes: Sequence[Axis], onset: Onset, outcome: Outcome
) -> Robot:
    """The robot with provenance: what was computed for which wishes, and what was copied."""
    said = []
    for wish in wishes:
        shown = units.format(wish.value, unit_of(wish.quantity, robot, onset), digits=6)
        said.append(f"{wish.quantity} {'<>'[(wish.sense + 1) // 2] if wish.sense else ''}{shown}")
    texts = dict(robot.copied().provenance)
    for each in axes:
        low, high = (units.format(end, each.unit, digits=6) for end in (each.low, each.high))
        origin = f"computed: chilopod size, {', '.join(said)}, {each.path} within {low} to {high}; {outcome.label}"
        texts |= dict.fromkeys(sorted(each.numbers(robot)), origin)
    return found.with_(name="sized", provenance=texts)
