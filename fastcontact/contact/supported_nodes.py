"""Secondary nodes at which supports or multi-point constraints determine the gap, the slip or the traction."""

from __future__ import annotations

import numpy as np

from fastcontact._tools.records import replace
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.contact_sides import ContactSides
from fastcontact.contact.held_motions import (
    HeldMotions,
    deflate,
    direction_fields,
    eigenspaces,
    without_complete_facets,
)
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.pairing import Candidates, Pairing, relative_motion
from fastcontact.contact.projection import SMALL_OVERHANG
from fastcontact.contact.surface import Surface
from fastcontact.linear.sparse_rows import rows_of
from fastcontact.round_off import LENGTH_ROUND_OFF


def nodes_with_prescribed_gap(sides: ContactSides, config: Configuration) -> Mask:
    """Return the nodes (n_nodes,) at which supports and multi-point constraints prescribe the gap.

    The contact forces of such nodes act between supports. On non-matching meshes, their gaps may also depend on unrestrained
    primary nodes, but not on secondary nodes, and the constraints are nearly redundant.
    """
    motions, points = sides.held_motions, sides.secondary.points
    prescribed = np.zeros(len(points), bool)
    if motions is None or sides.options.kind == "tied" or not isinstance(sides.primary, Surface):
        return prescribed
    nodes = np.flatnonzero(np.isin(points, motions.restrained))
    if len(nodes):
        candidates, pairing = _paired_nodes(sides, nodes, config)
        rows = rows_of(relative_motion(candidates, pairing, len(sides.points)), pairing.normal)
        # The gap is prescribed if the part of its row for the free unknowns has less than half of the norm of the row.
        square, free_square = ((matrix**2).sum(axis=1) for matrix in (rows, rows @ motions.motion))
        prescribed[nodes] = pairing.paired & (free_square < 0.25 * square)
    return prescribed & ~sides.excluded[points]


def nodes_with_undetermined_traction(sides: ContactSides, config: Configuration) -> Mask:
    """Return which nodes (n_nodes,) belong to facets whose traction is undetermined.

    This is the case if supports hold all nodes of a facet, and the other side, in one direction. If supports hold the
    complete side in a tangential direction, as in a slice in plane strain, the traction in this direction vanishes and is
    not undetermined. With a penalty, the gap determines the pressure, and with a cohesive layer the traction.
    """
    held_both = held_on_both_sides(sides, config)
    if not held_both.any() or sides.options.cohesion is not None:
        return np.zeros(len(held_both), bool)
    nodal_normals = config.deformed(sides.secondary, sides.points).nodal_normals
    tangential = deflate(held_both, nodal_normals, np.sqrt(0.5))
    normal = held_both - tangential
    if sides.options.penalty is not None:
        normal = np.zeros_like(normal)
    if sides.options.kind != "tied":
        since_begin = replace(config, start=np.zeros_like(config.displacement))
        tangential = _held_without_motion(sides, since_begin) if sides.friction else np.zeros_like(held_both)
    # Projector that removes the tangential directions in which the complete side is held.
    remaining = np.eye(held_both.shape[1]) - eigenspaces(tangential.mean(axis=0)[None], 1.0 - LENGTH_ROUND_OFF)[0]
    normal, tangential = (held - without_complete_facets(held, sides.secondary) for held in (normal, tangential))
    return np.asarray(np.trace(normal + remaining @ tangential @ remaining, axis1=1, axis2=2) > 0.5)


def directions_without_slip(sides: ContactSides, config: Configuration) -> list[tuple[Array, Mask]]:
    """Return directions in which supports hold both sides without relative motion.

    In a plane of symmetry or on an axis, slip in these directions is zero for every traction, so that the traction is
    undetermined. If one side is free, or moves relative to the other, friction determines the traction. Directions in
    which all nodes of a facet are held are ignored.

    Returns
    -------
    list of (ndarray (n_nodes, dim), ndarray of bool (n_nodes,))
        Unit vectors, each with the secondary nodes that are held in this direction.
    """
    if not len(sides.held_nodes):
        return []
    held = without_complete_facets(_held_without_motion(sides, config), sides.secondary)
    return direction_fields(held, sides.points[sides.secondary.points])


def held_on_both_sides(sides: ContactSides, config: Configuration) -> Array:
    """Return projectors (n_nodes, dim, dim) onto directions in which both sides are held."""
    dim, nodes = sides.points.shape[1], sides.held_nodes
    held = np.zeros((len(sides.secondary.points), dim, dim))
    if len(nodes) and sides.held_motions is not None:
        P = sides.held_motions.projectors_at(sides.secondary.points[nodes])
        Q = _held_projections(sides, nodes, sides.held_motions, config)[1]
        held[nodes] = eigenspaces(P @ Q @ P, 0.5)
    return held


def _held_without_motion(sides: ContactSides, config: Configuration) -> Array:
    """Return projectors (n_nodes, dim, dim) onto `directions_without_slip`, including those of complete facets."""
    dim, nodes = sides.points.shape[1], sides.held_nodes
    held = np.zeros((len(sides.secondary.points), dim, dim))
    motions, points = sides.held_motions, sides.secondary.points[nodes]
    if not len(nodes) or motions is None:
        return held
    pairing, held_opposite = _held_projections(sides, nodes, motions, config)
    common, slip = motions.projectors_at(points), (config.displacement - config.start)[points]
    if isinstance(sides.primary, RigidSide):
        slip = slip - sides.rigid_motion(lambda coordinates: coordinates[points], config)
    else:
        rows, feet, held_primary = pairing.rows, pairing.feet, motions.projectors_at(pairing.feet.nodes)
        motion = (config.displacement - config.start)[feet.nodes]
        mean = np.einsum("nk,nkd->nd", feet.shape, motion)
        # The point opposite to a held node may lie slightly off the held primary node, if the normal is inclined. The
        # motion of the other nodes of this facet is then ignored.
        excess = np.einsum("nk,nkde,nkd->ne", feet.shape, held_primary, motion - mean[:, None])
        slip[rows] -= mean + np.einsum("nde,ne->nd", np.linalg.pinv(held_opposite[rows], hermitian=True), excess)
        common = eigenspaces(common @ held_opposite @ common, 0.5)
    normal_part = np.einsum("nde,ne->nd", common, pairing.normal)
    common = deflate(common, pairing.normal, np.sqrt(0.5))
    # Where the normal is held, a motion along it closes the gap and is not slip. Elsewhere the normal may be inclined to
    # the held directions, such as at the edge of a plane of symmetry.
    closing = np.einsum("nd,nd->n", slip, pairing.normal)
    closing = np.where(np.linalg.norm(normal_part, axis=1) > np.sqrt(0.5), closing, 0.0)
    slip -= closing[:, None] * pairing.normal
    tolerance = LENGTH_ROUND_OFF * max(np.abs(config.displacement).max(), np.abs(config.start).max())
    held[nodes] = deflate(common, slip, tolerance)
    return held


def _paired_nodes(sides: ContactSides, nodes: Indices, config: Configuration) -> tuple[Candidates, Pairing]:
    """Return secondary `nodes` (n,), numbered within the side, as candidates, and their pairing."""
    candidates = Candidates.from_nodes(sides.secondary.points[nodes])
    return candidates, sides.pair_candidates(candidates, config, max(sides.projection_tolerance or 0.0, SMALL_OVERHANG))


def _held_projections(
    sides: ContactSides, nodes: Indices, motions: HeldMotions, config: Configuration
) -> tuple[Pairing, Array]:
    """Return the pairing of secondary `nodes` (n,), and the directions in which their projections are held.

    The directions are given by projectors (n, dim, dim), interpolated between the nodes of the opposite facets.
    """
    pairing = _paired_nodes(sides, nodes, config)[1]
    dim = sides.points.shape[1]
    held_primary = np.zeros((len(nodes), dim, dim))
    if pairing.primary is not None:
        projectors = motions.projectors_at(pairing.feet.nodes)
        held_primary[pairing.rows] = np.einsum("nk,nkde->nde", pairing.feet.shape, projectors)
    return pairing, held_primary
