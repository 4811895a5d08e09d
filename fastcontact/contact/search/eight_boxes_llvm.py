"""What Numba is told to write for `eight_boxes`: each function here runs while a kernel is compiled, none in it."""

from __future__ import annotations

from typing import Any

import numpy as np

WIDTH = 8


def squares(_context: Any, boxes: Any, node: Any, point: Any, away: Any, begin: Any) -> Any:
    """Return the types of `eight_boxes.squares`, and what writes it."""
    from numba.core import types

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        dim, start = len(signature.args[2]), _start(context, builder, signature, args, 0)
        first = builder.mul(args[1], args[1].type(2 * dim * WIDTH))

        def side(k: int) -> Any:
            return builder.load(_eight(builder, start, builder.add(first, first.type(k * WIDTH))), align=8)

        total = None
        for d in range(dim):
            here = _everywhere(builder, builder.extract_value(args[2], d))
            out = _chosen(builder, ">", builder.fsub(side(d), here), builder.fsub(here, side(dim + d)))
            out = _chosen(builder, ">", out, out.type([0.0] * WIDTH))
            square = builder.fmul(out, out, flags=("contract",))
            total = square if total is None else builder.fadd(total, square, flags=("contract",))
        builder.store(total, _eight(builder, _start(context, builder, signature, args, 3), args[4]), align=8)
        return _least(builder, total)

    return types.float64(boxes, types.intp, point, away, types.intp), code


def within(_context: Any, away: Any, begin: Any, reach: Any) -> Any:
    """Return the types of `eight_boxes.within`, and what writes it."""
    from numba.core import types

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        from llvmlite import ir

        squares = builder.load(_eight(builder, _start(context, builder, signature, args, 0), args[1]), align=8)
        bits = builder.bitcast(builder.fcmp_ordered("<=", squares, _everywhere(builder, args[2])), ir.IntType(WIDTH))
        return builder.zext(bits, ir.IntType(64))

    return types.int64(away, types.intp, types.float64), code


def without(_context: Any, away: Any, begin: Any, k: Any) -> Any:
    """Return the types of `eight_boxes.without`, and what writes it."""
    from numba.core import types

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        from llvmlite import ir

        where = _eight(builder, _start(context, builder, signature, args, 0), args[1])
        squares, lane = builder.load(where, align=8), ir.IntType(32)
        here = _everywhere(builder, builder.trunc(args[2], lane))
        here = builder.icmp_unsigned("==", here, here.type(list(range(WIDTH))))
        squares = builder.select(here, squares.type([np.inf] * WIDTH), squares)
        builder.store(squares, where, align=8)
        return _least(builder, squares)

    return types.float64(away, types.intp, types.intp), code


def emptied(_context: Any, boxes: Any, node: Any, point: Any) -> Any:
    """Return the types of `eight_boxes.emptied`, and what writes it."""
    from numba.core import types

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        from llvmlite import ir

        dim, start = len(signature.args[2]), _start(context, builder, signature, args, 0)
        first, vector = builder.mul(args[1], args[1].type(2 * dim * WIDTH)), ir.VectorType(ir.DoubleType(), WIDTH)
        for d in range(2 * dim):
            nowhere = vector([np.inf if d < dim else -np.inf] * WIDTH)
            builder.store(nowhere, _eight(builder, start, builder.add(first, first.type(d * WIDTH))), align=8)
        return context.get_dummy_value()

    return types.none(boxes, types.intp, point), code


def copied(_context: Any, boxes: Any, node: Any, k: Any, others: Any, other: Any, at: Any, point: Any) -> Any:
    """Return the types of `eight_boxes.copied`, and what writes it."""
    from numba.core import types

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        sides, number = 2 * len(signature.args[6]), args[1].type

        def side(array: int, d: int) -> Any:
            first = builder.mul(args[array + 1], number(sides * WIDTH))
            index = builder.add(builder.add(first, args[array + 2]), number(d * WIDTH))
            return builder.gep(_start(context, builder, signature, args, array), [index])

        for d in range(sides):
            builder.store(builder.load(side(0, d)), side(3, d))
        return context.get_dummy_value()

    return types.none(boxes, types.intp, types.intp, others, types.intp, types.intp, point), code


def lowest(_context: Any, bits: Any) -> Any:
    """Return the types of `eight_boxes.lowest`, and what writes it."""
    from numba.core import types

    def code(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        from llvmlite import ir

        return builder.cttz(args[0], ir.IntType(1)(0))

    return types.int64(types.int64), code


def _start(context: Any, builder: Any, signature: Any, args: Any, k: int) -> Any:
    """Return the address of the first element of the array that argument `k` is."""
    from numba.np.arrayobj import make_array

    return make_array(signature.args[k])(context, builder, args[k]).data


def _eight(builder: Any, start: Any, offset: Any) -> Any:
    """Return the address of eight numbers that begin with number `offset`."""
    from llvmlite import ir

    return builder.bitcast(builder.gep(start, [offset]), ir.VectorType(ir.DoubleType(), WIDTH).as_pointer())


def _everywhere(builder: Any, number: Any) -> Any:
    """Return a vector with the same number eight times."""
    from llvmlite import ir

    vector, index = ir.VectorType(number.type, WIDTH), ir.IntType(32)
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), number, index(0))
    return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(index, WIDTH), [0] * WIDTH))


def _chosen(builder: Any, sign: str, one: Any, other: Any) -> Any:
    """Return the numbers of one vector where it is larger or smaller than the other's, else the other's."""
    return builder.select(builder.fcmp_ordered(sign, one, other), one, other)


def _least(builder: Any, numbers: Any) -> Any:
    """Return the least number of a vector: that of its halves, and so on."""
    from llvmlite import ir

    index = ir.IntType(32)
    for half in (4, 2, 1):
        lanes = ir.VectorType(index, half)
        low, high = ir.Constant(lanes, list(range(half))), ir.Constant(lanes, list(range(half, 2 * half)))
        numbers = _chosen(
            builder,
            "<",
            builder.shuffle_vector(numbers, numbers, low),
            builder.shuffle_vector(numbers, numbers, high),
        )
    return builder.extract_element(numbers, index(0))
