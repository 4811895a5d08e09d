"""Facets of different bodies that face each other, by projection of sample points onto the closest facets."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fastcontact.arrays import Array, Indices, Mask, Numbers
from fastcontact.contact.projection import CORNER, closest_of_kinds
from fastcontact.contact.surface import by_block
from fastcontact.mesh import elements
from fastcontact.mesh.area_vectors import area_vectors
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import cells_of_outer_facets, outer_facets
from fastcontact.round_off import LENGTH_ROUND_OFF

# Distance of the sample points near nodes from these nodes, relative to that of the nodes from the middle of the facet.
INSET = 0.02


@dataclass(frozen=True, eq=False)
class OuterFacets:
    """The outer facets of bodies, in blocks of one element type and numbered consecutively.

    Attributes
    ----------
    mesh : Mesh
    blocks : dict of str to ndarray of int (n_facets, n_nodes)
        Connectivity by element type, normals outward.
    body, cell : ndarray of int (n,)
        Body and solid cell of each facet.
    """

    mesh: Mesh
    blocks: dict[str, Numbers]
    body: Indices
    cell: Indices

    @classmethod
    def of(cls, mesh: Mesh, body_of_cells: Indices) -> OuterFacets:
        """Return the outer facets of the cells whose body, in `body_of_cells` (n_cells,) of int, is not -1."""
        blocks, cells = {}, []
        for name, facets in outer_facets(mesh).items():
            behind = cells_of_outer_facets(mesh)[name]
            kept = body_of_cells[behind] >= 0
            blocks[name] = facets[kept]
            cells.append(behind[kept])
        cell = np.concatenate(cells).astype(np.intp)
        return cls(mesh, blocks, body_of_cells[cell], cell)

    @cached_property
    def first(self) -> Indices:
        """The number of the first facet of each block, and the total number."""
        return np.cumsum([0, *map(len, self.blocks.values())])

    @cached_property
    def samples(self) -> tuple[Indices, Array, Array]:
        """Sample points inside the facets: facet (m,), position (m, dim) [length] and outward normal (m, dim) of each."""
        facet, point, normal = [], [], []
        for (name, facets), first in zip(self.blocks.items(), self.first):
            element = elements.get(name)
            inside = element.nodes + INSET * (element.nodes.mean(axis=0) - element.nodes)
            xi = np.concatenate([element.quadrature[0], inside])  # facets may overlap only by a narrow strip
            shape, gradient = element.shape(xi), element.gradient(xi)
            corners = self.mesh.points[facets]
            point.append((shape @ corners).reshape(-1, self.mesh.dim))
            normal.append(area_vectors(corners, gradient).reshape(-1, self.mesh.dim))
            facet.append(np.repeat(first + np.arange(len(facets)), len(shape)))
        normals = np.concatenate(normal)
        return np.concatenate(facet), np.concatenate(point), normals / np.linalg.norm(normals, axis=1, keepdims=True)

    @cached_property
    def area(self) -> Array:
        """Areas (n,), in 2D lengths [length^(dim - 1)]."""
        areas = [np.empty(0)]
        for name, facets in self.blocks.items():
            _, gradient, weights = elements.get(name).tables
            areas.append(np.linalg.norm(area_vectors(self.mesh.points[facets], gradient), axis=2) @ weights)
        return np.concatenate(areas)

    @cached_property
    def size(self) -> Array:
        """Sizes (n,) [length]."""
        return np.asarray(self.area ** (1.0 / (self.mesh.dim - 1)))

    @cached_property
    def spacing(self) -> Array:
        """Distances between nodes (n,) [length]: half the size of quadratic facets."""
        order = [elements.get(name).order for name in self.blocks]
        return self.size / np.repeat(order, np.diff(self.first))

    @cached_property
    def boxes(self) -> tuple[Array, Array]:
        """Lower and upper corners (n, dim) of the boxes around the nodes [length]."""
        corners = [self.mesh.points[facets] for facets in self.blocks.values()]
        return np.concatenate([c.min(axis=1) for c in corners]), np.concatenate([c.max(axis=1) for c in corners])

    @cached_property
    def smooth_face(self) -> Indices:
        """The smooth face (n,) of each facet: adjacent facets without a corner between them share one."""
        keys, facet, normal = [], [], []
        for (name, facets), first in zip(self.blocks.items(), self.first):
            element = elements.get(name)
            at_nodes = area_vectors(self.mesh.points[facets], element.gradient(element.nodes))
            at_nodes /= np.linalg.norm(at_nodes, axis=2, keepdims=True)
            for ends in [(0, 0), (1, 1)] if self.mesh.dim == 2 else element.edges:
                keys.append(np.sort(facets[:, ends], axis=1))
                normal.append(at_nodes[:, ends].sum(axis=1))
                facet.append(first + np.arange(len(facets)))
        key, edge_normal, number = np.concatenate(keys), np.concatenate(normal), np.concatenate(facet)
        edge_normal /= np.linalg.norm(edge_normal, axis=1, keepdims=True)
        order = np.lexsort(key.T)
        row, next_row = order[:-1], order[1:]
        joined = (key[row] == key[next_row]).all(axis=1)
        joined &= np.einsum("nd,nd->n", edge_normal[row], edge_normal[next_row]) > np.cos(np.radians(CORNER))
        first_of, second_of = number[row[joined]], number[next_row[joined]]
        graph = coo_array((np.ones(len(first_of)), (first_of, second_of)), shape=(len(self.body),) * 2)
        return np.asarray(connected_components(graph, directed=False)[1], np.intp)

    def facets(self, numbers: Indices) -> dict[str, Numbers]:
        """Return the connectivity of the facets `numbers` by element type."""
        of_blocks = zip(self.blocks.items(), by_block(numbers, map(len, self.blocks.values())), strict=True)
        return {name: block[rows] for (name, block), (_, rows) in of_blocks if len(rows)}


@dataclass(frozen=True, eq=False)
class Facing:
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


def facing(outside: OuterFacets, distance: float | None, angle: float) -> Facing:
    """Return the points at which facets face another body; see `find_contacts` for `distance` [length] and `angle` [degrees].

    A third body between two bodies hides them from each other, since only the closest facet of all other bodies counts.
    """
    everywhere = np.ones(len(outside.body), bool)
    near = _search(outside, distance, angle, everywhere)
    if distance is not None:
        return near
    # Smooth faces that are close to each other somewhere also face each other where their gap is larger.
    face = outside.smooth_face
    key = np.sort(np.column_stack([face[near.facet], face[near.opposite]]), axis=1) @ [len(face), 1]
    far = _search(outside, np.inf, angle, np.isin(face, face[np.concatenate([near.facet, near.opposite])]))
    far_key = np.sort(np.column_stack([face[far.facet], face[far.opposite]]), axis=1) @ [len(face), 1]
    ahead, touching = np.isin(far_key, key) & (far.gap > 0.0), near.gap <= 0.0
    fields = ((near.facet, far.facet), (near.opposite, far.opposite), (near.gap, far.gap))
    return Facing(*(np.concatenate([from_near[touching], from_far[ahead]]) for from_near, from_far in fields))


def _search(outside: OuterFacets, distance: float | None, angle: float, among: Mask) -> Facing:
    """Return the facets of other bodies that the sample points of the facets `among` (n,) face."""
    facing_of_bodies = [_faced_by(outside, body, distance, angle, among) for body in np.unique(outside.body)]
    return Facing(*(np.concatenate(of_bodies) for of_bodies in zip(*facing_of_bodies, strict=True)))


def _faced_by(
    outside: OuterFacets, body: int, distance: float | None, angle: float, among: Mask
) -> tuple[Indices, Indices, Array]:
    """Return the arrays of `Facing` for the points in those facets of one body that are `among` (n,)."""
    facet_of_point, point, normal = outside.samples
    (low, high), size = outside.boxes, outside.size
    of_body = outside.body == body
    reach = float(size.max()) if distance is None else distance
    begin, end = low[of_body].min(axis=0) - reach, high[of_body].max(axis=0) + reach
    others = ~of_body & ((high >= begin) & (low <= end)).all(axis=1)
    candidates = np.flatnonzero((of_body & among)[facet_of_point])
    if others.any():
        at, begin, end = point[candidates], low[others].min(axis=0) - reach, high[others].max(axis=0) + reach
        candidates = candidates[((at >= begin) & (at <= end)).all(axis=1)]
    if not others.any() or not len(candidates):
        return np.empty(0, np.intp), np.empty(0, np.intp), np.empty(0)
    kinds = outside.facets(np.flatnonzero(others)).values()
    closest = closest_of_kinds(point[candidates], [outside.mesh.points[block] for block in kinds])
    facet, opposite = facet_of_point[candidates], np.flatnonzero(others)[closest.facet]
    difference = point[candidates] - closest.position
    gap = np.einsum("nd,nd->n", difference, closest.normal)
    offset = np.linalg.norm(difference - gap[:, None] * closest.normal, axis=1)
    larger = np.maximum(size[facet], size[opposite])
    opposed = np.einsum("nd,nd->n", normal[candidates], closest.normal) <= -np.cos(np.radians(angle))
    near = closest.distance <= (larger if distance is None else distance) + LENGTH_ROUND_OFF * larger
    ahead = offset <= np.abs(gap) * np.tan(np.radians(angle)) + LENGTH_ROUND_OFF * larger
    kept = opposed & near & ahead
    return facet[kept], opposite[kept], gap[kept]
