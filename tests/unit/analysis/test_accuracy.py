"""Forces balance to the criterion with every linear solver, and results of a load step agree with its solution."""

import logging
import warnings
from dataclasses import replace

import numpy as np
import pytest
from models import elastic_model, last_step, made_of, pressed_spheres, supported, united, with_contact
from stepping import Stepping

import fastcontact as fc
from fastcontact.analysis import restart
from fastcontact.analysis.problem import prepare
from fastcontact.contact.configuration import Configuration
from fastcontact.elasticity.stiffness import stiffness
from fastcontact.mesh.generate import block, box

DEPTH = 0.01
# Newton, metres and pascal; or millimetres and pressures of one.
UNITS = {"N-m": (2e11, 1e-3), "ones": (1.0, 1.0)}


def stacked(ratio=1.0, friction=0.3, formulation="node_to_segment", dim=3, unit="ones", elements=3):
    """One block on another, `ratio` times as stiff, pressed down by DEPTH and pushed aside."""
    E, size = UNITS[unit]
    axis = "xyz"[dim - 1]
    if dim == 3:
        low = fc.generate.box(
            (1.2, 1.2, 0.5), (elements + 1, elements + 1, 2), "hex8", (-0.1, -0.1, -0.5), name="BLOCK"
        )
        up = fc.generate.box((1.0, 1.0, 0.5), (elements, elements, 2), "hex8", name="BLOCK")
        bottom, top = "ZMIN", "ZMAX"
    else:
        low, up = block((1.2, 0.5), (elements + 1, 3), "quad4", (-0.1, -0.5)), block((1.0, 0.5), (elements, 3), "quad4")
        bottom, top = "BOTTOM", "TOP"
    mesh = united(L_=low, U_=up)
    mesh = fc.Mesh(mesh.points * size, mesh.cells, mesh.cell_groups, mesh.point_groups)
    materials = {"L_BLOCK": fc.LinearElastic(E, 0.3), "U_BLOCK": fc.LinearElastic(E * ratio, 0.3)}
    model = made_of(mesh, "3d" if dim == 3 else "plane_strain", materials, **{"L_" + bottom: "xyz"[:dim]})
    moved = {"x": 0.2 * DEPTH * size, "y": 0.0, axis: -DEPTH * size}
    model.prescribe("U_" + top, **moved)
    return with_contact(model, "c", "U_" + bottom, "L_" + top, formulation=formulation, friction=friction)


def solved(model, solver="direct", steps=1, **options):
    return fc.solve(model, fc.linear_ramp(steps), linear_solver=solver, **options)[-1]


def out_of_balance(model, step):
    """Return the largest force that nothing balances, where the primary side is not, over the largest contact force."""
    contact, mesh = step.contact["c"], model.mesh
    K = stiffness(mesh, model.kinematics, *model.material_numbers())
    rest = (K @ step.displacement.ravel()).reshape(mesh.points.shape)
    rest[contact.points] -= contact.force_vectors
    free = np.ones(len(rest), bool)
    for held in (*(each.group for each in model.supports), model.contact[0].primary):
        free[mesh.points_of(held)] = False
    return np.abs(rest[free]).max() / np.abs(contact.force_vectors).max()


@pytest.mark.filterwarnings("ignore:Young's moduli", "ignore:multigrid gave up", "ignore:.*across its radius")
@pytest.mark.parametrize(
    ("solver", "options"),
    [
        ("direct", {}), ("amg", {"friction": 0.0}), ("amg", {"formulation": "mortar"}), ("pyamg", {"dim": 2}),
        ("amg", {"dim": 2, "formulation": "mortar"}), ("amg", {"formulation": "continuous", "friction": 0.0}),
    ],
)  # fmt: skip
def test_soft_parts_balance_beside_parts_a_million_times_as_stiff(solver, options):
    model = stacked(1e6, **options)
    assert out_of_balance(model, solved(model, solver)) < 1e-6


@pytest.mark.filterwarnings("ignore:Young's moduli", "ignore:multigrid gave up", "ignore:.*across its radius")
@pytest.mark.parametrize("unit", UNITS)
def test_friction_of_a_stiff_secondary_side_balances(unit):
    model = stacked(1e6, unit=unit)
    found, expected = solved(model, "amg"), solved(model, "direct")
    assert out_of_balance(model, found) < 2e-7
    assert found.iterations["linear_iterations"] <= 260
    forces = expected.contact["c"].force_vectors
    assert np.abs(found.contact["c"].force_vectors - forces).max() < 3e-7 * np.abs(forces).max()


@pytest.mark.filterwarnings("ignore:Young's moduli", "ignore:.*across its radius")
def test_factors_take_over_once_where_a_tolerance_near_round_off_would_be_needed(caplog):
    with (
        caplog.at_level(logging.WARNING, "fastcontact"),
        pytest.warns(fc.FastcontactWarning, match="a factorisation replaced it"),
    ):
        solved(stacked(1e8, friction=0.0, dim=2), "amg", steps=2)
    assert sum("the out-of-balance forces are" in record.message for record in caplog.records) == 1


@pytest.mark.filterwarnings("ignore:Young's moduli", "ignore:multigrid gave up", "ignore:.*across its radius")
@pytest.mark.parametrize("solver", ["direct", "amg"])
def test_what_round_off_of_a_stiff_body_leaves_is_told_with_its_number(solver):
    model = stacked(1e10, friction=0.0, dim=2)
    with pytest.warns(fc.FastcontactWarning, match=r"out of balance by .* by round-off of a stiff body") as caught:
        found = solved(model, solver)
    text = next(str(each.message) for each in caught if "out of balance" in str(each.message))
    relative = float(text.split("out of balance by ")[1].split(" ")[0])
    assert 1e-6 < out_of_balance(model, found) < 10 * relative  # the product with K here has round-off of its own
    softer = solved(stacked(1e6, friction=0.0, dim=2)).contact["c"].force
    assert found.contact["c"].force[1] == pytest.approx(softer[1], rel=1e-5)


@pytest.mark.filterwarnings("ignore:multigrid gave up")
@pytest.mark.parametrize(("solver", "kinematics"), [("direct", "axisymmetric"), ("amg", "plane_strain")])
def test_a_stiff_body_that_moves_until_it_just_touches(solver, kinematics):
    """Round-off of its own stiffness is more than the criterion allows of a force that is small by itself."""
    mesh = united(A=block((10, 4), (8, 4), "quad8"), B=block((6, 4), (5, 3), "quad8", (0, 4.05)))
    model = made_of(mesh, kinematics, {"ABLOCK": fc.LinearElastic(1e3, 0.3), "BBLOCK": fc.LinearElastic(2e5, 0.3)})
    supported(model, ABOTTOM="xy", BTOP={"x": 0.0, "y": -1.0})
    model.add_contact("c", secondary="BBOTTOM", primary="ATOP")
    with pytest.warns(fc.FastcontactWarning, match="by round-off of a stiff body"):
        touching = fc.solve(model, [0.05 + 1e-8], linear_solver=solver)[-1].contact["c"].force[1]
    pressed = fc.solve(model, [0.051], linear_solver=solver)[-1].contact["c"].force[1]
    assert touching == pytest.approx(1e-5 * pressed, rel=1e-4)


@pytest.mark.filterwarnings("ignore:a displacement of")
@pytest.mark.parametrize("solver", ["direct", "amg", "pyamg"])
def test_bodies_that_only_move_have_no_forces_to_balance(solver):
    model = stacked(friction=0.0, dim=2, unit="N-m")
    moved = elastic_model(model.mesh, "plane_strain", E=2e11, L_BOTTOM={"x": 1.0, "y": 2.0}, U_TOP={"x": 1.0, "y": 2.0})
    assert np.abs(solved(moved, solver).displacement - [1.0, 2.0]).max() < 1e-8


@pytest.mark.each_value
@pytest.mark.parametrize("solver", ["direct", "amg", "pyamg"])
@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
def test_a_body_that_slides_on_one_at_rest_has_no_forces_to_balance(formulation, solver):
    """What round-off of the one exerts on the other is no force, though nothing cancels it there."""
    model = elastic_model(fc.generate.block_on_block(divisions_lower=(3, 2), divisions_upper=(4, 2)), "plane_strain")
    supported(model, LOWER_BOTTOM="xy", UPPER_TOP={"x": 0.5, "y": 0.0})
    model.add_contact("c", secondary="CONT_UPPER", primary="CONT_LOWER", formulation=formulation, kind="bilateral")
    step = solved(model, solver)
    assert np.abs(step.displacement[model.mesh.points_of("UPPER")] - [0.5, 0.0]).max() < 1e-8


@pytest.mark.each_value
@pytest.mark.filterwarnings("ignore:.*across its radius")
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
@pytest.mark.parametrize(("solver", "dim"), [("amg", 3), ("pyamg", 2)])
def test_a_loose_tolerance_of_the_linear_solver_costs_no_accuracy(solver, dim, tolerance, friction):
    model = stacked(friction=friction, dim=dim)
    expected, found = solved(model), solved(model, solver, linear_tolerance=tolerance)
    assert out_of_balance(model, found) < 1e-6
    np.testing.assert_allclose(
        found.contact["c"].force, expected.contact["c"].force, atol=1e-5 * np.abs(expected.contact["c"].force).max()
    )


@pytest.mark.parametrize("tolerance", [0.0, -1e-10, 0.01, 0.5, 2.0, float("nan")])
def test_senseless_tolerances_are_refused_before_anything_is_computed(tolerance, tmp_path):
    with pytest.raises(fc.ModelError, match=r"must be positive and at most 0\.001"):
        fc.solve_steps(stacked(dim=2), linear_tolerance=tolerance)
    for name in ("relative", "geometry"):
        with pytest.raises(fc.ModelError, match=rf"criterion {name} = .* must be positive and at most 0\.01"):
            fc.Criteria(**{name: 10 * tolerance})


def test_a_lowered_tolerance_is_remembered():
    model = stacked(1e3, friction=0.0, dim=2)
    analysis = Stepping(model, "pyamg", 1e-6, None, fc.linear_ramp(2))
    assert analysis.problem.solver.improve(100.0)
    analysis.state = replace(analysis.state, solver=analysis.problem.solver.snapshot())
    analysis.step(1, 0.5)
    kept = restart.restart_data(analysis.problem, analysis.state, {})
    other = Stepping(model, "pyamg", 1e-6, None, fc.linear_ramp(2))
    assert kept["solver"]["kind"] == restart.restart_data(other.problem, other.state, {})["solver"]["kind"]
    other.problem.solver.put_back(kept["solver"]["memory"])
    assert other.problem.solver.tolerance == analysis.problem.solver.tolerance == pytest.approx(3e-9)


@pytest.mark.parametrize("criteria", [{"geometry": 1e-2}, {"relative": 1e-2}])
def test_what_loose_criteria_leave_is_told_with_its_number(criteria):
    model = pressed_spheres(fc.generate.half_spheres("tri3", size=5.0))
    solver = "direct" if "geometry" in criteria else "pyamg"
    text = "still changed by" if "geometry" in criteria else "forces are out of balance by"
    with pytest.warns(fc.FastcontactWarning, match=text + r" \d\.\de-0[34]"):
        solved(model, solver, linear_tolerance=1e-3, criteria=fc.Criteria(**criteria))


@pytest.mark.each_value
@pytest.mark.filterwarnings("ignore:.*across its radius")
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize(
    "options",
    [{"elements": 8}, {"elements": 8, "formulation": "mortar"}, {"elements": 20, "dim": 2}],
    ids=["node", "mortar", "2D"],
)
def test_bodies_that_come_apart_have_no_forces_that_multigrid_balances_in_vain(options, friction, caplog):
    model = stacked(friction=friction, **options)
    with caplog.at_level(logging.WARNING, "fastcontact"):
        steps = fc.solve(model, [(0.0, 0.0), (1.0, 1.0), (2.0, -0.5), (3.0, 1.0)], linear_solver="amg")
    assert not caplog.records  # as that a factorisation replaced multigrid
    axis = model.mesh.dim - 1
    moved = steps[1].displacement[model.mesh.points_of("U_BLOCK")]
    rigid = -0.5 * np.where(np.arange(axis + 1) == axis, -DEPTH, np.where(np.arange(axis + 1) == 0, 0.2 * DEPTH, 0.0))
    assert np.abs(moved - rigid).max() < 1e-11 * DEPTH
    assert not steps[1].contact["c"].active.any()
    assert all(out_of_balance(model, steps[k]) < 1e-6 for k in (0, 2))


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("at_end", [-0.1, 0.1])
@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
def test_a_coarse_contact_that_has_opened_is_told_for_the_step_with_its_largest_force(dim, formulation, at_end):
    """With 0.1 the obstacle has not left; the warning is then about the last step."""
    mesh = fc.generate.block((4.0, 2.0), (8, 4)) if dim == 2 else fc.generate.box((4.0, 4.0, 2.0), (8, 8, 4))
    bottom, top, axis = ("BOTTOM", "TOP", "y") if dim == 2 else ("ZMIN", "ZMAX", "z")
    model = elastic_model(mesh, "plane_strain" if dim == 2 else "3d", **{bottom: "xy" if dim == 2 else "xyz"})
    centre = (2.0, 7.0) if dim == 2 else (2.0, 2.0, 7.0)
    ball = fc.obstacles.Sphere(centre, 5.0)
    options = {"motion": {axis: -0.1}, "ramp": [(0.0, 0.0), (2.0, 1.0), (4.0, at_end)], "formulation": formulation}
    model.add_obstacle("ball", secondary=top, obstacle=ball, **options)
    texts = fc.solve(model, [1.0, 2.0, 3.0, 4.0])[-1].warnings
    for steps in (2, 3) if formulation == "mortar" and dim == 2 else ():
        earlier = fc.solve(model, [1.0, 2.0, 3.0][:steps])
        assert fc.solve(model, [1.0, 2.0, 3.0, 4.0], resume=earlier)[-1].warnings == texts
    (text,) = [text for text in texts if "across its radius" in text]
    assert text.startswith(
        "in load step 2, where its force is largest, contact 'ball' has" if at_end < 0.0 else "contact"
    )


def test_steps_in_which_a_contact_is_coarse_are_told_without_a_warning_of_the_run(tmp_path):
    """The pressures of these steps are up to 20 % too large."""
    model = elastic_model(fc.generate.block((4.0, 2.0), (48, 12), "quad8", (-2.0, 0.0)), "plane_strain", BOTTOM="xy")
    model.add_obstacle("disc", secondary="TOP", obstacle=fc.obstacles.Sphere((0.0, 7.0), 5.0), force={"y": -40.0})
    instants = [0.02, 0.1, 0.25, 1.0]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", fc.FastcontactWarning)
        steps = fc.solve(model, instants)
    assert not [text for text in map(str, caught) if "across its radius" in text]
    counts = [step.iterations.get("coarse_contacts", {}).get("disc", 4) for step in steps]
    assert counts[0] == min(counts) < counts[2] < counts[3] == 4
    for step, count in zip(steps[:3], counts, strict=False):
        number = f"{count} element{'s' * (count > 1)}"
        text = f"contact 'disc' has only {number} across its radius in this step: its pressure needs 4 or more"
        assert text in step.warnings
    resumed = fc.solve(model, instants, resume=fc.solve(model, instants[:2]))
    assert [step.warnings for step in resumed[2:]] == [step.warnings for step in steps[2:]]
    with fc.ResultWriter(tmp_path / "disc.vtkhdf", model) as out:
        for step in steps:
            out.write(step)
    with fc.open_results(tmp_path / "disc.vtkhdf") as results:
        assert [step.warnings for step in results] == [step.warnings for step in steps]
        assert not [text for text in results.warnings if "across its radius" in text]


def pushed_nose(n, **options):
    """The contact of a nose of radius 4.5, with n facets of length 6 / n, and a ball of radius 2 that touches it aslant."""
    mesh = fc.generate.block((6.0, 2.0), (n, 4), "quad8", (-3.0, 0.0))
    x, y = mesh.points.T
    bottom = 4.5 - np.sqrt(4.5**2 - x**2)
    model = elastic_model(mesh.replace(points=np.column_stack([x, bottom + 0.5 * y * (4.0 - bottom)])), "plane_strain")
    model.fix("TOP", "xy")
    ball = fc.obstacles.Sphere((0.15, 4.52 - np.sqrt(6.5**2 - 0.15**2)), 2.0)
    model.add_obstacle("ball", secondary="BOTTOM", obstacle=ball, **options)
    step, _ = last_step(model)
    return step.contact["ball"].force, [text for text in step.warnings if "across its radius" in text]


def test_contacts_smaller_than_a_facet_have_inaccurate_forces():
    exact, _ = pushed_nose(96, formulation="continuous")
    force, (text,) = pushed_nose(12, formulation="mortar", multipliers="dual", friction=0.0)
    other, (plain,) = pushed_nose(12, formulation="continuous")
    assert (
        "with fewer than 2 the force and its direction may be inaccurate, too; refine 'BOTTOM', or, unless it is a sharp "
        "corner, use formulation 'continuous'" in text
    )
    assert "refine 'BOTTOM'. At a sharp corner" in plain
    assert np.linalg.norm(other - exact) < 0.1 * np.linalg.norm(exact) < np.linalg.norm(force - exact)
    _, (rough,) = pushed_nose(12, formulation="continuous", friction=0.1)
    assert "its direction and the work of friction may be inaccurate" in rough


def test_forces_across_gaps_between_large_facets_are_told():
    """A pad with rounded corners on a coarse plane: exchanged sides have the force of fine meshes, 11.6."""
    pad, plane = block((8.0, 3.0), (32, 8)), block((16.0, 4.0), (12, 4), origin=(-4.3, -4.0))
    x, y = pad.points.T
    bottom = 1.5 - np.sqrt(1.5**2 - (1.5 - np.minimum(np.minimum(x, 8.0 - x), 1.5)) ** 2)
    mesh = united(U_=pad.replace(points=np.column_stack([x, bottom + (3.0 - bottom) * y / 3.0])), L_=plane)
    forces = []
    for sides, told in ((("U_BOTTOM", "L_TOP"), False), (("L_TOP", "U_BOTTOM"), True)):
        model = elastic_model(mesh, "plane_strain", L_BOTTOM="xy", U_TOP={"x": 0.0, "y": -0.01})
        model.add_contact("pad", secondary=sides[0], primary=sides[1])
        step, texts = last_step(model, about="acts across gaps of up to")
        assert [text.endswith("refine 'L_TOP' or exchange the sides") for text in texts] == [True] * told
        forces.append(abs(step.contact["pad"].force[1]))
    assert forces[0] == pytest.approx(11.6, rel=0.05)
    assert forces[1] > 1.5 * forces[0]


FORMULATIONS = ("node_to_segment", "continuous", "mortar")


def two_blocks(wide=2.0, **held):
    """A small block on a wide one, whose sides have the prefixes U_ and L_."""
    mesh = united(L_=block((wide, 0.5), (7, 2), origin=(0.0, -0.5)), U_=block((1.0, 0.5), (4, 2)))
    return elastic_model(mesh, "plane_strain", L_BOTTOM="xy", **held)


@pytest.mark.filterwarnings("ignore:the largest", "ignore:.*across its radius")
@pytest.mark.parametrize("formulation", ["node_to_segment", "mortar"])
def test_with_a_kept_pairing_gaps_are_those_of_that_pairing(formulation):
    """A facet that turns as bodies slide: on the undeformed mesh closed nodes have no gap, on the deformed one they do."""
    model = two_blocks()
    model.prescribe("U_TOP", x=0.3, y=-0.05)
    model.add_contact("c", secondary="U_BOTTOM", primary="L_TOP", formulation=formulation)
    (step,) = fc.solve(model, fc.linear_ramp(1), criteria=fc.Criteria(keep_pairing=True))
    contact = step.contact["c"]
    flat = model.mesh.points[contact.points]
    top = model.mesh.points_of("L_TOP")
    ordered = top[np.argsort(model.mesh.points[top, 0])]
    beneath = np.interp(flat[:, 0], model.mesh.points[ordered, 0], step.displacement[ordered, 1])
    np.testing.assert_allclose(contact.gap, step.displacement[contact.points, 1] - beneath, atol=1e-12)
    np.testing.assert_allclose(contact.normal, np.tile([0.0, 1.0], (len(flat), 1)), atol=1e-14)
    if formulation == "node_to_segment":
        assert np.abs(contact.gap[contact.active]).max() < 1e-12


@pytest.mark.filterwarnings("ignore:contact .* is lost", "ignore:.*across its radius", "ignore:the largest")
@pytest.mark.filterwarnings("ignore:the energy of these load steps")  # what it leaves springs back at once
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_closed_once_is_remembered_beside_the_other_side(formulation):
    """A block slides off the end of the other one while it is closed for good, comes back, and is pulled: it holds."""
    model = two_blocks(wide=1.5, U_TOP={"x": 1.2, "ramp": ((0.0, 0.0), (1.0, 0.0), (2.0, 1.0), (3.0, 0.0), (4.0, 0.0))})
    model.prescribe("U_TOP", y=-0.01, ramp=((0.0, 0.0), (1.0, 1.0), (2.0, 1.0), (3.0, 1.0), (4.0, -1.0)))
    options = {"projection_tolerance": 0.0} if formulation != "mortar" else {}
    with_contact(model, "c", "U_BOTTOM", "L_TOP", formulation=formulation, kind="bilateral_once_closed", **options)
    steps = fc.solve(model, fc.Ramp((1.0, 2.0, 3.0, 4.0), table=((0.0, 0.0), (4.0, 4.0))))
    first, beside, _, pulled = (step.contact["c"].active for step in steps)
    assert first.all()
    assert not beside.all()
    assert pulled.all()
    assert steps[-1].contact["c"].force[1] < 0.0


def test_linear_solutions_without_contact_are_counted():
    model = two_blocks()
    supported(model, U_TOP={"x": 0.0, "y": -0.01}, U_BOTTOM="y")
    (step,) = fc.solve(model, fc.linear_ramp(1), linear_solver="direct")
    assert step.iterations["linear_iterations"] >= 1


def test_closing_slip_is_finite_where_both_normals_are_the_same():
    """The upper block lies on its back: no direction lies between the normals of the sides, and nothing is added."""
    model = two_blocks()
    model.add_contact("c", secondary="U_BOTTOM", primary="L_TOP", formulation="node_to_segment", friction=0.3)
    model.prescribe("U_TOP", x=0.0, y=-0.01)
    pair = prepare(model, fc.linear_ramp(1), fc.Criteria()).pairs["c"]
    points = model.mesh.points
    turned = np.where(
        (points[:, 1] > 0.0)[:, None] | np.isin(np.arange(len(points)), pair.secondary.points)[:, None], 1, 0
    )
    displacement = turned * ([1.0, 0.0] - 2.0 * points)
    constraints = pair.constraints(Configuration.displaced(displacement))
    assert constraints.usable.any()
    assert np.abs(constraints.slip0).max() == 0.0


@pytest.mark.filterwarnings("ignore:.*across its radius")
def test_where_bodies_meet_first_does_not_depend_on_the_steps_before():
    """A ball that comes down at a slant meets the block where it is then, not where it was after the first step."""
    found = []
    for instants in ((0.7, 1.0), (0.1, 0.2, 0.6, 0.7, 1.0)):
        model = elastic_model(box((4.0, 2.0, 1.0), (12, 6, 2), origin=(-1.0, -1.0, -1.0)), "3d", ZMIN="xyz")
        ball = fc.obstacles.Sphere((0.0, 0.0, 2.0624), 2.0)
        model.add_obstacle("ball", secondary="ZMAX", obstacle=ball, motion={"x": 1.0, "z": -0.1})
        found.append(fc.solve(model, fc.Ramp(instants))[-1].contact["ball"])
    assert found[0].active.any()
    np.testing.assert_array_equal(found[0].abscissa, found[1].abscissa)
    assert np.abs(found[0].coordinates[np.argmin(found[0].abscissa), 0] - 0.7) < 0.2
