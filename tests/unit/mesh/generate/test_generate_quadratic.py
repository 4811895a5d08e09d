"""Mid nodes: one per edge, half-way or on the curve, and no folded cell."""

import numpy as np
import pytest

import fastcontact as fc
from fastcontact.errors import MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.generate import Circle, block, quarter_disc, to_quadratic
from fastcontact.mesh.mesh import Mesh

R = 50.0
ARCS = (Circle((0.0, -R), R, "CONT1"), Circle((0.0, -R), R, "D1B1"))


def disc(element="tri3"):
    return quarter_disc(size=12.0) if element == "tri3" else quarter_disc(element, arc_sizes=(4.0, 9.0), segments=3)


def edges_of(mesh):
    ends = [block[:, elements.get(name).edges].reshape(-1, 2) for name, block in mesh.cells.items()]
    return np.unique(np.sort(np.concatenate(ends), axis=1), axis=0)


@pytest.mark.parametrize("element", ["tri3", "quad4"])
def test_one_mid_node_an_edge_half_way(element):
    mesh = disc(element)
    quadratic = to_quadratic(mesh)
    assert quadratic.n_points == mesh.n_points + len(edges_of(mesh))
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
    mesh = to_quadratic(Mesh(element.nodes, {name: [np.arange(element.n_nodes)]}))
    quadratic = elements.get(element.quadratic)
    assert mesh.points[mesh.cells[element.quadratic][0]] == pytest.approx(quadratic.nodes)
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
    mesh = Mesh(points, {"tri3": [[0, 1, 2]], "line2": [[0, 1]]}, {"ARC": [1]})
    to_quadratic(mesh)
    with pytest.raises(MeshError, match=r"cell 0 \(tri6.*inverted"):
        to_quadratic(mesh, [Circle((0.0, -1.0), np.sqrt(2.0), "ARC")])


def test_errors_name_the_culprit():
    mesh = block()
    with pytest.raises(MeshError, match="radius = -1"):
        Circle((0.0, 0.0), -1.0)
    with pytest.raises(MeshError, match="did you mean 'TOP'"):
        to_quadratic(mesh, [Circle((0.0, 0.0), 1.0, "TOPP")])
    with pytest.raises(MeshError, match="no edge of group 'TOP'"):
        to_quadratic(mesh, [Circle((0.0, 0.0), 7.0, "TOP")])
    with pytest.raises(MeshError, match="16 quad8"):
        to_quadratic(to_quadratic(mesh))
    tet = elements.get("tet4")
    with pytest.raises(MeshError, match="centre_nodes"):
        to_quadratic(Mesh(tet.nodes, {"tet4": [[0, 1, 2, 3]]}), centre_nodes=True)
