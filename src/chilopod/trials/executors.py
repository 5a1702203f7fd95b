"""Where trials walk: what every executor does, the one of this machine, and which one is in use."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Protocol, TypeVar

if TYPE_CHECKING:
    import xarray as xr

    from chilopod.trials.trial import Trial

T = TypeVar("T")


class Executor(Protocol):
    """Walks batches of trials, somewhere.

    The records do not depend on where: the same trial has the same bits on every executor.
    """

    @property
    def words(self) -> str:
        """Where, to be put behind "3 of 7 trials"; empty on this machine alone."""
        ...

    def cut(self, batches: list[list[T]]) -> list[list[T]]:
        """The same batches, those that are too large to be shared out evenly in pieces."""
        ...

    def walk(self, batches: Iterable[Sequence[Trial]]) -> Iterator[tuple[int, list[xr.Dataset]]]:
        """The number of a batch and its records, of every batch as soon as it is done, in any order.

        A batch is taken when its walk begins, not before: what nobody has begun, another process may. Whoever takes
        records writes them; one who stops taking them stops the walks.
        """
        ...


class Here:
    """This machine: one batch after the other, each on all cores."""

    words = ""

    def cut(self, batches: list[list[T]]) -> list[list[T]]:
        """The same batches."""
        return batches

    def walk(self, batches: Iterable[Sequence[Trial]]) -> Iterator[tuple[int, list[xr.Dataset]]]:
        """One after the other."""
        from chilopod.trials.batch import walked

        for index, batch in enumerate(batches):
            yield index, walked(batch)


_CURRENT: ContextVar[Executor | None] = ContextVar("executor", default=None)


def current() -> Executor:
    """The executor in use: that of the innermost :func:`using` around, else this machine."""
    return _CURRENT.get() or Here()


@contextmanager
def using(executor: Executor) -> Iterator[None]:
    """Let everything that runs trials in this block, studies and tasks included, run them there.

    It holds for this thread and for tasks of asyncio made in the block, not for threads started in it: these have
    to say it again.
    """
    token = _CURRENT.set(executor)
    try:
        yield
    finally:
        _CURRENT.reset(token)
