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
    """Tolerances and limits of one solution of the inequalities of contact.

    Attributes
    ----------
    gap : float
        A gap above minus this counts as open or closed, not as penetration [length].
    multiplier : float
        A multiplier above minus this fraction of the largest one counts as compression [-].
    residual : float, optional
        Relative residual of iterative linear solvers where it may exceed their own tolerance [-].
    max_iterations : int
        Largest number of linear solutions without friction; the result may then not be converged.
    max_newton_steps : int, optional
        Number of Newton steps with friction after which an unconverged state is accepted; None where it is not.
    """

    gap: float
    multiplier: float = 1e-12
    residual: float | None = None
    max_iterations: int = 200
    max_newton_steps: int | None = None


# Response of the unknowns (n,) [length] to forces (n,) [force], and to gaps and slips (1 + k, m) [length].
Response = Callable[[Array, Array], Array]


def response(loaded: Loaded, R: csr_array, rows: Indices, forces_of: Callable[[Array], Array]) -> Response:
    """Return the `Response` of constraints `rows` (q,), in contact.

    Parameters
    ----------
    loaded : Loaded
    R : csr_array ((1 + k) q, n)
        Rows of their gaps, and of their slips along k tangents.
    rows : ndarray of int (q,)
    forces_of : callable
        Returns the change of their forces ((1 + k) q,) due to a change of gaps and slips.
    """
    at_rest, transpose = loaded.involved_solution(np.zeros(R.shape[1]), None), csr_array(R.T)

    def respond(force: Array, gaps: Array) -> Array:
        u = loaded.involved_solution(force, None) - at_rest
        return u + loaded.involved_solution(transpose @ forces_of(R @ u + gaps[:, rows].ravel()), None) - at_rest

    return respond


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A solution under a set of active constraints.

    Attributes
    ----------
    u : ndarray (n,)
        Unknowns [length].
    multiplier : ndarray (m,)
        Multipliers of all constraints, zero for inactive ones [force].
    gap : ndarray (m,)
        Gaps of all constraints [length].
    active : ndarray of bool (m,)
        Active set of this solution.
    wanted : ndarray of bool (m,)
        Next active set by the signs of this solution; equal to `active` when every inequality holds.
    iterations : int
        Number of linear solutions.
    response : callable, optional
        Returns the `Response` of this solution with its active set.
    """

    u: Array
    multiplier: Array
    gap: Array
    active: Mask
    wanted: Mask
    iterations: int
    response: Callable[[], Response] | None = field(default=None, repr=False)
    # The active set is solved exactly, and there are no tangential forces without friction.
    residual: ClassVar[float] = 0.0
    tangential: ClassVar[None] = None

    @property
    def settled(self) -> bool:
        """Whether all inequalities hold."""
        return bool(np.array_equal(self.active, self.wanted))


@dataclass(frozen=True, eq=False)
class Path:
    """Constraints at the beginning of a load step.

    Attributes
    ----------
    gap, normal : ndarray (m,)
        Gaps [length], zero where forces act, and normal forces [force].
    traction : ndarray (m, dim)
        Tangential forces [force].
    closing : ndarray (m, dim)
        Slip that closing the whole gap would add, and that does not count [length].
    parts : int
        Number of increments.
    """

    gap: Array
    normal: Array
    traction: Array
    closing: Array
    parts: int

    @property
    def loaded(self) -> Mask:
        """Constraints (m,) that carry forces at the beginning."""
        return self.normal != 0.0

    def forces(self, directions: tuple[Array, ...], rows: Indices) -> Array:
        """Return the forces (1 + k, r) of constraints `rows` (r,) along tangents (m, dim)."""
        return _components(self.normal, self.traction, directions, rows)

    def closed(self, directions: tuple[Array, ...], rows: Indices) -> Array:
        """Return gaps and `closing` (1 + k, r) of constraints `rows` (r,) along tangents (m, dim) [length]."""
        return _components(self.gap, self.closing, directions, rows)


def _components(normal: Array, vectors: Array, directions: tuple[Array, ...], rows: Indices) -> Array:
    """Return the values `normal` (m,) of some rows (r,), and the components of vectors (m, dim), as (1 + k, r)."""
    along = [(vectors[rows] * tangent[rows]).sum(axis=1) for tangent in directions]
    return np.vstack([normal[rows], *along])


@dataclass(frozen=True, eq=False)
class Slid:
    """Constraints at the beginning of the last increment of a load step.

    Attributes
    ----------
    slip : ndarray (m, dim)
        Slip since the beginning of the step [length].
    work : ndarray (2, m)
        Frictional work since then, and the part of it done by constraints while they closed [energy].
    normal : ndarray (m,)
        Normal forces [force].
    """

    slip: Array
    work: Array
    normal: Array


@dataclass(frozen=True, eq=False)
class FrictionalEquilibrium:
    """A solution with friction; the normal part as in `Equilibrium`.

    Attributes
    ----------
    u : ndarray (n,)
        Unknowns [length].
    multiplier : ndarray (m,)
        Normal forces [force].
    gap : ndarray (m,)
        [length].
    tangential : ndarray (m, k)
        Tangential forces on the secondary side, along the k tangents [force].
    slip : ndarray (m, k)
        Slip of the step along the k tangents [length].
    active, sticking : ndarray of bool (m,)
    settled : bool
        Whether all inequalities hold.
    residual : float
        Violation of the inequalities over the largest force.
    iterations : int
        Newton iterations.
    directions : tuple of ndarray (m, dim)
        The k tangents.
    work : ndarray (2, m), optional
        Frictional work in the step, and the part of it done by constraints while they close, from increments [energy].
    slid : Slid, optional
        Beginning of the last increment.
    response : callable, optional
        As in `Equilibrium`.
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
    slid: Slid | None = None
    response: Callable[[], Response] | None = field(default=None, repr=False)

    def forces_along(self, directions: tuple[Array, ...], m: int) -> Array | None:
        """Return normal and tangential forces (1 + k, m) along other tangents (m, dim); None for other constraints.

        Tangents of different pairings may differ by any angle: only their plane is defined by the contact.
        """
        if self.tangential.shape != (m, len(directions)):
            return None
        vectors = sum(t[:, None] * along for t, along in zip(self.tangential.T, self.directions, strict=True))
        return np.vstack([self.multiplier, *((vectors * along).sum(axis=1) for along in directions)])

    @property
    def wanted(self) -> Mask:
        """Initial active set of the next solution."""
        return self.active


Solution = Equilibrium | FrictionalEquilibrium
