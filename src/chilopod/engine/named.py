"""Engines and controllers by the names that are typed: ``planar``, ``package.module:Class``."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Hashable, Mapping
from importlib import import_module
from typing import Any, Final

from chilopod.engine.contract import Array, Controller, Engine, Traits, Walk, missing_parts
from chilopod.errors import AnalysisError, ChilopodError, ParameterError, in_words, nearest_name
from chilopod.robot import Robot

_MODULES: Final[Mapping[str, str]] = {"planar": "chilopod.planar", "twin": "chilopod.twin"}

ENGINES: Final = tuple(_MODULES)
"""What walks: the planar model, or the whole robot in three dimensions."""

_PARTS: Final = ("traits", "common", "initial_states", "start", "resume")
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
    if not isinstance(name, str):
        raise ParameterError("must be a name", field="engine", value=name, allowed=", ".join(ENGINES))
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
    return _Own(name, _imported("engine", name))


class _Own:
    """An engine of somebody else's: what goes wrong in it is said to be its own fault."""

    def __init__(self, name: str, engine: Any) -> None:
        if isinstance(engine, type):
            raise ParameterError(
                "is a class", field="engine", value=name, allowed="an object, such as one of that class"
            )
        missing = [each for each in _PARTS if not hasattr(engine, each)]
        if missing:
            raise ParameterError(f"is no engine: it has no {missing[0]}", field="engine", value=name)
        if not isinstance(engine.traits, Traits):
            raise ParameterError("is no engine: its traits are no chilopod.engine.Traits", field="engine", value=name)
        self._name, self._engine = name, engine
        self.traits: Traits = engine.traits

    def common(self, robot: Robot) -> Hashable:
        shared = self._blamed("common", robot)
        try:
            hash(shared)
        except TypeError:
            raise AnalysisError("common gave what has no hash", field=f"engine {self._name}") from None
        return shared

    def initial_states(self, *arguments: Any, **named: Any) -> Array:
        return self._blamed("initial_states", *arguments, **named)

    def start(self, *arguments: Any, **named: Any) -> Walk:
        walk: Walk = self._blamed("start", *arguments, **named)
        missing = missing_parts(walk)
        if missing:
            raise AnalysisError(
                f"start gave no chilopod.engine.Walk: it has no {', '.join(missing)}", field=f"engine {self._name}"
            )
        return walk

    def resume(self, saved: bytes) -> Walk:
        walk: Walk = self._blamed("resume", saved)
        return walk

    def _blamed(self, name: str, *arguments: Any, **named: Any) -> Any:
        try:
            return getattr(self._engine, name)(*arguments, **named)
        except ChilopodError:
            raise
        except (Exception, SystemExit) as error:
            raise AnalysisError(f"{name} raised {in_words(error)}", field=f"engine {self._name}") from error


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
    except (Exception, SystemExit) as error:  # it is somebody else's code
        raise ParameterError(
            f"cannot be made: {in_words(error)}",
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


def path_of(kind: type) -> str:
    """``package.module:Class`` of a class."""
    return f"{kind.__module__}:{kind.__qualname__}"


def _imported(field: str, path: str) -> Any:
    if not _PATH.fullmatch(path):
        kind = "Class" if field == "controller" else "object"
        raise ParameterError("names nothing", field=field, value=path, allowed=f"package.module:{kind}")
    module_name, _, name = path.partition(":")
    try:
        found: Any = import_module(module_name)
    except (Exception, SystemExit) as error:  # whatever somebody else's module does when it is imported
        raise ParameterError(f"cannot be imported: {in_words(error)}", field=field, value=path) from error
    for part in name.split("."):
        if not hasattr(found, part):
            raise ParameterError(
                f"{module_name} has no {name}", field=field, value=path, nearest=nearest_name(part, dir(found))
            )
        found = getattr(found, part)
    return found
