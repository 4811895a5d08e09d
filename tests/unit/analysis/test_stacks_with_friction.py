"""Friction with multigrid: stacks held by contact alone, and small contact forces."""

import numpy as np
import pytest
from models import elastic_model, supported, united, with_contact
from pairwise import first_of

import fastcontact as fc
from fastcontact.analysis.friction import eliminated
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
    model = elastic_model(mesh, "3d", E=1.0, B0_ZMIN="xyz", **{f"B{top}_ZMAX": {"x": 0.01, "y": 0.0, "z": -0.01}})
    for level in range(1, top):
        supported(model, **{f"YMIN {level}": "y", f"XMIN {level}": "x"})
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
    assert not solver.replacement_reason
    assert solver.counters.iterations <= most
    exact = solved(model, "direct")[1]
    assert found.displacement == pytest.approx(exact.displacement, abs=1e-8 * np.abs(exact.displacement).max())
    for name, contact in exact.contact.items():
        force = found.contact[name].force_vectors
        assert force == pytest.approx(contact.force_vectors, abs=1e-7 * np.abs(contact.force_vectors).max())


def light_contact_beside_a_large_force(shift):
    """Return two blocks pressed together and pushed along each other, and a third one far away that is stretched hard."""

    def part(z, k):
        return fc.generate.box((1.0, 1.0, 0.5), (k, k, k // 2), "hex8", (0.0, 0.0, z))

    model = elastic_model(united(L_=part(-0.5, 6), U_=part(0.0, 5), FAR_=part(5.0, 6)), "3d", E=1.0, L_ZMIN="xyz")
    supported(model, U_ZMAX={"x": shift, "y": 0.0, "z": -0.001}, FAR_XMIN="xyz")
    model.prescribe("FAR_XMAX", x=0.2, y=0.0, z=0.0)
    return with_contact(model, "c", "U_ZMIN", "L_ZMAX", formulation="mortar", multipliers="dual", friction=0.2)


@pytest.mark.parametrize("acceptable", first_of(1, [eliminated.ACCEPTABLE, 0.0]))
def test_forces_that_cannot_be_more_accurate_settle_without_a_compliance(acceptable, monkeypatch):
    monkeypatch.setattr(eliminated, "ROUND_OFF", 0.0)
    monkeypatch.setattr(eliminated, "LAW_TOLERANCE", 1e-9)  # more than linear solutions to 1e-10 can give
    monkeypatch.setattr(eliminated, "ACCEPTABLE", acceptable)
    model = light_contact_beside_a_large_force(6e-4)
    (solver, step), exact = solved(model, "amg"), solved(model, "direct")[1].contact["c"]
    assert bool(solver.columns.requests) == (acceptable == 0.0)
    found = step.contact["c"]
    assert np.abs(found.force - exact.force).max() < 1e-6 * np.abs(exact.force).max()
    assert found.active.sum() > found.sticking.sum()


@pytest.mark.parametrize(("factor", "told"), [(1.0, "contact"), (0.0, "in load step 1,")], ids=["pressed", "lifted"])
def test_a_contact_is_said_to_be_too_coarse_where_it_carries_a_force(factor, told, recwarn):
    """A ball without force still touches one node of the dent that it has left, which says nothing about the mesh."""
    model = fc.Model(fc.generate.block((2.0, 1.0), (8, 4), "quad8"), kinematics="axisymmetric")
    model.add_material(fc.ElasticPlastic(E=200e3, nu=0.3, yield_stress=400.0, hardening=[(0.0, 400.0), (1.0, 2000.0)]))
    model.fix("BOTTOM", "y")
    ramp = [(0.0, 0.0), (1.0, 1.0), (2.0, factor)]
    ball = fc.obstacles.Sphere((0.0, 3.5), 2.5)
    model.add_obstacle("ball", secondary="TOP", obstacle=ball, force={"y": -300.0}, ramp=ramp)
    last = fc.solve(model, [1.0, 2.0])[-1]
    assert last.contact["ball"].active.any()
    (text,) = [text for text in last.warnings if "element across" in text or "elements across" in text]
    assert text.startswith(told)
