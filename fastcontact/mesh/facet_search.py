"""Facets of solid cells, found by their nodes: those outside of bodies, and those between two cells."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fastcontact.mesh import elements

Indices = NDArray[np.int32]
Mask = NDArray[np.bool_]


def facets_with_nodes(solids: Mapping[str, Indices], chosen: Mask, between: bool) -> dict[str, Indices]:
    """Return by facet element the facets (n_facets, n_nodes) of solid cells all of whose nodes are chosen.

    Each once, as its first cell has it, which is outward for those of one cell.

    Parameters
    ----------
    solids : mapping of str to ndarray of int (n_cells, n_nodes)
        Connectivity by element.
    chosen : ndarray of bool (n_points,)
    between : bool
        Facets of two cells; otherwise those of one.
    """
    found: dict[str, list[Indices]] = {}
    for name, block in solids.items():
        element = elements.get(name)
        for facet, kind in zip(element.facets, element.facet_elements, strict=True):
            nodes = block[:, list(facet)]
            found.setdefault(kind, []).append(nodes[chosen[nodes].all(axis=1)])
    kept = {}
    for kind, blocks in found.items():
        facets = np.concatenate(blocks)
        _, first, count = np.unique(np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True)
        rows = np.sort(first[count == (2 if between else 1)])
        if len(rows):
            kept[kind] = facets[rows]
    return kept


def added(block: Indices, facets: Indices) -> tuple[Indices, NDArray[np.intp]]:
    """Return a block of facets with those that it lacks at its end, and the rows where all of them are."""
    rows = {tuple(row): i for i, row in enumerate(np.sort(block, axis=1).tolist())}
    place: list[int] = []
    missing: list[int] = []
    for i, key in enumerate(map(tuple, np.sort(facets, axis=1).tolist())):
        if key not in rows:
            rows[key] = len(block) + len(missing)
            missing.append(i)
        place.append(rows[key])
    return np.concatenate([block, facets[missing]]), np.array(place, np.intp)
