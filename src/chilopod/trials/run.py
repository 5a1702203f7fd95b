"""Running trials: in batches on all cores, each batch's records written as soon as it is done."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from chilopod.progress import Progress, silent
from chilopod.trials.batch import batches
from chilopod.trials.executors import Executor, current
from chilopod.trials.store import Store
from chilopod.trials.trial import Trial


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
        Where records are kept, see :class:`chilopod.trials.Store`; without one nothing is kept.
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
    store = None if folder is None else Store(folder)
    asked = {trial.file_name: trial for trial in trials}
    records: dict[str, xr.Dataset] = {}
    for name, trial in asked.items() if store else ():
        found = store.read(trial) if store else None
        if found is not None:
            records[name] = found
    executor = current() if executor is None else executor
    share = executor.cut(batches([trial for name, trial in asked.items() if name not in records]))
    progress(len(records) / max(len(asked), 1), f"{len(records)} of {len(asked)} trials")
    for index, walked in executor.walk(share):
        for trial, record in zip(share[index], walked, strict=True):
            if store:
                store.write(trial, record)
            records[trial.file_name] = record
        if store:
            store.sync()
        progress(len(records) / len(asked), f"{len(records)} of {len(asked)} trials{executor.words}")
    progress(1.0, f"{len(records)} trials")
    return [records[trial.file_name] for trial in trials]


def together(records: Sequence[xr.Dataset]) -> xr.Dataset:
    """Records of one duration and rate as one dataset over ``robot``."""
    joined = xr.concat(records, dim="robot", data_vars="minimal", coords="minimal", compat="override", join="override")
    return joined.assign_coords(robot=np.arange(len(records)))
