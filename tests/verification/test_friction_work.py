"""Work of friction: a block just below and just above its limit, and the energy balance when the load turns round."""

import numpy as np
import pytest
from stepping import Stepping

import fastcontact as fc
from fastcontact.mesh.generate import box, renamed, union

E, FRICTION, PRESSURE, SLIP = 1e5, 0.3, 1.0, 0.1


def blocks(dim):
    """A block of width 2 (and depth 1) on a longer one, whose meshes do not match."""
    if dim == 2:
        return fc.generate.block_on_block(
            size_lower=(4.0, 0.5), size_upper=(2.0, 1.0), divisions_lower=(7, 1), divisions_upper=(4, 2), shift=1.0
        )
    parts = []
    for name, size, divisions, origin in (
        ("LOWER", (4.0, 2.0, 0.5), (7, 3, 1), (-1.0, -0.5, -0.5)),
        ("UPPER", (2.0, 1.0, 1.0), (3, 2, 2), (0.0, 0.0, 0.0)),
    ):
        part = box(size, divisions, "hex8", origin, name=name)
        sides = {"ZMIN": "UPPER_BOTTOM", "ZMAX": "UPPER_TOP"} if name == "UPPER" else {"ZMAX": "LOWER_TOP"}
        parts.append(renamed(part, {g: sides.get(g, f"{name}_{g}") for g in part.group_names if g != name}))
    return union(*parts)


def pushed_block(dim, formulation, ratio):
    """Press a block on a rigid base, then push it with `ratio` of its limit against weak springs; return the steps."""
    mesh = blocks(dim)
    up, contact = "xyz"[dim - 1], ("CONT_UPPER", "CONT_LOWER") if dim == 2 else ("UPPER_BOTTOM", "LOWER_TOP")
    model = fc.Model(mesh, "plane_strain" if dim == 2 else "3d")
    model.add_material(fc.LinearElastic(E=E, nu=0.0))
    model.fix("LOWER", "xyz"[:dim])
    top = mesh.points_of("UPPER_TOP")
    if dim == 3:
        model.fix("UPPER_TOP", "y")
    model.couple("UPPER_TOP", up)  # it stays level
    limit = FRICTION * PRESSURE * 2.0
    model.add_pressure("UPPER_TOP", PRESSURE, ramp=[(0, 0), (1, 1), (2, 1)])
    model.add_traction("UPPER_TOP", x=ratio * limit / 2.0, ramp=[(0, 0), (1, 0), (2, 1)])
    stiffness = 0.01 * limit / SLIP
    model.add_spring("UPPER_TOP", x=stiffness / len(top))
    model.add_contact("pair", secondary=contact[0], primary=contact[1], formulation=formulation, friction=FRICTION)
    steps = fc.solve(model, fc.Ramp((1.0, 2.0), ((0, 0), (2, 2))), linear_solver="direct")
    return steps, top, limit, stiffness


CASES = [(2, "node_to_segment"), (2, "continuous"), (2, "mortar"), (3, "node_to_segment"), (3, "mortar")]


@pytest.mark.parametrize(("dim", "formulation"), CASES)
def test_a_block_sticks_at_99_hundredths_of_its_limit(dim, formulation):
    steps, top, limit, _ = pushed_block(dim, formulation, 0.99)
    contact = steps[-1].contact["pair"]
    assert contact.sticking.any()
    moved = np.abs(steps[-1].displacement[top, 0]).max()
    assert moved < 10 * PRESSURE / E  # it deforms
    assert np.abs(contact.force[0]) == pytest.approx(0.99 * limit, rel=1e-3)
    assert contact.force[dim - 1] == pytest.approx(PRESSURE * 2.0, rel=1e-8)


@pytest.mark.parametrize(("dim", "formulation"), CASES)
def test_a_block_slides_at_101_hundredths_of_its_limit_until_springs_hold_it(dim, formulation):
    steps, top, limit, stiffness = pushed_block(dim, formulation, 1.01)
    contact = steps[-1].contact["pair"]
    assert not contact.sticking.any()
    assert -contact.force[0] == pytest.approx(limit, rel=1e-8)
    held = stiffness * steps[-1].displacement[top, 0].mean()
    assert held == pytest.approx(0.01 * limit, rel=1e-6)
    slip = steps[-1].displacement[contact.points, 0].mean()
    assert contact.dissipation == pytest.approx(limit * slip, rel=1e-4)  # but for its deformation
    assert steps[0].contact["pair"].dissipation == pytest.approx(0.0, abs=1e-12 * limit * SLIP)


def analysed(model, ramp, **criteria):
    """Return the steps and, for every step, the elastic energy."""
    analysis = Stepping(model, "direct", 1e-10, fc.Criteria(**criteria), ramp)
    steps = [analysis.step(index, instant) for index, instant in enumerate(ramp.instants, start=1)]
    displacements = [step.displacement.ravel() for step in steps]
    return steps, [0.5 * u @ (analysis.K @ u) for u in displacements], analysis.K


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_a_load_that_turns_round_leaves_work_in_elasticity_and_friction_only(formulation):
    # Level rows are tied together, so that the column shears uniformly; steps end where stick and slip take turns, so
    # that the work of the supports is that of the mean force exactly.
    mesh = fc.generate.block((2.0, 1.0), (3, 2))
    rows = {f"row {k}": np.flatnonzero(np.isclose(mesh.points[:, 1], 0.5 * k)) for k in range(2)}
    model = fc.Model(mesh.with_groups(points=rows), "plane_strain")
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.0))
    for row in rows:
        model.couple(row, "xy")
    path = [0.0, 0.6, 1.0, -0.2, -1.0, 0.2, 1.0]
    instants = tuple(float(k) for k in range(1, len(path) + 1))
    model.prescribe("TOP", y=-1e-3, ramp=[(0, 0), (1, 1), (len(path), 1)])
    model.prescribe("TOP", x=1e-3, ramp=[(0, 0), *zip(instants, path, strict=True)])
    plane = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("plane", secondary="BOTTOM", obstacle=plane, formulation=formulation, friction=FRICTION)
    steps, energy, _ = analysed(model, fc.Ramp(instants, ((0, 1), (len(path), 1))))
    work, u, force = 0.0, 0.0, 0.0
    for step in steps:
        top = step.reaction.ravel()
        work += 0.5 * (top + force) @ (step.displacement.ravel() - u)
        u, force = step.displacement.ravel(), top
    lost = sum(step.contact["plane"].dissipation for step in steps)
    # It slides where the shear would pass 0.3 of the pressure of 1: beyond 6e-4 from where it stuck, 12e-4 on return.
    assert lost == pytest.approx(FRICTION * 2.0 * (4e-4 + 8e-4 + 8e-4), rel=1e-8)
    assert energy[-1] == pytest.approx(0.5 * 2.0 * 1e-3 + 0.5 * 0.6 * 6e-4, rel=1e-8)
    assert work == pytest.approx(energy[-1] + lost, rel=1e-8)
    for k, step in enumerate(steps):
        contact = step.contact["plane"]
        if k in (2, 4, 6):
            assert not contact.sticking.any()
        else:
            assert contact.dissipation == pytest.approx(0.0, abs=1e-12 * lost)


@pytest.mark.parametrize("dim", [2, 3])
def test_every_implicit_step_balances_its_energy_in_partial_slip(dim):
    # With the forces at the end of each step, work is energy, friction, and half the energy of the increment.
    mesh = blocks(dim)
    model = fc.Model(mesh, "plane_strain" if dim == 2 else "3d")
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    axes = "xyz"[:dim]
    model.fix("LOWER_BOTTOM" if dim == 2 else "LOWER_ZMIN", axes)
    up = {axes[-1]: -2e-3}
    model.prescribe("UPPER_TOP", ramp=[(0, 0), (1, 1), (9, 1)], **up)
    model.prescribe("UPPER_TOP", x=1e-3, ramp=[(0, 0), (1, 0), (3, 1), (7, -1), (9, 1)])
    sides = ("CONT_UPPER", "CONT_LOWER") if dim == 2 else ("UPPER_BOTTOM", "LOWER_TOP")
    model.add_contact("pair", secondary=sides[0], primary=sides[1], formulation="node_to_segment", friction=FRICTION)
    ramp = fc.Ramp(tuple(range(1, 10)), ((0, 0), (9, 9)))
    steps, energy, K = analysed(model, ramp, keep_pairing=True)
    u, before, partial = np.zeros(model.n_dofs), 0.0, 0
    for step, now in zip(steps, energy, strict=True):
        contact = step.contact["pair"]
        assert contact.active.all()  # an opening or closing gap would be a term of its own
        change = step.displacement.ravel() - u
        work = step.reaction.ravel() @ change
        found = now - before + 0.5 * change @ (K @ change) + contact.dissipation
        assert work == pytest.approx(found, abs=1e-10 * max(energy))
        assert contact.dissipation >= -1e-12 * max(energy)
        partial += contact.sticking.any() and not contact.sticking.all()
        u, before = step.displacement.ravel(), now
    assert partial >= 3
