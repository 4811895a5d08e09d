"""Every law in every element, uniaxial, equibiaxial and shear: closed forms, equilibrium at inner nodes (patch test)."""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import brentq

import fastcontact as fc
from fastcontact.elasticity.nonlinear_bodies import NonlinearBodies
from tests.verification.test_finite_strain import LAWS, cauchy, slope

FLAT = ["tri3", "tri6", "quad4", "quad8", "quad9"]
SOLID = [
    "tet4", "tet10", "hex8", "hex20", "hex27", "wedge6", "wedge15", "wedge18", "pyramid5", "pyramid13",
]  # fmt: skip
# Of quadratic elements, those on their corners.
LINEAR = {
    "quad8": "quad4",
    "quad9": "quad4",
    "tri6": "tri3",
    "tet10": "tet4",
    "hex20": "hex8",
    "wedge15": "wedge6",
    "pyramid13": "pyramid5",
}
CELLS = [
    *(("plane_strain", element) for element in FLAT),
    *(("plane_stress", element) for element in FLAT),
    *(("axisymmetric", element) for element in FLAT),
    *(("3d", element) for element in SOLID),
]
PLASTIC = fc.ElasticPlastic(E=200.0, nu=0.3, yield_stress=1.0, hardening=[(0.0, 1.0), (1.0, 11.0)], kinematic=5.0)


def distorted(kinematics: str, element: str) -> fc.Mesh:
    """Return a mesh whose inner corners do not lie in rows; cells with nodes on their faces are deformed smoothly."""
    start = LINEAR.get(element, element)
    if element in ("hex27", "wedge18"):
        mesh = fc.generate.box((1.0, 1.0, 1.0), (2, 2, 2), element=element)
        hat = np.prod(1.0 - np.abs(2.0 * mesh.points - 1.0), axis=1)
        return mesh.replace(points=mesh.points + hat[:, None] * [0.06, -0.04, 0.05])
    if kinematics == "3d":
        mesh = fc.generate.box((1.0, 1.0, 1.0), (2, 2, 2), element=start)
    else:
        mesh = fc.generate.block((1.0, 1.0), (3, 2), element=start, origin=(float(kinematics == "axisymmetric"), 0.0))
    points = mesh.points.copy()
    low, high = points.min(axis=0), points.max(axis=0)
    inside = ((points > low + 1e-9) & (points < high - 1e-9)).all(axis=1)
    points[inside] += 0.06 * np.random.default_rng(0).normal(size=points[inside].shape)
    mesh = mesh.replace(points=points)
    return mesh if start == element else fc.generate.to_quadratic(mesh, centre_nodes=element == "quad9")


def deformed(mode: str, kinematics: str, amount: float) -> np.ndarray:
    """Return F (3, 3), without the strain across plane stress."""
    F = np.eye(3)
    if mode == "shear":
        F[(1, 0) if kinematics == "axisymmetric" else (0, 1)] = amount
    elif mode == "uniaxial":
        F[1, 1] += amount
    else:
        F[0, 0], F[1, 1] = 1.0 + amount, 1.0 + (0.0 if kinematics == "axisymmetric" else amount)
        F[2, 2] += amount if kinematics == "axisymmetric" else 0.0
    return F


def displaced(mesh: fc.Mesh, F: np.ndarray) -> np.ndarray:
    dim = mesh.dim
    return mesh.points @ (F[:dim, :dim] - np.eye(dim)).T


def check(mesh: fc.Mesh, kinematics: str, bodies: NonlinearBodies, F: np.ndarray, stress: np.ndarray) -> None:
    """Assert that every point has `stress` (3, 3), and that no node inside has a force."""
    here, scale = bodies.at(displaced(mesh, F), bodies.beginning), np.abs(stress).max()
    pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)]
    for found in here.stress.values():
        exact = [stress[pair] for pair in pairs[: found.shape[-1]]]
        assert np.abs(found - exact).max() <= 1e-9 * scale
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    inside = ((mesh.points > low + 1e-9) & (mesh.points < high - 1e-9)).all(axis=1)
    if kinematics != "axisymmetric":  # there the hoop stress pulls everywhere
        assert inside.any()
        assert np.abs(here.force[inside]).max() <= 1e-11 * scale


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("kinematics", "element"), CELLS)
def test_stress_is_the_derivative_of_the_energy(kinematics: str, element: str, law: str) -> None:
    material, energy = LAWS[law]
    mesh = distorted(kinematics, element)
    model = fc.Model(mesh, kinematics, strain="finite")
    model.add_material(material)
    bodies = NonlinearBodies(mesh, kinematics, "finite", model.material_field())
    amounts = (0.1, -0.1) if law == "Saint Venant-Kirchhoff" else (0.6, -0.3)
    for mode in ("uniaxial", "equibiaxial", "shear"):
        for amount in amounts:
            F = deformed(mode, kinematics, amount)
            if kinematics == "plane_stress":

                def across(stretch: float, F: np.ndarray = F) -> float:
                    principal = np.sqrt(np.linalg.eigvalsh(F[:2, :2] @ F[:2, :2].T))
                    return slope(energy, np.array([*principal, stretch]), 2)

                F[2, 2] = brentq(across, 0.4, 2.0, xtol=1e-15, rtol=1e-15)
            check(mesh, kinematics, bodies, F, cauchy(energy, F))


def logarithm(F: np.ndarray) -> np.ndarray:
    """Return the spatial logarithmic strain (3, 3), ln(F F^T) / 2."""
    squared, axes = np.linalg.eigh(F @ F.T)
    return axes @ np.diag(0.5 * np.log(squared)) @ axes.T


@pytest.mark.parametrize("strains", ["small", "finite"])
@pytest.mark.parametrize(("kinematics", "element"), CELLS)
def test_plastic_flow_along_a_straight_path(kinematics: str, element: str, strains: str) -> None:
    """Linear hardening: p = (3 G e - Y) / (3 G + H + C) for a deviatoric strain of size e; finite strains are logarithmic."""
    mesh, law, finite = distorted(kinematics, element), PLASTIC, strains == "finite"
    law = dataclasses.replace(law, kinematic=0.0) if finite else law
    model = fc.Model(mesh, kinematics, strain=strains)
    model.add_material(law)
    bodies = NonlinearBodies(mesh, kinematics, strains, model.material_field())
    G, bulk = law.shear_modulus, law.bulk_modulus
    for mode in ("uniaxial", "equibiaxial", "shear"):
        F = deformed(mode, kinematics, 0.4 if finite else 0.02)

        def stress_of(F: np.ndarray) -> np.ndarray:
            strain = logarithm(F) if finite else 0.5 * (F + F.T) - np.eye(3)
            J = np.linalg.det(F) if finite else 1.0
            deviator = strain - np.trace(strain) / 3.0 * np.eye(3)
            size = np.sqrt(2.0 / 3.0 * (deviator**2).sum())
            p = max(3.0 * G * size - 1.0, 0.0) / (3.0 * G + 10.0 + law.kinematic)
            assert p > 1e-3
            return (
                bulk * (J - 1.0 if finite else np.trace(strain)) * np.eye(3) + 2.0 * G * (1.0 - p / size) * deviator / J
            )

        if kinematics == "plane_stress":

            def through(stretch: float, F: np.ndarray = F) -> float:
                F[2, 2] = stretch
                return stress_of(F)[2, 2]

            F[2, 2] = brentq(through, 0.45, 1.1, xtol=1e-16, rtol=1e-15)
        check(mesh, kinematics, bodies, F, stress_of(F))


@pytest.mark.parametrize("law", [*LAWS, "plastic"])
@pytest.mark.parametrize(("kinematics", "element"), [cell for cell in CELLS if cell[0] != "axisymmetric"])
def test_a_rotation_by_90_degrees_leaves_no_stress(kinematics: str, element: str, law: str) -> None:
    mesh, material = distorted(kinematics, element), dataclasses.replace(PLASTIC, kinematic=0.0)
    model = fc.Model(mesh, kinematics, strain="finite")
    model.add_material(material if law == "plastic" else LAWS[law][0])
    bodies = NonlinearBodies(mesh, kinematics, "finite", model.material_field())
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turn = turn @ turn.T[[1, 2, 0]][:, [1, 2, 0]] if kinematics == "3d" else turn
    here, E = bodies.at(displaced(mesh, turn), bodies.beginning), 200.0 if law == "plastic" else 2.8
    assert max(np.abs(stress).max() for stress in here.stress.values()) <= 1e-10 * E
    assert np.abs(here.force).max() <= 1e-10 * E
