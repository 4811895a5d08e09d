"""Conjugate gradients preconditioned by multigrid, with the rigid-body modes as near null space.

Aggregates and prolongators are those of K and are used in the whole analysis. Equations ``B u = c`` are eliminated: the
iterates satisfy them, forces at the eliminated unknowns, the pivots, are moved to the other unknowns, and the hierarchy is
updated near the pivots.
"""

from __future__ import annotations

import logging

import numpy as np
from scipy.sparse import bsr_array

from fastcontact.arrays import Array
from fastcontact.errors import ConvergenceError, ModelError
from fastcontact.linear.delassus import InverseColumns
from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.krylov.iterations import (
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
from fastcontact.linear.multigrid.reduced import Reduced, multiplier
from fastcontact.linear.protocol import MILD, TOLERANCE, Counters, Monitor
from fastcontact.linear.springs import Springs

log = logging.getLogger("fastcontact")
MAX_ITERATIONS = 1000
# Number of columns of K^-1, one solution each, up to which they cost less than a factorisation.
MOST_COLUMNS = 300
# Iterations between two calls of a monitor.
WATCH_EVERY = 2
# Iterations before the first call where contrasts are large: after fewer, errors of soft parts are unknown.
WATCH_CONTRAST_FROM = 6
# Equations with the same pivots whose weights differ by less than this share a hierarchy.
ALIKE = 0.02
# Cost of an update of the hierarchy, including the elimination of its equations, in iterations.
CHANGE = 15
# A warm start of a nonsymmetric solution is improved by the first factor, but at most to the second fraction of its
# tolerance, and by at most this many iterations once the tolerance is met. With much stiffer pivots the number is
# doubled, up to LONGEST_WARM, each time that the next start is not better by STOOD.
WARM, WARM_LEAST, MOST_WARM = 0.05, 1e-3, 10
STOOD, LONGEST_WARM = 0.2, 40
# If the smoother amplifies a vector, its bound of the spectrum is raised by the first number, at most as often as the
# second.
RAISE, RAISES = 1.3, 4


class StallError(ConvergenceError):
    """The iteration does not reach its tolerance."""


class TooManyIterationsError(StallError):
    """The work done so far costs more than another solution method."""


class Multigrid:
    """Smoothed-aggregation multigrid as preconditioner of conjugate gradients.

    Parameters
    ----------
    tolerance : float
        The residual is reduced below this fraction of the right-hand side (2-norms).
    precision : {"single", "double"}
        Precision of the multigrid cycle; the outer iteration is in double precision.

    Attributes
    ----------
    contrast
        See `LinearSolver`.
    work : int
        Iterations so far, with updates of the hierarchy converted to iterations.
    allowed : int, optional
        Largest work; None for unlimited.

    Raises
    ------
    ModelError
        If there is no such precision.
    """

    def __init__(self, tolerance: float = TOLERANCE, precision: str = "single") -> None:
        if precision not in ("single", "double"):
            raise ModelError(f"the precision of the multigrid cycle is 'single' or 'double', not '{precision}'")
        self.tolerance, self.precision = tolerance, precision
        self.counters = Counters()
        self.contrast = 1.0
        self.work = 0
        self.allowed: int | None = None
        self.begin()

    def begin(self) -> None:
        """Reset the statistics of warm starts for a new load step."""
        self._most_warm, self._cut_short = MOST_WARM, np.inf

    @property
    def nbytes(self) -> int:
        """Memory of the hierarchy and the work space, without K [bytes]."""
        return self.hierarchy.nbytes + self._cg.nbytes + (self._residuals.nbytes if self._residuals is not None else 0)

    def build(self, K: bsr_array, rigid_modes: Array, release: bool = False) -> None:
        """Build the hierarchy of K (n, n); see `LinearSolver.prepare`."""
        n = K.shape[0]
        self.K = ScaledMatrix(K, self.precision, release)
        self._modes = rigid_modes.astype(np.float32)  # for a second set-up: single precision suffices
        self._cg = ConjugateGradients(n)
        self._residuals: ConjugateResiduals | None = None
        self._diagonal: Array | None = None
        self._build(rigid_modes)
        self.columns = InverseColumns(n, self._solve_many, MOST_COLUMNS)

    def _build(self, rigid_modes: Array) -> None:
        self.hierarchy = Hierarchy(self.K.scaled, rigid_modes)
        self._constrained = ConstrainedHierarchy(self.hierarchy, self.K.scaled)
        # The current equations and springs, and those of the hierarchy.
        self._reduced = Reduced(self.K, None)
        self._hierarchy_equations: Elimination | None = None
        self._hierarchy_springs: Springs | None = None
        self.counters.setups += 1

    def build_in(self, precision: str) -> None:
        """Rebuild the hierarchy in another precision."""
        self.precision = precision
        del self._constrained, self.hierarchy  # avoids two hierarchies in memory
        self.K.change(precision)
        self._build(self._modes.astype(float))

    def _solve_many(self, F: Array) -> Array:
        return np.column_stack([self.solution(np.ascontiguousarray(f), None, None) for f in F.T])

    def constrain(self, elimination: Elimination | None, springs: Springs | None = None) -> None:
        """Change the hierarchy to that of the eliminated matrix, `springs` included.

        A hierarchy for the same pivots with nearly the same weights is kept: it preconditions equally well, since only the
        neighbourhood of the pivots matters. Coupled pivots have sparse weights there.
        """
        if elimination is not self._reduced.elimination or springs is not self._reduced.springs:
            sparse = elimination and elimination.with_sparse_weights()
            known = self._hierarchy_springs
            alike = known is None if springs is None else springs.alike(known)
            if not (alike and _alike(sparse, self._hierarchy_equations)):
                self._change_hierarchy(sparse, springs)
                self._worked(CHANGE)
            compliant = elimination is not None and elimination.compliance is not None
            self._reduced = Reduced(self.K, elimination, springs, self.diagonal() if compliant else None)

    def _change_hierarchy(self, sparse: Elimination | None, springs: Springs | None) -> None:
        """Change the hierarchy to that under equations with sparse weights and springs."""
        self._constrained.constrain(sparse, None if springs is None else springs.scaled(self.K.unit))
        self._hierarchy_equations, self._hierarchy_springs = sparse, springs

    def solution(
        self, f: Array, elimination: Elimination | None, guess: Array | None, monitor: Monitor | None = None,
        tolerance: float | None = None, springs: Springs | None = None,
    ) -> Array:  # fmt: skip
        """Solve ``K u = f``, `springs` added to K, under the equations of `elimination`.

        The residual is reduced to the solver's tolerance, or to a larger one.

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
        self._begin(cg, f)
        enough = self._enough(tolerance or 0.0) * scale
        made, raised = 0, 0
        watched_from = WATCH_EVERY if self._contrast <= MILD else WATCH_CONTRAST_FROM
        while cg.norm > enough:
            if made >= MAX_ITERATIONS or raised > RAISES:
                raise StallError(
                    f"conjugate gradients stall at a relative residual of {cg.norm / scale:.1e} after {made} iterations, "
                    f"above {self.tolerance:.1e}: use the direct solver, or look for near-incompressible or thin parts"
                )
            if monitor is not None and made >= watched_from and made % WATCH_EVERY == 0:
                u = self._reduced.displacement(cg.x)
                if monitor(u, self._reduced.multiplier(u, f), self._contrast * cg.norm / scale):
                    break
            if cg.step(self._reduced.multiply, self.precondition):
                made += 1
                self._count()
            else:
                raised += 1
                self._strengthen(raised)
                self._begin(cg, f)
        return self._reduced.displacement(cg.x).copy()

    def nonsymmetric_solution(
        self, f: Array, elimination: Elimination | None, springs: Springs | None, guess: Array, tolerance: float
    ) -> Array:
        """Solve ``K u + S u = f + F.T multiplier`` and ``B u = c``, F the rows that multipliers act through.

        A sliding contact keeps its gap closed, but its force also has a tangential component. Unknowns are eliminated as
        without friction, forces move along the rows F; the reduced matrix is not symmetric. The hierarchy of the
        equations and springs without F preconditions it.

        Parameters
        ----------
        f : ndarray (n,)
            [force]
        elimination : Elimination or None
        springs : Springs or None
            S is their matrix.
        guess : ndarray (n,)
            [length]
        tolerance : float
            Relative residual, where larger than the solver's own.

        Raises
        ------
        StallError
            If the residual does not fall below the tolerance.
        """
        if self._residuals is None:
            self._residuals = ConjugateResiduals(len(f))
        iteration = self._residuals
        scale = self._scale(f, elimination)
        self.constrain(elimination, springs)
        enough = self._enough(tolerance) * scale
        iteration.x[:] = guess
        self._begin(iteration, f)
        # With much stiffer parts the solver's own tolerance leaves errors that pairings would reduce one by one.
        aim = tolerance / self._contrast * scale
        self._reduce(iteration, enough, self._reduced.multiply, self.precondition, aim)
        return self._reduced.displacement(iteration.x).copy()

    def bordered_solution(
        self, f: Array, elimination: Elimination | None, springs: Springs | None, border: Border,
        guess: Array | None, start: Array, tolerance: float | None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Solve ``K u + S u = f + G.T multiplier`` and ``G u + C multiplier = d`` under the equations of `elimination`.

        G, C and d are those of the border; returns u (n,) and its multipliers (e,), which begin at `start`. See
        `nonsymmetric_solution` for the others.

        Raises
        ------
        StallError
            If the residual does not fall below the tolerance.
        """
        n = len(f)
        iteration = ConjugateResiduals(n + len(border))
        scale = self._scale(f, elimination)
        self.constrain(elimination, springs)
        border.prepare(self.diagonal())
        if guess is not None:
            iteration.x[:n] = guess
        x, r, iteration.x[n:] = iteration.x[:n], iteration.r[:n], start
        self._reduced.begin(x, f + border.rows.T @ start, r)
        iteration.r[n:] = border.stiffness * (border.right - border.rows @ x - border.compliance @ start)
        iteration.start()

        def move_forces(forces: Array) -> None:
            if elimination is not None:
                elimination.move_forces(forces)

        multiply = border.multiply(self._reduced.multiply, move_forces)
        self._reduce(
            iteration, self._enough(tolerance or 0.0) * scale, multiply, border.precondition(self.precondition)
        )
        return x.copy(), iteration.x[n:].copy()

    def _reduce(
        self, iteration: ConjugateResiduals, enough: float, multiply: Multiply, precondition: Precondition,
        aim: float = np.inf,
    ) -> None:  # fmt: skip
        """Iterate until the residual is `enough` [force]; a warm start is improved further, to `aim` if that is smaller.

        It may satisfy the tolerance while the forces of a small contact are still inaccurate.
        """
        made, wanted = 0, max(min(enough, WARM * iteration.norm, aim), WARM_LEAST * enough)
        begun = iteration.norm
        if begun > STOOD * self._cut_short and self._constrained.stiffening > MILD:
            self._most_warm = min(2 * self._most_warm, LONGEST_WARM)
        self._cut_short = np.inf
        while iteration.norm > wanted:
            done = iteration.norm <= enough
            if done and made >= self._most_warm:
                self._cut_short = begun
                return
            if made >= MAX_ITERATIONS or not iteration.step(multiply, precondition):
                if done:
                    return
                left = iteration.norm / enough
                raise StallError(f"conjugate residuals stall at {left:.1e} times the tolerance after {made} iterations")
            made += 1
            self._count()

    def _count(self) -> None:
        self.counters.iterations += 1
        self._worked(1)

    def _worked(self, iterations: int) -> None:
        self.work += iterations
        if self.allowed is not None and self.work > self.allowed:
            raise TooManyIterationsError("the work allowed is done")

    def diagonal(self) -> Array:
        """Return the diagonal (n,) of K."""
        if self._diagonal is None:  # only needed with friction
            self._diagonal = self.K.diagonal()
        return self._diagonal

    def _strengthen(self, times: int) -> None:
        """Make the preconditioner positive definite again: with higher bounds, at last in double precision."""
        if times < RAISES or self.precision == "double":
            self.hierarchy.raise_bounds(RAISE)
            return
        log.info("multigrid: single precision is not enough for this matrix, the cycle continues in double precision")
        reduced = self._reduced
        self.build_in("double")
        self.constrain(reduced.elimination, reduced.springs)

    def _begin(self, iteration: Iteration, f: Array) -> None:
        """Make the iterate satisfy the equations, and compute its residual."""
        self._reduced.begin(iteration.x, f, iteration.r)
        iteration.start()

    def _scale(self, f: Array, elimination: Elimination | None) -> float:
        """Return the norm of the right-hand side, constraint forces included."""
        square = self._cg.dot(f, f)
        if elimination is not None and elimination.offset.any():
            moved = np.zeros(len(f))
            moved[elimination.pivots] = elimination.offset
            forces = self.K @ moved
            square += self._cg.dot(forces, forces)
        return float(np.sqrt(square))

    def _enough(self, tolerance: float) -> float:
        """Return the relative residual to reach: `tolerance`, but not less than the solver's own."""
        return max(self.tolerance, tolerance / self._contrast)

    @property
    def _contrast(self) -> float:
        """Factor by which relative errors may exceed residuals: in softer bodies beside stiffer pivots, and in shear."""
        return max(1.0, self._constrained.stiffening) * (self.contrast if self.contrast > MILD else 1.0)

    def precondition(self, r: Array, norm: float, z: Array) -> None:
        """Fill z (n,) with an approximate solution for r (n,), of 2-norm `norm`, that satisfies the equations."""
        self._reduced.precondition(r, norm, z, self._cycle)

    def _cycle(self, r: Array, norm: float, z: Array) -> None:
        top = self.hierarchy.levels[0]
        scaled(1.0 / norm, r, top.b)
        self.hierarchy.cycle()
        scaled(norm * self.K.unit, top.x, z)

    def multiplier(self, elimination: Elimination | None, u: Array, f: Array, springs: Springs | None = None) -> Array:
        """Return the multipliers (m,) of the equations at the displacement `u`."""
        return multiplier(self.K, elimination, springs, u, f)


def _alike(new: Elimination | None, old: Elimination | None) -> bool:
    """Return whether two eliminations have the same pivots and nearly the same weights."""
    if new is None or old is None or not np.array_equal(new.pivots, old.pivots):
        return new is old
    return bool(np.abs((new.weights - old.weights).data).max(initial=0.0) <= ALIKE)
