"""Linearised contact geometry: derivatives compared with differences, and quadratic convergence of load steps."""

import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc
from fastcontact.analysis.iterate import Iterate, pair_surfaces
from fastcontact.analysis.problem import prepare

MESHES = {"A": "data/meshes/forma04a.med", "B": "data/meshes/forma04b.med", "C": "data/meshes/forma04c.med"}


def half_spheres(mesh, **options):
    model = elastic_model(fc.read_mesh(MESHES[mesh]), "axisymmetric", E=20_000.0, A1A2="x")
    model.prescribe("A2B2", y=-2.0)
    model.prescribe("A1B1", y=2.0)
    model.add_contact("hertz", secondary="CONT1", primary="CONT2", **options)
    return model


def ball_on_block(element, **options):
    mesh = fc.generate.sphere_on_block(element, contact_size=4.0, contact_radius=8.0)
    model = elastic_model(mesh, E=20_000.0, SYMMETRY_X="x", SYMMETRY_Z="z", BLOCK_BOTTOM="y")
    model.prescribe("SPHERE_TOP", y=-2.0)
    model.add_contact("hertz", secondary="CONT_SPHERE", primary="CONT_BLOCK", **options)
    return model


def ball_on_ball(element, **options):
    """Half a sphere on a rigid one."""
    mesh = fc.generate.sphere_octant(element, contact_size=4.0, contact_radius=8.0)
    model = elastic_model(mesh, E=20_000.0, SYMMETRY_X="x", SYMMETRY_Z="z")
    model.prescribe("SPHERE_TOP", y=-1.0)
    ball = fc.obstacles.Sphere(centre=(0.0, -60.0, 0.0), R=60.0)
    model.add_obstacle("hertz", secondary="CONT_SPHERE", obstacle=ball, **options)
    return model


DERIVATIVES = [
    # model, options, allowed error of the derivative: that of weighted gaps leaves out how cuts and weights move
    (half_spheres, "A", {"formulation": "node_to_segment"}, 1e-6),
    (half_spheres, "A", {"formulation": "node_to_segment", "normals": "averaged"}, 1e-6),
    (half_spheres, "B", {"formulation": "continuous"}, 1e-6),
    (half_spheres, "B", {"formulation": "continuous", "normals": "facet"}, 1e-6),
    (half_spheres, "C", {"formulation": "mortar", "multipliers": "dual"}, 0.02),
    (ball_on_block, "tet4", {"formulation": "node_to_segment"}, 0.05),  # angles of facets are held
    (ball_on_block, "hex8", {"formulation": "continuous"}, 0.05),
    (ball_on_block, "hex8", {"formulation": "mortar"}, 0.1),
    (ball_on_ball, "hex8", {"formulation": "node_to_segment"}, 1e-6),
    (ball_on_ball, "hex8", {"formulation": "mortar"}, 1e-5),
]


@pytest.mark.parametrize(("make", "mesh", "options", "error"), DERIVATIVES)
def test_forces_and_gaps_vary_as_their_differences(make, mesh, options, error):
    model = make(mesh, **options)
    step = fc.solve(model, fc.linear_ramp(2))[-1]
    problem = prepare(model, fc.linear_ramp(2), fc.Criteria(), linear_solver="direct")
    state, load, u = problem.initial_state(), problem.load_at(1.0), step.displacement.ravel()
    rng = np.random.default_rng(1)

    def paired(u):
        return pair_surfaces(problem, state, load, Iterate(u.copy(), {}, {})).parts["hertz"]

    here = paired(u)
    closed = here.usable & (here.gap0 + here.B @ u < 1e-3)
    multiplier = np.where(closed, rng.uniform(0.5, 1.0, len(here)), 0.0)
    # Both sides move as a whole over each other, turn and stretch; a little off, lest nodes pass the ends of facets.
    points, h = model.mesh.points, 1e-5
    du = points @ rng.normal(size=(points.shape[1],) * 2) / 50.0
    du[points[:, 1] > 0.0] += 0.02 * rng.normal(size=points.shape[1])

    def forces(u):
        at = paired(u)
        return at.force(multiplier), at.gap0 + at.B @ step.displacement.ravel()

    (force1, gap1), (force0, gap0) = forces(u + h * du.ravel()), forces(u - h * du.ravel())
    force, gap = here.geometry(multiplier).along(du)
    difference = (force1 - force0) / (2 * h)
    assert np.abs(difference).max() > 0.0
    assert np.abs(force.ravel() - difference).max() <= error * np.abs(difference).max()
    size = np.abs(du).max()
    assert np.abs(gap - (gap1 - gap0) / (2 * h))[closed].max() <= error * size


@pytest.mark.parametrize(
    ("make", "mesh", "options", "updates"),
    [
        (half_spheres, "A", {"formulation": "node_to_segment"}, 4),
        (half_spheres, "A", {}, 4),
        (half_spheres, "A", {"formulation": "continuous", "normals": "facet"}, 4),
        (half_spheres, "B", {}, 5),
        (half_spheres, "B", {"formulation": "continuous"}, 4),
        (half_spheres, "C", {}, 4),
        (half_spheres, "C", {"formulation": "mortar"}, 4),
        (half_spheres, "C", {"formulation": "node_to_segment"}, 5),
        (ball_on_block, "hex8", {"formulation": "continuous"}, 4),
        (ball_on_block, "tet4", {"formulation": "node_to_segment"}, 4),
        (ball_on_block, "hex8", {}, 5),
        (ball_on_ball, "hex8", {}, 3),
    ],
)
def test_load_steps_take_few_pairings_and_converge_quadratically(make, mesh, options, updates):
    """Alternating between pairing and solution takes 8 to 12, each with a fourth of the last change."""
    ramp = [k / 20.0 for k in range(1, 7)] if make is half_spheres else 4
    steps = fc.solve(make(mesh, **options), ramp, linear_solver="direct")
    counts = [step.iterations["geometry_updates"] + 1 for step in steps]
    assert max(counts) <= updates
    for step in steps[-2:]:
        changes = [entry["displacement_change"] for entry in step.iterations["history"]]
        before, change, last = changes[-3:]
        assert change < 0.01 * before
        assert last < 0.02 * change or last < 1e-11
