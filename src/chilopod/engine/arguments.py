"""Checks of arguments that all engines share; each raises a ParameterError that names the argument."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import ParameterError
from chilopod.frozen import Array
from chilopod.record import LARGEST, LONGEST, Recording
from chilopod.robot import Robot
from chilopod.units.quantity import as_number as as_number  # for all engines

Arguments = Mapping[str, tuple[ArrayLike | None, tuple[int, ...]]]
"""Arguments by name, each with the shape of one row."""

BEGINNING = 1e-9
"""Tolerance of a time at the beginning of a gait cycle, relative to the cycle: rounding of whole multiples of the
period."""


def require(
    fits: object, problem: str, field: str, value: object = None, allowed: str | None = None, nearest: str | None = None
) -> None:
    """Check of an argument: a ParameterError with these parts, see :class:`chilopod.errors.ChilopodError`, unless it
    fits."""
    if not fits:
        raise ParameterError(problem, field=field, value=value, allowed=allowed, nearest=nearest)


def beyond(array: Array) -> str:
    """Complaint about numbers of which some are too large, infinite or NaN."""
    return "is too large" if np.isfinite(array).all() else "must be finite"


def as_array(name: str, value: object) -> Array:
    """An array of plain numbers, not necessarily a copy."""
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "fiu":
            raise TypeError
        return array.astype(np.float64, copy=False)
    except (TypeError, ValueError, OverflowError):
        raise ParameterError("must be an array of numbers", field=name, value=value) from None


def as_seeds(seeds: object, name: str = "seeds") -> list[int] | None:
    """Seeds as a list of whole numbers, zero or more; None for None."""
    if seeds is None:
        return None
    try:
        given: Any = seeds
        whole = [-1 if isinstance(each, bool) else operator.index(each) for each in given]
    except TypeError:
        whole = []
    require(whole and min(whole) >= 0, "must be whole numbers, one for each walk", name, seeds, "0 or more")
    return whole


def as_marks(name: str, value: object, count: int) -> NDArray[np.bool_]:
    """Copy of an array of truth values, one for each robot."""
    try:
        marks = np.array(value)
    except (TypeError, ValueError):
        marks = np.empty(0)
    fits = marks.dtype == np.bool_ and marks.shape == (count,)
    require(fits, "must be truth values", name, value, f"{count} of True or False")
    return marks


def as_robots(robots: object) -> list[Robot]:
    """One robot or several as a list."""
    given: Any = [robots] if isinstance(robots, Robot) else robots
    listed = isinstance(given, Sequence) and not isinstance(given, str)
    fits = listed and all(isinstance(each, Robot) for each in given)
    require(fits, "must be a Robot or a sequence of Robots", "robots", type(robots).__name__)
    require(given, "must not be empty", "robots", allowed="at least one robot")
    return list(given)


def as_robot(robot: object) -> Robot:
    """One robot."""
    if not isinstance(robot, Robot):
        raise ParameterError("must be a Robot", field="robot", value=type(robot).__name__, allowed="a chilopod Robot")
    return robot


def check_wishes(record: object, expected: object) -> float:
    """Checked duration of a walk, s, together with the contents of its record."""
    fits, allowed = isinstance(record, Recording | None), "a chilopod.record.Recording, or None"
    require(fits, "must be a Recording or None", "record", record, allowed)
    seconds = as_number("expected", expected)
    require(0.0 <= seconds <= LONGEST, "must be a duration in s", "expected", expected, f"0 to {LONGEST:g} s")
    return seconds


def standing(
    robot: Robot, joint_angles: ArrayLike, heading: ArrayLike, position: ArrayLike
) -> tuple[Array, Array, Array]:
    """Arguments of ``initial_states`` as arrays with one row a robot: (robots, N-1), (robots,), (robots, 2)."""
    joints = as_robot(robot).body.modules - 1
    angles, headings = as_array("joint_angles", joint_angles), as_array("heading", heading)
    places = as_array("position", position)
    for name, array, fits, allowed in (
        ("joint_angles", angles, angles.ndim < 3 and angles.shape[-1:] in ((), (1,), (joints,)), f"({joints},)"),
        ("heading", headings, headings.ndim < 2, "a number"),
        ("position", places, places.ndim in (1, 2) and places.shape[-1] == 2, "(2,)"),
    ):
        require(fits, f"has the wrong shape {array.shape}", name, allowed=f"{allowed}, or one for each walk")
        _check_size(name, array)
    angles, headings, places = np.atleast_2d(angles), np.atleast_1d(headings), np.atleast_2d(places)
    try:
        (count,) = np.broadcast_shapes(angles.shape[:1], headings.shape, places.shape[:1])
    except ValueError:
        raise ParameterError("must have the same number of walks", field="joint_angles, heading, position") from None
    shaped = (angles, (count, joints)), (headings, (count,)), (places, (count, 2))
    angles, headings, places = (np.array(np.broadcast_to(each, shape)) for each, shape in shaped)
    return angles, headings, places


def _check_size(name: str, array: Array, largest: float = LARGEST) -> None:
    require((np.abs(array) <= largest).all(), beyond(array), name, allowed=f"numbers up to {largest:g}")


def rows_of(
    robots: Sequence[Robot], arguments: Arguments, seeds: Sequence[int] | None = None
) -> tuple[int, dict[str, Array | None]]:
    """Arguments of ``start``: the number of walks, and copies of the arrays, with one row a walk; None for an argument
    that was not given.

    ``arguments`` has the value given and the shape of one row, by name, of which ``friction`` must be positive. There
    is one robot, or one for each walk, and likewise one seed.
    """
    counts = {"robots": len(robots), "seeds": len(seeds) if seeds else 1}
    arrays: dict[str, Array | None] = {}
    for name, (argument, shape) in arguments.items():
        arrays[name] = None
        if argument is None:
            continue
        array = as_array(name, argument)
        given = array if array.ndim > len(shape) else array[None]
        allowed = f"{shape} or (walks, {', '.join(map(str, shape))})"
        require(given.shape[1:] == shape and given.size, f"has the wrong shape {array.shape}", name, allowed=allowed)
        # The state of a walk that diverges may be larger.
        _check_size(name, array, np.finfo(float).max if name == "initial" else LARGEST)
        require(name != "friction" or (array > 0.0).all(), "must be positive", name)
        arrays[name], counts[name] = given, len(given)
    count = max(counts.values())
    for name, each in counts.items():
        require(each in (1, count), f"has the wrong length {each}", name, allowed=f"1 or {count}")
    for name, rows in arrays.items():
        if rows is not None:
            arrays[name] = np.array(np.broadcast_to(rows, (count, *rows.shape[1:])), order="C")
    return count, arrays


def rows_anew(
    which: object, robots: Sequence[Robot], time: float, record: Recording | None, arguments: Arguments, seeds: object
) -> tuple[NDArray[np.bool_], dict[str, Array | None]]:
    """Arguments of ``restart``, ``arguments`` as in :func:`rows_of`, of a walk with these robots, time and record: the
    mask of the robots, and arrays with one row for each restarted robot; None for an argument that was not given, or if
    the mask is empty."""
    marked, period = as_marks("which", which, len(robots)), robots[0].gait.period
    cycles = time / period
    problem = "must be False for a walk that is recorded: a record covers one walk"
    require(record is None, problem, "restart", allowed="a walk that was started with record=None")
    whole, allowed = abs(cycles - round(cycles)) <= BEGINNING, f"a whole multiple of the period, {period:g} s"
    require(whole, "must be the end of a gait cycle", "restart", f"{time:g} s", allowed)
    count, own = int(marked.sum()), as_seeds(seeds)
    if own is not None:
        require(len(own) == count, f"has the wrong length {len(own)}", "seeds", allowed=str(count))
    if count == 0:
        return marked, dict.fromkeys(arguments)
    found, rows = rows_of(robots[:count], arguments)
    require(found == count, f"has the wrong length {found}", "initial, friction", allowed=f"1 or {count}")
    return marked, rows


def check_time(until: float, now: float) -> float:
    """Time to advance to, s; refuses times in the past and times beyond ``LONGEST``."""
    until = as_number("until", until)
    problem = "must not lie before the time of the walk" if until < now else "must be a time in s"
    allowed = f"{now:g} s or later, at most {LONGEST:g} s"
    require(now <= until <= LONGEST, problem, "until", f"{until:g} s", allowed)
    return until
