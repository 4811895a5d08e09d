"""Recovered nodal stresses for error estimation.

At the centres of linear cells, and at the reduced Gauss points of quadratic ones, stresses are more accurate than elsewhere
(Barlow, 1976). They are extrapolated from there to the nodes and averaged over the cells of one material at each node.
Polynomials fitted to patches of cells (Zienkiewicz and Zhu, 1992) are less accurate near the edge of a contact, where the
pressure decreases like a square root: they smooth the decrease over two cells, and overestimate the error of quadratic cells
by a factor of two to four.
"""

from __future__ import annotations

import math

import numpy as np

from fastcontact.arrays import Array
from fastcontact.elasticity import recovery
from fastcontact.elasticity.cell_stress import CellStress
from fastcontact.elasticity.initial_states import StressOffset
from fastcontact.elasticity.material_field import MaterialField
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh

# Distance of the sampling points of quadratic triangles and tetrahedra from the centre, divided by that of the corners.
SIMPLEX_FRACTION = {3: 0.5, 4: 1.0 / math.sqrt(5.0)}


def smoothed_stress(
    mesh: Mesh,
    kinematics: str,
    field: MaterialField,
    displacement: Array,
    offset: StressOffset | None = None,
) -> dict[str, Array]:
    """Return the stress (n_cells, n_nodes, n_components) [pressure] at the nodes of each solid cell, by element type.

    At a node all cells of one material have the same stress.

    Parameters
    ----------
    mesh : Mesh
    kinematics : str
    field : MaterialField
        Materials of all cells.
    displacement : ndarray (n_points, dim)
        Displacements of all points [length].
    offset : StressOffset, optional
        Contribution of temperatures and initial states to the stress.
    """
    components = field.moduli.shape[1]
    stress = CellStress(mesh, kinematics, field.moduli, displacement, field.treatment, offset)
    by_kind = {name: np.empty((*block.shape, components)) for name, block in mesh.solids.items()}
    material = field.distinct
    for number in np.unique(np.concatenate([*material.values()])):
        average = recovery.NodalAverage(mesh.n_points, components)
        rows = {name: np.flatnonzero(material[name] == number) for name in by_kind}
        for name, chosen in rows.items():
            xi, extrapolation = sampling(name)
            cells = mesh.cells[name][chosen]
            average.add(cells, extrapolation, stress.at(name, xi, cells, field.loops[name][chosen], chosen))
        nodal = average.result()
        for name, chosen in rows.items():
            by_kind[name][chosen] = nodal[mesh.cells[name][chosen]]
    return by_kind


def sampling(name: str) -> tuple[Array, Array]:
    """Return the points (n_q, dim) [-] of an element where stress is most accurate, and the extrapolation (n_nodes, n_q)."""
    element = elements.get(name)
    corners = element.nodes[: element.n_corners]
    centre = corners.mean(axis=0)
    if element.order == 1:
        return centre[None, :], np.ones((element.n_nodes, 1))
    simplex = element.n_corners == element.dim + 1
    inward = SIMPLEX_FRACTION[element.n_corners] if simplex else 1.0 / math.sqrt(3.0)
    xi = np.asarray(centre + inward * (corners - centre))
    return xi, np.asarray(element.corner_shape(element.nodes) @ np.linalg.inv(element.corner_shape(xi)))
