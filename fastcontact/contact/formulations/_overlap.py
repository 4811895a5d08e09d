"""Mortar integrals: integrals of products of shape functions over the overlap of two surfaces.

For two meshed sides, `_cut_lines` and `_cut_faces` intersect the facets and compute these integrals. If the primary side is a
rigid obstacle, Gauss quadrature over complete facets suffices, see `obstacle_overlap`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices
from fastcontact.contact.integration import areas_of_rule
from fastcontact.contact.obstacles.rigid_side import Pose, RigidSide
from fastcontact.contact.surface import FacetBlock, Surface


@record
class Coupling:
    """Overlapping facets of a secondary and a primary block.

    Attributes
    ----------
    secondary, primary : FacetBlock
    pairs : ndarray of int (n, 2)
        Numbers of the secondary and the primary facet of each pair, each in its block. A pair may occur several times.
    integrals : ndarray (n, n_nodes, n_primary_nodes)
        Integrals of secondary times primary shape functions over the overlap [area].
    projection : ndarray (n_facets, dim), optional
        Unit vectors out of the primary side along which each secondary facet is projected; None if these are the normals of
        the primary side [-].
    """

    secondary: FacetBlock
    primary: FacetBlock
    pairs: Indices
    integrals: Array
    projection: Array | None = None


@record
class OverlapPoints:
    """Integration points of a secondary block.

    Attributes
    ----------
    facet : ndarray of int (n,)
        Index of the facet that contains each point.
    shape : ndarray (n, k)
        Shape functions of the k nodes of the facet at the point [-].
    area : ndarray (n,)
        Integration weight of the point in the reference configuration, zero outside the overlap [area].
    """

    facet: Indices
    shape: Array
    area: Array


@record
class Overlap:
    """The overlap of two surfaces.

    Attributes
    ----------
    mass : list of ndarray (n_facets, n_nodes, n_nodes)
        For each block of the secondary side, integrals of products of two of its shape functions over the part that
        faces the primary side [area].
    couplings : list of Coupling
    gap_reductions : list of ndarray (n_facets, n_nodes, dim)
        For each block, integrals of its shape functions times vectors along the normals of the primary side, whose lengths
        are the distances by which the smooth surfaces are closer to each other than the facets, see `surface_smoothing`
        [volume]. Against an obstacle, which has no nodes, the vectors are the positions of the opposite points instead, so
        that the weighted gaps are also correct in this case.
    points : sequence of OverlapPoints
        For each block, the integration points; empty in 3D, where the mortar segments are divided into triangles.
    """

    mass: list[Array]
    couplings: list[Coupling]
    gap_reductions: list[Array]
    points: Sequence[OverlapPoints]


def obstacle_overlap(
    secondary: Surface, obstacle: RigidSide, points: tuple[Array, Array], axisymmetric: bool, pose: Pose
) -> Overlap:
    """Integrate over the parts of the secondary facets that face a rigid obstacle, with undeformed areas.

    Parameters
    ----------
    secondary : Surface
    obstacle : RigidSide
    points : (ndarray, ndarray)
        Reference and deformed coordinates (n_points, dim) [length].
    axisymmetric : bool
    pose : Pose
        Position and rotation of the obstacle.
    """
    mass, opposite_positions, samples = [], [], []
    for block in secondary.blocks:
        N, full_area = areas_of_rule(block, points[0], axisymmetric)
        positions = np.einsum("qk,fkd->fqd", N, points[1][block.facets])
        gap, normal, paired, _ = obstacle.project(positions.reshape(-1, positions.shape[2]), pose)
        foot = positions - (np.where(paired, gap, 0.0)[:, None] * normal).reshape(positions.shape)
        area = np.where(paired.reshape(full_area.shape), full_area, 0.0)
        mass.append(np.einsum("fq,qa,qb->fab", area, N, N))
        opposite_positions.append(np.einsum("fq,qa,fqd->fad", area, N, foot))
        samples.append(OverlapPoints(np.repeat(np.arange(len(area)), len(N)), np.tile(N, (len(area), 1)), area.ravel()))
    return Overlap(mass, [], opposite_positions, samples)
