"""Work of a worker of a cluster: one batch at a time, bytes in, bytes out.

Imports are as few as possible before a call, because the scheduler also loads this file.
"""

from __future__ import annotations

import pickle
import sys
import threading
import time
import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import metadata
from typing import TYPE_CHECKING, Any

from chilopod.cores import use_at_most
from chilopod.engine.named import path_of
from chilopod.errors import ClusterError, ParameterError, in_words
from chilopod.sources import digest

if TYPE_CHECKING:
    from chilopod.trials.trial import Trial

PACKAGES = ("chilopod", "numpy", "numba")
"""Packages whose versions must be equal on all machines."""

TWIN_PACKAGE = "mujoco-core"
"""Package that trials of the twin need."""

_SOURCES = "source code of chilopod"
_DIGITS = 12  # of a digest, in an error
_ONE_AT_A_TIME = threading.Lock()
_PR_SET_PDEATHSIG = 1  # of prctl(2)


def versions(packages: Sequence[str] = (*PACKAGES, TWIN_PACKAGE)) -> dict[str, str]:
    """Versions, in this process, of the software that determines a record."""
    found = {"python": "{}.{}".format(*sys.version_info), _SOURCES: digest()[:_DIGITS]}
    for package in packages:
        if package not in found:
            try:
                found[package] = metadata.version(package)
            except metadata.PackageNotFoundError:
                found[package] = "none"
    return found


def check_versions(expected: Mapping[str, str], found: Mapping[str, str], place: str) -> None:
    """Raise a ClusterError for the first version that differs on a worker."""
    for name, wanted in expected.items():
        there = found.get(name, "none")
        if there != wanted:
            raise ClusterError(f"{name} is {there} on a worker and {wanted} here", field="cluster", value=place)


def packed(batch: Sequence[Trial]) -> bytes:
    """Pack a batch for a worker: its requirements and its trials. Raises ParameterError if another process could not
    import or identify the controller."""
    for trial in batch:
        if trial.code[1]:
            raise ParameterError(trial.not_kept(trial.code[1]), field="cluster", allowed="trials run on this machine")
    packages = (*PACKAGES, TWIN_PACKAGE) if batch[0].engine == "twin" else PACKAGES
    try:
        trials = pickle.dumps(list(batch), pickle.HIGHEST_PROTOCOL)
    except Exception as error:  # a user class may raise anything
        raise _not_importable(batch[0].controller, error) from error
    return pickle.dumps((versions(packages), [trial.text for trial in batch], trials), pickle.HIGHEST_PROTOCOL)


def walked_there(job: bytes, place: str) -> bytes:
    """Walk a batch on this worker and pack its result, or its error, for :func:`unpacked`; dask would write a traceback
    on the terminal."""
    try:
        with _ONE_AT_A_TIME:  # the batch has all threads of this worker
            answer = pickle.dumps(_walked(job, place), pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        error.add_note("On the worker:\n" + traceback.format_exc())
        try:
            answer = pickle.dumps(error, pickle.HIGHEST_PROTOCOL)
            pickle.loads(answer)
        except Exception:  # a foreign exception that cannot be pickled
            answer = pickle.dumps(ClusterError(in_words(error)))
    return answer


def unpacked(answer: bytes) -> Any:
    """Return the records that a worker sent and their computing time, s, or raise the worker's error."""
    found = pickle.loads(answer)
    if isinstance(found, Exception):
        raise found
    return found


def dask_setup(worker: object) -> None:
    """Set up a worker process on the client's machine, called by dask: it ends with its client and ignores Ctrl-C.
    (Dask ends it too, but only between two batches, because compiled code holds the lock.)"""
    import ctypes
    import signal

    with suppress(ValueError):  # only the main thread may set it
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.stdout = sys.stderr  # output that a controller prints there is dropped
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _walked(job: bytes, place: str) -> Any:
    expected, texts, packed_trials = pickle.loads(job)
    check_versions(expected, versions(tuple(expected)), place)
    try:
        trials = pickle.loads(packed_trials)
    except Exception as error:  # importing a foreign module may raise anything
        raise _not_importable(None, error) from error
    from chilopod.trials.description import meanwhile_unchanged

    with meanwhile_unchanged():
        here = [trial.text for trial in trials]
    for trial, there, text in zip(trials, here, texts, strict=True):
        if there != text:
            own = f"engine {trial.engine}" if trial.controller is None else path_of(type(trial.controller))
            problem = f"the code of {own}, or of what it imports, differs between a worker and this machine"
            raise ClusterError(problem, field="cluster", value=place)
    import numba
    from distributed import get_worker

    from chilopod.trials.batch import walked

    threads = get_worker().state.nthreads
    use_at_most(threads)
    numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))
    begun = time.monotonic()
    records = walked(trials)
    return records, time.monotonic() - begun


def _not_importable(controller: object, error: Exception) -> ParameterError:
    problem = f"cannot be imported on a worker ({in_words(error)})"
    value = None if controller is None else path_of(type(controller))
    allowed = "a class in a module that is on the path of the workers"
    return ParameterError(problem, field="controller", value=value, allowed=allowed)
