"""Guard that keeps a walk to one thread at a time, for every engine."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial, wraps
from threading import get_ident
from typing import Any, Final, TypeVar

from chilopod.engine.contract import Foresees, Walk
from chilopod.errors import ThreadError

_Kind = TypeVar("_Kind", bound=type)

_VERBS: Final = tuple(
    name
    for name, each in {**vars(Walk), **vars(Foresees)}.items()
    if callable(each) and not isinstance(each, type) and name[0] != "_"
)
_INSIDE: Final = "_thread_inside"


def one_thread(kind: _Kind) -> _Kind:
    """Make a class of walks refuse a thread while another thread runs a method of :class:`Walk` or :class:`Foresees`.

    Threads may take turns: no thread owns a walk between two calls. A method may call others.
    """
    for name in filter(partial(hasattr, kind), _VERBS):
        setattr(kind, name, _alone(name, getattr(kind, name)))
    return kind


def _alone(name: str, verb: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(verb)
    def alone(self: Any, *arguments: Any, **named: Any) -> Any:
        state, me = self.__dict__, get_ident()
        if state.get(_INSIDE) == me:
            return verb(self, *arguments, **named)
        # One step for the interpreter, so that of two threads one is first.
        if state.setdefault(_INSIDE, me) != me:
            allowed = "one thread at a time: give each thread its own walk, or use a lock"
            raise ThreadError("must not run while another thread uses the walk", field=f"walk.{name}", allowed=allowed)
        try:
            return verb(self, *arguments, **named)
        finally:
            del state[_INSIDE]

    return alone
