"""A model is checked whole before any numerics: one clear line each."""

import numpy as np
import pytest

import fastcontact as fc


@pytest.fixture
def spheres():
    return fc.generate.half_spheres("tri3", size=10.0)


@pytest.fixture
def model(spheres):
    model = fc.Model(spheres, "axisymmetric")
    model.add_material(fc.LinearElastic(E=20_000.0, nu=0.3))
    model.fix("A1A2", "x")
    return model


@pytest.mark.parametrize("nu", [0.5, 0.7, -1.0, float("nan")])
def test_poisson_ratio_out_of_range(nu):
    with pytest.raises(fc.ModelError, match=r"Poisson"):
        fc.LinearElastic(E=1.0, nu=nu)


@pytest.mark.parametrize("E", [0.0, -5.0, float("inf"), float("nan")])
def test_youngs_modulus_must_be_positive(E):
    with pytest.raises(fc.ModelError, match=r"Young"):
        fc.LinearElastic(E=E, nu=0.3)


def test_an_unknown_group_offers_near_names(model):
    with pytest.raises(fc.MeshError, match=r"'A1A3'.*'A1A2'"):
        model.fix("A1A3", "x")
    with pytest.raises(fc.MeshError, match=r"'SPHHAUT'.*'SPHHAU'"):
        model.add_material(fc.LinearElastic(1.0, 0.3), ["SPHHAUT"])


def test_groups_without_material_are_named(spheres):
    model = fc.Model(spheres, "axisymmetric")
    model.add_material(fc.LinearElastic(1.0, 0.3), ["SPHBAS"])
    with pytest.raises(fc.ModelError, match=r"solid cells have no material, in 'SPHHAU'"):
        model.check()


def test_one_free_rigid_motion_a_body_is_counted_and_named(model):
    with pytest.raises(fc.ModelError, match=r"2 rigid-body motions .*'SPHBAS': translation along y.*'SPHHAU'"):
        model.check()
    model.prescribe("A2B2", y=-1.0)
    with pytest.raises(fc.ModelError, match=r"1 rigid-body motion is not supported: body 'SPHBAS'"):
        model.check()
    model.fix("A1B1", "y")
    model.check()


def test_plane_bodies_have_three_motions():
    model = fc.Model(fc.generate.block((1.0, 1.0), (2, 2), "quad4"), "plane_strain")
    model.add_material(fc.LinearElastic(1.0, 0.3))
    with pytest.raises(fc.ModelError, match=r"3 rigid-body motions"):
        model.check()
    model.fix("BOTTOM", "y")
    with pytest.raises(fc.ModelError, match=r"1 rigid-body motion.*translation along x"):
        model.check()


def test_supports_that_contradict_each_other_are_both_named(model):
    model.prescribe("A2B2", y=-2.0)
    model.prescribe("A2", y=-1.0)
    with pytest.raises(fc.ModelError, match=r"'A2' prescribes y = -1.*'A2B2' prescribes -2"):
        model.check()


def test_bodies_that_overlap_without_contact_are_refused(spheres):
    moved = spheres.points.copy()
    upper = spheres.points_of("SPHHAU")
    moved[upper, 1] -= 3.0
    model = fc.Model(spheres.replace(points=moved), "axisymmetric")
    model.add_material(fc.LinearElastic(1.0, 0.3))
    model.fix("A1A2", "x")
    model.fix("A1B1", "y")
    model.fix("A2B2", "y")
    with pytest.raises(fc.ModelError, match=r"overlaps body .* by 2.99"):
        model.check()
    model.add_contact("pair", secondary="CONT1", primary="CONT2")
    model.check()


def test_negative_radii_are_refused(spheres):
    with pytest.raises(fc.ModelError, match=r"radius x = .* < 0"):
        fc.Model(spheres.replace(points=spheres.points - [1.0, 0.0]), "axisymmetric")


def test_a_wrong_side_is_refused(model):
    with pytest.raises(fc.ContactError, match=r"faces"):
        model.add_contact("wrong", secondary="CONT1", primary="A2B2")


def test_sides_that_share_nodes_are_refused(model):
    with pytest.raises(fc.ContactError, match=r"share"):
        model.add_contact("wrong", secondary="CONT1", primary="D1B1")


def test_facets_inside_a_solid_are_refused(spheres):
    block = spheres.cells["tri3"]
    inner = next(c for c in block if not np.isin(c, np.unique(spheres.cells["line2"])).any())
    with_line = spheres.replace(
        cells={**spheres.cells, "line2": np.vstack([spheres.cells["line2"], inner[:2]])},
        cell_groups={"INNER": [spheres.offsets["line2"] + len(spheres.cells["line2"])], "CONT1": []},
    ) if list(spheres.cells)[-1] == "line2" else None  # fmt: skip
    if with_line is None:
        lines = {"line2": np.vstack([spheres.cells["line2"], inner[:2]]), "tri3": block}
        with_line = fc.Mesh(
            spheres.points, dict(reversed(lines.items())), {"INNER": [len(block) + len(lines["line2"]) - 1]}
        )
    groups = dict(with_line.cell_groups)
    model = fc.Model(with_line.replace(cell_groups=groups), "axisymmetric")
    with pytest.raises(fc.ContactError, match=r"do not lie on the outside"):
        model.add_contact("wrong", secondary="INNER", primary="INNER")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"formulation": "mortarr"}, "contact formulation 'mortarr'"),
        ({"projektion_tolerance": 1.0}, "did you mean 'projection_tolerance'"),
        ({"formulation": "continuous", "n_gauss": 1}, "undetermined"),
        ({"formulation": "continuous", "integration": "gaus"}, "did you mean 'gauss'"),
        ({"formulation": "continuous", "augmentation": 0.0}, "augmentation"),
        ({"normals": "smooth"}, "kind of normals 'smooth'"),
        ({"projection_tolerance": -1.0}, "must not be negative"),
        ({"secondary": "SPHBAS"}, "holds no facets"),
    ],
)
def test_wrong_contact_options(model, options, message):
    arguments = {"secondary": "CONT1", "primary": "CONT2", **options}
    with pytest.raises(fc.ContactError, match=message):
        model.add_contact("pair", **arguments)


def test_a_second_pair_of_the_same_name_is_refused(model):
    model.add_contact("pair", secondary="CONT1", primary="CONT2")
    with pytest.raises(fc.ContactError, match=r"already"):
        model.add_contact("pair", secondary="CONT2", primary="CONT1")


@pytest.mark.parametrize("kinematics", ["axisymetric", "3d"])
def test_wrong_kinematics(spheres, kinematics):
    with pytest.raises(fc.ModelError):
        fc.Model(spheres, kinematics)


def test_wrong_components_and_values(model):
    with pytest.raises(fc.ModelError, match=r"component 'z'"):
        model.prescribe("A2B2", z=1.0)
    with pytest.raises(fc.ModelError, match=r"not a finite number"):
        model.prescribe("A2B2", y=float("nan"))
    with pytest.raises(fc.ModelError, match=r"names no component"):
        model.fix("A2B2", "")


def test_nan_in_the_coordinates_is_named(spheres):
    points = spheres.points.copy()
    points[7, 1] = np.nan
    with pytest.raises(fc.MeshError, match=r"point 7"):
        spheres.replace(points=points)
