"""Load steps in which constraints close and slide, whose friction is solved in increments (`solution.in_increments`).

Once the geometry has nearly converged, the contact problem of a pairing is solved in increments. For later pairings only
the last increment is solved again, with the slips of the earlier ones, unless the geometry changes gaps and slips
noticeably.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fastcontact.analysis.criteria import NOTABLE
from fastcontact.analysis.inequalities import Iterate, StepContext, pair_surfaces
from fastcontact.analysis.shared_nodes import SharedNodes
from fastcontact.analysis.solution import LoadPath, Solution
from fastcontact.arrays import Array, largest
from fastcontact.contact.constraints import StackedConstraints
from fastcontact.contact.surface import Surface
from fastcontact.round_off import LENGTH_ROUND_OFF, SINGLE_PRECISION


@dataclass(eq=False, repr=False)
class FrictionIncrements:
    """Decision whether the friction of a load step is solved in increments, and in which pairings; see `geometry_loop`.

    Attributes
    ----------
    step : StepContext
        If Newton's method applies to the contact geometry, the increments are solved once the geometry has nearly converged,
        otherwise once it has converged.
    due : bool
        Whether the next pairing is solved in increments.
    unfinished : bool
        Whether the last pairing was solved in increments, so that its last increment is to be solved again.
    """

    step: StepContext
    due: bool = False
    unfinished: bool = False
    # Constraints of the last pairing that was solved in increments, and the last change of the gaps and slips since then.
    _paired: StackedConstraints | None = None
    _shift: float = np.inf
    _settled: bool = False

    def with_path(
        self, step: StepContext, constraints: StackedConstraints, u: Array, nodes: SharedNodes | None
    ) -> StepContext:
        """Return the step in which a pairing at displacements u (n_dofs,) is solved.

        It has a `LoadPath` if increments are due, and is unchanged otherwise.
        """
        self.unfinished = False
        if not (self.due or (self._paired is not None and self._outdated(self._paired, constraints, u))):
            return step
        path = _path(step, constraints, nodes)
        self.due, self.unfinished, self._paired = False, path is not None, constraints
        return step if path is None else replace(step, path=path)

    def update(self, constraints: StackedConstraints, solution: Solution, excess: float, size: float, u: Array) -> None:
        """Set `due`, given the solution of a pairing with the displacements `u` (n_dofs,) [length].

        `excess` is the change of the displacements beyond the tolerance, and `size` the largest displacement [length].
        """
        shear_limit = self.step.problem.friction_while_touching
        near = NOTABLE if self.step.linearises_contact else 0.0
        self._settled = shear_limit < 1.0 and solution.settled and excess <= near * size
        self._active, self._size = solution.active, size
        if self._paired is None:
            self.due = self._settled and _slides(self.step, constraints, solution, shear_limit)
        else:
            self.due = self._outdated(self._paired, constraints, u)

    def _outdated(self, before: StackedConstraints, constraints: StackedConstraints, u: Array) -> bool:
        """Return whether the geometry has changed since the increments were solved, but by less than the last time.

        The slips of the earlier increments belong to the pairing in which they were solved.
        """
        start = self.step.state.u
        if not (self._settled and self.step.problem.until_settled):
            return False
        if not len(before) == len(constraints) == len(self._active):  # slips of other constraints cannot be used
            return True
        difference = _gaps_and_slips(before, u, start) - _gaps_and_slips(constraints, u, start)
        shift = largest(difference[self._active])
        outdated = SINGLE_PRECISION * self._size < shift < self._shift
        self._shift = shift if outdated else self._shift
        return outdated


def _gaps_and_slips(constraints: StackedConstraints, u: Array, start: Array) -> Array:
    """Return the gaps and the slip vectors of constraints, (m, 1 + dim) [length].

    Displacements are `u` (n_dofs,), and at the beginning of the step `start` (n_dofs,) [length].
    """
    tangents = zip(constraints.tangents, constraints.slip0, constraints.directions, strict=True)
    vectors = [(T @ (u - start) + slip0)[:, None] * direction for T, slip0, direction in tangents]
    return np.column_stack([constraints.gap0 + constraints.B @ u, np.sum(vectors, axis=0)])


def _slides(step: StepContext, constraints: StackedConstraints, solution: Solution, limit: float) -> bool:
    """Return whether nodes that close in the step carry more shear than the fraction `limit` of the friction capacity."""
    if not constraints.tangents or (forces := _forces(step, constraints)) is None:
        return False
    shear, capacity = np.linalg.norm(solution.tangential, axis=1), constraints.friction * solution.multiplier
    frictional = solution.active & (constraints.friction > 0.0)
    return bool(shear[frictional & (forces[0] == 0.0)].sum() > limit * capacity[frictional].sum())


def _path(step: StepContext, constraints: StackedConstraints, nodes: SharedNodes | None) -> LoadPath | None:
    """Return the path of a step with the gaps and forces at its beginning.

    None if no constraint is open there, or if the forces are unknown.
    """
    forces = _forces(step, constraints)
    if forces is None:
        return None
    normal, traction = forces
    state, gaps, known = step.state, [], []  # in the configuration at the beginning of the step
    begin = replace(step.load, obstacles=state.obstacles, angles=state.angles)
    for name, part in pair_surfaces(step.problem, state, begin, Iterate.of(state)).parts.items():
        current = constraints.parts[name]
        same = np.array_equal(part.positions, current.positions)
        initial = part if same else current
        determined = np.isfinite(initial.gap0) & initial.usable
        known.append(determined & same)
        gaps.append(np.where(determined, initial.gaps(state.u), current.gaps(state.u)))
    gap = np.where(normal != 0.0, 0.0, np.maximum(np.concatenate(gaps), 0.0))
    size = float(np.ptp(step.problem.model.mesh.points, axis=0).max())
    slips = _closing(step, constraints, gap)
    determined = np.concatenate(known)
    if nodes is not None:
        determined[nodes.redundant] = False
        gap, normal, traction, slips = nodes.of_representatives(constraints, gap, normal, traction, slips)
    waiting = (gap > LENGTH_ROUND_OFF * size) & ~constraints.equality
    geometry = constraints.positions, tuple(constraints.rows.values())
    return LoadPath(gap, normal, traction, slips, waiting, determined, *geometry) if waiting.any() else None


def _closing(step: StepContext, constraints: StackedConstraints, gap: Array) -> Array:
    """Return the tangential part (m, dim) of the relative displacements that close gaps (m,) along inclined normals [length].

    It is not slip, see `LoadPath`. The constraints contain it as `slip0`, for the gaps of the last pairing at the
    displacements at the beginning of the step. Here it is scaled to `gap`.
    """
    closing = np.zeros_like(constraints.positions)
    for name, rows in constraints.rows.items():
        if isinstance(step.problem.pairs[name].primary, Surface):
            tangents = np.stack([tangent[rows] for tangent in constraints.directions])
            begin_gap = constraints.parts[name].gaps(step.state.u)
            ratio = np.divide(gap[rows], begin_gap, out=np.ones_like(begin_gap), where=begin_gap > 0.0)
            closing[rows] = np.einsum("km,kmd->md", ratio * constraints.slip0[:, rows], tangents)
    return closing


def _forces(step: StepContext, constraints: StackedConstraints) -> tuple[Array, Array] | None:
    """Return normal (m,) and tangential (m, dim) forces at the beginning of the step [force]; None if unknown.

    Forces of equality constraints are not needed.
    """
    normal, traction = np.zeros(len(constraints)), np.zeros_like(constraints.positions)
    for name, rows in constraints.rows.items():
        part, before = constraints.parts[name], step.state.forces.get(name)
        if before is not None and part.areas is not None and part.wetted is None:
            normal[rows], traction[rows] = before.at(part.positions, part.finite_areas)
        elif name in step.state.touched and not part.equality.all():
            return None
    return normal, traction
