"""Lazy import of the public names of packages, of the values of dictionaries, and of optional libraries."""

from __future__ import annotations

import importlib
import pkgutil
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, TypeVar

T = TypeVar("T")


def lazy_names(package: str, title: str = "") -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return ``__getattr__``, ``__dir__`` and ``__all__`` of a package.

    The names and their modules are read from ``__init__.pyi``, the stub of the package for type checkers. Messages call the
    package `title`, by default by its name.
    """
    stub = (pkgutil.get_data(package, "__init__.pyi") or b"").decode()
    imports = re.findall(r"^from ([\w.]+) import \(?\s*(\w+) as", stub, re.MULTILINE)
    module_of = {name: module for module, name in imports}
    public = sorted(module_of.keys() - {"__version__"})

    def attribute(name: str) -> Any:
        if name not in module_of:
            from fastcontact.errors import getattr_and_dir

            return getattr_and_dir(title or package, public)[0](name)
        owner = importlib.import_module(module_of[name])
        is_module = hasattr(owner, "__path__")  # a name that the stub imports from a package is a module
        value = importlib.import_module(f"{owner.__name__}.{name}") if is_module else getattr(owner, name)
        setattr(sys.modules[package], name, value)
        return value

    return attribute, lambda: sorted(module_of), public


def import_library(name: str, title: str, install: str) -> Any:
    """Import a library. Raises FileError with the installation command if the library is missing."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        from fastcontact.errors import FileError

        raise FileError(f"{title} is not installed: pip install {install}") from error


class LazyDict(Mapping[str, T]):
    """Objects by name, which are imported on first use.

    Parameters
    ----------
    names : iterable of str
        Names of the objects.
    load : Callable
        Function that imports the object with a given name and returns it.
    """

    def __init__(self, names: Iterable[str], load: Callable[[str], T]) -> None:
        self._names, self._load = tuple(names), load

    def __getitem__(self, name: str) -> T:
        if name not in self._names:
            raise KeyError(name)
        return self._load(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)
