"""Nodes at material interfaces, where stress is discontinuous and has a nodal value for each material."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fastcontact.arrays import Numbers
from fastcontact.mesh.mesh import Mesh


@dataclass(frozen=True, eq=False)
class MaterialSides:
    """Slots for nodal values: a slot for each node, and additional slots for the other materials at interfaces.

    Attributes
    ----------
    cells : mapping of str to ndarray of int (n_cells, n_nodes)
        Slots of the nodes of each cell, by solid element type.
    node : ndarray of int (n_slots,)
        Node of each slot; slot k of the first n_points belongs to node k.
    points : ndarray of int (k,)
        Node of each pair of a node at an interface and one of its materials, in ascending order.
    material : ndarray of int (k,)
        Material number of each of these pairs.
    place : ndarray of int (k,)
        Slot of each of these pairs.
    """

    cells: Mapping[str, Numbers]
    node: Numbers
    points: Numbers
    material: Numbers
    place: Numbers


def material_sides(mesh: Mesh, material: Mapping[str, Numbers]) -> MaterialSides:
    """Return the slots for nodal values; `material` contains the material number (n_cells,) of cells by element type."""
    n = mesh.n_points
    lowest, highest = np.full(n, np.iinfo(np.int32).max, np.int32), np.full(n, -1, np.int32)
    for number in np.unique(np.concatenate([np.empty(0, np.int32), *material.values()]))[::-1]:
        inside = np.concatenate([block[material[name] == number].ravel() for name, block in mesh.solids.items()])
        lowest[inside] = number
        highest[inside] = np.maximum(highest[inside], number)
    shared = lowest < highest
    if not shared.any():
        none = np.empty(0, np.int32)
        return MaterialSides(dict(mesh.solids), np.arange(n, dtype=np.int32), none, none, none)
    count = int(highest.max()) + 1
    keys = [
        (block.astype(np.int64) * count + material[name][:, None])[shared[block]] for name, block in mesh.solids.items()
    ]
    rows = np.unique(np.concatenate(keys))
    points, numbers = (rows // count).astype(np.int32), (rows % count).astype(np.int32)
    additional = numbers != lowest[points]
    side = points.copy()
    side[additional] = n + np.arange(np.count_nonzero(additional), dtype=np.int32)
    cells = {}
    for name, block in mesh.solids.items():
        here = shared[block]
        cells[name] = block.copy()
        wanted = (block.astype(np.int64) * count + material[name][:, None])[here]
        cells[name][here] = side[np.searchsorted(rows, wanted)]
    node = np.concatenate([np.arange(n, dtype=np.int32), points[additional]])
    return MaterialSides(cells, node, points, numbers, side)
