"""Facets of solid cells with given nodes: outer facets of bodies, and facets between two cells."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fastcontact.arrays import Indices, Mask, Numbers
from fastcontact.mesh import elements


def facets_with_nodes(
    solids: Mapping[str, Numbers], chosen: Mask, between: bool, among: Mapping[str, Mask] | None = None
) -> dict[str, Numbers]:
    """Return the facets (n_facets, n_nodes) of solid cells whose nodes are all chosen, by facet element.

    Each facet appears once, with the orientation of its first cell. This is outward for facets of a single cell.

    Parameters
    ----------
    solids : mapping of str to ndarray of int (n_cells, n_nodes)
        Connectivity by element type.
    chosen : ndarray of bool (n_points,)
        Whether each point is chosen.
    between : bool
        If True, return the facets between two cells; if False, the facets of a single cell.
    among : mapping of str to ndarray of bool (n_cells,), optional
        Whether the facets of each cell are considered; by default those of all cells.
    """
    candidates: dict[str, list[Numbers]] = {}
    flags: dict[str, list[Mask]] = {}
    for name, block in solids.items():
        element, counted = elements.get(name), np.ones(len(block), bool) if among is None else among[name]
        for facet, kind in zip(element.facets, element.facet_elements, strict=True):
            nodes = block[:, list(facet)]
            inside = chosen[nodes].all(axis=1)
            candidates.setdefault(kind, []).append(nodes[inside])
            flags.setdefault(kind, []).append(counted[inside])
    facets_by_kind, n_cells = {}, 2 if between else 1
    for kind, blocks in candidates.items():
        facets, is_among = np.concatenate(blocks), np.concatenate(flags[kind])
        _, first, group, count = np.unique(
            np.sort(facets, axis=1), axis=0, return_index=True, return_inverse=True, return_counts=True
        )
        count_among = np.bincount(group.ravel(), is_among, len(count))
        rows = np.sort(first[(count == n_cells) & (count_among == n_cells)])
        if len(rows):
            facets_by_kind[kind] = facets[rows]
    return facets_by_kind


def added(block: Numbers, facets: Numbers) -> tuple[Numbers, Indices]:
    """Return a block of facets with the missing facets appended, and the row of each of the `facets` in it."""
    both = np.concatenate([block, facets])
    _, first, facet = np.unique(np.sort(both, axis=1), axis=0, return_index=True, return_inverse=True)
    row = first[facet.ravel()]  # row of the first facet with the same nodes
    new = (row == np.arange(len(both))) & (np.arange(len(both)) >= len(block))
    place = np.where(np.arange(len(both)) < len(block), np.arange(len(both)), len(block) + np.cumsum(new) - 1)
    return np.concatenate([block, both[new]]), place[row[len(block) :]].astype(np.intp)
