"""Undocumented parts of numba and llvmlite that chilopod uses, and that a new version of them may change.

Therefore ``pyproject.toml`` caps numba, and ``tests/test_numba_internals.py`` names the parts that changed.
"""

from __future__ import annotations

import hashlib
import logging
import os
import shutil
import time
from contextlib import suppress
from multiprocessing import parent_process
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numba
from llvmlite import binding, ir
from numba.core import cgutils, event
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile
from numba.core.typeconv import Conversion
from numba.core.typing import signature

from chilopod import sources

__all__ = ["COMPILING", "Conversion", "cgutils", "ir", "is_processor", "keep", "signature"]

ABOVE = ("analysis", "cli", "gym", "live", "paper", "show", "tasks", "trials", "twin")
"""Subpackages without compiled code, which no compiled code reaches: their changes need no new compilation."""

NOTICED = 1.0
"""Seconds of compilation after which a message appears."""

_APART, _AGAIN = 5.0, 15.0  # s without compilation, and with it, after which another message appears
_FOLDER = "chilopod-"
FOLDERS = 3
"""Number of versions whose code is kept, for switching between them."""


def keep(dispatcher: Any) -> bool:
    """Keep the machine code of a function of ``numba.njit`` on disk; return True if there is a folder for it.

    Numba alone would run old code: it checks only the function's *own* file, although a function contains the functions
    that it calls. Here the code lies in a folder named after the package's digest, inside numba's cache folder.
    """
    try:
        dispatcher._cache = _Cache(dispatcher.py_func)
    except RuntimeError:
        return False
    return True


def is_processor(name: str) -> bool:
    """True if LLVM knows a processor of that name; LLVM itself only complains on stderr, at every function."""
    binding.initialize_native_target()
    with TemporaryFile() as complaints:
        stderr = os.dup(2)
        os.dup2(complaints.fileno(), 2)
        try:
            binding.Target.from_default_triple().create_target_machine(cpu=name)
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
        return complaints.seek(0, os.SEEK_END) == 0


class _Locator:
    """Cache folder of numba with a subfolder for this version of chilopod."""

    def __init__(self, found: Any) -> None:
        self._found = found
        version = hashlib.sha256(f"{sources.digest(ABOVE)} {numba.__version__}".encode()).hexdigest()
        self._folder = Path(found.get_cache_path(), _FOLDER + version[:16])

    def __getattr__(self, name: str) -> Any:
        return getattr(self._found, name)

    def get_cache_path(self) -> str:
        return str(self._folder)

    def ensure_cache_path(self) -> None:
        if self._folder.exists():
            return
        self._folder.mkdir(parents=True, exist_ok=True)
        # A running process may use one of these folders; it creates the folder again.
        others = {other.stat().st_mtime: other for other in self._folder.parent.glob(f"{_FOLDER}*")}
        for when in sorted(others)[:-FOLDERS]:
            shutil.rmtree(others[when], ignore_errors=True)


class _Impl(CompileResultCacheImpl):  # type: ignore[misc]
    def __init__(self, function: Any) -> None:
        super().__init__(function)
        self._locator: Any = _Locator(self._locator)


class _File(IndexDataCacheFile):  # type: ignore[misc]
    def save(self, key: Any, data: Any) -> None:
        # Numba counts its files. Of two processes that compile at the same time, for other arguments or another
        # processor, one would overwrite what the other's entry in the index stands for.
        name = f"{self._index_name.removesuffix('.nbi')}.{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.nbc"
        self._save_data(name, data)
        self._save_index({**self._load_index(), key: name})

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except Exception:  # damaged: treated as missing
            return {}


class _Cache(FunctionCache):  # type: ignore[misc]
    _impl_class = _Impl

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        self._cache_file = _File(self._cache_path, self._impl.filename_base, sources.digest(ABOVE))

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        if sources.edited(ABOVE):
            return None
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # damaged: treated as missing
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        # A full disk, or a folder that another process has just cleared away, costs time and nothing else.
        if not sources.edited(ABOVE):
            with suppress(OSError):
                super().save_overload(sig, data)


class _Compiling(event.Listener):  # type: ignore[misc]
    """Time that numba has spent compiling in this process; called functions count with their callers."""

    def __init__(self) -> None:
        self._before, self._begun, self._ended, self._depth = 0.0, 0.0, 0.0, 0
        self._due = NOTICED  # compile time after which the next message appears

    def on_start(self, event: Any) -> None:
        if not self._depth and time.monotonic() - self._ended > _APART:  # another kind of system, for example
            self._due = self.seconds() + NOTICED
        own = event.data["dispatcher"].__module__.startswith("chilopod") and parent_process() is None
        if own and self.seconds() > self._due:
            self._due = self.seconds() + _AGAIN
            logging.getLogger("chilopod").warning("chilopod: compiling, once on this machine")
        self._begun = self._begun if self._depth else time.monotonic()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if not self._depth:
            self._ended = time.monotonic()
            self._before += self._ended - self._begun

    def seconds(self) -> float:
        """Compile time so far, s; functions read from the cache count 0."""
        return self._before + (time.monotonic() - self._begun if self._depth else 0.0)


COMPILING = _Compiling()
event.register("numba:compile", COMPILING)
