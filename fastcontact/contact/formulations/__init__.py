"""Contact formulations.

Each module of this package whose name has no leading underscore implements one formulation, under the name of the module, and
defines its class as ``FORMULATION``. To add a formulation, add a module.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator, Mapping

from fastcontact.contact.formulations._formulation import Formulation


class _Formulations(Mapping[str, type[Formulation]]):
    """The formulations by name. Each is imported at its first use, because most models use only one."""

    _names = tuple(name for _, name, _ in pkgutil.iter_modules(__path__) if not name.startswith("_"))

    def __getitem__(self, name: str) -> type[Formulation]:
        if name not in self._names:
            raise KeyError(name)
        formulation: type[Formulation] = importlib.import_module(f"{__name__}.{name}").FORMULATION
        return formulation

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


FORMULATIONS: Mapping[str, type[Formulation]] = _Formulations()

__all__ = ["FORMULATIONS", "Formulation"]
