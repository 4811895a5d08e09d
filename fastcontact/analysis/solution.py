"""Solutions of the contact problem, without and with friction, and their accuracy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

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
        Whether linear solutions are inexact. Friction then takes a single Newton step, because their errors reverse slips.
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
        Prepared matrix (n, n) with a right-hand side, which does not matter.
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
class Equilibrium:
    """Solution of the frictionless contact problem for one active set.

    Attributes
    ----------
    u : ndarray (n,)
        Unknowns [length].
    multiplier : ndarray (m,)
        Lagrange multipliers of all constraints, which are zero for inactive constraints [force].
    gap : ndarray (m,)
        Gaps of all constraints [length].
    active : ndarray of bool (m,)
        Active set of this solution.
    wanted : ndarray of bool (m,)
        Next active set, which follows from the signs of gaps and multipliers; it equals `active` if all inequalities hold.
    iterations : int
        Number of linear solutions.
    response : callable, optional
        Function without arguments that returns the `Response` of this solution, for a constant active set.
    """

    u: Array
    multiplier: Array
    gap: Array
    active: Mask
    wanted: Mask
    iterations: int
    response: Callable[[], Response] | None = field(default=None, repr=False)
    # Both as in `FrictionalEquilibrium`: each active set is solved exactly, and there are no tangential forces.
    residual: ClassVar[float] = 0.0
    tangential: ClassVar[None] = None

    @property
    def settled(self) -> bool:
        """Whether all inequalities hold."""
        return bool(np.array_equal(self.active, self.wanted))


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
        Vectors of the tangential forces [force].
    closing : ndarray (m, dim)
        Tangential relative displacement while the whole gap closes, which is not slip [length].
    waiting : ndarray of bool (m,)
        Constraints that are open at the beginning of the step, and close at some instant if at all.
    """

    gap: Array
    normal: Array
    traction: Array
    closing: Array
    waiting: Mask

    def forces(self, directions: tuple[Array, ...], rows: Indices) -> Array:
        """Return the normal forces of the constraints `rows` (q,), and their components along each of k tangents (m, dim).

        Returns
        -------
        ndarray (1 + k, q)
            [force].
        """
        return _components(self.normal, self.traction, directions, rows)

    def closed(self, directions: tuple[Array, ...], rows: Indices) -> Array:
        """Return the gaps of the constraints `rows` (q,), and the components of `closing` along each of k tangents (m, dim).

        Returns
        -------
        ndarray (1 + k, q)
            [length].
        """
        return _components(self.gap, self.closing, directions, rows)


def _components(normal: Array, vectors: Array, directions: tuple[Array, ...], rows: Indices) -> Array:
    """Return values `normal` (m,), and components of `vectors` (m, dim) along k directions (m, dim), at `rows` (q,).

    The result is an array (1 + k, q).
    """
    along = [(vectors[rows] * tangent[rows]).sum(axis=1) for tangent in directions]
    return np.vstack([normal[rows], *along])


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
class FrictionalEquilibrium:
    """Solution of the contact problem with friction.

    Attributes
    ----------
    u : ndarray (n,)
        Unknowns [length].
    multiplier : ndarray (m,)
        Normal forces [force].
    gap : ndarray (m,)
        Gaps [length].
    tangential : ndarray (m, k)
        Tangential forces on the secondary side, along each of k tangents [force].
    slip : ndarray (m, k)
        Slips of the load step along each tangent [length].
    active, sticking : ndarray of bool (m,)
        Constraints that are closed, and closed constraints that stick.
    settled : bool
        Whether all inequalities hold.
    residual : float
        Residual of the complementarity function, relative to the largest force [-].
    iterations : int
        Number of Newton iterations.
    directions : tuple of k ndarray (m, dim)
        Unit tangents.
    work : ndarray (m,), optional
        Frictional work in the step [energy]; only if the step is solved in increments.
    approach : ndarray (m, k), optional
        Part of `slip` before the constraint closed in this step [length]; only if the step is solved in increments.
    slid : Slid, optional
        Data at the beginning of the last increment; only if the step is solved in increments.
    response : callable, optional
        Function without arguments that returns the `Response` of this solution, for a constant contact state.
    """

    u: Array
    multiplier: Array
    gap: Array
    tangential: Array
    slip: Array
    active: Mask
    sticking: Mask
    settled: bool
    residual: float
    iterations: int
    directions: tuple[Array, ...] = ()
    work: Array | None = None
    approach: Array | None = None
    slid: Slid | None = None
    response: Callable[[], Response] | None = field(default=None, repr=False)

    def forces_along(self, directions: tuple[Array, ...], m: int) -> Array | None:
        """Return normal and tangential forces (1 + k, m) in components along different tangents (m, dim) [force].

        Tangents of different pairings may differ by any angle in the tangent plane. The result is None if the solution does
        not have `m` constraints.
        """
        if self.tangential.shape != (m, len(directions)):
            return None
        vectors = sum(t[:, None] * along for t, along in zip(self.tangential.T, self.directions, strict=True))
        return np.vstack([self.multiplier, *((vectors * along).sum(axis=1) for along in directions)])

    @property
    def wanted(self) -> Mask:
        """Initial active set (m,) of the next solution."""
        return self.active


Solution = Equilibrium | FrictionalEquilibrium
