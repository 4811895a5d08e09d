"""Kernels on disk are compiled anew when a file they depend on has changed; Numba looks at a kernel's own file alone."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any


def watch_files(kernel: Any, function: Callable[..., Any]) -> Any:
    """Return a kernel, made from a function, with all files of the kernels that it may call in the stamp of its cache."""
    files: set[str] = set()
    _gather(function, files)
    cache_file = getattr(getattr(kernel, "_cache", None), "_cache_file", None)  # none where kernels are not compiled
    if cache_file is not None:
        cache_file._source_stamp = [(stat.st_mtime, stat.st_size) for stat in map(os.stat, sorted(files))]
    return kernel


def _gather(function: Callable[..., Any], files: set[str]) -> None:
    """Add the file of a function and those of the kernels, and of the code written by hand, that it and they may call."""
    file = function.__code__.co_filename
    if file not in files:
        files.add(file)
        for other in list(function.__globals__.values()):
            part = getattr(other, "py_func", None) or getattr(other, "_defn", None)  # of a kernel, of an intrinsic
            if part is not None:
                _gather(part, files)
