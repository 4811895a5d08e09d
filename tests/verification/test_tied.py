"""Tied contact between meshes that need not match."""

import numpy as np
import pytest
from models import elastic_model, supported, with_contact
from scipy.spatial.transform import Rotation
from two_bodies import EVERY, SIDES, blocks, boxes, rings, touching

import fastcontact as fc

pytestmark = pytest.mark.pairwise

FORMULATIONS = ("node_to_segment", "continuous", "mortar")
ONCE = fc.linear_ramp(1)
SKEW = np.array([[2e-3, 1e-3, -4e-4], [3e-3, -1e-3, 7e-4], [5e-4, -2e-3, 1e-3]])


def stretched(mesh, prescribed=(), **options):
    """The outside of both bodies moves as a linear function of position: so must everything.

    Tractions act at sides whose displacement is not `prescribed`.
    """
    dim = mesh.dim
    model = elastic_model(mesh, "3d" if dim == 3 else "plane_strain")
    for group in ("L_ZMIN", "U_ZMAX") if dim == 3 else ("LOWER_BOTTOM", "UPPER_TOP"):
        model.prescribe(group, **{axis: linear(k, dim) for k, axis in enumerate("xyz"[:dim])})
    sides = ("XMIN", "XMAX", "YMIN", "YMAX") if dim == 3 else ("LEFT", "RIGHT")
    for body in ("L", "U") if dim == 3 else ("LOWER", "UPPER"):
        for side in prescribed:
            model.prescribe(f"{body}_{side}", **{axis: linear(k, dim) for k, axis in enumerate("xyz"[:dim])})
        for side in set(sides).difference(prescribed):
            traction = stress(dim) @ outward(side, dim)
            model.add_traction(f"{body}_{side}", **dict(zip("xyz", traction, strict=False)))
    return touching(model, **{"kind": "tied", **options})


def linear(k, dim):
    return lambda x: x @ SKEW[k, :dim]


def stress(dim):
    strain = 0.5 * (SKEW + SKEW.T)
    if dim == 2:
        strain = np.pad(strain[:2, :2], ((0, 1), (0, 1)))
    lame, shear = 1000.0 * 0.3 / (1.3 * 0.4), 1000.0 / 2.6
    return (lame * np.trace(strain) * np.eye(3) + 2 * shear * strain)[:dim, :dim]


def outward(side, dim):
    axis = {"LEFT": 0, "RIGHT": 0}.get(side, "XYZ".find(side[0]))
    return (-1.0 if side.endswith(("LEFT", "MIN")) else 1.0) * np.eye(dim)[axis]


@pytest.mark.each_value
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("element", ["tri3", "tri6", "quad4", "quad8", "quad9", "hex8", "tet4", "hex20", "tet10"])
def test_mortar_ties_meshes_that_do_not_match_exactly(element, swap):
    """The linear patch test, with stretching, shearing and turning, under tension and shear in the interface."""
    flat = element[:3] in ("tri", "qua")
    mesh = blocks(element, upper=(4, 3)) if flat else boxes(element, lower=(2, 3, 1), upper=(3, 2, 1))
    last = fc.solve(stretched(mesh, formulation="mortar", swap=swap), ONCE)[-1]
    dim = mesh.dim
    exact = mesh.points @ SKEW[:dim, :dim].T
    assert np.abs(last.displacement - exact).max() < 1e-10 * np.abs(exact).max()
    contact = last.contact["pair"]
    assert contact.active.all()
    assert contact.sticking.all()
    # What the secondary side feels: the traction of the uniform stress on its outer normal.
    sigma = stress(dim)
    normal = (1.0 if swap else -1.0) * np.eye(dim)[-1]
    assert contact.pressure == pytest.approx(-normal @ sigma @ normal, rel=1e-9)
    along = sigma @ normal - (normal @ sigma @ normal) * normal
    assert contact.shear == pytest.approx(np.tile(along, (len(contact.shear), 1)), rel=1e-9, abs=1e-9)
    area = 10.0 ** (dim - 1)
    assert contact.force == pytest.approx(sigma @ normal * area, rel=1e-10, abs=1e-9)


@pytest.mark.parametrize("multipliers", ["standard", "dual"])
@pytest.mark.parametrize("element", ["quad4", "quad8", "hex8", "tet4"])
def test_uniform_tractions_pass_beside_edges_that_supports_hold_on_both_sides(element, multipliers):
    flat = element.startswith("quad")
    mesh = blocks(element, upper=(4, 3)) if flat else boxes(element, lower=(2, 3, 1), upper=(3, 2, 1))
    # Of the triangle in a corner all nodes are held: nothing determines what it transmits.
    prescribed = ("LEFT", "RIGHT") if flat else ("XMIN", "YMAX") if element == "hex8" else ("XMIN",)
    model = stretched(mesh, prescribed, formulation="mortar", multipliers=multipliers)
    contact, sigma = fc.solve(model, ONCE)[-1].contact["pair"], stress(mesh.dim)
    assert contact.pressure == pytest.approx(-sigma[-1, -1], rel=1e-9)
    along = np.append(-sigma[:-1, -1], 0.0)
    assert contact.shear == pytest.approx(np.tile(along, (len(contact.shear), 1)), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("said", ["x", "normal", "axes", "relation"])
@pytest.mark.parametrize(
    ("formulation", "options"), [("continuous", {}), ("mortar", {}), ("mortar", {"multipliers": "dual"})]
)
@pytest.mark.parametrize("element", ["quad4", "quad8", "hex8"])
def test_ties_are_determined_where_supports_hold_both_sides(element, formulation, options, said):
    """Multipliers that alternate from node to node do no work where the first displacement is held: 107 for 1.3."""
    flat = element.startswith("quad")
    mesh = blocks(element, upper=(6, 3)) if flat else boxes(element, lower=(4, 2, 2), upper=(2, 2, 2))
    bottom, top, *left = (
        ("LOWER_BOTTOM", "UPPER_TOP", "LOWER_LEFT", "UPPER_LEFT") if flat else ("L_ZMIN", "U_ZMAX", "L_XMIN", "U_XMIN")
    )
    for kinematics in ["plane_strain", *["axisymmetric"] * (said == "x")] if flat else ["3d"]:
        for swap in (False, True):
            model = elastic_model(mesh, kinematics, **{bottom: "xyz"[: mesh.dim]})
            for side in left:
                if said == "relation":
                    for point in set(mesh.points_of(side)).difference(mesh.points_of(bottom)):
                        model.relate([(int(point), "x", 1.0)])
                elif said == "axes":
                    model.fix(side, "x", axes=(1.0, 0.0) if flat else [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
                else:
                    model.fix(side, said)
            model.add_traction(top, **{"xyz"[mesh.dim - 1]: -1.0, "x": 0.3})
            touching(model, formulation, kind="tied", swap=swap, **options)
            contact = fc.solve(model, ONCE)[-1].contact["pair"]
            assert np.linalg.norm(contact.shear, axis=1).max() < 2.0


@pytest.mark.each_value
@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("make", [blocks, boxes])
def test_matching_meshes_are_tied_as_if_they_were_one(make, formulation):
    mesh = make()
    one = fc.generate.merge_points(mesh, tolerance=1e-9)
    models = []
    for m in (mesh, one):
        model = fc.Model(m, "3d" if m.dim == 3 else "plane_strain")
        model.add_material(fc.LinearElastic(E=1000.0, nu=0.3), "L_BOX" if m.dim == 3 else "LOWER")
        model.add_material(fc.LinearElastic(E=300.0, nu=0.4), "U_BOX" if m.dim == 3 else "UPPER")
        model.fix("L_ZMIN" if m.dim == 3 else "LOWER_BOTTOM", "xyz"[: m.dim])
        model.add_traction("U_ZMAX" if m.dim == 3 else "UPPER_TOP", **dict(zip("xyz"[: m.dim], (1.0, 2.0, 3.0))))
        models.append(model)
    touching(models[0], formulation, kind="tied")
    glued, whole = (fc.solve(model, ONCE)[-1] for model in models)
    nearest = [np.flatnonzero((np.abs(one.points - x) < 1e-9).all(axis=1))[0] for x in mesh.points]
    assert np.abs(glued.displacement - whole.displacement[nearest]).max() < 1e-9 * np.abs(whole.displacement).max()


@pytest.mark.each_value
@pytest.mark.parametrize(("formulation", "options"), [("continuous", {}), ("mortar", {"multipliers": "dual"})])
@pytest.mark.parametrize("make", ["octagon", "trough"])
def test_ties_do_not_depend_on_the_direction_of_the_axes(make, formulation, options):
    """Nodes opposite corners and edges have several closest facets, and axes at supports any tangents: up to 1.7e-2 apart."""
    flat = make == "octagon"
    mesh = rings("quad4", divisions=((5, 2), (2, 2))) if flat else trough()
    if flat:
        fixed, pressed = {"XAXIS": "y", "YAXIS": "x"}, "SHAFT_INNER"
        sides = {"secondary": "SHAFT_OUTER", "primary": "HUB_INNER"}
    else:
        fixed, pressed = {"L_ZMIN": "xyz", "L_XMIN": "x", "U_XMIN": "x", "L_YMIN": "y", "U_YMIN": "y"}, "U_ZMAX"
        sides = {"secondary": "U_ZMIN", "primary": "L_ZMAX"}
    found = []
    for angle in (0.0, 30.0, 100.0):
        about = np.array([0.0 if flat else 0.4, 0.0 if flat else 0.7, 1.0])
        axes = Rotation.from_rotvec(angle * about, degrees=True).as_matrix()
        Q = axes[: mesh.dim, : mesh.dim]
        model = elastic_model(mesh.replace(points=mesh.points @ Q.T), "plane_strain" if flat else "3d")
        for group, components in fixed.items():
            model.fix(group, components, axes=axes.T.tolist())
        model.add_pressure(pressed, 10.0)
        model.add_contact("pair", formulation=formulation, kind="tied", **sides, **options)
        found.append(fc.solve(model, ONCE)[-1].displacement @ Q)
    for other in found[1:]:
        assert np.abs(other - found[0]).max() < 1e-9 * np.abs(found[0]).max()


def trough():
    """Two boxes with a gap, whose faces are bent to a trough: nodes above its concave edges have two closest facets."""
    mesh = boxes(lower=(4, 2, 1), upper=(2, 3, 1), apart=0.4)
    points = mesh.points.copy()
    points[:, 2] += 0.06 * (points[:, 0] - 5.0) ** 2 + 0.03 * (points[:, 1] - 3.0) ** 2
    return mesh.replace(points=points)


@pytest.mark.each_value
@pytest.mark.parametrize("turn", [0.0, 1e-3])
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_curved_sides_are_tied_without_stress_as_they_lie(formulation, turn):
    """Facets of two circles leave gaps and overlaps, which the tie keeps: exactly when moved, nearly when turned."""
    mesh = rings("quad4", divisions=((6, 2), (8, 2)))
    model = elastic_model(mesh, "plane_strain")
    model.prescribe("HUB_OUTER", x=lambda x: 0.1 - turn * x[:, 1], y=lambda x: 0.2 + turn * x[:, 0])
    model.add_contact("pair", secondary="SHAFT_OUTER", primary="HUB_INNER", formulation=formulation, kind="tied")
    last = fc.solve(model, ONCE)[-1]
    exact = np.array([0.1, 0.2]) + turn * mesh.points[:, ::-1] * [-1.0, 1.0]
    # Across a gap the two sides of a turning body move apart by the angle times the gap: 2 (1 - cos(pi / 24)) at most.
    across = turn * 2.0 * (1.0 - np.cos(np.pi / 24))
    assert np.abs(last.displacement - exact).max() < 1e-12 + across
    assert np.abs(last.stress).max() < 1e-9 + 1000.0 * across


def test_a_tied_pair_is_linear_and_sits_beside_contact_with_friction():
    """Load and unload leave nothing behind; another pair slides meanwhile."""
    mesh = blocks(upper=(4, 3))
    for step, load in zip(fc.solve(held_and_pulled(mesh), fc.Ramp((0.5, 1.0, 1.5, 2.0), ((0, 0), (1, 1), (2, 0)))),
                          (0.5, 1.0, 0.5, 0.0), strict=True):  # fmt: skip
        assert step.contact["pair"].force[1] == pytest.approx(-20.0 * load, abs=1e-9)
        assert step.iterations["geometry_updates"] <= 1
    mesh = fc.generate.union(blocks(), moved(blocks(), 20.0))
    secondary, primary = SIDES["plane"]
    model = elastic_model(mesh, "plane_strain", LOWER_BOTTOM="xy", R_LOWER_BOTTOM="xy")
    supported(model, UPPER_TOP={"x": 0.05, "y": -0.02}, R_UPPER_TOP={"x": 0.05, "y": -0.02})
    model.add_contact("slides", secondary=secondary, primary=primary, formulation="node_to_segment", friction=0.2)
    model.add_contact("glued", secondary="R_" + secondary, primary="R_" + primary, formulation="mortar", kind="tied")
    both = fc.solve(model, fc.linear_ramp(2))[-1]
    model.contact.pop()
    model.add_contact("glued", secondary="R_" + secondary, primary="R_" + primary, formulation="mortar")
    alone = fc.solve(model, fc.linear_ramp(2))[-1]
    assert both.contact["slides"].pressure == pytest.approx(alone.contact["slides"].pressure, rel=1e-10)
    assert not both.contact["slides"].sticking.all()
    assert np.abs(both.contact["glued"].force[0]) > 5 * np.abs(alone.contact["glued"].force[0])


def held_and_pulled(mesh):
    model = elastic_model(mesh, "plane_strain", LOWER_BOTTOM="xy")
    model.add_traction("UPPER_TOP", y=2.0)
    return touching(model, "mortar", kind="tied")


def moved(mesh, by):
    points = mesh.points + np.array([by, 0.0])
    return fc.generate.renamed(mesh.replace(points=points), lambda name: f"R_{name}")


# Tied sides with an offset: free rotations, moments of shear, with every formulation and solver.

TURN = np.array([[0.0, -3e-4, 2e-4], [3e-4, 0.0, -5e-4], [-2e-4, 5e-4, 0.0]])
NAMES = {"XMIN": "LEFT", "XMAX": "RIGHT", "YMIN": "FRONT", "YMAX": "BACK", "ZMIN": "BOTTOM", "ZMAX": "TOP"}


def apart(element, gap):
    """Two blocks, one above the other at a distance, with meshes that do not match."""
    if element.startswith(("hex", "tet", "wedge")):
        lower = fc.generate.renamed(fc.generate.box((2.0, 1.0, 1.0), (4, 3, 2), element, name="LOWER"), NAMES)
        upper = fc.generate.box((2.0, 1.0, 1.0), (3, 2, 2), element, (0.0, 0.0, 1.0 + gap), name="UPPER")
        return fc.generate.union(lower, fc.generate.renamed(upper, {k: f"{v}2" for k, v in NAMES.items()}))
    lower = fc.generate.block((2.0, 1.0), (6, 3), element, name="LOWER")
    upper = fc.generate.block((2.0, 1.0), (4, 2), element, (0.0, 1.0 + gap), name="UPPER")
    sides = ("BOTTOM", "TOP", "LEFT", "RIGHT")
    names = [*sides, *(f"{a}_{b}" for a in sides[:2] for b in sides[2:])]
    return fc.generate.union(lower, fc.generate.renamed(upper, {name: f"{name}2" for name in names}))


def tied(mesh, kinematics, formulation, options, sides=("BOTTOM2", "TOP")):
    model = elastic_model(mesh, kinematics)
    return with_contact(model, "tie", sides[0], sides[1], kind="tied", formulation=formulation, **options)


def cases(elements):
    for element in elements:
        for formulation, options in EVERY:
            if formulation != "node_to_segment" or element not in ("hex20", "quad8", "tri6"):
                yield pytest.param(
                    element, formulation, options, id="-".join([element, formulation, *options.values()])
                )


# Across gaps longer than facets multigrid may hand over to factors, which a warning tells.
@pytest.mark.parametrize(
    ("solver", "gap"), [("direct", 0.0), ("direct", 0.01), ("direct", 0.5), ("amg", 0.01), ("amg", 0.2)]
)
@pytest.mark.parametrize("sides", [("BOTTOM2", "TOP"), ("TOP", "BOTTOM2")])
@pytest.mark.parametrize(
    ("element", "formulation", "options"), [*cases(["quad4", "quad8", "tri6", "hex8", "tet4", "wedge6"])]
)
def test_the_tied_body_follows_a_rotation_without_stress(element, formulation, options, gap, sides, solver):
    mesh = apart(element, gap)
    model = tied(mesh, "plane_stress" if mesh.dim == 2 else "3d", formulation, options, sides)
    turn = TURN[: mesh.dim, : mesh.dim]
    for k, axis in enumerate("xyz"[: mesh.dim]):
        model.prescribe("BOTTOM", **{axis: lambda points, k=k: points @ turn[k]})
    step = fc.solve(model, fc.linear_ramp(1), linear_solver=solver)[-1]
    accuracy = 1e-12 if solver == "direct" else 3e-12  # the linear tolerance is 1e-10, of displacements of 1e-3
    np.testing.assert_allclose(step.displacement, mesh.points @ turn.T, atol=accuracy)
    assert np.abs(step.stress).max() < 1e-8


@pytest.mark.parametrize(("element", "formulation", "options"), [*cases(["quad4", "quad8", "hex8"])])
@pytest.mark.parametrize("gap", [0.0, 0.5])
def test_shear_across_the_gap_keeps_its_moment(element, formulation, options, gap):
    """Reactions balance force and moment of a load on the upper block about any place; contact forces balance it as well."""
    mesh = apart(element, gap)
    model = tied(mesh, "plane_stress" if mesh.dim == 2 else "3d", formulation, options)
    model.fix("BOTTOM", "xyz"[: mesh.dim])
    model.add_traction("TOP2", x=2.0, **({} if mesh.dim == 2 else {"y": -1.0}))
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    arms, load, reaction, contact = np.zeros((4, mesh.n_points, 3))
    arms[:, : mesh.dim] = mesh.points
    load[:, : mesh.dim], reaction[:, : mesh.dim] = model.load_vector(model.loads[0]), step.reaction
    found = step.contact["tie"]
    np.add.at(contact[:, : mesh.dim], found.points, found.force_vectors)
    both = contact.copy()
    np.add.at(both[:, : mesh.dim], found.primary_points, found.primary_force_vectors)
    moment = np.cross(arms, load).sum(axis=0)
    np.testing.assert_allclose(np.cross(arms, reaction).sum(axis=0), -moment, atol=1e-9)
    np.testing.assert_allclose(np.cross(arms, contact).sum(axis=0), -moment, atol=1e-9)  # on the upper block
    np.testing.assert_allclose(np.cross(arms, both).sum(axis=0), 0.0, atol=1e-9)


@pytest.mark.parametrize("formulation", ["continuous", "mortar"])
def test_rings_with_a_seam_turn_as_one(formulation):
    """Two rings on their circles, a seam of glue between them, turned about their middle."""
    mesh = fc.generate.rings("quad8", divisions_inner=(3, 12), divisions_outer=(3, 9))
    inner = np.zeros(mesh.n_points, bool)
    inner[mesh.points_of("INNER")] = True
    points = mesh.points * np.where(inner, 0.99, 1.0)[:, None]
    mesh = fc.Mesh(points, mesh.cells, mesh.cell_groups, mesh.point_groups)
    model = tied(mesh, "plane_strain", formulation, {}, ("CONT_INNER", "CONT_OUTER"))
    model.prescribe("RIM", x=lambda x: -1e-4 * x[:, 1], y=lambda x: 1e-4 * x[:, 0])
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    np.testing.assert_allclose(step.displacement, 1e-4 * mesh.points[:, ::-1] * [-1.0, 1.0], atol=1e-11)
    assert np.abs(step.stress).max() < 1e-8


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
def test_in_axisymmetry_the_tied_body_follows_along_the_axis(formulation):
    model = tied(apart("quad4", 0.2), "axisymmetric", formulation, {})
    model.prescribe("BOTTOM", y=1e-3)
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    np.testing.assert_allclose(step.displacement[:, 1], 1e-3, rtol=1e-9)
    assert np.abs(step.stress).max() < 1e-9
