"""Block matrices of multigrid, and the stiffness matrix K, which is stored once for two precisions.

The multigrid cycle uses K in single precision, and the outer iteration uses it in double precision. Each number of K is
therefore stored as the sum of two numbers in single precision, a high and a low part. The cycle reads the high part only.
This takes 8 bytes per number instead of 12. Since K is symmetric, most of its blocks are stored only once for both triangles
(see `symmetric_storage_kernels`).
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass

import numpy as np
from scipy.sparse import bsr_array, csr_array

from fastcontact._jit.parallel import parallel_for
from fastcontact.arrays import AnyArray, Array, Indices, Numbers
from fastcontact.linear.multigrid import cycle_kernels, symmetric_storage_kernels

# The arrays `start`, `upper` and `columns`, and the `length` of the strips, see `symmetric_storage_kernels`.
Storage = tuple[Numbers, Numbers, Numbers, int]
# Storage in which every block of the pattern is stored.
ALL_BLOCKS: Storage = (np.empty(0, np.int32), np.empty(0, np.int32), np.empty(0, np.int32), 0)
# Largest number of strips into which the rows of a symmetric matrix are divided, and smallest number of rows of a strip. This
# number of strips suffices for many threads, and the results of a strip remain in the cache. With more strips, more blocks
# would be stored twice.
MAX_STRIPS, MIN_ROWS = 32, 1024


@dataclass(eq=False)
class BlockMatrix:
    """Sparse matrix of dense blocks of equal size, stored by block rows.

    Attributes
    ----------
    indptr : ndarray (n_rows + 1,)
        Offsets of the block rows.
    indices : ndarray (n_blocks,)
        Block column of each block.
    data : ndarray (n_blocks * len(rows) * len(cols),)
        The blocks, one after the other, in single or double precision.
    rows, cols : tuple of zeros
        Tuples whose lengths are the block size. The length of a tuple is known when a kernel is compiled.
    low : ndarray, optional
        Low parts of the numbers of a split matrix, in single precision; `data` then contains the high parts.
    storage : tuple
        Which blocks of the pattern `indptr`, `indices` are stored, and in which order; by default all of them. Of a symmetric
        matrix, most blocks are stored only once, see `symmetric_storage_kernels`.
    """

    indptr: Numbers
    indices: Numbers
    data: AnyArray
    rows: tuple[int, ...]
    cols: tuple[int, ...]
    low: AnyArray | None = None
    storage: Storage = ALL_BLOCKS

    @property
    def exact_data(self) -> tuple[AnyArray, ...]:
        """Arrays of the entries in full precision, as arguments of kernels: (data,), or (high, low) for a split matrix."""
        return (self.data,) if self.low is None else (self.data, self.low)

    @property
    def nbytes(self) -> int:
        """Memory of the matrix, without its low part [bytes]."""
        return sum(part.nbytes for part in (self.indptr, self.indices, self.data, *self.storage[:3]))

    def multiply(self, x: AnyArray, y: AnyArray) -> None:
        """Fill `y` with ``A @ x``."""
        self.combine(1.0, x, 0.0, y, y)

    def combine(self, factor: float, x: AnyArray, z_factor: float, z: AnyArray, y: AnyArray) -> None:
        """Fill `y` with ``z_factor * z + factor * A @ x``, in the precision of x; x and y must be different arrays."""
        real = x.dtype.type
        entries = (self.data,) if x.dtype == self.data.dtype else self.exact_data
        if self.storage is not ALL_BLOCKS:
            strip, n = self.storage[3], len(self.indptr) - 1  # numbers of rows
            parallel_for(
                symmetric_storage_kernels.multiply, -(-n // strip), self.work_of_row * strip, self.storage, entries, x,
                real(factor), real(z_factor), z, y, self.rows,
            )  # fmt: skip
            return
        parallel_for(
            cycle_kernels.multiply, len(self.indptr) - 1, self.work_of_row, self.indptr, self.indices, entries, x,
            real(factor), real(z_factor), z, y, self.rows, self.cols,
        )  # fmt: skip

    @property
    def work_of_row(self) -> float:
        """Average number of blocks of a row, its work in the sense of `_jit.parallel.portions`."""
        return len(self.indices) / max(1, len(self.indptr) - 1)

    def diagonal_blocks(self) -> Array:
        """Return the diagonal blocks (n_rows, size, size) of a square matrix, in double precision."""
        size = len(self.rows)
        blocks = [self.diagonal_part(part).astype(float, copy=False) for part in self.exact_data]
        return np.asarray(sum(blocks[1:], blocks[0])).reshape(-1, size, size)

    def diagonal_part(self, data: AnyArray) -> AnyArray:
        """Return the diagonal blocks (n_rows * size * size,) of a square matrix, from the high or the low part."""
        size = len(self.rows)
        if self.storage is ALL_BLOCKS:
            return diagonal_blocks(self.indptr, self.indices, data, size)
        return data.reshape(-1, size * size)[self.storage[1] - 1].ravel()

    def absolute_product(self, u: Array) -> Array:
        """Return ``abs(A) @ abs(u)`` (n,) for a square matrix, computed with its high part."""
        out = np.empty(len(u))
        parallel_for(
            symmetric_storage_kernels.absolute_product, len(self.indptr) - 1, self.work_of_row, self.indptr, self.indices,
            self.storage, (self.data,), u, len(self.rows), out,
        )  # fmt: skip
        return out

    def rows_of(self, dofs: Indices) -> csr_array:
        """Return the rows `dofs` (m,) of a symmetric matrix, in double precision."""
        size, node = len(self.rows), dofs // len(self.rows)
        count = np.diff(self.indptr)[node]
        starts = np.concatenate([[0], np.cumsum(count)])
        blocks = np.repeat(self.indptr[node] - starts[:-1], count) + np.arange(starts[-1])
        columns, data = self.indices[blocks][:, None] * size + np.arange(size), np.empty(starts[-1] * size)
        symmetric_storage_kernels.rows_of(dofs, self.indptr, self.indices, self.storage, self.exact_data, size, data)
        rows = csr_array((data, columns.ravel(), size * starts), shape=(len(dofs), (len(self.indptr) - 1) * size))
        rows.eliminate_zeros()
        return rows

    def to_scipy(self) -> bsr_array:
        """Return a square matrix as a SciPy array, in double precision."""
        size, n = len(self.rows), len(self.indptr) - 1
        data = np.empty(len(self.indices) * size * size)
        arrays = self.indptr, self.indices, self.storage, self.exact_data
        parallel_for(symmetric_storage_kernels.expand, n, self.work_of_row, *arrays, size, data)
        return bsr_array((data.reshape(-1, size, size), self.indices, self.indptr), shape=2 * (n * size,))


def diagonal_blocks(indptr: Numbers, indices: Numbers, data: AnyArray, size: int) -> AnyArray:
    """Return the diagonal blocks (n * size * size,) of a square matrix in canonical format, zero where there is none."""
    row = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
    diagonal, out = np.flatnonzero(row == indices), np.zeros((len(indptr) - 1, size * size), data.dtype)
    out[row[diagonal]] = data.reshape(-1, size * size)[diagonal]
    return out.ravel()


def block_matrix(K: bsr_array) -> BlockMatrix:
    """Return a matrix of square blocks that shares the arrays of K."""
    size = (0,) * K.blocksize[0]
    return BlockMatrix(K.indptr, K.indices, K.data.reshape(-1), size, size)


class ScaledMatrix:
    """The stiffness matrix K, stored after multiplication by a power of two. Products with K are in double precision.

    Parameters
    ----------
    K : bsr_array (n, n)
        Square blocks [force / length].
    precision : {"single", "double"}
        Precision of the multigrid cycle. For "single", numbers are split into a high and a low part.
    release : bool
        Whether the low parts may overwrite the numbers of K, which is empty afterwards. K and the two parts are then never in
        memory at the same time, which reduces the peak memory with a million unknowns by a tenth.
    source : ScaledMatrix, optional
        Matrix whose `scale` is reused, and also the storage scheme if the pattern is the same. By default, the scale is
        chosen such that the largest stiffness is about one.

    Attributes
    ----------
    scaled : BlockMatrix
        ``scale K``. Since the largest stiffness is about one, the numbers are within the range of single precision in any
        system of units.
    scale : float
        A power of two, so that the multiplication is exact.
    shape, blocksize : (int, int)
    """

    def __init__(self, K: bsr_array, precision: str, release: bool = False, source: ScaledMatrix | None = None) -> None:
        self.shape, self.blocksize = K.shape, K.blocksize
        self._store(K, precision, release, source)

    def _store(self, K: bsr_array, precision: str, release: bool, source: ScaledMatrix | None = None) -> None:
        self.scale = 1.0
        if precision == "double":
            self.scaled = block_matrix(K)
            return
        if source is None:
            diagonal = range(K.blocksize[0])
            largest = block_matrix(K).diagonal_blocks()[:, diagonal, diagonal].max()
            self.scale = float(0.5 ** np.round(np.log2(largest)))
        else:
            self.scale = source.scale
        self.scaled = _split_matrix(K, self.scale, release, None if source is None else source.scaled)

    def convert(self, precision: str) -> None:
        """Store the numbers for a cycle in another precision."""
        self._store(self.restored(), precision, release=True)

    def restored(self) -> bsr_array:
        """Return K, up to round-off."""
        K = self.scaled.to_scipy()
        K.data /= self.scale
        return K

    def combine(self, factor: float, x: Array, z_factor: float, z: Array, y: Array) -> None:
        """Fill `y` (n,) with ``z_factor * z + factor * K @ x``."""
        self.scaled.combine(factor / self.scale, x, z_factor, z, y)

    def __matmul__(self, u: Array) -> Array:
        out = np.empty(len(u))
        self.combine(1.0, u, 0.0, out, out)
        return out

    def forces_of(self, dofs: Indices, u: Array) -> Array:
        """Return the forces (n,) of displacements u (m,) of the unknowns `dofs` (m,), the others being zero [force]."""
        return np.asarray(u @ self.scaled.rows_of(dofs) / self.scale)

    def forces_at(self, dofs: Indices, u: Array, f: Array) -> Array:
        """Return ``(K @ u - f)[dofs]`` (m,) [force]."""
        return np.asarray(self.scaled.rows_of(dofs) @ u / self.scale - f[dofs])

    def diagonal(self) -> Array:
        """Return the diagonal (n,) of K [force / length]."""
        diagonal = range(self.blocksize[0])
        return self.scaled.diagonal_blocks()[:, diagonal, diagonal].ravel() / self.scale

    def absolute_product(self, u: Array) -> Array:
        """Return ``abs(K) @ abs(u)`` (n,) [force]."""
        return self.scaled.absolute_product(u) / self.scale


def _split_matrix(K: bsr_array, scale: float, release: bool, source: BlockMatrix | None) -> BlockMatrix:
    """Return ``scale K``, split into high and low parts; see `ScaledMatrix` for `release`.

    The storage scheme of the matrix `source` is used if it has the same pattern.
    """
    indptr, indices = (array.astype(np.int32, copy=False) for array in (K.indptr, K.indices))
    size, entries = K.blocksize[0], K.data if K.data.base is None else K.data.base
    if release and entries.size == K.data.size and entries.flags.owndata and entries.flags.c_contiguous:
        # Every number is read before it is overwritten. The numbers of K are invalid afterwards, and are therefore removed.
        K.indptr, K.indices, K.data = np.zeros_like(indptr), indices[:0], np.empty((0, *K.blocksize))
    else:
        entries = K.data.copy()
    storage = ALL_BLOCKS if source is None else source.storage
    if source is None or not (np.array_equal(indptr, source.indptr) and np.array_equal(indices, source.indices)):
        storage = symmetric_storage(indptr, indices)
    n = entries.size if storage is ALL_BLOCKS else len(storage[2]) * size * size
    high = np.empty(n, np.float32)
    _store_parts(indptr, indices, storage, scale, entries.reshape(-1), size * size, high)
    with contextlib.suppress(ValueError):  # another array references the memory, which then stays allocated
        entries.resize(((n + 1) // 2,))
    low = entries.reshape(-1).view(np.float32)[:n]
    return BlockMatrix(indptr, indices, high, (0,) * size, (0,) * size, low, storage)


def _store_parts(
    indptr: Numbers, indices: Numbers, storage: Storage, scale: float, entries: AnyArray, size: int, high: AnyArray
) -> None:
    """Fill `high` with the high parts of the stored blocks, of `size` numbers each, times `scale`.

    `entries` contains the entries of all blocks; the low parts overwrite the beginning of this array.
    """
    start, low = indptr if storage is ALL_BLOCKS else storage[0], entries.view(np.float32)
    end, n, max_blocks = 0, len(indptr) - 1, int(np.diff(indptr).max(initial=0))
    while end < n:  # Up to row `safe_end`, low parts overwrite only numbers that have been read.
        first = end
        safe_end = int(np.searchsorted(start, 2 * int(indptr[first]), side="right")) - 1
        end = max(min(n, safe_end), min(n, first + MIN_ROWS))
        work = len(indices) / n if end == safe_end else 0
        parallel_for(
            symmetric_storage_kernels.store_rows, end - first, work, first, max_blocks, indptr, indices, storage, scale,
            entries, size, high, low,
        )  # fmt: skip


def symmetric_storage(indptr: Numbers, indices: Numbers) -> Storage:
    """Return the storage scheme of a symmetric matrix with a given pattern.

    It is `ALL_BLOCKS` if the pattern is not sorted, lacks a diagonal block, or is not symmetric within the strips.
    """
    n = len(indptr) - 1
    length = max(MIN_ROWS, -(-n // MAX_STRIPS))
    row = np.repeat(np.arange(n, dtype=np.int32), np.diff(indptr))
    same_strip = row // length == indices // length
    below, above, diagonal = same_strip & (indices < row), same_strip & (indices > row), indices == row
    ascending = (indices[1:] > indices[:-1]) | (row[1:] > row[:-1])
    transposed = np.sort(indices[below].astype(np.int64) * n + row[below])
    symmetric = np.array_equal(transposed, row[above].astype(np.int64) * n + indices[above])
    if not (symmetric and ascending.all() and diagonal.sum() == n):
        return ALL_BLOCKS
    stored = ~below
    rows, rank = row[stored], (diagonal + np.int32(2) * above)[stored]  # rank: order of the groups in a row
    columns = indices[stored][np.argsort(np.int64(3) * rows + rank, kind="stable")]
    start = pointers(np.bincount(rows, minlength=n).astype(np.int32))
    upper = start[1:] - np.bincount(row[above], minlength=n).astype(np.int32)
    return start, upper, columns, length


def pointers(count: Numbers | Indices) -> Numbers:
    """Return the row pointers (n + 1,) of rows with `count` (n,) entries."""
    return np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
