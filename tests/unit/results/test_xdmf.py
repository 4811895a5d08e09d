"""XDMF sidecars and Grace project files: other programs read the same numbers."""

import math
import os
import re
import shutil
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusals import refused
from test_node_order import SOLIDS, row_of
from test_result_files import CELL_DATA, MESH, ResultWriter, expected_point_data, step_result, write

import fastcontact as fc
from fastcontact.errors import CaseError, FileError
from fastcontact.mesh import elements
from fastcontact.results.xdmf import write_xdmf
from fastcontact.results.xmgrace import STYLES, Curve, escape, round_axis, write_agr

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
    steps = ElementTree.parse(sidecar).getroot().findall("./Domain/Grid[@CollectionType='Temporal']/Grid")
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
            np.testing.assert_array_equal(vtk_to_numpy(grid.GetPointData().GetArray(name)), values, err_msg=name)


def test_one_written_during_the_run_stays_right(tmp_path: Path) -> None:
    path, sidecar = tmp_path / "result.vtkhdf", tmp_path / "result.xdmf"
    with ResultWriter(path, MESH) as out:
        refused(FileError, "contains no complete step yet", write_xdmf, path, sidecar)
        out.write(step_result(0))
        write_xdmf(path, sidecar)
        out.write(step_result(1))
    assert len(ElementTree.parse(sidecar).getroot().findall("./Domain/Grid/Grid")) == 1
    write_xdmf(path, sidecar)
    assert len(ElementTree.parse(sidecar).getroot().findall("./Domain/Grid/Grid")) == 2
    assert sorted(os.listdir(tmp_path)) == ["result.vtkhdf", "result.xdmf"]


def test_what_cannot_be_exported(tmp_path: Path) -> None:
    path = write(tmp_path / "result.vtkhdf", 1)
    refused(FileError, "does not exist", write_xdmf, tmp_path / "missing.vtkhdf", tmp_path / "a.xdmf")
    refused(FileError, r"folder '.*' does not exist", write_xdmf, path, tmp_path / "nowhere" / "a.xdmf")
    for name in ("a:b.vtkhdf", "é.vtkhdf"):
        path = path.rename(tmp_path / name)
        with pytest.raises(FileError, match=rf"XDMF readers cannot open '{name}': use a name in ASCII without colons"):
            write_xdmf(path, tmp_path / "a.xdmf")
    write(tmp_path / "lines.vtkhdf", 1, fc.Mesh(MESH.points, {"line2": MESH.cells["line2"]}))
    with pytest.raises(
        FileError, match=r"XDMF cannot show '.*lines\.vtkhdf' with no solid cells: open the \.vtkhdf file itself"
    ):
        write_xdmf(tmp_path / "lines.vtkhdf", tmp_path / "a.xdmf")
    assert not (tmp_path / "a.xdmf").exists()


def solid_step(mesh: fc.Mesh) -> fc.StepResult:
    """Displacements that tell the points apart."""
    u, zero = np.arange(mesh.points.size, dtype=float).reshape(-1, 3), np.zeros(mesh.n_points)
    return fc.StepResult(1, 1.0, u, np.zeros((mesh.n_points, 6)), zero, zero, np.zeros_like(u))


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


GRACE = shutil.which("gracebat")
needs_grace = pytest.mark.skipif(GRACE is None, reason="gracebat (Debian's grace) is not installed")
X = np.linspace(0.0, 9.6, 25)
LABELS = {"title": "Pressure", "xlabel": "r [mm]", "ylabel": "p [MPa]"}


def pressure_curves() -> list[Curve]:
    theory = 2798.0 * np.sqrt(np.maximum(1 - (X / 9.0) ** 2, 0))
    return [Curve(X, theory, "Hertz"), Curve(X, 1.04 * theory, "mesh A", "symbols")]


def sets_of(text: str) -> list[np.ndarray]:
    blocks = re.findall(r"@target G0\.S\d+\n@type xy\n(.*?)&\n", text, flags=re.DOTALL)
    return [np.array([line.split() for line in block.splitlines()], float).reshape(-1, 2) for block in blocks]


def draw(path: Path, *arguments: str) -> Path:
    picture = path.with_suffix(".png")
    command = [GRACE, str(path), *arguments, "-hardcopy", "-printfile", str(picture), "-hdevice", "PNG"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0
    assert not re.search("error|unknown|invalid", done.stdout + done.stderr, flags=re.IGNORECASE), done.stderr
    return picture


def test_the_numbers_stand_in_the_file_to_the_last_bit(tmp_path: Path) -> None:
    curves = pressure_curves()
    write_agr(tmp_path / "a.agr", curves, **LABELS)
    found = sets_of((tmp_path / "a.agr").read_text("latin-1"))
    assert len(found) == 2
    for values, curve in zip(found, curves):
        np.testing.assert_array_equal(values, np.column_stack([curve.x, curve.y]))


def test_values_that_are_not_finite_are_left_out(tmp_path: Path) -> None:
    curve = Curve([0.0, 1.0, np.nan, 3.0, 4.0], [1.0, np.nan, 2.0, np.inf, 5.0], "holes")
    write_agr(tmp_path / "a.agr", [Curve([np.nan], [1.0], "nothing"), curve], **LABELS)
    text = (tmp_path / "a.agr").read_text("latin-1")
    assert [values.tolist() for values in sets_of(text)] == [[[0.0, 1.0], [4.0, 5.0]]]
    assert "nothing" not in text


@needs_grace
def test_grace_draws_it_and_reads_the_same_numbers(tmp_path: Path) -> None:
    curves = pressure_curves()
    write_agr(tmp_path / "a.agr", curves, subtitle="h = 4 mm", **LABELS)
    picture = draw(tmp_path / "a.agr", "-saveall", str(tmp_path / "saved.agr"))
    content = picture.read_bytes()
    assert content.startswith(b"\x89PNG")
    assert len(content) > 3000
    saved = (tmp_path / "saved.agr").read_text("latin-1")
    for values, curve in zip(sets_of(saved), curves, strict=True):
        np.testing.assert_allclose(values, np.column_stack([curve.x, curve.y]), rtol=1e-7)
    for line in (
        '@    title "Pressure"', '@    subtitle "h = 4 mm"', "@    world 0, 0, 10, 3000",
        '@    xaxis  label "r [mm]"', "@    xaxis  tick major 2", "@    yaxis  tick major 500",
        '@    s0 legend  "Hertz"', "@    s0 symbol 0", "@    s1 symbol 2", "@    s1 line type 0",
        "@    legend on",
    ):  # fmt: skip
        assert line in saved, line


@needs_grace
@pytest.mark.parametrize(
    ("curves", "text"),
    [
        ([Curve([1.0], [5.0], "one point", "symbols")], "one point"),
        ([Curve([0, 1, 2], [0.0, 0.0, 0.0])], "zero"),
        ([Curve([1e-9, 2e-9], [-3e12, 4e12], "huge", "line+symbols")], "huge"),
        ([Curve([0, 1], [i, i + 1.0], f"n {i}", STYLES[i % 3]) for i in range(40)], "many"),
        ([Curve([0, 1], [1, 2], r'a "quoted" \S2\N 100 % @ # & name')], r'C:\temp "x" \xabc\f{} $y {z}'),
        ([Curve([0, 1], [1, 2], "β₁ ≥ µ·Δp, ∞, é")], "Größe Δ² ≥ β₃ 日本"),
    ],
    ids=["one point", "zero", "huge", "many", "markup", "letters"],
)
def test_grace_takes_whatever_comes(curves: list[Curve], text: str, tmp_path: Path) -> None:
    write_agr(tmp_path / "a.agr", curves, title=text, subtitle=text, xlabel=text, ylabel=text)
    picture = draw(tmp_path / "a.agr", "-saveall", str(tmp_path / "saved.agr"))
    assert len(picture.read_bytes()) > 2000
    saved = (tmp_path / "saved.agr").read_text("latin-1")
    assert f'@    title "{escape(text)}"' in saved
    assert len(sets_of(saved)) == len(curves)


def test_text_is_shown_as_it_stands() -> None:
    assert escape(r"a\b") == r"a\\b"
    assert escape('"x"') == r"\"x\""
    assert escape("two\nlines\tand\x00 more") == "two lines and? more"
    assert escape("r² é µ") == "r² é µ"
    assert escape("π") == r"\f{Symbol}p\f{}"
    assert escape("\u0391") == r"\f{Symbol}A\f{}", "a capital that looks like a Latin one"
    assert escape("a \u2212 b") == "a - b"
    assert escape("\uff02\uff3c") == r"\"\\", "also where a letter turns into markup only here"
    assert escape("x₁ 日") == "x1 ?"


@given(st.text())
def test_any_text_fits_one_line_of_latin_1(text: str) -> None:
    line = escape(text)
    line.encode("latin-1")
    assert len(line.splitlines()) <= 1
    assert not re.search(r'(?<!\\)(\\\\)*"', line), "a bare quote would end the string"


@given(
    st.lists(st.floats(-1e12, 1e12).filter(lambda v: v == 0 or abs(v) > 1e-12), min_size=1, max_size=9),
    st.floats(1e-6, 1e6),
)
def test_axes_are_round_and_hold_all_values(values: list[float], scale: float) -> None:
    numbers = np.array(values) * scale
    first, last, distance = round_axis(numbers)
    slack = 1e-8 * distance
    assert first <= numbers.min() + slack
    assert last >= numbers.max() - slack
    mantissa = distance / 10.0 ** math.floor(math.log10(distance) + 1e-9)
    assert min(abs(mantissa - round_one) for round_one in (1, 2, 5, 10)) < 1e-9
    assert abs(first / distance - round(first / distance)) < 1e-6
    intervals = (last - first) / distance
    assert abs(intervals - round(intervals)) < 1e-6
    assert 3.5 < intervals < 10.5


def test_without_names_there_is_no_legend(tmp_path: Path) -> None:
    write_agr(tmp_path / "none.agr", [Curve(X, X)], **LABELS)
    assert "@    legend off" in (tmp_path / "none.agr").read_text()


def test_messages(tmp_path: Path) -> None:
    refused(CaseError, r"curve 'a': x has shape \(2,\) and y \(3,\)", Curve, [1, 2], [1, 2, 3], "a")
    refused(CaseError, "unknown curve style 'lines': did you mean 'line'", Curve, [1], [1], "a", "lines")
    with pytest.raises(CaseError, match="none of the 1 curves has a finite point"):
        write_agr(tmp_path / "a.agr", [Curve([np.nan], [1.0])], **LABELS)
    with pytest.raises(FileError, match="does not exist: create it"):
        write_agr(tmp_path / "nowhere" / "a.agr", pressure_curves(), **LABELS)
    assert list(tmp_path.iterdir()) == []
