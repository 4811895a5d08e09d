"""Products of small blocks with vectors and with each other, implemented with vector instructions.

The compiler translates a plain loop over the nine entries of a 3 x 3 block into nine scalar multiplications, because it
cannot deduce that the positions given by an index array are contiguous. Here, a row of a block is processed by one vector
instruction. This reduces the time of a matrix-vector product from 16.7 to 8.5 ns per unknown (single precision, 311 469
unknowns, one thread). Plain compiled loops in place of the four functions increase the CPU time of an analysis from 2.5 to
3.1 s (sphere on a block, 28 833 unknowns, three steps). Plain loops in place of `add_product` and `add_transposed` alone
increase it from between 3.0 and 3.4 s to between 3.7 and 4.4 s (279 447 unknowns, one step).

`block_products_llvm` generates the instructions. The functions `..._plain` are their equivalents in NumPy. They are used if
kernels are not compiled, and in tests of the instructions. Indices are not checked.
"""

from __future__ import annotations

from typing import Any

import numba.extending
import numpy as np

from fastcontact._jit.decorators import jit_enabled
from fastcontact.linear.multigrid import block_products_llvm

Sizes = tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...]]


def row_times_plain(
    indices: Any, entries: tuple[Any, ...], x: Any, begin: int, end: int, rows: tuple[int, ...], cols: tuple[int, ...]
) -> tuple[Any, ...]:
    """Return the product of one block row of a matrix with a vector, as a tuple of m numbers.

    Parameters
    ----------
    indices : ndarray of int (n_blocks,)
        Block columns.
    entries : tuple of ndarray (n_blocks * m * n,)
        The entries of the blocks, one block after the other. They may be split, see `symmetric_storage_kernels`.
    x : ndarray (n_columns * n,)
    begin, end : int
        The blocks of the row are those from `begin` to ``end - 1``.
    rows, cols : tuple
        Tuples of m and n zeros, from whose types the compiler knows the size of a block.
    """
    m, n = len(rows), len(cols)
    positions = slice(begin * m * n, end * m * n)
    blocks = sum(array[positions].astype(x.dtype) for array in entries).reshape(-1, m, n)
    return tuple(np.einsum("kmn,kn->m", blocks, x.reshape(-1, n)[indices[begin:end]]))


def row_times_both_ways_plain(
    indices: Any, entries: tuple[Any, ...], x: Any, begin: int, end: int, row: int, factor: Any, y: Any,
    rows: tuple[int, ...],
) -> tuple[Any, ...]:  # fmt: skip
    """Return the product of the blocks of a row with x, and add the products of the transposed blocks with x to y.

    The first product uses the entries of x in the block columns, the others use those in the block row.

    Parameters
    ----------
    indices, entries, x, begin, end
        As in `row_times_plain`. The blocks are square, and no two of them are in the same column.
    row : int
        Number of the block row.
    factor : float
        Factor of the products that are added to y.
    y : ndarray (n_columns * m,)
        Changed in place at the columns of the blocks. It must not share memory with x.
    rows : tuple
        Tuple of m zeros.
    """
    m, columns = len(rows), indices[begin:end]
    blocks = sum(array[begin * m * m : end * m * m].astype(x.dtype) for array in entries).reshape(-1, m, m)
    y.reshape(-1, m)[columns] += np.einsum("kmn,m->kn", blocks, factor * x[row * m : (row + 1) * m])
    return tuple(np.einsum("kmn,kn->m", blocks, x.reshape(-1, m)[columns]))


def add_product_plain(
    out: Any, start: int, left: tuple[Any, ...], left_start: int, right: Any, right_start: int, sizes: Sizes
) -> None:
    """Add ``A B`` to the block (m, n), in double precision, that begins at ``out[start]``.

    Parameters
    ----------
    out : ndarray, start : int
        Array that is changed in place, beginning at the position `start`.
    left : tuple of ndarray, left_start : int
        Entries of A (m, k), which may be split, and the position of the first one.
    right : ndarray, right_start : int
        Entries of B (k, n), and the position of the first one.
    sizes : tuple of tuples
        Tuples of m, k and n zeros.
    """
    m, k, n = (len(size) for size in sizes)
    A = sum(array[left_start : left_start + m * k].astype(float) for array in left).reshape(m, k)
    out[start : start + m * n] += (A @ right[right_start : right_start + k * n].reshape(k, n).astype(float)).ravel()


def add_transposed_plain(
    out: Any, start: int, left: tuple[Any, ...], left_start: int, right: Any, right_start: int, sizes: Sizes
) -> None:
    """Add ``A.T B`` with A (k, m); see `add_product_plain`."""
    m, k, n = (len(size) for size in sizes)
    A = sum(array[left_start : left_start + k * m].astype(float) for array in left).reshape(k, m)
    out[start : start + m * n] += (A.T @ right[right_start : right_start + k * n].reshape(k, n).astype(float)).ravel()


def _intrinsic_or_plain(vectorised: Any, plain: Any) -> Any:
    """Return the function that kernels call: an intrinsic that generates `vectorised`, or `plain` without compilation."""
    return numba.extending.intrinsic(vectorised) if jit_enabled() else plain


row_times = _intrinsic_or_plain(block_products_llvm.row_times, row_times_plain)
row_times_both_ways = _intrinsic_or_plain(block_products_llvm.row_times_both_ways, row_times_both_ways_plain)
add_product = _intrinsic_or_plain(block_products_llvm.add_product, add_product_plain)
add_transposed = _intrinsic_or_plain(block_products_llvm.add_transposed, add_transposed_plain)
