"""Contact forces and gaps as functions of the configuration of the pairing, and their derivatives.

Contact is paired on the deformed configuration: forces ``B.T multiplier`` and gaps ``gap0 + B u`` also depend on the
displacement through B and gap0 (Wriggers, Computational Contact Mechanics, 2006, chapter 6). Their directional derivatives
are those of Newton's method, see `contact.linearised_geometry`, where these are complete. Otherwise, as in mortar contact
between bodies, they are finite differences of the pairing alone. A point of a surface only affects the constraints around
it, so that distant points are moved simultaneously (Curtis, Powell and Reid, J. Inst. Math. Appl. 13, 1974).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array, eye_array, hstack, kron, vstack

from fastcontact._tools.records import record, replace
from fastcontact.analysis.contact_result import closed_node_pressures
from fastcontact.analysis.geometry_loop import linearised_pairs
from fastcontact.analysis.inequalities import Iterate, pair_surfaces
from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.analysis.solution import Solution
from fastcontact.analysis.state import State
from fastcontact.arrays import Array, Indices, Mask, largest, scattered
from fastcontact.contact.constraints import StackedConstraints
from fastcontact.contact.linearised_geometry import LinearisedPoints
from fastcontact.contact.surface import Surface
from fastcontact.errors import ModelError
from fastcontact.linear.sparse_rows import entry_rows, without_zeros
from fastcontact.round_off import DIFFERENCE_STEP

REMEDY = "Change the load slightly, or use one-sided finite differences between two solutions"
OPPOSITE_NODES = (
    f"{REMEDY}; or keep the pairing (Criteria(keep_pairing=True)), mesh both sides differently, or use the default "
    "formulation (omit formulation and multipliers)"
)
# Increment of finite differences, relative to the admissible range of a constant or to the largest force. One-sided
# differences of smooth functions have errors of this order, and central differences have errors of the order of its square.
INCREMENT = 1e-3


@record
class MovingContact:
    """The contact of a load step with fixed multipliers, for any pairing of its surfaces.

    Attributes
    ----------
    problem : Problem
    state : State
        State at the beginning of the step.
    load : StepLoad
    instant : float
        Pseudo-time at the end of the step.
    u : ndarray (n_dofs,)
        Displacements of the step [length].
    solution : Solution
        Multipliers and active set of the step.
    pressures : dict of str to ndarray (n_nodes,)
        Nodal pressures of each contact pair in the solution [pressure].
    closed : ndarray of bool (n_nodes,), optional
        Closed nodes of the contact pair whose pressures are requested.
    pair : str
        Name of that pair; empty for none.
    """

    problem: Problem
    state: State
    load: StepLoad
    instant: float
    u: Array
    solution: Solution
    pressures: dict[str, Array]
    closed: Mask | None = None
    pair: str = ""

    @cached_property
    def constraints(self) -> StackedConstraints:
        """Constraints at the current configuration."""
        return self.constraints_at(self.u)

    @cached_property
    def active(self) -> Indices:
        """The active constraints (k,)."""
        return np.flatnonzero(self.solution.active)

    def constraints_at(self, u: Array) -> StackedConstraints:
        """Return the constraints of surfaces paired at displacements u (n_dofs,) [length]."""
        constraints = pair_surfaces(self.problem, self.state, self.load, Iterate(u.copy(), {}, self.pressures))
        if len(constraints) != (count := len(self.solution.multiplier)):
            raise ModelError(
                f"contact has {count} constraints, but {len(constraints)} if nodes move: nodes of both sides coincide, and "
                f"the one-sided derivatives differ there. {OPPOSITE_NODES}"
            )
        return constraints

    def sample_at(self, u: Array) -> Array:
        """Return forces, gaps and pressures for surfaces paired at u (n_dofs,), at the displacements `self.u` [length].

        The result contains the nodal contact forces (n_dofs,) [force], then the gaps (k,) of the active constraints with
        their compliance [length], then the nodal pressures (n_nodes,) of the pair if they are requested.
        """
        constraints, multiplier = self.constraints_at(u), self.solution.multiplier
        gap = constraints.gap0 + constraints.B @ self.u + constraints.elastic_gaps(multiplier)
        pressure = self.pressure(multiplier, constraints)
        return np.concatenate([constraints.force(multiplier), gap[self.active], pressure])

    def pressure(self, multiplier: Array, constraints: StackedConstraints | None = None) -> Array:
        """Return the nodal pressures (n_nodes,) of the pair for multipliers (m,) [force] [pressure]."""
        if not self.pair:
            return np.empty(0)
        constraints = constraints or self.constraints
        assert self.closed is not None
        pair = constraints.parts[self.pair]
        forces = pair.normal_forces(pair.contact_forces(multiplier[constraints.rows[self.pair]]))
        return closed_node_pressures(pair, forces, self.closed, self.problem.pairs[self.pair].secondary)[1]

    def parameter_derivative(self, modified: Callable[[float], MovingContact], increment: float) -> Array:
        """Return the derivative of `sample_at` with respect to a parameter, which `modified(d)` increases by d."""
        forward, backward = (modified(d).sample_at(self.u) for d in (increment, -increment))
        return (forward - backward) / (2.0 * increment)

    @cached_property
    def increment(self) -> float:
        """Increment by which points are moved [length]."""
        points = self.problem.model.mesh.points
        sizes = [float(block.diameters(points).min()) for side in self._surfaces() for block in side.blocks]
        return DIFFERENCE_STEP * min(sizes, default=np.inf)

    def _surfaces(self) -> list[Surface]:
        pairs = self.problem.pairs.values()
        return [side for pair in pairs for side in (pair.secondary, pair.primary) if isinstance(side, Surface)]

    def derivatives(self, lifts: Sequence[Array]) -> tuple[csr_array, csr_array]:
        """Return forward and backward derivatives (n, n_dofs + q) of `sample_at` with respect to its argument.

        The first columns belong to the unknowns of the system. The others belong to the q `lifts` (n_dofs,), divided by their
        largest component. Points are only moved as the supports allow: if both sides end in a plane of symmetry, a point that
        left the plane would face no facet.

        The mean of both is the derivative. Where they differ by more than the truncation error, a point projects onto the
        edge between two facets.
        """
        if self.problem.criteria.keep_pairing or not len(self.active):
            nodes = len(self.problem.pairs[self.pair].secondary.points) if self.pair else 0
            shape = len(self.u) + len(self.active) + nodes, len(self.u) + len(lifts)
            return csr_array(shape), csr_array(shape)
        dofs = self._moving_dofs
        derivatives = self._differences(_independent_groups(dofs, self._pattern, self.problem.model.mesh.dim))
        if not self._is_consistent(0.5 * (derivatives[0] + derivatives[1])):
            derivatives = self._differences([np.array([dof]) for dof in dofs])
        along_lifts = [self._one_sided(lift / (largest(lift) or 1.0)) for lift in lifts]
        columns = [[csr_array(pair[side][:, None]) for pair in along_lifts] for side in (0, 1)]
        forward, backward = (csr_array(hstack([D, *added])) for D, added in zip(derivatives, columns, strict=True))
        return forward, backward

    def kinks(self, forward: csr_array, backward: csr_array) -> csr_array:
        """Return half the difference of the two `derivatives` where points project onto an edge between two facets."""
        jump, n = csr_array(0.5 * (forward - backward)), len(self.u)
        force = float(np.abs(self.solution.multiplier).max(initial=0.0)) * DIFFERENCE_STEP / self.increment
        row = entry_rows(jump)
        # Half the difference of one-sided derivatives is larger at a kink. Pressures follow from forces: they are smooth
        # where forces are.
        scale = np.where(row < n, force, np.where(row < n + len(self.active), 1.0, np.inf))
        jump.data[np.abs(jump.data) <= INCREMENT * scale] = 0.0
        return without_zeros(jump)

    @cached_property
    def _moving_dofs(self) -> Indices:
        """Unknowns that active constraints may depend on."""
        dim, contact_dofs = self.problem.model.mesh.dim, self.problem.contact_dofs
        points = np.unique(self._pattern.nonzero()[1])
        obstacle_dofs = contact_dofs[contact_dofs >= self.problem.model.n_dofs]
        dofs = (points[:, None] * dim + np.arange(dim)).ravel()
        dofs = np.concatenate([dofs, obstacle_dofs]).astype(np.intp)
        return dofs[self.problem.system.free[dofs]]

    @cached_property
    def _pattern(self) -> csr_array:
        """Pattern (n, n_points) of the derivatives of `sample_at`: the points on whose unknowns each value may depend.

        Forces on obstacles are omitted, which may depend on all points.
        """
        dim, n = self.problem.model.mesh.dim, self.problem.model.mesh.n_points
        B = csr_array(self.constraints.B[self.active])
        keep = (B.indices < self.problem.model.n_dofs) & (B.data != 0.0)
        nonzero = entry_rows(B)[keep], B.indices[keep] // dim
        involved = csr_array((np.ones(keep.sum()), nonzero), shape=(len(self.active), n))
        neighbours = eye_array(n, format="csr")
        for side in self._surfaces():
            m = len(side.points)
            local = csr_array((np.ones(m), (side.points, np.arange(m))), (n, m))
            neighbours = neighbours + local @ side.extended_adjacency @ local.T
        moving = np.ones(len(self.constraints))
        for name, pair in self.problem.pairs.items():
            if pair.options.kind == "tied":  # paired once, before any load
                moving[self.constraints.rows[name]] = 0.0
        of_gaps = csr_array((involved * moving[self.active, None]) @ neighbours)
        if (T := self.problem.system.T) is not None:
            entries = T[: n * dim, : n * dim].tocoo()
            points = entries.row // dim, entries.col // dim
            of_gaps = csr_array(of_gaps @ csr_array((np.ones(entries.nnz), points), shape=(n, n)))
        of_points = csr_array(involved.T @ of_gaps)
        nodes = self.problem.pairs[self.pair].secondary.points if self.pair else np.empty(0, np.intp)
        of_obstacles = csr_array((len(self.u) - n * dim, n))
        return csr_array(vstack([kron(of_points, np.ones((dim, 1))), of_obstacles, of_gaps, of_points[nodes]]))

    def _differences(self, groups: list[Indices]) -> tuple[csr_array, csr_array]:
        """Return the forward and backward derivatives (n, n_dofs), given groups of unknowns that are moved simultaneously."""
        dim, n, size = self.problem.model.mesh.dim, len(self.u), len(self.sample)
        sums = [csr_array((size, n)), csr_array((size, n))]
        for dofs in groups:
            unknowns = scattered(1.0, dofs, n)
            for side, changed in enumerate(self._one_sided(self.problem.system.displacement(unknowns, np.zeros(n)))):
                rows, columns = np.flatnonzero(changed), np.zeros(np.count_nonzero(changed), np.intp)
                if len(dofs) > 1:
                    rows, columns = self._pattern[:, dofs // dim].nonzero()
                sums[side] += csr_array((changed[rows], (rows, dofs[columns])), shape=(size, n))
        return sums[0], sums[1]

    @cached_property
    def sample(self) -> Array:
        """Forces, gaps and pressures at the displacements of the step, see `sample_at`."""
        return self.sample_at(self.u)

    @cached_property
    def _linearised(self) -> list[dict[str, LinearisedPoints]]:
        """Linearised pairs on either side of the configuration, whose derivatives differ at kinks.

        The result is empty if the derivatives in Newton's method are incomplete: they omit constraints without force, the
        variation of the segments in mortar contact between bodies, and that of overhangs.
        """
        problem, u, sides = self.problem, self.u, list[dict[str, LinearisedPoints]]()
        pairs = problem.pairs.values()
        has_segments = any(pair.name == "mortar" and isinstance(pair.primary, Surface) for pair in pairs)
        if has_segments or not self.solution.multiplier[self.active].all():
            return sides
        shift = self.increment * problem.system.displacement(self._direction, np.zeros(len(u)))
        for side in (1.0, -1.0):
            found = linearised_pairs(self.constraints_at(u + side * shift), self.solution, problem.displacement(u))
            exact = {name: p for name, p in found.items() if isinstance(p, LinearisedPoints) and not p.points.overhangs}
            if not exact or len(exact) < len(found):
                return []
            sides.append(exact)
        return sides

    def _one_sided(self, motion: Array) -> tuple[Array, Array]:
        """Return the forward and the backward derivative of `sample_at` along a motion (n_dofs,) of the points."""
        problem, n = self.problem, len(motion)
        if self._linearised:
            derivatives, gaps = np.zeros((2, len(self.sample))), np.zeros((2, len(self.constraints)))
            for side, pairs in enumerate(self._linearised):
                for name, pair in pairs.items():
                    nodal_motion, driven = problem.displacement(motion), problem.force_driven.number(name)
                    if driven is not None:  # only the motion relative to the obstacle counts
                        nodal_motion = nodal_motion - motion[problem.force_driven.dofs(driven)]
                    forces, (gaps[side, self.constraints.rows[name]], *_) = pair.derivatives_along(nodal_motion)
                    derivatives[side, : forces.size] += forces.ravel()
                    if driven is not None:
                        derivatives[side, problem.force_driven.dofs(driven)] -= forces.sum(axis=0)
            # Nodal pressures depend on the multipliers alone.
            derivatives[:, n : n + len(self.active)] = gaps[:, self.active]
            return derivatives[0], derivatives[1]
        increment = self.increment / (largest(motion) or 1.0)

        def at(distance: float) -> Array:
            shift = distance * motion
            # Displacements of force-driven obstacles that are prescribed are taken from the load.
            load = replace(self.load, lift=self.load.lift + np.where(self.problem.system.fixed, shift, 0.0))
            return replace(self, load=load).sample_at(self.u + shift)

        return (at(increment) - self.sample) / increment, (self.sample - at(-increment)) / increment

    @cached_property
    def _direction(self) -> Array:
        """Unknowns (n_dofs,) of a direction in which all points move [-]."""
        dofs = self._moving_dofs
        return scattered(np.random.default_rng(0).uniform(-1.0, 1.0, len(dofs)), dofs, len(self.u))

    def _is_consistent(self, derivative: csr_array) -> bool:
        """Return whether the derivative agrees with that along a direction in which all points move."""
        shift = self._direction
        forward, backward = self._one_sided(self.problem.system.displacement(shift, np.zeros(len(shift))))
        difference = 0.5 * (forward + backward)
        n, k = len(self.u), len(self.active)
        error = np.abs(difference - derivative @ shift)
        blocks = (slice(0, n), slice(n, n + k), slice(n + k, None))
        return all(largest(error[block]) <= INCREMENT**2 * largest(difference[block]) for block in blocks)


def _independent_groups(dofs: Indices, pattern: csr_array, dim: int) -> list[Indices]:
    """Return groups of components, no two of which affect the same value; `pattern` is `MovingContact._pattern`."""
    n_points, dependent = pattern.shape[1], csr_array(pattern.T @ pattern)
    colour = np.full(n_points, -1)
    for point in np.unique(dofs[dofs < n_points * dim] // dim):
        used = set(colour[dependent.indices[dependent.indptr[point] : dependent.indptr[point + 1]]].tolist())
        colour[point] = next(c for c in range(n_points) if c not in used)
    of_colours = [np.flatnonzero(colour == c) * dim for c in range(colour.max(initial=-1) + 1)]
    groups = [np.intersect1d(first + axis, dofs) for first in of_colours for axis in range(dim)]
    return [group for group in groups if len(group)] + [np.array([dof]) for dof in dofs[dofs >= n_points * dim]]
