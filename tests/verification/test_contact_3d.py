"""Node-to-segment and continuous contact in three dimensions: patch tests, spheres, equilibrium, invariance."""

import numpy as np
import pytest
from models import elastic_model, supported, with_contact
from pairwise import first_of

import fastcontact as fc
from fastcontact.mesh.generate import box, merge_points, renamed, sphere_octant, sphere_on_block, union

pytestmark = pytest.mark.each_value

LINEAR = ("hex8", "tet4", "wedge6", "pyramid5")
QUADRATIC = ("hex20", "hex27", "tet10", "wedge15", "wedge18", "pyramid13")
E, NU = 1000.0, 0.3


def body(name, element, divisions, z):
    """A unit cube with its groups; "mixed" stands for hexahedra and wedges side by side."""
    if element in ("mixed", "mixed quadratic"):
        left, right = ("hex8", "wedge6") if element == "mixed" else ("hex20", "wedge15")
        halves = [
            renamed(box((0.5, 1.0, 1.0), divisions, kind, (x, 0.0, z), name=name), {inner: None})
            for kind, x, inner in ((left, 0.0, "XMAX"), (right, 0.5, "XMIN"))
        ]
        part = merge_points(union(*halves), tolerance=1e-9)
    else:
        part = box((1.0, 1.0, 1.0), divisions, element, (0.0, 0.0, z), name=name)
    return renamed(part, lambda group: group if group == name else f"{name}_{group}")


def two_cubes(lower, upper, divisions=((2, 3, 2), (2, 3, 2))):
    return union(body("LOWER", lower, divisions[0], -1.0), body("UPPER", upper, divisions[1], 0.0))


def pressed(mesh, formulation, swap=False, push=0.01, **options):
    model = elastic_model(mesh, "3d", E=E, nu=NU)
    for name in ("LOWER", "UPPER"):
        supported(model, **{f"{name}_XMIN": "x", f"{name}_YMIN": "y"})
    supported(model, LOWER_ZMIN="z", UPPER_ZMAX={"z": -push})
    sides = ("UPPER_ZMIN", "LOWER_ZMAX") if swap else ("LOWER_ZMAX", "UPPER_ZMIN")
    return with_contact(model, "pair", sides[0], sides[1], formulation=formulation, **options)


def is_uniform(last, pressure, tolerance=1e-10):
    assert np.abs(last.stress[:, 2] + pressure).max() < tolerance * pressure
    assert np.abs(last.stress[:, [0, 1, 3, 4, 5]]).max() < tolerance * pressure
    assert last.contact["pair"].pressure == pytest.approx(pressure, rel=tolerance)
    assert last.contact["pair"].active.all()


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize(
    ("element", "formulation"),
    [(e, "node_to_segment") for e in (*LINEAR, "hex27", "mixed")]
    + [(e, "continuous") for e in (*LINEAR, *QUADRATIC, "mixed", "mixed quadratic")],
)
def test_matching_meshes_transmit_a_uniform_pressure_exactly(element, formulation, swap):
    is_uniform(fc.solve(pressed(two_cubes(element, element), formulation, swap), fc.linear_ramp(2))[-1], E * 0.01 / 2.0)


# Where they make sense: two points do not determine quadratic fields, some corners have no area.
RULES = [(e, {"integration": "simpson"}) for e in ("hex8", "tet4", "hex20", "tet10", "hex27")]
RULES += [(e, {"n_gauss": 5}) for e in ("hex8", "tet4", "hex20", "tet10", "hex27")]
RULES += [(e, {"n_gauss": 2}) for e in ("hex8", "tet4")] + [(e, {"n_gauss": 3}) for e in ("hex20", "tet10", "hex27")]
RULES += [(e, {"integration": "node"}) for e in ("hex8", "tet4", "hex27")]


@pytest.mark.parametrize(("element", "options"), RULES)
def test_the_continuous_pressure_is_exact_with_every_rule(element, options):
    is_uniform(fc.solve(pressed(two_cubes(element, element), "continuous", **options), fc.linear_ramp(1))[-1], 5.0)


@pytest.mark.parametrize(("lower", "upper"), [("hex8", "hex20"), ("hex27", "hex8")])
def test_a_finer_field_on_a_flat_primary_side_is_exact_too(lower, upper):
    """Facets nested in those of the other side: every rule integrates their gap exactly."""
    mesh = two_cubes(lower, upper, ((4, 4, 2), (2, 2, 2)))
    is_uniform(fc.solve(pressed(mesh, "continuous"), fc.linear_ramp(1))[-1], 5.0)


def test_meshes_that_do_not_match_transmit_the_force():
    """Neither formulation passes the patch test there; the resultant is that of the pressure, the error bounded."""
    mesh = two_cubes("hex8", "hex8", ((3, 3, 2), (4, 4, 2)))
    for formulation, force, pressure in (("node_to_segment", 1e-2, 0.3), ("continuous", 1e-3, 0.1)):
        contact = fc.solve(pressed(mesh, formulation), fc.linear_ramp(1))[-1].contact["pair"]
        assert -contact.force[2] == pytest.approx(5.0, rel=force)
        assert contact.pressure == pytest.approx(5.0, rel=pressure)


# Spheres: R = 50, E = 20 000, nu = 0.3.


def sphere_model(mesh, formulation, swap=False, push=0.5, **options):
    model = elastic_model(mesh, "3d", E=20_000.0, SYMMETRY_X="x", SYMMETRY_Z="z", SPHERE_TOP={"y": -push})
    sides = ("CONT_BLOCK", "CONT_SPHERE") if swap else ("CONT_SPHERE", "CONT_BLOCK")
    return with_contact(model, "hertz", sides[0], sides[1], formulation=formulation, **options)


def on_rigid_plate(element, formulation, **sizes):
    """The sphere on a plate all of whose nodes are held: half of two equal spheres."""
    sphere = sphere_octant(element, **sizes)
    plate = box((30.0, 10.0, 30.0), (1, 1, 1), "hex8", (0.0, -10.0, 0.0), name="PLATE")
    return supported(sphere_model(union(sphere, renamed(plate, {"YMAX": "CONT_BLOCK"})), formulation), PLATE="xyz")


def on_elastic_block(element, formulation, contact_size, swap=False, **options):
    mesh = sphere_on_block(element, size=12.5, contact_size=contact_size, contact_radius=6.0)
    return supported(sphere_model(mesh, formulation, swap, **options), BLOCK_BOTTOM="y")


def measured(contact):
    """Force over all four quarters, pressure at the pole, and radius from the first moment of the pressure.

    Under Hertz's pressure the mean distance of the force from the axis is 3 pi / 16 of the radius.
    """
    push = contact.force_vectors[:, 1] * np.sign(contact.force[1])
    radius = 16 / (3 * np.pi) * (push @ contact.abscissa) / push.sum()
    return 4 * push.sum(), contact.pressure[np.argmin(contact.abscissa)], radius


def plate_contact(element, formulation, contact_size):
    """All sizes of the mesh but the finely meshed radius fall together; quadratic elements do with a coarser one."""
    sizes = {"size": 8.0 * contact_size, "contact_radius": 6.0, "growth": 0.2 * contact_size}
    if element != "hex8":
        sizes = {"size": 25.0, "contact_radius": 5.0}
    model = on_rigid_plate(element, formulation, contact_size=contact_size, **sizes)
    return fc.solve(model, fc.linear_ramp(1), linear_solver="direct")[-1].contact["hertz"]


@pytest.mark.parametrize(
    ("element", "formulation", "contact_size", "tolerances"),
    [
        ("hex8", "node_to_segment", 1.4, (0.01, 0.01, 0.01)),
        ("hex8", "continuous", 1.2, (0.01, 0.02, 0.01)),
        pytest.param("hex27", "continuous", 1.5, (0.01, 0.02, 0.01), marks=pytest.mark.slow),
        pytest.param("hex20", "continuous", 1.5, (0.01, 0.02, 0.01), marks=pytest.mark.slow),
    ],
)
def test_a_sphere_on_a_rigid_plate_is_half_of_two_spheres(element, formulation, contact_size, tolerances):
    """Force, pressure and radius of the mesh-converged finite bodies, not of Hertz: a/R is 0.1 here."""
    exact = fc.analytic.finite_half_spheres(1.0)
    contact = plate_contact(element, formulation, contact_size)
    for value, reference, tolerance in zip(
        measured(contact), (exact.force, exact.pressure_max, exact.radius), tolerances, strict=True
    ):
        assert value == pytest.approx(reference, rel=tolerance)
    inner, outer = contact.radius
    assert inner - contact_size < exact.radius < outer + contact_size


DIRECT, DUAL = ("direct", 0.02, {}), ("amg", 0.01, {"multipliers": "dual"})
ON_A_BLOCK = [("node_to_segment", False, *DIRECT), ("continuous", False, *DIRECT), ("mortar", False, *DUAL),
              ("mortar", True, *DUAL), ("node_to_segment", True, *DIRECT), ("continuous", True, *DIRECT)]  # fmt: skip


@pytest.mark.parametrize(("formulation", "swap", "solver", "tolerance", "options"), first_of(4, ON_A_BLOCK))
def test_a_sphere_on_an_elastic_block_agrees_with_hertz_at_equal_force(formulation, swap, solver, tolerance, options):
    model = on_elastic_block("hex8", formulation, 1.4, swap, **options)
    force, pressure, radius = measured(fc.solve(model, fc.linear_ramp(1), linear_solver=solver)[-1].contact["hertz"])
    hertz = fc.analytic.hertz_point(E1=20_000.0, nu1=0.3, R1=50.0, E2=20_000.0, nu2=0.3, force=force)
    assert pressure == pytest.approx(hertz.pressure_max, rel=tolerance)
    assert radius == pytest.approx(hertz.radius, rel=tolerance)
