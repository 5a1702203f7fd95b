"""Folder of records whose files, netCDF-3 with a seal behind it, are verified or treated as missing."""

from __future__ import annotations

import io
import logging
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.io import netcdf_file

from chilopod.errors import OutputError, in_words
from chilopod.netcdf import UnsoundError, sealed, sealed_file, unsealed
from chilopod.output import check_folder, made_folder, sync_folder, write_atomic
from chilopod.trials.batch import NOT_KEPT
from chilopod.trials.claims import Claims
from chilopod.trials.trial import Trial

_UNFINISHED = ".chilopod-trial-"
_DAMAGES = (ValueError, TypeError, LookupError, AttributeError, OverflowError)
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

    @property
    def holds_trials(self) -> bool:
        """True if the folder has the file of any trial."""
        return any(self.folder.glob("*.nc"))

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
            self._tell_once(trial.not_kept(record.attrs.pop(NOT_KEPT)))
            return
        # A folder that is deleted while trials walk is created again; only its old content is lost.
        write_atomic(self.folder / trial.file_name, content_of(record), durable=True, temporary=_UNFINISHED)

    def keep(self, trial: Trial, record: xr.Dataset) -> None:
        """Keep a record as :meth:`write` does, or say in one line why its file, and others, cannot be written."""
        try:
            self.write(trial, record)
        except OutputError as error:
            if error.source is None:  # the record is faulty
                raise
            self.tell_unkept(error.problem)

    def tell_unkept(self, why: str) -> None:
        """Say once why trials are not kept."""
        self._tell_once(f"{self.folder}: trials run but are not kept: {why}")

    @contextmanager
    def claims(self) -> Iterator[Claims]:
        """Return the claims of this process in the folder, which is created; other processes walk other trials."""
        with made_folder(self.folder), Claims(self.folder, self._sweep) as claims:
            yield claims

    def sync(self) -> None:
        """Make all written records survive a power failure."""
        with suppress(FileNotFoundError):  # it was deleted
            sync_folder(self.folder)

    def _tell_once(self, words: str) -> None:
        if words not in self._said:
            self._tell(words)
        self._said.add(words)

    def _move_aside(self, path: Path, why: str) -> None:
        names = (path.with_name(f"{path.name}.aside{number}") for number in chain([""], count(2)))
        aside = next(each for each in names if not os.path.lexists(each))
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


def content_of(record: xr.Dataset) -> bytes:
    """Bytes of a record's file. Raises OutputError for types other than floating-point numbers, integers of 32 bits,
    truth values and text, and for a dimension of length 0."""
    if not all(record.sizes.values()):
        sizes = {str(name): size for name, size in record.sizes.items()}
        raise OutputError("must not have a dimension of length 0", field="record", value=sizes)
    buffer = io.BytesIO()
    # Directly, for xarray takes ten times as long as the walk of a short trial.
    file = netcdf_file(buffer, "w", version=2)
    for name, size in record.sizes.items():
        file.createDimension(str(name), size)
    aside = " ".join(str(name) for name in record.coords if name not in record.dims)
    _describe(file, "record", record.attrs | ({"coordinates": aside} if aside else {}))
    for name, variable in record.variables.items():
        values, added = _as_stored(f"record.{name}", variable.values)
        over = [str(each) for each in variable.dims]
        if values.ndim > variable.ndim:
            over.append(f"string{values.shape[-1]}")
            if over[-1] not in file.dimensions:
                file.createDimension(over[-1], values.shape[-1])
        stored = file.createVariable(str(name), values.dtype, over)
        _describe(stored, f"record.{name}", variable.attrs | added)
        stored.data[...] = values
    file.flush()
    return sealed(buffer.getvalue())


def _as_stored(field: str, values: NDArray[Any]) -> tuple[NDArray[Any], dict[str, str]]:
    """Values in the form of the file, text with one more dimension, and attributes that readers need."""
    kind = values.dtype.kind
    if kind == "f":
        return values, {}
    if kind in "biu" and np.array_equal(values.astype(np.int32), values):
        return values.astype(np.int32), {"dtype": "bool"} if kind == "b" else {}
    if kind == "U" or (kind == "O" and all(isinstance(each, str) for each in values.flat)):
        encoded = np.char.encode(values.astype(str), "utf-8")
        encoded = encoded.astype(f"S{max(1, encoded.dtype.itemsize)}")
        return encoded[..., None].view("S1"), {"_Encoding": "utf-8"}
    raise OutputError("must be of a type that netCDF can hold", field=field, value=str(values.dtype))


def _describe(target: Any, field: str, attributes: Mapping[Any, Any]) -> None:
    for name, value in attributes.items():
        if not isinstance(value, str | bool | int | float | np.number):
            raise OutputError("must be of a type that netCDF can hold", field=f"{field}.attrs[{name!r}]", value=value)
        setattr(target, str(name), value.encode() if isinstance(value, str) else np.float64(value))


def read_record(path: Path) -> xr.Dataset:
    """Read a record with its original types and without attributes of the file. Raises the errors of
    :func:`chilopod.netcdf.unsealed`."""
    try:
        record = xr.load_dataset(io.BytesIO(unsealed(path)), engine="scipy").drop_encoding()
    except UnsoundError:
        raise
    except _DAMAGES as error:  # the seal is valid but the content is foreign
        raise UnsoundError(f"cannot be read ({in_words(error)})") from None
    record.attrs = {name: value if isinstance(value, str) else float(value) for name, value in record.attrs.items()}
    # The file has integers of 32 bits only, and all text is read as objects.
    whole = {name: each.astype(np.int64) for name, each in record.data_vars.items() if each.dtype == np.int32}
    kinds = {np.dtype(np.int32): np.int64, np.dtype(object): str}
    wider = {name: each.astype(kinds[each.dtype]) for name, each in record.coords.items() if each.dtype in kinds}
    return record.assign(whole).assign_coords(wider)


def read_header(path: Path, *, whole: bool = False) -> tuple[dict[str, str], int]:
    """Attributes of a record as text, and size of its file, bytes, which is checked against its seal if ``whole``,
    otherwise only its length. Raises the errors of :func:`chilopod.netcdf.unsealed`."""
    if whole:
        unsealed(path)
    with sealed_file(path) as file:
        try:
            with netcdf_file(file, mmap=True) as front:
                attributes = {name: value for name, value in vars(front).items() if isinstance(value, bytes)}
                return {name: value.decode() for name, value in attributes.items()}, file.seek(0, io.SEEK_END)
        except _DAMAGES:
            raise UnsoundError("is damaged or was edited") from None
