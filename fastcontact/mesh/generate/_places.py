"""Name points by where they stand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fastcontact.mesh.mesh import Mesh


def with_points_at(mesh: Mesh, places: Mapping[str, Sequence[float]]) -> Mesh:
    """Return the mesh with a point group for the point nearest to each place [length]."""
    nearest = {
        name: [int(((mesh.points - np.asarray(place)) ** 2).sum(axis=1).argmin())] for name, place in places.items()
    }
    return mesh.with_groups(points=nearest)
