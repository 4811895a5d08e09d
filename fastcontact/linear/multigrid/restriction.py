"""Restriction: products with the transpose of the prolongator."""

from __future__ import annotations

import numpy as np

from fastcontact._jit.parallel import spread
from fastcontact.arrays import AnyArray
from fastcontact.linear.multigrid import restriction_kernels
from fastcontact.linear.multigrid.matrix import PARTS, SHORTEST, WORK_OF_ROW, BlockMatrix


class Restriction:
    """The transpose of a prolongator P, which is not stored; each part of the rows of P has its own work space.

    Parameters
    ----------
    P : BlockMatrix
    """

    def __init__(self, P: BlockMatrix) -> None:
        self.P, n = P, len(P.indptr) - 1
        count = min(PARTS, max(1, n // SHORTEST))
        self._ends = np.linspace(0, n, count + 1).astype(np.int64)
        self._first, self._last = np.empty(count, np.int64), np.empty(count, np.int64)
        restriction_kernels.reach(P.indptr, P.indices, self._ends, self._first, self._last)
        widths = np.concatenate([[0], np.cumsum(self._last - self._first)])
        self._begin = widths[:-1]
        self._work = np.empty(int(widths[-1]) * len(P.cols), P.data.dtype)

    @property
    def nbytes(self) -> int:
        """Memory of the work space, without P [bytes]."""
        return self._work.nbytes

    def multiply(self, x: AnyArray, y: AnyArray) -> None:
        """Fill `y` with ``P.T x``."""
        P, parts = self.P, (self._first, self._last, self._begin)
        n_parts, n = len(self._begin), len(y) // len(P.cols)
        spread(
            restriction_kernels.add_parts, n_parts, WORK_OF_ROW * (len(P.indptr) - 1) // n_parts, P.indptr, P.indices, P.data,
            self._ends, *parts, x, self._work, P.rows, P.cols,
        )  # fmt: skip
        spread(restriction_kernels.gather, n, n_parts, *parts, self._work, y, P.cols)
