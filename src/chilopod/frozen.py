"""Arrays that nobody can write into: what keeps models and results as they are once they are made."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

AnyArray = TypeVar("AnyArray", bound=NDArray[Any])


def read_only(array: AnyArray) -> AnyArray:
    """An array of the same numbers, in the same order in memory, that cannot be written into.

    It is a copy: behind a view, whoever holds the original could still change the numbers, and the original is left as
    writable as it was. Only an array that is read-only down to its memory is given back itself.

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


class ReadOnlyArrays:
    """Base of frozen dataclasses whose arrays are as frozen as their fields, also after a copy or a pickle.

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
