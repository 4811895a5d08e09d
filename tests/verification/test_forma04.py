"""The training case on meshes of the generator: close to code_aster's meshes, and converging to the reference."""

import numpy as np
import pytest
from pairwise import first_of

import fastcontact as fc
from fastcontact.cases.case import read_case

# code_aster's meshes of the same letter, converged geometry (A, C: stress at C1; B: code_aster's multiplier).
ON_CODE_ASTERS_MESH = {"a": 2773.57307445, "b": 2876.28674013, "c": 2928.76786014}
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


@pytest.mark.parametrize("letter", first_of(1, ["a", "b", "c"]))
def test_default_meshes_are_within_two_percent_of_code_asters(letter, root):
    case = read_case(root / f"data/cases/forma04{letter}.toml")
    last = fc.solve(case.model, case.ramp)[-1]
    point = case.probes["C1"]
    contact = last.contact["hertz"]
    found = contact.pressure[np.flatnonzero(contact.points == point)[0]] if letter == "b" else -last.stress[point, 1]
    assert found == pytest.approx(ON_CODE_ASTERS_MESH[letter], rel=0.02)


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


def test_force_and_pressure_converge_with_the_mesh(forma04):
    errors = []
    for k in (1, 2, 4):
        mesh = fc.generate.half_spheres("quad8", arc_sizes=(0.8 / k, 8.0 / k), segments=5 * k)
        contact = fc.solve(forma04(mesh, "continuous"), fc.linear_ramp(1))[-1].contact["hertz"]
        errors.append((abs(contact.force[1]) / FORCE - 1, contact.pressure[0] / PRESSURE - 1))
    sizes = np.abs(errors)
    assert (sizes[-1] < [2e-4, 5e-4]).all()
    assert (sizes[-1] < 0.2 * sizes[0]).all()
