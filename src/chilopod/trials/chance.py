"""Detection of clocks, random numbers and identities in code, whose values differ between processes although the code
is the same.

Instructions are read in order: names that they load, attributes of modules, local names for these. Code that hides its
source of chance is found only if its first gait cycle, walked twice, differs.
"""

from __future__ import annotations

import dis
import re
import sys
from collections.abc import Iterator, Mapping
from functools import lru_cache
from types import CodeType, ModuleType
from typing import Any

_WHOLE = ("time", "random", "secrets", "uuid", "numpy.random")
_SOME = {
    "builtins": ("hash", "id"),
    "os": ("getpid", "getppid", "getrandom", "times", "urandom"),
    "threading": ("get_ident", "get_native_id"),
}
_LOADING = {
    "builtins": ("__import__", "eval", "exec"),
    "importlib": ("import_module", "reload"),
    "importlib.util": ("module_from_spec",),
    "pkgutil": ("resolve_name",),
    "pydoc": ("importfile", "locate", "resolve", "safeimport"),
    "runpy": ("run_module", "run_path"),
    "sys": ("modules",),
}
BY_NAME = "code that imports modules by name, or may"
"""What :func:`by_chance` and :func:`chance_in` call everything that leads to code which no search can find."""
_NOW = ("now", "today", "utcnow")  # of classes in datetime
_FINE = ("sleep", "uuid3", "uuid5")
_SEEDED = frozenset(
    ("Random", "RandomState", "default_rng", "SeedSequence", "MT19937", "PCG64", "PCG64DXSM", "Philox", "SFC64")
)
"""Random generators that repeat their numbers for a given seed."""
_BESIDE = ("CACHE", "COPY_FREE_VARS", "EXTENDED_ARG", "KW_NAMES", "NOP", "PRECALL", "PUSH_NULL", "RESUME", "SWAP")
_GLOBAL = ("LOAD_GLOBAL", "LOAD_NAME", "LOAD_DEREF", "LOAD_CLASSDEREF")
_INNER = ("LOAD_ATTR", "LOAD_METHOD", "IMPORT_FROM")


def by_chance(value: object) -> str:
    """Name of a function whose result varies from call to call, or of a module of such functions; empty otherwise."""
    of, name = getattr(value, "__self__", None), getattr(value, "__name__", "")
    if isinstance(of, type) and of.__module__ == "datetime" and name in _NOW:
        return f"{of.__name__}.{name}"
    return _sources(tuple(each for each in {*_WHOLE, *_SOME, *_LOADING} if each in sys.modules)).get(id(value), "")


@lru_cache
def _sources(modules: tuple[str, ...]) -> dict[int, str]:
    """Names of all such functions and modules, by their address, because imports may rename them."""
    found = {id(sys.modules[module]): module for module in modules if module in _WHOLE}
    for module in modules:
        for name, value in vars(sys.modules[module]).items():
            drawn = module in _WHOLE and callable(value) and (name == "SystemRandom" or not isinstance(value, type))
            if name in _LOADING.get(module, ()):
                found[id(value)] = BY_NAME
            elif name in _SOME.get(module, ()) or (drawn and name not in (*_FINE, *_SEEDED) and name[0] != "_"):
                found.setdefault(id(value), f"{module}.{name}")
    return found


def chance_in(code: CodeType, space: Mapping[str, object]) -> str:
    """Name of a source of chance that code, inner functions included, loads; empty if there is none. ``space`` has the
    values of global names, and of names from outer functions."""
    local: dict[str, Any] = {}
    here: Any = None
    package: Any = None
    for verb, name in _steps(code):
        before, here = here, None
        if verb in _GLOBAL:
            here = local.get(name, space.get(name))
        elif verb.startswith("LOAD_FAST"):
            here = local.get(name)
        elif verb == "IMPORT_NAME":
            here = package = sys.modules.get(name)
        elif verb.startswith("STORE_"):
            local[name] = sys.modules.get(name, before) if before is package else before
        elif verb in _INNER:
            owner = package if verb == "IMPORT_FROM" else before
            here = owner if owner and owner is package and owner.__name__.endswith(f".{name}") else _inner(owner, name)
        elif isinstance(before, ModuleType) and before is not package and by_chance(before):
            return by_chance(before)  # passed to other code
        if _takes_seed(before) and _seedless(verb, name):
            return f"{before.__name__} without a seed"
        hashing = code.co_name == "__hash__" and here is hash  # no more than what dictionaries ask
        if not isinstance(here, ModuleType) and by_chance(here) and not hashing:
            return by_chance(here)
    inner = (chance_in(each, {**space, **local}) for each in code.co_consts if isinstance(each, CodeType))
    return next(filter(None, inner), "")


def _inner(owner: Any, name: str) -> Any:
    """Attribute of a module, or of a class of datetime; None for other objects, whose attributes may run code."""
    if isinstance(owner, ModuleType):
        return vars(owner).get(name)
    return getattr(owner, name, None) if getattr(owner, "__module__", None) == "datetime" else None


def _takes_seed(value: Any) -> bool:
    home = str(getattr(value, "__module__", ""))
    return getattr(value, "__name__", None) in _SEEDED and home.startswith(("random", "numpy.random"))


def _seedless(verb: str, value: object) -> bool:
    """True if the argument of a function that takes a seed is missing or None."""
    return not verb.startswith(("LOAD_", "BUILD_")) or (verb == "LOAD_CONST" and value is None)


def _steps(code: CodeType) -> Iterator[tuple[str, Any]]:
    """Instructions and their arguments, with combined instructions split in two."""
    for each in dis.get_instructions(code):
        if isinstance(each.argval, tuple) and "_FAST_" in each.opname:
            yield from zip(re.findall("[A-Z]+_FAST", each.opname), each.argval, strict=True)
        elif each.opname not in _BESIDE:
            yield each.opname, each.argval
