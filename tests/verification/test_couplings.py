"""Couplings, moments, distributed forces and hydrostatic pressure: beam theory, statics, and rigid-body motions."""

import numpy as np
import pytest
from models import elastic_model, supported
from refusals import refused

import fastcontact as fc
from fastcontact.model.couplings import WEIGHTINGS

pytestmark = pytest.mark.pairwise

E, LENGTH, HEIGHT = 1000.0, 10.0, 1.0
INERTIA = HEIGHT**3 / 12
MOMENT, FORCE = 0.02, 0.003
KINDS = ("rigid", "distributing")


def beam(kind, place=(LENGTH + 2.0, 0.5), element="quad8"):
    """Return a beam held at its left end, coupled with a reference point at its right one; nu = 0."""
    mesh = fc.generate.block((LENGTH, HEIGHT), (10, 2), element)
    model = elastic_model(fc.generate.with_reference_points(mesh, {"REF": place}), "plane_stress", E=E, nu=0.0)
    model.fix("LEFT", "x")
    model.mesh = model.mesh.with_facet_group("END", lambda x: abs(x[:, 0]) < 1e-9)
    held = int(np.flatnonzero((np.abs(mesh.points - [0.0, 0.5]) < 1e-9).all(axis=1))[0])
    model.mesh = model.mesh.with_groups(points={"HELD": [held]})
    model.fix("HELD", "y")
    model.add_coupling("REF", "RIGHT", kind=kind)
    return model


def at_reference(model, step):
    return step.displacement[model.mesh.point("REF")], step.displacement[model.mesh.point("REF rotation"), 0]


@pytest.mark.parametrize("kind", KINDS)
def test_a_pure_moment_bends_a_beam_to_a_circle(kind):
    """Rotation M L / (E I) at the end, deflection M L^2 / (2 E I), and 2 [length] further on the arm adds its part."""
    model = beam(kind)
    model.add_moment("REF", z=MOMENT)
    (step,) = fc.solve(model, 1)
    moved, angle = at_reference(model, step)
    assert angle == pytest.approx(MOMENT * LENGTH / (E * INERTIA), rel=1e-9)
    assert moved[1] == pytest.approx(MOMENT * LENGTH**2 / (2 * E * INERTIA) + 2.0 * angle, rel=1e-9)
    assert step.stress[:, 0] == pytest.approx(
        -MOMENT
        / INERTIA
        * (model.mesh.points[:, 1] - 0.5)
        * (np.arange(model.mesh.n_points) < model.mesh.n_points - 2),
        abs=1e-9,
    )


@pytest.mark.parametrize("kind", KINDS)
def test_a_force_at_an_arm_is_a_force_and_a_moment(kind):
    """A pull of F at a height h over the middle: strain F / (E A), curvature F h / (E I)."""
    model = beam(kind, (LENGTH, 0.5 + 3.0))
    model.add_force("REF", x=FORCE)
    (step,) = fc.solve(model, 1)
    moved, angle = at_reference(model, step)
    assert angle == pytest.approx(-FORCE * 3.0 * LENGTH / (E * INERTIA), rel=1e-9)
    assert moved[0] == pytest.approx(FORCE * LENGTH / (E * HEIGHT) - 3.0 * angle, rel=1e-9)
    assert step.reaction[model.mesh.points_of("LEFT")].sum(axis=0) == pytest.approx([-FORCE, 0.0], abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("held", ["x", "xy"])
def test_a_supported_reference_point_has_a_force_and_a_moment(kind, held):
    """The load F acts at an arm of 1 along x and of 2.5 along y from the reference point, which is held in part."""
    mesh = fc.generate.with_reference_points(fc.generate.block((4.0, 2.0), (4, 2), "quad8"), {"HUB": (1.0, -0.5)})
    model = elastic_model(mesh, "plane_strain", E=E)
    model.add_coupling("HUB", "BOTTOM", kind=kind)
    supported(model, HUB=held, **{"HUB rotation": "x"})
    if held == "x":
        model.add_force("HUB", y=2.0 * FORCE)
        model.add_spring("TOP_RIGHT", y=1.0)
    model.add_force("TOP", x=FORCE, y=-2.0 * FORCE)
    (step,) = fc.solve(model, 1)
    spring = step.reaction[mesh.points_of("TOP_RIGHT"), 1].sum()
    along_y = 2.0 * FORCE if held == "xy" else 0.0
    told = step.reference_reactions["HUB"]
    assert told["force"] == pytest.approx([-FORCE, along_y], abs=1e-9)
    assert told["moment"] == pytest.approx([2.0 * FORCE + 2.5 * FORCE - 3.0 * spring], abs=1e-8)
    assert fc.support_forces(model, step)["HUB"] == pytest.approx([-FORCE, along_y], abs=1e-9)


def test_a_moment_on_facets_is_that_on_a_distributing_coupling():
    model, other = beam("distributing"), beam("distributing")
    model.add_moment("REF", z=MOMENT)
    other.add_moment("RIGHT", z=MOMENT)
    steps = [fc.solve(own, 1)[0] for own in (model, other)]
    assert steps[0].displacement == pytest.approx(steps[1].displacement, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("element", ["hex8", "tet4", "tet10", "hex20", "wedge6"])
def test_in_space_a_body_follows_the_reference_point(kind, element):
    """Prescribed motions and rotations of the reference point move a free body as a rigid one, without stress."""
    place, angles, shift = np.array([0.3, -1.0, 4.0]), np.array([1e-3, -2e-3, 3e-3]), np.array([0.1, 0.2, -0.3])
    mesh = fc.generate.with_reference_points(fc.generate.box((1.0, 2.0, 1.5), (2, 2, 2), element), {"REF": place})
    model = elastic_model(mesh, "3d", E=E)
    model.add_coupling("REF", "ZMAX", kind=kind)
    model.prescribe("REF", **dict(zip("xyz", shift, strict=True)))
    model.prescribe("REF rotation", **dict(zip("xyz", angles, strict=True)))
    (step,) = fc.solve(model, 1)
    body = mesh.points_of("BOX")
    exact = shift + np.cross(angles, mesh.points[body] - place)
    assert step.displacement[body] == pytest.approx(exact, abs=1e-10)
    assert np.abs(step.stress).max() < 1e-8


@pytest.mark.parametrize("kind", KINDS)
def test_forces_and_moments_in_space_are_balanced_by_the_supports(kind):
    mesh = fc.generate.with_reference_points(fc.generate.box((1.0, 1.0, 2.0), (2, 2, 4)), {"REF": (0.2, 0.9, 2.5)})
    model = elastic_model(mesh, "3d", E=E, ZMIN="xyz")
    model.add_coupling("REF", "ZMAX", kind=kind)
    force, moment = np.array([0.1, -0.2, 0.3]), np.array([0.05, 0.02, -0.07])
    model.add_force("REF", **dict(zip("xyz", force, strict=True)))
    model.add_moment("REF", **dict(zip("xyz", moment, strict=True)))
    (step,) = fc.solve(model, 1)
    held = mesh.points_of("ZMIN")
    assert step.reaction[held].sum(axis=0) == pytest.approx(-force, rel=1e-9)
    turned = np.cross(mesh.points[held], step.reaction[held]).sum(axis=0)
    assert turned == pytest.approx(-moment - np.cross([0.2, 0.9, 2.5], force), rel=1e-8)


def test_components_of_a_rigid_coupling():
    model = beam("rigid")
    model.relations.clear()
    model.add_coupling("REF", "RIGHT", components="x")
    assert model.relations[0].rows.shape[0] == len(model.mesh.points_of("RIGHT"))


@pytest.mark.parametrize("level", [0.4, 1.0, 3.0])
def test_a_liquid_presses_by_its_depth(level):
    """The force on a wall of height 1 is weight * depth^2 / 2, less the part above the wall."""
    model = elastic_model(fc.generate.block((1.0, 1.0), (4, 20), "quad8"), "plane_strain", E=E, nu=0.0, RIGHT="xy")
    model.add_hydrostatic_pressure("LEFT", weight=2.0, level=level)
    (step,) = fc.solve(model, 1)
    exact = level**2 - max(level - 1.0, 0.0) ** 2
    assert step.reaction[:, 0].sum() == pytest.approx(-exact, rel=1e-9)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda m: m.add_coupling("RIGHT", "LEFT"), "'RIGHT' is not a reference point: build the model on fc.generate"),
        (lambda m: m.add_coupling("REF", "LEFT", kind="stiff"), "unknown kind of coupling 'stiff'"),
        (lambda m: m.add_coupling("REF", "REF"), "the group must have points and must not contain the reference point"),
        (lambda m: m.add_coupling("REF", "LEFT", components="z"), "unknown component 'z'"),
        (lambda m: m.add_coupling("REF", "LEFT", kind="distributing", components="x"), "couples all components"),
        (lambda m: m.add_moment("REF", x=1.0), "in two dimensions a moment has the component z only"),
        (lambda m: m.add_moment("REF", z=np.nan), "the moment on 'REF' is nan"),
        (lambda m: m.add_hydrostatic_pressure("LEFT", weight=np.inf, level=1.0), "weight of the hydrostatic pressure"),
        (lambda m: m.add_hydrostatic_pressure("LEFT", weight=1.0, level=1.0, axis="z"), "unknown component 'z'"),
    ],
)
def test_what_is_refused(call, said):
    model = beam("rigid")

    def run():
        call(model)
        fc.solve(model, 1)

    refused(fc.FastcontactError, said, run)


def test_nothing_turns_in_axisymmetry():
    model = fc.Model(fc.generate.with_reference_points(fc.generate.block(), {"REF": (0.0, 2.0)}), "axisymmetric")
    with pytest.raises(fc.ModelError, match=r"in axisymmetry there are no rotations; use couple\('TOP', 'y'\)"):
        model.add_coupling("REF", "TOP")
    refused(fc.ModelError, "a moment cannot act on an axisymmetric model", model.add_moment, "TOP", z=1.0)


@pytest.mark.parametrize("said", ["component", "normal", "axes"])
def test_forces_of_supports_hold_neither_springs_nor_couplings(said):
    """A block on a support and a spring, its top coupled: the support carries what the spring does not."""
    model = elastic_model(fc.generate.block((2.0, 1.0), (4, 2)), "plane_stress")
    if said == "normal":
        model.fix("BOTTOM", "normal")
    elif said == "axes":
        model.prescribe("BOTTOM", y=0.0, axes=(1.0, 0.0))
    else:
        model.fix("BOTTOM", "y")
    model.fix("LEFT", "x")
    model.add_spring("RIGHT", y=5.0, x=2.0)
    model.couple("TOP", "y")
    model.add_traction("TOP", x=1.0, y=-3.0)
    (step,) = fc.solve(model, 1)
    found, springs = fc.support_forces(model, step), fc.spring_forces(model, step)
    assert found.keys() == {"BOTTOM", "LEFT"}
    right = step.displacement[model.mesh.points_of("RIGHT")]
    assert springs["spring on 'RIGHT'"].sum() == pytest.approx((right @ [2.0, 5.0]).sum(), rel=1e-12)
    pulled = right.sum(axis=0) * [2.0, 5.0]
    assert found["BOTTOM"] + found["LEFT"] == pytest.approx(np.array([-2.0, 6.0]) + pulled, rel=1e-9)
    assert found["BOTTOM"][0] == pytest.approx(0.0, abs=1e-9)
    assert found["LEFT"][1] == 0.0
    other = fc.Model(fc.generate.block((2.0, 1.0), (3, 2)), "plane_stress")
    for asked in (fc.support_forces, fc.spring_forces):
        refused(fc.ModelError, "pass the model of this step", asked, other, step)


SPREAD_FORCE = {2: {"x": 3.0, "y": -7.0}, 3: {"x": 3.0, "y": -7.0, "z": 2.0}}
MESHES = {
    "quad4": lambda: fc.generate.block((4.0, 1.0), (16, 2), "quad4"),
    "quad8": lambda: fc.generate.block((4.0, 1.0), (8, 2), "quad8"),
    "tri3": lambda: fc.generate.block((4.0, 1.0), (9, 2), "tri3"),
    "hex8": lambda: fc.generate.renamed(fc.generate.box((4.0, 1.0, 2.0), (8, 2, 4), "hex8"), {"YMAX": "TOP"}),
    "tet10": lambda: fc.generate.renamed(fc.generate.box((4.0, 1.0, 2.0), (4, 1, 2), "tet10"), {"YMAX": "TOP"}),
}


def model_on(mesh):
    return elastic_model(mesh, "plane_stress" if mesh.dim == 2 else "3d")


def resultants(mesh, forces, place):
    """The resultant, and the moment about a place, in three components."""
    arms, force = np.zeros((2, mesh.n_points, 3))
    arms[:, : mesh.dim], force[:, : mesh.dim] = mesh.points - place, forces
    return force.sum(axis=0), np.cross(arms, force).sum(axis=0)


@pytest.mark.parametrize("weighting", WEIGHTINGS)
@pytest.mark.parametrize("radius", [None, 1.5])
@pytest.mark.parametrize("name", MESHES)
def test_the_resultant_passes_through_the_place(name, weighting, radius):
    """Also beside the group, and near its border: the force is whole, its moment about the place zero."""
    mesh = MESHES[name]()
    for place in (np.array([1.0, 1.0, 1.0]), np.array([0.2, 1.3, 0.4])):
        model = model_on(mesh)
        model.add_force("TOP", **SPREAD_FORCE[mesh.dim], at=place[: mesh.dim], weighting=weighting, radius=radius)
        force, moment = resultants(mesh, model.load_vector(model.loads[0]), place[: mesh.dim])
        np.testing.assert_allclose(force[: mesh.dim], list(SPREAD_FORCE[mesh.dim].values()), atol=1e-11)
        np.testing.assert_allclose(moment, 0.0, atol=1e-10)


@pytest.mark.parametrize("weighting", WEIGHTINGS)
@pytest.mark.parametrize("name", ["quad8", "hex8"])
def test_in_the_middle_it_is_the_traction_of_that_function(name, weighting):
    """No moment is left there, so the force is a traction in proportion to the weight."""
    mesh = MESHES[name]()
    place, radius = np.array([2.0, 1.0, 1.0])[: mesh.dim], 3.0

    def weight(points):
        return WEIGHTINGS[weighting](np.linalg.norm(points - place, axis=1) / radius)

    spread, traction = model_on(mesh), model_on(mesh)
    spread.add_force("TOP", y=-7.0, at=place, weighting=weighting, radius=radius)
    traction.add_traction("TOP", y=weight)
    one, other = (model.load_vector(model.loads[0]) for model in (spread, traction))
    np.testing.assert_allclose(one, -7.0 * other / other.sum(), atol=1e-12)


def test_nothing_is_loaded_beyond_the_radius():
    mesh = MESHES["quad4"]()
    model = model_on(mesh)
    model.add_force("TOP", y=-7.0, at=(2.0, 1.0), weighting="cubic", radius=0.75)
    loaded = model.load_vector(model.loads[0]).any(axis=1)
    assert np.abs(mesh.points[loaded, 0] - 2.0).max() <= 0.75 + 0.25
    assert 3 <= loaded.sum() <= 9


def test_a_group_of_points_is_weighted_by_distance_alone():
    mesh = MESHES["quad4"]()
    top = mesh.points_of("TOP")
    model = model_on(mesh.with_groups(points={"NODES": top}))
    model.add_force("NODES", y=-1.0, at=(2.0, 1.0), weighting="linear")
    found = model.load_vector(model.loads[0])[top, 1]
    expected = 1.0 - np.abs(mesh.points[top, 0] - 2.0) / 2.0
    np.testing.assert_allclose(found, -expected / expected.sum(), atol=1e-14)


@pytest.mark.parametrize("name", ["quad4", "hex8"])
@pytest.mark.parametrize("weighting", ["linear", "cubic"])
def test_a_weighted_coupling_bears_the_force_at_its_reference_point(name, weighting):
    """It is the transpose: a force at the reference point loads the group as `add_force` about this place does."""
    place = (1.3, 1.2, 0.9)
    mesh = fc.generate.with_reference_points(MESHES[name](), {"PIN": place[: MESHES[name]().dim]})
    side = "BOTTOM" if mesh.dim == 2 else "YMIN"
    results = []
    for coupled in (True, False):
        model = model_on(mesh)
        model.fix(side, "xyz"[: mesh.dim])
        model.add_coupling("PIN", "TOP", kind="distributing", weighting=weighting, radius=1.6)
        if coupled:
            model.add_force("PIN", **SPREAD_FORCE[mesh.dim])
        else:
            model.add_force("TOP", **SPREAD_FORCE[mesh.dim], at=place[: mesh.dim], weighting=weighting, radius=1.6)
        results.append(fc.solve(model, fc.linear_ramp(1))[-1])
    bodies = ~np.isin(np.arange(mesh.n_points), [mesh.point("PIN"), mesh.point("PIN rotation")])
    one, other = (step.displacement[bodies] for step in results)
    np.testing.assert_allclose(one, other, atol=1e-11 * np.abs(other).max())


# ----------------------------------------------------------------------------- springs between groups
def two_blocks(element, divisions=(4, 4), distance=0.5):
    lower = fc.generate.block((2.0, 1.0), (divisions[0], 2), element, name="LOW")
    upper = fc.generate.block((2.0, 1.0), (divisions[1], 2), element, (0.0, 1.0 + distance), name="UP")
    names = {side: f"{side}2" for side in ("BOTTOM", "TOP", "LEFT", "RIGHT")}
    corners = {f"{a}_{b}": f"{a}_{b}2" for a in ("BOTTOM", "TOP") for b in ("LEFT", "RIGHT")}
    return fc.generate.union(lower, fc.generate.renamed(upper, {**names, **corners}))


@pytest.mark.parametrize("element", ["quad4", "quad8", "tri3"])
@pytest.mark.parametrize("kind", ["axes", "axial", "direction"])
def test_springs_join_the_nodes_of_two_groups(element, kind):
    """Rigidly moved ends: n springs of k each carry n k times the approach."""
    mesh = two_blocks(element)
    model = model_on(mesh)
    n = len(mesh.points_of("TOP"))
    given = {"axes": {"y": 30.0}, "axial": {"axial": 30.0}, "direction": {"axial": 30.0, "direction": (0.0, 1.0)}}[kind]
    model.add_spring("TOP", "BOTTOM2", **given)
    assert model.springs[0].stiffness.tolist() == [30.0] * n
    supported(model, LOW="x", UP="x")
    supported(model, LOW="y", UP={"y": -0.01})
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    assert step.reaction[mesh.points_of("UP"), 1].sum() == pytest.approx(-30.0 * n * 0.01, rel=1e-12)
    np.testing.assert_allclose(model.springs[0].tension(step.displacement), -0.3, rtol=1e-12)


def test_one_node_is_joined_with_all_of_a_group():
    mesh = two_blocks("quad4")
    model = model_on(mesh)
    model.add_spring("BOTTOM_LEFT2", "TOP", axial=5.0)
    model.add_spring("TOP", mesh.point("BOTTOM_RIGHT2"), y=5.0)
    n = len(mesh.points_of("TOP"))
    assert [len(own.stiffness) for own in model.springs] == [n, n]
    lines = mesh.points[mesh.points_of("TOP")] - mesh.points[mesh.point("BOTTOM_LEFT2")]
    u = np.zeros(mesh.points.shape)
    u[mesh.points_of("TOP")] = 1e-3 * lines
    np.testing.assert_allclose(model.springs[0].tension(u), 5e-3 * np.linalg.norm(lines, axis=1), rtol=1e-12)


@pytest.mark.parametrize(
    ("method", "arguments", "words"),
    [
        ("add_spring", {"group": "TOP", "to": "BOTTOM_LEFT2", "y": 1.0, "translation": (0, 1)}, "out the translation"),
        ("add_force", {"group": "TOP", "y": 1.0, "weighting": "linear"}, "point from which distances are measured:"),
        ("add_force", {"group": "TOP", "y": 1.0, "radius": 1.0}, "no point from which distances are measured"),
        ("add_force", {"group": "TOP", "y": 1.0, "at": (1.0, 1.0), "weighting": "square"}, "weighting 'square'"),
        ("add_force", {"group": "TOP", "y": 1.0, "at": (1.0, 1.0, 1.0)}, "needs 2 coordinates"),
        ("add_force", {"group": "TOP", "y": 1.0, "at": (9.0, 1.0), "radius": 1.0}, "no part of 'TOP' lies within the"),
        ("add_force", {"group": "TOP", "y": 1.0, "at": (1.0, 1.0), "distribute": False}, "out 'at' or 'distribute'"),
        ("add_force", {"group": "TOP_LEFT", "y": 1.0, "at": (1.0, 1.0)}, "are collinear or coincide"),
        ("add_coupling", {"reference": "PIN", "group": "TOP", "weighting": "linear"}, "has no weighting or radius"),
        (
            "add_coupling",
            {"reference": "PIN", "group": "TOP", "kind": "distributing", "weighting": "l"},
            "unknown weighting 'l'",
        ),
    ],
)
def test_mistakes_are_told(method, arguments, words):
    mesh = fc.generate.with_reference_points(two_blocks("quad4"), {"PIN": (1.0, 1.2)})
    model = model_on(mesh.with_groups(points={"SIDE": mesh.points_of("LEFT2")}))
    refused(fc.ModelError, words, getattr(model, method), **arguments)


@pytest.mark.parametrize("kind", ["rigid", "distributing"])
def test_reactions_of_a_reference_point_on_an_inclined_guide(kind):
    mesh = fc.generate.with_reference_points(fc.generate.block((1.0, 1.0), (2, 2)), {"HUB": (0.5, 1.5)})
    model = elastic_model(mesh, BOTTOM="xy")
    model.add_coupling("HUB", "TOP", kind=kind)
    model.add_force("RIGHT", x=1.0)
    model.fix("HUB", "y", axes=(0.8, 0.6))  # guided along (0.8, 0.6)
    step = fc.solve(model, 1)[-1]
    force = step.reference_reactions["HUB"]["force"]
    assert force == pytest.approx(fc.support_forces(model, step)["HUB"].tolist(), abs=1e-12)
    assert np.dot(force, [0.8, 0.6]) == pytest.approx(0.0, abs=1e-12)
    assert np.linalg.norm(force) > 0.1
