"""Recovered nodal stresses for error estimation.

Stresses are most accurate at the centres of linear cells and at the reduced Gauss points of quadratic cells (Barlow, 1976).
In wedges and pyramids, points at 1/sqrt(3) of the distance from the centre to the corners are used. Stresses are extrapolated
from these points to the nodes, and averaged at each node over the cells of one material. Polynomials fitted to patches of
cells (Zienkiewicz and Zhu, 1992) are less accurate near the edge of a contact, where the pressure decreases like a square
root: the polynomials smooth this decrease over two cells, so that the estimated error of quadratic cells is too large by a
factor of two to four.
"""

from __future__ import annotations

import math

import numpy as np

from fastcontact.arrays import Array, Indices, Numbers
from fastcontact.elasticity.material_field import MaterialField
from fastcontact.elasticity.recovery import CellStress, NodalAverage, interpolation
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh

# Distance of the sampling points from the centre of quadratic triangles and tetrahedra, divided by the distance of the
# corners from the centre; by number of corners.
SIMPLEX_FRACTION = {3: 0.5, 4: 1.0 / math.sqrt(5.0)}


class PointStress:
    """Stresses in the cells of a mesh, interpolated from given stresses at the quadrature points.

    Parameters
    ----------
    stress : dict of str to ndarray (n_cells, n_q, n_components)
        Stress by solid element type [pressure].
    """

    def __init__(self, stress: dict[str, Array]) -> None:
        self._stress = stress

    def at(self, name: str, xi: Array, _cells: Numbers, _material: Numbers, rows: Indices) -> Array:
        """Return the stresses (n_cells, n, n_components) [pressure] at points `xi` (n, dim) [-], as `CellStress.at` does.

        The integer array `rows` (n_cells,) contains the numbers of the cells. Their nodes `_cells` (n_cells, n_nodes) and
        materials `_material` (n_cells,) are not needed.
        """
        return np.asarray(interpolation(name, xi) @ self._stress[name][rows])


def smoothed_stress(mesh: Mesh, field: MaterialField, stress: CellStress | PointStress) -> dict[str, Array]:
    """Return the stress (n_cells, n_nodes, n_components) [pressure] at the nodes of each solid cell, by element type.

    All cells of one material at a node have the same stress there.

    Parameters
    ----------
    mesh : Mesh
    field : MaterialField
        Materials of all cells.
    stress : CellStress or PointStress
        Stresses in the cells.
    """
    components = field.moduli.shape[1]
    at_nodes = {name: np.empty((*block.shape, components)) for name, block in mesh.solids.items()}
    material = field.distinct_materials
    for number in np.unique(np.concatenate([*material.values()])):
        average = NodalAverage(mesh.n_points, components)
        rows_of_material = {name: np.flatnonzero(material[name] == number) for name in at_nodes}
        rows_of_material = {name: rows for name, rows in rows_of_material.items() if len(rows)}
        for name, rows in rows_of_material.items():
            xi, extrapolation = sampling_points(name)
            cells = mesh.cells[name][rows]
            average.add(cells, extrapolation, stress.at(name, xi, cells, field.moduli_rows[name][rows], rows))
        nodal = average.result()
        for name, rows in rows_of_material.items():
            at_nodes[name][rows] = nodal[mesh.cells[name][rows]]
    return at_nodes


def sampling_points(name: str) -> tuple[Array, Array]:
    """Return the points (n_q, dim) [-] of an element type at which stresses are most accurate, and an extrapolation matrix.

    The extrapolation matrix (n_nodes, n_q) [-] maps values at these points to values at the nodes.
    """
    element = elements.get(name)
    corners = element.nodes[: element.n_corners]
    centre = corners.mean(axis=0)
    if element.order == 1:
        return centre[None, :], np.ones((element.n_nodes, 1))
    is_simplex = element.n_corners == element.dim + 1
    fraction = SIMPLEX_FRACTION[element.n_corners] if is_simplex else 1.0 / math.sqrt(3.0)
    xi = np.asarray(centre + fraction * (corners - centre))
    return xi, np.asarray(element.corner_shape(element.nodes) @ np.linalg.inv(element.corner_shape(xi)))
