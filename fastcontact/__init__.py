"""fastcontact: fast finite elements for elastic contact problems.

Public names are imported on first use, which keeps ``import fastcontact`` at about 0.02 s.
"""

from __future__ import annotations

import importlib
import logging
import os
import pkgutil
import re
from typing import Any

from fastcontact._version import __version__ as __version__

# Without this setting, idle threads of OpenBLAS spin for about 0.1 s before they sleep. OpenBLAS reads the variable once,
# when NumPy or SciPy is first imported.
os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "4")

logging.getLogger(__name__).addHandler(logging.NullHandler())  # no output unless the user configures logging

# Modules of the public names. The stub lists them for type checkers, and here they are imported on first use.
_STUB = (pkgutil.get_data(__name__, "__init__.pyi") or b"").decode()
_MODULE_OF = {name: module for module, name in re.findall(r"^from ([\w.]+) import \(?\s*(\w+) as", _STUB, re.MULTILINE)}
__all__ = sorted(_MODULE_OF.keys() - {"__version__"})


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        from fastcontact.errors import getattr_and_dir

        return getattr_and_dir(__name__, __all__)[0](name)
    owner = importlib.import_module(_MODULE_OF[name])
    is_module = hasattr(owner, "__path__")  # the public names of packages are modules
    value = importlib.import_module(f"{owner.__name__}.{name}") if is_module else getattr(owner, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
