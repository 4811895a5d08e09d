"""The analytic library: table of names, imports, results as plain values."""

import inspect
import math
import pickle

import pytest
from new_process import printed
from refusals import refused

from fastcontact import analytic
from fastcontact.errors import ModelError

LINE_OR_POINT = {"E1": 1.0, "nu1": 0.3, "R1": 1.0, "force": 1e-3}
CATTANEO = {**LINE_OR_POINT, "E2": 1.0, "nu2": 0.3, "friction": 0.1, "tangential_force": 0.0}
RINGS = {"E_inner": 1.0, "nu_inner": 0.3, "E_outer": 1.0, "nu_outer": 0.3, "interface_radius": 1, "outer_radius": 2}
PRESS_FIT = {**RINGS, "interference": 0.01}
EXAMPLES = {
    "block_sliding": {"E": 1.0, "nu": 0.3, "height": 1.0, "pressure": 1.0, "friction": 0.1, "displacement": 0.0},
    "cattaneo_mindlin_line": CATTANEO,
    "cattaneo_mindlin_sphere": CATTANEO,
    "cone_punch": {"E": 1.0, "nu": 0.3, "slope_angle": 5.0, "force": 1.0},
    "finite_half_spheres": {"approach": 1.0},
    "flat_punch": {"E": 1.0, "nu": 0.3, "radius": 1.0, "force": 1.0},
    "flat_punch_2d": {"nu": 0.3, "half_width": 1.0, "force": 1.0},
    "hertz_box": {},
    "hertz_elliptical": {"E1": 1.0, "nu1": 0.3, "R1x": 1.0, "R1y": 2.0, "force": 1.0},
    "hertz_line": LINE_OR_POINT,
    "hertz_point": LINE_OR_POINT,
    "paraboloid_punch": {"E": 1.0, "nu": 0.3, "R": 5.0, "force": 1.0},
    "persson_pin": {"E": 1.0, "R": 1.0, "clearance": 0.01, "force": 0.01},
    "power_law_punch": {"E": 1.0, "nu": 0.3, "coefficient": 1.0, "exponent": 3, "force": 1.0},
    "press_fit_cylinders": PRESS_FIT,
    "press_fit_spheres": PRESS_FIT,
    "receding_layer": {"E1": 1.0, "nu1": 0.3, "thickness": 1.0, "force": 1.0},
    "thick_cylinder": {"E": 1.0, "nu": 0.3, "inner_radius": 1, "outer_radius": 2, "inner_pressure": 1.0},
    "thick_sphere": {"E": 1.0, "nu": 0.3, "inner_radius": 1, "outer_radius": 2, "inner_pressure": 1.0},
}


def test_every_theory_has_an_example_here():
    assert sorted(EXAMPLES) == sorted(analytic.THEORIES)


@pytest.mark.parametrize("name", sorted(EXAMPLES))
def test_results_are_frozen_picklable_values(name):
    result = analytic.THEORIES[name](**EXAMPLES[name])
    assert pickle.loads(pickle.dumps(result)) == result
    field = next(iter(type(result).__dataclass_fields__))
    with pytest.raises(AttributeError):
        setattr(result, field, 0.0)


@pytest.mark.parametrize("name", sorted(analytic.THEORIES))
def test_every_factory_is_public_and_documented(name):
    factory = analytic.THEORIES[name]
    assert getattr(analytic, name) is factory
    assert name in analytic.__all__
    keywords = list(inspect.signature(factory).parameters)
    documented = inspect.getdoc(factory)
    assert "as for `" in documented or all(keyword in documented for keyword in keywords)


BAD_INPUT = [
    # theory, changes of its example, words of the message
    ("cattaneo_mindlin_line", {"friction": 0.4, "force": 500.0, "tangential_force": 200.2},
     "the bodies slide above friction times normal force, 200"),
    ("cattaneo_mindlin_sphere", {"friction": 0.0}, "friction is 0"),
    ("cattaneo_mindlin_sphere", {"tangential_force": -1.0}, "tangential_force is -1"),
    ("cone_punch", {"slope_angle": 90.0}, "between 0 and 90"),
    ("finite_half_spheres", {"nu": 0.25}, r"nu is 0\.25"),
    ("finite_half_spheres", {"R": -1.0}, "R is -1"),
    ("finite_half_spheres", {"approach": 0.0}, "approach is 0"),
    ("flat_punch", {"force": None}, "exactly one of force, approach"),
    ("flat_punch", {"nu": 0.6}, r"nu is 0\.6"),
    ("flat_punch_2d", {"half_width": 0.0}, "half_width is 0"),
    ("hertz_box", {"radius": 1.5}, "narrower than the box"),
    ("hertz_box", {"kinematics": "axisymetric"}, "axisymmetric"),
    ("hertz_elliptical", {"R1y": math.inf}, "R1y and R2y are both infinite: use hertz_line for line contact"),
    ("hertz_elliptical", {"R1y": 1e14}, "use hertz_line"),
    ("hertz_elliptical", {"R1x": -1.0}, "the relative curvature 1/R1x [+] 1/R2x is -1"),
    ("hertz_elliptical", {"force": None}, "exactly one of force, approach, pressure_max"),
    ("hertz_line", {"kinematics": "plain_strain"}, "did you mean 'plane_strain'"),
    ("hertz_line", {"force": None}, "exactly one of force, radius, pressure_max"),
    ("hertz_line", {"R1": 3.0, "R2": -2.0}, "the relative curvature 1/R1 [+] 1/R2 is -0.1"),
    ("hertz_point", {"R1": True}, "R1 is True"),
    ("hertz_point", {"R2": 0.0}, "R2 is 0"),
    ("hertz_point", {"R1": math.inf}, "both infinite"),
    ("hertz_point", {"nu1": 0.6}, r"nu1 is 0\.6"),
    ("hertz_point", {"nu2": -1.0}, "nu2 is -1"),
    ("hertz_point", {"E1": 0.0}, "E1 is 0"),
    ("hertz_point", {"E1": math.nan}, "E1 is nan"),
    ("hertz_point", {"E2": "steel"}, "E2 is 'steel'"),
    ("hertz_point", {"force": -2.0}, "force is -2"),
    ("hertz_point", {"force": None}, "got none"),
    ("hertz_point", {"radius": 1.0}, "got force and radius"),
    ("paraboloid_punch", {"R": -5.0}, "R is -5:"),
    ("persson_pin", {"force": None, "contact_angle": 89.0}, r"must be below 8\d\.\d+ degrees"),
    ("persson_pin", {"force": None, "contact_angle": 30.0, "clearance": 0.0}, "without clearance"),
    ("persson_pin", {"clearance": -1.0}, "clearance is -1"),
    ("persson_pin", {"force": None}, "exactly one of force, contact_angle"),
    ("power_law_punch", {"exponent": 0.0}, "exponent is 0"),
    ("press_fit_cylinders", {"E_outer": 0.0}, "E_outer is 0"),
    ("press_fit_cylinders", {"interference": -0.1}, r"interference is -0\.1"),
    ("press_fit_cylinders", {"interface_radius": 30.0, "outer_radius": 30.0}, "outer_radius is 30: it must exceed"),
    ("press_fit_cylinders", {"kinematics": "3d"}, "kinematics"),
    ("press_fit_spheres", {"nu_inner": 0.7}, r"nu_inner is 0\.7"),
    ("receding_layer", {"E1": 101.0, "nu1": 0.0, "E2": 1.0}, "101 times stiffer"),
    ("receding_layer", {"E2": 1.0, "load_half_width": 11.0}, "load_half_width is 11 thicknesses"),
    ("receding_layer", {"thickness": 0.0}, "thickness is 0"),
    ("receding_layer", {"kinematics": "axisymmetric"}, "kinematics"),
    ("thick_cylinder", {"inner_radius": 0.0}, "no bore"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "changes", "words"), BAD_INPUT)
def test_bad_input_is_named(name, changes, words):
    refused(ModelError, words, analytic.THEORIES[name], **{**EXAMPLES[name], **changes})


POINT, FIT = analytic.hertz_point(**EXAMPLES["hertz_point"]), {**EXAMPLES["press_fit_cylinders"], "inner_radius": 0.5}
BAD_REQUESTS = [
    (lambda: POINT.surface_displacement(0.0, body=2), "body 2 is rigid"),
    (lambda: POINT.surface_displacement(0.0, body=3), "must be 1 or 2"),
    (lambda: POINT.stress(0.0, 0.1), "above the surface"),
    (lambda: POINT.stress(0.0, -0.1, 0.7), r"nu is 0\.7"),
    (lambda: POINT.at_approach(-1.0), "approach is -1"),
    (lambda: analytic.hertz_line(**EXAMPLES["hertz_line"]).stress(0.0, 1.0), "above the surface"),
    (lambda: analytic.hertz_box().stress([0.0, 1.0, 2.0]), r"shape \(3,\)"),
    (lambda: analytic.hertz_box().displacement([[0.0, 0.5]]), "above the surface"),
    (lambda: analytic.flat_punch(**EXAMPLES["flat_punch"], bonded=True).pressure(0.0), "bonded flat punch has no closed"),
    (lambda: analytic.spence_stick_ratio(nu=0.3, friction=-1.0), "friction is -1"),
    (lambda: analytic.press_fit_cylinders(**FIT).inner.hoop_stress([0.7, 1.1]), r"radii run from 0\.5 to 1"),
    (lambda: analytic.press_fit_spheres(**FIT).inner.axial_stress(0.7), "no axial stress"),
    (lambda: analytic.cattaneo_mindlin_sphere(
        **{**EXAMPLES["cattaneo_mindlin_sphere"], "force": 500.0, "friction": 0.4, "tangential_force": 100.0}
    ).unloaded_to(101.0), "down to the opposite peak -100"),
]  # fmt: skip


@pytest.mark.parametrize(("request_", "words"), BAD_REQUESTS)
def test_bad_requests_are_named(request_, words):
    refused(ModelError, words, request_)


def test_import_needs_numpy_only():
    heavy = {"scipy", "numba", "matplotlib", "meshio", "h5py", "pyamg"}
    assert printed(f"import sys, fastcontact.analytic; print({heavy} & set(sys.modules))") == "set()\n"


def test_a_concave_radius_is_negative():
    load = {"E1": 1e5, "nu1": 0.3, "force": 10.0}
    assert analytic.hertz_line(R1=10.0, R2=-11.0, **load).R_effective == pytest.approx(110.0)
    groove = analytic.hertz_elliptical(R1x=10.0, R1y=10.0, R2y=-11.0, **load)
    assert groove.pressure_max == pytest.approx(analytic.hertz_elliptical(R1x=10.0, R1y=110.0, **load).pressure_max)
