"""Block matrices of multigrid, and the one that is solved with: in double precision, or in two halves of single precision."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array

from fastcontact.linear.elimination import constrained_matrix_kernels
from fastcontact.linear.multigrid import cycle_kernels, galerkin_kernels, split_matrix_kernels

Array = NDArray[np.float64]
Values = NDArray[Any]
Indices = NDArray[np.int32]


@dataclass(eq=False)
class Matrix:
    """A block matrix, flat: see `kernels.multigrid`.

    With a `rest`, what `data` in single precision misses, it is exact: see `kernels.halves`.
    """

    indptr: Indices
    indices: Indices
    data: Values
    rows: tuple[int, ...]
    cols: tuple[int, ...]
    rest: Values | None = None

    @property
    def exact(self) -> tuple[Values, ...]:
        """The numbers as kernels take them that need them all."""
        return (self.data,) if self.rest is None else (self.data, self.rest)

    @property
    def nbytes(self) -> int:
        """Memory without the rest [bytes]."""
        return self.indptr.nbytes + self.indices.nbytes + self.data.nbytes

    def multiply(self, x: Values, y: Values) -> None:
        """Fill `y` with ``A x``."""
        self.combine(1.0, x, 0.0, y, y)

    def combine(self, factor: float, x: Values, share: float, z: Values, y: Values) -> None:
        """Fill `y` with ``share z + factor A x``, in the precision of x."""
        kind = x.dtype.type
        numbers = (self.data,) if x.dtype == self.data.dtype else self.exact
        cycle_kernels.multiply(
            self.indptr, self.indices, numbers, x, kind(factor), kind(share), z, y, self.rows, self.cols
        )  # fmt: skip


class Given:
    """The matrix K that is solved with: products in double precision, whatever the precision of the cycle.

    Parameters
    ----------
    K : bsr_array (n, n)
        Square blocks.
    precision : {"single", "double"}
        Numbers for a cycle in single precision are kept in halves.
    own : bool
        Whether the room of K's numbers may be taken; K is then no matrix any more, but this is: ``given @ u``.

    Attributes
    ----------
    scaled : Matrix
        ``unit K``. Numbers of any unit system fit single precision when the largest stiffness is about one.
    unit : float
        A power of two, which changes no digit.
    shape, blocksize : (int, int)
    """

    def __init__(self, K: bsr_array, precision: str, release: bool = False) -> None:
        self.shape, self.blocksize = K.shape, K.blocksize
        self._take(K, precision, release)

    def _take(self, K: bsr_array, precision: str, release: bool) -> None:
        indptr, indices, size = K.indptr, K.indices, (0,) * K.blocksize[0]
        if precision == "double":
            self.unit = 1.0
            self.scaled = Matrix(indptr, indices, K.data.reshape(-1), size, size)
            return
        self.unit = float(0.5 ** np.round(np.log2(K.diagonal().max())))
        first, second = _in_halves(K, self.unit, release)
        self.scaled = Matrix(indptr, indices, first, size, size, second)

    def change(self, precision: str) -> None:
        """Keep the numbers for a cycle in another precision."""
        self._take(self.restored(), precision, release=True)

    def restored(self) -> bsr_array:
        """Return K as it was given, but for round-off."""
        A, size = self.scaled, self.blocksize[0]
        data = np.empty(len(A.data))
        split_matrix_kernels.join(1.0 / self.unit, A.exact, data)
        return bsr_array((data.reshape(-1, size, size), A.indices, A.indptr), shape=self.shape)

    def combine(self, factor: float, x: Array, share: float, z: Array, y: Array) -> None:
        """Fill `y` with ``share z + factor K x``."""
        self.scaled.combine(factor / self.unit, x, share, z, y)

    def __matmul__(self, u: Array) -> Array:
        out = np.empty(len(u))
        self.combine(1.0, u, 0.0, out, out)
        return out

    def forces_at(self, dofs: NDArray[np.intp], u: Array, f: Array) -> Array:
        """Return ``(K u - f)[dofs]``."""
        A, out = self.scaled, np.empty(len(dofs))
        constrained_matrix_kernels.forces_at(
            dofs, A.indptr, A.indices, A.exact, 1.0 / self.unit, len(A.rows), u, f, out
        )
        return out

    def add_forces_of(self, dofs: NDArray[np.intp], values: Array, out: Array) -> None:
        """Add ``K[:, dofs] values`` to `out` (n,)."""
        A = self.scaled
        constrained_matrix_kernels.forces_of(
            dofs, values, A.indptr, A.indices, A.exact, 1.0 / self.unit, len(A.rows), out
        )

    def diagonal(self) -> Array:
        """Return the diagonal (n,)."""
        A, size = self.scaled, self.blocksize[0]
        parts = [galerkin_kernels.diagonal_blocks(A.indptr, A.indices, part, size).astype(float) for part in A.exact]
        blocks = np.sum(parts, axis=0).reshape(-1, size, size)
        return blocks[:, range(size), range(size)].ravel() / self.unit

    def largest_row_sum(self, u: Array) -> float:
        """Return the largest entry of ``|K| |u|``."""
        A, out = self.scaled, np.empty(len(u))
        cycle_kernels.row_sums(A.indptr, A.indices, (A.data,), u, A.rows, out)
        return float(out.max(initial=0.0)) / self.unit


def _in_halves(K: bsr_array, unit: float, release: bool) -> tuple[Values, Values]:
    """Return the halves of ``unit K``, the second one in the room of K's numbers where it may be."""
    numbers: Array = K.data.reshape(-1)
    n, first = len(numbers), np.empty(len(numbers), np.float32)
    owner = _owner(K.data)
    if not (release and owner.flags.owndata and owner.flags.c_contiguous and owner.nbytes == numbers.nbytes):
        second = np.empty(n, np.float32)
        split_matrix_kernels.split(unit, numbers, first, second)
        return first, second
    # K has no numbers now, so that nobody reads what is no number.
    K.indptr, K.indices, K.data = np.zeros_like(K.indptr), K.indices[:0], np.empty((0, *K.blocksize))
    split_matrix_kernels.split(unit, numbers, first, numbers.view(np.float32)[:n])
    del numbers
    with contextlib.suppress(ValueError):  # where somebody else holds it, all of it stays
        owner.resize(((n + 1) // 2,))
    return first, owner.reshape(-1).view(np.float32)[:n]


def _owner(array: Values) -> Values:
    """Return the array that has the memory of an array."""
    while isinstance(array.base, np.ndarray):
        array = array.base
    return array
