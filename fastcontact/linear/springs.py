"""Springs between unknowns, such as penalties, which are stored by rows instead of as an assembled matrix."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse import csr_array, vstack

from fastcontact.arrays import AnyArray, Indices
from fastcontact.linear.sparse_rows import scaled

# Relative difference below which two sets of springs, or of weights of eliminated unknowns, are equally good in a
# preconditioner.
ALIKE = 0.3


@dataclass(frozen=True, eq=False)
class Springs:
    """Springs with the forces ``-through.T @ (stiffness * (rows @ u))`` on n unknowns u.

    Attributes
    ----------
    rows : csr_array (q, n)
        Derivatives of the elongations of q springs with respect to the unknowns [-].
    stiffness : ndarray (q,)
        Stiffness of each spring, not negative [force / length].
    through : csr_array (q, n), optional
        Matrix whose transpose maps the forces of the springs to the unknowns; `rows` by default [-].
    """

    rows: csr_array
    stiffness: AnyArray
    through: csr_array | None = None

    def subtract_forces(self, u: AnyArray, r: AnyArray, factor: float = 1.0) -> None:
        """Subtract `factor` times the product of the stiffness matrix of the springs and `u` (n,) from `r` (n,), in place."""
        R = self.rows
        if self.through is not None:
            r -= factor * (self.through.T @ (self.stiffness * (R @ u)))
            return
        row = np.repeat(np.arange(len(self.stiffness)), np.diff(R.indptr))
        force = factor * self.stiffness * np.bincount(row, R.data * u[R.indices], len(self.stiffness))
        # With another precision than that of r, `subtract.at` takes twenty times as long.
        np.subtract.at(r, R.indices, (R.data * force[row]).astype(r.dtype, copy=False))

    def beside(self, others: Springs | None) -> Springs:
        """Return these springs together with `others`."""
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
        """Return the springs after the elimination ``u[pivots] = weights @ u`` with weights (m, n).

        Their rows are zero in the columns of the pivots.
        """
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
        """Return the springs with the stiffness multiplied by `factor`, in the data type `kind`."""
        return Springs(self.rows.astype(kind), (factor * self.stiffness).astype(kind))

    def to_dict(self) -> dict[str, AnyArray]:
        """Return the rows and the stiffness as arrays."""
        R = self.rows
        return {"indptr": R.indptr, "indices": R.indices, "data": R.data, "stiffness": self.stiffness}

    @classmethod
    def from_dict(cls, arrays: Mapping[str, AnyArray], n: int) -> Springs:
        """Return the springs of n unknowns, given the arrays of `to_dict`."""
        shape = (len(arrays["stiffness"]), n)
        return cls(csr_array((arrays["data"], arrays["indices"], arrays["indptr"]), shape=shape), arrays["stiffness"])

    def alike(self, other: Springs | None) -> bool:
        """Return whether `other` springs have nearly the same rows and stiffness, see ALIKE."""
        if other is None or self.rows.shape != other.rows.shape:
            return False
        scaled_self, scaled_other = (scaled(one.rows, np.sqrt(one.stiffness)) for one in (self, other))
        return bool(abs(scaled_self - scaled_other).sum() <= ALIKE * abs(scaled_other).sum())
