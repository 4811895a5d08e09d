"""Nodes on the axis of symmetry, where the radial displacement of an axisymmetric model is zero."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Indices
from fastcontact.mesh.mesh import Mesh
from fastcontact.round_off import SINGLE_PRECISION


def axis_nodes(mesh: Mesh) -> Indices:
    """Return the nodes (n,) of solid cells on the axis x = 0, in ascending order."""
    on_axis = np.flatnonzero(np.abs(mesh.points[:, 0]) <= SINGLE_PRECISION * np.abs(mesh.points).max())
    return on_axis[np.any([np.isin(on_axis, block) for block in mesh.solids.values()], axis=0)]
