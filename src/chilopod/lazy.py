"""Packages that load their exports on first use (PEP 562).

A function then loads only the modules that it needs itself.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from types import ModuleType

TYPE_CHECKING = False  # that of typing, which takes longer to load than all this
if TYPE_CHECKING:
    from typing import Any


class _Package(ModuleType):
    """Package in which an export keeps its value when a submodule of the same name is loaded."""

    _homes: Mapping[str, str]

    def __setattr__(self, name: str, value: object) -> None:
        # The import system binds every submodule it loads to the package: `turn`, say, would be a module or the
        # function in it, depending on what was imported first.
        if not (name in self._homes and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


def exports(package: str, names: Mapping[str, Sequence[str]]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """``__getattr__`` and ``__dir__`` for the module of a package; ``names`` are those that each of its submodules
    exports, and its ``__all__`` unless it has one."""
    homes = {name: f"{package}.{submodule}" for submodule, given in names.items() for name in given}
    module = sys.modules[package]
    module.__class__ = _Package
    module.__dict__["_homes"] = homes
    module.__dict__["__all__"] = sorted(homes, key=lambda name: (not name.isupper(), name))

    def load(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(homes[name]), name)
        module.__dict__[name] = value
        return value

    def listed() -> list[str]:
        return sorted({*module.__dict__, *homes})

    return load, listed
