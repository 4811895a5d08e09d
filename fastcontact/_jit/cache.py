"""Kernels on disk are compiled anew when a file they depend on has changed; Numba looks at a kernel's own file alone."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from functools import cache
from typing import Any


def is_trusted(kernel: Any) -> bool:
    """Return whether nobody but the owner of this process and root can write to the folder of a kernel's cache.

    What lies there is run. Groups of their own, which many systems give to each user, are no others.
    """
    folder = getattr(getattr(kernel, "_cache", None), "cache_path", None)
    return folder is None or not hasattr(os, "getuid") or (_is_own(folder) and _keeps_names(os.path.dirname(folder)))


@cache
def _is_own(folder: str) -> bool:
    found = os.stat(folder)
    shared = found.st_mode & stat.S_IWOTH or (found.st_mode & stat.S_IWGRP and found.st_gid not in (0, os.getgid()))
    return found.st_uid in (0, os.getuid()) and not shared


@cache
def _keeps_names(folder: str) -> bool:
    """Return whether others cannot put a folder of theirs in the place of one inside `folder`."""
    return bool(os.stat(folder).st_mode & stat.S_ISVTX) or _is_own(folder)


def watch_files(kernel: Any, function: Callable[..., Any], decorators: str) -> Any:
    """Return a kernel, made from a function, with all files that its machine code depends on in the stamp of its cache.

    They are those of the kernels that it may call, and the file of `decorators`, which say how it is compiled.
    """
    files = {decorators}
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
