r"""Terms of the equilibrium: nodal forces that depend on the displacements, each with its tangent and history.

Let :math:`f_i(u)` be the nodal forces of term i at the displacements u, :math:`f_{ext}` the external forces, B the matrix of
the contact constraints, and :math:`\lambda` their Lagrange multipliers. A load step solves

.. math:: \sum_i f_i(u) = f_{ext} + B(u)^T \lambda

by Newton's method, see `newton`. Contact is not a term: it is linearised together with its inequalities in `geometry_loop`.
Only fluid pressure between the contact surfaces is one, `Fluid`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from scipy.sparse import bsr_array, csr_array

from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.analysis.state import State
from fastcontact.arrays import Array
from fastcontact.contact.constraints import Wetted
from fastcontact.elasticity.constrained_system import Stiffness
from fastcontact.elasticity.following_pressure import FollowingPressure
from fastcontact.elasticity.nonlinear_bodies import WHOLE, DeformedBodies
from fastcontact.elasticity.springs import Springs, spring_force, spring_stiffness
from fastcontact.linear.sparse_rows import sum_of_blocks

# Elastic energy and plastic work of a term [energy].
Energies = tuple[float, float]


class Term(Protocol):
    """Term of the equilibrium of a load step.

    In all methods u (n_dofs,) are the displacements of all points, and then of the force-driven obstacles [length].
    """

    def residual(self, u: Array) -> tuple[Array, Energies]:
        """Return the nodal forces (n_dofs,) of the term at u [force], and its energies."""
        ...

    def tangent(self, u: Array, geometric: int = WHOLE) -> bsr_array | csr_array | None:
        """Return the derivative (n, n) of the nodal forces with respect to the n displacements of points [force / length].

        The caller may modify the matrix. None means that the derivative is constant, and part of the matrix that `prepare`
        passed to the linear solver. `geometric` selects how much of the geometric stiffness is included, see
        `NonlinearBodies.at`.
        """
        ...

    def commit(self, u: Array, state: State) -> State:
        """Return `state` with the history variables of the term at u, the end of the load step.

        By default a term has no history variables, and the state is returned as it is.
        """
        return state


class LinearBodies(Term):
    """Linear bodies and springs, with the constant stiffness matrix K (n_dofs, n_dofs) of the problem [force / length]."""

    def __init__(self, K: Stiffness) -> None:
        self._K = K

    def residual(self, u: Array) -> tuple[Array, Energies]:
        """See `Term`."""
        force = self._K @ u
        return force, (0.5 * float(u @ force), 0.0)

    def tangent(self, u: Array, geometric: int = WHOLE) -> None:
        """See `Term`."""


class Bodies(Term):
    """Nonlinear bodies in a load step that begins with the state `start`.

    Forces and tangent are computed in one loop over the cells, and cached for the last two displacement vectors.
    """

    def __init__(self, problem: Problem, start: State, load: StepLoad) -> None:
        self._problem, self._start, self._rise = problem, start, load.rise
        self._kept: list[tuple[Array, DeformedBodies]] = []
        self._taken: Array | None = None

    def at(self, u: Array, *, tangent: bool = True) -> DeformedBodies:
        """Return forces, energies, history variables and tangent of the bodies at u (n_dofs,) [length].

        With ``tangent=False`` the tangent is not computed in advance, because it will probably not be needed.

        Raises
        ------
        ConvergenceError
            If a cell is inverted.
        """
        for known, bodies in self._kept:
            if known is u:
                return bodies
        bodies = self._problem.deformed(u, self._start, self._rise, tangent=tangent)
        self._kept = [*self._kept[-1:], (u, bodies)]
        return bodies

    def residual(self, u: Array) -> tuple[Array, Energies]:
        """See `Term`."""
        bodies, force = self.at(u), np.zeros_like(u)
        force[: bodies.force.size] = bodies.force.ravel()
        return force, (bodies.energy, bodies.plastic_work)

    def tangent(self, u: Array, geometric: int = WHOLE) -> bsr_array:
        """See `Term`."""
        if geometric < WHOLE or u is self._taken:
            return self._problem.deformed(u, self._start, self._rise, geometric=geometric).K
        self._taken = u
        return self.at(u).K

    def commit(self, u: Array, state: State) -> State:
        """See `Term`."""
        return replace(state, history=self.at(u).history)


class SpringForces(Term):
    """Springs in a model with nonlinear bodies; `n` is the number of displacement components of the mesh."""

    def __init__(self, springs: Sequence[Springs], n: int) -> None:
        self._springs, self._n = springs, n
        self._K = spring_stiffness(springs, n)

    def residual(self, u: Array) -> tuple[Array, Energies]:
        """See `Term`."""
        force, of_points = np.zeros_like(u), u[: self._n]
        force[: self._n] = spring_force(self._springs, of_points)
        return force, (0.5 * float(force[: self._n] @ of_points), 0.0)

    def tangent(self, u: Array, geometric: int = WHOLE) -> csr_array:
        """See `Term`."""
        return self._K


class FollowerLoad(Term):
    """Pressure load that follows the deformed surface.

    The external forces of the step include the force of the pressure on the undeformed surface. The term therefore is this
    force minus the force on the deformed surface. `factor` is the load multiplier [-].
    """

    def __init__(self, problem: Problem, pressure: FollowingPressure, factor: float) -> None:
        self._problem, self._pressure, self._factor = problem, pressure, factor
        self._before = pressure.at(np.zeros_like(problem.model.mesh.points))[0]

    def residual(self, u: Array) -> tuple[Array, Energies]:
        """See `Term`."""
        force, here = np.zeros_like(u), self._pressure.at(self._problem.displacement(u))[0]
        force[: here.size] = -self._factor * (here - self._before).ravel()
        return force, (0.0, 0.0)

    def tangent(self, u: Array, geometric: int = WHOLE) -> csr_array:
        """See `Term`."""
        return self._factor * self._pressure.at(self._problem.displacement(u))[1]


class Fluid(Term):
    """Pressure of a fluid between the contact surfaces.

    The linearised contact problem includes the fluid force at the displacements `at` (n_dofs,) [length], about which it was
    linearised. The term therefore is this force minus the force at the current displacements.
    """

    def __init__(self, problem: Problem, wetted: Wetted, at: Array) -> None:
        self._problem, self._wetted = problem, wetted
        self._before = wetted.force(problem.displacement(at))

    def residual(self, u: Array) -> tuple[Array, Energies]:
        """See `Term`."""
        force, here = np.zeros_like(u), self._wetted.force(self._problem.displacement(u))
        force[: here.size] = (self._before - here).ravel()
        return force, (0.0, 0.0)

    def tangent(self, u: Array, geometric: int = WHOLE) -> csr_array:
        """See `Term`."""
        return self._wetted.stiffness(self._problem.displacement(u))


class Terms:
    """The sum of the terms of a load step.

    Parameters
    ----------
    problem : Problem
    start : State
        State at the beginning of the step.
    load : StepLoad

    Attributes
    ----------
    bodies : Bodies, optional
        The term of the nonlinear bodies; None if all bodies are linear.
    """

    def __init__(self, problem: Problem, start: State, load: StepLoad) -> None:
        self.bodies = None if problem.bodies is None else Bodies(problem, start, load)
        self._parts: list[Term] = [LinearBodies(problem.system.K)]
        if self.bodies is not None:
            springs, n = problem.model.springs, problem.model.n_dofs
            self._parts = [self.bodies, *([SpringForces(springs, n)] if springs else [])]
            for (pressure, _), factor in zip(problem.following, load.following, strict=True):
                self._parts.append(FollowerLoad(problem, pressure, factor))

    @property
    def prepared(self) -> bool:
        """Whether the tangents of all terms are constant and included in the prepared matrix of the linear solver."""
        return self.bodies is None

    def residual(self, u: Array, more: Sequence[Term] = ()) -> tuple[Array, Energies]:
        """Return the sums of the nodal forces and of the energies of all terms, including the terms `more`; see `Term`."""
        force, energy = self._parts[0].residual(u)
        for term in (*self._parts[1:], *more):
            added, stored = term.residual(u)
            force, energy = force + added, (energy[0] + stored[0], energy[1] + stored[1])
        return force, energy

    def tangent(self, u: Array, geometric: int = WHOLE) -> bsr_array:
        """Return the sum of the tangents; see `Term`. It may only be called if the bodies are nonlinear."""
        assert self.bodies is not None
        K = self.bodies.tangent(u, geometric)
        for term in self._parts[1:]:
            if (more := term.tangent(u)) is not None:
                K = sum_of_blocks(K, more)
        return K

    def commit(self, u: Array, state: State) -> State:
        """See `Term`."""
        for term in self._parts:
            state = term.commit(u, state)
        return state
