"""Results for PyVista, pandas and xarray, and the units of a model in all outputs."""

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


def pressed(n=8, units="mm, N, MPa", kinematics="plane_strain"):
    model = fc.Model(fc.generate.block((4.0, 2.0), (n, n // 2)), kinematics=kinematics, units=units)
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    model.fix("BOTTOM", "xy")
    disc = fc.obstacles.Sphere((2.0, 7.0), 5.0)
    model.add_obstacle("disc", secondary="TOP", obstacle=disc, motion={"y": -0.05}, formulation="node_to_segment")
    return model


@pytest.fixture(scope="module")
def steps():
    return fc.solve(pressed(), 2)


def test_steps_show_the_units_and_no_number_depends_on_them(steps):
    plain = fc.solve(pressed(units=""), 2)
    assert np.array_equal(plain[-1].displacement, steps[-1].displacement)
    assert " N/mm, largest pressure" in repr(steps[-1])
    assert "N/mm" not in repr(plain[-1])
    contact = steps[-1].contact["disc"]
    assert repr(contact).endswith(" mm)")
    assert f"{contact.pressure_max:.6g} MPa" in contact._repr_html_()
    assert fc.plot.pressure_profile(contact).get_ylabel() == "contact pressure [MPa]"
    assert fc.plot.pressure_profile(contact, units={"pressure": "bar"}).get_ylabel() == "contact pressure [bar]"
    assert fc.plot.pressure_profile(plain[-1].contact["disc"]).get_ylabel() == "contact pressure"
    assert fc.plot.history(steps, "disc")[0].get_ylabel() == "contact force [N/mm]"


def test_result_files_keep_the_units(steps, tmp_path):
    with fc.ResultWriter(tmp_path / "a.vtkhdf", pressed()) as out:
        out.write(steps[-1])
    with fc.ResultWriter(tmp_path / "b.vtkhdf", pressed(units="")) as out:
        out.write(steps[-1])
    found = fc.open_results(tmp_path / "a.vtkhdf")
    assert found.units == dict(steps[-1].units)
    assert found[-1].shown == steps[-1].shown
    assert fc.open_results(tmp_path / "b.vtkhdf").units == {}


def test_tables_of_pandas_have_the_units_by_column(steps, tmp_path):
    pytest.importorskip("pandas")
    with fc.ResultWriter(tmp_path / "a.vtkhdf", pressed()) as out:
        out.write(steps[-1])
    units = fc.open_results(tmp_path / "a.vtkhdf").to_pandas().attrs["units"]
    assert [units[name] for name in ("x", "gap", "pressure", "force_y", "von_mises")] == [
        "mm",
        "mm",
        "MPa",
        "N/mm",
        "MPa",
    ]
    assert not {"point", "active", "multiplier"} & {*units}


def test_studies_of_functions_show_the_units_of_standard_quantities():
    named = {"highest": lambda steps: max(step.contact["disc"].pressure_max for step in steps)}
    down = fc.Ramp((1.0, 2.0), ((0.0, 0.0), (1.0, 1.0), (2.0, 0.5)))
    found = fc.parameter_sweep(lambda n: fc.solve(pressed(n), down), [4, 8], quantities=named)
    (_, rows), *_ = found.tables()
    assert "force [N/mm]" in rows[0]
    assert "highest" in rows[0]  # what the caller's own functions return has no unit that is known
    assert all(point.values["highest"] > 1.2 * point.values["pressure_max"] for point in found.points)


@pytest.mark.parametrize(
    ("units", "message"),
    [
        ("mm, N", "units = 'mm, N' must be the units of length, force and pressure in this order"),
        ("N, mm, MPa", "'N' is a unit of force, not of length"),
        ({"mass": "t"}, "unknown kind of unit 'mass'"),
    ],
)
def test_what_names_no_units_is_told(units, message):
    with pytest.raises(fc.ModelError, match=message):
        pressed(units=units)


def test_units_that_do_not_fit_are_told():
    with pytest.warns(fc.FastcontactWarning, match=r"1 N/m\^2 is 1e-06 MPa"):
        fc.solve(pressed(4, "m, N, MPa"), 1)


def test_a_case_file_takes_the_units_as_a_text(tmp_path):
    from fastcontact.cases.case import read_case

    text = 'kinematics = "plane_strain"\nunits = "mm, N, MPa"\n[mesh]\ngenerator = "block"\n'
    text += "[[material]]\nE = 1000.0\nnu = 0.3\n"
    (tmp_path / "case.toml").write_text(text + '[[support]]\ngroup = "BOTTOM"\nx = 0.0\ny = 0.0\n')
    assert read_case(tmp_path / "case.toml").units == {"length": "mm", "force": "N", "pressure": "MPa"}
    (tmp_path / "case.toml").write_text(text.replace("mm, N", "N, mm"))
    with pytest.raises(fc.ModelError, match="'N' is a unit of force"):
        read_case(tmp_path / "case.toml")
