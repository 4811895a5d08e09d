"""Refined and quadratic meshes: conforming cells, groups, points on curves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused

import fastcontact as fc
from fastcontact.mesh import elements
from fastcontact.mesh.generate import Circle, Forest, block, circles, quarter_disc, refined, to_quadratic

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
MIDDLES = np.array([[0.5, 0.0], [1.0, 0.5], [0.5, 1.0], [0.0, 0.5]])


def one_cell(name):
    points = {
        "tri3": SQUARE[:3], "quad4": SQUARE, "quad8": np.vstack([SQUARE, MIDDLES]),
        "tri6": np.vstack([SQUARE[:3], MIDDLES[:2], [[0.5, 0.5]]]), "quad9": np.vstack([SQUARE, MIDDLES, [[0.5, 0.5]]]),
    }[name]  # fmt: skip
    bottom = [0, 1] if name in ("tri3", "quad4") else [0, 1, {"tri6": 3}.get(name, 4)]
    groups = {
        "corner": np.array([0]),
        "bottom": np.array(bottom),
        "all": np.arange(len(points)),
        "far": np.array([0, 2]),
    }
    return fc.Mesh(points, {name: np.arange(len(points))[None]}, {}, groups)


@pytest.mark.parametrize("name", ["tri3", "tri6", "quad4", "quad8", "quad9"])
def test_new_points_join_the_groups_that_hold_all_of_their_edge(name):
    mesh = refined(one_cell(name))
    assert len(mesh.cells[name]) == 4
    assert mesh.point_groups["corner"].tolist() == [0]
    assert set(mesh.point_groups["all"]) == set(range(mesh.n_points))
    bottom = np.flatnonzero(mesh.points[:, 1] == 0.0)
    assert set(mesh.point_groups["bottom"]) == set(bottom)
    assert len(bottom) == (3 if name in ("tri3", "quad4") else 5)
    # The ends of a diagonal are no edge, but where a triangle has it as one.
    diagonal = np.flatnonzero(mesh.points[:, 0] == mesh.points[:, 1])
    expected = set(diagonal) if name == "tri3" else {0, 2}
    assert set(mesh.point_groups["far"]) == expected


@pytest.mark.parametrize("name", ["tri3", "tri6", "quad4", "quad9"])
def test_arcs_stay_round_and_areas_add_up(name):
    mesh = fc.generate.half_spheres(name, **({"size": 12.0} if name.startswith("tri") else {"segments": 3}))
    fine = refined(mesh, circles(mesh))
    for group, centre in (("CONT1", -50.0), ("CONT2", 50.0)):
        r = np.linalg.norm(fine.points[fine.points_of(group)] - [0.0, centre], axis=1)
        assert r == pytest.approx(50.0, rel=1e-12)
    assert sum(map(len, fine.solids.values())) == 4 * sum(map(len, mesh.solids.values()))
    assert len(fine.points_of("CONT1")) == 2 * len(mesh.points_of("CONT1")) - 1


def area(mesh):
    return sum(fc.topology.corner_measures(mesh, name).sum() for name in mesh.solids)


def edges_of(cells):
    """The edges of cells, and how often each of them occurs."""
    edges = [block[:, elements.get(name).edges].reshape(-1, 2) for name, block in cells.items()]
    return np.unique(np.sort(np.concatenate(edges), axis=1), axis=0, return_counts=True)


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
    assert edges_of(mesh.solids)[1].max() == 2
    assert set(mesh.cell_groups) == set(first.cell_groups)
    outer = {tuple(sorted(f)) for block in fc.topology.outer_facets(mesh).values() for f in block.tolist()}
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


R = 50.0
ARCS = (Circle((0.0, -R), R, "CONT1"), Circle((0.0, -R), R, "D1B1"))


def disc(element="tri3"):
    return quarter_disc(size=12.0) if element == "tri3" else quarter_disc(element, arc_sizes=(4.0, 9.0), segments=3)


@pytest.mark.parametrize("element", ["tri3", "quad4"])
def test_one_mid_node_an_edge_half_way(element):
    mesh = disc(element)
    quadratic = to_quadratic(mesh)
    assert quadratic.n_points == mesh.n_points + len(edges_of(mesh.cells)[0])
    assert np.array_equal(quadratic.points[: mesh.n_points], mesh.points)
    for name, cells in quadratic.cells.items():
        reference = elements.get(name)
        for k, (a, b) in enumerate(reference.edges):
            middle = 0.5 * (mesh.points[cells[:, a]] + mesh.points[cells[:, b]])
            assert quadratic.points[cells[:, reference.n_corners + k]] == pytest.approx(middle, abs=1e-12)


@pytest.mark.parametrize("element", ["tri3", "quad4"])
def test_only_mid_nodes_of_the_arcs_leave_the_middle(element):
    mesh = disc(element)
    straight, curved = to_quadratic(mesh), to_quadratic(mesh, ARCS)
    moved = np.flatnonzero((straight.points != curved.points).any(axis=1))
    on_arcs = np.union1d(curved.points_of("CONT1"), curved.points_of("D1B1"))
    assert np.array_equal(moved, on_arcs[on_arcs >= mesh.n_points])
    assert np.abs(np.hypot(curved.points[moved, 0], curved.points[moved, 1] + R) - R).max() < 1e-12 * R


def test_a_circle_without_group_takes_the_outer_facets_on_it():
    mesh = disc()
    named, found = to_quadratic(mesh, ARCS), to_quadratic(mesh, [Circle((0.0, -R), R)])
    assert np.array_equal(named.points, found.points)


def test_groups_and_cell_numbers_stay():
    mesh = disc()
    quadratic = to_quadratic(mesh, ARCS)
    assert list(quadratic.cells) == ["tri6", "line3"]
    assert quadratic.point_groups == mesh.point_groups
    for group, cells in mesh.cell_groups.items():
        assert np.array_equal(quadratic.cell_groups[group], cells)
    assert set(mesh.points_of("CONT1")) < set(quadratic.points_of("CONT1"))


def test_centre_nodes_stand_where_the_curved_sides_put_them():
    mesh = disc("quad4")
    eight, nine = to_quadratic(mesh, ARCS), to_quadratic(mesh, ARCS, centre_nodes=True)
    assert nine.n_points == eight.n_points + len(mesh.cells["quad4"])
    centre = elements.get("quad8").shape(np.zeros((1, 2)))[0]
    expected = np.einsum("n,cni->ci", centre, eight.points[eight.cells["quad8"]])
    assert nine.points[nine.cells["quad9"][:, 8]] == pytest.approx(expected, abs=1e-12)
    assert fc.quality(nine).measure == pytest.approx(fc.quality(eight).measure, rel=1e-9)


@pytest.mark.parametrize("name", ["tet4", "hex8", "wedge6", "pyramid5"])
def test_solid_cells_in_3d_become_quadratic_too(name):
    element = elements.get(name)
    mesh = to_quadratic(fc.Mesh(element.nodes, {name: [np.arange(element.n_nodes)]}))
    assert mesh.points[mesh.cells[element.quadratic][0]] == pytest.approx(elements.get(element.quadratic).nodes)
    assert fc.quality(mesh).n_bad == 0


def test_projection_is_the_nearest_point():
    circle = Circle((1.0, 2.0), 3.0)
    angles = np.linspace(0.1, 6.0, 7)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    for distance in (0.5, 3.0, 40.0):
        found = circle.project(np.array([1.0, 2.0]) + distance * directions)
        assert found == pytest.approx(np.array([1.0, 2.0]) + 3.0 * directions)


def test_a_side_curved_too_much_folds_the_cell():
    # A flat triangle under an arc of a quarter circle that bulges through its tip.
    points = [[-1.0, 0.0], [1.0, 0.0], [0.0, 0.1]]
    mesh = fc.Mesh(points, {"tri3": [[0, 1, 2]], "line2": [[0, 1]]}, {"ARC": [1]})
    to_quadratic(mesh)
    refused(fc.MeshError, r"cell 0 \(tri6.*inverted", to_quadratic, mesh, [Circle((0.0, -1.0), np.sqrt(2.0), "ARC")])


def test_errors_name_the_culprit():
    mesh = block()
    refused(fc.MeshError, "radius = -1", Circle, (0.0, 0.0), -1.0)
    refused(fc.MeshError, "did you mean 'TOP'", to_quadratic, mesh, [Circle((0.0, 0.0), 1.0, "TOPP")])
    refused(fc.MeshError, "no edge of group 'TOP'", to_quadratic, mesh, [Circle((0.0, 0.0), 7.0, "TOP")])
    refused(fc.MeshError, "16 quad8", to_quadratic, to_quadratic(mesh))
    tet = elements.get("tet4")
    refused(fc.MeshError, "centre_nodes", to_quadratic, fc.Mesh(tet.nodes, {"tet4": [[0, 1, 2, 3]]}), centre_nodes=True)
