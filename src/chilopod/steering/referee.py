"""Referee of courses: it sets one target after another and judges the outcome of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chilopod.engine import Command, Controller, Observation, Status, Walk, event_times
from chilopod.frozen import Array
from chilopod.gait import Gait
from chilopod.labels import Labelled
from chilopod.record import bearing_and_distance
from chilopod.steering.course import Course
from chilopod.steering.shortest import shortest_path
from chilopod.steering.target import ARRIVAL_RADIUS

if TYPE_CHECKING:
    import xarray as xr


LOOK = 0.1
"""Time between two looks at the positions of the robots, s, in which the paper's robot moves 6 mm."""


_ROUNDING = 1e-9  # s


class Verdict(Labelled):
    """Outcome of a target of a course; each member's ``sentence`` describes it in words."""

    ARRIVED = "arrived", f"came within {ARRIVAL_RADIUS:g} m of it"
    LATE = "out of time", "did not get there in its time"
    UNSEEN = "never seen", "never had it in the scanner's view, in its time"
    TOO_FAR = "out of reach", "farther than the robot can walk in its time"
    STOPPED = "stopped", "did not walk to the end"


@dataclass(frozen=True)
class Judged:
    """Masks of the robots, shape (robots,), whose target ended at a look of :class:`CourseReferee`. They have
    ``arrived``, are out of time (``late``, ``unseen`` if the target was never in view), or no longer walk, which ends
    all their targets (``gone``). Others have had no target yet (``begins``)."""

    arrived: NDArray[np.bool_]
    late: NDArray[np.bool_]
    unseen: NDArray[np.bool_]
    gone: NDArray[np.bool_]
    begins: NDArray[np.bool_]

    @property
    def moved(self) -> NDArray[np.bool_]:
        """Robots that got the next target, or ended their last."""
        return self.arrived | self.late | self.unseen | self.begins


class CourseReferee:
    """Referee of robots that walk one course each, see :class:`chilopod.engine.Referee`.

    A robot's next target is set when it has arrived at the one before, when the time of that one is over, or when that
    one is out of reach: even the straight line to it is longer than the feet can cover in its time. After its last
    target the robot is halted.

    Parameters
    ----------
    courses, gait
        Course of each robot, with equal patience and view; gait of the robots.
    missed
        True for events at which the scanner misses the target, shape (robots, at least as many as events); None for no
        misses.
    keep
        True to log the observations of controllers, for :meth:`add_to`.
    """

    every = LOOK

    def __init__(
        self, courses: Sequence[Course], gait: Gait, missed: NDArray[np.bool_] | None = None, keep: bool = True
    ) -> None:
        robots, most = len(courses), max(len(each.goals) for each in courses)
        self._courses, self._missed, self._speed, self._keep = list(courses), missed, gait.speed, keep
        self._counts = np.array([len(each.goals) for each in courses])
        self._common = courses[0]
        self._number = np.full(robots, -1)
        self._places, self._seen_from = np.full((2, robots, most, 2), np.nan)
        self._begin, self._end, self._nearest = np.full((3, robots, most), np.nan)
        self._verdicts = np.full((robots, most), "", dtype=object)
        # Of the present target, NaN for robots without one: position, time of its setting, and least distance so far.
        self._aims, (self._since, self._least) = np.full((robots, 2), np.nan), np.full((2, robots), np.nan)
        self._present, self._first = -1, np.nan  # number of robots with a target, -1 before any; earliest setting, s
        self._seen_once = np.zeros(robots, dtype=np.bool_)
        self._log: list[list[Array]] = []  # arrays of _KEPT

    def look(self, walk: Walk) -> bool:
        """Judge the targets, set the next ones, halt finished robots; return True if any robot walks on."""
        pose, away = self._away(walk)
        far = np.count_nonzero(away >= ARRIVAL_RADIUS)
        if far == self._present > 0 and walk.time - self._first < self._common.patience - _ROUNDING:
            return True  # nothing to judge, as nearly always
        moved, busy = self._judged(walk, pose, away).moved, self.busy
        done = moved & ~busy
        if done.any():
            walk.halt(done)
        return bool(busy.any())

    def judge(self, walk: Walk) -> Judged:
        """Judge the targets and set the next ones."""
        return self._judged(walk, *self._away(walk))

    def _judged(self, walk: Walk, pose: Array, away: Array) -> Judged:
        now, begins = walk.time, self._number < 0
        arrived, gone = away < ARRIVAL_RADIUS, np.isnan(away) & ~np.isnan(self._since)
        over = (now - self._since >= self._common.patience - _ROUNDING) & ~(arrived | gone)
        judged = Judged(arrived, over & self._seen_once, over & ~self._seen_once, gone, begins)
        moved = judged.moved
        self._judge(gone, now, Verdict.STOPPED)
        self._judge(arrived, now, Verdict.ARRIVED)
        self._judge(judged.late, now, Verdict.LATE)
        self._judge(judged.unseen, now, Verdict.UNSEEN)
        self._number[gone], self._since[gone] = self._counts[gone], np.nan
        if moved.any():
            self._next(walk, pose, moved)
        self._present, self._first = int(np.count_nonzero(~np.isnan(self._since))), np.fmin.reduce(self._since)
        return judged

    def _away(self, walk: Walk) -> tuple[Array, Array]:
        """Poses, and distance of the target, m, shape (robots,), NaN without it or a walk; the least is kept."""
        pose = walk.pose()
        away: Array = np.hypot(*(self._aims - pose[:, :2]).T)
        np.fmin(self._least, away, out=self._least)
        return pose, away

    def restart(self, which: NDArray[np.bool_], courses: Sequence[Course], missed: NDArray[np.bool_] | None) -> None:
        """Restart with robots that were restarted, by a mask of shape (robots,), each with a course, no longer than the
        longest at the start, and with the misses of its scanner."""
        for robot, course in zip(np.flatnonzero(which).tolist(), courses, strict=True):
            self._courses[robot], self._counts[robot] = course, len(course.goals)
        if self._missed is not None and missed is not None:
            self._missed[which] = missed
        self._number[which], self._verdicts[which], self._seen_once[which] = -1, "", False
        of_goals = self._places, self._seen_from, self._begin, self._end, self._nearest
        for each in (*of_goals, self._aims, self._since, self._least):
            each[which] = np.nan
        self._present = -1

    @property
    def aims(self) -> Array:
        """Positions of the present targets, m, shape (robots, 2); NaN for robots without one."""
        return self._aims.copy()

    def time_left(self, now: float) -> Array:
        """Time to the end of the last patience if no target is reached, s, shape (robots,); 0 for finished robots."""
        begin = np.where(np.isnan(self._since), now, self._since)
        until = begin + self._common.patience * (self._counts - np.maximum(self._number, 0))
        return np.where(self.busy, until - now, 0.0)

    @property
    def busy(self) -> NDArray[np.bool_]:
        """Mask of the robots that still have a target, shape (robots,)."""
        return self._number < self._counts

    def through(self, index: int | NDArray[np.intp], seen: Observation) -> Observation:
        """Observation as a scanner sees it at the event of that number, one for all robots or one each."""
        hidden = np.abs(seen.bearing) > 0.5 * self._common.view
        hidden |= seen.distance > self._common.range
        if self._missed is not None:
            hidden |= self._missed[np.arange(len(hidden)), index]
        bearing, distance = (np.where(hidden, np.nan, each) for each in (seen.bearing, seen.distance))
        self._seen_once |= np.isfinite(bearing)
        found = replace(seen, bearing=bearing, distance=distance)
        if self._keep:  # the observation is the controller's to keep
            self._log.append([getattr(found, name).copy() for name in _KEPT])
        return found

    def add_to(self, data: xr.Dataset, walk: Walk) -> None:
        """Add the outcomes of all targets and the observations of the controller to the record of a finished walk."""
        busy, (_, away) = self.busy, self._away(walk)  # the last look, as the walk ends between two
        stopped = busy & np.array([each is not Status.WALKED for each in walk.status])
        self._judge(stopped, walk.time, Verdict.STOPPED)
        arrived = busy & ~stopped & (away < ARRIVAL_RADIUS)
        self._judge(arrived, walk.time, Verdict.ARRIVED)
        busy &= ~arrived
        self._judge(busy & ~stopped & self._seen_once, walk.time, Verdict.LATE)
        self._judge(busy & ~stopped & ~self._seen_once, walk.time, Verdict.UNSEEN)
        over = ("robot", "goal")
        found: dict[str, Any] = {"goal_place": ((*over, "axis"), self._places, {"units": "m"})}
        for name, values, unit in (
            ("begin", self._begin, "s"),
            ("end", self._end, "s"),
            ("shortest", shortest_path(self._seen_from, self._common.tightest), "m"),
            ("nearest", self._nearest, "m"),
        ):
            found[f"goal_{name}"] = (over, values, {"units": unit})
        found["goal_verdict"] = (over, self._verdicts)
        for (name, (dims, unit)), shown in zip(_KEPT.items(), zip(*self._log, strict=True), strict=False):
            found[f"seen_{name}"] = (("event", "robot", *dims), np.array(shown), {"units": unit})
        data.coords["goal"] = np.arange(1, self._places.shape[1] + 1)
        data.update(found)
        if "target" in data and "time" not in data.target.dims:  # as among robots whose targets moved
            data["target"] = data.target.expand_dims(time=data.sizes["time"])

    def _judge(self, which: NDArray[np.bool_], now: float, verdict: Verdict) -> None:
        if not which.any():
            return
        robots = np.flatnonzero(which)
        present = robots, self._number[robots]
        self._end[present], self._nearest[present], self._verdicts[present] = now, self._least[robots], verdict.label
        if verdict is Verdict.STOPPED:
            for robot in robots.tolist():
                self._verdicts[robot, self._number[robot] + 1 : self._counts[robot]] = verdict.label

    def _next(self, walk: Walk, pose: Array, which: NDArray[np.bool_]) -> None:
        """Set the next target that can be reached."""
        now, most = walk.time, self._common.patience * self._speed
        self._aims[which], self._since[which], self._least[which] = np.nan, np.nan, np.nan
        for robot in np.flatnonzero(which).tolist():
            for number in range(self._number[robot] + 1, len(self._courses[robot].goals)):
                place = self._courses[robot].goals[number].place(pose[robot])
                bearing, away = bearing_and_distance(pose[robot, :2], pose[robot, 2], place)
                self._seen_from[robot, number] = away * np.cos(bearing), away * np.sin(bearing)
                self._number[robot], self._places[robot, number], self._begin[robot, number] = number, place, now
                if away - ARRIVAL_RADIUS <= most:
                    self._aims[robot], self._since[robot], self._least[robot] = place, now, away
                    break
                self._end[robot, number], self._verdicts[robot, number] = now, Verdict.TOO_FAR.label
            else:
                self._number[robot] = len(self._courses[robot].goals)
        self._seen_once &= ~which
        walk.aim(self._aims)


_KEPT = {
    "bearing": ((), "rad"),
    "distance": ((), "m"),
    "joint_angles": (("joint",), "rad"),
    "leg_yaw": (("side",), "rad"),
    "stiffness": (("joint",), "N*m/rad"),
}
"""Variables observed by a controller, their dimensions besides event and robot, and their units."""


def decisions(record: xr.Dataset, controller: Controller, gait: Gait) -> list[Command]:
    """Commands of a controller for the observations in the record of a course."""
    shown = {name: record[f"seen_{name}"].transpose("event", "robot", ...).values for name in _KEPT}
    until = float(record.event[-1]) + gait.period
    events = zip(event_times(controller, gait, until), range(record.sizes["event"]), strict=False)
    return [
        controller.act(event, Observation(time, **{name: values[index].copy() for name, values in shown.items()}))
        for (time, event), index in events
    ]
