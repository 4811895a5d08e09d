"""Mechanisms: bodies connected at one node or edge, and rotations named by their centre or axis."""

import numpy as np
import pytest
import scipy.optimize
from models import body_of, elastic_model, united
from refusals import refused
from scipy.sparse import csr_array

import fastcontact as fc
from fastcontact.contact.constraints import Constraints
from fastcontact.model import rigid_motions
from fastcontact.model.rigid_motions import mechanisms, stopped_at


def pair_of(first, second):
    return fc.generate.merge_points(united(A_=first, B_=second), 1e-9)


def squares(element="quad4", n=2):
    return pair_of(*(body_of(element, (1.0, 1.0), (n, n), (at, at)) for at in (0.0, 1.0)))


def boxes(element="hex8", height=0.0):
    return pair_of(*(body_of(element, (1.0,) * 3, (1,) * 3, at) for at in ((0.0, 0.0, 0.0), (1.0, 1.0, height))))


@pytest.mark.parametrize("element", ["tri3", "quad4", "tri6", "quad8", "quad9"])
def test_a_square_on_the_corner_of_another_is_refused(element):
    mesh = squares(element)
    model = elastic_model(mesh, A_BOTTOM="xy")
    node = int(np.flatnonzero((mesh.points == 1.0).all(axis=1))[0])
    part = rf"the part 'B_BLOCK' that is connected at point {node} at \(1, 1\)"
    refused(fc.ModelError, rf"1 rigid-body motion is .*{part}.*only at nodes \(number: 1, .*merge", model.check)
    model.fix("B_TOP", "y")
    model.check()


@pytest.mark.parametrize("element", ["tet4", "hex8", "wedge6", "tet10", "hex20"])
@pytest.mark.parametrize(("height", "motions"), [(0.0, "1 rigid-body motion is"), (1.0, "3 rigid-body motions are")])
def test_a_box_on_the_edge_or_corner_of_another_is_refused(element, height, motions):
    model = elastic_model(boxes(element, height), A_YMIN="xyz")
    refused(
        fc.ModelError, rf"{motions} not restrained: .*part 'B_BOX' that is connected at \w+ \d+ at \(1, 1,", model.check
    )
    model.fix("B_YMAX", "xyz")
    model.check()


def test_both_parts_held_share_the_force_at_the_hinge():
    """A hinge passes forces on: what pulls one part is held by both supports."""
    model = elastic_model(squares(n=4), A_BOTTOM="xy", B_TOP="x")
    model.add_body_force("B_BLOCK", y=-1.0)
    (step,) = fc.solve(model, fc.linear_ramp(1))
    assert step.reaction[model.mesh.points_of("A_BOTTOM"), 1].sum() == pytest.approx(1.0, rel=1e-9)


def test_rings_in_axisymmetry_turn_about_no_node():
    model = elastic_model(squares(), "axisymmetric", A_BOTTOM="y")
    model.add_body_force("B_BLOCK", y=-1e-3)
    (step,) = fc.solve(model, fc.linear_ramp(1))
    weight = 1e-3 * np.pi * (2.0**2 - 1.0**2)
    assert step.reaction[model.mesh.points_of("A_BOTTOM"), 1].sum() == pytest.approx(weight, rel=1e-9)


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_a_floor_holds_what_hangs_at_a_hinge(formulation):
    model = elastic_model(squares(n=4), A_BOTTOM="xy")
    model.add_body_force("B_BLOCK", y=-1.0)
    floor = fc.obstacles.HalfSpace((0.0, 0.99), (0.0, 1.0))
    model.add_obstacle("floor", secondary="B_BOTTOM", obstacle=floor, formulation=formulation)
    (step,) = fc.solve(model, fc.linear_ramp(1))
    contact = step.contact["floor"]
    lever = (model.mesh.points[contact.points, 0] - 1.0) @ contact.force_vectors[:, 1] / contact.force[1]
    assert contact.force[1] * lever == pytest.approx(0.5, rel=1e-6)  # the moment of the weight about the hinge


def test_a_load_away_from_the_floor_ends_with_the_name_of_the_part():
    model = elastic_model(squares(), A_BOTTOM="xy")
    model.add_body_force("B_BLOCK", y=1.0)
    model.add_obstacle("floor", secondary="B_BOTTOM", obstacle=fc.obstacles.HalfSpace((0.0, 0.99), (0.0, 1.0)))
    refused(fc.ConvergenceError, "'B_BLOCK' that is connected at point", fc.solve, model, fc.linear_ramp(1))


def test_relations_and_springs_stop_a_hinge():
    model = elastic_model(squares(), A_BOTTOM="xy")
    model.add_spring("B_TOP_RIGHT", x=1.0)
    model.check()
    model = elastic_model(squares(), A_BOTTOM="xy")
    model.relate([("B_TOP_RIGHT", "x", 1.0), ("A_TOP_LEFT", "x", -1.0)])
    model.check()


def test_a_mesh_that_falls_into_very_many_parts_is_refused_at_once(monkeypatch):
    monkeypatch.setattr(rigid_motions, "MAX_MOTIONS", 4)
    with pytest.raises(fc.ModelError, match=r"consists of 2 parts .*first: point \d+ at \(1, 1\)\): let cells share"):
        elastic_model(squares()).check()


def polar(name, inner, outer, divisions, centre):
    """Return a ring of quadrangles."""
    mesh = fc.generate.block((1.0, 1.0), divisions, "quad8", name=name)
    radius, angle = inner + (outer - inner) * mesh.points[:, 1], -2.0 * np.pi * mesh.points[:, 0]
    around = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    closed = fc.generate.merge_points(mesh.replace(points=around + centre), 1e-9)
    return fc.generate.renamed(closed, {g: f"{name}_{g}" for g in closed.group_names if g != name})


def test_the_rotation_of_a_round_pin_in_its_hole_is_named():
    """Contact without friction hardly resists it, and loads of round-off turn the pin."""
    mesh = fc.generate.union(
        polar("PIN", 3.0, 9.98, (72, 3), [0.0, -0.02]), polar("PLATE", 10.0, 40.0, (60, 5), [0.0, 0.0])
    )
    bore = mesh.points_of("PIN_BOTTOM")
    beside = bore[np.argmin(np.hypot(*(mesh.points[bore] - [3.0, -0.02]).T))]
    model = elastic_model(mesh.with_groups(points={"BESIDE": [beside]}), "plane_stress", E=210e3, PLATE_TOP="xy")
    model.fix("BESIDE", "x")
    model.add_body_force("PIN", y=-3.0)
    model.add_contact("pin", secondary="PIN_TOP", primary="PLATE_BOTTOM")
    match = (
        r"contact hardly resists one motion, body 'PIN': rotation about \(0, -0\.02\), which changes the gaps 0\.00\d "
    )
    refused(fc.ConvergenceError, match, fc.solve, model, 1, criteria=fc.Criteria(max_halvings=0))


def test_the_rotation_of_a_ring_of_sectors_is_about_its_centre():
    part = fc.generate.block((1.0, 1.0), (4, 2), "quad8")
    radius, angle = 50.0 + 50.0 * part.points[:, 1], -2.0 * np.pi / 6.0 * part.points[:, 0]
    model = elastic_model(
        part.replace(points=np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])), "plane_stress", E=210e3
    )
    model.add_cyclic_symmetry("LEFT", "RIGHT", sectors=6)
    model.add_pressure("BOTTOM", 1.0)
    refused(fc.ModelError, r"1 rigid-body motion is not .*'BLOCK': rotation about \(0, 0\)\. ", fc.solve, model, 1)


def test_the_rotation_about_a_hinge_is_about_its_line():
    box = fc.generate.box()
    edge = np.flatnonzero((box.points[:, 0] == 0.0) & (box.points[:, 1] == 1.0))
    model = elastic_model(box.with_groups(points={"EDGE": edge}), "3d", EDGE="xyz")
    refused(fc.ModelError, r"rotation about the line through \(0, 1, 0\.5\) along \(0, 0, 1\)\.", fc.solve, model, 1)


def test_all_bodies_that_friction_cannot_hold_are_named():
    """A wedge lifts a weight: the wedge moves at half the speed of the weight, and only the wedge is pushed."""
    labels = [rigid_motions.Label(f"body '{name}'", "translation along x") for name in ("WEDGE", "WEIGHT")]
    motions = rigid_motions.FreeMotions(np.eye(2), np.eye(2), labels)
    lifted, along = csr_array([[0.0, 0.5]]), csr_array([[1.0, 0.0]])
    options = {"tangents": (along,), "directions": (np.array([[1.0, 0.0]]),), "friction": np.ones(1)}
    wedge = Constraints(lifted, np.zeros(1), np.zeros((1, 2)), **options, slip0=np.zeros((1, 1)))
    factor, named = rigid_motions.needed_friction(wedge, motions, np.zeros(2), np.array([1.0, -0.45]), 1.0)
    assert factor == pytest.approx(0.5 / 0.45, rel=2e-3)
    assert named == ["body 'WEDGE'", "body 'WEIGHT'"]


def test_halves_of_a_cut_bolt_have_its_name_and_each_motion_is_listed_once():
    bolt = fc.generate.block((1.0, 2.0), (1, 2), "quad4", name="BOLT")
    bolt = bolt.with_facet_group("CUT", lambda x: np.abs(x[:, 1] - 1.0) < 1e-9, between=True)
    nut = fc.generate.block((1.0, 1.0), (1, 1), origin=(3.0, 0.0), name="NUT")
    mesh = united(BOLT_=fc.generate.cut(bolt, "CUT"), NUT_=nut)
    names = rigid_motions.free_motions(mesh, "plane_strain", np.zeros((mesh.n_points, 2), bool)).names()
    assert len(names) == len(set(names)) == 9
    parts = [name.partition(": ")[0] for name in names]
    for part in ("'BOLT', the part around (0.5, 0.5)", "'BOLT', the part around (0.5, 1.5)", "'NUT'"):
        assert parts.count(f"body {part}") == 3
    model = elastic_model(mesh, "plane_strain", NUT="xy")
    model.add_pretension("bolt", "BOLT_CUT", opposite="BOLT_CUT opposite", force=1.0)
    whole = (
        r"4 rigid-body motions are not restrained: body 'BOLT': translation along x, rotation about \(0\.5, 0\.5\); "
    )
    halves = (
        r"the part around \(0\.5, 0\.5\): translation along y; the part around \(0\.5, 1\.5\): translation along y\."
    )
    refused(fc.ModelError, whole + halves, fc.solve, model, 1)


# Motions that contact does not stop, and positions at which contact stops rigid bodies.


def test_a_body_without_loads_stays_where_it_is() -> None:
    """One body is pressed through a gap of 0.1; another one moves and turns between two walls, at no cost."""
    gaps = np.array(
        [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.5], [0.0, -1.0, -0.5], [0.0, 1.0, -0.5], [0.0, -1.0, 0.5], [-1.0, 1.0, 0.0]]
    )
    gap = np.array([0.1, 0.2, 0.2, 0.2, 0.2, 0.3])
    assert stopped_at(gaps, gap, np.array([2.0, 0.0, 0.0]), 1.0) == pytest.approx([0.1, 0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("opens", [False, True])
def test_one_linear_programme_shows_that_contact_stops_all_motions(opens, monkeypatch) -> None:
    """Gaps of random signs; if one opens, a motion closes none, and no load acts on it."""
    random, count, solve = np.random.default_rng(5), [], scipy.optimize.linprog
    monkeypatch.setattr(scipy.optimize, "linprog", lambda *args, **options: count.append(1) or solve(*args, **options))
    gaps, motion = random.standard_normal((60, 12)), random.standard_normal(12)
    if opens:
        gaps *= np.sign(gaps @ motion)[:, None]
    found = mechanisms(gaps, np.cross(motion[:3], [1.0, 2.0, 3.0])[None] @ np.eye(3, 12), np.eye(12))
    assert found.shape == (12, int(opens))
    assert (gaps @ found >= -1e-6).all()
    assert opens or len(count) == 1


@pytest.mark.parametrize("together", [False, True])
@pytest.mark.parametrize(
    ("dim", "formulation", "axis"),
    [
        (2, "node_to_segment", r"\(1, 0\)"),
        (2, "mortar", r"\(\S+, 0\)"),
        (3, "mortar", r"the line through .* along \(0, 1, 0\)"),
    ],
)
def test_a_tall_block_that_loads_tip_over_is_told(dim, formulation, axis, together) -> None:
    """The moment of the push about the edge is four times that of the weight."""
    flat = dim == 2
    element, up, bottom, top = ("quad4", "y", "BOTTOM", "TOP") if flat else ("hex8", "z", "ZMIN", "ZMAX")
    tall = body_of(element, (1.0, 4.0) if flat else (1.0, 1.0, 4.0), (2, 4) if flat else (2, 2, 4))
    base = body_of(element, (3.0, 1.0, 1.0), (6, 2, 1), (-1.0, -1.0) if flat else (-1.0, 0.0, -1.0))
    model = elastic_model(united(T_=tall, B_=base), **{f"B_{bottom}": "xyz"[:dim]})
    model.add_contact("c", secondary=f"T_{bottom}", primary=f"B_{top}", formulation=formulation, friction=0.9)
    model.add_force(f"T_{top}", **{up: -1.0}, ramp=None if together else [(0, 0), (0.5, 1), (1, 1)])
    model.add_force(f"T_{top}", x=0.5, ramp=None if together else [(0, 0), (0.5, 0), (1, 1)])
    text = rf"^the loads tip bodies over.*\(body 'T_\w+': rotation about {axis}, which opens the contact\): lower the"
    refused(fc.ModelError if together else fc.ConvergenceError, text, fc.solve, model, 2)
