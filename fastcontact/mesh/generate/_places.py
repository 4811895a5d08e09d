"""Groups by the places of their points."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fastcontact.mesh.mesh import Mesh


def with_points_at(mesh: Mesh, places: Mapping[str, Sequence[float]]) -> Mesh:
    """Return the mesh with a point group for the point nearest to each place [length]."""
    nearest = {
        name: [int(((mesh.points - np.asarray(place)) ** 2).sum(axis=1).argmin())] for name, place in places.items()
    }
    return mesh.with_groups(points=nearest)


def with_cells_inside(
    mesh: Mesh, name: str, group: str, inside: Callable[[NDArray[np.float64]], NDArray[np.bool_]]
) -> Mesh:
    """Return the mesh with a cell group `name`: the cells of `group` whose nodes are all inside.

    `inside` (n,) maps points (n, dim) [length] to booleans.
    """
    near = inside(mesh.points)
    rows = mesh.split(mesh.cell_groups[group])
    parts = [mesh.offsets[kind] + own[near[mesh.cells[kind][own]].all(axis=1)] for kind, own in rows.items()]
    return mesh.with_groups(cells={name: np.concatenate(parts)})
