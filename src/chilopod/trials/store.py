"""Folder of records whose files are verified or treated as missing."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from chilopod.errors import OutputError
from chilopod.netcdf import UnsoundError
from chilopod.output import check_folder, made_folder, sync_folder, write_atomic
from chilopod.trials.batch import NOT_KEPT
from chilopod.trials.claims import Claims
from chilopod.trials.file import content_of, read_record
from chilopod.trials.trial import Trial

if TYPE_CHECKING:
    import xarray as xr

_UNFINISHED = ".chilopod-trial-"
_logger = logging.getLogger(__name__)


class Store:
    """Folder that keeps the records of trials, each in a netCDF-3 file.

    Every file is complete or absent, has a name derived from everything that defines its trial, holds that as text, and
    has a checksum over all of its bytes. Many processes may use one folder at the same time: they share the work, and
    equal trials give equal files. A missing folder is created with the first record. ``tell`` receives a line about
    every faulty file; by default it is the logger of this module.

    Raises OutputError if files cannot be written into the folder.
    """

    def __init__(self, folder: str | Path, tell: Callable[[str], object] = _logger.warning) -> None:
        self.folder = check_folder(folder)
        self._tell, self._said = tell, set[str]()

    def has(self, trial: Trial) -> bool:
        """True if the folder has a file with the name of a trial's record."""
        return os.path.lexists(self.folder / trial.file_name)

    def read(self, trial: Trial) -> xr.Dataset | None:
        """Return the record of a trial, or None if it is missing.

        A file that is damaged, was edited, or holds another trial counts as missing and gets the ending ``.aside``.
        Raises OutputError if it cannot be moved, or memory to read it is missing.
        """
        path = self.folder / trial.file_name
        try:
            record = read_record(path)
            if record.attrs.get("trial") != trial.text:
                raise UnsoundError("holds another trial")
            return record
        except FileNotFoundError:
            return None
        except UnsoundError as error:
            self._move_aside(path, str(error))
            return None

    def write(self, trial: Trial, record: xr.Dataset) -> None:
        """Keep a record, durably once :meth:`sync` has been called, unless it is marked as not to be kept. Raises
        OutputError for another trial's record, or if the file cannot be written."""
        if record.attrs.get("trial") != trial.text:
            problem = "must belong to this trial and to this code"
            raise OutputError(problem, field="record", allowed=f"a record for {trial.file_name}")
        if NOT_KEPT in record.attrs:
            words = trial.not_kept(record.attrs.pop(NOT_KEPT))
            if words not in self._said:
                self._tell(words)
            self._said.add(words)
            return
        # A folder that is deleted while trials walk is created again; only its old content is lost.
        write_atomic(self.folder / trial.file_name, content_of(record), durable=True, temporary=_UNFINISHED)

    @contextmanager
    def claims(self) -> Iterator[Claims]:
        """Return the claims of this process in the folder, which is created; other processes walk other trials."""
        with made_folder(self.folder), Claims(self.folder, self._sweep) as claims:
            yield claims

    def sync(self) -> None:
        """Make all written records survive a power failure."""
        with suppress(FileNotFoundError):  # it was deleted
            sync_folder(self.folder)

    def _move_aside(self, path: Path, why: str) -> None:
        aside, count = path.with_name(f"{path.name}.aside"), 1
        while os.path.lexists(aside):
            count += 1
            aside = path.with_name(f"{path.name}.aside{count}")
        try:
            path.rename(aside)
        except FileNotFoundError:
            return  # another process was faster
        except OSError as error:
            raise OutputError(f"{why}, and cannot be moved aside ({error.strerror})", source=str(path)) from None
        self._tell(f"{path} {why}: walked again; the old file is now {aside.name}")

    def _sweep(self) -> None:
        """Remove unfinished files of killed processes."""
        for path in self.folder.glob(f"{_UNFINISHED}*"):
            path.unlink()
