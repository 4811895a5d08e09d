"""Less common errors: wrong histories, positions, fields of files, streams; incomplete systems."""

import errno
import os
import threading
import time
import types

import h5py
import meshio
import numpy as np
import pytest
from models import elastic_model, supported
from refusals import refused

import fastcontact as fc
from fastcontact._tools import paths
from fastcontact.analytic.pressure_curve import pressure_curve
from fastcontact.cli import _outputs, main
from fastcontact.cli._study import _failing_threads_interrupt
from fastcontact.results import file_lock
from fastcontact.round_off import SUM_ROUND_OFF
from fastcontact.studies import checks as affordable
from fastcontact.studies import execute

SQUARE = fc.generate.block()


def model(mesh=SQUARE):
    return elastic_model(mesh, "plane_strain")


TOO_LARGE = 10**400


@pytest.mark.parametrize("value", [TOO_LARGE, [TOO_LARGE], [(0.0, 3.0), (1.0, TOO_LARGE)]])
def test_whole_numbers_too_large_for_a_constant(value):
    for name in ("mu", "alpha", "density"):
        with pytest.raises(fc.ModelError):
            fc.Ogden(**{"mu": 1.0, "alpha": 2.0, "bulk": 9.0, name: value})
    with pytest.raises(fc.ModelError):
        fc.ElasticPlastic(E=1.0, nu=0.3, yield_stress=3.0, hardening=value)
    assert fc.ElasticPlastic(E=1.0, nu=0.3, yield_stress=10**30).hardening[0][1] == 1e30


def test_the_curve_of_a_pin_is_its_pressure_over_the_arc():
    pin = fc.analytic.persson_pin(E=1e3, R=2.0, clearance=1e-3, force=1.0)
    curve = pressure_curve(pin)
    assert curve.pressure(0.0) == pytest.approx(pin.pressure_max)
    assert curve.pressure(2.0 * np.radians(30.0)) == pytest.approx(pin.pressure(30.0))
    assert pressure_curve(None) is None


def test_fields_of_points_that_a_file_does_not_have(tmp_path):
    points, cells = SQUARE.points, [("quad", next(iter(SQUARE.solids.values())))]
    meshio.write(tmp_path / "a.msh", meshio.Mesh(np.pad(points, ((0, 0), (0, 1))), cells), file_format="gmsh")
    refused(fc.FileError, "fields of Gmsh files are not read", model().add_temperature_file, tmp_path / "a.msh", "T")
    (tmp_path / "b.vtu").write_text("<VTKFile type='UnstructuredGrid'><no")
    refused(fc.FileError, r"b\.vtu", model().add_temperature_file, tmp_path / "b.vtu", "T")


def test_folders_of_file_systems_that_cannot_wait(tmp_path, monkeypatch):
    """Some cannot wait for the disk, which is no error; a disk that fails is one."""
    for number in (errno.EINVAL, errno.EIO):

        def failing(descriptor, number=number):
            raise OSError(number, os.strerror(number))

        monkeypatch.setattr(os, "fsync", failing)
        if number == errno.EINVAL:
            paths._synchronise(tmp_path)
        else:
            refused(OSError, "Input/output error", paths._synchronise, tmp_path)


def test_a_lock_in_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(FileNotFoundError):
        file_lock._open_lock_file(tmp_path / "none" / "x.lock")


def test_a_picture_that_cannot_be_drawn(tmp_path):
    def too_large(path, **options):
        raise ValueError("Image size of 1e9x1e9 pixels is too large.")

    with pytest.raises(fc.FileError, match=r"cannot write the picture '.*a\.png': Image size of"):
        _outputs.save(types.SimpleNamespace(figure=types.SimpleNamespace(savefig=too_large)), str(tmp_path / "a.png"))


def test_outputs_onto_a_device(capsys):
    """As /dev/null, which takes all."""
    assert main(["cases", "-q"]) == 0
    _outputs.write_text("/dev/null", "text")
    _outputs.write_json("/dev/null", {"a": 1})


def interrupted_by_a_thread():
    """Tell that a thread ended by an error without an exception object."""
    with _failing_threads_interrupt() as failures:
        assert failures == []
        threading.excepthook(types.SimpleNamespace(exc_value=None))
        time.sleep(60)


def test_a_thread_that_fails_without_a_value_interrupts_all_the_same():
    with pytest.raises(KeyboardInterrupt):
        interrupted_by_a_thread()


def test_memory_that_cannot_be_asked(monkeypatch):
    def unknown(name):
        raise ValueError("unrecognized configuration name")

    monkeypatch.setattr(os, "sysconf", unknown)
    assert affordable._memory() == float("inf")


def test_an_interruption_of_a_run_alone_ends_its_process(monkeypatch):
    ended = []

    class Pool:
        def submit(self, *arguments):
            raise KeyboardInterrupt

        def end(self):
            ended.append(True)

        def shutdown(self, **options):
            ended.append(options)

    monkeypatch.setattr(execute, "Workers", lambda count: Pool())
    with pytest.raises(KeyboardInterrupt):
        execute._run_alone(None)
    assert ended == [True, {"wait": False, "cancel_futures": True}]


def two_materials(path):
    """Write a result with two materials that meet."""
    mesh = fc.generate.block(divisions=(2, 2))
    cells = [*range(len(next(iter(mesh.solids.values()))))]
    mesh = mesh.with_groups(cells={"SOFT": cells[:2], "HARD": cells[2:]})
    found = fc.Model(mesh, "plane_strain")
    found.add_material(fc.LinearElastic(E=1.0, nu=0.3), "SOFT")
    found.add_material(fc.LinearElastic(E=10.0, nu=0.3), "HARD")
    supported(found, BOTTOM="xy", TOP={"y": -0.01})
    with fc.ResultWriter(path, found) as out:
        return fc.solve(found, 1, on_step=out.write)[0]


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        ("cut", "the table of stresses by material is truncated"),
        ("far", "refers to points that do not exist"),
        ("none", ""),
    ],
)
def test_stresses_by_material_of_a_damaged_file(spoil, said, tmp_path):
    step = two_materials(tmp_path / "a.vtkhdf")
    with h5py.File(tmp_path / "a.vtkhdf", "r+", locking=False) as file:
        own = file["fastcontact"]
        if spoil == "none":
            del own["materials"]
        elif spoil == "cut":
            own["materials/rows"].resize((len(own["materials/rows"]) - 1,))
        else:
            rows = own["materials/rows"][()]
            rows["points"][0] = 10**6
            own["materials/rows"][...] = rows
    assert step.material_stress is not None
    with fc.open_results(tmp_path / "a.vtkhdf") as results:
        if said:
            with pytest.raises(fc.FileError, match=said):
                results[-1]
        else:
            assert results[-1].material_stress is None
            assert np.array_equal(results[-1].stress_of_material(0), results[-1].stress)


def test_compliances_of_any_constants_are_those_of_the_material():
    material = fc.Anisotropic(np.diag([1.0, 2.0, 4.0, 1.0, 1.0, 1.0]))
    assert material.compliances(None).shape == (1, 6, 6)
    assert np.diag(material.compliances(None)[0])[:3] == pytest.approx([1.0, 0.5, 0.25])


def test_constants_that_vary_are_named_before_cells_are_known():
    material = fc.Orthotropic(E=(lambda x: x[:, 0], 1.0, 1.0), nu=(0.1, 0.1, 0.1), G=(1.0, 1.0, np.ones(3)))
    assert "E = (a function of the position, 1, 1)" in material.described
    assert "an array of 3 numbers" in material.described
    with pytest.raises(fc.ModelError, match=r"must be a number, or numbers for all cells or points, not \['a'\]"):
        fc.Anisotropic(np.eye(6), density=["a"])


def test_two_materials_that_vary_inside_their_cells():
    """Both of one modulus: they are one."""
    mesh = fc.generate.block(divisions=(2, 2))
    cells = [*range(4)]
    mesh = mesh.with_groups(cells={"ONE": cells[:2], "TWO": cells[2:]})
    results = []
    for E in (1000.0, lambda points: np.full(len(points), 1000.0)):
        found = fc.Model(mesh, "plane_strain")
        for group in ("ONE", "TWO"):
            found.add_material(fc.LinearElastic(E=E, nu=0.3), group)
        supported(found, BOTTOM="xy", TOP={"y": -0.01, "x": 0.02})
        results.append(fc.solve(found, 1)[0])
    np.testing.assert_allclose(results[1].displacement, results[0].displacement, rtol=1e-10, atol=1e-16)


def test_iterations_that_do_not_get_there_name_other_solvers(monkeypatch):
    from fastcontact.linear.solvers import pyamg

    monkeypatch.setattr(pyamg, "MAX_ITERATIONS", 1)
    found = elastic_model(fc.generate.block(divisions=(8, 8)), "plane_strain", BOTTOM="xy", TOP={"y": -0.01, "x": 0.02})
    refused(fc.ConvergenceError, r"do not reach .*: use amg or direct", fc.solve, found, 1, linear_solver="pyamg")


def test_the_least_tolerance_is_not_lowered():
    from fastcontact.linear.elimination.loaded import tighten

    solver = types.SimpleNamespace(tolerance=SUM_ROUND_OFF)
    assert not tighten(solver, 100.0)
    assert solver.tolerance == SUM_ROUND_OFF


def test_a_sweep_shows_itself(tmp_path):
    study = fc.parameter_sweep("forma04a", {"material[0].nu": [0.2, 0.3]}, workers=1, level=0)
    ((caption, rows),) = study.tables()
    assert len(rows) == 3
    assert repr(study).startswith("Sweep of 'forma04a'\n")
    assert study._repr_html_().count("<tr") == 3
    assert caption in study._repr_html_()


@pytest.mark.parametrize("first", ["truncate", "write"])
def test_a_disk_that_fails_while_hdf5_writes_is_told_once(first, tmp_path):
    """The first error is kept, nothing is written after it, and HDF5 sees no exception."""
    from fastcontact._tools.hdf5 import DriverFile

    path = tmp_path / "a.med"
    path.write_bytes(b"before")
    file = DriverFile(path)
    failing = OSError(errno.ENOSPC, "No space left on device")

    def full(*_):
        raise failing

    before, file._file = (
        file._file,
        types.SimpleNamespace(write=full, truncate=full, seek=full, fileno=file._file.fileno),
    )
    calls = [lambda: file.truncate(100) == 100, lambda: file.write(b"abc") == 3]
    assert all(call() for call in (calls if first == "truncate" else calls[::-1]))
    file._file = before
    assert file.truncate(0) == 0
    file.write(b"abc")
    assert file.failure is failing
    refused(OSError, "No space left", file.check)
    assert path.read_bytes() == b"before"


MAIL = "TITRE\n{}\nFINSF\nCOOR_2D\nN1 0. 0.\nN2 1. 0.\nN3 0. 1.\nFINSF\nTRIA3\n{}\nFINSF\nFIN\n"


def test_files_of_code_aster_that_are_no_mesh(tmp_path, monkeypatch):
    path = tmp_path / "a.mail"
    path.write_text(MAIL.format("a title of TRIA3 words", "M1 N1 N2 N3"))
    assert fc.read_mesh(path).n_points == 3
    path.write_text("TITRE\nwithout an end\n")
    refused(fc.FileError, r"cut off|FIN", fc.read_mesh, path)
    path.write_text("COOR_2D\nN1 0. 0.\nFINSF\nFIN\n")
    refused(fc.MeshError, r"'.*a\.mail': ", fc.read_mesh, path)


def test_groups_without_points():
    mesh = SQUARE.with_groups(points={"NONE": []})
    for act in (lambda m: m.add_periodicity("NONE", "NONE"), lambda m: m.add_spring("LEFT", "NONE", x=1.0)):
        refused(fc.FastcontactError, r"'NONE'.* is empty", act, model(mesh))


def test_loads_on_groups_of_cells_and_facets_act_on_the_cells():
    facets = SQUARE.cell_groups["TOP"].tolist()
    solids = [SQUARE.offsets[name] + k for name, block in SQUARE.solids.items() for k in range(len(block))]
    mesh = SQUARE.with_groups(cells={"BOTH": [*solids, *facets]})
    found = model(mesh)
    found.fix("BOTTOM", "xy")
    found.add_body_force("BOTH", y=-1.0)
    assert fc.solve(found, 1)[0].reaction[:, 1].sum() == pytest.approx(fc.quality(mesh).measure)


def test_stresses_along_the_normal_of_a_contact_in_the_plane():
    """Without an axis of symmetry the line begins at the largest pressure, along the normal there."""
    pytest.importorskip("matplotlib")
    mesh = fc.generate.block(divisions=(6, 6))
    found = elastic_model(mesh, "plane_strain", BOTTOM="xy")
    ball = fc.obstacles.Sphere((0.4, mesh.points[:, 1].max() + 5.0), 5.0)
    found.add_obstacle("ball", secondary="TOP", obstacle=ball, motion={"y": -0.01})
    ax = fc.plot.axis_stress(mesh, fc.solve(found, 1)[-1], "ball")
    depths = np.concatenate([line.get_xdata() for line in ax.get_lines()])
    assert depths.max() <= 1.0 + 1e-9
    assert depths.max() > 0.1
