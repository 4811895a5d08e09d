"""What a model refuses before any numerics, where no other test of its part asks for it."""

import dataclasses

import numpy as np
import pytest
from test_result_files import MESH, step_result

import fastcontact as fc
from fastcontact.mesh.generate import block, box


def cube(points=None):
    """A cube with a reference point, and a group of points by their numbers."""
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1), "hex8")
    corners = np.flatnonzero((mesh.points[:, 0] == 0.0) & (mesh.points[:, 1] == 0.0))
    mesh = mesh.with_groups(points={"line": corners, "none": []})
    model = fc.Model(fc.generate.with_reference_points(mesh, {"HANDLE": (0.5, 0.5, 3.0)}), "3d")
    model.add_material(fc.LinearElastic(E=1.0, nu=0.3))
    return model


def test_a_plane_of_isotropy_that_gives_energy():
    with pytest.raises(fc.ModelError, match=r"nu_across = -1.0 must be above -1"):
        fc.Orthotropic.transversely_isotropic(
            E_along=1.0, E_across=1.0, nu_along=0.3, nu_across=-1.0, G_along=1.0, axes=np.eye(3)
        )


@pytest.mark.parametrize("place", [(0.5,), (0.5, 0.5, 0.5), (np.nan, 0.0)])
def test_a_reference_point_has_a_place(place):
    with pytest.raises(fc.MeshError, match=r"the place .* of reference point 'HANDLE' must be 2 numbers"):
        fc.generate.with_reference_points(block(), {"HANDLE": place})


def test_a_reference_point_takes_no_name_that_is_there():
    with pytest.raises(fc.MeshError, match="there is already a group 'TOP': give the reference point another name"):
        fc.generate.with_reference_points(block(), {"TOP": (0.5, 3.0)})


@pytest.mark.parametrize("ramp", [np.zeros((3, 3)), np.zeros((1, 1))])
def test_a_ramp_is_one(ramp):
    with pytest.raises(fc.ModelError, match="the ramp must be a number of steps, load factors"):
        fc.solve(cube(), ramp)


def test_a_size_has_as_many_numbers_as_the_plane():
    with pytest.raises(fc.MeshError, match="argument size of block must be two numbers, not the tuple"):
        block((1.0,), (2, 2))
    with pytest.raises(fc.MeshError, match="divisions of block must be two"):
        block((1.0, 1.0), "ab")


def test_a_line_has_no_mean_rotation():
    with pytest.raises(fc.ModelError, match=r"coupling of 'HANDLE' with 'line': .* have no mean rotation"):
        cube().add_coupling("HANDLE", "line", kind="distributing")
    model = cube()
    model.add_moment("line", z=1.0)
    with pytest.raises(fc.ModelError, match=r"the moment on 'line': .* have no mean rotation"):
        model.check(fc.linear_ramp(1))


def test_a_moment_needs_points():
    with pytest.raises(fc.MeshError, match=r"'none'.*the group is empty"):
        cube().add_moment("none", z=1.0)


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


def ring():
    """An axisymmetric block."""
    model = fc.Model(block((1.0, 1.0), (2, 2), "quad4"), "axisymmetric")
    model.add_material(fc.LinearElastic(E=1.0, nu=0.3, density=1.0))
    return model


def test_loads_that_a_body_of_revolution_cannot_have():
    with pytest.raises(
        fc.ModelError, match="has a radial component x: in axisymmetry it acts along the axis, y, alone"
    ):
        ring().add_gravity(x=9.81)
    with pytest.raises(fc.ModelError, match=r"is not that of the axisymmetry: its direction is \(0, 1, 0\)"):
        ring().add_centrifugal(3.0, direction=(0.0, 0.0, 1.0))


@pytest.mark.parametrize("radius", [0.0, -1.0])
def test_a_force_is_spread_over_a_positive_radius(radius):
    with pytest.raises(fc.ModelError, match=rf"the radius of the force on 'ZMAX' = {radius:g} must be positive"):
        cube().add_force("ZMAX", z=-1.0, at=(0.5, 0.5, 1.0), radius=radius)


def test_a_force_is_spread_over_points():
    with pytest.raises(fc.MeshError, match=r"'none'.*the group is empty"):
        cube().add_force("none", z=-1.0, at=(0.5, 0.5, 1.0))


@pytest.mark.parametrize("centre", [(0.0, 0.0, 0.0), (np.inf, 0.0), ("left", 0.0)])
def test_an_obstacle_turns_about_a_place(centre):
    wall = fc.obstacles.HalfSpace(point=(0.0, 1.0), normal=(0.0, -1.0))
    model = fc.Model(block(), "plane_strain")
    with pytest.raises(fc.ModelError, match=r"centre .* must be 2 finite numbers, not"):
        model.add_obstacle("wall", secondary="TOP", obstacle=wall, rotation={"centre": centre, "angle": 0.1})


def test_a_table_along_z_needs_a_solid():
    model = fc.Model(block(), "plane_strain")
    with pytest.raises(fc.ModelError, match="a table is along z, but the mesh is plane: take x, y or radius"):
        model.add_material(fc.LinearElastic(E=fc.Tabulated("z", [(0.0, 1.0), (1.0, 2.0)]), nu=0.3))
