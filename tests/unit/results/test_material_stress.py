"""Stress at material interfaces: separate for each side, in results, files, viewers, pictures and summaries."""

import json

import h5py
import numpy as np
import pytest

import fastcontact as fc
from fastcontact.cli import main
from fastcontact.elasticity.material_sides import material_sides
from fastcontact.results import layout
from fastcontact.results.layout import mean_in_cells, separated

STRAIN = -0.01
MODULI = (1.0, 1000.0)
ELEMENTS = ("tri3", "tri6", "quad4", "quad8", "hex8", "tet4", "tet10", "wedge6", "pyramid5")


def bars(element, first=0, softer=None):
    """Return a model of two bars side by side, glued, pressed by the same strain; `first` is the material added first."""
    solid = element in ("hex8", "tet4", "tet10", "wedge6", "pyramid5")
    mesh = (
        fc.generate.box((2.0, 1.0, 1.0), (4, 2, 2), element)
        if solid
        else fc.generate.block((2.0, 1.0), (4, 2), element)
    )
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
    model.fix("ZMIN" if solid else "BOTTOM", up)
    model.fix("XMIN" if solid else "LEFT", "x")
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
    apart, node, stress = separated(model.mesh, step)
    assert apart.n_points == model.mesh.n_points + border.sum()
    assert {float(np.round(v, 6)) for v in stress[:, up]} == {stiff, soft}
    assert np.array_equal(apart.points, model.mesh.points[node])


def test_equal_materials_and_bodies_apart_have_no_border():
    model, _ = bars("quad4", softer=7.0)
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    assert step.material_stress is None
    assert separated(model.mesh, step)[0] is model.mesh
    mesh = fc.generate.block_on_block("quad4")
    numbers = {"quad4": (mesh.points[mesh.cells["quad4"]].mean(axis=1)[:, 1] > 0).astype(np.int32)}
    assert not len(material_sides(mesh, numbers).points)


def test_three_materials_at_one_node():
    mesh = fc.generate.block((2.0, 2.0), (2, 2), "quad4")
    sides = material_sides(mesh, {"quad4": np.array([2, 0, 1, 2], np.int32)})
    middle = int(np.flatnonzero(np.isclose(mesh.points, 1.0).all(axis=1))[0])
    assert sides.material[sides.points == middle].tolist() == [0, 1, 2]
    assert sides.place[sides.points == middle][0] == middle
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
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    drawn = fc.plot.deformed_shape(model.mesh, step)
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
    words = ["run", str(tmp_path / "bars.toml"), "-o", str(tmp_path / "b.vtkhdf"), "--json", str(out), "-q"]
    assert main(words) == 0
    sides = json.loads(out.read_text())["probes"]["edge"]["stress_by_material"]
    assert {name: pytest.approx(stress[1]) for name, stress in sides.items()} == {"0": -0.01, "1": -10.0}
