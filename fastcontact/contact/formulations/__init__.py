"""Contact formulations: one file each; a new file here is a new formulation.

Every module of this package whose name has no leading underscore defines one class ``FORMULATION``.
"""

from __future__ import annotations

import importlib
import pkgutil

from fastcontact.contact.formulations._formulation import Formulation

FORMULATIONS: dict[str, type[Formulation]] = {
    name: importlib.import_module(f"{__name__}.{name}").FORMULATION
    for _, name, _ in pkgutil.iter_modules(__path__)
    if not name.startswith("_")
}

__all__ = ["FORMULATIONS", "Formulation"]
