"""Coulomb friction: the inequalities of contact and the friction cone, solved together on their compliance.

With normal forces n >= 0 and tangential forces t of all constraints as unknowns, gaps and slips of the step are
``(g, s) = (g, s)_free + F (n, t)`` with ``F = R K^-1 R.T + C``, R the normal and tangential rows and C the compliance of
the constraints themselves. `coulomb` solves that: stick holds the slip of the step at zero exactly, slip returns to the
cone exactly.
"""

from __future__ import annotations

import dataclasses
import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lstsq
from scipy.sparse import csr_array, vstack

from fastcontact.analysis.friction.slip_directions import aligning, idle, own_compliance
from fastcontact.contact.constraints import Compliance
from fastcontact.linear.protocol import Loaded, LoadedNonsymmetric

if TYPE_CHECKING:
    from fastcontact.analysis.friction import coulomb

log = logging.getLogger("fastcontact")
Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class FrictionalEquilibrium:
    """A solution with friction; the normal part as in `active_set.Equilibrium`.

    Attributes
    ----------
    u : ndarray (n,)
    multiplier, gap : ndarray (m,)
        Normal forces and gaps.
    tangential, slip : ndarray (m, k)
        Tangential forces on the secondary side and slip of the step, along the k tangents.
    active, sticking : ndarray of bool (m,)
    settled : bool
        Whether all inequalities hold.
    residual : float
        By how much they do not, over the largest force.
    iterations : int
        Newton iterations.
    directions : tuple of ndarray (m, dim)
        The k tangents.
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

    def forces_along(self, directions: tuple[Array, ...], m: int) -> Array | None:
        """Return normal and tangential forces (1 + k, m) along other tangents (m, dim); None for other constraints.

        From one pairing to the next tangents may turn by any angle: only the plane that they span is the contact's.
        """
        if self.tangential.shape != (m, len(directions)):
            return None
        vectors = sum(t[:, None] * along for t, along in zip(self.tangential.T, self.directions, strict=True))
        return np.vstack([self.multiplier, *((vectors * along).sum(axis=1) for along in directions)])

    @property
    def wanted(self) -> Mask:
        """The set to start the next solution from."""
        return self.active


def solve(
    loaded: Loaded,
    B: csr_array,
    tangents: tuple[csr_array, ...],
    gap0: Array,
    slip0: Array,
    friction: Array,
    usable: Mask,
    *,
    compliance: Compliance | None,
    directions: tuple[Array, ...],
    closed: Mask,
    held: Mask | None = None,
    softness: Array | None = None,
    loose: Array | None = None,
    guess: FrictionalEquilibrium | None = None,
    elsewhere: Array | None = None,
    tolerance: float = 0.0,
    patience: int | None = None,
) -> FrictionalEquilibrium:
    """Find displacement and contact forces under contact and friction.

    Constraints that nothing presses together are left out, for each costs columns of the compliance: the problem begins
    with those that were closed, and takes up others as they are found to penetrate. What is left out in the end is open
    and free of forces, so nothing is lost. Constraints that a compliance of their own couples are taken all at once.

    Parameters
    ----------
    loaded : Loaded
    B : csr_array (m, n)
        Normal rows.
    tangents : tuple of csr_array (m, n)
        Tangential rows, one matrix a tangent: one in 2D, two in 3D.
    gap0 : ndarray (m,)
    slip0 : ndarray (k, m)
        Slip at u = 0, minus that at the beginning of the step.
    friction : ndarray (m,)
        Coefficients mu.
    usable : ndarray of bool (m,)
    compliance : Compliance, optional
        Of the constraints themselves, the same in every direction.
    directions : tuple of ndarray (m, dim)
        The tangents, zero for constraints without friction.
    closed : ndarray of bool (m,)
        Constraints to start from as closed and sticking.
    held : ndarray of bool (m,), optional
        Constraints that are equations, without friction: always closed, with normal forces of either sign.
    softness : ndarray (m,), optional
        Compliance of each constraint along its normal alone.
    loose : ndarray (1 + k, m, h), optional
        Z of a further compliance ``Z Z.T`` of normal and tangential forces.
    guess : FrictionalEquilibrium, optional
        A solution with nearly the same forces; one of other constraints is passed over.
    elsewhere : ndarray (n,), optional
        Displacement to keep where no constraint acts, see `Loaded.near`; iterative solvers start from it.
    tolerance : float
        Relative residual for iterative solvers.
    patience : int, optional
        Newton iterations after which an unsettled state will do, for solvers that eliminate constraints.
    """
    forces = None if guess is None else guess.forces_along(directions, len(gap0))
    if isinstance(loaded, LoadedNonsymmetric) and compliance is None and softness is None and loose is None:
        found = _eliminated(
            loaded, (B, *tangents), np.vstack([gap0, slip0]), friction, usable, closed, held, forces, elsewhere, tolerance,
            patience,
        )  # fmt: skip
        if found is not None:
            return dataclasses.replace(found, directions=directions)
        log.info("friction: the iteration on eliminated constraints did not settle, their compliance is formed")
    together = compliance is not None or loose is not None
    chosen = usable if together else usable & (closed if held is None else closed | held)
    iterations = 0
    while True:
        found = _among(
            chosen, loaded, B, tangents, gap0, slip0, friction, compliance, directions, closed, held, softness, loose, forces,
            elsewhere,
        )  # fmt: skip
        found.gap[~usable], found.slip[~usable] = np.inf, 0.0
        iterations += found.iterations
        missing = usable & ~chosen & (found.gap < 0.0)
        if not missing.any():
            return dataclasses.replace(found, iterations=iterations, directions=directions)
        chosen = chosen | missing


def _eliminated(
    loaded: LoadedNonsymmetric, rows: tuple[csr_array, ...], free: Array, friction: Array, usable: Mask, closed: Mask,
    held: Mask | None, forces: Array | None, elsewhere: Array | None, tolerance: float,
    patience: int | None,
) -> FrictionalEquilibrium | None:  # fmt: skip
    """Solve without a compliance, see `friction_eliminated`; None where that fails."""
    from fastcontact.analysis.friction import eliminated

    u = np.zeros(rows[0].shape[1]) if elsewhere is None else elsewhere
    solved = eliminated.solve(
        loaded, rows, free, friction, usable, closed=closed & usable, held=held, forces=forces, u=u, tolerance=tolerance,
        patience=patience,
    )  # fmt: skip
    if solved is None:
        return None
    u, found = solved
    found.gaps[0, ~usable], found.gaps[1:, ~usable] = np.inf, 0.0
    return FrictionalEquilibrium(
        u, found.y[0], found.gaps[0], found.y[1:].T, found.gaps[1:].T, found.closed & usable, found.sticking, found.settled,
        found.residual, found.iterations,
    )  # fmt: skip


def _among(
    chosen: Mask, loaded: Loaded, B: csr_array, tangents: tuple[csr_array, ...], gap0: Array, slip0: Array,
    friction: Array, compliance: Compliance | None, directions: tuple[Array, ...], closed: Mask, held: Mask | None,
    softness: Array | None, loose: Array | None, forces: Array | None, elsewhere: Array | None,
) -> FrictionalEquilibrium:  # fmt: skip
    """Solve with the `chosen` constraints (m,) alone; gaps and slips of the others are what the displacement leaves."""
    rows = np.flatnonzero(chosen)
    k, m = len(tangents), len(gap0)
    R = csr_array(vstack([matrix[rows] for matrix in (B, *tangents)], format="csr"))
    free, F = loaded.flexibility(R)
    Q = aligning(own_compliance(F, 3)) if k == 2 else None
    still = np.flatnonzero(idle(own_compliance(F if Q is None else np.asarray(Q @ (Q @ F).T), 1 + k))) + len(rows)
    if compliance is not None and len(rows):
        F += _turned(compliance.block(rows), np.stack([along[rows] for along in directions]))
    if loose is not None:
        Z = loose[:, rows].reshape((1 + k) * len(rows), -1)
        F += Z @ Z.T
    if softness is not None:
        F[np.arange(len(rows)), np.arange(len(rows))] += softness[rows]
    free = free.reshape(1 + k, -1) + np.vstack([gap0[rows], *(slip0[:, rows])])
    start = None if forces is None else forces[:, rows]
    if Q is not None:
        F, free = np.asarray(Q @ (Q @ F).T), (Q @ free.ravel()).reshape(free.shape)
        start = None if start is None else (Q @ start.ravel()).reshape(free.shape)
    if len(still):
        F[still], F[:, still], free.ravel()[still] = 0.0, 0.0, 0.0
        F[still, still] = np.diag(F).max()
    equations = np.zeros(len(rows), bool) if held is None else held[rows]
    found = _coulomb(F, free, friction[rows], closed[rows], equations, start)
    y, relative = found.y, found.gaps
    if Q is not None:
        y, relative = (Q.T @ y.ravel()).reshape(y.shape), (Q.T @ relative.ravel()).reshape(y.shape)
    u = loaded.involved_solution(R.T @ y.ravel(), elsewhere)
    full, gaps = np.zeros((1 + k, m)), np.vstack([gap0 + B @ u, *(own + T @ u for own, T in zip(slip0, tangents))])
    full[:, rows], gaps[:, rows] = y, relative
    active, sticking = np.zeros(m, bool), np.zeros(m, bool)
    active[rows], sticking[rows] = found.closed, found.sticking
    return FrictionalEquilibrium(
        u, full[0], gaps[0], full[1:].T, gaps[1:].T, active, sticking, found.settled, found.residual, found.iterations
    )


def _coulomb(F: Array, free: Array, friction: Array, closed: Mask, held: Mask, start: Array | None) -> coulomb.Forces:
    """Solve the problem on the compliance F, from which the equations of `held` constraints are eliminated first."""
    from fastcontact.analysis.friction import coulomb

    if not held.any():
        return coulomb.solve(F, free, friction, closed, start)
    index = np.arange(free.size).reshape(free.shape)
    h, r = index[0, held], index[:, ~held].ravel()
    give = lstsq(F[np.ix_(h, h)], np.column_stack([F[np.ix_(h, r)], free.ravel()[h]]))[0]
    rest = free.ravel()[r] - F[np.ix_(r, h)] @ give[:, -1]
    remaining = F[np.ix_(r, r)] - F[np.ix_(r, h)] @ give[:, :-1]
    start = None if start is None else start[:, ~held]
    found = coulomb.solve(remaining, rest.reshape(len(free), -1), friction[~held], closed[~held], start)
    y, gaps = np.zeros(free.shape), np.zeros(free.shape)
    y[:, ~held], gaps[:, ~held] = found.y, found.gaps
    y[0, held] = -(give[:, -1] + give[:, :-1] @ found.y.ravel())
    now, sticking = held.copy(), held.copy()
    now[~held], sticking[~held] = found.closed, found.sticking
    return dataclasses.replace(found, y=y, gaps=gaps, closed=now, sticking=sticking)


def _turned(C: Array, along: Array) -> Array:
    """Return the compliance of normal and tangential forces ((1 + k) m, (1 + k) m), C (m, m) being that of vectors.

    Frames turn from one constraint to the next: what C couples are the forces, not their components.

    Parameters
    ----------
    C : ndarray (m, m)
    along : ndarray (k, m, dim)
        Tangents, zero without friction.
    """
    if len(along) == 1:
        normal = np.column_stack([-along[0, :, 1], along[0, :, 0]])
    else:
        normal = np.cross(along[0], along[1])
    normal[~along.any(axis=(0, 2)), 0] = 1.0  # where nothing turns
    frame = np.concatenate([normal[None], along]).reshape(-1, normal.shape[1])
    parts = len(along) + 1
    return np.asarray(np.tile(C, (parts, parts)) * (frame @ frame.T))
