"""A right-hand side for multigrid, solved for under equations some of which give way by themselves.

An equation with a compliance of its own is a spring along its row. Springs not much stiffer than the body become part of the
matrix and of the hierarchy; stiffer ones are eliminated like equations that do not give way, see `reduced`.
"""

from __future__ import annotations

import dataclasses
import logging
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fastcontact.linear.elimination.elimination import Elimination, eliminate
from fastcontact.linear.elimination.loaded import LoadedIteration
from fastcontact.linear.elimination.pivot_order import RepeatedError
from fastcontact.linear.protocol import FrictionTerms, Monitor
from fastcontact.linear.springs import Springs

log = logging.getLogger("fastcontact")
Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
# Equations whose own stiffness is more than so many times that of the unknowns they act on are eliminated: as springs they
# take half as many iterations again there, and the root of the ratio as many beyond. The second where pivots are coupled,
# whose weights are nearly right only.
STIFF, STIFF_COUPLED = 10.0, 300.0


class LoadedMultigrid(LoadedIteration):
    """See `LoadedIteration`; its solver is a `Multigrid`."""

    def solve(
        self, B: csr_array, c: Array, C: Array | None = None, guess: Array | None = None,
        monitor: Monitor | None = None, tolerance: float | None = None, nodes: NDArray[np.intp] | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """See `Loaded`: equations with a full compliance, and those that repeat each other, go through columns of K^-1."""
        parts = None
        if C is not None and C.ndim == 1 and len(c):
            try:
                parts = self._parts(B, c, C, nodes)
            except RepeatedError as repeated:
                log.info("%s: their compliance is formed", repeated)
        if parts is None:
            return super().solve(B, c, C, guess, monitor, tolerance, nodes)
        return self._solved(parts, c, guess, monitor, tolerance)

    def diagonal(self) -> Array:
        """See `LoadedNonsymmetric`."""
        return np.asarray(self._solver.diagonal())

    def solve_nonsymmetric(
        self, B: csr_array, c: Array, nodes: NDArray[np.intp], guess: Array, tolerance: float,
        friction: FrictionTerms | None = None, C: Array | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """See `LoadedNonsymmetric`."""
        parts = self._parts(B, c, C, nodes, None if friction is None else friction.rows)
        if friction is None:
            return self._solved(parts, c, guess, None, tolerance)
        solver, elimination, springs = self._solver, parts.elimination, parts.springs
        springs = friction.springs if springs is None else springs.beside(friction.springs)
        f = self._f if friction.forces is None else self._f + friction.forces
        f = parts.pushed(f, c)
        u = solver.nonsymmetric_solution(f, elimination, springs, guess, tolerance)
        return u, parts.multiplier(u, solver.multiplier(elimination, u, f, springs), c)

    def _solved(
        self, parts: _Parts, c: Array, guess: Array | None, monitor: Monitor | None, tolerance: float | None
    ) -> tuple[Array, Array]:
        """Return u and multipliers under equations (m,) whose multipliers act through their own rows."""
        solver, elimination, springs, f = self._solver, parts.elimination, parts.springs, parts.pushed(self._f, c)

        def watch(u: Array, multiplier: Array, error: float) -> bool:
            assert monitor is not None
            return monitor(u, parts.multiplier(u, multiplier, c), error)

        u = solver.solution(f, elimination, guess, monitor and watch, tolerance, springs)
        return u, parts.multiplier(u, solver.multiplier(elimination, u, f, springs), c)

    def _parts(
        self, B: csr_array, c: Array, C: Array | None, nodes: NDArray[np.intp] | None, through: csr_array | None = None
    ) -> _Parts:
        """Return what is eliminated and what becomes springs, of multipliers that act `through` rows, B by default.

        Raises
        ------
        RepeatedError
            If equations that do not give way repeat each other.
        """
        size = self._solver.K.blocksize[0]
        if C is None or not C.any():
            return _Parts.of(B, c, None, np.ones(len(c), bool), nodes, size, through)
        diagonal = self._solver.diagonal()
        yielding = np.divide(1.0, diagonal, out=np.zeros(len(diagonal)), where=diagonal > 0.0)
        own = B.multiply(B) @ yielding
        for least in (STIFF, STIFF_COUPLED):
            stiff = own > least * C
            try:
                found = _Parts.of(B, c, C, stiff, nodes, size, through)
            except RepeatedError:
                continue
            if not found.coupled or least == STIFF_COUPLED:
                return found
        return _Parts.of(B, c, C, C == 0.0, nodes, size, through)


@dataclass(frozen=True, eq=False)
class _Parts:
    """Equations (m,) as an elimination of those that are `stiff`, and springs for the others."""

    stiff: Mask
    elimination: Elimination | None
    springs: Springs | None

    @classmethod
    def of(
        cls, B: csr_array, c: Array, C: Array | None, stiff: Mask, nodes: NDArray[np.intp] | None, size: int,
        through: csr_array | None,
    ) -> _Parts:  # fmt: skip
        """Return the parts of ``B u + C multiplier = c``; RepeatedError where those that are stiff repeat each other."""
        if stiff.all():
            elimination = eliminate(B, c, through, nodes, size) if len(c) else None
        else:
            rows, acting = csr_array(B[stiff]), None if through is None else csr_array(through[stiff])
            of_rows = None if nodes is None else nodes[stiff]
            elimination = eliminate(rows, c[stiff], acting, of_rows, size) if stiff.any() else None
        if C is None:
            return cls(stiff, elimination, None)
        if elimination is not None and C[stiff].any():
            elimination = dataclasses.replace(elimination, compliance=C[stiff])
        if stiff.all():
            return cls(stiff, elimination, None)
        acting = None if through is None else csr_array(through[~stiff])
        return cls(stiff, elimination, Springs(csr_array(B[~stiff]), 1.0 / C[~stiff], acting))

    @property
    def coupled(self) -> bool:
        """Whether equations eliminated have pivots in common."""
        return self.elimination is not None and self.elimination.coupled is not None

    def pushed(self, f: Array, c: Array) -> Array:
        """Return forces f (n,) and those of the springs at u = 0."""
        if self.springs is None:
            return f
        acting = self.springs.rows if self.springs.through is None else self.springs.through
        return f + acting.T @ (self.springs.stiffness * c[~self.stiff])

    def multiplier(self, u: Array, of_stiff: Array, c: Array) -> Array:
        """Return all multipliers (m,), given those of the equations eliminated."""
        if self.springs is None:
            return of_stiff
        found = np.empty(len(c))
        found[self.stiff] = of_stiff
        found[~self.stiff] = self.springs.stiffness * (c[~self.stiff] - self.springs.rows @ u)
        return found
