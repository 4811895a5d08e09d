"""Boxes of a tree come in the order of their distance, and the front holds all that may be closest."""

import numpy as np
import pytest

from fastcontact._jit.decorators import kernel
from fastcontact.contact.search import packed_tree_kernels
from fastcontact.contact.search.nearest_first_kernels import (
    FRONT,
    SORTED,
    farthest,
    found_front,
    left,
    nearest,
    opened,
    queue,
    started,
    taken,
    whole_front,
)
from fastcontact.contact.search.packed_tree_kernels import WIDTH


@kernel
def visited(tree, n_leaves, room, count, point, reach, numbers, away):
    """Fill the numbers and squared distances of the facets in the order in which they come; return how many."""
    n, met, most = started(room, count, point), 0, 0
    while n > 0:
        most = max(most, n)
        chunk, square = nearest(room, n)
        if square > reach:
            n = left(n)
            continue
        child = taken(room, chunk, square, count)
        if child < len(tree.first):
            n = opened(room, n, tree, n_leaves, child, point)
            continue
        numbers[met], away[met] = child - len(tree.first), square
        met += 1
    return met, most


def scattered(dim, n):
    """Boxes (n, dim) along the curve, and their tree."""
    rng = np.random.default_rng(n)
    low = rng.uniform(0, 1, (n, dim))
    low = low[packed_tree_kernels.curve_order(low, np.zeros(dim), np.ones(dim))]
    high = low + rng.uniform(0, 0.5 / n ** (1 / dim), (n, dim))
    return low, high, packed_tree_kernels.pack(low, high), packed_tree_kernels.leaves(n)


def distances(low, high, point):
    return (np.maximum(np.maximum(low - point, point - high), 0.0) ** 2).sum(axis=1)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("n", [1, 8, 9, 300])
def test_all_within_reach_come_in_the_order_of_their_distance(dim, n):
    low, high, tree, n_leaves = scattered(dim, n)
    point = np.full(dim, 0.4)
    room, numbers, away = queue(dim), np.zeros(n, np.int64), np.zeros(n)
    expected = distances(low, high, point)
    for reach in (expected.min(), 0.01, 0.1):
        count = whole_front(room, tree, tuple(point))
        met, _ = visited(tree, n_leaves, room, count, tuple(point), reach * (1 + 1e-14), numbers, away)
        assert sorted(numbers[:met]) == np.flatnonzero(expected <= reach * (1 + 1e-14)).tolist()
        assert away[:met] == pytest.approx(expected[numbers[:met]], rel=1e-14)
        assert (np.diff(away[:met]) >= 0.0).all()


@pytest.mark.parametrize("dim", [2, 3])
def test_more_than_have_room_come_all_the_same(dim):
    low, high, tree, n_leaves = scattered(dim, 5000)
    point = (7.0,) * dim
    room, numbers, away = queue(dim), np.zeros(5000, np.int64), np.zeros(5000)
    met, most = visited(tree, n_leaves, room, whole_front(room, tree, point), point, 1e300, numbers, away)
    assert met == 5000
    assert np.array_equal(np.sort(numbers), np.arange(5000))
    assert SORTED < most <= len(room.least)
    assert away == pytest.approx(distances(low, high, point)[numbers], rel=1e-14)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("radius", [0.0, 0.05, 0.2, 5.0])
def test_the_front_holds_the_leaves_within_a_distance(dim, radius):
    low, high, tree, n_leaves = scattered(dim, 3000)
    point, room = (0.3,) * dim, queue(dim)
    count = found_front(room, tree, n_leaves, point, radius)
    leaf_low = np.minimum.reduceat(low, np.arange(0, 3000, WIDTH))
    leaf_high = np.maximum.reduceat(high, np.arange(0, 3000, WIDTH))
    expected = np.flatnonzero(distances(leaf_low, leaf_high, point) <= (radius * (1 + 1e-9)) ** 2)
    if len(expected) > FRONT * WIDTH:
        assert (count, room.front[0]) == (1, len(tree.first) - 1)
        return
    assert sorted(room.front[:count]) == expected.tolist()
    for place, leaf in enumerate(room.front[:count]):
        chunk, lane = divmod(place, WIDTH)
        assert np.array_equal(room.boxes[chunk, :, lane], np.concatenate([leaf_low[leaf], leaf_high[leaf]]))
    # What fills the last chunk up is in nobody's reach.
    chunks = -(-count // WIDTH)
    assert np.isinf(np.moveaxis(room.boxes[:chunks], 1, 2).reshape(-1, 2 * dim)[count:]).all()


def test_a_tree_of_one_leaf_is_its_own_front():
    _, _, tree, n_leaves = scattered(2, 5)
    room = queue(2)
    assert found_front(room, tree, n_leaves, (0.0, 0.0), 9.0) == 1
    assert room.front[0] == 0


def test_the_farthest_of_a_run():
    points = np.random.default_rng(1).normal(size=(20, 3))
    order = np.random.default_rng(2).permutation(20)
    expected = np.linalg.norm(points[order[5:12]] - points[3], axis=1).max()
    assert farthest(points, order, 5, 12, 3) == pytest.approx(expected, rel=1e-15)
