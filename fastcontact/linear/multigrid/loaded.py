"""Solution by multigrid subject to linear equations, some of which have a compliance.

An equation with a compliance is equivalent to a spring with the elongation ``B u - c``. Springs that are not much stiffer
than the bodies are added to the matrix and to the hierarchy. Equations with stiffer springs are eliminated like equations
without compliance, see `reduced`.
"""

from __future__ import annotations

import dataclasses
import logging

import numpy as np
from scipy.sparse import csr_array

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, Mask, scattered
from fastcontact.linear.elimination.elimination import Elimination, eliminate
from fastcontact.linear.elimination.loaded import LoadedIterative
from fastcontact.linear.elimination.pivot_order import DependenceError
from fastcontact.linear.field_compliance import FieldCompliance, FieldEquations
from fastcontact.linear.multigrid.border import Border
from fastcontact.linear.protocol import MILD_CONTRAST, FrictionTerms, Monitor
from fastcontact.linear.sparse_rows import scaled, taken
from fastcontact.linear.springs import Springs

log = logging.getLogger("fastcontact")
# Equations with a compliance are eliminated if they are stiffer than their unknowns by more than this factor. With springs
# instead, the number of iterations would be 1.5 times as large at this ratio of stiffnesses, and beyond it proportional to
# the square root of the ratio.
LARGEST_STIFFNESS_RATIO = MILD_CONTRAST


class LoadedMultigrid(LoadedIterative):
    """A matrix prepared by a `Multigrid` solver, with a right-hand side; see `LoadedIterative`."""

    # Values of the pressure field at the edge of the contact in the last solution, as an initial guess for the next one.
    _at_edge: Array = np.empty(0)

    def solve(
        self, B: csr_array, c: Array, C: Array | FieldCompliance | None = None, guess: Array | None = None,
        monitor: Monitor | None = None, tolerance: float | None = None, nodes: Indices | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Return the displacements and the multipliers, see `Loaded.solve`.

        If equations are linearly dependent or have a full compliance matrix, the Delassus operator is formed.
        """
        equations: _DividedEquations | None = None
        if C is not None and len(c) and (isinstance(C, FieldCompliance) or C.ndim == 1):
            try:
                if isinstance(C, FieldCompliance):
                    equations = _DividedFieldEquations.from_points(B, c, C, self._solver.K.blocksize[0])
                else:
                    equations = self._divide(B, c, C, nodes)
            except DependenceError as error:
                log.info("%s (the Delassus operator is formed instead)", error)
        if equations is None:
            return super().solve(B, c, C, guess, monitor, tolerance, nodes)
        return self._solution(equations, c, guess, monitor, tolerance)

    @property
    def contrast(self) -> float:
        """See `LinearSolver`."""
        return float(self._solver.contrast)

    def diagonal(self) -> Array:
        """See `LoadedNonsymmetric`."""
        return np.asarray(self._solver.diagonal())

    def solve_nonsymmetric(
        self, B: csr_array, c: Array, nodes: Indices, guess: Array, tolerance: float,
        friction: FrictionTerms | None = None, C: Array | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """See `LoadedNonsymmetric`."""
        equations = self._divide(B, c, C, nodes, None if friction is None else friction.rows)
        if friction is None:
            return self._solution(equations, c, guess, None, tolerance)
        solver, elimination, springs = self._solver, equations.elimination, equations.springs
        springs = friction.springs if springs is None else springs.joined(friction.springs)
        f = self._f if friction.forces is None else self._f + friction.forces
        f = equations.with_spring_forces(f, c)
        u = solver.nonsymmetric_solution(f, elimination, springs, guess, tolerance)
        return u, equations.multiplier(u, solver.multiplier(elimination, u, f, springs), c)

    def _solution(
        self, equations: _DividedEquations, c: Array, guess: Array | None, monitor: Monitor | None,
        tolerance: float | None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Return u (n,) [length] and the multipliers (m,) [force] of equations without friction."""
        solver, elimination, springs = self._solver, equations.elimination, equations.springs
        f, at_edge = equations.with_spring_forces(self._f, c), np.empty(0)

        def check(u: Array, multiplier: Array, error: float) -> bool:
            assert monitor is not None
            return monitor(u, equations.multiplier(u, multiplier, c), error)

        if isinstance(equations, _DividedFieldEquations) and equations.field.edge.any():
            field, edge = equations.field, equations.field.edge
            border = Border(csr_array(field.rows[edge]), field.rhs[edge], field.compliance)
            start = np.zeros(equations.C.P.shape[1])
            if guess is not None and len(self._at_edge) == len(start):
                start = self._at_edge
            arguments = f, elimination, springs, border, guess, start[field.edge_values] / field.scales, tolerance
            u, at_edge = solver.bordered_solution(*arguments)
            self._at_edge = scattered(field.scales * at_edge, field.edge_values, len(start))
            f = f + border.rows.T @ at_edge
        else:
            u = solver.solution(f, elimination, guess, monitor and check, tolerance, springs)
        multipliers = np.concatenate([solver.multiplier(elimination, u, f, springs), at_edge])
        return u, equations.multiplier(u, multipliers, c)

    def _divide(
        self, B: csr_array, c: Array, C: Array | None, nodes: Indices | None, force_rows: csr_array | None = None
    ) -> _DividedEquations:
        """Return the equations, divided into eliminated ones and springs.

        `force_rows` (m, n) is the matrix F of the forces ``F.T @ multiplier`` on the unknowns; B by default.

        Raises
        ------
        DependenceError
            If equations without compliance are linearly dependent.
        """
        size = self._solver.K.blocksize[0]
        if C is None or not C.any():
            return _DividedEquations.of(B, c, np.zeros(len(c)), np.ones(len(c), bool), nodes, size, force_rows)
        diagonal = self._solver.diagonal()
        unknown_compliance = np.divide(1.0, diagonal, out=np.zeros(len(diagonal)), where=diagonal > 0.0)
        compliance = B.multiply(B) @ unknown_compliance  # of the unknowns of each equation
        try:
            return _DividedEquations.of(B, c, C, compliance > LARGEST_STIFFNESS_RATIO * C, nodes, size, force_rows)
        except DependenceError:
            return _DividedEquations.of(B, c, C, C == 0.0, nodes, size, force_rows)


@record
class _DividedEquations:
    """Equations, divided into eliminated ones and springs.

    Attributes
    ----------
    stiff : ndarray of bool (m,)
        The equations that are eliminated.
    elimination : Elimination or None
        Their elimination.
    springs : Springs or None
        The other equations, as springs.
    """

    stiff: Mask
    elimination: Elimination | None
    springs: Springs | None

    @classmethod
    def of(
        cls, B: csr_array, c: Array, C: Array, stiff: Mask, nodes: Indices | None, size: int,
        force_rows: csr_array | None,
    ) -> _DividedEquations:  # fmt: skip
        """Return the equations ``B u + C multiplier = c``, of which those marked in `stiff` (m,) are eliminated.

        For parameters see `eliminate` and `LoadedMultigrid._divide`. A DependenceError is raised if the eliminated equations
        are linearly dependent.
        """
        rows, elimination = np.flatnonzero(stiff), None
        if len(rows):
            stiff_force_rows, nodes_of_rows = (None if a is None else taken(a, rows) for a in (force_rows, nodes))
            elimination = eliminate(taken(B, rows), c[rows], stiff_force_rows, nodes_of_rows, size)
            if C[rows].any():
                elimination = dataclasses.replace(elimination, compliance=C[rows])
        if stiff.all():
            return cls(stiff, elimination, None)
        spring_force_rows = None if force_rows is None else csr_array(force_rows[~stiff])
        return cls(stiff, elimination, Springs(csr_array(B[~stiff]), 1.0 / C[~stiff], spring_force_rows))

    def with_spring_forces(self, f: Array, c: Array) -> Array:
        """Return f (n,) plus the forces of the springs at u = 0 [force]; c (m,) are the right-hand sides."""
        if self.springs is None:
            return f
        force_rows = self.springs.rows if self.springs.force_rows is None else self.springs.force_rows
        return f + force_rows.T @ (self.springs.stiffness * c[~self.stiff])

    def multiplier(self, u: Array, eliminated: Array, c: Array) -> Array:
        """Return the multipliers (m,) of all equations [force], given those of the eliminated ones, `eliminated`."""
        if self.springs is None:
            return eliminated
        multiplier = np.empty(len(c))
        multiplier[self.stiff] = eliminated
        multiplier[~self.stiff] = self.springs.stiffness * (c[~self.stiff] - self.springs.rows @ u)
        return multiplier


@record
class _DividedFieldEquations(_DividedEquations):
    """Equations at m points in the form of equations for a pressure field, and of springs; see `field_compliance`.

    The equations for the field are eliminated, except at the edge of the contact; those at the points are not. Springs at the
    points account for forces that the field does not represent.

    Attributes
    ----------
    field : FieldEquations
        Equations of the values of the field.
    C : FieldCompliance
        Compliance of the points.
    """

    field: FieldEquations
    C: FieldCompliance

    @classmethod
    def from_points(cls, B: csr_array, c: Array, C: FieldCompliance, size: int) -> _DividedFieldEquations:
        """Return the equations ``B u + C multiplier = c`` at the points.

        `size` is the number of unknowns per node. A DependenceError is raised if equations are linearly dependent.
        """
        field, elimination = C.field_equations(B, c), None
        if not field.edge.all():
            rows = csr_array(field.rows[~field.edge])
            nodes = abs(rows).argmax(axis=1).ravel() // size  # those of the largest entries
            elimination = eliminate(rows, field.rhs[~field.edge], None, np.asarray(nodes, np.intp), size)
        springs = Springs(scaled(B, (C.stiffness > 0.0).astype(float)), C.stiffness)
        return cls(np.zeros(len(c), bool), elimination, springs, field, C)

    def multiplier(self, u: Array, eliminated: Array, c: Array) -> Array:
        """Return the forces (m,) at the points [force].

        `eliminated` contains the multipliers of the eliminated equations of the field, followed by those at the edge.
        """
        p = np.empty(len(eliminated))
        p[np.argsort(self.field.edge, kind="stable")] = eliminated
        return self.C.weights * (self.field.P @ p) + super().multiplier(u, np.empty(0), c)
