"""Orthotropic and anisotropic materials: moduli, conditions, axes, element loops compared with NumPy twins."""

import numpy as np
import pytest
from models import FLAT, elastic_model
from refusals import refused
from test_assembly import MESHES, plane_patch, twin

import fastcontact as fc
from fastcontact.elasticity.material_axes import TENSOR_INDICES
from fastcontact.elasticity.stiffness import is_isotropic, stiffness

pytestmark = pytest.mark.pairwise

KINEMATICS = ("plane_strain", "plane_stress", "axisymmetric", "3d")
WOOD = {"E": (10_800.0, 700.0, 430.0), "nu": (0.45, 0.51, 0.54), "G": (620.0, 580.0, 26.0)}
TILTED = [(1.0, 2.0, 0.5), (-2.0, 1.0, 0.0)]
IN_PLANE = [(np.cos(0.4), np.sin(0.4), 0.0), (-np.sin(0.4), np.cos(0.4), 0.0)]


def general():
    """Moduli without any symmetry but that of the matrix."""
    A = np.random.default_rng(4).normal(size=(6, 6))
    return 100.0 * (A @ A.T + 6.0 * np.eye(6))


def numbers(mesh):
    return {name: np.zeros(len(block), np.int32) for name, block in mesh.solids.items()}


@pytest.mark.parametrize("kinematics", KINEMATICS)
def test_isotropic_constants_give_the_isotropic_moduli(kinematics):
    E, nu = 210.0, 0.3
    expected = fc.LinearElastic(E, nu).moduli(kinematics)
    for material in (
        fc.Orthotropic((E,) * 3, (nu,) * 3, (E / 2 / (1 + nu),) * 3, axes=IN_PLANE),
        fc.Orthotropic.transversely_isotropic(E, E, nu, nu, E / 2 / (1 + nu)),
        fc.Anisotropic(fc.LinearElastic(E, nu).moduli("3d"), axes=IN_PLANE),
    ):
        np.testing.assert_allclose(material.moduli(kinematics), expected, rtol=1e-13, atol=1e-11)


def test_constants_mean_what_they_are_called():
    """A stress along one axis strains the others by minus nu_ij, a shear stress by 1 / G."""
    S = np.linalg.inv(fc.Orthotropic(**WOOD).moduli("3d"))
    (E1, E2, E3), (nu12, nu13, nu23), (G12, G13, G23) = WOOD["E"], WOOD["nu"], WOOD["G"]
    np.testing.assert_allclose(np.diag(S), [1 / E1, 1 / E2, 1 / E3, 1 / G12, 1 / G23, 1 / G13])
    np.testing.assert_allclose([S[1, 0] / S[0, 0], S[2, 0] / S[0, 0], S[2, 1] / S[1, 1]], [-nu12, -nu13, -nu23])


@pytest.mark.parametrize(
    "make", [lambda axes: fc.Orthotropic(**WOOD, axes=axes), lambda a: fc.Anisotropic(general(), a)]
)
def test_turned_moduli_are_those_of_the_tensor_turned_index_by_index(make):
    D, R = make(None).moduli("3d"), np.array([*TILTED, np.cross(*TILTED)])
    R /= np.linalg.norm(R, axis=1, keepdims=True)
    C = np.empty((3,) * 4)
    for row, (i, j) in enumerate(TENSOR_INDICES):
        for column, (k, m) in enumerate(TENSOR_INDICES):
            C[i, j, k, m] = C[j, i, k, m] = C[i, j, m, k] = C[j, i, m, k] = D[row, column]
    turned = np.einsum("ai,bj,ck,dl,abcd->ijkl", R, R, R, R, C)
    expected = [[turned[i, j, k, m] for k, m in TENSOR_INDICES] for i, j in TENSOR_INDICES]
    np.testing.assert_allclose(make(TILTED).moduli("3d"), expected, rtol=1e-10, atol=1e-9 * np.abs(D).max())


@pytest.mark.parametrize("kinematics", KINEMATICS[:3])
def test_shear_out_of_the_plane_is_refused_there(kinematics):
    for material in (fc.Orthotropic(**WOOD, axes=[(1, 0, 1), (0, 1, 0)]), fc.Anisotropic(general())):
        refused(fc.ModelError, "couples in-plane strains with out-of-plane shear", material.moduli, kinematics)


def test_plane_stress_has_no_stress_out_of_the_plane():
    """The plane-stress moduli are those of 3D with the strain zz that makes the stress zz vanish."""
    material = fc.Orthotropic(**WOOD, axes=IN_PLANE)
    D, strain = material.moduli("3d"), np.array([1.0, -0.4, 0.0, 0.7, 0.0, 0.0])
    strain[2] = -D[2] @ strain / D[2, 2]
    np.testing.assert_allclose(material.moduli("plane_stress") @ strain[:4], (D @ strain)[:4], atol=1e-9)


@pytest.mark.parametrize("name", MESHES)
def test_stiffness_in_space_equals_its_numpy_twin(name):
    mesh = MESHES[name]()
    for D in (fc.Orthotropic(**WOOD, axes=TILTED).moduli("3d"), general()):
        K, expected = stiffness(mesh, "3d", D[None], numbers(mesh)).toarray(), twin(mesh, "3d", D)
        np.testing.assert_allclose(K, expected, atol=1e-12 * np.abs(expected).max())
        np.testing.assert_array_equal(K, K.T)


@pytest.mark.parametrize("kinematics", KINEMATICS[:3])
@pytest.mark.parametrize("element", FLAT)
def test_stiffness_in_the_plane_equals_its_numpy_twin(element, kinematics):
    mesh = plane_patch(element)
    D = fc.Orthotropic(**WOOD, axes=IN_PLANE).moduli(kinematics)
    assert not is_isotropic(D[None]).any()
    K, expected = stiffness(mesh, kinematics, D[None], numbers(mesh)).toarray(), twin(mesh, kinematics, D)
    np.testing.assert_allclose(K, expected, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_array_equal(K, K.T)


def test_isotropic_moduli_keep_the_short_loops_however_incompressible():
    for nu in (-0.9, 0.0, 0.3, 0.4999, 0.4999999):
        assert is_isotropic(fc.LinearElastic(3.3, nu).moduli("3d")[None]).all()
    assert not is_isotropic(fc.Orthotropic(**WOOD).moduli("3d")[None]).any()


def test_axes_of_a_cylinder_are_radial_tangential_and_along():
    axes = fc.CylindricalAxes(origin=(1.0, 0.0, 0.0), direction=(0.0, 0.0, 2.0))
    found = axes(np.array([[3.0, 0.0], [1.0, 5.0]]))
    np.testing.assert_allclose(found, [np.eye(3), [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]])
    refused(fc.ModelError, "lies on the line of the cylindrical axes", axes, np.array([[1.0, 0.0], [2.0, 0.0]]))
    refused(fc.ModelError, "no length", fc.CylindricalAxes, direction=(0.0, 0.0, 0.0))
    refused(fc.ModelError, "three components", fc.CylindricalAxes, origin=(0.0, 0.0))
    material = fc.Orthotropic(**WOOD, axes=axes)
    refused(fc.ModelError, "depend on the position", material.moduli, "3d")
    refused(fc.ModelError, "not about the axis of symmetry", material.moduli_at, np.ones((1, 2)), "axisymmetric")


def test_a_cylinder_in_axisymmetry_has_its_tangent_along_the_circumference():
    D = fc.Orthotropic(**WOOD, axes=fc.CylindricalAxes(direction=(0, 1, 0))).moduli_at(np.ones((1, 2)), "axisymmetric")[
        0
    ]
    expected = fc.Orthotropic(**WOOD).moduli("3d")[np.ix_([0, 2, 1, 5], [0, 2, 1, 5])]
    np.testing.assert_allclose(D, expected, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize(
    ("nu", "kinematics", "expected"),
    [(0.3, "3d", 1.0), (0.4999, "3d", 2499.5), (0.49, "axisymmetric", 24.5), (0.4999, "plane_stress", 1.0)],
)
def test_contrast_of_a_material_is_that_of_change_of_volume_to_shear(nu, kinematics, expected):
    mesh = MESHES["hex8"]() if kinematics == "3d" else plane_patch("quad4")
    assert elastic_model(mesh, kinematics, E=7.0, nu=nu).material_field().contrast == pytest.approx(expected)
