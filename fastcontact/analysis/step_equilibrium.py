"""The equilibrium at the end of a load step."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from fastcontact.analysis.balance import Balance
from fastcontact.analysis.geometry_loop import SettledContact
from fastcontact.analysis.terms import Terms
from fastcontact.arrays import Array
from fastcontact.elasticity.nonlinear_bodies import DeformedBodies


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

    @property
    def counts(self) -> dict[str, Any]:
        """Iteration history of nonlinear bodies, with the pairings and active-set iterations of all iterations."""
        if self.terms.prepared:
            return {}
        names = {"geometry_updates": "pairings", "active_set_iterations": "active_set_iterations"}
        counts = {name: sum(entry[key] for entry in self.newton) for name, key in names.items()}
        return {**counts, "history": self.newton}
