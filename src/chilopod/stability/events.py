"""Events of hybrid systems: where a motion meets a surface, and jumps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from chilopod.errors import ParameterError


@dataclass(frozen=True)
class Event:
    """An event of a hybrid system, such as an impact or a foot that touches down.

    Parameters
    ----------
    guard
        ``guard(t, x, *args)`` -> a number: the event is where it passes zero.
    reset
        ``reset(t, x, *args)`` -> the state after it, shape (n,); None where the state goes on as it is.
    direction
        +1 if the guard has to rise through zero, -1 if it has to fall, 0 for both.
    """

    guard: Callable[..., Any]
    reset: Callable[..., ArrayLike] | None = None
    direction: int = 0

    def __post_init__(self) -> None:
        for name, value in (("guard", self.guard), ("reset", self.reset or self.guard)):
            if not callable(value):
                raise ParameterError("must be a function", field=name, value=value, allowed=f"{name}(t, x, *args)")
        if self.direction not in (-1, 0, 1):
            raise ParameterError("must be -1, 0 or 1", field="direction", value=self.direction)


def checked_events(events: object) -> tuple[Event, ...]:
    """Events as what they should be."""
    if isinstance(events, Event):
        return (events,)
    if not isinstance(events, Sequence) or not all(isinstance(event, Event) for event in events):
        raise ParameterError("must be events", field="events", value=events, allowed="[Event(guard, reset), ...]")
    return tuple(events)
