"""What Numba is told to write for `block_rows`: each function here runs while a kernel is compiled, none in it."""

from __future__ import annotations

from typing import Any, NamedTuple

# Numbers in a vector: four in double precision are what most processors have, and blocks have three or six columns.
WIDTH = 4


class Piece(NamedTuple):
    """A part of a row of a block: `used` numbers from column `column` on, taken with those beside in vectors of `width`."""

    column: int
    width: int
    used: int


def product(_context: Any, indices: Any, numbers: Any, x: Any, begin: Any, end: Any, rows: Any, cols: Any) -> Any:
    """Return the types of `block_rows.product`, and what writes it."""
    from numba.core import types

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        from numba.core import cgutils

        write = _Writer(context, builder, signature, args)
        step = args[3].type(1)
        with cgutils.for_range_slice(builder, args[3], args[4], step, args[3].type, inc=True) as (k, _):
            write.block(k)
        return context.make_tuple(builder, signature.return_type, write.sums())

    sums = types.UniTuple(x.dtype, len(rows))
    return sums(indices, numbers, x, types.intp, types.intp, rows, cols), code


class _Writer:
    """Writes the loop over the blocks of a row; a sum for every row and lane of a vector.

    With three columns a vector has one number too many. In the last row of a block it is the one before the row, in others
    the one behind, so that nothing is read beside the block.
    """

    def __init__(self, context: Any, builder: Any, signature: Any, args: Any) -> None:
        from llvmlite import ir
        from numba.core import cgutils
        from numba.np.arrayobj import make_array

        self.builder, self.offset = builder, args[3].type
        self.m, self.n = len(signature.args[5]), len(signature.args[6])
        self.indices = make_array(signature.args[0])(context, builder, args[0]).data
        self.numbers = [
            make_array(kind)(context, builder, builder.extract_value(args[1], k)).data
            for k, kind in enumerate(signature.args[1])
        ]
        self.x = make_array(signature.args[2])(context, builder, args[2]).data
        self.real, self.lane = self.x.type.pointee, ir.IntType(32)
        self.shifted = self.n == 3 and self.m > 1
        self.pieces = [Piece(0, WIDTH, 3)] if self.shifted else _pieces(self.n)
        self.totals = [
            [cgutils.alloca_once_value(builder, self._zeros(piece.width)) for piece in self.pieces]
            for _ in range(self.m)
        ]

    def block(self, k: Any) -> None:
        """Add the product of block `k` with what it meets of x."""
        builder, m, n = self.builder, self.m, self.n
        j = builder.mul(builder.sext(builder.load(builder.gep(self.indices, [k])), self.offset), self.offset(n))
        at = builder.mul(k, self.offset(m * n))
        meets = self._three(j) if self.shifted else [self._load(self.x, j, piece) for piece in self.pieces]
        behind = self._shuffled(meets[0], [0, 0, 1, 2]) if self.shifted else None
        for r in range(m):
            last = behind is not None and r == m - 1
            for piece, total, x in zip(self.pieces, self.totals[r], [behind] if last else meets, strict=True):
                number = self._number(builder.add(at, self.offset(r * n - last)), piece)
                change = builder.fmul(number, x, flags=("contract",))
                builder.store(builder.fadd(builder.load(total), change, flags=("contract",)), total)

    def sums(self) -> list[Any]:
        """Return the sum of every row."""
        found = []
        for r, totals in enumerate(self.totals):
            first = int(self.shifted and r == self.m - 1)
            lanes = [
                self._lane(self.builder.load(total), piece, first + c)
                for piece, total in zip(self.pieces, totals, strict=True)
                for c in range(piece.used)
            ]
            total = lanes[0]
            for lane in lanes[1:]:
                total = self.builder.fadd(total, lane)
            found.append(total)
        return found

    def _number(self, at: Any, piece: Piece) -> Any:
        """Return numbers of a row that begins at `at`, in the precision of x, the halves of each added."""
        parts = [self._load(start, at, piece) for start in self.numbers]
        if len(parts) == 1:
            return parts[0]
        return self.builder.fadd(*(self.builder.fpext(part, self._type(self.real, piece.width)) for part in parts))

    def _load(self, start: Any, at: Any, piece: Piece) -> Any:
        """Return what is in an array from a piece's column on, counted from `at`."""
        from llvmlite import ir

        builder, number = self.builder, start.type.pointee
        where = builder.gep(start, [builder.add(at, self.offset(piece.column))])
        where = builder.bitcast(where, self._type(number, piece.width).as_pointer())
        return builder.load(where, align=4 if number == ir.FloatType() else 8)

    def _three(self, j: Any) -> list[Any]:
        """Return three numbers of x and any fourth, without a look beyond them."""
        pair = self._shuffled(self._load(self.x, j, Piece(0, 2, 2)), [0, 1, 0, 1])
        return [self.builder.insert_element(pair, self._load(self.x, j, Piece(2, 1, 1)), self.lane(2))]

    def _shuffled(self, vector: Any, lanes: list[int]) -> Any:
        from llvmlite import ir

        order = ir.Constant(ir.VectorType(self.lane, len(lanes)), lanes)
        return self.builder.shuffle_vector(vector, vector, order)

    def _lane(self, vector: Any, piece: Piece, lane: int) -> Any:
        return vector if piece.width == 1 else self.builder.extract_element(vector, self.lane(lane))

    def _type(self, number: Any, width: int) -> Any:
        from llvmlite import ir

        return number if width == 1 else ir.VectorType(number, width)

    def _zeros(self, width: int) -> Any:
        from llvmlite import ir

        return ir.Constant(self._type(self.real, width), 0.0 if width == 1 else [0.0] * width)


def _pieces(n: int) -> list[Piece]:
    """Return the pieces of n columns: as many whole vectors as there are, half a one, a single number."""
    found, column = [], 0
    for width in (WIDTH, WIDTH // 2, 1):
        while n - column >= width:
            found.append(Piece(column, width, width))
            column += width
    return found
