"""Contact formulations.

Each module of this package whose name has no leading underscore implements one formulation, under the name of the module, and
defines its class as ``FORMULATION``. To add a formulation, add a module.
"""

from __future__ import annotations

import importlib
import pkgutil

from fastcontact._tools.lazy import LazyDict
from fastcontact.contact.formulations._formulation import Formulation


def _imported(name: str) -> type[Formulation]:
    formulation: type[Formulation] = importlib.import_module(f"{__name__}.{name}").FORMULATION
    return formulation


# The formulations by name. Most models use only one.
FORMULATIONS = LazyDict((name for _, name, _ in pkgutil.iter_modules(__path__) if not name.startswith("_")), _imported)

__all__ = ["FORMULATIONS", "Formulation"]
