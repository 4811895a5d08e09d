"""Tied sides with an offset: a rigid arm across the gap rotates with the primary facet.

Equal displacements across a gap would resist rigid rotations: the forces of both sides would have different lines of action,
and the moment of the shear would be lost. With the arm, the relative displacement along a tangent t is
``t . (u_s - u_p) + g n . du_p/dt`` with the gap g, the normal n and the derivative along t on the primary facet; it vanishes
in any small rotation of both sides.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, diags_array

from fastcontact.arrays import Array
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.pairing import Pairing, normals
from fastcontact.contact.surface import Surface
from fastcontact.linear.sparse_rows import nodal_rows
from fastcontact.round_off import LENGTH_ROUND_OFF


def with_arms(constraints: Constraints, pairing: Pairing, primary: Surface, points: Array) -> Constraints:
    """Return constraints whose tangential rows are zero in small rotations of both sides, also across a gap.

    Parameters
    ----------
    constraints : Constraints
        Constraints (m) with tangents.
    pairing : Pairing
        Pairing of the constraint points.
    primary : Surface
    points : ndarray (n_points, dim)
        Reference coordinates [length].
    """
    size = float(np.ptp(constraints.positions, axis=0).max(initial=0.0))
    normal, facing = normals(constraints.directions), pairing.places(primary, np.arange(len(constraints)))
    axes = np.einsum("mkj,mkd->mdj", facing.gradient, points[facing.nodes])
    along = np.einsum("mkj,mjd->mkd", facing.gradient, np.linalg.pinv(axes))
    slopes = [np.einsum("mkd,md->mk", along, direction) for direction in constraints.directions]
    levers = [nodal_rows(facing.nodes, slope[:, :, None] * normal[:, None, :], points.size) for slope in slopes]
    rotations, translations = _rotations(points), np.tile(np.eye(points.shape[1]), (len(points), 1))
    arms = np.stack([lever @ rotations for lever in levers], axis=1)
    left = np.stack([tangent @ rotations for tangent in constraints.tangents], axis=1)
    moved = np.stack([np.abs(tangent @ translations).max(axis=1) for tangent in constraints.tangents], axis=1)
    # A tensor, because one length per tangent would depend on the choice of tangents where the gap is not along the normal.
    lengths = left @ np.linalg.pinv(arms)
    lengths[(np.abs(lengths) <= LENGTH_ROUND_OFF * size) | (moved > LENGTH_ROUND_OFF)[:, :, None]] = 0.0
    tangents = [
        csr_array(tangent - sum(diags_array(lengths[:, k, j]) @ lever for j, lever in enumerate(levers)))
        for k, tangent in enumerate(constraints.tangents)
    ]
    return replace(constraints, tangents=tuple(tangents) if lengths.any() else constraints.tangents)


def _rotations(points: Array) -> Array:
    """Return the displacements (n_dofs, 1), in 3D (n_dofs, 3) of unit rotations about the middle [length]."""
    x = points - points.mean(axis=0)
    if points.shape[1] == 2:
        return np.column_stack([-x[:, 1], x[:, 0]]).reshape(-1, 1)
    return np.stack([np.cross(axis, x).ravel() for axis in np.eye(3)], axis=1)
