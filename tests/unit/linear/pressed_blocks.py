"""A box and two non-matching blocks, for tests of linear solvers under contact."""

import numpy as np
import pytest
from models import supported, united, with_contact

import fastcontact as fc
from fastcontact.analysis.load_step import load_step
from fastcontact.analysis.problem import prepare
from fastcontact.elasticity.constrained_system import separate_supports
from fastcontact.elasticity.stiffness import rigid_modes, stiffness


def pressed(element="hex8", friction=0.0, ratio=1.0, curvature=0.0, n=10, along=0.01, **options):
    """Two blocks that do not match, pressed together, and with friction pushed along each other."""

    def part(z, k):
        return fc.generate.box((1.0, 1.0, 0.5), (k, k, k // 2), element, (0.0, 0.0, z))

    upper = part(0.0, n * 4 // 5)
    points = np.array(upper.points)
    points[:, 2] += curvature * (points[:, 0] ** 2 + points[:, 1] ** 2)
    model = fc.Model(united(L_=part(-0.5, n), U_=upper.replace(points=points)), "3d")
    model.add_material(fc.LinearElastic(ratio, 0.3), groups=["L_BOX"])
    model.add_material(fc.LinearElastic(1.0, 0.3), groups=["U_BOX"])
    supported(model, L_ZMIN="xyz", U_ZMAX={"x": along if friction else 0.0, "y": 0.0, "z": -0.01})
    return with_contact(model, "c", "U_ZMIN", "L_ZMAX", friction=friction, **options)


def box(divisions=(7, 6, 5), E=10.0):
    """Return the stiffness (n, n) of a box held at one side, its modes, and which unknowns are fixed."""
    mesh = fc.generate.box((1.0, 1.1, 0.9), divisions)
    moduli = np.asarray([fc.LinearElastic(E=E, nu=0.3).moduli("3d")])
    K = stiffness(mesh, "3d", moduli, {"hex8": np.zeros(len(mesh.cells["hex8"]), np.int64)})
    fixed = np.repeat(mesh.points[:, 1] == 0, 3)
    return separate_supports(K, fixed)[0], np.where(fixed[:, None], 0.0, rigid_modes(mesh.points, "3d")), fixed


def solved(model, name, steps=1):
    """Return the linear solver and the result of the last of some load steps."""
    problem = prepare(model, fc.linear_ramp(steps), fc.Criteria(), linear_solver=name)
    state = problem.initial_state()
    for index in range(1, steps + 1):
        state, result = load_step(problem, state, index, index / steps)
    return problem.solver, result


def assert_agree(model, most, within=1e-8):
    """Multigrid finds what factors find, without columns or factors, in `most` iterations."""
    solver, step = solved(model, "amg")
    assert not solver.replacement_reason
    assert not solver.columns.requests
    assert solver.counters.iterations <= most
    found, exact = step.contact["c"], solved(model, "direct")[1].contact["c"]
    assert found.force_vectors == pytest.approx(exact.force_vectors, abs=within * np.abs(exact.force_vectors).max())
    assert np.array_equal(found.active, exact.active)
    assert np.array_equal(found.sticking, exact.sticking)
