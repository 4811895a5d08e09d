"""Loading and unloading, and swapping the sides: invariants of the result."""

import numpy as np
import pytest
from models import elastic_model
from two_bodies import blocks, boxes, held, touching

import fastcontact as fc

FORMULATIONS = ("node_to_segment", "continuous", "mortar")
# Up in three steps, down again through the same loads, and up once more.
THERE_AND_BACK = fc.Ramp((1.0, 2.0, 3.0, 4.0, 5.0, 6.0), ((0.0, 0.0), (3.0, 1.0), (5.0, 1 / 3), (6.0, 2 / 3)))


def same(one, other, tolerance=1e-10):
    assert np.abs(one.displacement - other.displacement).max() < tolerance * np.abs(other.displacement).max()
    assert np.abs(one.stress - other.stress).max() < 10 * tolerance * np.abs(other.stress).max()


# A node opposite a node may take the normal of either facet there, and keeps the one that the path led to.
AVERAGED = [("node_to_segment", {"normals": "averaged"})]


FIELDS = [(f, {"normals": n}) for f in ("continuous", "mortar") for n in ("facet", "averaged")]
OPTIONS = [("mortar", given) for given in ({"penalty": 1e6}, {"clearance": 0.1}, {"clearance": -0.1})]


@pytest.mark.parametrize(("formulation", "options"), AVERAGED + FIELDS + OPTIONS, ids=str)
def test_without_friction_only_the_load_counts(formulation, options, forma04):
    """The half-spheres, whose contact grows and shrinks."""
    mesh = fc.generate.half_spheres("quad4", arc_sizes=(1.0, 6.0), radial_sizes=(1.0, 6.0))
    steps = fc.solve(forma04(mesh, formulation, **options), THERE_AND_BACK)
    same(steps[3], steps[1])
    same(steps[4], steps[0])
    same(steps[5], steps[1])
    assert steps[4].contact["hertz"].active.sum() < steps[2].contact["hertz"].active.sum()


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_in_space_too(formulation):
    mesh = boxes(upper=(3, 2, 2) if formulation == "mortar" else (2, 3, 2), apart=0.001)
    steps = fc.solve(touching(held(mesh, "3d"), formulation, clearance=lambda x: 4e-4 * x[:, 0]), THERE_AND_BACK)
    same(steps[3], steps[1])
    same(steps[4], steps[0])


@pytest.mark.filterwarnings("ignore:contact .* has opened again at the end")  # drawn apart by a quarter of the approach
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_unloading_until_bodies_part_leaves_nothing(formulation, forma04):
    mesh = fc.generate.half_spheres("quad4", arc_sizes=(1.0, 6.0), radial_sizes=(1.0, 6.0))
    ramp = fc.Ramp((1.0, 2.0, 3.0), ((0.0, 0.0), (1.0, 1.0), (3.0, -0.5)))
    steps = fc.solve(forma04(mesh, formulation, normals="averaged"), ramp)
    assert not steps[2].contact["hertz"].active.any()
    assert np.abs(steps[2].stress).max() < 1e-9 * np.abs(steps[0].stress).max()


RAMP = fc.Ramp((0.5, 1.0, 2.0, 3.0, 4.0), ((0.0, 0.0), (1.0, 1.0), (9.0, 1.0)))
OF_CONSTANT_LOAD = [
    {"formulation": "continuous"},
    {"formulation": "mortar", "multipliers": "standard"},
    {"formulation": "mortar", "multipliers": "dual"},
    {"formulation": "node_to_segment"},
    {"formulation": "continuous", "tangential_penalty": 2e4},
]


def changes(model, name, first=1):
    """By how much tangential forces change in the steps after the load has come to rest, over the largest force."""
    steps = fc.solve(model, RAMP)
    shear = [step.contact[name].force_vectors for step in steps[first:]]
    assert np.abs(steps[first].contact[name].shear).max() > 0.05 * steps[first].contact[name].pressure.max()
    return max(np.abs(later - shear[0]).max() / np.abs(shear[0]).max() for later in shear[1:])


@pytest.mark.filterwarnings("ignore:.*nodal shear of sticking nodes oscillates")
@pytest.mark.each_value
@pytest.mark.parametrize("elements", ["tri3", "quad4", "quad8"])
@pytest.mark.parametrize("options", [OF_CONSTANT_LOAD[i] for i in (0, 2, 3, 4)], ids=str)
def test_ball_on_block(elements, options):
    mesh = fc.generate.graded_block(elements, width=10.0, depth=10.0, contact_radius=1.2, contact_size=0.2)
    model = elastic_model(mesh, "axisymmetric", SYMMETRY_X="x", BOTTOM="xy")
    ball = fc.obstacles.Sphere(centre=(0, 10.0), R=10.0)
    model.add_obstacle("ball", secondary="CONTACT", obstacle=ball, motion={"y": -0.1}, friction=0.3, **options)
    assert changes(model, "ball") < 1e-4


@pytest.mark.each_value
@pytest.mark.parametrize("options", OF_CONSTANT_LOAD, ids=str)
@pytest.mark.parametrize("elements", ["quad4", "tri6", "hex8"])
def test_stiff_body_on_soft_one(elements, options):
    """Pressed on each other and pulled along, so that some parts of the sides slide and others stick."""
    space = elements == "hex8"
    mesh = boxes(elements, (3, 2, 2), (4, 3, 2)) if space else blocks(elements, (8, 4), (6, 3))
    model = elastic_model(mesh, "3d" if space else "plane_strain")
    below, above = ("L_ZMIN", "U_ZMAX") if space else ("LOWER_BOTTOM", "UPPER_TOP")
    model.add_material(fc.LinearElastic(E=5000.0, nu=0.1), "U_BOX" if space else "UPPER")
    model.fix(below, "xyz" if space else "xy")
    model.prescribe(above, **{"z" if space else "y": -0.2, "x": 0.05, **({"y": 0.0} if space else {})})
    touching(model, friction=0.3, **options)
    assert changes(model, "pair") < 1e-4
