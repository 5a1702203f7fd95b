"""Processor and machine code chosen for it, on which the last bits of a number depend."""

from __future__ import annotations

import ctypes
import platform
from contextlib import suppress
from importlib import import_module
from pathlib import Path

_CORENAME = [f"{front}openblas_get_corename{end}" for front in ("scipy_", "") for end in ("64_", "")]


def processor() -> str:
    """Name of the processor, or its architecture if the system does not tell."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine() or "unknown"


def compiled_for() -> str:
    """LLVM's name of the processor that numba compiles for."""
    from llvmlite import binding
    from numba import config

    return str(config.CPU_NAME or binding.get_host_cpu_name())


def blas_kernels(package: str) -> str:
    """Kernels that the OpenBLAS of numpy or scipy has chosen, such as ``Haswell``; "unknown" with other libraries."""
    home = Path(str(import_module(package).__file__)).parent
    for folder in (home.parent / f"{package}.libs", home / ".dylibs"):  # of wheels
        for path in folder.glob("*openblas*"):
            with suppress(OSError):
                library = ctypes.CDLL(str(path))  # is loaded already
                for name in _CORENAME:
                    if ask := getattr(library, name, None):
                        ask.restype = ctypes.c_char_p
                        return str(ask().decode())
    return "unknown"
