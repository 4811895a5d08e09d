"""The equilibrium at the end of a load step, and its displacements for known contact forces."""

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
        None without contact.
    u : ndarray (n_dofs,)
        [length]
    balance : Balance
    terms : Terms
    newton : list of dict
        An entry for each iteration, if tangents vary.
    """

    settled: SettledContact | None
    u: Array
    balance: Balance
    terms: Terms
    newton: list[dict[str, Any]] = field(default_factory=list)

    @property
    def bodies(self) -> DeformedBodies | None:
        """The bodies, if they are nonlinear."""
        return None if self.terms.bodies is None else self.terms.bodies.at(self.u)

    @property
    def history(self) -> list[dict[str, Any]]:
        """An entry for each geometry update of the contact."""
        return self.settled.iterate.history if self.settled is not None else []

    def counts(self, linear_iterations: int) -> dict[str, Any]:
        """Return the work of the step, see `StepResult.iterations`.

        For nonlinear bodies the history is that of Newton's iterations, with the pairings and active-set iterations of all.
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
    """Return the equations of the step: the prepared matrix with the right-hand side of its loads."""
    return problem.solver.load(problem.system.right(load.force, load.lift))


def solve_displacements(
    problem: Problem, load: StepLoad, loaded: Loaded, settled: SettledContact | None, guess: Array
) -> tuple[Array, Array]:
    """Return all displacements [length] and the contact forces [force], both (n_dofs,).

    Without contact, iterative solvers begin at the displacements `guess` (n_dofs,) [length].
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
