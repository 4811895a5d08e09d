"""Newton's method for the contact geometry of a load step, by directional derivatives.

With the pairing at displacements u the contact problem has a solution S(u), and the load step requires u = S(u). Newton's
method accounts for the variation of the geometry: of the change v of the displacements in

    v = S(u) - u + S'(u) v

the last term is the response of the solution, with fixed active set, to the variation of forces and gaps with the geometry
along v, see `contact.linearised_geometry`. It is a third of v or less, so that a few iterations of GMRES solve for v, each at
the cost of a back substitution. Derivatives of frictional slips with respect to the geometry are not available.
"""

from __future__ import annotations

import numpy as np
from numpy.linalg import LinAlgError
from scipy.sparse.linalg import LinearOperator, gmres

from fastcontact._jit.norms_kernels import largest, largest_difference
from fastcontact.analysis.inequalities import StepContext
from fastcontact.analysis.solution import Equilibrium, Solution
from fastcontact.arrays import Array
from fastcontact.contact.constraints import StackedConstraints
from fastcontact.contact.linearised_geometry import Linearised

# Relative residual of the change, and the largest number of iterations.
ACCURACY, MOST = 1e-6, 20


def newton_step(
    step: StepContext, constraints: StackedConstraints, solution: Solution, before: Array, image: Array
) -> Array | None:
    """Return the active displacements (k,) of the next pairing [length]; None where the geometry is not linearised.

    Parameters
    ----------
    step : StepContext
    constraints : StackedConstraints
        Paired at displacements `before` (k,) [length].
    solution : Solution
        Solution with these constraints.
    before, image : ndarray (k,)
        Active displacements of the pairing and of the solution [length]; displacements on which contact does not depend are
        taken from the latter.
    """
    if (
        not isinstance(solution, Equilibrium)
        or solution.response is None
        or not (parts := _linearised(constraints, solution))
    ):
        return None
    try:
        respond = solution.response()
    except LinAlgError:
        return None
    dim, n_dofs, where = step.problem.model.mesh.dim, len(step.load.lift), step.dofs.compared
    gaps = np.zeros(len(constraints))

    def along(v: Array) -> Array:
        """Return ``v - S'(u) v``."""
        active = np.zeros_like(image)
        active[where] = v
        u = step.dofs.put(np.zeros(n_dofs), active)
        force, nodal = np.zeros(n_dofs), u[: step.problem.model.n_dofs].reshape(-1, dim)
        for rows, part in parts:
            varied, gaps[rows] = part.along(nodal)
            force[: varied.size] += varied.ravel()
        return v - step.dofs.varied(respond(step.dofs.reduced(force), gaps))[where]

    changed = (image - before)[where]
    system = LinearOperator((len(changed),) * 2, matvec=along, dtype=float)
    size = largest(changed) or 1.0
    v, _ = gmres(system, changed / size, rtol=ACCURACY, atol=0.0, restart=MOST, maxiter=1)
    # Far from the solution a step in which the response adds more than the change itself leads anywhere.
    if not largest_difference(size * v, changed) <= size:
        return None
    mixed = image.copy()
    mixed[where] = before[where] + size * v
    return mixed


def _linearised(constraints: StackedConstraints, solution: Solution) -> list[tuple[slice, Linearised]]:
    """Return the linearised geometry of pairs in contact with the rows of each; empty if a pair has none."""
    parts = []
    for name, rows in constraints.rows().items():
        part, multiplier = constraints.parts[name], solution.multiplier[rows]
        if part.tied is not None or not multiplier.any():
            continue
        if part.geometry is None:
            return []
        parts.append((rows, part.geometry(multiplier)))
    return parts
