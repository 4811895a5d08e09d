"""The axis of an axisymmetric model, on which the radial displacement is zero."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Indices
from fastcontact.mesh.mesh import Mesh

# Nodes nearer to the axis than this fraction of the largest coordinate lie on it: files may hold single precision.
ON_AXIS = 1e-6


def axis_nodes(mesh: Mesh) -> Indices:
    """Return the nodes of solid cells on the axis x = 0, ascending.

    A body that reaches the axis stays closed there: by symmetry its points on the axis move along it only.
    """
    near = np.abs(mesh.points[:, 0]) <= ON_AXIS * np.abs(mesh.points).max()
    used = np.zeros(mesh.n_points, bool)
    for block in mesh.solids.values() if near.any() else ():
        used[block] = True
    return np.flatnonzero(near & used)
