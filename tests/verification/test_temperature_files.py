"""Temperatures from files and at several instants: the same bits as arrays, histories, other orders of points, mistakes."""

import h5py
import meshio
import numpy as np
import pytest
from case_texts import of_block
from mechanics import in_space
from refusals import refused
from test_temperature import ALPHA, E, free, plane

import fastcontact as fc
from fastcontact.cases.case import read_case
from fastcontact.mesh import elements
from fastcontact.mesh.files import mesh_fields
from fastcontact.mesh.files.med import add_field, add_mesh, new_file
from fastcontact.model.fingerprint import fingerprint

pytestmark = pytest.mark.usefixtures("meshio_here")

STEEL = fc.LinearElastic(E, 0.3, expansion=ALPHA)


def field_of(mesh, factor=1.0):
    return 20.0 + factor * (50.0 * mesh.points[:, 0] ** 2 - 30.0 * mesh.points[:, 1])


def med(path, mesh, values, times=(0.0,), components=("TEMP",)):
    with new_file(path, mesh) as file:
        add_mesh(file, mesh, "mesh")
        for number, (time, field) in enumerate(zip(times, values, strict=True)):
            add_field(file, "TEMP", components, np.reshape(field, (mesh.n_points, -1)), (number, time), "mesh")
    return path


def vtu(path, mesh, values, order=None, name="TEMP"):
    order = np.arange(mesh.n_points) if order is None else order
    back = np.argsort(order)
    cells = [(elements.get(kind).meshio, back[block]) for kind, block in mesh.solids.items()]
    meshio.write(path, meshio.Mesh(in_space(mesh.points)[order], cells, point_data={name: np.asarray(values)[order]}))
    return path


def vtkhdf(path, mesh, values, times):
    """As VTK lays out data that change with time on a mesh that does not."""
    with h5py.File(path, "w") as file:
        grid = file.create_group("VTKHDF")
        grid["NumberOfPoints"], grid["Points"] = [mesh.n_points], in_space(mesh.points)
        grid["PointData/TEMP"] = np.concatenate(values)
        grid["Steps/Values"] = times
        grid["Steps/PointDataOffsets/TEMP"] = mesh.n_points * np.arange(len(times))
        grid["Steps"].attrs["NSteps"] = len(times)
    return path


def heated(mesh, kinematics, *args, steps=1, from_file=True, **kwargs):
    model = free(mesh, kinematics, STEEL)
    (model.add_temperature_file if from_file else model.add_temperature)(*args, **kwargs)
    return fc.solve(model, fc.linear_ramp(steps))


@pytest.mark.each_value
@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress", "axisymmetric", "3d"])
@pytest.mark.parametrize("kind", ["med", "vtu", "vtk", "vtkhdf"])
def test_a_field_of_a_file_gives_the_bits_of_the_array(tmp_path, kind, kinematics):
    mesh = fc.generate.box((2.0, 1.0, 1.0), (2, 2, 1), "hex20") if kinematics == "3d" else plane("quad8", kinematics)
    values, path = field_of(mesh), tmp_path / f"heat.{kind}"
    if kind == "med":
        med(path, mesh, [values])
    elif kind == "vtkhdf":
        vtkhdf(path, mesh, [values], [0.0])
    else:
        vtu(path, mesh, values)
    (one,) = heated(mesh, kinematics, path, "TEMP", reference=20.0)
    (other,) = heated(mesh, kinematics, values, reference=20.0, from_file=False)
    np.testing.assert_array_equal(one.displacement, other.displacement)
    np.testing.assert_array_equal(one.stress, other.stress)


def test_a_field_of_a_result_file_is_read(tmp_path):
    """Whatever it means: the von Mises stress of the last step, taken for a temperature."""
    mesh = plane("quad8", "plane_stress")
    model = free(mesh, "plane_stress", STEEL)
    model.add_temperature(field_of(mesh))
    with fc.ResultWriter(tmp_path / "first.vtkhdf", model) as out:
        steps = fc.solve(model, fc.linear_ramp(2), on_step=out.write)
    (one,) = heated(mesh, "plane_stress", tmp_path / "first.vtkhdf", "von_mises", instant=1.0)
    (other,) = heated(mesh, "plane_stress", steps[-1].von_mises, from_file=False)
    np.testing.assert_array_equal(one.displacement, other.displacement)


@pytest.mark.parametrize("kind", ["med", "vtkhdf", "files", "array"])
def test_temperatures_follow_one_another_linearly(tmp_path, kind):
    """Three instants; half-way between two the displacement is the mean of theirs, since all is linear."""
    mesh = plane("quad8", "plane_stress")
    values, times = [field_of(mesh, factor) for factor in (0.0, 2.0, -1.0)], [0.0, 0.5, 1.0]
    if kind == "med":
        given = {"args": (med(tmp_path / "h.med", mesh, values, [0.0, 1800.0, 3600.0]), "TEMP"), "times": times}
    elif kind == "vtkhdf":
        given = {"args": (vtkhdf(tmp_path / "h.vtkhdf", mesh, values, times), "TEMP")}
    elif kind == "files":
        paths = [vtu(tmp_path / f"h{i}.vtu", mesh, field) for i, field in enumerate(values)]
        given = {"args": (paths, "TEMP"), "times": times}
    else:
        given = {"args": (np.array(values),), "times": times, "from_file": False}
    args = given.pop("args")
    steps = heated(mesh, "plane_stress", *args, reference=20.0, steps=4, **given)
    exact = [heated(mesh, "plane_stress", v, reference=20.0, from_file=False)[0].displacement for v in values]
    expected = [(exact[0] + exact[1]) / 2, exact[1], (exact[1] + exact[2]) / 2, exact[2]]
    for step, u in zip(steps, expected, strict=True):
        np.testing.assert_allclose(step.displacement, u, atol=1e-12 * np.abs(exact[1]).max())
    assert steps[2].iterations["temperature_factors"] == pytest.approx([0.0, 0.5, 0.5])
    np.testing.assert_allclose(steps[3].stress, 0.0 * steps[3].stress, atol=E * ALPHA * 200.0)


def test_points_in_another_order_are_found_by_their_place(tmp_path):
    mesh = plane("tri6", "plane_stress")
    values = field_of(mesh)
    order = np.random.default_rng(3).permutation(mesh.n_points)
    (one,) = heated(mesh, "plane_stress", vtu(tmp_path / "mixed.vtu", mesh, values, order), "TEMP")
    (other,) = heated(mesh, "plane_stress", values, from_file=False)
    np.testing.assert_array_equal(one.displacement, other.displacement)


def test_points_that_touch_may_not_have_two_temperatures_in_another_order(tmp_path):
    mesh = fc.generate.block_on_block("quad4", divisions_lower=(4, 2), divisions_upper=(4, 2))
    body = np.zeros(mesh.n_points)
    body[mesh.points_of("UPPER")] = 1.0
    model = fc.Model(mesh, "plane_stress")
    model.add_temperature_file(vtu(tmp_path / "same.vtu", mesh, body), "TEMP")
    np.testing.assert_array_equal(model.temperatures[0].value, body)
    path = vtu(tmp_path / "turned.vtu", mesh, body, np.arange(mesh.n_points)[::-1])
    refused(fc.MeshError, r"has 2 different values at .*, where bodies touch", model.add_temperature_file, path, "TEMP")


def test_no_points_have_no_values_of_two_bodies():
    field = mesh_fields.FileField(None, np.zeros((1, 3)), np.zeros((3, 2)))
    mesh_fields._check_unique(field, np.empty((0, 2)), 1.0, "the field")


def test_a_part_of_the_mesh_suffices_for_a_group(tmp_path):
    """A file of the lower body alone heats it, and says that it does not hold the upper one."""
    mesh = fc.generate.block_on_block("quad4", divisions_lower=(4, 2), divisions_upper=(3, 2))
    lower = fc.generate.block(
        (10.0, 5.0), (4, 2), "quad4", origin=tuple(mesh.points[mesh.points_of("LOWER")].min(axis=0))
    )
    path = med(tmp_path / "lower.med", lower, [np.full(lower.n_points, 70.0)])
    model = fc.Model(mesh, "plane_stress")
    model.add_temperature_file(path, "TEMP", "LOWER", reference=20.0)
    rise = model.temperatures[0].rise(mesh)
    assert (rise[mesh.points_of("LOWER")] == 50.0).all()
    assert not rise[mesh.points_of("UPPER")].any()
    with pytest.raises(fc.MeshError, match=r"has no point where \d+ points of the mesh are .* write it on the nodes"):
        model.add_temperature_file(path, "TEMP")


def test_heated_spheres_close_their_gap_and_press_as_hertz_says():
    """Each grows by alpha T R, through half of the gap and then into the other, as if pressed by what remains."""
    radius, rise, half_gap = 50.0, 100.0, 0.02
    approach = ALPHA * rise * radius - half_gap
    forces = []
    for hot in (True, False):
        model = fc.Model(fc.generate.half_spheres("quad8", arc_sizes=(0.15, 4.0), segments=12), "axisymmetric")
        model.add_material(fc.LinearElastic(20_000.0, 0.3, expansion=ALPHA))
        model.prescribe("A2B2", y=0.0 if hot else -approach)
        model.prescribe("A1B1", y=0.0 if hot else approach)
        if hot:
            model.add_temperature(rise)
        model.add_contact("hertz", secondary="CONT1", primary="CONT2", clearance=2.0 * half_gap if hot else 0.0)
        steps = fc.solve(model, fc.Ramp((0.3, 1.0)) if hot else fc.linear_ramp(1))
        assert not hot or not steps[0].contact["hertz"].active.any()  # still open
        forces.append(abs(steps[-1].contact["hertz"].force[1]))
    hertz = fc.analytic.hertz_point(
        E1=20_000.0, nu1=0.3, R1=radius, E2=20_000.0, nu2=0.3, R2=radius, approach=2.0 * approach
    )
    assert forces[0] == pytest.approx(forces[1], rel=5e-3)  # hot ones are larger by alpha T
    assert forces[0] == pytest.approx(hertz.force, rel=0.02)


# ----------------------------------------------------------------------------- case files and mistakes
MATERIAL = "E = 1000.0\nnu = 0.3\nexpansion = 1.2e-5"
CASE = of_block("[[temperature]]\n{}", material=MATERIAL, steps=2, LEFT="x", BOTTOM="y")


@pytest.fixture
def folder(tmp_path):
    mesh = fc.generate.block((2.0, 1.0), (4, 2), "quad4")
    fc.write_mesh(tmp_path / "block.med", mesh)
    med(tmp_path / "heat.med", mesh, [field_of(mesh), field_of(mesh, 2.0)], [0.0, 60.0])
    vtu(tmp_path / "heat.vtu", mesh, field_of(mesh))
    med(tmp_path / "vectors.med", mesh, [np.ones((mesh.n_points, 2))], components=("DX", "DY"))
    med(tmp_path / "holes.med", mesh, [np.where(np.arange(mesh.n_points) == 3, np.nan, 1.0)])
    return tmp_path


def case(folder, text):
    (folder / "case.toml").write_text(CASE.format(text))
    return read_case(folder / "case.toml").model


def test_fields_in_case_files(folder):
    own = case(folder, "file = 'heat.med'\nfield = 'TEMP'\ninstant = 60.0\nreference = 20.0").temperatures
    assert len(own) == 1
    np.testing.assert_array_equal(own[0].value, field_of(fc.read_mesh(folder / "block.med"), 2.0))
    model = case(folder, "file = 'heat.med'\nfield = 'TEMP'\ntimes = [0.0, 1.0]")
    assert (
        "Temperature: a number for each point (reference: 0) in all solid cells, at 2 instants from 0 to 1"
        in model.describe()
    )
    assert len(case(folder, "file = ['heat.vtu', 'heat.vtu']\nfield = 'TEMP'\ntimes = [0, 1]").temperatures) == 2
    assert fingerprint(model)["the temperatures"] != fingerprint(case(folder, "value = 1.0"))["the temperatures"]
    step = fc.solve(case(folder, "value = {along = 'x', table = [[0, 0], [2, 100]]}"), fc.linear_ramp(1))[-1]
    assert step.displacement[:, 0].max() == pytest.approx(ALPHA * 100.0, rel=0.2)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("reference = 1.0", r"temperature\[0\].*needs either 'value', or 'file' and 'field'|a temperature needs"),
        ("value = 1.0\nfile = 'heat.med'", "a temperature needs either 'value', or 'file' and 'field'"),
        ("value = 1.0\ntimes = [0, 1]", "the key 'times' belongs to a temperature with 'file'"),
        ("file = 'heat.med'", "needs 'field', the name of the field in the file"),
        ("file = 'heat.med'\nfield = 'TMP'", "unknown field 'TMP': did you mean 'TEMP'"),
        ("file = 'heat.vtu'\nfield = 'TMP'", "unknown field 'TMP': did you mean 'TEMP'"),
        ("file = 'nothing.med'\nfield = 'TEMP'", "nothing.med"),
        ("file = 3\nfield = 'TEMP'", "'file' must be a path or a list of paths, not 3"),
        ("file = [3]\nfield = 'TEMP'", "'file' must be a path or a list of paths"),
        ("file = []\nfield = 'TEMP'", "no file is given for the temperature"),
        ("file = 'vectors.med'\nfield = 'TEMP'", "has 2 components: a field with a single number per point is needed"),
        ("file = 'holes.med'\nfield = 'TEMP'", r"has no value at 1 points \(first: point 3"),
        ("file = 'heat.med'\nfield = 'TEMP'\ninstant = 30.0", "has no instant 30, the nearest is 0|the nearest is 60"),
        ("file = 'heat.vtu'\nfield = 'TEMP'\ninstant = 30.0", "has no times: omit instant"),
        ("file = 'heat.med'\nfield = 'TEMP'\ntimes = [0, 1, 2]", "has 2 instants, but 3 times"),
        ("file = 'heat.med'\nfield = 'TEMP'\ntimes = [1, 0]", "must ascend"),
        ("file = 'heat.med'\nfield = 'TEMP'\nramp = [[0, 0], [1, 1]]", "has 2 instants and takes no ramp"),
        ("file = 'heat.vtu'\nfield = 'TEMP'\ntimes = [0]", "has a single instant"),
        ("file = ['heat.vtu', 'heat.vtu']\nfield = 'TEMP'", "has 2 instants without times"),
        ("file = ['heat.med', 'heat.vtu']\nfield = 'TEMP'\ntimes = [0, 1, 2]", "has 2 instants: each of several files"),
        ("file = 'heat.med'\nfield = 'TEMP'\ngroups = 'TOP'", "group 'TOP' contains no solid cells: it has no"),
    ],
)
def test_mistakes_with_files_are_told(folder, text, message):
    refused(fc.FastcontactError, message, case, folder, text)


def test_a_history_must_cover_the_analysis(folder):
    model = case(folder, "file = 'heat.med'\nfield = 'TEMP'\ntimes = [0.0, 0.5]")
    with pytest.raises(fc.ModelError, match=r"the ramp of the temperature of all solid cells covers 0 to 0\.5"):
        fc.solve(model, fc.linear_ramp(2))
    with pytest.raises(fc.ModelError, match="give either times or ramp"):
        model.add_temperature(np.zeros((2, 15)), times=[0, 1], ramp=[(0, 0), (1, 1)])
    refused(fc.ModelError, "must be an array", model.add_temperature, 3.0, times=[0, 1])
    refused(fc.ModelError, "must be a sequence of numbers", model.add_temperature, np.zeros((2, 15)), times=["a", "b"])


def test_a_damaged_grid_of_vtk_is_told(tmp_path):
    mesh = plane("quad4", "plane_stress")
    model = free(mesh, "plane_stress", STEEL)
    path = vtkhdf(tmp_path / "short.vtkhdf", mesh, [field_of(mesh)] * 2, [0.0, 1.0])
    with h5py.File(path, "a") as file:
        file["VTKHDF/Steps/PointDataOffsets/TEMP"][1] = 2 * mesh.n_points
    refused(fc.FileError, "has fewer numbers than its steps need", model.add_temperature_file, path, "TEMP")
    with h5py.File(path, "a") as file:
        file["VTKHDF/NumberOfPoints"][0] = 3
    refused(fc.FileError, "a mesh that changes", model.add_temperature_file, path, "TEMP")
    with h5py.File(tmp_path / "empty.vtkhdf", "w") as file:
        file.create_group("other")
    with pytest.raises(fc.FileError, match="contains no unstructured grid of VTK"):
        model.add_temperature_file(tmp_path / "empty.vtkhdf", "TEMP")


def test_a_field_whose_mesh_is_in_another_file_goes_by_the_order_of_its_points(tmp_path):
    mesh = plane("quad4", "plane_stress")
    path = med(tmp_path / "field.med", mesh, [field_of(mesh)])
    with h5py.File(path, "a") as file:
        del file["ENS_MAA"]
    model = free(mesh, "plane_stress", STEEL)
    model.add_temperature_file(path, "TEMP")
    np.testing.assert_array_equal(model.temperatures[0].value, field_of(mesh))
    other = free(plane("quad8", "plane_stress"), "plane_stress", STEEL)
    with pytest.raises(fc.MeshError, match=r"has 12 points and no coordinates, the mesh has \d+"):
        other.add_temperature_file(path, "TEMP")


def test_a_grid_of_vtk_without_steps_has_one_instant(tmp_path):
    mesh = plane("quad4", "plane_stress")
    path = vtkhdf(tmp_path / "one.vtkhdf", mesh, [field_of(mesh)], [0.0])
    with h5py.File(path, "a") as file:
        del file["VTKHDF/Steps"]
    model = free(mesh, "plane_stress", STEEL)
    model.add_temperature_file(path, "TEMP")
    np.testing.assert_array_equal(model.temperatures[0].value, field_of(mesh))
    refused(fc.FileError, "unknown field 'TMP': did you mean 'TEMP'", model.add_temperature_file, path, "TMP")
    none = vtkhdf(tmp_path / "none.vtkhdf", mesh, [field_of(mesh)], [0.0])
    with h5py.File(none, "a") as file:
        file["VTKHDF/Steps"].attrs["NSteps"] = 0
    refused(fc.FileError, "has no instants", model.add_temperature_file, none, "TEMP")
