"""Walking trials batch by batch, alone or with other processes that keep theirs in the same folder."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence

import xarray as xr

from chilopod.errors import AnalysisError
from chilopod.trials.batch import NOT_KEPT, batches
from chilopod.trials.claims import Claims
from chilopod.trials.executors import Executor
from chilopod.trials.store import Store
from chilopod.trials.trial import Trial

Walked = list[tuple[Trial, xr.Dataset]]

_LOOK = 0.2  # s between two looks whether other processes are done
_PATIENCE = 120.0  # s in which they have to be done with one trial; one that is stopped never is


def alone(share: Iterable[list[Trial]], executor: Executor) -> Iterator[tuple[Walked, int]]:
    """Walks in the form of :func:`shared`, where nothing is kept."""
    for walked in _walked(share, executor):
        for _, record in walked:
            record.attrs.pop(NOT_KEPT, None)
        yield walked, 0


def shared(trials: Sequence[Trial], store: Store, executor: Executor) -> Iterator[tuple[Walked, int]]:
    """Trials with their records, walked here or by others, and for how many of the others we wait."""
    with store.claims() as claims:
        left, moved, patient = list(trials), time.monotonic(), True
        while left:
            part = _Part(store, claims, patient)
            for walked in _walked(executor.cut(batches(left)), executor, part.free):
                for trial, record in walked:
                    store.write(trial, record)
                store.sync()
                for trial, _ in walked:
                    claims.release(trial.file_name)
                yield walked, 0
            for trial in part.brought:
                found = store.read(trial)
                if found is None:
                    part.elsewhere.append(trial)
                else:
                    yield [(trial, found)], 0
            yield [], len(part.elsewhere)
            now = time.monotonic()
            moved = now if len(part.elsewhere) < len(left) else moved
            left, patient = part.elsewhere, now - moved < _PATIENCE
            if left and patient:
                time.sleep(_LOOK)


def _walked(
    share: Iterable[list[Trial]], executor: Executor, free: Callable[[list[Trial]], list[Trial]] = list
) -> Iterator[Walked]:
    """Batches of trials with their records; ``free`` says which of a batch are to be walked when it is begun."""
    begun: list[list[Trial]] = []

    def taken() -> Iterator[list[Trial]]:
        for batch in share:
            mine = free(batch)
            if mine:
                begun.append(mine)
                yield mine

    for index, records in executor.walk(taken()):
        walked = list(zip(begun[index], records, strict=True))
        for trial, record in walked:
            if record.attrs.get("trial") != trial.text:
                raise AnalysisError(
                    "gave the record of another trial, or one that other code walked", field=type(executor).__name__
                )
        yield walked


class _Part:
    """Part of a study that is walked here, what other processes walk, and what they have brought meanwhile."""

    def __init__(self, store: Store, claims: Claims, patient: bool) -> None:
        self._store, self._claims, self._patient = store, claims, patient
        self.elsewhere: list[Trial] = []
        self.brought: list[Trial] = []

    def free(self, batch: list[Trial]) -> list[Trial]:
        """Those of a batch that are to be walked here; they are claimed."""
        mine = []
        for trial in batch:
            if not self._claims.take(trial.file_name) and self._patient:
                self.elsewhere.append(trial)
            elif self._store.has(trial):
                self._claims.release(trial.file_name)
                self.brought.append(trial)
            else:
                mine.append(trial)
        return mine
