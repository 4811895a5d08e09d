"""The equilibrium at the end of a load step, and the solution for all displacements with known contact forces."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from fastcontact.analysis.balance import Balance
from fastcontact.analysis.geometry_loop import SettledContact
from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.analysis.terms import Terms
from fastcontact.arrays import Array
from fastcontact.elasticity.nonlinear_bodies import DeformedBodies
from fastcontact.linear.protocol import Loaded


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
