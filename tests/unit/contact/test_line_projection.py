"""Projection on lines along averaged normals: compared with a plain solution, and its continuity."""

import numpy as np
import pytest
from scipy.optimize import brentq

import fastcontact as fc
from fastcontact.contact.pairing import pair
from fastcontact.contact.projection import along_line_normals, at_nodes_of_facets, interpolated, places, smooth_normals
from fastcontact.contact.search.closest import closest_of_kinds
from fastcontact.contact.surface import surface
from fastcontact.mesh import elements


def wavy(element, n=8):
    """The top of a block bent into a wave: it folds inward and outward."""
    mesh = fc.generate.block((4.0, 1.0), (n, 1), element)
    points = mesh.points.copy()
    points[:, 1] += 0.3 * np.sin(2.5 * points[:, 0]) * points[:, 1]
    mesh = mesh.replace(points=points)
    return mesh, surface(mesh, "TOP")


def cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


@pytest.mark.parametrize("element", ["quad4", "quad8"])
def test_points_lie_along_the_normal_of_their_projection(element):
    mesh, side = wavy(element)
    rng = np.random.default_rng(3)
    x = rng.uniform(0.1, 3.9, 400)
    candidates = np.column_stack([x, 1.0 + 0.3 * np.sin(2.5 * x) + rng.uniform(-0.1, 0.25, 400)])
    normals = at_nodes_of_facets(smooth_normals(side, mesh.points))
    start = closest_of_kinds(candidates, side.corners(mesh.points))
    facet, xi, overhang, _ = along_line_normals(candidates, side, mesh.points, normals, start)
    at = places(side, facet, xi)
    foot = np.einsum("nk,nkd->nd", at.shape, mesh.points[at.nodes])
    assert (overhang == 0.0).all()
    assert np.abs(cross(candidates - foot, interpolated(normals[facet], at))).max() < 1e-13


@pytest.mark.parametrize("element", ["quad4", "quad8"])
def test_against_a_plain_root_on_every_facet(element):
    """Height over the surface is small, so that each point has one projection: that of a bracketed root."""
    mesh, side = wavy(element)
    normals = at_nodes_of_facets(smooth_normals(side, mesh.points))
    reference = elements.get(side.element)
    rng = np.random.default_rng(5)
    x = rng.uniform(0.1, 3.9, 60)
    candidates = np.column_stack([x, 1.0 + 0.3 * np.sin(2.5 * x) + rng.uniform(0.0, 0.1, 60)])
    start = closest_of_kinds(candidates, side.corners(mesh.points))
    facet, xi, _, _ = along_line_normals(candidates, side, mesh.points, normals, start)
    for i, point in enumerate(candidates):

        def aside(s, f, point=point):
            N = reference.shape(np.array([[s]]))[0]
            return float(cross(point - N @ mesh.points[side.facets[f]], N @ normals[f]))

        roots = [
            (f, brentq(aside, -1.0, 1.0, args=(f,), xtol=1e-14))
            for f in range(side.n_facets)
            if aside(-1.0, f) * aside(1.0, f) <= 0.0
        ]
        assert any(f == facet[i] and abs(s - xi[i, 0]) < 1e-11 for f, s in roots)


@pytest.mark.parametrize("element", ["quad4", "quad8"])
def test_the_projection_moves_on_smoothly_over_folds(element):
    """The closest point jumps over a valley, and stays at the node over a ridge."""
    mesh, side = wavy(element)
    x = np.linspace(0.1, 3.9, 4001)
    track = np.column_stack([x, 1.0 + 0.3 * np.sin(2.5 * x) + 0.15])
    for normals, most in (("averaged", 4.0), ("facet", np.inf)):
        found = pair(track, side, mesh.points, 1e-6, normals)
        at = places(side, found.facet, found.xi)
        foot = np.einsum("nk,nkd->nd", at.shape, mesh.points[at.nodes])
        turned = np.linalg.norm(np.diff(found.normal, axis=0), axis=1)
        if normals == "averaged":
            assert found.paired.all()
            assert np.linalg.norm(np.diff(foot, axis=0), axis=1).max() < most * (x[1] - x[0])
            assert turned.max() < 0.02
        elif element == "quad4":
            assert turned.max() > 0.1
            assert found.paired.all()  # beyond both facets at a fold is not beyond the end of the line


def test_beyond_the_end_a_point_stands_out():
    mesh = fc.generate.block((4.0, 1.0), (8, 1), "quad4")
    side = surface(mesh, "TOP")
    for by, tolerance, paired in ((0.001, 0.5, True), (0.2, 0.5, True), (0.35, 0.5, False), (0.001, 1e-6, False)):
        found = pair(np.array([[4.0 + by, 1.2], [-by, 0.9]]), side, mesh.points, tolerance, "averaged")
        assert found.paired.tolist() == [paired, paired]


def test_a_closed_line_has_no_end():
    points = np.array([[np.cos(a), np.sin(a)] for a in np.linspace(0, 2 * np.pi, 12, endpoint=False)])
    inner = 0.5 * points
    cells = np.array([[i, (i + 1) % 12, 12 + (i + 1) % 12, 12 + i] for i in range(12)])
    facets = np.array([[i, (i + 1) % 12] for i in range(12)])
    mesh = fc.Mesh(
        np.vstack([points, inner]), {"quad4": cells, "line2": facets}, cell_groups={"OUT": np.arange(12, 24)}
    )
    side = surface(mesh, "OUT")
    angle = np.linspace(0.0, 2 * np.pi, 100)
    found = pair(1.1 * np.column_stack([np.cos(angle), np.sin(angle)]), side, mesh.points, 1e-6, "averaged")
    assert found.paired.all()
    # On a circle nodal means are radial, so the projection runs towards the centre.
    assert np.abs(found.normal - np.column_stack([np.cos(angle), np.sin(angle)])).max() < 1e-12
