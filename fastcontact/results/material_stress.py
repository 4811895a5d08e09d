"""Nodal stress on material interfaces: one value for each material."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastcontact.arrays import Array, Numbers
from fastcontact.elasticity import recovery
from fastcontact.elasticity.material_sides import MaterialSides


@dataclass(frozen=True, eq=False)
class MaterialStress:
    """Stress of each material at the nodes where materials meet.

    Attributes
    ----------
    cells : ndarray of int (n_solids,)
        Material number of every solid cell, in the order of ``mesh.solids``. Materials are numbered from 0 in the
        order in which they were added to the model; equal materials have the number of the first.
    points, material : ndarray of int (k,)
        Nodes where materials meet, with a row for each of their materials, ordered by node.
    stress : ndarray (k, 4) or (k, 6)
        Average over the cells of that material at the node, components as of `StepResult.stress` [pressure].
    """

    cells: Numbers
    points: Numbers
    material: Numbers
    stress: Array

    def at(self, point: int) -> dict[int, Array]:
        """Return the stress (4,) or (6,) of each material at a node [pressure]; empty if the node has only one."""
        return {int(self.material[row]): self.stress[row] for row in np.flatnonzero(self.points == point)}


def by_largest_von_mises(
    sides: MaterialSides, cells: Numbers, at_places: Array, n_points: int
) -> tuple[Array, MaterialStress]:
    """Return the nodal stress (n_points, n_components), and that of each side of material interfaces [pressure].

    At interfaces the nodal stress is that of the side with the largest von Mises stress.

    Parameters
    ----------
    sides : MaterialSides
    cells : ndarray of int (n_solids,)
        Material of every solid cell.
    at_places : ndarray (n_places, n_components)
        Stress at the slots of `sides` [pressure].
    n_points : int
    """
    stress, values = at_places[:n_points].copy(), at_places[sides.place]
    order = np.lexsort((recovery.von_mises(values), sides.points))  # the last row of each node has the largest
    stress[sides.points[order]] = values[order]
    return stress, MaterialStress(cells, sides.points, sides.material, values)
