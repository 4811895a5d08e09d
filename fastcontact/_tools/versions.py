"""Versions of fastcontact, of Python and of the main libraries."""

from __future__ import annotations

import contextlib
import platform
from functools import cache
from importlib import metadata

from fastcontact._version import __version__

LIBRARIES = ("numpy", "scipy", "numba", "pyamg", "meshio", "h5py")


@cache
def versions() -> dict[str, str]:
    """Return the versions by name; libraries whose version is unknown are omitted."""
    by_name = {"fastcontact": __version__, "python": platform.python_version()}
    for name in LIBRARIES:
        with contextlib.suppress(metadata.PackageNotFoundError):
            library = metadata.distribution(name)
            # `metadata.version` would import `email`, which takes time.
            text = library.read_text("METADATA") or library.read_text("PKG-INFO") or ""
            if version := text.partition("\nVersion: ")[2].partition("\n")[0]:
                by_name[name] = version
    return by_name
