"""Wishes of users of the page, and the box in which they wait for the thread that owns the walk."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass

LARGEST_SEED = 2**53 - 1
"""Largest whole number that a browser holds exactly."""


@dataclass(frozen=True)
class Set:
    """Another value (SI) of a slider, by its name in :func:`chilopod.live.sliders.sliders_of`."""

    slider: str
    value: float


def Spring(joint: int | None, stiffness: float) -> Set:
    """Another stiffness (N*m/rad) of one spring, counted from 0 at the front, or of all (None)."""
    return Set("springs.stiffness" if joint is None else f"springs.stiffness[{joint}]", stiffness)


@dataclass(frozen=True)
class Target:
    """Target on the floor, m; None for no target. By hand no strategy steers there."""

    place: tuple[float, float] | None
    by_hand: bool = False


@dataclass(frozen=True)
class Steering:
    """Another strategy to go to targets with, by name."""

    strategy: str


@dataclass(frozen=True)
class Pull:
    """A torque on a yaw joint, N*m, positive where it turns the part behind the joint to the left; for some time (s),
    or until another pull."""

    joint: int
    torque: float
    time: float = math.inf


@dataclass(frozen=True)
class Pause:
    """Stand still, or walk on."""

    paused: bool


@dataclass(frozen=True)
class Step:
    """Walk on by a number of gait cycles, and pause."""

    cycles: float


@dataclass(frozen=True)
class Reset:
    """Begin anew with a seed; springs, floor and steps stay as they are set."""

    seed: int


@dataclass(frozen=True)
class Record:
    """Begin or end a recording."""

    on: bool


Wish = Set | Target | Steering | Pull | Pause | Step | Reset | Record


class Box:
    """Box of wishes that any thread fills and one empties; it holds one wish of each kind, or for each slider."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._any = threading.Event()
        self._waiting: dict[object, Wish] = {}

    def put(self, wish: Wish) -> None:
        """Leave a wish; an older one of its kind is forgotten."""
        kind: object = wish.slider if isinstance(wish, Set) else type(wish)
        with self._lock:
            self._waiting.pop(kind, None)
            self._waiting[kind] = wish
        self._any.set()

    def wait(self, seconds: float) -> bool:
        """Wait until there is a wish or :meth:`wake` is called, some seconds at most; True if either came."""
        return self._any.wait(seconds)

    def wake(self) -> None:
        """Let the thread that waits go on, as if there were a wish."""
        self._any.set()

    def take(self) -> list[Wish]:
        """Take all wishes out, in the order in which they came."""
        with self._lock:
            self._any.clear()
            wishes = list(self._waiting.values())
            self._waiting.clear()
        return wishes
