"""Node orders of solids in files of other programs: MED, Gmsh, Abaqus, VTK, each compared with its own description."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from models import elastic_model, row_of

import fastcontact as fc
from fastcontact.mesh import elements
from fastcontact.mesh.files.med import write_med_mesh
from fastcontact.mesh.files.mesh_files import read_mesh, read_mesh_report, write_mesh

pytestmark = pytest.mark.usefixtures("meshio_here")

CASES = Path(__file__).resolve().parents[5] / "shared" / "cases"
SOLIDS = {name: element for name, element in elements.ELEMENTS.items() if element.dim == 3}


def volumes(names):
    return {name: fc.topology.corner_measures(row_of([name]), name)[0] for name in names}


def outward_with_mid_nodes(points, faces):
    """Check faces given as (corners, mid nodes, centre or none): outward, mid nodes and centre in their middle."""
    inside = points.mean(axis=0)
    for corners, middles, centre in faces:
        x = points[corners]
        assert np.cross(x[1] - x[0], x[2] - x[0]) @ (x.mean(axis=0) - inside) > 0
        if len(middles):
            np.testing.assert_allclose(points[middles], (x + np.roll(x, -1, axis=0)) / 2, atol=1e-14)
        if len(centre):
            np.testing.assert_allclose(points[centre[0]], x.mean(axis=0), atol=1e-14)


def parts_of(face):
    """Split a face's nodes: 3 or 6 are a triangle, 4, 8 or 9 a quadrangle."""
    n = 3 if len(face) in (3, 6) else 4
    return face[:n], face[n : 2 * n], face[2 * n :]


# MED -----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SOLIDS)
def test_medcoupling_sees_our_solids_as_they_are(tmp_path, name):
    mc = pytest.importorskip("medcoupling", reason="medcoupling is not installed")
    mesh, path = row_of([name]), tmp_path / "solids.med"
    write_med_mesh(path, mesh)
    found = mc.MEDFileUMesh(str(path))[0]
    faces = found.buildDescendingConnectivity()[0]
    assert faces.getNumberOfCells() == 2 * len(SOLIDS[name].facets)
    # Faces come cell by cell, as our two cells share none.
    ids = [list(faces.getNodeIdsOfCell(i)) for i in range(faces.getNumberOfCells())]
    for cell in mesh.cells[name]:
        own = [[cell.tolist().index(p) for p in face] for face in ids if set(face) <= set(cell.tolist())]
        assert len(own) == len(SOLIDS[name].facets)
        outward_with_mid_nodes(mesh.points[cell], [parts_of(face) for face in own])
    # What medcoupling calls the volume of linear cells.
    found.convertQuadraticCellsToLinear()
    measured = found.getMeasureField(False).getArray().toNumPyArray()
    np.testing.assert_allclose(measured, fc.topology.corner_measures(mesh, name), rtol=1e-12)
    assert (measured > 0).all()


def test_solids_of_medcoupling_are_read_the_right_way_round(tmp_path):
    mc = pytest.importorskip("medcoupling", reason="medcoupling is not installed")
    x = mc.DataArrayDouble([0.0, 1.0, 2.5])
    grid = mc.MEDCouplingCMesh("grid")
    grid.setCoords(x, x, x)
    cubes = grid.buildUnstructured()
    cubes.setName("cubes")
    assert (cubes.getMeasureField(False).getArray().toNumPyArray() > 0).all()
    mc.WriteUMesh(str(tmp_path / "cubes.med"), cubes, True)
    mesh, report = read_mesh_report(tmp_path / "cubes.med")
    assert (list(mesh.cells), report.n_turned) == (["hex8"], 0)
    assert fc.topology.corner_measures(mesh, "hex8").sum() == pytest.approx(2.5**3)
    cubes.simplexize(mc.PLANAR_FACE_6)
    cubes.findAndCorrectBadOriented3DCells()
    mc.WriteUMesh(str(tmp_path / "tetrahedra.med"), cubes, True)
    mesh, report = read_mesh_report(tmp_path / "tetrahedra.med")
    assert (list(mesh.cells), report.n_turned) == (["tet4"], 0)
    assert fc.topology.corner_measures(mesh, "tet4").sum() == pytest.approx(2.5**3)


@pytest.mark.skipif(not CASES.is_dir(), reason="code_aster's cases are not beside the checkout")
@pytest.mark.parametrize("name", ["ssnp121d", "ssnp167e", "ssnp170k", "ssnv503f"])
def test_solids_of_code_aster_make_a_model(name):
    mesh, report = read_mesh_report(CASES / f"{name}.med")
    assert mesh.dim == 3
    # One of the files has its solids the other way round than MED wants them.
    assert report.n_turned == (129 if name == "ssnv503f" else 0)
    specification = next(path for path in CASES.glob("*.json") if f'"{name}.med"' in path.read_text())
    (facts,) = json.loads(specification.read_text())["meshes"]
    box_volume = np.prod(np.ptp(facts["bounding_box"], axis=0))
    model = fc.Model(mesh, "3d")
    assert 0.05 * box_volume < fc.quality(model.mesh).measure <= box_volume * (1 + 1e-9)


# Gmsh and Abaqus -----------------------------------------------------------------------------------------------------

# Mid nodes and centres by the corners between which they lie, in the order of the reference manuals.
GMSH = {
    "tet10": (11, ["01", "12", "20", "30", "32", "31"]),
    "hex20": (17, ["01", "03", "04", "12", "15", "23", "26", "37", "45", "47", "56", "67"]),
    "hex27": (12, ["01", "03", "04", "12", "15", "23", "26", "37", "45", "47", "56", "67",
                   "0321", "0154", "0473", "1265", "2376", "4567", "01234567"]),
    "wedge15": (18, ["01", "02", "03", "12", "14", "25", "34", "35", "45"]),
    "wedge18": (13, ["01", "02", "03", "12", "14", "25", "34", "35", "45", "0143", "0352", "1254"]),
    "pyramid13": (19, ["01", "03", "04", "12", "14", "23", "24", "34"]),
    "tet4": (4, []), "hex8": (5, []), "wedge6": (6, []), "pyramid5": (7, []),
}  # fmt: skip
ABAQUS = {
    "tet4": ("C3D4", []),
    "tet10": ("C3D10", ["01", "12", "20", "03", "13", "23"]),
    "hex8": ("C3D8", []),
    "hex20": ("C3D20", ["01", "12", "23", "30", "45", "56", "67", "74", "04", "15", "26", "37"]),
    "wedge6": ("C3D6", []),
    "wedge15": ("C3D15", ["01", "12", "20", "34", "45", "53", "03", "14", "25"]),
}


def nodes_by_corners(name, between):
    corners = SOLIDS[name].nodes[: SOLIDS[name].n_corners]
    return np.vstack([corners, *(corners[[int(c) for c in word]].mean(axis=0) for word in between)])


def assert_reference_cell(mesh, name):
    np.testing.assert_allclose(mesh.points[mesh.cells[name][0]], SOLIDS[name].nodes, atol=1e-15)


@pytest.mark.parametrize("name", GMSH)
def test_gmsh_nodes_get_their_places(tmp_path, name):
    code, between = GMSH[name]
    points = nodes_by_corners(name, between)
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(points))]
    lines += [f"{i} {x} {y} {z}" for i, (x, y, z) in enumerate(points.tolist(), 1)]
    numbers = " ".join(map(str, range(1, len(points) + 1)))
    lines += ["$EndNodes", "$Elements", "1", f"1 {code} 2 1 1 {numbers}", "$EndElements", ""]
    (tmp_path / "one.msh").write_text("\n".join(lines))
    mesh, report = read_mesh_report(tmp_path / "one.msh")
    assert report.n_turned == 0
    assert_reference_cell(mesh, name)
    write_mesh(tmp_path / "again.msh", mesh)
    assert read_mesh(tmp_path / "again.msh").cells[name].tolist() == mesh.cells[name].tolist()


def test_gmsh_table_is_complete():
    assert set(GMSH) == set(SOLIDS)


@pytest.mark.parametrize("name", ABAQUS)
def test_abaqus_nodes_get_their_places(tmp_path, name):
    kind, between = ABAQUS[name]
    points = nodes_by_corners(name, between)
    lines = ["*NODE", *(f"{i}, {x}, {y}, {z}" for i, (x, y, z) in enumerate(points.tolist(), 1))]
    numbers = list(map(str, range(1, len(points) + 1)))
    lines += [f"*ELEMENT, TYPE={kind}, ELSET=ALL", ", ".join(["1", *numbers[:15]]) + ("," if numbers[15:] else "")]
    lines += [", ".join(numbers[15:])] if numbers[15:] else []
    (tmp_path / "one.inp").write_text("\n".join(lines) + "\n")
    mesh, report = read_mesh_report(tmp_path / "one.inp")
    assert report.n_turned == 0
    assert_reference_cell(mesh, name)


# VTK -----------------------------------------------------------------------------------------------------------------


def assert_vtk_cells(grid, mesh, vtk):
    """VTK's own faces look outward, mid nodes stand in their middle, and volumes are ours."""
    size = vtk.vtkCellSizeFilter()
    size.SetInputData(grid)
    size.Update()
    measured = size.GetOutput().GetCellData().GetArray("Volume")
    expected = np.concatenate([fc.topology.corner_measures(mesh, name) for name in mesh.solids])
    assert grid.GetNumberOfCells() == len(expected)
    for number, volume in enumerate(expected):
        cell = grid.GetCell(number)
        ids = [cell.GetPointId(i) for i in range(cell.GetNumberOfPoints())]
        points = np.array([grid.GetPoint(i) for i in ids])
        faces = [cell.GetFace(i) for i in range(cell.GetNumberOfFaces())]
        local = [[ids.index(face.GetPointId(i)) for i in range(face.GetNumberOfPoints())] for face in faces]
        outward_with_mid_nodes(points, [parts_of(face) for face in local])
        assert measured.GetValue(number) == pytest.approx(volume, rel=1e-6)


@pytest.mark.parametrize(("name", "suffix"), list(itertools.product(SOLIDS, ["vtu", "vtk"])))
def test_vtk_sees_our_solids_as_they_are(tmp_path, name, suffix):
    vtk = pytest.importorskip("vtk", reason="vtk is not installed")
    mesh, path = row_of([name]), tmp_path / f"solids.{suffix}"
    write_mesh(path, mesh)
    reader = vtk.vtkXMLUnstructuredGridReader() if suffix == "vtu" else vtk.vtkUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    assert_vtk_cells(reader.GetOutput(), mesh, vtk)
    found, report = read_mesh_report(path)
    assert report.n_turned == 0
    assert found.cells[name].tolist() == mesh.cells[name].tolist()


@pytest.mark.parametrize("element", SOLIDS)
def test_vtk_reads_results_of_a_solid(tmp_path, element):
    vtk = pytest.importorskip("vtk", reason="vtk is not installed")
    model = elastic_model(fc.generate.box((2.0, 1.0, 1.0), (2, 1, 1), element), "3d", E=200.0, XMIN="xyz")
    model.prescribe("XMAX", x=1e-3, y=2e-3, z=-1e-3)
    path = tmp_path / "solid.vtkhdf"
    with fc.ResultWriter(path, model) as out:
        steps = fc.solve(model, fc.linear_ramp(2), on_step=out.write)
    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.SetStep(1)
    reader.Update()
    grid = reader.GetOutput()
    assert_vtk_cells(grid, model.mesh, vtk)
    stress = grid.GetPointData().GetArray("stress")
    np.testing.assert_array_equal(np.array([stress.GetTuple(i) for i in range(model.mesh.n_points)]), steps[1].stress)
    np.testing.assert_array_equal(fc.open_results(path)[-1].displacement, steps[1].displacement)
    again = fc.open_results(path).mesh
    assert {name: block.tolist() for name, block in again.cells.items()} == {
        name: block.tolist() for name, block in model.mesh.cells.items()
    }
