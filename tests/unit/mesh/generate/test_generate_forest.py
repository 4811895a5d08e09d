"""Local refinement: conforming meshes, groups and volumes, bounded angles, curved boundaries."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fastcontact as fc
from fastcontact.errors import MeshError
from fastcontact.mesh.generate import Forest, circles
from fastcontact.mesh.topology import corner_areas, outer_facets


def area(mesh):
    return sum(corner_areas(mesh, name).sum() for name in mesh.solids)


def edge_counts(mesh):
    """How often every edge of a solid cell occurs."""
    from fastcontact.mesh import elements

    edges = [b[:, elements.get(n).edges].reshape(-1, 2) for n, b in mesh.solids.items()]
    return np.unique(np.sort(np.concatenate(edges), axis=1), axis=0, return_counts=True)[1]


@given(st.sampled_from(["tri3", "quad4"]), st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_random_refinement_keeps_area_groups_and_conformity(element, seed):
    random = np.random.default_rng(seed)
    first = fc.generate.block((2.0, 1.0), (3, 2), element)
    forest = Forest(first)
    for _ in range(4):
        forest.refine(random.random(forest.n_leaves) < 0.2)
    mesh, leaf = forest.mesh()
    assert area(mesh) == pytest.approx(2.0, rel=1e-12)
    assert edge_counts(mesh).max() == 2
    assert set(mesh.cell_groups) == set(first.cell_groups)
    outer = {tuple(sorted(f)) for block in outer_facets(mesh).values() for f in block.tolist()}
    lines = {tuple(sorted(f)) for f in mesh.cells["line2"].tolist()}
    # The sides have groups in the first mesh, so all outer edges are lines of the refined one.
    assert outer == lines
    for side in ("TOP", "BOTTOM", "LEFT", "RIGHT"):
        length = np.linalg.norm(np.diff(mesh.points[mesh.cells_of(side)["line2"]], axis=1), axis=2).sum()
        assert length == pytest.approx(2.0 if side in ("TOP", "BOTTOM") else 1.0, rel=1e-12)
    assert leaf.max() < forest.n_leaves
    assert len(np.unique(leaf)) == forest.n_leaves


@pytest.mark.parametrize("element", ["tri3", "quad4"])
def test_angles_stay_as_they_are_however_often_one_refines(element):
    forest = Forest(fc.generate.block((1.0, 1.0), (2, 2), element))
    angles = []
    for _ in range(9):
        mesh, leaf = forest.mesh()
        angles.append(fc.quality(mesh).smallest_angle)
        centres = np.concatenate([mesh.points[block].mean(axis=1) for block in mesh.solids.values()])
        marked = np.zeros(forest.n_leaves, bool)
        marked[leaf[np.argmin(np.linalg.norm(centres - [0.7, 0.6], axis=1))]] = True
        forest.refine(marked)
    assert min(angles[1:]) >= 0.55 * angles[1]
    assert min(angles[4:]) == pytest.approx(min(angles[2:4]), rel=0.3)


def test_marking_everything_is_uniform_refinement():
    mesh = fc.generate.half_spheres("tri3", size=10.0)
    forest = Forest(mesh, circles(mesh))
    forest.refine(np.ones(forest.n_leaves, bool))
    locally, _ = forest.mesh()
    uniformly = fc.generate.refined(mesh, circles(mesh))
    assert area(locally) == pytest.approx(area(uniformly), rel=1e-12)
    a, b = (points[np.lexsort(points.round(9).T)] for points in (locally.points, uniformly.points))
    np.testing.assert_allclose(a, b, atol=1e-12)


def test_new_points_of_an_arc_lie_on_it_and_join_its_ends():
    mesh = fc.generate.half_spheres("tri3", size=10.0)
    forest = Forest(mesh, circles(mesh))
    for _ in range(3):
        made, leaf = forest.mesh()
        near = np.concatenate([np.linalg.norm(made.points[b].mean(axis=1), axis=1) for b in made.solids.values()])
        marked = np.zeros(forest.n_leaves, bool)
        marked[leaf[near < 12]] = True
        forest.refine(marked)
    made, _ = forest.mesh()
    for side, centre in (("CONT1", -50.0), ("CONT2", 50.0)):
        arc = made.points[made.points_of(side)]
        assert len(arc) > 2 * len(mesh.points_of(side))
        centre = 50.0 * np.sign(arc[:, 1].mean())
        np.testing.assert_allclose(np.hypot(arc[:, 0], arc[:, 1] - centre), 50.0, rtol=1e-12)
    assert made.point("C1") == mesh.point("C1")


def test_quadratic_cells_are_refused_with_the_remedy():
    with pytest.raises(MeshError, match="quad8 cannot be refined locally: use `linearised`"):
        Forest(fc.generate.block((1.0, 1.0), (2, 2), "quad8"))
