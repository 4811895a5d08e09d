"""Contact formulations: one file each; a new file here is a new formulation.

Every module of this package whose name has no leading underscore defines one class ``FORMULATION``.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator, Mapping

from fastcontact.contact.formulations._formulation import Formulation


class _Formulations(Mapping[str, type[Formulation]]):
    """The formulations by name, each imported at its first use: most models have one."""

    _names = tuple(name for _, name, _ in pkgutil.iter_modules(__path__) if not name.startswith("_"))

    def __getitem__(self, name: str) -> type[Formulation]:
        if name not in self._names:
            raise KeyError(name)
        formulation: type[Formulation] = importlib.import_module(f"{__name__}.{name}").FORMULATION
        return formulation

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


FORMULATIONS: Mapping[str, type[Formulation]] = _Formulations()

__all__ = ["FORMULATIONS", "Formulation"]
