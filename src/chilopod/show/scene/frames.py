"""Positions of all modules and feet of a recorded walk, and the other contents of its replay or film.

A *record* is a dataset over ``time`` (s), ``robot``, ``axis`` (x, y), ``joint`` and ``side`` (left, right) with
``position`` (m, centre of module 1), ``heading`` (rad), ``joint_angle`` (rad, heading of a module less that of the one
in front of it), ``leg_yaw`` (rad, of the legs of module 1) and ``status`` (text). Where there was a task there are
``target`` (m), over time if it moved, and ``distance`` (m) as well; where there was a course, over ``robot`` and
``goal``, ``goal_place`` (m), ``goal_begin`` and ``goal_end`` (s) and ``goal_verdict`` (text). After a robot stopped its
values are NaN. The attribute ``robot`` is the text of the robot file.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from chilopod.engine import Status
from chilopod.errors import ParameterError
from chilopod.frozen import Array
from chilopod.kinematics import directions, foot_places, from_modules, module_centres, module_headings
from chilopod.robot import Robot
from chilopod.show.words import round_down
from chilopod.steering import ARRIVAL_RADIUS, Verdict, arrivals

LARGEST: Final = 32767
"""Largest whole number that stands for a position on a page; the smallest is minus that."""

_NOWHERE: Final = -32768  # stands for NaN
# Phases such as 0.62/0.31 miss their integer by round-off; a foot nearer than this (in cycles) to a switch has made it.
_SAME_PHASE: Final = 1e-9
_MARGIN: Final = 0.06
_FOOT_ROOM: Final = 0.12  # for the scale bar below all bodies
_FLATTEST, _TALLEST = 2.4, 0.8


@dataclass(frozen=True)
class BodyFrames:
    """Bodies seen from above at T times, of R robots with N modules.

    After a robot stopped all stays as it was last; of one that never started it is NaN, and no foot stands.
    """

    robot: Robot  # but for its springs
    time: Array  # s, (T,)
    spine: Array  # front end of module 1, yaw joints and rear end of module N, m, (T, R, N+1, 2)
    centres: Array  # of the modules, m, (T, R, N, 2)
    headings: Array  # rad, left positive, (T, R, N)
    feet: Array  # by module, side (left, right) and axis, m, (T, R, N, 2, 2)
    stands: NDArray[np.bool_]  # True for each foot on the floor, (T, R, N, 2)
    walks: NDArray[np.bool_]  # True while the record has the robot, (T, R)


def body_frames(record: xr.Dataset, times: ArrayLike | None = None) -> BodyFrames:
    """Place modules and feet of a record at T times (s), by default those of the record; a ParameterError if it does
    not go with its robot.

    Between samples the body is interpolated, while the feet keep the gait's exact clock: standing ones move back along
    their module, swinging ones forward.
    """
    robot = robot_of(record)
    recorded = record["time"].values.astype(np.float64)
    time = recorded if times is None else np.asarray(times, dtype=np.float64)
    position, heading, angles, leg_yaw = (
        _interpolated(record[name].transpose("time", "robot", ...).values, recorded, time)
        for name in ("position", "heading", "joint_angle", "leg_yaw")
    )
    return bodies(robot, time, position, heading, angles, leg_yaw)


def bodies(
    robot: Robot, time: Array, position: Array, heading: Array, joint_angles: Array, leg_yaw: Array
) -> BodyFrames:
    """Place modules and feet of robots of one description at T times (s).

    ``position``, ``heading``, ``joint_angles`` and ``leg_yaw`` are as in a record, NaN after a robot stopped, in m and
    rad: (T, R, 2), (T, R), (T, R, N-1) and (T, R, 2).
    """
    walks = np.isfinite(position).all(-1) & np.isfinite(heading) & np.isfinite(joint_angles).all(-1)
    walks &= np.isfinite(leg_yaw).all(-1)
    headings = module_headings(heading, joint_angles)
    centres = module_centres(position, headings, robot.module_length)
    half = 0.5 * robot.module_length * directions(headings)[0]
    spine = np.concatenate([centres[..., :1, :] + half[..., :1, :], centres - half], axis=-2)
    phase = (robot.gait.phases(time, robot.body.modules) + _SAME_PHASE) % 1.0
    stands, stroke, yaw = robot.gait.stands(phase), robot.gait.stroke(phase)[:, None], np.zeros((*headings.shape, 2))
    yaw[:, :, 0] = leg_yaw
    places = foot_places(robot.legs.forward_offset, robot.legs.half_width, stroke, yaw)
    feet = from_modules(centres, headings, places)

    # Index of the last sample, at each time, at which the robot walked.
    last = np.maximum.accumulate(np.where(walks, np.arange(len(time))[:, None], 0), axis=0)
    rows, started = (last, np.arange(walks.shape[1])), np.maximum.accumulate(walks, axis=0)
    standing = stands[last] & started[..., None, None]
    return BodyFrames(robot, time, spine[rows], centres[rows], headings[rows], feet[rows], standing, walks)


def robot_of(record: xr.Dataset) -> Robot:
    """Robot of a record, from its attribute; ParameterError without the attribute, or for other joints."""
    if "robot" not in record.attrs:
        raise ParameterError("has no robot", field="record", allowed="the text of a robot file in attrs['robot']")
    robot = Robot.from_toml(record.attrs["robot"])
    if record.sizes["joint"] != robot.body.modules - 1:
        allowed = f"{robot.body.modules - 1}, those of its robot"
        raise ParameterError(f"has {record.sizes['joint']} joints", field="record", allowed=allowed)
    return robot


def _interpolated(values: NDArray[Any], recorded: Array, times: Array) -> Array:
    """Values over time at other times; NaN next to NaN and where a value is infinite."""
    known = np.where(np.isfinite(values), values, np.nan).astype(np.float64)
    place = np.interp(times, recorded, np.arange(len(recorded)))
    below = np.floor(place + _SAME_PHASE).astype(np.intp)
    above = np.minimum(below + 1, len(recorded) - 1)
    share = (place - below).reshape(-1, *[1] * (known.ndim - 1))
    # On a sample its neighbour does not count, not even as 0 times NaN.
    return np.where(share <= _SAME_PHASE, known[below], (1.0 - share) * known[below] + share * known[above])


@dataclass(frozen=True)
class Aim:
    """A target: place (m), time from which on it is one, and time at which it was reached, None if never (s)."""

    place: tuple[float, float]
    since: float
    reached: float | None

    def is_reached(self, now: float) -> bool:
        """True if it has been, at a time (s)."""
        return self.reached is not None and now >= self.reached - 1e-9


@dataclass(frozen=True)
class Outcome:
    """Outcome of a robot's walk, such as "arrived at 18.4 s", known from a time (s) on; its kind is "arrived",
    "stopped" (the record ends early) or "ended" (with the record, or where it was told to halt)."""

    text: str
    kind: str
    time: float


@dataclass(frozen=True)
class Floor:
    """Piece of the floor that is shown, alike for all robots: its edges, and the distance of the grid lines, which pass
    through the origin, m."""

    x0: float
    x1: float
    y0: float
    y1: float
    grid: float

    @classmethod
    def of(cls, middle: Array, size: Array, grid: float) -> Floor:
        """Floor of a size around a place, m, (2,)."""
        (x0, y0), (x1, y1) = (middle - 0.5 * size).tolist(), (middle + 0.5 * size).tolist()
        return cls(x0, x1, y0, y1, grid)

    @property
    def size(self) -> Array:
        """Width and height, m."""
        return np.array([self.x1 - self.x0, self.y1 - self.y0])

    def span(self) -> tuple[Array, float]:
        """Middle of positions on a page, and their largest distance from it, m: the floor with a margin of its size."""
        return np.array([0.5 * (self.x0 + self.x1), 0.5 * (self.y0 + self.y1)]), 1.5 * float(self.size.max())


@dataclass(frozen=True)
class Scene:
    """Everything that is drawn: bodies, floor, and of each robot title, outcome and targets in the order of their
    turns; the radius (m) is 0 where there are no targets."""

    frames: BodyFrames
    floor: Floor
    titles: tuple[str, ...]
    outcomes: tuple[Outcome, ...]
    aims: tuple[tuple[Aim, ...], ...]
    arrival_radius: float
    springs: Array  #: of the yaw joints, N*m/rad, (T, R, N-1)

    @property
    def shares(self) -> Array:
        """Springs relative to the stiffest of all, (T, R, N-1)."""
        return self.springs / max(float(np.nanmax(self.springs, initial=0.0)), 1e-300)

    def steers(self, robot: int) -> bool:
        """True if the first spring of a robot changes."""
        return bool(np.ptp(self.springs[:, robot, 0]) > 1e-9 * self.springs[0, robot, 0])

    def begun(self, robot: int, now: float) -> tuple[Aim, ...]:
        """Past and present targets of a robot at a time, s."""
        return tuple(aim for aim in self.aims[robot] if now >= aim.since - 1e-9)


def scene(record: xr.Dataset, titles: Mapping[Any, str] | Sequence[str], times: ArrayLike | None = None) -> Scene:
    """Contents of the pictures of a record at some times (s), by default those of the record; titles are by the labels
    of the robots, or in their order. A ParameterError if it does not go with its robot, or a robot has no title."""
    frames = body_frames(record, times)
    aims = aims_of(record)
    radius = ARRIVAL_RADIUS if any(aims) else 0.0
    floor, named = _floor(frames, places_of(aims), radius), _titles(record, titles)
    outcomes = tuple(_outcome(record, frames, robot, each) for robot, each in enumerate(aims))
    return Scene(frames, floor, named, outcomes, aims, radius, _springs(record, frames))


def aims_of(record: xr.Dataset) -> tuple[tuple[Aim, ...], ...]:
    """Targets of every robot of a record in the order of their turns."""
    if "goal_place" in record:
        goals = record[["goal_place", "goal_begin", "goal_end", "goal_verdict"]]
        return tuple(_course(goals.isel(robot=robot)) for robot in range(record.sizes["robot"]))
    if "target" not in record:
        return ((),) * record.sizes["robot"]
    return tuple(_targets(record.isel(robot=[robot])) for robot in range(record.sizes["robot"]))


def places_of(aims: Iterable[Iterable[Aim]]) -> NDArray[np.float64]:
    """Places of all targets of all robots, m, shape (P, 2)."""
    return np.array([aim.place for each in aims for aim in each]).reshape(-1, 2)


def _targets(record: xr.Dataset) -> tuple[Aim, ...]:
    """Aims of one robot, whose target may be over time."""
    target, time = record["target"].isel(robot=0).broadcast_like(record["time"]), record["time"].values
    places = target.transpose("time", "axis").values.astype(np.float64)
    edges = [0, *(np.flatnonzero((np.diff(places, axis=0) != 0.0).any(axis=1)) + 1).tolist(), len(time)]
    aims = []
    for first, last in zip(edges[:-1], edges[1:], strict=True):
        x, y = places[first].tolist()
        if np.isfinite([x, y]).all():
            (reached,) = arrivals(record.isel(time=slice(first, last)))
            aims.append(Aim((x, y), float(time[first]), float(reached) if np.isfinite(reached) else None))
    return tuple(aims)


def _course(goals: xr.Dataset) -> tuple[Aim, ...]:
    aims = []
    for goal in range(goals.sizes["goal"]):
        one = goals.isel(goal=goal)
        x, y = (float(each) for each in one["goal_place"].values)
        begin, end = float(one["goal_begin"]), float(one["goal_end"])
        # What had no turn is nowhere yet.
        if np.isfinite([x, y, begin]).all():
            aims.append(Aim((x, y), begin, end if str(one["goal_verdict"].values) == Verdict.ARRIVED.label else None))
    return tuple(aims)


def _springs(record: xr.Dataset, frames: BodyFrames) -> Array:
    """Springs at the times of frames, as they were last once a robot stopped; those of its robot without a record."""
    shape = (len(frames.time), record.sizes["robot"], record.sizes["joint"])
    if "stiffness" not in record:
        return np.broadcast_to(np.array(frames.robot.springs.stiffness), shape)
    recorded = record["stiffness"]
    if "time" not in recorded.dims:
        return np.broadcast_to(recorded.transpose(..., "joint").values, shape)
    times = record["time"].values.astype(np.float64)
    found = _interpolated(recorded.transpose("time", "robot", "joint").values, times, frames.time)
    rows = np.where(np.isfinite(found), np.arange(len(found))[:, None, None], 0)
    return np.take_along_axis(found, np.maximum.accumulate(rows, axis=0), axis=0)


def _titles(record: xr.Dataset, titles: Mapping[Any, str] | Sequence[str]) -> tuple[str, ...]:
    labels = record["robot"].values.tolist()
    if isinstance(titles, Mapping):
        missing = [label for label in labels if label not in titles]
        if missing:
            raise ParameterError(f"must name robot {missing[0]!r} too", field="titles", allowed="one for each robot")
        return tuple(titles[label] for label in labels)
    if len(titles) != len(labels):
        raise ParameterError(f"has {len(titles)} titles", field="titles", allowed=f"{len(labels)}, one for each robot")
    return tuple(titles)


def _outcome(record: xr.Dataset, frames: BodyFrames, robot: int, aims: tuple[Aim, ...]) -> Outcome:
    status, walks = str(record["status"].values[robot]), frames.walks[:, robot]
    reached = [aim.reached for aim in aims if aim.reached is not None]
    goals = record.sizes.get("goal", max(len(aims), 1))
    if len(reached) == goals:
        words = f"arrived at {reached[-1]:.1f} s" if goals == 1 else f"all {goals} targets by {reached[-1]:.1f} s"
        return Outcome(words, "arrived", reached[-1])
    if not walks.any():
        return Outcome(status, "stopped", float(frames.time[0]))
    end = float(frames.time[walks][-1])
    if not walks[-1] and status != Status.HALTED.label:
        return Outcome(f"{status} at {end:.1f} s", "stopped", end)
    if goals > 1:
        return Outcome(f"{len(reached)} of {goals} targets", "ended", end)
    return Outcome("target not reached" if aims else status, "ended", end)


def _floor(frames: BodyFrames, aims: Array, radius: float) -> Floor:
    """The box around all bodies and targets, a little larger, and neither a slit nor a tower."""
    robot, n = frames.robot, frames.robot.body.modules
    flat = np.concatenate([frames.spine, frames.feet.reshape(*frames.centres.shape[:2], 2 * n, 2)], axis=2)
    seen = frames.walks[..., None] & np.isfinite(flat).all(-1)
    # A robot that diverges may be anywhere in its last samples, and must not shrink all others to a dot.
    duration = frames.time[-1] - frames.time[0]
    furthest = 2.0 * (robot.body.length + robot.gait.speed * duration)
    start = frames.centres[:1, :, :1]
    seen &= np.abs(np.where(seen[..., None], flat - start, np.inf)).max(axis=-1) <= furthest
    points = np.concatenate([flat[seen], aims - radius, aims + radius, np.zeros((0 if seen.any() else 1, 2))])
    low, high = points.min(axis=0), points.max(axis=0)
    low[1] -= _FOOT_ROOM * max(high[1] - low[1], (high[0] - low[0]) / _FLATTEST)
    middle, size = 0.5 * (low + high), np.maximum(high - low, 0.5 * robot.body.length)
    size *= 1.0 + 2.0 * _MARGIN
    size = np.array([max(size[0], _TALLEST * size[1]), max(size[1], size[0] / _FLATTEST)])
    return Floor.of(middle, size, _grid(float(size.max())))


def close(frames: BodyFrames) -> Floor:
    """The smallest floor that, moved along, has every body at every time, with a module's length to spare."""
    size = np.ptp(frames.spine, axis=2)
    size = size[np.isfinite(size).all(axis=-1)]
    wide, tall = np.max(size, axis=0, initial=0.0) + frames.robot.module_length
    wide = max(wide, _TALLEST * tall)
    tall = max(tall, wide / _FLATTEST)
    return Floor(0.0, float(wide), 0.0, float(tall), _grid(float(max(wide, tall))))


def _grid(extent: float) -> float:
    """1 m where that makes a readable grid, otherwise 1, 2 or 5 times the power of ten that does."""
    return 1.0 if 2.0 <= extent <= 14.0 else round_down(extent / 3.0)


def packed(values: NDArray[np.float64], origin: NDArray[np.float64], step: NDArray[np.float64] | float) -> NDArray[Any]:
    """Whole numbers of steps from an origin, clipped to their range."""
    with np.errstate(over="ignore"):
        steps = np.round((values - origin) / step).clip(-LARGEST, LARGEST)
    return np.where(np.isnan(steps), _NOWHERE, steps).astype("<i2")


def encoded(values: NDArray[Any]) -> str:
    """An array, which should be little-endian, in base64."""
    return b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
