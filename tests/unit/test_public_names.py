"""Public names: loaded on first use, known to type checkers, included in the package."""

import ast
import importlib
from pathlib import Path

import pytest

import fastcontact as fc

FOLDER = Path(fc.__file__).parent


def imports_of_the_stub():
    """The module and the name there that the stub gives for each public name."""
    tree = ast.parse((FOLDER / "__init__.pyi").read_text(encoding="utf-8"))
    lines = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    return {alias.asname: (node.module, alias.name) for node in lines for alias in node.names}


def test_the_stub_lists_the_public_names():
    assert set(imports_of_the_stub()) == {*fc.__all__, "__version__"}


@pytest.mark.parametrize("name", fc.__all__)
def test_a_name_is_what_the_stub_says(name):
    module, there = imports_of_the_stub()[name]
    home = importlib.import_module(module)
    found = getattr(home, there) if hasattr(home, there) else importlib.import_module(f"{module}.{there}")
    assert getattr(fc, name) is found


def test_the_package_declares_its_types():
    assert (FOLDER / "py.typed").exists()


def test_an_unknown_name_is_no_attribute():
    with pytest.raises(AttributeError, match="no attribute 'solver'"):
        fc.solver  # noqa: B018
