"""Keeps meshio's readers within bounds: one file, its true size, an end to every loop.

meshio believes the sizes that a file declares, and several of its readers wait for a line that never comes. While one
reads, the modules of meshio see stand-ins for `numpy`, `open`, `zlib`, `lzma` and `gzip`, which are the same but refuse
what a file of this size cannot mean. They are put in place for the length of a block only, by one thread at a time.
"""

from __future__ import annotations

import builtins
import gzip
import lzma
import os
import re
import sys
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from fastcontact.mesh.files import hdf5

# Lines read beyond the end of a file before a reader is stopped.
ENDS = 10_000
# What an array may take [bytes], or times the size of the file if that is more: a number takes two bytes of text and
# eight of memory, and readers make some room for things that are not in the file.
PLAUSIBLE_BYTES = 1 << 26
PLAUSIBLE_EXPANSION = 32
# What a packed file may grow to, in the same way: XML and numbers as text compress tenfold.
UNPACKED_BYTES = 1 << 27
UNPACKED_EXPANSION = 30
# Formats that are HDF5 files, and those that consist of several files.
HDF5_FORMATS = ("cgns", "h5m", "hmf", "exodus")
SEVERAL_FILES = ("tetgen", "xdmf", "dolfin-xml")


# Surfaces as text. meshio's own pattern takes time without end to find that a text is none; this one never goes back.
_NUMBER = r"[+-]?+(?:\d++\.?+\d*+|\.\d++)"
_POINT = rf"{_NUMBER}\s++{_NUMBER}\s++{_NUMBER}(?:\s++{_NUMBER})?+"
WKT = re.compile(rf"TIN\s*+\((?:\s*+\(\s*+\(\s*+{_POINT}(?:\s*+,\s*+{_POINT}){{3}}\s*+\)\s*+\)\s*+,?+)*+\s*+\)")


class ImplausibleError(Exception):
    """What a file declares cannot be meant."""


@contextmanager
def bounded(path: Path, file_format: str) -> Iterator[None]:
    """Put the stand-ins in place while meshio reads `path`; not for two threads at once.

    Raises
    ------
    FileError
        If the file is an HDF5 file that leads elsewhere or declares what it cannot hold.
    ImplausibleError
        Inside the block, if meshio is made to read another file, to take more memory than the file can mean, or to
        wait beyond its end.
    """
    if file_format in HDF5_FORMATS and (file_format != "exodus" or _is_hdf5(path)):
        with hdf5.opened(path):
            pass
    size = os.path.getsize(path)
    limit, most = max(PLAUSIBLE_BYTES, PLAUSIBLE_EXPANSION * size), max(UNPACKED_BYTES, UNPACKED_EXPANSION * size)
    allowed = path.resolve().parent if file_format in SEVERAL_FILES else path.resolve()
    if path.suffix.lower() == ".gz":
        _check_packed(path, most)
    if file_format == "xdmf":
        _check_references(path)
    if file_format == "wkt" and not WKT.match(path.read_text(encoding="utf-8", errors="replace").strip()):
        raise ImplausibleError("it holds no triangles as TIN (((x y z, ...)), ...)")
    stand_ins: dict[str, Any] = {
        "np": _Bounded(np, _arrays(limit, size, allowed)),
        "zlib": _Bounded(zlib, {"decompress": lambda data: _unpacked(zlib.decompressobj(), data, most)}),
        "lzma": _Bounded(lzma, {"decompress": lambda data: _unpacked(lzma.LZMADecompressor(), data, most)}),
        "open": _opener(allowed),
    }
    before: list[tuple[dict[str, Any], dict[str, Any]]] = []
    try:
        for module in [m for name, m in list(sys.modules.items()) if name.startswith("meshio.") and m is not None]:
            names = vars(module)
            before.append((names, {name: names[name] for name in stand_ins if name in names}))
            names.update({name: stand_in for name, stand_in in stand_ins.items() if name in names or name == "open"})
        yield
    finally:
        for names, originals in before:
            names.pop("open", None)
            names.update(originals)


def _is_hdf5(path: Path) -> bool:
    """Return whether a file is one of HDF5: others may be of an older kind of netCDF."""
    import h5py

    return bool(h5py.is_hdf5(path))


class _Bounded:
    """A module with some of its functions replaced."""

    def __init__(self, module: Any, replaced: dict[str, Callable[..., Any]]) -> None:
        self._module = module
        self.__dict__.update(replaced)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._module, name)


def _arrays(limit: int, size: int, allowed: Path) -> dict[str, Callable[..., Any]]:
    """Return numpy's functions that make arrays of a size that comes from a file; `size` is that of the file itself."""

    def check(shape: Any, dtype: Any) -> None:
        counts = [int(n) for n in np.atleast_1d(shape).tolist()] if np.size(shape) else []
        wanted = int(np.prod(counts, dtype=object)) * np.dtype(dtype).itemsize
        if min(counts, default=0) < 0 or wanted > limit:
            raise ImplausibleError(f"it declares an array of {wanted:.3g} bytes, which a file of its size cannot hold")

    def made(function: Callable[..., Any]) -> Callable[..., Any]:
        def make(shape: Any, dtype: Any = float, *args: Any, **kwargs: Any) -> Any:
            check(shape, dtype)
            return function(shape, dtype, *args, **kwargs)

        return make

    def full(shape: Any, fill_value: Any, dtype: Any = None, **kwargs: Any) -> Any:
        check(shape, float if dtype is None else dtype)
        return np.full(shape, fill_value, dtype, **kwargs)

    def arange(*args: Any, **kwargs: Any) -> Any:
        check(max(int(abs(float(a))) for a in args), int)
        return np.arange(*args, **kwargs)

    def fromfile(file: Any, dtype: Any = float, count: Any = -1, sep: str = "", **kwargs: Any) -> Any:
        # In NumPy -1 means everything, and other negative counts are no error everywhere.
        if int(count) < -1:
            raise ImplausibleError(f"it declares {int(count)} numbers")
        check(max(int(count), 0), dtype)
        if isinstance(file, str | os.PathLike):
            _check_place(file, allowed)
            return np.fromfile(file, dtype, int(count), sep, **kwargs)
        if isinstance(file, _Ending):
            file = file.before_numbers()
        found = np.fromfile(file, dtype, int(count), sep, **kwargs)
        # The head of a section of Gmsh 4: how many blocks follow, with how many entries in all, none without a byte.
        if np.dtype(dtype).kind == "u" and int(count) in (2, 4) and found[:2].max(initial=0) > size:
            raise ImplausibleError(f"it declares {found[:2].max()} blocks or entries")
        return found

    def fromiter(items: Any, dtype: Any, count: Any = -1, **kwargs: Any) -> Any:
        check(max(int(count), 0), dtype)
        return np.fromiter(items, dtype, int(count), **kwargs)

    return {
        "fromiter": fromiter,
        "empty": made(np.empty), "zeros": made(np.zeros), "ones": made(np.ones), "full": full,
        "arange": arange, "fromfile": fromfile,
    }  # fmt: skip


class _Ending:
    """An open file that counts how often it is read beyond its end."""

    def __init__(self, file: Any) -> None:
        self._file, self._ends = file, 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def __enter__(self) -> _Ending:
        return self

    def __exit__(self, *_: Any) -> None:
        self._file.close()

    def __iter__(self) -> Iterator[Any]:
        return iter(self._file)

    def __next__(self) -> Any:
        return next(self._file)

    def _counted(self, found: Any) -> Any:
        if not found:
            self._ends += 1
            if self._ends > ENDS:
                raise ImplausibleError("it ends where more must come")
        return found

    def before_numbers(self) -> Any:
        """Return the file itself, for NumPy to read from; counts whether that begins at the end."""
        self._counted(self._file.tell() < os.fstat(self._file.fileno()).st_size)
        return self._file

    def readline(self, *args: Any) -> Any:
        """Read a line."""
        return self._counted(self._file.readline(*args))

    def read(self, *args: Any) -> Any:
        """Read a part, and make room only for what is there."""
        if args and args[0] is not None and args[0] >= 0:
            args = (min(args[0], os.fstat(self._file.fileno()).st_size),)
        return self._counted(self._file.read(*args)) if args != (0,) else self._file.read(0)


def _opener(allowed: Path) -> Callable[..., Any]:
    def guarded_open(name: Any, mode: str = "r", *args: Any, **kwargs: Any) -> Any:
        _check_place(name, allowed)
        if set(mode) & set("wax+"):
            raise ImplausibleError("reading it would write a file")
        return _Ending(builtins.open(name, mode, *args, **kwargs))

    return guarded_open


def _check_place(name: Any, allowed: Path) -> None:
    """Refuse a file that is neither the one allowed nor, where that is a folder, in it."""
    found = Path(os.fspath(name)).resolve()
    if allowed not in (found, found.parent):
        raise ImplausibleError(f"it refers to the file '{found}', which is not beside it")


def _check_references(path: Path) -> None:
    """Look through the HDF5 files that an XDMF file refers to, which must stand beside it."""
    try:
        items = [item for item in ElementTree.parse(path).iter("DataItem") if item.get("Format") == "HDF"]
    except ElementTree.ParseError as error:
        raise ImplausibleError(f"it is no XML: {error}") from error
    for name in {(item.text or "").strip().partition(":")[0] for item in items}:
        _check_place(path.parent / name, path.resolve().parent)
        with hdf5.opened(path.parent / name):
            pass


def _unpacked(unpacker: Any, data: bytes, most: int) -> bytes:
    found = bytes(unpacker.decompress(data, most))
    if len(found) >= most:
        raise ImplausibleError(f"it unpacks to more than {most} bytes")
    if not unpacker.eof:
        raise ImplausibleError("a packed part of it is cut off")
    return found


def _check_packed(path: Path, most: int) -> None:
    total = 0
    with gzip.open(path, "rb") as file:
        while piece := file.read(1 << 20):
            total += len(piece)
            if total > most:
                raise ImplausibleError(f"it unpacks to more than {most} bytes: unpack it first")
