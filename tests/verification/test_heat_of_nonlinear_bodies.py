"""Heat in nonlinear bodies: free and constrained expansion, conduction in deformed bodies, coupling with contact."""

import numpy as np
import pytest
from models import made_of, supported, with_contact
from scipy.integrate import quad
from scipy.optimize import brentq, fsolve

import fastcontact as fc

pytestmark = pytest.mark.each_value

ALPHA = 1e-3
HOT = {"expansion": ALPHA, "conductivity": 10.0}
LAWS = {
    "neo_hookean": fc.NeoHookean(E=6.0, nu=0.3, **HOT),
    "nearly_incompressible": fc.NeoHookean(E=6.0, nu=0.4995, **HOT),
    "mooney_rivlin": fc.MooneyRivlin(C10=0.6, C01=0.3, bulk=20.0, **HOT),
    "yeoh": fc.Yeoh(C10=0.6, C20=0.1, C30=0.01, bulk=20.0, **HOT),
    "ogden": fc.Ogden(mu=[1.0, 0.2], alpha=[1.5, -2.0], bulk=20.0, **HOT),
    "saint_venant": fc.LinearElastic(E=6.0, nu=0.3, **HOT),
    "plastic": fc.ElasticPlastic(E=6.0, nu=0.3, yield_stress=0.1, **HOT),
}


def free_body(law, kinematics, element):
    """A body that supports leave to expand."""
    if kinematics == "3d":
        mesh, faces = fc.generate.box((1.0, 1.0, 1.0), (2, 2, 2), element), {"XMIN": "x", "YMIN": "y", "ZMIN": "z"}
    else:
        origin = (1.0, 0.0) if kinematics == "axisymmetric" else (0.0, 0.0)
        mesh, faces = fc.generate.block((1.0, 1.0), (2, 2), element, origin), {"LEFT": "x", "BOTTOM": "y"}
    model = made_of(mesh, kinematics, law, strain="small" if isinstance(law, fc.ElasticPlastic) else "finite")
    for face, axis in list(faces.items())[kinematics == "axisymmetric" :]:
        model.fix(face, axis)
    return model


@pytest.mark.filterwarnings("ignore:temperatures and initial states cause strains")
@pytest.mark.parametrize(
    ("law", "kinematics", "element"),
    [(law, "axisymmetric", "quad8") for law in LAWS]
    + [("neo_hookean", "plane_stress", "tri6"), ("plastic", "plane_stress", "quad4"), ("saint_venant", "3d", "tet10"),
       ("nearly_incompressible", "3d", "hex8"), ("ogden", "plane_stress", "quad8")],
)  # fmt: skip
def test_free_expansion_is_without_stress(law, kinematics, element):
    model = free_body(LAWS[law], kinematics, element)
    model.fix_temperature("ZMAX" if kinematics == "3d" else "TOP", 100.0)
    step = fc.solve(model, 1)[-1]
    assert step.displacement == pytest.approx(0.1 * model.mesh.points, abs=1e-10)
    assert np.abs(step.stress).max() < 1e-8
    if law != "plastic":
        assert step.cell_fields["J"] == pytest.approx(1.1**3, rel=1e-10)


def test_given_temperatures_expand_as_computed_ones_and_axes_have_their_own():
    wood = {"E": (9.0, 5.0, 4.0), "nu": (0.2, 0.2, 0.2), "G": (2.0, 2.0, 2.0), "axes": [[1, 1, 0], [-1, 1, 0]]}
    model = free_body(fc.Orthotropic(**wood, expansion=(3e-3, 1e-3, 2e-3)), "plane_stress", "quad8")
    model.supports.clear()
    supported(model, BOTTOM_LEFT="xy", TOP_RIGHT="x")
    model.add_temperature(120.0, reference=20.0)
    step = fc.solve(model, [0.5, 1.0])[-1]
    assert np.abs(step.stress).max() < 1e-8
    u = step.displacement[model.mesh.points_of("TOP_RIGHT")[0]]
    assert np.hypot(1.0 + u[0], 1.0 + u[1]) == pytest.approx(np.sqrt(2.0) * 1.3, rel=1e-10)  # along the first axis
    assert step.cell_fields["J"] == pytest.approx(1.3 * 1.1 * 1.2, rel=1e-10)


@pytest.mark.filterwarnings("ignore:temperatures and initial states cause strains")
@pytest.mark.parametrize("conducted", [True, False])
def test_a_held_bar_yields_as_it_is_heated_and_is_pulled_as_it_cools(conducted):
    E, alpha, yields, slope = 200e3, 1e-5, 200.0, 10e3
    table = [(0.0, yields), (1.0, yields + slope)]
    law = fc.ElasticPlastic(E, 0.3, yield_stress=yields, hardening=table, expansion=alpha, conductivity=50.0)
    model = free_body(law, "plane_stress", "quad4")
    model.fix("RIGHT", "x")
    ramp = [(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)]
    if conducted:
        model.fix_temperature("LEFT", 300.0, ramp=ramp)
    else:
        model.add_temperature(300.0, ramp=ramp)
    hot, cold = fc.solve(model, [1.0, 2.0])
    p = (E * alpha * 300.0 - yields) / (E + slope)
    assert hot.stress[:, 0] == pytest.approx(-(yields + slope * p), rel=1e-9)
    assert hot.cell_fields["plastic_strain"] == pytest.approx(p, rel=1e-9)
    back = -(yields + slope * p) + E * alpha * 300.0  # elastic, and beyond yielding in tension
    more = (back - (yields + slope * p)) / (E + slope)
    assert more > 0.0
    assert cold.cell_fields["plastic_strain"] == pytest.approx(p + more, rel=1e-9)
    assert cold.stress[:, 0] == pytest.approx(yields + slope * (p + more), rel=1e-9)


BARS = {"size_lower": (0.05, 0.1), "size_upper": (0.05, 0.1), "divisions_lower": (3, 8), "divisions_upper": (4, 8)}
STIFFNESS, K = 2e9, {"UPPER": 50.0, "LOWER": 20.0}


def law_of_contact(pressure, gap):
    return 1000.0 + 2e-5 * pressure


def column(alpha, conductance=law_of_contact, element="quad8"):
    """Two bars that stretch along y alone, held at their outer ends."""
    model = fc.Model(fc.generate.block_on_block(element, **BARS), "plane_strain", strain="finite")
    for body, own in K.items():
        model.add_material(fc.LinearElastic(E=STIFFNESS, nu=0.0, expansion=alpha, conductivity=own), body)
        model.fix(body, "x")
    supported(model, LOWER_BOTTOM="y", UPPER_TOP="y")
    model.fix_temperature("UPPER_TOP", 100.0)
    model.fix_temperature("LOWER_BOTTOM", 0.0)
    return with_contact(model, "c", "CONT_UPPER", "CONT_LOWER", conductance=conductance)


def column_exact(alpha, L=0.1):
    """Flux and pressure: dT/dX = q stretch / k, stretches by Saint Venant-Kirchhoff's law, both lengths together 2 L."""

    def stretch(force, degrees):
        grown = 1.0 + alpha * degrees  # in all directions, of which two are held
        nominal = lambda e: grown**2 * e * 0.5 * STIFFNESS * (e**2 - 1.0) + force  # noqa: E731
        return grown * brentq(nominal, 0.6, 2.0, xtol=1e-15)

    def length_left(force, flux, begin, end, k):
        return quad(lambda t: k / (flux * stretch(force, t)), begin, end, epsabs=1e-14)[0] - L

    def missing(unknown):
        force, flux, upper, lower = unknown * np.array([1e8, 1e4, 100.0, 100.0])
        bars = (50.0 * (100.0 - upper) + 20.0 * lower) / flux
        return [
            length_left(force, flux, upper, 100.0, 50.0) / L, length_left(force, flux, 0.0, lower, 20.0) / L,
            bars / (2.0 * L) - 1.0, flux / (law_of_contact(force, 0.0) * (upper - lower)) - 1.0,
        ]  # fmt: skip

    force, flux, upper, lower = fsolve(missing, [1.0, 1.2, 0.75, 0.625], xtol=1e-13)
    return force * 1e8, flux * 1e4, 100.0 * upper, 100.0 * lower


def test_hot_bars_press_and_conduct_as_their_stretches_say():
    step = fc.solve(column(ALPHA), 2)[-1]
    force, flux, upper, lower = column_exact(ALPHA)
    contact, mesh = step.contact["c"], step.temperature
    assert force > 0.02 * STIFFNESS  # expansion by 5 % is held
    assert contact.pressure == pytest.approx(force, rel=1e-6)
    assert contact.heat_flux == pytest.approx(flux, rel=1e-6)
    points = column(ALPHA).mesh
    assert mesh[points.points_of("CONT_UPPER")] == pytest.approx(upper, rel=1e-6)
    assert mesh[points.points_of("CONT_LOWER")] == pytest.approx(lower, rel=1e-6)
    assert step.heat["exchanges"] > 2


@pytest.mark.filterwarnings("ignore:contact .* supports hold .* of the .* facets")
@pytest.mark.parametrize("formulation", ["mortar", "continuous", "node_to_segment"])
def test_heat_is_conducted_in_the_deformed_bodies_and_across_the_deformed_contact(formulation):
    mesh = fc.generate.block_on_block("quad4", **{**BARS, "divisions_upper": (3, 8)})
    model = fc.Model(mesh, "plane_strain", strain="finite")
    for body, own in K.items():
        model.add_material(fc.LinearElastic(E=STIFFNESS, nu=0.0, conductivity=own), body)
        model.prescribe(body, x=lambda p: 0.2 * p[:, 0], y=lambda p: -0.1 * p[:, 1])
    model.fix_temperature("UPPER_TOP", 100.0)
    model.fix_temperature("LOWER_BOTTOM", 0.0)
    with_contact(model, "c", "CONT_UPPER", "CONT_LOWER", conductance=1000.0, kind="tied", formulation=formulation)
    step = fc.solve(model, 1)[-1]
    flux = 100.0 / (0.09 / 50.0 + 1.0 / 1000.0 + 0.09 / 20.0)
    assert step.heat_flux[:, 1] == pytest.approx(-flux, rel=1e-9)
    assert step.contact["c"].heat_flux == pytest.approx(flux, rel=1e-9)
    assert step.heat["contacts"]["c"] == pytest.approx(flux * 0.05 * 1.2, rel=1e-9)


@pytest.mark.parametrize("kinematics", ["plane_strain", "axisymmetric", "3d"])
def test_films_fluxes_and_sources_count_deformed_areas_and_volumes(kinematics):
    """A bar that is 1.3 times as wide and 0.9 times as long, with a source, a flux at its top and a film at its bottom."""
    if kinematics == "3d":
        mesh, top, bottom = fc.generate.box((1.0, 1.0, 2.0), (1, 1, 4), "hex20"), "ZMAX", "ZMIN"
    else:
        mesh, top, bottom = fc.generate.block((1.0, 2.0), (2, 4), "quad8"), "TOP", "BOTTOM"
    axis = "xyz"[mesh.dim - 1]
    model = fc.Model(mesh, kinematics, strain="finite", reference_temperature=10.0)
    model.add_material(fc.LinearElastic(E=1.0, nu=0.0, conductivity=5.0))
    wide = {name: lambda x, i=i: 0.3 * x[:, i] for i, name in enumerate("xyz"[: mesh.dim - 1])}
    model.prescribe("BOX" if kinematics == "3d" else "BLOCK", **wide, **{axis: lambda x: -0.1 * x[:, -1]})
    model.add_heat_source(lambda x: 2.0 * x[:, -1])  # by positions before the deformation
    model.add_heat_flux(top, 3.0)
    model.add_film(bottom, lambda x: 4.0 + 0.0 * x[:, 0], 20.0)
    step = fc.solve(model, 1)[-1]
    z = mesh.points[:, -1]
    flux = 3.0 + 0.9 * (4.0 - z**2)  # downwards, through the area as it is
    exact = 20.0 + flux[z == 0.0][0] / 4.0 + 0.9 / 5.0 * ((3.0 + 3.6) * z - 0.9 * z**3 / 3.0)
    assert step.temperature == pytest.approx(exact, rel=1e-4)  # quadratic cells, a cubic
    assert step.temperature[z == 0.0] == pytest.approx(exact[z == 0.0], rel=1e-10)
    area = {"plane_strain": 1.3, "axisymmetric": np.pi * 1.69, "3d": 1.69}[kinematics]
    assert step.heat["films"] == pytest.approx(-6.6 * area, rel=1e-10)


def test_a_plastic_law_that_does_not_yield_exchanges_heat_as_a_linear_one():
    results = []
    for law in (fc.LinearElastic, lambda **given: fc.ElasticPlastic(**given, yield_stress=1e12)):
        model = fc.Model(fc.generate.block_on_block("quad4", **BARS), "axisymmetric")
        model.add_material(law(E=2e11, nu=0.3, expansion=1e-5, conductivity=50.0, volumetric="mean_dilatation"))
        supported(model, LOWER_BOTTOM="y", UPPER_TOP="y")
        model.fix_temperature("UPPER_TOP", 100.0)
        model.add_film("LOWER_BOTTOM", 500.0, 0.0)
        model.add_contact("c", secondary="CONT_UPPER", primary="CONT_LOWER", friction=0.3, conductance=law_of_contact)
        results.append(fc.solve(model, 2)[-1])
    linear, plastic = results
    assert plastic.temperature == pytest.approx(linear.temperature, rel=1e-8)
    assert plastic.displacement == pytest.approx(linear.displacement, abs=1e-8 * np.abs(linear.displacement).max())
    assert plastic.stress == pytest.approx(linear.stress, abs=1e-7 * np.abs(linear.stress).max())
