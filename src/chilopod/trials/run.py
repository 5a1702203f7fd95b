"""Runs of trials, batch by batch, alone or with other processes that use the same folder."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from chilopod.errors import AnalysisError, OutputError
from chilopod.output import check_room
from chilopod.progress import Progress, silent
from chilopod.record import check_memory
from chilopod.trials.batch import NOT_KEPT, Executor, batches, current
from chilopod.trials.description import meanwhile_unchanged
from chilopod.trials.store import Store
from chilopod.trials.trial import Trial

Folder = str | Path | None
_Walked = list[tuple[Trial, xr.Dataset]]

_COPIES = 2  # of a record: as the engine has it and as it is given; of many, each and all together
_LOOK = 0.2  # s between two looks whether other processes are done
_PATIENCE = 120.0  # s in which another process must finish a trial; a stopped process never does


def run(
    trials: Sequence[Trial], folder: Folder = None, progress: Progress = silent, executor: Executor | None = None
) -> list[xr.Dataset]:
    """Run trials, or read the records of previous runs; return the record of every trial, with one ``robot`` and the
    trial in the attributes. Raises ParameterError or OutputError if memory cannot hold the records, or the folder has
    no room for them; if it holds trials already, they are given all the same, and one line says that they are not kept.

    Parameters
    ----------
    trials
        Trials in any order, with repetitions allowed. All their records must fit into memory, see :func:`run_each`.
    folder
        Folder of the records, see :class:`chilopod.trials.Store`; None keeps nothing. Several processes with the same
        folder share the work: each walks trials that no other has begun, and waits for the others at the end.
    progress
        Function of the fraction done (0 to 1) and a few words.
    executor
        Executor that walks the batches; by default that of :func:`using`, else all cores of this machine.
    """
    trials = as_now(trials)
    check_fits(trials)
    records = {trial.file_name: record for trial, record in _each(trials, folder, progress, executor)}
    return [records[trial.file_name] for trial in trials]


def check_fits(trials: Sequence[Trial]) -> None:
    """Raise ParameterError if memory cannot hold the records of trials all together."""
    check_memory(_COPIES * sum(trial.least_bytes for trial in trials))


def run_each(
    trials: Sequence[Trial], folder: Folder = None, progress: Progress = silent, executor: Executor | None = None
) -> Iterator[tuple[Trial, xr.Dataset]]:
    """Run or read trials as :func:`run` does, and yield each distinct trial and its record as soon as it is ready, in
    any order. Memory holds one batch at a time."""
    yield from _each(as_now(trials), folder, progress, executor)


def _each(
    trials: Sequence[Trial], folder: Folder, progress: Progress, executor: Executor | None
) -> Iterator[tuple[Trial, xr.Dataset]]:
    distinct = {trial.file_name: trial for trial in trials}
    store = None if folder is None else Store(folder)
    kept = {name: trial for name, trial in distinct.items() if store and store.has(trial)}
    study = _Study(store, current() if executor is None else executor, progress, len(distinct), len(kept))
    # Missing trials come first, so that a study that is killed repeatedly progresses however much there is to read.
    yield from study.walk([trial for name, trial in distinct.items() if name not in kept])
    damaged = []
    for trial in kept.values():
        found = store.read(trial) if store else None
        if found is None:
            damaged.append(trial)
        else:
            yield trial, found
    if damaged:
        study.done -= len(damaged)
        yield from study.walk(damaged)
    progress(1.0, f"{len(distinct)} trials")


def as_now(trials: Sequence[Trial]) -> list[Trial]:
    """Trials with the current code and fields of their controllers."""
    found = [trial.as_now() for trial in trials]
    with meanwhile_unchanged():
        for trial in found:
            trial.file_name  # noqa: B018  (fixes the identity of each trial)
    return found


def together(records: Sequence[xr.Dataset]) -> xr.Dataset:
    """Records of one duration and rate as one dataset over ``robot``."""
    joined = xr.concat(records, dim="robot", data_vars="minimal", coords="minimal", compat="override", join="override")
    return joined.assign_coords(robot=np.arange(len(records)))


class _Study:
    """Progress of a study: number of trials in all and done."""

    def __init__(self, store: Store | None, executor: Executor, progress: Progress, total: int, done: int) -> None:
        self._store, self._executor, self._progress = store, executor, progress
        self._total, self.done = total, done

    def walk(self, missing: Sequence[Trial]) -> Iterator[tuple[Trial, xr.Dataset]]:
        """Yield trials with their records, walked here or by other processes in the same folder."""
        if self._store:
            self._check_room(self._store, sum(trial.least_bytes for trial in missing))
        share = batches(missing)
        check_memory(_COPIES * max((sum(trial.least_bytes for trial in batch) for batch in share), default=0.0))
        self._progress(self.done / max(self._total, 1), f"{self.done} of {self._total} trials")
        if self._store and missing:
            yield from self._shared(missing, self._store)
            return
        for walked in self._walked(self._executor.cut(share)):
            for _, record in walked:
                record.attrs.pop(NOT_KEPT, None)
            yield from self._given(walked)

    def _check_room(self, store: Store, needed: float) -> None:
        """Refuse a study whose folder lacks room. If it holds trials, as those of a study before in the same command,
        others are walked and not kept: a refusal would lose what the former came to."""
        try:
            check_room(store.folder, needed)
        except OutputError:
            if not store.holds_trials:
                raise
            store.tell_unkept("there is no room")
            self._store = None

    def _shared(self, missing: Sequence[Trial], store: Store) -> Iterator[tuple[Trial, xr.Dataset]]:
        with store.claims() as claims:
            left, moved, patient = list(missing), time.monotonic(), True
            brought, elsewhere = list[Trial](), list[Trial]()  # by other processes meanwhile; still with them

            def free(batch: list[Trial]) -> list[Trial]:
                """Trials of a batch that this process walks, claimed for it."""
                mine = []
                for trial in batch:
                    if not claims.take(trial.file_name) and patient:
                        elsewhere.append(trial)
                    elif store.has(trial):
                        claims.release(trial.file_name)
                        brought.append(trial)
                    else:
                        mine.append(trial)
                return mine

            while left:
                for walked in self._walked(self._executor.cut(batches(left)), free):
                    for trial, record in walked:
                        store.keep(trial, record)
                    store.sync()
                    for trial, _ in walked:
                        claims.release(trial.file_name)
                    yield from self._given(walked)
                for trial in brought:
                    found = store.read(trial)
                    if found is None:
                        elsewhere.append(trial)
                    else:
                        yield from self._given([(trial, found)])
                yield from self._given([], len(elsewhere))
                now = time.monotonic()
                moved = now if len(elsewhere) < len(left) else moved
                left, patient = elsewhere.copy(), now - moved < _PATIENCE
                brought.clear()
                elsewhere.clear()
                if left and patient:
                    time.sleep(_LOOK)

    def _given(self, walked: _Walked, elsewhere: int = 0) -> Iterator[tuple[Trial, xr.Dataset]]:
        """Yield trials with their records, which count as done once they have been taken."""
        yield from walked
        self.done += len(walked)
        words = f"{self.done} of {self._total} trials{self._executor.words}"
        waiting = f", {elsewhere} walked by another process" if elsewhere else ""
        self._progress(self.done / self._total, f"{words}{waiting}")

    def _walked(
        self, share: Iterable[list[Trial]], free: Callable[[list[Trial]], list[Trial]] = list
    ) -> Iterator[_Walked]:
        """Yield batches of trials with their records; ``free`` selects the trials of a batch to walk when it begins."""
        begun: list[list[Trial]] = []

        def taken() -> Iterator[list[Trial]]:
            for batch in share:
                mine = free(batch)
                if mine:
                    begun.append(mine)
                    yield mine

        for index, records in self._executor.walk(taken()):
            walked = list(zip(begun[index], records, strict=True))
            for trial, record in walked:
                if record.attrs.get("trial") != trial.text:
                    problem = "must return the record of this trial, computed by this code"
                    raise AnalysisError(problem, field=type(self._executor).__name__)
            yield walked
