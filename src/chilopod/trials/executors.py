"""Executors, which run batches of trials: their interface, the one of this machine, and the one in use."""

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
_USUAL = 10.0  # s of a walk of which a core walks the engine's ``robots_per_core``, until measured
_LANES = 8  # robots that a core walks at once in the planar model


class Executor(Protocol):
    """Executor of batches of trials; results are equal to the bit on every executor."""

    @property
    def words(self) -> str:
        """Name of the place, to be put behind "3 of 7 trials"; empty on this machine alone."""
        ...

    def cut(self, batches: Sequence[list[Trial]]) -> Iterable[list[Trial]]:
        """Yield the same batches in order, large ones in pieces; each is cut when it is taken."""
        ...

    def walk(self, batches: Iterable[Sequence[Trial]]) -> Iterator[tuple[int, list[xr.Dataset]]]:
        """Yield the number and the records of every batch as soon as it is done, in any order. A batch is taken when
        its walk begins, so that other processes may take those not yet begun. The walks stop when the generator is
        closed."""
        ...


class Pace:
    """Estimate of the trials in a few seconds of work from the time of the last ones; a kill loses the current
    batch."""

    def __init__(self) -> None:
        self._speeds: dict[str, float] = {}  # of engines: s of walks that a core does in a second

    def pieces(self, batch: Sequence[Trial], threads: int) -> Iterator[list[Trial]]:
        """Yield a batch in pieces for a number of threads, each cut when it is taken: all lanes full, or at least all
        threads busy."""
        done = 0
        while done < len(batch):
            first = batch[done]
            speed = self._speeds.get(
                first.engine, engine_named(first.engine).traits.robots_per_core * _USUAL / _SECONDS
            )
            most = int(threads * speed * _SECONDS / first.duration)
            unit = threads * _LANES if most >= threads * _LANES else threads
            size = max(threads, most // unit * unit)
            yield list(batch[done : done + size])
            done += size

    def took(self, batch: Sequence[Trial], threads: int, seconds: float) -> None:
        """Record the time that a batch took, s."""
        walks = sum(trial.duration for trial in batch) / min(threads, len(batch))
        self._speeds[batch[0].engine] = walks / max(seconds, 1e-9)


class Here:
    """Executor of this machine: one batch after the other, each on all cores."""

    words = ""
    _pace = Pace()  # of this process

    def cut(self, batches: Sequence[list[Trial]]) -> Iterator[list[Trial]]:
        """Yield the same batches in pieces of a few seconds of work."""
        for batch in batches:
            yield from self._pace.pieces(batch, cores())

    def walk(self, batches: Iterable[Sequence[Trial]]) -> Iterator[tuple[int, list[xr.Dataset]]]:
        """Walk one batch after the other."""
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
    """Use an executor for all trials within this block, studies and tasks included, in this thread and in tasks of
    asyncio made in the block, but not in threads started in it."""
    token = _CURRENT.set(executor)
    try:
        yield
    finally:
        _CURRENT.reset(token)
