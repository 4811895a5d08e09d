"""The balance of forces at the end of a load step: reactions, and what is left out of balance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact._jit.norms_kernels import largest
from fastcontact.analysis.problem import Problem
from fastcontact.analysis.unsupported_bodies import SLACK
from fastcontact.elasticity.springs import ground_force
from fastcontact.errors import ConvergenceError

Array = NDArray[np.float64]


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
        The largest force that nothing balances [force].
    bound : float
        What is allowed of it [force].
    relative : float
        The residual over the largest force of this step, zero where that is round-off.
    """

    reaction: Array
    largest: float
    residual: float
    bound: float
    relative: float

    def check(self, index: int, relative: float, history: Sequence[dict[str, Any]]) -> None:
        """Raise ConvergenceError for step `index` if the residual is beyond its bound, the criterion being `relative`."""
        if not self.residual <= self.bound:
            raise ConvergenceError(
                f"step {index}: the out-of-balance force {self.residual:.3g} stays above {self.bound:.3g} "
                f"({relative:g} of the largest force): use the direct solver or a smaller tolerance",
                history,
            )


def balance(problem: Problem, u: Array, contact_force: Array, external: Array, largest_so_far: float) -> Balance:
    """Return the reactions, and check that all other degrees of freedom are in balance.

    Parameters
    ----------
    problem : Problem
    u : ndarray (n_dofs,)
        Displacements [length].
    contact_force, external : ndarray (n_dofs,)
        Nodal forces of contact and of loads [force].
    largest_so_far : float
        The largest force of the steps so far [force].
    """
    criteria = problem.criteria
    out = problem.system.K @ u
    out -= contact_force
    out -= external
    reaction, residual = problem.system.balance(out)
    force = max(largest(forces) for forces in (reaction, contact_force, external))
    largest_so_far = max(largest_so_far, force)
    bound = max(criteria.relative * force, criteria.absolute or 0.0)
    # Without forces the criterion is 0/0: round-off of the internal forces decides, which costs a product with K.
    round_off = 0.0 if 0.0 < residual <= bound else _round_off(problem, u, largest_so_far)
    n_dofs = problem.model.n_dofs
    return Balance(
        reaction[:n_dofs] + ground_force(problem.model.springs, u[:n_dofs]),
        largest_so_far,
        residual,
        max(bound, round_off),
        float(residual / force) if force > round_off else 0.0,
    )


def _round_off(problem: Problem, u: Array, largest_force: float) -> float:
    """Return how far internal forces may be off by round-off and the tolerance of the linear solver [force]."""
    row_sums = problem.system.K.largest_row_sum(u)
    return max(max(1e-13, problem.solver.tolerance) * 10 * row_sums, SLACK * largest_force)
