"""The analytic library: table of names, imports, results as plain values."""

import inspect
import pickle
import subprocess
import sys

import pytest

from fastcontact import analytic

EXAMPLES = {
    "block_sliding": {"E": 1.0, "nu": 0.3, "height": 1.0, "pressure": 1.0, "friction": 0.1, "displacement": 0.0},
    "cattaneo_mindlin_line": {
        "E1": 1.0, "nu1": 0.3, "R1": 1.0, "E2": 1.0, "nu2": 0.3, "friction": 0.1, "tangential_force": 0.0,
        "force": 1e-3,
    },
    "cattaneo_mindlin_sphere": {
        "E1": 1.0, "nu1": 0.3, "R1": 1.0, "E2": 1.0, "nu2": 0.3, "friction": 0.1, "tangential_force": 0.0,
        "force": 1e-3,
    },
    "cone_punch": {"E": 1.0, "nu": 0.3, "slope_angle": 5.0, "force": 1.0},
    "finite_half_spheres": {"approach": 1.0},
    "flat_punch": {"E": 1.0, "nu": 0.3, "radius": 1.0, "force": 1.0},
    "flat_punch_2d": {"nu": 0.3, "half_width": 1.0, "force": 1.0},
    "hertz_box": {},
    "hertz_elliptical": {"E1": 1.0, "nu1": 0.3, "R1x": 1.0, "R1y": 2.0, "force": 1.0},
    "hertz_line": {"E1": 1.0, "nu1": 0.3, "R1": 1.0, "force": 1e-3},
    "hertz_point": {"E1": 1.0, "nu1": 0.3, "R1": 1.0, "force": 1e-3},
    "paraboloid_punch": {"E": 1.0, "nu": 0.3, "R": 5.0, "force": 1.0},
    "persson_pin": {"E": 1.0, "R": 1.0, "clearance": 0.01, "force": 0.01},
    "power_law_punch": {"E": 1.0, "nu": 0.3, "coefficient": 1.0, "exponent": 3, "force": 1.0},
    "press_fit_cylinders": {
        "E_inner": 1.0, "nu_inner": 0.3, "E_outer": 1.0, "nu_outer": 0.3, "interface_radius": 1, "outer_radius": 2,
        "interference": 0.01,
    },
    "press_fit_spheres": {
        "E_inner": 1.0, "nu_inner": 0.3, "E_outer": 1.0, "nu_outer": 0.3, "interface_radius": 1, "outer_radius": 2,
        "interference": 0.01,
    },
    "receding_layer": {"E1": 1.0, "nu1": 0.3, "thickness": 1.0, "force": 1.0},
    "thick_cylinder": {"E": 1.0, "nu": 0.3, "inner_radius": 1, "outer_radius": 2, "inner_pressure": 1.0},
    "thick_sphere": {"E": 1.0, "nu": 0.3, "inner_radius": 1, "outer_radius": 2, "inner_pressure": 1.0},
}  # fmt: skip


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


def test_import_needs_numpy_only():
    code = (
        "import sys, fastcontact.analytic; "
        "heavy = {'scipy', 'numba', 'matplotlib', 'meshio', 'h5py', 'pyamg'} & set(sys.modules); "
        "sys.exit(', '.join(sorted(heavy)) or 0)"
    )
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert process.returncode == 0, process.stderr
