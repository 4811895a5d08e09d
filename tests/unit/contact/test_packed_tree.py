"""The tree of boxes in the order of a curve: everything is in it once, and boxes hold what is below them."""

import numpy as np
import pytest

from fastcontact.contact.search import packed_tree_kernels
from fastcontact.contact.search.packed_tree_kernels import WIDTH


def lattice(dim, n):
    """All cells of a lattice (n ** dim, dim), shuffled."""
    cells = np.stack(np.meshgrid(*[np.arange(n)] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    return np.random.default_rng(dim).permutation(cells).astype(float)


@pytest.mark.parametrize(("dim", "n"), [(2, 32), (3, 16)])
def test_neighbours_on_the_curve_are_neighbours_in_space(dim, n):
    cells = lattice(dim, n)
    # The cube just so large that every point lies in a cell of its own: along Hilbert's curve, the next one touches it.
    order = packed_tree_kernels.curve_order(cells, np.full(dim, -0.5), np.full(dim, n - 0.5))
    assert np.array_equal(np.sort(order), np.arange(len(cells)))
    assert np.abs(np.diff(cells[order], axis=0)).sum(axis=1).tolist() == [1.0] * (len(cells) - 1)


@pytest.mark.parametrize("dim", [2, 3])
def test_the_order_is_a_permutation_whatever_the_points(dim):
    rng = np.random.default_rng(1)
    points = rng.normal(size=(1000, dim))
    points[::7] = points[0]
    points[5], points[6], points[11] = np.nan, np.inf, -1e300
    for low, high in ((np.full(dim, -1.0), np.full(dim, 1.0)), (np.zeros(dim), np.zeros(dim))):
        assert np.array_equal(np.sort(packed_tree_kernels.curve_order(points, low, high)), np.arange(1000))
    # What is in one cell stays in its order.
    assert np.array_equal(packed_tree_kernels.curve_order(points[:50], np.zeros(dim), np.zeros(dim)), np.arange(50))
    assert len(packed_tree_kernels.curve_order(points[:0], np.zeros(dim), np.ones(dim))) == 0


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("n", [0, 1, 7, 8, 9, 64, 65, 203, 600])
def test_boxes_hold_what_is_below_them(dim, n):
    rng = np.random.default_rng(n)
    low = rng.uniform(-3, 3, (n, dim))
    high = low + rng.uniform(0, 1, (n, dim))
    boxes, first = packed_tree_kernels.pack(low, high)
    starts = [0]  # of the levels of nodes
    while starts[-1] < len(first) - 1:
        starts.append(starts[-1] + max(-(-(n if len(starts) == 1 else starts[-1] - starts[-2]) // WIDTH), 1))
    met = []

    def below(node):
        """Corners of the box around everything in a node."""
        level = np.searchsorted(starts, node, side="right") - 1
        children = np.arange(first[node], min(first[node] + WIDTH, starts[level] if level else n))
        if level == 0:
            met.extend(children)
        parts = [below(child) if level else (low[child], high[child]) for child in children]
        for k, (a, b) in enumerate(parts):
            assert np.array_equal(boxes[node, :dim, k], a)
            assert np.array_equal(boxes[node, dim:, k], b)
        assert (boxes[node, :dim, len(parts) :] == np.inf).all()
        assert (boxes[node, dim:, len(parts) :] == -np.inf).all()
        return np.min([a for a, _ in parts], axis=0, initial=np.inf), np.max(
            [b for _, b in parts], axis=0, initial=-np.inf
        )

    below(len(first) - 1)
    assert met == list(range(n))
