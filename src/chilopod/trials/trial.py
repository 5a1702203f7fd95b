"""One walk with its conditions, its disturbances drawn from a seed, and the name of its file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

import chilopod
from chilopod.engine import Controller, Engine, engine_named
from chilopod.engine.arguments import as_array, as_number, as_seeds, require
from chilopod.engine.named import check_controller, path_of
from chilopod.frozen import Array
from chilopod.record import LONGEST, RATE, Recording, in_range
from chilopod.robot import Robot
from chilopod.sources import digest
from chilopod.steering import Course, Target
from chilopod.trials.description import classes_in, code_of, engine_code_of, is_findable, is_ours, plain, robot_text
from chilopod.trials.reach import UnknownKindError

_DIGITS = 16
_SLICK = 1e-3
"""Remaining friction of a foot without grip, as a factor."""

_DEVIATIONS = ("joint_angle", "heading", "friction", "bearing")
_MOST_BENT = 1.5  # rad; at a right angle modules collide
_FLAG = bool | np.bool_, "True or False"
_ABOVE = ("analysis", "cli", "gym", "live", "paper", "show", "stability", "tasks")
"""Subpackages that do not affect walks: editing them keeps earlier trials valid."""


@dataclass(frozen=True)
class Disturbance:
    """Differences from trial to trial: standard deviations of independent normal deviates.

    None of it is printed in the paper. Of joints at 0.5, 1, 2 deg and feet at 2, 4, 8 % the middle is the smallest
    spread with which the twin agrees with the robot at k1 = 28 N*mm/deg: most walks curve, to both sides (5, 7 and 8 of
    10 after 90 s). A heading of 1 deg corresponds to careful positioning by hand, and the error of the bearing to the
    scanner's step of 0.352 deg with an extended target.

    Attributes
    ----------
    joint_angle, heading
        Deviation of every yaw joint, and of the heading of module 1, at the start, rad.
    friction
        Deviation of the logarithm of every foot's friction coefficient.
    bearing
        Deviation of every measured bearing, rad. The twin's scanner has noise of its own instead, if this is not zero.
    missed
        Fraction of the looks at which the scanner misses the target, on a course.
    slick
        Foot without grip, which simulates a lost leg: module and side (left 0, right 1), counted from 0, or None.
    """

    joint_angle: float = float(np.deg2rad(1.0))
    heading: float = float(np.deg2rad(1.0))
    friction: float = 0.04
    bearing: float = float(np.deg2rad(0.5))
    missed: float = 0.0
    slick: tuple[int, int] | None = None

    def scaled(self, factor: float) -> Disturbance:
        """Disturbance with all standard deviations multiplied by a factor."""
        return replace(self, **{name: factor * getattr(self, name) for name in _DEVIATIONS})

    def __post_init__(self) -> None:
        require(0.0 <= self.missed <= 1.0, "must be a fraction", "missed", self.missed, "0 to 1")
        for name in _DEVIATIONS:
            value = getattr(self, name)
            require(0.0 <= value < 10.0, "is out of range", name, value, "0 or more, less than 10")
        foot: Any = self.slick
        known = foot is None or (isinstance(foot, tuple) and [type(each) for each in foot] == [int, int])
        fits = known and not (foot and not (foot[0] >= 0 <= foot[1] <= 1))
        require(fits, "must be a foot", "slick", foot, "(module, side), module from 0, side 0 or 1; or None")

    def check_foot(self, modules: int) -> None:
        """Refuse a foot without grip that a robot of this many modules does not have."""
        there = self.slick is None or self.slick[0] < modules
        require(there, "must be a foot of the robot", "slick", self.slick, f"module 0 to {modules - 1}")


NONE = Disturbance(0.0, 0.0, 0.0, 0.0)
"""No disturbance at all."""


_KINDS = {
    "robot": (Robot, "a chilopod.Robot"),
    "engine": (str, "the name of an engine"),
    "target": (Target | Course | None, "a chilopod.steering.Target or Course, or None"),
    "disturbance": (Disturbance, "a chilopod.trials.Disturbance"),
    **dict.fromkeys(("forces", "poses", "brief"), _FLAG),
}


@dataclass(frozen=True)
class Trial:
    """Everything that defines a walk. Raises ParameterError if a value is out of range, the engine is unknown or cannot
    walk the robot, or the controller cannot be identified by its code and fields.

    Attributes
    ----------
    robot, duration
        Robot with the springs of this trial, and duration of the walk, s.
    seed, disturbance
        Seed and size of the differences from trial to trial.
    joint_angles
        Joint angles at the start, before disturbance, rad: one for each joint, front to rear, one for all, or none for
        a straight robot.
    target
        Target of the robot, if any: one target, or a course of them, which ends the walk.
    controller
        Controller, if any: a frozen dataclass with ``events`` and ``act``, whose fields are plain data. Its fields, and
        everything that the code of its class can reach, are part of the trial.
    rate, forces, poses
        See :class:`chilopod.record.Recording`.
    engine
        Name of an engine, one of :data:`chilopod.engine.ENGINES` or ``package.module:object``.
    brief
        True to keep only the outcomes of a course's targets, not its motion over time.
    """

    robot: Robot
    duration: float
    seed: int = 0
    joint_angles: tuple[float, ...] = ()
    target: Target | Course | None = None
    controller: Controller | None = None
    disturbance: Disturbance = field(default_factory=Disturbance)
    rate: float = RATE
    forces: bool = False
    engine: str = "planar"
    poses: bool = False
    brief: bool = False

    def __post_init__(self) -> None:
        for name, (kind, allowed) in _KINDS.items():
            value = getattr(self, name)
            require(isinstance(value, kind), "has the wrong type", name, value, allowed)
        (seed,) = as_seeds([self.seed], "seed") or []
        # Equal trials have one text, whatever kinds of numbers they were given.
        plain_values = {
            **{name: as_number(name, getattr(self, name)) for name in ("duration", "rate")},
            **{name: bool(getattr(self, name)) for name in ("forces", "poses", "brief")},
            "seed": seed,
            "joint_angles": self._every_joint_angle(),
        }
        for name, value in plain_values.items():
            object.__setattr__(self, name, value)
        in_range("duration", self.duration, LONGEST, "s")
        course, engine = self.course, engine_named(self.engine)
        require(course or not self.brief, "must be False: only courses have brief records", "brief", True)
        if course:
            fits, allowed = self.duration == course.duration, f"{course.duration:g} s"
            require(fits, "must be that of the course", "duration", self.duration, allowed)
        engine.common(self.robot)
        self.disturbance.check_foot(self.robot.body.modules)
        has_poses = not self.recording.poses or engine.traits.poses
        require(has_poses, "must be False: this engine has no poses in space", "poses", True)
        if self.controller is not None:
            check_controller(self.controller)
            self.steering  # noqa: B018  (as it is now; the content of a frozen dataclass may still change)

    def _every_joint_angle(self) -> tuple[float, ...]:
        """Joint angles at the start, one for each joint, or none."""
        angles, joints = as_array("joint_angles", self.joint_angles), self.robot.body.modules - 1
        fits, problem = angles.shape in ((0,), (1,), (joints,)), f"must be one angle for each joint, not {angles.size}"
        require(fits, problem, "joint_angles", self.joint_angles, f"{joints}, or one for all")
        inside, allowed = np.abs(angles) <= _MOST_BENT, f"-{_MOST_BENT} to {_MOST_BENT} rad (85 deg)"
        require(inside.all(), "must be smaller", "joint_angles", self.joint_angles, allowed)
        return tuple(np.broadcast_to(angles, joints if angles.size else 0).tolist())

    def __getstate__(self) -> dict[str, Any]:
        # Another process derives these again, because its versions may differ.
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @property
    def course(self) -> Course | None:
        """The target if it is a course, else None."""
        return self.target if isinstance(self.target, Course) else None

    @property
    def recording(self) -> Recording:
        """Contents of the record."""
        return Recording(self.rate, self.forces, self.poses)

    @property
    def least_bytes(self) -> float:
        """Least memory of its record, bytes."""
        return 0.0 if self.brief else self.recording.least_bytes(self.robot.body.modules, self.duration)

    @cached_property
    def steering(self) -> Any:
        """The controller as plain data, see :func:`chilopod.trials.description.plain`."""
        return None if self.controller is None else plain(self.controller, type(self.controller).__name__)

    @cached_property
    def code(self) -> tuple[str, str, str]:
        """Digest of the code of controller and engine; reason why another process could not import it, if so; and
        reason why its walks are not reproducible, if so."""
        known_here = "__main__:" in self.engine or not all(map(is_findable, classes_in(self.controller)))
        why = "it must be defined at the top of a module that can be imported"
        try:
            digest, chance = code_of(self.controller)
            again = f"{chance}, which may vary from call to call or process to process; use seeds, and sort sets"
            return digest + engine_code_of(self.engine), why if known_here else "", again if chance else ""
        except UnknownKindError as error:
            can = "numbers, text, arrays, lists, dictionaries, enums, functions, classes and modules can"
            return f"of this process {id(self.controller):x}", f"{error}, which cannot be described; {can}", ""

    def repeated(self, seed: int | None = None, repeats: int = 1) -> tuple[Trial, ...]:
        """Repeat the trial with consecutive seeds, or once without disturbance if the seed is None. Raises
        ParameterError for no walks, or several identical ones."""
        require(repeats >= 1, "must be positive", "repeats", repeats)
        several = seed is not None or repeats == 1
        require(several, "must be 1 without a seed: trials would be equal", "repeats", repeats)
        spread = NONE if seed is None else self.disturbance
        return tuple(replace(self, seed=(seed or 0) + i, disturbance=spread) for i in range(repeats))

    def as_now(self) -> Trial:
        """The same trial with the current code and fields of its controller."""
        own = ":" in self.engine or any(not is_ours(kind) for kind in classes_in(self.controller))
        return replace(self) if own else self

    @cached_property
    def text(self) -> str:
        """Complete trial as JSON; equal texts mean equal trials."""
        plain_names = ("engine", "duration", "seed", "rate", "forces", "poses", "brief")
        target: Any = self.target
        if isinstance(target, Target):
            target = [float(target.bearing), float(target.distance)]
        return json.dumps(
            {
                **versions_of(self.engine),
                **{name: getattr(self, name) for name in plain_names},
                "code": self.code[0],
                "robot": robot_text(self.robot),
                "joint_angles": list(self.joint_angles),
                "target": asdict(target) if isinstance(target, Course) else target,
                "controller": self.steering,
                "disturbance": asdict(self.disturbance),
            },
            sort_keys=True,
        )

    @cached_property
    def file_name(self) -> str:
        """Name of the file of its record."""
        engine = engine_named(self.engine).traits.name
        kind = "".join(each if each.isalnum() else "-" for each in engine)
        return f"{kind}-{digest_of(self.text)}.nc"

    def not_kept(self, why: str) -> str:
        """Message that explains why a folder does not keep this trial."""
        who = f"engine {self.engine}" if self.controller is None else f"controller {path_of(type(self.controller))}"
        return f"{who}: its trials run but are not kept: {why}"


def versions_of(engine: str) -> dict[str, Any]:
    """Versions of the software that determines a record, as written in a trial's text."""
    return {
        # The rest of a checkout's version is covered by the digest of the sources.
        "chilopod": chilopod.__version__.partition("+")[0],
        "sources": digest(_ABOVE)[:_DIGITS],
        "engine_version": engine_named(engine).traits.version,
    }


def digest_of(text: str) -> str:
    """Digest of a trial's text, which names its file."""
    return hashlib.sha256(text.encode()).hexdigest()[:20]


@dataclass(frozen=True)
class Drawn:
    """Disturbance of one robot, drawn from a seed: joint angles, shape (N-1,), and heading at the start, rad; factors
    on the friction coefficients of feet, shape (N, 2); errors of the measured bearings, rad, and whether the scanner
    misses the target, shape (looks,); seed of the noise of a scanner that has its own."""

    joint_angles: Array
    heading: float
    friction: Array
    bearing: Array
    missed: NDArray[np.bool_]
    scan_seed: int


def draw(
    disturbance: Disturbance, seed: int, modules: int, looks: int, joint_angles: Sequence[float] | None = None
) -> Drawn:
    """Draw a disturbance for a number of modules and of looks at the target, each kind from its own stream of random
    numbers. The joint angles at the start scatter about ``joint_angles``, rad, by default straight."""
    streams = np.random.SeedSequence(seed).spawn(6)
    joints, heading, friction, bearing = (np.random.default_rng(each) for each in streams[:4])
    feet = np.exp(disturbance.friction * friction.standard_normal((modules, 2)))
    if disturbance.slick is not None:
        feet[disturbance.slick] *= _SLICK
    missed = np.random.default_rng(streams[5])
    return Drawn(
        np.array(joint_angles or 0.0) + disturbance.joint_angle * joints.standard_normal(modules - 1),
        float(disturbance.heading * heading.standard_normal()),
        feet,
        disturbance.bearing * bearing.standard_normal(looks),
        missed.random(looks) < disturbance.missed,
        int(streams[4].generate_state(1)[0]),
    )


def conditions(engine: Engine, robot: Robot, drawn: Sequence[Drawn], noisy: bool) -> dict[str, Any]:
    """Arguments of an engine's ``start`` for drawn walks; a ``noisy`` engine also gets seeds of its sensor noise."""
    angles, headings = np.stack([each.joint_angles for each in drawn]), np.array([each.heading for each in drawn])
    seeds = [each.scan_seed for each in drawn] if noisy and engine.traits.noisy else None
    friction = np.stack([each.friction for each in drawn])
    return {"initial": engine.initial_states(robot, angles, headings), "friction": friction, "seeds": seeds}
