"""Events of hybrid systems: a motion reaches a surface and jumps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chilopod.errors import ParameterError
from chilopod.flows.arguments import SIZES, numbers
from chilopod.frozen import Array


@dataclass(frozen=True)
class Event:
    """An event of a hybrid system, such as an impact or the touchdown of a foot.

    Parameters
    ----------
    guard
        Function ``guard(t, x, *args)`` -> a number that passes zero at the event. Of several events at one instant
        only the first of the list happens, the others only if their guards pass zero again.
    reset
        Function ``reset(t, x, *args)`` -> state after the event, shape (n,); None for an unchanged state.
    direction
        Sign of the guard's passage through zero: +1 rising, -1 falling, 0 either.
    """

    guard: Callable[..., Any]
    reset: Callable[..., ArrayLike] | None = None
    direction: int = 0

    def __post_init__(self) -> None:
        for name, value in (("guard", self.guard), ("reset", self.guard if self.reset is None else self.reset)):
            if not callable(value):
                raise ParameterError("must be a function", field=name, value=value, allowed=f"{name}(t, x, *args)")
        if not (isinstance(self.direction, Real) and self.direction in (-1, 0, 1)):
            raise ParameterError("must be -1, 0 or 1", field="direction", value=self.direction)


def checked_events(events: object) -> tuple[Event, ...]:
    """Check that events are a list of events."""
    if isinstance(events, Event):
        return (events,)
    if not isinstance(events, Sequence) or not all(isinstance(event, Event) for event in events):
        raise ParameterError(
            "must be a list of events", field="events", value=events, allowed="[Event(guard, reset), ...]"
        )
    return tuple(events)


def check_events(events: Sequence[Event], args: tuple[Any, ...], times: Array, orbit: Array | None, n: int) -> None:
    """Check that guards give numbers that may pass zero, and resets states, around the orbit at some times."""
    if not events:
        return
    base = np.zeros(n) if orbit is None else orbit
    waves = [size * np.cos(3.0 * np.arange(n) + 1.0) for size in SIZES]
    places = [(t, base + wave) for t in times.tolist() for wave in [np.zeros(n), *waves]]
    known: dict[int, Array] = {}
    for i, event in enumerate(events):
        name = f"events[{i}].guard"
        asked = [_value(event.guard, t, x, args, (), name) for t, x in places]
        values = np.array([np.nan if value is None else value for value in asked])
        if event.reset is not None:
            _value(event.reset, *places[0], args, (n,), f"events[{i}].reset")
        if asked[0] is None:
            continue  # tracing reports it
        if orbit is not None and not np.isfinite(values[0]):
            raise ParameterError("is not finite on the orbit", field=name, value=float(values[0]))
        if not np.isfinite(values).any():
            raise ParameterError("must be finite, but was not at any state that was tried", field=name)
        if not np.nan_to_num(values).any():
            raise ParameterError("is zero at all states", field=name, allowed="a function that passes zero")
        for j, other in known.items():
            if np.array_equal(values, other, equal_nan=True) and event.direction * events[j].direction != -1:
                said = f"must differ from that of events[{j}]: of events at one instant only the first happens"
                raise ParameterError(said, field=name, allowed="one event with a reset that does both")
        known[i] = values


def _value(
    function: Callable[..., Any], t: float, x: Array, args: tuple[Any, ...], shape: tuple[int, ...], name: str
) -> Array | None:
    """Value of a guard or a reset; None where it raises an exception."""
    try:
        with np.errstate(all="ignore"):
            result = function(t, x.copy(), *args)
    except Exception:
        return None
    if not shape:
        if isinstance(result, bool | np.bool_):
            raise ParameterError("must return a number, not true or false", field=name, allowed="zero at the event")
        if isinstance(result, list | tuple | np.ndarray) and np.size(result) == 1:
            result = np.ravel(result)[0]
    return numbers(result, shape, name)
