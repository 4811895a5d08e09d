"""Facets of one cell only, against Python's sorted tuples."""

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
    facets = np.random.default_rng(seed).integers(n_points, size=(n, n_nodes)).astype(np.int32)
    found = np.empty(n, bool)
    topology_kernels.alone(facets, n_points, found)
    keys = [tuple(sorted(facet)) for facet in facets.tolist()]
    count = Counter(keys)
    assert found.tolist() == [count[key] == 1 for key in keys]


def test_half_a_million_facets_round_one_node():
    # Were pairs of them compared, 1e11 would be: minutes.
    n = 500_000
    rim = np.arange(1, n + 1, dtype=np.int32)
    facets = np.column_stack([np.zeros(n, np.int32), np.concatenate([rim[: n // 2], rim[: n // 2]])])
    found = np.empty(n, bool)
    topology_kernels.alone(facets, n + 1, found)
    assert not found.any()
