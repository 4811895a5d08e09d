"""Products of small matrices by tiles of 4 x 4 numbers, with vector instructions.

The compiler does not vectorise loops over the few nodes of a cell. Here, each row of a tile is one vector, and the tile
remains in registers. The product ``A.T B`` of two matrices (24, 8) then takes 0.10 us instead of 0.50 us with scalar
instructions.
"""

from __future__ import annotations

from typing import Any

import numba.extending

from fastcontact._jit.decorators import jit_enabled


def tile_plain(
    left: Any, left_row: int, left_column: int, right: Any, right_row: int, column: int, n: int, out: Any, row: int,
    overwrite: bool,
) -> None:  # fmt: skip
    """Add a 4 x 4 tile of ``left.T @ right`` to the tile of `out` that begins at (row, column), or overwrite this tile.

    Parameters
    ----------
    left, right, out : ndarray (n_rows, n_columns)
        Arrays in C order. Indices are not checked.
    left_row, right_row : int
        First rows of the factors in `left` and in `right`.
    left_column, column : int
        First columns of the factors in `left` and in `right`.
    n : int
        Number of rows of both factors.
    row : int
        First row of the tile in `out`; its first column is `column`.
    overwrite : bool
        Whether the tile is overwritten.
    """
    factor = left[left_row : left_row + n, left_column : left_column + 4]
    product = factor.T @ right[right_row : right_row + n, column : column + 4]
    target = out[row : row + 4, column : column + 4]
    target[:] = product if overwrite else target + product


def tile_in_vectors(
    _context: Any, left: Any, left_row: Any, left_column: Any, right: Any, right_row: Any, column: Any, n: Any, out: Any,
    row: Any, overwrite: Any,
) -> Any:  # fmt: skip
    """Return the signature and the code generator of `tile_plain` for `numba.extending.intrinsic`."""
    from llvmlite import ir
    from numba.core import cgutils, types

    vector = ir.VectorType(ir.DoubleType(), 4)

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        def address(argument: int, row: Any, column: Any) -> Any:
            array = context.make_array(signature.args[argument])(context, builder, args[argument])
            width = builder.extract_value(array.shape, 1)
            start = builder.gep(array.data, [builder.add(builder.mul(row, width), column)])
            return builder.bitcast(start, vector.as_pointer())

        lane_zero, all_lanes = ir.Constant(ir.IntType(32), 0), ir.Constant(ir.VectorType(ir.IntType(32), 4), [0] * 4)
        row_of_left, row_of_right, sums = args[1], args[4], []
        for k in range(4):
            pointer = address(7, builder.add(args[8], args[8].type(k)), args[5])
            total, before = cgutils.alloca_once(builder, vector), builder.load(pointer, align=8)
            builder.store(builder.select(args[9], ir.Constant(vector, [0.0] * 4), before), total)
            sums.append((pointer, total))
        with cgutils.for_range(builder, args[6]) as loop:
            y = builder.bitcast(address(0, builder.add(row_of_left, loop.index), args[2]), ir.DoubleType().as_pointer())
            x = builder.load(address(3, builder.add(row_of_right, loop.index), args[5]), align=8)
            for k, (_, total) in enumerate(sums):
                number = builder.load(builder.gep(y, [ir.Constant(ir.IntType(64), k)]), align=8)
                lane = builder.insert_element(ir.Constant(vector, ir.Undefined), number, lane_zero)
                factor = builder.shuffle_vector(lane, ir.Constant(vector, ir.Undefined), all_lanes)
                builder.store(builder.fadd(builder.load(total), builder.fmul(factor, x)), total)
        for pointer, total in sums:
            builder.store(builder.load(total), pointer, align=8)
        return context.get_dummy_value()

    index = types.intp
    arguments = left, index, index, right, index, index, index, out, index, types.boolean
    return types.none(*arguments), code


tile = numba.extending.intrinsic(tile_in_vectors) if jit_enabled() else tile_plain
