"""MED files: compared with the MED library and medcoupling, files of code_aster, and round trips."""

import contextlib
import dataclasses
import json
import shutil
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from matplotlib_pictures import contact_of
from models import assert_same_mesh, members, row_of
from refusals import refused

import fastcontact as fc
from fastcontact.errors import FastcontactWarning, FileError, MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.files.med import read_med, read_med_field, write_med_mesh
from fastcontact.mesh.files.mesh_files import read_mesh_report

CASES = Path(__file__).resolve().parents[5] / "shared" / "cases"
FLAT = [name for name, element in elements.ELEMENTS.items() if element.dim <= 2]


def all_elements():
    """Two cells of each flat element side by side, in groups that overlap."""
    mesh = row_of(FLAT, groups=False)
    every = np.arange(mesh.n_cells)
    return mesh.with_groups(
        {"everything": every, "upper row": every[1::2], "one": [3], "nobody": []}, {"P": [0], "Q": [0, 5, 7], "R": [5]}
    )


@contextlib.contextmanager
def changed(path):
    """Write a mesh of all elements; give its group in the file, and that of its only step, to be changed."""
    write_med_mesh(path, all_elements())
    with h5py.File(path, "a") as file:
        mesh = file["ENS_MAA/mesh"]
        yield mesh, next(iter(mesh.values()))


def some_steps(mesh, count=3):
    random = np.random.default_rng(4)
    n, m = mesh.n_points, 4 if mesh.dim == 2 else 6
    for index in range(1, count + 1):
        displacement, reaction = random.normal(size=(2, n, mesh.dim))
        von_mises, signed = random.normal(size=(2, n))
        yield fc.StepResult(
            index, index / count, displacement, random.normal(size=(n, m)), von_mises, signed, reaction,
            {"contact": contact(np.array([1, 4]), np.array([2.5, 0.5]) * index)},
        )  # fmt: skip


def contact(points, pressure):
    return contact_of(points.astype(np.int32), np.zeros((len(points), 2)), name="contact", pressure=pressure)


def run(*command):
    if shutil.which(command[0]) is None:
        pytest.skip(f"{command[0]} (Debian package libmed-tools) is not installed")
    done = subprocess.run([str(word) for word in command], capture_output=True, check=False)
    return done.returncode, (done.stdout + done.stderr).decode("latin-1")


# The MED library and medcoupling ------------------------------------------------------------------


def test_med_library_accepts_what_we_write(tmp_path):
    path = tmp_path / "results.med"
    fc.write_med_results(path, all_elements(), some_steps(all_elements()))
    code, said = run("medconforme", path)
    assert code == 0
    assert said.count("conforme a") + said.count("conforme au") >= 2
    assert "non conforme" not in said
    code, said = run("mdump", path, "NODALE", "FULL_INTERLACE", 0)
    assert code == 0
    assert "ERREUR" not in said
    for expected in ("MED_TRIA6 : 2", "MED_QUAD9 : 2", "MED_SEG3 : 2", "upper row", "SIEF_NOEU", "VMIS_SG"):
        assert expected in said


def test_medcoupling_reads_our_mesh(tmp_path):
    mc = pytest.importorskip("medcoupling", reason="medcoupling is not installed")
    mesh, path = all_elements(), tmp_path / "mesh.med"
    write_med_mesh(path, mesh, mesh_name="two rows")
    found = mc.MEDFileUMesh(str(path))
    assert found.getName() == "two rows"
    np.testing.assert_array_equal(found.getCoords().toNumPyArray(), mesh.points)
    assert set(found.getGroupsNames()) == set(mesh.group_names)
    for name in mesh.point_groups:
        np.testing.assert_array_equal(found.getNodeGroupArr(name).toNumPyArray(), mesh.point_groups[name])
    for name in mesh.cell_groups:
        ours = sorted(tuple(row) for block in mesh.cells_of(name).values() for row in block.tolist())
        theirs = []
        for level in found.getGrpNonEmptyLevels(name):
            group = found.getGroup(level, name)
            theirs += [tuple(group.getNodeIdsOfCell(i)) for i in range(group.getNumberOfCells())]
        assert sorted(theirs) == ours


def test_medcoupling_reads_our_fields_at_all_instants(tmp_path):
    mc = pytest.importorskip("medcoupling", reason="medcoupling is not installed")
    mesh, path = all_elements(), tmp_path / "results.med"
    steps = list(some_steps(mesh))
    fc.write_med_results(path, mesh, iter(steps))
    assert set(mc.MEDFileFields(str(path)).getFieldsNames()) == {
        "DEPL", "SIEF_NOEU", "SIEQ_NOEU", "REAC_NODA", "PRES_CONT",
    }  # fmt: skip
    expected = {
        "DEPL": (("DX", "DY"), lambda step: step.displacement),
        "SIEF_NOEU": (("SIXX", "SIYY", "SIZZ", "SIXY"), lambda step: step.stress),
        "SIEQ_NOEU": (("VMIS", "VMIS_SG"), lambda step: np.column_stack([step.von_mises, step.von_mises_signed])),
        "REAC_NODA": (("DX", "DY"), lambda step: step.reaction),
    }
    for name, (components, values) in expected.items():
        field = mc.MEDFileFieldMultiTS(str(path), name)
        assert tuple(field.getInfo()) == components
        assert field.getTimeSteps() == [(step.index, -1, step.load_factor) for step in steps]
        for step in steps:
            array = field.getTimeStep(step.index, -1).getUndergroundDataArray().toNumPyArray()
            np.testing.assert_array_equal(array, values(step))


def written_by_medcoupling(mc, path, write="write"):
    """Square and triangle, bottom line, groups that overlap on three levels, two instants of a field."""
    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [2.0, 0.0]])
    solids, lines = mc.MEDCouplingUMesh("plate", 2), mc.MEDCouplingUMesh("plate", 1)
    for mesh in (solids, lines):
        mesh.setCoords(mc.DataArrayDouble(points) if mesh is solids else solids.getCoords())
        mesh.allocateCells(2)
    # In the order in which MED files hold kinds: triangles before quadrangles.
    solids.insertNextCell(mc.NORM_TRI3, [1, 4, 2])
    solids.insertNextCell(mc.NORM_QUAD4, [0, 1, 2, 3])
    lines.insertNextCell(mc.NORM_SEG2, [0, 1])
    lines.insertNextCell(mc.NORM_SEG2, [1, 4])
    file = mc.MEDFileUMesh()
    file[0], file[-1] = solids, lines
    for level, groups in {0: {"all": [0, 1], "square": [1]}, -1: {"bottom": [0, 1]}, 1: {"corner": [2, 4]}}.items():
        arrays = []
        for name, numbers in groups.items():
            arrays.append(mc.DataArrayInt(numbers))
            arrays[-1].setName(name)
        file.setGroupsAtLevel(level, arrays)
    field = mc.MEDCouplingFieldDouble(mc.ON_NODES, mc.ONE_TIME)
    field.setMesh(solids)
    field.setName("TEMP")
    series = mc.MEDFileFieldMultiTS()
    for index in (1, 2):
        field.setArray(mc.DataArrayDouble(np.arange(5.0)[:, None] * index))
        field.setTime(0.25 * index, index, -1)
        series.appendFieldNoProfileSBT(field)
    meshes, fields, data = mc.MEDFileMeshes(), mc.MEDFileFields(), mc.MEDFileData()
    meshes.pushMesh(file)
    fields.pushField(series)
    data.setMeshes(meshes)
    data.setFields(fields)
    getattr(data, write)(str(path), 2)
    return points


@pytest.mark.parametrize("write", ["write30", "write33", "write40", "write"])
def test_reads_what_medcoupling_writes(tmp_path, write):
    mc = pytest.importorskip("medcoupling", reason="medcoupling is not installed")
    path = tmp_path / "plate.med"
    points = written_by_medcoupling(mc, path, write)
    mesh = read_med(path).mesh
    np.testing.assert_array_equal(mesh.points, points)
    assert {name: block.tolist() for name, block in mesh.cells.items()} == {
        "tri3": [[1, 4, 2]], "quad4": [[0, 1, 2, 3]], "line2": [[0, 1], [1, 4]],
    }  # fmt: skip
    assert members(mesh) == {
        "all": {("tri3", 0), ("quad4", 0)}, "square": {("quad4", 0)}, "bottom": {("line2", 0), ("line2", 1)},
    }  # fmt: skip
    assert mesh.point_groups["corner"].tolist() == [2, 4]
    times, values = read_med_field(path, "TEMP")
    np.testing.assert_array_equal(times, [0.25, 0.5])
    np.testing.assert_array_equal(values[:, :, 0], [np.arange(5.0), 2 * np.arange(5.0)])


def test_field_on_a_part_of_the_points_is_nan_elsewhere(tmp_path):
    mc = pytest.importorskip("medcoupling", reason="medcoupling is not installed")
    path = tmp_path / "plate.med"
    written_by_medcoupling(mc, path)
    mesh = mc.MEDFileUMesh(str(path))
    field = mc.MEDCouplingFieldDouble(mc.ON_NODES, mc.ONE_TIME)
    field.setName("PART")
    field.setMesh(mesh[0])
    field.setArray(mc.DataArrayDouble([7.0, 9.0]))
    profile = mc.DataArrayInt([1, 3])
    profile.setName("two points")
    part = mc.MEDFileField1TS()
    part.setFieldProfile(field, mesh, 0, profile)
    part.write(str(path), 0)
    _, values = read_med_field(path, "PART")
    np.testing.assert_array_equal(values, [[[np.nan], [7.0], [np.nan], [9.0], [np.nan]]])


# code_aster's files -------------------------------------------------------------------------------


@pytest.mark.skipif(not CASES.is_dir(), reason="code_aster's cases are not beside the checkout")
@pytest.mark.parametrize("spec", sorted(CASES.glob("*.json")), ids=lambda path: path.stem)
def test_code_aster_meshes(spec):
    for facts in json.loads(spec.read_text())["meshes"]:
        counts = {kind: count for kind, count in facts["n_cells"].items() if kind != "vertex"}
        foreign = [kind for kind in counts if kind not in elements.BY_MESHIO]
        if foreign:
            refused(MeshError, f"{counts[foreign[0]]} cells of kind ", read_mesh_report, CASES / facts["file"])
            continue
        mesh, report = read_mesh_report(CASES / facts["file"])
        assert report.format == f"MED {facts['format']}"
        assert report.n_turned == n_turned(mesh, facts["cells_flipped_to_positive_orientation"])
        assert report.dropped.get("vertex", 0) == facts["n_cells"].get("vertex", 0)
        assert (mesh.dim, mesh.n_points) == (facts["dim"], facts["n_nodes"])
        assert counts == {elements.get(name).meshio: len(block) for name, block in mesh.cells.items()}
        assert_box(mesh.points, facts["bounding_box"])
        assert_groups(mesh, facts)


def n_turned(mesh, flipped):
    """The facts count cells that are inside out in VTK's order; MED's own order of solids is its mirror image."""
    in_vtk_order = {name: flipped.get(elements.get(name).meshio, 0) for name in mesh.solids}
    return sum(len(mesh.cells[name]) - n if mesh.dim == 3 else n for name, n in in_vtk_order.items())


def assert_box(points, box):
    np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)], np.array(box)[:, : points.shape[1]], atol=1e-9)


def assert_groups(mesh, facts):
    derived = json.dumps(facts.get("derived_groups", []))
    for name, group in facts["cell_groups"].items():
        if name not in mesh.cell_groups:
            assert f'"new_cell_group": "{name}"' in derived
            continue
        kinds = {elements.get(kind).meshio: len(rows) for kind, rows in mesh.cells_of(name).items()}
        assert kinds == {kind: count for kind, count in group["cells"].items() if kind != "vertex"}
        nodes = np.unique(np.concatenate([block.ravel() for block in mesh.cells_of(name).values()]))
        assert len(nodes) == group["n_nodes"]
        assert_box(mesh.points[nodes], group["box"])
    for name, numbers in mesh.point_groups.items():
        group = facts["node_groups"][name]
        assert len(numbers) == group["n"]
        if "nodes_1based" in group:
            assert numbers.tolist() == sorted(node - 1 for node in group["nodes_1based"])
    for name in set(facts["node_groups"]) - set(mesh.point_groups):
        assert f'"{name}"' in derived or name in mesh.cell_groups


# There and back -----------------------------------------------------------------------------------

# MED pads names with blanks and zero bytes, so those two cannot end or stand in a name.
NAMES = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), min_size=1, max_size=80).filter(
    lambda name: len(name.encode()) <= 80 and not name.endswith(" ")
)
COORDINATES = st.floats(-1e6, 1e6)


@st.composite
def meshes(draw):
    dim = draw(st.sampled_from([2, 3]))
    n_points = draw(st.integers(2, 12))
    points = np.array(draw(st.lists(COORDINATES, min_size=n_points * dim, max_size=n_points * dim))).reshape(-1, dim)
    if dim == 3:
        points[0, 2], points[1, 2] = 0.0, 1e6  # a flat one would come back in 2D
    kinds = [name for name, element in elements.ELEMENTS.items() if element.dim <= dim]
    node, cells = st.integers(0, n_points - 1), {}
    for name in draw(st.lists(st.sampled_from(kinds), min_size=1, unique=True)):
        size, count = elements.get(name).n_nodes, draw(st.integers(1, 3))
        cells[name] = np.reshape(draw(st.lists(node, min_size=size * count, max_size=size * count)), (count, size))
    n_cells = sum(map(len, cells.values()))
    return fc.Mesh(
        points,
        cells,
        draw(st.dictionaries(NAMES, st.lists(st.integers(0, n_cells - 1)), max_size=5)),
        draw(st.dictionaries(NAMES, st.lists(node), max_size=5)),
    )


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mesh=meshes())
def test_any_mesh_comes_back_the_same(tmp_path, mesh):
    write_med_mesh(tmp_path / "any.med", mesh)
    assert_same_mesh(read_med(tmp_path / "any.med").mesh, mesh)


def test_fields_come_back_in_code_aster_component_order(tmp_path):
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0], [2.0, 2.0, 2.0]])
    mesh, path = fc.Mesh(points, {"quad4": [[0, 1, 2, 3]]}), tmp_path / "solid.med"
    steps = list(some_steps(mesh))
    fc.write_med_results(path, mesh, steps)
    times, values = read_med_field(path, "SIEF_NOEU")
    np.testing.assert_array_equal(times, [1 / 3, 2 / 3, 1.0])
    xx, yy, zz, xy, yz, xz = np.moveaxis([step.stress for step in steps], 2, 0)
    np.testing.assert_array_equal(np.moveaxis(values, 2, 0), [xx, yy, zz, xy, xz, yz])
    with h5py.File(path) as file:
        assert file["CHA/SIEF_NOEU"].attrs["NOM"].split() == b"SIXX SIYY SIZZ SIXY SIXZ SIYZ".split()
        assert file["CHA/DEPL"].attrs["NOM"].split() == b"DX DY DZ".split()
    np.testing.assert_array_equal(read_med_field(path, "REAC_NODA")[1], [step.reaction for step in steps])
    np.testing.assert_array_equal(read_med_field(path, "DEPL")[1], [step.displacement for step in steps])


def test_contact_pressure_is_zero_off_the_contact(tmp_path):
    mesh, path = all_elements(), tmp_path / "results.med"
    fc.write_med_results(path, mesh, some_steps(mesh))
    expected = np.zeros((3, mesh.n_points, 1))
    expected[:, [1, 4], 0] = np.outer([1, 2, 3], [2.5, 0.5])
    np.testing.assert_array_equal(read_med_field(path, "PRES_CONT")[1], expected)


def test_temperatures_are_written_where_heat_is_conducted(tmp_path):
    mesh, path = all_elements(), tmp_path / "hot.med"
    hot = np.linspace(20.0, 80.0, mesh.n_points)
    fc.write_med_results(path, mesh, [dataclasses.replace(step, temperature=hot) for step in some_steps(mesh)])
    np.testing.assert_array_equal(read_med_field(path, "TEMP")[1], np.tile(hot[:, None], (3, 1, 1)))


# Layouts that we do not write ---------------------------------------------------------------------


def write_characters(group, text):
    """One zero-terminated character an entry, a type for which h5py has no NumPy type of its own."""
    characters = np.frombuffer(text.encode(), "S1")
    space = h5py.h5s.create_simple(characters.shape)
    h5py.h5d.create(group.id, b"NOM", h5py.h5t.C_S1, space).write(space, space, characters, mtype=h5py.h5t.C_S1)


def write_med_2(path):
    """A file as MED 2.3 lays it out: no time step of the mesh, families in the mesh, lines apart as edges."""
    with h5py.File(path, "w") as file:
        file.create_group("INFOS_GENERALES").attrs.update(MAJ=np.int32(2), MIN=np.int32(3), REL=np.int32(6))
        mesh = file.create_group("ENS_MAA/old")
        mesh.attrs.update(DIM=np.int32(2), TYP=np.int32(0), DES=np.bytes_("old".ljust(200)))
        points = mesh.create_dataset("NOE/COO", data=[0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0])
        points.attrs.update(
            NBR=np.int32(4), REP=np.int32(0), NOM=np.bytes_("x".ljust(32)), UNI=np.bytes_("m".ljust(32))
        )
        mesh.create_dataset("NOE/FAM", data=np.int32([0, 0, 1, 0])).attrs["NBR"] = np.int32(4)
        for where, nodes, families in [("MAI/TR3", [1, 1, 2, 3, 3, 4], [-1, -2]), ("ARE/SE2", [1, 2], [0])]:
            mesh.create_dataset(f"{where}/NOD", data=np.int32(nodes)).attrs["NBR"] = np.int32(len(families))
            mesh.create_dataset(f"{where}/FAM", data=np.int32(families)).attrs["NBR"] = np.int32(len(families))
        mesh.create_group("FAS/FAMILLE_ZERO").attrs["NUM"] = np.int32(0)
        for where, number, names in [("ELEME/a", -1, ["one"]), ("ELEME/b", -2, ["one", "two"]), ("NOEUD/c", 1, ["P"])]:
            family = mesh.create_group(f"FAS/{where}")
            family.attrs["NUM"] = np.int32(number)
            group = family.create_group("GRO")
            group.attrs["NBR"] = np.int32(len(names))
            write_characters(group, "".join(name.ljust(80) for name in names) + "\0")


def test_reads_med_2(tmp_path):
    write_med_2(tmp_path / "old.med")
    mesh, report = read_mesh_report(tmp_path / "old.med")
    assert (report.format, report.mesh_name) == ("MED 2.3.6", "old")
    expected = fc.Mesh(
        [[0, 0], [1, 0], [1, 1], [0, 1]],
        {"tri3": [[0, 1, 2], [0, 2, 3]], "line2": [[0, 1]]},
        {"one": [0, 1], "two": [1]},
        {"P": [2]},
    )
    assert_same_mesh(mesh, expected)


def test_reads_med_2_as_the_med_library_converts_it(tmp_path):
    write_med_2(tmp_path / "old.med")
    code, said = run("medimport", tmp_path / "old.med", tmp_path / "new.med")
    assert code == 0, said
    with h5py.File(tmp_path / "new.med") as file:
        assert file["INFOS_GENERALES"].attrs["MAJ"] >= 3
    assert_same_mesh(read_med(tmp_path / "new.med").mesh, read_med(tmp_path / "old.med").mesh)


def test_first_of_several_time_steps_is_read(tmp_path):
    path = tmp_path / "moving.med"
    with changed(path) as (mesh, first):
        mesh.copy(first, f"{1:020d}{-1:020d}")
        later = mesh[f"{1:020d}{-1:020d}"]
        later.attrs["NDT"] = 1
        later["NOE/COO"][...] += 100.0
    assert_same_mesh(read_med(path).mesh, all_elements())


def test_numbers_and_families_may_be_absent(tmp_path):
    path = tmp_path / "bare.med"
    with changed(path) as (mesh, step):
        del mesh.file["FAS"]
        for entry in [step["NOE"], *step["MAI"].values()]:
            del entry["FAM"]
    mesh = read_med(path).mesh
    assert mesh.group_names == []
    np.testing.assert_array_equal(mesh.cells["tri6"], all_elements().cells["tri6"])


def add_vertices(path, points, family):
    with h5py.File(path, "a") as file:
        entry = next(iter(file["ENS_MAA/mesh"].values()))["MAI"].create_group("PO1")
        for name, data in {"NOD": np.int32(points) + 1, "FAM": np.full(len(points), family, np.int32)}.items():
            entry.create_dataset(name, data=data).attrs["NBR"] = len(points)


def test_groups_of_vertex_cells_become_groups_of_points(tmp_path):
    path = tmp_path / "vertices.med"
    write_med_mesh(path, fc.Mesh([[0, 0], [1, 0], [0, 1]], {"tri3": [[0, 1, 2]]}, {"corners": []}, {"P": [1]}))
    add_vertices(path, [0, 2], family=-1)
    mesh, report = read_mesh_report(path)
    assert mesh.point_groups["corners"].tolist() == [0, 2]
    assert list(mesh.cell_groups) == []
    assert dict(report.dropped) == {"vertex": 2}


def test_points_lost_from_a_mixed_group_are_counted(tmp_path):
    path = tmp_path / "mixed.med"
    write_med_mesh(path, fc.Mesh([[0, 0], [1, 0], [0, 1], [5, 5]], {"tri3": [[0, 1, 2]]}, {"mixed": [0]}))
    add_vertices(path, [0, 3], family=-1)
    with pytest.warns(FastcontactWarning, match="'mixed'.* 1 points"):
        assert read_med(path).mesh.cell_groups["mixed"].tolist() == [0]


# Errors -------------------------------------------------------------------------------------------


def test_no_mesh_and_two_meshes(tmp_path):
    path = tmp_path / "meshes.med"
    with h5py.File(path, "w"):
        pass
    refused(FileError, "contains no MED mesh", read_med, path)
    write_med_mesh(path, all_elements(), mesh_name="upper")
    with h5py.File(path, "a") as file:
        file.copy("ENS_MAA/upper", "ENS_MAA/lower")
    refused(FileError, r"2 meshes \('lower', 'upper'\): choose one with mesh_name", read_med, path)
    refused(FileError, "unknown mesh 'uper': did you mean 'upper'", read_med, path, mesh_name="uper")
    assert_same_mesh(read_med(path, mesh_name="upper").mesh, all_elements())


def test_unknown_kinds_are_named_and_counted(tmp_path):
    path = tmp_path / "foreign.med"
    with changed(path) as (_, step):
        step["MAI"].move("TR6", "TR7")
        step["MAI"].create_dataset("POG/INN", data=[1, 4, 8, 13])
    refused(MeshError, r"3 cells of kind POG, 2 cells of kind TR7.*use only.* SE2", read_med, path)


@pytest.mark.parametrize(("attribute", "value", "message"), [("TYP", 1, "structured grid"), ("REP", 1, "cylindrical")])
def test_meshes_of_another_kind(tmp_path, attribute, value, message):
    path = tmp_path / "other.med"
    with changed(path) as (mesh, _):
        mesh.attrs[attribute] = value
    refused(MeshError, f"mesh 'mesh' of .*{message}", read_med, path)


@pytest.mark.parametrize(
    ("where", "values", "message"),
    [
        ("MAI/TR3/NOD", [1, 2, 71, 3, 4, 5], "refers to node 71, but nodes go from 1 to 70"),
        ("MAI/TR3/NOD", [1, 2, 3, 4, 5], "5 node numbers, which is not a multiple of 3"),
        ("MAI/TR3/FAM", [0], "1 family numbers for 2 cells"),
        ("NOE/COO", np.zeros(141), "141 coordinates for 70 nodes"),
        ("NOE/COO", np.zeros(70), "its points have one coordinate"),
        ("NOE/COO", None, "COO' of .* is missing"),
        ("MAI/TR3/NOD", None, "TR3 cells have no nodal connectivity"),
        ("NOE", None, "it has no nodes"),
        ("MAI", None, "no cells"),
    ],
)
def test_damage_is_named(tmp_path, where, values, message):
    path = tmp_path / "damaged.med"
    with changed(path) as (_, step):
        attributes = dict(step[where].attrs)
        del step[where]
        if values is not None:
            step[where] = np.asarray(values)
            step[where].attrs.update(attributes)
    refused((FileError, MeshError), message, read_med, path)


def test_family_that_is_not_described_is_counted(tmp_path):
    path = tmp_path / "family.med"
    with changed(path) as (_, step):
        step["NOE/FAM"][:3] = 77
    with pytest.warns(FastcontactWarning, match="3 cells or points belong to family 77"):
        read_med(path)


def test_links_out_of_the_file_are_refused(tmp_path):
    write_med_mesh(tmp_path / "target.med", all_elements())
    with h5py.File(tmp_path / "linked.med", "w") as file:
        file.create_group("ENS_MAA")["mesh"] = h5py.ExternalLink("target.med", "/ENS_MAA/mesh")
        file["soft"] = h5py.SoftLink("/ENS_MAA/mesh")
    refused(FileError, "refers to another file at '/ENS_MAA/mesh'", read_med, tmp_path / "linked.med")


def test_values_in_another_file_are_refused(tmp_path):
    path = tmp_path / "outside.med"
    for make in ("external", "virtual"):
        np.zeros(140).tofile(tmp_path / "numbers.bin")
        with changed(path) as (_, step):
            points = step["NOE"]
            del points["COO"]
            if make == "external":
                points.create_dataset("COO", 140, float, external=[(str(tmp_path / "numbers.bin"), 0, 140 * 8)])
            else:
                layout = h5py.VirtualLayout(140, float)
                layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "x", 140)
                points.create_virtual_dataset("COO", layout)
        refused(FileError, r"COO' of .* stores its values in another file", read_med, path)


def test_soft_links_inside_the_file_are_followed(tmp_path):
    path = tmp_path / "soft.med"
    with changed(path) as (mesh, _):
        mesh.file.move("ENS_MAA/mesh", "elsewhere")
        mesh.file["ENS_MAA/mesh"] = h5py.SoftLink("/elsewhere")
    assert read_med(path).mesh.n_points == 70


@pytest.mark.parametrize(
    ("name", "message"),
    [("g" * 81, "81 bytes, but MED allows 1 to 80"), ("é" * 41, "82 bytes"), ("", "0 bytes"), ("end ", "blank")],
)
def test_names_that_med_cannot_hold(tmp_path, name, message):
    path = tmp_path / "names.med"
    write_med_mesh(path, all_elements())
    before = path.read_bytes()
    refused(FileError, message, write_med_mesh, path, all_elements().with_groups(points={name: [0]}))
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["names.med"]


def test_mesh_name_with_a_slash(tmp_path):
    refused(FileError, "contains a slash", write_med_mesh, tmp_path / "slash.med", all_elements(), mesh_name="a/b")


def test_failed_results_leave_the_old_file(tmp_path):
    mesh, path = all_elements(), tmp_path / "results.med"
    path.write_text("precious")

    def breaks_off():
        yield from some_steps(mesh, 2)
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fc.write_med_results(path, mesh, breaks_off())
    refused(FileError, "no step to write", fc.write_med_results, path, mesh, [])
    with pytest.raises(FileError, match="two steps have the index 1"):
        fc.write_med_results(path, mesh, [*some_steps(mesh, 1), *some_steps(mesh, 1)])
    smaller = fc.Mesh(mesh.points[:5], {"line2": [[0, 1]]})
    with pytest.raises(MeshError, match=r"stress of step 1 has shape \(70, 4\) where the mesh needs \(5, 4\)"):
        fc.write_med_results(path, smaller, some_steps(mesh))
    assert path.read_text() == "precious"
    assert [entry.name for entry in tmp_path.iterdir()] == ["results.med"]


def test_unknown_field_offers_near_names(tmp_path):
    path = tmp_path / "results.med"
    fc.write_med_results(path, all_elements(), some_steps(all_elements()))
    refused(FileError, "unknown field 'SIEF_NOUE': did you mean 'SIEF_NOEU'", read_med_field, path, "SIEF_NOUE")
    with h5py.File(path, "a") as file:
        for instant in file["CHA/DEPL"].values():
            instant.move("NOE", "MAI.TR3")
    refused(FileError, r"'DEPL' of .* has no values at nodes", read_med_field, path, "DEPL")
