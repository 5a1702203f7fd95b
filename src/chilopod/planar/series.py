"""One term of a matrix Taylor series in vector registers, the innermost loop of the linearised flow.

For matrices of some ten rows a BLAS call costs more than its arithmetic, and the compiler does not keep sums in
registers across an inner loop over columns. So the product is written out as compiler instructions: four rows times
two vectors of eight columns stay in registers while the inner index runs; on processors with narrower vectors the
compiler splits the operations. ``benchmarks/series_term.py`` compares it with plain loops and BLAS.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.extending import intrinsic

from chilopod.numba_internals import cgutils, ir, pointer_to

PANEL = 16
"""Number of columns."""

ROWS = 4
"""The number of rows of the matrix must be a multiple of this."""

_LANES = 8


@intrinsic
def series_term(typing_context: Any, matrix: Any, terms: Any, start: Any, scale: Any, total: Any) -> Any:
    """Compute the next term of a series from the last ones, and add it to the sum.

    ``series_term(matrix, terms, start, scale, total)`` puts ``new = scale * matrix @ terms[start : start +
    matrix.shape[1]]`` into the rows of ``terms`` just before ``start``, and adds it to ``total``. All arrays are
    C-contiguous float64: ``matrix`` (r, k) with r a multiple of ROWS, ``terms`` (any number, PANEL), ``total`` (r,
    PANEL); ``start`` is an int64 of at least r. Nothing is checked.
    """
    signature = types.void(matrix, terms, start, scale, total)

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        a, b, c = (
            cgutils.create_struct_proxy(kind)(context, builder, value)
            for kind, value in zip((matrix, terms, total), (args[0], args[1], args[4]), strict=True)
        )
        integer, double = ir.IntType(64), ir.DoubleType()
        vector = ir.VectorType(double, _LANES)
        vectors = PANEL // _LANES
        rows, inner = cgutils.unpack_tuple(builder, a.shape, 2)
        # fmuladd: one instruction where the processor has it, a product and a sum where it has not.
        fma = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(vector, [vector] * 3), f"llvm.fmuladd.v{_LANES}f64"
        )

        def constant(value: int) -> Any:
            return ir.Constant(integer, value)

        def spread(value: Any) -> Any:
            undefined = ir.Constant(vector, ir.Undefined)
            lane = builder.insert_element(undefined, value, ir.Constant(ir.IntType(32), 0))
            return builder.shuffle_vector(
                lane, undefined, ir.Constant(ir.VectorType(ir.IntType(32), _LANES), [0] * _LANES)
            )

        def element(base: Any, row: Any, column: int) -> Any:
            at = builder.add(builder.mul(row, constant(vectors)), constant(column))
            return builder.gep(base, [at], source_etype=vector)

        def panel(data: Any, row: Any) -> Any:
            start = builder.gep(data, [builder.mul(row, constant(PANEL))], source_etype=double)
            return pointer_to(vector, builder, start)

        def loaded(place: Any, **how: Any) -> Any:
            return builder.load(place, typ=vector, **how)

        source = panel(b.data, args[2])
        target = panel(b.data, builder.sub(args[2], rows))
        summed = panel(c.data, constant(0))
        factor = spread(args[3])
        sums = [[cgutils.alloca_once(builder, vector) for _ in range(vectors)] for _ in range(ROWS)]
        with cgutils.for_range_slice(builder, constant(0), rows, constant(ROWS), inc=True) as (i, _):
            for slot in (slot for row in sums for slot in row):
                builder.store(ir.Constant(vector, [0.0] * _LANES), slot)
            with cgutils.for_range(builder, inner) as loop:
                columns = [loaded(element(source, loop.index, h), align=8) for h in range(vectors)]
                for r in range(ROWS):
                    at = builder.add(builder.mul(builder.add(i, constant(r)), inner), loop.index)
                    entry = spread(builder.load(builder.gep(a.data, [at], source_etype=double), typ=double))
                    for h in range(vectors):
                        builder.store(builder.call(fma, [entry, columns[h], loaded(sums[r][h])]), sums[r][h])
            for r in range(ROWS):
                for h in range(vectors):
                    row = builder.add(i, constant(r))
                    new = builder.fmul(factor, loaded(sums[r][h]))
                    builder.store(new, element(target, row, h), align=8)
                    place = element(summed, row, h)
                    builder.store(builder.fadd(loaded(place, align=8), new), place, align=8)
        return context.get_dummy_value()

    return signature, generate
