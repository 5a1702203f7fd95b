"""One walk with its conditions: all that makes it, its disturbances drawn from a seed, and the name of its file."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field
from typing import Any

from chilopod.errors import ParameterError, nearest_name
from chilopod.record import RATE
from chilopod.robot import Robot
from chilopod.steering import LegYawController, Target
from chilopod.trials.disturbance import Disturbance
from chilopod.trials.store import RECORD_VERSION

ENGINES = ("planar", "twin")
"""What walks: the planar model, or the whole robot in three dimensions."""


@dataclass(frozen=True)
class Trial:
    """Everything that makes a walk.

    Attributes
    ----------
    robot
        With the springs of this trial.
    duration
        s.
    seed
        Of its disturbances.
    joint_angles
        At the start, before disturbance, rad, (N-1,); empty for straight.
    target
        Where the robot is to go, if anywhere.
    controller
        What steers it, if anything.
    disturbance
        How much differs from trial to trial.
    rate
        Samples per second.
    forces
        Whether the record has the force on every foot.
    engine
        One of :data:`ENGINES`.
    poses
        Whether the record has the positions of all joints, to be drawn (twin only).
    """

    robot: Robot
    duration: float
    seed: int = 0
    joint_angles: tuple[float, ...] = ()
    target: Target | None = None
    controller: LegYawController | None = None
    disturbance: Disturbance = field(default_factory=Disturbance)
    rate: float = RATE
    forces: bool = False
    engine: str = "planar"
    poses: bool = False

    def __post_init__(self) -> None:
        check_engine(self.engine, self.robot)

    @property
    def description(self) -> dict[str, Any]:
        """All of it as plain data; equal descriptions are equal trials."""
        return {
            "version": RECORD_VERSION,
            "engine": self.engine,
            # What it is called and where its numbers come from makes no difference.
            "robot": self.robot.with_(name="robot", provenance={}).to_toml(),
            "duration": self.duration,
            "seed": self.seed,
            "joint_angles": list(self.joint_angles),
            "target": asdict(self.target) if self.target else None,
            "controller": asdict(self.controller) if self.controller else None,
            "disturbance": asdict(self.disturbance),
            "rate": self.rate,
            "forces": self.forces,
            "poses": self.poses,
        }

    @property
    def file_name(self) -> str:
        """Of its record."""
        text = json.dumps(self.description, sort_keys=True)
        return f"{self.engine}-{hashlib.sha256(text.encode()).hexdigest()[:20]}.nc"


def check_engine(engine: str, robot: Robot) -> None:
    """Make sure that there is such an engine and that it knows such a robot.

    Raises
    ------
    ParameterError
        If not.
    """
    if engine not in ENGINES:
        raise ParameterError(
            "there is no such engine",
            field="engine",
            value=engine,
            allowed=", ".join(ENGINES),
            nearest=nearest_name(engine, ENGINES),
        )
    if engine == "twin" and robot.twin is None:
        raise ParameterError(
            "the robot has no [twin], only the planar model knows it",
            field="engine",
            value=engine,
            allowed="planar, or a robot file with a [twin], such as the preset aoi2022",
        )
