"""Contact in finite strain on deformed surfaces, and its linearised geometry: patch tests, quadratic convergence."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from models import elastic_model, made_of, pressed_spheres, united, with_contact, with_obstacle
from pairwise import first_of

import fastcontact as fc
from fastcontact.analysis import geometry_loop
from fastcontact.analysis.convergence_messages import fluid_note
from fastcontact.analysis.inequalities import Iterate, pair_surfaces
from fastcontact.analysis.problem import prepare
from fastcontact.contact.pairing import normals
from tests.verification.test_finite_strain import LAWS


def stack(kinematics: str, element: str, law, **options):
    """Squeeze two blocks whose cells do not match by 30 %; return the last step and the model."""
    if kinematics == "3d":
        lower = fc.generate.box((1.0, 1.0, 0.5), (2, 3, 2), element=element)
        upper = fc.generate.box((1.0, 1.0, 0.5), (3, 2, 2), element=element)
        faces, axis = ("ZMIN", "ZMAX"), "z"
    else:
        lower = fc.generate.block((1.0, 0.5), (4, 2), element=element)
        upper = fc.generate.block((1.0, 0.5), (3, 2), element=element)
        faces, axis = ("BOTTOM", "TOP"), "y"
    upper = fc.generate.transformed(upper, translate=(*[0.0] * (lower.dim - 1), 0.5))
    names = {faces[0]: "BASE", faces[1]: "JOINT"}, {faces[0]: "SOLE", faces[1]: "HEAD"}
    mesh = fc.generate.union(*(fc.generate.renamed(part, own) for part, own in zip((lower, upper), names, strict=True)))
    model = made_of(mesh, kinematics, law, strain="finite")
    for group, component in (("LEFT", "x"), ("XMIN", "x"), ("YMIN", "y"), ("BASE", axis)):
        if group in mesh.cell_groups:
            model.fix(group, component)
    model.prescribe("HEAD", **{axis: -0.3})
    model.add_contact("joint", secondary="SOLE", primary="JOINT", **options)
    return fc.solve(model, 3)[-1], model


@pytest.mark.each_value
@pytest.mark.parametrize("law", ["neo-Hookean", "Ogden"])
@pytest.mark.parametrize(
    ("kinematics", "element"),
    [("plane_strain", e) for e in ("quad4", "tri6")]
    + [("plane_stress", "quad8"), ("axisymmetric", "quad4"), ("3d", "hex8")],
)
def test_pressure_is_the_true_stress_across(kinematics: str, element: str, law: str) -> None:
    step, model = stack(kinematics, element, LAWS[law][0])
    contact, axis = step.contact["joint"], model.mesh.dim - 1
    stress = step.stress[:, {"3d": 2}.get(kinematics, 1)]
    assert stress == pytest.approx(stress[0], rel=1e-6)
    side = model.mesh.points[contact.points, 0].argmax()
    grown = 1.0 + step.displacement[contact.points[side], 0]
    # In plane stress pressures are forces per length and unit of thickness before.
    thickness = step.cell_fields["J"][0] / (0.7 * grown) if kinematics == "plane_stress" else 1.0
    assert contact.pressure == pytest.approx(-stress[0] * thickness, rel=1e-6)
    # The true area is larger than that of before, by what the body has grown across.
    answers = fc.contact_resultants(model, [step], "joint")[0]
    area = {"plane_strain": grown, "plane_stress": grown, "axisymmetric": np.pi * grown**2, "3d": grown**2}[kinematics]
    assert grown > 1.1
    assert answers.area == pytest.approx(area, rel=1e-6)
    assert answers.pressure_mean == pytest.approx(-stress[0] * thickness, rel=1e-6)
    assert abs(contact.force[axis]) == pytest.approx(-stress[0] * thickness * area, rel=1e-6)


def test_the_width_of_a_contact_is_that_of_the_deformed_shape() -> None:
    step, _ = stack("plane_strain", "quad4", LAWS["neo-Hookean"][0])
    contact = step.contact["joint"]
    grown = 1.0 + step.displacement[contact.points, 0].max()
    assert max(contact.radius[0], 0.0) in (pytest.approx(grown, rel=1e-6), pytest.approx(0.5 * grown, rel=1e-6))


@pytest.mark.parametrize(
    ("element", "formulation"), [("quad4", "node_to_segment"), pytest.param("quad8", None, marks=pytest.mark.slow)]
)
@pytest.mark.filterwarnings("ignore:contact 'ball' has only")
def test_a_ball_slides_over_a_rubber_block(element: str, formulation: str | None) -> None:
    """Pressed in by a quarter of the height, then the block is drawn on by three nodes; friction of 0.5."""
    divisions = {"quad4": (40, 10), "quad8": (20, 5)}[element]  # as many nodes along the surface
    mesh = fc.generate.block((4.0, 1.0), divisions, element=element, origin=(-2.0, 0.0))
    model = made_of(mesh, "plane_strain", fc.NeoHookean(E=1.0, nu=0.4995), strain="finite", BOTTOM="y")
    model.prescribe("BOTTOM", x=-0.3, ramp=[(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)])
    model.add_obstacle(
        "ball", secondary="TOP", obstacle=fc.obstacles.Sphere((0.0, 1.5), 0.5), friction=0.5, motion={"y": -0.25},
        ramp=[(0.0, 0.0), (1.0, 1.0), (2.0, 1.0)], formulation=formulation,
    )  # fmt: skip
    steps = fc.solve(model, [0.5, 1.0, 1.25, 1.5, 1.75, 2.0])
    bottom = mesh.points_of("BOTTOM")
    for step in steps:
        contact = step.contact["ball"]
        assert step.reaction[bottom].sum(axis=0) == pytest.approx(
            -contact.force, abs=1e-6 * np.abs(contact.force).max()
        )
        # Normals of the ball at the deformed nodes; shear along the surface, in the cone of friction.
        out = contact.coordinates + step.displacement[contact.points] - [0.0, 1.5 - 0.25 * min(step.load_factor, 1.0)]
        out /= np.linalg.norm(out, axis=1)[:, None]
        closed = contact.active
        assert contact.normal[closed] == pytest.approx(out[closed], abs=1e-6)
        assert np.einsum("nd,nd->n", contact.shear, contact.normal)[closed] == pytest.approx(0.0, abs=1e-9)
    last = steps[-1].contact["ball"]
    slides = last.active & ~last.sticking
    assert 2 <= slides.sum() < last.active.sum()
    shear = np.linalg.norm(last.shear, axis=1)
    assert (shear <= 0.5 * last.pressure * (1.0 + 1e-9)).all()
    if formulation == "node_to_segment":  # where the law holds at nodes
        assert shear[slides] == pytest.approx(0.5 * last.pressure[slides], rel=1e-3)
    # The pull grows in every part of the way; the push falls by the few hundredths that sheared rubber sinks.
    pull = np.array([step.contact["ball"].force[0] for step in steps[1:]])
    assert (np.diff(pull) > 0.05).all()
    assert steps[-1].contact["ball"].force[1] == pytest.approx(steps[1].contact["ball"].force[1], rel=0.08)
    assert steps[-1].contact["ball"].dissipation > 0.0


def ring(free: bool):
    """Return an O-ring between plates that squeeze it by a quarter: half of it, or all, held by contact alone."""
    part = fc.generate.quarter_disc("tri6", R=2.5, size=0.5, contact_size=0.5, contact_radius=1.25)
    part = fc.generate.transformed(part, translate=(0.0, 2.5))
    mesh = fc.generate.union(part, fc.generate.mirrored(part, "x"))
    if free:
        mesh = fc.generate.union(mesh, fc.generate.mirrored(mesh, "y"))
    mesh = fc.generate.transformed(fc.generate.merge_points(mesh, 1e-6), translate=(25.0, 0.0))
    model = made_of(mesh, "axisymmetric", fc.NeoHookean(E=6.0, nu=0.4995), strain="finite")
    if free:
        model.add_obstacle("floor", secondary="CONT1", obstacle=fc.obstacles.HalfSpace((0.0, -2.5), (0.0, 1.0)))
    else:
        model.fix("A1B1", "y")
    plate = fc.obstacles.HalfSpace(point=(0.0, 2.5), normal=(0.0, -1.0))
    return with_obstacle(model, "plate", "CONT1", plate, motion={"y": -0.625 * (1 + free)})


@pytest.mark.filterwarnings("ignore:contact .* has only 3 elements")
def test_a_ring_held_by_contact_alone_is_that_of_symmetry() -> None:
    """Between plates a ring would roll: its stiffness alone is not definite, and it has more iterations."""
    half, whole = (fc.solve(ring(free), 2) for free in (False, True))
    for one, other in zip(half, whole, strict=True):
        assert other.contact["plate"].force[1] == pytest.approx(one.contact["plate"].force[1], rel=1e-5)
        assert other.contact["floor"].force[1] == pytest.approx(-other.contact["plate"].force[1], rel=1e-5)
    # Lindley (1967), of a cord with a diameter of 5; the volume is kept.
    force = -half[-1].contact["plate"].force[1] / (np.pi * 50.0)
    assert force == pytest.approx(6.0 * 5.0 * (1.25 * 0.25**1.5 + 50.0 * 0.25**6), rel=0.1)
    points, moved = (ring(False).mesh.points + part * half[-1].displacement for part in (0.0, 1.0))
    assert volume(ring(False).mesh, moved) == pytest.approx(volume(ring(False).mesh, points), rel=1e-3)


def cord(r: float, centre: float, size: float, contact_size: float) -> fc.Mesh:
    """Return the section of an O-ring of a radius, at a distance from the axis, whose halves are 'UPPER' and 'LOWER'."""
    part = fc.generate.quarter_disc("tri6", R=r, size=size, contact_size=contact_size)
    part = fc.generate.renamed(part, {"CONT1": "UPPER", "D1B1": "UPPER"})
    part = fc.generate.transformed(part, translate=(0.0, r))
    upper = fc.generate.union(part, fc.generate.mirrored(part, "x"))
    lower = fc.generate.renamed(fc.generate.mirrored(upper, "y"), {"UPPER": "LOWER"})
    mesh = fc.generate.merge_points(fc.generate.union(upper, lower), 1e-6 * r)
    return fc.generate.transformed(mesh, translate=(centre, 0.0))


def groove(friction: float, ramp: list[tuple[float, float]] | None = None) -> fc.Model:
    """Return an O-ring that the four walls of a groove hold: the inner one stretches it, the lid squeezes it by a quarter."""
    mesh = cord(2.5, 25.0, 0.7, 0.7)
    mesh = mesh.with_facet_group("CORD", lambda x: np.hypot(x[:, 0] - 25.0, x[:, 1]) > 2.4)
    mesh = mesh.with_facet_group("INSIDE", lambda x: np.hypot(x[:, 0] - 22.5, x[:, 1]) < 0.9)
    model = made_of(mesh, "axisymmetric", fc.NeoHookean(E=6.0, nu=0.4995), strain="finite")
    for name, side, point, normal, motion in (
        ("floor", "LOWER", (0.0, -2.5), (0.0, 1.0), None),
        ("lid", "UPPER", (0.0, 2.5), (0.0, -1.0), {"y": -1.25}),
        ("inner", "CORD", (22.5, 0.0), (1.0, 0.0), {"x": 0.2}),
        ("outer", "CORD", (28.3, 0.0), (-1.0, 0.0), None),
    ):
        wall = fc.obstacles.HalfSpace(point=point, normal=normal)
        model.add_obstacle(name, secondary=side, obstacle=wall, motion=motion, ramp=ramp, friction=friction)
    return model


@pytest.mark.filterwarnings("ignore:contact .* elements across its radius")
@pytest.mark.parametrize("steps", first_of(1, [5, 3]))
def test_a_ring_in_a_groove_rubs_on_four_walls(steps: int) -> None:
    """Nothing but the walls hold it; the force on the lid is that on the floor and what it rubs on both sides, sliding."""
    model = groove(0.1)
    last = fc.solve(model, steps)[-1]
    contact = last.contact
    assert sum(c.force[1] for c in contact.values()) == pytest.approx(0.0, abs=1e-6 * contact["lid"].normal_force)
    for name in ("inner", "outer"):
        assert contact[name].force[1] == pytest.approx(0.1 * contact[name].normal_force, rel=1e-6)
    for name in ("lid", "inner", "outer"):
        wall = contact[name]
        assert wall.active.any()
        assert not wall.sticking.any()
        assert np.linalg.norm(wall.shear, axis=1) == pytest.approx(0.1 * wall.pressure, rel=1e-6, abs=1e-9)
    moved = model.mesh.points + last.displacement
    assert volume(model.mesh, moved) == pytest.approx(volume(model.mesh, model.mesh.points), rel=1e-3)


@pytest.mark.filterwarnings("ignore:contact .* elements across its radius")
@pytest.mark.parametrize("steps", first_of(1, [5, 12, 1]))
def test_a_ring_in_a_groove_without_friction(steps: int) -> None:
    """The forces on lid and floor are equal for any number of steps; the walls of the groove push along x alone."""
    contact = fc.solve(groove(0.0), steps)[-1].contact
    assert contact["lid"].normal_force == pytest.approx(1151.585, rel=1e-5)
    assert contact["floor"].force[1] == pytest.approx(contact["lid"].normal_force, rel=1e-6)
    assert all(abs(contact[name].force[1]) < 1e-9 for name in ("inner", "outer"))
    assert all(contact[name].normal_force > 50.0 for name in ("inner", "outer"))


@pytest.mark.filterwarnings("ignore:contact .* has only")
@pytest.mark.parametrize(
    "options", [{}, {"formulation": "node_to_segment"}], ids=lambda own: own.get("formulation", "mortar")
)
@pytest.mark.parametrize("element", ["quad4", "quad8"])
def test_a_rubber_cord_without_friction_that_can_rotate_is_squeezed_as_one_that_cannot(element, options) -> None:
    """On polygons of facets the position is unstable, and Newton's method with springs alone would turn the cord further."""
    square = fc.generate.block((2.0, 2.0), (8, 8), element, (-1.0, -1.0))
    x, y = square.points.T
    disc = 2.5 * np.column_stack([x * np.sqrt(1.0 - 0.5 * y**2), y * np.sqrt(1.0 - 0.5 * x**2)])
    groups = {"MIDDLE": [int(np.linalg.norm(disc, axis=1).argmin())], "AXIS": np.flatnonzero(np.abs(x) < 1e-9).tolist()}
    mesh = square.replace(points=disc, point_groups=groups)
    for name, sign in (("LOWER", -1.0), ("UPPER", 1.0)):
        mesh = mesh.with_facet_group(name, lambda at, sign=sign: (np.hypot(*at.T) > 2.4) & (sign * at[:, 1] > -1e-6))
    forces = []
    for held in ("MIDDLE", "AXIS"):
        model = made_of(mesh, "plane_strain", fc.NeoHookean(E=6.0, nu=0.4995), strain="finite", **{held: "x"})
        for name, side, y, motion in (("floor", "LOWER", -2.5, None), ("lid", "UPPER", 2.5, {"y": -1.25})):
            plate = fc.obstacles.HalfSpace((0.0, y), (0.0, -np.sign(y)))
            model.add_obstacle(name, secondary=side, obstacle=plate, motion=motion, **options)
        forces.append(fc.solve(model, 2)[-1].contact["lid"].normal_force)
    assert forces[0] == pytest.approx(forces[1], rel=1e-3)


@pytest.mark.filterwarnings("ignore:contact .* elements across its radius")
def test_fluid_pushes_a_ring_with_friction_across_its_groove() -> None:
    """Squeezed, then pressurised; at the front of the fluid a node may be neither wet nor dry.

    What the fluid adds to the push of the ring on the outer wall is its pressure over the height, less friction.
    """
    model, ramps = groove(0.1, ramp=[(0.0, 0.0), (1.0, 1.0), (2.0, 1.0)]), [(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)]
    for name in ("floor", "lid"):
        model.add_fluid_pressure(name, 2.0, source="INSIDE", ramp=ramps)
    steps = fc.solve(model, [0.5, 1.0, 2.0])
    before, contact = (step.contact for step in steps[1:])
    push = [
        (c["outer"].normal_force / 28.3 - c["inner"].normal_force / 22.7) / (2.0 * np.pi) for c in (before, contact)
    ]
    rubs = 0.1 * (contact["lid"].normal_force + before["lid"].normal_force) / (np.pi * 25.0)  # both walls, turned round
    assert 2.0 * 3.75 - rubs < push[1] - push[0] < 2.0 * 3.75
    assert sum(c.force[1] for c in contact.values()) == pytest.approx(0.0, abs=1e-6 * contact["lid"].normal_force)
    assert contact["lid"].fluid_pressure.max() == pytest.approx(2.0)
    assert contact["lid"].pressure_max - before["lid"].pressure_max > 0.5 * 2.0  # the ring seals by itself
    dry = contact["lid"].fluid_pressure == 0.0
    shear = np.linalg.norm(contact["lid"].shear, axis=1)
    assert (shear[dry] <= 0.1 * contact["lid"].pressure[dry] + 1e-6).all()
    assert abs(steps[-1].work["imbalance"]) < 0.01 * steps[-1].work["external_work"]


@pytest.mark.filterwarnings("ignore:contact .* elements across its radius")
def test_fluid_pushes_a_ring_along_its_groove_until_the_wall_stops_it() -> None:
    """Squeezed radially, the ring slides when the fluid below it pushes more than friction carries, up to the wall above.

    The wall then carries the pressure on the area of the groove less the friction of its sides.
    """
    r, centre, pressure = 0.0695, 0.5615, 50.0
    ramp, fluid = [(0.0, 0.0), (1.0, 1.0), (2.0, 1.0)], [(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)]
    mesh = cord(r, centre, 0.04, 0.02)
    for name, sign in (("INNER", -1.0), ("OUTER", 1.0)):
        mesh = mesh.with_facet_group(
            name,
            lambda x, sign=sign: (sign * (x[:, 0] - centre) > -1e-9) & (np.hypot(x[:, 0] - centre, x[:, 1]) > 0.98 * r),
        )
    mesh = mesh.with_facet_group("BELOW", lambda x: np.hypot(x[:, 0] - centre, x[:, 1] + r) < 0.35 * r)
    model = made_of(mesh, "axisymmetric", fc.MooneyRivlin(C10=110.0, C01=22.0, bulk=2e5), strain="finite")
    for name, side, point, normal, motion in (
        ("inner", "INNER", (0.492, 0.0), (1.0, 0.0), {"x": 0.008}),
        ("outer", "OUTER", (0.632, 0.0), (-1.0, 0.0), {"x": -0.021}),
        ("wall", "UPPER", (0.0, 0.0935), (0.0, -1.0), None),
    ):
        plane = fc.obstacles.HalfSpace(point=point, normal=normal)
        model.add_obstacle(name, secondary=side, obstacle=plane, motion=motion, ramp=ramp, friction=0.1)
    for name in ("inner", "outer"):
        model.add_fluid_pressure(name, 20.0 * pressure, source="BELOW", ramp=fluid)
    contact = fc.solve(model, [0.5, 1.0, 1.05])[-1].contact
    rubs = 0.1 * sum(contact[name].normal_force for name in ("inner", "outer"))
    push = pressure * np.pi * (0.611**2 - 0.5**2)
    assert contact["wall"].normal_force == pytest.approx(push - rubs, rel=5e-3)
    assert contact["inner"].force_parts[2] == pytest.approx(0.1 * contact["inner"].normal_force)
    problem = prepare(model, fc.linear_ramp(1), fc.Criteria())
    assert "the fluid in contact 'inner', 'outer', whose force jumps" in fluid_note(problem, 1.05)
    assert fluid_note(problem, 1.0) == ""


def volume(mesh: fc.Mesh, points: np.ndarray) -> float:
    """Return the volume of revolution of a mesh with other places."""
    from fastcontact.mesh import elements

    total = 0.0
    for name, cells in mesh.solids.items():
        N, dN, weights = elements.get(name).tables
        jacobian = np.einsum("qaj,cai->cqij", dN, points[cells])
        total += (weights * np.linalg.det(jacobian) * (points[cells][:, :, 0] @ N.T)).sum()
    return 2.0 * np.pi * total


MESHES = {"A": "data/meshes/forma04a.med", "B": "data/meshes/forma04b.med", "C": "data/meshes/forma04c.med"}


def half_spheres(mesh, **options):
    return pressed_spheres(fc.read_mesh(MESHES[mesh]), **options)


def ball_on_block(element, **options):
    mesh = fc.generate.sphere_on_block(element, contact_size=4.0, contact_radius=8.0)
    model = elastic_model(mesh, E=20_000.0, SYMMETRY_X="x", SYMMETRY_Z="z", BLOCK_BOTTOM="y", SPHERE_TOP={"y": -2.0})
    return with_contact(model, "hertz", "CONT_SPHERE", "CONT_BLOCK", **options)


def ball_on_ball(element, **options):
    """Half a sphere on a rigid one."""
    mesh = fc.generate.sphere_octant(element, contact_size=4.0, contact_radius=8.0)
    model = elastic_model(mesh, E=20_000.0, SYMMETRY_X="x", SYMMETRY_Z="z", SPHERE_TOP={"y": -1.0})
    ball = fc.obstacles.Sphere(centre=(0.0, -60.0, 0.0), R=60.0)
    return with_obstacle(model, "hertz", "CONT_SPHERE", ball, **options)


def blocks(mesh, drawn=None, shift=4.0, sides=("CONT_UPPER", "CONT_LOWER"), **options):
    """A block drawn over a wider one."""
    sizes = {"size_lower": (14.0, 4.0), "size_upper": (6.0, 3.0), "shift": shift}
    mesh = fc.generate.block_on_block(mesh, **sizes, divisions_lower=(14, 4), divisions_upper=(9, 4))
    model = elastic_model(
        mesh, LOWER_BOTTOM="xy", **({"UPPER_TOP": {"x": 0.05, "y": -0.05}} if drawn is None else drawn)
    )
    return with_contact(model, "hertz", sides[0], sides[1], **options)


def punch(mesh, **options):
    """A block pressed into a wider one, whose facets are secondary and partly covered at the ends of the punch."""
    return blocks(mesh, shift=4.03, sides=("CONT_LOWER", "CONT_UPPER"), **options)


def seam(mesh, **options):
    """A block drawn over two blocks side by side, which touch and whose tops form one side."""
    left, right = fc.generate.block((7.2, 4.0), (8, 4), mesh), fc.generate.block((6.8, 4.0), (7, 4), mesh, (7.2, 0.0))
    lower = fc.generate.union(fc.generate.renamed(left, {"RIGHT": "A"}), fc.generate.renamed(right, {"LEFT": "B"}))
    mesh = united(LOWER_=lower, UPPER_=fc.generate.block((6.0, 3.0), (9, 4), mesh, (4.0, 4.0)))
    model = elastic_model(mesh, LOWER_BOTTOM="xy", UPPER_TOP={"x": 0.05, "y": -0.05})
    model.add_contact("hertz", secondary="UPPER_BOTTOM", primary="LOWER_TOP", **options)
    return with_contact(model, "seam", "LOWER_A", "LOWER_B", formulation="node_to_segment")


def shell(element, divisions, radii, angle, group, double):
    """Part of a hollow cylinder or sphere, with `group` on one of its curved sides."""
    inside, outside = radii
    mesh = fc.generate.box((2 * angle, 2 * angle, outside - inside), divisions, element, (-angle, -angle, inside))
    along, across, r = mesh.points.T
    along = along + 0.013 * (group == "SECONDARY")
    level = np.cos(across) if double else 1.0
    points = [level * r * np.sin(along), r * np.sin(across) if double else across, level * r * np.cos(along)]
    names = {"SECONDARY": {"ZMAX": "SECONDARY", "ZMIN": "INSIDE"}, "PRIMARY": {"ZMIN": "PRIMARY", "ZMAX": "OUTSIDE"}}
    return fc.generate.renamed(mesh.replace(points=np.column_stack(points)), names[group])


def nested(mesh, **options):
    """A shell pushed into another one, whose facets do not match; without symmetry."""
    element, double = mesh
    inner = shell(element, (3, 3, 1), (1.7, 2.0), 0.4, "SECONDARY", double)
    mesh = fc.generate.union(inner, shell(element, (5, 5, 1), (2.0, 2.4), 0.5, "PRIMARY", double))
    model = elastic_model(mesh, E=200.0, OUTSIDE="xyz", INSIDE={"x": 0.002, "y": 0.003, "z": 0.03})
    return with_contact(model, "hertz", "SECONDARY", "PRIMARY", **options)


def pressed_ball(element, **options):
    """A sphere on a block that a pressure presses; contact alone holds it vertically."""
    mesh = fc.generate.sphere_on_block(element, contact_size=4.0, contact_radius=8.0)
    model = elastic_model(mesh, E=20_000.0, SYMMETRY_X="x", SYMMETRY_Z="z", BLOCK_BOTTOM="y")
    model.add_pressure("SPHERE_TOP", 20.0)
    return with_contact(model, "hertz", "CONT_SPHERE", "CONT_BLOCK", **options)


def loose_blocks(mesh, **options):
    """A block that lies on a wider one without supports, pressed and pushed."""
    model = blocks(mesh, {}, **options)
    model.add_traction("UPPER_TOP", x=0.1, y=-1.0)
    return model


# The derivative of weighted gaps is a one-sided difference in 3D and where the primary side ends. Elsewhere between bodies it
# leaves out how weights move.
EXACT, DIFFERENCE = 1e-7, 1e-5
# The axes of curvature of two cylinders turn against each other, which changes the height of smooth surfaces a little.
TURNING = 1e-5
FRICTION, SMOOTH = {"friction": 0.3}, {"surface_smoothing": True}
DERIVATIVES = [
    # model, mesh, options, allowed error of the derivative
    (half_spheres, "A", {"formulation": "node_to_segment"}, EXACT),
    (half_spheres, "A", {"formulation": "node_to_segment", "normals": "averaged"}, EXACT),
    (half_spheres, "A", {"formulation": "node_to_segment", **FRICTION}, EXACT),
    (half_spheres, "A", {"formulation": "node_to_segment", "normals": "averaged", **FRICTION}, EXACT),
    (half_spheres, "B", {"formulation": "continuous"}, EXACT),
    (half_spheres, "B", {"formulation": "continuous", "normals": "facet"}, EXACT),
    (half_spheres, "B", {"formulation": "continuous", "normals": "facet", **FRICTION}, EXACT),
    (half_spheres, "B", {"formulation": "continuous", **FRICTION}, EXACT),
    (half_spheres, "B", {"formulation": "continuous", "slip": "primary", **FRICTION}, EXACT),
    (half_spheres, "C", {"formulation": "mortar", "multipliers": "dual"}, DIFFERENCE),
    (half_spheres, "C", {"formulation": "mortar", "multipliers": "dual", **FRICTION}, DIFFERENCE),
    (half_spheres, "C", {"formulation": "mortar", "multipliers": "dual", "slip": "primary", **FRICTION}, DIFFERENCE),
    (blocks, "quad4", {"formulation": "node_to_segment", **FRICTION}, EXACT),
    (blocks, "quad8", {"formulation": "continuous", **FRICTION}, EXACT),
    (blocks, "quad4", {"formulation": "mortar", "multipliers": "dual", **FRICTION}, DIFFERENCE),
    (punch, "quad4", {"formulation": "mortar", "multipliers": "dual"}, DIFFERENCE),
    (punch, "quad8", {"formulation": "mortar", "multipliers": "dual", **FRICTION}, DIFFERENCE),
    (seam, "quad4", {"formulation": "mortar", "multipliers": "dual", **FRICTION}, DIFFERENCE),
    (seam, "quad8", {"formulation": "mortar", "multipliers": "dual"}, DIFFERENCE),
    (ball_on_block, "tet4", {"formulation": "node_to_segment"}, EXACT),
    (ball_on_block, "tet4", {"formulation": "node_to_segment", **FRICTION}, EXACT),
    (ball_on_block, "hex8", {"formulation": "continuous", **FRICTION}, EXACT),
    (ball_on_block, "hex8", {"formulation": "continuous", "slip": "primary", **FRICTION}, EXACT),
    (ball_on_block, "hex8", {"formulation": "mortar", "multipliers": "dual", **FRICTION}, DIFFERENCE),
    (ball_on_block, "hex20", {"formulation": "mortar", "multipliers": "dual", **FRICTION}, DIFFERENCE),
    (ball_on_block, "hex27", {"formulation": "mortar"}, DIFFERENCE),
    (nested, ("hex8", True), {"formulation": "mortar", "surface_smoothing": False}, DIFFERENCE),
    (nested, ("hex8", True), {"formulation": "mortar", "multipliers": "dual", **FRICTION}, DIFFERENCE),
    (nested, ("tet4", True), {"formulation": "mortar", "multipliers": "dual"}, DIFFERENCE),
    (nested, ("tet4", False), {"formulation": "mortar", **FRICTION}, DIFFERENCE),
    (nested, ("hex20", True), {"formulation": "mortar", "multipliers": "dual"}, DIFFERENCE),
    (nested, ("hex20", True), {"formulation": "mortar", "multipliers": "dual", "normals": "secondary"}, DIFFERENCE),
    (nested, ("hex27", True), {"formulation": "mortar", **FRICTION}, DIFFERENCE),
    (nested, ("tet10", False), {"formulation": "mortar", "multipliers": "dual", **FRICTION}, DIFFERENCE),
    (nested, ("hex8", True), {"formulation": "node_to_segment", **FRICTION}, EXACT),
    (nested, ("hex8", True), {"formulation": "node_to_segment", **SMOOTH}, EXACT),
    (nested, ("tet4", True), {"formulation": "node_to_segment", **SMOOTH, **FRICTION}, EXACT),
    (nested, ("hex8", True), {"formulation": "continuous", "surface_smoothing": False, **FRICTION}, EXACT),
    (nested, ("hex8", True), {"formulation": "continuous", **SMOOTH}, EXACT),
    (nested, ("tet4", True), {"formulation": "continuous", **SMOOTH, **FRICTION}, EXACT),
    (nested, ("hex20", True), {"formulation": "continuous", **SMOOTH, **FRICTION}, EXACT),
    (nested, ("hex8", False), {"formulation": "continuous", **SMOOTH, **FRICTION}, TURNING),
    (ball_on_ball, "hex8", {"formulation": "node_to_segment", **FRICTION}, EXACT),
    (ball_on_ball, "hex8", {"formulation": "mortar", **FRICTION}, EXACT),
    (ball_on_ball, "hex20", {"formulation": "mortar", "multipliers": "dual", **FRICTION}, EXACT),
]


@pytest.mark.filterwarnings("ignore:contact 'hertz'. facets of 'SECONDARY' and of the other side deviate")
@pytest.mark.filterwarnings("ignore:contact 'hertz'. the integration points of complete facets")
@pytest.mark.filterwarnings("ignore:the energy of these load steps is out of balance")  # of nested shells
@pytest.mark.parametrize(("make", "mesh", "options", "error"), DERIVATIVES)
@pytest.mark.filterwarnings("ignore:.*nodal shear of sticking nodes")
def test_forces_gaps_and_slips_vary_as_their_differences(make, mesh, options, error):
    """With friction, forces and slips are compared in tangents that follow the normals by the smallest rotation.

    Where a compliance couples vectors, it adds to gaps and slips.
    """
    model = make(mesh, **options)
    first, step = fc.solve(model, fc.linear_ramp(2))
    problem = prepare(model, fc.linear_ramp(2), fc.Criteria(), linear_solver="direct")
    start, load = first.displacement.ravel(), problem.load_at(1.0)
    state, rng = replace(problem.initial_state(), u=start), np.random.default_rng(1)
    # One side has slid a little, so that no node faces a node.
    points, u, side = model.mesh.points, step.displacement.copy(), problem.pairs["hertz"].secondary.points
    u[side, 0] += 0.01 * points[side, 0]
    u = u.ravel()

    def paired(u):
        return pair_surfaces(problem, state, load, Iterate(u.copy(), {}, {})).parts["hertz"]

    here = paired(u)
    closed = here.usable & (here.gap0 + here.B @ u < 1e-3)
    if not here.tangents and here.nodes is not None:
        # Nodes on the axis and on planes of symmetry face the ends of facets, where derivatives are one-sided.
        closed &= problem.system.free.reshape(points.shape)[here.nodes].all(axis=1)
    multiplier = np.where(closed, rng.uniform(0.5, 1.0, len(here)), 0.0)
    slides = np.array([closed & (np.diff(T.indptr) > 0) for T in here.tangents], bool).reshape(-1, len(here)).T
    tangential = np.where(slides, rng.uniform(-0.3, 0.3, slides.shape), 0.0)
    du = points @ rng.normal(size=(points.shape[1],) * 2) / 50.0
    du[side] += 0.02 * rng.normal(size=points.shape[1])
    du = np.where(problem.system.free.reshape(points.shape), du, 0.0)

    def values(displaced):
        at = paired(displaced)
        gap = at.gap0 + at.B @ u
        if not at.tangents:
            return at.force(multiplier), gap[None]
        before, now = normals(here.directions), normals(at.directions)
        mean = (before + now) / (1.0 + (before * now).sum(axis=1))[:, None]
        followed = [t - (t * now).sum(axis=1)[:, None] * mean for t in here.directions]
        vector = sum(t[:, None] * along for t, along in zip(tangential.T, followed, strict=True))
        forces = np.column_stack([(vector * along).sum(axis=1) for along in at.directions])
        slips = [T @ (u - start) + more for T, more in zip(at.tangents, at.slip0, strict=True)]
        slip = sum(s[:, None] * along for s, along in zip(slips, at.directions, strict=True))
        if at.coupled_directions:
            vectors = multiplier[:, None] * now + vector
            elastic = np.column_stack([at.compliance.apply(component) for component in vectors.T])
            gap, slip = gap + (elastic * now).sum(axis=1), slip + elastic
        return at.force(multiplier, forces), np.stack([gap, *((slip * t).sum(axis=1) for t in followed)])

    h = 1e-5
    (force1, gaps1), (force0, gaps0) = values(u + h * du.ravel()), values(u - h * du.ravel())
    force, gaps = here.geometry(multiplier, tangential, u.reshape(points.shape)).derivatives_along(du)
    difference = (force1 - force0) / (2 * h)
    assert np.abs(difference).max() > 0.0
    assert np.abs(force.ravel() - difference).max() <= error * np.abs(difference).max()
    assert np.abs(gaps - (gaps1 - gaps0) / (2 * h))[:, closed].max() <= error * np.abs(du).max()


@pytest.mark.filterwarnings("ignore:contact 'hertz'. facets of 'SECONDARY' and of the other side deviate")
@pytest.mark.filterwarnings("ignore:contact 'hertz'. the integration points of complete facets")
@pytest.mark.filterwarnings("ignore:the energy of these load steps is out of balance")  # of nested shells
@pytest.mark.parametrize(
    ("make", "mesh", "options", "updates"),
    [
        (half_spheres, "A", {"formulation": "node_to_segment"}, 4),
        (half_spheres, "A", {}, 4),
        (half_spheres, "A", {"formulation": "continuous", "normals": "facet"}, 4),
        (half_spheres, "B", {}, 5),
        (half_spheres, "B", {"formulation": "continuous"}, 4),
        (half_spheres, "C", {}, 4),
        (half_spheres, "C", {"formulation": "mortar"}, 4),
        (half_spheres, "C", {"formulation": "node_to_segment"}, 5),
        (ball_on_block, "hex8", {"formulation": "continuous"}, 4),
        (ball_on_block, "tet4", {"formulation": "node_to_segment"}, 4),
        (ball_on_block, "hex8", {}, 4),
        (ball_on_ball, "hex8", {}, 3),
        (half_spheres, "C", {"formulation": "node_to_segment", **FRICTION}, 5),
        (half_spheres, "B", FRICTION, 5),
        (half_spheres, "C", {"formulation": "mortar", **FRICTION}, 5),
        (half_spheres, "C", {"formulation": "continuous", **FRICTION}, 4),
        (blocks, "quad4", {"formulation": "node_to_segment", **FRICTION}, 4),
        (blocks, "quad4", {"formulation": "mortar", "slip": "primary", **FRICTION}, 5),
        (blocks, "quad8", {"formulation": "continuous", **FRICTION}, 4),
        (punch, "quad4", {"formulation": "mortar", "multipliers": "dual", **FRICTION}, 4),
        (punch, "quad8", {"formulation": "mortar", "multipliers": "dual"}, 4),
        (seam, "quad8", {"formulation": "mortar", "multipliers": "dual", **FRICTION}, 4),
        (ball_on_block, "tet4", {"formulation": "node_to_segment", **FRICTION}, 4),
        (ball_on_block, "hex8", {"formulation": "continuous", **FRICTION}, 4),
        (ball_on_block, "hex8", FRICTION, 4),
        (ball_on_block, "hex20", {"multipliers": "dual"}, 4),
        (ball_on_block, "hex20", FRICTION, 3),
        (ball_on_block, "hex27", {}, 4),
        (nested, ("hex8", True), {"formulation": "mortar", "surface_smoothing": False}, 4),
        (nested, ("tet4", True), {"formulation": "mortar", "multipliers": "dual"}, 4),
        (nested, ("hex8", False), {"formulation": "mortar", "multipliers": "dual", **FRICTION}, 4),
        (nested, ("tet4", True), {"formulation": "mortar", **FRICTION}, 4),
        (nested, ("hex20", True), {"formulation": "mortar", "multipliers": "dual", **FRICTION}, 4),
        (nested, ("hex20", True), {"formulation": "mortar", "multipliers": "standard"}, 4),
        (nested, ("hex8", True), {"formulation": "node_to_segment", **SMOOTH}, 4),
        (nested, ("hex8", True), {"formulation": "node_to_segment", **SMOOTH, **FRICTION}, 4),
        (nested, ("tet4", True), {"formulation": "continuous"}, 4),
        (nested, ("hex8", False), {"formulation": "continuous", **SMOOTH}, 4),
        (nested, ("hex8", True), {"formulation": "continuous", **FRICTION}, 4),
        (nested, ("tet4", True), {"formulation": "continuous", **SMOOTH, **FRICTION}, 4),
        (pressed_ball, "hex8", {"formulation": "continuous"}, 4),
        (pressed_ball, "tet4", {"formulation": "node_to_segment"}, 4),
        (pressed_ball, "hex8", FRICTION, 4),
        (loose_blocks, "quad4", {"formulation": "node_to_segment", **FRICTION}, 4),
        (loose_blocks, "quad4", FRICTION, 4),
        (loose_blocks, "quad8", {"formulation": "continuous", **FRICTION}, 4),
    ],
)
def test_load_steps_take_few_pairings_and_converge_quadratically(make, mesh, options, updates, monkeypatch):
    """Alternating between pairing and solution takes 8 to 12, each with a fourth of the last change."""
    ramp = [k / 20.0 for k in range(1, 7)] if make is half_spheres else 4
    model = make(mesh, **options)
    whole = fc.Criteria(friction_while_touching=1.0)
    steps = fc.solve(model, ramp, criteria=whole, linear_solver="direct")
    counts = [step.iterations["geometry_updates"] + 1 for step in steps]
    assert max(counts) <= updates
    if "friction" in options:  # increments, and their last one that is solved again, take one or two pairings
        along = fc.solve(model, ramp, linear_solver="direct")
        assert all(step.iterations["geometry_updates"] < count + 2 for step, count in zip(along, counts, strict=True))
    assert max(counts) > 2
    monkeypatch.setattr(geometry_loop, "SAFETY", np.inf)  # no Newton step is omitted
    for step in fc.solve(model, ramp, criteria=whole, linear_solver="direct")[-2:]:
        changes = [entry["displacement_change"] for entry in step.iterations["history"]]
        for before, after in list(pairwise(changes))[-2:]:
            assert after < max(10.0 * before**2 if before < 1e-2 else 0.01 * before, 1e-11)


def test_gaps_at_points_are_linearised_halfway_to_the_solution():
    """Derivatives at the displacements of the pairing take 55 updates."""
    steps = fc.solve(half_spheres("B", formulation="continuous"), 20, linear_solver="direct")
    assert sum(step.iterations["geometry_updates"] for step in steps) <= 42
