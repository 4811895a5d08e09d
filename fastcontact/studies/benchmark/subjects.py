"""Find the subjects of the benchmark suite beside the package's checkout."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

from fastcontact.errors import FastcontactError, unknown


def folder() -> Path:
    """Return the folder of the subjects.

    Raises
    ------
    FastcontactError
        If the package is installed without its checkout.
    """
    found = Path(__file__).resolve().parents[3] / "bench" / "subjects"
    if not found.is_dir():
        raise FastcontactError(
            f"the benchmarks need the source checkout, and there is no '{found}': install it with pip install -e"
        )
    return found


def names() -> list[str]:
    """Return the names of all subjects."""
    return sorted(path.stem for path in folder().glob("*.py") if not path.stem.startswith("_"))


def load(name: str) -> ModuleType:
    """Import a subject.

    Raises
    ------
    FastcontactError
        If there is none of that name.
    """
    if name not in names():
        raise FastcontactError(unknown("benchmark", name, names()))
    spec = importlib.util.spec_from_file_location(f"fastcontact_bench_{name}", folder() / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
