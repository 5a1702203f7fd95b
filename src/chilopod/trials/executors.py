"""Where trials walk: what every executor does, the one of this machine, and which one is in use."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Protocol

from chilopod.cores import cores
from chilopod.engine.named import engine_named

if TYPE_CHECKING:
    import xarray as xr

    from chilopod.trials.trial import Trial

_SECONDS = 2.5  # of work in a batch, about
_USUAL = 10.0  # s of a walk of which a core walks as many as an engine says, until it is known better
_LANES = 8  # robots that a core walks at once in the planar model


class Executor(Protocol):
    """Walks batches of trials, somewhere: the same trial has the same bits on every executor."""

    @property
    def words(self) -> str:
        """Name of the place, to be put behind "3 of 7 trials"; empty on this machine alone."""
        ...

    def cut(self, batches: Sequence[list[Trial]]) -> Iterable[list[Trial]]:
        """The same batches in order, those that are too large in pieces; each is cut when it is taken."""
        ...

    def walk(self, batches: Iterable[Sequence[Trial]]) -> Iterator[tuple[int, list[xr.Dataset]]]:
        """The number of a batch and its records, of every batch as soon as it is done, in any order. A batch is taken
        when its walk begins, not before: what nobody has begun, another process may. Who stops taking records stops the
        walks."""
        ...


class Pace:
    """How many trials are a few seconds' work, by how long the last ones took: what somebody is killed at is lost."""

    def __init__(self) -> None:
        self._speeds: dict[str, float] = {}  # of engines: s of walks that a core does in a second

    def pieces(self, batch: Sequence[Trial], threads: int) -> Iterator[list[Trial]]:
        """A batch in pieces for so many threads, each cut when it is taken: all lanes full, else at least all threads
        busy."""
        done = 0
        while done < len(batch):
            first = batch[done]
            speed = self._speeds.get(first.engine, engine_named(first.engine).traits.a_core * _USUAL / _SECONDS)
            most = int(threads * speed * _SECONDS / first.duration)
            unit = threads * _LANES if most >= threads * _LANES else threads
            size = max(threads, most // unit * unit)
            yield list(batch[done : done + size])
            done += size

    def took(self, batch: Sequence[Trial], threads: int, seconds: float) -> None:
        """Learn how long a batch took, s."""
        walks = sum(trial.duration for trial in batch) / min(threads, len(batch))
        self._speeds[batch[0].engine] = walks / max(seconds, 1e-9)


class Here:
    """This machine: one batch after the other, each on all cores."""

    words = ""
    _pace = Pace()  # of this process

    def cut(self, batches: Sequence[list[Trial]]) -> Iterator[list[Trial]]:
        """The same batches, in pieces of a few seconds' work."""
        for batch in batches:
            yield from self._pace.pieces(batch, cores())

    def walk(self, batches: Iterable[Sequence[Trial]]) -> Iterator[tuple[int, list[xr.Dataset]]]:
        """One after the other."""
        from chilopod.trials.batch import walked

        for index, batch in enumerate(batches):
            begun = time.monotonic()
            records = walked(batch)
            self._pace.took(batch, cores(), time.monotonic() - begun)
            yield index, records


_CURRENT: ContextVar[Executor | None] = ContextVar("executor", default=None)


def current() -> Executor:
    """The executor in use: that of the innermost :func:`using` around, else this machine."""
    return _CURRENT.get() or Here()


@contextmanager
def using(executor: Executor) -> Iterator[None]:
    """Let everything that runs trials in this block, studies and tasks included, run them there, in this thread and in
    tasks of asyncio made in the block, not in threads started in it."""
    token = _CURRENT.set(executor)
    try:
        yield
    finally:
        _CURRENT.reset(token)
