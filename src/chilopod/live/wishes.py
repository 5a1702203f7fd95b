"""Wishes of somebody at a page, and the box in which they wait for the thread that owns the walk."""

from __future__ import annotations

import math
import threading
from collections.abc import Hashable
from dataclasses import dataclass

LARGEST_SEED = 2**53 - 1
"""Largest whole number that a browser holds exactly."""


@dataclass(frozen=True)
class Wish:
    """Something that is wanted; of those that are alike only the last counts."""

    @property
    def kind(self) -> Hashable:
        """Alike are wishes of the same kind."""
        return type(self).__name__


@dataclass(frozen=True)
class Spring(Wish):
    """Another stiffness of one spring, counted from 0 at the front, or of all (None), N*m/rad."""

    joint: int | None
    stiffness: float

    @property
    def kind(self) -> Hashable:
        """Every spring has its own."""
        return "Spring", self.joint


@dataclass(frozen=True)
class Friction(Wish):
    """Another floor: friction as a factor on that of the robot file."""

    factor: float


@dataclass(frozen=True)
class Stride(Wish):
    """Longer or shorter steps, m."""

    length: float


@dataclass(frozen=True)
class Target(Wish):
    """A place on the floor to go to, m; None: none any more."""

    place: tuple[float, float] | None


@dataclass(frozen=True)
class Steering(Wish):
    """Another strategy to go to targets with, by name."""

    strategy: str


@dataclass(frozen=True)
class Pull(Wish):
    """A torque on a yaw joint, N*m, positive where it turns what is behind it to the left; for some time (s), or until
    another one."""

    joint: int
    torque: float
    time: float = math.inf


@dataclass(frozen=True)
class Speed(Wish):
    """How many seconds of walking a second shows."""

    times: float


@dataclass(frozen=True)
class Pause(Wish):
    """Stand still, or walk on."""

    paused: bool


@dataclass(frozen=True)
class Step(Wish):
    """Walk on by a part of a gait cycle, and pause."""

    cycles: float


@dataclass(frozen=True)
class Reset(Wish):
    """Begin anew with a seed; springs, floor and steps stay as they were set."""

    seed: int


@dataclass(frozen=True)
class Record(Wish):
    """Begin or end to write the walk down."""

    on: bool


class Box:
    """Where wishes wait: any thread puts them in, one takes them out. A flood of them takes no more room than one of
    each kind."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._any = threading.Event()
        self._waiting: dict[Hashable, Wish] = {}

    def put(self, wish: Wish) -> None:
        """Leave a wish; an older one of its kind is forgotten."""
        with self._lock:
            self._waiting.pop(wish.kind, None)
            self._waiting[wish.kind] = wish
        self._any.set()

    def wait(self, seconds: float) -> bool:
        """Until there is a wish, or somebody wakes, which it tells; but so long at most."""
        return self._any.wait(seconds)

    def wake(self) -> None:
        """Let the one who waits go on, as if there were a wish."""
        self._any.set()

    def take(self) -> list[Wish]:
        """All wishes in the order in which they came, and none is left."""
        with self._lock:
            self._any.clear()
            wishes = list(self._waiting.values())
            self._waiting.clear()
        return wishes
