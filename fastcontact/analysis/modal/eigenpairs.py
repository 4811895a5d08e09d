"""The lowest eigenpairs of ``K v = eigenvalue M v`` among the motions that supports and closed contact allow.

With a factorisation of ``K + s M``, the Lanczos method is applied to its inverse (Ericsson and Ruhe, Math. Comp. 35, 1980);
where a factorisation is too expensive, the locally optimal block preconditioned conjugate gradient method (LOBPCG; Knyazev,
SIAM J. Sci. Comput. 23, 2001) is used, with one multigrid cycle as preconditioner.
"""

from __future__ import annotations

import warnings

import numpy as np
from scipy.linalg import eigh, qr, solve_triangular
from scipy.sparse import bsr_array, csr_array, diags_array
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh, lobpcg

from fastcontact.arrays import Array, Indices, Mask
from fastcontact.elasticity.constrained_system import System, separate_supports
from fastcontact.errors import ConvergenceError, ModelError
from fastcontact.linear.elimination.coupled_pivots import DependenceError
from fastcontact.linear.elimination.elimination import eliminate
from fastcontact.linear.multigrid.hierarchy import COARSEST_SIZE
from fastcontact.linear.multigrid.solver import MAX_ITERATIONS, Multigrid
from fastcontact.linear.protocol import TOLERANCE, LinearSolver
from fastcontact.linear.sparse_rows import substituted
from fastcontact.round_off import LENGTH_ROUND_OFF

UNSTABLE = (
    "the equilibrium of the step is unstable, since the stiffness is not positive definite: where nodes slide, as round a "
    "tightened bolt, hold them (hold_sliding=True); beyond a buckling load use a lower load, or neglect the geometric "
    "stiffness (stress_stiffening=False)"
)


def lowest_eigenpairs(
    solver: LinearSolver, matrices: tuple[bsr_array, bsr_array], near_nullspace: Array, free: Mask,
    n: int, shift: float,
) -> tuple[Array, Array]:  # fmt: skip
    """Return the n lowest eigenvalues (n,), ascending, and their vectors (size, n), orthonormal by M.

    Parameters
    ----------
    solver : LinearSolver
    matrices : (bsr_array (size, size), bsr_array (size, size))
        K, with only the diagonal in rows that are not free, and M, whose rows are empty there.
    near_nullspace : ndarray (size, k)
        Near null space of K.
    free : ndarray of bool (size,)
        Unknowns that are free.
    n : int
    shift : float
        s, such that ``K + s M`` is positive definite.

    Raises
    ------
    ModelError
        If ``K + s M`` is not positive definite.
    ConvergenceError
        If the iteration does not converge.
    """
    K, M = matrices
    if free.sum() < max(COARSEST_SIZE, 3 * n):
        return _dense_eigenpairs(K, M, np.flatnonzero(free), n, shift)
    shifted = bsr_array(K + shift * M)
    shifted.sort_indices()
    try:
        solver.prepare(shifted, near_nullspace, np.empty(0, np.intp))
    except ModelError as error:
        raise ModelError(UNSTABLE) from error
    rng = np.random.default_rng(0)
    if isinstance(solver, Multigrid):
        start = rng.normal(size=(len(free), n + n // 2 + 2)) * free[:, None]
        basis = _lobpcg_vectors(solver, shifted, M, start, n)
    else:
        basis = _lanczos_vectors(solver, shifted, M, rng.normal(size=len(free)) * free, n)
    # Ritz pairs in the span of the iterates are more accurate, and their vectors are orthogonal for equal eigenvalues.
    small_K, small_M = basis.T @ (K @ basis), basis.T @ (M @ basis)
    inverse_factor = np.linalg.inv(np.linalg.cholesky(small_M))
    values, vectors = np.linalg.eigh(inverse_factor @ (0.5 * (small_K + small_K.T)) @ inverse_factor.T)
    return values[:n], (basis @ (inverse_factor.T @ vectors))[:, :n]


def _dense_eigenpairs(K: bsr_array, M: bsr_array, free: Indices, n: int, shift: float) -> tuple[Array, Array]:
    """Return the result of `lowest_eigenpairs` for few unknowns `free` (k,), by a dense eigenvalue problem."""
    dense_K, dense_M = (np.asarray(matrix.tocsr()[free][:, free].todense()) for matrix in (K, M))
    try:  # for the inverse eigenvalues, since M may be singular
        inverse, modes = eigh(dense_M, dense_K + shift * dense_M, subset_by_index=[len(free) - n, len(free) - 1])
    except np.linalg.LinAlgError as error:
        raise ModelError(UNSTABLE) from error
    vectors = np.zeros((K.shape[0], n))
    vectors[free] = modes[:, ::-1] / np.sqrt(inverse[::-1])
    return 1.0 / inverse[::-1] - shift, vectors


def _lanczos_vectors(solver: LinearSolver, shifted: bsr_array, M: bsr_array, start: Array, n: int) -> Array:
    """Return n eigenvectors (size, n) by the Lanczos method with a factorised matrix."""
    zero = np.zeros(len(start))
    loaded = solver.load(zero)
    inverse = LinearOperator(shifted.shape, matvec=loaded.full_solution, dtype=float)
    try:
        return np.asarray(eigsh(shifted, n, M, sigma=0.0, OPinv=inverse, v0=loaded.full_solution(M @ start))[1])
    except ArpackNoConvergence as error:
        found = len(error.eigenvalues)
        raise ConvergenceError(f"Lanczos iterations found {found} of {n} modes: request fewer") from error


def _lobpcg_vectors(solver: Multigrid, shifted: bsr_array, M: bsr_array, start: Array, n: int) -> Array:
    """Return at least n eigenvectors (size, k) by LOBPCG with one multigrid cycle as preconditioner."""

    def cycle(residuals: Array) -> Array:
        corrections = np.zeros((residuals.shape[1], residuals.shape[0]))
        for z, residual in zip(corrections, residuals.T, strict=True):
            r = np.ascontiguousarray(residual)
            if norm := float(np.linalg.norm(r)):
                solver.precondition(r, norm, z)
        return corrections.T

    preconditioner = LinearOperator(shifted.shape, lambda r: cycle(r.reshape(-1, 1)).ravel(), matmat=cycle, dtype=float)
    vectors = start
    for _ in range(MAX_ITERATIONS // 20):  # LOBPCG makes 20 iterations by default
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of LOBPCG, that 20 iterations do not reach the tolerance
            values, vectors = lobpcg(shifted, vectors, M, preconditioner, tol=1e-300, largest=False)
        residuals = shifted @ vectors[:, :n] - (M @ vectors[:, :n]) * values[:n]
        # The error is measured by its energy, independent of units; the error of eigenvalues is of second order.
        if (np.einsum("ij,ij->j", residuals, cycle(residuals)) <= TOLERANCE * values[:n]).all():
            return np.asarray(vectors)
    raise ConvergenceError(
        f"{n} modes did not converge in {MAX_ITERATIONS} iterations with multigrid: request fewer, or use "
        'linear_solver="direct" if memory allows'
    )


class Reduced:
    """Motions ``u = T v`` that satisfy the constraints of a system and the additional equations ``rows @ u = 0``.

    Parameters
    ----------
    system : System
        System with supports and multi-point constraints.
    mass : bsr_array (n, n)
        Mass matrix [mass].
    rows : csr_array (m, n)
        Equations, possibly linearly dependent [-].
    nodes : ndarray of int (m,)
        Node of each row, whose unknowns are preferred for elimination.

    Attributes
    ----------
    K, M : bsr_array (n, n)
        Stiffness [force / length] and mass [mass] of v; rows that are not free have only the diagonal in K, and are
        empty in M.
    free : ndarray of bool (n,)
        Components of v that are unknowns.
    """

    def __init__(self, system: System, mass: bsr_array, rows: csr_array, nodes: Indices) -> None:
        n, size = mass.shape[0], mass.blocksize[0]
        free_part = diags_array(system.free.astype(float))
        self._T = csr_array(free_part if system.T is None else system.T @ free_part)
        self.K, self.free = system.matrix, system.free.copy()
        rows_of_unknowns = system.rows(rows, np.zeros(rows.shape[0]), np.zeros(n))[0]
        nonempty = np.flatnonzero(np.diff(rows_of_unknowns.indptr) > 0)
        if len(nonempty):
            pivots, weights = _pivots_and_weights(csr_array(rows_of_unknowns[nonempty]), nodes[nonempty], size)
            self.free[pivots] = False
            projection = substituted(csr_array(diags_array(system.free.astype(float))), pivots, weights)
            K = csr_array(projection.T @ self.K.tocsr() @ projection).tobsr((size, size))
            K.sort_indices()
            self.K, self._T = separate_supports(K, ~self.free)[0], csr_array(self._T @ projection)
        self.M = csr_array(self._T.T @ mass.tocsr() @ self._T).tobsr((size, size))

    def displacement(self, v: Array) -> Array:
        """Return the displacements (n, k) of motions v (n, k) [unit of v]."""
        return np.asarray(self._T @ v)


def _pivots_and_weights(rows: csr_array, nodes: Indices, size: int) -> tuple[Indices, csr_array]:
    """Return the unknowns (p,) that equations (m, n) eliminate, as weighted sums (p, n) of the other unknowns.

    Linearly dependent equations, as at corners where several sides meet, are dropped.
    """
    try:
        elimination = eliminate(rows, np.zeros(rows.shape[0]), None, nodes, size)
    except DependenceError:
        return _pivots_by_qr(rows)
    return elimination.pivots, elimination.full_weights()


def _pivots_by_qr(rows: csr_array) -> tuple[Indices, csr_array]:
    """Return the result of `_pivots_and_weights` for linearly dependent equations, by a dense QR factorisation."""
    columns = np.unique(rows.indices)
    _, R, order = qr(rows[:, columns].toarray(), mode="economic", pivoting=True)
    rank = int((np.abs(np.diag(R)) > LENGTH_ROUND_OFF * abs(R[0, 0])).sum())
    weights, others = csr_array(-solve_triangular(R[:rank, :rank], R[:rank, rank:])), columns[order[rank:]]
    full_weights = csr_array((weights.data, others[weights.indices], weights.indptr), shape=(rank, rows.shape[1]))
    return columns[order[:rank]].astype(np.intp), full_weights
