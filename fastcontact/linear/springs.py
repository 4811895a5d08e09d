"""Springs between unknowns, such as penalties, which are stored by rows instead of as an assembled matrix."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse import csr_array, vstack

from fastcontact._tools.records import record
from fastcontact.arrays import AnyArray, Indices
from fastcontact.linear.sparse_rows import entry_rows, scaled, substituted

# Largest relative difference between two sets of springs, or between the weights of eliminated unknowns, for which the same
# preconditioner is used. With 3, "hex20" with friction takes 62 iterations (48 with 0.3; `fastcontact bench
# robustness`, 3 000 unknowns); with 0.003, it takes 43, but the hierarchy changes with each pairing.
MAX_DIFFERENCE = 0.3


@record
class Springs:
    """Springs with the forces ``-force_rows.T @ (stiffness * (rows @ u))`` on n unknowns u.

    Attributes
    ----------
    rows : csr_array (q, n)
        Derivatives of the elongations of q springs with respect to the unknowns [-].
    stiffness : ndarray (q,)
        Stiffness of each spring, which is not negative [force / length].
    force_rows : csr_array (q, n), optional
        Matrix whose transpose maps the forces of the springs to the unknowns; `rows` by default [-].
    """

    rows: csr_array
    stiffness: AnyArray
    force_rows: csr_array | None = None

    @cached_property
    def _entry_springs(self) -> Indices:
        """Spring (k,) to which each entry of `rows` belongs."""
        return entry_rows(self.rows)

    def subtract_forces(self, u: AnyArray, r: AnyArray, factor: float = 1.0) -> None:
        """Subtract `factor` times the product of the stiffness matrix of the springs and `u` (n,) from `r` (n,), in place."""
        R = self.rows
        if self.force_rows is not None:
            r -= factor * (self.force_rows.T @ (self.stiffness * (R @ u)))
            return
        force = factor * self.stiffness * np.bincount(self._entry_springs, R.data * u[R.indices], len(self.stiffness))
        # If the precision is not that of r, `subtract.at` takes twenty times as long.
        np.subtract.at(r, R.indices, (R.data * force[self._entry_springs]).astype(r.dtype, copy=False))

    def joined(self, others: Springs | None) -> Springs:
        """Return these springs together with `others`."""
        if others is None:
            return self
        sets = (self, others)
        rows = csr_array(vstack([springs.rows for springs in sets], format="csr"))
        force_rows = None
        if self.force_rows is not None or others.force_rows is not None:
            rows_of_forces = [springs.rows if springs.force_rows is None else springs.force_rows for springs in sets]
            force_rows = csr_array(vstack(rows_of_forces, format="csr"))
        return Springs(rows, np.concatenate([springs.stiffness for springs in sets]), force_rows)

    def reduced(self, pivots: Indices, weights: csr_array) -> Springs:
        """Return the springs after the elimination ``u[pivots] = weights @ u`` with weights (m, n).

        The rows of the result are zero in the columns of the pivots. The springs must not have a matrix `force_rows`.
        """
        return Springs(substituted(self.rows, pivots, weights), self.stiffness)

    def scaled(self, factor: float, dtype: DTypeLike = float) -> Springs:
        """Return the springs with the stiffness multiplied by `factor`, in the data type `dtype`."""
        return Springs(self.rows.astype(dtype), (factor * self.stiffness).astype(dtype))

    def to_dict(self) -> dict[str, AnyArray]:
        """Return the rows and the stiffness as arrays."""
        R = self.rows
        return {"indptr": R.indptr, "indices": R.indices, "data": R.data, "stiffness": self.stiffness}

    @classmethod
    def from_dict(cls, arrays: Mapping[str, AnyArray], n: int) -> Springs:
        """Return the springs of n unknowns, given the arrays of `to_dict`."""
        shape = (len(arrays["stiffness"]), n)
        return cls(csr_array((arrays["data"], arrays["indices"], arrays["indptr"]), shape=shape), arrays["stiffness"])

    def is_similar(self, other: Springs | None) -> bool:
        """Return whether the springs `other` have nearly the same rows and stiffnesses, see MAX_DIFFERENCE."""
        if other is None or self.rows.shape != other.rows.shape:
            return False
        rows, other_rows = (scaled(springs.rows, np.sqrt(springs.stiffness)) for springs in (self, other))
        return bool(abs(rows - other_rows).sum() <= MAX_DIFFERENCE * abs(other_rows).sum())
