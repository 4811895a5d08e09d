"""Loads in equilibrium: exact fields, thick cylinders, coupled faces, histories, floating bodies."""

import numpy as np
import pytest
from models import elastic_model, last_step, supported, with_contact, with_obstacle
from pairwise import first_of

import fastcontact as fc

pytestmark = pytest.mark.each_value

PLANE = ("tri3", "tri6", "quad4", "quad8", "quad9")
SOLID = ("tet4", "tet10", "hex8", "hex20", "hex27", "wedge6", "wedge15", "pyramid5", "pyramid13")
E, NU = 1000.0, 0.3


# --- exact fields -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress", "axisymmetric"])
@pytest.mark.parametrize("element", PLANE)
def test_uniform_pressure_gives_a_uniform_stress(element, kinematics):
    mesh = fc.generate.block((2.0, 3.0), (3, 4), element, distortion=0.2 if element in PLANE[:3] else 0.0)
    model = elastic_model(mesh, kinematics, LEFT="x", BOTTOM="y")
    model.add_pressure("TOP", 5.0)
    model.add_pressure("RIGHT", 2.0)
    last = fc.solve(model, 1)[-1]
    expected = {"plane_strain": NU * -7.0, "plane_stress": 0.0, "axisymmetric": -2.0}[kinematics]
    assert np.abs(last.stress - [-2.0, -5.0, expected, 0.0]).max() < 1e-12 * 5.0
    area = np.pi * 4.0 if kinematics == "axisymmetric" else 2.0
    assert last.reaction[mesh.points_of("BOTTOM"), 1].sum() == pytest.approx(5.0 * area, rel=1e-12)


@pytest.mark.parametrize("element", SOLID)
def test_uniform_pressure_gives_a_uniform_stress_in_3d(element):
    model = elastic_model(fc.generate.box((2.0, 3.0, 1.0), (2, 2, 2), element), "3d", XMIN="x", YMIN="y", ZMIN="z")
    model.add_pressure("XMAX", 2.0)
    model.add_traction("YMAX", y=3.0)
    model.add_force("ZMAX", z=-4.0 * 6.0)
    assert np.abs(fc.solve(model, 1)[-1].stress - [-2.0, 3.0, -4.0, 0.0, 0.0, 0.0]).max() < 2e-12 * 4.0


def ring(element, n):
    """A quarter of the ring 1 < r < 2, mid nodes on the circles."""
    mesh = fc.generate.block((1.0, 1.0), (n, 2 * n), element, origin=(1.0, 0.0))
    r, angle = mesh.points[:, 0], 0.5 * np.pi * mesh.points[:, 1]
    return mesh.replace(points=np.column_stack([r * np.cos(angle), r * np.sin(angle)]))


@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress"])
@pytest.mark.parametrize(("element", "order"), [("tri3", 1.9), ("quad4", 1.9), ("tri6", 2.9), ("quad8", 2.9)])
def test_a_thick_cylinder_converges_to_lame(element, order, kinematics):
    exact = fc.analytic.thick_cylinder(
        E=E, nu=NU, inner_radius=1.0, outer_radius=2.0, inner_pressure=10.0, kinematics=kinematics
    )
    sizes, errors = (4, 8, 16), []
    for n in sizes:
        mesh = ring(element, n)
        model = elastic_model(mesh, kinematics, BOTTOM="y", TOP="x")
        model.add_pressure("LEFT", 10.0)  # the bore
        u = fc.solve(model, 1)[-1].displacement
        r = np.linalg.norm(mesh.points, axis=1)
        difference = u - (exact.displacement(r) / r)[:, None] * mesh.points
        errors.append(np.sqrt((difference**2).mean()) / exact.displacement(1.0))
    fitted = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert fitted > order
    assert errors[-1] < (1e-3 if order < 2 else 1e-5)


@pytest.mark.parametrize("element", ["quad8", "tri6", "hex20", "tet10"])
def test_a_column_under_its_weight(element):
    """Without lateral contraction ``u_y = -w (L y - y^2 / 2) / E``, which quadratic elements hold exactly."""
    if element in PLANE:
        mesh, axis = fc.generate.block((1.0, 4.0), (1, 3), element), 1
        sides, kinematics = {"bottom": "BOTTOM", "left": "LEFT"}, "plane_strain"
    else:
        mesh, axis = fc.generate.box((1.0, 1.0, 4.0), (1, 1, 3), element), 2
        sides, kinematics = {"bottom": "ZMIN", "left": "XMIN"}, "3d"
    model = elastic_model(mesh, kinematics, E=E, nu=0.0, **{sides["bottom"]: "xyz"[axis], sides["left"]: "x"})
    if axis == 2:
        model.fix("YMIN", "y")
    model.add_body_force(**{"xyz"[axis]: -2.0})
    last = fc.solve(model, 1)[-1]
    y = mesh.points[:, axis]
    assert np.abs(last.displacement[:, axis] + 2.0 * (4.0 * y - y * y / 2) / E).max() < 1e-14
    assert last.reaction[:, axis].sum() == pytest.approx(8.0, rel=1e-12)


# --- relations ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", ["direct", "amg"])
def test_a_coupled_face_under_a_force_is_a_rigid_plate(solver):
    """Coupled nodes under a total force move as a face does that is pushed by the same amount."""
    mesh = fc.generate.block((2.0, 1.0), (6, 4), "quad8")
    top = mesh.points_of("TOP")

    def prepared():
        return supported(elastic_model(mesh, "plane_strain"), BOTTOM="xy")

    forced = prepared()
    forced.couple("TOP", "y")
    forced.add_force("TOP", y=-30.0)
    first = fc.solve(forced, 1, linear_solver=solver, linear_tolerance=1e-13)[-1]
    assert np.ptp(first.displacement[top, 1]) < 1e-15
    assert first.reaction[mesh.points_of("BOTTOM"), 1].sum() == pytest.approx(30.0, rel=1e-10)
    assert abs(first.reaction[top, 1].sum()) < 1e-10 * 30.0  # what couples the face adds no resultant
    assert np.abs(first.reaction[top, 1]).max() > 0.1

    moved = prepared()
    moved.prescribe("TOP", y=float(first.displacement[top[0], 1]))
    second = fc.solve(moved, 1, linear_solver=solver, linear_tolerance=1e-13)[-1]
    assert second.reaction[top, 1].sum() == pytest.approx(-30.0, rel=1e-9)
    assert np.abs(second.stress - first.stress).max() < 1e-9 * np.abs(first.stress).max()


def test_a_reference_point_carries_the_force_of_a_face():
    mesh = fc.generate.block((2.0, 1.0), (4, 2), "quad4")
    top = mesh.points_of("TOP")
    mesh = mesh.replace(points=np.vstack([mesh.points, [[1.0, 9.0]]]))
    mesh = mesh.with_groups(points={"PILOT": [mesh.n_points - 1]})
    results = []
    for pilot in (False, True):
        model = elastic_model(mesh, "plane_stress", BOTTOM="xy")
        if pilot:
            for node in top:
                model.relate([(int(node), "y", 1.0), ("PILOT", "y", -1.0)])
            model.add_force("PILOT", y=-3.0)
        else:
            model.couple("TOP", "y")
            model.add_force("TOP", y=-3.0)
        results.append(fc.solve(model, 1)[-1].displacement)
    assert np.abs(results[0][:-1] - results[1][:-1]).max() < 1e-12 * np.abs(results[0]).max()
    assert results[1][-1, 1] == pytest.approx(results[1][top[0], 1], rel=1e-12)


def test_a_relation_with_a_right_hand_side_and_its_reactions():
    """Two halves pulled apart by a given amount: the relation's forces are equal and opposite."""
    mesh = fc.generate.block_on_block("quad4", divisions_lower=(4, 2), divisions_upper=(4, 2))
    model = elastic_model(mesh, "plane_stress", LOWER_BOTTOM="xy", UPPER_TOP="xy")
    lower, upper = mesh.points_of("CONT_LOWER"), mesh.points_of("CONT_UPPER")
    order = [points[np.argsort(mesh.points[points, 0])] for points in (lower, upper)]
    for a, b in zip(*order, strict=True):
        model.relate([(int(b), "y", 1.0), (int(a), "y", -1.0)], value=0.1)
        model.relate([(int(b), "x", 1.0), (int(a), "x", -1.0)])
    last = fc.solve(model, 1)[-1]
    below, above = order
    assert last.displacement[above, 1] - last.displacement[below, 1] == pytest.approx(0.1, rel=1e-12)
    assert last.reaction[below, 1] == pytest.approx(-last.reaction[above, 1], rel=1e-9)
    assert last.reaction[below, 1].sum() == pytest.approx(
        -last.reaction[mesh.points_of("LOWER_BOTTOM"), 1].sum(), rel=1e-9
    )


# --- histories ----------------------------------------------------------------------------------------------------


def test_loads_with_their_own_histories():
    model = elastic_model(fc.generate.block((2.0, 1.0), (3, 2), "quad8"), "plane_strain", BOTTOM="y", LEFT="x")
    model.add_pressure("TOP", 5.0, ramp=[(0, 0), (1, 1), (3, 1)])
    model.add_pressure("RIGHT", 2.0, ramp=[(0, 0), (1, 0), (2, 1), (3, 0)])
    steps = fc.solve(model, fc.Ramp((0.5, 1.0, 2.0, 3.0), ((0, 0), (3, 7))))
    for step, top, right in zip(steps, (2.5, 5.0, 5.0, 5.0), (0.0, 0.0, 2.0, 0.0), strict=True):
        assert np.abs(step.stress[:, :2] - [-right, -top]).max() < 1e-12 * 5.0


# --- bodies that only contact holds -------------------------------------------------------------------------------


def driven_by_force(mesh, formulation, force, gap=0.0, **load):
    """Half-spheres, the upper one pushed down by a force on its coupled top face, the lower one raised."""
    points = mesh.points.copy()
    if gap:
        points[mesh.points_of("SPHHAU"), 1] += gap
    model = elastic_model(mesh.replace(points=points), "axisymmetric", E=20_000.0, A1A2="x", A1B1={"y": 2.0})
    model.couple("A2B2", "y")
    model.add_force("A2B2", y=-force, **load)
    return with_contact(model, "hertz", "CONT1", "CONT2", formulation=formulation)


@pytest.mark.parametrize("solver", first_of(1, ["direct", "amg"]))
@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
@pytest.mark.parametrize("steps", [4, 1])
def test_force_driven_is_displacement_driven(formulation, solver, steps, forma04):
    mesh = fc.generate.half_spheres("tri3", size=4.0)
    options = {"linear_solver": solver, "linear_tolerance": 1e-12}
    moved = fc.solve(forma04(mesh, formulation), 1, **options)[-1]
    force = abs(moved.contact["hertz"].force[1])
    last = fc.solve(driven_by_force(mesh, formulation, force), fc.linear_ramp(steps), **options)[-1]
    assert np.abs(last.displacement - moved.displacement).max() < 1e-8 * 2.0
    assert np.abs(last.stress - moved.stress).max() < 1e-8 * np.abs(moved.stress).max()
    assert last.displacement[mesh.points_of("A2B2"), 1] == pytest.approx(-2.0, rel=1e-8)
    told = last.iterations["regularised"]
    named = {"motions", "springs", "spring_stiffness", "force_left", "relative_to_load", "positions"}
    assert set(told) == {*named, "undetermined", "moved"}
    assert told["motions"] == ["body 'SPHHAU': translation along y (the axis)"]
    assert told["spring_stiffness"] > 0
    assert told["relative_to_load"] < (1e-11 if solver == "direct" else 1e-8)


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
@pytest.mark.parametrize("gap", [0.5, 30.0])
def test_a_body_comes_from_afar(gap, formulation):
    """With a gap at the start the body moves through it, and then presses as without."""
    mesh = fc.generate.half_spheres("tri3", size=5.0)
    near, far = (fc.solve(driven_by_force(mesh, formulation, 2e5, gap=g), fc.linear_ramp(2))[-1] for g in (0.0, gap))
    upper = mesh.points_of("SPHHAU")
    expected = near.displacement.copy()
    expected[upper, 1] -= gap
    assert np.abs(far.displacement - expected).max() < 1e-9 * 30.0
    assert np.abs(far.stress - near.stress).max() < 1e-8 * np.abs(near.stress).max()


@pytest.mark.filterwarnings("ignore:the loads strain the model by about 2.9e-15")
def test_a_load_lost_in_round_off_is_told_in_numbers(request):
    """A millionth of a newton over a gap of 30 mm: the deformations are below the accuracy of the coordinates.

    What an iteration leaves is larger still, so that the contact does not close.
    """
    iterative = request.config.getoption("--linear-solver") == "amg"
    mesh = fc.generate.half_spheres("tri3", size=8.0)
    springs = r"springs that regularise .* still carry \d\.\de-0\d of the load"
    gap = r"never closed: the smallest gap is \d"
    with pytest.warns(fc.FastcontactWarning, match=gap if iterative else springs):
        fc.solve(driven_by_force(mesh, "node_to_segment", 1e-6, gap=30.0), 1)[-1]


@pytest.mark.parametrize("friction", [None, 0.3])
def test_a_body_that_nothing_loads_has_no_determined_position(friction):
    """It lies between two others without touching them; pushed by one of them, it has one."""
    for push, free in ((0.0, True), (0.3, False)):
        last, texts = last_step(floating_block(push, friction), about="nothing determines the position")
        assert len(texts) == free
        assert last.iterations["regularised"]["undetermined"] == (
            {"body 'UPPER'": ["translation along y"]} if free else {}
        )
        assert not free or "body 'UPPER': translation along y" in texts[0]


@pytest.mark.filterwarnings("ignore:contact 'drum'")
def test_springs_of_a_body_loaded_only_across_its_free_motion():
    """A band over a drum is pulled down at one end and held at the other. Its loads along x, which is free, are round-off."""
    strip, radius = fc.generate.block((1.0, 1.0), (20, 1), "quad8", name="BAND"), 50.0
    angle, r = np.pi * (1.0 - strip.points[:, 0]), radius + 0.5 * strip.points[:, 1]
    points = np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1)
    model = elastic_model(strip.replace(points=points), "plane_strain", E=2e6, nu=NU)
    model.add_traction("LEFT", x=1e-16, y=-20.0)
    supported(model, RIGHT="y")
    model.add_obstacle("drum", secondary="BOTTOM", obstacle=fc.obstacles.Sphere((0.0, 0.0), radius), friction=0.3)
    last = fc.solve(model)[-1]
    assert last.iterations["regularised"]["relative_to_load"] <= 1e-9
    assert last.contact["drum"].force[1] > 10.0


def test_an_undetermined_position_in_an_earlier_step_is_told_at_the_end():
    """The block is free in the first step, and pushed in the second one."""
    ramp = fc.Ramp((1.0, 2.0), ((0.0, 0.0), (1.0, 0.0), (2.0, 1.0)))
    with pytest.warns(fc.FastcontactWarning, match="determines the position of bodies in load step 1, since") as told:
        steps = fc.solve(floating_block(0.3, None), ramp)
    assert steps[-1].iterations["regularised"]["undetermined"] == {}
    assert sum("nothing determines" in str(one.message) for one in told) == 1
    assert sum("nothing determines" in text for text in steps[-1].warnings) == 1
    assert not any("smaller load steps" in text for text in steps[-1].warnings)


def test_a_body_that_loses_contact_in_a_step_is_told_with_its_motion():
    ramp = fc.Ramp((1.0, 2.0), ((0.0, 0.0), (1.0, 1.0), (2.0, 0.0)))
    with pytest.warns(fc.FastcontactWarning, match="nothing determines"):
        held, free = fc.solve(floating_block(0.3, None), ramp)
    points = fc.generate.block_on_block().points_of("UPPER")
    moved = np.abs(free.displacement - held.displacement)[points].max()
    assert moved > 1e-3
    assert any(
        f"They lost contact in this step, moving by up to {moved:.3g}: smaller" in text for text in free.warnings
    )


def floating_block(push, friction):
    """A block that is free along y, between a block and an obstacle that goes down by `push`, each 0.1 from it."""
    mesh = fc.generate.block_on_block()
    points = mesh.points.copy()
    points[mesh.points_of("UPPER"), 1] += 0.1
    model = elastic_model(mesh.replace(points=points), "plane_strain", LOWER_BOTTOM="xy", UPPER_LEFT="x")
    model.add_contact("below", secondary="CONT_UPPER", primary="CONT_LOWER", friction=friction)
    top = float(points[:, 1].max()) + 0.1
    model.add_obstacle(
        "above",
        secondary="UPPER_TOP",
        obstacle=fc.obstacles.HalfSpace((0.0, top), (0.0, -1.0)),
        motion={"y": -push},
        friction=friction,
    )
    return model


def test_a_body_pulled_away_is_told_clearly():
    mesh = fc.generate.half_spheres("tri3", size=8.0)
    done = []
    with pytest.raises(fc.ConvergenceError, match=r"pull bodies away.*'SPHHAU': translation along y"):
        fc.solve(
            driven_by_force(mesh, "node_to_segment", 1e5, ramp=[(0, 0), (0.5, 1), (1, -1)]),
            fc.linear_ramp(4), on_step=done.append,
        )  # fmt: skip
    assert [step.load_factor for step in done] == [0.25, 0.5, 0.75]


@pytest.mark.filterwarnings("ignore:nothing determines the position of bodies")
@pytest.mark.filterwarnings("ignore:contact .* has opened again at the end")
def test_a_force_goes_and_the_contact_force_with_it():
    mesh = fc.generate.half_spheres("tri3", size=5.0)
    steps = fc.solve(driven_by_force(mesh, "node_to_segment", 2e5, ramp=[(0, 0), (0.5, 1), (1, 0)]), fc.linear_ramp(4))
    forces = [step.contact["hertz"].force[1] for step in steps]
    assert forces[:3] == pytest.approx([-1e5, -2e5, -1e5], rel=1e-9)
    assert abs(forces[3]) < 1e-9 * 2e5
    assert np.abs(steps[0].stress - steps[2].stress).max() < 1e-7 * np.abs(steps[1].stress).max()
    assert np.abs(steps[3].stress).max() < 1e-9 * np.abs(steps[1].stress).max()


def stack(load, motion):
    """Three blocks, each on the one below; the middle one is held sideways only."""
    two = fc.generate.block_on_block("quad4", divisions_lower=(4, 2), divisions_upper=(4, 2))
    top = fc.generate.block((10.0, 5.0), (4, 2), "quad4", (0.0, 5.0), name="CAP")
    names = {"CAP": "CAP", "BOTTOM": "CONT_CAP", "TOP": "CAP_TOP", "LEFT": "CAP_LEFT", "RIGHT": "CAP_RIGHT"}
    mesh = fc.generate.transform.union(
        two, fc.generate.transform.renamed(top, lambda name: names.get(name, "C" + name))
    )
    model = elastic_model(mesh, "plane_strain", LOWER_BOTTOM="y", LOWER_LEFT="x", UPPER_LEFT="x", CAP_LEFT="x")
    if motion:
        model.prescribe("CAP_TOP", y=-motion)
    if load:
        model.add_pressure("CAP_TOP", load)
    model.add_contact("below", secondary="CONT_LOWER", primary="CONT_UPPER", formulation="continuous")
    return with_contact(model, "above", "CONT_CAP", "UPPER_TOP", formulation="continuous")


def test_a_body_between_two_others_is_held_by_contact_alone():
    modulus = E / (1 - NU**2)
    moved = fc.solve(stack(0.0, 0.15), 1)[-1]
    assert np.abs(moved.stress[:, 1] + modulus * 0.01).max() < 1e-9 * modulus * 0.01
    pressed = fc.solve(stack(modulus * 0.01, 0.0), 1)[-1]
    assert np.abs(pressed.displacement - moved.displacement).max() < 1e-9 * 0.15
    motions = ["body 'UPPER': translation along y", "body 'CAP': translation along y"]
    assert pressed.iterations["regularised"]["motions"] == motions


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_friction_and_weight_hold_a_block(formulation):
    """A block free to move, turn and slide stays on its friction; its tangential force is what is applied."""
    mesh = fc.generate.block_on_block("quad4", divisions_lower=(6, 3), divisions_upper=(6, 3))
    model = elastic_model(mesh, "plane_strain", LOWER_BOTTOM="xy")
    model.add_pressure("UPPER_TOP", 10.0, ramp=[(0, 0), (0.5, 1), (1, 1)])
    model.add_force("UPPER_LEFT", x=10.0, ramp=[(0, 0), (0.5, 0), (1, 1)])
    model.add_contact("base", secondary="CONT_UPPER", primary="CONT_LOWER", formulation=formulation, friction=0.3)
    for step in fc.solve(model, fc.linear_ramp(4)):
        applied = [-20.0 * max(step.load_factor - 0.5, 0.0), 100.0 * min(2 * step.load_factor, 1.0)]
        assert step.contact["base"].force == pytest.approx(applied, abs=1e-9 * 100.0)
        assert len(step.iterations["regularised"]["springs"]) == 3


def test_a_sub_model_follows_the_stages_of_the_global_model():
    """A block is pressed onto a rigid plane with friction and then sheared; its lower half is solved again on its own."""

    def model(height, divisions):
        model = elastic_model(fc.generate.block((1.0, height), (4, divisions), "quad8"), "plane_strain", E=100.0)
        return with_obstacle(model, "plane", "BOTTOM", fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0)), friction=0.3)

    block, half = model(1.0, 4), model(0.5, 2)
    heights = np.array([(0.5, -0.01), (1.0, -0.008)])  # an array of pairs serves as well as a list
    block.prescribe("TOP", x=[(0.5, 0.0), (1.0, lambda x: 0.004 - 0.001 * x[:, 0])], y=heights)
    steps = fc.solve(block, 4)
    cut, top = np.flatnonzero(block.mesh.points[:, 1] == 0.5), half.mesh.points_of("TOP")
    order = np.argsort(block.mesh.points[cut, 0])

    def displacement(step, axis):
        return lambda x: np.interp(x[:, 0], block.mesh.points[cut[order], 0], step.displacement[cut[order], axis])

    for axis, name in enumerate("xy"):
        half.prescribe("TOP", **{name: [(step.load_factor, displacement(step, axis)) for step in steps]})
    for step, lower in zip(steps, fc.solve(half, 4), strict=True):
        contact, expected = lower.contact["plane"], step.contact["plane"]
        assert lower.displacement[top, 0] == pytest.approx(displacement(step, 0)(half.mesh.points[top]), abs=1e-12)
        assert contact.force == pytest.approx(expected.force, rel=1e-9)
        assert contact.dissipation == pytest.approx(expected.dissipation, rel=1e-6, abs=1e-12)
    assert expected.dissipation > 0.0


@pytest.mark.parametrize("along_normals", [False, True])
def test_displacements_along_axes_and_normals_follow_pairs(along_normals):
    """A turned block; every node has a history of its own."""
    along, up = np.array([np.cos(0.3), np.sin(0.3)]), np.array([-np.sin(0.3), np.cos(0.3)])
    block = fc.generate.block((2.0, 1.0), (2, 2))
    model = elastic_model(block.replace(points=block.points @ [along, up]), "plane_strain", BOTTOM="xy")
    pairs = [(0.5, lambda x: 0.01 * (x @ along)), (1.0, -0.02)]
    if along_normals:
        model.prescribe("TOP", normal=pairs)
    else:
        model.prescribe("TOP", y=pairs, axes=tuple(along))
    top = block.points_of("TOP")
    for step, first, last in zip(fc.solve(model, 4), (0.5, 1.0, 0.5, 0.0), (0.0, 0.0, 0.5, 1.0), strict=True):
        expected = 0.01 * first * block.points[top, 0] - 0.02 * last
        assert step.displacement[top] @ up == pytest.approx(expected, abs=1e-12)
    forces = fc.support_forces(model, step)
    assert forces["TOP"] == pytest.approx(-forces["BOTTOM"], rel=1e-6)
    assert model.describe().count("'TOP'") == 1
    other = elastic_model(block, "plane_strain", BOTTOM="xy", TOP={"y": 0.01, "ramp": [(0, 0), (1, 1)]})
    other.prescribe("TOP", y=-0.02)
    with pytest.raises(fc.ModelError, match=r"or give both histories as pairs: y=\[\(0\.5, f\), \(1\.0, g\)\]"):
        other.check()
