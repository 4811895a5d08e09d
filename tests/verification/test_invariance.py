"""Rotation, reflection, distant translation and renumbering change results by round-off only."""

from functools import cache

import numpy as np
import pytest
from images import (
    Image,
    ball,
    cylinder,
    differences,
    discs,
    flat_top,
    floating,
    floating_ball,
    image_of,
    model_of,
    on_plane,
    solved,
)
from scipy.spatial.transform import Rotation

import fastcontact as fc
from fastcontact.contact.pairing import tangents
from fastcontact.contact.projection import closest

FORMULATIONS = ("node_to_segment", "continuous", "mortar")
QUARTER_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])
CYCLE = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # a third of a turn about x = y = z
# A thousand times the size of the bodies: coordinates there are exact to 1e-13 of them, displacements to 1e-11.
FAR = {2: (3e4, -5e4), 3: (3e4, -5e4, 1e4)}


def whole_supports():
    """Problems whose supports are whole vectors, so that they can be turned by any angle."""
    for formulation in FORMULATIONS:
        for friction in (0.0, 0.3):
            name = f"{formulation}, friction {friction}"
            yield f"cylinder {name}", cylinder(formulation, friction=friction)
            yield f"ball {name}", ball(formulation, friction=friction)
    yield "cylinder dual", cylinder("mortar", multipliers="dual", friction=0.3)
    yield "cylinder quadratic", cylinder("mortar", "quad8")
    yield "cylinder facet normals", cylinder("continuous", normals="facet")
    yield "ball dual", ball("mortar", multipliers="dual", friction=0.3)
    yield "ball tetrahedra", ball("node_to_segment", "tet4", friction=0.3)
    for formulation in FORMULATIONS[:2]:
        for dim in (2, 3):
            yield f"plane {dim} {formulation}", on_plane(dim, formulation=formulation, friction=0.3)


def along_axes():
    """Problems with supports along axes."""
    for formulation in FORMULATIONS:
        yield f"discs {formulation}", discs(formulation)
        yield f"floating {formulation}", floating(formulation)
        yield f"floating ball {formulation}", floating_ball(formulation)
    yield "flat top", flat_top("quad8", friction=0.1)


WHOLE, AXES = dict(whole_supports()), dict(along_axes())
ALL = WHOLE | AXES
LONG = ("ball continuous, friction 0.3", "ball mortar, friction 0.3")


def image(change, job):
    """Return an image of a job, and how far results may lie apart."""
    dim, axisymmetric = job.mesh.dim, job.kinematics == "axisymmetric"
    if change == "renumbered":
        return Image(seed=3), 1e-9
    if change == "far away":
        return Image(shift=(0.0, 5e4) if axisymmetric else FAR[dim]), 1e-8
    if change == "mirrored":
        mirror = np.eye(dim)
        mirror[int(axisymmetric)] *= -1.0
        return Image(Q=mirror), 1e-9
    if change == "axes into axes":  # ninety degrees in the plane; in space x to y, y to z, z to x
        return Image(Q=QUARTER_TURN if dim == 2 else CYCLE), 1e-9
    angle = Rotation.random(random_state=1) if dim == 3 else Rotation.from_euler("z", 30, degrees=True)
    return Image(Q=angle.as_matrix()[:dim, :dim]), 1e-9


def cases():
    """Give problems and changes: by default one for each problem with friction, in turn; random ones meet all."""
    changes = ("renumbered", "far away", "mirrored", "axes into axes", "turned")
    for i, (name, job) in enumerate(ALL.items()):
        possible = changes if name in WHOLE else changes[: 3 if job.kinematics == "axisymmetric" else 4]
        for j, change in enumerate(possible):
            default = j == i % len(possible) and name not in LONG and "friction 0.0" not in name
            yield pytest.param(name, change, marks=() if default else pytest.mark.slow)


@cache
def original(name):
    return solved(ALL[name], Image())[0]


def agrees(name, image, tolerance=1e-9):
    found, one, _ = differences(ALL[name], image, original(name))
    assert max(found.values()) < tolerance, max(found, key=found.get)
    assert any(contact.active.any() for contact in one.contact.values())


@pytest.mark.parametrize(("name", "change"), [*cases()])
@pytest.mark.filterwarnings("ignore:.*integration points of complete facets")
def test_an_image_has_the_image_of_the_result(name, change):
    agrees(name, *image(change, ALL[name]))


# --- what these rest on ---------------------------------------------------------------------------------------------


def test_renumbered_meshes_are_the_same_mesh():
    """The check of this file's own tool: groups, measure and outer shape survive."""
    mesh = ball("mortar").mesh
    other, order = image_of(mesh, Image(seed=5))
    assert np.array_equal(other.points, mesh.points[order])
    assert fc.quality(other).measure == pytest.approx(fc.quality(mesh).measure, rel=1e-12)
    for name in mesh.group_names:
        assert set(order[other.points_of(name)]) == set(mesh.points_of(name).tolist())
    assert list(order[:20]) != list(range(20))


@pytest.mark.parametrize("n_nodes", [3, 4, 6, 8, 9])
def test_projections_far_from_the_origin(n_nodes):
    """A thousand times as far as the facets are large: to what the coordinates there are exact."""
    element = {3: "tri3", 4: "quad4", 6: "tri6", 8: "quad8", 9: "quad9"}[n_nodes]
    flat = fc.generate.block((1.0, 1.0), (3, 3), element)
    corners = np.insert(flat.points, 2, 0.1 * np.sin(3 * flat.points[:, 0]) * flat.points[:, 1], axis=1)[
        flat.cells[element]
    ]
    points = np.random.default_rng(2).uniform([0, 0, 0.05], [1, 1, 0.3], (50, 3))
    shift = np.array([3e2, -1e3, 7e2])
    near, far = closest(points, corners), closest(points + shift, corners + shift)
    assert np.abs(far.position - shift - near.position).max() < 1e-11
    assert np.abs(far.distance - near.distance).max() < 1e-11
    assert np.abs(far.normal - near.normal).max() < 1e-10


def test_tangents_turn_with_their_normals_and_are_smooth():
    normals = np.array([0.0, 0.0, 1.0]) + 0.8 * np.random.default_rng(4).uniform(-1, 1, (200, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    first, second = tangents(normals)
    frames = np.stack([normals, first, second], axis=1)
    assert np.abs(frames @ frames.transpose(0, 2, 1) - np.eye(3)).max() < 1e-14
    assert np.abs(np.linalg.det(frames) - 1).max() < 1e-14
    # They change no faster than the normals, up to the tangent of half the angle to the mean.
    apart = np.linalg.norm(normals[:, None] - normals, axis=2)
    assert (np.linalg.norm(first[:, None] - first, axis=2) <= 2.0 * apart + 1e-12).all()
    # Turned with the surface, they are the same but for one angle common to all.
    turn = Rotation.random(random_state=3).as_matrix()
    other = tangents(normals @ turn.T)
    cosine = np.einsum("nd,nd->n", other[0], first @ turn.T)
    sine = np.einsum("nd,nd->n", other[0], second @ turn.T)
    assert cosine == pytest.approx(cosine[0], abs=1e-13)
    assert sine == pytest.approx(sine[0], abs=1e-13)


def test_tangents_of_a_closed_surface():
    around = np.vstack([np.eye(3), -np.eye(3), [[0.6, 0.0, -0.8], [-0.6, 0.0, 0.8]]])
    nearly = np.array([[2e-6, -1e-6, -1.0], [0.0, 3e-6, -1.0]])  # opposite to the mean but for deformations
    for normals in (
        around,
        np.vstack([np.tile([0.0, 0.0, 1.0], (9, 1)), nearly / np.linalg.norm(nearly, axis=1)[:, None]]),
    ):
        frames = np.stack([normals, *tangents(normals)], axis=1)
        assert np.abs(frames @ frames.transpose(0, 2, 1) - np.eye(3)).max() < 1e-14


def test_increments_along_the_path_do_not_depend_on_the_numbers_of_nodes():
    """Mortar segments at the beginning of a step are others than at its end, even where there are as many."""
    job, displacements = WHOLE["cylinder mortar, friction 0.3"], []
    for image in (Image(), Image(seed=3)):
        model, order = model_of(job, image)
        steps = fc.solve(model, job.steps, criteria=fc.Criteria(friction_while_touching=0.05))
        whole = np.empty_like(steps[-1].displacement)
        whole[order] = steps[-1].displacement
        displacements.append(whole)
    one, other = displacements
    assert np.abs(one - other).max() < 1e-10 * np.abs(one).max()
