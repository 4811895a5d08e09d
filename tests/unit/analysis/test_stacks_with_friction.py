"""Stacks of blocks with friction and multigrid: contact alone holds the middle bodies."""

import numpy as np
import pytest
from models import elastic_model, united
from pairwise import first_of

import fastcontact as fc
from fastcontact.analysis.load_step import load_step
from fastcontact.analysis.problem import prepare


def stack(element, divisions, friction=0.3, whole_sides=False):
    """Blocks that do not match, those in the middle smaller and held along x and y by a side each, or at half height."""
    parts = {}
    for level, n in enumerate(divisions):
        width = 1.0 if level % 2 == 0 else 0.9
        mesh = fc.generate.box((width, width, 0.5), (n, n, n // 2), element, (0.0, 0.03 * level, 0.5 * level))
        parts[f"B{level}_"] = mesh
    mesh, top = united(**parts), len(divisions) - 1
    for level in range(1, top):
        for side in ("XMIN", "YMIN"):
            nodes = mesh.points_of(f"B{level}_{side}")
            held = nodes if whole_sides else nodes[np.abs(mesh.points[nodes, 2] - 0.5 * level - 0.25) < 1e-9]
            mesh = mesh.replace(point_groups={**mesh.point_groups, f"{side} {level}": held})
    model = elastic_model(mesh, "3d", E=1.0, B0_ZMIN="xyz")
    model.prescribe(f"B{top}_ZMAX", x=0.01, y=0.0, z=-0.01)
    for level in range(1, top):
        model.fix(f"YMIN {level}", "y")
        model.fix(f"XMIN {level}", "x")
    for level in range(top):
        secondary, primary = f"B{level + 1}_ZMIN", f"B{level}_ZMAX"
        options = {"formulation": "mortar", "multipliers": "dual", "friction": friction}
        model.add_contact(f"c{level}", secondary=secondary, primary=primary, **options)
    return model


def solved(model, name):
    problem = prepare(model, fc.linear_ramp(1), fc.Criteria(), linear_solver=name)
    return problem.solver, load_step(problem, problem.initial_state(), 1, 1.0)[1]


# Exact solutions in each step of Newton's method took 418, 851 and 1017 iterations.
@pytest.mark.parametrize(
    ("element", "divisions", "most"), first_of(1, [("hex8", (4, 5, 4), 300), ("hex20", (3, 4, 3), 620)])
)
def test_newtons_method_solves_no_more_exactly_than_the_friction_law_holds(element, divisions, most):
    model = stack(element, divisions)
    solver, found = solved(model, "amg")
    assert not solver.gave_up
    assert solver.counters.iterations <= most
    exact = solved(model, "direct")[1]
    size = np.abs(exact.displacement).max()
    assert found.displacement == pytest.approx(exact.displacement, abs=1e-8 * size)
    for name, contact in exact.contact.items():
        force = found.contact[name].force_vectors
        assert force == pytest.approx(contact.force_vectors, abs=1e-7 * np.abs(contact.force_vectors).max())
