"""Nearly incompressible bodies in finite strain do not lock: an inflated thick sphere, a compressed block."""

import numpy as np
import pytest
from pairwise import first_of

import fastcontact as fc

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
    model = fc.Model(mesh, "3d", strain="finite")
    model.add_material(LAW)
    for group in ("XMIN", "YMIN", "XMAX", "YMAX"):
        model.fix(group, "normal")
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
    model = fc.Model(mesh, "3d", strain="finite")
    model.add_material(LAW)
    model.fix("ZMIN", "z")
    model.fix("ZMAX", "xy")
    model.prescribe("ZMAX", z=-0.1)
    for group, axis in (("XMIN", "x"), ("YMIN", "y")):
        model.fix(group, axis)
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
def test_linear_triangles_and_tetrahedra_lock_and_a_warning_says_so(element: str, law) -> None:
    solid = element in ("tet4", "hex8")
    if solid:
        mesh, bottom, top = fc.generate.box((1.0, 1.0, 0.5), (4, 4, 2), element=element), "ZMIN", "ZMAX"
    else:
        mesh, bottom, top = fc.generate.block((1.0, 0.5), (4, 2), element=element), "BOTTOM", "TOP"
    model = fc.Model(mesh, "3d" if solid else "plane_strain", strain="finite" if law is LAW else "small")
    model.add_material(law)
    model.fix(bottom, "xyz"[: mesh.dim])
    model.fix(top, "xy"[: mesh.dim - 1])
    model.prescribe(top, **{"xyz"[mesh.dim - 1]: -0.05})
    told = any("cells lock" in text for text in fc.solve(model, 2)[-1].warnings)
    assert told == (element in ("tri3", "tet4"))
