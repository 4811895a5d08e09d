"""Direct solver of the coarsest level of a multigrid hierarchy.

It uses a dense Cholesky factor or, if aggregation stopped early so that the level is large, sparse factors by SuperLU.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import splu

from fastcontact.arrays import AnyArray
from fastcontact.linear.multigrid import cycle_kernels
from fastcontact.round_off import ROUND_OFF

# Number of unknowns up to which a level is not coarsened. Its factors are then dense.
COARSEST = 200


class Coarse:
    """Direct solver for a symmetric positive semidefinite matrix; unknowns without stiffness are set to zero.

    Parameters
    ----------
    A : csc_array (n, n)

    Attributes
    ----------
    matrix : csc_array (n, n)
        The matrix A without the change by `set`.
    """

    def __init__(self, A: csc_array) -> None:
        self.n, self.matrix = A.shape[0], A
        self._lu: Any = None
        self._factor: AnyArray = np.empty((0, 0))
        self._reciprocal, self._work = np.empty(self.n), np.empty(self.n)
        self._changed = True
        self.set(None)

    @property
    def nbytes(self) -> int:
        """Memory of the factors [bytes]."""
        return self._factor.nbytes if self._lu is None else 12 * int(self._lu.nnz)

    def set(self, change: csc_array | None) -> None:
        """Factorise the sum of the matrix and the symmetric matrix `change` (n, n); None means zero."""
        if change is None and not self._changed:
            return
        self._changed = change is not None
        A = self.matrix if change is None else csc_array(self.matrix + change)
        if self.n <= COARSEST:
            self._factor = A.toarray(order="C")
            cycle_kernels.factorise_dense(self._factor, self._reciprocal)
            return
        diagonal = A.diagonal()
        self._idle = np.flatnonzero(diagonal <= ROUND_OFF * diagonal.max())
        active = np.ones(self.n)
        active[self._idle] = 0.0
        K = diags_array(active) @ A @ diags_array(active) + diags_array(1.0 - active)
        self._lu = splu(csc_array(K), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})

    def solve(self, b: AnyArray, x: AnyArray) -> None:
        """Fill `x` (n,) with the solution for the right-hand side `b` (n,)."""
        if self._lu is None:
            cycle_kernels.solve_dense(self._factor, self._reciprocal, b, self._work, x)
            return
        x[:] = self._lu.solve(b.astype(float))
        x[self._idle] = 0.0
