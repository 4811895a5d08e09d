"""Mortar contact with standard and dual multipliers: patch tests, partial cover, the training case."""

import numpy as np
import pytest
from models import elastic_model, supported, united, with_contact
from two_bodies import blocks, held, touching

import fastcontact as fc
from fastcontact.contact.configuration import Configuration
from fastcontact.mesh import elements
from fastcontact.mesh.generate import block, box

pytestmark = pytest.mark.pairwise

ELEMENTS = ("tri3", "tri6", "quad4", "quad8", "quad9")


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_the_other_formulations_do_not(formulation):
    """What the mortar formulation is for: the others miss the uniform stress by several per cent."""
    model = touching(held(blocks(upper=(4, 3))), formulation, swap=True)
    last = fc.solve(model, 1)[-1]
    expected = -1000.0 / (1 - 0.3**2) * 0.02 / np.ptp(model.mesh.points[:, 1])
    assert np.abs(last.stress[:, 1] / expected - 1).max() > 0.02


def assert_uniform(model, others):
    """Assert that the stress is that of the pressure alone, `others` its components that are zero."""
    last = fc.solve(model, 2)[-1]
    modulus = 1000.0 / (1 - 0.3**2) if model.kinematics == "plane_strain" else 1000.0
    expected = -modulus * 0.02 / np.ptp(model.mesh.points[:, 1])
    assert np.abs(last.stress[:, 1] - expected).max() < 1e-10 * abs(expected)
    assert np.abs(last.stress[:, others]).max() < 1e-10 * abs(expected)
    assert last.contact["pair"].pressure == pytest.approx(-expected, rel=1e-10)


@pytest.mark.each_value
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress", "axisymmetric"])
@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
@pytest.mark.parametrize("element", ELEMENTS)
def test_matching_meshes_transmit_a_uniform_pressure_exactly(element, formulation, kinematics, swap):
    model = touching(held(blocks(element), kinematics), formulation, swap)
    assert_uniform(model, [0, 3] if kinematics == "plane_strain" else [0, 2, 3])


def test_without_contact_bodies_move_rigidly_and_their_overlap_is_told(forma04):
    model = forma04(fc.generate.half_spheres("tri3", size=4.0), contact=False)
    with pytest.warns(fc.FastcontactWarning, match=r"interpenetrate by 3.99\d* near .*no contact is defined"):
        steps = fc.solve(model)
    assert len(steps) == 20
    assert np.abs(steps[-1].stress).max() < 1e-10 * 20_000.0
    assert np.abs(steps[-1].reaction).max() < 1e-12 * 586_080.0  # of the force that Hertz gives


E, NU = 1000.0, 0.3
FLAT = [(e, e) for e in ("tri3", "tri6", "quad4", "quad8", "quad9")]
FLAT += [("quad4", "quad8"), ("tri6", "quad4"), ("quad8", "tri3"), ("tri6", "quad9")]
SOLID = [(e, e) for e in ("tet4", "tet10", "hex8", "hex20", "hex27", "wedge6", "wedge15")]
SOLID += [("hex8", "tet4"), ("hex20", "tet10"), ("tet10", "hex8"), ("hex27", "tet10"), ("hex8", "hex20")]


def two_squares(lower, upper):
    low, up = block((1.0, 0.5), (3, 2), lower, (0.0, -0.5), name="BODY"), block((1.0, 0.5), (4, 3), upper, name="BODY")
    return united(L_=low, U_=up)


def two_boxes(lower, upper, divisions=((2, 3, 2), (3, 2, 2))):
    low = box((1.0, 1.0, 0.5), divisions[0], lower, (0.0, 0.0, -0.5))
    return united(L_=low, U_=box((1.0, 1.0, 0.5), divisions[1], upper))


def two_of(kinds):
    """Return whether kinds of cells are plane, and two bodies of them."""
    flat = elements.get(kinds[0]).dim == 2
    return flat, (two_squares if flat else two_boxes)(*kinds)


def pair_of(mesh, kinematics, swap, **options):
    model = elastic_model(mesh, kinematics, E=E, nu=NU)
    sides = ("U_BOTTOM", "L_TOP") if mesh.dim == 2 else ("U_ZMIN", "L_ZMAX")
    secondary, primary = sides if swap else sides[::-1]
    options = {"multipliers": "dual"} | options
    return with_contact(model, "pair", secondary, primary, formulation="mortar", **options)


def pressed(mesh, kinematics="3d", swap=False, **options):
    model = pair_of(mesh, kinematics, swap, **options)
    lateral = [("LEFT", "x")] if mesh.dim == 2 else [("XMIN", "x"), ("YMIN", "y")]
    for side in "LU":
        for group, axis in lateral:
            model.fix(f"{side}_{group}", axis)
    bottom, top, up = ("L_BOTTOM", "U_TOP", "y") if mesh.dim == 2 else ("L_ZMIN", "U_ZMAX", "z")
    return supported(model, **{bottom: up, top: {up: -0.01}})


def is_uniform(last, expected, axis):
    """Stress minus `expected` along an axis, nothing else in the components given."""
    assert np.abs(last.stress[:, axis] + expected).max() < 1e-10 * expected
    shear = [3] if last.displacement.shape[1] == 2 else [0, 1, 3, 4, 5]
    assert np.abs(last.stress[:, shear]).max() < 1e-10 * expected
    contact = last.contact["pair"]
    assert contact.active.all()
    assert contact.pressure == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("multipliers", ["dual", "standard"])
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress", "axisymmetric"])
@pytest.mark.parametrize("kinds", FLAT, ids="-".join)
def test_a_uniform_pressure_passes_exactly_between_lines(kinds, kinematics, swap, friction, multipliers):
    model = pressed(two_squares(*kinds), kinematics, swap, friction=friction, multipliers=multipliers)
    is_uniform(fc.solve(model, 1)[-1], (E / (1 - NU**2) if kinematics == "plane_strain" else E) * 0.01, 1)


@pytest.mark.parametrize("multipliers", ["dual", "standard"])
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("kinds", SOLID, ids="-".join)
def test_a_uniform_pressure_passes_exactly_between_faces(kinds, swap, friction, multipliers):
    model = pressed(two_boxes(*kinds), swap=swap, friction=friction, multipliers=multipliers)
    is_uniform(fc.solve(model, 1)[-1], E * 0.01, 2)


def sheared(mesh, kinematics, swap, gradient, **options):
    """Outer sides moved by a linear field, which both bodies follow as long as the interface sticks."""
    model = pair_of(mesh, kinematics, swap, **options)
    outer = ("BOTTOM", "LEFT", "RIGHT", "TOP") if mesh.dim == 2 else ("XMIN", "XMAX", "YMIN", "YMAX", "ZMIN", "ZMAX")
    inner = {"L_TOP", "U_BOTTOM", "L_ZMAX", "U_ZMIN"}
    for side in "LU":
        for group in outer:
            if f"{side}_{group}" not in inner:
                fields = {"xyz"[d]: lambda X, d=d: X @ gradient[d] for d in range(mesh.dim)}
                model.prescribe(f"{side}_{group}", **fields)
    return model


@pytest.mark.filterwarnings("ignore:contact .* supports hold .* of the .* facets")
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("kinds", [*FLAT, ("hex8", "hex8"), ("tet10", "hex20"), ("hex27", "tet4")], ids="-".join)
def test_a_uniform_shear_passes_exactly_where_friction_sticks(kinds, swap):
    flat, mesh = two_of(kinds)
    gradient = np.array([[0.0, 2e-3], [0.0, -1e-2]])
    if not flat:
        gradient = np.array([[0.0, 0.0, 1e-3], [0.0, 0.0, -2e-3], [0.0, 0.0, -1e-2]])
    last = fc.solve(sheared(mesh, "plane_strain" if flat else "3d", swap, gradient, friction=0.3), 1)[-1]
    strain = 0.5 * (gradient + gradient.T)
    lame, shear = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
    stress = lame * np.trace(strain) * np.eye(mesh.dim) + 2 * shear * strain
    expected = [stress[0, 0], stress[1, 1], lame * np.trace(strain), stress[0, 1]]
    if not flat:
        expected = [stress[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))]
    size = np.abs(stress).max()
    assert np.abs(last.stress[:, : len(expected)] - expected).max() < 1e-10 * size
    contact = last.contact["pair"]
    inner = contact.active & (np.abs(contact.coordinates[:, :-1] - 0.5) < 0.49).all(axis=1)
    assert contact.sticking[inner].all()
    assert contact.pressure[inner] == pytest.approx(-stress[-1, -1], rel=1e-9)
    carried = np.linalg.norm(contact.shear[inner], axis=1)  # beside the prescribed sides some leave it to others
    own = carried > 1e-9 * size
    assert carried[own] == pytest.approx(np.linalg.norm(stress[-1, :-1]), rel=1e-9)
    assert own.sum() > len(own) / 2


@pytest.mark.parametrize("kinds", [("hex8", "hex8"), ("tet10", "hex20")], ids="-".join)
def test_a_block_on_a_plane_of_symmetry_slides_at_the_limit(kinds):
    """Nodes in the plane have friction along it, and none across."""
    model = elastic_model(two_boxes(*kinds), E=E, nu=0.0, L_ZMIN="xyz", L_YMIN="y", U_YMIN="y", U_ZMAX="y")
    model.prescribe("U_ZMAX", x=1e-3, z=-1e-4)
    with_contact(model, "pair", "U_ZMIN", "L_ZMAX", formulation="mortar", multipliers="dual", friction=0.3)
    contact = fc.solve(model, 3)[-1].contact["pair"]
    assert not contact.sticking.any()
    assert np.abs(contact.force[0] / contact.force[2]) == pytest.approx(0.3, rel=1e-3)
    assert np.abs(contact.force[1]) < 1e-4 * contact.force[2]
    in_plane = contact.active & (contact.coordinates[:, 1] == 0.0)
    assert in_plane.any()
    # The surface leans by 1e-4, and so do what is told as pressure and as shear.
    assert np.abs(contact.shear[in_plane, 0]) == pytest.approx(0.3 * contact.pressure[in_plane], rel=1e-3)
    assert np.abs(contact.shear[in_plane, 1]).max() < 1e-4 * contact.pressure_max


@pytest.mark.parametrize("element", ["quad4", "quad8"])
def test_mirrored_bodies_meet_with_next_to_no_shear(element, forma04):
    """By symmetry there is none; what is left comes from the mesh, and friction changes the force by less than it."""
    mesh = fc.generate.half_spheres(element, arc_sizes=(0.8, 6.0), radial_sizes=(0.8, 6.0))
    forces = []
    for friction in (0.0, 0.3):
        contact = fc.solve(forma04(mesh, "mortar", multipliers="dual", friction=friction), 1)[-1].contact["hertz"]
        forces.append(np.linalg.norm(contact.force))
    assert contact.sticking[contact.active].all()
    assert np.abs(contact.shear).max() < 0.03 * contact.pressure_max
    assert forces[1] == pytest.approx(forces[0], rel=1e-3)


def bound(mesh, swap=False, **options):
    model = pressed(mesh, "plane_strain" if mesh.dim == 2 else "3d", swap, **options)
    return model.bind(model.contact[0])


@pytest.mark.parametrize("shift", [0.3, 0.3333, 0.999, 1e-3, 2e-5])
@pytest.mark.parametrize("kinds", [*FLAT[:5], *SOLID[:5], ("hex20", "tet10")], ids="-".join)
def test_partly_covered_facets_carry_all_the_pressure_there_is(kinds, shift):
    """The weights add up to the common area, and a motion apart opens every gap by as much."""
    flat, mesh = two_of(kinds)
    upper = mesh.points_of("U_BODY" if flat else "U_BOX")
    points = mesh.points.copy()
    points[upper, 0] += shift
    part = bound(mesh.replace(points=points)).constraints(Configuration.undeformed(points))
    weight = part.areas
    weight = weight[np.isfinite(weight)]
    assert weight.min() > 0.0
    assert weight.sum() == pytest.approx(1.0 - shift, abs=1e-6)  # less than a thousandth of a facet may be left out
    apart = np.zeros_like(points)
    apart[upper, -1] = 0.25
    usable = np.diff(part.B.indptr) > 0
    assert (part.gap0 + part.B @ apart.ravel())[usable] == pytest.approx(0.25, abs=1e-9)
    assert np.abs(part.B @ np.tile(np.arange(1.0, mesh.dim + 1), len(points))).max() < 1e-9


@pytest.mark.parametrize("kinds", [*FLAT, *SOLID], ids="-".join)
def test_gaps_are_eliminated_one_by_one(kinds):
    """Each involves one secondary node that none before it does, with the largest entry on that side."""
    mesh = two_of(kinds)[1]
    pair = bound(mesh)
    part = pair.constraints(Configuration.undeformed(mesh.points))
    own = part.B[:, pair.secondary.points.astype(np.intp) * mesh.dim + mesh.dim - 1].toarray()
    order = np.argsort((np.abs(own) > 0).sum(axis=1), kind="stable")  # corners, mid nodes, centres
    own = own[np.ix_(order, order)]
    assert np.abs(np.triu(own, 1)).max() == 0.0
    assert np.abs(np.diag(own)).min() >= 1.0 - 1e-12
    assert (np.abs(np.diag(own)) >= np.abs(own).max(axis=1)).all()


@pytest.mark.parametrize("normals", ["facet", "averaged"])
@pytest.mark.parametrize("kinds", [("tri6", "quad4"), ("hex8", "tet10")], ids="-".join)
def test_normals_of_flat_sides_are_theirs_however_taken(kinds, normals):
    flat, mesh = two_of(kinds)
    turn = (
        np.array([[0.8, -0.6], [0.6, 0.8]]) if flat else np.array([[0.8, 0.0, -0.6], [0.0, 1.0, 0.0], [0.6, 0.0, 0.8]])
    )
    pair = bound(mesh.replace(points=mesh.points @ turn.T), normals=normals)
    apart = np.zeros_like(mesh.points)
    apart[mesh.points_of("U_BODY" if flat else "U_BOX")] = 0.1 * turn[:, -1]
    part = pair.constraints(Configuration.undeformed(mesh.points))
    assert part.gap0 + part.B @ apart.ravel() == pytest.approx(0.1, abs=1e-13)


def test_sides_that_face_each_other_nowhere_have_no_gaps():
    mesh = two_boxes("hex8", "tet4")
    points = mesh.points.copy()
    points[mesh.points_of("U_BOX")] += np.array([2.5, 0.0, 0.3])
    part = bound(mesh).constraints(Configuration.displaced(points - mesh.points))
    assert part.B.nnz == 0
    assert np.isfinite(part.gap0).all()


def test_a_linear_gap_is_measured_at_the_nodes():
    """Gaps of linear facets are the nodal values of the best linear field, so of a linear gap its own."""
    mesh = two_boxes("hex8", "tet4")
    pair = bound(mesh, swap=True)
    tilt = np.zeros_like(mesh.points)
    upper = mesh.points_of("U_BOX")
    tilt[upper, 2] = mesh.points[upper] @ np.array([0.01, -0.02, 0.0]) + 0.1
    part = pair.constraints(Configuration.undeformed(mesh.points))
    X = part.positions
    assert part.gap0 + part.B @ tilt.ravel() == pytest.approx(X @ np.array([0.01, -0.02, 0.0]) + 0.1, abs=1e-13)


@pytest.mark.parametrize(
    ("letter", "multipliers", "force", "pressure"),
    [
        ("a", "dual", 1e-2, 0.04), ("b", "dual", 3e-3, 6e-3), ("c", "dual", 1e-3, 2e-3),
        ("a", "standard", 5e-3, 0.03), ("b", "standard", 5e-4, 0.01), ("c", "standard", 1e-3, 0.005),
    ],
)  # fmt: skip
def test_the_training_case(letter, multipliers, force, pressure, cases, forma04):
    """On quadratic facets too, the pressure falls from node to node all the way out, but for the one on the axis."""
    model = forma04(fc.read_mesh(cases / f"forma04{letter}.med"), "mortar", multipliers=multipliers)
    contact = fc.solve(model, 1)[-1].contact["hertz"]
    assert np.linalg.norm(contact.force) == pytest.approx(659_773.142, rel=force)
    assert contact.pressure_max == pytest.approx(2910.4071, rel=pressure)
    outward = contact.pressure[np.argsort(contact.coordinates[:, 0])][: contact.active.sum()]
    if multipliers == "dual":
        assert (np.diff(outward[1:]) < 0).all()
        assert outward[0] == pytest.approx(outward[1], rel=0.02)


def test_the_force_converges_to_that_of_the_finite_bodies(forma04):
    mesh = fc.generate.half_spheres("quad8", arc_sizes=(0.3, 2.4), radial_sizes=(0.3, 6.0))
    contact = fc.solve(forma04(mesh, "mortar", multipliers="dual"), 1)[-1].contact["hertz"]
    assert np.linalg.norm(contact.force) == pytest.approx(659_773.142, rel=2e-4)
    assert contact.pressure_max == pytest.approx(2910.4071, rel=1e-4)
