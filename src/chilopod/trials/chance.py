"""Detection of clocks, random numbers and identities in code, whose values differ between processes although the code
is the same.

Instructions are read in order: names that they load, attributes of modules, local names for these. Code that hides its
source of chance is found when it answers the same question twice.
"""

from __future__ import annotations

import dis
import re
import sys
from collections.abc import Iterator, Mapping
from functools import lru_cache
from types import CodeType, ModuleType
from typing import Any

_WHOLE = ("time", "random", "secrets", "threading", "uuid", "numpy.random")
_SOME = {"builtins": ("hash", "id"), "os": ("getpid", "getppid", "getrandom", "times", "urandom"), "sys": ()}
_LOADING = ("importlib", "pkgutil", "pydoc", "runpy")
_LOADERS = {"builtins": ("__import__", "eval", "exec"), "sys": ("modules",)}
BY_NAME = "code that imports modules by name, or may"
_NOW = ("now", "today", "utcnow")  # of classes in datetime
_FINE = ("sleep", "uuid3", "uuid5", "default_rng")
_NUMBERS = (bool, int, float, complex)
_ORDERLESS = ("CONTAINS_OP", "SET_UPDATE", "STORE_FAST", "STORE_DEREF")  # uses of sets
_BESIDE = ("CACHE", "COPY_FREE_VARS", "EXTENDED_ARG", "KW_NAMES", "NOP", "PRECALL", "PUSH_NULL", "RESUME", "SWAP")
_GLOBAL = ("LOAD_GLOBAL", "LOAD_NAME", "LOAD_DEREF", "LOAD_CLASSDEREF")
_INNER = ("LOAD_ATTR", "LOAD_METHOD", "IMPORT_FROM")


def by_chance(value: object) -> str:
    """Name of a function whose result varies from call to call, or of a module of such functions; empty otherwise."""
    of, name = getattr(value, "__self__", None), getattr(value, "__name__", "")
    if isinstance(of, type) and of.__module__ == "datetime" and name in _NOW:
        return f"{of.__name__}.{name}"
    return _sources(tuple(each for each in (*_WHOLE, *_SOME, *_LOADING) if each in sys.modules)).get(id(value), "")


@lru_cache
def _sources(modules: tuple[str, ...]) -> dict[int, str]:
    """Names of all such functions and modules, by their address, because imports may rename them."""
    found = {id(sys.modules[module]): module for module in modules if module in _WHOLE}
    for module in modules:
        for name, value in vars(sys.modules[module]).items():
            drawn = module in _WHOLE and callable(value) and (name == "SystemRandom" or not isinstance(value, type))
            loads = module in _LOADING and callable(value) and getattr(value, "__module__", "") == module
            if loads or name in _LOADERS.get(module, ()):
                found[id(value)] = BY_NAME
            elif name in _SOME.get(module, ()) or (drawn and name not in _FINE and name[0] != "_"):
                found.setdefault(id(value), f"{module}.{name}")
    return found


def chance_in(code: CodeType, space: Mapping[str, object]) -> str:
    """Name of a source of chance that code, inner functions included, loads; empty if there is none. ``space`` has the
    values of global names, and of names from outer functions."""
    local: dict[str, Any] = {}
    before: Any = None
    here: Any = None
    package: Any = None
    for verb, name in _steps(code):
        earlier, before, here = before, here, None
        sized = verb == "CALL" and (earlier is len or earlier is sorted)
        if _unordered(before) and verb not in _ORDERLESS and not sized:
            return "the order of a set"
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
        elif verb == "LOAD_CONST" and isinstance(name, str | frozenset):
            here = name
        elif verb in ("BUILD_SET", "SET_UPDATE"):  # of one constant after the other, or of all at once
            here = {before, ""} if isinstance(before, str) else before
        if getattr(before, "__name__", "") == "datetime64" and verb == "LOAD_CONST" and name in _NOW:
            return f"datetime64 {name}"
        hashing = code.co_name == "__hash__" and here is hash  # no more than what dictionaries ask
        if not isinstance(here, ModuleType) and by_chance(here) and not hashing:
            return by_chance(here)
    inner = (chance_in(each, {**space, **local}) for each in code.co_consts if isinstance(each, CodeType))
    return next(filter(None, inner), "")


def _unordered(value: object) -> bool:
    """True for a set whose order varies from process to process: not only of numbers."""
    return isinstance(value, set | frozenset) and len(value) > 1 and not all(type(each) in _NUMBERS for each in value)


def _inner(owner: Any, name: str) -> Any:
    """Attribute of a module, or of a class of datetime; None for other objects, whose attributes may run code."""
    if isinstance(owner, ModuleType):
        return vars(owner).get(name)
    return getattr(owner, name, None) if getattr(owner, "__module__", None) == "datetime" else None


def _steps(code: CodeType) -> Iterator[tuple[str, Any]]:
    """Instructions and their arguments, with combined instructions split in two."""
    for each in dis.get_instructions(code):
        if isinstance(each.argval, tuple) and "_FAST_" in each.opname:
            yield from zip(re.findall("[A-Z]+_FAST", each.opname), each.argval, strict=True)
        elif each.opname not in _BESIDE:
            yield each.opname, each.argval
