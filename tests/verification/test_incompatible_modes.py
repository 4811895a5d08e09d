"""Incompatible modes: exact bending of beams with one cell across, patch tests, free thermal strain."""

import numpy as np
import pytest

import fastcontact as fc

pytestmark = pytest.mark.pairwise

E, NU, LENGTH, MOMENT_STRESS = 1000.0, 0.3, 10.0, 0.01


def beam(element, modes, divisions=10):
    if element == "quad4":
        mesh, kinematics = fc.generate.block((LENGTH, 1.0), (divisions, 1)), "plane_stress"
        ends = ("LEFT", "RIGHT")
    else:
        mesh, kinematics = fc.generate.box((LENGTH, 1.0, 1.0), (divisions, 1, 1)), "3d"
        ends = ("XMIN", "XMAX")
    model = fc.Model(mesh, kinematics)
    model.add_material(fc.LinearElastic(E=E, nu=NU, incompatible_modes=modes, expansion=1e-3))
    return model, ends


def bent(element, modes):
    """Return the deflection of the end of a beam under a pure moment, over that of the theory, and its stress."""
    model, (left, right) = beam(element, modes)
    model.fix(left, "x")
    points = np.flatnonzero((model.mesh.points[:, :2] == 0.0).all(axis=1))
    model.mesh = model.mesh.with_groups(points={"CORNER": points, "ONE": points[:1]})
    model.fix("CORNER", "y")
    if element == "hex8":
        model.fix("ONE", "z")
    model.add_traction(right, x=lambda x: MOMENT_STRESS * (2.0 * x[:, 1] - 1.0))
    (step,) = fc.solve(model, 1)
    exact = -MOMENT_STRESS / E * LENGTH**2  # curvature 2 s / (E h), deflection curvature L^2 / 2
    at_end = step.displacement[model.mesh.points_of(right), 1]
    return at_end.mean() / exact, step.stress[:, 0], MOMENT_STRESS * (2.0 * model.mesh.points[:, 1] - 1.0)


@pytest.mark.filterwarnings("ignore:the traction on .* varies within single elements")
@pytest.mark.parametrize("element", ["quad4", "hex8"])
def test_a_beam_of_one_cell_across_bends_as_in_theory(element):
    """Timoshenko and Goodier, 1970, section 102; without modes it is stiffer by a third to a half."""
    ratio, stress, exact = bent(element, True)
    assert stress == pytest.approx(exact, abs=1e-8 * MOMENT_STRESS)
    assert bent(element, False)[0] < 0.75
    # The cross-section curves, too: its ends lie nu times a little off the middle line.
    assert ratio == pytest.approx(1.0, abs=NU * 0.25 / LENGTH**2 * 4 + 1e-9)


@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress", "3d"])
@pytest.mark.parametrize("law", ["isotropic", "orthotropic"])
def test_a_patch_of_distorted_cells_keeps_a_uniform_stress(kinematics, law):
    if kinematics == "3d":
        mesh = fc.generate.box((1.0, 1.0, 1.0), (2, 2, 2))
        points = np.array(mesh.points)
        points[(np.abs(points - 0.5) < 1e-9).all(axis=1)] += [0.11, -0.07, 0.09]
        mesh = mesh.replace(points=points)
    else:
        mesh = fc.generate.block((1.0, 1.0), (3, 3), distortion=0.2)
    model = fc.Model(mesh, kinematics)
    if law == "isotropic":
        model.add_material(fc.LinearElastic(E=E, nu=NU, incompatible_modes=True))
    else:
        model.add_material(
            fc.Orthotropic((E, 2 * E, E), (0.2, 0.1, 0.3), (300.0, 400.0, 500.0), incompatible_modes=True)
        )
    slope = np.array([[1.0, 0.5, -0.3], [0.2, -0.7, 0.1], [0.4, -0.2, 0.6]])[: mesh.dim, : mesh.dim] * 1e-3
    outside = np.unique(np.concatenate([f.ravel() for f in mesh.facets.values()]))
    model.mesh = mesh.with_groups(points={"OUTSIDE": outside})
    for axis in range(mesh.dim):
        model.prescribe("OUTSIDE", **{"xyz"[axis]: lambda x, row=slope[axis]: x @ row})
    (step,) = fc.solve(model, 1)
    assert step.displacement == pytest.approx(mesh.points @ slope.T, abs=1e-15)
    assert np.ptp(step.stress, axis=0) == pytest.approx(0.0, abs=1e-12 * np.abs(step.stress).max())
    inner = model.internal_forces(step.displacement)
    assert np.abs(np.delete(inner, outside, axis=0)).max(initial=0.0) < 1e-12


def test_a_temperature_that_varies_along_a_line_strains_freely():
    """T = c y: u = alpha c x y, v = alpha c (y^2 - x^2) / 2 without stress, in a beam of one cell across."""
    model, (left, _) = beam("quad4", True)
    model.fix(left, "x")
    model.mesh = model.mesh.with_groups(points={"CORNER": [0]})
    model.fix("CORNER", "y")
    model.add_temperature(lambda x: 0.5 * x[:, 1])
    (step,) = fc.solve(model, 1)
    x, y = model.mesh.points.T
    assert np.abs(step.stress).max() < 1e-9 * E * 1e-3 * 0.5
    assert step.displacement[:, 0] == pytest.approx(1e-3 * 0.5 * x * y, abs=1e-12)
    assert step.displacement[:, 1] == pytest.approx(1e-3 * 0.5 * (y * y - x * x) / 2, abs=1e-11)
