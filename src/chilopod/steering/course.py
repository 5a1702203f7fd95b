"""Courses: targets one after another, and their text form."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from chilopod import units
from chilopod.engine.arguments import as_number
from chilopod.errors import ParameterError, UnitError, concerning, nearest_name
from chilopod.frozen import Array
from chilopod.record import in_range
from chilopod.steering.target import ARRIVAL_RADIUS, FARTHEST
from chilopod.text_file import read_text

MOST_GOALS = 1000
"""Largest number of targets; more are typing errors."""

RANDOM_DISTANCES = (0.8, 2.0)
"""Least and largest distance of the targets of a random course from the robot when they are set, m."""

_LONGEST_PATIENCE = 1e4
_FORM = 'a direction and a distance, such as "45 deg, 1.3 m", or a place on the floor, such as "1.2 m, 0.5 m"'
_RANDOM = "random:"
_LONGEST_SEED = 18  # digits: a 64-bit whole number holds them
_WIDEST_BEARING = math.radians(75.0)
_DIGITS = 9  # decimal places of a distance, so that rounding does not exclude 0.15 m or 10 km


@dataclass(frozen=True)
class Goal:
    """Target of a course: a position on the floor, or relative to the robot at the time the target is set.
    ParameterError if it is too far, or is relative and within the arrival radius.

    Attributes
    ----------
    x, y
        Position on the floor, m; the robot starts at the origin along x. If ``relative``, ahead of module 1 and to its
        left.
    relative
        True if the position is relative to module 1 at the end of the goal before.
    """

    x: float
    y: float
    relative: bool

    def __post_init__(self) -> None:
        # Equal trials have one text, whatever kinds of numbers they were given.
        for name in ("x", "y"):
            object.__setattr__(self, name, as_number(name, getattr(self, name)))
        distance = round(math.hypot(self.x, self.y), _DIGITS)
        if not (ARRIVAL_RADIUS if self.relative else -1.0) < distance <= FARTHEST:
            near = f"more than the {ARRIVAL_RADIUS:g} m that count as arrived, " if self.relative else ""
            value, allowed = f"{distance:g} m", f"{near}at most {FARTHEST:g} m"
            raise ParameterError("must be a distance to walk", field="target distance", value=value, allowed=allowed)

    @classmethod
    def parse(cls, text: str) -> Goal:
        """Read ``"45 deg, 1.3 m"``: direction and distance from module 1, or ``"1.2 m, 0.5 m"``: x and y on the floor.
        A direction is relative to the heading, left positive, -180 to 180 deg. ParameterError or UnitError for any
        other text, or a position out of range."""
        first, comma, second = (part.strip() for part in text.partition(","))
        fits = [unit for unit in ("rad", "m") if _is_quantity(first, unit)]
        if not comma or len(fits) != 1:
            # A number without a unit could be an angle or a length.
            problem = "must have a unit behind its first number" if comma and fits else "must be a target"
            raise ParameterError(problem, field="target", value=text.strip(), allowed=_FORM)
        value = units.parse(first, fits[0])
        with concerning("target"):
            other = units.parse(second, "m")
        if fits == ["m"]:
            return cls(value, other, relative=False)
        if not abs(value) <= math.pi or other < 0.0:
            allowed = "-180 to 180 deg, a positive distance"
            raise ParameterError("must be bearing and distance", field="target", value=text.strip(), allowed=allowed)
        return cls(other * math.cos(value), other * math.sin(value), relative=True)

    def __str__(self) -> str:
        if not self.relative:
            return f"{self.x:g} m, {self.y:g} m"
        return f"{math.degrees(math.atan2(self.y, self.x)):g} deg, {math.hypot(self.x, self.y):g} m"

    def place(self, poses: Array) -> Array:
        """Position on the floor, m, shape (..., 2), from x, y (m) and heading (rad) when it is set, shape (..., 3)."""
        if not self.relative:
            return np.tile([self.x, self.y], (*poses.shape[:-1], 1))
        x, y, heading = poses.T
        cos, sin = np.cos(heading), np.sin(heading)
        return np.array([x + self.x * cos - self.y * sin, y + self.x * sin + self.y * cos]).T


@dataclass(frozen=True)
class Course:
    """Targets one after another; ParameterError if they are no course.

    Attributes
    ----------
    goals, patience
        At least one goal, each apart from the one before; time for each, s, after which the next is set.
    view, range
        Full angle of the scanner's view ahead of module 1, rad, and its range, m; by default those of the paper's
        (Hokuyo URG-04LX).
    tightest
        Radius of the circles of the shortest path to a target, m; 0 for a robot that turns on the spot. The radius of a
        radius law is the paper's measure of the body axis: module 1 itself follows smaller circles, so that a walk may
        be shorter than this path.
    """

    goals: tuple[Goal, ...]
    patience: float
    view: float = math.radians(240.0)
    range: float = 4.095
    tightest: float = 0.0

    def __post_init__(self) -> None:
        for name in ("patience", "view", "range", "tightest"):
            object.__setattr__(self, name, as_number(name, getattr(self, name)))
        in_range("patience", self.patience, _LONGEST_PATIENCE, "s")
        in_range("view", math.degrees(self.view), 360.0, "deg")
        in_range("range", self.range, FARTHEST, "m")
        if not 0.0 <= self.tightest <= FARTHEST:
            allowed = f"0 to {FARTHEST:g} m"
            raise ParameterError("must be a radius", field="tightest", value=f"{self.tightest:g} m", allowed=allowed)
        if not 1 <= len(self.goals) <= MOST_GOALS:
            raise _wrong_count(len(self.goals))
        before, where = Goal(0.0, 0.0, relative=False), "the start"
        for number, goal in enumerate(self.goals, 1):
            apart = math.hypot(goal.x - before.x, goal.y - before.y)
            if not (goal.relative or before.relative or apart > ARRIVAL_RADIUS):
                problem, allowed = f"must lie apart from {where}", f"more than {ARRIVAL_RADIUS:g} m from it"
                raise ParameterError(problem, field=f"target {number}", value=str(goal), allowed=allowed)
            before, where = goal, f"target {number}"

    @property
    def duration(self) -> float:
        """Longest duration of a walk along the course, s."""
        return self.patience * len(self.goals)

    def __str__(self) -> str:
        return "; ".join(map(str, self.goals))


def _floor(*places: tuple[float, float]) -> tuple[Goal, ...]:
    return tuple(Goal(x, y, relative=False) for x, y in places)


COURSES: Mapping[str, tuple[Goal, ...]] = {
    "slalom": _floor((1.5, 0.5), (3.0, -0.5), (4.5, 0.5), (6.0, -0.5), (7.5, 0.5)),
    "square": _floor((2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (0.0, 0.0)),
    "eight": _floor(
        (1.0, 1.0), (0.0, 2.0), (-1.0, 1.0), (0.0, 0.0), (1.0, -1.0), (0.0, -2.0), (-1.0, -1.0), (0.0, 0.0)
    ),
}
"""Courses by name, for a robot as long as the paper's, 1.35 m, which turns within about 0.35 m.

``slalom``: gates left and right of the straight path, 1.5 m from each other; ``square``: the corners of a square of
2 m, all turns to the left; ``eight``: a circle of 1 m to the left and one to the right, back each time.
"""


def random_course(seed: int, patience: float, count: int = 5) -> Course:
    """Random course of a number of targets relative to module 1, each with a patience, s: bearings within 75 deg of the
    heading, distances of 0.8 to 2 m. Equal seeds, 0 or more, give equal courses."""
    rng = np.random.default_rng(seed)
    bearings = rng.uniform(-_WIDEST_BEARING, _WIDEST_BEARING, count)
    distances = rng.uniform(*RANDOM_DISTANCES, count)
    x, y = distances * np.cos(bearings), distances * np.sin(bearings)
    return Course(tuple(Goal(float(a), float(b), relative=True) for a, b in zip(x, y, strict=True)), patience)


def course_named(text: str, patience: float) -> Course:
    """Read a course with a patience for each target, s; ParameterError or UnitError names a fault. The text has targets
    as :meth:`Goal.parse` reads them with semicolons between, ``"45 deg, 1.3 m; -60 deg, 1.5 m"``; or is the path of a
    file (``./name`` for one with the name of a course) with a target a line, ``#`` before comments; or a name of
    :data:`COURSES`; or ``random:SEED``."""
    if text in COURSES:
        return Course(COURSES[text], patience)
    if text.startswith(_RANDOM):
        return random_course(_seed(text), patience)
    if text and os.path.exists(text):
        return Course(_goals_in(text), patience)
    if "," in text or ";" in text:
        return Course(_goals(text.split(";")), patience)
    raise ParameterError(
        "must be targets, a named course or an existing file",
        field="targets",
        value=text,
        allowed=f'targets such as "45 deg, 1.3 m; -60 deg, 1.5 m", a file, {", ".join(COURSES)}, {_RANDOM}SEED',
        nearest=nearest_name(text, [*COURSES, f"{_RANDOM}1"]),
    )


def _goals_in(path: str) -> tuple[Goal, ...]:
    lines = (line.partition("#")[0].strip() for line in read_text(path, "course", ParameterError).splitlines())
    with concerning(source=path):
        return _goals([line for line in lines if line])


def _goals(texts: list[str]) -> tuple[Goal, ...]:
    if not 1 <= len(texts) <= MOST_GOALS:
        raise _wrong_count(len(texts))
    goals = []
    for number, text in enumerate(texts, 1):
        with concerning(f"target {number}"):
            goals.append(Goal.parse(text))
    return tuple(goals)


def _seed(text: str) -> int:
    digits = text.removeprefix(_RANDOM)
    if not (digits.isascii() and digits.isdigit() and len(digits) <= _LONGEST_SEED):
        allowed = f"a whole number from 0, at most {_LONGEST_SEED} digits, such as {_RANDOM}1"
        raise ParameterError("must end with a seed", field="targets", value=text, allowed=allowed)
    return int(digits)


def _wrong_count(count: int) -> ParameterError:
    return ParameterError("must be a number of targets", field="targets", value=count, allowed=f"1 to {MOST_GOALS}")


def _is_quantity(text: str, unit: str) -> bool:
    try:
        units.parse(text, unit)
    except UnitError:
        return False
    return True
