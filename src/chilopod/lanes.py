"""Numbers in lanes for numba: several numbers that one vector instruction of the processor works on.

In compiled code :func:`as_lanes` makes an array of them of an array of plain numbers. It is indexed as any array, and
its numbers are added, multiplied and so on as any number; a plain number beside them is the same in every lane. No lane
knows of another, and a computation has the same bits in one lane as in eight, whatever is in the other seven: every
operation rounds as IEEE 754 says, and which sums are fused with a product, into one rounding, is settled here and not
by LLVM, which would choose otherwise for another width. So what must have the same bits in any width is compiled by
:data:`chilopod.compiled.njit`, without leave to fuse. (A processor older than 2013 has no fused instruction: the same
bits take it much longer.)
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic, lower_builtin, lower_cast, models, register_model, type_callable

from chilopod.compiled import njit
from chilopod.numba_internals import Conversion, cgutils, ir, signature

LANES = 8
"""Number of lanes of double precision in the widest registers; narrower ones are used two or four at a time."""

HALF = LANES // 2
"""Lanes for computations with few numbers side by side."""

_CACHE_LINE = 8  # numbers
_INDEX = ir.IntType(32)


class LanesType(types.Type):  # type: ignore[misc]
    """Numba type of a number in 1, ``HALF`` or ``LANES`` lanes."""

    def __init__(self, width: int) -> None:
        self.width = width
        self.vector = ir.VectorType(ir.DoubleType(), width) if width > 1 else ir.DoubleType()
        super().__init__(name=f"lanes({width})")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """A plain number is the same in every lane."""
        return Conversion.safe if isinstance(other, types.Float) else None


_TYPES = {width: LanesType(width) for width in (1, HALF, LANES)}


@register_model(LanesType)
class _Model(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, kind.vector)


@lower_cast(types.Float, LanesType)
def _everywhere(context: Any, builder: Any, given: Any, kind: Any, value: Any) -> Any:
    number = context.cast(builder, value, given, types.float64)
    if kind.width == 1:
        return number
    nothing = ir.Constant(kind.vector, ir.Undefined)
    first = builder.insert_element(nothing, number, ir.Constant(_INDEX, 0))
    return builder.shuffle_vector(first, nothing, ir.Constant(ir.VectorType(_INDEX, kind.width), [0] * kind.width))


def _call(builder: Any, name: str, kind: Any, values: Sequence[Any]) -> Any:
    """Call of an intrinsic function of LLVM for numbers of one type."""
    full = f"llvm.{name}." + (f"v{kind.width}f64" if kind.width > 1 else "f64")
    signature = ir.FunctionType(kind.vector, [kind.vector] * len(values))
    return builder.call(cgutils.get_or_insert_function(builder.module, signature, full), values)


def _factors(value: Any) -> Any:
    """Factors of a product, or None for another operation."""
    return value.operands if getattr(value, "opname", "") == "fmul" else None


def _add(builder: Any, kind: Any, a: Any, b: Any) -> Any:
    if factors := _factors(a):
        return _call(builder, "fma", kind, (*factors, b))
    if factors := _factors(b):
        return _call(builder, "fma", kind, (*factors, a))
    return builder.fadd(a, b)


def _subtract(builder: Any, kind: Any, a: Any, b: Any) -> Any:
    if factors := _factors(b):
        return _call(builder, "fma", kind, (builder.fneg(factors[0]), factors[1], a))
    if factors := _factors(a):
        return _call(builder, "fma", kind, (*factors, builder.fneg(b)))
    return builder.fsub(a, b)


def _same(*given: Any) -> Any:
    """Signature of a function whose arguments and result are all in lanes; None if no argument is in lanes."""
    kinds = [kind for kind in given if isinstance(kind, LanesType)]
    return signature(*kinds[:1] * (len(given) + 1)) if kinds else None


def _add_operator(function: Callable[..., Any], make: Callable[..., Any], operands: int) -> None:
    if operands == 1:
        type_callable(function)(lambda context: lambda a: _same(a))
    else:
        type_callable(function)(lambda context: lambda a, b: _same(a, b))

    @lower_builtin(function, *(LanesType,) * operands)
    def lower(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        return make(builder, sig.return_type, *values)


_add_operator(operator.neg, lambda builder, kind, a: builder.fneg(a), 1)
for _make, *_functions in (
    (_add, operator.add, operator.iadd),
    (_subtract, operator.sub, operator.isub),
    (lambda builder, kind, a, b: builder.fmul(a, b), operator.mul, operator.imul),
    (lambda builder, kind, a, b: builder.fdiv(a, b), operator.truediv, operator.itruediv),
):
    for _function in _functions:
        _add_operator(_function, _make, 2)


def _kind(*given: Any) -> Any:
    """Lane type among the types of some arguments."""
    return next(each for each in given if isinstance(each, LanesType))


def _operands(context: Any, builder: Any, sig: Any, values: Any) -> list[Any]:
    kind = _kind(*sig.args)
    return [context.cast(builder, value, given, kind) for value, given in zip(values, sig.args, strict=True)]


def _instruction_of(name: str) -> Any:
    """Function of one number for which LLVM has an instruction."""

    @intrinsic
    def function(typing: Any, a: Any) -> Any:
        def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
            return _call(builder, name, sig.return_type, values)

        return (a(a), generate) if isinstance(a, LanesType) else None

    return function


absolute = _instruction_of("fabs")
nearest_integer = _instruction_of("rint")
square_root = _instruction_of("sqrt")


@intrinsic
def choose(typing: Any, a: Any, b: Any, this: Any, that: Any) -> Any:
    """Return ``this`` where a < b, and ``that`` where not, or where either is not a number."""
    kind = _kind(a, b, this, that)

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        a, b, this, that = _operands(context, builder, sig, values)
        return builder.select(builder.fcmp_ordered("<", a, b), this, that)

    return kind(a, b, this, that), generate


@njit(inline="always")
def larger(a: Any, b: Any) -> Any:
    """The larger of two; a if either is not a number."""
    return choose(a, b, b, a)


@intrinsic
def any_less(typing: Any, a: Any, b: Any) -> Any:
    """True if a < b in any lane."""
    width = _kind(a, b).width

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        less = builder.fcmp_ordered("<", *_operands(context, builder, sig, values))
        if width == 1:
            return less
        bits = ir.IntType(width)
        return builder.icmp_unsigned("!=", builder.bitcast(less, bits), ir.Constant(bits, 0))

    return types.boolean(a, b), generate


@intrinsic
def exponential(typing: Any, a: Any) -> Any:
    """e^a, one lane after the other."""

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        call = context.get_function(math.exp, signature(types.float64, types.float64))
        (out,) = values
        if sig.args[0].width == 1:
            return call(builder, (out,))
        for index in (ir.Constant(_INDEX, lane) for lane in range(sig.args[0].width)):
            out = builder.insert_element(out, call(builder, (builder.extract_element(out, index),)), index)
        return out

    return a(a), generate


@intrinsic(prefer_literal=True)
def as_lanes(typing: Any, array: Any, width: Any) -> Any:
    """View of an array as numbers in lanes, without the last dimension, whose length is the constant ``width``."""
    kind = types.Array(_TYPES[width.literal_value], array.ndim - 1, "C", aligned=False)

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        plain = context.make_array(array)(context, builder, values[0])
        out = context.make_array(kind)(context, builder)
        context.populate_array(
            out,
            data=builder.bitcast(plain.data, out.data.type),
            shape=cgutils.unpack_tuple(builder, plain.shape)[:-1],
            strides=cgutils.unpack_tuple(builder, plain.strides)[:-1],
            itemsize=context.get_constant(types.intp, 8 * width.literal_value),
            meminfo=plain.meminfo,
            parent=plain.parent,
        )
        context.nrt.incref(builder, array, values[0])
        return out._getvalue()

    return kind(array, width), generate


@njit
def room(shape: Any) -> Any:
    """Array of zeros that begins at a cache line of the processor, as vector registers need it."""
    numbers = 1
    for length in shape:
        numbers *= length
    more = np.zeros(numbers + _CACHE_LINE)
    skip = -(more.ctypes.data // 8) % _CACHE_LINE
    return more[skip : skip + numbers].reshape(shape)
