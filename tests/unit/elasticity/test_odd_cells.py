"""Inverted cells and points without cells in element loops, and the largest rotation of a cell."""

import numpy as np
import pytest
from models import body_of

import fastcontact as fc
from fastcontact.analysis.kinematics_warnings import largest_rotation
from fastcontact.elasticity import stiffness
from fastcontact.mesh import elements

STEEL = fc.LinearElastic(E=1.0, nu=0.3)
WOOD = fc.Orthotropic(E=(10.0, 1.0, 2.0), nu=(0.1, 0.2, 0.3), G=(1.0, 1.0, 1.0))


@pytest.mark.parametrize("material", [STEEL, WOOD], ids=["isotropic", "orthotropic"])
@pytest.mark.parametrize("element", ["tri3", "quad4", "quad8", "tet4", "hex8", "wedge6"])
def test_the_first_cell_that_is_inside_out_is_told(element, material):
    mesh = body_of(element)
    kinematics = "plane_strain" if mesh.dim == 2 else "3d"
    count = len(mesh.cells[element])
    turned = mesh.points * np.array([-1.0, *[1.0] * (mesh.dim - 1)])
    bad = mesh.replace(points=turned)
    moduli, numbers = material.moduli(kinematics)[None], {element: np.zeros(count, np.int32)}
    with pytest.raises(fc.MeshError, match=rf"cell 0 of {element} near .* is degenerate or inverted"):
        stiffness.stiffness(bad, kinematics, moduli, numbers)
    assert stiffness.stiffness(mesh, kinematics, moduli, numbers).shape[0] == mesh.n_points * mesh.dim


def halves(first, second):
    """Return the stiffness of a strip of cells with two materials, and the points of the first one alone."""
    mesh = fc.generate.block(divisions=(4, 1))
    middles = mesh.points[mesh.cells["quad4"], 0].mean(axis=1)
    left, right = np.flatnonzero(middles < 0.5), np.flatnonzero(middles > 0.5)
    found = fc.Model(mesh.with_groups(cells={"LEFT HALF": left, "RIGHT HALF": right}), "plane_strain")
    found.add_material(fc.LinearElastic(E=1.0, nu=first), "LEFT HALF")
    found.add_material(fc.LinearElastic(E=1.0, nu=second), "RIGHT HALF")
    u = np.random.default_rng(1).random(mesh.points.shape)
    return found.internal_forces(u).reshape(mesh.points.shape), mesh.points[:, 0] < 0.4, mesh.points[:, 0] > 0.6


def test_a_mean_dilatation_beside_cells_without():
    """Each half has the forces that it has beside a half of its own kind."""
    mixed, left, right = halves(0.3, 0.499)
    plain, soft = halves(0.3, 0.3)[0], halves(0.499, 0.499)[0]
    np.testing.assert_allclose(mixed[left], plain[left], rtol=1e-12)
    np.testing.assert_allclose(mixed[right], soft[right], rtol=1e-12)


def test_points_without_cells_have_no_stiffness():
    mesh = fc.generate.block(divisions=(2, 1))
    more = fc.Mesh(np.vstack([mesh.points, [[9.0, 9.0]]]), dict(mesh.cells))
    moduli, numbers = STEEL.moduli("plane_strain")[None], {"quad4": np.zeros(2, np.int32)}
    K, alone = (stiffness.stiffness(m, "plane_strain", moduli, numbers).toarray() for m in (more, mesh))
    n = len(alone)
    assert np.array_equal(K[:n, :n], alone)
    assert not K[n:].any()
    assert not K[:, n:].any()


NAMES = ("tri3", "quad4", "quad8", "tet4", "hex8", "hex20")


def moved(name):
    mesh = body_of(name, (2.0, 1.0, 1.0), (3, 2, 2))
    return mesh.replace(points=mesh.points + 0.05 * np.sin(4.0 * np.roll(mesh.points, 1, axis=1)))


def curls(mesh, u, name):
    """Half the curl of u (n_cells,) at the middle of the cells."""
    element = elements.get(name)
    dN = element.gradient(element.nodes[: element.n_corners].mean(axis=0)[None])[0]
    found = []
    for cell in mesh.cells[name]:
        slope = u[cell].T @ dN @ np.linalg.inv(mesh.points[cell].T @ dN)
        found.append(np.linalg.norm(0.5 * (slope - slope.T)) / np.sqrt(2.0))
    return np.array(found)


@pytest.mark.parametrize("name", NAMES)
def test_the_largest_rotation_is_half_the_largest_curl(name):
    mesh = moved(name)
    u = np.random.default_rng(0).normal(size=mesh.points.shape)
    expected = curls(mesh, u, name)
    angle, place = largest_rotation(mesh, u)
    assert abs(angle - expected.max()) < 1e-12 * expected.max()
    assert np.array_equal(place, mesh.points[mesh.cells[name][expected.argmax()]].mean(axis=0))


@pytest.mark.parametrize("name", NAMES)
def test_a_rigid_rotation_is_found_and_nothing_at_rest(name):
    mesh = moved(name)
    spin = np.array([[0.0, -0.3, 0.2], [0.3, 0.0, -0.1], [-0.2, 0.1, 0.0]])[: mesh.dim, : mesh.dim]
    angle, _ = largest_rotation(mesh, mesh.points @ spin.T)
    assert abs(angle - np.linalg.norm(spin) / np.sqrt(2.0)) < 1e-12
    none, place = largest_rotation(mesh, np.zeros_like(mesh.points))
    assert none == 0.0
    assert np.array_equal(place, np.zeros(mesh.dim))
