"""A side of a contact pair: the facets of a group, with normals that point out of the body."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from fastcontact._tools.records import record, replace
from fastcontact.arrays import AnyArray, Array, Indices, Mask, Numbers, numbers_at
from fastcontact.errors import ContactError, MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import cached_by_mesh, ordered_line, outer_facets, outer_rows


@record
class FacetBlock:
    """Facets of one element type.

    Attributes
    ----------
    element : str
        Name of the element type of the facets.
    facets : ndarray of int (n_facets, n_nodes)
        Point numbers of the nodes of each facet, oriented such that normals point out of the body.
    local : ndarray of int (n_facets, n_nodes)
        The same nodes, as positions in `Surface.points`.
    """

    element: str
    facets: Numbers
    local: Indices

    @cached_property
    def neighbours(self) -> Indices:
        """Line facets (n_facets, 2) of the block before and after each of its line facets; -1 if there is none."""
        return _line_neighbours(self.local)

    @cached_property
    def slopes_at_nodes(self) -> Array:
        """Derivatives (n_nodes, n_nodes, dim - 1) of the shape functions (second index) at the nodes (first index) [-]."""
        element = elements.get(self.element)
        return element.gradient(element.nodes)

    def diameters(self, coordinates: Array) -> Array:
        """Return the largest distance (n_facets,) between two nodes of each facet [length].

        `coordinates` (n_points, dim) are those of all points of the mesh [length].
        """
        x = coordinates[self.facets]
        return np.asarray(np.linalg.norm(x[:, :, None] - x[:, None], axis=3).max(axis=(1, 2)))


@record
class Surface:
    """Facets of one side of a contact pair.

    Each block contains the facets of one element type. Facets are numbered consecutively through all blocks.

    Attributes
    ----------
    group : str
        Name of the group in the mesh.
    blocks : tuple of FacetBlock
        The facets. There are several blocks if the side has triangles and quadrangles.
    points : ndarray of int (m,)
        Point numbers of the nodes: in the order along the line if the facets form one open line, otherwise in ascending
        order.
    abscissa : ndarray (m,)
        Arc length along the line to each node; zero if the facets do not form one open line [length].
    periodic_ends : tuple of (ndarray of int (k,), ndarray of int (k,), ndarray (dim, dim) or (k, dim, dim))
        Ends at which the surface is continued: positions in `points` of the nodes of two ends, and the rotation from the
        first to the second end [-]. In a plane of symmetry both ends are the same nodes, and the rotation is a reflection.
    """

    group: str
    blocks: tuple[FacetBlock, ...]
    points: Numbers
    abscissa: Array
    periodic_ends: tuple[tuple[Indices, Indices, Array], ...] = ()

    def with_periodic_ends(self, ends: Iterable[tuple[Indices, Indices, Array]]) -> Surface:
        """Return the surface with `periodic_ends`, given by point numbers; nodes that are not on the surface are ignored."""
        order, ends_on_surface = np.argsort(self.points), []
        for first, second, rotation in ends:
            valid = np.isin(first, self.points) & np.isin(second, self.points) & (first != second)
            numbers = (order[np.searchsorted(self.points, end[valid], sorter=order)] for end in (first, second))
            ends_on_surface.append((*numbers, rotation))
        return replace(self, periodic_ends=tuple(ends_on_surface))

    def add_across_ends(self, vectors: Array) -> None:
        """Add up the vectors (m, dim) of corresponding nodes at both ends of each periodic interface, in place.

        The vectors are sums over the facets of a node. At a periodic end these include the facets at the other end.
        """
        for first, second, rotation in self.periodic_ends:
            vectors[first] += (vectors[second][:, None] @ rotation)[:, 0]
            vectors[second] = (vectors[first][:, None] @ np.swapaxes(rotation, -1, -2))[:, 0]

    @cached_property
    def sizes(self) -> list[int]:
        """Number of facets of each block."""
        return [len(block.facets) for block in self.blocks]

    @cached_property
    def n_facets(self) -> int:
        """Number of facets of all blocks."""
        return sum(self.sizes)

    @cached_property
    def offsets(self) -> Indices:
        """Number of the first facet of each block, and the total number of facets."""
        return np.cumsum([0, *self.sizes])

    @cached_property
    def order(self) -> int:
        """Order of the facets: 1 if all facets are linear, otherwise 2."""
        return max(elements.get(block.element).order for block in self.blocks)

    @property
    def only_block(self) -> FacetBlock:
        """The only block of facets.

        Raises ContactError if there are several.
        """
        if len(self.blocks) > 1:
            raise ContactError(
                f"group '{self.group}' mixes facets of {' and '.join(block.element for block in self.blocks)}, which this "
                "formulation does not take: use 'continuous' or 'node_to_segment', or mesh the surface with one kind"
            )
        return self.blocks[0]

    @cached_property
    def ends(self) -> Indices:
        """Nodes (n_facets, 2) at both ends of line facets, numbered on the side."""
        return self.all_local[:, :2]

    @cached_property
    def inner_ends(self) -> Mask:
        """Ends (n_facets, 2) of line facets at which another line facet begins or ends."""
        return np.asarray(np.bincount(self.ends.ravel())[self.ends] > 1)

    @cached_property
    def line_neighbours(self) -> Indices:
        """Line facets (n_facets, 2) before and after each line facet of the side; -1 if there is none."""
        return _line_neighbours(self.ends)

    @cached_property
    def all_facets(self) -> Numbers:
        """Point numbers (n_facets, k) of the nodes of all facets; if a facet has fewer than k nodes, the last is repeated."""
        return padded([block.facets for block in self.blocks])

    @cached_property
    def all_local(self) -> Indices:
        """The nodes `all_facets` (n_facets, k), numbered on the side."""
        return padded([block.local for block in self.blocks])

    @cached_property
    def node_weights(self) -> Array:
        """One for each node of `all_facets` (n_facets, k), zero where the last node of a facet is repeated."""
        return padded([np.ones(block.local.shape) for block in self.blocks])

    @cached_property
    def incidence(self) -> csr_array:
        """Incidence matrix (n_facets, m) of facets and nodes: one if a node belongs to a facet, otherwise zero."""
        nodes = np.concatenate([block.local.ravel() for block in self.blocks])
        sizes = np.concatenate([np.full(len(block.local), block.local.shape[1]) for block in self.blocks])
        start = np.concatenate([[0], np.cumsum(sizes)])
        return csr_array((np.ones(len(nodes)), nodes, start), shape=(self.n_facets, len(self.points)))

    @cached_property
    def node_adjacency(self) -> csr_array:
        """Adjacency matrix (m, m) of the nodes: one if two nodes belong to the same facet, otherwise zero."""
        adjacency = csr_array(self.incidence.T @ self.incidence)
        adjacency.sort_indices()
        adjacency.data[:] = 1.0
        return adjacency

    @cached_property
    def extended_adjacency(self) -> csr_array:
        """Matrix (m, m), one if two nodes belong to the same facet or to two facets with a common node, otherwise zero."""
        adjacency = csr_array(self.node_adjacency @ self.node_adjacency)
        adjacency.data[:] = 1.0
        return adjacency

    @cached_property
    def triangular(self) -> Mask:
        """The facets (n_facets,) that are triangles."""
        return np.concatenate([np.full(len(b.facets), elements.get(b.element).n_corners == 3) for b in self.blocks])

    @cached_property
    def neighbours(self) -> tuple[Indices, Indices]:
        """For each facet, the other facets with which it has a common node, in ascending order.

        They are stored as offsets (n_facets + 1,) and numbers of facets, as in a CSR matrix.
        """
        adjacency = csr_array(self.incidence @ self.incidence.T)
        adjacency.setdiag(0.0)
        adjacency.eliminate_zeros()
        adjacency.sort_indices()
        return adjacency.indptr.astype(np.intp), adjacency.indices.astype(np.intp)

    def largest_diameters(self, coordinates: Array) -> Array:
        """Return the diameter of the largest facet at each node (m,) [length]; see `FacetBlock.diameters`."""
        largest = np.zeros(len(self.points))
        for block in self.blocks:
            np.maximum.at(largest, block.local, block.diameters(coordinates)[:, None])
        return largest

    def node_positions(self, coordinates: Array) -> list[Array]:
        """Return the positions (n_facets, n_nodes, dim) of the nodes of the facets of each block [length].

        `coordinates` (n_points, dim) are those of all points of the mesh [length].
        """
        return [coordinates[block.facets] for block in self.blocks]


def by_block(numbers: Indices, sizes: Iterable[int]) -> Iterator[tuple[Indices, Indices]]:
    """Distribute items to blocks of the given sizes; `numbers` (n,) are consecutive through all blocks.

    Yields, for each block, the positions of its items in `numbers`, and their rows in the block.
    """
    first = 0
    for size in sizes:
        positions = np.flatnonzero((numbers >= first) & (numbers < first + size))
        yield positions, numbers[positions] - first
        first += size


def padded(arrays: Sequence[AnyArray]) -> AnyArray:
    """Return arrays (n_i, k_i, ...) concatenated along the first axis, padded to the largest k_i.

    Integers are padded with the last entry of the row, floating-point numbers with zeros.
    """
    if len(arrays) == 1:
        return arrays[0]
    width = max(values.shape[1] for values in arrays)
    mode: Any = "edge" if np.issubdtype(arrays[0].dtype, np.integer) else "constant"
    unpadded = [(0, 0)] * (arrays[0].ndim - 2)
    return np.concatenate([np.pad(x, ((0, 0), (0, width - x.shape[1]), *unpadded), mode) for x in arrays])


def _line_neighbours(local: Indices) -> Indices:
    """Return `Surface.line_neighbours` for lines with nodes (n, k), which must have the same orientation."""
    begins, ends = np.full((2, int(local.max()) + 1), -1, np.intp)
    begins[local[:, 0]] = ends[local[:, 1]] = np.arange(len(local))
    return np.column_stack([ends[local[:, 0]], begins[local[:, 1]]])


@cached_by_mesh
def surface(mesh: Mesh, group: str) -> Surface:
    """Return the facets of `group`, oriented such that normals point out of the body, as ORIE_PEAU of code_aster does.

    Raises
    ------
    MeshError
        If there is no such group.
    ContactError
        If the group contains no facets, or a facet that lies inside a solid or does not belong to one.
    """
    cells = mesh.cells_of(group, dim=mesh.dim - 1)
    if not cells:
        raise ContactError(
            f"group '{group}' contains no facets (cells of dimension {mesh.dim - 1}): name a boundary group"
        )
    remedy = (
        ": give each body nodes of its own, which merge_points may have joined, and let boundary facets share their nodes "
        "with solid cells"
    )
    facets = {}
    for name, block in cells.items():
        rows = outer_rows(mesh, group, name, block, ContactError, remedy)
        facets[name] = outer_facets(mesh)[name][np.unique(rows)]
    points, abscissa = _ordered(mesh, group, facets)
    position = numbers_at(points, mesh.n_points)
    blocks = tuple(FacetBlock(name, block, position[block]) for name, block in facets.items())
    return Surface(group, blocks, points, abscissa)


def _ordered(mesh: Mesh, group: str, facets: Mapping[str, Numbers]) -> tuple[Numbers, Array]:
    """Return `Surface.points` (m,) and `Surface.abscissa` (m,)."""
    if mesh.dim == 2:
        try:
            line = ordered_line(mesh, group)
            return line.points, line.abscissa
        except MeshError:  # a closed line, or several pieces, have no order
            pass
    points = np.unique(np.concatenate([block.ravel() for block in facets.values()]))
    return points, np.zeros(len(points))
