"""The graded block: volume, groups, refinement."""

import numpy as np
import pytest
from models import FLAT, SOLIDS

import fastcontact as fc
from fastcontact.mesh import elements

GROUPS = {"BLOCK", "TOP", "CONTACT", "BOTTOM", "SIDE", "SYMMETRY_X", "POLE"}


@pytest.mark.parametrize("element", FLAT + SOLIDS)
def test_it_fills_the_block_and_names_its_sides(element):
    mesh = fc.generate.graded_block(element, width=4.0, depth=3.0, contact_radius=0.8, contact_size=0.4)
    dim = mesh.dim
    assert dim == elements.get(element).dim
    assert fc.quality(mesh).n_bad == 0
    assert fc.quality(mesh).measure == pytest.approx(3.0 * 4.0 ** (dim - 1), rel=1e-12)
    assert set(mesh.group_names) == GROUPS | ({"SYMMETRY_Y"} if dim == 3 else set())
    assert list(mesh.solids) == [element]
    points, height = mesh.points, mesh.points[:, -1]
    sides = {"TOP": height == 0.0, "BOTTOM": height == -3.0, "SYMMETRY_X": points[:, 0] == 0.0}
    sides["SIDE"] = (points[:, :-1] == 4.0).any(axis=1)
    if dim == 3:
        sides["SYMMETRY_Y"] = points[:, 1] == 0.0
    for name, on in sides.items():
        assert mesh.points_of(name).tolist() == np.flatnonzero(on).tolist()
    assert (points[mesh.point("POLE")] == 0.0).all()


@pytest.mark.parametrize("element", ["quad4", "tri6", "hex8", "tet10"])
def test_edges_are_as_asked_at_the_contact_and_far_from_it(element):
    mesh = fc.generate.graded_block(element, width=10.0, contact_radius=1.0, contact_size=0.2, size=2.0, growth=0.5)
    for axis in range(mesh.dim):
        on_axis = (np.delete(mesh.points, axis, axis=1) == 0.0).all(axis=1)
        places = np.sort(np.abs(mesh.points[on_axis, axis]))[:: elements.get(element).order]
        edges = np.diff(places)
        fine = places[1:] <= (0.5 if axis == mesh.dim - 1 else 1.0)
        assert (edges[fine] <= 0.2 * (1 + 1e-9)).all()
        assert (edges[fine] > 0.1).all()
        assert edges.max() <= 2.0 * (1 + 1e-9)
        assert (edges[1:] < 1.7 * edges[:-1]).all()
        assert edges[-1] > 1.0


def test_the_contact_is_the_finely_meshed_part_of_the_top():
    mesh = fc.generate.graded_block("hex8", width=10.0, contact_radius=1.0, contact_radius_y=2.0, contact_size=0.3)
    reach = mesh.points[mesh.points_of("CONTACT")].max(axis=0)
    assert (reach[:2] >= [1.0, 2.0]).all()
    assert (reach[:2] <= [1.3, 2.3]).all()
    assert reach[2] == 0.0
    whole = fc.generate.graded_block("quad4", width=1.0, contact_radius=1.0)
    assert whole.cell_groups["CONTACT"].tolist() == whole.cell_groups["TOP"].tolist()
