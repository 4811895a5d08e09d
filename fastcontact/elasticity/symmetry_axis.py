"""The axis of an axisymmetric model, on which the radial displacement is zero."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Indices
from fastcontact.mesh.mesh import Mesh
from fastcontact.round_off import SINGLE_PRECISION


def axis_nodes(mesh: Mesh) -> Indices:
    """Return the nodes (n,) of solid cells on the axis x = 0, in ascending order.

    By symmetry, points of a body on the axis move along the axis only.
    """
    near = np.abs(mesh.points[:, 0]) <= SINGLE_PRECISION * np.abs(mesh.points).max()
    used = np.zeros(mesh.n_points, bool)
    for block in mesh.solids.values() if near.any() else ():
        used[block] = True
    return np.flatnonzero(near & used)
