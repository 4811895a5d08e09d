r"""Terms of the equilibrium: nodal forces that depend on the displacements, each with its tangent and history.

With the nodal forces :math:`f_i` of the terms, external forces and contact, a load step solves

.. math:: \sum_i f_i(u) = f_{ext} + B(u)^T \lambda

by the iterations of `newton`, in which a constant tangent costs nothing. Contact is linearised with its inequalities, see
`geometry_loop`; fluid pressure that follows the surface adds the term `Fluid`.
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

# Elastic energy and plastic work [energy].
Energies = tuple[float, float]


class Term(Protocol):
    """A part of the equilibrium of a load step; u (n_dofs,) are the displacements of all components [length]."""

    def residual(self, u: Array) -> tuple[Array, Energies]:
        """Return the nodal forces (n_dofs,) of the term at u [force], and its energies."""
        ...

    def tangent(self, u: Array, geometric: int = WHOLE) -> bsr_array | csr_array | None:
        """Return the derivative of the forces (n, n), for components of the mesh [force / length]; None: as prepared.

        The caller may modify it. For the part of the `geometric` stiffness see `NonlinearBodies.at`.
        """
        ...

    def commit(self, u: Array, state: State) -> State:
        """Return the state with the history of the term at the end of the load step; most terms have none."""
        return state


class LinearBodies(Term):
    """Linear bodies and springs, whose stiffness is that of the prepared problem."""

    def __init__(self, K: Stiffness) -> None:
        self._K = K

    def residual(self, u: Array) -> tuple[Array, Energies]:
        """See `Term`."""
        force = self._K @ u
        return force, (0.5 * float(u @ force), 0.0)

    def tangent(self, u: Array, geometric: int = WHOLE) -> None:
        """See `Term`."""


class Bodies(Term):
    """Nonlinear bodies in a load step that begins at `start`.

    Forces and tangent are computed in one loop over the cells, and cached for the last two displacements.
    """

    def __init__(self, problem: Problem, start: State, load: StepLoad) -> None:
        self._problem, self._start, self._rise = problem, start, load.rise
        self._kept: list[tuple[Array, DeformedBodies]] = []
        self._taken: Array | None = None

    def at(self, u: Array, *, tangent: bool = True) -> DeformedBodies:
        """Return the bodies at u; `tangent` is False if their tangent will probably not be needed.

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
    """Springs beside nonlinear bodies, of `n` components."""

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
    """Force of a pressure on the undeformed surface, which is in the external forces, minus that on the deformed one."""

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
    """Fluid force at the displacements `at` (n_dofs,), where contact was linearised, minus the current one."""

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
        The bodies, if they are nonlinear.
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
        """Whether all tangents are the prepared ones at any displacement."""
        return self.bodies is None

    def residual(self, u: Array, more: Sequence[Term] = ()) -> tuple[Array, Energies]:
        """See `Term`, with `more` terms."""
        force, energy = self._parts[0].residual(u)
        for term in (*self._parts[1:], *more):
            added, stored = term.residual(u)
            force, energy = force + added, (energy[0] + stored[0], energy[1] + stored[1])
        return force, energy

    def tangent(self, u: Array, geometric: int = WHOLE) -> bsr_array:
        """See `Term`; only if tangents vary."""
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
