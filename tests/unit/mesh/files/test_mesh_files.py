"""Mesh files of every format: orientation, round trips of groups, losses through meshio, messages."""

import logging
import os
import stat
import sys
import threading

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from models import assert_same_mesh, members, row_of
from pairwise import first_of
from refusals import refused

import fastcontact as fc
from fastcontact.errors import FastcontactWarning, FileError, MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.files.mesh_files import read_mesh, read_mesh_report, write_mesh

FLAT = [name for name, element in elements.ELEMENTS.items() if element.dim <= 2]
SOLIDS = [name for name in elements.ELEMENTS if name not in FLAT]


@pytest.fixture(autouse=True)
def reading(request):
    """Let meshio read in this process, but where a test listens to what the one that it starts says."""
    if "capfd" not in request.fixturenames:
        request.getfixturevalue("meshio_here")


def patch():
    """Four triangles on a line, with a group for each body, the line, its parts and two points."""
    points = [[0, 0], [1, 0], [2, 0], [0.5, 1], [1.5, 1], [9, 9]]
    return fc.Mesh(
        points,
        {"tri3": [[0, 1, 3], [1, 2, 4], [1, 4, 3]], "line2": [[0, 1], [1, 2]]},
        {"left": [0, 2], "right": [1], "bottom": [3, 4]},
        {"corner": [0], "top": [3, 4]},
    )


# Orientation ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [name for name in FLAT if elements.get(name).dim == 2])
def test_clockwise_cells_are_turned_and_counted(tmp_path, name, caplog):
    mesh = row_of([name])
    block = mesh.cells[name].copy()
    mirrored = mesh.points * [1.0, -1.0]
    block[1] += 2 * block.shape[1]  # the second cell stands in the mirror
    both = fc.Mesh(np.concatenate([mesh.points, mirrored]), {name: block}, {"second": [1]})
    write_mesh(tmp_path / "turned.med", both)
    with caplog.at_level(logging.INFO, logger="fastcontact"):
        found, report = read_mesh_report(tmp_path / "turned.med")
    assert report.n_turned == 1
    assert "1 cells turned" in caplog.text
    assert (fc.topology.corner_measures(found, name) > 0).all()
    assert set(found.cells[name][1]) == set(block[1])
    np.testing.assert_array_equal(found.cells[name][0], block[0])
    assert read_mesh_report(tmp_path / "turned.med", orient=False)[1].n_turned == 0
    assert_same_mesh(read_mesh(tmp_path / "turned.med", orient=False), both)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(turned=st.lists(st.booleans(), min_size=6, max_size=6), suffix=st.sampled_from(["med", "vtu", "inp"]))
def test_number_turned_is_the_number_that_was_clockwise(tmp_path, turned, suffix):
    mesh = row_of(["tri3", "quad4", "tri6"], groups=False)
    clockwise = iter(turned)
    cells = {
        name: [row[::-1] if name != "tri6" and next(clockwise) else row for row in block.tolist()]
        for name, block in mesh.cells.items()
    }
    path = tmp_path / f"any.{suffix}"
    write_mesh(path, mesh.replace(cells=cells))
    found, report = read_mesh_report(path)
    assert report.n_turned == sum(turned[:4])
    assert all((fc.topology.corner_measures(found, name) > 0).all() for name in found.cells)


# There and back -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("suffix", "names"), [*((suffix, FLAT) for suffix in ("med", "mmed", "MED", "vtu", "vtk", "inp")), ("med", SOLIDS)]
)
def test_formats_that_keep_everything(tmp_path, suffix, names):
    mesh = row_of(sorted(names, key=lambda name: elements.get(name).med))
    write_mesh(tmp_path / f"mesh.{suffix}", mesh)
    found, report = read_mesh_report(tmp_path / f"mesh.{suffix}")
    assert_same_mesh(found, mesh)
    assert (report.n_turned, dict(report.dropped)) == (0, {})


@pytest.mark.parametrize("names", [["tri3", "quad4", "line2"], ["tri6"], ["quad9"]])
def test_xdmf_keeps_everything_of_what_it_takes(tmp_path, names):
    write_mesh(tmp_path / "mesh.xdmf", row_of(names))
    assert_same_mesh(read_mesh(tmp_path / "mesh.xdmf"), row_of(names))
    assert [entry.name for entry in tmp_path.iterdir()] == ["mesh.xdmf"]


@pytest.mark.parametrize("suffix", ["vtu", "vtk", "med"])
def test_group_names_with_any_sign(tmp_path, suffix):
    mesh = patch().with_groups(cells={'a <b> & "c" /é%20': [0]}, points={"p q": [1]})
    write_mesh(tmp_path / f"names.{suffix}", mesh)
    assert members(read_mesh(tmp_path / f"names.{suffix}")) == members(mesh)


def test_gmsh_keeps_groups_that_do_not_overlap(tmp_path):
    write_mesh(tmp_path / "patch.msh", patch())
    found, report = read_mesh_report(tmp_path / "patch.msh")
    assert_same_mesh(found, patch())
    assert (report.format, dict(report.dropped)) == ("gmsh", {"vertex": 3})


@pytest.mark.parametrize("name", FLAT)
def test_gmsh_keeps_every_element(tmp_path, name):
    write_mesh(tmp_path / "one.msh", row_of([name], groups=False))
    assert_same_mesh(read_mesh(tmp_path / "one.msh"), row_of([name], groups=False))


def test_gmsh_keeps_the_smaller_of_groups_that_overlap(tmp_path):
    mesh = patch().with_groups(cells={"all": [0, 1, 2, 3, 4]}, points={"left": [0]})
    with pytest.warns(FastcontactWarning) as caught:
        write_mesh(tmp_path / "patch.msh", mesh)
    said = " ".join(str(entry.message) for entry in caught)
    assert "5 memberships of the groups all are left out" in said
    assert "1 groups of points have the name of a group of cells (left)" in said
    found = read_mesh(tmp_path / "patch.msh")
    assert members(found) == {**members(patch()), "all": set()}
    assert set(found.point_groups) == {"corner", "top"}


# Groups of other programs ---------------------------------------------------------------------------

GMSH_2 = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
4
0 7 "corner"
1 1 "bottom"
2 1 "plate"
2 2 "half"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
$EndNodes
$Elements
7
1 15 2 7 1 3
2 1 2 1 1 1 2
3 2 2 1 1 1 2 3
4 2 2 1 1 1 3 4
5 2 2 2 1 2 1 3
6 1 2 5 2 2 3
7 1 2 0 3 3 4
$EndElements
"""

GMSH_4 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
3
1 4 "bottom"
2 5 "plate"
2 6 "again"
$EndPhysicalNames
$Entities
0 1 1 0
1 0 0 0 1 0 0 1 4 0
1 0 0 0 1 1 0 2 5 6 0
$EndEntities
$Nodes
1 3 1 3
2 1 0 3
1
2
3
0 0 0
1 0 0
0 1 0
$EndNodes
$Elements
2 2 1 2
1 1 1 1
1 1 2
2 1 2 1
2 1 2 3
$EndElements
"""


def test_gmsh_2_names_tags_and_repeated_cells(tmp_path):
    (tmp_path / "plate.msh").write_text(GMSH_2)
    mesh, report = read_mesh_report(tmp_path / "plate.msh")
    assert mesh.cells["tri3"].tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.cells["line2"].tolist() == [[0, 1], [1, 2], [2, 3]]
    assert members(mesh) == {
        "bottom": {("line2", 0)}, "plate": {("tri3", 0), ("tri3", 1)}, "half": {("tri3", 0)},
        "curve_5": {("line2", 1)},
    }  # fmt: skip
    assert {name: points.tolist() for name, points in mesh.point_groups.items()} == {"corner": [2]}
    assert (mesh.dim, report.n_turned, dict(report.dropped)) == (2, 0, {"vertex": 1, "duplicate": 1})


def test_gmsh_4_cells_in_several_groups(tmp_path):
    (tmp_path / "plate.msh").write_text(GMSH_4)
    mesh = read_mesh(tmp_path / "plate.msh")
    assert members(mesh) == {"bottom": {("line2", 0)}, "plate": {("tri3", 0)}, "again": {("tri3", 0)}}
    assert mesh.points.tolist() == [[0, 0], [1, 0], [0, 1]]


def test_medit_references(tmp_path):
    (tmp_path / "plate.mesh").write_text(
        "MeshVersionFormatted 2\nDimension 2\nVertices\n4\n0 0 0\n1 0 3\n1 1 0\n0 1 0\n"
        "Triangles\n2\n1 2 3 8\n1 3 4 9\nEdges\n1\n1 2 8\nEnd\n"
    )
    mesh = read_mesh(tmp_path / "plate.mesh")
    assert members(mesh) == {"surface_8": {("tri3", 0)}, "surface_9": {("tri3", 1)}, "curve_8": {("line2", 0)}}
    assert {name: points.tolist() for name, points in mesh.point_groups.items()} == {"point_3": [1]}


ABAQUS = """*HEADING
*NODE
10, 0.0, 0.0
20, 1.0, 0.0
30, 1.0, 1.0
40, 0.0, 1.0
50, 2.0, 0.5
*ELEMENT, TYPE=CPS4, ELSET=square
1, 10, 20, 30, 40
*ELEMENT, TYPE=CPS3
2, 20, 50, 30
*NSET, NSET=tip
50
*ELSET, ELSET=all, GENERATE
1, 2, 1
"""


def test_abaqus_sets(tmp_path):
    (tmp_path / "plate.inp").write_text(ABAQUS)
    mesh = read_mesh(tmp_path / "plate.inp")
    assert members(mesh) == {"square": {("quad4", 0)}, "all": {("quad4", 0), ("tri3", 0)}}
    assert mesh.point_groups["tip"].tolist() == [4]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("CPS3\n", "CPS3, ELSET=SQUARE\n", "defines the ELSET 'square' in several places"),
        (", ELSET=square\n", "\n", None),
        ("*HEADING", "*NODE\n1, 0.0, 0.0\n*HEADING", r"has 2 \*NODE sections"),
        ("*NSET, NSET=tip", "*NSET, NSET=tip\n10\n*NSET, NSET=tip", "defines the NSET 'tip'"),
    ],
)
def test_abaqus_files_that_meshio_reads_wrongly(tmp_path, old, new, message):
    (tmp_path / "plate.inp").write_text(ABAQUS.replace(old, new))
    if message is None:
        assert "square" not in read_mesh(tmp_path / "plate.inp").cell_groups
        return
    refused(FileError, message, read_mesh, tmp_path / "plate.inp")


def test_abaqus_set_of_a_later_section_only(tmp_path):
    (tmp_path / "plate.inp").write_text(ABAQUS.replace(", ELSET=square", "").replace("CPS3", "CPS3, ELSET=triangle"))
    refused(FileError, r"has an \*ELEMENT section with ELSET after one without", read_mesh, tmp_path / "plate.inp")


def test_abaqus_names_with_blanks_are_refused(tmp_path):
    refused(FileError, "group name 'a,b'", write_mesh, tmp_path / "names.inp", patch().with_groups(cells={"a,b": [0]}))


# Space ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("height", [0.0, 7.5])
def test_flat_mesh_becomes_a_plane_one_and_keeps_unused_points(tmp_path, height):
    mesh = patch()
    points = np.pad(mesh.points, [(0, 0), (0, 1)], constant_values=height)
    write_mesh(tmp_path / "flat.vtu", mesh.replace(points=np.column_stack([mesh.points, points[:, 2]])))
    assert read_mesh(tmp_path / "flat.vtu").points.tolist() == mesh.points.tolist()


@pytest.mark.parametrize("suffix", ["med", "vtu", "msh", "inp"])
def test_shell_stays_in_space(tmp_path, suffix):
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 1e-6], [0.0, 1.0, 0.0]])
    mesh = fc.Mesh(points, {"quad4": [[0, 1, 2, 3]]}, {"shell": [0]})
    write_mesh(tmp_path / f"shell.{suffix}", mesh)
    assert_same_mesh(read_mesh(tmp_path / f"shell.{suffix}"), mesh)


# Errors and losses ----------------------------------------------------------------------------------


def test_missing_file_folder_and_suffix(tmp_path):
    refused(FileError, "is a folder", read_mesh, tmp_path)
    (tmp_path / "mesh.vtuu").write_text("")
    refused(FileError, r"unknown mesh file suffix '\.vtuu': did you mean '\.vtu'", read_mesh, tmp_path / "mesh.vtuu")
    refused(FileError, "mesh file suffix ''", write_mesh, tmp_path / "mesh", patch())
    refused(FileError, r"nowhere' does not exist", write_mesh, tmp_path / "nowhere" / "mesh.vtu", patch())


def test_mesh_name_is_for_med_only(tmp_path):
    write_mesh(tmp_path / "mesh.vtu", patch())
    refused(FileError, "omit mesh_name='upper'", read_mesh, tmp_path / "mesh.vtu", mesh_name="upper")
    write_mesh(tmp_path / "mesh.med", patch())
    assert read_mesh_report(tmp_path / "mesh.med", mesh_name="mesh")[1].mesh_name == "mesh"


UNREADABLE = [
    ("bad.msh", "$MeshFormat\nnonsense\n"),
    ("bad.msh", "(0 nonsense"),
    ("bad.vtu", "<VTKFile"),
    ("bad.inp", "*ELEMENT, TYPE=CPS4\n1, 1, 2, 3, 4\n"),
    ("bad.inp", "*NODE\n1, 0, 0\n*ELEMENT, TYPE=CAX4\n1, 1, 1, 1, 1\n"),
    ("bad.mesh", "nonsense 1\n"),
    ("bad.su2", ""),
]


@pytest.mark.parametrize(("name", "text"), first_of(4, UNREADABLE))
def test_unreadable_files_are_named_without_printing_or_exiting(tmp_path, capfd, name, text):
    (tmp_path / name).write_text(text)
    refused((FileError, MeshError), name.replace(".", r"\."), read_mesh, tmp_path / name)
    assert capfd.readouterr() == ("", "")


def test_reason_of_meshio_is_passed_on(tmp_path):
    (tmp_path / "axisymmetric.inp").write_text(ABAQUS.replace("CPS4", "CAX4"))
    with pytest.raises(FileError, match=r"Element type not available: CAX4.*convert it to \.med"):
        read_mesh(tmp_path / "axisymmetric.inp")


def test_unknown_cells_are_named_and_counted(tmp_path):
    import meshio

    line = meshio.Mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]], [("line4", [[0, 3, 1, 2]] * 2)])
    meshio.write(tmp_path / "cubic.msh", line, file_format="gmsh22")
    with pytest.raises(MeshError, match=r"cubic\.msh': it has 2 cells of kind line4.*use only.*triangle6"):
        read_mesh(tmp_path / "cubic.msh")


def test_file_without_cells(tmp_path):
    import meshio

    meshio.write(tmp_path / "points.vtu", meshio.Mesh([[0, 0, 0], [1, 0, 0]], [("vertex", [[0], [1]])]))
    refused(MeshError, r"points\.vtu': the mesh has no cells", read_mesh, tmp_path / "points.vtu")


@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")  # meshio's reader of STL
@pytest.mark.parametrize("suffix", ["mesh", "su2", "stl", "xdmf", "svg", "node", "post"])
def test_formats_that_cannot_hold_the_cells_leave_the_old_file(tmp_path, suffix, capfd):
    path = tmp_path / f"mesh.{suffix}"
    path.write_text("precious")
    refused(FileError, r"write \.med, \.vtu or \.msh instead", write_mesh, path, row_of(FLAT, groups=False))
    assert path.read_text() == "precious"
    assert os.listdir(tmp_path) == [path.name]
    assert capfd.readouterr() == ("", "")


def test_groups_that_a_format_cannot_hold_are_counted(tmp_path):
    mesh = patch().replace(cells={"tri3": patch().cells["tri3"]}, cell_groups={"left": [0]})
    with pytest.warns(FastcontactWarning, match="medit files have no named groups: 3 groups are left out"):
        write_mesh(tmp_path / "mesh.mesh", mesh)
    assert read_mesh(tmp_path / "mesh.mesh").cells["tri3"].tolist() == mesh.cells["tri3"].tolist()


def test_written_file_has_ordinary_permissions(tmp_path):
    write_mesh(tmp_path / "mesh.med", patch())
    (tmp_path / "plain").touch()
    modes = [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("mesh.med", "plain")]
    assert modes[0] == modes[1]


def test_threads_get_their_streams_back(tmp_path, capfd):
    write_mesh(tmp_path / "mesh.vtu", patch())
    streams = sys.stdout, sys.stderr
    threads = [threading.Thread(target=read_mesh, args=(tmp_path / "mesh.vtu",)) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (sys.stdout, sys.stderr) == streams
    assert capfd.readouterr() == ("", "")


def test_groups_survive_a_round_trip_through_pyvista(tmp_path):
    """Also where another program reads the file and writes it again."""
    pyvista = pytest.importorskip("pyvista", reason="needs PyVista: pip install 'fastcontact[view]'")
    mesh = fc.generate.half_spheres(size=10.0)
    write_mesh(tmp_path / "ours.vtu", mesh)
    pyvista.read(tmp_path / "ours.vtu").save(tmp_path / "theirs.vtu")
    assert_same_mesh(read_mesh(tmp_path / "theirs.vtu"), mesh)
