"""Running trials: in batches on all cores, each batch's records written as soon as it is done."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from chilopod.progress import Progress, silent
from chilopod.trials.batch import batches
from chilopod.trials.claims import Claims
from chilopod.trials.executors import Executor, current
from chilopod.trials.store import Store
from chilopod.trials.trial import Trial

_LOOK = 0.2  # s between two looks whether other processes are done
_PATIENCE = 120.0  # s in which they have to be done with one trial; one that is stopped never is

Walked = list[tuple[Trial, xr.Dataset]]


def run(
    trials: Sequence[Trial],
    folder: str | Path | None = None,
    progress: Progress = silent,
    executor: Executor | None = None,
) -> list[xr.Dataset]:
    """Run trials, or read what has been run before.

    Parameters
    ----------
    trials
        In any order; the same trial may occur twice.
    folder
        Where records are kept, see :class:`chilopod.trials.Store`; without one nothing is kept. Several processes that
        are given the same one share the work: each walks what no other has begun, and waits for the others' at the end.
    progress
        Called with the part done (0 to 1) and a few words.
    executor
        What walks the batches; by default what :func:`using` says, and without that all cores of this machine. The
        records are the same to the bit.

    Returns
    -------
    The record of every trial, see :func:`chilopod.planar.simulate` and :func:`chilopod.twin.simulate`, with one
    ``robot`` and the trial in the attributes.
    """
    executor = current() if executor is None else executor
    asked = {trial.file_name: trial for trial in trials}
    records: dict[str, xr.Dataset] = {}
    ours = list(asked.values())
    come = _shared(ours, Store(folder), executor) if folder is not None else _alone(ours, executor)
    for walked, elsewhere in come:
        records.update((trial.file_name, record) for trial, record in walked)
        words = f"{len(records)} of {len(asked)} trials{executor.words}"
        told = f"{words}, {elsewhere} walked by another process" if elsewhere else words
        progress(len(records) / max(len(asked), 1), told)
    progress(1.0, f"{len(records)} trials")
    return [records[trial.file_name] for trial in trials]


def _walked(
    trials: Sequence[Trial], executor: Executor, free: Callable[[list[Trial]], list[Trial]] = list
) -> Iterator[Walked]:
    """Trials with their records, batch by batch; ``free`` says which of a batch are to be walked when it is begun."""
    begun: list[list[Trial]] = []

    def taken() -> Iterator[list[Trial]]:
        for batch in executor.cut(batches(trials)):
            mine = free(batch)
            if mine:
                begun.append(mine)
                yield mine

    for index, records in executor.walk(taken()):
        yield list(zip(begun[index], records, strict=True))


def _alone(trials: Sequence[Trial], executor: Executor) -> Iterator[tuple[Walked, int]]:
    """What :func:`_shared` gives, where nothing is kept."""
    yield [], 0
    for walked in _walked(trials, executor):
        yield walked, 0


def _shared(trials: Sequence[Trial], store: Store, executor: Executor) -> Iterator[tuple[Walked, int]]:
    """Trials with their records, from the store or walked, and how many other processes walk that we wait for."""
    with store.claims() as claims:
        there = [(trial, record) for trial in trials if (record := store.read(trial)) is not None]
        yield there, 0
        names = {trial.file_name for trial, _ in there}
        left = [trial for trial in trials if trial.file_name not in names]
        moved, patient = time.monotonic(), True
        while left:
            share = _Share(store, claims, patient)
            for walked in _walked(left, executor, share.free):
                for trial, record in walked:
                    store.write(trial, record)
                store.sync()
                for trial, _ in walked:
                    claims.release(trial.file_name)
                yield walked, 0
            yield share.brought, len(share.elsewhere)
            now = time.monotonic()
            moved = now if len(share.elsewhere) < len(left) else moved
            left, patient = share.elsewhere, now - moved < _PATIENCE
            if left and patient:
                time.sleep(_LOOK)


class _Share:
    """What of a study is to be walked here, what other processes walk, and what they have brought meanwhile."""

    def __init__(self, store: Store, claims: Claims, patient: bool) -> None:
        self._store, self._claims, self._patient = store, claims, patient
        self.elsewhere: list[Trial] = []
        self.brought: Walked = []

    def free(self, batch: list[Trial]) -> list[Trial]:
        """Those of a batch that are to be walked here; they are claimed."""
        mine = []
        for trial in batch:
            if not self._claims.take(trial.file_name) and self._patient:
                self.elsewhere.append(trial)
            elif (record := self._store.read(trial)) is None:
                mine.append(trial)
            else:
                self._claims.release(trial.file_name)
                self.brought.append((trial, record))
        return mine


def together(records: Sequence[xr.Dataset]) -> xr.Dataset:
    """Records of one duration and rate as one dataset over ``robot``."""
    joined = xr.concat(records, dim="robot", data_vars="minimal", coords="minimal", compat="override", join="override")
    return joined.assign_coords(robot=np.arange(len(records)))
