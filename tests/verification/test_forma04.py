"""The training case on meshes of the generator: close to code_aster's meshes, and converging to the reference."""

import csv
import json

import numpy as np
import pytest
from pairwise import first_of

import fastcontact as fc
from fastcontact.cli import main

FORCE, PRESSURE = 659_773.142, 2910.4071
VON_MISES, DEPTH = 1738.4852, 5.645414


@pytest.mark.parametrize("letter", ["a", "b", "c"])
def test_the_shipped_meshes_are_those_of_the_generator(letter, root):
    element = {"a": "tri3", "b": "tri6", "c": "quad4"}[letter]
    made, shipped = fc.generate.half_spheres(element), fc.read_mesh(root / f"data/meshes/forma04{letter}.med")
    assert np.abs(made.points - shipped.points).max() < 1e-9
    assert {name: block.tolist() for name, block in made.cells.items()} == {
        name: block.tolist() for name, block in shipped.cells.items()
    }
    for group in made.group_names:
        assert np.array_equal(made.points_of(group), shipped.points_of(group))


def test_refined_quadratic_mesh_reaches_the_mesh_converged_solution(forma04):
    mesh = fc.generate.half_spheres("quad8", arc_sizes=(0.15, 1.5), segments=24)
    model = forma04(mesh, "continuous")
    assert 40_000 < model.n_dofs < 50_000
    last = fc.solve(model, fc.linear_ramp(1))[-1]
    contact = last.contact["hertz"]
    assert abs(contact.force[1]) == pytest.approx(FORCE, rel=5e-5)
    assert contact.pressure[0] == pytest.approx(PRESSURE, rel=2e-4)
    assert contact.radius[0] - 0.01 < 10.358557 < contact.radius[1] + 0.01
    top = int(np.argmax(last.von_mises))
    assert last.von_mises[top] == pytest.approx(VON_MISES, rel=2e-3)
    assert mesh.points[top] == pytest.approx([0.0, np.copysign(DEPTH, mesh.points[top, 1])], abs=0.3)


LINES = ("CONT1", "CONT2")
FIXED = {"a": -2773.5474109439, "c": -2928.74092725}
CONVERGED = {"a": -2773.57307445, "c": -2928.76786014}
FORCE_OF_CODE_ASTER = {"a": 664_075.264, "c": 660_238.472}


@pytest.fixture(scope="module")
def meshes(cases):
    return {letter: fc.read_mesh(cases / f"forma04{letter}.med") for letter in "abc"}


def code_aster_line(folder, letter, group):
    """Return (node numbers, displacement, stress) of one contact line."""
    with open(folder / f"forma04{letter}_{group}.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    number = np.array([int(row["node"]) - 1 for row in rows])
    displacement = np.array([[float(row[f"DEPL:D{k}"]) for k in "XY"] for row in rows])
    stress = np.array([[float(row[f"SIEF_NOEU:SI{k}"]) for k in ("XX", "YY", "ZZ", "XY")] for row in rows])
    return number, displacement, stress


@pytest.mark.parametrize(("letter", "tolerance"), [("a", 1e-9), ("c", 1e-8)])
def test_two_geometry_updates_reproduce_code_aster(letter, tolerance, meshes, code_aster, forma04):
    model = forma04(meshes[letter])
    last = fc.solve(model, criteria=fc.Criteria(geometry_updates=2))[-1]
    assert last.stress[model.mesh.point("C1"), 1] == pytest.approx(FIXED[letter], rel=tolerance)
    for group in LINES:
        number, displacement, stress = code_aster_line(code_aster, letter, group)
        assert np.abs(last.displacement[number] - displacement).max() < 1e-9 * np.abs(displacement).max()
        assert np.abs(last.stress[number] - stress).max() < 1e-9 * np.abs(stress).max()


@pytest.mark.parametrize("letter", first_of(1, ["a", "c"]))
def test_converged_geometry_does_not_depend_on_the_number_of_steps(letter, meshes, forma04):
    model = forma04(meshes[letter])
    one, twenty = (fc.solve(model, fc.linear_ramp(n))[-1] for n in (1, 20))
    assert twenty.stress[model.mesh.point("C1"), 1] == pytest.approx(CONVERGED[letter], rel=1e-8)
    assert np.linalg.norm(twenty.contact["hertz"].force) == pytest.approx(FORCE_OF_CODE_ASTER[letter], rel=2e-9)
    assert np.abs(one.displacement - twenty.displacement).max() < 1e-8 * np.abs(twenty.displacement).max()
    assert np.abs(one.stress - twenty.stress).max() < 1e-8 * np.abs(twenty.stress).max()


def smooth_deviation(contact):
    """Largest distance of the pressures well inside from a smooth fit, relative to the largest pressure.

    The fit is the pressure of a spherical contact with a free edge times an even quartic. The last closed node is not
    an interior one: the pressure ends within its facets with a vertical tangent.
    """
    r, p = contact.coordinates[:, 0], contact.pressure
    edge = 0.5 * sum(contact.radius)
    inside = np.flatnonzero(contact.active)[:-1]
    x = (r[inside] / edge) ** 2
    basis = np.sqrt(1 - x)[:, None] * np.stack([np.ones_like(x), x, x * x], axis=1)
    fit = basis @ np.linalg.lstsq(basis, p[inside], rcond=None)[0]
    return np.abs(fit - p[inside]).max() / p.max()


def test_continuous_contact_on_quadratic_triangles(meshes, forma04):
    model = forma04(meshes["b"], "continuous", integration="gauss")
    contact = fc.solve(model)[-1].contact["hertz"]
    pressure = contact.pressure[np.flatnonzero(contact.points == model.mesh.point("C1"))[0]]
    assert pressure == pytest.approx(2798.3287, rel=0.03)  # the training case's own check
    assert pressure == pytest.approx(2876.287, rel=0.005)  # code_aster
    assert np.linalg.norm(contact.force) == pytest.approx(FORCE, rel=5e-4)
    assert smooth_deviation(contact) < 0.02


@pytest.mark.each_value
@pytest.mark.filterwarnings("ignore:.*integration points of complete facets")
@pytest.mark.parametrize("integration", ["gauss", "simpson", "node"])
@pytest.mark.parametrize("letter", ["a", "b", "c"])
def test_no_integration_rule_leaves_a_multiplier_undetermined(integration, letter, meshes, forma04):
    model = forma04(meshes[letter], "continuous", integration=integration)
    contact = fc.solve(model, fc.linear_ramp(2))[-1].contact["hertz"]
    assert np.linalg.norm(contact.force) == pytest.approx(FORCE, rel=0.01)
    assert contact.pressure_max == pytest.approx(PRESSURE, rel=0.05)
    assert np.abs(contact.multiplier).max() < 1.05 * PRESSURE
    assert contact.multiplier.min() > -0.1 * PRESSURE


# The convergence study of the training case separates model error from mesh error.


def test_three_levels_tell_model_error_from_mesh_error(root, tmp_path, capsys):
    files = {name: tmp_path / f"study.{name}" for name in ("json", "csv", "png", "html")}
    options = [text for name, path in files.items() for text in (f"--{name}", str(path))]
    case = str(root / "data/cases/forma04c.toml")
    arguments = ["converge", case, "--levels", "3", "--elements", "quad8", "--formulations", "continuous"]
    assert main([*arguments, "--workers", "1", "--store", str(tmp_path / "store"), *options]) == 0
    study = json.loads(files["json"].read_text())
    assert len(study["levels"]) == 3
    assert all(level["n_dofs"] > 0 and level["force"] > 0 for level in study["levels"])
    for name, exact, near in (("force", FORCE, 2e-3), ("pressure_max", PRESSURE, 2e-3)):
        found = study["quantities"][name]
        assert found["limit"] == pytest.approx(exact, rel=near)
        assert abs(found["limit"] - exact) <= found["uncertainty"]
        assert found["order"] > 0
    assert study["quantities"]["force"]["model_error"] == pytest.approx(0.12574, abs=2e-3)
    assert study["quantities"]["pressure_max"]["model_error"] == pytest.approx(0.04005, abs=2e-3)
    assert study["equal_force"]["pressure_max"]["model_error"] == pytest.approx(-2e-4, abs=2e-3)
    assert files["png"].read_bytes()[:4] == b"\x89PNG"
    assert "data:image/png;base64" in files["html"].read_text()
    assert "model error" in capsys.readouterr().out
    # Started again, the study takes its runs from the store.
    assert main([*arguments, "--workers", "1", "--store", str(tmp_path / "store"), "-q"]) == 0
