"""The tree of bounding boxes: every facet occurs once, and boxes contain their children."""

import numpy as np
import pytest

from fastcontact._jit.decorators import kernel
from fastcontact.contact.search.box_tree_kernels import build, open_box, square_to_box, tree_order


@kernel
def opened(tree, box, point, stack, squares):
    return open_box(tree, box, point, stack, squares, 0)


@kernel
def square(tree, box, point):
    return square_to_box(tree, box, point)


@pytest.mark.parametrize("dim", [2, 3])
def test_every_box_is_halved_along_its_longest_side(dim):
    points = np.random.default_rng(4).uniform(0, 1, (64, dim)) * ([1.0, 0.8, 0.6][:dim])
    points[:20] = points[5]  # many equal ones
    order = tree_order(points, 1)
    assert np.array_equal(np.sort(order), np.arange(64))
    for size in (64, 32, 16, 8, 4, 2):
        for part in points[order].reshape(-1, size, dim):
            axis = np.argmax(np.ptp(part, axis=0))
            assert part[: size // 2, axis].max() <= part[size // 2 :, axis].min()
    coarse = tree_order(points, 16).reshape(4, 16)
    assert np.array_equal(np.sort(coarse, axis=1), np.sort(order.reshape(4, 16), axis=1))


@pytest.mark.parametrize("dim", [2, 3])
def test_the_nearer_of_two_boxes_comes_on_top(dim):
    low = np.random.default_rng(dim).uniform(-1, 1, (5, dim))
    tree = build(low, low + 0.3)
    stack, squares = np.empty(4, np.int64), np.empty(4)
    for point in np.random.default_rng(9).uniform(-1, 1, (40, dim)):
        away = np.maximum(np.maximum(tree.low - point, point - tree.high), 0.0)
        away = (away * away).sum(axis=1)
        for box in range(1, 8):
            assert square(tree, box, tuple(point)) == pytest.approx(away[box], rel=1e-14)
            assert opened(tree, box, tuple(point), stack, squares) == 2
            assert sorted(stack[:2]) == [2 * box, 2 * box + 1]
            assert squares[:2] == pytest.approx(away[stack[:2]], rel=1e-14)
            assert squares[1] <= squares[0]
