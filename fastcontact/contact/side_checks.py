"""Checks of the two sides of a contact pair before any computation."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Array, Mask, Numbers
from fastcontact.contact.obstacles.rigid_side import Pose, RigidSide
from fastcontact.contact.projection import DeformedSide
from fastcontact.contact.surface import Surface
from fastcontact.errors import ContactError
from fastcontact.mesh import elements
from fastcontact.mesh.area_vectors import flat_area_vectors
from fastcontact.mesh.mesh import Mesh

# Approximate number of sampled facets of each element type.
SAMPLE_SIZE = 200


def check_sides(mesh: Mesh, name: str, secondary: Surface, primary: Surface, excluded: Mask | None = None) -> None:
    """Raise ContactError if the sides of contact `name` share nodes or cannot face each other.

    Nodes without contact, which the mask `excluded` (n_points,) marks, may be shared.
    """
    if secondary.group == primary.group:
        raise ContactError(
            f"contact '{name}' has '{primary.group}' on both sides: name the group of the other body as one of them; contact "
            "of a surface with itself is not available"
        )
    shared = np.intersect1d(secondary.points, primary.points)
    if excluded is not None:
        shared = shared[~excluded[shared]]
    if len(shared):
        raise ContactError(
            f"the two sides of contact '{name}' share nodes (number: {len(shared)}, first: point {shared[0]}): "
            "duplicate the nodes of the interface, one set for each side, or name the nodes where two surfaces of one body "
            "meet in `excluded`"
        )
    for side in (secondary, primary):
        _check_normals(mesh, name, side)
    centres, normals, sizes = _facet_geometry(mesh, secondary)
    other_centres, other_normals, other_sizes = _facet_geometry(mesh, primary)
    difference = other_centres[None] - centres[:, None]
    height, distance = np.einsum("ijd,id->ij", difference, normals), np.linalg.norm(difference, axis=2)
    facing = normals @ other_normals.T < 0
    # Facets may lie slightly behind the plane of the other one, because surfaces are curved and may overlap.
    in_front = (height > -0.1 * distance) | (distance < np.minimum.outer(sizes, other_sizes))
    if not (facing & in_front).any():
        depth = -height[facing]
        hint = f", or do the bodies overlap, by {depth.min():.4g} or more" if len(depth) else ""
        raise ContactError(
            f"no facet of '{secondary.group}' faces '{primary.group}': the outer sides of the two groups face away from "
            f"each other; is one of them the wrong face of its body{hint}?"
        )


def check_obstacle(mesh: Mesh, name: str, secondary: Surface, obstacle: RigidSide) -> None:
    """Raise ContactError if no facet of the secondary side of contact `name` faces the obstacle."""
    _check_normals(mesh, name, secondary)
    centres, outward, _ = _facet_geometry(mesh, secondary)
    _, normal, paired, _ = obstacle.project(centres, Pose(np.zeros(mesh.dim)))
    cosine = np.einsum("id,id->i", outward, normal)[paired]
    if len(cosine) and (cosine >= 0).all():
        raise ContactError(
            f"the rigid obstacle of contact '{name}' faces in the same direction as '{secondary.group}', so that they cannot "
            "touch: reverse its normal or its facets, or name another face of the body"
        )


def _check_normals(mesh: Mesh, name: str, side: Surface) -> None:
    """Raise ContactError if a side of contact `name` has no normal at one of its nodes."""
    undefined = np.flatnonzero(~DeformedSide(side, mesh.points).nodal_normals.any(axis=1))
    if len(undefined):
        point = side.points[undefined[0]]
        raise ContactError(
            f"the facets of '{side.group}' in contact '{name}' meet back to back at point {point}, {mesh.points[point]}: "
            "they have no normal there; bodies that touch at a point need separate points, which merge_points may have merged"
        )


def nodes_of_shared_facets(mesh: Mesh, group: str, other_group: str) -> Numbers:
    """Return the sorted nodes of the facets that two groups share, even if the mesh contains a facet once for each group."""
    facets_of_groups = [mesh.cells_of(name, dim=mesh.dim - 1) for name in (group, other_group)]
    nodes = [np.empty(0, np.int32)]
    for element in facets_of_groups[0].keys() & facets_of_groups[1].keys():
        facets, count = np.unique(
            np.concatenate([np.unique(np.sort(by_type[element], axis=1), axis=0) for by_type in facets_of_groups]),
            axis=0, return_counts=True,
        )  # fmt: skip
        nodes.append(facets[count > 1].ravel())
    return np.unique(np.concatenate(nodes))


def _facet_geometry(mesh: Mesh, side: Surface) -> tuple[Array, Array, Array]:
    """Return centres, unit normals and sizes of about SAMPLE_SIZE facets of each element type.

    They are computed from the corners. Sizes are lengths in 2D, and square roots of areas in 3D [length].
    """
    blocks = [(block.facets, elements.get(block.element).n_corners) for block in side.blocks]
    corners = [mesh.points[facets[:: max(1, len(facets) // SAMPLE_SIZE), :n]] for facets, n in blocks]
    centres = np.concatenate([block_corners.mean(axis=1) for block_corners in corners])
    normals = np.concatenate([flat_area_vectors(block_corners) for block_corners in corners])
    areas = np.linalg.norm(normals, axis=1)
    return centres, normals / areas[:, None], areas ** (1 / (mesh.dim - 1))
