"""Result files: bitwise round trip, readable by other programs, and no step lost by failures."""

import contextlib
import dataclasses
import gc
import importlib.util
import os
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from refusals import refused

import fastcontact as fc
from fastcontact.errors import FileError, ModelError
from fastcontact.mesh import elements
from fastcontact.results import layout, write_arrays
from fastcontact.results.writer import ResultWriter

# Corners of the cells, body by body: two blocks, 0.1 apart, of four kinds of cells.
CORNERS = [
    ("quad8", [(0, 0), (1, 0), (1, 1), (0, 1)]),
    ("tri6", [(1, 0), (2, 0), (2, 1)]),
    ("tri6", [(1, 0), (2, 1), (1, 1)]),
    ("quad9", [(0, 1.1), (1, 1.1), (1, 2.1), (0, 2.1)]),
    ("quad4", [(1, 1.1), (2, 1.1), (2, 2.1), (1, 2.1)]),
    ("line3", [(2, 1), (1, 1)]),
    ("line3", [(1, 1), (0, 1)]),
    ("line3", [(0, 1.1), (1, 1.1)]),
    ("line2", [(1, 1.1), (2, 1.1)]),
]


def two_blocks() -> fc.Mesh:
    nodes, cells = [], {}
    for name, corners in CORNERS:
        element = elements.get(name)
        place = element.corner_shape(element.nodes) @ np.array(corners, float)
        cells.setdefault(name, []).append(range(len(nodes), len(nodes) + len(place)))
        nodes.extend(map(tuple, place.round(12).tolist()))
    points, number = np.unique(np.array(nodes), axis=0, return_inverse=True)
    blocks = {name: number.ravel()[np.array(rows, int)] for name, rows in cells.items()}
    return fc.Mesh(
        points,
        blocks,
        # numbered by element: 0 quad8, 1-2 tri6, 3 quad9, 4 quad4, 5-7 line3, 8 line2
        {"LOWER": [0, 1, 2], "UPPER": [3, 4], "TOP": [5, 6], "a/b": [7, 8], "all": range(9), "empty": []},
        {"origin": [0], "côté": [1, 3, 5], "TOP_": [2], "a_b": [4]},
    )


MESH = two_blocks()
PAIRS = {"left": "node_to_segment", "right / 2": "continuous"}


def vectors(random: np.random.Generator, *shape: int) -> np.ndarray:
    """Any bits: also NaN with a payload, infinities, denormals, -0.0."""
    values = random.integers(0, 2**64, size=shape, dtype=np.uint64).view(np.float64)
    values.ravel()[: min(4, values.size)] = [-0.0, 5e-324, np.inf, np.nan][: min(4, values.size)]
    return values


def contact_result(number: int, name: str, formulation: str, mesh: fc.Mesh = MESH) -> fc.ContactResult:
    random = np.random.default_rng(number + 100 * len(name))
    m, dim = min((number * 3 + len(name)) % 7, mesh.n_points), mesh.dim
    return fc.ContactResult(
        name=name,
        formulation=formulation,
        points=random.permutation(mesh.n_points)[:m].astype(np.int32),
        coordinates=vectors(random, m, dim),
        abscissa=vectors(random, m),
        gap=vectors(random, m),
        pressure=random.random(m),
        multiplier=vectors(random, m),
        force_vectors=vectors(random, m, dim),
        normal=vectors(random, m, dim),
        active=random.random(m) > 0.5,
        force=vectors(random, dim),
        radius=(float(number), np.nan),
        stick_bounds=(float(number), np.inf),
        direction=random.normal(size=dim),
        slip=vectors(random, m, dim),
        slip_total=vectors(random, m, dim),
        primary_points=random.permutation(mesh.n_points)[: m // 2].astype(np.int32),
        primary_force_vectors=vectors(random, m // 2, dim),
    )


def nth_step(number: int) -> fc.StepResult:
    """One of many steps, whose history stays short."""
    return dataclasses.replace(step_result(number % 5), index=number + 1, load_factor=(number + 1) / 7.0)


def step_result(number: int, mesh: fc.Mesh = MESH, pairs: dict[str, str] = PAIRS) -> fc.StepResult:
    random, n, dim = np.random.default_rng(number), mesh.n_points, mesh.dim
    history = [{"residual": 10.0**-i / 3.0, "active": i, "closed": bool(i % 2)} for i in range(number)]
    return fc.StepResult(
        index=number + 1,
        load_factor=(number + 1) / 7.0,
        displacement=random.normal(size=(n, dim)),
        stress=random.normal(size=(n, 4 if dim == 2 else 6)),
        von_mises=random.random(n),
        von_mises_signed=random.normal(size=n),
        reaction=random.normal(size=(n, dim)),
        contact={name: contact_result(number, name, kind, mesh) for name, kind in pairs.items()},
        iterations={"geometry_updates": number, "history": history, "none": None, "text": "é"},
        warnings=("strain 12 %",) + (f"only at step {number}",) * (number % 2),
    )


def assert_same(found: object, expected: object, where: str = "") -> None:
    """The same class, and every field the same to the bit, shape and dtype included."""
    assert type(found) is type(expected), where
    for field in dataclasses.fields(expected):
        a, b, name = getattr(found, field.name), getattr(expected, field.name), f"{where}.{field.name}"
        if isinstance(b, np.ndarray):
            assert (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes()), name
            assert a.flags.c_contiguous, name
        elif field.name == "contact":
            assert list(a) == list(b), name
            for pair in b:
                assert_same(a[pair], b[pair], f"{name}[{pair}]")
        elif field.name == "radius":
            assert np.array(a).tobytes() == np.array(b).tobytes(), name
        else:
            assert (type(a), a) == (type(b), b), name


def assert_holds(path: Path, n_steps: int, nth: Callable[[int], fc.StepResult] = step_result) -> None:
    """The file has so many steps, each as it was written."""
    with fc.open_results(path) as results:
        assert len(results) == n_steps
        for number, step in enumerate(results):
            assert_same(step, nth(number), f"step {number}")


def write(path: Path, n_steps: int = 3, mesh: fc.Mesh = MESH) -> Path:
    with ResultWriter(path, mesh) as out:
        for number in range(n_steps):
            out.write(step_result(number, mesh))
    return path


# ---------------------------------------------------------------------------------------------- round trip


def test_steps_come_back_bit_for_bit(path: Path) -> None:
    assert_holds(write(path, 5), 5)
    counts = {len(step_result(number).contact["left"].points) for number in range(5)}
    assert len(counts) > 3, "the sample must change its number of contact rows"
    assert 0 in counts, "and have an empty table"


def test_any_bit_pattern_survives(path: Path) -> None:
    random = np.random.default_rng(1)
    n = MESH.n_points
    with np.errstate(invalid="ignore"):
        step = dataclasses.replace(
            step_result(0),
            displacement=vectors(random, n, 2),
            stress=vectors(random, n, 4),
            von_mises=vectors(random, n),
            von_mises_signed=vectors(random, n),
            reaction=vectors(random, n, 2),
            load_factor=5e-324,
        )
        with ResultWriter(path, MESH) as out:
            out.write(step)
    assert_same(fc.open_results(path)[0], step)


def test_the_mesh_comes_back_with_its_groups_and_their_order(path: Path) -> None:
    mesh = fc.open_results(write(path)).mesh
    assert mesh.points.tobytes() == MESH.points.tobytes()
    assert mesh.points.shape == MESH.points.shape
    for found, expected in (
        (mesh.cells, MESH.cells),
        (mesh.cell_groups, MESH.cell_groups),
        (mesh.point_groups, MESH.point_groups),
    ):
        assert list(found) == list(expected)
        for name in expected:
            assert found[name].dtype == np.int32
            np.testing.assert_array_equal(found[name], expected[name])


def test_what_the_file_says_beside_the_steps(path: Path) -> None:
    model = SimpleNamespace(mesh=MESH, kinematics="plane_strain", case_text="title = 'é'\n[mesh]\n")
    with ResultWriter(path, model) as out:
        out.write(step_result(0))
        out.write(step_result(1))
        out.close(log=["20 steps", {"seconds": np.float64(1.5)}], warnings=["the ramp has one step"])
    results = fc.open_results(path)
    assert results.kinematics == "plane_strain"
    assert results.case_text == model.case_text
    assert results.versions["numpy"] == np.__version__
    assert {"python", "hdf5", "h5py"} <= set(results.versions)
    assert results.log == ["20 steps", {"seconds": 1.5}]
    assert results.warnings == ("the ramp has one step", "strain 12 %", "only at step 1")
    assert results.complete
    assert results.error == ""
    np.testing.assert_array_equal(results.load_factors, [1 / 7, 2 / 7])
    assert repr(results) == f"Results('{path}': 2 steps, complete, plane_strain, {MESH!r})"


def test_a_bare_mesh_takes_its_kinematics_and_case_from_the_call(path: Path) -> None:
    ResultWriter(path, MESH, kinematics="plane_stress", case_text="x = 1").close()
    results = fc.open_results(path)
    assert (results.kinematics, results.case_text, len(results)) == ("plane_stress", "x = 1", 0)
    assert results.load_factors.shape == (0,)
    assert list(results) == []


def test_results_are_a_sequence(path: Path) -> None:
    results = fc.open_results(write(path, 4))
    assert results[-1].index == results[3].index == 4
    assert results[np.int64(2)].index == 3
    assert [step.index for step in results[1:3]] == [2, 3]
    assert [step.index for step in results[::-2]] == [4, 2]
    assert [step.index for step in reversed(results)] == [4, 3, 2, 1]
    for position in (4, -5):
        with pytest.raises(IndexError, match=f"has 4 steps, so there is no step at position {position}"):
            results[position]


def test_steps_outlive_the_file(path: Path) -> None:
    with fc.open_results(write(path)) as results:
        step = results[1]
    path.unlink()
    assert_same(step, step_result(1))
    with pytest.raises(FileError, match="is closed: open it again"):
        results[0]


def test_a_pair_may_come_late_and_go(path: Path) -> None:
    pairs = [{}, {"left": "node_to_segment"}, {"new": "continuous", "left": "continuous"}, {"new": "continuous"}]
    steps = [step_result(number, pairs=names) for number, names in enumerate(pairs)]
    with ResultWriter(path, MESH) as out:
        for step in steps:
            out.write(step)
    for found, expected in zip(fc.open_results(path), steps, strict=True):
        assert_same(found, expected)


def test_readers_trust_the_number_of_steps_and_no_length(path: Path) -> None:
    write(path, 2)
    with h5py.File(path, "r+") as file:  # as if a third step had been cut off before its count was written
        tables = [file["fastcontact/steps"], file["fastcontact/notes"], *file["VTKHDF/PointData"].values()]
        tables += [table for pair in file["fastcontact/contact"].values() for table in pair.values() if table.shape]
        for table in tables:
            if table.maxshape[0] is None:
                table.resize(len(table) + 5, axis=0)
    assert_holds(path, 2)


def test_steps_can_be_followed_while_they_are_written(path: Path) -> None:
    code = "import sys; from fastcontact.results.reader import open_results as read; "
    code += "print(read(sys.argv[1])[-1].index)"
    with ResultWriter(path, MESH) as out:
        assert len(fc.open_results(path)) == 0
        out.write(step_result(0))
        out.write(step_result(1))
        results = fc.open_results(path)
        assert not results.complete
        assert_same(results[1], step_result(1))
        other = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
        assert other.stdout.strip() == "2"
        out.write(step_result(2))
    assert_same(fc.open_results(path)[2], step_result(2))


# ------------------------------------------------------------------------------------------ other programs


def expected_point_data(step: fc.StepResult) -> dict[str, np.ndarray]:
    n = MESH.n_points
    pressure = np.zeros(n)
    for contact in step.contact.values():
        for point, value in zip(contact.points, contact.pressure):
            pressure[point] = max(pressure[point], value)
    return {
        "displacement": np.column_stack([step.displacement, np.zeros(n)]),
        "stress": np.column_stack([step.stress, np.zeros((n, 2))]),
        "von_mises": step.von_mises,
        "von_mises_signed": step.von_mises_signed,
        "reaction": np.column_stack([step.reaction, np.zeros(n)]),
        "contact_pressure": pressure,
        **{f"group_{name}": flags([name]) for name in ("origin", "TOP_", "TOP")},
        "group_cote": flags(["côté"]),
        "group_a_b": flags(["a/b"]),
        "group_a_b_": flags(["a_b"]),
        "group_all": flags(["TOP", "a/b"]),  # of its cells only the lines are facets
    }


def flags(groups: list[str]) -> np.ndarray:
    inside = np.zeros(MESH.n_points)
    for name in groups:
        inside[MESH.points_of(name)] = 1
    return inside


CELL_DATA = {
    "body": [0, 0, 0, 1, 1],
    "group_LOWER": [1, 1, 1, 0, 0],
    "group_UPPER": [0, 0, 0, 1, 1],
    "group_all": [1, 1, 1, 1, 1],
}


def assert_grid_shows(grid: object, step: fc.StepResult) -> None:
    """A VTK grid has the cells of the sample and all data of a step."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    points = vtk_to_numpy(grid.GetPoints().GetData())
    np.testing.assert_array_equal(points, np.column_stack([MESH.points, np.zeros(MESH.n_points)]))
    cells = map(grid.GetCell, range(grid.GetNumberOfCells()))
    found = [(cell.GetCellType(), [cell.GetPointId(i) for i in range(cell.GetNumberOfPoints())]) for cell in cells]
    assert found == [(elements.get(name).vtk, row) for name, block in MESH.solids.items() for row in block.tolist()]
    for data, expected in (
        (grid.GetPointData(), expected_point_data(step)),
        (grid.GetCellData(), {name: np.array(values) for name, values in CELL_DATA.items()}),
    ):
        assert {data.GetArrayName(i) for i in range(data.GetNumberOfArrays())} >= set(expected)
        for name, values in expected.items():
            np.testing.assert_array_equal(vtk_to_numpy(data.GetArray(name)), values, err_msg=name)


def read_with_vtk(path: Path) -> list[tuple[float, object]]:
    pytest.importorskip("vtkmodules", reason="VTK is not installed")
    from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
    from vtkmodules.vtkIOHDF import vtkHDFReader

    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    shown = []
    for time in times:
        reader.GetOutputInformation(0).Set(vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP(), time)
        reader.Update()
        grid = vtkUnstructuredGrid()
        grid.DeepCopy(reader.GetOutputDataObject(0))
        shown.append((time, grid))
    return shown


def test_vtk_reads_every_step(path: Path) -> None:
    shown = read_with_vtk(write(path, 4))
    assert [time for time, _ in shown] == [(number + 1) / 7 for number in range(4)]
    for number, (_, grid) in enumerate(shown):
        assert_grid_shows(grid, step_result(number))


def test_vtk_can_follow_a_run(path: Path) -> None:
    with ResultWriter(path, MESH) as out:
        out.write(step_result(0))
        out.write(step_result(1))
        shown = read_with_vtk(path)
        assert len(shown) == 2
        assert_grid_shows(shown[1][1], step_result(1))
        out.write(step_result(2))
    assert_holds(path, 3)


@pytest.mark.skipif(importlib.util.find_spec("pyvista") is None, reason="PyVista is not installed")
def test_pyvista_shows_what_vtk_shows(path: Path) -> None:
    import pyvista

    write(path, 3)
    results = fc.open_results(path)
    assert_grid_shows(results.to_pyvista(1), step_result(1))
    assert_grid_shows(results.to_pyvista(results[-1]), step_result(2))
    assert pyvista.read(path).n_cells == 5
    deformed = results.to_pyvista(0).warp_by_vector("displacement")
    np.testing.assert_allclose(deformed.points[:, :2], MESH.points + step_result(0).displacement, atol=1e-6)


# ----------------------------------------------------------------------------------------------- accidents


def test_an_exception_leaves_all_steps_and_its_message(path: Path) -> None:
    def analysis() -> None:
        with ResultWriter(path, MESH) as out:
            out.write(step_result(0))
            out.write(step_result(1))
            raise ZeroDivisionError("division by zero")

    with pytest.raises(ZeroDivisionError):
        analysis()
    results = fc.open_results(path)
    assert [step.index for step in results] == [1, 2]
    assert_same(results[1], step_result(1))
    assert not results.complete
    assert results.error == "ZeroDivisionError: division by zero"
    assert os.listdir(path.parent) == [path.name], "neither lock nor temporary file may stay"


def test_a_step_interrupted_half_way_can_be_written_again(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with ResultWriter(path, MESH) as out:
        out.write(step_result(0))
        with monkeypatch.context() as patch:
            patch.setattr(write_arrays, "append_offsets", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
            with pytest.raises(KeyboardInterrupt):
                out.write(step_result(4))
        assert len(fc.open_results(path)) == 1
        out.write(step_result(1))
    assert_holds(path, 2)


def test_an_old_file_stays_until_the_new_one_is_begun(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(path, 2)
    before = path.read_bytes()

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("fastcontact.results.write_arrays.write_case", fail)
    refused(FileError, r"cannot be written \(No space left on device\)", ResultWriter, path, MESH)
    assert path.read_bytes() == before
    assert os.listdir(path.parent) == [path.name]


def test_an_open_old_file_can_still_be_read_when_a_new_one_takes_its_place(path: Path) -> None:
    with fc.open_results(write(path, 3)) as old:
        write(path, 1)
        assert len(old) == 3
        assert_same(old[2], step_result(2))
    assert len(fc.open_results(path)) == 1


def test_a_file_that_is_not_closed_closes_itself(path: Path) -> None:
    write(path, 2)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        assert_same(fc.open_results(path)[-1], step_result(1))
        gc.collect()
    assert not told


def test_a_second_writer_is_refused_and_damages_nothing(path: Path) -> None:
    with ResultWriter(path, MESH) as out:
        out.write(step_result(0))
        refused(FileError, f"is being written by process {os.getpid()}: wait for it", ResultWriter, path, MESH)
        link = path.with_name("link.vtkhdf")
        link.symlink_to(path)
        refused(FileError, "is being written", ResultWriter, link, MESH)
        code = f"import sys; sys.path[:0] = {sys.path!r}; import test_result_files as t; "
        code += f"t.ResultWriter({str(path)!r}, t.MESH)"
        other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        assert f"is being written by process {os.getpid()}" in other.stderr.splitlines()[-1]
        out.write(step_result(1))
    assert_holds(path, 2)
    write(link, 1)  # now the path is free, and the link still names the same file
    assert len(fc.open_results(path)) == 1
    assert link.is_symlink()


def test_a_file_is_no_longer_than_its_contents(path: Path) -> None:
    with ResultWriter(path, MESH) as out:
        out.write(step_result(0))
    with h5py.File(path) as file:
        used = sum(item.id.get_storage_size() for item in _datasets(file))
    assert used < path.stat().st_size < used + 200_000


def _datasets(group: h5py.Group) -> list[h5py.Dataset]:
    found: list[h5py.Dataset] = []
    group.visititems(lambda _, item: found.append(item) if isinstance(item, h5py.Dataset) else None)
    return found


def test_a_writer_that_is_forgotten_frees_the_path(path: Path) -> None:
    out = ResultWriter(path, MESH)
    out.write(step_result(0))
    del out
    write(path, 2)
    assert len(fc.open_results(path)) == 2


# -------------------------------------------------------------------------------------- messages on writing


@contextlib.contextmanager
def no_rights_of_root():
    """Run as nobody where the tests run as root, who may write everywhere."""
    if os.name != "posix":
        pytest.skip("needs POSIX permissions")
    root = os.geteuid() == 0
    if root:
        os.seteuid(65534)
    try:
        yield
    finally:
        if root:
            os.seteuid(0)


def test_protected_folders_and_files() -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = write(Path(folder) / "a.vtkhdf", 1)
        before = path.read_bytes()
        os.chmod(folder, 0o555)
        with no_rights_of_root(), pytest.raises(FileError, match=r"folder '.*' is write-protected"):
            ResultWriter(Path(folder) / "b.vtkhdf", MESH)
        os.chmod(folder, 0o777)
        os.chmod(path, 0o444)
        with no_rights_of_root(), pytest.raises(FileError, match=r"'.*a.vtkhdf' is write-protected"):
            ResultWriter(path, MESH)
        os.chmod(path, 0)
        with no_rights_of_root(), pytest.raises(FileError, match="is not readable"):
            fc.open_results(path)
        os.chmod(path, 0o644)
        assert path.read_bytes() == before
        os.chmod(folder, 0o755)


def test_files_that_must_not_be_replaced(tmp_path: Path, path: Path) -> None:
    before = write(path).read_bytes()
    refused(FileError, r"already exists: name another file", ResultWriter, path, MESH, overwrite=False)
    assert path.read_bytes() == before
    ResultWriter(tmp_path / "new.vtkhdf", MESH, overwrite=False).close()
    case, mesh = tmp_path / "case.toml", tmp_path / "mesh.med"
    case.write_text("[mesh]\n")
    h5py.File(mesh, "w").create_group("ENS_MAA").file.close()
    for foreign in (case, mesh):
        before = foreign.read_bytes()
        refused(FileError, "exists and is not a result file", ResultWriter, foreign, MESH)
        assert foreign.read_bytes() == before
    path.write_bytes(b"")  # a name that tempfile has made
    assert len(fc.open_results(write(path, 1))) == 1


def test_steps_that_do_not_fit(path: Path) -> None:
    good, n = step_result(1), MESH.n_points
    contact = good.contact["right / 2"]

    def contact_with(**change: np.ndarray) -> dict[str, fc.ContactResult]:
        return {"c": dataclasses.replace(contact, **change)}

    bad = {
        rf"displacement has shape \({n - 1}, 2\), but .* needs \({n}, 2\)": {"displacement": np.zeros((n - 1, 2))},
        rf"stress has shape \({n}, 3\)": {"stress": good.stress[:, :3]},
        r"contact 'c': gap has shape": {"contact": contact_with(gap=np.zeros(99))},
        rf"point {n + contact.points[0]} is not": {"contact": contact_with(points=contact.points + n)},
    }
    with ResultWriter(path, MESH) as out:
        for message, change in bad.items():
            refused(FileError, message, out.write, dataclasses.replace(good, **change))
        out.write(good)
    assert_same(fc.open_results(path)[0], good)
    refused(FileError, "is closed", out.write, good)
    out.close()  # a second close does nothing
    with pytest.raises(ModelError, match="needs a mesh or a model, not str"):
        ResultWriter(path, "mesh.med")  # type: ignore[arg-type]


# -------------------------------------------------------------------------------------- messages on reading


def test_a_file_from_the_future(path: Path) -> None:
    write(path)
    with h5py.File(path, "r+") as file:
        file["fastcontact"].attrs.modify("schema", 7)
    refused(FileError, "has schema 7, but this version reads schemas up to 4: update it", fc.open_results, path)


def test_truncated_files_say_so(path: Path) -> None:
    whole = write(path).read_bytes()
    for part in (0.02, 0.3, 0.6, 0.9, 0.999):
        path.write_bytes(whole[: int(part * len(whole))])
        refused(FileError, r"truncated or damaged|is not an HDF5 file", fc.open_results, path)


def test_damage_inside_is_told_and_never_read_as_data(path: Path) -> None:
    write(path)
    for name in ("VTKHDF/PointData/stress", "fastcontact/contact/0/rows", "fastcontact/steps"):
        damaged = path.with_name("damaged.vtkhdf")
        damaged.write_bytes(path.read_bytes())
        with h5py.File(damaged, "r+") as file:
            file[name].resize(1, axis=0)
        with pytest.raises(FileError, match=r"truncated or damaged .*: repeat the run"):
            fc.open_results(damaged)[2]
    with h5py.File(path, "r+") as file:
        del file["fastcontact/mesh/cells"]
    refused(FileError, "truncated or damaged", fc.open_results, path)


def test_forces_on_the_primary_side_that_are_cut_off(path: Path) -> None:
    step = step_result(2)
    force = {"primary_points": np.arange(3, dtype=np.int32), "primary_force_vectors": np.ones((3, 2))}
    contact = {name: dataclasses.replace(pair, **force) for name, pair in step.contact.items()}
    with ResultWriter(path, MESH) as out:
        out.write(dataclasses.replace(step, contact=contact))
    with h5py.File(path, "r+") as file:
        file["fastcontact/contact/0/primary"].resize(2, axis=0)
    with pytest.raises(FileError, match="the table of primary forces of 'left' is truncated"):
        fc.open_results(path)[0]


def test_the_file_is_what_the_standard_says(path: Path) -> None:
    write(path, 3)
    with h5py.File(path) as file:
        root, n = file["VTKHDF"], MESH.n_points
        assert root.attrs["Version"].tolist() == [2, 0]
        assert root.attrs.get_id("Type").dtype == np.dtype("S16")
        assert root.attrs["Type"] == b"UnstructuredGrid"
        assert file.libver[0] == "earliest"
        steps = root["Steps"]
        assert steps.attrs["NSteps"] == 3
        assert steps["PointDataOffsets/stress"][()].tolist() == [0, n, 2 * n]
        assert steps["PointDataOffsets/group_TOP"][()].tolist() == [0, 0, 0]
        assert steps["CellOffsets"][()].tolist() == [[0], [0], [0]]
        stress = root["PointData/stress"]
        assert (stress.compression, stress.chunks) == (None, (3 * n, 6))  # small: three steps in 4 kB
        assert set(steps["PointDataOffsets"]) == set(root["PointData"])
        assert set(steps["CellDataOffsets"]) == set(root["CellData"])


def test_larger_fields_have_chunks_of_one_step_which_are_compressed_if_sparse(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(write_arrays, "MAX_SHARED", 2 * 8 * MESH.n_points - 1)
    write(path, 3)
    with h5py.File(path) as file:
        for name, width in layout.POINT_FIELDS.items():
            if name in layout.OPTIONAL_FIELDS:
                assert name not in file["VTKHDF/PointData"]
                continue
            field = file["VTKHDF/PointData"][name]
            is_sparse = name == "reaction" or name.startswith("contact_")
            assert (field.compression, field.compression_opts) == (("gzip", 1) if is_sparse else (None, None))
            assert field.chunks == (MESH.n_points, *[width] * (width > 1))
            assert not field.shuffle
    assert_holds(path, 3)


@pytest.mark.parametrize("number", ["last", 1.5, None, (0, 1), slice(0.5, 2)])
def test_a_step_that_is_no_number_is_told(number, path):
    said = (
        "needs integers and a nonzero increment"
        if isinstance(number, slice)
        else "is selected by an integer or a slice"
    )
    with pytest.raises(fc.FileError, match=said):
        fc.open_results(write(path, 1))[number]
