"""Friction at supported nodes: present where sides slide, zero where symmetry excludes slip, however supports are stated."""

import re

import numpy as np
import pytest
from models import elastic_model, last_step, supported, united, with_obstacle
from refusals import refused

import fastcontact as fc
from fastcontact.analysis.convergence_messages import friction_exceeded
from fastcontact.analysis.floating_bodies import FloatingBodies

pytestmark = pytest.mark.each_value

FORMULATIONS = {
    "default": {},
    "standard": {"formulation": "mortar", "multipliers": "standard"},
    "node to segment": {"formulation": "node_to_segment"},
    "continuous": {"formulation": "continuous"},
}


def turn(dim, seed):
    """A rotation (dim, dim); the identity without a seed."""
    if seed is None:
        return np.eye(dim)
    Q = np.linalg.qr(np.random.default_rng(seed).normal(size=(dim, dim)))[0]
    Q[:, 0] *= np.linalg.det(Q)
    return Q


def blocks(element, dim):
    """A wide block A and a smaller one B on it that does not match."""
    if dim == 2:
        a = fc.generate.block((10, 4), (8, 4), element, name="A")
        b = fc.generate.block((6, 4), (5, 3), element, origin=(2, 4), name="B")
    else:
        a = fc.generate.box((10, 6, 2), (8, 5, 2), element, name="A")
        b = fc.generate.box((6, 4, 2), (4, 3, 2), element, origin=(2, 1, 2), name="B")
    return united(A_=a, B_=b)


def sides(dim):
    """Names of the lower end, of the side that contact is on, of the left and right ones of a block."""
    return ("BOTTOM", "TOP", "LEFT", "RIGHT") if dim == 2 else ("ZMIN", "ZMAX", "XMIN", "XMAX")


@pytest.mark.filterwarnings("ignore:.*nodal pressures oscillate")  # of node-to-segment on quadratic facets
@pytest.mark.parametrize(("element", "dim"), [("quad4", 2), ("quad8", 2), ("tri3", 2), ("hex8", 3)])
@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("driven", ["upper", "lower"])
def test_a_block_held_or_drawn_by_its_sides_carries_all_friction(element, dim, formulation, driven):
    if dim == 3 and formulation in ("standard", "continuous"):
        pytest.skip("the same in the plane")
    bottom, top, left, right = sides(dim)
    model = elastic_model(blocks(element, dim), "plane_strain" if dim == 2 else "3d")
    model.add_pressure(f"B_{top}", 1.0, ramp=[(0, 0), (1, 1), (3, 1)])
    late = [(0, 0), (1, 0), (3, 1)]
    model.fix(f"A_{bottom}", "yz"[: dim - 1])
    model.prescribe(f"A_{bottom}", x=0.1 if driven == "lower" else 0.0, ramp=late)
    for side in (left, right):
        model.prescribe(f"B_{side}", x=0.0 if driven == "lower" else 0.1, ramp=late)
    for side in ("YMIN", "YMAX") if dim == 3 else ():
        model.fix(f"B_{side}", "y")
    model.add_contact("c", secondary=f"B_{bottom}", primary=f"A_{top}", friction=0.2, **FORMULATIONS[formulation])
    contact = fc.solve(model, [1, 2, 3])[-1].contact["c"]
    normal = abs(contact.force[-1])
    assert abs(contact.force[0]) == pytest.approx(0.2 * normal, rel=1e-3)
    held = np.isin(contact.points, np.concatenate([model.mesh.points_of(f"B_{side}") for side in (left, right)]))
    assert not contact.sticking[held].any()


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
@pytest.mark.parametrize("said", ["supports", "axes"])
@pytest.mark.parametrize("group", ["LEFT", "BLOCK"])
def test_a_block_driven_over_a_plane_carries_all_friction(formulation, said, group):
    mesh = fc.generate.block((6.0, 2.0), (6, 2), "quad4")
    model = elastic_model(mesh, "plane_strain")
    model.add_pressure("TOP", 1.0, ramp=[(0, 0), (1, 1), (3, 1)])
    axes = {"axes": (1.0, 0.0)} if said == "axes" else {}
    model.prescribe("LEFT" if group == "LEFT" else mesh.group_names[0], x=0.1, ramp=[(0, 0), (1, 0), (3, 1)], **axes)
    floor = fc.obstacles.HalfSpace(point=(0.0, 0.0), normal=(0.0, 1.0))
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor, friction=0.2, formulation=formulation)
    contact = fc.solve(model, [1, 2])[-1].contact["floor"]
    assert abs(contact.force[0]) == pytest.approx(0.2 * abs(contact.force[1]), rel=1e-6)


@pytest.mark.parametrize(
    ("said", "seed"), [("fix", None), ("normal", None), ("axes", None), ("normal", 3), ("axes", 4)]
)
@pytest.mark.parametrize("elements", [("hex8", "tet4"), ("hex20", "hex20")])
def test_bodies_pressed_uniformly_have_no_shear_in_planes_of_symmetry(said, seed, elements):
    """A quarter of two boxes: uniform pressure, by whatever words the planes are held, and however the model is turned."""
    lower, upper = (
        fc.generate.box((1.0, 1.0, 0.5), (n, n, 1), element, origin=(0, 0, z))
        for element, n, z in zip(elements, (2, 3), (-0.5, 0.0), strict=True)
    )
    mesh, Q = united(L_=lower, U_=upper), turn(3, seed)
    model = elastic_model(mesh.replace(points=mesh.points @ Q.T), "3d")
    for group, axis in (("L_ZMIN", 2), ("L_XMIN", 0), ("U_XMIN", 0), ("L_YMIN", 1), ("U_YMIN", 1)):
        if said == "fix":
            model.fix(group, "xyz"[axis])
        elif said == "normal":
            model.fix(group, "normal")
        else:
            model.fix(group, "x", axes=[tuple(Q[:, axis]), tuple(Q[:, (axis + 1) % 3])])
    model.add_pressure("U_ZMAX", 1.0)
    model.add_contact("c", secondary="U_ZMIN", primary="L_ZMAX", friction=0.3)
    contact = fc.solve(model, 1)[-1].contact["c"]
    assert contact.force @ Q == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    assert np.abs(contact.shear).max() < 1e-9
    assert contact.sticking.all()


@pytest.mark.parametrize("azimuth", [0.0, np.pi / 8, 3 * np.pi / 4])
def test_a_block_within_the_cone_is_held_whatever_the_direction_of_its_load(azimuth):
    model = elastic_model(fc.generate.box((1.0, 1.0, 0.25), (3, 3, 1), "hex8"), "3d")
    along = 0.95 * 0.5 * np.array([np.cos(azimuth), np.sin(azimuth)])
    model.add_body_force(x=along[0], y=along[1], z=-1.0)
    floor = fc.obstacles.HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))
    model.add_obstacle("floor", secondary="ZMIN", obstacle=floor, friction=0.5)
    force = fc.solve(model, 1)[-1].contact["floor"].force
    assert force == pytest.approx(0.25 * np.array([*-along, 1.0]), abs=1e-8)


def pushed(push, element="hex8", divisions=2):
    """A cube on a floor, with a coefficient of friction of 0.3, under a unit pressure and a tangential force."""
    model = elastic_model(fc.generate.box((1.0, 1.0, 1.0), (divisions,) * 3, element), "3d")
    model.add_pressure("ZMAX", 1.0, ramp=[(0, 0), (1, 1), (2, 1)])
    model.add_traction("XMIN", x=push, ramp=[(0, 0), (1, 0), (2, 1)])
    floor = fc.obstacles.HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))
    return with_obstacle(model, "floor", "ZMIN", floor, friction=0.3)


@pytest.mark.parametrize(("push", "needed"), [(0.5, r"0\.5"), (0.3003, r"0\.3003")])
def test_a_push_beyond_friction_is_told_as_such(push, needed):
    told = f"friction cannot hold body .* coefficient of about {needed} where the largest is 0\\.3"
    with pytest.raises(fc.ConvergenceError, match=told):
        fc.solve(pushed(push), [1.0, 2.0])


def twisted(friction):
    """A small box on a larger one, under its weight and a tangential force at one of its sides, which turns it."""
    boxes = {"A_": ((6.0, 6.0, 2.0), (6, 6, 1), (0, 0, 0)), "B_": ((4.0, 4.0, 2.0), (5, 5, 1), (1, 1, 2))}
    parts = {name: fc.generate.box(*data[:2], "hex8", data[2], name=name[0]) for name, data in boxes.items()}
    model = elastic_model(united(**parts), "3d", A_ZMIN="xyz", E=1000.0)
    model.add_body_force(groups="B", z=-1.0 / 32.0, ramp=[(0, 0), (1, 1), (2, 1)])
    model.add_traction("B_XMIN", y=0.2 / 8.0, ramp=[(0, 0), (1, 0), (2, 1)])
    model.add_contact("c", secondary="B_ZMIN", primary="A_ZMAX", friction=friction)
    return model


def test_the_required_friction_is_that_of_the_elastic_pressures():
    """With other normal forces, rigid bodies could be in equilibrium with a coefficient of 0.255."""
    told = []
    for friction in (0.24, 0.32):
        with pytest.raises(fc.ConvergenceError, match=r"friction cannot hold body 'B' .*about .* where") as caught:
            fc.solve(twisted(friction), [1.0, 2.0])
        told.append(float(re.search(r"about ([\d.]+)", str(caught.value))[1]))
        assert "halved" not in str(caught.value)
    assert told == pytest.approx(told[:1] * 2, rel=0.03)
    assert fc.solve(twisted(1.01 * told[1]), [1.0, 2.0])[-1].contact["c"].force[1] == pytest.approx(-0.2, rel=1e-6)


def test_rigid_bodies_give_a_bound_of_the_required_friction_with_multigrid():
    text = r"coefficient of at least 0\.5 where the largest is 0\.3\b"
    refused(fc.ConvergenceError, text, fc.solve, pushed(0.5), [1.0, 2.0], linear_solver="amg")


def test_a_hub_that_slides_on_its_shaft_is_told_as_such():
    """The normals are slightly inclined, since the shaft is longer than the hub."""
    shaft = fc.generate.block((10.0, 100.0), (3, 30), "quad8", (10.0, -30.0), name="SHAFT")
    hub = fc.generate.block((40.0, 40.0), (5, 12), "quad8", (20.0, 0.0), name="HUB")
    model = elastic_model(united(S_=shaft, H_=hub), "axisymmetric", E=100e3, S_BOTTOM="y")
    ramp = [(0, 0), (1, 1), (2, 1)]
    model.add_contact("fit", secondary="H_LEFT", primary="S_RIGHT", friction=0.15, clearance=-0.03, clearance_ramp=ramp)
    pressing = fc.solve(model, [1.0])[-1].contact["fit"].normal_force
    area = np.pi * (60.0**2 - 20.0**2)
    model.add_traction("H_TOP", y=1.04 * 0.15 * pressing / area, ramp=[(0, 0), (1, 0), (2, 1)])
    text = r"friction cannot hold body 'H_HUB' .*of about 0\.15\d where .* is 0\.15\b"
    refused(fc.ConvergenceError, text, fc.solve, model, [1.0, 2.0])


@pytest.mark.parametrize("angle", [0.2, 0.44, 0.7])
def test_the_required_friction_is_that_of_coulombs_cone_in_every_direction(angle):
    """A force in the middle of the cube, between the edges of a pyramid, for which the cone needs 0.306."""
    model = pushed(0.0)
    model.add_body_force(x=0.306 * np.cos(angle), y=0.306 * np.sin(angle), ramp=[(0, 0), (1, 0), (2, 1)])
    with pytest.raises(fc.ConvergenceError, match=r"coefficient of about 0\.306 where the largest is 0\.3\b"):
        fc.solve(model, [1.0, 2.0])


@pytest.mark.parametrize(("push", "element", "divisions"), [(0.2999, "hex8", 2), (0.299999, "hex20", 3)])
def test_a_push_just_below_the_friction_limit_takes_few_positions(push, element, divisions, monkeypatch):
    """Newton's method for the anchors converges, even where it moves the body by up to its slip."""
    positions, settle = [], FloatingBodies.settle

    def counted(*arguments):
        positions.append((rigid := settle(*arguments)).positions)
        return rigid

    monkeypatch.setattr(FloatingBodies, "settle", counted)
    step = fc.solve(pushed(push, element, divisions), [1.0, 2.0])[-1]
    assert step.contact["floor"].force == pytest.approx([-push, 0.0, 1.0], abs=1e-9)
    assert sum(positions) <= 24


def test_friction_that_would_hold_rigid_bodies_is_told_as_such():
    told = friction_exceeded(0.95, ["body 'B'"], np.array([0.3, 0.3]))
    assert "friction hardly holds body 'B'" in told
    assert "about 0.285 where the largest is 0.3, if the bodies were rigid, and more for elastic bodies" in told


@pytest.mark.parametrize("along", [0.31, 0.35])
def test_a_stack_that_slides_in_its_weaker_joint_is_told_as_such(along):
    """Coulomb's cone in 3D lies between pyramids that differ by 8 %: the first load is between them, the second beyond."""
    boxes = {
        f"{n}_": fc.generate.box((3.0, 3.0, 1.0), (2, 2, 1), "hex8", (0, 0, z), name=n) for z, n in enumerate("AB")
    }
    model = elastic_model(united(**boxes), "3d")
    model.add_body_force(x=along, z=-1.0)
    floor = fc.obstacles.HalfSpace(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))
    model.add_obstacle("floor", secondary="A_ZMIN", obstacle=floor, friction=0.5)
    model.add_contact("joint", secondary="B_ZMIN", primary="A_ZMAX", friction=0.3)
    factor = f"{along / 0.3:.3g}"
    with pytest.raises(fc.ConvergenceError, match=rf"hold body 'B' against .* would require about {factor} times the"):
        fc.solve(model, 1)


def flange(name, bottom, element="hex8", divisions=(4, 12, 2)):
    """A quarter of a plate with a hole in the midst."""
    mesh = fc.generate.box((1.0, 1.0, 8.0), divisions, element, (0.0, 0.0, bottom), name=name)
    radius, angle = 20.0 + 40.0 * mesh.points[:, 0], np.pi / 2.0 * mesh.points[:, 1]
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), mesh.points[:, 2]])
    return united(**{f"{name}_": mesh.replace(points=points)})


@pytest.mark.filterwarnings("ignore:.*nodal pressures oscillate", "ignore:.*across its radius")
@pytest.mark.parametrize("friction", [None, 0.2])
def test_bolted_flanges_held_at_the_same_edge_settle_and_mirror_each_other(friction):
    """Of the weighted gaps at the held edge, supports leave round-off, and later what strains of the neighbours bring in."""
    mesh = fc.generate.union(flange("A", 0.0), flange("B", 8.0))
    model = elastic_model(mesh, "3d", E=210e3)
    for name, outside in (("A", "ZMIN"), ("B", "ZMAX")):
        supported(model, **{f"{name}_XMIN": "xyz", f"{name}_YMIN": "y", f"{name}_YMAX": "x"})
        model.add_pressure(f"{name}_{outside}", lambda x: 2.0 * (60.0 - np.linalg.norm(x[:, :2], axis=1)))
    model.add_contact("joint", secondary="B_ZMIN", primary="A_ZMAX", friction=friction)
    step = fc.solve(model, 1, criteria=fc.Criteria(max_geometry_updates=10, max_halvings=0))[-1]
    a, b = (mesh.points_of(name) for name in "AB")
    mirrored = (
        a[np.lexsort(np.round(mesh.points[a][:, :3], 6).T)],
        b[np.lexsort(np.round(mesh.points[b] * [1, 1, -1], 6).T)],
    )
    below, above = (step.displacement[nodes] for nodes in mirrored)
    assert np.abs(below - above * [1, 1, -1]).max() < 1e-6 * np.abs(above).max()
    contact = step.contact["joint"]
    assert abs(step.reaction[a, 2].sum() + step.reaction[b, 2].sum()) < 1e-6 * contact.force[2]
    assert np.allclose(contact.coordinates[contact.pressure > 0.0, 2], 8.0, atol=1e-3)


CLAMPS = {
    "fix": lambda model, group: model.fix(group, "xyz"),
    "axes": lambda model, group: model.fix(group, "xyz", axes=[(0.6, 0.8, 0.0), (-0.48, 0.36, 0.8)]),
    "coupling": lambda model, group: (
        model.add_coupling("O", group),
        model.fix("O", "xyz"),
        model.fix("O rotation", "xyz"),
    ),
    "pushed together": lambda model, group: model.prescribe(group, x=0.0, y=0.0, z=1e-6 if group[0] == "A" else -1e-6),
}


@pytest.mark.filterwarnings("ignore:contact .joint.. the integration points of complete facets")
@pytest.mark.filterwarnings("ignore:supports push")
@pytest.mark.parametrize("friction", [None, 0.3])
@pytest.mark.parametrize(
    ("element", "method", "clamp"),
    [
        ("hex20", "default", "fix"),
        ("hex20", "default", "axes"),
        ("hex20", "default", "coupling"),
        ("hex20", "default", "pushed together"),
        ("hex20", "standard", "pushed together"),
        ("hex20", "continuous", "fix"),
        ("hex27", "default", "fix"),
        ("tet10", "default", "fix"),
    ],
)
def test_plates_clamped_at_the_same_edge_carry_their_load_on_every_mesh(element, method, clamp, friction):
    """Forces between nodes that supports hold do no work: they follow those of the neighbouring nodes."""
    mesh = fc.generate.union(flange("A", 0.0, element, (4, 6, 1)), flange("B", 8.0, element, (4, 4, 1)))
    if clamp == "coupling":
        mesh = fc.generate.with_reference_points(mesh, {"O": (0.0, 0.0, 8.0)})
    model = elastic_model(mesh, "3d", E=210e3)
    for name, outside in (("A", "ZMIN"), ("B", "ZMAX")):
        CLAMPS[clamp](model, f"{name}_XMIN")
        model.add_pressure(f"{name}_{outside}", 1.0)
    model.add_contact("joint", secondary="B_ZMIN", primary="A_ZMAX", friction=friction, **FORMULATIONS[method])
    (step,) = fc.solve(model, 1)
    contact, load = step.contact["joint"], 0.25 * np.pi * (60.0**2 - 20.0**2)
    assert contact.force[2] == pytest.approx(0.958 * load, rel=0.025)  # the limit of fine meshes, clamps carry the rest
    assert contact.force[2] + step.reaction[mesh.points_of("B"), 2].sum() == pytest.approx(load, rel=1e-3)
    assert contact.pressure == pytest.approx(1.0, abs=0.25 if method == "default" else 0.4)


@pytest.mark.filterwarnings("ignore:contact .joint.. the integration points of complete facets")
@pytest.mark.parametrize("element", ["quad4", "quad8", "tri6"])
@pytest.mark.parametrize("method", ["default", "standard", "continuous"])
def test_the_force_between_clamped_plates_is_accurate_on_coarse_meshes(element, method):
    forces = []
    coarse = [(element, upper, lower, 1) for upper, lower in ((4, 4), (4, 6), (6, 4))]
    for kind, upper, lower, height in [("quad4", 120, 120, 12), *coarse]:
        a = fc.generate.block((60.0, 6.0), (lower, height), kind, (40.0, -6.0), name="A")
        b = fc.generate.block((60.0, 6.0), (upper, height), kind, (40.0, 0.0), name="B")
        model = elastic_model(united(A_=a, B_=b), "axisymmetric", E=210e3)
        for name, outside in (("A", "BOTTOM"), ("B", "TOP")):
            model.fix(f"{name}_LEFT", "xy")
            model.add_pressure(f"{name}_{outside}", 1.0)
        model.add_contact("joint", secondary="B_BOTTOM", primary="A_TOP", **FORMULATIONS[method])
        forces.append(fc.solve(model, 1)[-1].contact["joint"].force[1])
    assert np.array(forces) == pytest.approx(forces[0], rel=0.02)


class Turned:
    """A rigid shape that is turned about the origin by Q."""

    def __init__(self, shape, Q):
        self.shape, self.Q = shape, Q

    def distance(self, points):
        distance, normals = self.shape.distance(points @ self.Q)
        return distance, normals @ self.Q.T


@pytest.mark.parametrize(
    "options", [{"formulation": "node_to_segment"}, {"formulation": "continuous", "integration": "node"}]
)
@pytest.mark.parametrize("motion", [(0.0, 0.0, -0.05), (0.0, 0.03, -0.03)])
def test_a_moving_ball_drags_no_node_across_its_plane_of_symmetry(options, motion):
    mesh = fc.generate.box((1.0, 1.0, 0.5), (3, 3, 2), "hex8")
    forces = []
    for said, seed in (("fix", None), ("axes", None), ("normal", 3), ("relation", 3)):
        Q = turn(3, seed)
        model = elastic_model(mesh.replace(points=mesh.points @ Q.T), "3d")
        for group, axis in (("ZMIN", 2), ("XMIN", 0), ("YMIN", 1)):
            if said == "fix":
                model.fix(group, "xyz"[axis])
            elif said == "normal":
                model.fix(group, "normal")
            elif said == "axes":
                model.fix(group, "x", axes=[tuple(Q[:, axis]), tuple(Q[:, (axis + 1) % 3])])
            else:
                for point in mesh.points_of(group):
                    model.relate([(int(point), name, float(Q[k, axis])) for k, name in enumerate("xyz")])
        ball = Turned(fc.obstacles.Sphere(centre=(0.0, 0.0, 2.5), R=2.0), Q)
        along = {name: float(value) for name, value in zip("xyz", Q @ motion, strict=True)}
        model.add_obstacle("ball", secondary="ZMAX", obstacle=ball, motion=along, friction=0.3, **options)
        contact = fc.solve(model, 1)[-1].contact["ball"]
        plane = np.isin(contact.points, mesh.points_of("XMIN")) & contact.active
        assert plane.sum() > 1
        assert np.abs((contact.shear @ Q)[plane, 0]).max() < 1e-10 * contact.pressure.max()
        forces.append(contact.force @ Q)
    np.testing.assert_allclose(forces, np.tile(forces[0], (4, 1)), atol=1e-9 * abs(forces[0][2]))


TOLD = "supports hold 2 of the 6 facets of 'CONT_UPPER'"


@pytest.mark.parametrize(
    ("options", "held", "told"),
    [
        ({"kind": "tied"}, "x", True),
        ({"kind": "tied", "formulation": "node_to_segment"}, "xy", True),
        ({"friction": 0.3}, "x", True),
        ({"friction": 0.3, "formulation": "continuous"}, "xy", True),
        ({}, "xy", True),
        ({}, "x", False),  # without friction nothing goes along the contact
    ],
)
def test_tractions_between_facets_that_supports_hold_are_told_to_be_undetermined(options, held, told):
    model = elastic_model(fc.generate.block_on_block(divisions_lower=(6, 3), divisions_upper=(6, 3)), "plane_strain")
    supported(model, LOWER_BOTTOM="xy", UPPER_TOP={"x": 0.01, "y": -0.01})
    points, width = model.mesh.points, np.ptp(model.mesh.points[:, 0])
    sides = np.concatenate([model.mesh.points_of(group) for group in ("CONT_LOWER", "CONT_UPPER")])
    for point in sides[points[sides, 0] < points[:, 0].min() + 0.34 * width]:
        for component in held:
            model.relate([(int(point), component, 1.0)])
    model.add_contact("c", secondary="CONT_UPPER", primary="CONT_LOWER", **options)
    step, _ = last_step(model)
    assert any(TOLD in text for text in step.warnings) == told


def test_a_slice_and_a_side_that_is_drawn_are_determined():
    """Where the whole side is held, as in plane strain, there is no traction; where one slides over the other, friction."""
    model = elastic_model(blocks("hex8", 3), "3d")
    supported(model, A_YMIN="y", A_YMAX="y", B_YMIN="y", B_YMAX="y", A_ZMAX="y", B_ZMIN="y")
    supported(model, A_ZMIN="xz", A_ZMAX="x", B_ZMIN={"x": 0.1}, B_ZMAX={"x": 0.1, "z": -0.01})
    model.add_contact("c", secondary="B_ZMIN", primary="A_ZMAX", friction=0.2)
    step, _ = last_step(model)
    assert abs(step.contact["c"].force[0]) == pytest.approx(0.2 * abs(step.contact["c"].force[2]), rel=1e-3)
    assert not any("supports hold" in text for text in step.warnings)


@pytest.mark.parametrize("friction", [0.1, 0.6])
def test_facets_that_meet_a_plane_of_symmetry_at_an_angle_do_not_penetrate(friction):
    """The support carries what goes along an inclined normal: friction changes hardly anything where nothing slides."""
    mesh = fc.generate.rings("quad4", divisions_inner=(1, 2), divisions_outer=(1, 2))
    forces = []
    for mu in (None, friction):
        model = elastic_model(mesh, "plane_strain", SYMMETRY_X="x", SYMMETRY_Y="y")
        model.add_pressure("BORE", 1.0)
        options = {"formulation": "continuous", "integration": "node", "surface_smoothing": False}
        model.add_contact("fit", secondary="CONT_INNER", primary="CONT_OUTER", friction=mu, **options)
        step, _ = last_step(model)
        contact = step.contact["fit"]
        assert np.abs(contact.gap).max() < 1e-7 * np.abs(step.displacement).max()
        forces.append(np.linalg.norm(contact.force))
    assert forces[1] == pytest.approx(forces[0], rel=0.02)


@pytest.mark.parametrize("driven", [True, False])
def test_friction_on_an_inclined_seat_whose_end_is_supported(driven):
    """A wedge of 15 degrees slides in its seat; either may be pushed. Its supported end lies within the seat."""
    slope, mu = np.tan(np.radians(15.0)), 0.2
    wedge, seat = (fc.generate.block((1.0, 1.0), divisions) for divisions in ((4, 10), (6, 14)))
    x, y = wedge.points.T
    wedge = wedge.replace(points=np.column_stack([(10.0 + slope * (2.0 + 10.0 * y)) * x, 2.0 + 10.0 * y]))
    x, y = seat.points[:, 0], 14.0 * seat.points[:, 1]
    inner = 10.0 + slope * y
    seat = seat.replace(points=np.column_stack([inner + (45.0 - inner) * x, y]))
    parts = {"S": wedge, "H": seat}
    mesh = fc.generate.union(*(fc.generate.renamed(m, f"{name}_{{}}".format) for name, m in parts.items()))
    model = elastic_model(mesh, "plane_strain", E=210e3, S_LEFT="x", H_RIGHT="x", S_TOP={"y": -0.02 * driven})
    model.prescribe("H_BOTTOM", y=0.02 * (not driven))
    model.add_contact("c", secondary="S_RIGHT", primary="H_LEFT", friction=mu)
    contact = fc.solve(model, 1)[-1].contact["c"]
    assert not contact.sticking.any()
    angle = np.arctan(slope)
    expected = contact.normal_force * (np.sin(angle) + mu * np.cos(angle))
    assert contact.force[1] == pytest.approx(expected, rel=1e-3)  # 5 % less with the normals of a plane of symmetry
