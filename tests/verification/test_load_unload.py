"""Loading and unloading, and swapping the sides: invariants of the result."""

import numpy as np
import pytest
from two_bodies import blocks, boxes, held, touching

import fastcontact as fc

FORMULATIONS = ("node_to_segment", "continuous", "mortar")
# Up in three steps, down again through the same loads, and up once more.
THERE_AND_BACK = fc.Ramp((1.0, 2.0, 3.0, 4.0, 5.0, 6.0), ((0.0, 0.0), (3.0, 1.0), (5.0, 1 / 3), (6.0, 2 / 3)))


def same(one, other, tolerance=1e-10):
    size = np.abs(other.displacement).max()
    assert np.abs(one.displacement - other.displacement).max() < tolerance * size
    assert np.abs(one.stress - other.stress).max() < 10 * tolerance * np.abs(other.stress).max()


# A node opposite a node may take the normal of either facet there, and keeps the one that the path led to.
AVERAGED = [("node_to_segment", "averaged")]


@pytest.mark.parametrize(
    ("formulation", "normals"), AVERAGED + [(f, n) for f in ("continuous", "mortar") for n in ("facet", "averaged")]
)
def test_without_friction_only_the_load_counts(formulation, normals, forma04):
    """The half-spheres, whose contact grows and shrinks."""
    mesh = fc.generate.half_spheres("quad4", arc_sizes=(1.0, 6.0), radial_sizes=(1.0, 6.0))
    steps = fc.solve(forma04(mesh, formulation, normals=normals), THERE_AND_BACK)
    same(steps[3], steps[1])
    same(steps[4], steps[0])
    same(steps[5], steps[1])
    assert steps[4].contact["hertz"].active.sum() < steps[2].contact["hertz"].active.sum()


@pytest.mark.parametrize("options", [{"penalty": 1e6}, {"clearance": 0.1}, {"clearance": -0.1}], ids=str)
def test_nor_does_the_path_with_options(options, forma04):
    mesh = fc.generate.half_spheres("quad4", arc_sizes=(1.0, 6.0), radial_sizes=(1.0, 6.0))
    steps = fc.solve(forma04(mesh, "mortar", **options), THERE_AND_BACK)
    same(steps[4], steps[0])


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


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("make", [blocks, boxes])
def test_swapping_sides_of_meshes_that_match_changes_nothing(make, formulation):
    mesh = make()
    kinematics = "3d" if mesh.dim == 3 else "plane_strain"
    one, other = (
        fc.solve(touching(held(mesh, kinematics), formulation, swap, clearance=0.004), fc.linear_ramp(1))[-1]
        for swap in (False, True)
    )  # fmt: skip
    same(one, other, 1e-12)
    assert one.contact["pair"].force == pytest.approx(-other.contact["pair"].force, rel=1e-10, abs=1e-10)
