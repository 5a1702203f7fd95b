"""Engines and controllers by the names that are typed: ``planar``, ``package.module:Class``."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from importlib import import_module
from typing import Any, Final

from chilopod.engine.contract import Controller, Engine
from chilopod.errors import ParameterError, nearest_name, one_line

_MODULES: Final[Mapping[str, str]] = {"planar": "chilopod.planar", "twin": "chilopod.twin"}

ENGINES: Final = tuple(_MODULES)
"""What walks: the planar model, or the whole robot in three dimensions."""

_PATH: Final = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_][\w.]*")


def engine_named(name: str) -> Engine:
    """An engine by its name, one of :data:`ENGINES`; or one of your own as ``package.module:object``.

    It is imported now, not before: MuJoCo takes a moment to load.

    Raises
    ------
    ParameterError
        If there is none.
    """
    engine: Engine
    if name in _MODULES:
        engine = import_module(_MODULES[name])  # a module is an engine
        return engine
    if ":" not in name:
        raise ParameterError(
            "there is no such engine",
            field="engine",
            value=name,
            allowed=f"{', '.join(ENGINES)}, or package.module:object",
            nearest=nearest_name(name, ENGINES),
        )
    engine = _imported("engine", name)
    missing = [each for each in ("traits", "common", "initial_states", "start", "resume") if not hasattr(engine, each)]
    if missing:
        raise ParameterError(f"is no engine: it has no {missing[0]}", field="engine", value=name)
    return engine


def controller_named(path: str) -> Controller:
    """An instance of a controller's class, given as ``package.module:Class``, with the defaults of all its fields.

    Raises
    ------
    ParameterError
        If it cannot be imported or is no controller, see :func:`check_controller`.
    """
    made = _imported("controller", path)
    if not isinstance(made, type):
        raise ParameterError("is no class", field="controller", value=path, allowed="package.module:Class")
    try:
        controller: Controller = made()
    except ParameterError:
        raise
    except Exception as error:  # it is somebody else's code
        raise ParameterError(
            f"cannot be made: {one_line(f'{type(error).__name__}: {error}')}",
            field="controller",
            value=path,
            allowed="a class whose fields all have defaults",
        ) from error
    check_controller(controller)
    return controller


def check_controller(controller: Controller) -> None:
    """Make sure that a controller can be part of a trial: a frozen dataclass with ``events`` and ``act``.

    Raises
    ------
    ParameterError
        If it is not.
    """
    kind = type(controller)
    for name in ("events", "act"):
        if not callable(getattr(controller, name, None)):
            raise ParameterError(f"has no {name}", field="controller", value=kind.__name__, allowed="events and act")
    frozen = dataclasses.is_dataclass(kind) and kind.__dataclass_params__.frozen
    if not frozen:
        raise ParameterError(
            "can change, so nobody could tell trials apart",
            field="controller",
            value=kind.__name__,
            allowed="a frozen dataclass: @dataclass(frozen=True)",
        )


def path_of(thing: object) -> str:
    """``package.module:Class`` of an object's class."""
    kind = type(thing)
    return f"{kind.__module__}:{kind.__qualname__}"


def _imported(field: str, path: str) -> Any:
    if not _PATH.fullmatch(path):
        raise ParameterError("names nothing", field=field, value=path, allowed="package.module:Class")
    module_name, _, name = path.partition(":")
    try:
        found: Any = import_module(module_name)
    except Exception as error:  # whatever somebody else's module does when it is imported
        raise ParameterError(
            f"cannot be imported: {one_line(f'{type(error).__name__}: {error}')}", field=field, value=path
        ) from error
    for part in name.split("."):
        if not hasattr(found, part):
            raise ParameterError(
                f"{module_name} has no {name}", field=field, value=path, nearest=nearest_name(part, vars(found))
            )
        found = getattr(found, part)
    return found
