"""A model is checked completely before any computation, with one clear line for each mistake."""

import dataclasses
import inspect

import pytest
from models import elastic_model

import fastcontact as fc
from fastcontact.contact.formulations import FORMULATIONS
from fastcontact.model.pair_options import SHARED_OPTIONS, ContactOptions


@pytest.fixture
def spheres():
    return fc.generate.half_spheres("tri3", size=10.0)


@pytest.fixture
def model(spheres):
    return elastic_model(spheres, "axisymmetric", E=20_000.0, A1A2="x")


@pytest.mark.parametrize(
    ("constants", "message"),
    [({"nu": nu}, "Poisson") for nu in (0.7, -1.0, float("nan"))]
    + [({"E": E}, "Young") for E in (-5.0, float("inf"), float("nan"))],
)
def test_constants_out_of_range(constants, message):
    with pytest.raises(fc.ModelError, match=message):
        fc.LinearElastic(**{"E": 1.0, "nu": 0.3, **constants})


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


def test_bodies_that_overlap_without_contact_are_refused(spheres):
    moved = spheres.points.copy()
    upper = spheres.points_of("SPHHAU")
    moved[upper, 1] -= 3.0
    model = elastic_model(spheres.replace(points=moved), "axisymmetric", E=1.0, A1A2="x", A1B1="y", A2B2="y")
    with pytest.raises(fc.ModelError, match=r"overlaps body .* by 2.99"):
        model.check()
    model.add_contact("pair", secondary="CONT1", primary="CONT2")
    model.check()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"projektion_tolerance": 1.0}, "did you mean 'projection_tolerance'"),
        ({"formulation": "continuous", "integration": "gaus"}, "did you mean 'gauss'"),
    ],
)
def test_wrong_contact_options(model, options, message):
    arguments = {"secondary": "CONT1", "primary": "CONT2", **options}
    with pytest.raises(fc.ContactError, match=message):
        model.add_contact("pair", **arguments)


def test_dir_shows_what_a_user_calls():
    """No more than the page of reference needs: what serves the analysis is not offered."""
    model = fc.Model(fc.generate.block(), "plane_strain")
    shown = [name for name in dir(model) if not name.startswith("__")]
    assert all(hasattr(model, name) for name in shown)
    assert {"add_contact", "add_material", "fix", "prescribe", "check", "describe", "mesh", "contact"} <= {*shown}
    assert not {"bind", "forces_by_ramp", "material_field", "holding_rows", "conducts"} & {*shown}


@pytest.mark.parametrize("add", [fc.Model.add_contact, fc.Model.add_contacts, fc.Model.add_obstacle])
def test_options_of_contact_are_named_arguments(add):
    """For `help` and editors: those of all formulations and no others, None by default."""
    given = {"secondary", "primary", "points", "axisymmetric", "modulus", "options", "held"}
    kinds = [
        kind.variant(dim, {"multipliers": m})
        for kind in FORMULATIONS.values()
        for dim in (2, 3)
        for m in ("standard", "dual")
    ]
    own = {field.name for kind in kinds for field in dataclasses.fields(kind) if field.init} - given
    shown = inspect.signature(add).parameters
    assert own | {*SHARED_OPTIONS} == {*ContactOptions.__annotations__}
    assert all(shown[name].default is None for name in ContactOptions.__annotations__)
    assert not any(parameter.kind is parameter.VAR_KEYWORD for parameter in shown.values())
