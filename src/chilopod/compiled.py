"""The decorators for compiled code, with the one cache rule numba does not have: changed sources never run old code."""

from __future__ import annotations

import functools
import os
import warnings
from typing import Any

from chilopod.errors import ParameterError

# Read once, when the first loop goes parallel: waiting threads sleep. By default GNU's threads spin, and where
# another process has the cores, each of thousands of short loops waits for a spinning thread to be taken off.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

import numba

from chilopod.numba_internals import is_processor, keep

if numba.config.DISABLE_JIT:
    # As plain Python the compiled functions would take hours, and their overloads do not run.
    raise ParameterError(
        "must be 0: chilopod needs the compiler of Numba", field="NUMBA_DISABLE_JIT", value=1, allowed="0, or unset"
    )

if (_cpu := numba.config.CPU_NAME) not in (None, "host") and not is_processor(_cpu):
    raise ParameterError(
        "must be a processor of LLVM", field="NUMBA_CPU_NAME", value=_cpu, allowed="generic, host, a name, or unset"
    )

_LAYERS = {
    "NUMBA_THREADING_LAYER": "omp, workqueue, threadsafe, forksafe; with the package tbb also tbb, safe; or unset",
    "NUMBA_THREADING_LAYER_PRIORITY": "tbb, omp and workqueue in any order, or unset",
}
if _LAYERS.keys() & os.environ.keys():
    try:
        numba.get_num_threads()  # otherwise the error appears in the middle of a walk
    except ValueError as error:
        _name = "NUMBA_THREADING_LAYER" + "_PRIORITY" * ("PRIORITY" in str(error))
        _value = os.environ.get(_name)
        raise ParameterError("cannot be loaded", field=_name, value=_value, allowed=_LAYERS[_name]) from None


def _compiled(function: Any = None, **options: Any) -> Any:
    """``numba.njit`` with the compiled code kept on disk where it can be."""
    if function is None:
        return functools.partial(_compiled, **options)
    dispatcher = numba.njit(**options)(function)
    if not keep(dispatcher):
        _warn()
    return dispatcher


@functools.cache
def _warn() -> None:
    warnings.warn(
        "compiled code cannot be kept, so every start compiles again: set NUMBA_CACHE_DIR to a writable folder",
        RuntimeWarning,
        stacklevel=4,
    )


# With debug information numba keeps every value in memory, which prevents fused operations and changes bits.
njit = functools.partial(_compiled, nogil=True, debug=False)
"""``numba.njit`` with the compiled code kept on disk; other threads run meanwhile, for progress and for Ctrl-C."""

fused_njit = functools.partial(njit, fastmath={"contract"})
""":data:`njit` with fused products and sums of one rounding allowed: not for exact error terms."""

parallel_njit = functools.partial(njit, parallel=True)
""":data:`njit` for loops over ``prange``, one robot in an iteration, so that results do not depend on the number of
threads."""


@njit(inline="always")
def copy_into(target: Any, source: Any) -> None:
    """Copy an array of one dimension, or the start of it, over another.

    For ``target[:] = source`` numba also compiles a formatted error message about unequal sizes, which takes seconds.
    """
    for i in range(target.size):
        target[i] = source[i]


@njit
def assign(target: Any, source: Any) -> None:
    """Copy a matrix, or the start of it, over another; see :func:`copy_into`."""
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = source[i, j]
