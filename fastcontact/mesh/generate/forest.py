"""Local red-green refinement of 2D meshes of triangles and quadrangles (Bank, Sherman and Weiser, 1983).

A forest contains every cell of an initial mesh and its descendants. Cells without descendants are its leaves. Red refinement
divides marked leaves into four. Green refinement divides the neighbours of smaller leaves. It changes only the mesh and not
the forest, so that angles do not deteriorate with repeated refinement.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import AnyArray, Mask
from fastcontact.errors import MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.generate.quadratic import Curve, centres, edge_keys, edges_of, edges_on, ends_of
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.quality import check_cells

CORNERS = {"line2": 2, "tri3": 3, "quad4": 4}
# Nodes of the children of a cell. They are numbers of its corners, of the midpoints of its edges, and of the centre of
# quadrangles, in this order.
RED = {
    "line2": [[0, 2], [2, 1]],
    "tri3": [[0, 3, 5], [3, 1, 4], [5, 4, 2], [4, 5, 3]],
    "quad4": [[0, 4, 8, 7], [4, 1, 5, 8], [8, 5, 2, 6], [7, 8, 6, 3]],
}
# Cells that replace a leaf, for its element type and number of divided edges. The leaf is first rotated such that edge 0, or
# edges 0 and 2, are divided.
GREEN: dict[tuple[str, int], dict[str, list[list[int]]]] = {
    ("tri3", 1): {"tri3": [[0, 3, 2], [3, 1, 2]]},
    ("quad4", 1): {"tri3": [[0, 4, 3], [4, 1, 2], [4, 2, 3]]},
    ("quad4", 2): {"quad4": [[0, 4, 6, 3], [4, 1, 2, 6]]},
}


@dataclass(eq=False)
class _Leaves:
    """Leaves of one element type: the corners (n, k), and the number (n,) of the initial cell from which each descends."""

    corners: AnyArray
    root: AnyArray


@typed(MeshError)
class Forest:
    """A mesh that can be refined locally any number of times.

    Parameters
    ----------
    mesh : Mesh
        Two-dimensional mesh of line2, tri3 and quad4 cells.
    curves : iterable of Circle, optional
        Exact shapes of the boundary, or other objects with `group` and `project`: new points of facets on a curve are
        moved onto it.

    Raises
    ------
    MeshError
        If a cell is of another type, or the group of a curve has no facet on the curve.

    Examples
    --------
    >>> import numpy as np
    >>> from fastcontact import generate
    >>> forest = generate.Forest(generate.block(divisions=(2, 2)))
    >>> forest.refine(np.array([True, False, False, False]))
    >>> mesh, leaves = forest.mesh()
    """

    def __init__(self, mesh: Mesh, curves: Iterable[Curve] = ()) -> None:
        for name, block in mesh.cells.items():
            if name not in CORNERS:
                raise MeshError(
                    f"{len(block)} cells of {name} cannot be refined locally: use `linearised` on a mesh of triangles and "
                    "quadrangles, and `to_quadratic` after refinement"
                )
        self.initial, self.curves = mesh, list(curves)
        self.points = mesh.points
        self._leaves = {
            name: _Leaves(block.astype(np.int64), mesh.offsets[name] + np.arange(len(block)))
            for name, block in mesh.cells.items()
        }
        # The sorted keys of divided edges, and the numbers of their midpoints.
        self._divided, self._midpoint_numbers = np.empty(0, np.int64), np.empty(0, np.int64)
        self._groups = {group: np.asarray(members) for group, members in mesh.point_groups.items()}
        self._on_curve = [edges_on(mesh, curve) for curve in self.curves]

    @property
    def solids(self) -> list[str]:
        """Element types of the solid leaves, in the order of the marks of `refine`."""
        return [name for name in self._leaves if name != "line2"]

    @property
    def n_leaves(self) -> int:
        """Number of solid leaves."""
        return sum(len(self._leaves[name].corners) for name in self.solids)

    def refine(self, marked: Mask) -> None:
        """Divide the marked solid leaves into four, and further leaves such that neighbours differ by at most one level.

        Parameters
        ----------
        marked : ndarray of bool (n_leaves,)
            Whether to divide each leaf. Leaves are ordered by element type as in `solids`, with the numbers that `mesh`
            returns.
        """
        starts = np.cumsum([0, *(len(self._leaves[name].corners) for name in self.solids)])
        marks = {name: marked[a:b] for name, a, b in zip(self.solids, starts[:-1], starts[1:], strict=True)}
        while any(mask.any() for mask in marks.values()):
            for name, mask in marks.items():
                self._refine_leaves(name, mask)
            marks = {name: self._leaves_to_refine(name) for name in self.solids}
        self._refine_lines()

    def _midpoints(self, keys: AnyArray) -> AnyArray:
        """Return the numbers of the midpoints of edges, and -1 for edges that are not divided."""
        if not len(self._divided):
            return np.full(keys.shape, -1)
        index = np.minimum(np.searchsorted(self._divided, keys), len(self._divided) - 1)
        return np.where(self._divided[index] == keys, self._midpoint_numbers[index], -1)

    def _add_midpoints(self, keys: AnyArray) -> None:
        """Add the midpoints of edges that are not divided yet."""
        new_keys = np.setdiff1d(keys, self._divided)
        if not len(new_keys):
            return
        ends = ends_of(new_keys)
        numbers = len(self.points) + np.arange(len(new_keys))
        positions = self.points[ends].mean(axis=1)
        for k, curve in enumerate(self.curves):
            rows = np.isin(new_keys, self._on_curve[k])
            positions[rows] = curve.project(positions[rows])
            halves = edge_keys(np.stack([ends[rows], np.repeat(numbers[rows, None], 2, axis=1)], axis=2)).ravel()
            self._on_curve[k] = np.concatenate([self._on_curve[k], halves])
        self.points = np.concatenate([self.points, positions])
        for group, members in self._groups.items():
            if len(members) > 1:
                self._groups[group] = np.concatenate([members, numbers[np.isin(ends, members).all(axis=1)]])
        order = np.argsort(np.concatenate([self._divided, new_keys]))
        self._divided = np.concatenate([self._divided, new_keys])[order]
        self._midpoint_numbers = np.concatenate([self._midpoint_numbers, numbers])[order]

    def _refine_leaves(self, name: str, mask: Mask) -> None:
        """Divide the marked leaves of one element type: quadrangles and triangles into four, lines into two."""
        leaves = self._leaves[name]
        parents = leaves.corners[mask]
        keys = edges_of(name, parents)
        self._add_midpoints(np.unique(keys))
        lattice = [parents, self._midpoints(keys)]
        if name == "quad4":
            lattice.append(len(self.points) + np.arange(len(parents))[:, None])
            self.points = np.concatenate([self.points, centres(self.points[parents], self.points[lattice[1]])])
        children = np.concatenate(lattice, axis=1)[:, RED[name]].reshape(-1, CORNERS[name])
        roots = np.repeat(leaves.root[mask], len(RED[name]))
        corners = np.concatenate([leaves.corners[~mask], children])
        self._leaves[name] = _Leaves(corners, np.concatenate([leaves.root[~mask], roots]))

    def _leaves_to_refine(self, name: str) -> Mask:
        """Return the mask (n,) of leaves that must be divided because there is no green refinement for them.

        They have an edge that is divided more than once, or too many divided edges.
        """
        corners = self._leaves[name].corners
        keys = edges_of(name, corners)
        midpoints = self._midpoints(keys)
        divided = midpoints >= 0
        ends = corners[:, elements.get(name).edges]
        twice = np.zeros(divided.shape, bool)
        for end in (0, 1):
            half_keys = edge_keys(np.stack([ends[:, :, end], np.where(divided, midpoints, 0)], axis=2))
            twice |= divided & (self._midpoints(half_keys) >= 0)
        count = divided.sum(axis=1)
        opposite = (count == 2) & (divided[:, 0] == divided[:, 2]) if name == "quad4" else np.zeros(len(corners), bool)
        return np.asarray(twice.any(axis=1) | ((count > 1) & ~opposite))

    def _refine_lines(self) -> None:
        """Divide lines until no line has a divided edge."""
        while "line2" in self._leaves:
            mask = (self._midpoints(edges_of("line2", self._leaves["line2"].corners)) >= 0).ravel()
            if not mask.any():
                return
            self._refine_leaves("line2", mask)

    def mesh(self) -> tuple[Mesh, AnyArray]:
        """Return the mesh of all leaves, and the leaf (n,) of each of its solid cells, in the order of `Mesh.solids`.

        Cell groups contain the descendants of their cells. A new point belongs to the point groups that contain both ends of
        its edge.
        """
        blocks: dict[str, list[tuple[AnyArray, AnyArray, AnyArray]]] = {}  # cells with their roots and leaves
        first = 0
        for name, leaves in self._leaves.items():
            for kind, cells, leaf in self._green_cells(name, leaves.corners):
                blocks.setdefault(kind, []).append((cells, leaves.root[leaf], first + leaf))
            first += len(leaves.corners) if name != "line2" else 0
        joined = {kind: [np.concatenate(arrays) for arrays in zip(*blocks[kind], strict=True)] for kind in blocks}
        root = np.concatenate([roots for _, roots, _ in joined.values()])
        groups = {group: np.flatnonzero(np.isin(root, members)) for group, members in self.initial.cell_groups.items()}
        mesh = Mesh(self.points, {kind: cells for kind, (cells, _, _) in joined.items()}, groups, self._groups)
        check_cells(mesh)
        return mesh, np.concatenate([joined[kind][2] for kind in mesh.solids])

    def _green_cells(self, name: str, corners: AnyArray) -> list[tuple[str, AnyArray, AnyArray]]:
        """Return element types, cells and the leaf of each cell, after green refinement of leaves with divided edges."""
        if name == "line2":
            return [(name, corners, np.arange(len(corners)))]
        midpoints = self._midpoints(edges_of(name, corners))
        count = (midpoints >= 0).sum(axis=1)
        blocks = [(name, corners[count == 0], np.flatnonzero(count == 0))]
        sides = CORNERS[name]
        for rotation in range(sides):
            rotated = (np.arange(sides) + rotation) % sides
            for number in (1, 2):
                rows = (count == number) & (midpoints[:, rotation] >= 0)
                if (name, number) not in GREEN or (number == 2 and rotation > 1):
                    continue
                lattice = np.concatenate([corners[:, rotated], midpoints[:, rotated]], axis=1)[rows]
                for kind, pattern in GREEN[name, number].items():
                    cells = lattice[:, pattern].reshape(-1, CORNERS[kind])
                    blocks.append((kind, cells, np.repeat(np.flatnonzero(rows), len(pattern))))
        return blocks
