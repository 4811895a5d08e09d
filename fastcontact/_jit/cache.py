"""Kernels on disk: told when a file they depend on has changed; Numba looks at a kernel's own file alone."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any


def kept(kernel: Any, function: Callable[..., Any]) -> Any:
    """Return a kernel, made from a function, whose cache on disk knows all its files."""
    cache = getattr(kernel, "_cache", None)
    if hasattr(cache, "_cache_file"):
        _watch(cache, function)
    return kernel


def _watch(cache: Any, function: Callable[..., Any]) -> None:
    files: set[str] = set()
    _gather(function, files)
    if len(files) > 1:
        stats = [os.stat(file) for file in sorted(files)]
        cache._cache_file._source_stamp = [(stat.st_mtime, stat.st_size) for stat in stats]


def _gather(function: Callable[..., Any], files: set[str]) -> None:
    """Add the file of a function and those of the kernels that it and they may call."""
    file = function.__code__.co_filename
    if file not in files:
        files.add(file)
        for other in list(function.__globals__.values()):
            part = _written(other)
            if part is not None:
                _gather(part, files)


def _written(part: Any) -> Any:
    """Return the function from which a kernel, or a part that is written for each kernel anew, is compiled; else None."""
    return getattr(part, "py_func", None) or getattr(part, "_defn", None)
