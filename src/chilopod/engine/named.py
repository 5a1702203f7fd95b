"""Engines and controllers by the names that are typed: ``planar``, ``package.module:Class``."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from typing import Any, Final, cast

import numpy as np

from chilopod.engine.arguments import require
from chilopod.engine.contract import Controller, Engine, Observation, Traits, Walk, missing_parts
from chilopod.errors import AnalysisError, ChilopodError, ParameterError, in_words, nearest_name
from chilopod.frozen import Array
from chilopod.robot import Robot

_MODULES: Final[Mapping[str, str]] = {"planar": "chilopod.planar", "twin": "chilopod.twin"}

ENGINES: Final = tuple(_MODULES)
"""Engines by name: the planar model, and the robot in three dimensions."""

PARTS: Final = ("traits", "common", "initial_states", "start", "resume")  # of every engine
_SAME_TIME: Final = 1e-9  # s
_PATH: Final = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_][\w.]*")


def engine_named(name: str) -> Engine:
    """Return an engine by its name, one of :data:`ENGINES` or ``package.module:object``; ParameterError for an unknown
    name.

    The engine is imported here, because MuJoCo takes a moment to load.
    """
    engine: Engine
    known = ", ".join(ENGINES)
    require(isinstance(name, str), "must be a name", "engine", name, known)
    if name in _MODULES:
        engine = import_module(_MODULES[name])  # a module is an engine
        return engine
    if ":" not in name:
        allowed, near = f"{known}, or package.module:object", nearest_name(name, ENGINES)
        raise ParameterError("must be one of the engines", field="engine", value=name, allowed=allowed, nearest=near)
    return _Own(name, _imported("engine", name))


class _Own:
    """Engine from outside chilopod; errors in it name the engine."""

    def __init__(self, name: str, engine: Any) -> None:
        allowed = "an instance of that class"
        require(not isinstance(engine, type), "must be an object, not a class", "engine", name, allowed)
        for each in PARTS:
            require(hasattr(engine, each), f"must be an engine: attribute {each} is missing", "engine", name)
        known = isinstance(engine.traits, Traits)
        require(known, "must be an engine: its traits must be a chilopod.engine.Traits", "engine", name)
        self._name, self._engine = f"engine {name}", engine
        self.traits: Traits = engine.traits

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or not hasattr(self._engine, name):  # optional, as in contract.HasFootCreep
            raise AttributeError(name)
        found = getattr(self._engine, name)
        return partial(_theirs, self._name, name, found) if callable(found) else found

    def common(self, robot: Robot) -> Hashable:
        shared = _theirs(self._name, "common", self._engine.common, robot)
        try:
            hash(shared)
        except TypeError:
            raise AnalysisError("common must return a hashable value", field=self._name) from None
        return shared

    def initial_states(self, *arguments: Any, **named: Any) -> Array:
        return _theirs(self._name, "initial_states", self._engine.initial_states, *arguments, **named)

    def start(self, *arguments: Any, **named: Any) -> Walk:
        return self._walk("start", *arguments, **named)

    def resume(self, saved: bytes) -> Walk:
        return self._walk("resume", saved)

    def _walk(self, how: str, *arguments: Any, **named: Any) -> Walk:
        walk: Any = _theirs(self._name, how, getattr(self._engine, how), *arguments, **named)
        missing = _theirs(self._name, how, missing_parts, walk)
        if missing:
            problem = f"{how} must return a chilopod.engine.Walk; missing: {', '.join(missing)}"
            raise AnalysisError(problem, field=self._name)
        return cast(Walk, _OwnWalk(self._name, walk))


class _OwnWalk:
    """Walk of an engine from outside chilopod; errors in it name the engine."""

    def __init__(self, name: str, walk: Any) -> None:
        self._name, self._walk = name, walk

    def __getattr__(self, name: str) -> Any:
        if name not in vars(Walk) and not hasattr(self._walk, name):  # optional, as in contract.Foresees
            raise AttributeError(name)
        found = _theirs(self._name, name, getattr, self._walk, name)
        return partial(_theirs, self._name, name, found) if callable(found) else found

    @property
    def time(self) -> float:
        return _theirs(self._name, "time", lambda: float(self._walk.time))

    @property
    def robots(self) -> tuple[Robot, ...]:
        return _theirs(self._name, "robots", lambda: tuple(self._walk.robots))

    def advance(self, until: float) -> None:
        _theirs(self._name, "advance", self._walk.advance, until)
        if not abs(self.time - until) <= _SAME_TIME:
            raise AnalysisError(f"advance({until:g}) must end at that time, not at {self.time} s", field=self._name)

    def observe(self) -> Observation:
        seen: Any = _theirs(self._name, "observe", self._walk.observe)
        robots, joints = len(self.robots), self.robots[0].body.modules - 1
        shapes = {"bearing": (robots,), "distance": (robots,), "joint_angles": (robots, joints)}
        for name, shape in {**shapes, "leg_yaw": (robots, 2), "stiffness": (robots, joints)}.items():
            self._check(f"observe().{name}", getattr(seen, name, None), shape)
        return cast(Observation, seen)

    def pose(self) -> Array:
        pose: Any = _theirs(self._name, "pose", self._walk.pose)
        self._check("pose()", pose, (len(self.robots), 3))
        return cast(Array, pose)

    def _check(self, what: str, values: Any, shape: tuple[int, ...]) -> None:
        if not isinstance(values, np.ndarray) or values.dtype.kind != "f" or values.shape != shape:
            shaped = isinstance(values, np.ndarray)
            found = f"{values.dtype} of shape {values.shape}" if shaped else type(values).__name__
            raise AnalysisError(f"{what} must be an array of floats of shape {shape}, not {found}", field=self._name)


@contextmanager
def foreign(kind: type[ChilopodError], problem: str, *passed: type[ChilopodError], **parts: Any) -> Iterator[None]:
    """Turn what foreign code raises, which may be anything, into an error of chilopod with these parts, but for errors
    that are ``passed`` on."""
    try:
        yield
    except BaseException as error:
        if isinstance(error, (KeyboardInterrupt, *passed)):
            raise
        raise kind(f"{problem} {in_words(error)}", **parts) from error


def _theirs(who: str, what: str, call: Callable[..., Any], /, *arguments: Any, **named: Any) -> Any:
    """Result of a call of foreign code; an error in it names the code."""
    with foreign(AnalysisError, f"{what} raised", ChilopodError, field=who):
        return call(*arguments, **named)


def controller_named(path: str) -> Controller:
    """An instance of a controller's class, given as ``package.module:Class``, with the defaults of all its fields;
    ParameterError if it cannot be imported or is not a controller, see :func:`check_controller`."""
    made = _imported("controller", path)
    if not isinstance(made, type):
        raise ParameterError("must name a class", field="controller", value=path, allowed="package.module:Class")
    parts = {"field": "controller", "value": path, "allowed": "a class whose fields all have defaults"}
    with foreign(ParameterError, "cannot be made:", ParameterError, **parts):
        controller: Controller = made()
    check_controller(controller)
    return controller


def check_controller(controller: Controller) -> None:
    """Make sure that a controller can be part of a trial: a frozen dataclass with ``events`` and ``act``;
    ParameterError if it is not."""
    kind = type(controller)
    for name in ("events", "act"):
        there = callable(getattr(controller, name, None))
        require(there, f"must have a method {name}", "controller", kind.__name__, "events and act")
    frozen = dataclasses.is_dataclass(kind) and kind.__dataclass_params__.frozen
    problem = "must be immutable, because its fields name the trial"
    require(frozen, problem, "controller", kind.__name__, "a frozen dataclass: @dataclass(frozen=True)")


def path_of(kind: type) -> str:
    """``package.module:Class`` of a class."""
    return f"{kind.__module__}:{kind.__qualname__}"


def _imported(field: str, path: str) -> Any:
    allowed = f"package.module:{'Class' if field == 'controller' else 'object'}"
    require(_PATH.fullmatch(path), "must name an object", field, path, allowed)
    module_name, _, name = path.partition(":")
    with foreign(ParameterError, "cannot be imported:", field=field, value=path):
        found: Any = import_module(module_name)
    for part in name.split("."):
        if not hasattr(found, part):
            near = nearest_name(part, dir(found))
            raise ParameterError(f"{module_name} has no {name}", field=field, value=path, nearest=near)
        found = getattr(found, part)
    return found
