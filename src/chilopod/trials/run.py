"""Running trials: in batches, each batch's records written as soon as it is done."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from chilopod.output import prepare_folder, write_atomic
from chilopod.progress import Progress, silent
from chilopod.trials.batch import batches
from chilopod.trials.executors import Executor, current
from chilopod.trials.store import as_bytes, read
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
        Where records are kept; without one nothing is kept.
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
    if folder is not None:
        folder = prepare_folder(folder)
    names = [trial.file_name for trial in trials]
    missing = dict(zip(names, trials, strict=True))
    records: dict[str, xr.Dataset] = {}
    if folder is not None:
        for name in list(missing):
            found = read(folder / name)
            if found is not None:
                records[name] = found
                del missing[name]
    executor = current() if executor is None else executor
    done, total = len(records), len(records | missing)
    share = executor.cut(batches(list(missing.items())))
    progress(done / max(total, 1), f"{done} of {total} trials")
    for index, walked in executor.walk([[trial for _, trial in batch] for batch in share]):
        for (name, _), record in zip(share[index], walked, strict=True):
            if folder is not None:
                write_atomic(folder / name, as_bytes(record))
            records[name] = record
            done += 1
        progress(done / total, f"{done} of {total} trials{executor.words}")
    progress(1.0, f"{done} trials")
    return [records[name] for name in names]


def together(records: Sequence[xr.Dataset]) -> xr.Dataset:
    """Records of one duration and rate as one dataset over ``robot``."""
    joined = xr.concat(records, dim="robot", data_vars="minimal", coords="minimal", compat="override", join="override")
    return joined.assign_coords(robot=np.arange(len(records)))
