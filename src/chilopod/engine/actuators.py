"""Actuators of a batch of robots under commands: limits, ramps, lag, and a log of the setpoints.

One object serves one walk of any engine. It knows the stiffness of every spring at every moment in closed form, so that
an engine can integrate the ramp itself: a commanded stiffness is first held within the range of its actuator, then
approached at constant rate u(t), no faster than the actuator's rate, and followed by the spring with the actuator's lag
tau, tau k' = u - k::

    k = u0 + r (s - tau) + (k0 - u0 + r tau) e^(-s/tau)      while u ramps at rate r, s after the command
    k = u1 + (k1 - u1) e^(-s/tau)                            s after it has got there
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.engine.arguments import as_array, as_number, beyond, require
from chilopod.engine.contract import Command
from chilopod.engine.saved import part
from chilopod.errors import ParameterError
from chilopod.frozen import Array
from chilopod.record import LARGEST, LONGEST, quantity
from chilopod.robot import Robot

SINCE, FROM, SLOPE, UNTIL, GOAL, RAMPING, SETTLING = range(7)
"""Rows of :attr:`Actuators.profile`: time of the command (s), start of the ramp (N*m/rad), its slope (N*m/rad/s), its
end in time (s) and in stiffness (N*m/rad); and the remaining lag at its start and at its end (N*m/rad)."""

_MOST_YAW = 0.5 * np.pi
_SAME_INSTANT = 1e-9  # s
_SAME = 1e-9  # relative tolerance of the stiffness commanded to a spring that is not adjustable


class Ramps:
    """Values of any shape that move from a start to their setpoints at constant rates, independently; with ``keep`` the
    setpoints are logged, for :meth:`over`.

    A repeated setpoint does not restart the ramp of a value, which then arrives no later than the new command demands.
    """

    def __init__(self, start: Array, keep: bool = False) -> None:
        begun = np.array(start, dtype=np.float64)
        # Start and end of each ramp, and their times; never written into, only replaced.
        self._ramps = np.stack([begun, begun, 0.0 * begun, 0.0 * begun])
        self._history: list[tuple[float, Array]] | None = [(0.0, self._ramps)] if keep else None

    @property
    def goal(self) -> Array:
        """Setpoint of the last command."""
        return self._ramps[1]

    def to(self, goal: Array, now: float, within: ArrayLike) -> None:
        """Move to ``goal`` (NaN: unchanged), from a time on and within a duration, both in any unit."""
        until = np.add(now, within)
        changed = ~np.isnan(goal) & ((goal != self.goal) | (until < self._ramps[3]))
        if changed.any():
            begun = np.broadcast_arrays(_at(self._ramps, now), goal, now, until)
            self._ramps = np.where(changed, begun, self._ramps)
            if self._history is not None:
                self._history.append((now, self._ramps))

    def at(self, times: Array) -> Array:
        """Values at times (T,) since the last command, shape (T, ...)."""
        return _at(self._ramps, times.reshape(-1, *[1] * self.goal.ndim))

    def restart(self, which: NDArray[np.bool_]) -> None:
        """Set some values to 0 from now on, in place of their setpoints; only without a log (``keep``)."""
        ramps = self._ramps.copy()
        ramps[:, which] = 0.0
        self._ramps = ramps

    def over(self, times: Array) -> Array:
        """Values at any rising times (T,), shape (T, ...); at the time of a command, the values before it."""
        history = self._history or [(0.0, self._ramps)]
        values = np.empty((len(times), *self.goal.shape))
        ends = np.searchsorted(times, [when for when, _ in history[1:]] + [np.inf], side="right")
        first = 0
        for (_, ramps), last in zip(history, ends, strict=True):
            if last > first:
                values[first:last] = _at(ramps, times[first:last].reshape(-1, *[1] * self.goal.ndim))
                first = last
        return values

    def state(self) -> dict[str, Array]:
        """Complete state, for :meth:`restore`."""
        if self._history is None:
            return {"now": self._ramps}
        history = np.array([each for _, each in self._history])
        return {"now": self._ramps, "times": np.array([when for when, _ in self._history]), "history": history}

    def restore(self, state: dict[str, Array]) -> None:
        """Take over the state of other ramps."""
        self._ramps = state["now"]
        if self._history is not None:
            self._history = list(zip(state["times"].tolist(), state["history"], strict=True))


class Actuators:
    """Springs, leg yaw and torques of a batch of robots under commands; with ``keep`` the setpoints are logged, for
    :meth:`recorded`.

    ``joint_torque`` is the commanded one, N*m, shape (robots, N-1); ``profile`` the stiffness over time since the last
    command, the rows named above, shape (7, robots, N-1); ``lag`` that of the springs' actuators, s, shape (robots,
    N-1); and ``driven``, shape (robots,), is True if a robot's springs or torques were ever commanded.
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
        self.lag[self.lag < _SAME_INSTANT] = 0.0
        self._leg_yaw = Ramps(np.zeros((len(robots), 2)), keep)
        self.joint_torque = np.zeros_like(first)
        self.driven = np.zeros(len(robots), dtype=np.bool_)
        self.profile = np.zeros((7, *first.shape))
        self.profile[FROM] = self.profile[GOAL] = self._start = first
        self._keep = keep
        self._log: list[dict[str, Any]] = []
        self._profiles: list[tuple[float, Array]] = []

    @property
    def leg_yaw(self) -> Array:
        """Leg yaw that was last commanded, rad, shape (robots, 2)."""
        return self._leg_yaw.goal

    @property
    def adjustable(self) -> bool:
        """True if any spring of any robot is adjustable."""
        return bool(self._adjustable.any())

    def command(self, time: float, command: Command, walking: NDArray[np.bool_], swing: ArrayLike = np.inf) -> None:
        """Follow a command from a time on, s, not before the last one, with the robots that still walk, mask of shape
        (robots,); an invalid command raises ParameterError and changes nothing. Legs arrive within the rest of their
        ``swing``, s, shape (2,), zero of legs that stand."""
        known = isinstance(command, Command)
        require(known, "must be a chilopod.engine.Command", "command", type(command).__name__)
        within = as_number("command.within", command.within)
        allowed = f"0 to {LONGEST:g} s"
        require(0.0 <= within <= LONGEST, "must be a duration in s", "command.within", within, allowed)
        within = within if within >= _SAME_INSTANT else 0.0
        yaw = self._rows("leg_yaw", command.leg_yaw, 2, walking)
        stiffness = self._rows("stiffness", command.stiffness, self.lag.shape[1], walking)
        torque = self._rows("joint_torque", command.joint_torque, self.lag.shape[1], walking)
        if yaw is not None:
            worst, allowed = float(np.abs(yaw[walking]).max(initial=0.0)), "-pi/2 to pi/2 rad"
            require(worst <= _MOST_YAW, "must be at most a right angle", "command.leg_yaw", worst, allowed)
        if stiffness is not None:
            self._check(stiffness, walking)
            self._soften(time, stiffness, walking, within)
        if yaw is not None:
            ramp = np.where(within > np.add(swing, _SAME_INSTANT), swing, within)
            self._leg_yaw.to(np.where(walking[:, None], yaw, np.nan), time, ramp)
        if torque is not None:
            self.driven |= walking & (torque != 0.0).any(axis=1)
            self.joint_torque = np.where(walking[:, None], torque, self.joint_torque)
        if self._keep:
            wanted = np.full(self.lag.shape, np.nan) if stiffness is None else stiffness
            what = {"command": self.leg_yaw, "command_stiffness": wanted, "command_torque": self.joint_torque}
            self._log.append({"event": time, "within": within, **what})

    def restart(self, which: NDArray[np.bool_]) -> None:
        """Reset some robots, shape (robots,), to the start; only without a log of setpoints."""
        profile, driven = self.profile.copy(), self.driven & ~which
        profile[:, which] = 0.0
        profile[FROM, which] = profile[GOAL, which] = self._start[which]
        self.profile, self.driven = profile, driven
        self.joint_torque = np.where(which[:, None], 0.0, self.joint_torque)
        self._leg_yaw.restart(which)

    def stiffness(self, time: float) -> Array:
        """Stiffness of every spring at a time from the last command on, N*m/rad, shape (robots, N-1)."""
        return _stiffness(self.profile, self.lag, time) if self.driven.any() else self._start.copy()

    def mean_stiffness(self, times: Array) -> Array:
        """Mean stiffness of every spring from each time to the next, N*m/rad, shape (times - 1, robots, N-1)."""
        edges = times.reshape(-1, 1, 1)
        return np.diff(_integral(self.profile, self.lag, edges), axis=0) / np.diff(edges, axis=0)

    def stiffness_rate(self, time: float) -> Array:
        """Rate of the stiffness of every spring at a time after the last command, N*m/rad/s, shape (robots, N-1)."""
        return _rate(self.profile, self.lag, time)

    def recorded(self, times: Array) -> dict[str, Any]:
        """Setpoints and springs as variables of a record of these times; springs over time if any is adjustable."""
        found = {name: self._logged(name) for name in (self._log[0] if self._log else ())}
        if not self.adjustable:
            found.pop("command_stiffness", None)
        found["stiffness"] = self._stiffness_over(times) if self.adjustable else self._start.copy()
        return {name: quantity(name, values) for name, values in found.items()}

    def leg_yaw_over(self, times: Array) -> Array:
        """Leg yaw on its ramps at any rising times of the walk, rad, shape (times, robots, 2)."""
        return self._leg_yaw.over(times)

    def leg_yaw_commanded(self, times: Array) -> Array:
        """Setpoint of leg yaw at any rising times of the walk, rad, shape (times, robots, 2)."""
        setpoints = np.array([np.zeros_like(self.leg_yaw), *(each["command"] for each in self._log)])
        return setpoints[np.searchsorted(self._logged("event"), times, side="left")]

    def state(self) -> dict[str, Array]:
        """Complete state, for :meth:`restore`."""
        logged = {f"log_{name}": self._logged(name) for name in (self._log[0] if self._log else ())}
        history = {
            "profile_times": np.array([time for time, _ in self._profiles]),
            "profiles": np.array([each for _, each in self._profiles]).reshape(-1, *self.profile.shape),
        }
        now = {"joint_torque": self.joint_torque, "driven": self.driven, "profile": self.profile}
        yaw = {f"yaw_{name}": values for name, values in self._leg_yaw.state().items()}
        return {**now, **yaw, **history, **logged}

    def restore(self, state: dict[str, Any]) -> None:
        """Take over the state of actuators of the same robots."""
        self.joint_torque, self.driven, self.profile = state["joint_torque"], state["driven"], state["profile"]
        self._leg_yaw.restore(part(state, "yaw_"))
        self._profiles = list(zip(state["profile_times"].tolist(), state["profiles"], strict=True))
        logged = part(state, "log_")
        count = len(next(iter(logged.values()), ()))
        self._log = [{name: values[i] for name, values in logged.items()} for i in range(count)]

    # -- inside

    def _rows(self, name: str, value: ArrayLike | None, columns: int, walking: NDArray[np.bool_]) -> Array | None:
        if value is None:
            return None
        array, shape = as_array(f"command.{name}", value), (len(walking), columns)
        fits = array.shape in (shape, (1, columns), (columns,))
        require(fits, f"has the wrong shape {array.shape}", f"command.{name}", allowed=str(shape))
        rows = np.array(np.broadcast_to(array, shape))
        small, allowed = np.abs(rows[walking]) <= LARGEST, f"numbers up to {LARGEST:g} for every robot that still walks"
        require(small.all(), beyond(rows[walking]), f"command.{name}", allowed=allowed)
        return rows

    def _check(self, stiffness: Array, walking: NDArray[np.bool_]) -> None:
        least = float(stiffness[walking].min(initial=np.inf))
        require(least > 0.0, "must be positive", "command.stiffness", least, "N*m/rad")
        present = self.profile[GOAL]
        wrong = (np.abs(stiffness - present) > _SAME * present) & ~self._adjustable & walking[:, None]
        if wrong.any():
            robot, joint = np.argwhere(wrong)[0].tolist()
            problem = f"the spring of joint {joint + 1} is not adjustable"
            given = f"{stiffness[robot, joint]:g} N*m/rad"
            allowed = f"the {present[robot, joint]:.6g} N*m/rad it has, or springs.adjustable in the robot file"
            raise ParameterError(problem, field="command.stiffness", value=given, allowed=allowed)

    def _soften(self, time: float, stiffness: Array, walking: NDArray[np.bool_], within: float) -> None:
        wanted, present = np.clip(stiffness, self._softest, self._stiffest), self.profile[GOAL]
        reference = _reference(self.profile, time)
        length = np.maximum(within, np.abs(wanted - reference) / self._fastest)
        length[length < _SAME_INSTANT] = 0.0
        # A ramp that is given its old goal again goes on, and arrives no later than the new command demands.
        changed = self._adjustable & walking[:, None] & ((wanted != present) | (time + length < self.profile[UNTIL]))
        if not changed.any():
            return
        goal, moves = np.where(changed, wanted, reference), length > 0.0
        slope = np.where(moves, (goal - reference) / np.where(moves, length, 1.0), 0.0)
        begun = np.zeros_like(self.profile)
        begun[SINCE], begun[FROM], begun[SLOPE], begun[UNTIL], begun[GOAL] = time, reference, slope, time + length, goal
        if self.lag.any():
            now = self.stiffness(time)
            begun[RAMPING] = now - reference + slope * self.lag
            # This form is as exact for a lag much longer than the ramp.
            caught_up = slope * self.lag * _decay(length, self.lag, np.expm1)
            begun[SETTLING] = np.where(moves, (now - reference) * _decay(length, self.lag) + caught_up, now - goal)
        self.profile = np.where(changed, begun, self.profile)
        self.driven = self.driven | changed.any(axis=1)
        if self._keep:
            self._profiles.append((time, self.profile))

    def _logged(self, name: str) -> Array:
        return np.array([each[name] for each in self._log])

    def _stiffness_over(self, times: Array) -> Array:
        values = np.repeat(self._start[None], len(times), axis=0)
        # A sample at the time of a command precedes the command.
        edges = np.searchsorted(times, [start for start, _ in self._profiles] + [np.inf], side="right")
        for (_, profile), first, last in zip(self._profiles, edges[:-1], edges[1:], strict=True):
            if last > first:
                values[first:last] = _stiffness(profile, self.lag, times[first:last, None, None])
        return values


def _at(ramps: Array, times: Any) -> Array:
    start, goal, since, until = ramps
    length = until - since
    part = np.minimum(np.maximum((times - since) / np.where(length > 0.0, length, 1.0), 0.0), 1.0)
    return np.where(times >= until, goal, start + part * (goal - start))


def _decay(time: Any, lag: Array, power: Callable[[Array], Array] = np.exp) -> Array:
    """e^(-t/lag), which is 0 without a lag; with :func:`numpy.expm1` less one."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return power(-np.where(lag > 0.0, time / lag, np.inf))


def _reference(profile: Array, time: Any) -> Array:
    """Value of the ramp."""
    ramp = profile[FROM] + profile[SLOPE] * (time - profile[SINCE])
    return np.where(time < profile[UNTIL], ramp, profile[GOAL])


def _behind(profile: Array, lag: Array, time: Any) -> Array:
    """Transient of the stiffness: its distance from the steady response to the ramp."""
    ramping = time < profile[UNTIL]
    since = time - np.where(ramping, profile[SINCE], profile[UNTIL])
    return np.where(ramping, profile[RAMPING], profile[SETTLING]) * _decay(since, lag)


def _stiffness(profile: Array, lag: Array, time: Any) -> Array:
    if not lag.any():
        return _reference(profile, time)
    late = np.where(time < profile[UNTIL], profile[SLOPE] * lag, 0.0)
    return _reference(profile, time) - late + _behind(profile, lag, time)


def _rate(profile: Array, lag: Array, time: Any) -> Array:
    slope, behind = np.where(time < profile[UNTIL], profile[SLOPE], 0.0), _behind(profile, lag, time)
    return slope - np.divide(behind, lag, out=np.zeros_like(behind), where=np.broadcast_to(lag > 0.0, behind.shape))


def _integral(profile: Array, lag: Array, time: Any) -> Array:
    """Integral of the stiffness over time, from the command on."""
    ramped = np.clip(time, profile[SINCE], profile[UNTIL]) - profile[SINCE]
    held = np.maximum(time - profile[UNTIL], 0.0)
    ramp = (profile[FROM] - profile[SLOPE] * lag + 0.5 * profile[SLOPE] * ramped) * ramped
    behind = profile[RAMPING] * (1.0 - _decay(ramped, lag)) + profile[SETTLING] * (1.0 - _decay(held, lag))
    return ramp + profile[GOAL] * held + lag * behind
