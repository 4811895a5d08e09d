"""Springs along rows of displacements, such as penalties: stored as rows, not as an assembled matrix."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse import csr_array, vstack

from fastcontact.arrays import AnyArray, Indices
from fastcontact.linear import springs_kernels
from fastcontact.linear.sparse_rows import scaled

# Relative difference below which springs count as equal.
ALIKE = 0.3


@dataclass(frozen=True, eq=False)
class Springs:
    """Springs with the forces ``-through.T (stiffness * (rows u))``.

    Attributes
    ----------
    rows : csr_array (q, n)
        Rows of the elongation of each spring [-].
    stiffness : ndarray (q,)
        Stiffness, not negative [force / length].
    through : csr_array (q, n), optional
        Rows along which the forces act [-]; `rows` by default. Springs of preconditioners have none.
    """

    rows: csr_array
    stiffness: AnyArray
    through: csr_array | None = None

    def subtract_forces(self, u: AnyArray, r: AnyArray, factor: float = 1.0) -> None:
        """Subtract from `r` (n,) `factor` times the product of their matrix with `u` (n,)."""
        R = self.rows
        if self.through is not None:
            r -= factor * (self.through.T @ (self.stiffness * (R @ u)))
            return
        springs_kernels.subtract(R.indptr, R.indices, R.data, self.stiffness, r.dtype.type(factor), u, r)

    def beside(self, others: Springs | None) -> Springs:
        """Return these springs and others."""
        if others is None:
            return self
        pair = (self, others)
        rows = csr_array(vstack([one.rows for one in pair], format="csr"))
        through = None
        if self.through is not None or others.through is not None:
            rows_of_forces = [one.rows if one.through is None else one.through for one in pair]
            through = csr_array(vstack(rows_of_forces, format="csr"))
        return Springs(rows, np.concatenate([one.stiffness for one in pair]), through)

    def under(self, pivots: Indices, weights: csr_array) -> Springs:
        """Return the springs for ``u[pivots] = weights u``, weights (m, n); rows are then zero at the pivots."""
        R, W, n = self.rows, weights, self.rows.shape[1]
        number = np.full(n, -1, np.int32)
        number[pivots] = np.arange(len(pivots))
        column = number[R.indices]
        follows = column >= 0
        starts = np.concatenate([[0], np.cumsum(follows)])[R.indptr]
        followed = csr_array((R.data[follows], column[follows], starts), shape=(R.shape[0], W.shape[0]))
        unchanged = csr_array((R.data[~follows], R.indices[~follows], R.indptr - starts), shape=R.shape)
        return Springs(csr_array(unchanged + followed @ W), self.stiffness)

    def scaled(self, factor: float, kind: DTypeLike = float) -> Springs:
        """Return springs with `factor` times the stiffness, in a given precision."""
        return Springs(self.rows.astype(kind), (factor * self.stiffness).astype(kind))

    def to_dict(self) -> dict[str, AnyArray]:
        """Return the springs as plain arrays."""
        R = self.rows
        return {"indptr": R.indptr, "indices": R.indices, "data": R.data, "stiffness": self.stiffness}

    @classmethod
    def from_dict(cls, arrays: Mapping[str, AnyArray], n: int) -> Springs:
        """Return the springs saved by `to_dict`, for n unknowns."""
        shape = (len(arrays["stiffness"]), n)
        return cls(csr_array((arrays["data"], arrays["indices"], arrays["indptr"]), shape=shape), arrays["stiffness"])

    def alike(self, other: Springs | None) -> bool:
        """Return whether `other` springs act on the same unknowns with nearly the same stiffness."""
        if other is None or self.rows.shape != other.rows.shape:
            return False
        scaled_self, scaled_other = (scaled(one.rows, np.sqrt(one.stiffness)) for one in (self, other))
        return bool(abs(scaled_self - scaled_other).sum() <= ALIKE * abs(scaled_other).sum())
