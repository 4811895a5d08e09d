"""Results for PyVista, pandas and xarray, units in all outputs, and stress at material interfaces."""

import importlib.util
import json
import sys

import h5py
import numpy as np
import pytest
from models import supported, with_obstacle
from refusals import refused

import fastcontact as fc
from fastcontact.cli import main
from fastcontact.elasticity.material_sides import material_sides
from fastcontact.results import layout
from fastcontact.results.layout import cut_at_interfaces, mean_in_cells

CASE = 'title = "small"\nunits = { length = "mm", force = "N", pressure = "MPa" }\n'


@pytest.fixture(scope="module", params=["2d", "3d"])
def results(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("conversions") / "result.vtkhdf"
    if request.param == "2d":
        model = fc.Model(fc.generate.half_spheres(size=25.0), kinematics="axisymmetric", case_text=CASE)
        supported(model, A2B2={"y": -2.0}, A1B1={"y": 2.0})
        pair = {"secondary": "CONT1", "primary": "CONT2"}
    else:
        mesh = fc.generate.sphere_on_block(R=1.0, size=0.5, contact_size=0.3, contact_radius=0.3)
        model = fc.Model(mesh, kinematics="3d", case_text=CASE)
        supported(model, SYMMETRY_X="x", SYMMETRY_Z="z", BLOCK_BOTTOM="y", SPHERE_TOP={"y": -0.02})
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
    assert frame.groupby("step")["pressure"].max()[2] == results[-1].contact["hertz"].pressure_max


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


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("name", "med", "caption"),
    [
        ("damage", "ENDO_CONT", "damage"),
        ("fluid_pressure", "PRES_FLUI", "fluid pressure [MPa]"),
        ("wear", "USUR_CONT", "wear depth [mm]"),
    ],
)
def test_fields_of_special_contacts_are_in_every_export(name, med, caption, tmp_path):
    model = fc.Model(fc.generate.block_on_block(), "plane_strain", units="mm, N, MPa")
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.0))
    model.fix("LOWER_BOTTOM", "xy")
    sides = {"secondary": "CONT_UPPER", "primary": "CONT_LOWER"}
    if name == "damage":
        model.prescribe("UPPER_TOP", x=0.0, y=0.1)
        model.add_contact("joint", **sides, cohesion={"strength": 10.0, "energy": 0.2})
    elif name == "wear":
        model.prescribe("UPPER_TOP", x=0.1, y=-0.01)
        model.add_contact("joint", **sides, friction=0.1, wear=1e-4)
    else:
        model.prescribe("UPPER_TOP", x=0.0, y=-0.01)
        model.add_contact("joint", **sides)
        model.add_fluid_pressure("joint", 50.0, source="UPPER_BOTTOM_LEFT", ramp=[(0, 0), (1, 0), (3, 2)])
    path, field = tmp_path / "joint.vtkhdf", f"contact_{name}"
    with fc.ResultWriter(path, model) as out:
        fc.solve(model, [1.0, 2.0], on_step=out.write)
    with fc.open_results(path) as results:
        steps = list(results)
        contact = steps[-1].contact["joint"]
        expected = np.zeros(model.mesh.n_points)
        expected[contact.points] = getattr(contact, name)
        assert expected.any()
        assert name != "fluid_pressure" or contact.normal_force == 0.0 < contact.force[1]
        table = fc.contact_table(contact)
        assert dict(zip(table["point"], table[name])) == dict(zip(contact.points, getattr(contact, name)))
        np.testing.assert_array_equal(layout.contact_fields(model.mesh, steps[-1])[field], expected)
        if importlib.util.find_spec("pandas"):
            frame = results.to_pandas()
            np.testing.assert_array_equal(frame[frame["step"] == 2][name], table[name])
        if importlib.util.find_spec("pyvista"):
            np.testing.assert_array_equal(results.to_pyvista(-1).point_data[field], expected)
        if importlib.util.find_spec("xarray"):
            np.testing.assert_array_equal(results.to_xarray()[field][-1], expected)
    with h5py.File(path) as file:
        stored = file[f"VTKHDF/PointData/{field}"][()].reshape(2, -1)
        assert file[f"VTKHDF/Steps/PointDataOffsets/{field}"][()].tolist() == [0, model.mesh.n_points]
    np.testing.assert_array_equal(stored[-1], expected)
    assert main(["export", str(path), "--med", str(tmp_path / "j.med"), "--xdmf", str(tmp_path / "j.xdmf"), "-q"]) == 0
    np.testing.assert_array_equal(fc.read_med_field(tmp_path / "j.med", med)[1][:, :, 0], stored)
    assert f'Name="{field}"' in (tmp_path / "j.xdmf").read_text()
    assert main(["plot", str(path), "--png", str(tmp_path / "j.png"), "--field", field, "-q"]) == 0
    axes = fc.plot.deformed_shape(model.mesh, steps[-1], field=field, units=model.units)
    assert caption in [other.get_ylabel() for other in axes.figure.axes]
    with h5py.File(path, "r+") as file:  # as earlier versions wrote it
        del file[f"VTKHDF/PointData/{field}"], file[f"VTKHDF/Steps/PointDataOffsets/{field}"]
    with fc.ResultWriter(path, model, resume=True) as out:
        fc.solve(model, [1.0, 2.0, 3.0], on_step=out.write, resume=out.done)
    with fc.open_results(path) as results:
        assert field not in results.point_field_names
        np.testing.assert_array_equal(getattr(results[1].contact["joint"], name), getattr(contact, name))
        assert getattr(results[2].contact["joint"], name).any()


@pytest.mark.parametrize(
    ("library", "method"), [("pyvista", "to_pyvista"), ("pandas", "to_pandas"), ("xarray", "to_xarray")]
)
def test_a_missing_library_is_told(library, method, results, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    refused(fc.FileError, f"(?i){library} is not installed: pip install", getattr(results, method))


def pressed(n=8, units="mm, N, MPa", kinematics="plane_strain"):
    model = fc.Model(fc.generate.block((4.0, 2.0), (n, n // 2)), kinematics=kinematics, units=units)
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    model.fix("BOTTOM", "xy")
    disc = fc.obstacles.Sphere((2.0, 7.0), 5.0)
    return with_obstacle(model, "disc", "TOP", disc, motion={"y": -0.05}, formulation="node_to_segment")


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
    assert fc.plot.pressure_profile(contact, units="in, lbf, psi").get_ylabel() == "contact pressure [psi]"
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
    refused(fc.ModelError, message, pressed, units=units)


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
    refused(fc.ModelError, "'N' is a unit of force", read_case, tmp_path / "case.toml")


STRAIN = -0.01
MODULI = (1.0, 1000.0)
ELEMENTS = ("tri3", "tri6", "quad4", "quad8", "hex8", "tet4", "tet10", "wedge6", "pyramid5")


def bars(element, first=0, softer=None):
    """Return a model of two bars side by side, glued, pressed by the same strain; `first` is the material added first."""
    solid = element in ("hex8", "tet4", "tet10", "wedge6", "pyramid5")
    sizes = ((2.0, 1.0, 1.0), (4, 2, 2)) if solid else ((2.0, 1.0), (4, 2))
    mesh = (fc.generate.box if solid else fc.generate.block)(*sizes, element)
    groups = {}
    for number, side in enumerate((lambda x: x < 1, lambda x: x > 1)):
        cells = [
            mesh.offsets[name] + np.flatnonzero(side(mesh.points[block].mean(axis=1)[:, 0]))
            for name, block in mesh.solids.items()
        ]
        groups[f"BAR{number}"] = np.concatenate(cells)
    mesh = mesh.with_groups(cells=groups)
    model = fc.Model(mesh, "3d" if solid else "plane_strain")
    for number in (first, 1 - first):
        model.add_material(fc.LinearElastic(MODULI[number] if softer is None else softer, 0.0), groups=[f"BAR{number}"])
    up = "z" if solid else "y"
    supported(model, **{"ZMIN" if solid else "BOTTOM": up, "XMIN" if solid else "LEFT": "x"})
    if solid:
        model.fix("YMIN", "y")
    model.prescribe("ZMAX" if solid else "TOP", **{up: STRAIN})
    return model, "xyz".index(up)


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("element", ELEMENTS)
def test_no_stress_is_averaged_across_a_border(element, first):
    model, up = bars(element, first)
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    x = model.mesh.points[:, 0]
    border = np.isclose(x, 1.0)
    stiff, soft = STRAIN * MODULI[1], STRAIN * MODULI[0]
    np.testing.assert_allclose(step.stress[x < 1 - 1e-9, up], soft, rtol=1e-8)
    np.testing.assert_allclose(step.stress[border, up], stiff, rtol=1e-8)  # the side with the larger von Mises stress
    found = step.material_stress
    assert set(found.points) == set(np.flatnonzero(border))
    np.testing.assert_allclose(step.stress_of_material(first)[border, up], soft, rtol=1e-8)
    np.testing.assert_allclose(step.stress_of_material(1 - first)[border, up], stiff, rtol=1e-8)
    sides = found.at(int(np.flatnonzero(border)[0]))
    assert sorted(float(np.round(s[up], 6)) for s in sides.values()) == [stiff, soft]
    # every cell has its own side's stress, and the mesh that is cut along the border has twice the nodes there
    cells = mean_in_cells(model.mesh, step)[:, up]
    np.testing.assert_allclose(cells, np.where(found.cells == first, soft, stiff), rtol=1e-8)
    apart, node, stress = cut_at_interfaces(model.mesh, step)
    assert apart.n_points == model.mesh.n_points + border.sum()
    assert {float(np.round(v, 6)) for v in stress[:, up]} == {stiff, soft}
    assert np.array_equal(apart.points, model.mesh.points[node])


def test_equal_materials_and_bodies_apart_have_no_border():
    model, _ = bars("quad4", softer=7.0)
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    assert step.material_stress is None
    assert cut_at_interfaces(model.mesh, step)[0] is model.mesh
    mesh = fc.generate.block_on_block("quad4")
    numbers = {"quad4": (mesh.points[mesh.cells["quad4"]].mean(axis=1)[:, 1] > 0).astype(np.int32)}
    assert not len(material_sides(mesh, numbers).points)


def test_three_materials_at_one_node():
    mesh = fc.generate.block((2.0, 2.0), (2, 2), "quad4")
    sides = material_sides(mesh, {"quad4": np.array([2, 0, 1, 2], np.int32)})
    middle = int(np.flatnonzero(np.isclose(mesh.points, 1.0).all(axis=1))[0])
    assert sides.material[sides.points == middle].tolist() == [0, 1, 2]
    assert sides.slot[sides.points == middle][0] == middle
    assert len(sides.node) == mesh.n_points + 2 + 4


def test_the_file_keeps_each_side_and_shows_it_by_cell(tmp_path, capsys):
    model, up = bars("quad8")
    path = tmp_path / "bars.vtkhdf"
    with fc.ResultWriter(path, model) as out:
        steps = fc.solve(model, fc.linear_ramp(2), on_step=out.write)
    with fc.open_results(path) as results:
        for read, step in zip(results, steps, strict=True):
            for name in ("cells", "points", "material", "stress"):
                np.testing.assert_array_equal(getattr(read.material_stress, name), getattr(step.material_stress, name))
        assert results.cell_field_names == []
    with h5py.File(path) as file:
        cells = file["VTKHDF/CellData"]
        count = len(file["VTKHDF/Types"])
        assert cells[layout.CELL_STRESS].shape == (2 * count, 6)
        assert file[f"VTKHDF/Steps/CellDataOffsets/{layout.CELL_VON_MISES}"][()].tolist() == [0, count]
        assert set(cells["material"][()]) == {0, 1}
        np.testing.assert_allclose(cells[layout.CELL_STRESS][count:, up], mean_in_cells(model.mesh, steps[-1])[:, up])
    assert main(["info", str(path)]) == 0
    assert "materials meet at 5 nodes" in capsys.readouterr().out
    with fc.ResultWriter(path, model, resume=True) as out:
        assert len(out.done) == 2
    bare = tmp_path / "bare.vtkhdf"
    with fc.ResultWriter(bare, model.mesh, kinematics="plane_strain") as out:
        out.write(steps[-1])
    np.testing.assert_array_equal(fc.open_results(bare)[-1].material_stress.stress, steps[-1].material_stress.stress)


@pytest.mark.parametrize("element", ["quad4", "hex8"])
def test_pictures_do_not_mix_the_sides(element, monkeypatch):
    pytest.importorskip("matplotlib", reason="pictures need matplotlib")
    model, _ = bars(element)
    drawn = fc.plot.deformed_shape(model.mesh, fc.solve(model, fc.linear_ramp(1))[-1])
    low, high = abs(STRAIN) * MODULI[0], abs(STRAIN) * MODULI[1]
    if element == "quad4":
        (field,) = (c for c in drawn.collections if c.get_array() is not None)
        assert {float(np.round(v, 6)) for v in field.get_array()} == {low, high}
    else:
        (solid,) = drawn.collections
        colours = np.unique(np.round(solid.get_facecolor()[solid.get_facecolor()[:, 3] > 0], 3), axis=0)
        assert len(colours) == 2  # no facet has a colour between those of the two bars


def test_the_summary_has_both_sides_of_a_probe(tmp_path):
    model, _ = bars("quad4")
    top = np.flatnonzero(np.isclose(model.mesh.points, [1.0, 1.0]).all(axis=1))
    fc.write_mesh(tmp_path / "bars.med", model.mesh.with_groups(points={"EDGE": top}))
    (tmp_path / "bars.toml").write_text(
        'kinematics = "plane_strain"\nmesh = { file = "bars.med" }\nramp = { steps = 1 }\n'
        'material = [{ E = 1.0, nu = 0.0, groups = "BAR0" }, { E = 1000.0, nu = 0.0, groups = "BAR1" }]\n'
        'support = [{ group = "BOTTOM", y = 0.0 }, { group = "LEFT", x = 0.0 }, { group = "TOP", y = -0.01 }]\n'
        'probes = { edge = "EDGE" }\n'
    )
    out = tmp_path / "out.json"
    assert main(["run", str(tmp_path / "bars.toml"), "-o", str(tmp_path / "b.vtkhdf"), "--json", str(out), "-q"]) == 0
    sides = json.loads(out.read_text())["probes"]["edge"]["stress_by_material"]
    assert {name: pytest.approx(stress[1]) for name, stress in sides.items()} == {"0": -0.01, "1": -10.0}
