"""Contract of an engine: it starts walks, which advance step by step, return observations and follow commands.

A controller knows neither the engine nor the robot's position: at instants of the gait it receives an observation of
the robot's sensors and returns a command. Everything comes as arrays with the robots of a batch in front, so one object
steers one robot or ten thousand, a model or a machine.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chilopod.frozen import Array
from chilopod.gait import Gait
from chilopod.labels import Labelled
from chilopod.record import Recording
from chilopod.robot import Robot

if TYPE_CHECKING:
    import xarray as xr


Marks = NDArray[np.bool_]
"""Mask of the robots of a batch, shape (robots,)."""


class Status(Labelled):
    """Status of a walk; each member's ``sentence`` explains it."""

    WALKED = "walked", "walked to the end"
    DIVERGED = "diverged", "the motion became too fast to follow or infinite"
    OUT_OF_RANGE = "out of range", "a yaw joint bent by more than a right angle, where modules run into each other"
    FALLEN = "fallen", "module 1 tipped over"
    HALTED = "halted", "stopped by a command"


@dataclass(frozen=True)
class Event:
    """An instant of every gait cycle at which a controller is called: a name by which the controller recognizes it, its
    phase, the time since the start of the cycle over its period, in [0, 1), and the window, which is the time available
    for the action, s."""

    name: str
    phase: float
    window: float


@dataclass(frozen=True)
class Observation:
    """Observation of the robots of a batch at an instant; the arrays are the controller's to keep.

    Attributes
    ----------
    time
        Time of the observation, s.
    bearing, distance
        Direction of the target relative to the heading of module 1, left positive, rad in [-pi, pi), and its distance
        from the centre of module 1, m; NaN where it is not seen. Shape (robots,).
    joint_angles
        Angles of the yaw joints, heading of the module behind minus heading of the module before (positive: bent to the
        right), rad, shape (robots, N-1); NaN for a robot that no longer walks.
    leg_yaw
        Angles last commanded for the left and right leg of module 1, left positive, rad, shape (robots, 2).
    stiffness
        Stiffness of the springs of the yaw joints at this moment, N*m/rad, shape (robots, N-1).
    """

    time: float
    bearing: Array
    distance: Array
    joint_angles: Array
    leg_yaw: Array
    stiffness: Array


@dataclass(frozen=True, kw_only=True)
class Command:
    """Setpoints of the actuators, one row for all robots or one for each robot; None leaves an actuator as it is.

    :class:`chilopod.engine.Actuators` enforces the limits of the robot's actuators (``[springs]`` of its file).

    Attributes
    ----------
    leg_yaw
        Angles for the left and right leg of module 1, left positive, rad, at most a right angle, shape (robots, 2).
    stiffness
        Stiffness of the springs of the yaw joints, N*m/rad, positive, shape (robots, N-1). A spring that is not
        adjustable must be given the stiffness it has.
    joint_torque
        Torque that drives the yaw joints beside their springs, positive where it turns the rear module to the left,
        N*m, shape (robots, N-1). Held until another torque is commanded.
    within
        Time in which leg yaw and stiffness are to be reached, at constant rate, s; 0 for at once.
    """

    leg_yaw: ArrayLike | None = None
    stiffness: ArrayLike | None = None
    joint_torque: ArrayLike | None = None
    within: float = 0.0


class Controller(Protocol):
    """Steering law, called at its events in order of time.

    For trials it must be a frozen dataclass; class and fields then are part of the trial.
    """

    def events(self, gait: Gait) -> Sequence[Event]:
        """Instants of the cycle at which :meth:`act` is to be called."""

    def act(self, event: Event, seen: Observation) -> Command:
        """Command for the robots, given an observation."""


@runtime_checkable
class Walk(Protocol):
    """Walk of a batch of robots that do not interact.

    The results are equal to the bit for any division into calls of :meth:`advance`, any number of observations, alone
    or in a batch, with any number of threads, and after :meth:`save` and ``resume``. Only commands change a walk, and
    :meth:`halt` ends it; :meth:`restart` begins another in its place.

    A wrong argument raises :class:`chilopod.errors.ParameterError` and leaves the walk unchanged.

    A walk belongs to one thread at a time. Threads may take turns; while one thread runs a method, every method of the
    same walk raises :class:`chilopod.errors.ThreadError` in another thread, and changes nothing. Properties are exempt.
    """

    @property
    def robots(self) -> tuple[Robot, ...]:
        """Robots of the walk, one for each row of the batch."""

    @property
    def time(self) -> float:
        """Present time of the walk, s; the gait is at phase 0 at time 0."""

    @property
    def status(self) -> tuple[Status, ...]:
        """Status of each robot: ``WALKED`` while it walks."""

    def observe(self) -> Observation:
        """Observation of the robots now."""

    def pose(self) -> Array:
        """Poses of the robots now: x and y of the centre of module 1, m, and its heading, rad, up to whole turns.

        Shape (robots, 3); NaN for robots that no longer walk. Referees and displays use them; controllers receive only
        :meth:`observe`.
        """

    def aim(self, target: ArrayLike) -> None:
        """Move the targets of the robots from now on to positions on the floor, m, shape (robots, 2) or (2,); a row of
        NaN removes the target of a robot. The motion of the robots does not change."""

    def halt(self, which: Marks) -> None:
        """Stop some robots finally, by a mask of shape (robots,), with ``HALTED``; those that no longer walk keep their
        status, and the results of the others do not change."""

    def states(self) -> Array:
        """States of the robots now, for ``initial`` of :meth:`chilopod.engine.Engine.start` or :meth:`restart`.

        At the beginning of a gait cycle another walk can start from these states. They contain neither setpoints nor
        the memory of integrator or solver, so the walks agree to their tolerance.

        Shape (robots, n), with n defined by the engine; NaN for robots that no longer walk.
        """

    def restart(
        self, which: Marks, initial: ArrayLike, friction: ArrayLike | None = None, seeds: Sequence[int] | None = None
    ) -> None:
        """Start some robots again, by a mask of shape (robots,), at the beginning of a gait cycle; the results of the
        others do not change.

        Whatever their status, they walk as if freshly started, up to the rounding of times: springs of the file, legs
        straight, no torque. Their targets stay in place. A walk with a record cannot be restarted.

        States and factors of friction are as for :meth:`chilopod.engine.Engine.start`, one row for all of them or one
        each; without factors those of the walk remain. Seeds, one each, are of the noise of their sensors from now on;
        without them the noise continues.
        """

    def command(self, command: Command) -> None:
        """Command the actuators from now on."""

    def advance(self, until: float) -> None:
        """Advance the walk to a time, s. Robots that fail stop with a status; the others go on."""

    def save(self) -> bytes:
        """Complete state of the walk as bytes, the record so far included."""

    def to_dataset(self) -> xr.Dataset:
        """Record so far, NaN for robots from the time at which they stopped.

        Trials keep a record only if it has all of this, and nothing else:

        - samples as many as, and at the times of, :meth:`chilopod.record.Recording.samples`. Only where the robot's
          file has a ``twin.timestep`` a sample may be half of it away, at the step that is nearest;
        - the quantities of :data:`chilopod.record.QUANTITIES` that go with what was asked for, over these dimensions
          and in these units, as float64 (``status`` is text). ``foot_load``, ``command_stiffness``, ``command_torque``
          and what is ``seen`` may be missing; the unit of ``pose`` is the engine's affair;
        - the coordinates of :func:`chilopod.record.walk_record`, ``event`` and ``module``;
        - at time 0 what the robots started with: position, heading, joint angles, stiffness of the file, straight legs;
        - no number beyond :data:`chilopod.record.LARGEST`;
        - the attributes ``engine`` (name of its traits), ``robot`` (file of the first robot) and ``duration``
          (``time``), and others that are numbers or text.
        """


@runtime_checkable
class Foresees(Protocol):
    """A walk that may be computed ahead of its time, in one piece; the results do not change."""

    def foresee(self, until: float) -> None:
        """Compute the walk up to ``until``, s, before which nothing will be commanded; the present time stays.

        To :meth:`Walk.advance` up to there, and :meth:`Walk.pose`, :meth:`Walk.aim` and :meth:`Walk.halt` at samples of
        the record, then cost next to nothing. After anything else before ``until`` the walk is computed once more.
        """


def missing_parts(walk: object) -> list[str]:
    """Names of the attributes of :class:`Walk` that an object lacks."""
    return [name for name in vars(Walk) if not name.startswith("_") and not hasattr(walk, name)]


@dataclass(frozen=True)
class Traits:
    """Properties of an engine that are known before it walks.

    Attributes
    ----------
    name, sentence
        Name of the engine on the command line and in records, and its description.
    exact
        True if its walks are those of the planar theory (:mod:`chilopod.analysis`), so that branches hold for them.
    noisy, poses
        True if its sensors have noise of their own, drawn from ``seeds``; if it can record the positions of all joints.
    threads
        True if walks of several threads run at the same time, because the interpreter's lock is free meanwhile.
    robots_per_core, walks_per_round
        Number of robots that one core should walk at a time, a few seconds of work, and number of walks that a search
        may spend on one round of trials.
    duration_ratio
        Ratio of a task's duration to its duration at the speed of the straight walk without slip.
    version
        Version of the software besides chilopod that determines the records; empty if there is none.
    """

    name: str
    sentence: str
    exact: bool = False
    noisy: bool = False
    poses: bool = False
    threads: bool = False
    robots_per_core: int = 1
    walks_per_round: int = 8
    duration_ratio: float = 2.0
    version: str = ""


class Engine(Protocol):
    """Engine that starts walks: a module such as :mod:`chilopod.planar`, or an object.

    A wrong argument raises :class:`chilopod.errors.ParameterError`.
    """

    @property
    def traits(self) -> Traits:
        """Properties of the engine."""

    def common(self, robot: Robot) -> Hashable:
        """Properties that all robots of one batch must share; ParameterError for a robot that the engine cannot
        walk."""

    def initial_states(
        self, robot: Robot, joint_angles: ArrayLike = 0.0, heading: ArrayLike = 0.0, position: ArrayLike = (0.0, 0.0)
    ) -> Array:
        """States of robots that are about to walk, for ``initial`` of :meth:`start`, shape (robots, n), with n the
        engine's affair.

        Joint angles are in rad, shape (N-1,) or (robots, N-1); the heading of module 1 in rad, a number or shape
        (robots,), and the position of its centre in m, shape (2,) or (robots, 2).
        """

    def start(
        self,
        robots: Robot | Sequence[Robot],
        *,
        initial: ArrayLike | None = None,
        friction: ArrayLike | None = None,
        target: ArrayLike | None = None,
        seeds: Sequence[int] | None = None,
        record: Recording | None = Recording(),  # noqa: B008  (frozen)
        expected: float = 0.0,
        **options: Any,
    ) -> Walk:
        """Start a batch of walks.

        Parameters
        ----------
        robots
            One, or one for every walk, with the same :meth:`common`.
        initial
            From :meth:`initial_states` or :meth:`Walk.states`, one row for all or one a walk; by default straight from
            the origin along x.
        friction
            Factor on the friction coefficient of every foot, positive, shape (N, 2) or (walks, N, 2).
        target
            Position of the target on the floor, m, shape (2,) or (walks, 2).
        seeds
            Seeds of the noise of the sensors, one for each walk; None for no noise.
        record
            Variables and rate of the record; by default the motion, :data:`chilopod.record.RATE` times a second. None:
            no record.
        expected
            Expected duration of the walk, s, so that memory may be taken at once; 0: not known.
        options
            Options of this engine.
        """

    def resume(self, saved: bytes) -> Walk:
        """Walk that this engine and version saved, continued to the bit."""


class FootCreep(Protocol):
    """Creep of standing feet on a floor."""

    @property
    def across(self) -> float:
        """Coefficient of the viscous friction that gives the same creep across the way, N*s/m."""


@runtime_checkable
class HasFootCreep(Protocol):
    """An engine on whose floor standing feet creep."""

    def foot_creep(self, robot: Robot) -> FootCreep:
        """Measure the creep of standing feet."""
