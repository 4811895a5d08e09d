"""Results for PyVista, pandas and xarray: all steps, with the numbers of the file; a missing library is reported."""

import sys

import numpy as np
import pytest

import fastcontact as fc

CASE = 'title = "small"\nunits = { length = "mm", force = "N", pressure = "MPa" }\n'


@pytest.fixture(scope="module", params=["2d", "3d"])
def results(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("conversions") / "result.vtkhdf"
    if request.param == "2d":
        model = fc.Model(fc.generate.half_spheres(size=25.0), kinematics="axisymmetric", case_text=CASE)
        model.prescribe("A2B2", y=-2.0)
        model.prescribe("A1B1", y=2.0)
        pair = {"secondary": "CONT1", "primary": "CONT2"}
    else:
        mesh = fc.generate.sphere_on_block(R=1.0, size=0.5, contact_size=0.3, contact_radius=0.3)
        model = fc.Model(mesh, kinematics="3d", case_text=CASE)
        for group, axis in (("SYMMETRY_X", "x"), ("SYMMETRY_Z", "z"), ("BLOCK_BOTTOM", "y")):
            model.fix(group, axis)
        model.prescribe("SPHERE_TOP", y=-0.02)
        pair = {"secondary": "CONT_SPHERE", "primary": "CONT_BLOCK"}
    model.add_material(fc.LinearElastic(E=20_000.0, nu=0.3))
    model.add_contact("hertz", **pair)
    with fc.ResultWriter(path, model, case_text=CASE) as out:
        fc.solve(model, 2, on_step=out.write)
    with fc.open_results(path) as found:
        yield found


@pytest.mark.filterwarnings("ignore")
def test_pyvista_gets_all_steps_as_a_series(results):
    pytest.importorskip("pyvista")
    blocks = results.to_pyvista()
    assert list(blocks.keys()) == ["step 1", "step 2"]
    for block, step in zip(blocks, results, strict=True):
        assert block.field_data["load_factor"][0] == step.load_factor
        dim = results.mesh.dim
        np.testing.assert_array_equal(block.point_data["displacement"][:, :dim], step.displacement)
        np.testing.assert_array_equal(block.point_data["von_mises"], step.von_mises)
        assert block.n_cells == sum(map(len, results.mesh.solids.values()))
    one = results.to_pyvista(-1)
    np.testing.assert_array_equal(one.point_data["displacement"], blocks[1].point_data["displacement"])
    np.testing.assert_array_equal(results.to_pyvista(results[0]).point_data["von_mises"], results[0].von_mises)


def test_pandas_gets_the_contact_tables_of_all_steps(results):
    pytest.importorskip("pandas")
    frame = results.to_pandas()
    assert list(frame.columns[:3]) == ["step", "load_factor", "contact"]
    assert len(frame) == sum(len(contact.points) for step in results for contact in step.contact.values())
    for step in results:
        rows = frame[(frame["step"] == step.index) & (frame["contact"] == "hertz")]
        table = fc.contact_table(step.contact["hertz"], step)
        for name in table.dtype.names:
            np.testing.assert_array_equal(rows[name].to_numpy(), table[name])
    largest = frame.groupby("step")["pressure"].max()
    assert largest[2] == results[-1].contact["hertz"].pressure_max


def test_xarray_gets_the_fields_of_all_steps(results):
    pytest.importorskip("xarray")
    data = results.to_xarray()
    dim = results.mesh.dim
    assert data.sizes["step"] == 2
    assert data.sizes["point"] == results.mesh.n_points
    assert data.sizes["stress_component"] == (4 if dim == 2 else 6)
    for number, step in enumerate(results):
        at = data.isel(step=number)
        assert float(at["load_factor"]) == step.load_factor
        for name in ("displacement", "stress", "von_mises", "von_mises_signed", "reaction"):
            np.testing.assert_array_equal(at[name].to_numpy(), getattr(step, name))
        contact = step.contact["hertz"]
        np.testing.assert_array_equal(at["contact_force"].sel(contact="hertz").to_numpy(), contact.force)
        assert float(at["contact_pressure_max"].sel(contact="hertz")) == contact.pressure_max
        np.testing.assert_array_equal(at["contact_pressure"].to_numpy()[contact.points], contact.pressure)
    np.testing.assert_array_equal(data.sel(step=2)["stress"].sel(stress_component="yy"), results[-1].stress[:, 1])
    np.testing.assert_array_equal(data["x"], results.mesh.points[:, 0])
    assert data["displacement"].attrs["units"] == "mm"
    assert data["stress"].attrs["units"] == "MPa"


@pytest.mark.parametrize(
    ("library", "method"), [("pyvista", "to_pyvista"), ("pandas", "to_pandas"), ("xarray", "to_xarray")]
)
def test_a_missing_library_is_told(library, method, results, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(fc.FileError, match=f"(?i){library} is not installed: pip install"):
        getattr(results, method)()
