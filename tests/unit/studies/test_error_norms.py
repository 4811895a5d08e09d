"""Norms of errors: exact on polynomials, equal to the energy of the stiffness matrix, additive over groups."""

from dataclasses import dataclass

import numpy as np
import pytest
from models import FLAT, SOLIDS, body_of, elastic_model, made_of
from refusals import refused

import fastcontact as fc
from fastcontact.elasticity.stiffness import stiffness
from fastcontact.mesh import elements

E, NU = 1000.0, 0.3
QUADRATIC = [name for name in FLAT + SOLIDS if elements.get(name).order == 2]
ALL = [(name, kind) for name in FLAT for kind in ("plane_strain", "plane_stress", "axisymmetric")]
ALL += [(name, "3d") for name in SOLIDS]


@dataclass
class Field:
    """A displacement field with its strains xx, yy, zz, 2xy[, 2yz, 2xz], under a material."""

    u: object
    strain: object
    moduli: np.ndarray

    def displacement(self, points):
        return self.u(*points.T).T

    def stress(self, points):
        return self.strain(*points.T).T @ self.moduli.T


def solid(element, kinematics, shift=1.0):
    """Distorted cells of 2 x 1.5 (x 1), whose inner points leave the lattice; the volume stays."""
    if kinematics == "3d":
        mesh = fc.generate.box((2.0, 1.5, 1.0), (2, 2, 2), element, (shift, 0.0, 0.0))
    else:
        mesh = fc.generate.block((2.0, 1.5), (4, 3), element, (shift, 0.0), distortion=0.2)
    return elastic_model(mesh, kinematics, E=E, nu=NU)


def moduli(kinematics):
    return fc.LinearElastic(E=E, nu=NU).moduli(kinematics)


def linear(kinematics):
    """u = (0.01 x, -0.02 y[, 0.005 z]) with its uniform strain; in axisymmetry 0.01 is the hoop strain too."""

    def u(x, y, z=None):
        return np.stack([0.01 * x, -0.02 * y] if z is None else [0.01 * x, -0.02 * y, 0.005 * z])

    def strain(x, y, z=None):
        hoop = 0.01 if kinematics == "axisymmetric" else 0.0
        rows = [0.01, -0.02, hoop if z is None else 0.005, 0.0] + ([] if z is None else [0.0, 0.0])
        return np.outer(rows, np.ones_like(x))

    return Field(u, strain, moduli(kinematics))


def quadratic(dim):
    """u = (x y, x^2 - y^2), in three dimensions also y z added to x and x z as the last component."""

    def u(x, y, z=0.0):
        rows = [x * y + y * z, x**2 - y**2] + ([] if dim == 2 else [x * z])
        return np.stack(rows)

    def strain(x, y, z=0.0):
        if dim == 2:
            return np.stack([y, -2 * y, 0 * x, 3 * x])
        return np.stack([y, -2 * y, x, 3 * x + z, 0 * x, y + z])

    return Field(u, strain, moduli("plane_strain" if dim == 2 else "3d"))


@pytest.mark.parametrize(("element", "kinematics"), ALL)
def test_a_linear_field_has_no_error_and_the_norms_of_its_volume(element, kinematics):
    model, field = solid(element, kinematics), linear(kinematics)
    norms = fc.error_against(field, model, field.displacement(model.mesh.points))
    assert norms.relative_energy < 1e-13
    assert norms.relative_displacement < 1e-13
    # Written out: volume times energy density; the mean of r over 1 to 3 is 2.
    volume = 3.0 * (2 * np.pi * 2.0 if kinematics == "axisymmetric" else 1.0)
    strain = field.strain(np.zeros(1), np.zeros(1), *([np.zeros(1)] if kinematics == "3d" else []))[:, 0]
    assert norms.energy_of_theory**2 == pytest.approx(volume * strain @ moduli(kinematics) @ strain, rel=1e-12)
    x2, y2, z2 = (26 / 3 / 2, 0.75, 1 / 3)
    if kinematics == "axisymmetric":
        x2 = 20.0 / 4.0  # the mean of r^3 over that of r
    square = volume * (1e-4 * x2 + 4e-4 * y2 + (2.5e-5 * z2 if kinematics == "3d" else 0.0))
    assert norms.displacement_of_theory**2 == pytest.approx(square, rel=1e-12)


@pytest.mark.parametrize("element", QUADRATIC)
def test_a_quadratic_field_has_no_error_on_quadratic_elements(element):
    """Straight cells that are images of the reference by an affine map, on which the elements hold all of it."""
    mesh = body_of(element, (2.0, 1.5, 1.0), (4, 3, 2))
    model = elastic_model(mesh, "plane_strain" if mesh.dim == 2 else "3d", E=E, nu=NU)
    field = quadratic(mesh.dim)
    norms = fc.error_against(field, model, field.displacement(mesh.points))
    assert norms.relative_energy < 1e-12
    assert norms.relative_displacement < 1e-13


@pytest.mark.parametrize(("element", "kinematics"), [
    ("tri3", "plane_strain"), ("quad4", "plane_stress"), ("quad9", "plane_strain"), ("hex8", "3d"), ("tet4", "3d"),
])  # fmt: skip
def test_the_energy_of_a_displacement_is_that_of_the_stiffness_matrix(element, kinematics):
    mesh = fc.generate.box(element=element) if kinematics == "3d" else fc.generate.block(element=element)
    model = elastic_model(mesh, kinematics, E=E, nu=NU)
    u = np.random.default_rng(3).normal(size=mesh.points.shape)
    nothing = Field(lambda *x: np.zeros((len(x), len(x[0]))), None, None)
    nothing.stress = lambda points: np.zeros((len(points), 4 if mesh.dim == 2 else 6))
    norms = fc.error_against(nothing, model, u)
    K = stiffness(mesh, kinematics, *model.material_numbers())
    assert norms.energy**2 == pytest.approx(u.ravel() @ (K @ u.ravel()), rel=1e-12)
    assert norms.energy_of_theory == norms.displacement_of_theory == 0.0


def test_materials_are_those_of_the_cells_and_groups_add_up():
    mesh = fc.generate.block_on_block("quad4")
    model = fc.Model(mesh, "plane_strain")
    soft, stiff = fc.LinearElastic(E=E, nu=NU), fc.LinearElastic(E=3 * E, nu=0.1)
    model.add_material(soft, "LOWER")
    model.add_material(stiff, "UPPER")
    box = fc.analytic.hertz_box(width=20.0, height=20.0)
    shifted = Field(None, None, None)
    shifted.displacement = lambda points: box.displacement(points - [0.0, 10.0])
    shifted.stress = lambda points: box.stress(points - [0.0, 10.0])
    rest = np.zeros_like(mesh.points)
    both, lower, upper = (fc.error_against(shifted, model, rest, groups=g) for g in (None, "LOWER", ["UPPER"]))
    for name in ("energy", "displacement", "energy_of_theory", "displacement_of_theory"):
        assert getattr(both, name) == pytest.approx(np.hypot(getattr(lower, name), getattr(upper, name)), rel=1e-12)
    alone = made_of(mesh, "plane_strain", stiff)
    assert fc.error_against(shifted, alone, rest, groups="UPPER") == upper
    assert fc.error_against(shifted, alone, rest, groups="LOWER").energy < lower.energy


def test_more_points_hardly_change_the_error():
    """Three more points than the order are enough, also where the pressure ends like a square root."""
    box = fc.analytic.hertz_box()
    model = elastic_model(fc.generate.block((1.0, 1.0), (8, 8), "quad8", origin=(0.0, -1.0)), "plane_strain")
    u = box.displacement(model.mesh.points)
    usual, many = fc.error_against(box, model, u), fc.error_against(box, model, u, n_points=12)
    assert usual.energy == pytest.approx(many.energy, rel=0.01)
    assert usual.displacement == pytest.approx(many.displacement, rel=0.01)


def test_wrong_arguments_are_told():
    model, field = solid("quad4", "plane_strain"), linear("plane_strain")
    u = field.displacement(model.mesh.points)
    refused(fc.ModelError, r"displacement has shape \(2, 2\)", fc.error_against, field, model, u[:2])
    refused(fc.ModelError, "group 'TOP' contains no solid cells", fc.error_against, field, model, u, groups="TOP")
    refused(fc.MeshError, "BLOCK", fc.error_against, field, model, u, groups="BLOC")
    refused(fc.ModelError, "n_points = 0", fc.error_against, field, model, u, n_points=0)
    six, endless = linear("plane_strain"), linear("plane_strain")
    six.stress = lambda points: np.zeros((len(points), 6))
    endless.displacement = lambda points: np.full(points.shape, np.nan)
    refused(fc.ModelError, r"stress has shape \(192, 6\) where \(192, 4\)", fc.error_against, six, model, u)
    refused(fc.ModelError, "displacement is not finite at", fc.error_against, endless, model, u)
