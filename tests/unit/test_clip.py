"""Facets cut by facets in 3D: areas add up, whatever the position in space."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fastcontact.kernels import clip3d


def cut(secondary, primary, facing=-0.1):
    def packed(polygons):
        room = np.zeros((len(polygons), 4, 3))
        for row, polygon in zip(room, polygons, strict=True):
            row[: len(polygon)] = polygon
        return room, np.array([len(polygon) for polygon in polygons])

    pairs = np.array([(i, j) for i in range(len(secondary)) for j in range(len(primary))])
    owner, triangles = np.empty(1000, np.intp), np.empty((1000, 3, 3))
    count = clip3d.facing_triangles(*packed(secondary), *packed(primary), pairs, facing, owner, triangles)
    return owner[:count], triangles[:count]


def areas(triangles):
    return 0.5 * np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)


def rotation(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def grid(nx, ny, height, up):
    """Quadrangles over the unit square at a height, looking up or down."""
    x, y = np.linspace(0, 1, nx + 1), np.linspace(0, 1, ny + 1)
    found = []
    for i in range(nx):
        for j in range(ny):
            corners = [(x[i], y[j]), (x[i + 1], y[j]), (x[i + 1], y[j + 1]), (x[i], y[j + 1])]
            polygon = np.array([(a, b, height) for a, b in corners])
            found.append(polygon if up else polygon[::-1])
    return found


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 1000), nx=st.integers(1, 4), ny=st.integers(1, 4), gap=st.floats(-0.3, 0.3))
def test_pieces_of_one_square_cover_the_other(seed, nx, ny, gap):
    Q = rotation(seed)
    lower = [polygon @ Q.T for polygon in grid(nx, ny, 0.0, True)]
    upper = [polygon @ Q.T for polygon in grid(3, 2, gap, False)]
    owner, triangles = cut(lower, upper)
    assert areas(triangles).sum() == pytest.approx(1.0, abs=1e-12)
    per_facet = np.bincount(owner, weights=areas(triangles), minlength=nx * ny)
    assert per_facet == pytest.approx(1.0 / (nx * ny), abs=1e-12)


def test_a_triangle_and_a_quadrangle_share_their_common_part():
    triangle = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0]])
    square = np.array([[0.0, 0, 1], [0, 1.5, 1], [1.5, 1.5, 1], [1.5, 0, 1]])
    _, triangles = cut([triangle], [square])
    assert areas(triangles).sum() == pytest.approx(2.0 - 2 * 0.5 * 0.25, abs=1e-14)
    assert np.abs(triangles[:, :, 2]).max() < 1e-15


def test_facets_that_look_the_same_way_or_lie_apart_share_nothing():
    square = grid(1, 1, 0.0, True)
    assert len(cut(square, grid(1, 1, 0.1, True))[0]) == 0
    apart = [polygon + np.array([5.0, 0, 0]) for polygon in grid(1, 1, 0.1, False)]
    assert len(cut(square, apart)[0]) == 0
    touching = [polygon + np.array([1.0, 0, 0]) for polygon in grid(1, 1, 0.1, False)]
    assert len(cut(square, touching)[0]) == 0


def test_too_little_room_is_told():
    lower, upper = np.zeros((1, 4, 3)), np.zeros((1, 4, 3))
    lower[0], upper[0] = grid(1, 1, 0.0, True)[0], grid(1, 1, 0.1, False)[0]
    count = clip3d.facing_triangles(
        lower, np.array([4]), upper, np.array([4]), np.array([[0, 0]]), -0.1, np.empty(1, np.intp), np.empty((1, 3, 3))
    )
    assert count > 1
