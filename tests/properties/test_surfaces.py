"""The search and the pairing on random closed and open surfaces against brute force."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from problems import examples
from scipy.spatial.transform import Rotation

from fastcontact.contact.search.closest import closest
from fastcontact.mesh import elements

SIZE = {"line2": 2, "line3": 3, "tri3": 3, "tri6": 6, "quad4": 4, "quad8": 8, "quad9": 9}


def wavy(random, places, dim):
    """Lift places (n, dim - 1) in [0, 1] to a smooth random graph (n, dim)."""
    lift = np.zeros(len(places))
    for _ in range(4):
        direction, phase = random.normal(0, 2.5, dim - 1), random.uniform(0, 6.3)
        lift += 0.05 * np.sin(places @ direction + phase)
    return np.column_stack([places, lift])


def line(kind, n):
    """Facets (n, n_nodes, 1) that divide [0, 1]."""
    ends = np.linspace(0, 1, n + 1)
    nodes = [ends[:-1], ends[1:]] + ([0.5 * (ends[1:] + ends[:-1])] if kind == "line3" else [])
    return np.column_stack(nodes)[:, :, None]


def square(kind, n):
    """Facets (n_facets, n_nodes, 2) that divide the unit square."""
    reference = elements.get(kind).nodes
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    corner = np.column_stack([i, j])[:, None]
    if not kind.startswith("tri"):
        return (corner + 0.5 * (1 + reference)) / n
    return np.concatenate([corner + reference, corner + 1 - reference]) / n


def sampled(kind, corners, n):
    """Points all over each facet (n_facets * m, dim), and how far any point of a facet is from them at most."""
    element = elements.get(kind)
    if kind.startswith("line"):
        xi = np.linspace(-1, 1, n)[:, None]
    else:
        low = 0.0 if kind.startswith("tri") else -1.0
        s, t = (a.ravel() for a in np.meshgrid(np.linspace(low, 1, n), np.linspace(low, 1, n), indexing="ij"))
        xi = np.column_stack([s, t])[s + t <= 1 + 1e-12] if kind.startswith("tri") else np.column_stack([s, t])
    points = np.einsum("qk,nkd->nqd", element.shape(xi), corners)
    # Half the largest diagonal of the pattern, and as much again for what is curved.
    apart = np.linalg.norm(np.ptp(corners, axis=1), axis=1).max() / (n - 1)
    return points.reshape(-1, corners.shape[2]), 2.0 * apart


@examples(100)
@given(
    kind=st.sampled_from(sorted(SIZE)), n=st.integers(1, 8), seed=st.integers(0, 2**32 - 1), far=st.floats(-2, 1),
    scale=st.floats(-9, 9), shift=st.floats(0, 100),
)  # fmt: skip
def test_the_closest_point_of_a_random_surface(kind, n, seed, far, scale, shift):
    """Of any size, turned and moved any way; points from near to far, on both sides and beyond its edges."""
    random = np.random.default_rng(seed)
    dim = 2 if kind.startswith("line") else 3
    flat = line(kind, n) if dim == 2 else square(kind, n)
    corners = wavy(random, flat.reshape(-1, dim - 1), dim).reshape(*flat.shape[:2], dim)
    corners = corners[random.permutation(len(corners))]
    chosen = corners[random.integers(len(corners), size=25)].mean(axis=1)
    points = chosen + 10.0**far * random.normal(size=(25, dim))
    turn = Rotation.random(random_state=seed % 2**31).as_matrix() if dim == 3 else (
        Rotation.from_euler("z", random.uniform(0, 6.3)).as_matrix()[:2, :2]
    )  # fmt: skip
    size, origin = 10.0**scale, shift * random.normal(size=dim)
    corners, points = ((size * (x @ turn.T + origin)) for x in (corners, points))
    found = closest(points, corners)
    # It lies on its facet, at the distance that it tells.
    element = elements.get(kind)
    on = np.einsum("nk,nkd->nd", element.shape(found.xi), corners[found.facet])
    rounding = 1e-11 * size * (1 + shift)
    assert np.abs(on - found.position).max() <= rounding
    assert np.abs(np.linalg.norm(points - found.position, axis=1) - found.distance).max() <= rounding
    inside = np.clip(found.xi, 0.0 if kind.startswith("tri") else -1.0, 1.0)
    assert np.abs(inside - found.xi).max() <= 1e-12
    # No sample of any facet is closer, and the closest one is not much farther.
    samples, apart = sampled(kind, corners, 25)
    brute = np.sqrt(((points[:, None] - samples[None]) ** 2).sum(axis=2).min(axis=1))
    assert (found.distance <= brute + rounding).all()
    assert (found.distance >= brute - apart).all()
    assert np.abs(np.linalg.norm(found.normal, axis=1) - 1).max() < 1e-12


@examples(60)
@given(kind=st.sampled_from(sorted(SIZE)), n=st.integers(1, 6), seed=st.integers(0, 2**32 - 1))
def test_the_order_of_facets_and_points_does_not_matter(kind, n, seed):
    random = np.random.default_rng(seed)
    dim = 2 if kind.startswith("line") else 3
    flat = line(kind, n) if dim == 2 else square(kind, n)
    corners = wavy(random, flat.reshape(-1, dim - 1), dim).reshape(*flat.shape[:2], dim)
    points = random.uniform(-0.3, 1.3, (30, dim))
    one = closest(points, corners)
    facets, order = random.permutation(len(corners)), random.permutation(len(points))
    other = closest(points[order], corners[facets])
    assert (
        np.array_equal(other.distance, one.distance[order])
        or np.abs(other.distance - one.distance[order]).max() < 1e-13
    )
    assert np.abs(other.position - one.position[order]).max() < 1e-6  # equally close places may be two
