"""Hostile environments: variables that others read, and limits; the same result, or one line that names the cause."""

from __future__ import annotations

import os
import resource
from collections.abc import Callable
from random import Random

from in_process import Place, environment, snapshot
from outcomes import FoundFault, Kind, Outcome, judged
from processes import commanded
from studies import content, whole

_COMMANDS = {
    ("robot", "show", "aoi2022-planar", "--json"): 3,
    ("stability", "aoi2022-planar", "--json"): 3,
    ("walk", "aoi2022-planar", "--duration", "1 s", "--seed", "1", "--out", "kept/x.nc", "--json"): 3,
    ("walk", "aoi2022", "--engine", "twin", "--duration", "0.1 s", "--seed", "1", "--trials", "kept", "--json"): 2,
    (*("branch", "aoi2022-planar", "--between", "11 N*mm/deg", "13 N*mm/deg"), "--points", "2", "--out", "kept"): 2,
    ("robot", "export", "aoi2022", "--out", "x.xml"): 1,
    ("doctor", "--json"): 1,
}
_VARIABLES: dict[str, tuple[str, ...]] = {
    "NUMBA_NUM_THREADS": ("0", "1", "7", "64", "-1", "abc", "", "1e9"),
    "NUMBA_THREADING_LAYER": ("nosuch", "workqueue", "omp", "safe", "tbb", "forksafe", ""),
    "NUMBA_THREADING_LAYER_PRIORITY": ("nosuch", "omp", "workqueue omp tbb", "omp,tbb,workqueue", ""),
    "NUMBA_CACHE_DIR": ("nowhere/at/all", "/proc", "/dev/null", ""),
    "NUMBA_DISABLE_JIT": ("0", "1", "abc"),
    "NUMBA_DEBUGINFO": ("1",),
    "OMP_WAIT_POLICY": ("active",),
    "NUMBA_DEBUG": ("abc",),
    "NUMBA_CPU_NAME": ("nosuch",),
    "NUMBA_OPT": ("9", "x"),
    "MPLBACKEND": ("nosuch", "TkAgg", "", "module://nosuch"),
    "MPLCONFIGDIR": ("/proc", "nowhere/at/all", "/dev/null"),
    "MATPLOTLIBRC": ("file", "/dev/null"),
    "MUJOCO_GL": ("nosuch", "egl", "osmesa", "disable", ""),
    "HOME": ("/nonexistent", "", "/proc", "relative"),
    "TMPDIR": ("/nonexistent", "", "/proc"),
    "LANG": ("C", "tr_TR.UTF-8", "nosuch"),
    "LC_ALL": ("C", "POSIX", "de_DE.UTF-8"),
    "COLUMNS": ("0", "1", "-1", "abc", "999999999"),
    "TERM": ("dumb", "", "nosuch"),
    "NO_COLOR": ("1",),
    "FORCE_COLOR": ("1",),
    "PYTHONOPTIMIZE": ("1", "2"),
    "PYTHONWARNINGS": ("error", "always", "nosuch"),
    "PYTHONIOENCODING": ("ascii", "latin-1"),
    "PYTHONUTF8": ("0", "1"),
    "PYTHONHASHSEED": ("0", "42"),
    "PYTHONUNBUFFERED": ("1",),
    "PYTHONDONTWRITEBYTECODE": ("1",),
    "OMP_NUM_THREADS": ("0", "-1", "64", "abc"),
    "OPENBLAS_NUM_THREADS": ("0", "64"),
    "HDF5_USE_FILE_LOCKING": ("TRUE", "FALSE", "nosuch"),
    "HDF5_DISABLE_VERSION_CHECK": ("0", "2"),
    "XDG_CACHE_HOME": ("/proc", ""),
    "COMP_WORDS": ("chilopod w",),
    "_CHILOPOD_COMPLETE": ("nosuch",),
    "MALLOC_PERTURB_": ("165",),
}
_LIMITS: dict[str, tuple[int, tuple[int, ...]]] = {
    "open files": (resource.RLIMIT_NOFILE, (12, 20, 40, 64)),
    "address space": (resource.RLIMIT_AS, (1 << 28, 1 << 29, 1 << 30, 3 << 29, 1 << 31, 3 << 30)),
    "stack": (resource.RLIMIT_STACK, (1 << 18, 1 << 20)),
    "processes": (resource.RLIMIT_NPROC, (1,)),
}


class Environments:
    """A command where one or two variables, or a limit, are hostile."""

    name = "environment"
    per_minute = 30

    def attack(self, chance: Random, place: Place) -> Outcome:
        """One environment."""
        (command,) = chance.choices(tuple(_COMMANDS), tuple(_COMMANDS.values()))
        names = chance.sample(tuple(_VARIABLES), chance.choice((1, 1, 2)))
        variables = {name: chance.choice(_VARIABLES[name]) for name in names}
        limit = chance.choice(tuple(_LIMITS)) if chance.random() < 0.12 else None
        if limit:
            number, most = _LIMITS[limit][0], chance.choice(_LIMITS[limit][1])
            variables = {}
            named = [limit, "memory"]
        else:
            number, most, named = resource.RLIMIT_CORE, 0, list(variables)
        words = " ".join(
            [*(f"{name}={value!r}" for name, value in variables.items()), *([f"{limit}: {most}"] if limit else [])]
        )
        place.tried.write_text(f"{words} chilopod {' '.join(command)}")
        study = whole(place, *command, by=commanded)
        right, files = study.ending, study.files
        (place.here / "file").write_text("nonsense = yes\n")
        before = snapshot(place.root)
        ending = commanded(command, place, env=environment(place, **variables), preexec_fn=_limited(number, most))
        after = {name: each for name, each in snapshot(place.root).items() if "nowhere" not in name}
        kind = judged(
            ending, before, after, named=named, codes=(0, 3) if "doctor" in command else (0,), stays=limit is None
        )
        if kind is Kind.ENDED and "doctor" not in command:
            if ending.out != right.out:
                raise FoundFault(Kind.WRONG, f"{ending.out[-200:]!r} instead of {right.out[-200:]!r}")
            now = {name: each for name, each in content(place.here).items() if name in files}
            if now != files:
                raise FoundFault(
                    Kind.WRONG, f"{', '.join(name for name in files if now.get(name) != files[name])} differs"
                )
        return Outcome(kind, ending.err.strip()[-200:])


def _limited(number: int, most: int) -> Callable[[], None]:
    def limit() -> None:
        if number != resource.RLIMIT_NPROC or os.getuid():  # root has no such limit
            resource.setrlimit(number, (most, resource.getrlimit(number)[1]))

    return limit
