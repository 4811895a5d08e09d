"""Limits of the geometry loop: slow convergence continues, round-off ends it with a note, and the result is correct."""

import logging

import numpy as np
import pytest
from models import elastic_model, united, with_contact

import fastcontact as fc
from fastcontact.analysis.tolerances import WINDOW, ScatterWindow

RNG = np.random.default_rng(5)


def watched(parts, size=1.0, forces=None):
    """Return the number of the update at which scatter is found, and the scatter."""
    watch = ScatterWindow()
    for k in range(1, len(parts)):
        change = np.abs(parts[k] - parts[k - 1]).max()
        force = np.ones(3) if forces is None else forces[k]
        found = watch.add(parts[k], force, change, size)
        if found is not None:
            return k, found
    return None, None


@pytest.mark.parametrize("level", [1e-13, 1e-10, 1e-8])
def test_noise_is_found_soon_and_measured(level):
    k, found = watched(1.0 + level * RNG.normal(size=(40, 20)))
    assert WINDOW <= k <= 3 * WINDOW
    assert level < found["displacement"] < 10 * level
    assert found["force"] == 0.0


@pytest.mark.parametrize("rate", [0.5, 0.8, 0.9, 0.95, 0.99])
def test_slow_convergence_is_no_noise(rate):
    u = RNG.normal(size=20)
    assert watched([1.0 + 1e-7 * rate**k * u for k in range(60) if rate**k > 1e-7])[0] is None


@pytest.mark.parametrize(("level", "force"), [(1e-5, 0.0), (1e-9, 1e-3)])
def test_what_matters_is_not_let_pass(level, force):
    """Too large a scatter, of displacements or of contact forces, ends nothing."""
    parts = 1.0 + level * RNG.normal(size=(40, 20))
    assert watched(parts, forces=1.0 + force * RNG.normal(size=(40, 3)))[0] is None


def side_by_side(element="tri6", unit=(1000.0, 1.0), **options):
    mesh = fc.generate.block_on_block(element, divisions_lower=(3, 3), divisions_upper=(3, 2), shift=3.26)
    mesh = fc.Mesh(mesh.points * unit[1], mesh.cells, mesh.cell_groups, mesh.point_groups)
    model = elastic_model(mesh, "plane_strain", E=unit[0], LOWER_BOTTOM="xy")
    model.prescribe("UPPER_TOP", x=0.0, y=-0.05 * unit[1])
    options = {"formulation": "mortar", "kind": "bilateral", **options}
    return with_contact(model, "c", "CONT_UPPER", "CONT_LOWER", **options)


@pytest.mark.each_value
@pytest.mark.parametrize("unit", [(1000.0, 1.0), (2e11, 1e-3)], ids=["N-mm", "N-m"])
@pytest.mark.parametrize("element", ["tri6", "quad8"])
def test_bilateral_contact_of_quadratic_facets_settles(element, unit):
    model = side_by_side(element, unit)
    (step,) = fc.solve(model, fc.linear_ramp(1))
    assert step.iterations["geometry_updates"] < 15
    (loose,) = fc.solve(model, fc.linear_ramp(1), criteria=fc.Criteria(geometry=1e-6))
    np.testing.assert_allclose(step.contact["c"].force[1], loose.contact["c"].force[1], rtol=1e-5)


def slender():
    """A bar of 400 by 1 that lies on a foundation under its weight of 0.4."""
    low = fc.generate.block((400.0, 2.0), (100, 2), "quad4", (0.0, -2.0))
    up = fc.generate.block((400.0, 1.0), (133, 2))
    model = elastic_model(united(L_=low, U_=up), "plane_strain", L_BOTTOM="xy", U_LEFT="x")
    model.add_body_force(["U_BLOCK"], y=-1e-3)
    return with_contact(model, "c", "U_BOTTOM", "L_TOP")


@pytest.mark.parametrize("geometry", [1e-6, 1e-11])
def test_a_slender_bar_settles_and_contact_carries_its_load(geometry, caplog):
    """Round-off moves its end by more than a criterion of 1e-11 allows: that is told."""
    with caplog.at_level(logging.INFO, "fastcontact"):
        *_, step = fc.solve(slender(), fc.linear_ramp(3), criteria=fc.Criteria(geometry=geometry))
    assert step.contact["c"].force[1] == pytest.approx(0.4, rel=1e-6)
    assert step.iterations["geometry_updates"] < 25
    scatter = step.iterations.get("scatter")
    assert (scatter is not None) == (geometry < 1e-10)
    if scatter is not None:
        assert 0.0 < scatter["displacement"] < 1e-7
        assert scatter["force"] < 1e-6
        assert f"scatter by {scatter['displacement']:.1e}" in caplog.text


def test_a_slender_bar_that_contact_holds_scatters_by_round_off_alone():
    """Its position settles in two updates, and the geometry loop ends where later ones tell nothing more."""
    (step,) = fc.solve(slender(), fc.linear_ramp(1))
    assert step.iterations["scatter"]["displacement"] < 1e-7
    assert step.iterations["geometry_updates"] < 20
    assert step.contact["c"].force[1] == pytest.approx(0.4, rel=1e-10)


def test_a_geometry_that_does_not_settle_names_the_criterion():
    words = r"accept changes of that size \(Criteria\.geometry, which is 1e-11, above \de-(09|10)\)"
    with pytest.raises(fc.ConvergenceError, match=words):
        fc.solve(side_by_side(), fc.linear_ramp(1), criteria=fc.Criteria(max_geometry_updates=3, max_halvings=0))
