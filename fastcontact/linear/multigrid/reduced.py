"""Reduced operator of the iteration: K and springs under eliminated constraints, with or without compliance.

Equations ``B u + C multiplier = c`` with a diagonal compliance C are eliminated like exact ones, but their pivots have the
additional displacement ``P^-1 s``, P the pivots' columns of B. Their excess ``s = B u - c = -C multiplier`` is an
unknown with the stiffness ``1 / C``, which replaces the pivot in the vectors of the iteration. Even a large stiffness
costs no digits and no iterations, since it is solved for separately; the stiffer, the weaker its coupling with the other
unknowns.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fastcontact.arrays import Array
from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.multigrid.matrix import ScaledMatrix
from fastcontact.linear.springs import Springs


class Reduced:
    """Operator of the iteration: K and springs under eliminated constraints.

    Parameters
    ----------
    K : ScaledMatrix
        Shape (n, n) [force / length].
    elimination : Elimination, optional
    springs : Springs, optional
        Added to K.
    diagonal : ndarray (n,), optional
        Diagonal of K [force / length], where equations have a compliance.

    Attributes
    ----------
    elimination, springs
    """

    def __init__(
        self, K: ScaledMatrix, elimination: Elimination | None, springs: Springs | None = None,
        diagonal: Array | None = None,
    ) -> None:  # fmt: skip
        self._K, self.elimination, self.springs = K, elimination, springs
        self._excess = None
        if elimination is not None and elimination.compliance is not None:
            assert diagonal is not None
            self._excess = _Excess(diagonal, elimination, elimination.compliance)

    def begin(self, x: Array, f: Array, r: Array) -> None:
        """Convert the displacement x (n,) [length] to a vector of the iteration, and fill r (n,) with its residual."""
        if self._excess is not None:
            self._excess.begin(x, self.multiplier(x, f) if x.any() else None)
        elif self.elimination is not None:
            self.elimination.complete(x, self.elimination.offset)
        self._subtract(self.displacement(x), f, x, r)

    def displacement(self, x: Array, moved: bool = True) -> Array:
        """Return the displacement (n,) of a vector of the iteration or, if not `moved`, of an increment of it.

        Valid until the next call: it may be work space, or x itself.
        """
        if self._excess is None:
            return x
        assert self.elimination is not None
        return self._excess.displacement(x, self.elimination.offset if moved else None)

    def multiply(self, p: Array, q: Array) -> None:
        """Fill q (n,) with the product with p (n,)."""
        u = self.displacement(p, moved=False)
        self._K.combine(1.0, u, 0.0, q, q)
        if self.springs is not None:
            self.springs.subtract_forces(u, q, -1.0)
        self._reduce(p, q, 1.0)

    def precondition(self, r: Array, norm: float, z: Array, cycle: Callable[[Array, float, Array], None]) -> None:
        """Fill z (n,) with an approximate solution for r (n,), of 2-norm `norm`; `cycle` is for exact equations."""
        if self._excess is None:
            cycle(r, norm, z)
            if self.elimination is not None:
                self.elimination.complete(z)
        else:
            self._excess.precondition(r, norm, z, cycle)

    def multiplier(self, u: Array, f: Array) -> Array:
        """Return the multipliers (m,) [force] of the equations at the displacement u (n,)."""
        return multiplier(self._K, self.elimination, self.springs, u, f)

    def _subtract(self, u: Array, f: Array, x: Array, r: Array) -> None:
        self._K.combine(-1.0, u, 1.0, f, r)
        if self.springs is not None:
            self.springs.subtract_forces(u, r)
        self._reduce(x, r, -1.0)

    def _reduce(self, x: Array, r: Array, sign: float) -> None:
        """Move forces r (n,) from the pivots; add those of the excesses in x times `sign` there."""
        if self._excess is not None:
            self._excess.reduce(x, r, sign)
        elif self.elimination is not None:
            self.elimination.move_forces(r)


def multiplier(K: ScaledMatrix, elimination: Elimination | None, springs: Springs | None, u: Array, f: Array) -> Array:
    """Return the multipliers (m,) [force] of the equations at the displacement u (n,)."""
    if elimination is None:
        return np.empty(0)
    if springs is not None:
        f = f.copy()
        springs.subtract_forces(u, f)
    return elimination.multiplier(K.forces_at(elimination.pivots, u, f))


class _Excess:
    """Violation of compliant constraints, an unknown in place of each pivot. See `Reduced` for parameters."""

    def __init__(self, diagonal: Array, elimination: Elimination, compliance: Array) -> None:
        self._elimination, self._pivots = elimination, elimination.pivots
        compliant, self._compliance = compliance > 0.0, compliance
        self._stiffness = np.divide(1.0, compliance, out=np.zeros(len(compliance)), where=compliant)
        # Stiffness of the excess plus that of the pivot; exact equations are unchanged.
        of_pivots = elimination.own.sparse.matrix.power(2).T @ diagonal[self._pivots]
        self._inverse = np.where(compliant, 1.0 / (self._stiffness + of_pivots), 0.0)
        self._compliant = compliant
        self._u = np.empty(len(diagonal))

    def begin(self, x: Array, multiplier: Array | None) -> None:
        """Replace pivots by the violations that balance the forces there; constraints that were open start with zero."""
        x[self._pivots] = 0.0 if multiplier is None else -self._compliance * multiplier

    def displacement(self, x: Array, offset: Array | None) -> Array:
        moved = self._elimination.shifted(x[self._pivots])
        u = self._u
        u[:] = x
        self._elimination.complete(u, moved if offset is None else moved + offset)
        return u

    def reduce(self, x: Array, r: Array, sign: float) -> None:
        multiplier = self._elimination.multiplier(r[self._pivots]) + sign * self._stiffness * x[self._pivots]
        self._elimination.move_forces(r)
        r[self._pivots] = np.where(self._compliant, multiplier, 0.0)

    def precondition(self, r: Array, norm: float, z: Array, cycle: Callable[[Array, float, Array], None]) -> None:
        residual = r[self._pivots]
        r[self._pivots] = 0.0
        cycle(r, norm, z)
        r[self._pivots] = residual
        z[self._pivots] = self._inverse * residual
