"""Pressure penetration: fluid enters between the sides of a contact pair from a source, wherever they are open.

A node is open to the fluid if its contact pressure is at most the fluid pressure or, in the first pairing, if its gap is
open. Open nodes of the same facet are connected. At open nodes that are connected with the source, the fluid pressure
replaces the contact pressure. The fluid acts on each side along the normals of this side and over its own area, because the
areas within the front of the fluid differ between the sides unless the gap is small. This includes the part of the secondary
side that faces no primary facet. The pressure at a point of the primary side is that at its projection on the secondary side
along averaged normals. With finite strains, normals and areas are those of the deformed surfaces at which the bodies are
linearised, and their variation enters the tangent.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csr_array, diags_array, eye_array, kron
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from fastcontact._tools.records import record, replace
from fastcontact.arrays import Array, Indices, Mask, mask_at
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.integration import facet_measure, fine_rule
from fastcontact.contact.projection import (
    SMALL_OVERHANG,
    DeformedSide,
    along_line_normals,
    along_normals,
    closest_of_types,
    facet_points,
)
from fastcontact.contact.surface import Surface
from fastcontact.linear.sparse_rows import Blocks, assembled, rows_of, without_zeros
from fastcontact.mesh import elements
from fastcontact.mesh.area_vectors import area_vectors, weighted_area_vectors
from fastcontact.round_off import LENGTH_ROUND_OFF, SINGLE_PRECISION

# Cosine of the angle between the outward normals of both sides beyond which primary facets face away from the secondary
# side, such as the back of a plate. Flanks of a curved body, whose normals are perpendicular, are wetted. Without it,
# `test_the_force_of_a_fluid_does_not_depend_on_the_choice_of_the_secondary_side` fails.
FACING_AWAY = 0.5
# Gap, relative to the facet size of the secondary side, and deviation of the cosine between opposite normals from 1, up to
# which the force on the secondary side acts on the primary side. Forces at a front then balance exactly. The fraction that
# acts decreases to zero at twice these values, since an abrupt change could make geometry updates alternate. Mean gaps at
# open nodes near the edge of the contact, where facets are partly closed, may be negative by this fraction of the facet
# length: with none, `test_a_flat_seal_opens_at_the_pressure_of_statics` fails.
NARROW = 0.01


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
        Matrix whose product with the area vectors at the secondary nodes is minus the nodal forces on this side [force].
    areas : AreaVectors
        Area vectors of the secondary side.
    facets : tuple of WettedFacets
        Wetted facets of the primary side, and of the secondary side where no contact is possible.
    """

    rows: Mask
    pressure: Array
    nodal_weights: csr_array
    areas: AreaVectors
    facets: tuple[WettedFacets, ...]

    def force(self, displacement: Array) -> Array:
        """Return the nodal forces (n_points, dim) [force] at a `displacement` (n_points, dim) [length]."""
        force = np.asarray(-(self.nodal_weights @ self.areas.with_derivative(displacement)[0]))
        return force - sum(part.with_derivative(displacement)[0] for part in self.facets)

    def stiffness(self, displacement: Array) -> csr_array:
        """Return the symmetric part (n_dofs, n_dofs) of minus the derivative of `force` [force / length]."""
        dim, derivative = displacement.shape[1], self.areas.with_derivative(displacement)[1]
        K = csr_array(kron(self.nodal_weights, eye_array(dim)) @ derivative)
        for part in self.facets:
            K = csr_array(K + part.with_derivative(displacement)[1])
        return csr_array(0.5 * (K + K.T))


@record
class WettedFacets:
    """Fluid pressure that acts on the facets of a side directly, not through contact constraints.

    Attributes
    ----------
    side : Surface
    axisymmetric : bool
    points : ndarray (n_points, dim)
        Reference coordinates of all points [length].
    pressure : tuple of ndarray (n_facets, n_q)
        Fluid pressure at the points of the `fine_rule`, for each block of facets [pressure].
    """

    side: Surface
    axisymmetric: bool
    points: Array
    pressure: tuple[Array, ...]

    @classmethod
    def opposite(cls, primary: Surface, areas: AreaVectors, displacement: Array, nodal_pressure: Array) -> WettedFacets:
        """Return the part of a `primary` side that faces the wetted part of the secondary side, at a `displacement`.

        `nodal_pressure` (n_nodes,) are the fluid pressures at the secondary nodes [pressure].
        """
        side, current, pressures = areas.side, areas.points + displacement, list[Array]()
        deformed = DeformedSide(side, current)
        project = along_normals if current.shape[1] == 3 else along_line_normals
        for block in primary.blocks:
            element, xi = elements.get(block.element), fine_rule(block.element)[0]
            x, shape = current[block.facets], (len(block.facets), len(xi))
            positions = np.einsum("qk,fkd->fqd", element.shape(xi), x).reshape(-1, x.shape[2])
            # Points opposite the edge between two facets lie beyond both of them, but not beyond averaged normals.
            start = closest_of_types(positions, side.node_positions(current))
            facet, foot, overhang, normal = project(positions, deformed, deformed.smooth_normals, start)
            on_side = facet_points(side, facet, foot)
            vectors = area_vectors(x, element.gradient(xi)).reshape(positions.shape)
            faces_away = np.einsum("nd,nd->n", vectors, normal) > FACING_AWAY * np.linalg.norm(vectors, axis=1)
            # Beyond the ends of the side the pressure decreases to zero; if it ended abruptly, pairings could alternate.
            fraction = np.clip(2.0 - overhang / SMALL_OVERHANG, 0.0, 1.0) * ~faces_away
            at_feet = np.einsum("nk,nk->n", on_side.shape, nodal_pressure[on_side.local])
            pressures.append((fraction * at_feet).reshape(shape))
        return cls(primary, areas.axisymmetric, areas.points, tuple(pressures))

    @classmethod
    def uncovered(cls, areas: AreaVectors, nodal_pressure: Array, fractions: list[Array]) -> WettedFacets:
        """Return the parts of the secondary side where no contact is possible; for the parameters see `opposite`.

        `fractions` contains the uncovered fraction of the area of each node (n_facets, n_nodes) [-] for each block of facets.
        """
        pressures = list[Array]()
        for block, fraction in zip(areas.side.blocks, fractions, strict=True):
            N = elements.get(block.element).shape(fine_rule(block.element)[0])
            pressures.append(nodal_pressure[block.local] * fraction @ N.T)
        return cls(areas.side, areas.axisymmetric, areas.points, tuple(pressures))

    def by_node(self, displacement: Array, secondary: Surface, carriers: Mask) -> csr_array:
        """Return minus the nodal forces that each secondary node transmits (n_nodes, n_dofs) [force].

        The node nearest to a facet among `carriers` (n_nodes,) transmits its force.
        """
        blocks, numbers = list[Blocks](), np.flatnonzero(carriers)
        tree = KDTree(self.points[secondary.points[numbers]])
        for block, (dofs, by_facet, _) in zip(self.side.blocks, self._by_block(displacement), strict=True):
            nearest = numbers[tree.query(self.points[block.facets].mean(axis=1))[1]]
            blocks.append((nearest[:, None], dofs, by_facet[:, None]))
        return assembled(blocks, (len(carriers), self.points.size))

    def with_derivative(self, displacement: Array) -> tuple[Array, csr_array]:
        """Return minus the nodal forces (n_points, dim) [force], and their derivative (n_dofs, n_dofs) [force / length]."""
        forces, blocks = np.zeros(self.points.size), list[Blocks]()
        for dofs, by_facet, derivative in self._by_block(displacement):
            np.add.at(forces, dofs, by_facet)
            blocks.append((dofs, dofs, derivative))
        return forces.reshape(self.points.shape), assembled(blocks, (self.points.size, self.points.size))

    def _by_block(self, displacement: Array) -> Iterator[tuple[Indices, Array, Array]]:
        """Yield for each block the numbers of the displacement components, minus the forces, and their derivatives."""
        for block, pressure in zip(self.side.blocks, self.pressure, strict=True):
            element, (xi, weights) = elements.get(block.element), fine_rule(block.element)
            N, dN, x = element.shape(xi), element.gradient(xi), (self.points + displacement)[block.facets]
            by_facet, derivative = weighted_area_vectors(x, N, dN, pressure * weights, N, self.axisymmetric)
            dofs = (block.facets[:, :, None] * x.shape[2] + np.arange(x.shape[2])).reshape(len(x), -1)
            yield dofs, by_facet.reshape(dofs.shape), derivative.reshape(*dofs.shape, -1)


@record
class AreaVectors:
    """Outward area vectors of the deformed secondary side at its nodes, per reference area (Nanson's formula).

    They are means over the facets around a node, weighted with the square of the shape function of the node, because shape
    functions of quadratic facets can be negative.

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
    constraints: Constraints, config: Configuration, areas: AreaVectors, source: Mask, primary: Surface | None
) -> Constraints:
    """Return the constraints of a pair under the fluid pressure of a configuration.

    The fluid enters from the nodes `source` (n_nodes,) of the secondary side. The `primary` side is None for obstacles.
    Contact pressures are those of the last pairing; before the first one, closed nodes are impermeable.
    """
    if not config.fluid_pressure > 0.0:
        return constraints
    assert constraints.areas is not None
    side, points = areas.side, areas.points
    size = float(np.linalg.norm(np.ptp(points[side.points], axis=0)))
    facet_size = size / side.n_facets ** (1.0 / (points.shape[1] - 1))
    deformation = config.linearisation_point
    linearised_at = np.zeros_like(points) if deformation is None else deformation
    vectors = areas.with_derivative(linearised_at)[0]
    gaps = constraints.gaps(config.displacement)
    nodal_gap, node = constraints.nodal_field.weighted_gaps(np.where(constraints.usable, gaps, np.inf))
    if config.pressure is None:
        passable = nodal_gap > LENGTH_ROUND_OFF * size
    else:
        # A node under contact pressure is impermeable, even if it is open itself and only points near it are closed. Contact
        # pressures are forces per reference area.
        nominal = config.fluid_pressure * (1.0 if deformation is None else np.linalg.norm(vectors, axis=1))
        is_open = nodal_gap > -NARROW * facet_size
        passable = is_open & (config.pressure <= (1.0 + LENGTH_ROUND_OFF) * nominal)
        if config.impermeable is not None:
            passable &= ~config.impermeable
    wetted = connected_nodes(side, source, passable)
    # Where no contact is possible, the first row of each node transmits the force.
    pressure = np.where(wetted, config.fluid_pressure, 0.0)
    uncovered = constraints.nodal_field.uncovered(side, constraints.usable)
    first_of_node = mask_at(np.unique(node, return_index=True)[1], len(node))
    of_blocks = zip(side.blocks, uncovered, strict=True)
    nodes = [block.local[np.abs(fraction) > SINGLE_PRECISION] for block, fraction in of_blocks]
    partly_uncovered = mask_at(np.concatenate(nodes), len(wetted))
    rows = wetted[node] & (constraints.usable | (first_of_node & partly_uncovered[node]))
    row_areas = np.where(constraints.usable, constraints.areas, facet_size ** (points.shape[1] - 1))
    # A force that does not depend on the gap is represented by a linear law of small slope, whose force vanishes at a gap
    # much larger than the side.
    distance_to_zero = size / SINGLE_PRECISION
    force = np.where(rows, config.fluid_pressure * row_areas, 0.0)
    force_by_node = csr_array((force, (np.arange(len(node)), node)), shape=(len(node), len(wetted)))
    nodal_force = force_by_node.sum(axis=0)
    carriers, facets, transmitted = nodal_force > 0.0, list[WettedFacets](), np.ones(len(wetted))
    if carriers.any() and (wetted & partly_uncovered).any():
        facets.append(WettedFacets.uncovered(areas, constraints.nodal_field.at_nodes(pressure), uncovered))
    if primary is not None and carriers.any():
        current = points + config.displacement
        x, opposite = current[side.points], primary.node_positions(current)
        transmitted = _transmitted_fraction(x, nodal_gap, vectors, opposite, facet_size)
        direct_pressure = constraints.nodal_field.at_nodes(pressure * (1.0 - transmitted))
        facets.append(WettedFacets.opposite(primary, areas, config.displacement, direct_pressure))
    B, weights = _rows_along_area_vectors(constraints.B, rows, side, vectors[node], transmitted[node])
    if facets:
        per_force = rows / np.where(carriers, nodal_force, np.inf)[node]
        to_rows = csr_array((per_force, (np.arange(len(node)), node)), shape=force_by_node.shape)
        for part in facets:
            B = csr_array(B - to_rows @ part.by_node(linearised_at, side, carriers))
        B.eliminate_zeros()
    soft = distance_to_zero / (config.fluid_pressure * row_areas)
    return replace(
        constraints,
        B=B,
        gap0=np.where(rows, -distance_to_zero - B @ config.displacement.ravel(), constraints.gap0),
        softness=np.vstack([np.where(rows, soft, constraints.softness[0]), constraints.softness[1:]]),
        equality=constraints.equality | rows,
        friction=np.where(rows, 0.0, constraints.friction),
        wetted=WettedRegion(rows, pressure, csr_array(weights.T @ force_by_node), areas, tuple(facets)),
    )


def _rows_along_area_vectors(
    B: csr_array, rows: Mask, side: Surface, vectors: Array, transmitted: Array
) -> tuple[csr_array, csr_array]:
    """Return B (m, n_dofs) with secondary entries along area vectors in the marked `rows` (m,), and their weights.

    The weights (m, n_points) are those of the secondary points in these rows [-]. `vectors` (m, dim) are the area vectors of
    the secondary `side` per area [-]. On the primary side, their component along the normal of the gap acts, times the
    fraction `transmitted` (m,) of the pressure [-].
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
    area_ratio = np.where(rows, -np.einsum("md,md->m", vectors, normal) * transmitted, 1.0)
    other_entries = csr_array((entries.data * area_ratio[row] * ~replaced, (row, entries.col)), shape=B.shape)
    return without_zeros(csr_array(other_entries + rows_of(weights, -vectors))), weights


def _transmitted_fraction(x: Array, gap: Array, vectors: Array, opposite: list[Array], facet_size: float) -> Array:
    """Return the fraction (n_nodes,) of the pressure that is transmitted to the opposite side, one in narrow gaps [-].

    `x` (n_nodes, dim) are the positions of the secondary nodes [length], `gap` (n_nodes,) their gaps, infinite if unknown
    [length], `vectors` (n_nodes, dim) their area vectors [-], `opposite` the positions of the nodes of the primary facets in
    each block [length], and `facet_size` the mean size of the secondary facets [length].
    """
    foot = closest_of_types(x, opposite)
    size = np.maximum(np.linalg.norm(vectors, axis=1), SINGLE_PRECISION)
    cosine = -np.einsum("nd,nd->n", vectors, foot.normal) / size
    ratios = np.minimum(np.abs(gap), foot.distance) / (NARROW * facet_size), (1.0 - cosine) / NARROW
    return np.asarray(np.prod([np.clip(2.0 - ratio, 0.0, 1.0) for ratio in ratios], axis=0))


def connected_nodes(side: Surface, source: Mask, passable: Mask) -> Mask:
    """Return which nodes (n_nodes,) are connected with the `source` by facets through `passable` nodes."""
    nodes, connected = np.flatnonzero(passable), np.zeros(len(passable), bool)
    component = connected_components(side.node_adjacency[nodes][:, nodes], directed=False)[1]
    connected[nodes] = np.isin(component, component[source[nodes]])
    return connected
