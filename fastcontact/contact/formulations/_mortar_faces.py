"""Mortar contact in three dimensions: weighted gaps, integrated exactly over the pieces where facets face each other.

Every secondary facet is cut by the primary facets opposite, in its own plane, and the pieces are integrated by
triangles (Puso, 2004; Popp, Gitterle, Gee and Wall, 2010). The pressure field is linear between the corner nodes, also
on quadratic facets, whose nodal functions are no help: those of corners have no area on flat triangles. One weighted
gap belongs to each corner node; its multiplier is the force of the node's share of the pressure.

Curved facets are cut by their corner polygons, an error of second order in the facet's length over its radius.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array

from fastcontact import elements, quadrature
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.formulations._formulation import Formulation
from fastcontact.contact.integration import facet_measure, fine_rule
from fastcontact.contact.pairing import Candidates, filled_up, pair, rows_along, tangents
from fastcontact.contact.surface import FacetBlock, Surface
from fastcontact.errors import ContactError
from fastcontact.kernels import clip3d

Array = NDArray[np.float64]
# Facets face each other if their normals enclose more than about 95 degrees.
FACING = -0.1
# A node of which less than this part of its area faces the primary side takes no part.
COVERED = 1e-3


@dataclass(eq=False)
class MortarFaces(Formulation):
    """Mortar contact between faces; parameters as in `Formulation`."""

    projection_tolerance: float = 1e-6
    normals: str = "averaged"

    name: ClassVar[str] = "mortar"
    geometry_in_loop: ClassVar[bool] = True
    _areas: Array = field(init=False, repr=False)
    _weight: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._areas = np.zeros(len(self.secondary.points))
        for block in self.secondary.blocks:
            linear = elements.get(elements.get(block.element).linear)
            xi, weights = fine_rule(block.element)
            dA = facet_measure(block.facets, block.element, self.points, xi, False) * weights
            np.add.at(self._areas, block.local[:, : linear.n_nodes], dA @ linear.shape(xi))

    def constraints(self, displacement: Array) -> Constraints:
        """Cut and pair on the displaced configuration and return one mean gap per corner node."""
        deformed = self.points + displacement
        owner, triangles = self._pieces(deformed)
        candidates, node, psi, area = self._integration_points(owner, triangles, deformed)
        pairing = pair(candidates.positions(deformed), self.primary, deformed, self.projection_tolerance, self.normals)
        kept = np.where(pairing.paired, area, 0.0)
        m, n = len(self.secondary.points), len(area)
        row = np.broadcast_to(np.arange(n)[:, None], psi.shape)
        W = coo_array(((psi * kept[:, None]).ravel(), (node.ravel(), row.ravel())), shape=(m, n)).tocsr()
        weight = np.asarray(W.sum(axis=1)).ravel()
        self._weight = np.where(weight > COVERED * np.maximum(self._areas, 1e-300), weight, np.inf)
        W = csr_array(diags_array(1.0 / self._weight) @ W)
        W.eliminate_zeros()
        B = csr_array(W @ rows_along(pairing.normal, candidates, pairing, self.primary, self.points.size))
        B.eliminate_zeros()
        positions = self.points[self.secondary.points]
        gap0 = B @ self.points.ravel()
        if not self.friction:
            return Constraints(B, gap0, positions)
        directions = tuple(tangents(self._mean_normals(W, pairing.normal)))
        n_dofs, still = self.points.size, np.zeros_like(pairing.normal)
        cartesian = [W @ rows_along(still + e, candidates, pairing, self.primary, n_dofs) for e in np.eye(3)]
        along = tuple(csr_array(sum(diags_array(t[:, k]) @ cartesian[k] for k in range(3))) for t in directions)
        return Constraints(B, gap0, positions, None, along, directions, np.full(m, self.friction))

    @staticmethod
    def _mean_normals(W: csr_array, normal: Array) -> Array:
        """Return unit means (m, 3) of the normals at the integration points of each node; e_z for nodes without."""
        mean = W @ normal
        mean[np.linalg.norm(mean, axis=1) == 0] = (0.0, 0.0, 1.0)
        return mean / np.linalg.norm(mean, axis=1, keepdims=True)

    def _pieces(self, deformed: Array) -> tuple[NDArray[np.intp], Array]:
        """Return owners (n,) and corners (n, 3, 3) of the triangles into which facing facets cut each other."""
        secondary, n_secondary = _polygons(self.secondary, deformed)
        assert isinstance(self.primary, Surface)
        primary, n_primary = _polygons(self.primary, deformed)
        pairs = _near(secondary, n_secondary, primary, n_primary)
        room = 8 * max(len(pairs), 1)
        owner, triangles = np.empty(room, np.intp), np.empty((room, 3, 3))
        count = clip3d.facing_triangles(secondary, n_secondary, primary, n_primary, pairs, FACING, owner, triangles)
        return owner[:count], triangles[:count]

    def _integration_points(
        self, owner: NDArray[np.intp], triangles: Array, deformed: Array
    ) -> tuple[Candidates, NDArray[np.intp], Array, Array]:
        """Return candidates, multiplier nodes (n, 4), their functions (n, 4) and reference areas (n,) of all points."""
        found: list[tuple[NDArray[Any], ...]] = []
        first = 0
        for block in self.secondary.blocks:
            mine = (owner >= first) & (owner < first + len(block.facets))
            found.append(self._of_block(block, owner[mine] - first, triangles[mine], deformed))
            first += len(block.facets)
        nodes, shape, corners, psi, area = zip(*found, strict=True)
        candidates = Candidates(filled_up(nodes), filled_up(shape))
        return candidates, filled_up(corners), filled_up(psi), np.concatenate(area)

    def _of_block(
        self, block: FacetBlock, owner: NDArray[np.intp], triangles: Array, deformed: Array
    ) -> tuple[NDArray[Any], ...]:
        """Return nodes, shape functions, multiplier nodes, multiplier functions and areas of one kind of facets."""
        element = elements.get(block.element)
        linear = elements.get(element.linear)
        bary, weights = quadrature.triangle(4 if element.order == 1 else 6)
        N = np.column_stack([1.0 - bary.sum(axis=1), bary])
        at = np.einsum("qk,tkd->tqd", N, triangles).reshape(-1, 3)
        normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        cut = (np.linalg.norm(normal, axis=1)[:, None] * weights).ravel()
        facet = np.repeat(owner, len(weights))
        normal = np.repeat(normal / np.linalg.norm(normal, axis=1, keepdims=True), len(weights), axis=0)
        xi, seen = _inverse_map(element, deformed[block.facets[facet]], at, normal)
        reference = _area_vector(element, self.points[block.facets[facet]], xi)
        area = cut * np.linalg.norm(reference, axis=1) / seen
        psi = linear.shape(xi)
        return block.facets[facet], element.shape(xi), block.local[facet][:, : linear.n_nodes], psi, area

    def pressure(self, multiplier: Array) -> Array:
        """Return forces over the areas they stand for at corner nodes, means of those at mid nodes."""
        pressure = multiplier / self._weight
        for block in self.secondary.blocks:
            element = elements.get(block.element)
            if element.order == 2:
                for k, (a, b) in enumerate(element.edges):
                    mid = block.local[:, element.n_corners + k]
                    pressure[mid] = 0.5 * (pressure[block.local[:, a]] + pressure[block.local[:, b]])
                if element.n_nodes == 9:
                    pressure[block.local[:, 8]] = pressure[block.local[:, :4]].mean(axis=1)
        return pressure

    def closed_nodes(self, active: NDArray[np.bool_], gap: Array, pressure: Array) -> NDArray[np.bool_]:
        """Return the active corner nodes, and the other nodes with a pressure."""
        return active | (pressure > 0)


def _polygons(side: Surface, coordinates: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return corners (n_facets, 4, 3) and their numbers (n_facets,) of all facets."""
    corners, count = np.zeros((side.n_facets, 4, 3)), np.zeros(side.n_facets, np.intp)
    first = 0
    for block in side.blocks:
        n = elements.get(block.element).n_corners
        rows = slice(first, first + len(block.facets))
        corners[rows, :n], count[rows] = coordinates[block.facets[:, :n]], n
        first = rows.stop
    return corners, count


def _near(
    secondary: Array, n_secondary: NDArray[np.intp], primary: Array, n_primary: NDArray[np.intp]
) -> NDArray[np.intp]:
    """Return pairs (n, 2) of facets near enough to face each other.

    Along the way from a secondary facet to the primary side lies at least the closest primary facet; whatever else
    faces it is no farther than that by more than the sizes of both.
    """
    from scipy.spatial import cKDTree

    ours, theirs = _spheres(secondary, n_secondary), _spheres(primary, n_primary)
    tree = cKDTree(theirs[0])
    away, _ = tree.query(ours[0])
    reach = away + 2.0 * ours[1] + 2.0 * theirs[1].max()
    lists = tree.query_ball_point(ours[0], reach)
    return np.array([(i, j) for i, near in enumerate(lists) for j in sorted(near)], np.intp).reshape(-1, 2)


def _spheres(corners: Array, count: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return centres (n, 3) and radii (n,) around facets."""
    inside = np.arange(4) < count[:, None]
    centre = (corners * inside[..., None]).sum(axis=1) / count[:, None]
    apart = np.linalg.norm(corners - centre[:, None], axis=2)
    return centre, np.where(inside, apart, 0.0).max(axis=1)


def _area_vector(element: elements.Element, corners: Array, xi: Array) -> Array:
    """Return the area vectors (n, 3) per unit of xi at one point of each facet."""
    tangent = np.einsum("nkj,nkd->njd", element.gradient(xi), corners)
    return np.cross(tangent[:, 0], tangent[:, 1])


def _inverse_map(element: elements.Element, corners: Array, at: Array, normal: Array) -> tuple[Array, Array]:
    """Return xi (n, 2) of the points of facets that lie above `at` (n, 3) along `normal`, and the area seen there.

    The area is that of a facet projected along `normal`, per unit of xi.
    """
    xi = np.tile(element.nodes[: element.n_corners].mean(axis=0), (len(at), 1))
    first, second = tangents(normal)
    plane = np.stack([first, second], axis=1)
    for _ in range(30):
        apart = np.einsum("nad,nd->na", plane, at - np.einsum("nk,nkd->nd", element.shape(xi), corners))
        J = np.einsum("nad,nkj,nkd->naj", plane, element.gradient(xi), corners)
        step = np.linalg.solve(J, apart[..., None])[..., 0]
        xi = xi + step
        if np.abs(step).max(initial=0.0) < 1e-13:
            break
    else:
        worst = at[np.abs(step).max(axis=1).argmax()]
        raise ContactError(f"a facet near {worst} is too distorted to be cut: improve the mesh there")
    seen = np.abs(np.einsum("nd,nd->n", _area_vector(element, corners, xi), normal))
    return xi, seen
