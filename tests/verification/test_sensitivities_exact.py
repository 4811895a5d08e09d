"""Sensitivities compared with exact derivatives: a bar, Lamé's press fit, Hertz, and scaling invariants.

Measured: the bar and the identities hold to round-off; Lamé's force by interference and constants is right to 7e-4, the error
of the mesh; Hertz's powers of the force to 7 %.
"""

import pytest
from models import elastic_model, made_of, supported, with_contact

import fastcontact as fc

TIGHT = fc.Criteria(relative=1e-10)
LAME = 1e-3


def test_a_bar():
    length, E, traction = 10.0, 1000.0, 2.0
    model = elastic_model(fc.generate.block((length, 1.0), (5, 2)), "plane_stress", E=E, LEFT="x", BOTTOM="y")
    model.add_traction("RIGHT", x=traction)
    step = fc.solve(model, 1)[-1]
    corner = int(model.mesh.points_of("TOP_RIGHT")[0])
    found = fc.sensitivities(
        model, step, ("displacement", corner, "x"), [("E", 0), ("load", "RIGHT"), ("nu", 0)], ramp=1
    )
    stretch = traction * length / E
    assert found.value == pytest.approx(stretch, rel=1e-12)
    assert found.solutions == 1
    assert found.derivatives["E", 0] == pytest.approx(-stretch / E, rel=1e-10)
    assert found.derivatives["load", "RIGHT"] == pytest.approx(stretch, rel=1e-12)
    assert found.derivatives["nu", 0] == pytest.approx(0.0, abs=1e-10 * stretch)
    across = fc.sensitivities(model, step, ("displacement", corner, "y"), [("nu", 0), ("E", 0)], ramp=1)
    assert across.derivatives["nu", 0] == pytest.approx(-traction / E, rel=1e-10)
    assert across.derivatives["E", 0] == pytest.approx(0.3 * traction / E**2, rel=1e-10)


def press_fit_pressure(a, b, c, E, nu, E_hub, nu_hub, interference):
    """Return the pressure of a bush (a, b) in a hub (b, c), plane stress: Lamé, in Timoshenko, Theory of Elasticity, 28."""
    bush = ((b**2 + a**2) / (b**2 - a**2) - nu) / E
    hub = ((c**2 + b**2) / (c**2 - b**2) + nu_hub) / E_hub
    return interference / (b * (bush + hub))


def test_the_press_fit_of_lame():
    mesh = fc.generate.rings("quad8", divisions_inner=(4, 12), divisions_outer=(6, 12))
    materials = {"INNER": fc.LinearElastic(E=2e5, nu=0.3), "OUTER": fc.LinearElastic(E=7e4, nu=0.25)}
    model = made_of(mesh, "plane_stress", materials, SYMMETRY_X="x", SYMMETRY_Y="y")
    # So small that the radius at which the parts meet stays the same, as in the formula.
    model.add_contact("fit", secondary="CONT_INNER", primary="CONT_OUTER", clearance=-1e-4)
    step = fc.solve(model, 1, criteria=TIGHT)[-1]
    given = {"E": 2e5, "nu": 0.3, "E_hub": 7e4, "nu_hub": 0.25, "interference": 1e-4}
    by = {"E": ("E", "INNER"), "nu": ("nu", "INNER"), "E_hub": ("E", "OUTER"), "nu_hub": ("nu", "OUTER")}
    by["interference"] = ("clearance", "fit")
    found = fc.sensitivities(model, step, ("contact_force", "fit", "x"), list(by.values()), ramp=1, criteria=TIGHT)

    def theory(**constants):  # on a quarter of the bush, by the thickness
        return -50.0 * press_fit_pressure(20.0, 50.0, 100.0, **constants)

    assert found.value == pytest.approx(theory(**given), rel=LAME)
    for name, parameter in by.items():
        more, less = ({**given, name: given[name] * (1.0 + part)} for part in (1e-5, -1e-5))
        exact = (theory(**more) - theory(**less)) / (2e-5 * given[name])
        exact *= -1.0 if name == "interference" else 1.0
        assert found.derivatives[parameter] == pytest.approx(exact, rel=LAME), name


def ball_on_plane(force: float, size: float) -> fc.Model:
    model = fc.Model(fc.generate.half_spheres(size=8.0, contact_size=size), kinematics="axisymmetric")
    model.add_material(fc.LinearElastic(E=20_000.0, nu=0.3), "SPHHAU")
    model.add_material(fc.LinearElastic(E=30_000.0, nu=0.2), "SPHBAS")
    supported(model, A1A2="x", A2B2={"y": 0.0})
    model.add_pressure("A1B1", force)
    return with_contact(model, "hertz", "CONT1", "CONT2")


def test_hertz_and_what_scaling_leaves_the_same():
    model = ball_on_plane(4.0, 0.5)
    step = fc.solve(model, 1, criteria=TIGHT)[-1]
    by = [("E", "SPHHAU"), ("E", "SPHBAS"), ("load", "A1B1")]
    force = fc.sensitivities(model, step, ("contact_force", "hertz", "y"), by, ramp=1, criteria=TIGHT)
    # The force is that of the load, whatever the moduli.
    assert force.derivatives["load", "A1B1"] == pytest.approx(force.value, rel=1e-9)
    assert 20_000.0 * force.derivatives["E", "SPHHAU"] == pytest.approx(0.0, abs=1e-8 * abs(force.value))
    pressure = fc.sensitivities(model, step, ("pressure_max", "hertz"), by, ramp=1, criteria=TIGHT)
    moduli = 20_000.0 * pressure.derivatives["E", "SPHHAU"] + 30_000.0 * pressure.derivatives["E", "SPHBAS"]
    # Moduli and load times a number leave displacements as they are: pressures are homogeneous of degree one in them.
    assert moduli + pressure.derivatives["load", "A1B1"] == pytest.approx(pressure.value, rel=1e-8)
    # p0 goes with F^(1/3) and E^(2/3); the largest nodal pressure changes with where the edge of the contact lies in a facet.
    assert pressure.derivatives["load", "A1B1"] / pressure.value == pytest.approx(1 / 3, rel=0.15)
    assert moduli / pressure.value == pytest.approx(2 / 3, rel=0.1)


def test_prescribed_displacements_scale_forces_with_moduli():
    model = fc.Model(fc.generate.sphere_on_block("hex8", R=10.0, contact_size=2.0, size=5.0), kinematics="3d")
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3), "SPHERE")
    model.add_material(fc.LinearElastic(E=3000.0, nu=0.2), "BLOCK")
    supported(model, SYMMETRY_X="x", SYMMETRY_Z="z", BLOCK_BOTTOM="y", SPHERE_TOP={"y": -0.3})
    model.add_contact("c", secondary="CONT_SPHERE", primary="CONT_BLOCK")
    step = fc.solve(model, 1, criteria=TIGHT)[-1]
    for quantity in (("contact_force", "c", "y"), ("pressure_max", "c"), ("reaction", "SPHERE_TOP", "y")):
        found = fc.sensitivities(model, step, quantity, [("E", "SPHERE"), ("E", "BLOCK")], ramp=1, criteria=TIGHT)
        total = 1000.0 * found.derivatives["E", "SPHERE"] + 3000.0 * found.derivatives["E", "BLOCK"]
        assert total == pytest.approx(found.value, rel=1e-8)
