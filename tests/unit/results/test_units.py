"""Units of a model: read from a text, shown in all outputs, without effect on numbers."""

import numpy as np
import pytest

import fastcontact as fc


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
