"""Contact geometry that is linearised by finite differences, where the derivatives of `linearised_geometry` do not apply."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastcontact._tools.records import record
from fastcontact.arrays import Array, largest
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.pairing import normals


@record
class FiniteDifferences:
    """Contact forces, gaps and slips of one pair, linearised by one-sided finite differences.

    The differences are taken at the mean of the displacements of the pairing and of its solution. The error of a Newton step
    is then a tenth of that with differences at one of the two displacements.

    Attributes
    ----------
    constraints : Constraints
    constraints_after : Callable
        Function from a motion (n_points, dim) [length] of all points after the pairing of `constraints` to the constraints of
        a new pairing.
    forces : (ndarray (m,), ndarray (m, k))
        Multipliers and tangential forces of the solution with `constraints` [force].
    motions : (ndarray (n_points, dim), ndarray (n_points, dim), ndarray (n_points, dim))
        Displacements of the solution, their increments in the load step, and their changes since the pairing [length].
    points_of_sides : ndarray of int (q,)
        Points on which the constraints depend.
    step : float
        Largest motion of these points in a difference [length].
    """

    constraints: Constraints
    constraints_after: Callable[[Array], Constraints]
    forces: tuple[Array, Array]
    motions: tuple[Array, Array, Array]
    points_of_sides: NDArray[np.integer]
    step: float

    def derivatives_along(self, du: Array) -> tuple[Array, Array]:
        """See `constraints.Linearised`."""
        rate = (largest(du[self.points_of_sides]) or 1.0) / self.step
        d_force, d_gaps = (rate * (y - y0) for y, y0 in zip(self._values(du / rate), self._values_at_mean, strict=True))
        return d_force.reshape(du.shape), d_gaps

    @cached_property
    def _values_at_mean(self) -> tuple[Array, Array]:
        return self._values(np.zeros_like(self.motions[0]))

    def _values(self, motion: Array) -> tuple[Array, Array]:
        """Return nodal forces (n_dofs,) [force], and gaps and slips (1 + k, m) [length].

        They are those after a `motion` (n_points, dim) from the mean of the displacements [length]. The tangents of
        `constraints` are rotated by the smallest rotation that maps the normals of `constraints` to the new normals.
        """
        (multiplier, tangential), (displacement, increment, change) = self.forces, self.motions
        varied = self.constraints_after(0.5 * change + motion)
        gap = varied.gaps(displacement)[None]
        if not varied.tangents:
            return varied.force(multiplier), gap
        tangents = self.constraints.directions
        normal0, normal = normals(tangents), normals(varied.directions)
        scaled_sum = (normal0 + normal) / (1.0 + np.einsum("md,md->m", normal0, normal))[:, None]
        rotated = [t - np.einsum("md,md->m", t, normal)[:, None] * scaled_sum for t in tangents]
        rotation = np.einsum("kmd,jmd->mkj", varied.directions, rotated)
        slip = np.stack([T @ increment.ravel() for T in varied.tangents]) + varied.slip0
        force = varied.force(multiplier, np.einsum("mkj,mj->mk", rotation, tangential))
        return force, np.vstack([gap, np.einsum("mkj,km->jm", rotation, slip)])
