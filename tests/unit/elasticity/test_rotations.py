"""The largest rotation of a cell compared with half the curl of the displacement in NumPy."""

import numpy as np
import pytest

import fastcontact as fc
from fastcontact.analysis.result_warnings import largest_rotation
from fastcontact.mesh import elements

MESHES = {
    **{name: lambda name=name: fc.generate.block((2.0, 1.0), (3, 2), name) for name in ("tri3", "quad4", "quad8")},
    **{name: lambda name=name: fc.generate.box((2.0, 1.0, 1.0), (3, 2, 2), name) for name in ("tet4", "hex8", "hex20")},
}


def moved(mesh):
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


@pytest.mark.parametrize("name", MESHES)
def test_the_largest_rotation_is_half_the_largest_curl(name):
    mesh = moved(MESHES[name]())
    u = np.random.default_rng(0).normal(size=mesh.points.shape)
    expected = curls(mesh, u, name)
    angle, place = largest_rotation(mesh, u)
    assert abs(angle - expected.max()) < 1e-12 * expected.max()
    assert np.array_equal(place, mesh.points[mesh.cells[name][expected.argmax()]].mean(axis=0))


@pytest.mark.parametrize("name", MESHES)
def test_a_rigid_rotation_is_found_and_nothing_at_rest(name):
    mesh = moved(MESHES[name]())
    spin = np.array([[0.0, -0.3, 0.2], [0.3, 0.0, -0.1], [-0.2, 0.1, 0.0]])[: mesh.dim, : mesh.dim]
    angle, _ = largest_rotation(mesh, mesh.points @ spin.T)
    assert abs(angle - np.linalg.norm(spin) / np.sqrt(2.0)) < 1e-12
    none, place = largest_rotation(mesh, np.zeros_like(mesh.points))
    assert none == 0.0
    assert np.array_equal(place, np.zeros(mesh.dim))
