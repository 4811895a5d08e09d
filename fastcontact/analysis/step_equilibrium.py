"""The equilibrium of a load step: displacements from known contact forces, reactions, and the residual with its bound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from fastcontact._jit.norms_kernels import largest
from fastcontact.analysis.criteria import NOTABLE
from fastcontact.analysis.geometry_loop import SettledContact
from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.analysis.terms import Terms
from fastcontact.arrays import Array
from fastcontact.elasticity.nonlinear_bodies import DeformedBodies
from fastcontact.elasticity.springs import ground_force
from fastcontact.errors import ConvergenceError
from fastcontact.linear.protocol import Loaded
from fastcontact.round_off import ROUND_OFF, SUM_ROUND_OFF

# A force is significant if it exceeds this multiple of the round-off of the internal forces in other rows.
SIGNIFICANT = 100.0


@dataclass(frozen=True, eq=False)
class Balance:
    """Forces at the end of a load step.

    Attributes
    ----------
    reaction : ndarray (n_dofs of the mesh,)
        Forces of supports, multi-point constraints and springs to the ground on the bodies [force].
    largest : float
        Largest force of all steps so far [force].
    residual : float
        Largest residual force. If it exceeds `bound`, the round-off of its row has been subtracted [force].
    bound : float
        Largest admissible residual force [force].
    relative : float
        Largest residual force relative to the largest force of this step; zero if all forces are round-off [-].
    noise : float
        Level of round-off: smaller forces are not significant [force].
    energy : (float, float)
        Strain energy, including that of springs, and plastic work since the beginning of the analysis [energy].
    """

    reaction: Array
    largest: float
    residual: float
    bound: float
    relative: float
    noise: float = 0.0
    energy: tuple[float, float] = (0.0, 0.0)

    @property
    def excess(self) -> float:
        """Ratio of the residual to its bound [-]."""
        return self.residual / self.bound if self.bound else float(np.inf if self.residual else 0.0)

    @property
    def wanting(self) -> float:
        """Factor by which the accuracy of linear solutions should increase [-].

        If the residual exceeds the level of round-off, and this level exceeds the bound, it is unknown whether there are
        any significant forces at all, for example after bodies have separated. The factor then only brings the residual to
        the level of round-off, which needs far less accuracy than the bound.
        """
        return self.residual / self.noise if self.residual > self.noise > self.bound else self.excess

    def check(self, index: int, problem: Problem, history: Sequence[dict[str, Any]]) -> None:
        """Raise a ConvergenceError for step `index` if the residual exceeds its bound."""
        if self.residual <= self.bound:
            return
        raise ConvergenceError(
            f"step {index}: the out-of-balance force {self.residual:.3g} stays above {self.bound:.3g} "
            f"({problem.criteria.relative:g} of the largest force): {self._remedy(problem.solver.iterative)}",
            history,
            smaller_steps_help=False,
        )

    def _remedy(self, iterative: bool) -> str:
        """Return a remedy for a residual above its bound."""
        if iterative:
            return "use the direct solver"
        more = f", or accept it with Criteria(relative={2 * self.relative:.0e})" if 2 * self.relative <= NOTABLE else ""
        return (
            "round-off allows no less if moduli or displacements differ by many orders of magnitude. Put a rigid obstacle "
            f"in the place of a stiff body{more}"
        )


def balance(
    problem: Problem, u: Array, contact_force: Array, external: Array, largest_so_far: float,
    internal: tuple[Array, tuple[float, float]],
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
    out = force_of_terms - contact_force
    out -= external
    reaction, residual = problem.system.balance(out)
    forces = (reaction, contact_force, external)
    force = max(largest(part) for part in forces)
    largest_so_far = max(largest_so_far, force)
    bound = max(criteria.relative * force, criteria.absolute or 0.0)
    off, round_off, noise = residual, 0.0, 0.0
    if not 0.0 < residual <= bound:
        # In stiff parts with large displacements, the round-off of internal forces may exceed the forces in soft parts. If
        # there are no forces, the relative residual is not defined, and the round-off of internal forces is the bound. Both
        # cases need the row sums, which cost as much as a product with K.
        row_sums = problem.system.K.row_sums(problem.accurate_to(u))
        residual = problem.system.balance(out, SUM_ROUND_OFF * row_sums)[1]
        round_off, noise = _round_off(problem, row_sums, forces, largest_so_far)
    reaction = reaction[: problem.model.mesh.points.size]
    if problem.model.springs:
        reaction = reaction + ground_force(problem.model.springs, u[: len(reaction)])
    return Balance(
        reaction,
        largest_so_far,
        residual,
        max(bound, round_off),
        float(off / force) if force > round_off else 0.0,
        noise,
        energy,
    )


def _round_off(
    problem: Problem, row_sums: Array, forces: tuple[Array, ...], largest_force: float
) -> tuple[float, float]:
    """Return a bound of the residual that is due to round-off, and the level of round-off.

    Forces are significant if one of them exceeds the level of round-off, and if the round-off of its row is below the
    criterion. The bound is then small, so that the round-off of stiff parts does not hide the residual of soft ones. If no
    force is significant, the bound is the error of the internal forces.

    Parameters
    ----------
    problem : Problem
    row_sums : ndarray (n_dofs,)
        ``abs(K) @ abs(u)`` [force].
    forces : tuple of ndarray
        Reactions, contact forces and external forces [force].
    largest_force : float
        Largest force of all steps so far [force].

    Returns
    -------
    bound, level : float
        [force].
    """
    slack = ROUND_OFF * largest_force
    noise = max(slack, SIGNIFICANT * SUM_ROUND_OFF * largest(row_sums))
    for part in map(np.abs, forces):
        if ((part > noise) & (part * problem.criteria.relative > SUM_ROUND_OFF * row_sums)).any():
            return slack, noise
    return max(max(ROUND_OFF, 10 * problem.solver.tolerance) * largest(row_sums), slack), noise


@dataclass(frozen=True, eq=False)
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
    terms : Terms
        Terms of the equilibrium.
    newton : list of dict
        Convergence data of each Newton iteration; empty if all bodies are linear.
    """

    settled: SettledContact | None
    u: Array
    balance: Balance
    terms: Terms
    newton: list[dict[str, Any]] = field(default_factory=list)

    @property
    def bodies(self) -> DeformedBodies | None:
        """The nonlinear bodies at the displacements u; None if bodies are linear."""
        return None if self.terms.bodies is None else self.terms.bodies.at(self.u)

    @property
    def history(self) -> list[dict[str, Any]]:
        """Convergence data of each pairing of the contact surfaces."""
        return self.settled.iterate.history if self.settled is not None else []

    def counts(self, linear_iterations: int) -> dict[str, Any]:
        """Return the numbers of iterations of the step, see `StepResult.iterations`.

        For nonlinear bodies the history is that of Newton's method, and the numbers are sums over all Newton iterations.
        """
        history, scatter = self.history, None if self.settled is None else self.settled.scatter
        counts: dict[str, Any] = {
            "geometry_updates": max(len(history) - 1, 0),
            "active_set_iterations": sum(entry["active_set_iterations"] for entry in history),
            "linear_iterations": linear_iterations,
            "history": history,
            **({} if scatter is None else {"scatter": asdict(scatter)}),
        }
        if self.terms.prepared:
            return counts
        names = {"geometry_updates": "pairings", "active_set_iterations": "active_set_iterations"}
        of_newton = {name: sum(entry[key] for entry in self.newton) for name, key in names.items()}
        return {**counts, **of_newton, "history": self.newton}


def with_loads(problem: Problem, load: StepLoad) -> Loaded:
    """Return the prepared matrix of the problem with the right-hand side of a load."""
    return problem.solver.load(problem.system.right(load.force, load.lift))


def solve_displacements(
    problem: Problem, load: StepLoad, loaded: Loaded, settled: SettledContact | None, guess: Array
) -> tuple[Array, Array]:
    """Return all displacements (n_dofs,) [length] and the nodal contact forces (n_dofs,) [force].

    `settled` is the contact solution, None without contact. Iterative solvers then begin with the displacements `guess`
    (n_dofs,) [length].
    """
    system, lift = problem.system, load.lift
    if settled is None:
        none = csr_array((0, len(lift))), np.empty(0)
        v = loaded.solve(*none, guess=system.unknowns(guess, lift))[0]
        return system.displacement(v, lift), np.zeros(len(lift))
    contact_force, rigid = settled.force, settled.iterate.rigid
    if problem.floating_bodies is not None and rigid is not None:
        lift = lift + problem.floating_bodies.rigid(rigid.position)
    v = loaded.full_solution(system.reduced(contact_force), settled.solution.u)
    return system.displacement(v, lift), contact_force
