"""Every law in every element in closed forms, and no locking of nearly incompressible bodies in finite strain."""

import dataclasses

import numpy as np
import pytest
from models import CELLS, made_of, supported
from pairwise import first_of
from scipy.optimize import brentq

import fastcontact as fc
from fastcontact.elasticity.nonlinear_bodies import NonlinearBodies
from fastcontact.mesh import elements
from tests.verification.test_finite_strain import LAWS, cauchy, slope

PLASTIC = fc.ElasticPlastic(E=200.0, nu=0.3, yield_stress=1.0, hardening=[(0.0, 1.0), (1.0, 11.0)], kinematic=5.0)


def distorted(kinematics: str, element: str) -> fc.Mesh:
    """Return a mesh whose inner corners do not lie in rows; cells with nodes on their faces are deformed smoothly."""
    start = elements.get(element).linear
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
    here, scale = bodies.at(displaced(mesh, F), bodies.initial_history), np.abs(stress).max()
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
    model = made_of(mesh, kinematics, material, strain="finite")
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
    model = made_of(mesh, kinematics, law, strain=strains)
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
    model = made_of(mesh, kinematics, material if law == "plastic" else LAWS[law][0], strain="finite")
    bodies = NonlinearBodies(mesh, kinematics, "finite", model.material_field())
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turn = turn @ turn.T[[1, 2, 0]][:, [1, 2, 0]] if kinematics == "3d" else turn
    here, E = bodies.at(displaced(mesh, turn), bodies.initial_history), 200.0 if law == "plastic" else 2.8
    assert max(np.abs(stress).max() for stress in here.stress.values()) <= 1e-10 * E
    assert np.abs(here.force).max() <= 1e-10 * E


NU, FAR = 0.4999, 1.6
LAW = fc.NeoHookean(E=2.0 * (1.0 + NU), nu=NU)


def sphere(element: str, n: int) -> tuple[float, float, float]:
    """Blow a 24th of a sphere of radii 1 and 2 up by 1.6.

    Returns
    -------
    pressure, radius, J : float
        Errors of the pressure inside and of the outer radius, relative to the incompressible solution, and the largest change
        of volume of a cell [-]. The pressure is the integral of dW / dlambda over lambda^3 - 1 (Green and Zerna, 1954).
    """
    mesh = fc.generate.box((1.0, 1.0, 1.0), (n, n, n), element=element)
    place = mesh.points - mesh.points.min(axis=0)
    towards = np.column_stack([np.tan(0.25 * np.pi * place[:, :2]), np.ones(mesh.n_points)])
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    mesh = mesh.replace(points=towards * (1.0 + place[:, 2:]))
    model = made_of(mesh, "3d", LAW, strain="finite", XMIN="normal", YMIN="normal", XMAX="normal", YMAX="normal")
    blown = {axis: lambda points, k=k: (FAR - 1.0) * points[:, k] for k, axis in enumerate("xyz")}
    model.prescribe("ZMIN", **blown)
    step = fc.solve(model, 3)[-1]
    moved, inside, outside = mesh.points + step.displacement, mesh.points_of("ZMIN"), mesh.points_of("ZMAX")
    # Virtual work of a pressure when all places grow: three times pressure times volume.
    pressure = (step.reaction[inside] * moved[inside]).sum() / (4.0 * np.pi * FAR**3 / 24.0)
    stretch = np.array([FAR, 0.5 * (7.0 + FAR**3) ** (1.0 / 3.0)])
    potential = 2.0 / stretch + 0.5 / stretch**4
    radius = np.linalg.norm(moved[outside], axis=1) / (2.0 * stretch[1]) - 1.0
    exact = potential[1] - potential[0]
    return pressure / exact - 1.0, float(np.abs(radius).max()), float(np.abs(step.cell_fields["J"] - 1.0).max())


# Errors of the pressure on 2 x 2 x 2 and on 4 x 4 x 4 hexahedra, or what they are cut into.
BOUNDS = {
    "hex8": (0.05, 0.013), "wedge6": (0.05, 0.013), "hex20": (0.002, 3e-4), "hex27": (5e-4, 2e-4), "tet10": (0.002, 6e-4),
    "wedge15": (0.004, 1e-3), "wedge18": (0.004, 1e-3),
}  # fmt: skip


@pytest.mark.parametrize("element", first_of(4, list(BOUNDS)))
def test_a_thick_sphere_is_blown_up(element: str) -> None:
    for n, bound in zip((2, 4), BOUNDS[element], strict=True):
        pressure, radius, J = sphere(element, n)
        assert abs(pressure) <= bound
        assert radius <= 6.5e-3 / n
        assert J <= 1e-3


def squeezed(element: str, n: int) -> tuple[float, float]:
    """Squeeze a block between rough plates by a fifth of its height; return the force [force] and max |J - 1| of cells."""
    mesh = fc.generate.box((1.0, 1.0, 0.5), (n, n, n // 2), element=element)
    model = made_of(mesh, "3d", LAW, strain="finite", ZMIN="z", ZMAX="xy")
    supported(model, ZMAX={"z": -0.1}, XMIN="x", YMIN="y")
    step = fc.solve(model, 2)[-1]
    return -step.reaction[mesh.points_of("ZMAX"), 2].sum(), float(np.abs(step.cell_fields["J"] - 1.0).max())


@pytest.mark.parametrize(("element", "n", "error"), first_of(1, [("hex8", 6, 0.06), ("wedge15", 4, 0.02)]))
def test_a_bonded_block_is_squeezed(element: str, n: int, error: float) -> None:
    """Against hex20, with whom the mean dilatation of linear cells and that of the others agree."""
    reference = squeezed("hex20", 6)[0]
    force, J = squeezed(element, n)
    assert force == pytest.approx(reference, rel=error)
    assert J <= 1e-3


@pytest.mark.each_value
@pytest.mark.filterwarnings("ignore:tet4 cells lock:fastcontact.FastcontactWarning")
@pytest.mark.filterwarnings("ignore:tri3 cells lock:fastcontact.FastcontactWarning")
@pytest.mark.parametrize("element", ["tri3", "tet4", "quad4", "hex8"])
@pytest.mark.parametrize("law", [LAW, fc.ElasticPlastic(E=1.0, nu=0.3, yield_stress=0.01)])
@pytest.mark.filterwarnings("ignore:rotations of up to")
def test_linear_triangles_and_tetrahedra_lock_and_a_warning_says_so(element: str, law) -> None:
    solid = element in ("tet4", "hex8")
    if solid:
        mesh, bottom, top = fc.generate.box((1.0, 1.0, 0.5), (4, 4, 2), element=element), "ZMIN", "ZMAX"
    else:
        mesh, bottom, top = fc.generate.block((1.0, 0.5), (4, 2), element=element), "BOTTOM", "TOP"
    model = made_of(mesh, "3d" if solid else "plane_strain", law, strain="finite" if law is LAW else "small")
    supported(model, **{bottom: "xyz"[: mesh.dim], top: "xy"[: mesh.dim - 1]})
    model.prescribe(top, **{"xyz"[mesh.dim - 1]: -0.05})
    told = any("cells lock" in text for text in fc.solve(model, 2)[-1].warnings)
    assert told == (element in ("tri3", "tet4"))


# Bodies without contact compared with FElupe 11.3 on the same meshes.


def neo_hookean(mu: float, bulk: float, volumetric: str = "auto") -> fc.NeoHookean:
    E, nu = 9.0 * bulk * mu / (3.0 * bulk + mu), (3.0 * bulk - 2.0 * mu) / (2.0 * (3.0 * bulk + mu))
    return fc.NeoHookean(E=E, nu=nu, volumetric=volumetric)


@pytest.mark.parametrize(
    ("element", "count", "place", "displacement"),
    [
        ("hex8", 4, (0.75, 0.5, 0.5), (0.0783203458135064, 0.0, 0.1397266187581981)),
        ("quad4", 6, (5.0 / 6.0, 0.5), (0.05784980188343853, 0.13548997230390997)),
    ],
)
def test_a_block_of_felupe(element: str, count: int, place, displacement) -> None:
    """A node inside of a stretched and sheared block, mu = 1, bulk = 2; all nodes agree to 2.4e-16."""
    dim = len(place)
    generate, faces = (fc.generate.box, ("ZMIN", "ZMAX")) if dim == 3 else (fc.generate.block, ("BOTTOM", "TOP"))
    mesh = generate((1.0,) * dim, (count,) * dim, element=element)
    model = made_of(mesh, "3d" if dim == 3 else "plane_strain", neo_hookean(1.0, 2.0, "plain"), strain="finite")
    model.fix(faces[0], "xyz"[:dim])
    model.prescribe(faces[1], **dict(zip("xyz"[:dim], (0.2, 0.0, 0.3) if dim == 3 else (0.2, 0.3), strict=True)))
    node = np.linalg.norm(mesh.points - place, axis=1).argmin()
    assert fc.solve(model, 4)[-1].displacement[node] == pytest.approx(displacement, rel=1e-8, abs=1e-12)
