"""Thermal strains: free and constrained bodies, a heated shrink fit compared with Lame, a bimetal strip with Timoshenko."""

import numpy as np
import pytest
from models import made_of, supported
from refusals import refused

import fastcontact as fc

pytestmark = pytest.mark.pairwise

E, NU, ALPHA, RISE = 1000.0, 0.3, 1.2e-5, 80.0
STEEL = fc.LinearElastic(E, NU, expansion=ALPHA)


def free(mesh, kinematics, material):
    """A model held against rigid motions alone."""
    model = made_of(mesh, kinematics, material)
    low = mesh.points.min(axis=0)
    places = {"A": low, "B": np.where(np.arange(mesh.dim) == 0, mesh.points.max(axis=0), low)}
    if mesh.dim == 3:
        places["C"] = np.array([low[0], mesh.points[:, 1].max(), low[2]])
    nodes = {name: [int(np.abs(mesh.points - place).sum(axis=1).argmin())] for name, place in places.items()}
    model = made_of(mesh.with_groups(points=nodes), kinematics, material)
    if kinematics == "axisymmetric":
        return supported(model, A="y")
    supported(model, A="xyz"[: mesh.dim], B="yz"[: mesh.dim - 1])
    if mesh.dim == 3:
        model.fix("C", "z")
    return model


def solved(model):
    return fc.solve(model, fc.linear_ramp(1))[-1]


def plane(element, kinematics):
    return fc.generate.block((2.0, 1.0), (3, 2), element, origin=(1.0 if kinematics == "axisymmetric" else 0.0, 0.0))


@pytest.mark.parametrize("nu", [0.3, 0.4999])
@pytest.mark.parametrize("element", ["tri3", "tri6", "quad4", "quad8", "quad9"])
@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress", "axisymmetric"])
def test_free_expansion_in_the_plane_has_no_stress(kinematics, element, nu):
    model = free(plane(element, kinematics), kinematics, fc.LinearElastic(E, nu, expansion=ALPHA))
    model.add_temperature(RISE + 20.0, reference=20.0)
    step = solved(model)
    expected = np.zeros(4)
    growth = ALPHA * RISE
    if kinematics == "plane_strain":  # held out of the plane
        expected[2], growth = -E * ALPHA * RISE, (1 + nu) * ALPHA * RISE
    np.testing.assert_allclose(step.stress, np.broadcast_to(expected, step.stress.shape), atol=1e-7 * E * ALPHA * RISE)
    x = model.mesh.points - (0.0 if kinematics == "axisymmetric" else model.mesh.points.min(axis=0))
    np.testing.assert_allclose(step.displacement, growth * x, atol=1e-8 * growth)
    np.testing.assert_allclose(step.reaction, 0.0, atol=1e-6 * E * ALPHA * RISE)


@pytest.mark.parametrize("nu", [0.3, 0.4999])
@pytest.mark.parametrize("element", ["tet4", "tet10", "hex8", "hex20", "wedge6", "pyramid5"])
def test_free_expansion_in_space_has_no_stress(element, nu):
    model = free(fc.generate.box((2.0, 1.0, 1.0), (2, 1, 1), element), "3d", fc.LinearElastic(E, nu, expansion=ALPHA))
    model.add_temperature(lambda x: np.full(len(x), RISE))
    step = solved(model)
    np.testing.assert_allclose(step.stress, 0.0, atol=1e-7 * E * ALPHA * RISE)
    np.testing.assert_allclose(step.displacement, ALPHA * RISE * model.mesh.points, atol=1e-8 * ALPHA * RISE)


def test_an_orthotropic_body_expands_along_its_axes():
    axes = np.array([(1.0, 1.0, 0.0), (-1.0, 1.0, 1.0), (1.0, -1.0, 2.0)])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    along = np.array([1e-6, 2e-5, 3e-5])
    material = fc.Orthotropic((900.0, 300.0, 200.0), (0.3, 0.2, 0.3), (90.0, 80.0, 70.0), axes=axes, expansion=along)
    model = free(fc.generate.box((2.0, 1.0, 1.0), (2, 2, 1), "hex8"), "3d", material)
    model.add_temperature(RISE)
    step = solved(model)
    np.testing.assert_allclose(step.stress, 0.0, atol=1e-9)
    strain = np.einsum("ai,a,aj->ij", axes, along * RISE, axes)
    stretch = step.displacement[model.mesh.points_of("B")[0], 0]
    assert stretch == pytest.approx(2.0 * strain[0, 0], rel=1e-9)


def test_a_linear_temperature_bends_without_stress():
    """In plane stress; quadratic displacements are those of quad8."""
    model = free(plane("quad8", "plane_stress"), "plane_stress", STEEL)
    model.add_temperature(lambda x: 10.0 + 30.0 * x[:, 0] - 50.0 * x[:, 1])
    step = solved(model)
    np.testing.assert_allclose(step.stress, 0.0, atol=1e-9)
    assert np.abs(step.displacement[:, 0]).max() > 1e-4


@pytest.mark.parametrize("element", ["quad4", "quad8", "tri6"])
def test_a_held_body_is_pressed_by_its_expansion(element):
    """By 3 K alpha T on all sides; the temperature has a history of its own, and an array gives the same."""
    for nu in (0.3, 0.4999):
        material = fc.LinearElastic(E, nu, expansion=ALPHA)
        model = made_of(plane(element, "plane_strain"), "plane_strain", material)
        supported(model, LEFT="x", RIGHT="x", TOP="y", BOTTOM="y")
        model.add_temperature(np.full(model.mesh.n_points, RISE), ramp=[(0.0, 0.0), (0.5, 2.0), (1.0, -1.0)])
        steps = fc.solve(model, fc.linear_ramp(2))
        pressure = E / (1 - 2 * nu) * ALPHA * RISE
        for step, factor in zip(steps, (2.0, -1.0), strict=True):
            assert step.iterations["temperature_factors"] == [factor]
            np.testing.assert_allclose(step.stress[:, :3], -factor * pressure, rtol=1e-9)
            push = step.reaction[model.mesh.points_of("LEFT"), 0].sum()
            assert push == pytest.approx(factor * pressure, rel=1e-9)


def test_a_bimetal_strip():
    """Curvature between the ends (Timoshenko, J. Opt. Soc. Am. 11, 1925): layers of unlike thickness and modulus."""
    lower, upper, length, stiffer = 0.4, 0.6, 20.0, 2.5
    strip = fc.generate.block((length, 1.0), (80, 10), "quad8")
    below = strip.points[strip.cells["quad8"]].mean(axis=1)[:, 1] < lower
    numbers = np.arange(len(below)) + strip.offsets["quad8"]
    mesh = strip.with_groups(cells={"LOWER": numbers[below], "UPPER": numbers[~below]})
    laws = {"LOWER": fc.LinearElastic(stiffer * E, NU, expansion=3.0 * ALPHA), "UPPER": STEEL}
    held = made_of(mesh, "plane_stress", laws, LEFT="x", BOTTOM_LEFT="y")
    held.add_temperature(RISE)
    step = solved(held)
    heights = [
        step.displacement[int(np.abs(mesh.points - (x, 0.0)).sum(axis=1).argmin()), 1] for x in (5.0, 10.0, 15.0)
    ]
    curvature = abs(heights[0] - 2 * heights[1] + heights[2]) / 25.0
    m, n = lower / upper, stiffer
    theory = 6 * 2.0 * ALPHA * RISE * (1 + m) ** 2 / (3 * (1 + m) ** 2 + (1 + m * n) * (m**2 + 1 / (m * n)))
    assert curvature == pytest.approx(theory, rel=1e-4)


def test_the_estimated_error_of_a_free_body_is_nothing():
    model = free(plane("quad4", "plane_strain"), "plane_strain", STEEL)
    model.add_temperature(RISE)
    step = solved(model)
    assert fc.estimate_error(model, step).relative < 1e-9
    np.testing.assert_allclose(model.temperature_rise(step.iterations["temperature_factors"]), RISE)


def test_mistakes_are_refused_before_any_numerics():
    model = free(plane("quad4", "plane_strain"), "plane_strain", fc.LinearElastic(E, NU))
    for value, words in ((np.ones(3), r"shape \(3,\)"), (np.nan, "not a finite"), ("hot", "not the string 'hot'")):
        refused(fc.ModelError, words, model.add_temperature, value)
    with pytest.raises(fc.ModelError, match="not finite at point 2"):
        model.add_temperature(np.where(np.arange(model.mesh.n_points) == 2, np.nan, 1.0))
    refused(fc.ModelError, "contains no solid cells: it has no temperature", model.add_temperature, 1.0, "TOP")
    model.add_temperature(1.0)
    refused(fc.ModelError, "acts on 6 solid cells whose material has no coefficient of thermal", model.check)


def test_an_expansion_that_shears_out_of_the_plane_is_refused():
    constants = (E,) * 3, (NU,) * 3, (E / 2 / (1 + NU),) * 3
    material = fc.Orthotropic(*constants, axes=[(1, 0, 1), (0, 1, 0)], expansion=(1e-6, 2e-6, 3e-6))
    model = free(plane("quad4", "plane_strain"), "plane_strain", material)
    model.add_temperature(1.0)
    refused(fc.ModelError, "causes out-of-plane shear", model.check)
