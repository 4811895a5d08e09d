"""Mortar integrals: products of shape functions over the overlap of two surfaces."""

from __future__ import annotations

from dataclasses import dataclass

from fastcontact.arrays import Array, Indices
from fastcontact.contact.surface import FacetBlock


@dataclass(frozen=True, eq=False)
class Coupling:
    """Pairs of a secondary and a primary facet that face each other, each of one kind.

    Attributes
    ----------
    secondary, primary : FacetBlock
    pairs : ndarray of int (n, 2)
        Rows of the facets in their blocks.
    integrals : ndarray (n, n_nodes, n_primary_nodes)
        Of secondary times primary shape functions over the common part [area].
    """

    secondary: FacetBlock
    primary: FacetBlock
    pairs: Indices
    integrals: Array


@dataclass(frozen=True, eq=False)
class Overlap:
    """All parts where two surfaces face each other.

    Attributes
    ----------
    mass : list of ndarray (n_facets, n_nodes, n_nodes)
        For each block of the secondary side, integrals of products of two of its shape functions over the part that
        faces the primary side [area].
    couplings : list of Coupling
    closer : list of ndarray (n_facets, n_nodes, dim)
        For each block, integrals of its shape functions times by how much the smooth surfaces are closer to each other than
        the facets, see `surface_smoothing`, along the normals that the secondary side faces [volume].
    """

    mass: list[Array]
    couplings: list[Coupling]
    closer: list[Array]
