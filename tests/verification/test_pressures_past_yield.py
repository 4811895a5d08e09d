"""Contact pressures of bodies that yield on coarse meshes: how large their errors are, and what warnings tell."""

import re

import numpy as np
import pytest
from models import last_step, made_of, supported, united, with_contact

import fastcontact as fc

EDGE = (
    r"contact '\w+': the largest nodal pressure, (\S+), is within four facets of open nodes, and means over "
    r"neighbouring facets are at most (\S+)\. "
)


def told(model: fc.Model, steps: int) -> tuple[fc.StepResult, list[str]]:
    """Return the last step of a model and its warnings."""
    last, _ = last_step(model, steps)
    return last, list(last.warnings)


def below_a_ball(formulation: str, divisions: int, law=None, steps=5, ramp=None) -> tuple[float, list[str]]:
    """Return the largest nodal pressure below a ball, and the warnings."""
    mesh = fc.generate.block((1.0, 0.5), (divisions, divisions // 2), element="quad8")
    model = fc.Model(mesh, "axisymmetric", strain="finite")
    model.add_material(law or fc.ElasticPlastic(200e3, 0.3, yield_stress=300.0, hardening=[(0.0, 300.0), (0.2, 450.0)]))
    supported(model, BOTTOM="y", LEFT="x")
    ball = fc.obstacles.Sphere((0.0, 2.5), 2.0)
    options = {"formulation": formulation, "ramp": ramp}
    model.add_obstacle("ball", secondary="TOP", obstacle=ball, motion={"y": -0.04}, **options)
    last, texts = told(model, steps)
    return last.contact["ball"].pressure_max, texts


def test_pressures_overshoot_at_the_edge_past_yield() -> None:
    fine, (text,) = below_a_ball("mortar", 24)
    assert text.startswith("the plastic flow turns")
    for formulation in ("continuous", "node_to_segment"):
        largest, texts = below_a_ball(formulation, 12)
        (match,) = [match for text in texts if (match := re.match(EDGE, text))]
        high, low = map(float, match.groups())
        assert high == pytest.approx(largest, rel=1e-3)
        assert 0.85 * fine < low < fine < 0.8 * high
        assert texts[0].endswith("use smaller facets, or formulation mortar")
    largest, (text,) = below_a_ball("mortar", 12)
    assert text.startswith("the plastic flow turns")
    assert largest == pytest.approx(fine, rel=0.1)
    _, texts = below_a_ball("continuous", 12, steps=6, ramp=[(0.0, 0.0), (5 / 6, 1.0), (1.0, 0.9)])
    assert any(re.match("in load step 5, where its force is largest, " + EDGE, text) for text in texts)
    _, texts = below_a_ball("continuous", 12, fc.LinearElastic(200e3, 0.3))
    assert not any(re.match(EDGE, text) for text in texts)


@pytest.mark.parametrize(
    ("element", "formulation"),
    [("quad8", "continuous"), ("quad8", "node_to_segment"), ("quad8", "mortar"), ("tri6", None)],
)
def test_pressures_that_scatter_over_several_facets_are_accurate_or_told(element: str, formulation: str | None) -> None:
    """With quad8, mortar, facets of half the length and 16 steps, the largest pressure is 1391."""
    mesh = fc.generate.graded_block(element, width=6.0, contact_radius=0.6, contact_size=0.05)
    law = fc.ElasticPlastic(200e3, 0.3, yield_stress=400.0, hardening=[(0.0, 400.0), (0.2, 600.0)])
    model = made_of(mesh, "axisymmetric", law, strain="finite", BOTTOM="xy", SYMMETRY_X="x")
    ball, options = fc.obstacles.Sphere((0.0, 2.5), 2.5), {"formulation": formulation} if formulation else {}
    model.add_obstacle("ball", secondary="CONTACT", obstacle=ball, motion={"y": -0.05}, **options)
    last, texts = told(model, 8)
    if formulation in ("node_to_segment", "mortar"):
        assert last.contact["ball"].pressure_max == pytest.approx(1391.0, rel=0.07)
    else:
        (match,) = [match for text in texts if (match := re.match(EDGE, text))]
        high, low = map(float, match.groups())
        assert 0.95 * 1391.0 < low < 1391.0 < high


def dome_on_block(divisions: int, exchanged: bool, **options) -> fc.Model:
    """Return a model of a dome and a block that yield, with cells of 1 / 2 and 2 / 3 over the `divisions`."""
    block = fc.generate.box((2.0, 2.0, 1.0), (3 * divisions, 3 * divisions, 2 * divisions), name="A")
    dome = fc.generate.box((1.0, 1.0, 0.6), (2 * divisions, 2 * divisions, divisions), origin=(0.5, 0.5, 1.0), name="B")
    x, y, z = dome.points.T
    rise = 0.3 * ((x - 1.0) ** 2 + (y - 1.0) ** 2) * (1.6 - z) / 0.6
    dome = dome.replace(points=np.column_stack([x, y, z + rise]))
    law = fc.ElasticPlastic(200e3, 0.3, yield_stress=300.0, hardening=[(0.0, 300.0), (0.1, 400.0)])
    model = made_of(united(A_=block, B_=dome), "3d", law, strain="finite", A_ZMIN="xyz", B_ZMAX="xy")
    model.prescribe("B_ZMAX", z=-0.05)
    sides = ("A_ZMAX", "B_ZMIN") if exchanged else ("B_ZMIN", "A_ZMAX")
    return with_contact(model, "joint", sides[0], sides[1], **options)


def test_exchanged_sides_differ_by_the_error_of_the_mesh() -> None:
    """Weighted gaps of coarse facets do not see nodes between theirs; there are warnings as long as it matters.

    With cells of 1/4, 1/6 and 1/12 the forces differ by 15, 5 and 3 %, those of continuous contact by 0.8 and 0.6 %. On the
    coarsest of these meshes CalculiX 2.20 (C3D8R, contact from surface to surface) has 293.7 and 293.4.
    """
    _, texts = told(dome_on_block(1, True), 3)
    assert texts == [
        "contact 'joint' carries nothing although nodes of 'B_ZMIN' are up to 0.05 deep in the body of 'A_ZMAX': refine "
        "'A_ZMAX' if they lie between its nodes, or exchange the sides; otherwise check whether the sides face each other"
    ]
    for options, apart, error in (({}, 0.18, 0.18), ({"formulation": "continuous"}, 0.015, 0.06)):
        forces = []
        for exchanged in (False, True):
            model = dome_on_block(2, exchanged, **options)
            last, texts = told(model, 6)
            assert any("across its radius: its pressure needs 4 or more" in text for text in texts)
            forces.append(abs(last.contact["joint"].force[2]))
            assert abs(last.reaction[model.mesh.points_of("A_ZMIN"), 2].sum()) == pytest.approx(forces[-1], rel=1e-8)
        assert forces[1] == pytest.approx(forces[0], rel=apart)
        assert forces == pytest.approx([293.7, 293.4], rel=error)


@pytest.mark.parametrize("exchanged", [False, True])
@pytest.mark.parametrize(
    ("element", "strain", "bound"), [("quad8", "small", 1e-3), ("quad4", "small", 2e-3), ("quad8", "finite", 1e-3)]
)
def test_a_press_fit_past_yield(element: str, strain: str, bound: float, exchanged: bool) -> None:
    r"""An elastic ring of radii 20 and 50 in one of 50 and 100 that yields up to the radius c = 70, in plane strain.

    With :math:`k = Y / \sqrt 3`, the pressure is :math:`p = k (1 - c^2 / 100^2 + 2 \ln(c / 50))` (Hill, 1950, chapter 5). As
    plastic flow keeps the volume, and nothing flows along the axis, the displacement in the plastic zone is
    :math:`(1 + \nu) (1 - 2 \nu) r \sigma_r / E + 2 (1 - \nu^2) k c^2 / (E r)`. The inner ring is Lame's.
    """
    a, b, outer, c, E, nu, k = 20.0, 50.0, 100.0, 70.0, 200e3, 0.3, 200.0 / np.sqrt(3.0)
    pressure = k * (1.0 - (c / outer) ** 2 + 2.0 * np.log(c / b))
    bore = -(1.0 + nu) * (1.0 - 2.0 * nu) * b * pressure / E + 2.0 * (1.0 - nu**2) * k * c**2 / (E * b)
    shaft = (1.0 + nu) / E * b * pressure * ((1.0 - 2.0 * nu) * b**2 + a**2) / (b**2 - a**2)
    mesh = fc.generate.rings(element, divisions_inner=(4, 12), divisions_outer=(8, 14))
    model = fc.Model(mesh, "plane_strain", strain=strain)
    model.add_material(fc.LinearElastic(E, nu) if strain == "small" else fc.NeoHookean(E=E, nu=nu), "INNER")
    model.add_material(fc.ElasticPlastic(E, nu, yield_stress=200.0), "OUTER")
    supported(model, SYMMETRY_Y="y", SYMMETRY_X="x")
    sides = ("CONT_OUTER", "CONT_INNER") if exchanged else ("CONT_INNER", "CONT_OUTER")
    interference = {"clearance": -bore - shaft, "clearance_ramp": [(0.0, 0.0), (1.0, 1.0)]}
    model.add_contact("fit", secondary=sides[0], primary=sides[1], **interference)
    last = fc.solve(model, 5)[-1]
    contact = last.contact["fit"]
    mean = np.linalg.norm(contact.force_vectors, axis=1).sum() / (0.5 * np.pi * b)
    assert mean == pytest.approx(pressure, rel=bound)
    assert contact.pressure == pytest.approx(pressure, rel=0.015)
    middle = np.concatenate([mesh.points[cells].mean(axis=1) for cells in mesh.solids.values()])
    yielded = last.cell_fields["plastic_strain"] > 1e-6
    assert np.linalg.norm(middle[yielded], axis=1).max() == pytest.approx(c, abs=outer / 16.0)


# First yield under a ball: at a pressure of 1.6 Y, 0.48 contact radii below the surface (Johnson, 1985, section 6.1).

E, NU, Y, R = 1000.0, 0.3, 1.0, 10.0


def test_first_yield_under_a_ball() -> None:
    modulus = E / (1.0 - NU**2)
    unit = np.pi * R * Y / (2.0 * modulus)  # contact radius where the largest pressure is Y
    mesh = fc.generate.graded_block(element="quad8", width=20.0 * unit, contact_radius=2.0 * unit)
    model = made_of(mesh, "axisymmetric", fc.ElasticPlastic(E=E, nu=NU, yield_stress=Y), SYMMETRY_X="x", BOTTOM="y")
    force = 4.0 / 3.0 * modulus / R * unit**3  # p0 = Y; it grows with the third power
    model.add_obstacle("ball", secondary="TOP", obstacle=fc.obstacles.Sphere((0.0, R), R), force={"y": -force})
    pressures = np.array([1.5, 1.55, 1.6, 1.65, 1.7])
    steps = fc.solve(model, pressures**3)
    strain = [step.cell_fields["plastic_strain"].max() for step in steps]
    first = int(np.argmax(np.array(strain) > 0.0))
    assert strain[first] > 0.0
    assert 1.55 <= pressures[first] <= 1.65
    yielded = steps[first].cell_fields["plastic_strain"].argmax()
    place = np.concatenate([mesh.points[block].mean(axis=1) for block in mesh.solids.values()])[yielded]
    radius = pressures[first] * unit
    assert place[0] < 0.2 * radius
    assert place[1] == pytest.approx(-0.48 * radius, abs=0.1 * radius)
