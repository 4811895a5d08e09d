"""Gravity and centrifugal forces compared with exact solutions."""

import numpy as np
import pytest
from models import made_of, supported
from scipy.integrate import quad

import fastcontact as fc

pytestmark = pytest.mark.pairwise

E, NU, RHO = 210e3, 0.3, 7.85e-9


def block(kinematics, size=(2.0, 3.0), origin=(0.0, 0.0), nu=NU, density=RHO):
    mesh = fc.generate.block(size, (8, 3), "quad8", origin=origin)
    return made_of(mesh, kinematics, fc.LinearElastic(E, nu, density=density))


@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress", "axisymmetric"])
def test_a_hanging_body_carries_its_weight(kinematics):
    """The mean stress falls linearly from the top; at nu = 0 it is exact everywhere."""
    model = supported(block(kinematics, nu=0.0), TOP="y", LEFT="x")
    model.add_gravity(y=-9810.0)
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    volume = np.pi * 2.0**2 * 3.0 if kinematics == "axisymmetric" else 6.0
    assert step.reaction[:, 1].sum() == pytest.approx(9810.0 * RHO * volume, rel=1e-12)
    np.testing.assert_allclose(step.stress[:, 1], 9810.0 * RHO * model.mesh.points[:, 1], atol=1e-12)


def test_gravity_acts_on_its_groups_with_their_own_densities_and_history():
    mesh = fc.generate.box((2.0, 1.0, 1.0), (2, 1, 1), "hex8").with_groups(cells={"HEAVY": [0], "LIGHT": [1]})
    light = fc.Orthotropic((E,) * 3, (NU,) * 3, (E,) * 3, density=1.0)
    model = made_of(mesh, "3d", {"HEAVY": fc.LinearElastic(E, NU, density=3.0), "LIGHT": light}, XMIN="xyz")
    model.add_gravity(x=1.0, z=-10.0)
    model.add_gravity("LIGHT", y=5.0, ramp=[(0.0, 2.0), (1.0, 2.0)])
    total = [force.sum(axis=0) for force in model.forces_by_ramp().values()]
    np.testing.assert_allclose(total, [[4.0, 0.0, -40.0], [0.0, 5.0, 0.0]], atol=1e-12)
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    np.testing.assert_allclose(step.reaction.sum(axis=0), [-4.0, -10.0, 40.0], atol=1e-9)


def disc(r, a, b, speed, nu=NU):
    """Radial and hoop stress of a thin rotating disc with a hole (Timoshenko and Goodier, 1970, section 32)."""
    c = (3 + nu) / 8 * RHO * speed**2
    radial = c * (a**2 + b**2 - (a * b / r) ** 2 - r**2)
    return radial, c * (a**2 + b**2 + (a * b / r) ** 2 - (1 + 3 * nu) / (3 + nu) * r**2)


def test_a_rotating_disc():
    mesh = fc.generate.block((40.0, np.pi / 2), (24, 20), "quad8", origin=(10.0, 0.0))
    r, t = mesh.points.T
    mesh = mesh.replace(points=np.column_stack([r * np.cos(t), r * np.sin(t)]))
    model = made_of(mesh, "plane_stress", fc.LinearElastic(E, NU, density=RHO), BOTTOM="y", TOP="x")
    model.add_centrifugal(1000.0)
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    radial, hoop = disc(r, 10.0, 50.0, 1000.0)
    np.testing.assert_allclose(step.stress[:, :2].sum(axis=1), radial + hoop, atol=0.004 * hoop.max())
    u = (step.displacement * model.mesh.points).sum(axis=1) / r
    np.testing.assert_allclose(u, r / E * (hoop - NU * radial), rtol=2e-4)


def test_a_rotating_cylinder_that_cannot_lengthen():
    """In axisymmetry, plane strain along the axis: the disc with E / (1 - nu^2) and nu / (1 - nu)."""
    model = supported(block("axisymmetric", (40.0, 1.0), origin=(10.0, 0.0)), TOP="y", BOTTOM="y")
    model.add_centrifugal(1000.0)
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    r, nu = model.mesh.points[:, 0], NU / (1 - NU)
    radial, hoop = disc(r, 10.0, 50.0, 1000.0, nu)
    np.testing.assert_allclose(step.displacement[:, 0], r * (1 - NU**2) / E * (hoop - nu * radial), rtol=5e-3)


def test_the_axis_may_lie_anywhere_in_space():
    """The force on a body is that on its mass at its centre, with finite strains at the centre of the deformed body."""
    box = fc.generate.box((2.0, 1.0, 1.0), (4, 1, 1), "hex8").with_groups(cells={"HEAVY": [0, 1], "OTHER": [2, 3]})
    laws = {"HEAVY": fc.LinearElastic(1e4, NU, density=2.0), "OTHER": fc.LinearElastic(1e4, NU)}
    model = made_of(box, "3d", laws, "finite", XMIN="xyz")
    model.add_centrifugal(2.0, "HEAVY", origin=(5.0, 1.0, -2.0), direction=(1.0, 2.0, 3.0))
    step, along = fc.solve(model, 1)[-1], np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    for u, force in ((0.0, model.forces_by_ramp()[None]), (step.displacement, -step.reaction)):
        arm = (box.points + u)[box.cells["hex8"][:2]].mean(axis=(0, 1)) - (5.0, 1.0, -2.0)
        np.testing.assert_allclose(force.sum(axis=0), 2.0 * 4.0 * (arm - (arm @ along) * along), rtol=1e-9)


@pytest.mark.parametrize(("kinematics", "direction"), [("plane_stress", (0, 0, 1)), ("plane_strain", (0, -2, 0))])
def test_a_bar_is_stretched_by_its_rotation(kinematics, direction):
    """At the deformed position x, ``(s - 1) (3 s + 1) E = 4 Omega^2 (length^2 - x^2)`` holds for the squared stretch s."""
    mesh, law = fc.generate.block((10.0, 1.0), (20, 1), "quad8"), fc.LinearElastic(1000.0, 0.0, density=1.0)
    model = made_of(mesh, kinematics, law, "finite", LEFT="x", BLOCK="y")
    for ramp in (None, [(0.0, 0.0), (1.0, 0.25)]):
        model.add_centrifugal(2.0, direction=direction, ramp=ramp)
    step = fc.solve(model, 1)[-1]
    length = 10.0 + step.displacement[mesh.points_of("RIGHT"), 0].mean()
    undeformed = quad(lambda x: ((1.0 + np.sqrt(4.0 + 0.06 * (length**2 - x**2))) / 3.0) ** -0.5, 0.0, length)[0]
    assert undeformed == pytest.approx(10.0, rel=1e-8)
    changes = [entry["displacement_change"] for entry in step.iterations["history"]]
    assert changes[-2] <= 5.0 * changes[-3] ** 2


def test_oblique_axes_are_refused_in_the_plane():
    for origin, message in ((0, 0, 0), "must lie in the plane or be normal"), ((0, 0, 1), "outside the plane"):
        with pytest.raises(fc.ModelError, match=message):
            block("plane_strain").add_centrifugal(1.0, origin=origin, direction=(1, 0, 1 - origin[2]))


def test_a_missing_density_is_told_before_any_numerics():
    model = supported(block("plane_strain", density=None), TOP="xy")
    model.add_gravity(y=-1.0)
    with pytest.raises(fc.ModelError, match="gravity on all solid cells needs densities, but the materials of 24"):
        model.check()
