"""Operator of the iteration: the sum of K and springs, after the elimination of equations with or without compliance.

Equations ``B u + C multiplier = c`` with a diagonal compliance C are eliminated like equations without compliance. Their
violation ``s = B u - c = -C multiplier``, called excess, adds the displacement ``P^-1 s`` to the pivots, where P contains the
columns of B that belong to the pivots. The excess is an unknown with the stiffness ``1 / C``, which replaces the pivot in the
vectors of the iteration. The preconditioner treats it separately. Therefore, a large stiffness impairs neither accuracy nor
convergence: the stiffer an equation, the weaker the coupling of its excess to the other unknowns.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fastcontact.arrays import Array
from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.multigrid.matrix import ScaledMatrix
from fastcontact.linear.springs import Springs


class ReducedOperator:
    """Operator of the iteration: the sum of K and springs, after the elimination of equations.

    Parameters
    ----------
    K : ScaledMatrix
        Stiffness matrix (n, n) [force / length].
    elimination : Elimination, optional
        Eliminated equations; none by default.
    springs : Springs, optional
        Springs that are added to K; none by default.
    diagonal : ndarray (n,), optional
        Diagonal of K, which is required if equations have a compliance [force / length].

    Attributes
    ----------
    elimination : Elimination or None
    springs : Springs or None
    """

    def __init__(
        self, K: ScaledMatrix, elimination: Elimination | None, springs: Springs | None = None,
        diagonal: Array | None = None,
    ) -> None:  # fmt: skip
        self._K, self.elimination, self.springs = K, elimination, springs
        self._excess = None
        if elimination is not None and elimination.compliance is not None:
            assert diagonal is not None
            self._excess = _Excesses(diagonal, elimination, elimination.compliance)

    def begin(self, x: Array, f: Array, r: Array) -> None:
        """Convert displacements x (n,) [length] in place to a vector of the iteration, and fill r (n,) with its residual.

        The right-hand side is f (n,) [force].
        """
        if self._excess is not None:
            self._excess.begin(x, self.multiplier(x, f) if x.any() else None)
        elif self.elimination is not None:
            self.elimination.complete(x, self.elimination.offset)
        u = self.displacement(x)
        self._K.combine(-1.0, u, 1.0, f, r)
        if self.springs is not None:
            self.springs.subtract_forces(u, r)
        self._reduce(x, r, -1.0)

    def displacement(self, x: Array, increment: bool = False) -> Array:
        """Return the displacements (n,) of a vector x (n,) of the iteration [length].

        If `increment` is true, x is an increment, to which the offsets of the pivots are not added. The result may be x
        itself or an array that the next call overwrites.
        """
        if self._excess is None:
            return x
        assert self.elimination is not None
        return self._excess.displacement(x, None if increment else self.elimination.offset)

    def multiply(self, p: Array, q: Array) -> None:
        """Fill q (n,) with the product of the operator and p (n,)."""
        u = self.displacement(p, increment=True)
        self._K.combine(1.0, u, 0.0, q, q)
        if self.springs is not None:
            self.springs.subtract_forces(u, q, -1.0)
        self._reduce(p, q, 1.0)

    def precondition(self, r: Array, norm: float, z: Array, cycle: Callable[[Array, float, Array], None]) -> None:
        """Fill z (n,) with an approximate solution for r (n,).

        `norm` is the 2-norm of r. `cycle` is the preconditioner for equations without compliance, with the arguments (r,
        norm, z).
        """
        if self._excess is None:
            cycle(r, norm, z)
            if self.elimination is not None:
                self.elimination.complete(z)
        else:
            self._excess.precondition(r, norm, z, cycle)

    def multiplier(self, u: Array, f: Array) -> Array:
        """Return the multipliers (m,) of the equations [force], see the function `multiplier`."""
        return multiplier(self._K, self.elimination, self.springs, u, f)

    def _reduce(self, x: Array, r: Array, sign: float) -> None:
        """Move the forces r (n,) from the pivots to the other unknowns, in place.

        At the pivots of compliant equations, the entries become the forces on the excesses, including `sign` times the
        product of the stiffness and the excesses in x.
        """
        if self._excess is not None:
            self._excess.reduce(x, r, sign)
        elif self.elimination is not None:
            self.elimination.move_forces(r)


def multiplier(K: ScaledMatrix, elimination: Elimination | None, springs: Springs | None, u: Array, f: Array) -> Array:
    """Return the multipliers (m,) of the equations of `elimination` [force].

    They balance the forces at the pivots, for displacements u (n,) [length] and the right-hand side f (n,) [force].
    """
    if elimination is None:
        return np.empty(0)
    if springs is not None:
        f = f.copy()
        springs.subtract_forces(u, f)
    return elimination.multiplier(K.forces_at(elimination.pivots, u, f))


class _Excesses:
    """Excesses of compliant equations, which replace the pivots as unknowns; for parameters see `ReducedOperator`."""

    def __init__(self, diagonal: Array, elimination: Elimination, compliance: Array) -> None:
        self._elimination, self._pivots = elimination, elimination.pivots
        compliant, self._compliance = compliance > 0.0, compliance
        self._stiffness = np.divide(1.0, compliance, out=np.zeros(len(compliance)), where=compliant)
        # Diagonal of the operator at the excesses: the stiffness of the equation plus that of the pivot.
        pivot_stiffness = elimination.pivot_inverse.sparse.matrix.power(2).T @ diagonal[self._pivots]
        self._inverse = np.where(compliant, 1.0 / (self._stiffness + pivot_stiffness), 0.0)
        self._compliant = compliant
        self._u = np.empty(len(diagonal))

    def begin(self, x: Array, multiplier: Array | None) -> None:
        """Replace the pivots of x (n,), in place, by the excesses that belong to multipliers (m,); None means zero."""
        x[self._pivots] = 0.0 if multiplier is None else -self._compliance * multiplier

    def displacement(self, x: Array, offset: Array | None) -> Array:
        """Return the displacements (n,) of x (n,) [length]; the `offset` (m,) of the pivots is added if it is given."""
        shift = self._elimination.pivot_inverse.solve(x[self._pivots])
        u = self._u
        u[:] = x
        self._elimination.complete(u, shift if offset is None else shift + offset)
        return u

    def reduce(self, x: Array, r: Array, sign: float) -> None:
        """See `ReducedOperator._reduce`."""
        multiplier = self._elimination.multiplier(r[self._pivots]) + sign * self._stiffness * x[self._pivots]
        self._elimination.move_forces(r)
        r[self._pivots] = np.where(self._compliant, multiplier, 0.0)

    def precondition(self, r: Array, norm: float, z: Array, cycle: Callable[[Array, float, Array], None]) -> None:
        """See `ReducedOperator.precondition`; excesses are preconditioned by their diagonal."""
        residual = r[self._pivots]
        r[self._pivots] = 0.0
        cycle(r, norm, z)
        r[self._pivots] = residual
        z[self._pivots] = self._inverse * residual
