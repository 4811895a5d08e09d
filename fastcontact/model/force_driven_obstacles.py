"""Rigid obstacles moved by forces. Each obstacle adds one point without stiffness, which is held by contact only.

The additional points follow those of the mesh, and their displacements are those of the obstacles. Components driven by a
force are rigid-body motions like those of a floating body, and are regularised by the same weak springs (see
`analysis.floating_bodies`); the other components are prescribed. A gap to a rigid obstacle changes by ``n . (u - q)``, where
q is the displacement of the obstacle. In the row of a gap, the entries of q are therefore minus the sum of the entries of all
points.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.sparse import bsr_array, csr_array, eye_array, hstack

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.constraints import Constraints
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint
from fastcontact.model.contact_pair import ContactPair
from fastcontact.model.ramp import PartHistory, Table
from fastcontact.model.rigid_motions import FreeMotions


@record
class ForceDrivenObstacles:
    """The force-driven obstacles of a model.

    Parameters
    ----------
    pairs : sequence of ContactPair
        Contact pairs with such an obstacle.
    shape : (int, int)
        Shape of the points of the mesh, (n_points, dim).
    """

    pairs: Sequence[ContactPair]
    shape: tuple[int, int]

    def __len__(self) -> int:
        return len(self.pairs)

    @property
    def n_dofs(self) -> int:
        """Number of displacement components, those of the obstacles last."""
        return (self.shape[0] + len(self)) * self.shape[1]

    @property
    def without_stiffness(self) -> Mask:
        """Mask (n_dofs,) of the displacement components driven by a force, which are free but have no stiffness."""
        mask = np.zeros(self.n_dofs, bool)
        for number, pair in enumerate(self.pairs):
            mask[self.dofs(number)] = [force is not None for force in pair.force]
        return mask

    def dofs(self, number: int) -> Indices:
        """Return the numbers (dim,) of the displacement components of an obstacle."""
        return (self.shape[0] + number) * self.shape[1] + np.arange(self.shape[1])

    def displacements(self, u: Array) -> dict[str, Array]:
        """Return the displacement (dim,) of each obstacle by name of its pair, from displacements u (n_dofs,) [length]."""
        return {pair.name: u[self.dofs(number)] for number, pair in enumerate(self.pairs)}

    def number(self, name: str) -> int | None:
        """Return the number of the obstacle of contact pair `name`; None if the pair has no force-driven obstacle."""
        return next((i for i, pair in enumerate(self.pairs) if pair.name == name), None)

    def stiffness(self, K: bsr_array) -> bsr_array:
        """Return the stiffness matrix with empty rows and columns for the obstacles."""
        if not self.pairs:
            return K
        indptr = np.r_[K.indptr, np.full(len(self), K.indptr[-1])].astype(K.indptr.dtype)
        return bsr_array((K.data, K.indices, indptr), shape=(self.n_dofs, self.n_dofs))

    def relations(self, relations: Sequence[MultiPointConstraint]) -> list[MultiPointConstraint]:
        """Return multi-point constraints with additional columns for the obstacles."""
        if not self.pairs:
            return list(relations)
        return [dataclasses.replace(relation, rows=self._with_columns(relation.rows, None)) for relation in relations]

    def supported(self, fixed: Mask) -> Mask:
        """Return the mask (n_points + n_obstacles, dim) of supported components, from the mask of the points."""
        prescribed = [[force is None for force in pair.force] for pair in self.pairs]
        return np.vstack([fixed, np.array(prescribed, bool).reshape(-1, self.shape[1])])

    def prescribed(self, by_ramp: dict[PartHistory, Array]) -> dict[PartHistory, Array]:
        """Return the displacements (n_points + n_obstacles, dim) of mesh and obstacles at multiplier 1, by ramp [length]."""
        return self._extended(by_ramp, [pair.motion for pair in self.pairs])

    def forces(self, by_ramp: Mapping[Table | None, Array]) -> dict[PartHistory, Array]:
        """Return the forces (n_points + n_obstacles, dim) on mesh and obstacles at multiplier 1, by ramp [force]."""
        return self._extended(by_ramp, [tuple(force or 0.0 for force in pair.force) for pair in self.pairs])

    def _extended(self, by_ramp: Mapping[Any, Array], values: Sequence[tuple[float, ...]]) -> dict[PartHistory, Array]:
        """Return nodal values by ramp, extended by the `values` of the obstacles."""
        n_points, dim = self.shape
        zero = np.zeros((len(self), dim))
        extended: dict[PartHistory, Array] = {ramp: np.vstack([rows, zero]) for ramp, rows in by_ramp.items()}
        for number, (pair, value) in enumerate(zip(self.pairs, values, strict=True)):
            if any(value):
                rows = extended.setdefault(pair.ramp, np.zeros((n_points + len(self), dim)))
                rows[n_points + number] = value
        return extended

    def motions(self, motions: FreeMotions) -> FreeMotions:
        """Return the rigid-body motions including those of the obstacles, one for each component under a force."""
        free = np.flatnonzero(self.without_stiffness)
        n_points, dim = self.shape
        names = [f"obstacle '{self.pairs[dof // dim - n_points].name}'" for dof in free.tolist()]
        return motions.with_translations(free, names, (self.n_dofs // dim, dim))

    def near_nullspace(self, modes: Array) -> Array:
        """Return the near null space (n_dofs, k): `modes`, translations first, extended to the obstacles."""
        return np.vstack([modes, np.tile(np.eye(self.shape[1], modes.shape[1]), (len(self), 1))])

    def constraints(
        self, name: str, constraints: Constraints, position: Array, included_motion: Array | None = None
    ) -> Constraints:
        """Return the constraints of pair `name` with columns for the displacements of all obstacles.

        `constraints` were computed with the obstacle of the pair fixed at its displacement `position` (dim,) [length].
        Slip then includes the motion of the obstacle. If the obstacle also rotates, `included_motion` (dim,) is its
        translation in the step, which the slip of `constraints` already includes [length].
        """
        number = self.number(name)
        B = self._with_columns(constraints.B, number)
        tangents = tuple(self._with_columns(tangent, number) for tangent in constraints.tangents)
        if number is None:
            return dataclasses.replace(constraints, B=B, tangents=tangents)
        slip0 = np.zeros_like(constraints.slip0)
        if included_motion is not None and constraints.tangents:
            slip0 = constraints.slip0 + np.stack([t @ included_motion for t in constraints.directions])
        gap0 = constraints.gap0 + self._directions(constraints.B) @ position
        return dataclasses.replace(constraints, B=B, gap0=gap0, tangents=tangents, slip0=slip0)

    def contact_stiffness(self, name: str, K: csr_array) -> csr_array:
        """Return the stiffness of pair `name` for the displacements of all obstacles, from that with its obstacle fixed."""
        motion = self._with_columns(csr_array(eye_array(K.shape[0], format="csr")), self.number(name))
        return csr_array(motion.T @ K @ motion)

    def _directions(self, rows: csr_array) -> Array:
        """Return the sums (m, dim) of the entries of rows (m, n_dofs) over all points of the mesh."""
        return np.asarray(rows @ np.tile(np.eye(self.shape[1]), (self.shape[0], 1)))

    def _with_columns(self, rows: csr_array, number: int | None) -> csr_array:
        """Return rows (m, n_dofs) with columns for the obstacles, which are empty except for obstacle `number`."""
        if number is None:
            return csr_array((rows.data, rows.indices, rows.indptr), shape=(rows.shape[0], self.n_dofs))
        dim = self.shape[1]
        columns = np.zeros((rows.shape[0], len(self) * dim))
        columns[:, number * dim : (number + 1) * dim] = -self._directions(rows)
        return csr_array(hstack([rows, csr_array(columns)], format="csr"))
