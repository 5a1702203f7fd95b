"""Checks of arguments that all engines share; each raises a ParameterError that names the argument."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.errors import ParameterError
from chilopod.frozen import Array
from chilopod.record import LARGEST, LONGEST, Recording
from chilopod.robot import Robot
from chilopod.units.quantity import as_number as as_number  # for all engines

BEGINNING = 1e-9
"""Tolerance of a time at the beginning of a gait cycle, relative to the cycle: rounding of whole multiples of the
period."""


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
        whole = [operator.index(each) for each in seeds]  # type: ignore[attr-defined]
    except TypeError:
        whole = []
    if not whole or min(whole) < 0:
        raise ParameterError("must be whole numbers, one for each walk", field=name, value=seeds, allowed="0 or more")
    return whole


def as_marks(name: str, value: object, count: int) -> NDArray[np.bool_]:
    """Copy of an array of truth values, one for each robot."""
    try:
        marks = np.array(value)
    except (TypeError, ValueError):
        marks = np.empty(0)
    if marks.dtype != np.bool_ or marks.shape != (count,):
        raise ParameterError("must be truth values", field=name, value=value, allowed=f"{count} of True or False")
    return marks


def as_robots(robots: object) -> list[Robot]:
    """One robot or several as a list."""
    given = [robots] if isinstance(robots, Robot) else robots
    if not isinstance(given, Sequence) or isinstance(given, str) or not all(isinstance(each, Robot) for each in given):
        raise ParameterError("must be a Robot or a sequence of Robots", field="robots", value=type(robots).__name__)
    if not given:
        raise ParameterError("must not be empty", field="robots", allowed="at least one robot")
    return list(given)


def as_robot(robot: object) -> Robot:
    """One robot."""
    if not isinstance(robot, Robot):
        raise ParameterError("must be a Robot", field="robot", value=type(robot).__name__, allowed="a chilopod Robot")
    return robot


def check_wishes(record: object, expected: object) -> float:
    """Checked duration of a walk, s, together with the contents of its record."""
    if not isinstance(record, Recording | None):
        raise ParameterError(
            "must be a Recording or None", field="record", value=record, allowed="a chilopod.record.Recording, or None"
        )
    seconds = as_number("expected", expected)
    if not 0.0 <= seconds <= LONGEST:
        raise ParameterError("must be a duration in s", field="expected", value=expected, allowed=f"0 to {LONGEST:g} s")
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
        if not fits:
            raise ParameterError(
                f"has the wrong shape {array.shape}", field=name, allowed=f"{allowed}, or one for each walk"
            )
        if not (np.abs(array) <= LARGEST).all():
            raise ParameterError(beyond(array), field=name, allowed=f"numbers up to {LARGEST:g}")
    angles = np.broadcast_to(np.atleast_2d(angles), (len(np.atleast_2d(angles)), joints))
    headings, places = np.atleast_1d(headings), np.atleast_2d(places)
    try:
        (count,) = np.broadcast_shapes(angles.shape[:1], headings.shape, places.shape[:1])
    except ValueError:
        raise ParameterError("must have the same number of walks", field="joint_angles, heading, position") from None
    return (
        np.array(np.broadcast_to(angles, (count, joints))),
        np.array(np.broadcast_to(headings, (count,))),
        np.array(np.broadcast_to(places, (count, 2))),
    )


def rows_of(
    robots: Sequence[Robot],
    arguments: Mapping[str, tuple[ArrayLike | None, tuple[int, ...]]],
    seeds: Sequence[int] | None = None,
) -> tuple[int, dict[str, Array | None]]:
    """Arguments of ``start`` as arrays with one row a walk.

    Parameters
    ----------
    robots
        One robot, or one for each walk.
    arguments
        Value given and shape of one row, by name. The argument ``friction`` must be positive.
    seeds
        One seed, or one for each walk.

    Returns
    -------
    Number of walks, and copies of the arrays; None for an argument that was not given.
    """
    counts = {"robots": len(robots), "seeds": len(seeds) if seeds else 1}
    arrays: dict[str, Array | None] = {}
    for name, (argument, shape) in arguments.items():
        arrays[name] = None
        if argument is None:
            continue
        array = as_array(name, argument)
        if array.shape[array.ndim - len(shape) :] != shape or array.ndim > len(shape) + 1 or array.size == 0:
            allowed = f"{shape} or (walks, {', '.join(map(str, shape))})"
            raise ParameterError(f"has the wrong shape {array.shape}", field=name, allowed=allowed)
        largest = (
            np.finfo(float).max if name == "initial" else LARGEST
        )  # the state of a walk that diverges may be larger
        if not (np.abs(array) <= largest).all():
            raise ParameterError(beyond(array), field=name, allowed=f"numbers up to {largest:g}")
        if name == "friction" and not (array > 0.0).all():
            raise ParameterError("must be positive", field=name)
        arrays[name] = array if array.ndim > len(shape) else array[None]
        counts[name] = len(array) if array.ndim > len(shape) else 1
    count = max(counts.values())
    for name, each in counts.items():
        if each not in (1, count):
            raise ParameterError(f"has the wrong length {each}", field=name, allowed=f"1 or {count}")
    for name, rows in arrays.items():
        if rows is not None:
            arrays[name] = np.array(np.broadcast_to(rows, (count, *rows.shape[1:])), order="C")
    return count, arrays


def rows_anew(
    which: object,
    robots: Sequence[Robot],
    time: float,
    record: Recording | None,
    arguments: Mapping[str, tuple[ArrayLike | None, tuple[int, ...]]],
    seeds: object = None,
) -> tuple[NDArray[np.bool_], dict[str, Array | None]]:
    """Arguments of ``restart`` as arrays with one row for each restarted robot.

    Parameters
    ----------
    which, seeds
        As given.
    robots, time, record
        Robots, time and record of the walk.
    arguments
        As of :func:`rows_of`.

    Returns
    -------
    Mask of the robots, and the arrays; None for an argument that was not given, or if the mask is empty.
    """
    marked, cycles = as_marks("which", which, len(robots)), time / robots[0].gait.period
    if record is not None:
        raise ParameterError(
            "must be False for a walk that is recorded: a record covers one walk",
            field="restart",
            allowed="a walk that was started with record=None",
        )
    if abs(cycles - round(cycles)) > BEGINNING:
        allowed = f"a whole multiple of the period, {robots[0].gait.period:g} s"
        raise ParameterError("must be the end of a gait cycle", field="restart", value=f"{time:g} s", allowed=allowed)
    count, own = int(marked.sum()), as_seeds(seeds)
    if own is not None and len(own) != count:
        raise ParameterError(f"has the wrong length {len(own)}", field="seeds", allowed=str(count))
    if count == 0:
        return marked, dict.fromkeys(arguments)
    found, rows = rows_of(robots[:count], arguments)
    if found != count:
        problem = f"has the wrong length {found}"
        raise ParameterError(problem, field="initial, friction", allowed=f"1 or {count}")
    return marked, rows


def check_time(until: float, now: float) -> float:
    """Time to advance to, s; refuses times in the past and times beyond ``LONGEST``."""
    until = as_number("until", until)
    if not now <= until <= LONGEST:
        problem = "must not lie before the time of the walk" if until < now else "must be a time in s"
        raise ParameterError(
            problem, field="until", value=f"{until:g} s", allowed=f"{now:g} s or later, at most {LONGEST:g} s"
        )
    return until
