"""Facets selected by position, and meshes cut along them."""

import numpy as np
import pytest

import fastcontact as fc
from fastcontact.mesh.topology import bodies, outer_facets

SOLIDS = ("tet4", "tet10", "hex8", "hex20", "hex27", "wedge6", "wedge15", "pyramid5", "pyramid13")
FLAT = ("tri3", "tri6", "quad4", "quad8", "quad9")


def bar(element):
    if element in FLAT:
        return fc.generate.block((1.0, 2.0), (2, 4), element)
    return fc.generate.box((1.0, 2.0, 1.0), (2, 4, 2), element)


def at(height):
    return lambda x: np.abs(x[:, 1] - height) < 1e-9


def measure(mesh, group):
    """Return the area of a group of facets, from its nodal forces under a traction of 1."""
    model = fc.Model(mesh, "3d" if mesh.dim == 3 else "plane_strain")
    model.add_traction(group, y=1.0)
    return model.load_vector(model.loads[0])[:, 1].sum()


@pytest.mark.parametrize("element", FLAT + SOLIDS)
def test_a_mesh_is_cut_in_two_at_any_height(element):
    mesh = bar(element).with_facet_group("CUT", at(1.0), between=True)
    assert measure(mesh, "CUT") == pytest.approx(1.0)
    opened = fc.generate.cut(mesh, "CUT")
    assert (bodies(mesh)[0], bodies(opened)[0]) == (1, 2)
    section, facing = opened.points_of("CUT"), opened.points_of("CUT opposite")
    assert len(section) == len(facing) == opened.n_points - mesh.n_points
    assert sorted(map(tuple, opened.points[section])) == sorted(map(tuple, opened.points[facing]))
    outside = sum(map(len, outer_facets(opened).values())) - sum(map(len, outer_facets(mesh).values()))
    assert outside == 2 * sum(map(len, mesh.cells_of("CUT").values()))
    for name, block in opened.solids.items():
        mine = np.isin(block, facing).any(axis=1)
        assert (opened.points[block].mean(axis=1)[mine, 1] > 1.0).all()
        assert (opened.points[block].mean(axis=1)[np.isin(block, section).any(axis=1), 1] < 1.0).all()
        assert mesh.cells[name].shape == block.shape
    for group in mesh.cell_groups:  # facets of other groups stay on the outside, of the same size
        if group != "CUT" and not mesh.cells_of(group, dim=mesh.dim):
            assert measure(opened, group) == pytest.approx(measure(mesh, group))
            kept = {frozenset(f) for block in outer_facets(opened).values() for f in block.tolist()}
            assert all(frozenset(f) in kept for block in opened.cells_of(group).values() for f in block.tolist())


def test_the_normal_says_which_side_gets_new_nodes():
    mesh = bar("quad4").with_facet_group("CUT", at(1.0), between=True).with_groups(points={"LINE": range(15)})
    opened = fc.generate.cut(mesh, "CUT", normal=(0.0, -1.0))
    block = opened.cells["quad4"]
    assert (opened.points[block].mean(axis=1)[(block >= mesh.n_points).any(axis=1), 1] < 1.0).all()
    assert set(range(mesh.n_points, opened.n_points)) <= set(opened.point_groups["LINE"].tolist())


def test_a_group_by_place_uses_the_facets_that_are_there():
    mesh = bar("hex8")
    named = mesh.with_facet_group("ROOF", at(2.0))
    assert named.n_cells == mesh.n_cells
    assert named.cell_groups["ROOF"].tolist() == mesh.cell_groups["YMAX"].tolist()
    bare = fc.Mesh(mesh.points, mesh.solids)
    assert measure(bare.with_facet_group("ROOF", at(2.0)), "ROOF") == pytest.approx(1.0)
    both = bare.with_facet_group("ROOF", at(2.0)).with_facet_group("FLOOR", at(0.0))
    assert set(both.cell_groups) == {"ROOF", "FLOOR"}
    assert (both.points[both.points_of("ROOF"), 1] == 2.0).all()


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (
            lambda m: m.with_facet_group("A", at(0.3)),
            "group 'A' would be empty: its function selects 0 points, but no f",
        ),
        (lambda m: m.with_facet_group("A", at(2.0), between=True), "no facet between two cells has all"),
        (
            lambda m: m.with_facet_group("A", lambda x: x[:, 0]),
            "returned float64 of shape .15,.: it must return True or",
        ),
        (lambda m: fc.generate.cut(m, "BLOCK"), "contains no facets"),
        (lambda m: fc.generate.cut(m, "NONE"), "unknown group"),
        (
            lambda m: fc.generate.cut(
                m.with_facet_group("A", lambda x: at(1.0)(x) & (x[:, 0] < 0.6), between=True), "A"
            ),
            "facets of 'A' do not divide the body",
        ),
        (
            lambda m: fc.generate.cut(m.with_facet_group("A", at(1.0), between=True), "A", normal=(0.0, 0.0)),
            "normal .0.0, 0.0. of section 'A' must be 2 numbers",
        ),
    ],
)
def test_what_is_refused(call, said):
    with pytest.raises(fc.MeshError, match=said):
        call(bar("quad4"))
