"""Facets selected by position, cut meshes, and meshes from gmsh, meshio and PyVista in memory."""

import sys

import meshio
import numpy as np
import pytest
from models import FLAT, SOLIDS, assert_same_mesh, body_of
from refusals import refused

import fastcontact as fc
from fastcontact.mesh import elements
from fastcontact.mesh.topology import bodies, outer_facets


def bar(element):
    return body_of(element, (1.0, 2.0, 1.0), (2, 4, 2))


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


@pytest.mark.parametrize(("element", "facet"), [("quad8", "line2"), ("hex20", "quad4")])
def test_linear_facets_of_quadratic_cells(element, facet):
    """Converters may write solids with mid-side nodes but facets without; a group by position is the remedy."""
    whole = bar(element).with_facet_group("ROOF", at(2.0))
    (block,) = whole.cells_of("ROOF").values()
    linear = fc.Mesh(whole.points, whole.solids).with_facets(
        {"ROOF": {facet: block[:, : elements.get(facet).n_corners]}}
    )
    said = f"facets of 'ROOF' are of type {facet}, but those of the cells there are of type .* Mesh.with_facet_group"
    model = fc.Model(linear, "3d" if linear.dim == 3 else "plane_strain")
    refused(fc.ModelError, said, model.add_pressure, "ROOF", 1.0)
    sphere = fc.obstacles.Sphere((0.0,) * linear.dim, 1.0)
    refused(fc.ContactError, said, model.add_obstacle, "ball", secondary="ROOF", obstacle=sphere)
    model = fc.Model(linear.with_facet_group("ROOF", at(2.0)), model.kinematics)
    model.add_pressure("ROOF", 1.0)
    assert model.load_vector(model.loads[0])[:, 1].sum() == pytest.approx(-1.0)


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
        (lambda m: m.with_facet_group("A", at(0.3)), "group 'A' would be empty: its function selects 0 points"),
        (lambda m: m.with_facet_group("A", at(2.0), between=True), "no facet between two cells has all"),
        (lambda m: m.with_facet_group("A", lambda x: x[:, 0]), "returned float64 of shape .15,.: it must return True"),
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
    refused(fc.MeshError, said, call, bar("quad4"))


def a_body(element):
    """Return a mesh with groups of solids, facets and points."""
    return body_of(element).with_groups(points={"CORNER": [0], "A name, with signs/": [1, 2]})


@pytest.mark.parametrize("element", ["tri3", "quad8", "quad9", *SOLIDS])
def test_meshio_hands_over_what_it_read(element, tmp_path):
    mesh = a_body(element)
    fc.write_mesh(tmp_path / "a.vtu", mesh)
    assert_same_mesh(fc.from_meshio(meshio.read(tmp_path / "a.vtu")), mesh)


def test_meshio_hands_over_sets_and_tags_made_in_memory():
    points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
    cells = [("quad", [[3, 2, 1, 0]]), ("line", [[0, 1]]), ("vertex", [[2]])]
    tags = [np.array([1]), np.array([2]), np.array([3])]
    made = meshio.Mesh(
        points, cells, cell_data={"gmsh:physical": tags}, field_data={"BODY": [1, 2], "LOW": [2, 1], "TIP": [3, 0]},
        cell_sets={"SET": [[0], [], []]}, point_sets={"SIDE": [0, 3]},
    )  # fmt: skip
    mesh = fc.from_meshio(made)
    assert mesh.dim == 2
    assert mesh.cells["quad4"].tolist() == [[3, 0, 1, 2]]  # turned, since it was clockwise
    assert [mesh.points_of(name).tolist() for name in ("BODY", "LOW", "TIP", "SET", "SIDE")] == [
        [0, 1, 2, 3], [0, 1], [2], [0, 1, 2, 3], [0, 3]
    ]  # fmt: skip


@pytest.mark.parametrize("element", ["tri6", "quad4", *SOLIDS])
def test_pyvista_hands_over_a_file_of_ours(element, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    mesh = a_body(element)
    fc.write_mesh(tmp_path / "a.vtu", mesh)
    assert_same_mesh(fc.from_pyvista(pyvista.read(tmp_path / "a.vtu")), mesh)


def test_masks_and_groups_of_results_become_groups():
    pyvista = pytest.importorskip("pyvista")
    plane = pyvista.Plane(i_resolution=4, j_resolution=2)
    plane.cell_data["LEFT"] = plane.cell_centers().points[:, 0] < 0
    plane.point_data["group_TOP"] = (plane.points[:, 1] > 0.49).astype(np.int8)
    plane.point_data["group_number"] = np.arange(plane.n_points)  # no group, but a field
    mesh = fc.from_pyvista(plane)
    assert mesh.dim == 2
    assert len(mesh.cells_of("LEFT")["quad4"]) == 4
    assert (mesh.points[mesh.points_of("TOP"), 1] == 0.5).all()
    assert mesh.group_names == ["LEFT", "TOP"]


def test_cells_that_nobody_knows_are_named():
    pyvista = pytest.importorskip("pyvista")
    with pytest.raises(fc.MeshError, match="1 of VTK's type 7"):
        fc.from_pyvista(
            pyvista.PolyData(
                np.array([[0, 0, 0], [1, 0, 0], [2, 1, 0], [1, 2, 0], [0, 1, 0.0]]), faces=[5, 0, 1, 2, 3, 4]
            )
        )
    with pytest.raises(fc.MeshError, match=r"meshio's mesh: .*kind polygon"):
        fc.from_meshio(meshio.Mesh(np.eye(3), [("polygon", [[0, 1, 2]])]))
    refused(fc.MeshError, "no cells", fc.from_meshio, meshio.Mesh(np.eye(3), []))


def test_without_gmsh_the_message_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "gmsh", None)
    refused(fc.FileError, r"gmsh cannot be imported .*: pip install gmsh", fc.from_gmsh)


def two_boxes(gmsh):
    """Make a box on a box in gmsh, that do not share nodes; return their tags, and those of the faces between them."""
    low, up = (gmsh.model.occ.addBox(0, 0, z, 1, 1, 1) for z in (0, 1))
    gmsh.model.occ.synchronize()
    faces = [tag for _, tag in gmsh.model.getEntities(2) if abs(gmsh.model.occ.getCenterOfMass(2, tag)[2] - 1) < 1e-6]
    gmsh.model.mesh.setSize(gmsh.model.getEntities(0), 0.5)
    return low, up, faces


@pytest.mark.parametrize("order", [1, 2])
def test_gmsh_hands_over_physical_groups(gmsh, order):
    low, up, faces = two_boxes(gmsh)
    groups = [("LOW", 3, [low]), ("UP", 3, [up]), ("ALL", 3, [low, up])]
    for name, dim, tags in [*groups, ("FACE", 2, faces[:1]), ("SAME", 2, faces[:1]), ("TIP", 0, [1])]:
        gmsh.model.addPhysicalGroup(dim, tags, name=name)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(order)
    gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)
    mesh = fc.from_gmsh()
    assert gmsh.option.getNumber("Mesh.MshFileVersion") == 2.2  # the user's own settings stay
    solid, facet = ("tet4", "tri3") if order == 1 else ("tet10", "tri6")
    count = {name: len(mesh.cells_of(name)[solid]) for name in ("LOW", "UP", "ALL")}
    assert count["LOW"] + count["UP"] == count["ALL"] == len(mesh.cells[solid])
    assert mesh.cell_groups["FACE"].tolist() == mesh.cell_groups["SAME"].tolist()
    assert (mesh.points[mesh.cells_of("FACE")[facet]][..., 2] == 1.0).all()
    assert len(mesh.points_of("TIP")) == 1
    assert "inside out" not in str(fc.quality(mesh))


def test_gmsh_without_groups_and_with_a_body_that_has_none(gmsh):
    low, _, _ = two_boxes(gmsh)
    refused(fc.MeshError, r"has no mesh: call gmsh\.model", fc.from_gmsh)
    gmsh.model.mesh.generate(3)
    whole = fc.from_gmsh()
    assert not whole.group_names
    gmsh.model.addPhysicalGroup(3, [low], name="LOW")
    with pytest.warns(fc.FastcontactWarning, match=r"cells belong to no physical group .*\(those of the volumes 2\)"):
        part = fc.from_gmsh()
    assert 0 < len(part.cells["tet4"]) < len(whole.cells["tet4"])


def test_gmsh_without_a_model(gmsh):
    gmsh.finalize()
    try:
        refused(fc.MeshError, r"call gmsh.initialize\(\)", fc.from_gmsh)
    finally:
        gmsh.initialize(interruptible=False)
    refused(fc.MeshError, "has no mesh", fc.from_gmsh)


@pytest.mark.parametrize("element", ["tri3", "quad8", *SOLIDS])
def test_facets_by_their_place_are_those_of_the_generator(element):
    mesh = a_body(element)
    bare = mesh.replace(cells=mesh.solids, cell_groups={}, point_groups={})
    axis = "XYZ"[mesh.dim - 1]
    names = ("YMAX", "YMIN") if mesh.dim == 2 else (f"{axis}MAX", f"{axis}MIN")
    names = names if names[0] in mesh.cell_groups else ("TOP", "BOTTOM")
    last = mesh.points[:, -1]
    for name, place in zip(names, (last.max(), last.min()), strict=True):
        bare = bare.with_facet_group(name, lambda x, place=place: np.abs(x[:, -1] - place) < 1e-9)
        again = mesh.with_facet_group("AGAIN", lambda x, place=place: np.abs(x[:, -1] - place) < 1e-9)
        np.testing.assert_array_equal(again.cell_groups["AGAIN"], mesh.cell_groups[name])  # no facet twice
        expected = {kind: np.sort(np.sort(block), axis=0) for kind, block in mesh.cells_of(name).items()}
        found = {kind: np.sort(np.sort(block), axis=0) for kind, block in bare.cells_of(name).items()}
        assert sorted(found) == sorted(expected)
        for kind, block in expected.items():
            np.testing.assert_array_equal(found[kind], block)


def test_other_groups_keep_their_cells():
    mesh = fc.generate.half_spheres("tri3")
    lines_first = mesh.replace(cells={k: mesh.cells[k] for k in ("line2", "tri3")}, cell_groups={}).with_groups(
        cells={"SOLIDS": len(mesh.cells["line2"]) + np.arange(len(mesh.cells["tri3"]))}
    )
    bare = lines_first.replace(cells={**lines_first.cells, "line2": lines_first.cells["line2"][:3]}, cell_groups={})
    bare = bare.with_groups(cells={"SOLIDS": 3 + np.arange(len(mesh.cells["tri3"])), "LINES": [0, 2]})
    more = bare.with_facet_group("ALL", lambda x: np.ones(len(x), bool))
    assert len(more.cells_of("ALL")["line2"]) == len(outer_facets(mesh)["line2"])
    np.testing.assert_array_equal(more.cells_of("SOLIDS")["tri3"], mesh.cells["tri3"])
    np.testing.assert_array_equal(more.cells_of("LINES")["line2"], bare.cells["line2"][[0, 2]])


def test_a_group_of_points_is_not_shadowed():
    mesh = a_body("quad4")
    with pytest.raises(fc.MeshError, match="'CORNER' is already a group of points"):
        mesh.with_facet_group("CORNER", lambda x: x[:, 0] < 1)
