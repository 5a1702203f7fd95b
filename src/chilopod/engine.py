"""What every engine that makes robots walk has in common: when controllers are asked, what they see, what they say.

A controller knows neither the engine nor the robot's place on the floor: at instants of the gait it sees what the
robot's sensors give, and answers with angles for the leg yaw joints of module 1. Everything comes as arrays over the
robots of a batch, so one object steers one robot or ten thousand.
"""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from chilopod.gait import Gait

Array = NDArray[np.float64]


class Status(enum.Enum):
    """How a walk ended; each member's ``sentence`` says it in words."""

    WALKED = "walked", "walked to the end"
    DIVERGED = "diverged", "the motion became too fast to follow or infinite"
    OUT_OF_RANGE = "out of range", "a yaw joint bent by more than a right angle, where modules run into each other"
    FALLEN = "fallen", "module 1 tipped over"

    def __init__(self, label: str, sentence: str) -> None:
        self.label = label
        self.sentence = sentence


@dataclass(frozen=True)
class Event:
    """An instant of every gait cycle at which a controller is asked.

    Attributes
    ----------
    name
        For the controller to know it by.
    phase
        Time since the start of the cycle over its period, in [0, 1).
    window
        Time there is to act, s.
    """

    name: str
    phase: float
    window: float


@dataclass(frozen=True)
class Observation:
    """What the robots of a batch see at an instant.

    Attributes
    ----------
    time
        s.
    bearing
        Direction of the target relative to the heading of module 1, left positive, rad in [-pi, pi); NaN where it is
        not seen. Shape (robots,).
    distance
        Of the target from the centre of module 1, m; NaN where it is not seen. Shape (robots,).
    joint_angles
        Of the yaw joints, rad, shape (robots, N-1).
    leg_yaw
        Angles last commanded for the left and right leg of module 1, rad, shape (robots, 2).
    """

    time: float
    bearing: Array
    distance: Array
    joint_angles: Array
    leg_yaw: Array


@dataclass(frozen=True)
class Command:
    """What a controller wants.

    Attributes
    ----------
    leg_yaw
        Angles for the left and right leg of module 1, left positive, rad, shape (robots, 2).
    within
        Time in which they are to be reached, at constant rate, s.
    """

    leg_yaw: Array
    within: float


class Controller(Protocol):
    """Anything that steers: asked at its events, in order of time."""

    def events(self, gait: Gait) -> Sequence[Event]:
        """Instants of the cycle at which :meth:`act` is to be called."""

    def act(self, event: Event, seen: Observation) -> Command:
        """What to do, given what is seen; must not change ``seen``."""


def event_times(controller: Controller, gait: Gait, duration: float) -> list[tuple[float, Event]]:
    """All instants in [0, duration) at which a controller is asked, in order."""
    cycles = int(np.ceil(duration / gait.period))
    times = [
        ((cycle + event.phase) * gait.period, event) for cycle in range(cycles) for event in controller.events(gait)
    ]
    return sorted(((t, event) for t, event in times if t < duration), key=lambda pair: pair[0])


def bearing_and_distance(position: Array, heading: Array, target: Array) -> tuple[Array, Array]:
    """Where a target is, seen from module 1.

    Parameters
    ----------
    position, target
        On the floor, m, shape (..., 2).
    heading
        rad, shape (...).

    Returns
    -------
    Direction relative to the heading, rad in [-pi, pi), and distance, m.
    """
    away = target - position
    angle = np.arctan2(away[..., 1], away[..., 0]) - heading
    return (angle + np.pi) % (2.0 * np.pi) - np.pi, np.hypot(away[..., 0], away[..., 1])
