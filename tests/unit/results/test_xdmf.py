"""XDMF sidecar of a result file: every reference leads to the right numbers, also for VTK's reader."""

from __future__ import annotations

import os
from pathlib import Path
from xml.etree import ElementTree

import h5py
import numpy as np
import pytest
from test_node_order import SOLIDS, row_of
from test_result_files import CELL_DATA, MESH, ResultWriter, expected_point_data, step_result, write

from fastcontact.errors import FileError
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh
from fastcontact.results import layout
from fastcontact.results.step import StepResult
from fastcontact.results.xdmf import write_xdmf

N_STEPS = 3


@pytest.fixture
def sidecar(tmp_path: Path) -> Path:
    """A result file in one folder, its XDMF file in the folder above."""
    (tmp_path / "sub folder").mkdir()
    write(tmp_path / "sub folder" / "result & more.vtkhdf", N_STEPS)
    path = tmp_path / "result.xdmf"
    write_xdmf(tmp_path / "sub folder" / "result & more.vtkhdf", path)
    return path


def values_of(item: ElementTree.Element, folder: Path) -> np.ndarray:
    """Follow a DataItem as the XDMF manual describes it: a data set, or a start, stride and count of one."""
    shape = tuple(map(int, item.get("Dimensions").split()))
    if item.get("ItemType") == "HyperSlab":
        selection, source = item
        start, stride, count = np.array(selection.text.split(), int).reshape(
            tuple(map(int, selection.get("Dimensions").split()))
        )
        part = tuple(slice(a, a + s * c, s) for a, s, c in zip(start, stride, count))
        found = values_of(source, folder)[part]
        assert found.shape == tuple(count)
        return found.reshape(shape)
    file_name, address = item.text.strip().split(":")
    with h5py.File(folder / file_name) as file:
        found = file[address][()]
    kind = {"f": "Float", "i": "Int" if found.dtype.itemsize > 1 else "Char"}[found.dtype.kind]
    assert (item.get("NumberType"), item.get("Precision")) == (kind, str(found.dtype.itemsize))
    assert found.shape == shape
    return found


def unpacked(sequence: np.ndarray) -> list[tuple[int, list[int]]]:
    sizes = {0x24: 6, 0x25: 8, 0x23: 9, 0x5: 4}
    cells, position = [], 0
    while position < len(sequence):
        code = int(sequence[position])
        cells.append((code, sequence[position + 1 : position + 1 + sizes[code]].tolist()))
        position += 1 + sizes[code]
    return cells


def test_every_reference_leads_to_the_right_numbers(sidecar: Path) -> None:
    root = ElementTree.parse(sidecar).getroot()
    steps = root.findall("./Domain/Grid[@CollectionType='Temporal']/Grid")
    assert len(steps) == N_STEPS
    codes = {"quad8": 0x25, "tri6": 0x24, "quad9": 0x23, "quad4": 0x5}
    for number, grid in enumerate(steps):
        step = step_result(number)
        assert float(grid.find("Time").get("Value")) == step.load_factor
        np.testing.assert_array_equal(values_of(grid.find("Geometry/DataItem"), sidecar.parent)[:, :2], MESH.points)
        cells = unpacked(values_of(grid.find("Topology/DataItem"), sidecar.parent))
        assert cells == [(codes[name], row) for name, block in MESH.solids.items() for row in block.tolist()]
        found, on_cells = {}, {}
        for attribute in grid.findall("Attribute"):
            target = found if attribute.get("Center") == "Node" else on_cells
            target[attribute.get("Name")] = values_of(attribute.find("DataItem"), sidecar.parent)
        expected = expected_point_data(step)
        stress = expected.pop("stress")
        for column, component in enumerate(("xx", "yy", "zz", "xy", "yz", "xz")):
            np.testing.assert_array_equal(found[f"stress_{component}"].ravel(), stress[:, column])
        for name, values in expected.items():
            np.testing.assert_array_equal(found[name], values, err_msg=name)
        assert {name: values.tolist() for name, values in on_cells.items()} == CELL_DATA


def test_vtk_reads_every_step_through_it(sidecar: Path) -> None:
    xdmf = pytest.importorskip("vtkmodules.vtkIOXdmf2", reason="this VTK has no XDMF reader")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

    reader = xdmf.vtkXdmfReader()
    reader.SetFileName(str(sidecar))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    np.testing.assert_allclose(times, [(number + 1) / 7 for number in range(N_STEPS)], rtol=1e-15)
    for number, time in enumerate(times):
        reader.GetOutputInformation(0).Set(vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP(), time)
        reader.Update()
        grid, step = reader.GetOutputDataObject(0), step_result(number)
        assert grid.GetNumberOfCells() == 5
        kinds = [elements.get(name).vtk for name, block in MESH.solids.items() for _ in block]
        assert [grid.GetCellType(i) for i in range(5)] == kinds
        expected = expected_point_data(step)
        stress = expected.pop("stress")
        expected |= {f"stress_{name}": stress[:, i] for i, name in enumerate(("xx", "yy", "zz", "xy"))}
        for name, values in expected.items():
            found = vtk_to_numpy(grid.GetPointData().GetArray(name))
            np.testing.assert_array_equal(found, values, err_msg=name)


def test_one_written_during_the_run_stays_right(tmp_path: Path) -> None:
    path, sidecar = tmp_path / "result.vtkhdf", tmp_path / "result.xdmf"
    with ResultWriter(path, MESH) as out:
        with pytest.raises(FileError, match="contains no complete step yet"):
            write_xdmf(path, sidecar)
        out.write(step_result(0))
        write_xdmf(path, sidecar)
        out.write(step_result(1))
    grids = ElementTree.parse(sidecar).getroot().findall("./Domain/Grid/Grid")
    assert len(grids) == 1
    write_xdmf(path, sidecar)
    assert len(ElementTree.parse(sidecar).getroot().findall("./Domain/Grid/Grid")) == 2
    assert sorted(os.listdir(tmp_path)) == ["result.vtkhdf", "result.xdmf"]


def test_what_cannot_be_exported(tmp_path: Path) -> None:
    path = write(tmp_path / "result.vtkhdf", 1)
    with pytest.raises(FileError, match="no file"):
        write_xdmf(tmp_path / "missing.vtkhdf", tmp_path / "a.xdmf")
    with pytest.raises(FileError, match=r"folder '.*' does not exist"):
        write_xdmf(path, tmp_path / "nowhere" / "a.xdmf")
    for name in ("a:b.vtkhdf", "é.vtkhdf"):
        path = path.rename(tmp_path / name)
        with pytest.raises(FileError, match=rf"XDMF readers cannot open '{name}': use a name in ASCII without colons"):
            write_xdmf(path, tmp_path / "a.xdmf")
    lines = Mesh(MESH.points, {"line2": MESH.cells["line2"]})
    write(tmp_path / "lines.vtkhdf", 1, lines)
    with pytest.raises(FileError, match=r"with no solid cells: open the .vtkhdf file itself"):
        write_xdmf(tmp_path / "lines.vtkhdf", tmp_path / "a.xdmf")
    assert not (tmp_path / "a.xdmf").exists()


def solid_step(mesh: Mesh) -> StepResult:
    """Displacements that tell the points apart."""
    u, zero = np.arange(mesh.points.size, dtype=float).reshape(-1, 3), np.zeros(mesh.n_points)
    return StepResult(1, 1.0, u, np.zeros((mesh.n_points, 6)), zero, zero, np.zeros_like(u))


def test_vtk_reads_every_solid_through_it(tmp_path: Path) -> None:
    """Cell types, nodes, and where VTK sees the middles of edges and the inside of the cells."""
    xdmf = pytest.importorskip("vtkmodules.vtkIOXdmf2", reason="this VTK has no XDMF reader")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    mesh = row_of(list(SOLIDS))
    with ResultWriter(tmp_path / "r.vtkhdf", mesh, kinematics="3d") as out:
        out.write(solid_step(mesh))
    write_xdmf(tmp_path / "r.vtkhdf", tmp_path / "r.xdmf")
    reader = xdmf.vtkXdmfReader()
    reader.SetFileName(str(tmp_path / "r.xdmf"))
    reader.Update()
    grid = reader.GetOutputDataObject(0)
    assert grid.GetNumberOfCells() == mesh.n_cells
    np.testing.assert_array_equal(
        vtk_to_numpy(grid.GetPointData().GetArray("displacement")), solid_step(mesh).displacement
    )
    number = 0
    for name, block in mesh.solids.items():
        for nodes in block.tolist():
            cell = grid.GetCell(number)
            assert cell.GetCellType() == elements.get(name).vtk
            assert [cell.GetPointId(i) for i in range(len(nodes))] == nodes
            for edge in map(cell.GetEdge, range(cell.GetNumberOfEdges())):
                ends = [mesh.points[edge.GetPointId(i)] for i in range(edge.GetNumberOfPoints())]
                if len(ends) == 3:
                    np.testing.assert_allclose(ends[2], 0.5 * (ends[0] + ends[1]), atol=1e-14)
            centre, found = [0.0] * 3, [0.0] * 3
            weights = [0.0] * len(nodes)
            cell.GetParametricCenter(centre)
            cell.EvaluateLocation(_reference(0), centre, found, weights)
            np.testing.assert_allclose(np.array(weights) @ mesh.points[nodes], found, atol=1e-12)
            number += 1


def _reference(value: int) -> object:
    from vtkmodules.vtkCommonCore import reference

    return reference(value)


@pytest.mark.parametrize("name", list(SOLIDS))
def test_every_solid_has_its_code(tmp_path: Path, name: str) -> None:
    """Names and codes as the XDMF library lists them."""
    codes = {"tet4": 0x6, "pyramid5": 0x7, "wedge6": 0x8, "hex8": 0x9, "tet10": 0x26, "pyramid13": 0x27,
             "wedge15": 0x28, "wedge18": 0x29, "hex20": 0x30, "hex27": 0x32}  # fmt: skip
    mesh = row_of([name])
    with ResultWriter(tmp_path / "r.vtkhdf", mesh, kinematics="3d") as out:
        out.write(solid_step(mesh))
    write_xdmf(tmp_path / "r.vtkhdf", tmp_path / "r.xdmf")
    item = ElementTree.parse(tmp_path / "r.xdmf").getroot().find(".//Topology/DataItem")
    sequence = values_of(item, tmp_path).reshape(2, -1)
    assert sequence[:, 0].tolist() == [codes[name]] * 2
    np.testing.assert_array_equal(sequence[:, 1:], mesh.cells[name])


def test_an_element_without_a_code_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(layout.XDMF_TYPES, elements.get("hex8").vtk)
    mesh = row_of(["hex8"])
    with ResultWriter(tmp_path / "r.vtkhdf", mesh, kinematics="3d") as out:
        out.write(solid_step(mesh))
    with pytest.raises(FileError, match=r"XDMF cannot show '.*r\.vtkhdf' with hex8: open the \.vtkhdf file itself"):
        write_xdmf(tmp_path / "r.vtkhdf", tmp_path / "r.xdmf")
    assert not (tmp_path / "r.xdmf").exists()
