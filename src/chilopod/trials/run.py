"""Running trials: in batches on all cores, each batch's records written as soon as it is done."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from chilopod.output import check_room
from chilopod.progress import Progress, silent
from chilopod.record import check_memory
from chilopod.trials.batch import batches
from chilopod.trials.description import meanwhile_unchanged
from chilopod.trials.executors import Executor, current
from chilopod.trials.sharing import alone, shared
from chilopod.trials.store import Store
from chilopod.trials.trial import Trial

_COPIES = 2  # of a record: as the engine has it and as it is given; of many, each and all together


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
        Folder of the records, see :class:`chilopod.trials.Store`; without one nothing is kept. Several processes that
        are given the same one share the work: each walks what no other has begun, and waits for the others' at the end.
    progress
        Called with the part done (0 to 1) and a few words.
    executor
        Executor that walks the batches; by default what :func:`using` says, and without that all cores of this machine.
        The records are the same to the bit.

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
    trials = as_now(trials)
    check_fits(trials)
    records = {trial.file_name: record for trial, record in _each(trials, folder, progress, executor)}
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
    yield from _each(as_now(trials), folder, progress, executor)


def _each(
    trials: Sequence[Trial], folder: str | Path | None, progress: Progress, executor: Executor | None
) -> Iterator[tuple[Trial, xr.Dataset]]:
    store = None if folder is None else Store(folder)
    asked = {trial.file_name: trial for trial in trials}
    kept = [trial for trial in asked.values() if store and store.has(trial)]
    executor, done = current() if executor is None else executor, len(kept)

    def walk(missing: Sequence[Trial]) -> Iterator[tuple[Trial, xr.Dataset]]:
        nonlocal done
        if store:
            check_room(store.folder, sum(trial.least_bytes for trial in missing))
        share = batches(missing)
        check_memory(_COPIES * max((sum(trial.least_bytes for trial in batch) for batch in share), default=0.0))
        progress(done / max(len(asked), 1), f"{done} of {len(asked)} trials")
        steps = shared(missing, store, executor) if store and missing else alone(executor.cut(share), executor)
        for walked, elsewhere in steps:
            yield from walked
            done += len(walked)
            words = f"{done} of {len(asked)} trials{executor.words}"
            progress(done / len(asked), f"{words}, {elsewhere} walked by another process" if elsewhere else words)

    # What is missing comes first: a study that is killed again and again gets on however much is there to be read.
    there = {trial.file_name for trial in kept}
    yield from walk([trial for name, trial in asked.items() if name not in there])
    damaged = []
    for trial in kept:
        found = store.read(trial) if store else None
        if found is None:
            damaged.append(trial)
        else:
            yield trial, found
    if damaged:
        done -= len(damaged)
        yield from walk(damaged)
    progress(1.0, f"{len(asked)} trials")


def as_now(trials: Sequence[Trial]) -> list[Trial]:
    """The same trials, with the code and the fields of their controllers as they are now."""
    found = [trial.as_now() for trial in trials]
    with meanwhile_unchanged():
        for trial in found:
            trial.file_name  # noqa: B018  (from here on it is known what each is)
    return found


def together(records: Sequence[xr.Dataset]) -> xr.Dataset:
    """Records of one duration and rate as one dataset over ``robot``."""
    joined = xr.concat(records, dim="robot", data_vars="minimal", coords="minimal", compat="override", join="override")
    return joined.assign_coords(robot=np.arange(len(records)))
