"""Pairing of nodes with nodes: the gap of a point is that to the nearest node of the primary side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fastcontact.arrays import Array, Indices
from fastcontact.contact.pairing import Candidates, Pairing
from fastcontact.contact.projection import nodal_normals
from fastcontact.contact.surface import Surface
from fastcontact.mesh import elements


def at_nodes(
    pairing: Pairing, candidates: Candidates, primary: Surface, deformed: Array, normals: str | Sequence[float]
) -> Pairing:
    """Return the pairing `pairing` of candidates with facets, moved to the nearest nodes of these surfaces.

    Parameters
    ----------
    pairing : Pairing
        Which candidates face anything, and the normals where those are not the primary's own.
    candidates : Candidates
    primary : Surface
    deformed : ndarray (n_points, dim)
        Coordinates of all points [length].
    normals : str or sequence of float
        See `Formulation`; of the primary side's own, those of nodes are the means of their facets'.
    """
    from scipy.spatial import cKDTree

    nearest = cKDTree(deformed[primary.points]).query(candidates.positions(deformed))[1]
    facet, xi = _on_facets(primary)
    of_facets = normals in ("facet", "averaged")
    normal = nodal_normals(primary, deformed)[nearest] if of_facets else pairing.normal
    return replace(pairing, facet=facet[nearest], xi=xi[nearest], normal=normal)


def _on_facets(side: Surface) -> tuple[Indices, Array]:
    """Return a facet (m,) at each node of a surface, and the reference coordinates (m, dim - 1) of the node on it."""
    m, dim = len(side.points), elements.get(side.blocks[0].element).dim
    facet, xi, first = np.zeros(m, np.intp), np.zeros((m, dim)), 0
    for block in side.blocks:
        n, k = block.local.shape
        facet[block.local] = np.arange(first, first + n)[:, None]
        # Of a node on several facets the last one is taken, in both arrays.
        xi[block.local] = np.broadcast_to(elements.get(block.element).nodes, (n, k, dim))
        first += n
    return facet, xi
