"""Control loop: advance the walk to the next event, observe, call the controller, command."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, replace
from heapq import merge
from itertools import chain, count, islice, pairwise, takewhile
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from chilopod.engine.arguments import as_array, as_number, check_time, require
from chilopod.engine.contract import Command, Controller, Event, Foresees, Observation, Walk
from chilopod.engine.named import foreign
from chilopod.errors import AnalysisError, ParameterError
from chilopod.gait import Gait
from chilopod.progress import Progress, silent
from chilopod.record import LONGEST

Heard = Callable[[Event, Observation, Command], None]

_MOMENT = 0.3
"""Approximate time between two reports of progress, s; Ctrl-C may wait as long."""

_MOST_EVENTS = 10_000
"""Largest number of events in a gait cycle: more would come from an endless generator."""

_FIRST, _SHORTEST = 0.02, 1e-3
"""First and least stretch of a walk that is advanced at a time, s."""


@dataclass
class Spent:
    """Time spent on walks, s: in controllers, and in all; ``progress`` receives the fraction done."""

    controller: float = 0.0
    total: float = 0.0
    progress: Progress = silent

    @property
    def share(self) -> float:
        """Share of the controllers, 0 to 1."""
        return self.controller / self.total if self.total > 0.0 else 0.0


_watching: list[Spent] = []


@contextmanager
def watched(progress: Progress = silent) -> Iterator[Spent]:
    """Sum up the time of all walks that :func:`steer` steers in this process within the block, and report progress."""
    spent = Spent(progress=progress)
    _watching.append(spent)
    try:
        yield spent
    finally:
        _watching[:] = [each for each in _watching if each is not spent]


class Referee(Protocol):
    """Observer of a steered walk: it knows the poses of the robots and filters the observations of their controller."""

    @property
    def every(self) -> float:
        """Time between two looks, s; the first is at the beginning."""

    def look(self, walk: Walk) -> bool:
        """Observe, aim and halt the walk; return True if it goes on."""

    def through(self, index: int, seen: Observation) -> Observation:
        """Observation that the controller receives at the event of that number."""


def event_times(controller: Controller, gait: Gait, duration: float) -> Iterator[tuple[float, Event]]:
    """All instants in [0, duration) at which a controller is called, in order; ParameterError or AnalysisError for
    invalid events."""
    fits, allowed = 0.0 <= as_number("duration", duration) <= LONGEST, f"0 to {LONGEST:g} s"
    require(fits, "must be a duration in s", "duration", duration, allowed)
    return ((time, event) for time, _, event in _numbered(controller, gait, 0.0, duration))


def _numbered(controller: Controller, gait: Gait, since: float, until: float) -> Iterator[tuple[float, int, Event]]:
    """Instants of :func:`event_times` with the number of each event, without the cycles that were over at ``since``
    (s), so that short advances need not count from the beginning."""
    where = _of(controller, "events")
    with foreign(AnalysisError, "raised", field=where):
        events = list(islice(controller.events(gait), _MOST_EVENTS + 1))
    fewer, allowed = len(events) <= _MOST_EVENTS, f"at most {_MOST_EVENTS} in a gait cycle"
    require(fewer, "must be fewer", where, allowed=allowed)
    for event in events:
        require(isinstance(event, Event), "must be a chilopod.engine.Event", where, event)
        fits = 0.0 <= as_number(where, event.phase) < 1.0
        require(fits, "must be a phase of the gait cycle", where, event.phase, "0 to less than 1")
        fits = 0.0 <= as_number(where, event.window) < math.inf
        require(fits, "must have a finite window", where, event.window, "0 s or more")
    events.sort(key=lambda event: event.phase)
    first = _whole(since, gait.period)
    for cycle in range(first, math.ceil(until / gait.period) if events else first):
        for number, event in enumerate(events, cycle * len(events)):
            time = (cycle + event.phase) * gait.period
            if time >= until:
                return
            yield time, number, event


def _whole(time: float, period: float) -> int:
    """Number of periods that are over at a time; one less beside their ends, because of round-off."""
    return max(0, math.ceil(time / period) - 1)


def steer(
    walk: Walk,
    until: float,
    controller: Controller | None = None,
    *,
    bearing_noise: ArrayLike | None = None,
    referee: Referee | None = None,
    progress: Progress = silent,
    heard: Heard | None = None,
) -> None:
    """Advance a walk to a time, commanded by a controller at its events, or until its referee ends it. Raises
    ParameterError for invalid events or commands, in a message that names the controller, and AnalysisError if the
    controller raises, with its exception as the cause.

    Parameters
    ----------
    walk, until, controller
        Walk, changed in place, time to advance it to, s, and its controller; None keeps the last setpoints.
    bearing_noise
        Error added to the bearing that the controller sees at its events, rad, shape (walks, at least as many as
        events); the last axis is the order of events from the start of the walk.
    progress, heard
        Function of the fraction done (0 to 1) and a few words; function of each event, of a copy of what the controller
        was shown, and of its command.
    """
    gait, begun = walk.robots[0].gait, walk.time
    until = check_time(until, begun)
    require(callable(progress), "must be a function of two arguments", "progress", progress)
    noise = None
    if controller is not None and bearing_noise is not None:
        walks, events = len(walk.robots), sum(1 for _ in event_times(controller, gait, until))
        noise = np.atleast_2d(as_array("bearing_noise", bearing_noise))
        fits = noise.ndim == 2 and len(noise) == walks and noise.shape[1] >= events
        allowed = f"({walks}, {events} or more)"
        require(fits, f"has the wrong shape {noise.shape}", "bearing_noise", allowed=allowed)

    def tell() -> None:
        # Without a target a referee ends the walk before it begins.
        done, words = walk.time / until if until > 0.0 else 1.0, f"{walk.time:.1f} of {until:g} s"
        for each in (progress, *(spent.progress for spent in _watching)):
            each(done, words)

    pace = _Pace(walk)
    since, thought = clock.perf_counter(), 0.0
    for time, index, event, following in _instants(controller, gait, referee, begun, until):
        if time < begun:
            continue
        pace.advance(time, tell)
        if event is None:
            if referee is not None and not referee.look(walk):
                until = time
                break
            continue
        seen = walk.observe()
        if noise is not None:
            seen = replace(seen, bearing=(seen.bearing + noise[:, index] + np.pi) % (2.0 * np.pi) - np.pi)
        if referee is not None:
            seen = referee.through(index, seen)
        assert controller is not None
        shown = deepcopy(seen) if heard else seen  # the controller may write into it
        called_at = clock.perf_counter()
        with foreign(AnalysisError, "raised", field=_of(controller, "act")):
            command = controller.act(event, seen)
        thought += clock.perf_counter() - called_at
        try:
            walk.command(command)
        except ParameterError as error:
            error.field = _of(controller, error.field or "command")
            raise
        if heard:
            heard(event, shown, command)
        tell()
        pace.foresee(following)
    pace.advance(until, tell)
    tell()
    for spent in _watching:
        spent.controller += thought
        spent.total += clock.perf_counter() - since


def _instants(
    controller: Controller | None, gait: Gait, referee: Referee | None, since: float, until: float
) -> Iterator[tuple[float, int, Event | None, float]]:
    """Instants before ``until`` (s) at which the controller or the referee observes, some of them before ``since``:
    number of the event, the event or None for the referee, which comes first, and time of the event after it, s, NaN
    if it is the last."""
    instants: list[Iterator[tuple[float, int, Event | None, float]]] = []
    if controller is not None:
        asked = _numbered(controller, gait, since, until)
        last = np.nan, -1, Event("", 0.0, 0.0)
        instants.append((*each, after[0]) for each, after in pairwise(chain(asked, [last])))
    if referee is not None:
        every = referee.every
        times = (n * every for n in count(_whole(since, every)))
        instants.append((time, -1, None, np.nan) for time in takewhile(lambda time: time < until, times))
    return merge(*instants, key=lambda each: each[:2])


class _Pace:
    """Pace of a walk in stretches that take about as long as a moment."""

    def __init__(self, walk: Walk) -> None:
        self._walk, self._stretch = walk, _FIRST  # and length of the next stretch, s
        self._foresee = walk.foresee if isinstance(walk, Foresees) else None

    def advance(self, until: float, tell: Callable[[], None]) -> None:
        # Avoid a last stretch of nearly zero length.
        while self._walk.time + 1.5 * self._stretch < until:
            self._measured(self._walk.advance, self._walk.time + self._stretch)
            tell()
        self._measured(self._walk.advance, until)

    def foresee(self, until: float) -> None:
        if self._foresee and until <= self._walk.time + 1.5 * self._stretch:
            self._measured(self._foresee, until)

    def _measured(self, go: Callable[[float], None], until: float) -> None:
        length, begun = until - self._walk.time, clock.perf_counter()
        go(until)
        took = clock.perf_counter() - begun
        if length > 0.5 * self._stretch:
            self._stretch = max(_SHORTEST, self._stretch * min(2.0, _MOMENT / max(took, 1e-9)))


def _of(controller: Controller, name: str) -> str:
    return f"{type(controller).__name__}.{name}"
