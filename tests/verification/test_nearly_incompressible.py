"""Nearly incompressible bodies: Cook's membrane, a bonded pad, Hertz contact, each compared with a refined mesh."""

import numpy as np
import pytest
from models import elastic_model, made_of, pressed_spheres, supported
from pairwise import first_of

import fastcontact as fc

NU = 0.4999
pytestmark = pytest.mark.filterwarnings("ignore:the largest")  # equivalent strain, rotation: linear all the same


def membrane(element, n, nu=NU, volumetric="auto"):
    """Deflection of the upper right corner of Cook's membrane (Cook, 1974), in plane strain."""
    mesh = fc.generate.block((1.0, 1.0), (n, n), element)
    x, y = mesh.points.T
    x = x - x.min()
    mesh = mesh.replace(points=np.column_stack([48 * x, 44 * x + (y - y.min()) * (44 - 28 * x)]))
    model = made_of(mesh, "plane_strain", fc.LinearElastic(E=250.0, nu=nu, volumetric=volumetric), LEFT="xy")
    model.add_force("RIGHT", y=100.0)
    corner = np.linalg.norm(mesh.points - [48.0, 60.0], axis=1).argmin()
    return fc.solve(model, 1)[-1].displacement[corner, 1]


@pytest.mark.parametrize(
    ("element", "n", "error"), [("quad4", 16, 0.025), ("quad8", 8, 0.025), ("quad9", 8, 0.01), ("tri6", 8, 0.01)]
)
def test_cooks_membrane(element, n, error):
    assert membrane(element, n) == pytest.approx(membrane("quad9", 32), rel=error)


@pytest.mark.filterwarnings("ignore:.* cells lock")
def test_plain_elements_would_lock_on_cooks_membrane():
    assert membrane("quad4", 16, volumetric="plain") < 0.35 * membrane("quad4", 16)


def pad(element, n, kinematics="plane_strain", solver="direct"):
    """Force on a pad four times as wide as high, bonded to rigid plates above and below that approach by a hundredth."""
    solid = kinematics == "3d"
    size = (2.0, 2.0, 1.0) if solid else (2.0, 1.0)
    mesh = (fc.generate.box if solid else fc.generate.block)(
        size, (2 * n,) * (2 * solid) + (n,) if solid else (2 * n, n), element
    )
    mesh = mesh.replace(points=mesh.points - mesh.points.min(axis=0))
    model = elastic_model(mesh, kinematics, E=3.0, nu=NU)
    bottom, top, up = ("ZMIN", "ZMAX", "z") if solid else ("BOTTOM", "TOP", "y")
    supported(model, **{bottom: "xyz"[: mesh.dim], top: "xy" if solid else "x"})
    model.prescribe(top, **{up: -0.01})
    for group, axis in (("XMIN", "x"), ("YMIN", "y")) if solid else (("LEFT", "x"),):
        model.fix(group, axis)  # symmetry
    return -fc.solve(model, 1, linear_solver=solver)[-1].reaction[mesh.points_of(top), "xyz".index(up)].sum()


@pytest.mark.parametrize(
    ("element", "n", "kinematics", "error"),
    [("quad4", 16, "plane_strain", 0.02), ("quad8", 8, "plane_strain", 0.02), ("tri6", 4, "axisymmetric", 0.02),
     ("quad4", 16, "axisymmetric", 0.02)],
)  # fmt: skip
def test_bonded_pad(element, n, kinematics, error):
    assert pad(element, n, kinematics) == pytest.approx(pad("quad9", 24, kinematics), rel=error)


def test_bonded_pad_in_space():
    assert pad("hex8", 6, "3d") == pytest.approx(pad("hex20", 5, "3d"), rel=0.05)


@pytest.mark.parametrize("kinematics", ["plane_strain", "3d"])
def test_multigrid_gives_the_same_pad(kinematics):
    element = "hex8" if kinematics == "3d" else "quad4"
    assert pad(element, 6, kinematics, "amg") == pytest.approx(pad(element, 6, kinematics), rel=1e-6)


def hertz(element, nu, coarseness):
    """Force, largest pressure and radius of two half-spheres pressed together by a twenty-fifth of the radius."""
    mesh = fc.generate.half_spheres(
        element, arc_sizes=(0.2 * coarseness, 2 * coarseness), segments=int(15 / coarseness)
    )
    contact = fc.solve(pressed_spheres(mesh, 1.0, material=fc.LinearElastic(E=20_000.0, nu=nu)), 1)[-1].contact["hertz"]
    return np.array([np.abs(contact.force[1]), contact.pressure.max()])


@pytest.mark.parametrize("element", first_of(1, ["quad4", "quad8", "quad9"]))
def test_hertz_is_as_good_as_at_nu_0_3(element):
    for nu in (0.3, NU):
        assert hertz(element, nu, 2.0) == pytest.approx(hertz("quad9", nu, 1.0), rel=0.01)
