"""Slots for nodal stresses: a node at a material interface has one slot for each of its materials."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fastcontact._tools.records import record
from fastcontact.arrays import Numbers
from fastcontact.mesh.mesh import Mesh


@record
class MaterialSides:
    """Slots for nodal values: one for each node, and one for each additional material of a node at an interface.

    Attributes
    ----------
    cells : mapping of str to ndarray of int (n_cells, n_nodes)
        Slots of the nodes of each cell, by solid element type.
    node : ndarray of int (n_slots,)
        Node of each slot; slot k of the first n_points belongs to node k.
    points, material, slot : ndarray of int (k,)
        For each pair of a node at an interface and one of its materials, the node, the material number and the slot. The
        nodes are in ascending order.
    """

    cells: Mapping[str, Numbers]
    node: Numbers
    points: Numbers
    material: Numbers
    slot: Numbers


def material_sides(mesh: Mesh, material: Mapping[str, Numbers]) -> MaterialSides:
    """Return the slots for nodal values; `material` contains the material numbers of cells (n_cells,) by element type."""
    n = mesh.n_points
    lowest, highest = np.full(n, np.iinfo(np.int32).max, np.int32), np.full(n, -1, np.int32)
    for number in np.unique(np.concatenate([np.empty(0, np.int32), *material.values()]))[::-1]:
        nodes = np.concatenate([block[material[name] == number].ravel() for name, block in mesh.solids.items()])
        lowest[nodes] = number
        highest[nodes] = np.maximum(highest[nodes], number)
    on_interface = lowest < highest
    if not on_interface.any():
        empty = np.empty(0, np.int32)
        return MaterialSides(dict(mesh.solids), np.arange(n, dtype=np.int32), empty, empty, empty)
    n_materials = int(highest.max()) + 1
    keys = {  # each key identifies a pair of an interface node and a material
        name: (block.astype(np.int64) * n_materials + material[name][:, None])[on_interface[block]]
        for name, block in mesh.solids.items()
    }
    pairs = np.unique(np.concatenate([*keys.values()]))
    points, numbers = (pairs // n_materials).astype(np.int32), (pairs % n_materials).astype(np.int32)
    additional = numbers != lowest[points]
    slot = points.copy()
    slot[additional] = n + np.arange(np.count_nonzero(additional), dtype=np.int32)
    cells = {name: block.copy() for name, block in mesh.solids.items()}
    for name, block in mesh.solids.items():
        cells[name][on_interface[block]] = slot[np.searchsorted(pairs, keys[name])]
    node = np.concatenate([np.arange(n, dtype=np.int32), points[additional]])
    return MaterialSides(cells, node, points, numbers, slot)
