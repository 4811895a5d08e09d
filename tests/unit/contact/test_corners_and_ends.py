"""Beyond corners and ends of the primary side no node carries force, and moments balance."""

import numpy as np
import pytest
from models import elastic_model, supported, united

import fastcontact as fc
from fastcontact.contact.pairing import pair
from fastcontact.contact.projection import DeformedSide
from fastcontact.contact.surface import surface

WAYS = [
    {"formulation": "node_to_segment", "normals": "facet"}, {"formulation": "node_to_segment", "normals": "averaged"},
    {"formulation": "continuous"}, {"formulation": "mortar"}, {"formulation": "mortar", "multipliers": "dual"},
]  # fmt: skip
NAMES = ["facet", "averaged", "continuous", "standard", "dual"]


def punch(dim=2, shift=0.55, nu=0.0, element=None, cells=(10, 7)):
    """A punch on a block twice as wide, which its corners press into."""
    n, m = cells
    if dim == 2:
        low = fc.generate.block((2.0, 1.0), (n, n // 2), element or "quad4", (0.0, -1.0))
        up = fc.generate.block((1.0, 1.0), (m, m), element or "quad4", (shift, 0.0))
    else:
        low = fc.generate.box((2.0, 2.0, 1.0), (n, n, 2), element or "hex8", (0.0, 0.0, -1.0))
        up = fc.generate.box((1.0, 1.0, 1.0), (m, m, 2), element or "hex8", (shift, shift, 0.0))
        low, up = (fc.generate.renamed(mesh, {"ZMIN": "BOTTOM", "ZMAX": "TOP"}) for mesh in (low, up))
    mesh = united(L_=low, U_=up)
    if dim == 2:
        whole = np.concatenate([mesh.cell_groups[name] for name in ("U_BOTTOM", "U_LEFT", "U_RIGHT")])
        mesh = mesh.with_groups(cells={"U_WHOLE": whole})
    model = elastic_model(mesh, "plane_strain" if dim == 2 else "3d", nu=nu, L_BOTTOM="xyz"[:dim])
    return supported(model, U_TOP={**dict.fromkeys("xyz"[: dim - 1], 0.0), **{"xyz"[dim - 1]: -0.01}})


def pressed(model, secondary, primary, **options):
    model.add_contact("pair", secondary=secondary, primary=primary, **options)
    return fc.solve(model, fc.linear_ramp(1))[-1]


def moments(model, step):
    """Return the moments of the nodal forces on both sides about the origin."""
    at, nodal = model.mesh.points + step.displacement, model.internal_forces(step.displacement)
    sides = np.concatenate([model.mesh.points_of("L_TOP"), model.mesh.points_of("U_BOTTOM")])
    x, f = at[sides], nodal[sides]
    return np.array([x[:, a] @ f[:, b] - x[:, b] @ f[:, a] for a in range(x.shape[1]) for b in range(a)])


@pytest.mark.each_value
@pytest.mark.parametrize("way", [WAYS[0], WAYS[1], WAYS[4]], ids=[NAMES[0], NAMES[1], NAMES[4]])
@pytest.mark.parametrize("cells", [(8, 4), (8, 7)])
def test_flanks_beside_the_corner_of_a_punch_change_nothing(way, cells):
    """They stand at right angles to what the punch presses: the block rises beside it, and touches none of them."""
    found = [
        pressed(punch(nu=0.3, shift=0.5, cells=cells), "L_TOP", primary, **way).contact["pair"].force[1]
        for primary in ("U_BOTTOM", "U_WHOLE")
    ]
    assert found[1] == pytest.approx(found[0], rel=2e-3)


@pytest.mark.each_value
@pytest.mark.parametrize("way", WAYS, ids=NAMES)
@pytest.mark.parametrize("shift", [0.55, 0.53, 0.51])
@pytest.mark.filterwarnings("ignore:.*integration points of complete facets")
def test_forces_of_both_sides_balance_in_moment(way, shift):
    """The punch is primary; nodes of the block stand 0.35, 0.21 and 0.07 of its facets beyond its edge."""
    model = punch(shift=shift)
    step = pressed(model, "L_TOP", "U_BOTTOM", **way)
    contact = step.contact["pair"]
    # A mean gap need not point along the mean normal, so that dual multipliers balance but for what is of second order.
    within = 1e-6 if way.get("multipliers") == "dual" else 1e-8
    assert np.abs(moments(model, step)).max() < within * abs(contact.force[1])
    if way["formulation"] == "node_to_segment":
        beyond = (contact.coordinates[:, 0] < shift - 1e-9) | (contact.coordinates[:, 0] > 1.0 + shift + 1e-9)
        assert beyond.any()
        assert np.abs(contact.force_vectors[beyond]).max() == 0.0


@pytest.mark.parametrize("normals", ["facet", "averaged"])
@pytest.mark.parametrize("dim", [2, 3])
def test_who_wants_them_has_forces_beyond_the_edge_in_balance(dim, normals):
    model = punch(dim, shift=0.55, cells=(10, 7) if dim == 2 else (10, 3))
    options = {"formulation": "node_to_segment", "normals": normals, "projection_tolerance": 0.5}
    step = pressed(model, "L_TOP", "U_BOTTOM", **options)
    contact = step.contact["pair"]
    force = np.abs(contact.force[-1])
    beyond = (contact.coordinates[:, 0] < 0.55 - 1e-9) | (contact.coordinates[:, 0] > 1.55 + 1e-9)
    assert np.abs(contact.force_vectors[beyond]).max() > 1e-3 * force
    assert np.abs(moments(model, step)).max() < 1e-8 * force


def test_normals_are_averaged_on_what_is_smooth_and_kept_at_corners():
    model = punch(shift=0.5)
    side = surface(model.mesh, "U_WHOLE")
    normals = DeformedSide(side, model.mesh.points).smooth_normals
    middle = model.mesh.points[side.only_block.facets].mean(axis=1)
    expected = np.where(middle[:, 1:] < 1e-9, [0.0, -1.0], np.sign(middle[:, :1] - 1.0) * [1.0, 0.0])
    np.testing.assert_allclose(normals, np.repeat(expected[:, None], 2, axis=1), atol=1e-14)
    rings = fc.generate.rings("quad4", divisions_inner=(2, 8), divisions_outer=(2, 8))
    ring, points = surface(rings, "CONT_INNER"), rings.points
    normals = DeformedSide(ring, points).smooth_normals
    inner = ring.inner_ends
    outward = points[ring.only_block.facets] / np.linalg.norm(points[ring.only_block.facets], axis=2, keepdims=True)
    np.testing.assert_allclose(normals[inner], outward[inner], atol=1e-14)


def test_points_beside_a_corner_face_nothing():
    """On a line that folds gently inward a point beyond both facets at a node still faces it; beside a corner it does not."""
    mesh = punch(shift=0.5).mesh
    beside = np.array([[0.5 - 0.03, -0.01], [0.5 + 0.03, -0.01]])
    for normals in ("facet", "averaged"):
        found = pair(beside, DeformedSide(surface(mesh, "U_WHOLE"), mesh.points), 0.05, normals)
        assert found.paired.tolist() == [False, True]
