"""Element loops compared with plain NumPy twins, and invariants of the stiffness."""

import numpy as np
import pytest

import fastcontact as fc
from fastcontact import recovery
from fastcontact.elasticity.stiffness import rigid_modes, sparsity, stiffness
from fastcontact.errors import MeshError
from fastcontact.mesh import elements

KINEMATICS = ("plane_strain", "plane_stress", "axisymmetric")
SOLIDS = [e.name for e in elements.ELEMENTS.values() if e.dim == 2]


def patch(element, shift=2.0):
    """A distorted patch of cells away from the axis."""
    mesh = fc.generate.block((2.0, 1.5), (3, 2), element, origin=(shift, -0.3))
    inner = np.sin(7.0 * mesh.points[:, ::-1]) * 0.04
    return mesh.replace(points=mesh.points + inner)


def strain_operator(element, corners, q, axisymmetric):
    """The strain-displacement matrix (4, 2 n) at one point, and its weight, written out."""
    N, dN, weights = element.tables
    J = dN[q].T @ corners
    gradient = dN[q] @ np.linalg.inv(J).T
    B = np.zeros((4, 2 * element.n_nodes))
    B[0, 0::2], B[1, 1::2] = gradient[:, 0], gradient[:, 1]
    B[3, 0::2], B[3, 1::2] = gradient[:, 1], gradient[:, 0]
    weight = weights[q] * np.linalg.det(J)
    if axisymmetric:
        radius = N[q] @ corners[:, 0]
        B[2, 0::2] = N[q] / radius
        weight *= 2 * np.pi * radius
    return B, weight


def twin(mesh, kinematics, D):
    """Stiffness assembled densely, cell by cell."""
    K = np.zeros((2 * mesh.n_points,) * 2)
    for name, block in mesh.solids.items():
        element = elements.get(name)
        for cell in block:
            dofs = (2 * cell[:, None] + [0, 1]).ravel()
            for q in range(len(element.quadrature[1])):
                B, weight = strain_operator(element, mesh.points[cell], q, kinematics == "axisymmetric")
                K[np.ix_(dofs, dofs)] += weight * B.T @ D @ B
    return K


def assembled(mesh, kinematics):
    D = fc.LinearElastic(E=210.0, nu=0.3).moduli(kinematics)
    material = {name: np.zeros(len(block), np.int32) for name, block in mesh.solids.items()}
    return stiffness(mesh, kinematics, D[None], material), D, material


@pytest.mark.parametrize("kinematics", KINEMATICS)
@pytest.mark.parametrize("element", SOLIDS)
def test_stiffness_equals_its_numpy_twin(element, kinematics):
    mesh = patch(element)
    K, D, _ = assembled(mesh, kinematics)
    expected = twin(mesh, kinematics, D)
    assert np.abs(K.toarray() - expected).max() < 1e-12 * np.abs(expected).max()
    assert np.array_equal(K.toarray(), K.toarray().T)


@pytest.mark.parametrize("kinematics", KINEMATICS)
@pytest.mark.parametrize("element", SOLIDS)
def test_rigid_body_motion_needs_no_force_and_gives_no_stress(element, kinematics):
    mesh = patch(element)
    K, D, material = assembled(mesh, kinematics)
    for mode in rigid_modes(mesh.points, kinematics).T:
        assert np.abs(K @ mode).max() < 1e-10 * np.abs(K.data).max()
        at_points = recovery.stress_at_points(mesh, kinematics, D[None], material, mode.reshape(-1, 2))
        assert np.abs(recovery.nodal_average(mesh, at_points)).max() < 1e-10 * 210.0


@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress"])
@pytest.mark.parametrize("element", SOLIDS)
def test_linear_displacements_give_the_exact_stress_everywhere(element, kinematics):
    mesh = patch(element)
    _, D, material = assembled(mesh, kinematics)
    strain = np.array([[1e-3, 4e-4], [4e-4, -2e-3]])
    at_points = recovery.stress_at_points(mesh, kinematics, D[None], material, mesh.points @ strain)
    expected = D @ [1e-3, -2e-3, 0.0, 8e-4]
    assert np.abs(recovery.nodal_average(mesh, at_points) - expected).max() < 1e-12
    for values in recovery.stress_at_element_nodes(at_points).values():
        assert np.abs(values - expected).max() < 1e-12


@pytest.mark.parametrize("element", SOLIDS)
def test_uniform_radial_stretch_in_axisymmetry_is_exact(element):
    mesh = patch(element)
    _, D, material = assembled(mesh, "axisymmetric")
    displacement = np.column_stack([1e-3 * mesh.points[:, 0], -5e-4 * mesh.points[:, 1]])
    at_points = recovery.stress_at_points(mesh, "axisymmetric", D[None], material, displacement)
    assert np.abs(recovery.nodal_average(mesh, at_points) - D @ [1e-3, -5e-4, 1e-3, 0.0]).max() < 1e-11


@pytest.mark.parametrize("kinematics", KINEMATICS)
@pytest.mark.parametrize("element", SOLIDS)
def test_internal_forces_are_stiffness_times_displacement(element, kinematics):
    mesh = patch(element)
    K, D, material = assembled(mesh, kinematics)
    u = np.random.default_rng(2).normal(size=mesh.points.shape)
    force = recovery.internal_force(mesh, kinematics, recovery.stress_at_points(mesh, kinematics, D[None], material, u))
    assert np.abs(force.ravel() - K @ u.ravel()).max() < 1e-12 * np.abs(force).max()


def test_the_sparsity_couples_exactly_the_nodes_of_common_cells():
    mesh = fc.Mesh([[0, 0], [1, 0], [1, 1], [0, 1], [9, 9]], {"tri3": [[0, 1, 2], [0, 2, 3]]})
    pattern = sparsity(mesh)
    rows = [pattern.indices[a:b].tolist() for a, b in zip(pattern.indptr[:-1], pattern.indptr[1:])]
    assert rows == [[0, 1, 2, 3], [0, 1, 2], [0, 1, 2, 3], [0, 2, 3], [4]]


def test_a_cell_inside_out_is_named():
    mesh = fc.Mesh([[0, 0], [1, 0], [0, 1]], {"tri3": [[0, 2, 1]]})
    with pytest.raises(MeshError, match="cell 0 of tri3"):
        assembled(mesh, "plane_strain")


def test_von_mises_of_simple_states():
    assert recovery.von_mises(np.array([5.0, 0, 0, 0])) == pytest.approx(5.0)
    assert recovery.von_mises(np.array([-3.0, -3, -3, 0])) == pytest.approx(0.0)
    assert recovery.von_mises(np.array([0.0, 0, 0, 2])) == pytest.approx(2 * np.sqrt(3))
    assert recovery.von_mises(np.array([0.0, 0, 0, 0, 2, 0])) == pytest.approx(2 * np.sqrt(3))
    assert recovery.von_mises_signed(np.array([[-5.0, 0, 0, 0], [5, 0, 0, 0]])) == pytest.approx([-5.0, 5.0])
