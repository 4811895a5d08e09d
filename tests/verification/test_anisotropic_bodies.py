"""Orthotropic and anisotropic bodies compared with exact solutions, and rotated as a whole."""

import numpy as np
import pytest
from models import made_of, supported

import fastcontact as fc

E, NU, G = (140.0, 10.0, 6.0), (0.3, 0.25, 0.4), (5.0, 4.0, 2.0)


def held_everywhere(mesh, kinematics, material, field):
    """A model with the displacement `field` prescribed on the whole outside."""
    outer = np.unique(np.concatenate([f.ravel() for f in fc.topology.outer_facets(mesh).values()]))
    model = made_of(mesh.with_groups(points={"OUTER": outer}), kinematics, material)
    axes = "xyz"[: mesh.dim]
    return supported(model, OUTER={**{a: (lambda x, k=k: field(x)[:, k]) for k, a in enumerate(axes)}})


@pytest.mark.parametrize("element", ["tet4", "hex8", "wedge6", "hex20", "tet10", "pyramid13"])
def test_patch_in_space(element):
    mesh = fc.generate.box((2.0, 1.5, 1.2), (2, 2, 2), element, (0.5, -0.3, 0.2))
    slope = 1e-3 * np.array([[1.0, 0.4, -0.3], [-0.2, -2.0, 0.7], [0.5, 0.1, 0.6]])
    material = fc.Orthotropic(E, NU, G, axes=[(1, 2, 0.5), (-2, 1, 0)])
    model = held_everywhere(mesh, "3d", material, lambda x: x @ slope.T)
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    strain = np.array(
        [*np.diag(slope), slope[0, 1] + slope[1, 0], slope[1, 2] + slope[2, 1], slope[0, 2] + slope[2, 0]]
    )
    expected = material.moduli("3d") @ strain
    np.testing.assert_allclose(step.displacement, mesh.points @ slope.T, atol=1e-13)
    np.testing.assert_allclose(step.stress, np.broadcast_to(expected, step.stress.shape), atol=1e-11)
    assert fc.estimate_error(model, step).relative < 1e-9


@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress"])
@pytest.mark.parametrize("element", ["tri3", "quad8"])
def test_tension_off_the_axes(kinematics, element):
    """A strip pulled at an angle to its fibres stretches by 1 / E_x and shears (Jones, Mechanics of composites, 2.6)."""
    angle, stress = 0.5, 0.01
    c, s = np.cos(angle), np.sin(angle)
    mesh = fc.generate.block((4.0, 1.0), (8, 3), element)
    corner, bottom = (int(np.abs(mesh.points - place).sum(axis=1).argmin()) for place in ((0.0, 0.0), (4.0, 0.0)))
    model = fc.Model(mesh.with_groups(points={"CORNER": [corner], "OTHER": [bottom]}), kinematics)
    model.add_material(fc.Orthotropic(E, NU, G, axes=(c, s)))
    model.add_traction("RIGHT", x=stress)
    model.add_traction("LEFT", x=-stress)
    supported(model, CORNER="xy", OTHER="y")
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    np.testing.assert_allclose(
        step.stress[:, [0, 1, 3]], np.broadcast_to([stress, 0, 0], (len(step.stress), 3)), atol=1e-12
    )
    if kinematics == "plane_stress":
        along = c**4 / E[0] + (1 / G[0] - 2 * NU[0] / E[0]) * (c * s) ** 2 + s**4 / E[1]
        assert step.displacement[bottom, 0] == pytest.approx(4.0 * stress * along, rel=1e-9)


def test_a_pressed_block_is_the_same_turned_as_a_whole():
    """Contact pressure and displacements turn with mesh, axes and load."""
    found = []
    for angle in (0.0, 0.7):
        c, s = np.cos(angle), np.sin(angle)
        R = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        mesh = fc.generate.box((2.0, 1.0, 1.0), (4, 2, 2), "hex8")
        mesh = mesh.replace(points=mesh.points @ R)
        model = fc.Model(mesh, "3d")
        axes = np.array([(1, 0, 1), (0, 1, 0), (-1, 0, 1)]) / np.sqrt([[2], [1], [2]])
        model.add_material(fc.Orthotropic(E, NU, G, axes=axes @ R))
        model.fix("XMIN", "xyz")
        pull = np.array([0.001, 0.02, 0.003]) @ R
        model.add_traction("XMAX", **dict(zip("xyz", pull)))
        step = fc.solve(model, fc.linear_ramp(1))[-1]
        found.append((step.displacement @ R.T, step.von_mises))
    np.testing.assert_allclose(found[1][0], found[0][0], atol=1e-10)
    np.testing.assert_allclose(found[1][1], found[0][1], rtol=1e-9)


def ring_pressure(r, inner, outer, p, k):
    """Radial and hoop stress of a ring with cylindrical orthotropy under internal pressure (Lekhnitskii, 1968)."""
    C = p / ((inner / outer) ** (-k - 1) - (inner / outer) ** (k - 1))
    rising, falling = (r / outer) ** (k - 1), (r / outer) ** (-k - 1)
    return C * (rising - falling), C * k * (rising + falling)


def quarter_ring(kinematics, n):
    if kinematics == "3d":
        mesh = fc.generate.box((1.0, np.pi / 2, 0.1), (n // 2, n, 1), "hex20", (1.0, 0.0, 0.0))
    else:
        mesh = fc.generate.block((1.0, np.pi / 2), (n // 2, n), "quad8", origin=(1.0, 0.0))
    points = mesh.points.copy()
    r, t = mesh.points.T[:2]
    points[:, 0], points[:, 1] = r * np.cos(t), r * np.sin(t)
    return mesh.replace(points=points)


def ring_errors(kinematics, n):
    """Errors of hoop stress and radial displacement, relative to the largest, of a ring with circumferential fibres."""
    Er, Et, nu_tr, p = 10.0, 40.0, 0.3, 0.01
    turning = kinematics != "axisymmetric"
    mesh = (
        quarter_ring(kinematics, n)
        if turning
        else fc.generate.block((1.0, 0.1), (n // 2, 1), "quad8", origin=(1.0, 0.0))
    )
    axes = fc.CylindricalAxes(direction=(0, 0, 1) if turning else (0, 1, 0))
    model = fc.Model(mesh, kinematics)
    model.add_material(fc.Orthotropic((Er, Et, 20.0), (nu_tr * Er / Et, 0.0, 0.0), (5.0, 5.0, 5.0), axes=axes))
    in_space = kinematics == "3d"
    model.add_pressure("XMIN" if in_space else "LEFT", p)
    model.fix("YMIN" if in_space else "BOTTOM", "y")
    if turning:
        model.fix("YMAX" if in_space else "TOP", "x")
    if in_space:
        model.fix("ZMIN", "z")
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    r = np.linalg.norm(mesh.points[:, :2], axis=1) if turning else mesh.points[:, 0]
    radial, hoop = ring_pressure(r, 1.0, 2.0, p, np.sqrt(Et / Er))
    found = step.stress[:, :2].sum(axis=1) - radial if turning else step.stress[:, 2]
    exact = r / Et * (hoop - nu_tr * radial)
    u = (step.displacement[:, :2] * mesh.points[:, :2]).sum(axis=1) / r if turning else step.displacement[:, 0]
    return np.abs(found - hoop).max() / hoop.max(), np.abs(u - exact).max() / exact.max()


@pytest.mark.parametrize("kinematics", ["plane_stress", "axisymmetric", "3d"])
def test_an_orthotropic_ring_under_internal_pressure(kinematics):
    """Radius and circumference have moduli of their own; axes turn inside cells, so the error falls as that of others."""
    coarse, fine = ring_errors(kinematics, 8), ring_errors(kinematics, 16)
    assert fine[0] < 0.011
    assert fine[1] < 2e-5
    assert fine[0] < 0.4 * coarse[0]
    assert fine[1] < 0.09 * coarse[1]
