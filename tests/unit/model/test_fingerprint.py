"""Digests of a model: equal for the same case however it was built, different for every other case."""

import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc
from fastcontact.mesh.generate import block
from fastcontact.model.fingerprint import different, fingerprint


def model(pressure=lambda points: 1.0 + points[:, 0], height=3.0, order=1, stiffness=2.0, mass=1.0):
    found = elastic_model(block((2.0, 1.0), (6, 3), "quad4", origin=(-1.0, -1.0)), "plane_strain")
    supports = [("BOTTOM", {"y": 0.0}), ("LEFT", {"x": 0.0})][::order]
    for group, values in supports:
        found.prescribe(group, **values)
    found.add_pressure("RIGHT", pressure)
    found.add_body_force(y=-mass)
    found.add_spring("TOP", x=stiffness)
    found.add_obstacle("ball", secondary="TOP", obstacle=fc.obstacles.Sphere((0.0, height), height), motion={"y": -0.1})
    return found


def parts(**changes):
    return fingerprint(model(**changes), {"geometry_updates": None})


def test_the_same_case_has_the_same_digests_however_it_was_put_together():
    expected = parts()
    assert parts() == expected
    assert parts(order=-1) == expected
    assert parts(pressure=lambda points: points[:, 0] + 1.0) == expected, "a function counts by its values"
    assert all(len(digest) == 16 for digest in expected.values())


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"pressure": lambda points: 1.0 + points[:, 1]}, "the loads"),
        ({"pressure": lambda points: np.nextafter(1.0 + points[:, 0], np.inf)}, "the loads"),
        ({"mass": 1.0 + 1e-15}, "the loads"),
        ({"height": 3.1}, "contact 'ball'"),
        ({"stiffness": 2.5}, "the springs"),
    ],
)
def test_what_changed_is_named(change, part):
    assert different(parts(), parts(**change)) == [part]


def test_options_count():
    one, other = (fingerprint(model(), {"geometry_updates": updates}) for updates in (None, 2))
    assert different(one, other) == ["the option geometry_updates"]
    assert different(one, fingerprint(model())) == ["the option geometry_updates"]


def test_functions_that_fail_are_told_apart_by_their_names():
    """The check of the model says what is wrong with them."""

    def wrong(points):
        raise ZeroDivisionError

    def other(points):
        raise ZeroDivisionError

    assert different(parts(pressure=wrong), parts(pressure=wrong)) == []
    assert different(parts(pressure=wrong), parts(pressure=other)) == ["the loads"]
