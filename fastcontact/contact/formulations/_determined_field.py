r"""Pressure fields that remain determined by their integration points on partly covered facets.

The integration points of a facet of which only a strip faces the other side hardly determine a field over the whole facet:
on a strip of a fraction :math:`\theta` at one end of a line, the value of a polynomial of degree k at the other end has the
weight :math:`\theta^{2k+1}`. The measure is the smallest eigenvalue of the mass matrix over the covered part, relative to
that over the whole facet. Where it is too small the field is simplified: linear between the corners of a quadratic facet, or
constant from the nodes that other facets determine. Fields that are constant over a strip remain representable, so a uniform
pressure is transmitted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array, lil_array

from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.integration import facet_measure, fine_rule
from fastcontact.contact.pair_options import spread
from fastcontact.contact.surface import FacetBlock, Surface
from fastcontact.mesh import elements
from fastcontact.round_off import SINGLE_PRECISION

# A seventh of the facet determines a line, two fifths a parabola; values at the other end are amplified at most thirtyfold.
DETERMINED = 1e-3


@dataclass(frozen=True, eq=False)
class WholeFacets:
    """Mass matrices of the fields over whole facets of a block.

    Attributes
    ----------
    block : FacetBlock
    to_corners : ndarray (n_corners, k)
        Coefficients of corner functions in shape functions [-].
    mass : ndarray (n_facets, k, k)
        Integrals of products of two shape functions over the facets [area].
    """

    block: FacetBlock
    to_corners: Array
    mass: Array

    @classmethod
    def of(cls, block: FacetBlock, points: Array, axisymmetric: bool) -> WholeFacets:
        """Integrate over the facets of a block at reference `points` (n_points, dim) [length]."""
        element = elements.get(block.element)
        xi, weights = fine_rule(block.element)
        N = element.shape(xi)
        dA = facet_measure(block.facets, block.element, points, xi, axisymmetric) * weights
        to_corners = elements.get(element.linear).shape(element.nodes).T
        return cls(block, to_corners, np.einsum("fq,qa,qb->fab", dA, N, N))

    def degrees(self, mass: Array) -> Indices:
        """Return the degree of the field (n_facets,) that `mass` (n_facets, k, k) over the covered part determines.

        2 for the full field, 1 for one that is linear between the corners, 0 for none, -1 where nothing takes part.
        """
        degrees = np.full(len(mass), 2)
        degrees[~mass.any(axis=(1, 2))] = -1
        size = np.einsum("fkk->f", self.mass)
        partly = np.flatnonzero((degrees == 2) & (np.abs(mass - self.mass).max(axis=(1, 2)) > SINGLE_PRECISION * size))
        full, partial, T = self.mass[partly], mass[partly], self.to_corners
        linear = _smallest(T @ full @ T.T, T @ partial @ T.T) > DETERMINED
        degrees[partly] = np.where(_smallest(full, partial) > DETERMINED, 2, np.where(linear, 1, 0))
        return degrees


def _smallest(full: Array, mass: Array) -> Array:
    """Return the smallest generalised eigenvalues (n_facets,) of mass matrices relative to those of whole facets."""
    inverse = np.linalg.inv(np.linalg.cholesky(full))
    return np.asarray(np.linalg.eigvalsh(inverse @ mass @ inverse.transpose(0, 2, 1))[:, 0])


def determined(
    side: Surface, fields: list[WholeFacets], masses: list[Array], excluded: Mask
) -> tuple[csr_array, Indices]:
    """Return the matrix (m, k) from the independent values of the field to all nodes, and the nodes (k,) of these values.

    Parameters
    ----------
    side : Surface
    fields : list of WholeFacets
        Whole facets of each block of the side.
    masses : list of ndarray (n_facets, n_nodes, n_nodes)
        Integrals of products of two shape functions over the covered part [area].
    excluded : ndarray of bool (m,)
        Nodes without an independent value.
    """
    degrees = [field.degrees(mass) for field, mass in zip(fields, masses, strict=True)]
    kept = np.zeros(len(side.points), bool)
    for field, degree in zip(fields, degrees, strict=True):
        kept[field.block.local[degree == 2]] = True
        kept[field.block.local[degree == 1][:, : len(field.to_corners)]] = True
    kept &= ~excluded
    for field, degree, mass in zip(fields, degrees, masses, strict=True):
        _give_each_a_value(kept, field.block.local[degree >= 0], mass[degree >= 0], excluded)
    independent = np.flatnonzero(kept)
    values = spread(side, excluded, independent) if excluded.any() else csr_array(diags_array(kept.astype(float)))
    if any((degree[degree >= 0] < 2).any() for degree in degrees):
        values = _interpolated(csr_array(values), fields, degrees, kept, excluded)
    return csr_array(csr_array(values)[:, independent]), independent


def _give_each_a_value(kept: Mask, local: Indices, mass: Array, excluded: Mask) -> None:
    """Make a node of each facet without independent ones independent, in place: where most of the facet takes part."""
    for row in np.flatnonzero(~kept[local].any(axis=1)):
        nodes = local[row]
        if not (kept[nodes].any() or excluded[nodes].all()):
            kept[nodes[np.argmax(np.where(excluded[nodes], -np.inf, mass[row].sum(axis=1)))]] = True


def _interpolated(
    values: csr_array, fields: list[WholeFacets], degrees: list[Indices], with_value: Mask, excluded: Mask
) -> csr_array:
    """Return `values` (m, m), completed by rows of the nodes that are neither independent nor excluded.

    Corners take the mean of the independent nodes of their facets; other nodes interpolate linearly between corners.
    """
    m = len(with_value)
    pairs = []
    for field, degree in zip(fields, degrees, strict=True):
        local = field.block.local[degree >= 0]
        corners = local[:, : len(field.to_corners)]
        row, column = np.repeat(corners, local.shape[1], axis=1).ravel(), np.tile(local, corners.shape[1]).ravel()
        kept = ~with_value[row] & ~excluded[row] & with_value[column]
        pairs.append(np.column_stack([row[kept], column[kept]]))
    row, column = np.unique(np.concatenate(pairs), axis=0).T
    count = np.bincount(row, minlength=m)
    values = csr_array(diags_array((with_value | excluded).astype(float)) @ values)
    values = csr_array(values + coo_array((1.0 / count[row], (row, column)), shape=(m, m)))
    return csr_array(values + _between_corners(fields, degrees, with_value | excluded) @ values)


def _between_corners(fields: list[WholeFacets], degrees: list[Indices], done: Mask) -> csr_array:
    """Return the rows (m, m) of nodes between corners that are not `done` (m,), interpolated linearly."""
    between = lil_array((len(done), len(done)))
    for field, degree in zip(fields, degrees, strict=True):
        corners = len(field.to_corners)
        facet, k = np.nonzero(~done[field.block.local[:, corners:]] & (degree >= 0)[:, None])
        for nodes, node in zip(field.block.local[facet], k + corners, strict=True):
            between[nodes[node], nodes[:corners]] = field.to_corners[:, node]  # the same from either side
    return csr_array(between)
