"""Disk cache of compiled kernels, whose files are used only if they are undamaged, current and protected from other users.

Numba identifies a kernel only by the time and the size of its source file, executes any file in its cache, and fails if a
file is damaged. Here, the file name contains a digest of all sources on which the kernel depends, so that kernels remain
valid when the same version is installed again. Each file ends with a checksum. If a file is damaged, the kernel is compiled
again.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import io
import logging
import os
import pickle
import secrets
import stat
import sys
from collections.abc import Callable, Iterator
from functools import cache, cached_property, lru_cache
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.environment import Environment, lookup_environment
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

from fastcontact._jit import compiling
from fastcontact._version import __version__

log = logging.getLogger("fastcontact")
# Settings of Numba that affect compiled code but not the keys of its cache.
NUMBA_SETTINGS = ("OPT", "BOUNDSCHECK", "DEBUGINFO_DEFAULT", "CPU_NAME", "CPU_FEATURES", "THREADING_LAYER")
# Number of characters of a digest.
DIGEST_LENGTH = 64
# Types of global variables that are compiled into kernels as constants.
CONSTANT_TYPES = (bool, int, float, complex, str, tuple, np.ndarray, np.generic, type(None))


class _Unpickler(pickle.Unpickler):
    """Unpickler of kernels that does not import the modules of Numba whose functions a kernel contains.

    Their import takes longer than loading the kernels, and compiled code does not read the globals of a module.
    """

    def find_class(self, module: str, name: str) -> Any:
        """Return a global of a module."""
        return _environment if name == "_rebuild_env" else super().find_class(module, name)


def _environment(module: str, constants: list[Any], name: str) -> Any:
    """Return the Numba environment of a compiled function, which contains its constants, by the name of the function."""
    environment = lookup_environment(name)
    if environment is None:
        module_globals = {"__name__": module} if module.startswith("numba.") else vars(importlib.import_module(module))
        environment = Environment(module_globals)
        environment.consts[:] = constants
        environment.env_name = name
        Environment._memo[name] = environment
    return environment


class KernelFiles(_Cache):  # type: ignore[misc]
    """Files of the compiled versions of a kernel, which replace the cache of Numba.

    If a file cannot be used, the reason is logged once, in one line, and the kernel is compiled.

    Parameters
    ----------
    folder : pathlib.Path
        Folder of the files.
    name : str
        Beginning of the file names.
    function : callable
        The kernel in Python.
    options : str
        Options of the compilation.
    """

    def __init__(self, folder: Path, name: str, function: Callable[..., Any], options: str) -> None:
        self.folder, self._name, self._function, self._options = folder, name, function, options

    @property
    def cache_path(self) -> str:
        """Folder of the files."""
        return str(self.folder)

    def exist(self) -> bool:
        """Return whether the current version of the kernel is stored for any signature."""
        with contextlib.suppress(OSError):
            return self.version in _versions(self.folder, os.stat(self.folder).st_mtime_ns)
        return False

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Return the compiled kernel of a signature, or None."""
        rtsys.initialize(target)  # Numba's method would first import the compiler (58 modules)
        data = self.load(self._key(signature, target.codegen()))
        return None if data is None else CompileResult._rebuild(target, *data)

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Store the compiled kernel of a signature, unless it contains addresses of this process."""
        if not compiled.library.has_dynamic_globals:
            self.save(self._key(signature, compiled.codegen), compiled._reduce())

    def _key(self, signature: Any, codegen: Any) -> Any:
        digests = tuple(hashlib.sha256(part).hexdigest() for part in (self._function.__code__.co_code, b""))
        return signature, codegen.magic_tuple(), digests

    def load(self, key: Any) -> Any:
        """Return the stored kernel of a signature or None, after waiting for a helper process that compiles it."""
        path = self._path(key)
        while not path.exists() and compiling.wait(self._name):
            pass
        try:
            with open(path, "rb") as file:
                if not _is_protected(os.fstat(file.fileno())):
                    _log_once(f"other users may write to the compiled kernel '{path}'")
                    return None
                content = file.read()
            if _digest(content[:-DIGEST_LENGTH]).encode() == content[-DIGEST_LENGTH:]:
                return _Unpickler(io.BytesIO(content)).load()  # the digest shows that this package wrote the file
            _log_once(f"the compiled kernel '{path}' is damaged")
        except FileNotFoundError:
            pass
        except Exception as error:  # e.g. an object written by another release of a library
            _log_once(f"the compiled kernel '{path}' cannot be read ({error})")
        return None

    def save(self, key: Any, data: Any) -> None:
        """Store the compiled kernel of a signature in a file that is written atomically."""
        path, content = self._path(key), dumps(data)
        temporary = path.with_name(f"{path.name}.{secrets.token_hex(8)}")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            temporary.write_bytes(content + _digest(content).encode())
            os.replace(temporary, path)
        except OSError as error:
            _log_once(f"compiled kernels cannot be stored in '{path.parent}' ({error.strerror or error})")
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)

    def flush(self) -> None:
        """Do nothing, because outdated files have other names."""

    enable = disable = flush

    def _path(self, key: Any) -> Path:
        """Return the path of the file of a signature."""
        return self.folder / f"{self.version}.{_digest(repr(key).encode())[:24]}.nbc"

    @cached_property
    def version(self) -> str:
        """Name of the kernel with a digest of what determines its machine code besides the signature and the processor."""
        config = {name: getattr(numba.config, name, None) for name in NUMBA_SETTINGS}
        settings = [__version__, numba.__version__, llvmlite.__version__, sys.version, self._options, repr(config)]
        dependencies = "\n".join([*settings, *sorted(set(_dependencies(self._function, set())))])
        return f"{self._name}.{_digest(dependencies.encode())[:24]}"


# Cache files of kernels, by their Python functions.
files: dict[Any, KernelFiles] = {}


def attach_cache(kernel: Any, function: Callable[..., Any], options: str) -> str:
    """Store the compiled versions of a kernel in `KernelFiles`.

    Returns the reason why this is impossible, or an empty string. `options` are the options of the compilation.
    """
    if not hasattr(kernel, "_cache"):
        return ""  # compilation is disabled
    folder = cache_folder()
    if folder is None:
        return "no writable folder for compiled kernels"
    if not is_trusted(folder):
        return f"other users may write to the folder of compiled kernels, {folder}"
    name = f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}"
    files[function] = kernel._cache = KernelFiles(folder, name, function, options)
    return ""


@lru_cache(maxsize=1)
def _versions(folder: Path, changed: int) -> set[str]:
    """Return the versions of the kernels in a folder, which was last modified at the time `changed` [ns]."""
    return {name.rsplit(".", 2)[0] for name in os.listdir(folder)}


@cache
def cache_folder() -> Path | None:
    """Return the first writable folder for compiled kernels: in NUMBA_CACHE_DIR or the user's cache, or in the package."""
    configured = str(getattr(numba.config, "CACHE_DIR", ""))
    if configured:
        base = configured
    elif sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA", "")
    elif sys.platform == "darwin":
        base = os.path.expanduser("~/Library/Caches")
    else:
        base = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    for folder in (Path(base, "fastcontact"), Path(__file__).parent / "__pycache__"):
        try:
            if folder.is_absolute() or configured:
                folder.mkdir(parents=True, exist_ok=True)
                if os.access(folder, os.W_OK):
                    return folder
        except OSError:
            log.debug("no compiled kernels in '%s'", folder)
    return None


@cache
def is_trusted(folder: Path) -> bool:
    """Return whether only the user of this process and root can write to a folder, whose files are executed.

    Write permission for the group of the process, which contains only its user on many systems, is accepted as well.
    """
    folder.mkdir(parents=True, exist_ok=True)
    parent = os.stat(folder.parent)  # users who may write to it could replace the folder
    return _is_protected(os.stat(folder)) and (bool(parent.st_mode & stat.S_ISVTX) or _is_protected(parent))


def _is_protected(status: os.stat_result) -> bool:
    """Return whether a file belongs to the user of this process or to root and is not writable for other users."""
    if not hasattr(os, "getuid"):
        return True
    shared = status.st_mode & stat.S_IWOTH or (status.st_mode & stat.S_IWGRP and status.st_gid not in (0, os.getgid()))
    return status.st_uid in (0, os.getuid()) and not shared


@cache
def _log_once(text: str) -> None:
    """Log the reason why a file is not used, once per process."""
    log.info("%s: compiling instead", text)


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


@cache
def _digest_of_file(path: str) -> str:
    return _digest(Path(path).read_bytes())


def _dependencies(function: Callable[..., Any], seen: set[Any]) -> Iterator[str]:
    """Yield strings that identify the code and the constants on which the machine code of a function depends.

    These are the digests of the files of the function and of the kernels and intrinsics that it calls, and the constants that
    are compiled into them.
    """
    code = function.__code__
    if code in seen:
        return
    seen.add(code)
    yield _digest_of_file(code.co_filename)
    for name in code.co_names:
        value = function.__globals__.get(name)
        # `py_func` is the function of a kernel, and `_defn` that of an intrinsic.
        called = getattr(value, "py_func", None) or getattr(value, "_defn", None)
        if called is not None:
            yield from _dependencies(called, seen)
        elif isinstance(value, CONSTANT_TYPES):
            yield f"{name} = {value.tobytes() if isinstance(value, np.ndarray) else value!r}"
