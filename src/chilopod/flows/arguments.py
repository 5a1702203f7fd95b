"""Checks of the user's arguments, and calls of the user's functions, with errors of one line."""

from __future__ import annotations

import operator
import re
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chilopod.errors import AnalysisError, ChilopodError, ParameterError, in_words
from chilopod.flows import deadline
from chilopod.frozen import Array

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
    number = value if type(value) is float and value < np.inf else float(finite_array(value, (), field))
    if not number > 0:
        raise ParameterError("must be positive and finite", field=field, value=value)
    return number


def checked_count(field: str, value: object, most: int, least: int = 1) -> int:
    """A whole number from ``least``, 1 or more, to ``most``."""
    try:
        count = 0 if isinstance(value, bool) else operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        count = 0
    if not least <= count <= most:
        said = "is too large" if count > most else "must be more" if count > 0 else "must be a whole number"
        raise ParameterError(said, field=field, value=value, allowed=f"{least} to {most}" if most > 1 else "1")
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
        raise ParameterError(f"has the wrong shape {array.shape}", field=field, value=value, allowed=str(shape))
    if not np.isfinite(array).all():
        raise ParameterError("must be finite", field=field, value=value)
    return array


def shape_of(value: Any) -> tuple[int, ...] | str:
    """The shape of an array-like, or a word for rows of different lengths."""
    try:
        return np.shape(value)
    except ValueError:
        return "ragged"


def as_real(result: Any) -> Array:
    """Values of a user's function as floating-point numbers, copied, as a function may return the same array at every
    call; TypeError for complex ones off the real axis."""
    array = np.asarray(result)
    if array.dtype.kind == "c":
        if array.imag.any():
            raise TypeError("complex numbers")
        array = array.real
    return np.array(array, dtype=np.float64)


def numbers(result: Any, shape: tuple[int, ...], field: str) -> Array:
    """Values of a user's function as an array of the required shape."""
    array, dtype = None, np.dtype(object)
    with suppress(TypeError, ValueError):
        dtype = np.asarray(result).dtype
        # None would become NaN.
        array = None if result is None else as_real(result)
    if dtype.char in "efF":  # half and single: rounding would stop the integration, with no word on its cause
        raise ParameterError(f"must be computed in double precision, not {dtype.name}", field=field)
    wanted = f"an array of shape {shape}" if shape else "one number"
    if array is None:
        what, text = "an array of real numbers" if shape else "a real number", repr(result)
        given = text if len(text) <= _LONGEST_SHOWN else f"a {type(result).__name__}"
        if dtype.kind == "c":
            given = "complex ones"
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


_CLAIMS = {
    "timeless": ("must be given", "T: {} depends on t"),
    "period": ("period", "T with f(t + T, x) = f(t, x); a function of one period takes t % T"),
    "symmetry": ("symmetry", "S with S f(t + T/k, x) = f(t, S x), of order k"),
    "spatial_symmetry": ("symmetry", "P with P f(t, x) = f(t, P x)"),
}


class Claim:
    """A symmetry in time or space of a right-hand side, its period, or none: S f(t, x) = f(t + shift, S x) at some
    times, modulo the period, and states of all sizes round a ``base``. A period is S = 1 with itself as the shift."""

    def __init__(self, field: str, matrix: Array, shift: float, times: Array, base: Array, period: float) -> None:
        self.field, self.matrix, self.shift = field, matrix, shift
        waves = np.cos(3.0 * np.arange(base.size)[:, None] + np.arange(1.0, 3.0))[:, None] * np.array(SIZES)[:, None]
        x = np.tile(base[:, None] + waves.reshape(base.size, -1), times.size)
        t = np.repeat(times, x.shape[1] // times.size)
        self.times = np.concatenate([t, (t + shift) % period])
        self.states = np.concatenate([x, matrix @ x], axis=1)
        self._alike = base.size, times.size, len(SIZES), -1  # the largest among samples of the same size

    def check_event(self, name: str, guard: Array, direction: int, reset: Array | None) -> None:
        """Check the claim for an event: its guard at the times and states, shape (1, samples), and its reset.

        A guard gives the same events if it is multiplied by a constant, positive unless both directions count.
        """
        here, there = np.split(np.where(np.isfinite(guard), guard, 0.0), 2, axis=1)
        largest = np.argmax(np.abs(here))
        factor = there.flat[largest] / (here.flat[largest] or 1.0)
        if self.field == "period" and (factor > 0.0 or (factor < 0.0 and direction == 0)):
            guard = np.hstack([guard[:, : here.size], guard[:, here.size :] / factor])
        self.check(np.broadcast_to(guard, self.states.shape), f"{name}.guard", 0.0)
        if reset is not None:
            self.check(reset, f"{name}.reset", _NEGLIGIBLE)

    def check(self, slopes: Array, of: str = "the right-hand side", negligible: float | None = None) -> None:
        """Check the claim by the values of a function, at its times and states: a wrong one gives wrong multipliers.
        Changes below a part of the states are ``negligible``, by default as that of a state within the shift."""
        half = self.times.size // 2
        here, there = slopes[:, :half], slopes[:, half:]
        with np.errstate(invalid="ignore"):  # values beyond double precision
            off = np.abs(self.matrix @ here - there)
            terms = np.abs(self.matrix) @ np.abs(here) + np.abs(there)
        if off.max() < np.inf and (off <= _SAME * np.abs(there)).all():
            return
        largest = np.where(np.isfinite(terms), terms, 0.0).reshape(self._alike).max(axis=(1, 3), keepdims=True)
        wrong = (off.reshape(self._alike) > _SAME * largest).reshape(off.shape)
        if self.shift > 0.0:  # a right-hand side may be round-off of terms that cancel
            least = _NEGLIGIBLE / self.shift if negligible is None else negligible
            wrong &= off > least * np.abs(self.states[:, :half]).max(axis=0)
        if not wrong.any():
            return
        what, allowed = _CLAIMS[self.field]
        if self.field == "timeless":
            raise ParameterError(what, field="period", value=None, allowed=allowed.format(of))
        failed = float(self.times[:half][wrong.any(axis=0)][0])
        said = f"must be a {what} of {of}, but fails at t = {failed:g}"
        value = self.shift if self.field == "period" else None
        raise ParameterError(said, field=self.field, value=value, allowed=allowed)


def sampled(rhs: Callable[..., ArrayLike], args: tuple[Any, ...], n: int) -> Slopes:
    """A right-hand side at many times and states, evaluated one after the other."""

    def slopes(times: Array, states: Array) -> Array:
        columns = []
        for t, x in zip(times.tolist(), states.T, strict=True):
            deadline.check()  # a slow function is called thousands of times
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


_FUNCTIONS = {
    "family": "family(value) -> the system at a value of the parameter",
    "family2": "family2(p, q) -> the system at values of two parameters",
    "progress": "progress(count, point)",
}
_COUNTS = {"budget": sys.maxsize, "points": sys.maxsize, "periods": 1000}  # with the largest
_LENGTHS = {"step", "longest", "precision"}


def check_arguments(**given: object) -> None:
    """Check arguments by their names: functions, whole numbers, positive numbers, and flags."""
    for field, value in given.items():
        if field in _FUNCTIONS:
            if not callable(value):
                raise ParameterError("must be a function", field=field, value=value, allowed=_FUNCTIONS[field])
        elif field in _COUNTS:
            if not (field == "points" and value is None):
                checked_count(field, value, _COUNTS[field])
        elif field in _LENGTHS:
            positive(field, value)
        elif not isinstance(value, bool | np.bool_):
            raise ParameterError("must be a truth value", field=field, value=value, allowed="True or False")


_NARROWEST = 1e-13  # width of an interval, relative to its values: some 500 floating-point numbers


def checked_interval(between: object, narrowest: float = _NARROWEST) -> tuple[float, float]:
    """An interval as two finite numbers, the second of which is larger, wider than ``narrowest`` relative to them."""
    low, high = finite_array(between, (2,), "between").tolist()
    if not (low < high and np.isfinite(high - low)):
        raise ParameterError("must rise", field="between", value=between, allowed="(lower, higher), both finite")
    if not high - low > narrowest * max(abs(low), abs(high)) + 1e9 * np.finfo(float).smallest_subnormal:
        raise ParameterError("is too narrow for double precision", field="between", value=between)
    return low, high


def checked_box(between: object) -> Array:
    """Intervals of both parameters, shape (2, 2)."""
    try:
        box = np.array([checked_interval(each) for each in between])  # type: ignore[attr-defined]
    except (TypeError, ParameterError):
        box = np.empty(0)
    if box.shape != (2, 2):
        allowed = "((p_low, p_high), (q_low, q_high))"
        raise ParameterError("must be two intervals", field="between", value=between, allowed=allowed)
    return box
