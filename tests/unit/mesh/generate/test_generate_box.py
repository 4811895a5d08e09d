"""Boxes: exact volume, sides, conforming cells in every element."""

import numpy as np
import pytest

import fastcontact as fc
from fastcontact.mesh import elements
from fastcontact.mesh.generate.box import SOLIDS

SIZE, ORIGIN = (2.0, 1.5, 1.2), (0.5, -0.3, 0.1)
SIDES = {f"{axis}{end}": (k, end) for k, axis in enumerate("XYZ") for end in ("MIN", "MAX")}


@pytest.mark.parametrize("element", SOLIDS)
def test_volume_points_and_sides(element):
    mesh = fc.generate.box(SIZE, (3, 2, 2), element, ORIGIN)
    fc.Model(mesh, "3d")  # no cell is degenerate or inverted
    assert list(mesh.solids) == [element]
    assert fc.topology.corner_measures(mesh, element).sum() == pytest.approx(np.prod(SIZE), rel=1e-13)
    assert fc.quality(mesh).measure == pytest.approx(np.prod(SIZE), rel=1e-13)
    assert fc.topology.bodies(mesh)[0] == 1
    assert (fc.topology.bodies(mesh)[1] == 0).all()
    low, high = np.array(ORIGIN), np.array(ORIGIN) + SIZE
    for name, (axis, end) in SIDES.items():
        found = mesh.points_of(name)
        on = mesh.points[:, axis] == (low if end == "MIN" else high)[axis]
        assert np.array_equal(found, np.flatnonzero(on))


@pytest.mark.parametrize("element", SOLIDS)
def test_neighbours_share_their_facets_so_that_only_the_sides_are_outside(element):
    mesh = fc.generate.box(SIZE, (3, 2, 2), element, ORIGIN)
    outer = {name: sorted(map(tuple, block.tolist())) for name, block in fc.topology.outer_facets(mesh).items()}
    assert {name: sorted(map(tuple, block.tolist())) for name, block in mesh.facets.items()} == outer
    members = np.concatenate([mesh.cell_groups[name] for name in SIDES])
    assert len(members) == len(np.unique(members)) == sum(map(len, mesh.facets.values()))


@pytest.mark.parametrize("element", SOLIDS)
def test_number_of_cells_and_points(element):
    mesh = fc.generate.box(divisions=(2, 3, 4), element=element, name="SOLID")
    n = {"hex8": 1, "tet4": 6, "wedge6": 2, "pyramid5": 6}[elements.get(element).linear] * 24
    assert len(mesh.cells[element]) == len(mesh.cell_groups["SOLID"]) == n
    corners = 3 * 4 * 5
    if element == "hex27":
        assert mesh.n_points == 5 * 7 * 9
    if element in ("hex8", "tet4", "wedge6"):
        assert mesh.n_points == corners
    if element == "pyramid5":
        assert mesh.n_points == corners + 24


@pytest.mark.parametrize("element", [name for name in SOLIDS if elements.get(name).order == 2])
def test_quadratic_boxes_are_linear_ones_with_mid_nodes(element):
    mesh = fc.generate.box(SIZE, (2, 1, 1), element, ORIGIN)
    for name, block in mesh.cells.items():
        reference = elements.get(name)
        expected = reference.corner_shape(reference.nodes) @ mesh.points[block[:, : reference.n_corners]]
        assert np.abs(mesh.points[block] - expected).max() < 1e-15
