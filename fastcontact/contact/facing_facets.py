"""Facets of different bodies that face each other, by projection of sample points onto the closest facets."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, Mask, Numbers
from fastcontact.contact.projection import CORNER, closest_of_types
from fastcontact.contact.surface import by_block
from fastcontact.mesh import elements
from fastcontact.mesh.area_vectors import area_vectors, unit_vectors
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import cells_of_outer_facets, outer_facets
from fastcontact.round_off import LENGTH_ROUND_OFF

# Distance of a sample point from its node, relative to the distance of the node from the middle of the facet.
INSET = 0.02


@record
class OuterFacets:
    """The n outer facets of bodies, in blocks of one element type and numbered consecutively through all blocks.

    Attributes
    ----------
    mesh : Mesh
    blocks : dict of str to ndarray of int (n_facets, n_nodes)
        Nodes of the facets by element type, oriented such that normals point outward.
    body, cell : ndarray of int (n,)
        Body and solid cell of each facet.
    """

    mesh: Mesh
    blocks: dict[str, Numbers]
    body: Indices
    cell: Indices

    @classmethod
    def of(cls, mesh: Mesh, body_of_cells: Indices) -> OuterFacets:
        """Return the outer facets of all cells with a body; `body_of_cells` (n_cells,) is -1 for the others."""
        blocks, cells = {}, []
        for name, facets in outer_facets(mesh).items():
            cell_of_facet = cells_of_outer_facets(mesh)[name]
            selected = body_of_cells[cell_of_facet] >= 0
            blocks[name] = facets[selected]
            cells.append(cell_of_facet[selected])
        cell = np.concatenate(cells).astype(np.intp)
        return cls(mesh, blocks, body_of_cells[cell], cell)

    @cached_property
    def offsets(self) -> Indices:
        """Number of the first facet of each block, and the total number of facets."""
        return np.cumsum([0, *map(len, self.blocks.values())])

    @cached_property
    def samples(self) -> tuple[Indices, Array, Array]:
        """Facets (m,), positions (m, dim) [length] and outward normals (m, dim) of sample points inside the facets."""
        facet, point, normal = [], [], []
        for (name, facets), first in zip(self.blocks.items(), self.offsets):
            element = elements.get(name)
            inset_nodes = element.nodes + INSET * (element.nodes.mean(axis=0) - element.nodes)
            xi = np.concatenate([element.quadrature[0], inset_nodes])  # facets may overlap only by a narrow strip
            shape, gradient = element.shape(xi), element.gradient(xi)
            nodes = self.mesh.points[facets]
            point.append((shape @ nodes).reshape(-1, self.mesh.dim))
            normal.append(area_vectors(nodes, gradient).reshape(-1, self.mesh.dim))
            facet.append(np.repeat(first + np.arange(len(facets)), len(shape)))
        return np.concatenate(facet), np.concatenate(point), unit_vectors(np.concatenate(normal))

    @cached_property
    def area(self) -> Array:
        """Areas (n,) of the facets, in 2D lengths [length^(dim - 1)]."""
        areas = [np.empty(0)]
        for name, facets in self.blocks.items():
            _, gradient, weights = elements.get(name).tables
            areas.append(np.linalg.norm(area_vectors(self.mesh.points[facets], gradient), axis=2) @ weights)
        return np.concatenate(areas)

    @cached_property
    def size(self) -> Array:
        """Sizes (n,) of the facets: lengths in 2D, square roots of areas in 3D [length]."""
        return np.asarray(self.area ** (1.0 / (self.mesh.dim - 1)))

    @cached_property
    def spacing(self) -> Array:
        """Distances (n,) between the nodes of each facet [length]; for quadratic facets half the size."""
        order = [elements.get(name).order for name in self.blocks]
        return self.size / np.repeat(order, np.diff(self.offsets))

    @cached_property
    def boxes(self) -> tuple[Array, Array]:
        """Lower and upper corners (n, dim) of the bounding boxes of the nodes of each facet [length]."""
        nodes = [self.mesh.points[facets] for facets in self.blocks.values()]
        return np.concatenate([x.min(axis=1) for x in nodes]), np.concatenate([x.max(axis=1) for x in nodes])

    @cached_property
    def smooth_face(self) -> Indices:
        """Number (n,) of the smooth face to which each facet belongs.

        Adjacent facets belong to the same smooth face if there is no corner between them.
        """
        keys, facet, normal = [], [], []
        for (name, facets), first in zip(self.blocks.items(), self.offsets):
            element = elements.get(name)
            at_nodes = unit_vectors(area_vectors(self.mesh.points[facets], element.gradient(element.nodes)))
            for ends in [(0, 0), (1, 1)] if self.mesh.dim == 2 else element.edges:
                keys.append(np.sort(facets[:, ends], axis=1))
                normal.append(at_nodes[:, ends].sum(axis=1))
                facet.append(first + np.arange(len(facets)))
        key, edge_normal, number = np.concatenate(keys), unit_vectors(np.concatenate(normal)), np.concatenate(facet)
        order = np.lexsort(key.T)
        row, next_row = order[:-1], order[1:]
        is_smooth = (key[row] == key[next_row]).all(axis=1)
        is_smooth &= np.einsum("nd,nd->n", edge_normal[row], edge_normal[next_row]) > np.cos(np.radians(CORNER))
        first_of, second_of = number[row[is_smooth]], number[next_row[is_smooth]]
        graph = coo_array((np.ones(len(first_of)), (first_of, second_of)), shape=(len(self.body),) * 2)
        return np.asarray(connected_components(graph, directed=False)[1], np.intp)

    def facets(self, numbers: Indices) -> dict[str, Numbers]:
        """Return the nodes of the facets `numbers` by element type."""
        blocks_and_rows = zip(self.blocks.items(), by_block(numbers, map(len, self.blocks.values())), strict=True)
        return {name: block[rows] for (name, block), (_, rows) in blocks_and_rows if len(rows)}


@record
class FacingPoints:
    """Points of facets that face another body.

    Attributes
    ----------
    facet, opposite : ndarray of int (n,)
        The facet of each point, and the closest facet of all other bodies.
    gap : ndarray (n,)
        Distance of the point from the opposite facet, negative where bodies overlap [length].
    """

    facet: Indices
    opposite: Indices
    gap: Array


def facing_points(facets: OuterFacets, distance: float | None, angle: float) -> FacingPoints:
    """Return the points at which facets face another body; see `find_contacts` for `distance` [length] and `angle` [degrees].

    Only the closest facet of all other bodies counts, so that a third body between two bodies hides them from each other.
    """
    all_facets = np.ones(len(facets.body), bool)
    close = _search(facets, distance, angle, all_facets)
    if distance is not None:
        return close
    # Two smooth faces that are close to each other in one place also face each other where their gap is larger.
    face = facets.smooth_face
    distant = _search(facets, np.inf, angle, np.isin(face, face[np.concatenate([close.facet, close.opposite])]))
    pairs = [np.sort(np.column_stack([face[p.facet], face[p.opposite]]), axis=1) for p in (close, distant)]
    key, distant_key = (pair @ [len(face), 1] for pair in pairs)
    # The distant points include all open points of the same pairs of faces, and the close points those that touch or overlap.
    is_open, is_closed = np.isin(distant_key, key) & (distant.gap > 0.0), close.gap <= 0.0
    fields = ((close.facet, distant.facet), (close.opposite, distant.opposite), (close.gap, distant.gap))
    return FacingPoints(*(np.concatenate([closed[is_closed], opened[is_open]]) for closed, opened in fields))


def _search(facets: OuterFacets, distance: float | None, angle: float, searched: Mask) -> FacingPoints:
    """Return the points at which the facets that the mask `searched` (n,) marks face another body."""
    by_body = (_arrays_of_body(facets, body, distance, angle, searched) for body in np.unique(facets.body))
    return FacingPoints(*map(np.concatenate, zip(*by_body, strict=True)))


def _arrays_of_body(
    facets: OuterFacets, body: int, distance: float | None, angle: float, searched: Mask
) -> tuple[Indices, Indices, Array]:
    """Return the arrays of `FacingPoints` for the points in those facets of one body that are `searched` (n,)."""
    facet_of_point, point, normal = facets.samples
    (low, high), size = facets.boxes, facets.size
    of_body = facets.body == body
    reach = float(size.max()) if distance is None else distance
    lower, upper = low[of_body].min(axis=0) - reach, high[of_body].max(axis=0) + reach
    is_other = ~of_body & ((high >= lower) & (low <= upper)).all(axis=1)
    candidates = np.flatnonzero((of_body & searched)[facet_of_point])
    if is_other.any():
        lower, upper = low[is_other].min(axis=0) - reach, high[is_other].max(axis=0) + reach
        position = point[candidates]
        candidates = candidates[((position >= lower) & (position <= upper)).all(axis=1)]
    if not is_other.any() or not len(candidates):
        return np.empty(0, np.intp), np.empty(0, np.intp), np.empty(0)
    facets_by_type = facets.facets(np.flatnonzero(is_other)).values()
    closest = closest_of_types(point[candidates], [facets.mesh.points[block] for block in facets_by_type])
    facet, opposite = facet_of_point[candidates], np.flatnonzero(is_other)[closest.facet]
    difference = point[candidates] - closest.position
    gap = np.einsum("nd,nd->n", difference, closest.normal)
    offset = np.linalg.norm(difference - gap[:, None] * closest.normal, axis=1)
    larger_size = np.maximum(size[facet], size[opposite])
    is_opposed = np.einsum("nd,nd->n", normal[candidates], closest.normal) <= -np.cos(np.radians(angle))
    is_near = closest.distance <= (larger_size if distance is None else distance) + LENGTH_ROUND_OFF * larger_size
    is_above = offset <= np.abs(gap) * np.tan(np.radians(angle)) + LENGTH_ROUND_OFF * larger_size
    is_facing = is_opposed & is_near & is_above
    return facet[is_facing], opposite[is_facing], gap[is_facing]
