"""Products of large matrices, bitwise those of plain loops and several times as fast.

Each sum goes in the order of a plain loop, so that it is rounded as there. Only what is computed
side by side differs: a tile of the result, whose sums stay in registers.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from reobserve.core.kernel import kernel

Array = NDArray[np.float64]

ROWS, COLUMNS = 6, 8  # of a tile: twelve registers of four numbers, of sixteen that processors have


def _add_tile(_: Any, left: Any, panel: Any, start: Any, out: Any, a: Any, b: Any) -> Any:
    """Compile `add_tile` by numba: its loop over i holds the sums as vectors."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        vector = ir.VectorType(ir.DoubleType(), COLUMNS)
        whole, zeros = args[4].type, ir.Constant(vector, [0.0] * COLUMNS)
        index = ir.IntType(32)
        first = ir.Constant(ir.VectorType(index, COLUMNS), [0] * COLUMNS)
        arrays: list[Any] = [
            kind is not types.none and context.make_array(kind)(context, builder, array)
            for kind, array in zip(signature.args[:4], args, strict=False)
        ]
        left, panel, start, out = arrays
        n = builder.extract_value(out.shape, 1)

        def entry(array: Any, row: Any, column: Any, width: Any = n) -> Any:
            return builder.gep(array.data, [builder.add(builder.mul(row, width), column)])

        def block(*place: Any) -> Any:
            return builder.bitcast(entry(*place), vector.as_pointer())

        rows = [builder.add(args[4], whole(r)) for r in range(ROWS)]
        begun = [
            builder.load(block(start, row, args[5]), align=8) if start else zeros for row in rows
        ]
        before, end = builder.block, builder.append_basic_block("end")
        loop = builder.append_basic_block("loop")
        builder.branch(loop)
        builder.position_at_end(loop)
        i, sums = builder.phi(whole), [builder.phi(vector) for _ in rows]
        right = builder.load(block(panel, i, whole(0), whole(COLUMNS)), align=8)
        after = builder.add(i, whole(1))
        i.add_incoming(whole(0), before)
        i.add_incoming(after, loop)
        totals = []
        for row, first_sum, total in zip(rows, begun, sums, strict=True):
            factors = builder.insert_element(zeros, builder.load(entry(left, row, i)), index(0))
            factors = builder.shuffle_vector(factors, zeros, first)
            totals.append(builder.fadd(total, builder.fmul(factors, right)))
            total.add_incoming(first_sum, before)
            total.add_incoming(totals[-1], loop)
        builder.cbranch(builder.icmp_signed("<", after, n), loop, end)
        builder.position_at_end(end)
        for row, total in zip(rows, totals, strict=True):
            builder.store(total, block(out, row, args[5]), align=8)
        return context.get_dummy_value()

    return types.void(left, panel, start, out, a, b), generate


add_tile: Any = intrinsic(_add_tile)

_settings: Any = numba.config
# States from which these are faster than plain loops (`benchmarks.large_models`), if compiled.
LARGE = 10**9 if _settings.DISABLE_JIT else 12


@kernel
def write_product(
    left: Array, right: Array, transposed: bool, start: Array | None, out: Array, lower: bool,
    panel: Array,
) -> None:  # fmt: skip
    """Write ``start`` plus L R, or L R', of square matrices of eight rows or more.

    ``panel``, shape (n, 8), is scratch, and ``start`` None for zeros. ``lower`` leaves out tiles
    above the diagonal. The last tiles overlap those before, where they write the same again.
    """
    # out = start + L R
    n = len(out)
    for b in range(0, n, COLUMNS):
        column = min(b, n - COLUMNS)
        for i in range(n):
            for j in range(COLUMNS):
                panel[i, j] = right[column + j, i] if transposed else right[i, column + j]
        for a in range(column - column % ROWS if lower else 0, n, ROWS):
            add_tile(left, panel, start, out, min(a, n - ROWS), column)


@kernel
def multiply_rows(left: Array, C: Array, out: Array) -> None:
    """Write L C', four rows at a time. The last ones overlap those before, as tiles do."""
    n = len(left)
    for o in range(len(C)):
        for place in range(0, n, 4):
            a = min(place, n - 4)
            s0 = s1 = s2 = s3 = 0.0
            for b in range(n):
                s0 += left[a, b] * C[o, b]
                s1 += left[a + 1, b] * C[o, b]
                s2 += left[a + 2, b] * C[o, b]
                s3 += left[a + 3, b] * C[o, b]
            out[a, o], out[a + 1, o], out[a + 2, o], out[a + 3, o] = s0, s1, s2, s3


@kernel
def mirror(matrix: Array) -> None:
    """Write what is below the diagonal above it, in blocks of four by four."""
    # M_ba = M_ab,   b < a
    n, fours = len(matrix), len(matrix) - len(matrix) % 4
    for a in range(0, fours, 4):
        for b in range(0, a, 4):
            for i in range(4):
                for j in range(4):
                    matrix[b + j, a + i] = matrix[a + i, b + j]
        for i in range(a, a + 4):
            for j in range(a, i):
                matrix[j, i] = matrix[i, j]
    for a in range(fours, n):
        for b in range(a):
            matrix[b, a] = matrix[a, b]
