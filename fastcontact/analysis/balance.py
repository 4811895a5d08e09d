"""Equilibrium at the end of a load step: reactions and the residual."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fastcontact._jit.norms_kernels import largest
from fastcontact.analysis.criteria import NOTABLE
from fastcontact.analysis.problem import Problem
from fastcontact.arrays import Array
from fastcontact.elasticity.springs import ground_force
from fastcontact.errors import ConvergenceError
from fastcontact.round_off import ROUND_OFF, SUM_ROUND_OFF

# Forces are significant above this multiple of the round-off of other rows.
SIGNIFICANT = 100.0


@dataclass(frozen=True, eq=False)
class Balance:
    """Forces at the end of a load step.

    Attributes
    ----------
    reaction : ndarray (n_dofs of the mesh,)
        Forces of supports, linear relations and springs to the ground [force].
    largest : float
        The largest force of all steps so far [force].
    residual : float
        The largest out-of-balance force; above the bound, less the round-off of its own row [force].
    bound : float
        Largest admissible residual [force].
    relative : float
        The largest out-of-balance force over the largest force of this step, zero where it is round-off.
    noise : float
        Forces up to this are round-off [force].
    energy : (float, float)
        Strain energy, springs included, and plastic work since the beginning [energy].
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
        """Residual relative to its tolerance."""
        return self.residual / self.bound if self.bound else float(np.inf if self.residual else 0.0)

    @property
    def wanting(self) -> float:
        """Factor by which the accuracy of solutions should increase.

        With errors above round-off it is undecided whether there are any forces at all, e.g. after bodies have
        separated: this is decided first, which takes much less than a balance of forces that may not exist.
        """
        return self.residual / self.noise if self.residual > self.noise > self.bound else self.excess

    def check(self, index: int, problem: Problem, history: Sequence[dict[str, Any]]) -> None:
        """Raise ConvergenceError for step `index` if the residual is beyond its bound."""
        if self.residual <= self.bound:
            return
        raise ConvergenceError(
            f"step {index}: the out-of-balance force {self.residual:.3g} stays above {self.bound:.3g} "
            f"({problem.criteria.relative:g} of the largest force): {self._remedy(problem.solver.iterative)}",
            history,
            smaller_steps_help=False,
        )

    def _remedy(self, iterative: bool) -> str:
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
    """Return the reactions, and the residual of all other degrees of freedom.

    Parameters
    ----------
    problem : Problem
    u : ndarray (n_dofs,)
        Displacements [length].
    contact_force, external : ndarray (n_dofs,)
        Nodal forces of contact and of loads [force].
    largest_so_far : float
        The largest force of the steps so far [force].
    internal : (ndarray (n_dofs,), (float, float))
        Forces [force] and energies [energy] of the terms, see `Terms.residual`.
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
        # In stiff parts with large displacements round-off of their own rows may exceed the forces of soft parts.
        # Without forces the criterion is 0/0: round-off of all rows decides. Either case costs a product with K.
        row_sums = problem.system.K.row_sums(problem.accurate_to(u))
        residual = problem.system.balance(out, SUM_ROUND_OFF * row_sums)[1]
        round_off, noise = _round_off(problem, row_sums, forces, largest_so_far)
    n_dofs = problem.model.n_dofs
    return Balance(
        reaction[:n_dofs] + ground_force(problem.model.springs, u[:n_dofs]),
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
    """Return the error bound of internal forces if all `forces` (n_dofs,) are round-off, and the level of round-off [force].

    `row_sums` (n_dofs,) is ``|K| |u|`` [force]. Forces are round-off if no degree of freedom has a force accurate to the
    criterion, or the force itself may be round-off of other rows. Otherwise the forces define the bound: stiff parts with
    large displacements must not hide the residual of soft ones.
    """
    slack = ROUND_OFF * largest_force
    noise = max(slack, SIGNIFICANT * SUM_ROUND_OFF * largest(row_sums))
    for part in map(np.abs, forces):
        if ((part > noise) & (part * problem.criteria.relative > SUM_ROUND_OFF * row_sums)).any():
            return slack, noise
    return max(max(ROUND_OFF, 10 * problem.solver.tolerance) * largest(row_sums), slack), noise
