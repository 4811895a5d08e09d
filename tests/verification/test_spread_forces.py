"""Forces distributed by distance, couplings weighted by distance, springs between groups."""

import numpy as np
import pytest
from models import elastic_model, supported

import fastcontact as fc
from fastcontact.cases.case import read_case
from fastcontact.model.couplings import WEIGHTINGS

pytestmark = pytest.mark.pairwise

FORCE = {2: {"x": 3.0, "y": -7.0}, 3: {"x": 3.0, "y": -7.0, "z": 2.0}}
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
        model.add_force("TOP", **FORCE[mesh.dim], at=place[: mesh.dim], weighting=weighting, radius=radius)
        force, moment = resultants(mesh, model.load_vector(model.loads[0]), place[: mesh.dim])
        np.testing.assert_allclose(force[: mesh.dim], list(FORCE[mesh.dim].values()), atol=1e-11)
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
            model.add_force("PIN", **FORCE[mesh.dim])
        else:
            model.add_force("TOP", **FORCE[mesh.dim], at=place[: mesh.dim], weighting=weighting, radius=1.6)
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
    for group in ("LOW", "UP"):
        model.fix(group, "x")
    supported(model, LOW="y", UP={"y": -0.01})
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    assert step.reaction[mesh.points_of("UP"), 1].sum() == pytest.approx(-30.0 * n * 0.01, rel=1e-12)
    np.testing.assert_allclose(model.springs[0].tension(step.displacement), -0.3, rtol=1e-12)


def test_columns_and_springs_in_series():
    """Stiffness E A / L of both columns and n k of the springs, one after the other; nu = 0."""
    mesh = two_blocks("quad4")
    model = elastic_model(mesh, "plane_stress", nu=0.0)
    groups = {}
    for name, side in (("A", "TOP"), ("B", "BOTTOM2")):
        points = mesh.points_of(side)
        ends = np.isin(mesh.points[points, 0], [0.0, 2.0])
        groups |= {f"{name}_INNER": points[~ends], f"{name}_ENDS": points[ends]}
    model.mesh = mesh.with_groups(points=groups)
    model.add_spring("A_INNER", "B_INNER", y=50.0, x=10.0)  # shares of 1/4 and 1/8: the pressure stays uniform
    model.add_spring("A_ENDS", "B_ENDS", y=25.0, x=10.0)
    supported(model, BOTTOM="y", LEFT="x")
    model.add_traction("TOP2", y=-1.0)
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    exact = -(2 * 1.0 * 1.0 / 1000.0 + 2.0 / 200.0)
    np.testing.assert_allclose(step.displacement[mesh.points_of("TOP2"), 1], exact, rtol=1e-10)


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
        (
            "add_spring",
            {"group": "TOP", "to": "BOTTOM_LEFT2", "y": 1.0, "translation": (0, 1)},
            "leave out the translation",
        ),
        (
            "add_force",
            {"group": "TOP", "y": 1.0, "weighting": "linear"},
            "no point from which distances count: give at",
        ),
        ("add_force", {"group": "TOP", "y": 1.0, "radius": 1.0}, "no point from which distances count"),
        ("add_force", {"group": "TOP", "y": 1.0, "at": (1.0, 1.0), "weighting": "square"}, "weighting 'square'"),
        ("add_force", {"group": "TOP", "y": 1.0, "at": (1.0, 1.0, 1.0)}, "must be 2 numbers"),
        (
            "add_force",
            {"group": "TOP", "y": 1.0, "at": (9.0, 1.0), "radius": 1.0},
            "no part of 'TOP' lies within the radius",
        ),
        (
            "add_force",
            {"group": "TOP", "y": 1.0, "at": (1.0, 1.0), "distribute": False},
            "leave out 'at' or 'distribute'",
        ),
        ("add_force", {"group": "TOP_LEFT", "y": 1.0, "at": (1.0, 1.0)}, "are collinear or coincide"),
        (
            "add_coupling",
            {"reference": "PIN", "group": "TOP", "weighting": "linear"},
            "has no weighting or radius",
        ),
        (
            "add_coupling",
            {"reference": "PIN", "group": "TOP", "kind": "distributing", "weighting": "l"},
            "unknown weighting 'l'",
        ),
    ],
)
def test_mistakes_are_told(method, arguments, words):
    mesh = fc.generate.with_reference_points(two_blocks("quad4"), {"PIN": (1.0, 1.2)})
    side = mesh.points_of("LEFT2")
    model = model_on(mesh.with_groups(points={"SIDE": side}))
    with pytest.raises(fc.ModelError, match=words):
        getattr(model, method)(**arguments)


def test_no_force_acts_through_a_place_of_a_ring():
    model = fc.Model(fc.generate.block((1.0, 1.0), (2, 2), "quad4", (1.0, 0.0)), "axisymmetric")
    with pytest.raises(fc.ModelError, match="in axisymmetry a force cannot act at a point"):
        model.add_force("TOP", y=1.0, at=(1.5, 1.0))


def test_in_a_case_file(tmp_path):
    fc.write_mesh(tmp_path / "two.med", two_blocks("quad4"))
    (tmp_path / "case.toml").write_text("""
kinematics = "plane_stress"
[mesh]
file = "two.med"
[[material]]
E = 1000.0
nu = 0.0
[[support]]
group = "BOTTOM"
x = 0.0
y = 0.0
[[spring]]
group = "TOP"
to = "BOTTOM2"
axial = 30.0
transverse = 10.0
translation = [0.0, 0.5]
[[force]]
group = "TOP2"
y = -1.0
at = [0.5, 2.5]
weighting = "quadratic"
radius = 1.0
[ramp]
steps = 1
""")
    case = read_case(tmp_path / "case.toml")
    step = fc.solve(case.model, case.ramp)[-1]
    assert step.reaction[case.model.mesh.points_of("BOTTOM"), 1].sum() == pytest.approx(1.0, rel=1e-9)
    springs = case.model.springs[0]
    pull = springs.rows.T @ springs.tension(step.displacement)  # what they do to the nodes
    below = case.model.mesh.points_of("TOP")
    vertical = pull.reshape(-1, 2)[below, 1]
    assert vertical.sum() == pytest.approx(1.0, rel=1e-9)
    # In balance about the place through which the force acts.
    moment = vertical @ (case.model.mesh.points[below, 0] - 0.5) - pull.reshape(-1, 2)[below, 0] @ (0.0 * below - 1.5)
    assert moment == pytest.approx(0.0, abs=1e-9)
