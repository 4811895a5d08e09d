"""Distances to eight boxes at once, against the same in NumPy."""

import numpy as np
import pytest

from fastcontact._jit.decorators import kernel
from fastcontact.contact.search import eight_boxes
from fastcontact.contact.search.eight_boxes import WIDTH, copied, emptied, lowest, squares, within, without


@kernel
def filled(boxes, node, point, away, begin):
    return squares(boxes, node, point, away, begin)


@kernel
def near(away, begin, reach):
    return within(away, begin, reach)


@kernel
def rest(away, begin, k):
    return without(away, begin, k)


@kernel
def first(bits):
    return lowest(bits)


@kernel
def moved(boxes, node, k, others, other, at, point):
    emptied(others, other, point)
    copied(boxes, node, k, others, other, at, point)


def some(dim):
    """Boxes of six nodes, of which one is not full, and one box is not a number."""
    low = np.random.default_rng(dim).uniform(-1, 1, (6, dim, WIDTH))
    boxes = np.concatenate([low, low + 0.3], axis=1)
    boxes[2, :dim, 5:], boxes[2, dim:, 5:] = np.inf, -np.inf
    boxes[3, 0, 4] = np.nan
    return boxes


@pytest.mark.parametrize("dim", [2, 3])
def test_distances_are_those_of_one_box_after_the_other(dim):
    boxes, rng = some(dim), np.random.default_rng(5)
    for node in range(6):
        point = tuple(rng.uniform(-1, 1, dim))
        away, plain = np.zeros(3 * WIDTH), np.zeros(3 * WIDTH)
        least = filled(boxes, node, point, away, WIDTH)
        assert least == away[WIDTH : 2 * WIDTH].min()
        assert least == pytest.approx(eight_boxes.squares_one_by_one(boxes, node, point, plain, WIDTH), rel=1e-15)
        assert away == pytest.approx(plain, rel=1e-15)
        assert (away >= 0.0).all()
        for reach in (-1.0, least, 0.2, 1e300, np.inf):
            assert near(away, WIDTH, reach) == eight_boxes.within_one_by_one(away, WIDTH, reach)


def test_one_is_taken_away_and_the_least_of_the_others_is_known():
    away = np.array([9.0, 3, 1, 4, 1, 5, np.inf, 2, 6, 5, 3])
    plain = away.copy()
    for k in (2, 4, 7, 1, 3, 5, 6, 0):
        assert rest(away, 1, k) == eight_boxes.without_one_by_one(plain, 1, k)
        assert np.array_equal(away, plain)
    assert away.tolist() == [9.0] + WIDTH * [np.inf] + [5.0, 3.0]


def test_the_lowest_bit_is_found():
    assert [first(bits) for bits in range(1, 256)] == [eight_boxes.lowest_one_by_one(bits) for bits in range(1, 256)]


@pytest.mark.parametrize("dim", [2, 3])
def test_a_box_is_put_among_empty_ones(dim):
    boxes, point = some(dim), dim * (0.0,)
    others = np.zeros((3, 2 * dim, WIDTH))
    plain = others.copy()
    moved(boxes, 4, 6, others, 1, 2, point)
    eight_boxes.emptied_one_by_one(plain, 1, point)
    eight_boxes.copied_one_by_one(boxes, 4, 6, plain, 1, 2, point)
    assert np.array_equal(others, plain)
    assert np.array_equal(others[1, :, 2], boxes[4, :, 6])
    assert np.isinf(np.delete(others[1], 2, axis=1)).all()
