r"""Equilibrium of a load step: terms, which are nodal forces that depend on the displacements, and their balance.

Let :math:`f_i(u)` be the nodal forces of term i at the displacements u, :math:`f_{ext}` the external forces, B the matrix of
the contact constraints, and :math:`\lambda` their Lagrange multipliers. A load step solves

.. math:: \sum_i f_i(u) = f_{ext} + B(u)^T \lambda

by Newton's method, see `newton`. `Balance` contains the reactions, and the residual with its bound; `StepEquilibrium`
contains the solution. Contact is not a term, because it is linearised together with its inequalities in `geometry_loop`.
The pressure of a fluid between the contact surfaces is a term.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from operator import itemgetter
from typing import Any, Protocol

import numpy as np
from scipy.sparse import bsr_array, csr_array

from fastcontact._tools.records import field, record
from fastcontact.analysis.criteria import LINEAR_ERROR, NOTABLE
from fastcontact.analysis.geometry_loop import SettledContact
from fastcontact.analysis.heat import Temperatures
from fastcontact.analysis.inequalities import StepContext
from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.analysis.state import State
from fastcontact.arrays import Array, largest
from fastcontact.contact.wear_compliance import WearCompliance
from fastcontact.elasticity.nonlinear_bodies import COMPLETE, DeformedBodies
from fastcontact.elasticity.springs import Springs, ground_force, spring_force, spring_stiffness
from fastcontact.errors import ConvergenceError
from fastcontact.linear.sparse_rows import sum_of_blocks
from fastcontact.round_off import ROUND_OFF, SUM_ROUND_OFF

# Elastic energy and plastic work [energy].
Energies = tuple[float, float]


class Term(Protocol):
    """Term of the equilibrium of a load step with nonlinear bodies, in addition to these bodies.

    In all methods u (n_dofs,) are the displacements of all points, and then of the force-driven obstacles [length].
    """

    def residual(self, u: Array) -> tuple[Array, float]:
        """Return the nodal forces (n_dofs,) of the term at u [force], and its elastic energy [energy]."""

    def tangent(self, u: Array) -> csr_array:
        """Return the derivative (n, n) of the nodal forces with respect to the n displacements of points [force / length]."""


class SpringForces(Term):
    """Springs in a model with nonlinear bodies; `n` is the number of displacement components of the mesh."""

    def __init__(self, springs: Sequence[Springs], n: int) -> None:
        self._springs, self._n = springs, n
        self._K = spring_stiffness(springs, n)

    def residual(self, u: Array) -> tuple[Array, float]:
        """See `Term`."""
        force, mesh_displacement = np.zeros_like(u), u[: self._n]
        force[: self._n] = spring_force(self._springs, mesh_displacement)
        return force, 0.5 * float(force[: self._n] @ mesh_displacement)

    def tangent(self, u: Array) -> csr_array:
        """See `Term`."""
        return self._K


class FollowingForce(Term):
    """Change of a force that depends on the displacements; its constant part is included elsewhere.

    For a load, the external forces of the step include the force on the undeformed bodies. For a fluid between contact
    surfaces, the linearised contact problem includes the force at the displacements about which it is linearised. The term,
    an internal force, is therefore the force at these displacements, `at`, minus that at the current displacements.

    Parameters
    ----------
    problem : Problem
    force, stiffness : callable
        Functions of the displacements (n_points, dim) [length], which return the nodal forces (n_points, dim) [force] and the
        tangent (n_dofs, n_dofs) [force / length].
    at : ndarray (n_dofs,)
        Displacements for which the forces are included elsewhere [length].
    factor : float
        Load multiplier [-].
    """

    def __init__(
        self, problem: Problem, force: Callable[[Array], Array], stiffness: Callable[[Array], csr_array], at: Array,
        factor: float = 1.0,
    ) -> None:  # fmt: skip
        self._displacement, self._force, self._stiffness, self._factor = problem.displacement, force, stiffness, factor
        self._included = force(problem.displacement(at))

    def residual(self, u: Array) -> tuple[Array, float]:
        """See `Term`."""
        force, current = np.zeros_like(u), self._force(self._displacement(u))
        force[: current.size] = -self._factor * (current - self._included).ravel()
        return force, 0.0

    def tangent(self, u: Array) -> csr_array:
        """See `Term`."""
        return self._factor * self._stiffness(self._displacement(u))


class Terms:
    """The nonlinear bodies and the other terms of a load step.

    Parameters
    ----------
    problem : Problem
    start : State
        State at the beginning of the step.
    load : StepLoad
    """

    def __init__(self, problem: Problem, start: State, load: StepLoad) -> None:
        self._problem, self._start, self._rise = problem, start, load.rise
        self._last_bodies: list[tuple[Array, DeformedBodies]] = []  # at the last two displacement vectors
        self._tangent_passed_at: Array | None = None  # where the caller may have modified the tangent
        springs, n = problem.model.springs, problem.model.n_dofs
        self._others: list[Term] = [SpringForces(springs, n)] if springs else []
        for (following, _), factor in zip(problem.following, load.following, strict=True):
            force, tangent = (lambda u, index=index, at=following.at: at(u)[index] for index in (0, 1))
            self._others.append(FollowingForce(problem, force, tangent, np.zeros_like(start.u), factor))

    def bodies_at(self, u: Array, *, tangent: bool = True) -> DeformedBodies:
        """Return forces, energies, history variables and tangent of the bodies at u (n_dofs,) [length].

        They are computed in one loop over the cells. With ``tangent=False`` the tangent is only computed when it is needed.

        Raises
        ------
        ConvergenceError
            If a cell is inverted.
        """
        for last_u, bodies in self._last_bodies:
            if last_u is u:
                return bodies
        bodies = self._problem.deformed(u, self._start, self._rise, tangent=tangent)
        self._last_bodies = [*self._last_bodies[-1:], (u, bodies)]
        return bodies

    def residual(self, u: Array, others: Sequence[Term] = ()) -> tuple[Array, Energies]:
        """Return the nodal forces (n_dofs,) at u (n_dofs,) [force] and the energies of bodies, all terms, and `others`."""
        bodies, force = self.bodies_at(u, tangent=False), np.zeros_like(u)
        force[: bodies.force.size] = bodies.force.ravel()
        strain_energy = bodies.energy
        for term in (*self._others, *others):
            added_force, added_energy = term.residual(u)
            force, strain_energy = force + added_force, strain_energy + added_energy
        return force, (strain_energy, bodies.plastic_work)

    def tangent(self, u: Array, geometric: int = COMPLETE) -> bsr_array:
        """Return the sum of the tangents of bodies and all terms [force / length].

        `geometric` selects how much of the geometric stiffness is included, see `NonlinearBodies.at`. The caller may modify
        the matrix.
        """
        if geometric < COMPLETE or u is self._tangent_passed_at:
            K = self._problem.deformed(u, self._start, self._rise, geometric=geometric).K
        else:
            K, self._tangent_passed_at = self.bodies_at(u).K, u
        for term in self._others:
            K = sum_of_blocks(K, term.tangent(u))
        return K


@record
class Balance:
    """Forces at the end of a load step.

    Attributes
    ----------
    reaction : ndarray (n_dofs of the mesh,)
        Forces of supports, multi-point constraints and springs to the ground on the bodies [force].
    largest : float
        Largest force of all steps so far [force].
    residual : float
        Largest residual force. If it exceeds the criterion, the round-off of each row has been subtracted [force].
    bound : float
        Largest admissible residual force [force].
    relative : float
        Largest residual force relative to the largest force of this step; zero if all forces are round-off [-].
    noise : float
        Level of round-off, below which forces are not significant [force].
    energy : (float, float)
        Strain energy, including that of springs, and plastic work since the beginning of the analysis [energy].
    """

    reaction: Array
    largest: float
    residual: float
    bound: float
    relative: float
    noise: float = 0.0
    energy: Energies = (0.0, 0.0)

    @property
    def accuracy_factor(self) -> float:
        """Factor by which the accuracy of linear solutions should increase, if the residual exceeds its bound [-].

        If the residual exceeds the level of round-off, and this level exceeds the bound, all forces may be round-off, for
        example after bodies have separated. The factor then only reduces the residual to the level of round-off, which
        requires a much lower accuracy than the bound.
        """
        target = self.noise if self.residual > self.noise > self.bound else self.bound
        return self.residual / target if target else float(np.inf)

    def failure(self, index: int, problem: Problem, history: Sequence[dict[str, Any]]) -> ConvergenceError:
        """Return the error for step `index`, in which the residual exceeds its bound."""
        tolerance = 2 * self.relative
        advice = f", or accept it with Criteria(relative={tolerance:.0e})" if tolerance <= NOTABLE else ""
        remedy = "use the direct solver" if problem.solver.iterative else (
            "round-off prevents a smaller one if moduli or displacements differ by many orders of magnitude. Replace a stiff "
            f"body by a rigid obstacle{advice}"
        )  # fmt: skip
        return ConvergenceError(
            f"step {index}: the out-of-balance force {self.residual:.3g} stays above {self.bound:.3g} "
            f"({problem.criteria.relative:g} of the largest force): {remedy}",
            history,
            smaller_steps_help=False,
        )


def balance(
    problem: Problem, u: Array, contact_force: Array, external: Array, largest_so_far: float,
    internal: tuple[Array, Energies],
) -> Balance:  # fmt: skip
    """Return the reactions at supports, and the residual at all other degrees of freedom.

    Parameters
    ----------
    problem : Problem
    u : ndarray (n_dofs,)
        Displacements [length].
    contact_force, external : ndarray (n_dofs,)
        Nodal forces of contact and of loads [force].
    largest_so_far : float
        Largest force of the earlier steps [force].
    internal : (ndarray (n_dofs,), (float, float))
        Nodal forces [force] and energies [energy] of all terms, see `Terms.residual`.
    """
    criteria, (force_of_terms, energy) = problem.criteria, internal
    unbalanced = force_of_terms - contact_force
    unbalanced -= external
    reaction, residual = problem.system.balance(unbalanced)
    forces = (reaction, contact_force, external)
    force = max(map(largest, forces))
    largest_so_far = max(largest_so_far, force)
    bound = max(criteria.relative * force, criteria.absolute or 0.0)
    full_residual, round_off, noise = residual, 0.0, 0.0
    if not 0.0 < residual <= bound:
        # In stiff parts with large displacements, the round-off of internal forces may exceed the forces in soft parts. If
        # there are no forces, the relative residual is not defined, and the round-off of internal forces is the bound. Both
        # cases need abs(K) @ lengths, which costs as much as a product with K.
        product = problem.system.K.absolute_product(problem.round_off_lengths(u))
        residual = problem.system.balance(unbalanced, SUM_ROUND_OFF * product)[1]
        round_off, noise = _round_off(problem, product, forces, largest_so_far)
    reaction = reaction[: problem.model.mesh.points.size]
    if problem.model.springs:
        reaction = reaction + ground_force(problem.model.springs, u[: len(reaction)])
    relative = float(full_residual / force) if force > round_off else 0.0
    return Balance(reaction, largest_so_far, residual, max(bound, round_off), relative, noise, energy)


def _round_off(problem: Problem, product: Array, forces: tuple[Array, ...], scale: float) -> tuple[float, float]:
    """Return a bound of the residual that is due to round-off, and the level of round-off.

    A force is significant if it exceeds the level of round-off, and if the round-off of its row is below the criterion. If
    any force is significant, the bound is small, so that the round-off of stiff parts does not hide the residual of soft
    ones. Otherwise the bound is the error of the internal forces.

    Parameters
    ----------
    problem : Problem
    product : ndarray (n_dofs,)
        ``abs(K) @ lengths`` with the lengths of `Problem.round_off_lengths` [force].
    forces : tuple of ndarray
        Reactions, contact forces and external forces [force].
    scale : float
        Largest force of all steps so far [force].

    Returns
    -------
    bound, level : float
        [force].
    """
    force_round_off = ROUND_OFF * scale
    noise = max(force_round_off, SUM_ROUND_OFF * largest(product) / NOTABLE)
    for magnitudes in map(np.abs, forces):
        if ((magnitudes > noise) & (magnitudes * problem.criteria.relative > SUM_ROUND_OFF * product)).any():
            return force_round_off, noise
    return max(max(ROUND_OFF, LINEAR_ERROR * problem.solver.tolerance) * largest(product), force_round_off), noise


@record
class StepEquilibrium:
    """The equilibrium at the end of a load step.

    Attributes
    ----------
    settled : SettledContact, optional
        The contact solution; None without contact.
    u : ndarray (n_dofs,)
        Displacements of all points, and then of the force-driven obstacles [length].
    balance : Balance
        Reactions and residual.
    terms : Terms, optional
        Terms of the equilibrium; None if all bodies are linear.
    newton : list of dict
        Convergence data of each Newton iteration; empty if all bodies are linear.
    wear : dict of str to WearCompliance
        Wear of each contact pair with a law of wear.
    temperatures : Temperatures, optional
        Temperatures and heat flows, in models with conduction of heat.
    """

    settled: SettledContact | None
    u: Array
    balance: Balance
    terms: Terms | None = None
    newton: list[dict[str, Any]] = field(default_factory=list)
    wear: Mapping[str, WearCompliance] = field(default_factory=dict)
    temperatures: Temperatures | None = None

    def counts(self, linear_iterations: int) -> dict[str, Any]:
        """Return the numbers of iterations of the step, see `StepResult.iterations`.

        For nonlinear bodies the history is that of Newton's method, and the numbers are sums over all Newton iterations.
        """
        pairings, scatter = ([], None) if self.settled is None else (self.settled.iterate.history, self.settled.scatter)
        history, updates = pairings, max(len(pairings) - 1, 0)
        if self.terms is not None:
            history, updates = self.newton, sum(map(itemgetter("pairings"), self.newton))
        return {
            "geometry_updates": updates,
            "active_set_iterations": sum(map(itemgetter("active_set_iterations"), history)),
            "linear_iterations": linear_iterations,
            "history": history,
            **({} if scatter is None else {"scatter": scatter}),
        }


def solve_displacements(
    step: StepContext, settled: SettledContact | None, guess: Array, tolerance: float | None = None
) -> tuple[Array, Array]:
    """Return all displacements (n_dofs,) [length] and the nodal contact forces (n_dofs,) [force].

    `settled` is the contact solution, None without contact. Iterative solvers then begin with the displacements `guess`
    (n_dofs,) [length], and stop at a relative residual `tolerance` [-] or at their own tolerance.
    """
    problem, loaded, system, lift = step.problem, step.loaded, step.problem.system, step.load.lift
    if settled is None:
        no_constraints = csr_array((0, len(lift))), np.empty(0)
        v = loaded.solve(*no_constraints, guess=system.unknowns(guess, lift), tolerance=tolerance)[0]
        return system.displacement(v, lift), np.zeros(len(lift))
    contact_force, rigid = settled.force, settled.iterate.rigid
    if problem.floating_bodies is not None and rigid is not None:
        lift = lift + problem.floating_bodies.rigid(rigid.anchor)
    v = loaded.full_solution(system.reduced(contact_force), settled.solution.u)
    return system.displacement(v, lift), contact_force
