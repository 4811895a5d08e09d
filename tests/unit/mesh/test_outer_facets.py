"""Outer facets, and cells joined by facets, compared with sorted tuples in Python."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastcontact.mesh import topology_kernels


@pytest.mark.parametrize("n_nodes", [2, 3, 4, 8])
@given(seed=st.integers(0, 2**32 - 1), n_points=st.integers(1, 9), n=st.integers(1, 40))
def test_facets_are_alone_whose_nodes_no_other_one_has(n_nodes, seed, n_points, n):
    # Nodes may come twice, as in cells that are collapsed.
    rng = np.random.default_rng(seed)
    facets = rng.integers(n_points, size=(n, n_nodes)).astype(np.int32)
    owner = rng.integers(5, size=n).astype(np.int32)
    found, parent = np.empty(n, bool), np.arange(5, dtype=np.int32)
    topology_kernels.alone(facets, owner, n_points, found, parent)
    keys = [tuple(sorted(facet)) for facet in facets.tolist()]
    count = Counter(keys)
    assert found.tolist() == [count[key] == 1 for key in keys]
    joined = [{cell} for cell in range(5)]
    for key in count:
        cells = set().union(*(joined[cell] for cell, own in zip(owner.tolist(), keys, strict=True) if own == key))
        for cell in cells:
            joined[cell] = cells
    while not (parent[parent] == parent).all():
        parent = parent[parent]
    assert parent.tolist() == [min(cells) for cells in joined]


def test_half_a_million_facets_round_one_node():
    # Were pairs of them compared, 1e11 would be: minutes.
    n = 500_000
    rim = np.arange(1, n + 1, dtype=np.int32)
    facets = np.column_stack([np.zeros(n, np.int32), np.concatenate([rim[: n // 2], rim[: n // 2]])])
    found, parent = np.empty(n, bool), np.arange(n, dtype=np.int32)
    topology_kernels.alone(facets, np.arange(n, dtype=np.int32), n + 1, found, parent)
    assert not found.any()
    assert len(np.unique(parent)) == n // 2
