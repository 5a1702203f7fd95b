"""What a batch of robots is told to do, and what its actuators make of it: limits, ramps, lag, and a log of it all.

One object serves one walk of any engine. It knows the stiffness of every spring at every moment in closed form, so that
an engine can integrate the ramp itself: a commanded stiffness is first held within the range of its actuator, then
approached at constant rate u(t), no faster than the actuator's rate, and followed by the spring with the actuator's lag
tau, tau k' = u - k::

    k = u0 + r (s - tau) + (k0 - u0 + r tau) e^(-s/tau)      while u ramps at rate r, s after the command
    k = u1 + (k1 - u1) e^(-s/tau)                            s after it has got there
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.engine.contract import Command
from chilopod.errors import ParameterError
from chilopod.robot import Robot

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

SINCE, FROM, SLOPE, UNTIL, GOAL, RAMPING, SETTLING = range(7)
"""Rows of :attr:`Actuators.profile`: when the command came (s), where the ramp began (N*m/rad), its slope (N*m/rad/s),
when it ends (s) and where; and what is left of the lag at its beginning and at its end (N*m/rad)."""

_MOST_YAW = 0.5 * np.pi
_SAME_INSTANT = 1e-9  # s
_SAME = 1e-9  # relative: a spring that is told the stiffness it has


class Ramps:
    """Values that move to where they are told at constant rate; what has begun goes on when the next command comes.

    Parameters
    ----------
    start
        Values before any command, any shape.
    """

    def __init__(self, start: Array) -> None:
        self.goal: Array = start
        self._reached: Array = start
        self._moving: list[tuple[float, float, Array]] = []

    def to(self, goal: Array, now: float, within: float) -> None:
        """Move to ``goal``, in a time of any unit."""
        self._moving.append((now, within, goal - self.goal))
        self.goal = goal

    def at(self, times: ArrayLike) -> Array:
        """Values at times since the last command, shape (times, ...); what was before the first is forgotten."""
        when = np.asarray(times, dtype=np.float64)
        while self._moving and self._moving[0][0] + self._moving[0][1] <= when[0]:
            self._reached = self._reached + self._moving.pop(0)[2]
        values = np.repeat(self._reached[None], len(when), axis=0)
        for start, length, change in self._moving:
            done: Array = (when - start) / length if length > 0.0 else (when >= start).astype(np.float64)
            values += np.clip(done, 0.0, 1.0)[(...,) + (None,) * change.ndim] * change
        return values

    def state(self) -> dict[str, Array]:
        """All there is to it, for :meth:`restore`."""
        times = np.array([each[:2] for each in self._moving]).reshape(-1, 2)
        changes = np.array([each[2] for each in self._moving]).reshape(-1, *self.goal.shape)
        return {"goal": self.goal, "reached": self._reached, "times": times, "changes": changes}

    def restore(self, state: dict[str, Array]) -> None:
        """Become as another was."""
        self.goal, self._reached = state["goal"], state["reached"]
        self._moving = [
            (float(a), float(b), each) for (a, b), each in zip(state["times"], state["changes"], strict=True)
        ]


class Actuators:
    """Springs, leg yaw and torques of a batch of robots under commands.

    Parameters
    ----------
    robots
        One a walk.
    keep
        Whether to keep what was commanded, for :meth:`add_to`.

    Attributes
    ----------
    leg_yaw
        Last commanded, rad, shape (robots, 2).
    joint_torque
        Commanded, N*m, shape (robots, N-1).
    profile
        Stiffness over time since the last command: the rows named above, shape (7, robots, N-1).
    lag
        Of the springs' actuators, s, shape (robots, N-1).
    driven
        Whether a robot's springs or torques were ever commanded, shape (robots,).
    """

    def __init__(self, robots: Sequence[Robot], keep: bool = True) -> None:
        springs = [each.springs for each in robots]
        first = np.array([each.stiffness for each in springs])
        joints = first.shape[1]

        def limits(values: Sequence[tuple[float, ...] | None], absent: float) -> Array:
            return np.array([(absent,) * joints if each is None else each for each in values], dtype=np.float64)

        self._adjustable = limits([each.adjustable for each in springs], 0.0) > 0.0
        self._softest = limits([each.softest for each in springs], 0.0)
        self._stiffest = limits([each.stiffest for each in springs], np.inf)
        self._fastest = limits([each.rate for each in springs], np.inf)
        self.lag = limits([each.lag for each in springs], 0.0)
        self.leg_yaw = np.zeros((len(robots), 2))
        self.joint_torque = np.zeros_like(first)
        self.driven = np.zeros(len(robots), dtype=np.bool_)
        self.profile = np.zeros((7, *first.shape))
        self.profile[FROM] = self.profile[GOAL] = self._start = first
        self._keep = keep
        self._log: list[dict[str, Any]] = []
        self._profiles: list[tuple[float, Array]] = []

    @property
    def adjustable(self) -> bool:
        """Whether any spring of any robot is."""
        return bool(self._adjustable.any())

    def command(self, time: float, command: Command, walking: NDArray[np.bool_]) -> None:
        """Obey, from now on; robots that no longer walk do not.

        Parameters
        ----------
        time
            s, not before that of the last command.
        command
            What is wanted.
        walking
            Shape (robots,).

        Raises
        ------
        ParameterError
            If it is no command for these robots; nothing has changed then.
        """
        if not isinstance(command, Command):
            raise ParameterError("is no chilopod.engine.Command", field="command", value=type(command).__name__)
        if not 0.0 <= command.within < np.inf:
            raise ParameterError("is no time", field="command.within", value=command.within, allowed="0 s or more")
        yaw = self._rows("leg_yaw", command.leg_yaw, 2, walking)
        stiffness = self._rows("stiffness", command.stiffness, self.lag.shape[1], walking)
        torque = self._rows("joint_torque", command.joint_torque, self.lag.shape[1], walking)
        if yaw is not None and (np.abs(yaw[walking]) > _MOST_YAW).any():
            worst = float(np.abs(yaw[walking]).max())
            raise ParameterError("is too far", field="command.leg_yaw", value=worst, allowed="up to a right angle, rad")
        if stiffness is not None:
            self._check(stiffness, walking)
            self._soften(time, stiffness, walking, command.within)
        if yaw is not None:
            self.leg_yaw = np.where(walking[:, None], yaw, self.leg_yaw)
        if torque is not None:
            self.driven |= walking & (torque != 0.0).any(axis=1)
            self.joint_torque = np.where(walking[:, None], torque, self.joint_torque)
        if self._keep:
            wanted = np.full(self.lag.shape, np.nan) if stiffness is None else stiffness
            when: dict[str, Any] = {"event": time, "within": command.within}
            what = {"command": self.leg_yaw, "command_stiffness": wanted, "command_torque": self.joint_torque}
            self._log.append(when | what)

    def stiffness(self, time: float) -> Array:
        """Of every spring at a time from the last command on, N*m/rad, shape (robots, N-1)."""
        return _stiffness(self.profile, self.lag, time) if self.driven.any() else self._start.copy()

    def mean_stiffness(self, times: Array) -> Array:
        """Of every spring between each of some times and the next, N*m/rad, shape (times - 1, robots, N-1)."""
        edges = times.reshape(-1, 1, 1)
        return np.diff(_integral(self.profile, self.lag, edges), axis=0) / np.diff(edges, axis=0)

    def stiffness_rate(self, time: float) -> Array:
        """How fast every spring stiffens at a time from the last command on, N*m/rad/s, shape (robots, N-1)."""
        return _rate(self.profile, self.lag, time)

    def add_to(self, data: xr.Dataset) -> None:
        """Add to a record what was commanded, and the springs: over time if any of them can be adjusted.

        Parameters
        ----------
        data
            From :func:`chilopod.record.walk_record`, with ``time``; changed in place.
        """
        over = ("robot", "joint")
        if not self.adjustable:
            data["stiffness"] = (over, self._start, {"units": "N*m/rad"})
        else:
            data["stiffness"] = (("time", *over), self._stiffness_over(data.time.values), {"units": "N*m/rad"})
        if not self._log:
            return
        data.coords["event"] = ("event", np.array([each["event"] for each in self._log]), {"units": "s"})
        data["within"] = ("event", np.array([each["within"] for each in self._log]))
        data["command"] = (("event", "robot", "side"), self._logged("command"), {"units": "rad"})
        if self.adjustable:
            data["command_stiffness"] = (("event", *over), self._logged("command_stiffness"), {"units": "N*m/rad"})
        torques = self._logged("command_torque")
        if torques.any():
            data["command_torque"] = (("event", *over), torques, {"units": "N*m"})

    def leg_yaw_over(self, times: Array) -> Array:
        """Leg yaw as commanded at any times of the walk, rad, shape (times, robots, 2): ramps from command to
        command."""
        if not self._log:
            return np.zeros((len(times), *self.leg_yaw.shape))
        starts, within, commands = (self._logged(name) for name in ("event", "within", "command"))
        changes = np.diff(commands, axis=0, prepend=np.zeros((1, *self.leg_yaw.shape)))
        # By the time of a sample, the ramps of so many commands are over, and the next few are under way.
        over = np.searchsorted(np.maximum.accumulate(starts + within), times - _SAME_INSTANT, side="right")
        begun = np.searchsorted(starts, times, side="right")
        yaw = np.concatenate([np.zeros((1, *self.leg_yaw.shape)), np.cumsum(changes, axis=0)])[over]
        for ahead in range(int((begun - over).max(initial=0))):
            here = np.flatnonzero(over + ahead < begun)
            event = over[here] + ahead
            since, length = times[here] - starts[event], within[event]
            part = np.clip(np.divide(since, length, out=np.ones(len(here)), where=length > 0.0), 0.0, 1.0)
            yaw[here] += part[:, None, None] * changes[event]
        return yaw

    def state(self) -> dict[str, Array]:
        """All there is to it, for :meth:`restore`."""
        logged = {f"log_{name}": self._logged(name) for name in (self._log[0] if self._log else ())}
        history = {
            "profile_times": np.array([time for time, _ in self._profiles]),
            "profiles": np.array([each for _, each in self._profiles]).reshape(-1, *self.profile.shape),
        }
        now = {name: getattr(self, name) for name in ("leg_yaw", "joint_torque", "driven", "profile")}
        return {**now, **history, **logged}

    def restore(self, state: dict[str, Any]) -> None:
        """Become as another was, of the same robots."""
        for name in ("leg_yaw", "joint_torque", "driven", "profile"):
            setattr(self, name, state[name])
        self._profiles = list(zip(state["profile_times"].tolist(), state["profiles"], strict=True))
        logged = {name.removeprefix("log_"): values for name, values in state.items() if name.startswith("log_")}
        count = len(next(iter(logged.values()), ()))
        self._log = [{name: values[i] for name, values in logged.items()} for i in range(count)]

    # -- inside
    # ---------------------------------------------------------------------------------------------------------------

    def _rows(self, name: str, value: ArrayLike | None, columns: int, walking: NDArray[np.bool_]) -> Array | None:
        if value is None:
            return None
        try:
            array = np.asarray(value, dtype=np.float64)
            rows = np.array(np.broadcast_to(array, (len(walking), columns)))
        except (TypeError, ValueError):
            shape = getattr(value, "shape", None)
            raise ParameterError(
                "has the wrong shape" if shape is not None else "is no array of numbers",
                field=f"command.{name}",
                value=value if shape is None else shape,
                allowed=f"({len(walking)}, {columns})",
            ) from None
        if not np.isfinite(rows[walking]).all():
            raise ParameterError("must be finite", field=f"command.{name}", allowed="numbers for all that still walk")
        return rows

    def _check(self, stiffness: Array, walking: NDArray[np.bool_]) -> None:
        if not (stiffness[walking] > 0.0).all():
            value = float(stiffness[walking].min())
            raise ParameterError("must be positive", field="command.stiffness", value=value, allowed="N*m/rad")
        present = self.profile[GOAL]
        changed = np.abs(stiffness - present) > _SAME * present
        wrong = np.argwhere(changed & ~self._adjustable & walking[:, None])
        if len(wrong):
            robot, joint = (int(each) for each in wrong[0])
            raise ParameterError(
                f"the spring of joint {joint + 1} is not adjustable",
                field="command.stiffness",
                value=f"{stiffness[robot, joint]:g} N*m/rad",
                allowed=f"the {present[robot, joint]:.6g} N*m/rad it has, or springs.adjustable in the robot file",
            )

    def _soften(self, time: float, stiffness: Array, walking: NDArray[np.bool_], within: float) -> None:
        wanted = np.clip(stiffness, self._softest, self._stiffest)
        changed = self._adjustable & walking[:, None] & (wanted != self.profile[GOAL])
        if not changed.any():
            return
        now, reference = self.stiffness(time), _reference(self.profile, time)
        goal = np.where(changed, wanted, reference)
        length = np.maximum(within, np.abs(goal - reference) / self._fastest)
        slope = np.divide(goal - reference, length, out=np.zeros_like(goal), where=length > 0.0)
        begun = np.empty_like(self.profile)
        begun[SINCE], begun[FROM], begun[SLOPE], begun[UNTIL], begun[GOAL] = time, reference, slope, time + length, goal
        begun[RAMPING] = now - reference + slope * self.lag
        at_end = goal - slope * self.lag + begun[RAMPING] * _decay(length, self.lag)
        begun[SETTLING] = np.where(length > 0.0, at_end, now) - goal
        self.profile = np.where(changed, begun, self.profile)
        self.driven = self.driven | changed.any(axis=1)
        if self._keep:
            self._profiles.append((time, self.profile))

    def _logged(self, name: str) -> Array:
        return np.array([each[name] for each in self._log])

    def _stiffness_over(self, times: Array) -> Array:
        values = np.repeat(self._start[None], len(times), axis=0)
        starts = [start for start, _ in self._profiles]
        for (start, profile), end in zip(self._profiles, [*starts[1:], np.inf], strict=False):
            # A sample at the very moment of a command is from before it.
            here = (times > start) & (times <= end)
            values[here] = _stiffness(profile, self.lag, times[here, None, None])
        return values


def _decay(time: Any, lag: Array) -> Array:
    """e^(-t/lag), which is 0 without a lag."""
    with np.errstate(divide="ignore", invalid="ignore"):
        decay: Array = np.exp(-np.where(lag > 0.0, time / lag, np.inf))
    return decay


def _reference(profile: Array, time: Any) -> Array:
    """Where the ramp is."""
    ramp = profile[FROM] + profile[SLOPE] * (time - profile[SINCE])
    return np.where(time < profile[UNTIL], ramp, profile[GOAL])


def _stiffness(profile: Array, lag: Array, time: Any) -> Array:
    ramping = time < profile[UNTIL]
    since = np.where(ramping, time - profile[SINCE], time - profile[UNTIL])
    behind = np.where(ramping, profile[RAMPING], profile[SETTLING]) * _decay(since, lag)
    return _reference(profile, time) - np.where(ramping, profile[SLOPE] * lag, 0.0) + behind


def _rate(profile: Array, lag: Array, time: Any) -> Array:
    ramping = time < profile[UNTIL]
    since = np.where(ramping, time - profile[SINCE], time - profile[UNTIL])
    behind = np.where(ramping, profile[RAMPING], profile[SETTLING]) * _decay(since, lag)
    slowing = np.divide(behind, lag, out=np.zeros_like(behind), where=np.broadcast_to(lag > 0.0, behind.shape))
    return np.where(ramping, profile[SLOPE], 0.0) - slowing


def _integral(profile: Array, lag: Array, time: Any) -> Array:
    """Of the stiffness over time, from the command on."""
    ramped = np.clip(time, profile[SINCE], profile[UNTIL]) - profile[SINCE]
    held = np.maximum(time - profile[UNTIL], 0.0)
    ramp = (profile[FROM] - profile[SLOPE] * lag + 0.5 * profile[SLOPE] * ramped) * ramped
    behind = profile[RAMPING] * (1.0 - _decay(ramped, lag)) + profile[SETTLING] * (1.0 - _decay(held, lag))
    return ramp + profile[GOAL] * held + lag * behind
