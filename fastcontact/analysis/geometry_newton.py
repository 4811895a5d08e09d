"""Newton's method for the contact geometry of a load step, by directional derivatives.

With the pairing at displacements u the contact problem has a solution S(u), and the load step requires u = S(u). Newton's
method solves

    v = S(u) - u + S'(u) v

for the change v of the displacements. The last term is the response of the solution, with fixed active set, to the variation
of forces and gaps with the geometry along v, see `contact.linearised_geometry`. Its norm is usually at most a third of that
of v, so that a few iterations of GMRES suffice, each at the cost of a back substitution. Slips and integrals over facets are
linearised at the displacements S(u), all other terms at u; the difference is of second order.
"""

from __future__ import annotations

import numpy as np
from numpy.linalg import LinAlgError
from scipy.sparse.linalg import LinearOperator, gmres

from fastcontact._jit.norms_kernels import largest, largest_difference
from fastcontact.analysis.inequalities import StepContext
from fastcontact.analysis.shared_nodes import SharedNodes
from fastcontact.analysis.solution import Solution
from fastcontact.arrays import Array
from fastcontact.contact.constraints import StackedConstraints
from fastcontact.contact.linearised_geometry import Linearised
from fastcontact.round_off import SINGLE_PRECISION

# Relative residual of the change over what suffices at the end. With as much as suffices, steps of plastic bodies take a
# tenth more pairings.
AT_END = 0.01


def newton_step(
    step: StepContext, constraints: StackedConstraints, solution: Solution, before: Array, image: Array, accuracy: float,
    nodes: SharedNodes | None = None,
) -> tuple[Array, float] | None:  # fmt: skip
    """Return the active displacements (k,) of the next pairing [length], and the norm of S'; None without derivatives.

    Parameters
    ----------
    step : StepContext
    constraints : StackedConstraints
        Paired at displacements `before` (k,) [length].
    solution : Solution
        Solution with these constraints, where representatives replace the constraints of shared nodes.
    before, image : ndarray (k,)
        Active displacements of the pairing and of the solution [length]; displacements that solutions do not determine are
        taken from the latter.
    accuracy : float
        Relative accuracy of the change that suffices.
    nodes : SharedNodes, optional
        Nodes that several pairs, or both ends of a period, share.
    """
    u = step.dofs.put(step.state.u.copy(), image)
    displacement = step.problem.displacement(u)
    if nodes is not None:
        solution = nodes.shared(solution, constraints, u)
    if solution.response is None or not (parts := _linearised(constraints, solution, displacement)):
        return None
    try:
        respond = solution.response()
    except LinAlgError:
        return None
    n_dofs, where = len(step.load.lift), step.dofs.compared
    gaps = np.zeros((1 + len(constraints.tangents), len(constraints)))

    def varied(v: Array) -> Array:
        """Return the active components (k,) of ``S'(u) v``."""
        active = np.zeros_like(image)
        active[where] = v
        u = step.dofs.put(np.zeros(n_dofs), active)
        force, nodal = np.zeros(n_dofs), step.problem.displacement(u)
        for rows, part in parts:
            varied, changed = part.along(nodal)
            gaps[: len(changed), rows] = changed
            force[: varied.size] += varied.ravel()
        merged = gaps if nodes is None else nodes.merged(gaps)
        return step.dofs.varied(respond(step.dofs.reduced(force), merged))

    changed = (image - before)[where]
    system = LinearOperator((len(changed),) * 2, matvec=lambda v: v - varied(v)[where], dtype=float)
    size = largest(changed) or 1.0
    v, _ = gmres(system, changed / size, rtol=max(SINGLE_PRECISION, AT_END * accuracy), atol=0.0, maxiter=1)
    responding = largest_difference(size * v, changed)
    # Far from the solution, a step in which the response exceeds the change itself is unreliable.
    if not responding <= size:
        return None
    mixed, determined = image.copy(), step.dofs.determined
    if len(determined) > len(where):  # there are springs of floating bodies
        mixed[determined] += size * varied(v)[determined]
    else:
        mixed[where] = before[where] + size * v
    return mixed, responding / (size * largest(v) or 1.0)


def _linearised(
    constraints: StackedConstraints, solution: Solution, displacement: Array
) -> list[tuple[slice, Linearised]]:
    """Return the linearised geometry of pairs in contact with the rows of each; empty if a pair has none."""
    parts = []
    for name, rows in constraints.rows.items():
        part, multiplier = constraints.parts[name], solution.multiplier[rows]
        tangential = np.zeros((len(part), 0))
        if solution.tangential is not None:
            tangential = solution.tangential[rows, : len(part.tangents)]
        if part.tied is not None or not multiplier.any():
            continue
        if part.geometry is None:
            return []
        parts.append((rows, part.geometry(multiplier, tangential, displacement)))
    return parts
