"""Arguments of a wrong type: every public call names the argument, in an error of the package."""

import inspect
from typing import Literal

import numpy as np
import pytest
from models import pressed_spheres
from numpy.typing import ArrayLike, NDArray
from refusals import refused

import fastcontact as fc
from fastcontact._tools.argument_types import check_type, fits, type_name, typed

WRONG = (None, "5", 5, [1, 2], {"a": 1}, object(), [None], 1j)


def model(contact=True):
    name = "hertz" if contact else None
    return pressed_spheres(fc.generate.half_spheres(size=25.0), name=name, formulation="node_to_segment")


def of_model(method):
    return lambda **given: getattr(model(contact=False), method)(**given)


def defaults(call, **given):
    """Return the arguments of a call: those given, the defaults of the others."""
    known = inspect.signature(call).parameters.values()
    return {p.name: p.default for p in known if p.default is not p.empty} | given


STEPS = fc.solve(model(), 1)
CONTACT, MESH = STEPS[0].contact["hertz"], model().mesh
SIDES = {"name": "h", "secondary": "CONT1", "primary": "CONT2"}
CALLS = {
    "LinearElastic": (fc.LinearElastic, {"E": 1.0, "nu": 0.3, "volumetric": "auto"}),
    "linear_ramp": (fc.linear_ramp, {"steps": 3, "end": 1.0}),
    "Ramp": (fc.Ramp, {"instants": (1.0,), "table": ((0.0, 0.0), (1.0, 1.0))}),
    "Criteria": (fc.Criteria, defaults(fc.Criteria)),
    "Model": (lambda **k: fc.Model(**k), {"mesh": fc.generate.block(), "kinematics": "plane_strain"}),
    "add_material": (of_model("add_material"), {"material": fc.LinearElastic(1.0, 0.3), "groups": None}),
    "fix": (of_model("fix"), {"group": "A1A2", "components": "x"}),
    "prescribe": (of_model("prescribe"), {"group": "A1A2", "normal": None, "ramp": None, "x": 0.0}),
    "add_pressure": (of_model("add_pressure"), {"group": "A1B1", "value": 1.0, "ramp": None}),
    "add_traction": (of_model("add_traction"), {"group": "A1B1", "y": 1.0, "ramp": None}),
    "add_body_force": (of_model("add_body_force"), {"groups": None, "y": 1.0, "ramp": None}),
    "add_force": (of_model("add_force"), {"group": "A1B1", "y": 1.0, "distribute": None, "ramp": None}),
    "couple": (of_model("couple"), {"group": "A1B1", "component": "y"}),
    "relate": (of_model("relate"), {"terms": [("A1", "y", 1.0), ("B1", "y", -1.0)], "value": 0.0, "ramp": None}),
    "relate_groups": (of_model("relate_groups"), {"first": "A1B1", "second": "A2B2", "component": "y"}),
    "add_spring": (of_model("add_spring"), {"group": "A1", "to": None, "x": 1.0, "direction": None}),
    "add_contact": (
        of_model("add_contact"),
        SIDES | {"formulation": "mortar", "friction": 0.1, "slip": "symmetric", "projection_tolerance": 0.05},
    ),
    "add_obstacle": (
        of_model("add_obstacle"),
        {"name": "o", "secondary": "CONT1", "obstacle": fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0)), "friction": 0.1},
    ),
    "solve": (lambda **k: fc.solve(model(), **k), {"ramp": fc.linear_ramp(1), "criteria": None, "resume": ()}),
    "open_results": (fc.open_results, {"path": "none.vtkhdf"}),
    "read_mesh": (fc.read_mesh, {"path": "none.med"}),
    "half_spheres": (fc.generate.half_spheres, {"element": "tri3", "R": 50.0, "size": 25.0}),
    "box": (fc.generate.box, defaults(fc.generate.box)),
    "mirrored": (fc.generate.mirrored, {"mesh": fc.generate.block(), "axis": "x", "at": 0.0, "rename": None}),
    "Sphere": (fc.obstacles.Sphere, {"centre": (0.0, 0.0), "R": 1.0, "hollow": False}),
    "convergence_study": (fc.convergence_study, {"case": "none.toml", "levels": 2, "elements": None}),
    "parameter_sweep": (fc.parameter_sweep, {"case": "none.toml", "parameters": {"approach": [1.0]}}),
    "read_deck": (fc.read_deck, {"path": "none.inp"}),
    "write_csv": (fc.write_csv, {"path": "none.csv", "table": fc.contact_table(CONTACT), "units": None}),
    "pressure_profile": (
        fc.plot.pressure_profile,
        {"contact": CONTACT, "theory": None, "other_theories": None, "units": {}, "title": "", "ax": None},
    ),
    "history": (fc.plot.history, {"steps": STEPS, "pair": "hertz", "approach": None, "share": 1.0, "title": ""}),
    "contact_zones": (fc.plot.contact_zones, {"steps": STEPS, "pair": "hertz", "title": "", "units": {}, "ax": None}),
    "deformed_shape": (fc.plot.deformed_shape, {"mesh": MESH, "step": STEPS[0], "field": "von_mises", "ax": None}),
    "axis_stress": (fc.plot.axis_stress, {"mesh": MESH, "step": STEPS[0], "pair": "hertz", "ax": None}),
    "points_of": (fc.generate.half_spheres(size=25.0).points_of, {"group": "CONT1"}),
}  # fmt: skip


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.filterwarnings("ignore")
def test_nothing_but_our_own_errors(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    call, good = CALLS[name]
    told = 0
    for argument in good:
        for wrong in WRONG:
            try:
                call(**{**good, argument: wrong})
            except fc.FastcontactError:
                told += 1
    assert told >= 4 * len(good)  # at least strings, dictionaries, complex numbers and any object, mostly


@pytest.mark.parametrize(
    ("annotation", "good", "bad"),
    [
        (float, (1, 2.0, np.float32(1), np.int64(3), np.array(2.0)), (True, "1", None, [1.0], 1j)),
        (bool, (True, np.bool_(False), 0, 1), ("yes", None, 2)),
        (int | None, (None, 3), ("3", [])),
        (tuple[float, float], ((1, 2), [1.0, 2.0], np.array([1.0, 2.0])), ((1, 2, 3), "ab", 1.0, ("a", "b"))),
        (tuple[float, ...], ((1, 2, 3), []), ("abc", 1.0)),
        (dict[str, float], ({}, {"a": 1}), ({"a": "b"}, [("a", 1)])),
        (ArrayLike, (1.0, [1, 2], np.zeros(3)), ("abc", None, {"a": 1}, object(), [[1.0], [1.0, 2.0]])),
        (ArrayLike | fc.Mesh, (1.0, [1, 2], MESH), ("x", None)),
        (Literal["a", "b"], ("a",), (1,)),
        (Literal[1, 2], (2,), (3,)),
        (NDArray[np.float64], (np.zeros(3), [1.0]), ("abc", None)),
        (fc.obstacles.Obstacle, (fc.obstacles.HalfSpace((0, 0), (0, 1)),), (3, "sphere", fc.obstacles.Sphere)),
    ],
)
def test_what_fits_an_annotation(annotation, good, bad):
    for value in good:
        assert fits(value, annotation), value
        check_type("it", value, annotation, fc.ModelError)
    for value in bad:
        assert not fits(value, annotation), value
        refused(fc.ModelError, "it must be ", check_type, "it", value, annotation, fc.ModelError)


def test_types_in_words():
    assert type_name(float | None) == "a number or None"
    assert type_name(tuple[float, float]) == "two numbers"
    assert type_name(dict[str, float]) == "a dictionary of numbers by name"
    assert type_name(ArrayLike | fc.Mesh) == "an array of numbers or a Mesh"


def test_what_is_no_wrong_type_stays_python_s():
    @typed(fc.ModelError)
    def call(first: float, second: "Unknown" = None) -> float:  # noqa: F821
        return first

    assert call(1, second="anything") == 1
    assert call.__name__ == "call"
    refused(TypeError, "missing", call)


def test_only_public_names_are_listed():
    for namespace in (fc, fc.analytic, fc.generate, fc.obstacles, fc.plot):
        assert set(dir(namespace)) <= {*namespace.__all__, "__version__"}, namespace


def masked(values):
    values = np.asarray(values, float)
    return np.ma.array(values, mask=np.arange(values.size).reshape(values.shape) == 1)


TRIANGLE = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
MASKED = {
    "points": lambda m: fc.Mesh(m(TRIANGLE), {"tri3": [[0, 1, 2]]}),
    "cells": lambda m: fc.Mesh(TRIANGLE, {"tri3": m([[0, 1, 2]])}),
    "groups of cells": lambda m: fc.Mesh(TRIANGLE, {"tri3": [[0, 1, 2]]}, {"A": m([0, 0])}),
    "groups of points": lambda m: fc.Mesh(TRIANGLE, {"tri3": [[0, 1, 2]]}, {}, {"A": m([0, 1])}),
    "table": lambda m: fc.Tabulated("y", m([[0.0, 1.0], [1.0, 2.0]])),
    "temperature": lambda m: model().add_temperature(m(np.ones(model().mesh.n_points))),
    "ramp": lambda m: fc.Ramp(instants=m([0.5, 1.0])),
}


@pytest.mark.parametrize("what", MASKED)
def test_masks_are_not_lost_without_a_word(what):
    """NumPy hands on what lies behind a mask as if it were valid; a mask that hides nothing changes nothing."""
    with pytest.raises(fc.FastcontactError, match="has masked entries, which are not supported: fill or remove them"):
        MASKED[what](masked)
    MASKED[what](lambda values: np.ma.array(values, mask=False))


@pytest.mark.parametrize("what", ["table", "temperature", "points", "ramp"])
def test_imaginary_parts_are_not_lost_without_a_word(what):
    refused(fc.FastcontactError, r"must be|must hold", MASKED[what], lambda values: np.asarray(values, float) + 1j)


@pytest.mark.parametrize(
    ("method", "given", "placed", "named"),
    [
        ("add_contact", ("pair", "TOP", "BOTTOM"), "name", "secondary=..., primary=..."),
        ("add_pressure", ("TOP", 1.0, [(0.0, 1.0)]), "group, value", "ramp=..."),
        ("add_force", ("TOP", -1.0), "group", "x=..., y=..."),
        ("add_moment", ("TOP", 3.0), "group", "z=..."),
        ("fix", ("TOP", "x", "y"), "group, components", "axes=..."),
        ("add_initial_stress", ("TOP", 1.0), "groups", "xx=..., yy=..."),
    ],
)
def test_misplaced_arguments_are_named(method, given, placed, named):
    rule = f"takes {placed} by position and all other arguments by keyword: write {named}"
    with pytest.raises(TypeError) as caught:
        getattr(fc.Model(fc.generate.block(), kinematics="plane_strain"), method)(*given)
    assert str(caught.value) == f"Model.{method} {rule}"


@pytest.mark.parametrize(
    ("method", "given", "options", "lacking"),
    [
        ("add_contact", ("pair",), {"secondary": "TOP"}, "1 required keyword-only argument: 'primary'"),
        (
            "add_contact",
            ("pair",),
            {"slave": "TOP", "master": "BOTTOM"},
            "2 required keyword-only arguments: 'secondary' and 'primary': write secondary instead of slave and primary "
            "instead of master",
        ),
        ("fix", ("TOP",), {}, "1 required positional argument: 'components'"),
    ],
)
def test_missing_arguments_are_named(method, given, options, lacking):
    with pytest.raises(TypeError) as caught:
        getattr(fc.Model(fc.generate.block(), kinematics="plane_strain"), method)(*given, **options)
    assert str(caught.value) == f"Model.{method}() missing {lacking}"
