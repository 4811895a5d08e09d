"""Exact Hertz solution in a box, and the finite-body solution of two half spheres."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from models import reference

from fastcontact.analytic import _finite_spheres, finite_half_spheres, hertz_box
from fastcontact.errors import ModelError

REFERENCE = reference("hertz_box")
KINEMATICS = ["plane_strain", "plane_stress", "axisymmetric"]


@pytest.mark.parametrize(("kinematics", "order"), [("plane_strain", [0, 1, 3]), ("axisymmetric", [0, 2, 1, 3])])
def test_matches_table(kinematics, order):
    case = REFERENCE[kinematics]
    box = hertz_box(
        kinematics=kinematics,
        E=REFERENCE["E"],
        nu=REFERENCE["nu"],
        radius=REFERENCE["radius"],
        pressure_max=REFERENCE["pressure_max"],
    )
    rows = np.array(case["rows"])
    assert pytest.approx(case["R"], rel=1e-14) == box.R
    np.testing.assert_allclose(box.displacement(rows[:, :2]), rows[:, 2:4], atol=1e-15)
    np.testing.assert_allclose(box.stress(rows[:, :2])[:, order], rows[:, 4:], atol=1e-11)
    force = case["force"] if kinematics == "axisymmetric" else 2.0 * case["half_force"]
    assert box.force == pytest.approx(force, rel=1e-14)


@pytest.mark.parametrize("kinematics", KINEMATICS)
@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45])
def test_solves_the_contact_problem(kinematics, nu):
    box = hertz_box(kinematics=kinematics, nu=nu)
    x = np.linspace(0.0, box.width, 200)
    top = np.column_stack([x, np.zeros_like(x)])
    gap = box.obstacle(x) - box.displacement(top)[:, 1]
    stress = box.stress(top)
    closed = x <= box.radius
    np.testing.assert_allclose(gap[closed], 0.0, atol=1e-15)
    assert (gap[~closed] > 0.0).all()
    np.testing.assert_allclose(-stress[:, 1], box.pressure(x), atol=1e-12)
    np.testing.assert_allclose(stress[:, 3], 0.0, atol=1e-12)
    assert (box.pressure(x)[closed] > 0.0).all()
    axis = np.column_stack([np.zeros(20), -np.linspace(0.0, box.height, 20)])
    np.testing.assert_allclose(box.displacement(axis)[:, 0], 0.0, atol=1e-17)
    np.testing.assert_allclose(box.stress(axis)[:, 3], 0.0, atol=1e-12)


@pytest.mark.parametrize("kinematics", KINEMATICS)
def test_stress_follows_from_displacement(kinematics):
    box, h = hertz_box(kinematics=kinematics), 1e-3
    points = np.array([[0.2, -0.1], [0.6, -0.05], [0.9, -0.8]])

    def slope(axis):
        shift = np.zeros(2)
        shift[axis] = h
        u = [box.displacement(points + k * shift) for k in (-2, -1, 1, 2)]
        return (u[0] - 8.0 * u[1] + 8.0 * u[2] - u[3]) / (12.0 * h)

    xx, yy, zz, xy = box.stress(points).T
    d_x, d_y = slope(0), slope(1)
    np.testing.assert_allclose(d_x[:, 0], (xx - box.nu * (yy + zz)) / box.E, atol=1e-8)
    np.testing.assert_allclose(d_y[:, 1], (yy - box.nu * (xx + zz)) / box.E, atol=1e-8)
    np.testing.assert_allclose(d_x[:, 1] + d_y[:, 0], 2.0 * (1.0 + box.nu) / box.E * xy, atol=1e-8)


def test_the_box_in_three_dimensions_is_the_axisymmetric_one_turned():
    box, round_box = hertz_box(kinematics="3d", nu=0.2), hertz_box(kinematics="axisymmetric", nu=0.2)
    r, z = np.array([0.0, 0.2, 0.6, 0.9]), np.array([-0.3, 0.0, -0.1, -1.0])
    u, s = round_box.displacement(np.column_stack([r, z])), round_box.stress(np.column_stack([r, z]))
    for angle in (0.0, 0.3, 2.0, -1.0):
        cosine, sine = math.cos(angle), math.sin(angle)
        turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        points = np.column_stack([r * cosine, r * sine, z])
        expected = np.column_stack([u[:, 0], 0 * r, u[:, 1]]) @ turn.T
        np.testing.assert_allclose(box.displacement(points), expected, atol=1e-15)
        tensor = np.zeros((4, 3, 3))
        tensor[:, 0, 0], tensor[:, 1, 1], tensor[:, 2, 2] = s[:, 0], s[:, 2], s[:, 1]
        tensor[:, 0, 2] = tensor[:, 2, 0] = s[:, 3]
        turned = turn @ tensor @ turn.T
        rows, columns = (0, 1, 2, 0, 1, 0), (0, 1, 2, 1, 2, 2)
        np.testing.assert_allclose(box.stress(points), turned[:, rows, columns], atol=1e-12)
        np.testing.assert_allclose(box.pressure(points[:, 0], points[:, 1]), round_box.pressure(r), rtol=1e-13)
        np.testing.assert_allclose(box.obstacle(points[:, 0], points[:, 1]), round_box.obstacle(r), rtol=1e-13)
    assert box.force == round_box.force
    assert (box.dim, round_box.dim) == (3, 2)


@pytest.mark.parametrize("kinematics", [*KINEMATICS, "3d"])
def test_symmetry_planes_stay_plane_to_the_last_bit(kinematics):
    box = hertz_box(kinematics=kinematics)
    points = np.random.default_rng(1).uniform(0.0, 1.0, (50, box.dim))
    points[:, -1] *= -1.0
    for axis in range(box.dim - 1):
        on = points.copy()
        on[:, axis] = 0.0
        assert not box.displacement(on)[:, axis].any()


@pytest.mark.parametrize("kinematics", ["plane_strain", "3d"])
def test_the_box_is_its_own_obstacle(kinematics):
    """Its gap is the one between the exact deformed top and the parabola."""
    box = hertz_box(kinematics=kinematics)
    top = np.zeros((20, box.dim))
    top[:, 0] = np.linspace(0.0, 1.0, 20)
    gap, normal = box.distance(top)
    assert box.pressure_max == -box.stress(np.zeros((1, box.dim)))[0, 1 if box.dim == 2 else 2]
    assert (normal == [*[0.0] * (box.dim - 1), -1.0]).all()
    left = gap + (normal * box.displacement(top)).sum(axis=1)
    np.testing.assert_allclose(left[top[:, 0] < box.radius], 0.0, atol=1e-15)
    assert (left[top[:, 0] > box.radius] > 0.0).all()


def test_rounded_mesh_coordinates_are_forgiven():
    box = hertz_box()
    np.testing.assert_array_equal(box.stress([[0.2, 1e-16]]), box.stress([[0.2, 0.0]]))


HALF_SPHERES = reference("finite_half_spheres")
QUANTITIES = ("force", "pressure_max", "radius")


@pytest.mark.parametrize("row", HALF_SPHERES["degree_8_to_10"]["rows"])
def test_reproduces_the_precise_rows(row):
    spheres = finite_half_spheres(row[0])
    np.testing.assert_allclose([getattr(spheres, name) for name in QUANTITIES], row[1:], rtol=1e-12)


@pytest.mark.parametrize("row", HALF_SPHERES["degree_4"]["rows"])
def test_two_independent_computations_agree(row):
    spheres = finite_half_spheres(row[0])
    found = np.array([getattr(spheres, name) for name in QUANTITIES])
    resolved = slice(0, 2) if row[0] == 0.002 else slice(0, 3)
    np.testing.assert_allclose(found[resolved], row[1:][resolved], rtol=3e-6)


def test_leaving_out_a_row_bounds_the_error_of_interpolation():
    table = _finite_spheres._table()
    errors = {}
    for i in range(1, len(table) - 1):
        found = _finite_spheres._interpolate(np.delete(table, i, axis=0), table[i, 0])
        errors[table[i, 0]] = np.abs(np.array(found) / table[i, 1:] - 1.0)
    worst = np.max(list(errors.values()), axis=0)
    large = np.max([error for x, error in errors.items() if x > 0.0079], axis=0)
    assert (worst < [2e-5, 2e-5, 4e-5]).all(), worst
    assert (large < [4e-6, 4e-6, 1e-5]).all(), large
    assert (worst > 1e-7).all()  # else the rows would not have been left out


def test_hertz_at_equal_force_and_at_equal_approach():
    spheres = finite_half_spheres(4.0)
    assert spheres.force / spheres.hertz.force == pytest.approx(1.12574, abs=1e-5)
    assert spheres.hertz.pressure_max == pytest.approx(2798.32867, rel=1e-8)
    equal_force = spheres.hertz.at_force(spheres.force)
    assert abs(spheres.pressure_max / equal_force.pressure_max - 1.0) < 3e-4
    assert abs(spheres.radius / equal_force.radius - 1.0) < 5e-3


def test_small_loads_tend_to_hertz():
    ratios = [finite_half_spheres(h) for h in (0.5, 0.05, 0.005)]
    excess = [s.force / s.hertz.force - 1.0 for s in ratios]
    assert excess[0] > 2.5 * excess[1] > 6.0 * excess[2] > 0.0


@given(approach=st.floats(4.001e-5, 0.0799), R=st.floats(1e-2, 1e2), E=st.floats(1e-2, 1e12))
def test_scales_with_radius_and_modulus(approach, R, E):
    one = finite_half_spheres(approach, R=1.0, E=1.0)
    other = finite_half_spheres(approach * R, R=R, E=E)
    assert other.force == pytest.approx(one.force * E * R**2, rel=1e-12)
    assert other.pressure_max == pytest.approx(one.pressure_max * E, rel=1e-12)
    assert other.radius == pytest.approx(one.radius * R, rel=1e-12)
    assert other.at_approach(other.approach).force == other.force


def test_grows_smoothly():
    approach = np.geomspace(0.002, 4.0, 80)
    force = np.array([finite_half_spheres(float(h)).force for h in approach])
    exponent = np.diff(np.log(force)) / np.diff(np.log(approach))
    assert (exponent > 1.5).all()
    assert (exponent < 1.57).all()
    # The exponent itself grows, without the waves of a bad interpolation.
    assert (np.diff(exponent) > 0.0).all()
    assert np.abs(np.diff(exponent, 2)).max() < 4e-4


@pytest.mark.parametrize("approach", [0.0019, 4.1])
def test_range_of_the_table_is_kept(approach):
    with pytest.raises(ModelError, match=r"runs from 4e-05 to 0\.08"):
        finite_half_spheres(approach)
