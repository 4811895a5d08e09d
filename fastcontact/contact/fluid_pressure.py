"""Pressure penetration: fluid enters between the sides of a contact pair from a source, wherever they are open.

A node is open to the fluid if its contact pressure is at most the fluid pressure or, in the first pairing, if its gap is
open. Open nodes of the same facet are connected. At open nodes that are connected with the source, the fluid pressure
replaces the contact pressure. It acts on the secondary side along the normals of this side, and on the primary side along the
normal of the gap, over the area that the secondary side covers. With finite strains, normals and areas are those of the
deformed surface at which the bodies are linearised, and their variation enters the tangent.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, diags_array, eye_array, kron
from scipy.sparse.csgraph import connected_components

from fastcontact._tools.records import record, replace
from fastcontact.arrays import Array, Mask
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.integration import facet_measure, fine_rule
from fastcontact.contact.surface import Surface
from fastcontact.linear.sparse_rows import Blocks, assembled, rows_of
from fastcontact.mesh import elements
from fastcontact.mesh.area_vectors import weighted_area_vectors
from fastcontact.round_off import LENGTH_ROUND_OFF, SINGLE_PRECISION

# Mean gaps at open nodes near the edge of the contact, where facets are partly closed, may be negative by up to this fraction
# of the facet length.
EDGE_PENETRATION = 0.01


@record
class WettedRegion:
    """Region of a contact that the fluid has reached.

    Attributes
    ----------
    rows : ndarray of bool (m,)
        Whether each constraint belongs to the region.
    pressure : ndarray (n_nodes,)
        Fluid pressure at the secondary nodes [pressure].
    nodal_weights : csr_array (n_points, n_nodes)
        Matrix whose product with the area vectors at the secondary nodes is minus the nodal forces [force].
    areas : AreaVectors
        Area vectors of the secondary side.
    """

    rows: Mask
    pressure: Array
    nodal_weights: csr_array
    areas: AreaVectors

    def force(self, displacement: Array) -> Array:
        """Return the nodal forces (n_points, dim) [force] at a `displacement` (n_points, dim) [length]."""
        return np.asarray(-(self.nodal_weights @ self.areas.with_derivative(displacement)[0]))

    def stiffness(self, displacement: Array) -> csr_array:
        """Return the symmetric part (n_dofs, n_dofs) of minus the derivative of `force` [force / length]."""
        dim, derivative = displacement.shape[1], self.areas.with_derivative(displacement)[1]
        K = csr_array(kron(self.nodal_weights, eye_array(dim)) @ derivative)
        return csr_array(0.5 * (K + K.T))


@record
class AreaVectors:
    """Outward area vectors of the deformed secondary side at its nodes, per reference area (Nanson's formula).

    They are means over the facets around a node, weighted with the square of its shape function, which cannot be negative.

    Attributes
    ----------
    side : Surface
        The secondary side.
    points : ndarray (n_points, dim)
        Reference coordinates of all points [length].
    axisymmetric : bool
    """

    side: Surface
    points: Array
    axisymmetric: bool

    def with_derivative(self, displacement: Array) -> tuple[Array, csr_array]:
        """Return the vectors (n_nodes, dim) [-] at a `displacement` (n_points, dim) [length], and their derivative.

        The derivative is a matrix (n_nodes * dim, n_points * dim) [1 / length].
        """
        dim, n = self.points.shape[1], len(self.side.points)
        areas, vectors, blocks = np.zeros(n), np.zeros((n, dim)), list[Blocks]()
        for block in self.side.blocks:
            element, (xi, weights) = elements.get(block.element), fine_rule(block.element)
            N, dN = element.shape(xi), element.gradient(xi)
            measure = facet_measure(block.facets, block.element, self.points, xi, self.axisymmetric)
            np.add.at(areas, block.local, (measure * weights) @ N**2)
            positions = (self.points + displacement)[block.facets]
            w = np.broadcast_to(weights, measure.shape)
            by_facet, derivative = weighted_area_vectors(positions, N, dN, w, N**2, self.axisymmetric)
            np.add.at(vectors, block.local, by_facet)
            dofs = (nodes[:, :, None] * dim + np.arange(dim) for nodes in (block.local, block.facets))
            rows, columns = (numbers.reshape(len(numbers), -1) for numbers in dofs)
            blocks.append((rows, columns, derivative.reshape(*rows.shape, -1)))
        inverse = np.divide(1.0, areas, out=np.zeros(n), where=areas > 0.0)
        by_node = diags_array(np.repeat(inverse, dim)) @ assembled(blocks, (n * dim, self.points.size))
        return vectors * inverse[:, None], csr_array(by_node)


def with_fluid_pressure(
    constraints: Constraints, config: Configuration, areas: AreaVectors, source: Mask
) -> Constraints:
    """Return the constraints of a pair under the fluid pressure of a configuration.

    The fluid enters from the nodes `source` (n_nodes,) of the secondary side. Contact pressures are those of the last
    pairing; before the first one, closed nodes are impermeable.
    """
    if not config.fluid_pressure > 0.0:
        return constraints
    assert constraints.areas is not None
    side, points = areas.side, areas.points
    size = float(np.linalg.norm(np.ptp(points[side.points], axis=0)))
    deformation = config.linearisation_point
    vectors = areas.with_derivative(np.zeros_like(points) if deformation is None else deformation)[0]
    gaps = constraints.gaps(config.displacement)
    nodal, node = constraints.nodal_field.weighted_gaps(np.where(constraints.usable, gaps, np.inf))
    if config.pressure is None:
        passable = nodal > LENGTH_ROUND_OFF * size
    else:
        # A node under contact pressure is impermeable, even if it is open itself and only points near it are closed. Contact
        # pressures are forces per reference area.
        nominal = config.fluid_pressure * (1.0 if deformation is None else np.linalg.norm(vectors, axis=1))
        facet_size = size / side.n_facets ** (1.0 / (points.shape[1] - 1))
        passable = (nodal > -EDGE_PENETRATION * facet_size) & (config.pressure <= (1.0 + LENGTH_ROUND_OFF) * nominal)
    nodes = connected_nodes(side, source, passable)
    rows = nodes[node] & constraints.usable
    # A force that does not depend on the gap is represented by a linear law of small slope, whose force vanishes at a gap
    # much larger than the side.
    distance_to_zero = size / SINGLE_PRECISION
    B, weights = _rows_along_area_vectors(constraints.B, rows, side, vectors[node])
    force = np.where(rows, config.fluid_pressure * constraints.areas, 0.0)
    force_by_node = csr_array((force, (np.arange(len(node)), node)), shape=(len(node), len(nodes)))
    pressure = np.where(nodes, config.fluid_pressure, 0.0)
    return replace(
        constraints,
        B=B,
        gap0=np.where(rows, -distance_to_zero - B @ config.displacement.ravel(), constraints.gap0),
        softness=np.where(rows, distance_to_zero / (config.fluid_pressure * constraints.areas), constraints.softness),
        equality=constraints.equality | rows,
        friction=np.where(rows, 0.0, constraints.friction),
        wetted=WettedRegion(rows, pressure, csr_array(weights.T @ force_by_node), areas),
    )


def _rows_along_area_vectors(B: csr_array, rows: Mask, side: Surface, vectors: Array) -> tuple[csr_array, csr_array]:
    """Return B (m, n_dofs) with secondary entries along area vectors in the marked `rows` (m,), and their weights.

    The weights (m, n_points) are those of the secondary points in these rows [-]. `vectors` (m, dim) are the area vectors of
    the secondary `side` per area [-]. On the primary side, their component along the normal of the gap acts.
    """
    (m, n_dofs), dim = B.shape, vectors.shape[1]
    entries = B.tocoo()
    row, point, component = entries.row, entries.col // dim, entries.col % dim
    on_secondary = np.isin(point, side.points)
    normal = np.zeros((m, dim))
    np.add.at(normal, (row[on_secondary], component[on_secondary]), entries.data[on_secondary])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=normal, where=length > 0.0)
    replaced = on_secondary & rows[row]
    values = entries.data[replaced] * normal[row[replaced], component[replaced]]
    weights = csr_array((values, (row[replaced], point[replaced])), shape=(m, n_dofs // dim))
    area_ratio = np.where(rows, -np.einsum("md,md->m", vectors, normal), 1.0)
    other_entries = csr_array((entries.data * area_ratio[row] * ~replaced, (row, entries.col)), shape=B.shape)
    with_area_vectors = csr_array(other_entries + rows_of(weights, -vectors))
    with_area_vectors.eliminate_zeros()
    return with_area_vectors, weights


def connected_nodes(side: Surface, source: Mask, passable: Mask) -> Mask:
    """Return which `passable` nodes (n_nodes,) are connected with passable nodes of the `source` through facets."""
    nodes, connected = np.flatnonzero(passable), np.zeros(len(passable), bool)
    component = connected_components(side.node_adjacency[nodes][:, nodes], directed=False)[1]
    connected[nodes] = np.isin(component, component[source[nodes]])
    return connected
