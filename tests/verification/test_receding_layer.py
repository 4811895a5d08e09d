"""A weightless layer pressed on its base by a line load: the contact recedes at once, then does not change.

Keer, Dundurs and Tsai (1972): the half-width of the contact does not depend on the load.
"""

import numpy as np
import pytest
from graded import graded_block, lines
from models import elastic_model, made_of

import fastcontact as fc

E, NU, FORCE = 1000.0, 0.3, 0.01  # per length, of the half x >= 0
LENGTH = 8.0  # of half the layer, which is 1 thick; it lifts off far before


def layer(size):
    mesh = graded_block(lines(size, 3.0, LENGTH), np.linspace(0.0, 1.0, round(1.0 / size) + 1), "quad4", name="LAYER")
    names = {"LAYER": "LAYER", "BOTTOM": "CONT_LAYER", "LEFT": "AXIS", "TOP": "TOP", "TOP_LEFT": "LOADED"}
    return fc.generate.renamed(mesh, names.get)


def pressed(model, steps=4):
    model.fix("AXIS", "x")
    model.add_force("LOADED", y=-FORCE)
    return fc.solve(model, fc.linear_ramp(steps))


def on_rigid_base(formulation, size, steps=4):
    model = elastic_model(layer(size), "plane_strain", E=E, nu=NU)
    base = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("base", secondary="CONT_LAYER", obstacle=base, formulation=formulation)
    return [step.contact["base"] for step in pressed(model, steps)]


def on_elastic_base(formulation, size, ratio):
    """The layer is `ratio` times as stiff as its base, a large block."""
    x, depth = lines(0.8 * size, 3.0, 200.0, growth=1.3), lines(size, 0.0, 200.0, growth=1.3)
    names = {"BLOCK": "BASE", "TOP": "CONT_BASE", "BOTTOM": "FAR", "LEFT": "AXIS"}
    base = fc.generate.renamed(graded_block(x, -depth[::-1], "quad4"), names.get)
    materials = {"LAYER": fc.LinearElastic(E=E, nu=NU), "BASE": fc.LinearElastic(E=E / ratio, nu=NU)}
    model = made_of(fc.generate.union(base, layer(size)), "plane_strain", materials, FAR="y")
    model.add_contact("base", secondary="CONT_LAYER", primary="CONT_BASE", formulation=formulation)
    return [step.contact["base"] for step in pressed(model, 2)]


def in_theory(ratio):
    return fc.analytic.receding_layer(
        E1=E, nu1=NU, E2=E / ratio if ratio else None, nu2=NU, thickness=1.0, force=2 * FORCE
    )


def pressure_fits(contact, load, exact, size):
    """Everywhere but in two facets at the edge, to 1 % of the largest."""
    x = contact.coordinates[:, 0]
    inner = x < exact.radius - 2 * size
    expected = load * exact.pressure(x[inner])
    assert contact.pressure[inner] == pytest.approx(expected, abs=0.01 * load * exact.pressure_max)


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_contact_on_a_rigid_base_is_the_same_from_first_to_last_load(formulation):
    size, exact = 0.05, in_theory(0.0)
    assert exact.radius == pytest.approx(0.85699, abs=5e-6)
    contacts = on_rigid_base(formulation, size)
    for load, contact in zip((0.25, 0.5, 0.75, 1.0), contacts, strict=True):
        assert contact.radius == pytest.approx(contacts[0].radius, rel=1e-12)
        inside, outside = contact.radius
        assert outside - inside <= size * (1 + 1e-9)
        assert inside - 0.5 * size < exact.radius < outside + 0.5 * size
        assert contact.force[1] == pytest.approx(load * FORCE, rel=1e-9)
        assert contact.pressure[0] == pytest.approx(load * exact.pressure_max, rel=5e-3)
        pressure_fits(contact, load, exact, size)


@pytest.mark.each_value
@pytest.mark.parametrize("ratio", [0.1, 1.0])
@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
def test_contact_with_an_elastic_base_that_does_not_match(formulation, ratio):
    """Nodal pressures are exact to 1 % with mortar only: the others fail the patch test on meshes like these."""
    size, exact = 0.1, in_theory(ratio)
    for load, contact in zip((0.5, 1.0), on_elastic_base(formulation, size, ratio), strict=True):
        inside, outside = contact.radius
        assert inside - 0.5 * size < exact.radius < outside + 0.5 * size
        assert contact.force[1] == pytest.approx(load * FORCE, rel=1e-9)
        if formulation == "mortar":
            pressure_fits(contact, load, exact, size)


def test_a_wider_load_widens_the_contact():
    """A strip load of half-width h on a rigid base: c/h = 1.402."""
    size, exact = 0.05, fc.analytic.receding_layer(E1=E, nu1=NU, thickness=1.0, force=2 * FORCE, load_half_width=1.0)
    model = elastic_model(layer(size), "plane_strain", E=E, nu=NU)
    base = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("base", secondary="CONT_LAYER", obstacle=base, formulation="continuous")
    model.fix("AXIS", "x")
    model.add_pressure("TOP", lambda x: np.where(x[:, 0] < 1.0, FORCE, 0.0))
    contact = fc.solve(model, fc.linear_ramp(1))[-1].contact["base"]
    assert contact.force[1] == pytest.approx(FORCE, rel=1e-9)
    assert contact.radius[0] - 0.5 * size < exact.radius < contact.radius[1] + 0.5 * size
    assert contact.pressure[0] == pytest.approx(exact.pressure_max, rel=5e-3)
