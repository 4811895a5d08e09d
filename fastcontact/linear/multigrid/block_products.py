"""Products of small blocks with vectors and with each other, in the vectors of the processor.

The compiler makes single numbers of a loop over small blocks, which takes twice the time. Indices are not checked here.
"""

from __future__ import annotations

from typing import Any

import numba.extending
import numpy as np

from fastcontact._jit.decorators import compiled
from fastcontact.linear.multigrid import block_products_llvm


def row_times_one_by_one(
    indices: Any, numbers: tuple[Any, ...], x: Any, begin: int, end: int, rows: tuple[int, ...], cols: tuple[int, ...]
) -> tuple[Any, ...]:
    """Return what `row_times` does, in NumPy."""
    m, n = len(rows), len(cols)
    own = slice(begin * m * n, end * m * n)
    blocks = sum(part[own].astype(x.dtype) for part in numbers).reshape(-1, m, n)
    return tuple(np.einsum("kmn,kn->m", blocks, x.reshape(-1, n)[indices[begin:end]]))


def row_sizes_one_by_one(
    indices: Any, numbers: tuple[Any, ...], x: Any, begin: int, end: int, rows: tuple[int, ...], cols: tuple[int, ...]
) -> tuple[Any, ...]:
    """Return what `row_sizes` does, in NumPy."""
    positive = tuple(np.abs(part) for part in numbers)
    return row_times_one_by_one(indices, positive, np.abs(x), begin, end, rows, cols)


def add_product_one_by_one(
    to: Any, at: int, left: tuple[Any, ...], first: int, right: Any, second: int, rows: tuple[int, ...],
    inner: tuple[int, ...], cols: tuple[int, ...],
) -> None:  # fmt: skip
    """Do what `add_product` does, in NumPy."""
    m, k, n = len(rows), len(inner), len(cols)
    one = sum(part[first : first + m * k].astype(float) for part in left).reshape(m, k)
    to[at : at + m * n] += (one @ right[second : second + k * n].reshape(k, n).astype(float)).ravel()


def add_transposed_one_by_one(
    to: Any, at: int, left: tuple[Any, ...], first: int, right: Any, second: int, rows: tuple[int, ...],
    inner: tuple[int, ...], cols: tuple[int, ...],
) -> None:  # fmt: skip
    """Do what `add_transposed` does, in NumPy."""
    m, k, n = len(rows), len(inner), len(cols)
    one = sum(part[first : first + k * m].astype(float) for part in left).reshape(k, m)
    to[at : at + m * n] += (one.T @ right[second : second + k * n].reshape(k, n).astype(float)).ravel()


# Returns the sums (m,) over the blocks `begin` to `end` - 1 of a row of their products with x (n_columns * n,). Blocks m x n
# follow each other in `numbers`, whole or in halves (see `halves`); `indices` are their columns. The block size comes as the
# lengths of two tuples.
row_times = numba.extending.intrinsic(block_products_llvm.row_times) if compiled() else row_times_one_by_one
# Returns the sums of the absolute values of all products.
row_sizes = numba.extending.intrinsic(block_products_llvm.row_sizes) if compiled() else row_sizes_one_by_one
# Adds ``A B`` to the block m x n in double precision that begins at to[at]: A (m, k) begins at left[first], whole or in
# halves, B (k, n) at right[second]. The sizes m, k and n come as the lengths of tuples.
add_product = numba.extending.intrinsic(block_products_llvm.add_product) if compiled() else add_product_one_by_one
# The same with ``A.T B``, A (k, m).
add_transposed = (
    numba.extending.intrinsic(block_products_llvm.add_transposed) if compiled() else add_transposed_one_by_one
)
