"""Work of friction: a block just below and above its limit, and the energy balance on load reversal."""

import numpy as np
import pytest
from models import elastic_model, pressed_spheres, supported, united, with_contact, with_obstacle
from stepping import Stepping

import fastcontact as fc
from fastcontact.analysis import friction_increments
from fastcontact.analysis.result_warnings import _slip_before_contact
from fastcontact.analysis.state import State
from fastcontact.analysis.work import Work

pytestmark = pytest.mark.each_value

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
        part = fc.generate.box(size, divisions, "hex8", origin, name=name)
        sides = {"ZMIN": "UPPER_BOTTOM", "ZMAX": "UPPER_TOP"} if name == "UPPER" else {"ZMAX": "LOWER_TOP"}
        parts.append(fc.generate.renamed(part, {g: sides.get(g, f"{name}_{g}") for g in part.group_names if g != name}))
    return fc.generate.union(*parts)


def pushed_block(dim, formulation, ratio):
    """Press a block on a rigid base, then push it with `ratio` of its limit against weak springs; return the steps."""
    mesh = blocks(dim)
    up, contact = "xyz"[dim - 1], ("CONT_UPPER", "CONT_LOWER") if dim == 2 else ("UPPER_BOTTOM", "LOWER_TOP")
    model = elastic_model(mesh, "plane_strain" if dim == 2 else "3d", E=E, nu=0.0, LOWER="xyz"[:dim])
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
    model = elastic_model(mesh.with_groups(points=rows), "plane_strain", nu=0.0)
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
    told = steps[-1].work
    assert told["external_work"] == pytest.approx(work, rel=1e-8)
    assert (told["friction_work"], told["strain_energy"]) == pytest.approx((lost, energy[-1]), rel=1e-8)
    for k, step in enumerate(steps):
        contact = step.contact["plane"]
        if k in (2, 4, 6):
            assert not contact.sticking.any()
        else:
            assert contact.dissipation == pytest.approx(0.0, abs=1e-12 * lost)


@pytest.mark.parametrize("dim", [2, 3])
def test_every_step_balances_its_energy_in_partial_slip(dim):
    # By the mean of the forces at both ends of each step, work is energy and friction.
    model = elastic_model(blocks(dim), "plane_strain" if dim == 2 else "3d")
    axes = "xyz"[:dim]
    model.fix("LOWER_BOTTOM" if dim == 2 else "LOWER_ZMIN", axes)
    up = {axes[-1]: -2e-3}
    model.prescribe("UPPER_TOP", ramp=[(0, 0), (1, 1), (9, 1)], **up)
    model.prescribe("UPPER_TOP", x=1e-3, ramp=[(0, 0), (1, 0), (3, 1), (7, -1), (9, 1)])
    sides = ("CONT_UPPER", "CONT_LOWER") if dim == 2 else ("UPPER_BOTTOM", "LOWER_TOP")
    model.add_contact("pair", secondary=sides[0], primary=sides[1], formulation="node_to_segment", friction=FRICTION)
    ramp = fc.Ramp(tuple(range(1, 10)), ((0, 0), (9, 9)))
    steps, energy, _ = analysed(model, ramp, keep_pairing=True)
    u, partial, force, slid, work = np.zeros(model.n_dofs), 0, 0.0, 0.0, 0.0
    for step, now in zip(steps, energy, strict=True):
        contact = step.contact["pair"]
        assert contact.active.all()  # an opening or closing gap would be a term of its own
        change = step.displacement.ravel() - u
        work += 0.5 * (step.reaction.ravel() + force) @ change
        slid += contact.dissipation
        assert step.work["strain_energy"] == pytest.approx(now, rel=1e-12)
        assert step.work["friction_work"] == pytest.approx(slid, abs=1e-12 * max(energy))
        assert abs(step.work["imbalance"]) < 1e-9 * max(energy)
        # Where friction was not at its limit as the step began, the mean force is less than that of sliding.
        assert step.work["external_work"] == pytest.approx(work, abs=0.02 * max(energy))
        assert contact.dissipation >= -1e-12 * max(energy)
        partial += contact.sticking.any() and not contact.sticking.all()
        u, force = step.displacement.ravel(), step.reaction.ravel()
    assert partial >= 3


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
@pytest.mark.filterwarnings("ignore:contact .* penetrates by")
@pytest.mark.parametrize("penalty", [None, 2e4])
def test_works_add_up_however_few_the_steps(formulation, penalty):
    """A contact that grows: the mean of the forces at both ends of one step would tell 27 % more than the energy."""
    found = []
    for count in (1, 5):
        mesh = fc.generate.half_spheres("quad4", arc_sizes=(3.0, 9.0), segments=3)
        steps = fc.solve(pressed_spheres(mesh, formulation=formulation, penalty=penalty), count)
        found.append(steps[-1].work)
    forces, moved = ([0.0, *(getattr(step, name) for step in steps)] for name in ("reaction", "displacement"))
    work = sum(0.5 * ((p + q) * (v - u)).sum() for p, q, u, v in zip(forces, forces[1:], moved, moved[1:]))
    assert found[1]["external_work"] == pytest.approx(work, rel=0.02)  # that of the supports
    for told in found:
        assert told["external_work"] == pytest.approx(told["strain_energy"] + told["penalty_energy"], rel=2e-3)
        assert told["friction_work"] == 0.0
        assert (told["penalty_energy"] > 0.02 * told["strain_energy"]) == (penalty is not None)


@pytest.mark.filterwarnings("ignore:.*across its radius", "ignore:a displacement of 2 is")
@pytest.mark.filterwarnings("ignore:the energy of these load steps is out of balance", "ignore:rotations of up to")
@pytest.mark.parametrize("count", [1, 16])
def test_works_that_do_not_add_up_are_told(count):
    """A block on springs is drawn up a drum: in one step the normal turns by half a radian under its force."""
    model = elastic_model(fc.generate.block((0.2, 0.2), (2, 2), origin=(-0.1, 0.0)), "plane_strain", E=1e4, nu=0.0)
    model.add_spring("TOP", y=100.0)
    model.prescribe("TOP", x=-2.0, ramp=[(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)])
    drum = fc.obstacles.Sphere((0.0, -4.0), 4.0)
    options = {"motion": {"y": 0.5}, "ramp": [(0, 0), (1, 1), (2, 1)], "integration": "gauss"}
    model.add_obstacle("drum", secondary="BOTTOM", obstacle=drum, **options)
    steps = fc.solve(model, [1.0, *np.linspace(1.0, 2.0, count + 1)[1:]])
    told = any("out of balance" in text and "use more load steps" in text for text in steps[-1].warnings)
    assert told == (count == 1)
    # The springs give back what they hold, 1/2 k u^2 at three nodes.
    assert abs(steps[-1].work["imbalance"]) < (0.1 if told else 0.005) * 0.5 * 300.0 * 0.5**2


def ball_on_block(kinematics="axisymmetric", element="quad4", strain="small", **changes):
    """Return the model of a rigid ball that is pressed into a block."""
    solid = kinematics == "3d"
    size = {"contact_radius": 2.0, "contact_size": 0.35} if solid else {"contact_radius": 1.2, "contact_size": 0.1}
    mesh = fc.generate.graded_block(element, width=10.0, depth=10.0, **size)
    model = elastic_model(mesh, kinematics, strain=strain)
    for side, axis in zip(("SYMMETRY_X", "SYMMETRY_Y"), "xy"[: mesh.dim - 1], strict=False):
        model.fix(side, axis)
    model.fix("BOTTOM", "xyz"[: mesh.dim])
    ball = fc.obstacles.Sphere(centre=(*[0.0] * (mesh.dim - 1), 10.0), R=10.0)
    driven = {"motion": {"xyz"[mesh.dim - 1]: -0.2 if solid else -0.1}, "friction": 0.3} | changes
    return with_obstacle(model, "ball", "CONTACT", ball, **driven)


def pressed_ball(solver="auto", steps=5, friction_while_touching=0.01, **changes):
    """Press the ball; return the steps."""
    criteria = fc.Criteria(friction_while_touching=friction_while_touching)
    return fc.solve(ball_on_block(**changes), steps, criteria=criteria, linear_solver=solver)


@pytest.mark.parametrize("formulation", ["continuous", "mortar"])
def test_nodal_tractions_obey_coulomb_and_have_the_resultant_of_the_forces(formulation):
    contact = fc.solve(ball_on_block("plane_strain", "quad8", formulation=formulation), 3)[-1].contact["ball"]
    shear = np.linalg.norm(contact.shear, axis=1)
    assert (shear <= 0.3 * contact.pressure * (1.0 + 1e-9)).all()
    order = np.argsort(contact.abscissa)
    traction = (contact.shear + contact.pressure[:, None] * np.nan_to_num(contact.normal))[order]
    length = np.diff(contact.coordinates[order[::2], 0])[:, None] / 6.0
    total = (length * (traction[:-2:2] + 4.0 * traction[1::2] + traction[2::2])).sum(axis=0)
    assert total == pytest.approx(contact.force, rel=0.015)


@pytest.mark.each_value
@pytest.mark.parametrize("kinematics", ["axisymmetric", "plane_strain"])
@pytest.mark.parametrize(
    ("formulation", "element"),
    [("mortar", "quad4"), ("continuous", "quad8"), pytest.param("node_to_segment", "tri3", marks=pytest.mark.slow)],
)
def test_work_of_friction_does_not_depend_on_the_number_of_steps(formulation, element, kinematics):
    """Nodes that close in a step slide from where they touch on: few steps have the work and the shear of many."""
    options = {"element": element, "formulation": formulation, "kinematics": kinematics}
    whole, fine, five, one = (
        pressed_ball(steps=n, friction_while_touching=fraction, **options)
        for n, fraction in ((40, 1.0), (20, None), (5, None), (1, None))
    )
    assert whole[-1].work["friction_work"] == pytest.approx(fine[-1].work["friction_work"], rel=0.1)
    shear, pressure = fine[-1].contact["ball"].shear, fine[-1].contact["ball"].pressure.max()
    for steps, error in ((five, 0.05), (one, 0.1)):
        assert steps[-1].work["friction_work"] == pytest.approx(fine[-1].work["friction_work"], rel=error)
        assert np.abs(steps[-1].contact["ball"].shear - shear).max() < 0.03 * 0.3 * pressure
        done = sum(step.contact["ball"].dissipation for step in steps)
        assert done == pytest.approx(steps[-1].work["friction_work"])


@pytest.mark.parametrize("element", ["quad4", pytest.param("tri6", marks=pytest.mark.slow)])
def test_work_of_friction_between_bodies_does_not_depend_on_the_number_of_steps(element):
    """A soft ball on a stiff one."""
    size = {"arc_sizes": (0.5, 4.0), "segments": 3} if element == "quad4" else {"size": 6.0, "contact_size": 0.8}
    works = []
    for n, fraction in ((40, 1.0), (5, None), (1, None)):
        bodies = {"SPHHAU": fc.LinearElastic(E=20_000.0, nu=0.3), "SPHBAS": fc.LinearElastic(E=2e6, nu=0.3)}
        model = pressed_spheres(fc.generate.half_spheres(element, **size), 0.5, material=bodies, friction=0.05)
        criteria = fc.Criteria(friction_while_touching=fraction)
        works.append(fc.solve(model, n, criteria=criteria)[-1].work["friction_work"])
    assert works[1:] == [pytest.approx(works[0], rel=error) for error in (0.05, 0.15)]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:contact 'ball' has only")
def test_shear_in_space_does_not_depend_on_the_number_of_steps():
    options = {"kinematics": "3d", "element": "hex8", "formulation": "mortar", "friction": 0.1}
    cases = [("direct", 20, 0.01), ("direct", 5, 0.01), ("amg", 5, 0.01)]
    fine, *few = (
        pressed_ball(steps=n, solver=solver, friction_while_touching=fraction, **options)[-1]
        for solver, n, fraction in cases
    )
    shear, pressure = fine.contact["ball"].shear, fine.contact["ball"].pressure.max()
    for step in few:
        assert step.work["friction_work"] == pytest.approx(fine.work["friction_work"], rel=0.02)
        assert np.abs(step.contact["ball"].shear - shear).max() < 0.1 * 0.1 * pressure
    assert few[1].work["friction_work"] == pytest.approx(few[0].work["friction_work"], rel=1e-3)  # rough increments


def test_a_ball_that_a_force_drives_has_the_work_of_friction_of_many_steps():
    options = {"formulation": "mortar", "motion": None, "force": {"y": -60.0}}
    fine, few = (pressed_ball(steps=n, **options)[-1] for n in (12, 4))
    assert few.work["friction_work"] == pytest.approx(fine.work["friction_work"], rel=0.05)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*of the work of friction")
def test_steps_in_finite_strain_are_halved_where_nodes_close_and_slide():
    options = {"formulation": "mortar", "strain": "finite"}
    fine, whole, few = (
        pressed_ball(steps=n, friction_while_touching=fraction, **options)[-1].work["friction_work"]
        for n, fraction in ((40, 1.0), (2, 1.0), (2, 0.1))
    )
    assert few == pytest.approx(fine, rel=0.05)
    assert whole > 2.0 * fine


@pytest.mark.filterwarnings("ignore:the largest equivalent strain", "ignore:the energy of these load steps")
@pytest.mark.parametrize("formulation", ["mortar", "continuous", "node_to_segment"])
def test_increments_of_friction_are_those_of_the_converged_geometry(formulation, monkeypatch):
    """In one step on a drum, increments on the geometry of the step as a whole leave displacements wrong by 2e-4."""
    model = elastic_model(fc.generate.block((2.0, 1.0), (8, 4)), "plane_strain", TOP={"x": 0.15, "y": -0.2})
    drum = fc.obstacles.Sphere((0.7, -3.0), 3.0)
    model.add_obstacle("drum", secondary="BOTTOM", obstacle=drum, friction=0.3, formulation=formulation)

    def solved(tolerance):
        monkeypatch.setattr(friction_increments, "SINGLE_PRECISION", tolerance)
        return fc.solve(model, 1)[-1]

    step, exact, rough = solved(friction_increments.SINGLE_PRECISION), solved(1e-10), solved(1.0)
    size = np.abs(exact.displacement).max()
    assert np.abs(step.displacement - exact.displacement).max() < 1e-6 * size
    assert np.abs(rough.displacement - exact.displacement).max() > 1e-4 * size
    assert step.work["friction_work"] == pytest.approx(exact.work["friction_work"], rel=1e-5)


@pytest.mark.parametrize(
    ("formulation", "rigid"),
    [("continuous", True), ("mortar", True), ("mortar", False), ("node_to_segment", False), ("continuous", False)],
)
def test_a_contact_that_moves_has_the_work_of_its_force(formulation, rigid):
    """A cylinder is dragged over a block by half the contact width in each step: nodes leave and close."""
    mesh, press, drag = fc.generate.block((12.0, 2.0), (48, 6), name="LOW"), [(0, 0), (1, 1)], [(1, 0), (7, 1)]
    if not rigid:
        round_block = fc.generate.block((4.0, 2.0), (16, 6), origin=(1.0, 2.0), name="UP")
        x, y = round_block.points.T
        round_block = round_block.replace(points=np.column_stack([x, y + (x - 3.0) ** 2 * (4.0 - y) / 80.0]))
        mesh = united(LOW_=mesh, UP_=round_block)
    low = "" if rigid else "LOW_"
    model = elastic_model(mesh, E=1e4, **{f"{low}BOTTOM": "x"})
    model.prescribe(f"{low}BOTTOM", y=0.03, ramp=[*press, (7, 1)])
    pair = {"secondary": f"{low}TOP", "friction": 0.2, "formulation": formulation}
    if rigid:
        cylinder = fc.obstacles.Sphere((3.0, 22.0), 20.0)
        model.add_obstacle("pair", obstacle=cylinder, motion={"x": 6.0}, ramp=[(0, 0), *drag], **pair)
    else:
        supported(model, UP_TOP={"y": 0.0}).prescribe("UP_TOP", x=6.0, ramp=[(0, 0), *drag])
        model.add_contact("pair", primary="UP_BOTTOM", **pair)
    steps = fc.solve(model, np.arange(1.0, 8.0))
    force = np.array([abs(step.contact["pair"].force[1]) for step in steps])
    done = [step.contact["pair"].dissipation for step in steps[1:]]
    assert done == pytest.approx(0.2 * 0.5 * (force[1:] + force[:-1]), rel=0.05)  # it sticks at first
    assert steps[-1].work["friction_while_touching"] < 0.01 * steps[-1].work["friction_work"]


@pytest.mark.filterwarnings("ignore:.*of the work of friction is done at nodes")
@pytest.mark.parametrize(
    ("body", "options", "slide", "load", "error"),
    [
        (None, {}, 1.0, 0.0, 0.02),
        (None, {}, 3.0, 1.0, 0.02),
        (None, {"formulation": "mortar"}, 1.0, 0.1, 0.1),
        ("primary", {"multipliers": "dual"}, 1.5, 1.0, 0.02),
        ("primary", {"multipliers": "dual"}, 1.5, 0.1, 0.1),
        ("primary", {"multipliers": "standard"}, 3.0, 1.0, 0.02),
        ("secondary", {"multipliers": "dual"}, 1.5, 1.0, 0.02),
    ],
)
def test_a_contact_that_moves_by_more_than_its_width_in_one_step(body, options, slide, load, error):
    """A block is drawn along a cylinder, of which the part `load` is pressed in before: one step has the work of many.

    Without this part, the contact is open at the beginning of the step.
    """
    mesh = fc.generate.block((12.0, 2.0), (96, 8), origin=(-6.0, -2.0), name="LOW")
    press, low, works = [(0.0, 0.0), (1.0, load), (2.0, 1.0)], "LOW_" if body else "", []
    if body:
        cap = fc.generate.block((3.0, 2.0), (25, 6), origin=(-1.5, 0.0), name="UP")
        x, y = cap.points.T
        mesh = united(LOW_=mesh, UP_=cap.replace(points=np.column_stack([x, y + x**2 * (2.0 - y) / 20.0])))
    for count in (1, 16):
        model = elastic_model(mesh, **{f"{low}BOTTOM": {"x": -slide, "y": 0.0, "ramp": [(0, 0), (1, 0), (2, 1)]}})
        if body:
            supported(model, UP_TOP={"x": 0.0, "y": -0.05, "ramp": press})
            sides = ("LOW_TOP", "UP_BOTTOM")[:: -1 if body == "secondary" else 1]
            with_contact(model, "pair", *sides, friction=0.3, **options)
        else:
            motion = {"motion": {"y": -0.04}, "ramp": press}
            with_obstacle(model, "pair", "TOP", fc.obstacles.Sphere((0.0, 5.0), 5.0), friction=0.3, **motion, **options)
        steps = fc.solve(model, [1.0, *np.linspace(1.0, 2.0, count + 1)[1:]])
        works.append(sum(step.contact["pair"].dissipation for step in steps[1:]))
    assert works[0] == pytest.approx(works[1], rel=error)


@pytest.mark.filterwarnings("ignore:contact 'plane' has opened again")
def test_slip_after_nodes_have_left_is_told():
    model = elastic_model(fc.generate.block((2.0, 1.0), (4, 2)), "plane_strain", E=1e4)
    model.prescribe("TOP", y=0.01, ramp=[(0, 0), (1, -1), (2, -1), (3, 1)])
    model.prescribe("TOP", x=1.0, ramp=[(0, 0), (1, 0), (2, 0.1), (3, 1)])
    plane = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("plane", secondary="BOTTOM", obstacle=plane, friction=0.2)
    with pytest.warns(
        fc.FastcontactWarning, match="friction is done at nodes .* shear is inaccurate where contact begins"
    ):
        work = fc.solve(model, [1.0, 2.0, 3.0])[-1].work
    assert work["friction_while_touching"] > 0.5 * work["friction_work"]


@pytest.mark.parametrize("friction", [0.5, 0.0, -0.5])
def test_the_share_of_work_while_touching_is_at_most_all_of_it(friction):
    """Elastic slip that recovers may leave less work in total than was done while nodes touched."""
    (text,) = _slip_before_contact(fc.Criteria(), State(np.zeros(2), 0.0, work=Work(1.0, friction, 1.0)))
    assert text.startswith("100% of the work of friction")


def test_the_energy_of_hot_bodies_before_contact_does_not_hide_work_while_touching():
    work = Work().after((1e6, 0.0), 0.0, (0.0, 0.0, 0.0)).after((6e3, 0.0), 0.0, (300.0, 60.0, 0.0))
    (text,) = _slip_before_contact(fc.Criteria(), State(np.zeros(2), 0.0, work=work))
    assert text.startswith("20% of the work of friction")


def test_no_work_of_friction_is_not_told_where_the_strain_energy_is_round_off():
    assert not [*_slip_before_contact(fc.Criteria(), State(np.zeros(2), 0.0, work=Work(-1e-30, 0.0, 0.0)))]


def test_steps_as_a_whole_have_the_work_of_slip_before_nodes_touch():
    few = pressed_ball()
    with pytest.warns(fc.FastcontactWarning, match=r"of the work of friction is done at nodes in the load step in"):
        whole = pressed_ball(friction_while_touching=1.0)
    assert whole[-1].work["friction_work"] > 2.0 * few[-1].work["friction_work"]
    assert whole[-1].work["friction_while_touching"] > 0.5 * whole[-1].work["friction_work"]
    assert "substeps" not in few[-1].iterations  # increments, not halves
    assert whole[-1].warnings[-1].endswith("matters, use more load steps")
    assert not few[-1].warnings


def test_nodes_that_touch_at_the_beginning_do_not_close_in_the_step():
    """A block that lies on another one is drawn over it in one step: slip counts from first contact."""
    mesh = fc.generate.block_on_block(divisions_lower=(4, 2), divisions_upper=(3, 2))
    model = elastic_model(mesh, "plane_strain", LOWER_BOTTOM="xy", UPPER_TOP={"x": 0.05, "y": -0.05})
    model.add_contact("pair", secondary="CONT_UPPER", primary="CONT_LOWER", friction=0.2, formulation="continuous")
    work = fc.solve(model, 1)[-1].work
    assert work["friction_work"] > 0.0
    assert not work["friction_while_touching"]


@pytest.mark.filterwarnings("ignore:.*of the work of friction", "ignore:.*nodal pressures oscillate")
@pytest.mark.parametrize(
    ("dim", "formulation", "exchanged"),
    [
        (2, "mortar", False),
        (3, "continuous", False),
        (3, "mortar", False),
        (3, "mortar", True),
        (3, "node_to_segment", True),
    ],
)
@pytest.mark.filterwarnings("ignore:.*integration points of complete facets")
def test_nodes_beside_an_edge_of_the_other_side_were_not_open(dim, formulation, exchanged):
    """The lower block is longer than the upper one, and an edge of the upper one is within a facet of the lower one."""
    held, sides = (("LOWER_BOTTOM", ["CONT_LOWER", "CONT_UPPER"]), ("LOWER_ZMIN", ["LOWER_TOP", "UPPER_BOTTOM"]))[
        dim - 2
    ]
    model = elastic_model(blocks(dim), "plane_strain" if dim == 2 else "3d", E=E, **{held: "xyz"[:dim]})
    model.prescribe("UPPER_TOP", **{"x": 0.02, "xyz"[dim - 1]: -0.03})
    secondary, primary = sides[:: -1 if exchanged else 1]
    model.add_contact("pair", secondary=secondary, primary=primary, friction=FRICTION, formulation=formulation)
    work = fc.solve(model, 1, criteria=fc.Criteria(friction_while_touching=1.0))[-1].work
    assert work["friction_work"] > 0.0
    assert not work["friction_while_touching"]


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_nodes_that_face_nothing_do_not_disturb_the_increments_of_a_step():
    """The longer block is secondary; with multigrid the increments contain its nodes, also those beside the other block."""
    found = []
    for solver in ("direct", "amg"):
        mesh = blocks(2)
        points = mesh.points.copy()
        upper = mesh.points_of("UPPER")
        points[upper, 1] += 0.01 * points[upper, 0]  # nodes close one after another
        model = elastic_model(mesh.replace(points=points), "plane_strain", E=E, LOWER_BOTTOM="xy")
        model.prescribe("UPPER_TOP", x=0.02, y=-0.03)
        model.add_contact("pair", secondary="CONT_LOWER", primary="CONT_UPPER", friction=FRICTION)
        last = fc.solve(model, fc.linear_ramp(2), linear_solver=solver)[-1]
        assert np.isfinite(last.contact["pair"].slip).all()
        found.append(last.displacement)
    assert np.abs(found[1] - found[0]).max() < 1e-6 * np.abs(found[0]).max()


@pytest.mark.parametrize("strain", ["small", "finite"])
@pytest.mark.parametrize("instants", [[1.0], [0.25, 0.5, 0.75, 1.0]])
def test_a_block_that_is_hot_at_first_shrinks_towards_its_middle(instants, strain):
    """The heat and the weight act at the beginning: friction opposes the shrinking, for any number of load steps."""
    model = fc.Model(fc.generate.block((0.1, 0.02), (10, 2), "quad8"), "plane_strain", strain=strain)
    model.add_material(fc.LinearElastic(E=1e9, nu=0.3, expansion=1e-5))
    model.couple("TOP", "xy")
    model.fix("TOP_LEFT", "x")
    model.add_force("TOP", y=-1e3, ramp=[(0.0, 1.0), (1.0, 1.0)])
    model.add_temperature(100.0, ramp=[(0.0, 1.0), (1.0, 0.0)])
    floor = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor, friction=0.2)
    contact = fc.solve(model, instants)[-1].contact["floor"]
    right = contact.coordinates[:, 0] > 0.05
    assert not contact.sticking[contact.active].all()
    assert contact.force_vectors[right, 0].sum() > 0.19 * contact.force_vectors[right, 1].sum()


def test_a_ring_that_contact_alone_holds_slides_as_on_weak_springs():
    """A ring is pulled onto a rigid pin with a clearance, and may turn about the point at which it is guided."""
    half = fc.generate.block((1.0, 1.0), (5, 24), "quad8", name="RING")
    half = fc.generate.renamed(half, {"LEFT": "HOLE", "RIGHT": "RIM", "BOTTOM": None, "TOP": None})
    radius, angle = 10.0 + 20.0 * half.points[:, 0], np.pi * half.points[:, 1]
    half = half.replace(points=np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))
    mesh = fc.generate.merge_points(fc.generate.union(half, fc.generate.mirrored(half, "y")), 1e-6)
    mesh = mesh.with_groups(points={"END": [int(np.argmax(mesh.points[:, 0]))]})
    work = []
    for steps, stiffness in ((1, 0.0), (4, 0.0), (8, 1e-3)):
        model = elastic_model(mesh, "plane_strain", E=2e5, END="y")
        model.add_obstacle("pin", secondary="HOLE", obstacle=fc.obstacles.Sphere((0.0, 0.0), 9.97), friction=0.2)
        model.add_traction("RIM", x=40.0)
        if stiffness:
            model.add_spring("RING", x=stiffness, y=stiffness)
        last = fc.solve(model, steps, criteria=fc.Criteria(friction_while_touching=0.01))[-1]
        x, force = last.contact["pin"].coordinates.T, last.contact["pin"].force_vectors.T
        moment, pull = x[0] @ force[1] - x[1] @ force[0], abs(force[0].sum())
        assert max(abs(moment) / 10.0, abs(force[1].sum())) < 1e-6 * pull
        work.append(last.work["friction_work"])
    np.testing.assert_allclose(work, work[2], rtol=3e-3)


@pytest.mark.filterwarnings(
    "ignore:nothing determines the position", "ignore:.*of the work of friction is done at nodes"
)
def test_a_hot_hub_on_a_weak_spring_shrinks_in_few_iterations():
    shaft = fc.generate.block((25.0, 60.0), (4, 18), "quad4", name="SHAFT")
    hub = fc.generate.block((35.0, 20.0), (5, 8), "quad4", (25.0, 20.0), name="HUB")
    forces, iterations = [], []
    for stiffness, limit in ((0.0, 0.01), (1.0, 0.01), (1.0, 1.0)):
        model = fc.Model(united(SHAFT_=shaft, HUB_=hub), "axisymmetric")
        model.add_material(fc.LinearElastic(E=210e3, nu=0.3), "SHAFT")
        model.add_material(fc.LinearElastic(E=100e3, nu=0.25, expansion=1.8e-5), "HUB")
        model.fix("SHAFT_BOTTOM", "y")
        if stiffness:
            model.add_spring("HUB_BOTTOM", y=stiffness)
        model.add_contact("fit", secondary="HUB_LEFT", primary="SHAFT_RIGHT", friction=0.2, clearance=-0.02)
        model.add_temperature(320.0, "HUB", reference=20.0, ramp=[(0, 1), (1, 1), (2, 0)])
        last = fc.solve(model, [1.0, 2.0], criteria=fc.Criteria(friction_while_touching=limit))[-1]
        forces.append(last.contact["fit"].normal_force)
        iterations.append(sum(entry["active_set_iterations"] for entry in last.iterations["history"]))
    np.testing.assert_allclose(forces[1], forces[0], rtol=1e-5)
    assert iterations[0] < 200
    assert iterations[1] < 400
    assert iterations[2] < 30
