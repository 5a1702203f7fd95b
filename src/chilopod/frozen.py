"""Types of arrays, and read-only arrays, which keep models and results unchanged after their construction."""

from __future__ import annotations

import enum
from collections.abc import Sized
from dataclasses import fields, is_dataclass
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
AnyArray = TypeVar("AnyArray", bound=NDArray[Any])


def read_only(array: AnyArray) -> AnyArray:
    """Read-only array of the same numbers in the same order in memory.

    The result is a copy, because the numbers behind a view could still be changed through the original. Only an array
    that is read-only down to its memory is returned itself.

    Compiled kernels take copies of these (numba compiles a function once more for read-only arguments).
    """
    if not array.flags.writeable:
        below: Any = array.base
        while isinstance(below, np.ndarray) and not below.flags.writeable:
            below = below.base
        if below is None:
            return array
    copy = array.copy(order="K")
    copy.setflags(write=False)
    return copy


_MOST_SHOWN, _WIDEST, _FEW = 12, 88, 6  # fields; characters of one; numbers of an array


class Short:
    """Base of dataclasses that print as a few lines; large parts are shown by type and size.

    ``_verdicts`` names properties that are printed too.
    """

    _verdicts: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, **named: Any) -> None:
        super().__init_subclass__(**named)
        if "__repr__" not in cls.__dict__:  # in place of the one that the decorator would make
            cls.__repr__ = _short  # type: ignore[method-assign]


def _short(result: Any) -> str:
    shown = [each.name for each in fields(result) if each.repr]
    lines = [f"    {name}={in_one_line(getattr(result, name))}" for name in (*shown[:_MOST_SHOWN], *result._verdicts)]
    if len(shown) > _MOST_SHOWN:
        lines.append(f"    and {', '.join(shown[_MOST_SHOWN:])}"[: _WIDEST + 20])
    return "\n".join([f"{type(result).__name__}(", *lines, ")"])


def in_one_line(value: Any) -> str:
    """Text of a field in one line; large parts are shown by type and size."""
    kind = type(value).__name__
    if isinstance(value, enum.Enum):
        return str(getattr(value, "label", value.name))
    if isinstance(value, np.ndarray):
        if value.size > _FEW or value.dtype == object:
            return f"<{value.dtype} array of shape {value.shape}>"
        return np.array2string(value, precision=6, separator=", ").replace("\n", "")
    if isinstance(value, tuple | list) and len(value) and is_dataclass(value[0]):
        return f"<{len(value)} times {type(value[0]).__name__}>"
    if is_dataclass(value) or hasattr(value, "dims"):  # results, and datasets
        return f"<{kind}>"
    text = repr(value)
    if len(text) <= _WIDEST and "\n" not in text:
        return text
    return f"<{kind} of {len(value)}>" if isinstance(value, Sized) else f"<{kind}>"


class ReadOnlyArrays(Short):
    """Base of frozen dataclasses whose arrays are read-only, also after a copy or a pickle.

    A subclass with a ``__post_init__`` of its own calls this one last.
    """

    def __post_init__(self) -> None:
        own = self.__dict__  # the way around the dataclass's own lock
        for name, value in own.items():
            if isinstance(value, np.ndarray):
                own[name] = read_only(value)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        ReadOnlyArrays.__post_init__(self)
