"""Tied contact: linear equations for zero opening and zero slip from the beginning.

The sides are paired once, in the undeformed configuration. The relative displacement of points that face each other remains
zero in every direction. The test functions are the multiplier functions of the formulation. If forces are nodal, there is
one set of equations per node. If forces act at integration points, the equations are moments with the functions of the
multiplier field, as in the mortar method (Bernardi, Maday and Patera, 1994), so that the augmentation parameter has no
influence.

If supports hold both sides at a node, the secondary side has fewer free displacements than multipliers. The multipliers are
then not unique, because multipliers that alternate from node to node and decay along the surface do no work. Their number
is reduced as at the ends of mortar lines (Bernardi et al., section 3): in a direction that is held on both sides, the
multiplier of a node is the mean of those of its neighbours, so that uniform tractions remain possible (`reduction`).

Equal displacements on both sides of a gap would resist rigid rotations, because the forces on the two sides would have
different lines of action. Therefore a rigid arm spans the gap and rotates with the primary facet (`with_rigid_arms`).
The relative displacement along a tangent t is ``t . (u_s - u_p) + g n . du_p/dt`` with the gap g, the normal n and the
derivative along t on the primary facet. It vanishes in any small rotation of both sides.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array, eye_array, vstack

from fastcontact._tools.records import record, replace
from fastcontact.arrays import Array, Indices
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.multiplier_field import Projection
from fastcontact.contact.pairing import Pairing, normals
from fastcontact.contact.projection import facet_points, facets_containing
from fastcontact.contact.surface import Surface
from fastcontact.elasticity.stiffness import rigid_modes
from fastcontact.linear.sparse_rows import nodal_rows, scaled, without_zeros
from fastcontact.round_off import LENGTH_ROUND_OFF, ROUND_OFF, TINY


@record
class TiedPair:
    """The equations of a tied pair.

    Attributes
    ----------
    moments : csr_array (q, m)
        Matrix from the gaps at the m constraint points of the formulation to the q weighted gaps of the equations [-].
    directions : tuple of k ndarray (m, dim)
        Unit tangents [-].
    areas : ndarray (q,), optional
        Integrals of the test functions of the equations [area].
    reduction : csr_array (q dim, q dim), optional
        Matrix from the remaining multipliers to all multipliers, if supports hold both sides at some nodes; see
        `reduction`.
    """

    moments: csr_array
    directions: tuple[Array, ...]
    areas: Array | None
    reduction: csr_array | None

    def forces(self, multiplier: Array) -> tuple[Array, Array]:
        """Return normal (m,) and tangential (m, k) forces at the constraint points of the formulation [force].

        `multiplier` (q dim,) are the multipliers of the equations [force].
        """
        multiplier = multiplier if self.reduction is None else self.reduction @ multiplier
        components = [self.moments.T @ component for component in multiplier.reshape(-1, self.moments.shape[0])]
        return components[0], np.column_stack(components[1:])


def tied_constraints(
    constraints: Constraints, moments: csr_array, areas: Array | None, reduction: csr_array | None
) -> Constraints:
    """Return the equations of a tied pair: first those along the normal, then those along each tangent.

    `constraints` are those of the formulation, with tangents. For the other arguments, see `moments_of` and `TiedPair`.
    """
    rows = [csr_array(moments @ row) for row in (constraints.B, *constraints.tangents)]
    weights, k = np.maximum(np.asarray(abs(moments).sum(axis=1)).ravel(), TINY), len(rows)
    if reduction is not None:
        rows = split_rows(csr_array(reduction.T @ vstack(rows, format="csr")), k)
    B = csr_array(vstack([_without_round_off(row) for row in rows], format="csr"))
    positions = np.tile(abs(moments) @ constraints.positions / weights[:, None], (k, 1))
    nodes = None if constraints.nodes is None else np.tile(constraints.nodes, k)
    tied, zeros = TiedPair(moments, constraints.directions, areas, reduction), np.zeros(B.shape[0])
    equality = np.ones(len(zeros), bool)
    return Constraints(B, zeros, positions, equality=equality, nodes=nodes, nodal=constraints.nodal_field, tied=tied)


def split_rows(matrix: csr_array, k: int) -> list[csr_array]:
    """Return k matrices with the same number of rows each, of which `matrix` is the stack."""
    q = matrix.shape[0] // k
    return [csr_array(matrix[first : first + q]) for first in range(0, k * q, q)]


def moments_of(constraints: Constraints) -> tuple[csr_array, Array | None]:
    """Return the test functions of the equations as rows (q, m), and their integrals (q,) if known [area].

    For a multiplier field with integration points, the rows contain the weights of the points, which sum to one if they are
    positive. An integration point on the axis, which has no area, has a row of its own.
    """
    if not isinstance(constraints.compliance, Projection):
        return csr_array(eye_array(len(constraints.gap0), format="csr")), constraints.areas
    P, areas = constraints.compliance.P, constraints.compliance.areas
    weighted_P = csr_array(P.T @ diags_array(areas))
    scale = np.asarray(abs(weighted_P).sum(axis=1)).ravel()
    on_axis = np.flatnonzero((areas == 0.0) & constraints.usable)
    axis_rows = csr_array((np.ones(len(on_axis)), (np.arange(len(on_axis)), on_axis)), shape=(len(on_axis), len(areas)))
    integrals = np.concatenate([scale, np.zeros(len(on_axis))])
    return csr_array(vstack([diags_array(1.0 / np.maximum(scale, TINY)) @ weighted_P, axis_rows])), integrals


def _without_round_off(rows: csr_array) -> csr_array:
    """Remove the entries of a matrix that are zero up to round-off, in place, and return the matrix."""
    rows.data[np.abs(rows.data) < ROUND_OFF * np.abs(rows.data).max(initial=0.0)] = 0.0
    return without_zeros(rows)


def reduction(frames: Array, held: Array, nodes: Indices, areas: Array, adjacency: csr_array) -> csr_array:
    """Return the matrix (q dim, q dim) that maps the remaining multipliers to all multipliers.

    The columns of removed multipliers are empty. Multipliers are forces: first the normal components of all nodes, then the
    components along each tangent.

    Parameters
    ----------
    frames : ndarray (q, dim, dim)
        Unit vectors along which the equations of each node are formulated, first the normal and then the tangents [-].
    held : ndarray (q, dim, dim)
        Projectors onto the directions in which supports hold both sides [-].
    nodes : ndarray of int (q,)
        Secondary nodes of the equations.
    areas : ndarray (q,)
        Integrals of their test functions, zero for empty equations [area].
    adjacency : csr_array (n_nodes, n_nodes)
        Adjacency matrix of the nodes, see `Surface.node_adjacency`.
    """
    q, dim = held.shape[:2]
    n_held = np.trace(held, axis1=1, axis2=2).round().astype(np.intp)
    held_nodes, free = np.flatnonzero(n_held), np.eye(dim) - held
    held_part = np.linalg.norm(np.einsum("qde,qke->qkd", held, frames), axis=2)
    is_free = np.argsort(np.argsort(-held_part, axis=1, kind="stable"), axis=1) >= n_held[:, None]
    free_part = np.where(is_free[:, None], np.einsum("qde,qke->qdk", free, frames), 0.0)
    pairs = coo_array(csr_array(adjacency[nodes])[:, nodes][held_nodes])
    is_valid = (areas[pairs.col] > 0.0) & (areas[held_nodes[pairs.row]] > 0.0) & (held_nodes[pairs.row] != pairs.col)
    held_index, neighbour = pairs.row[is_valid], pairs.col[is_valid]
    total = np.zeros((len(held_nodes), dim, dim))
    np.add.at(total, held_index, free[neighbour])
    mean = held[held_nodes] @ np.linalg.pinv(total, hermitian=True)
    rows, columns = np.append(np.arange(q), held_nodes[held_index]), np.append(np.arange(q), neighbour)
    # The means are those of tractions, and multipliers are forces.
    weights = np.where(areas > 0.0, areas, 1.0)
    ratio = (weights[rows] / weights[columns])[:, None, None]
    blocks = frames[rows] @ (np.concatenate([free_part, mean[held_index] @ free_part[neighbour]]) * ratio)
    blocks[np.abs(blocks) < ROUND_OFF] = 0.0
    row, column = (np.arange(dim) * q + node[:, None] for node in (rows, columns))
    row, column = np.broadcast_arrays(row[:, :, None], column[:, None, :])
    return without_zeros(csr_array((blocks.ravel(), (row.ravel(), column.ravel())), shape=(q * dim, q * dim)))


def with_rigid_arms(constraints: Constraints, pairing: Pairing, primary: Surface, points: Array) -> Constraints:
    """Return constraints whose tangential rows vanish in small rigid rotations of both sides, also across a gap.

    Parameters
    ----------
    constraints : Constraints
        Constraints (m) with tangents.
    pairing : Pairing
        Pairing of the constraint points.
    primary : Surface
    points : ndarray (n_points, dim)
        Reference coordinates [length].
    """
    size = float(np.ptp(constraints.positions, axis=0).max(initial=0.0))
    # At an edge the derivative is the mean over the facets that meet there, as the facet of the pairing depends on round-off.
    point, facet, xi = facets_containing(primary, pairing.facet, pairing.xi)
    normal, feet = normals(constraints.directions)[point], facet_points(primary, facet, xi)
    base_vectors = np.einsum("pkj,pkd->pdj", feet.gradient, points[feet.nodes])
    gradient = np.einsum("pkj,pjd->pkd", feet.gradient, np.linalg.pinv(base_vectors))
    weight = 1.0 / np.bincount(point)
    mean = csr_array((weight[point], (point, np.arange(len(point)))))
    slopes = [np.einsum("pkd,pd->pk", gradient, direction[point]) for direction in constraints.directions]
    entries = [slope[:, :, None] * normal[:, None, :] for slope in slopes]
    derivatives = [mean @ nodal_rows(feet.nodes, values, points.size) for values in entries]
    translations, rotations = np.split(rigid_modes(points, "3d"), [points.shape[1]], axis=1)
    tilts = np.stack([derivative @ rotations for derivative in derivatives], axis=1)
    spurious = np.stack([tangent @ rotations for tangent in constraints.tangents], axis=1)
    translation = np.stack([np.abs(tangent @ translations).max(axis=1) for tangent in constraints.tangents], axis=1)
    # The lengths of the arms form a tensor. With one length per tangent, the result would depend on the choice of the
    # tangents if the vector across the gap is not normal to the surface.
    lengths = spurious @ np.linalg.pinv(tilts)
    lengths[(np.abs(lengths) <= LENGTH_ROUND_OFF * size) | (translation > LENGTH_ROUND_OFF)[:, :, None]] = 0.0
    if not lengths.any():
        return constraints
    arms = (sum(map(scaled, derivatives, lengths_of_tangent)) for lengths_of_tangent in np.moveaxis(lengths, 0, 2))
    return replace(
        constraints, tangents=tuple(csr_array(T - arm) for T, arm in zip(constraints.tangents, arms, strict=True))
    )
