"""Contact at the cost of a linear solution, measured by iterations, which are the same on any machine."""

import numpy as np
import pytest
from models import cubes, elastic_model, with_contact
from pairwise import first_of
from scipy.sparse import csr_array
from stepping import Stepping

import fastcontact as fc
from fastcontact.cli.bench import suite
from fastcontact.contact.configuration import Configuration

pytestmark = pytest.mark.pairwise


def blocks(n, formulation="node_to_segment"):
    """Return two cubes whose meshes do not match, pressed together."""
    model = elastic_model(cubes(n, round(0.7 * n)), ZMIN_LOW="xyz", ZMAX_HIGH={"x": 0.0, "y": 0.0, "z": -0.01})
    return with_contact(model, "c", "ZMIN_HIGH", "ZMAX_LOW", formulation=formulation)


def sphere(size, formulation="node_to_segment"):
    mesh = fc.generate.sphere_on_block("hex8", R=1.0, size=size, contact_size=size / 3, contact_radius=0.2)
    model = elastic_model(mesh, SYMMETRY_X="x", SYMMETRY_Z="z", BLOCK_BOTTOM="y", SPHERE_TOP={"y": -0.02})
    return with_contact(model, "c", "CONT_SPHERE", "CONT_BLOCK", formulation=formulation)


def prepared(model, tolerance=1e-8, steps=1):
    criteria = fc.Criteria(relative=100 * tolerance, geometry=tolerance)
    return Stepping(model, "amg", tolerance, criteria, fc.linear_ramp(steps))


def counted(analysis, work):
    before = analysis.solver.counters.iterations
    work()
    return analysis.solver.counters.iterations - before


def linear_iterations(analysis):
    lift = analysis.load_at(1.0).lift
    loaded = analysis.solver.load(analysis.system.right_side(np.zeros_like(lift), lift))
    return counted(analysis, lambda: loaded.solve(csr_array((0, len(lift))), np.empty(0)))


@pytest.mark.parametrize("n", [16, pytest.param(28, marks=pytest.mark.slow)])
def test_linear_and_tied_solutions_take_the_same_few_iterations_at_any_size(n):
    analysis = prepared(blocks(n))
    assert linear_iterations(analysis) <= 13
    lift = analysis.load_at(1.0).lift
    rows = analysis.pairs["c"].constraints(Configuration.undeformed(analysis.model.mesh.points))
    B, gap0 = analysis.system.rows(rows.B, rows.gap0, lift)
    all_rows = np.flatnonzero(np.diff(B.indptr) > 0)
    loaded = analysis.solver.load(analysis.system.right_side(np.zeros_like(lift), lift))
    for tied in (all_rows, all_rows[::2]):
        assert counted(analysis, lambda tied=tied: loaded.solve(B[tied], -gap0[tied])) <= 14
    assert analysis.solver.counters.setups == 1


@pytest.mark.parametrize("formulation", ["node_to_segment", "mortar"])
def test_a_cold_contact_step_costs_at_most_1_6_linear_solutions(formulation):
    analysis = prepared(sphere(0.12, formulation))
    one = linear_iterations(analysis)
    assert one <= 15
    assert counted(analysis, lambda: analysis.step(1, 1.0)) <= 1.6 * one
    assert analysis.solver.counters.setups == 1


@pytest.mark.parametrize(("tolerance", "price"), [(1e-8, 16), pytest.param(1e-4, 8.5, marks=pytest.mark.slow)])
def test_twenty_steps_with_converged_geometry_cost_few_linear_solutions(tolerance, price):
    analysis = prepared(sphere(0.12), tolerance, 20)
    one = linear_iterations(analysis)
    total = sum(
        counted(analysis, lambda index=index, instant=instant: analysis.step(index, instant))
        for index, instant in enumerate(analysis.ramp.instants, start=1)
    )
    assert total <= price * one
    assert analysis.solver.counters.setups == 1


def test_precision_is_an_option_that_changes_no_digit_that_counts():
    model = sphere(0.18)
    single, double = (
        fc.solve(model, 1, linear_solver="amg", linear_precision=precision)[-1] for precision in ("single", "double")
    )
    assert np.abs(single.displacement - double.displacement).max() < 1e-8 * np.abs(double.displacement).max()
    with pytest.raises(fc.ModelError, match="'single' or 'double', not 'half'"):
        fc.solve(model, linear_solver="amg", linear_precision="half")


INTERFACES = [
    ({}, 3.5),
    ({"multipliers": "standard"}, 5.5),
    ({"ratio": 1e4}, 3.5),
    ({"ratio": 1e8}, 3.5),
    ({"ratio": 1e-2}, 6.0),
    ({"ratio": 1e-4}, 8.0),
    ({"nu": 0.45}, 3.5),
    ({"nu": 0.49}, 3.5),
    ({"nu": 0.499}, 3.5),
    ({"nu": 0.4999}, 3.5),
    ({"element": "tet4"}, 3.5),
    ({"element": "tet10", "divisions": 6}, 4.0),
    ({"element": "hex20", "divisions": 6}, 4.0),
    ({"curvature": 0.02}, 3.5),
    ({"stretch": 20.0}, 3.5),
]


def checked(make, *given, most, pairings=None, **options):
    """Return the figures of a step of `bench robustness` that takes so many times the iterations of a linear solution."""
    robustness = suite("subjects").load("robustness")
    found = robustness.figures(getattr(robustness, make)(*given, **options))
    assert not found["replacement_reason"]
    assert pairings is None or found["pairings"] <= pairings
    assert found["step"]["iterations"] <= most * found["linear"]["iterations"]
    assert found["residual"] < 1e-6
    return found


@pytest.mark.filterwarnings("ignore:Young's moduli")
@pytest.mark.parametrize(
    ("given", "most", "friction"),
    [  # by default every second, with friction and without in turn
        pytest.param(given, most, friction, marks=() if (k + 2 * bool(friction)) % 4 == 0 else pytest.mark.slow)
        for k, (given, most) in enumerate(INTERFACES)
        for friction in (0.0, 0.3)
    ],
)
def test_iterations_under_whole_interfaces_are_a_few_times_those_without_contact(given, most, friction):
    found = checked("blocks", **{"divisions": 12, **given, "friction": friction}, most=most)
    assert found["sliding"] > 0 or not friction


@pytest.mark.filterwarnings("ignore:Young's moduli")
def test_the_hierarchy_of_a_much_stiffer_secondary_side_follows_small_changes_of_the_weights():
    checked("blocks", 6, ratio=1e-4, most=3)


@pytest.mark.filterwarnings("ignore:Young's moduli")
@pytest.mark.parametrize("given", first_of(1, [{"curvature": 0.02}, {"nu": 0.499}]))
def test_iterations_beside_a_stiff_secondary_side_that_touches_in_part_or_is_nearly_incompressible(given):
    checked("blocks", 16, ratio=1e-3, **given, most=4)


@pytest.mark.filterwarnings("ignore:Young's moduli")
@pytest.mark.parametrize(("element", "most"), first_of(1, [("tet10", 7.0), ("hex20", 7.5)]))
def test_friction_beside_a_much_stiffer_secondary_side_is_not_solved_pairing_by_pairing(element, most):
    checked("blocks", 6, 0.3, ratio=1e-3, element=element, most=most, pairings=18)


@pytest.mark.filterwarnings("ignore:Young's moduli")
def test_initial_guesses_are_improved_beside_a_much_stiffer_body():
    checked("blocks", 6, 0.3, element="tet10", ratio=1e-4, most=22, pairings=20)


@pytest.mark.parametrize(
    ("nu", "most"),
    [pytest.param(0.49, 8, marks=pytest.mark.slow), (0.499, 8), pytest.param(0.4999, 9, marks=pytest.mark.slow)],
)
def test_friction_of_nearly_incompressible_bodies_is_paired_as_often_as_that_of_others(nu, most):
    checked("blocks", 12, 0.3, nu=nu, most=2.2, pairings=most)


@pytest.mark.each_value
@pytest.mark.parametrize("ball", [False, True])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_iterations_on_rigid_obstacles_are_a_few_times_those_without_contact(ball, friction):
    checked("on_obstacle", 12, friction, ball, most=3.5)


def test_signs_of_loose_solutions_do_not_change_the_active_set_to_and_fro():
    checked("blocks", 12, nu=0.499, most=2.5)
