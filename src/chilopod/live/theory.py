"""Pitchfork and curved walks of the robot on the page, computed in a process of their own.

The page asks anew whenever springs, floor or steps change; only the last question is answered.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chilopod.analysis.parameters import K1
from chilopod.engine import Status, engine_named
from chilopod.errors import ChilopodError
from chilopod.frozen import Array
from chilopod.process import deaf
from chilopod.robot import Robot
from chilopod.steering import RadiusLaw

_BETWEEN = (1.0 / 20.0, 3.0)  # of the stiffest spring: as for the radius law
_NICE = 5
_GROWTH = 30.0  # s that a short question may take


@dataclass(frozen=True)
class Stretch:
    """First springs (N*m/rad) between which the straight walk does not gain or lose stability."""

    low: float
    high: float
    stable: bool | None  # None if undecided
    begins: str = ""  # how stability changes at ``low``, empty where only the search begins


@dataclass(frozen=True)
class Theory:
    """Theory of a robot with any first spring; None for unknown parts, with a remark that gives the reason."""

    robot: Robot | None = None
    pitchfork: float | None = None  # first spring below which the straight walk gives way, N*m/rad
    springs: Array = field(default_factory=lambda: np.empty(0))  # of the curved walks from there on, N*m/rad, (points,)
    radii: Array = field(default_factory=lambda: np.empty(0))  # of these walks, m
    stable: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, dtype=np.bool_))  # True if the walk is stable
    law: RadiusLaw | None = None  # radius law of the springs, for strategies
    straight: tuple[Stretch, ...] = ()  # of the straight walk by rising first spring; nothing is known elsewhere
    remark: str = ""
    computing: bool = False  # True if more is to come

    def settled(self, spring: float) -> float | None:
        """Radius of the stable walk with a first spring (N*m/rad), m: infinite if it is the straight one; None where
        none is known."""
        if self.pitchfork is None:
            return None
        if spring >= self.pitchfork:
            return float("inf") if self.verdict(spring) else None
        if self.law is None or spring < self.law.values[0]:
            return None
        return self.law.radius(spring)

    def verdict(self, spring: float) -> bool | None:
        """True if the straight walk with a first spring (N*m/rad) is stable, None if that is not known."""
        return next((each.stable for each in self.straight if each.low <= spring <= each.high), None)


@dataclass(frozen=True)
class Growth:
    """Rate (1/s) at which a small bend of a robot's straight walk grows, the largest real part of all exponents, and
    frequency (rad/s) at which it sways."""

    robot: Robot
    rate: float
    sways: float = 0.0


def growth_of(robot: Robot) -> Growth:
    """Rate of growth of a small bend about the straight walk, by the planar theory."""
    from chilopod.analysis import straight_walk

    rate, sways = max(straight_walk(robot, longest=_GROWTH).as_json()["exponents_per_s"])
    return Growth(robot, rate, abs(sways))


def theory_of(robot: Robot, engine: str, springs: tuple[float, float], callback: Callable[[Theory], None]) -> None:
    """Compute the theory of a robot, and call a function with each intermediate result; its exceptions end the work.

    In an engine whose walks are not those of the planar theory, some are walked. The first spring does not matter;
    those between which the straight walk is judged are ``springs`` (N*m/rad).
    """
    known = Theory(robot, computing=True)
    try:
        if engine_named(engine).traits.exact:
            _exact(robot, known, springs, callback)
        else:
            from chilopod.tasks import radius_law

            law = radius_law(robot, engine, progress=lambda done, _: callback(_following(known, done)))
            stable = np.ones(len(law.values), dtype=np.bool_)
            # Straight walks with stiffer springs are not walked.
            straight = (Stretch(0.0, law.pitchfork, False),)
            callback(Theory(robot, law.pitchfork, law.values[::-1], law.radii[::-1], stable, law, straight))
    except ChilopodError as error:
        callback(replace(known, remark=error.problem, computing=False))


def straight_walks(robot: Robot, springs: tuple[float, float]) -> tuple[Stretch, ...]:
    """Stretches of the straight walk between two first springs, undecided where bifurcations may be missing."""
    from chilopod.analysis import bifurcations
    from chilopod.analysis.straight_walk import family
    from chilopod.stability import Kind, multipliers

    why, make, ways = list[str](), family(robot, K1), {Kind.NEIMARK_SACKER: "sway"}
    found = [each.point for each in bifurcations(robot, K1, springs, normal_form=False, remark=why.append)]
    begins = ["", *(ways.get(each.kind, each.kind.label) for each in found)]
    ends = pairwise([springs[0], *(each.value for each in found), springs[1]])
    return tuple(
        Stretch(low, high, None if why else multipliers(make(0.5 * (low + high))).stable, way)
        for (low, high), way in zip(ends, begins, strict=True)
    )


def _exact(robot: Robot, known: Theory, springs: tuple[float, float], callback: Callable[[Theory], None]) -> None:
    from chilopod.analysis import curved_walks, first_loss
    from chilopod.stability import Kind
    from chilopod.tasks.radius_law import that_holds

    # As the radius law has it, but for the first spring, which is what varies.
    low, high = (part * max(robot.springs.stiffness[1:], default=robot.springs.stiffness[0]) for part in _BETWEEN)
    callback(replace(known, remark="computing the pitchfork"))
    known = replace(known, straight=straight_walks(robot, (min(low, springs[0]), max(high, springs[1]))))
    try:
        loss = first_loss(robot, K1, (low, high), Kind.PITCHFORK, normal_form=False)
    except ChilopodError as error:
        callback(replace(known, remark=error.problem, computing=False))
        return
    known = replace(known, pitchfork=loss.point.value)
    callback(_following(known, 0.0))
    walks = curved_walks(robot, K1, (low, high), side=-1, progress=lambda done, _: callback(_following(known, done)))
    possible = walks.verdict.values != Status.OUT_OF_RANGE.label
    found = walks.parameter_si, walks.axis_radius, walks.stable
    bent, radii, stable = (each.values[possible] for each in found)
    known = replace(known, springs=bent, radii=radii, stable=stable, computing=False)
    try:
        law = RadiusLaw.of_branch(known.springs, known.radii, known.stable, robot.unit_of(K1))
        known = replace(known, law=that_holds(law, robot))
    except ChilopodError as error:
        known = replace(known, remark=error.problem)
    callback(known)


def _following(known: Theory, done: float) -> Theory:
    return replace(known, remark=f"computing the branch: {100.0 * done:.0f} %")


class Beside:
    """A process that answers questions about robots that walk in an engine, the last question of each kind only."""

    def __init__(self, engine: str) -> None:
        context = multiprocessing.get_context("spawn")
        self._here, there = context.Pipe()
        self._process = context.Process(target=_answer, args=(there, engine), daemon=True, name="chilopod theory")
        self._waits = False  # True if a theory was asked for and has not been told since
        with deaf():
            self._process.start()
        there.close()

    def ask(self, robot: Robot, springs: tuple[float, float] | None = None) -> None:
        """Ask for the theory of a robot, see :func:`theory_of`, or without springs for the growth of small bends of its
        straight walk."""
        self._waits = self._waits or springs is not None
        with suppress(OSError):  # the process may have ended, and answers nothing any more
            self._here.send((robot, springs))

    def answers(self) -> list[Theory | Growth]:
        """Answers since the last call, of which one says if the process has ended; never waits."""
        found: list[Theory | Growth] = []
        alive = self._process.is_alive()
        with suppress(EOFError, OSError):
            while self._here.poll():
                found.append(self._here.recv())
        self._waits = self._waits and all(each.computing for each in found if isinstance(each, Theory))
        if self._waits and not alive:
            self._waits = False
            found.append(Theory(remark="the process that computes it has ended"))
        return found

    def close(self) -> None:
        """End the process; unfinished work is lost."""
        self._here.close()
        self._process.terminate()
        self._process.join(timeout=5.0)


class _Stale(Exception):
    """Exception that ends the work on a question when another has come."""


def _answer(pipe: Connection, engine: str) -> None:
    """Work of the process: the last question of each kind, the quick one first, also while the long one is at work."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # as it is from the start, unless a thread of the page started it
    if hasattr(os, "nice"):
        os.nice(_NICE)
    waiting: dict[str, Any] = {}

    def take() -> None:
        robot, springs = pipe.recv()
        waiting["theory" if springs else "growth"] = robot, springs

    def growth() -> None:
        with suppress(ChilopodError):  # where there is no straight walk to speak of
            pipe.send(growth_of(waiting.pop("growth")[0]))

    def tell(known: Theory) -> None:
        while pipe.poll():
            take()
        if "theory" in waiting:
            raise _Stale
        pipe.send(known)
        if "growth" in waiting:
            growth()

    with suppress(EOFError, OSError):  # the page is gone
        while True:
            while not waiting or pipe.poll():
                take()
            if "growth" in waiting:
                growth()
                continue
            with suppress(_Stale):
                robot, springs = waiting.pop("theory")
                theory_of(robot, engine, springs, tell)
