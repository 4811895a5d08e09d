"""Krylov methods with multigrid as preconditioner, for systems subject to linear equations.

The aggregates and prolongators of the stiffness matrix K are used throughout the analysis. Equations ``B u = c`` are
eliminated, so that all iterates satisfy them. The eliminated unknowns are called pivots. The forces at the pivots are moved
to the other unknowns, and the multigrid hierarchy is changed near the pivots.
"""

from __future__ import annotations

import copy
import logging
from typing import Self

import numpy as np
from scipy.sparse import bsr_array

from fastcontact.arrays import Array, Indices, largest
from fastcontact.errors import ConvergenceError, ModelError
from fastcontact.linear.delassus import InverseColumns, inverse_entries
from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.krylov.iterations import (
    STORED_DIRECTIONS,
    ConjugateGradients,
    ConjugateResiduals,
    Iteration,
    Multiply,
    Precondition,
    scaled,
)
from fastcontact.linear.multigrid.border import Border
from fastcontact.linear.multigrid.constrained_hierarchy import ConstrainedHierarchy
from fastcontact.linear.multigrid.hierarchy import Hierarchy
from fastcontact.linear.multigrid.matrix import ScaledMatrix
from fastcontact.linear.multigrid.reduced import ReducedOperator, multiplier
from fastcontact.linear.protocol import MILD_CONTRAST, TOLERANCE, Counters, Monitor
from fastcontact.linear.springs import MAX_DIFFERENCE, Springs

log = logging.getLogger("fastcontact")
# Largest number of iterations of a linear solution. The hardest case of `fastcontact bench robustness` (nu = 0.4999,
# 161 442 unknowns) takes 295.
MAX_ITERATIONS = 1000
# Largest number of columns of K^-1 that are computed, each as the solution of one linear system. For more columns, a
# factorisation is cheaper.
MAX_COLUMNS = 300
# Number of iterations between two calls of a monitor. With 10, "tet4" takes 21 iterations (15 with 2).
MONITOR_INTERVAL = 2
# Number of iterations before the first call of a monitor if `_contrast` is large, because the errors of soft parts are not
# known earlier. The benchmark "nu 0.499" takes 123 iterations, and 132 with the first call after two iterations.
FIRST_MONITOR_WITH_CONTRAST = 6
# Largest admissible ratio of the estimated relative error of the displacements to the tolerance of the residual. It is
# exceeded only if bodies differ in stiffness: forces in the stiff body then dominate the residual, and the soft body
# converges later.
DISPLACEMENT_ERROR = 3e3
# Cost of changing the hierarchy, including the elimination of equations, in units of one iteration. Building a new hierarchy
# costs about as much.
COST_OF_CHANGE = 15
# Even if the initial guess of a nonsymmetric system satisfies the tolerance, the iteration continues until the residual has
# fallen by the factor WARM_REDUCTION, or to WARM_RESIDUAL times the tolerance. At most MAX_WARM_ITERATIONS are performed
# after the tolerance has been reached: with one, "aspect ratio 20" takes 18 pairings (9 with 10); without such iterations,
# the residual of "modulus ratio 0.0001" with friction is 8e-7 (5e-9 with 10; `fastcontact bench robustness`, 3 000
# unknowns). If
# equations stiffen nodes strongly, this number is doubled, up to STORED_DIRECTIONS, each time the residual of an initial
# guess exceeds WARM_REDUCTION times that of the previous initial guess.
WARM_REDUCTION, WARM_RESIDUAL, MAX_WARM_ITERATIONS = 0.05, 1e-3, 10
# If the smoother amplifies a vector, the upper bounds of the eigenvalues are multiplied by BOUND_FACTOR, at most MAX_RAISES
# times.
BOUND_FACTOR, MAX_RAISES = 1.3, 4


class StallError(ConvergenceError):
    """Raised if the iteration does not reach its tolerance."""


class TooManyIterationsError(StallError):
    """Raised if the iterations exceed the work limit, above which another solution method is cheaper."""


class Multigrid:
    """Krylov methods with smoothed-aggregation multigrid as preconditioner.

    Symmetric systems are solved by conjugate gradients, nonsymmetric and bordered ones by conjugate residuals.

    Parameters
    ----------
    tolerance : float
        Tolerance of the 2-norm of the residual, relative to the 2-norm of the right-hand side [-].
    precision : {"single", "double"}
        Precision of the multigrid cycle. The outer iteration always uses double precision.

    Attributes
    ----------
    contrast : float
        See `LinearSolver`.
    work : int
        Number of iterations so far, plus COST_OF_CHANGE for each change of the hierarchy.
    work_limit : int, optional
        Largest `work`; None means unlimited.

    Raises
    ------
    ModelError
        If the precision is neither "single" nor "double".
    """

    K: ScaledMatrix

    def __init__(self, tolerance: float = TOLERANCE, precision: str = "single") -> None:
        if precision not in ("single", "double"):
            raise ModelError(f"the precision of the multigrid cycle is 'single' or 'double', not '{precision}'")
        self.tolerance, self.precision = tolerance, precision
        self.counters = Counters()
        self.contrast = 1.0
        self.work = 0
        self.work_limit: int | None = None
        # Hierarchy of an earlier matrix, whose coarser levels the next hierarchy reuses, and whether the current hierarchy
        # reuses coarser levels.
        self._earlier_hierarchy: Hierarchy | None = None
        self._reuses_coarse_levels = False
        # Whether coarser levels may be reused; the list is shared by all copies.
        self._may_reuse_levels = [True]
        self.reset_warm_starts()

    def reset_warm_starts(self) -> None:
        """Reset the statistics of warm starts for a new load step."""
        # Largest number of warm iterations, and initial residual norm of the last solution if it stopped at this number.
        self._max_warm_iterations, self._unfinished_norm = MAX_WARM_ITERATIONS, np.inf
        # Change of displacements in an iteration, divided by the decrease of the residual.
        self._change_per_residual = np.inf

    @property
    def nbytes(self) -> int:
        """Memory of the hierarchy and of the vectors of the iteration, without K [bytes]."""
        return self.hierarchy.nbytes + self._cg.nbytes + (self._residuals.nbytes if self._residuals is not None else 0)

    def build(self, K: bsr_array, rigid_modes: Array, release: bool = False) -> None:
        """Build the hierarchy of K (n, n); see `LinearSolver.prepare`."""
        n, earlier = K.shape[0], self._earlier_hierarchy
        self.K = ScaledMatrix(K, self.precision, release, None if earlier is None else self.K)
        self._modes = rigid_modes.astype(np.float32)  # for `rebuild`; single precision suffices
        self._cg = ConjugateGradients(n)
        self._residuals: ConjugateResiduals | None = None
        self._diagonal: Array | None = None
        self._build(rigid_modes, earlier)
        self.columns = InverseColumns(n, self._inverse_entries, MAX_COLUMNS)

    def copy_for_similar_matrix(self) -> Self:
        """Return a copy, to be prepared for a similar matrix, whose hierarchy will reuse the coarser levels.

        Once the iteration converges slowly with reused levels, all hierarchies are built anew.
        """
        new = copy.copy(self)
        new._earlier_hierarchy = self.hierarchy if self._may_reuse_levels[0] else None
        return new

    def _build(self, rigid_modes: Array, earlier: Hierarchy | None = None) -> None:
        """Build the hierarchy of the stored matrix, if possible with the coarser levels of an `earlier` hierarchy."""
        renewed, self._earlier_hierarchy = None if earlier is None else earlier.renewed(self.K.scaled), None
        self._reuses_coarse_levels = renewed is not None
        self.hierarchy = Hierarchy(self.K.scaled, rigid_modes) if renewed is None else renewed
        self._constrained = ConstrainedHierarchy(self.hierarchy, self.K.scaled)
        # Equations and springs of the current iteration, and those for which the hierarchy was last changed.
        self._reduced = ReducedOperator(self.K, None)
        self._hierarchy_equations: Elimination | None = None
        self._hierarchy_springs: Springs | None = None
        self.counters.setups += 1

    def _build_anew(self) -> None:
        """Build all levels of the hierarchy, now and for all later matrices."""
        self._may_reuse_levels[0], reduced = False, self._reduced
        self._build(self._modes.astype(float))
        self._add_work(COST_OF_CHANGE)
        self.constrain(reduced.elimination, reduced.springs)

    def rebuild(self, precision: str) -> None:
        """Rebuild the hierarchy in a different precision."""
        self.precision = precision
        del self._constrained, self.hierarchy  # so that there are never two hierarchies in memory
        self.K.convert(precision)
        self._build(self._modes.astype(float))

    def _inverse_entries(self, rows: Indices, columns: Indices) -> Array:
        """Return the entries of ``K^-1`` in some `rows` (m,) and `columns` (k,), shape (m, k) [length / force]."""
        return inverse_entries(self.K.shape[0], lambda f: self.solution(f, None, None), rows, columns)

    def constrain(self, elimination: Elimination | None, springs: Springs | None = None) -> None:
        """Set the equations and springs of the iteration, and change the hierarchy accordingly.

        If the pivots are the same and the weights nearly the same, the hierarchy is kept, because it is an equally good
        preconditioner. For coupled pivots, the hierarchy uses sparse weights, see `Elimination.with_sparse_weights`.
        """
        if elimination is not self._reduced.elimination or springs is not self._reduced.springs:
            sparse = elimination and elimination.with_sparse_weights()
            old_springs = self._hierarchy_springs
            same_springs = old_springs is None if springs is None else springs.is_similar(old_springs)
            if not (same_springs and _nearly_equal(sparse, self._hierarchy_equations, self._constrained.stiffening)):
                self._change_hierarchy(sparse, springs)
                self._add_work(COST_OF_CHANGE)
            compliant = elimination is not None and elimination.compliance is not None
            self._reduced = ReducedOperator(self.K, elimination, springs, self.diagonal() if compliant else None)

    def _change_hierarchy(self, sparse: Elimination | None, springs: Springs | None) -> None:
        """Change the hierarchy for equations with sparse weights, and for springs."""
        self._constrained.constrain(sparse, None if springs is None else springs.scaled(self.K.scale))
        self._hierarchy_equations, self._hierarchy_springs = sparse, springs

    def solution(
        self, f: Array, elimination: Elimination | None, guess: Array | None, monitor: Monitor | None = None,
        tolerance: float | None = None, springs: Springs | None = None,
    ) -> Array:  # fmt: skip
        """Return the solution (n,) [length] of ``(K + S) u = f`` subject to the equations of `elimination`.

        Parameters
        ----------
        f : ndarray (n,)
            Right-hand side [force].
        elimination : Elimination or None
        guess : ndarray (n,) or None
            Initial guess; zero if None [length].
        monitor : callable, optional
            See `linear.protocol.Monitor`.
        tolerance : float, optional
            Relative residual at which the iteration stops. Values below the tolerance of the solver have no effect [-].
        springs : Springs, optional
            Springs with the matrix S (n, n); none by default.

        Raises
        ------
        ConvergenceError
            If the residual does not fall below the tolerance.
        """
        cg = self._cg
        scale = self._scale(f, elimination)
        if scale == 0.0:  # no loads
            return np.zeros_like(f)
        self.constrain(elimination, springs)
        cg.x[:] = 0.0 if guess is None else guess
        self._start(cg, f)
        limit = self._stopping_residual(tolerance or 0.0)
        count, attempts = 0, 0
        first_monitor = MONITOR_INTERVAL if self._contrast <= MILD_CONTRAST else FIRST_MONITOR_WITH_CONTRAST
        while not self._done(cg, limit, scale):
            if self._reuses_coarse_levels and count >= COST_OF_CHANGE:
                self._build_anew()
                self._start(cg, f)
            unconverged = cg.norm > limit * scale
            if count >= MAX_ITERATIONS or attempts > MAX_RAISES:
                if not unconverged:
                    break
                raise StallError(
                    f"conjugate gradients stall at a relative residual of {cg.norm / scale:.1e} after {count} iterations, "
                    f'above {self.tolerance:.1e}: use linear_solver="direct", which takes more memory, or look for thin or '
                    "nearly incompressible parts, and for cells of very different sizes"
                )
            if monitor is not None and unconverged and count >= first_monitor and count % MONITOR_INTERVAL == 0:
                u = self._reduced.displacement(cg.x)
                if monitor(u, self._reduced.multiplier(u, f), self._contrast * cg.norm / scale):
                    break
            if cg.step(self._reduced.multiply, self.precondition):
                count += 1
                self._count()
            else:
                attempts += 1
                self._make_definite(attempts)
                self._start(cg, f)
        return self._reduced.displacement(cg.x).copy()

    def nonsymmetric_solution(
        self, f: Array, elimination: Elimination | None, springs: Springs | None, guess: Array, tolerance: float
    ) -> Array:
        """Return the solution u (n,) [length] of ``K u + S u = f + F.T multiplier`` and ``B u = c``.

        In sliding contact, the gap stays closed, but the contact force also has a tangential component, so that F differs
        from B. The pivots are eliminated as in frictionless contact, but the forces at the pivots are moved to the other
        unknowns according to F. Therefore, the reduced matrix is not symmetric. The hierarchy for F = B preconditions it.

        Parameters
        ----------
        f : ndarray (n,)
            Right-hand side [force].
        elimination : Elimination or None
            Elimination of the equations ``B u = c``, with force weights according to F.
        springs : Springs or None
            Springs with the matrix S (n, n).
        guess : ndarray (n,)
            Initial guess [length].
        tolerance : float
            Relative residual at which the iteration stops. Values below the tolerance of the solver have no effect [-].

        Raises
        ------
        StallError
            If the residual does not fall below the tolerance.
        """
        if self._reuses_coarse_levels:
            self._build_anew()
        if self._residuals is None:
            self._residuals = ConjugateResiduals(len(f))
        iteration = self._residuals
        scale = self._scale(f, elimination)
        self.constrain(elimination, springs)
        limit = self._stopping_residual(tolerance)
        iteration.x[:] = guess
        self._start(iteration, f)
        # If some parts are much stiffer than others, the tolerance of the solver permits large errors in the soft parts,
        # which later pairings would reduce only slowly.
        target_norm = tolerance / self._contrast * scale
        self._iterate(iteration, limit, scale, self._reduced.multiply, self.precondition, target_norm)
        return self._reduced.displacement(iteration.x).copy()

    def bordered_solution(
        self, f: Array, elimination: Elimination | None, springs: Springs | None, border: Border,
        guess: Array | None, start: Array, tolerance: float | None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Solve ``K u + S u = f + G.T multiplier``, ``G u + C multiplier = d`` and the equations of `elimination`.

        Parameters
        ----------
        f, elimination, springs, guess, tolerance
            See `solution`.
        border : Border
            The equations that are not eliminated, with G (e, n), C (e, e) and d (e,).
        start : ndarray (e,)
            Initial guess of the multipliers of the border [force].

        Returns
        -------
        u : ndarray (n,)
            Displacements [length].
        multiplier : ndarray (e,)
            Multipliers of the equations of the border [force].

        Raises
        ------
        StallError
            If the residual does not fall below the tolerance.
        """
        if self._reuses_coarse_levels:
            self._build_anew()
        n = len(f)
        iteration = ConjugateResiduals(n + len(border))
        scale = self._scale(f, elimination)
        self.constrain(elimination, springs)
        border.prepare(self.diagonal())
        if guess is not None:
            iteration.x[:n] = guess
        x, r, iteration.x[n:] = iteration.x[:n], iteration.r[:n], start
        self._reduced.begin(x, f + border.rows.T @ start, r)
        iteration.r[n:] = border.stiffness * (border.rhs - border.rows @ x - border.compliance @ start)
        iteration.start()

        def move_forces(forces: Array) -> None:
            if elimination is not None:
                elimination.move_forces(forces)

        multiply = border.product(self._reduced.multiply, move_forces)
        limit, precondition = self._stopping_residual(tolerance or 0.0), border.preconditioner(self.precondition)
        self._iterate(iteration, limit, scale, multiply, precondition)
        return x.copy(), iteration.x[n:].copy()

    def _iterate(
        self, iteration: ConjugateResiduals, tolerance: float, scale: float, multiply: Multiply,
        precondition: Precondition, target_norm: float = np.inf,
    ) -> None:  # fmt: skip
        """Iterate until the residual is at most the `tolerance` times `scale` [force].

        An initial guess may satisfy this tolerance although the forces in a small contact area are still inaccurate. Some
        further iterations are therefore performed, see WARM_REDUCTION. Within the same limits, they continue until the norm
        of the residual has fallen to `target_norm`.
        """
        limit = tolerance * scale
        count, target = 0, max(min(limit, WARM_REDUCTION * iteration.norm, target_norm), WARM_RESIDUAL * limit)
        initial_norm = iteration.norm
        if initial_norm > WARM_REDUCTION * self._unfinished_norm and self._constrained.stiffening > MILD_CONTRAST:
            self._max_warm_iterations = min(2 * self._max_warm_iterations, STORED_DIRECTIONS)
        self._unfinished_norm = np.inf
        while not (done := self._done(iteration, tolerance, scale)) or iteration.norm > target:
            if done and count >= self._max_warm_iterations:
                self._unfinished_norm = initial_norm
                return
            if count >= MAX_ITERATIONS or not iteration.step(multiply, precondition):
                if iteration.norm <= limit:
                    return
                excess = iteration.norm / limit
                raise StallError(f"conjugate residuals stall at {excess:.1e} times the tolerance after {count} steps")
            count += 1
            self._count()

    def _done(self, iteration: Iteration, tolerance: float, scale: float) -> bool:
        """Return whether the residual is at most `tolerance` times `scale`, and whether the displacements have converged.

        The displacements are examined only at the tolerance of the solver. A residual that is small relative to the forces in
        a stiff body may exceed all forces in a soft body.
        """
        if iteration.norm > tolerance * scale:
            return False
        n = self.K.shape[0]
        self._change_per_residual = iteration.change_per_residual(n) or self._change_per_residual
        if tolerance > self.tolerance or not iteration.norm:
            return True
        error = self._change_per_residual * iteration.norm
        return error <= DISPLACEMENT_ERROR * self.tolerance * largest(iteration.x[:n])

    def _count(self) -> None:
        """Count one iteration."""
        self.counters.iterations += 1
        self._add_work(1)

    def _add_work(self, iterations: int) -> None:
        """Add a number of iterations to `work`; raise TooManyIterationsError if it exceeds `work_limit`."""
        self.work += iterations
        if self.work_limit is not None and self.work > self.work_limit:
            raise TooManyIterationsError(f"the iterations exceed the work limit of {self.work_limit}")

    def diagonal(self) -> Array:
        """Return the diagonal (n,) of K [force / length]."""
        if self._diagonal is None:  # computed on demand, because only friction and compliances need it
            self._diagonal = self.K.diagonal()
        return self._diagonal

    def _make_definite(self, attempt: int) -> None:
        """Make the preconditioner positive definite, by larger bounds or, in the last attempt, by double precision."""
        if self._reuses_coarse_levels:
            self._build_anew()
            return
        if attempt < MAX_RAISES or self.precision == "double":
            self.hierarchy.bounds = [BOUND_FACTOR * bound for bound in self.hierarchy.bounds]
            return
        log.info("multigrid: single precision is insufficient for this matrix; the cycle continues in double precision")
        reduced = self._reduced
        self.rebuild("double")
        self.constrain(reduced.elimination, reduced.springs)

    def _start(self, iteration: Iteration, f: Array) -> None:
        """Make the iterate satisfy the equations, and compute its residual."""
        self._reduced.begin(iteration.x, f, iteration.r)
        iteration.start()

    def _scale(self, f: Array, elimination: Elimination | None) -> float:
        """Return the 2-norm of the right-hand side, including forces due to the offsets of eliminated unknowns [force]."""
        square = self._cg.dot(f, f)
        if elimination is not None and elimination.offset.any():
            forces = self.K.forces_of(elimination.pivots, elimination.offset)
            square += self._cg.dot(forces, forces)
        return float(np.sqrt(square))

    def _stopping_residual(self, tolerance: float) -> float:
        """Return the relative residual [-] at which the iteration stops if the caller requests `tolerance`.

        The result is not smaller than the tolerance of the solver.
        """
        return max(self.tolerance, tolerance / self._contrast)

    @property
    def _contrast(self) -> float:
        """Factor by which relative errors of displacements may exceed relative residuals [-].

        This factor is due to the stiffening of soft bodies by equations and to the contrast within cells, see `LinearSolver`.
        """
        return max(1.0, self._constrained.stiffening) * (self.contrast if self.contrast > MILD_CONTRAST else 1.0)

    def precondition(self, r: Array, norm: float, z: Array) -> None:
        """Fill z (n,) with an approximate solution for r (n,) that satisfies the equations; `norm` is the 2-norm of r."""
        self._reduced.precondition(r, norm, z, self._cycle)

    def _cycle(self, r: Array, norm: float, z: Array) -> None:
        """Fill z (n,) with the result of one V-cycle for r (n,), which is divided by its 2-norm to fit single precision."""
        finest = self.hierarchy.levels[0]
        scaled(1.0 / norm, r, finest.b)
        self.hierarchy.cycle()
        scaled(norm * self.K.scale, finest.x, z)

    def multiplier(self, elimination: Elimination | None, u: Array, f: Array, springs: Springs | None = None) -> Array:
        """Return the multipliers (m,) of the equations [force] at the displacements `u` (n,), see `reduced.multiplier`."""
        return multiplier(self.K, elimination, springs, u, f)


def _nearly_equal(new: Elimination | None, old: Elimination | None, stiffening: float) -> bool:
    """Return whether two eliminations have the same pivots and nearly the same weights.

    If the body of the pivots is stiffer than the other body by the factor `stiffening`, a difference d of the weights
    increases the energy of displacements of the softer body by the factor ``stiffening d^2``.
    """
    if new is None or old is None or not np.array_equal(new.pivots, old.pivots):
        return new is old
    difference = float(np.abs((new.weights - old.weights).data).max(initial=0.0))
    return difference <= MAX_DIFFERENCE / np.sqrt(max(1.0, stiffening))
