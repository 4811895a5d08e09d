"""Surfaces, their integration and their pairing in three dimensions."""

import numpy as np
import pytest
from refusals import refused
from scipy.spatial.transform import Rotation

import fastcontact as fc
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.formulations.continuous import Continuous
from fastcontact.contact.formulations.node_to_segment import NodeToSegment
from fastcontact.contact.integration import facet_measure, fine_rule, gauss_rule, mass_matrix, nodal_areas
from fastcontact.contact.pairing import Candidates, gap_rows, pair, relative_motion
from fastcontact.contact.projection import DeformedSide, facet_points, interpolate
from fastcontact.contact.surface import surface
from fastcontact.mesh import quadrature
from fastcontact.mesh.generate import box, merge_points, sphere_octant, union

SOLIDS = ("hex8", "hex20", "hex27", "tet4", "tet10")


def two_kinds(order=1):
    """A box of hexahedra and wedges: its group ZMAX has quadrangles and triangles."""
    left, right = ("hex8", "wedge6") if order == 1 else ("hex20", "wedge15")
    return merge_points(
        union(box((0.5, 1, 1), (2, 2, 2), left), box((0.5, 1, 1), (2, 2, 2), right, (0.5, 0, 0))), tolerance=1e-9
    )


@pytest.mark.parametrize("element", SOLIDS)
def test_areas_and_normals_of_a_sphere(element):
    mesh = sphere_octant(element, R=2.0, size=1.0, contact_size=0.2, contact_radius=0.4)
    side = surface(mesh, "CONT_SPHERE")
    facet = np.arange(side.n_facets)
    normals, quadratic = DeformedSide(side, mesh.points).nodal_normals, side.order == 2
    smooth = DeformedSide(side, mesh.points).smooth_normals
    outward = (mesh.points[side.points] - [0, 2, 0]) / 2.0
    assert np.abs(normals - outward).max() < (2e-2 if quadratic else 0.2)
    inner = np.linalg.norm(outward[:, [0, 2]], axis=1) < 0.5
    inner &= (mesh.points[side.points][:, [0, 2]] > 1e-9).all(axis=1)  # nodes with facets all around
    assert np.abs(normals - outward)[inner].max() < (5e-3 if quadratic else 3e-2)
    middle = np.tile([[0.25, 0.25]], (len(facet), 1))
    assert np.abs(np.linalg.norm(interpolate(smooth, facet_points(side, facet, middle)), axis=1) - 1).max() < 1e-14
    # Solid angle of the face of a cube seen from its centre, a quarter of it: 4 pi / 6 / 4 of the sphere.
    area = 4.0 * np.pi / 6.0
    tolerance = 1e-4 if quadratic else 2e-2
    assert nodal_areas(side, mesh.points, False).sum() == pytest.approx(area, rel=tolerance)
    xi, weights = fine_rule(side.only_block.element)
    block = side.only_block
    sizes = facet_measure(block.facets, block.element, mesh.points, xi, False) @ weights
    assert sizes.sum() == pytest.approx(area, rel=tolerance)


@pytest.mark.parametrize("order", [1, 2])
def test_a_surface_may_mix_triangles_and_quadrangles(order):
    mesh = two_kinds(order)
    side = surface(mesh, "ZMAX")
    assert {block.element for block in side.blocks} == ({"tri3", "quad4"} if order == 1 else {"tri6", "quad8"})
    assert side.n_facets == 4 + 8
    assert mass_matrix(side, mesh.points, False).sum() == pytest.approx(1.0, rel=1e-14)
    positions = np.random.default_rng(0).uniform([0.02, 0.02, 0.8], [0.98, 0.98, 1.8], (50, 3))
    for normals in ("facet", "averaged"):
        found = pair(positions, DeformedSide(side, mesh.points), 0.5, normals)
        candidates = Candidates(np.zeros((50, 1), np.int32), np.zeros((50, 1)))
        # Without the candidates' own nodes the rows give minus the height of the surface under them.
        B, gap = gap_rows(relative_motion(candidates, found, mesh.n_points), found, mesh.points)
        assert gap == pytest.approx(-1.0, abs=1e-14)
        assert B.sum(axis=1) == pytest.approx(-1.0, abs=1e-14)
        assert found.normal == pytest.approx(np.tile([0.0, 0, 1], (50, 1)), abs=1e-14)
        at = facet_points(side, found.facet, found.xi)
        foot = np.einsum("nk,nkd->nd", at.shape, mesh.points[at.nodes])
        assert foot[:, :2] == pytest.approx(positions[:, :2], abs=1e-12)
    with pytest.raises(fc.ContactError, match=r"'ZMAX' mixes facets of .*use 'continuous' or 'node_to_segment'"):
        _ = side.only_block.facets


def folded(n=6, depth=0.15):
    """A box with a rough top of flat facets: the closest point on it jumps over its valleys."""
    mesh = box((1.0, 1.0, 1.0), (n, n, 1), "tet4")
    points = mesh.points.copy()
    top = points[:, 2] > 0.99
    points[top, 2] += depth / n * np.sin(17.0 * np.arange(top.sum()))
    return mesh.replace(points=points)


def test_projection_along_averaged_normals_is_continuous():
    mesh = folded()
    side = surface(mesh, "ZMAX")
    start, end = np.array([0.11, 0.17, 1.04]), np.array([0.87, 0.79, 1.06])

    def feet(n, normals):
        path = start + np.linspace(0, 1, n + 1)[:, None] * (end - start)
        found = pair(path, DeformedSide(side, mesh.points), 0.5, normals)
        assert found.paired.all()
        at = facet_points(side, found.facet, found.xi)
        foot = np.einsum("nk,nkd->nd", at.shape, mesh.points[at.nodes])
        if normals == "averaged":  # the candidate stands exactly along the normal
            assert np.abs(np.cross(path - foot, found.normal)).max() < 1e-12
        return max(
            np.linalg.norm(np.diff(foot, axis=0), axis=1).max(),
            np.linalg.norm(np.diff(found.normal, axis=0), axis=1).max(),
        )

    coarse, fine = feet(500, "averaged"), feet(50_000, "averaged")
    assert fine < 0.02 * coarse
    assert feet(50_000, "facet") > 0.5 * feet(500, "facet")


def test_gap_rows_do_not_see_rigid_motions():
    mesh = folded()
    side = surface(mesh, "ZMAX")
    nodes = np.flatnonzero(mesh.points[:, 2] < 0.5)[:6].reshape(2, 3).astype(np.int32)
    candidates = Candidates(nodes, np.array([[0.2, 0.3, 0.5], [0.6, 0.3, 0.1]]))
    lifted = mesh.points.copy()
    lifted[nodes.ravel()] = np.random.default_rng(2).uniform([0.2, 0.2, 1.2], [0.8, 0.8, 1.4], (6, 3))
    found = pair(candidates.positions(lifted), DeformedSide(side, lifted), 0.5, "averaged")
    assert found.paired.all()
    B, gap = gap_rows(relative_motion(candidates, found, mesh.n_points), found, lifted)
    assert (gap > 0).all()
    shift = np.tile([0.3, -0.2, 0.7], len(mesh.points))
    assert np.abs(B @ shift).max() < 1e-14
    spin = np.cross([0.1, 0.4, -0.2], lifted).ravel()
    # A rotation moves the foot and the candidate alike, but across the arm between them, which stands along the normal.
    assert np.abs(B @ spin).max() < 1e-13


def bound(kind, element="hex8", group="CONT_SPHERE", primary="hex8", **options):
    mesh = sphere_octant(element, R=2.0, size=1.0, contact_size=0.5, contact_radius=0.5)
    both = union(mesh, box((2.0, 1.0, 2.0), (2, 1, 2), primary, (0.0, -1.0, 0.0)))
    return kind(surface(both, group), surface(both, "YMAX"), both.points, False, 1.0, **options)


@pytest.mark.parametrize("element", ["tet10", "hex20"])
def test_rules_that_make_no_sense_are_refused(element):
    message = r"node_to_segment cannot have facets of (tri6|quad8) .*'continuous' or 'mortar'"
    refused(fc.ContactError, f"{message}, or swap the sides$", bound, NodeToSegment, element)
    with pytest.raises(fc.ContactError, match=f"{message}$"):  # the other side is quadratic, too
        bound(NodeToSegment, element, primary=element)
    with pytest.raises(fc.ContactError, match=r"makes no sense on facets of (tri6|quad8): .*'gauss' or 'simpson'"):
        bound(Continuous, element, integration="node")
    refused(fc.ContactError, r"n_gauss = 2 .* undetermined: use at least 3", bound, Continuous, element, n_gauss=2)
    refused(fc.ContactError, r"n_gauss = 6 is too large for triangles", bound, Continuous, "tet4", n_gauss=6)


@pytest.mark.each_value
@pytest.mark.parametrize("options", [{}, {"integration": "simpson"}, {"n_gauss": 3}, {"n_gauss": 5}])
@pytest.mark.parametrize("element", SOLIDS)
def test_every_rule_determines_the_field_and_keeps_its_resultant(element, options):
    pair_ = bound(Continuous, element, **options)
    projection = pair_.constraints(Configuration.undeformed(pair_.points)).nodal.projection
    field = np.random.default_rng(3).normal(size=projection.P.shape[1])
    forces = projection.areas * (projection.P @ field)
    assert projection.field(forces) == pytest.approx(field, abs=1e-10)
    assert np.abs(projection.apply(forces)).max() < 1e-10
    assert projection.areas.sum() == pytest.approx(nodal_areas(pair_.secondary, pair_.points, False).sum(), rel=2e-3)


@pytest.mark.parametrize("element", ["quad4", "quad8", "tri3", "tri6"])
@pytest.mark.parametrize("n", [2, 3, 4, 5])
def test_gauss_rules_have_the_degree_they_claim(element, n):
    xi, weights = gauss_rule(element, n)
    assert weights.min() > 0
    degree = 2 * n - 1 if element.startswith("quad") else 2 * n - 2
    exact = gauss_rule("quad4", 8) if element.startswith("quad") else quadrature.collapsed_triangle(8)
    for i in range(degree + 1):
        for j in range(degree + 1 - i):
            integral = exact[1] @ (exact[0][:, 0] ** i * exact[0][:, 1] ** j)
            assert weights @ (xi[:, 0] ** i * xi[:, 1] ** j) == pytest.approx(integral, abs=1e-14)


def test_closed_rules_on_triangles():
    closed = quadrature.triangle_7_closed()
    for xi, weights, count in ((*closed, 7), (*quadrature.quartered_triangle(closed), 19)):
        assert len(xi) == count
        assert weights.min() > 0
        for i, j, exact in ((0, 0, 1 / 2), (1, 0, 1 / 6), (1, 1, 1 / 24), (3, 0, 1 / 20), (2, 1, 1 / 60)):
            assert weights @ (xi[:, 0] ** i * xi[:, 1] ** j) == pytest.approx(exact, rel=1e-14)


def test_the_axis_of_first_contact():
    pair_ = bound(NodeToSegment)
    foot, axis = pair_.first_contact(Configuration.undeformed(pair_.points))
    assert foot == pytest.approx([0, 0, 0], abs=1e-12)
    assert axis == pytest.approx([0, 1, 0], abs=1e-12)


def test_turning_the_surface_turns_the_pairing():
    mesh = folded()
    turn = Rotation.random(random_state=4).as_matrix()
    turned = mesh.replace(points=mesh.points @ turn.T)
    positions = np.random.default_rng(5).uniform([0.05, 0.05, 1.0], [0.95, 0.95, 1.1], (100, 3))
    for normals in ("facet", "averaged"):
        one = pair(positions, DeformedSide(surface(mesh, "ZMAX"), mesh.points), 0.5, normals)
        other = pair(positions @ turn.T, DeformedSide(surface(turned, "ZMAX"), turned.points), 0.5, normals)
        assert np.array_equal(one.facet, other.facet)
        assert np.abs(one.xi - other.xi).max() < 1e-11
        assert np.abs(one.normal @ turn.T - other.normal).max() < 1e-12
