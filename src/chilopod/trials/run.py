"""Running trials: in batches on all cores, each batch's records written as soon as it is done."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from chilopod.output import check_room
from chilopod.progress import Progress, silent
from chilopod.record import check_memory
from chilopod.trials.batch import batches
from chilopod.trials.claims import Claims
from chilopod.trials.executors import Executor, current
from chilopod.trials.store import Store
from chilopod.trials.trial import Trial

_LOOK = 0.2  # s between two looks whether other processes are done
_PATIENCE = 120.0  # s in which they have to be done with one trial; one that is stopped never is
_COPIES = 2  # of a record: as the engine has it and as it is given; of many, each and all together

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
        In any order; the same trial may occur twice. All their records have to fit into memory, see :func:`run_each`.
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

    Raises
    ------
    ParameterError
        If memory cannot hold the records.
    OutputError
        If the folder has no room for them.
    """
    check_fits(trials)
    records = {trial.file_name: record for trial, record in run_each(trials, folder, progress, executor)}
    return [records[trial.file_name] for trial in trials]


def check_fits(trials: Sequence[Trial]) -> None:
    """Refuse trials whose records memory cannot hold all together.

    Raises
    ------
    ParameterError
        With what they would take.
    """
    check_memory(_COPIES * sum(trial.least_bytes for trial in trials))


def run_each(
    trials: Sequence[Trial],
    folder: str | Path | None = None,
    progress: Progress = silent,
    executor: Executor | None = None,
) -> Iterator[tuple[Trial, xr.Dataset]]:
    """Run trials, or read what has been run before, and give each different one and its record as soon as it is there,
    in any order: memory holds a batch at a time.

    Parameters
    ----------
    trials, folder, progress, executor
        As for :func:`run`.
    """
    store = None if folder is None else Store(folder)
    asked = {trial.file_name: trial for trial in trials}
    missing = []
    for trial in asked.values():
        found = store.read(trial) if store else None
        if found is None:
            missing.append(trial)
        else:
            yield trial, found
    if store:
        check_room(store.folder, sum(trial.least_bytes for trial in missing))
    executor = current() if executor is None else executor
    share = executor.cut(batches(missing))
    check_memory(_COPIES * max((sum(trial.least_bytes for trial in batch) for batch in share), default=0.0))
    done = len(asked) - len(missing)
    progress(done / max(len(asked), 1), f"{done} of {len(asked)} trials")
    for walked, elsewhere in _shared(missing, store, executor) if store and missing else _alone(share, executor):
        yield from walked
        done += len(walked)
        words = f"{done} of {len(asked)} trials{executor.words}"
        progress(done / len(asked), f"{words}, {elsewhere} walked by another process" if elsewhere else words)
    progress(1.0, f"{len(asked)} trials")


def _walked(
    share: Sequence[list[Trial]], executor: Executor, free: Callable[[list[Trial]], list[Trial]] = list
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
        yield list(zip(begun[index], records, strict=True))


def _alone(share: Sequence[list[Trial]], executor: Executor) -> Iterator[tuple[Walked, int]]:
    """What :func:`_shared` gives, where nothing is kept."""
    for walked in _walked(share, executor):
        yield walked, 0


def _shared(trials: Sequence[Trial], store: Store, executor: Executor) -> Iterator[tuple[Walked, int]]:
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


class _Part:
    """What of a study is to be walked here, what other processes walk, and what they have brought meanwhile."""

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


def together(records: Sequence[xr.Dataset]) -> xr.Dataset:
    """Records of one duration and rate as one dataset over ``robot``."""
    joined = xr.concat(records, dim="robot", data_vars="minimal", coords="minimal", compat="override", join="override")
    return joined.assign_coords(robot=np.arange(len(records)))
