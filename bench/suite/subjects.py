"""Find the subjects of the suite in ``bench/subjects``."""

import importlib.util
from pathlib import Path

from fastcontact.errors import FastcontactError, unknown

FOLDER = Path(__file__).resolve().parents[1] / "subjects"


def names():
    """Return the names of all subjects."""
    return sorted(path.stem for path in FOLDER.glob("*.py") if not path.stem.startswith("_"))


def load(name):
    """Import a subject."""
    if name not in names():
        raise FastcontactError(unknown("benchmark", name, names()))
    spec = importlib.util.spec_from_file_location(f"fastcontact_bench_{name}", FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
