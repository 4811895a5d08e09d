"""Nodal stress at material interfaces, with one value for each material."""

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
        Material number of each solid cell, in the order of ``mesh.solids``. Materials are numbered from 0 in the order
        in which they were added to the model; equal materials have the number of the first.
    points : ndarray of int (k,)
        Node of each row, in ascending order. A node where materials meet has a row for each material.
    material : ndarray of int (k,)
        Material number of each row.
    stress : ndarray (k, 4) or (k, 6)
        Mean stress of the cells with the material at the node [pressure]. The components are those of
        `StepResult.stress`.
    """

    cells: Numbers
    points: Numbers
    material: Numbers
    stress: Array

    def at(self, point: int) -> dict[int, Array]:
        """Return the stress (4,) or (6,) [pressure] of each material at a node.

        Parameters
        ----------
        point : int
            Number of the node.

        Returns
        -------
        dict of int to ndarray
            Stress by material number; empty if the node has one material only.
        """
        return {int(self.material[row]): self.stress[row] for row in np.flatnonzero(self.points == point)}


def by_largest_von_mises(
    sides: MaterialSides, cells: Numbers, at_places: Array, n_points: int
) -> tuple[Array, MaterialStress]:
    """Return the nodal stress (n_points, n_components) [pressure] and the stress of each material at interfaces.

    At a node on an interface, the nodal stress is that of the material with the largest von Mises stress.

    Parameters
    ----------
    sides : MaterialSides
        Nodes at material interfaces.
    cells : ndarray of int (n_solids,)
        Material number of each solid cell.
    at_places : ndarray (n_places, n_components)
        Stress at the nodes of the mesh that is cut along interfaces [pressure].
    n_points : int
        Number of points of the mesh.

    Returns
    -------
    stress : ndarray (n_points, n_components)
        Nodal stress [pressure].
    material_stress : MaterialStress
        Stress of each material at interfaces.
    """
    stress, values = at_places[:n_points].copy(), at_places[sides.place]
    order = np.lexsort((recovery.von_mises(values), sides.points))  # the last row of each node has the largest
    stress[sides.points[order]] = values[order]
    return stress, MaterialStress(cells, sides.points, sides.material, values)
