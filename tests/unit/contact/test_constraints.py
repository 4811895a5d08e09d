"""Rows of constraints: compared with explicit sums, stacked over pairs, directions in which nodes are held."""

import numpy as np
import pytest
from models import DenseCompliance
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

import fastcontact as fc
from fastcontact.contact.constraints import Constraints, stacked
from fastcontact.contact.held_motions import deflate, direction_fields, eigenspaces
from fastcontact.contact.pairing import Candidates, Pairing, gap_rows, relative_motion
from fastcontact.contact.projection import facet_points
from fastcontact.contact.surface import surface
from fastcontact.linear.sparse_rows import rows_of
from fastcontact.mesh import elements
from fastcontact.model.rigid_motions import cone_rows

N_DOFS = 7


def part(m, seed, compliance=False, tangents=0, **given):
    random = np.random.default_rng(seed)
    G = random.normal(size=(m, m))
    return Constraints(
        csr_array(random.normal(size=(m, N_DOFS))), random.normal(size=m), random.normal(size=(m, 3)),
        DenseCompliance(G @ G.T) if compliance else None,
        tuple(csr_array(random.normal(size=(m, N_DOFS))) for _ in range(tangents)),
        tuple(random.normal(size=(m, 3)) for _ in range(tangents)), **given,
    )  # fmt: skip


@pytest.fixture
def parts():
    random = np.random.default_rng(9)
    return [
        part(2, 1, equality=np.array([True, False])),
        part(3, 2, True, 2, friction=np.full(3, 0.3), low_rank_compliance=random.normal(size=(3, 3, 2))),
        part(4, 3, softness=np.full((1, 4), 0.1)),
        part(2, 4, True, 2, slip0=random.normal(size=(2, 2)), low_rank_compliance=random.normal(size=(3, 2, 1))),
    ]


def stack(parts):
    return stacked({f"pair {k}": each for k, each in enumerate(parts)})


def test_one_part_stays_what_it_is(parts):
    whole = stack(parts[:1])
    assert whole.B is parts[0].B
    assert whole.rows == {"pair 0": slice(0, 2)}


def test_rows_and_numbers_follow_each_other(parts):
    whole = stack(parts)
    np.testing.assert_array_equal(whole.B.toarray(), np.vstack([p.B.toarray() for p in parts]))
    np.testing.assert_array_equal(whole.gap0, np.concatenate([p.gap0 for p in parts]))
    assert whole.friction.tolist() == [0.0] * 2 + [0.3] * 3 + [0.0] * 6
    assert whole.equality.tolist() == [True] + [False] * 10
    assert whole.softness.tolist() == [[0.0] * 5 + [0.1] * 4 + [0.0] * 2] + [[0.0] * 11] * 2
    np.testing.assert_array_equal(whole.slip0[:, 9:], parts[3].slip0)
    assert not whole.slip0[:, :9].any()
    for k in range(2):
        rows = whole.tangents[k].toarray()
        np.testing.assert_array_equal(rows[2:5], parts[1].tangents[k].toarray())
        np.testing.assert_array_equal(rows[9:], parts[3].tangents[k].toarray())
        assert not rows[:2].any()
        assert not rows[5:9].any()
        np.testing.assert_array_equal(whole.directions[k][2:5], parts[1].directions[k])
        assert not whole.directions[k][5:9].any()


def test_what_no_part_has_the_whole_has_not():
    whole = stack([part(2, 1), part(3, 2)])
    assert whole.compliance is None
    assert whole.tangents == whole.directions == ()
    assert not whole.low_rank_compliance.size
    assert not np.concatenate([whole.slip0.ravel(), whole.equality, whole.friction, whole.softness.ravel()]).any()


def test_compliances_do_not_couple_parts(parts):
    whole = stack(parts)
    C = np.zeros((11, 11))
    C[2:5, 2:5], C[9:, 9:] = parts[1].compliance.C, parts[3].compliance.C
    rows = np.array([0, 2, 4, 5, 9, 10])
    np.testing.assert_array_equal(whole.compliance.block(rows), C[np.ix_(rows, rows)])
    multiplier = np.arange(11.0)
    np.testing.assert_allclose(whole.compliance.apply(multiplier), C @ multiplier, rtol=1e-14)
    soft = C + np.diag(whole.softness[0])
    np.testing.assert_array_equal(whole.normal_compliance(rows), soft[np.ix_(rows, rows)])
    np.testing.assert_allclose(whole.elastic_gaps(multiplier), soft @ multiplier, rtol=1e-14)


def test_factors_of_compliances_lie_side_by_side(parts):
    Z = stack(parts).low_rank_compliance
    assert Z.shape == (3, 11, 3)
    np.testing.assert_array_equal(Z[:, 2:5, :2], parts[1].low_rank_compliance)
    np.testing.assert_array_equal(Z[:, 9:, 2:], parts[3].low_rank_compliance)
    assert np.count_nonzero(Z) == parts[1].low_rank_compliance.size + parts[3].low_rank_compliance.size


@pytest.fixture(params=["quad4", "quad8"])
def sides(request):
    mesh = fc.generate.half_spheres(request.param, arc_sizes=(3.0, 6.0), radial_sizes=(3.0, 9.0), segments=3)
    return mesh, surface(mesh, "CONT1"), surface(mesh, "CONT2")


def test_only_the_first_and_the_last_end_of_an_open_line_meet_no_other(sides):
    _, side, _ = sides
    corners = side.only_block.facets[:, :2]
    outer = corners[~side.inner_ends]
    np.testing.assert_array_equal(np.sort(outer), np.flatnonzero(np.bincount(corners.ravel()) == 1))


def test_rows_are_sums_over_both_sides(sides):
    mesh, secondary, primary = sides
    rng = np.random.default_rng(2)
    n = len(secondary.points)
    nodes = Candidates(secondary.points[:, None], np.ones((n, 1)))
    facet, xi = rng.integers(0, primary.n_facets, n), rng.uniform(-1, 1, (n, 1))
    pairing = Pairing(facet, xi, rng.normal(size=(n, 2)), rng.random(n) < 0.7, primary=primary)
    direction, u = rng.normal(size=(n, 2)), rng.normal(size=mesh.points.shape)
    motion = relative_motion(nodes, pairing, len(u))
    found = rows_of(motion, direction)
    shape = elements.get(primary.only_block.element).shape(xi)
    theirs = np.einsum("nk,nkd->nd", shape, u[primary.only_block.facets[facet]])
    moved = np.einsum("nd,nd->n", direction, u[secondary.points] - theirs)
    np.testing.assert_allclose(found @ u.ravel(), np.where(pairing.paired, moved, 0.0), atol=1e-13)
    np.testing.assert_array_equal(np.diff(found.indptr) == 0, ~pairing.paired)
    assert found.has_canonical_format
    G, gap = gap_rows(motion, pairing, mesh.points)
    np.testing.assert_allclose(gap, G @ mesh.points.ravel())


def test_a_node_that_is_named_twice_counts_twice():
    mesh = fc.generate.half_spheres("quad4", arc_sizes=(3.0, 6.0), radial_sizes=(3.0, 9.0), segments=3)
    side = surface(mesh, "CONT1")
    nodes = Candidates(np.repeat(side.points[:1, None], 2, axis=1), np.array([[0.25, 0.5]]))
    pairing = Pairing(np.array([5]), np.zeros((1, 1)), np.ones((1, 2)), np.ones(1, bool), primary=side)
    found = rows_of(relative_motion(nodes, pairing, mesh.n_points), np.array([[1.0, 0.0]]))
    assert found[0, 2 * side.points[0]] == 0.75


def test_places_on_one_kind_of_facets_are_those_of_its_element(sides):
    _, side, _ = sides
    rng = np.random.default_rng(4)
    facet, xi = rng.integers(0, side.n_facets, 9), rng.uniform(-1, 1, (9, 1))
    at, element = facet_points(side, facet, xi), elements.get(side.only_block.element)
    np.testing.assert_array_equal(at.nodes, side.only_block.facets[facet])
    np.testing.assert_array_equal(side.points[at.local], at.nodes)
    np.testing.assert_array_equal(at.shape, element.shape(xi))
    np.testing.assert_array_equal(at.gradient, element.gradient(xi))


Q = Rotation.from_rotvec([0.4, 1.2, -0.5]).as_matrix()


def on(*directions):
    """The projector (3, 3) on some directions."""
    return eigenspaces(sum(np.outer(d, d) for d in np.array(directions, float))[None], 1e-6)[0]


def quadrant(n=5):
    """Nodes of a quarter of a disc: held along x where x = 0, along y where y = 0, along both on the axis."""
    places = np.array([[i, j, 0.0] for i in range(n) for j in range(n)])
    x, y, none = on([1, 0, 0]), on([0, 1, 0]), np.zeros((3, 3))
    held = [x * (p[0] == 0) + y * (p[1] == 0) if p[0] * p[1] == 0 else none for p in places]
    return np.array(held), places


def rim(n=24):
    """Nodes of a disc whose rim is held along its normals."""
    angle = 2 * np.pi * np.arange(n) / n
    normal = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(n)])
    places = np.concatenate([2 * normal, 1 * normal])
    return np.concatenate([[on(d) for d in normal], np.zeros((n, 3, 3))]), places


def cornered():
    """The same with the node on the axis held altogether."""
    held, places = quadrant()
    held[0] = np.eye(3)
    return held, places


def said(groups):
    """Directions that no sign and no order matters to: the sums of their projectors over groups, at the nodes held."""
    return sum(np.where(nodes[:, None, None], along[:, :, None] * along[:, None], 0.0) for along, nodes in groups)


@pytest.mark.parametrize("made", [quadrant, rim, cornered])
def test_turned_and_renumbered_nodes_are_held_alike(made):
    held, places = made()
    order = np.random.default_rng(3).permutation(len(places))
    groups = direction_fields(held, places)
    again = direction_fields((Q @ held @ Q.T)[order], (places @ Q.T)[order])
    assert len(groups) == len(again)
    assert (Q @ said(groups) @ Q.T)[order] == pytest.approx(said(again), abs=1e-12)
    assert eigenspaces(said(groups), 0.5) == pytest.approx(held, abs=1e-12)


def test_a_node_on_two_walls_belongs_to_both():
    held, places = quadrant()
    (first, at_first), (second, at_second) = direction_fields(held, places)
    assert abs(first[0] @ second[0]) < 1e-12
    assert np.flatnonzero(at_first & at_second).tolist() == [0]
    assert at_first.sum() == at_second.sum() == 5


def test_beside_a_rim_the_direction_is_that_of_the_rim_nearby():
    held, places = rim()
    ((along, nodes),) = direction_fields(held, places)
    assert nodes.sum() == 24
    radial = places / np.linalg.norm(places, axis=1, keepdims=True)
    outward = np.einsum("nd,nd->n", along, radial)
    assert outward * outward[0] == pytest.approx(1.0, abs=1e-9)


def test_what_nodes_move_apart_along_is_not_held():
    moved = np.array([[0.3, 0.3, 0.0], [0.0, 0.0, 0.0], [1e-12, 0.0, 0.0]])
    left = deflate(np.array([np.eye(3)] * 3), moved, 1e-9)
    assert left[0] == pytest.approx(on([1, -1, 0], [0, 0, 1]), abs=1e-12)
    assert left[1:] == pytest.approx(np.array([np.eye(3)] * 2), abs=1e-12)


def test_no_constraints_resist_no_motion():
    rows, gap0 = cone_rows(part(0, 0, tangents=2))
    assert rows.shape == (0, N_DOFS)
    assert not len(gap0)
