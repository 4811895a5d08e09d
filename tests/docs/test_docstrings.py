"""Docstrings: examples run, and every array argument and result has a shape and a unit."""

from __future__ import annotations  # as in the package: the measure reads them as text

import doctest
import importlib
import inspect

import arrays
import numpy as np
import pages
import pytest
from numpy.typing import ArrayLike

import fastcontact as fc
from fastcontact.model.model import PUBLIC

PACKAGE = pages.ROOT / "fastcontact"
WITH_EXAMPLES = [path for path in sorted(PACKAGE.rglob("*.py")) if ">>>" in path.read_text(encoding="utf-8")]
ROOMS = ["analytic", "mesh/generate", "mesh/elements", "mesh/mesh.py", "mesh/quadrature.py", "mesh/quality.py"]
ROOMS += ["mesh/topology.py", "model/checks.py"]
ROOMS += [f"elasticity/{name}.py" for name in ("energy", "loads", "materials", "recovery", "springs", "stiffness")]
ROOMS += [f"elasticity/{name}.py" for name in ("dilatation", "multipoint_constraints", "smoothed_stress")]


@pytest.mark.parametrize("path", WITH_EXAMPLES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_examples_of_a_module(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = ".".join(path.relative_to(pages.ROOT).with_suffix("").parts).removesuffix(".__init__")
    found = doctest.testmod(importlib.import_module(name), optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert not found.failed


def public_values():
    """Yield (name, value): public functions, the classes that users make or get, and what builds a model."""
    for module in (fc, fc.analytic, fc.generate, fc.obstacles, fc.plot):
        for name, value in {name: getattr(module, name) for name in module.__all__}.items():
            made_by_functions = module is fc.analytic or getattr(value, "_is_protocol", False)
            if inspect.isfunction(value) or (inspect.isclass(value) and not made_by_functions):
                yield f"{module.__name__}.{name}", value
    for name, value in inspect.getmembers(fc.Model, inspect.isfunction):
        if name.startswith("add_") or name in PUBLIC:
            yield f"Model.{name}", value


def test_every_public_name_has_an_example():
    values = [(name, value) for name, value in public_values() if not name.endswith(("Error", "Warning"))]
    assert len(values) > 120
    assert [name for name, value in values if ">>>" not in inspect.getdoc(value)] == []


def test_every_public_array_has_a_shape_and_a_unit():
    found = arrays.entries(arrays.public_values())
    print(arrays.figures(found))
    assert len(found) > 150
    assert arrays.missing(found) == []


@pytest.mark.parametrize("room", ROOMS)
def test_every_array_of_a_room_has_a_shape_and_a_unit(room):
    assert arrays.missing(arrays.entries(arrays.values_under(room))) == []


def scaled(x: ArrayLike, y: ArrayLike, factor: float) -> np.typing.NDArray[np.float64]:
    return factor * np.asarray(x) + np.asarray(y)


@pytest.mark.parametrize(
    ("text", "lacking"),
    [
        ("Return sums (n,) [length] of `x` (n,) [length] and `y` (n,) [length].", ""),
        ("Return sums (n,) [length] of `x` (n,) [length] and `y` (n,).", "y has no unit"),
        ("Return sums (n,) [length] of `x` and `y` (n,) [length].", "x has no shape and no unit"),
        ("Return sums of `x` (n,) [length] and `y` (n,) [length].", "return has no shape and no unit"),
        ("Return sums (Dunavant, 1985) on [-1, 1] of `x` (n,) [-], `y` (n,) [-].", "return has no shape and no unit"),
        ("Sums (n,) [-].\n\nParameters\n----------\nx, y : array_like (n,)\n    Places [length].\n", ""),
        ("Sums (n,) [-].\n\nParameters\n----------\nx, y : array_like\n    Places [length].\n", "x has no shape"),
    ],
)
def test_the_measure_finds_what_a_docstring_lacks(monkeypatch, text, lacking):
    monkeypatch.setattr(scaled, "__doc__", text)
    found = arrays.missing(list(arrays.of_value(scaled)))
    assert (found == []) if not lacking else found[0].endswith(lacking)
