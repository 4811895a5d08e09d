"""Material constants from files: the same bits as arrays, a graded bar, other orders, groups, mistakes."""

import h5py
import meshio
import numpy as np
import pytest
from case_texts import of_block
from mechanics import in_space
from refusals import refused

import fastcontact as fc
from fastcontact.cases.case import read_case
from fastcontact.mesh import elements
from fastcontact.mesh.files.med import add_field, add_mesh, new_file

pytestmark = pytest.mark.usefixtures("meshio_here")


def middles_of(mesh):
    return np.concatenate([mesh.points[block].mean(axis=1) for block in mesh.solids.values()])


def graded(places):
    return 1000.0 + 500.0 * places[:, 0]


def vtu(path, mesh, order=None, extra=None):
    """All solid cells, in another order where one is given; `extra` cells of a further block far away."""
    ((kind, block),) = mesh.solids.items()
    block = block if order is None else block[order]
    values = graded(mesh.points[block].mean(axis=1))
    point_data = {"E": graded(mesh.points)}
    meshio.write(
        path,
        meshio.Mesh(
            in_space(mesh.points), [(elements.get(kind).meshio, block)], point_data=point_data,
            cell_data={"E": [values], "vectors": [np.ones((len(block), 3))], **(extra or {})},
        ),
    )  # fmt: skip
    return path


def med(path, mesh, instants=1, gauss=1):
    ((kind, block),) = mesh.solids.items()
    values = graded(mesh.points[block].mean(axis=1))
    with new_file(path, mesh) as file:
        add_mesh(file, mesh, "mesh")
        for number in range(instants):
            add_field(file, "E", ("E",), np.zeros((mesh.n_points, 1)), (number, float(number)), "mesh")
            step = list(file["CHA/E"].values())[-1]
            support = step["NOE"]
            del step["NOE"]["MED_NO_PROFILE_INTERNAL"]["CO"]
            step.move("NOE", f"MAI.{elements.get(kind).med}")
            profile = support["MED_NO_PROFILE_INTERNAL"]
            profile.create_dataset("CO", data=np.repeat(values * (number + 1), gauss))
            profile.attrs["NGA"] = gauss
    return path


def vtkhdf(path, mesh):
    model = fc.Model(mesh, "plane_stress" if mesh.dim == 2 else "3d")
    ((_, block),) = mesh.solids.items()
    with h5py.File(path, "w") as file:
        grid = file.create_group("VTKHDF")
        grid["NumberOfPoints"], grid["NumberOfCells"] = [mesh.n_points], [len(block)]
        grid["Points"] = in_space(mesh.points)
        grid["Connectivity"], grid["Offsets"] = block.ravel(), block.shape[1] * np.arange(len(block) + 1)
        grid["CellData/E"] = graded(mesh.points[block].mean(axis=1))
    assert model.n_dofs == mesh.points.size
    return path


MESHES = {
    "quad8": lambda: fc.generate.block((2.0, 1.0), (5, 3), "quad8"),
    "tet10": lambda: fc.generate.box((2.0, 1.0, 1.0), (2, 1, 1), "tet10"),
}


@pytest.mark.parametrize("element", list(MESHES))
@pytest.mark.parametrize("kind", ["med", "vtu", "vtk", "vtkhdf"])
def test_a_field_over_cells_is_that_array(tmp_path, kind, element):
    mesh, path = MESHES[element](), tmp_path / f"scan.{kind}"
    {"med": med, "vtkhdf": vtkhdf}.get(kind, vtu)(path, mesh)
    found = fc.read_field(mesh, path, "E")
    assert found.shape == (len(middles_of(mesh)), 1)
    np.testing.assert_allclose(found[:, 0], graded(middles_of(mesh)), rtol=1e-14)
    if kind in ("vtu", "vtk"):
        np.testing.assert_allclose(fc.read_field(mesh, path, "E", over="points"), graded(mesh.points), rtol=1e-14)


def test_cells_in_another_order_and_of_a_group(tmp_path):
    mesh = fc.generate.block_on_block("quad4", divisions_lower=(4, 2), divisions_upper=(3, 2))
    order = np.random.default_rng(1).permutation(len(mesh.cells["quad4"]))
    path = vtu(tmp_path / "mixed.vtu", mesh, order)
    np.testing.assert_allclose(fc.read_field(mesh, path, "E")[:, 0], graded(middles_of(mesh)), rtol=1e-14)
    upper = fc.read_field(mesh, path, "E", groups="UPPER")
    rows = mesh.cells_of("UPPER")["quad4"]
    np.testing.assert_allclose(upper[:, 0], graded(mesh.points[rows].mean(axis=1)), rtol=1e-14)
    points = fc.read_field(mesh, path, "E", over="points", groups=["UPPER"])
    members = mesh.points_of("UPPER")
    np.testing.assert_allclose(points[members], graded(mesh.points)[members], rtol=1e-14)
    assert np.isfinite(points).all()


PULLED = '[[traction]]\ngroup = "RIGHT"\nx = 2.0'
CASE = of_block(PULLED, material="E = {}\nnu = 0.0", LEFT="x", BOTTOM="y")


@pytest.fixture
def folder(tmp_path):
    mesh = fc.generate.block((2.0, 1.0), (20, 2), "quad8")
    fc.write_mesh(tmp_path / "block.med", mesh)
    vtu(tmp_path / "scan.vtu", mesh)
    med(tmp_path / "scan.med", mesh, instants=2)
    med(tmp_path / "gauss.med", mesh, gauss=4)
    vtu(tmp_path / "coarse.vtu", fc.generate.block((2.0, 1.0), (5, 2), "quad8"))
    return tmp_path


def case(folder, E):
    (folder / "case.toml").write_text(CASE.format(E))
    return read_case(folder / "case.toml").model


@pytest.mark.parametrize(
    ("E", "scale", "within"),
    [
        ("{file = 'scan.vtu', field = 'E'}", 1.0, 1e-3),
        ("{file = 'scan.vtu', field = 'E', over = 'points'}", 1.0, 1e-5),
        ("{file = 'scan.med', field = 'E', instant = 1.0}", 2.0, 1e-3),
    ],
)
def test_a_graded_bar_of_a_case_file(folder, E, scale, within):
    """``u = integral of p / E(x)``, with E piecewise constant over cells of a tenth, or the line itself."""
    model = case(folder, E)
    step = fc.solve(model, 1)[-1]
    exact = 2.0 / 500.0 * np.log(2000.0 / 1000.0) / scale
    end = model.mesh.point("TOP_RIGHT")
    assert step.displacement[end, 0] == pytest.approx(exact, rel=within)


@pytest.mark.parametrize(
    ("E", "message"),
    [
        ("{file = 'scan.vtu'}", "needs 'field', the name of the field in the file"),
        ("{file = 'scan.vtu', field = 'F'}", "unknown field of cells 'F'"),
        ("{file = 'scan.vtu', field = 'vectors'}", "has 3 components: a field with a single number per cell is needed"),
        ("{file = 'scan.vtu', field = 'E', over = 'nodes'}", "over must be cells or points, not 'nodes'"),
        ("{file = 'scan.vtu', field = 'E', instant = 1.0}", "has no times: omit instant"),
        ("{file = 'scan.med', field = 'E'}", "has 2 instants: select one with instant"),
        ("{file = 'scan.med', field = 'E', instant = 0.4}", "has no instant 0.4, the nearest is 0"),
        ("{file = 'gauss.med', field = 'E'}", "has 4 values per cell, at integration points"),
        ("{file = 'block.med', field = 'E'}", "unknown field 'E'"),
        ("{file = 'coarse.vtu', field = 'E'}", r"has no cell where \d+ cells of the mesh are"),
        ("{file = 'no.vtu', field = 'E'}", "does not exist"),
    ],
)
def test_mistakes_are_told(folder, E, message):
    refused(fc.FastcontactError, message, case, folder, E)


def test_other_mistakes(folder, tmp_path):
    mesh = fc.read_mesh(folder / "block.med")
    refused(fc.MeshError, "unknown group of cells 'TUP'", fc.read_field, mesh, folder / "scan.vtu", "E", groups="TUP")
    with pytest.raises(fc.MeshError, match="the groups TOP contain no solid cells"):
        fc.read_field(mesh, folder / "scan.vtu", "E", groups="TOP")
    path = vtkhdf(tmp_path / "scan.vtkhdf", mesh)
    refused(fc.FileError, "unknown field of cells 'F'", fc.read_field, mesh, path, "F")
    with h5py.File(path, "a") as file:
        file["VTKHDF/Connectivity"][0] = mesh.n_points
    refused(fc.FileError, "refers to a missing point", fc.read_field, mesh, path, "E")
    with h5py.File(path, "a") as file:
        del file["VTKHDF/NumberOfCells"]
        file["VTKHDF/NumberOfCells"] = [1, 1]
    refused(fc.FileError, "has several instants or parts", fc.read_field, mesh, path, "E")
    with h5py.File(path, "a") as file:
        del file["VTKHDF/Points"]
    refused(fc.FileError, "contains no unstructured grid of VTK", fc.read_field, mesh, path, "E")
    med(tmp_path / "holes.med", mesh)
    with h5py.File(tmp_path / "holes.med", "a") as file:
        (step,) = file["CHA/E"].values()
        step["MAI.QU8/MED_NO_PROFILE_INTERNAL/CO"][3] = np.nan
    refused(fc.MeshError, "has no value at 1 cells", fc.read_field, mesh, tmp_path / "holes.med", "E")
    with h5py.File(tmp_path / "holes.med", "a") as file:
        (step,) = file["CHA/E"].values()
        step.move("MAI.QU8", "MAI.TR6")
    with pytest.raises(fc.FileError, match="is on TR6 cells, which its mesh does not have"):
        fc.read_field(mesh, tmp_path / "holes.med", "E")
    with h5py.File(tmp_path / "holes.med", "a") as file:
        (step,) = file["CHA/E"].values()
        step.move("MAI.TR6", "NOE")
    with pytest.raises(fc.FileError, match="has no values at cells in the layout of MED 3 or 4"):
        fc.read_field(mesh, tmp_path / "holes.med", "E")
    with h5py.File(tmp_path / "holes.med", "a") as file:
        del file["ENS_MAA"]
    with pytest.raises(fc.FileError, match="is on the mesh 'mesh', which is in another file"):
        fc.read_field(mesh, tmp_path / "holes.med", "E")
