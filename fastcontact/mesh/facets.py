"""Facets of solid cells: the outer ones, cells that inner ones join, and facets as cells of their own."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from fastcontact.mesh import elements, topology_kernels

Indices = NDArray[np.int32]


def facets_of_solids(
    solids: Mapping[str, Indices], offsets: Mapping[str, int], n_points: int, n_cells: int
) -> tuple[Mapping[str, Indices], Indices]:
    """Return by facet element the facets of exactly one solid cell (n_facets, n_nodes), and what cells facets join.

    Normals of the facets point outward. The second array holds for each cell (n_cells,) the lowest one that common facets
    join it to, from cell to cell.

    Parameters
    ----------
    solids : mapping of str to ndarray (n_cells, n_nodes)
        Connectivity by element.
    offsets : mapping of str to int
        Number of the first cell of each element.
    n_points, n_cells : int
        Of the whole mesh. Cells that are no solids stand for themselves.
    """
    found: dict[str, list[Indices]] = {}
    owners: dict[str, list[Indices]] = {}
    for name, block in solids.items():
        element, numbers = elements.get(name), offsets[name] + np.arange(len(block), dtype=np.int32)
        for facet, facet_element in zip(element.facets, element.facet_elements, strict=True):
            found.setdefault(facet_element, []).append(block[:, list(facet)])
            owners.setdefault(facet_element, []).append(numbers)
    parent, kept = np.arange(n_cells, dtype=np.int32), {}
    for name, blocks in found.items():
        facets = np.ascontiguousarray(np.concatenate(blocks))
        alone = np.empty(len(facets), bool)
        topology_kernels.alone(facets, np.concatenate(owners[name]), n_points, alone, parent)
        kept[name] = np.ascontiguousarray(facets[alone])
        kept[name].setflags(write=False)
    while not (parent[parent] == parent).all():
        parent = parent[parent]
    return MappingProxyType({name: facets for name, facets in kept.items() if len(facets)}), parent


def joined(block: Indices, facets: Indices) -> tuple[Indices, NDArray[np.intp]]:
    """Return a block of facets (n, n_nodes) with those of `facets` (m, n_nodes) that it lacks, and the rows (m,) of these."""
    sides = np.sort(np.concatenate([block, facets]), axis=1)
    _, first, inverse = np.unique(sides, axis=0, return_index=True, return_inverse=True)
    first = first[inverse.reshape(-1)]  # where the same nodes stand for the first time
    kept = (first == np.arange(len(sides))) | (np.arange(len(sides)) < len(block))
    return np.concatenate([block, facets])[kept], (np.cumsum(kept) - 1)[first[len(block) :]]
