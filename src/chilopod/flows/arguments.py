"""Checks of the user's input beside a right-hand side, and calls of the user's functions, with errors of one line."""

from __future__ import annotations

import functools
import operator
import re
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chilopod.errors import AnalysisError, ChilopodError, ParameterError, in_words
from chilopod.frozen import Array, read_only

LARGEST = 1_000_000
"""Largest number of states."""

SIZES = (1e-6, 1e-3, 1.0, 1e3)
_SAME = 1e-6
_NEGLIGIBLE = 1e-9  # change of a state within the shift, relative to its size
_LONGEST_SHOWN = 60


class UserError(AnalysisError):
    """A user's function raised an exception of its own."""


class UserCode:
    """Context of a call of a user's function, at a value of the parameter in a family: any exception becomes a
    :class:`UserError` of one line, which an outer context with a value names instead."""

    def __init__(self, field: str, value: object = None) -> None:
        self._field, self._value = field, value

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, UserError) and error.value is None and self._value is not None:
            error = error.__cause__
        if isinstance(error, Exception) and not isinstance(error, ChilopodError):
            raise UserError(f"raised {in_words(error)}", field=self._field, value=self._value) from error


def positive(field: str, value: object) -> float:
    """A positive finite number."""
    number = float(finite_array(value, (), field))
    if not number > 0:
        raise ParameterError("must be positive and finite", field=field, value=value)
    return number


def checked_count(field: str, value: object, most: int) -> int:
    """A whole number from 1 to ``most``."""
    try:
        count = 0 if isinstance(value, bool) else operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        count = 0
    if not 1 <= count <= most:
        raise ParameterError("must be a whole number", field=field, value=value, allowed=f"1 to {most}")
    return count


def finite_array(value: Any, shape: tuple[int, ...] | None, field: str) -> Array:
    """``value`` as finite numbers in an array of the given shape, or of any."""
    what = "must be a number" if shape == () else "must be numbers"
    try:
        array = np.array(value)
        if array.dtype.kind not in "iufO":
            raise TypeError("strings, truth values, complex numbers or dates")
        array = array.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ParameterError(what, field=field, value=value) from None
    if shape is not None and array.shape != shape:
        raise ParameterError("has the wrong shape", field=field, value=array.shape, allowed=str(shape))
    if not np.isfinite(array).all():
        raise ParameterError("must be finite", field=field, value=value)
    return array


def shape_of(value: Any) -> tuple[int, ...] | str:
    """The shape of an array-like, or a word for rows of different lengths."""
    try:
        return np.shape(value)
    except ValueError:
        return "ragged"


def numbers(result: Any, shape: tuple[int, ...], field: str) -> Array:
    """Values of a user's function as an array of the required shape."""
    try:
        # None would become NaN.
        array = None if result is None else np.asarray(result, dtype=np.float64)
    except (TypeError, ValueError):
        array = None
    wanted = f"an array of shape {shape}" if shape else "one number"
    if array is None:
        what, text = "an array of numbers" if shape else "a number", repr(result)
        given = text if len(text) <= _LONGEST_SHOWN else f"a {type(result).__name__}"
        raise ParameterError(f"must return {what}, not {given}", field=field, allowed=wanted)
    if array.shape != shape:
        raise ParameterError(f"returns an array of shape {array.shape}", field=field, allowed=wanted)
    return array


def check_shape(rhs: Callable[..., ArrayLike], args: tuple[Any, ...], t: float, x: Array) -> None:
    """Evaluate a right-hand side once and check the shape of its result."""
    try:
        with np.errstate(all="ignore"):
            result = rhs(t, x.copy(), *args)
    except Exception as error:
        if isinstance(error, ArithmeticError | ValueError) and not re.search("shape|sequence", str(error)):
            return  # a singularity at this state is not an error
        said = f"cannot be evaluated at a state of shape {x.shape} ({in_words(error)})"
        raise ParameterError(said, field="rhs") from error
    numbers(result, x.shape, "rhs")


Slopes = Callable[[Array, Array], Array]
"""``slopes(times, states) -> dx/dt``, shapes (samples,), (n, samples) and (n, samples); NaN where undefined."""


_SYMMETRIES = {
    "period": ("period", "T with f(t + T, x) = f(t, x); a function of one period takes t % T"),
    "symmetry": ("symmetry", "S with S f(t, x) = f(t + T/2, S x)"),
    "spatial_symmetry": ("symmetry", "P with P f(t, x) = f(t, P x)"),
}


@functools.lru_cache(maxsize=16)
def _compared(matrix: bytes, shift: float, times: bytes, base: bytes, period: float) -> tuple[Array, Array]:
    """Times and states of all sizes at which a symmetry is tested, then their images: the same for a family."""
    origin, some = np.frombuffer(base), np.frombuffer(times)
    n = origin.size
    waves = np.cos(3.0 * np.arange(n)[:, None] + np.arange(1.0, 3.0))[:, None] * np.array(SIZES)[:, None]
    x = np.tile(origin[:, None] + waves.reshape(n, -1), some.size)
    t = np.repeat(some, x.shape[1] // some.size)
    images = np.frombuffer(matrix).reshape(n, n) @ x
    return read_only(np.concatenate([t, (t + shift) % period])), read_only(np.concatenate([x, images], axis=1))


def check_symmetry(
    field: str, matrix: Array, shift: float, slopes: Slopes, times: Array, base: Array, period: float
) -> None:
    """Check a symmetry in time or space, or a period, of a right-hand side: a wrong one gives wrong multipliers."""
    failed = _failure(matrix, shift, slopes, times, base, period)
    if failed is not None:
        what, allowed = _SYMMETRIES[field]
        said = f"must be a {what} of the right-hand side, but fails at t = {failed:g}"
        raise ParameterError(said, field=field, value=shift if field == "period" else None, allowed=allowed)


def check_timeless(slopes: Slopes, base: Array, duration: float) -> None:
    """Check that a right-hand side without a period does not depend on time."""
    times = np.array([0.1234 * duration])
    if _failure(np.eye(base.size), 0.4444 * duration, slopes, times, base, np.inf) is not None:
        raise ParameterError("must be given", field="period", value=None, allowed="T: the right-hand side depends on t")


def _failure(matrix: Array, shift: float, slopes: Slopes, times: Array, base: Array, period: float) -> float | None:
    """Time at which S f(t, x) is not f(t + shift, S x), of some times, modulo the period, and states of all sizes;
    None if there is none. A period is the symmetry S = 1 with itself as the shift."""
    t, x = _compared(matrix.tobytes(), shift, times.tobytes(), base.tobytes(), period)
    both, half = slopes(t, x), t.size // 2
    here, there = both[:, :half], both[:, half:]
    off = np.abs(matrix @ here - there)
    if np.isfinite(off).all() and (off <= _SAME * np.abs(there)).all():
        return None
    terms = np.abs(matrix) @ np.abs(here) + np.abs(there)
    # The largest among samples of the same size; every time has some.
    alike = (base.size, times.size, len(SIZES), -1)
    largest = np.where(np.isfinite(terms), terms, 0.0).reshape(alike).max(axis=(1, 3), keepdims=True)
    wrong = (off.reshape(alike) > _SAME * largest).reshape(off.shape)
    if shift > 0.0:  # a right-hand side may be round-off of terms that cancel
        wrong &= off > _NEGLIGIBLE / shift * np.abs(x[:, :half]).max(axis=0)
    wrong = wrong.any(axis=0)
    return float(t[:half][wrong][0]) if wrong.any() else None


def sampled(rhs: Callable[..., ArrayLike], args: tuple[Any, ...], n: int) -> Slopes:
    """A right-hand side at many times and states, evaluated one after the other."""

    def slopes(times: Array, states: Array) -> Array:
        columns = []
        for t, x in zip(times.tolist(), states.T, strict=True):
            try:
                with np.errstate(all="ignore"), UserCode("rhs"):
                    column = numbers(rhs(t, x.copy(), *args), (n,), "rhs")
            except UserError as error:
                if not isinstance(error.__cause__, ArithmeticError | ValueError):
                    raise
                column = np.full(n, np.nan)  # not defined at this state
            columns.append(column)
        return np.array(columns).T

    return slopes
