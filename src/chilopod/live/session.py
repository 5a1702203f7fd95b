"""Walk of the live page, which goes on while the user changes the robot."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

import numpy as np
import xarray as xr

from chilopod.analysis.parameters import ALL
from chilopod.engine import Command, Controller, Status, Walk, engine_named, steer
from chilopod.engine.arguments import as_number, require
from chilopod.errors import ChilopodError, ParameterError, nearest_name
from chilopod.frozen import Array
from chilopod.live import wishes
from chilopod.live.sliders import Slider, sliders_of
from chilopod.live.state import Seen, Settings, as_finite, as_seed, as_within, but_springs
from chilopod.record import LONGEST, Recording
from chilopod.robot import Robot
from chilopod.steering import (
    ARRIVAL_RADIUS,
    LEG_YAW,
    ON_THE_WAY,
    VARIABLE,
    ActuatedAxis,
    RadiusLaw,
    SpringLaw,
    strategy_named,
)
from chilopod.steering.target import FARTHEST
from chilopod.trials import Disturbance

LOOKS = 6
"""Number of samples in a gait cycle, for means over the cycle."""

SPEED = 2.0  # at first: fast enough to see it bend, slow enough to see it step
_NUDGE = math.radians(0.5)  # standard deviation of what a nudge turns a joint by, held by its spring
_START = Disturbance()  # of joints and heading at the start, as in trials
_STRONGEST = 1.0  # rad by which a pull turns a joint, held by its spring
_RATE = 20.0  # Hz, of what is written down
_LONGEST = 900.0  # s of it in one piece
_MOST_RECORDS = 100  # of a session
_MOST_BYTES = 1 << 29  # of all of them, before they are packed
_MOST_WORDS = 4
_REMEMBERED = 600  # looks, in which an undulation is sought


class Session:
    """One robot that walks, and obeys wishes; for one thread, but :attr:`box` takes wishes from any.

    Without a wish the walk is the same to the bit however it is cut into frames. Once a gait cycle every joint is
    nudged at random, by about half a degree against its spring, as an uneven floor would: a straight walk that nothing
    disturbs stays straight even where it is unstable.

    Springs and pulls change at once (or as fast as the actuators of the robot file allow), the floor and the steps at
    the beginning of the next gait cycle.

    All springs of the robot may be changed here. The engine is one of :data:`chilopod.engine.ENGINES`, or one's own as
    ``package.module:object``; the seed is that of start and nudges, and the strategy the name of one of
    :data:`chilopod.steering.ON_THE_WAY`. Raises ParameterError if the engine cannot walk such a robot, or there is no
    such strategy.

    ``box`` has wishes from any thread, ``settings`` those that were granted, and ``first`` what was set at first.
    ``file`` is the robot as it was given, with springs that can all be changed, and ``sliders`` are its sliders by
    name. ``law`` is the radius law of the springs, which strategies need; None while it is not known.
    """

    def __init__(self, robot: Robot, engine: str = "planar", *, seed: int = 1, strategy: str = VARIABLE.name) -> None:
        self.box, self.engine, self._engine = wishes.Box(), engine, engine_named(engine)
        self.file = robot.override("springs.adjustable", True)
        self._engine.common(self.file)
        strategy = strategy_named(strategy, ON_THE_WAY).name
        self.settings = self.first = Settings(self.file, 1.0, strategy, SPEED, False, as_seed(seed), False)
        self.sliders = sliders_of(self.file)
        self.law: RadiusLaw | None = None
        self._records: list[xr.Dataset] = []
        self._recorded, self._bytes = 0, 0
        self._messages: deque[str] = deque(maxlen=_MOST_WORDS)
        self._begin()

    # -- what there is

    def seen(self) -> Seen:
        """State of the walk now."""
        walk, looked = self._walk, self._walk.observe()
        return Seen(
            self._before + walk.time,
            walk.time,
            walk.robots[0],
            walk.status[0],
            walk.pose()[0],
            looked.joint_angles[0],
            looked.stiffness[0],
            looked.leg_yaw[0],
            np.array(self._looks).mean(axis=0),
            (self._bends[-1] - self._bends[0]) / self._period if len(self._bends) > LOOKS else 0.0,
            self._pull.copy(),
            self._target,
            self._steering,
            walk.states()[0],
            self._undulates(),
            self._turned(),
        )

    def messages(self) -> list[str]:
        """Messages about events since the last call."""
        sentences, self._messages = list(self._messages), deque(maxlen=_MOST_WORDS)
        return sentences

    def records(self) -> list[xr.Dataset]:
        """Records since the last call, see :func:`chilopod.record.walk_record`: one for every floor and gait."""
        records, self._records = self._records, []
        return records

    # -- what is done

    def obey(self) -> bool:
        """Grant all wishes, or say why not; True if there was one."""
        waiting = self.box.take()
        for wish in waiting:
            try:
                self._obey(wish)
            except ChilopodError as error:
                self._messages.append(str(error))
        return bool(waiting)

    def walk_on(self, seconds: float) -> None:
        """Walk on; a robot that has failed stays where it is."""
        until = self._walk.time + as_within("seconds", as_number("seconds", seconds), (0.0, LONGEST), "s")
        while self._walk.status[0] is Status.WALKED:
            time = self._look_next / LOOKS * self._period
            if time > until:
                self._go(until)
                return
            self._go(time)
            self._look()
            self._look_next += 1
            if (self._look_next - 1) % LOOKS == 0 and self._walk.status[0] is Status.WALKED:
                left = until - self._walk.time
                self._between_cycles()
                until = self._walk.time + left

    def stop_recording(self) -> None:
        """End the recording, if there is one."""
        self.settings = replace(self.settings, recording=False)
        self._keep_record()

    # -- inside

    @property
    def _period(self) -> float:
        return self._walk.robots[0].gait.period

    def _begin(self) -> None:
        """Put the robot on the floor anew."""
        robot, joints = self.settings.robot, self.settings.robot.body.modules - 1
        self._random = random = np.random.default_rng(self.settings.seed)
        bends = random.normal(0.0, _START.joint_angle, joints)
        states = self._engine.initial_states(robot, bends, random.normal(0.0, _START.heading))
        self._before, self._reached = 0.0, 0.0
        self._target: tuple[float, float] | None = None
        self._steering = ""
        self._controller: Controller | None = None
        self._nudge, self._pull, self._pulled_until = np.zeros(joints), np.zeros(joints), np.zeros(joints)
        self._start(robot, states)
        self._looks: deque[Array] = deque([self._walk.observe().joint_angles[0]] * LOOKS, maxlen=LOOKS)
        self._bends: deque[float] = deque(maxlen=LOOKS + 1)
        self._left: deque[bool] = deque(maxlen=_REMEMBERED)
        self._headings: deque[float] = deque(maxlen=10 * _REMEMBERED)  # of module 1, not wrapped

    def _undulates(self) -> bool:
        """True if the bend goes from side to side: it has not stayed on this one for longer than the last whole
        undulation took."""
        left = np.array(self._left)
        *_, begin, _, end = (0, 0, 0, *(np.flatnonzero(left[1:] != left[:-1]) + 1))
        return bool(begin > 0 and len(left) - end <= end - begin)

    def _turned(self) -> float:
        """Turn of module 1 while it walked the last length of the axis, in whole gait cycles, rad."""
        robot = self._walk.robots[0]
        axis, step = (robot.body.modules - 1) * robot.module_length, robot.gait.stride / robot.gait.duty
        back = LOOKS * max(1, round(axis / step)) + 1
        return self._headings[-1] - self._headings[-back] if len(self._headings) >= back else math.nan

    def _start(self, robot: Robot, states: Array) -> None:
        if self.settings.recording and (self._recorded >= _MOST_RECORDS or self._bytes >= _MOST_BYTES):
            self.settings = replace(self.settings, recording=False)
            self._messages.append(f"recording has ended: there is room for no more than the {self._recorded} so far")
        self._written = self._has_record = self.settings.recording
        traits = self._engine.traits
        seeds = [self.settings.seed] if traits.noisy else None
        record = Recording(_RATE, poses=traits.poses) if self._has_record else None
        self._walk: Walk = self._engine.start([robot], initial=states, seeds=seeds, record=record)
        self._look_next = 1

    def _go(self, until: float) -> None:
        steer(self._walk, until, self._controller)
        if self._target is not None and np.hypot(*(self._walk.pose()[0, :2] - self._target)) < ARRIVAL_RADIUS:
            took = self._before + self._walk.time - self._reached
            self._messages.append(f"arrived after {took:.0f} s")
            self._let_go()

    def _look(self) -> None:
        angles = self._walk.observe().joint_angles[0]
        over = (self._pull != 0.0) & (self._pulled_until < self._before + self._walk.time)
        if over.any():
            self._pull[over] = 0.0
            self._push()
        if np.isfinite(angles).all():
            self._looks.append(angles)
            mean = np.mean(self._looks, axis=0)
            self._bends.append(float(np.abs(mean).sum()))
            heading, before = float(self._walk.pose()[0, 2]), self._headings[-1] if self._headings else 0.0
            self._headings.append(before + math.remainder(heading - before, math.tau))
            if self._controller is None and not self._pull.any():
                self._left.append(bool(mean.sum() < 0.0))
            else:  # who steers or pulls changes sides too
                self._left.clear()

    def _between_cycles(self) -> None:
        """Changes that are possible between two gait cycles only."""
        if self._written and self._walk.time > _LONGEST:
            self._messages.append(f"the recording ended by itself, after {_LONGEST / 60.0:g} minutes")
            self.stop_recording()
        wanted = self.settings
        as_wanted = but_springs(wanted.robot) == but_springs(self._walk.robots[0])
        if not as_wanted or self._walk.time > 0.5 * LONGEST or {wanted.recording} != {self._written, self._has_record}:
            self._continue(wanted.robot)
        self._nudge = np.array(self.file.springs.stiffness) * self._random.normal(0.0, _NUDGE, len(self._nudge))
        self._push()

    def _continue(self, robot: Robot) -> None:
        """Walk on from here with another floor, other steps, or another record."""
        self._keep_record()
        seen, states = self._walk.observe(), self._walk.states()
        self._before += self._walk.time
        for joint, value in enumerate(seen.stiffness[0].tolist()):
            robot = robot.with_value(f"{ALL}[{joint}]", value)
        self._start(robot, states)
        if self._target is not None:
            self._walk.aim(self._target)
        self._walk.command(Command(leg_yaw=seen.leg_yaw))
        if not isinstance(self._controller, SpringLaw):
            self._set_springs()

    def _keep_record(self) -> None:
        if self._written and self._walk.time > 0.0:
            record = self._walk.to_dataset()
            self._recorded, self._bytes = self._recorded + 1, self._bytes + record.nbytes
            self._records.append(record)
        self._written = False

    def _push(self) -> None:
        # Who drives the joints would take the nudges back at once.
        if not isinstance(self._controller, ActuatedAxis):
            self._walk.command(Command(joint_torque=[self._nudge + self._pull]))

    def _set_springs(self) -> None:
        self._walk.command(Command(stiffness=[self.settings.robot.springs.stiffness]))

    def _let_go(self) -> None:
        """Walk without a target, if there is one, with the springs as set and straight legs."""
        if self._target is None:
            return
        self._target, self._controller, self._steering = None, None, ""
        self._walk.aim((np.nan, np.nan))
        self._walk.command(Command(leg_yaw=[(0.0, 0.0)], within=self._period))
        self._set_springs()
        self._push()

    def _obey(self, wish: wishes.Wish) -> None:
        match wish:
            case wishes.Set():
                self._set(wish)
            case wishes.Target(place, by_hand):
                self._aim(place, by_hand)
            case wishes.Steering(strategy):
                self.settings = replace(self.settings, strategy=strategy_named(strategy, ON_THE_WAY).name)
                if self._steering:
                    self._aim(self._target)
            case wishes.Pull(joint, torque, time):
                self._pull_at(joint, torque, time)
            case wishes.Pause(paused):
                self.settings = replace(self.settings, paused=bool(paused))
            case wishes.Step(cycles):
                seconds = as_within("step", cycles, (0.0, 10.0), "gait cycles") * self._period
                self.settings = replace(self.settings, paused=True)
                self.walk_on(seconds)
            case wishes.Reset(seed):
                self._keep_record()
                self.settings = replace(self.settings, seed=as_seed(seed))
                self._begin()
            case wishes.Record(True):
                self.settings = replace(self.settings, recording=True)
            case wishes.Record():
                self.stop_recording()

    def checked(self, wish: wishes.Set) -> tuple[Slider, float]:
        """Slider of a wish and its value; a ParameterError if there is none, or the value is out of range."""
        slider = self.sliders.get(wish.slider)
        if slider is None:
            near, allowed = nearest_name(wish.slider, self.sliders), ", ".join(self.sliders)
            raise ParameterError("must be a slider", field="slider", value=wish.slider, allowed=allowed, nearest=near)
        return slider, as_within(slider.name, wish.value, slider.limits, slider.si)

    def _set(self, wish: wishes.Set) -> None:
        (slider, number), before = self.checked(wish), self.settings.robot
        settings = slider.apply(self.settings, number)
        self._engine.common(settings.robot)
        self.settings = settings
        if settings.robot.springs == before.springs:
            return
        if isinstance(self._controller, SpringLaw):
            self._messages.append("your springs are back when the target is reached")
        else:
            self._set_springs()

    def _aim(self, place: tuple[float, float] | None, by_hand: bool = False) -> None:
        if place is None:
            self._let_go()
            return
        require(np.shape(place) == (2,), "must be a place on the floor", "target", place, "(x, y), m")
        x, y = (as_finite("target", each) for each in place)
        as_within("target", math.hypot(x, y), (0.0, FARTHEST), "m from where the walk began")
        controller, steering = (None, "") if by_hand else self._steered()
        self._let_go()
        self._target, self._controller, self._steering = (x, y), controller, steering
        self._reached = self._before + self._walk.time
        self._walk.aim(self._target)

    def _steered(self) -> tuple[Controller | None, str]:
        """Controller of the strategy that is set, or of leg yaw where it needs an unknown law, and its name."""
        strategy = ON_THE_WAY[self.settings.strategy]
        if strategy.needs_law and self.law is None:
            self._messages.append(f"the radius law is not known (yet): leg yaw alone steers, not {strategy.name}")
            strategy = LEG_YAW
        return strategy.prepare(self.settings.robot, self.law).controller, strategy.name

    def _pull_at(self, joint: int, torque: float, time: float) -> None:
        own = self.file.springs.stiffness
        known, given = joint in range(len(own)), joint + 1 if type(joint) is int else joint
        require(known, "must be a joint", "joint", given, f"1 to {len(own)}")
        strongest = _STRONGEST * own[joint]
        torque, time = as_finite("pull", torque), time if time == math.inf else as_finite("time", time)
        self._pull[joint] = np.clip(torque, -strongest, strongest)
        self._pulled_until[joint] = self._before + self._walk.time + time
        self._push()
        if isinstance(self._controller, ActuatedAxis):
            self._messages.append("the strategy actuated drives the joints, so they cannot be pulled")
