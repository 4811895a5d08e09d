"""Linearised contact geometry: derivatives compared with differences, and quadratic convergence of load steps."""

from dataclasses import replace

import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc
from fastcontact.analysis.inequalities import Iterate, pair_surfaces
from fastcontact.analysis.problem import prepare
from fastcontact.contact.pairing import normals

MESHES = {"A": "data/meshes/forma04a.med", "B": "data/meshes/forma04b.med", "C": "data/meshes/forma04c.med"}


def half_spheres(mesh, **options):
    model = elastic_model(fc.read_mesh(MESHES[mesh]), "axisymmetric", E=20_000.0, A1A2="x", A2B2={"y": -2.0})
    model.prescribe("A1B1", y=2.0)
    model.add_contact("hertz", secondary="CONT1", primary="CONT2", **options)
    return model


def ball_on_block(element, **options):
    mesh = fc.generate.sphere_on_block(element, contact_size=4.0, contact_radius=8.0)
    model = elastic_model(mesh, E=20_000.0, SYMMETRY_X="x", SYMMETRY_Z="z", BLOCK_BOTTOM="y", SPHERE_TOP={"y": -2.0})
    model.add_contact("hertz", secondary="CONT_SPHERE", primary="CONT_BLOCK", **options)
    return model


def ball_on_ball(element, **options):
    """Half a sphere on a rigid one."""
    mesh = fc.generate.sphere_octant(element, contact_size=4.0, contact_radius=8.0)
    model = elastic_model(mesh, E=20_000.0, SYMMETRY_X="x", SYMMETRY_Z="z", SPHERE_TOP={"y": -1.0})
    ball = fc.obstacles.Sphere(centre=(0.0, -60.0, 0.0), R=60.0)
    model.add_obstacle("hertz", secondary="CONT_SPHERE", obstacle=ball, **options)
    return model


def blocks(mesh, **options):
    """A block drawn over a wider one."""
    sizes = {"size_lower": (14.0, 4.0), "size_upper": (6.0, 3.0), "shift": 4.0}
    mesh = fc.generate.block_on_block(mesh, **sizes, divisions_lower=(14, 4), divisions_upper=(9, 4))
    model = elastic_model(mesh, LOWER_BOTTOM="xy", UPPER_TOP={"x": 0.05, "y": -0.05})
    model.add_contact("hertz", secondary="CONT_UPPER", primary="CONT_LOWER", **options)
    return model


def pressed_ball(element, **options):
    """A sphere on a block that a pressure presses; contact alone holds it vertically."""
    mesh = fc.generate.sphere_on_block(element, contact_size=4.0, contact_radius=8.0)
    model = elastic_model(mesh, E=20_000.0, SYMMETRY_X="x", SYMMETRY_Z="z", BLOCK_BOTTOM="y")
    model.add_pressure("SPHERE_TOP", 20.0)
    model.add_contact("hertz", secondary="CONT_SPHERE", primary="CONT_BLOCK", **options)
    return model


def loose_blocks(mesh, **options):
    """A block that lies on a wider one without supports, pressed and pushed."""
    sizes = {"size_lower": (14.0, 4.0), "size_upper": (6.0, 3.0), "shift": 4.0}
    mesh = fc.generate.block_on_block(mesh, **sizes, divisions_lower=(14, 4), divisions_upper=(9, 4))
    model = elastic_model(mesh, LOWER_BOTTOM="xy")
    model.add_traction("UPPER_TOP", x=0.1, y=-1.0)
    model.add_contact("hertz", secondary="CONT_UPPER", primary="CONT_LOWER", **options)
    return model


# The derivative of weighted gaps leaves out how cuts and weights move, and in 3D replaces integrals over segments by those
# over facets.
EXACT, WEIGHTED, IN_SPACE = 1e-7, 0.01, 0.1
FRICTION = {"friction": 0.3}
DERIVATIVES = [
    # model, mesh, options, allowed error of the derivative
    (half_spheres, "A", {"formulation": "node_to_segment"}, EXACT),
    (half_spheres, "A", {"formulation": "node_to_segment", "normals": "averaged"}, EXACT),
    (half_spheres, "A", {"formulation": "node_to_segment", **FRICTION}, EXACT),
    (half_spheres, "A", {"formulation": "node_to_segment", "normals": "averaged", **FRICTION}, EXACT),
    (half_spheres, "B", {"formulation": "continuous"}, EXACT),
    (half_spheres, "B", {"formulation": "continuous", "normals": "facet"}, EXACT),
    (half_spheres, "B", {"formulation": "continuous", "normals": "facet", **FRICTION}, EXACT),
    (half_spheres, "B", {"formulation": "continuous", **FRICTION}, EXACT),
    (half_spheres, "B", {"formulation": "continuous", "slip": "primary", **FRICTION}, EXACT),
    (half_spheres, "C", {"formulation": "mortar", "multipliers": "dual"}, WEIGHTED),
    (half_spheres, "C", {"formulation": "mortar", "multipliers": "dual", **FRICTION}, WEIGHTED),
    (blocks, "quad4", {"formulation": "node_to_segment", **FRICTION}, EXACT),
    (blocks, "quad8", {"formulation": "continuous", **FRICTION}, EXACT),
    (blocks, "quad4", {"formulation": "mortar", "multipliers": "dual", **FRICTION}, WEIGHTED),
    (ball_on_block, "tet4", {"formulation": "node_to_segment"}, EXACT),
    (ball_on_block, "tet4", {"formulation": "node_to_segment", **FRICTION}, EXACT),
    (ball_on_block, "hex8", {"formulation": "continuous", **FRICTION}, EXACT),
    (ball_on_block, "hex8", {"formulation": "continuous", "slip": "primary", **FRICTION}, EXACT),
    (ball_on_block, "hex8", {"formulation": "mortar", "multipliers": "dual", **FRICTION}, IN_SPACE),
    (ball_on_ball, "hex8", {"formulation": "node_to_segment", **FRICTION}, EXACT),
    (ball_on_ball, "hex8", {"formulation": "mortar", **FRICTION}, WEIGHTED),
]


@pytest.mark.parametrize(("make", "mesh", "options", "error"), DERIVATIVES)
def test_forces_gaps_and_slips_vary_as_their_differences(make, mesh, options, error):
    """With friction, forces and slips are compared in tangents that follow the normals by the smallest rotation."""
    model = make(mesh, **options)
    first, step = fc.solve(model, fc.linear_ramp(2))
    problem = prepare(model, fc.linear_ramp(2), fc.Criteria(), linear_solver="direct")
    start, load = first.displacement.ravel(), problem.load_at(1.0)
    state, rng = replace(problem.initial_state(), u=start), np.random.default_rng(1)
    # One side has slid a little, so that no node faces a node.
    points, u, side = model.mesh.points, step.displacement.copy(), problem.pairs["hertz"].secondary.points
    u[side, 0] += 0.01 * points[side, 0]
    u = u.ravel()

    def paired(u):
        return pair_surfaces(problem, state, load, Iterate(u.copy(), {}, {})).parts["hertz"]

    here = paired(u)
    closed = here.usable & (here.gap0 + here.B @ u < 1e-3)
    if not here.tangents and here.nodes is not None:
        # Nodes on the axis and on planes of symmetry face the ends of facets, where derivatives are one-sided.
        closed &= problem.system.free.reshape(points.shape)[here.nodes].all(axis=1)
    multiplier = np.where(closed, rng.uniform(0.5, 1.0, len(here)), 0.0)
    slides = np.array([closed & (np.diff(T.indptr) > 0) for T in here.tangents], bool).reshape(-1, len(here)).T
    tangential = np.where(slides, rng.uniform(-0.3, 0.3, slides.shape), 0.0)
    du = points @ rng.normal(size=(points.shape[1],) * 2) / 50.0
    du[side] += 0.02 * rng.normal(size=points.shape[1])
    du = np.where(problem.system.free.reshape(points.shape), du, 0.0)

    def values(displaced):
        at = paired(displaced)
        gap = at.gap0 + at.B @ u
        if not at.tangents:
            return at.force(multiplier), gap[None]
        before, now = normals(here.directions), normals(at.directions)
        mean = (before + now) / (1.0 + (before * now).sum(axis=1))[:, None]
        followed = [t - (t * now).sum(axis=1)[:, None] * mean for t in here.directions]
        vector = sum(t[:, None] * along for t, along in zip(tangential.T, followed, strict=True))
        forces = np.column_stack([(vector * along).sum(axis=1) for along in at.directions])
        constant = at.slip0 if at.slip0 is not None else np.zeros((len(at.tangents), 1))
        slips = [T @ (u - start) + more for T, more in zip(at.tangents, constant, strict=True)]
        slip = sum(s[:, None] * along for s, along in zip(slips, at.directions, strict=True))
        return at.force(multiplier, forces), np.stack([gap, *((slip * t).sum(axis=1) for t in followed)])

    h = 1e-3
    (force1, gaps1), (force0, gaps0) = values(u + h * du.ravel()), values(u - h * du.ravel())
    force, gaps = here.geometry(multiplier, tangential, u.reshape(points.shape)).along(du)
    difference = (force1 - force0) / (2 * h)
    assert np.abs(difference).max() > 0.0
    assert np.abs(force.ravel() - difference).max() <= error * np.abs(difference).max()
    assert np.abs(gaps - (gaps1 - gaps0) / (2 * h))[:, closed].max() <= error * np.abs(du).max()


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
        (half_spheres, "C", {"formulation": "node_to_segment", **FRICTION}, 5),
        (half_spheres, "B", FRICTION, 5),
        (half_spheres, "C", {"formulation": "mortar", **FRICTION}, 5),
        (half_spheres, "C", {"formulation": "continuous", **FRICTION}, 5),
        (blocks, "quad4", {"formulation": "node_to_segment", **FRICTION}, 4),
        (blocks, "quad4", {"formulation": "mortar", "slip": "primary", **FRICTION}, 5),
        (blocks, "quad8", {"formulation": "continuous", **FRICTION}, 5),
        (ball_on_block, "tet4", {"formulation": "node_to_segment", **FRICTION}, 4),
        (ball_on_block, "hex8", {"formulation": "continuous", **FRICTION}, 5),
        (ball_on_block, "hex8", FRICTION, 5),
        (pressed_ball, "hex8", {"formulation": "continuous"}, 4),
        (pressed_ball, "tet4", {"formulation": "node_to_segment"}, 4),
        (pressed_ball, "hex8", FRICTION, 5),
        (loose_blocks, "quad4", {"formulation": "node_to_segment", **FRICTION}, 4),
        (loose_blocks, "quad4", FRICTION, 4),
        (loose_blocks, "quad8", {"formulation": "continuous", **FRICTION}, 4),
    ],
)
def test_load_steps_take_few_pairings_and_converge_quadratically(make, mesh, options, updates):
    """Alternating between pairing and solution takes 8 to 12, each with a fourth of the last change."""
    ramp = [k / 20.0 for k in range(1, 7)] if make is half_spheres else 4
    model = make(mesh, **options)
    whole = fc.Criteria(friction_while_touching=1.0)
    steps = fc.solve(model, ramp, criteria=whole, linear_solver="direct")
    counts = [step.iterations["geometry_updates"] + 1 for step in steps]
    assert max(counts) <= updates
    # Increments of friction, and their last one that is solved again, take one or two pairings.
    along = fc.solve(model, ramp, linear_solver="direct")
    assert all(step.iterations["geometry_updates"] < count + 2 for step, count in zip(along, counts, strict=True))
    assert max(counts) > 2
    for step in steps[-2:]:
        changes = [entry["displacement_change"] for entry in step.iterations["history"]]
        if len(changes) > 2:
            assert changes[-2] < 0.01 * changes[-3]
        assert changes[-1] < 0.02 * changes[-2] or changes[-1] < 1e-11
