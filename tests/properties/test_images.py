"""Units, turning, mirroring, moving, renumbering and the order of the bodies change nothing but rounding."""

from dataclasses import replace

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st
from images import Image, differences, solved
from problems import Blocks, analysis_of, carried, examples, recipes
from scipy.spatial.transform import Rotation

import fastcontact as fc

# Relative to the largest value of each quantity; found: 2e-11 in 2400 random problems.
ROUNDING = 1e-9
PLANE, SOLID, ROUND = ("plane_strain", "plane_stress"), ("3d",), ("axisymmetric",)
SEEDS = st.none() | st.integers(0, 999)


def stays(recipe: Blocks, image: Image) -> None:
    """The image of the problem has the image of its solution."""
    job = recipe.job()
    try:
        original = solved(job, Image())[0]
    except fc.ConvergenceError:
        assume(False)
    assume(carried(original, recipe))
    found, _, _ = differences(job, image, original)
    assert max(found.values()) < ROUNDING, max(found, key=found.get)


def motion(dim, turn, mirrored):
    Q = Rotation.from_quat(turn).as_matrix() if dim == 3 else Rotation.from_euler("z", turn).as_matrix()[:2, :2]
    return Q @ np.diag([-1.0 if mirrored else 1.0, *[1.0] * (dim - 1)])


@examples(25)
@given(
    recipe=recipes(kinematics=PLANE) | recipes(kinematics=PLANE, friction=True),
    angle=st.floats(-3.2, 3.2), mirrored=st.booleans(), shift=st.tuples(*[st.floats(-50, 50)] * 2), seed=SEEDS,
)  # fmt: skip
def test_rigid_motions_mirrors_and_numberings_in_the_plane(recipe, angle, mirrored, shift, seed):
    stays(recipe, Image(Q=motion(2, angle, mirrored), shift=shift, seed=seed))


@examples(15)
@given(
    recipe=recipes(kinematics=ROUND) | recipes(kinematics=ROUND, friction=True), shift=st.floats(-50, 50), seed=SEEDS
)
def test_mirrors_and_numberings_about_an_axis(recipe, shift, seed):
    stays(recipe, Image(Q=np.diag([1.0, -1.0]), shift=(0.0, shift), seed=seed))


@examples(12)
@given(
    recipe=recipes(kinematics=SOLID) | recipes(kinematics=SOLID, friction=True),
    quaternion=st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1), mirrored=st.booleans(),
    shift=st.tuples(*[st.floats(-50, 50)] * 3), seed=SEEDS,
)  # fmt: skip
def test_rigid_motions_mirrors_and_numberings_in_space(recipe, quaternion, mirrored, shift, seed):
    stays(recipe, Image(Q=motion(3, quaternion, mirrored), shift=shift, seed=seed))


@examples(25)
@given(recipe=recipes() | recipes(friction=True), length=st.floats(-9, 9), pressure=st.floats(-12, 12))
def test_units(recipe, length, pressure):
    stays(recipe, Image(length=10.0**length, pressure=10.0**pressure))


@examples(25)
@given(recipe=recipes(matching=True, crown=0.0, tilt=0.0), friction=st.sampled_from([0.0, 0.2]))
def test_swapping_the_sides_of_a_flat_contact_with_matching_meshes(recipe, friction):
    recipe = replace(recipe, upper=(recipe.lower[0], recipe.upper[1]), friction=friction)
    one, other = (analysis_of(recipe.job(swap), keep_pairing=True).step(1, 1.0) for swap in (False, True))
    size = np.abs(one.displacement).max()
    assert np.abs(one.displacement - other.displacement).max() < ROUNDING * size
    a, b = one.contact["pair 0"], other.contact["pair 0"]
    assert a.active.any()
    assert np.abs(a.force + b.force).max() < ROUNDING * np.abs(a.force).max()
    assert np.abs(one.stress - other.stress).max() < ROUNDING * np.abs(one.stress).max()
