"""Models refused before any computation that no other test covers."""

import dataclasses

import numpy as np
import pytest
from models import elastic_model
from test_result_files import MESH, step_result

import fastcontact as fc
from fastcontact.mesh.generate import block, box, merge_points, renamed, union

WALL = fc.obstacles.HalfSpace(point=(0.0, 1.0), normal=(0.0, -1.0))


def cube():
    """A cube with a reference point, and a group of points by their numbers."""
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1), "hex8")
    corners = np.flatnonzero((mesh.points[:, 0] == 0.0) & (mesh.points[:, 1] == 0.0))
    mesh = mesh.with_groups(points={"line": corners, "none": []})
    return elastic_model(fc.generate.with_reference_points(mesh, {"HANDLE": (0.5, 0.5, 3.0)}), "3d", E=1.0)


def ring():
    """An axisymmetric block."""
    model = fc.Model(block((1.0, 1.0), (2, 2), "quad4"), "axisymmetric")
    model.add_material(fc.LinearElastic(E=1.0, nu=0.3, density=1.0))
    return model


def plate():
    return fc.Model(block(), "plane_strain")


def turned_by_a_line():
    model = cube()
    model.add_moment("line", z=1.0)
    model.check(fc.linear_ramp(1))


def at(place):
    return lambda: fc.generate.with_reference_points(block(), {"HANDLE": place})


def spread(group, radius):
    return lambda: cube().add_force(group, z=-1.0, at=(0.5, 0.5, 1.0), radius=radius)


def turned_about(centre):
    rotation = {"centre": centre, "angle": 0.1}
    return lambda: plate().add_obstacle("wall", secondary="TOP", obstacle=WALL, rotation=rotation)


def isotropic_across(nu):
    given = {"E_along": 1.0, "E_across": 1.0, "nu_along": 0.3, "G_along": 1.0, "axes": np.eye(3)}
    return lambda: fc.Orthotropic.transversely_isotropic(**given, nu_across=nu)


ALONG_Z = fc.LinearElastic(E=fc.Tabulated("z", [(0.0, 1.0), (1.0, 2.0)]), nu=0.3)
NO_PLACE, NO_CENTRE = (
    "the place .* of reference point 'HANDLE' must be 2 numbers",
    "centre .* must be 2 finite numbers, not",
)
NO_RAMP, NO_TURN = "the ramp must be a number of steps, load factors", ".* have no mean rotation"


def touching_corners():
    """Two squares that share a corner, with an obstacle for all of their sides."""
    squares = [block((1.0, 1.0), (1, 1), origin=(at, at)) for at in (0.0, 1.0)]
    sides = dict.fromkeys(("LEFT", "RIGHT", "BOTTOM", "TOP"), "SIDES")
    mesh = merge_points(union(*(renamed(square, sides) for square in squares)), 1e-6)
    elastic_model(mesh).add_obstacle("wall", secondary="SIDES", obstacle=WALL)


REFUSED = [
    (touching_corners, fc.ContactError, "meet back to back at point 3"),
    (isotropic_across(-1.0), fc.ModelError, "nu_across = -1.0 must be above -1"),
    *((at(place), fc.MeshError, NO_PLACE) for place in [(0.5,), (0.5, 0.5, 0.5), (np.nan, 0.0)]),
    (
        lambda: fc.generate.with_reference_points(block(), {"TOP": (0.5, 3.0)}),
        fc.MeshError,
        "already a group 'TOP': give",
    ),
    (lambda: fc.solve(cube(), np.zeros((3, 3))), fc.ModelError, NO_RAMP),
    (lambda: fc.solve(cube(), np.zeros((1, 1))), fc.ModelError, NO_RAMP),
    (lambda: block((1.0,), (2, 2)), fc.MeshError, "argument size of block must be two numbers, not the tuple"),
    (lambda: block((1.0, 1.0), "ab"), fc.MeshError, "divisions of block must be two"),
    (
        lambda: cube().add_coupling("HANDLE", "line", kind="distributing"),
        fc.ModelError,
        f"of 'HANDLE' with 'line': {NO_TURN}",
    ),
    (turned_by_a_line, fc.ModelError, f"the moment on 'line': {NO_TURN}"),
    (lambda: cube().add_moment("none", z=1.0), fc.MeshError, "'none'.*the group is empty"),
    (
        lambda: ring().add_gravity(x=9.81),
        fc.ModelError,
        "has a radial component x: in axisymmetry it can act only along the axis",
    ),
    (lambda: ring().add_centrifugal(3.0, direction=(0.0, 0.0, 1.0)), fc.ModelError, r"its direction is \(0, 1, 0\)"),
    *((spread("ZMAX", r), fc.ModelError, f"of the force on 'ZMAX' = {r:g} must be positive") for r in (0.0, -1.0)),
    (spread("none", 0.1), fc.MeshError, "'none'.*the group is empty"),
    *((turned_about(c), fc.ModelError, NO_CENTRE) for c in [(0.0, 0.0, 0.0), (np.inf, 0.0), ("left", 0.0)]),
    (
        lambda: plate().add_material(ALONG_Z),
        fc.ModelError,
        "a table is along z, but the mesh is plane: use x, y or radius",
    ),
]


@pytest.mark.parametrize(("make", "kind", "message"), REFUSED, ids=[message for _, _, message in REFUSED])
def test_it_is_refused(make, kind, message):
    with pytest.raises(kind, match=message):
        make()


def test_forces_on_the_primary_side_have_a_row_for_each_point(tmp_path):
    step = step_result(2)
    name, contact = next(iter(step.contact.items()))
    wrong = dataclasses.replace(
        contact, primary_points=np.array([1, 2], np.int32), primary_force_vectors=np.zeros((3, 2))
    )
    with (
        fc.ResultWriter(tmp_path / "run.vtkhdf", MESH) as out,
        pytest.raises(fc.FileError, match=r"primary_force_vectors has shape \(3, 2\), but \(2, 2\) is needed"),
    ):
        out.write(dataclasses.replace(step, contact={**step.contact, name: wrong}))
