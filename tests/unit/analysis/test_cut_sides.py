"""A side divided into several node-to-segment pairs: results do not depend on the division, with friction and penalties."""

import numpy as np
import pytest
from mechanics import contact_forces
from models import elastic_model, supported, united
from pairwise import first_of

import fastcontact as fc

pytestmark = [pytest.mark.each_value, pytest.mark.filterwarnings("ignore:.*raise its penalty")]
CUTS = {1: (-9.0, 9.0), 2: (-9.0, 0.6, 9.0), 3: (-9.0, 0.4, 0.8, 9.0)}
PENALTIES = {"none": {}, "normal": {"penalty": 1e5}, "tangential": {"tangential_penalty": 1e5}}
PENALTIES["both"] = PENALTIES["normal"] | PENALTIES["tangential"]
# Of the largest nodal force: slips count along the mean of normals, which each pair takes of its own facets.
SAME = 5e-6


def pressed(kinematics, element, pieces, options, curvature=0.0):
    """A block on a longer one, pushed along it; its lower side belongs to so many contacts, with these `options` of each."""
    if kinematics == "3d":
        lower = fc.generate.box((1.6, 1.2, 0.5), (5, 3, 2), element, (-0.2, -0.1, -0.5), name="LOWER")
        upper = fc.generate.box((1.2, 1.0, 0.5), (6, 3, 2), element, name="UPPER")
        bottom, primary, secondary, top = "LOWER_ZMIN", "LOWER_ZMAX", "UPPER_ZMIN", "UPPER_ZMAX"
    else:
        start = 0.0 if kinematics == "axisymmetric" else -0.2
        lower = fc.generate.block((1.4 - start, 0.5), (5, 2), element, (start, -0.5), name="LOWER")
        upper = fc.generate.block((1.2, 0.5), (6, 2), element, name="UPPER")
        bottom, primary, secondary, top = "LOWER_BOTTOM", "LOWER_TOP", "UPPER_BOTTOM", "UPPER_TOP"
    points = np.array(upper.points)
    points[:, -1] += curvature * (points[:, :-1] ** 2).sum(axis=1)
    mesh = united(LOWER_=lower, UPPER_=upper.replace(points=points))
    middle = np.concatenate([mesh.points[cells][:, :, 0].mean(axis=1) for cells in mesh.cells.values()])
    groups, side = dict(mesh.cell_groups), mesh.cell_groups[secondary]
    for i, (begin, end) in enumerate(zip(CUTS[pieces][:-1], CUTS[pieces][1:], strict=True)):
        groups[f"PIECE{i}"] = side[(middle[side] > begin) & (middle[side] < end)]
    model = elastic_model(mesh.replace(cell_groups=groups), kinematics, **{bottom: "xyz"[: mesh.dim]})
    along = {"3d": {"x": 0.004, "y": 0.001}, "plane_strain": {"x": 0.004}, "axisymmetric": {}}[kinematics]
    model.prescribe(top, **along, **{"xyz"[mesh.dim - 1]: -0.01})
    if kinematics == "axisymmetric":
        supported(model, LOWER_LEFT="x", UPPER_LEFT="x")
    for i in range(pieces):
        own = options[i] if isinstance(options, list) else options
        model.add_contact(f"pair{i}", secondary=f"PIECE{i}", primary=primary, formulation="node_to_segment", **own)
    return model


def solved(*described, solver, **more):
    return fc.solve(pressed(*described, **more), fc.linear_ramp(2), linear_solver=solver)[-1]


def parts(contact, nodes):
    """Return normal (n,) and tangential forces (n, dim) of a pair on nodes (n,)."""
    rows = np.searchsorted(np.sort(contact.points), nodes)
    rows = np.argsort(contact.points)[rows]
    normal = np.einsum("nd,nd->n", contact.force_vectors[rows], contact.normal[rows])
    return normal, contact.force_vectors[rows] - normal[:, None] * contact.normal[rows]


def check_same(one, cut):
    expected = contact_forces(one)
    assert np.abs(contact_forces(cut) - expected).max() <= SAME * np.abs(expected).max()
    assert np.abs(cut.displacement - one.displacement).max() <= SAME * np.abs(one.displacement).max()
    whole = one.contact["pair0"]
    order, largest = np.argsort(whole.points), np.abs(whole.pressure).max()
    for contact in cut.contact.values():
        rows = order[np.searchsorted(whole.points[order], contact.points)]
        assert np.abs(contact.pressure - whole.pressure[rows]).max() <= SAME * largest
        assert np.abs(contact.shear - whole.shear[rows]).max() <= SAME * largest
        assert (contact.active == whole.active[rows]).all()
        assert (contact.sticking == whole.sticking[rows]).all()
    assert cut.iterations["active_set_iterations"] <= one.iterations["active_set_iterations"] + 2


SLOW = pytest.mark.slow


@pytest.mark.parametrize("solver", first_of(1, ["direct", "amg"]))
@pytest.mark.parametrize(
    "penalty", ["none", *(pytest.param(one, marks=SLOW) for one in ("normal", "tangential")), "both"]
)
@pytest.mark.parametrize(("friction", "pieces"), [(0.0, 2), (0.2, 3), (0.5, 2)])
@pytest.mark.parametrize(
    ("kinematics", "element"), [("plane_strain", "quad4"), ("axisymmetric", "tri3"), ("3d", "hex8"), ("3d", "tet4")]
)
def test_a_side_cut_in_several_is_what_it_is_whole(kinematics, element, friction, pieces, penalty, solver):
    options = {"friction": friction} | PENALTIES[penalty]
    one, several = (solved(kinematics, element, n, options, solver=solver) for n in (1, pieces))
    assert one.contact["pair0"].active.any()
    assert np.abs(one.contact["pair0"].shear).any() == bool(friction)
    check_same(one, several)


@pytest.mark.parametrize("solver", ["direct", "amg"])
@pytest.mark.parametrize(("kinematics", "element"), [("plane_strain", "tri3"), ("3d", "hex8")])
def test_a_round_side_too(kinematics, element, solver):
    one, three = (solved(kinematics, element, n, {"friction": 0.3}, curvature=0.004, solver=solver) for n in (1, 3))
    check_same(one, three)


@pytest.mark.parametrize("solver", ["direct", "amg"])
@pytest.mark.parametrize(
    ("left", "right"),
    [
        ({"friction": 0.1}, {"friction": 0.4}), ({"friction": 0.3}, {}), ({}, {"friction": 0.3}),
        ({"friction": 0.3, "penalty": 1e5}, {"friction": 0.1, "penalty": 4e5}),
        ({"friction": 0.3, "penalty": 1e5}, {"friction": 0.2}),
    ],
)  # fmt: skip
def test_pairs_of_different_friction_keep_to_their_cones(left, right, solver):
    """What both carry at their common nodes obeys the law of each, pressures are the same, penalties as stiff as given."""
    step = solved("3d", "hex8", 2, [left, right], solver=solver)
    ours, theirs = step.contact.values()
    common, mine, yours = np.intersect1d(ours.points, theirs.points, return_indices=True)
    assert len(common) == 4
    assert ours.active[mine].all()
    assert (theirs.active[yours] == ours.active[mine]).all()
    for contact, options in ((ours, left), (theirs, right)):
        normal, tangential = parts(contact, common)
        rubbing, limit = np.linalg.norm(tangential, axis=1), options.get("friction", 0.0) * np.abs(normal)
        assert (rubbing <= limit + 1e-7 * np.abs(step.contact["pair0"].force).max()).all()
    given = left.get("penalty"), right.get("penalty")
    if given == (None, None):
        assert theirs.pressure[yours] == pytest.approx(ours.pressure[mine], rel=1e-6)
    elif None not in given:
        assert theirs.pressure[yours] == pytest.approx(4.0 * ours.pressure[mine], rel=1e-6)
        assert ours.pressure[mine] == pytest.approx(-given[0] * ours.gap[mine], rel=1e-6)
    else:  # what does not give way carries all
        assert np.abs(ours.pressure[mine]).max() <= 1e-6 * theirs.pressure[yours].max()
