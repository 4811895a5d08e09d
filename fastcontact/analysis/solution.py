"""Solutions of the contact problem, without and with friction, and their accuracy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_array

from fastcontact.arrays import Array, Indices, Mask
from fastcontact.linear.protocol import Loaded


@dataclass(frozen=True)
class Accuracy:
    """Tolerances and limits of one solution of the contact inequalities.

    Attributes
    ----------
    gap : float
        Tolerance of the gap: only a gap less than ``-gap`` counts as penetration [length].
    multiplier : float
        Tolerance of multipliers: only a multiplier less than ``-multiplier`` times the largest one counts as tension [-].
    residual : float, optional
        Relative residual at which iterative linear solvers stop, if it is larger than their tolerance [-].
    max_iterations : int
        Largest number of linear solutions without friction. The iteration stops at this number even if it has not converged.
    inexact : bool
        Whether linear solutions are inexact. Friction then takes a single Newton step, because errors may reverse slips.
    """

    gap: float
    multiplier: float = 1e-12
    residual: float | None = None
    max_iterations: int = 200
    inexact: bool = False


# Linear map to the change of the unknowns (n,) [length] from additional forces (n,) [force] on them, and from additional
# gaps and slips (1 + k, m) of all constraints [length].
Response = Callable[[Array, Array], Array]


def response(loaded: Loaded, R: csr_array, rows: Indices, forces_of: Callable[[Array], Array]) -> Response:
    """Return the `Response` of a contact problem with q closed constraints.

    Parameters
    ----------
    loaded : Loaded
        Prepared matrix (n, n) with any right-hand side.
    R : csr_array ((1 + k) q, n)
        Derivatives of the gaps of the closed constraints, and of their slips along k tangents [-].
    rows : ndarray of int (q,)
        Numbers of the closed constraints.
    forces_of : callable
        Function that returns the change ((1 + k) q,) of their normal and tangential forces [force], given a change
        ((1 + k) q,) of their gaps and slips [length].
    """
    at_rest, transpose = loaded.involved_solution(np.zeros(R.shape[1]), None), csr_array(R.T)

    def respond(force: Array, gaps: Array) -> Array:
        u = loaded.involved_solution(force, None) - at_rest
        return u + loaded.involved_solution(transpose @ forces_of(R @ u + gaps[:, rows].ravel()), None) - at_rest

    return respond


@dataclass(frozen=True, eq=False)
class Path:
    """Data of the constraints at the beginning of a load step, for friction along the load path in increments.

    Attributes
    ----------
    gap : ndarray (m,)
        Gaps, zero at constraints with contact forces [length].
    normal : ndarray (m,)
        Normal forces [force].
    traction : ndarray (m, dim)
        Tangential force vectors [force].
    closing : ndarray (m, dim)
        Tangential relative displacement while the whole gap closes, which is not slip [length].
    waiting : ndarray of bool (m,)
        Constraints that are open at the beginning of the step. They carry no force before they close.
    """

    gap: Array
    normal: Array
    traction: Array
    closing: Array
    waiting: Mask

    def along(self, directions: tuple[Array, ...], rows: Indices) -> tuple[Array, Array]:
        """Return the data of the constraints `rows` (q,), with components along each of k tangents (m, dim).

        Returns
        -------
        forces : ndarray (1 + k, q)
            Normal forces, then tangential forces [force].
        closed : ndarray (1 + k, q)
            Gaps, then the components of `closing` [length].
        """
        forces, closed = (
            np.vstack([normal[rows], *((vectors[rows] * tangent[rows]).sum(axis=1) for tangent in directions)])
            for normal, vectors in ((self.normal, self.traction), (self.gap, self.closing))
        )
        return forces, closed


@dataclass(frozen=True, eq=False)
class Slid:
    """Data of the constraints at the beginning of the last increment of a load step.

    Attributes
    ----------
    slip : ndarray (m, dim)
        Slip vectors since the beginning of the step [length].
    approach : ndarray (m, dim)
        Part of `slip` before the constraint closed in this step, zero if it was closed at the beginning [length].
    work : ndarray (m,)
        Frictional work since the beginning of the step [energy].
    normal : ndarray (m,)
        Normal forces [force].
    """

    slip: Array
    approach: Array
    work: Array
    normal: Array


@dataclass(frozen=True, eq=False)
class Solution:
    """Solution of the contact problem of one pairing, with or without friction.

    Attributes
    ----------
    u : ndarray (n,)
        Unknowns [length].
    multiplier : ndarray (m,)
        Lagrange multipliers of all constraints, the normal forces, which are zero for inactive constraints [force].
    gap : ndarray (m,)
        Gaps [length].
    active : ndarray of bool (m,)
        Active set of this solution: constraints that are closed.
    wanted : ndarray of bool (m,)
        Initial active set of the next solution. Without friction it follows from the signs of gaps and multipliers, and
        equals `active` if all inequalities hold.
    settled : bool
        Whether all inequalities hold.
    iterations : int
        Number of linear solutions, with friction of Newton iterations.
    tangential : ndarray (m, k)
        Tangential forces on the secondary side, along each of k tangents; k is zero without friction [force].
    slip : ndarray (m, k)
        Slips of the load step along each tangent [length].
    sticking : ndarray of bool (m,)
        Closed constraints that do not slide.
    residual : float
        Residual of the complementarity function, relative to the largest force; zero without friction [-].
    directions : tuple of k ndarray (m, dim)
        Unit tangents.
    response : callable, optional
        Function without arguments that returns the `Response` of this solution, for a constant contact state.
    work : ndarray (m,), optional
        Frictional work in the step [energy]; only if the step is solved in increments.
    approach : ndarray (m, k), optional
        Part of `slip` before the constraint closed in this step [length]; only if the step is solved in increments.
    slid : Slid, optional
        Data at the beginning of the last increment; only if the step is solved in increments.
    """

    u: Array
    multiplier: Array
    gap: Array
    active: Mask
    wanted: Mask
    settled: bool
    iterations: int
    tangential: Array
    slip: Array
    sticking: Mask
    residual: float = 0.0
    directions: tuple[Array, ...] = ()
    response: Callable[[], Response] | None = field(default=None, repr=False)
    work: Array | None = None
    approach: Array | None = None
    slid: Slid | None = None

    @classmethod
    def frictionless(cls, u: Array, multiplier: Array, gap: Array, active: Mask, wanted: Mask) -> Solution:
        """Return the solution for one active set without friction."""
        settled, no_tangents = bool(np.array_equal(active, wanted)), np.zeros((len(gap), 0))
        return cls(u, multiplier, gap, active, wanted, settled, 1, no_tangents, no_tangents, active)

    def forces_along(self, directions: tuple[Array, ...], m: int) -> Array | None:
        """Return normal and tangential forces (1 + k, m) in components along different tangents (m, dim) [force].

        Tangents of different pairings may differ by any angle in the tangent plane. The result is None if the solution does
        not have `m` constraints.
        """
        if self.tangential.shape != (m, len(directions)):
            return None
        vectors = sum(t[:, None] * along for t, along in zip(self.tangential.T, self.directions, strict=True))
        return np.vstack([self.multiplier, *((vectors * tangent).sum(axis=1) for tangent in directions)])
