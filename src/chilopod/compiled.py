"""The decorators for compiled code, with the one cache rule numba does not have.

Numba keeps compiled functions on disk and recompiles a function when *its own file* changes; a function that calls one
from another file keeps running the old callee. So on import, compiled functions older than the newest of this
package's sources are dropped.
"""

from __future__ import annotations

import contextlib
import functools
from pathlib import Path
from typing import Any

import numba


def _drop_stale() -> None:
    package = Path(__file__).parent
    folders = ("", "planar/", "stability/taylor/", "stability/implicit/")
    sources = [source for folder in folders for source in package.glob(f"{folder}*.py")]
    newest = max(source.stat().st_mtime for source in sources)
    for index in package.rglob("*.nbi"):
        with contextlib.suppress(OSError):  # another process may have been quicker, or the folder is read-only
            if index.stat().st_mtime < newest:
                index.unlink()


_drop_stale()

njit = functools.partial(numba.njit, cache=True)
"""``numba.njit`` with the compiled code kept on disk."""

fused_njit = functools.partial(numba.njit, cache=True, fastmath={"contract"})
"""The same where a product and a sum may become one instruction with one rounding: not for exact error terms."""

parallel_njit = functools.partial(numba.njit, cache=True, parallel=True)
"""The same for loops over ``prange``: one robot an iteration, so the answer does not depend on the number of
threads."""


@njit(inline="always")
def copy_into(target: Any, source: Any) -> None:
    """Copy an array of one dimension, or the start of it, over another.

    With ``target[:] = source`` numba compiles what would say that the sizes differ, formatted: seconds of it.
    """
    for i in range(target.size):
        target[i] = source[i]
