"""Response of a solution with friction to further forces, gaps and slips, constraints staying open, stuck or sliding."""

from __future__ import annotations

import numpy as np
from scipy.linalg import lu_solve
from scipy.sparse import csr_array, vstack

from fastcontact.analysis.friction.slip_directions import IDLE
from fastcontact.analysis.solution import FrictionalEquilibrium, Response
from fastcontact.arrays import Array
from fastcontact.contact.constraints import Constraints
from fastcontact.linear.delassus import lu_factors
from fastcontact.linear.protocol import Loaded
from fastcontact.round_off import TINY


def response(
    loaded: Loaded, constraints: Constraints, equilibrium: FrictionalEquilibrium, compliance: Array
) -> Response:
    """Linearise a solution: closed gaps and stuck slips stay as they are, sliding ones follow Coulomb's law.

    Parameters
    ----------
    loaded : Loaded
    constraints : Constraints
        In the unknowns of `loaded`.
    equilibrium : FrictionalEquilibrium
    compliance : ndarray ((1 + k) q, (1 + k) q)
        The own compliance of its q closed constraints, normal parts first [length / force].
    """
    rows = np.flatnonzero(equilibrium.active)
    k, q = len(constraints.tangents), len(rows)
    R = csr_array(vstack([matrix[rows] for matrix in (constraints.B, *constraints.tangents)], format="csr"))
    at_rest = loaded.involved_solution(np.zeros(R.shape[1]), None)
    F = loaded.delassus(R)[1] + compliance
    unit = np.maximum(np.diag(F)[:q], TINY)
    A, slipping = F.copy(), np.flatnonzero(~equilibrium.sticking[rows])
    weight = np.zeros((k, k, len(slipping)))  # of slips in the equations of sliding constraints
    mu = constraints.coefficients[rows][slipping]
    force = equilibrium.tangential[rows][slipping].T
    trial = force - equilibrium.slip[rows][slipping].T / unit[slipping]
    reach = np.maximum(np.linalg.norm(trial, axis=0), TINY)
    along, turning = trial / reach, np.minimum(mu * equilibrium.multiplier[rows][slipping] / reach, 1.0)
    slips = [(1 + a) * q + slipping for a in range(k)]
    for a in range(k):
        A[slips[a]] = 0.0
        A[slips[a], slips[a]] = 1.0
        A[slips[a], slipping] -= mu * along[a]
        for b in range(k) if k == 2 else ():
            turn = turning * ((a == b) - along[a] * along[b])
            weight[a, b] = turn / unit[slipping]
            A[slips[a], slips[b]] -= turn
            A[slips[a]] += weight[a, b][:, None] * F[slips[b]]
    held = np.flatnonzero(np.diag(F) <= IDLE * np.tile(unit, 1 + k))  # nothing gives there, nor counts
    A[held], A[held, held] = 0.0, 1.0
    factors = lu_factors(A) if q else None

    def respond(force: Array, gaps: Array) -> Array:
        u = loaded.involved_solution(force, None) - at_rest
        if factors is None:
            return u
        moved = R @ u + gaps[:, rows].ravel()
        right = -moved
        for a in range(k):
            right[slips[a]] = -sum(weight[a, b] * moved[slips[b]] for b in range(k))
        right[held] = 0.0
        return u + loaded.involved_solution(R.T @ lu_solve(factors, right), None) - at_rest

    return respond
