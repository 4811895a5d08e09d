"""Safe reading of HDF5 files from untrusted sources, and writing that reports a write error as a Python exception.

No data outside a file are read, and damage is reported. All groups and data sets are checked before any data are read. Only
numbers and strings of fixed length are read: strings of variable length are stored in a heap of the file, and HDF5 does not
terminate for some damaged heaps.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from fastcontact._tools.paths import PathLike, existing_file
from fastcontact.arrays import AnyArray
from fastcontact.errors import FastcontactError, FileError

# The memory limit of a data set is the larger of this size [byte] and this multiple of the size of the file. A data set of
# zeros can be compressed by a factor of a thousand, but meshes and results cannot.
PLAUSIBLE_BYTES = 1 << 28
PLAUSIBLE_EXPANSION = 20
# Limits of the total size of all data sets, in which a data set is counted once for each link to it.
PLAUSIBLE_IN_ALL = 1 << 30
PLAUSIBLE_EXPANSION_IN_ALL = 100
# Number of strings or references that a data set may contain regardless of the size of its file.
MIN_OBJECT_LIMIT = 1000
# Largest nesting depth of groups. HDF5 visits groups by recursion, and deeper nesting could overflow its stack.
MAX_DEPTH = 64
# Allowed kinds of data: numbers and strings of fixed length.
PLAIN_KINDS = "iufS"


@contextmanager
def open_hdf5(path: PathLike) -> Iterator[Any]:
    """Open an HDF5 file for reading in a ``with`` block; any error in the block due to damage becomes a FileError."""
    import h5py

    existing = existing_file(path)
    try:
        if not h5py.is_hdf5(existing):
            raise FileError(f"'{path}' is not an HDF5 file: check that it is complete and has the right suffix")
        with h5py.File(existing, "r") as file:
            check_contents(file, path)
            yield file
    except (FastcontactError, Warning):
        raise
    except Exception as error:  # damage can cause any exception
        raise FileError(f"cannot read '{path}', which is damaged or incomplete: write it again") from error


def check_contents(file: Any, path: PathLike) -> None:
    """Check an open HDF5 file before anything in it is read.

    Raises FileError if a link refers to another file, if the values of a data set are stored in another file, if a data set
    needs an external filter, if the data sets need more memory than is plausible for a file of this size, or if groups are
    nested cyclically or too deeply.
    """
    from h5py import h5d, h5g, h5o
    from h5py.h5l import TYPE_HARD, TYPE_SOFT

    file_size, total = file.id.get_filesize(), 0
    limit = max(PLAUSIBLE_BYTES, PLAUSIBLE_EXPANSION * file_size)
    limit_in_all = max(PLAUSIBLE_IN_ALL, PLAUSIBLE_EXPANSION_IN_ALL * file_size)
    addresses: set[Any] = {h5o.get_info(file["/"].id).addr}
    pending: list[tuple[Any, str, int]] = [(file["/"].id, "", 0)]
    while pending:
        group, where, depth = pending.pop()
        links: list[tuple[bytes, int]] = []
        group.links.iterate(lambda name, info, links=links: links.append((name, info.type)), info=True)
        for link_name, kind in links:
            name = f"{where}/{link_name.decode('utf-8', 'replace')}"
            if kind == TYPE_SOFT:
                continue  # a soft link refers to an object of the same file
            if kind != TYPE_HARD:
                raise FileError(f"'{path}' refers to another file at '{name}': copy the data into one file")
            item = h5o.open(group, link_name)
            if isinstance(item, h5d.DatasetID):
                total += _check_dataset(item, f"'{name}' of '{path}'", limit, file_size)
                if total > limit_in_all:
                    raise FileError(
                        f"'{path}' declares more than {limit_in_all:.3g} bytes in total, which a file of its size cannot "
                        "hold: write it again"
                    )
            elif isinstance(item, h5g.GroupID):
                address = h5o.get_info(item).addr
                if address in addresses or depth >= MAX_DEPTH:
                    raise FileError(f"'{path}' has cyclic or too deeply nested groups at '{name[:80]}': write it again")
                addresses.add(address)
                pending.append((item, name, depth + 1))


def _check_dataset(dataset: Any, where: str, limit: int, file_size: int) -> int:
    """Return the size of a data set [byte]. Raises FileError, with its location `where`, if it is external or too large."""
    from h5py import h5d, h5z

    settings = dataset.get_create_plist()
    layout = settings.get_layout()
    if layout == h5d.VIRTUAL or settings.get_external_count():
        raise FileError(f"{where} stores its values in another file: copy the data into one file")
    item_size, count = dataset.get_type().get_size(), dataset.get_space().get_simple_extent_npoints()
    size = count * item_size
    # Each string or reference becomes a Python object, and takes space in the file.
    if count > max(MIN_OBJECT_LIMIT, file_size // 8) and dataset.dtype.hasobject:
        raise FileError(f"{where} declares {count} strings or references, which its file cannot hold: write it again")
    if layout == h5d.CHUNKED:
        chunk = int(np.prod([int(n) for n in settings.get_chunk()], dtype=object)) * item_size
        built_in = (h5z.FILTER_DEFLATE, h5z.FILTER_SHUFFLE, h5z.FILTER_FLETCHER32, h5z.FILTER_SZIP,
               h5z.FILTER_NBIT, h5z.FILTER_SCALEOFFSET)  # fmt: skip
        filters = [settings.get_filter(number)[0] for number in range(settings.get_nfilters())]
        # HDF5 would search the shared libraries of the system for an unknown filter.
        if not set(filters) <= set(built_in):
            raise FileError(f"{where} is compressed with the filter {filters[0]}, which HDF5 may lack: use gzip")
        if dataset.get_storage_size() > 2 * (size + chunk) + PLAUSIBLE_BYTES:
            raise FileError(f"{where} is larger compressed than uncompressed: the file is damaged; write it again")
        size = max(size, chunk)
    if size > limit:
        raise FileError(f"{where} declares {size:.3g} bytes, which a file of its size cannot hold: write it again")
    return int(size)


def check_size(where: str, shape: tuple[int, ...], file: Any) -> None:
    """Raise FileError if an array of doubles, called `where`, is too large for the size of the file with its data."""
    size = 8 * int(np.prod(shape, dtype=object))
    if size > max(PLAUSIBLE_IN_ALL, PLAUSIBLE_EXPANSION_IN_ALL * file.id.get_filesize()):
        raise FileError(f"{where} is an array of {size:.3g} bytes, too many for a file of its size: write it again")


def values(group: Any, name: str) -> AnyArray:
    """Return a data set of a group as an array of numbers or of strings of fixed length, or raise FileError."""
    import h5py

    where = f"'{group.name}/{name}' of '{group.file.filename}'"
    if name not in group:
        raise FileError(f"{where} is missing: the file is incomplete; write it again")
    dataset = group[name]
    if not isinstance(dataset, h5py.Dataset) or dataset.dtype.base.kind not in PLAIN_KINDS:
        raise FileError(f"{where} contains no plain numbers: the file is damaged; write it again")
    return np.asarray(dataset[()])


def attribute(item: Any, name: str, default: Any = None) -> Any:
    """Return an attribute of a group or a data set, or `default` if it is missing.

    Raises FileError unless the attribute is a number, a string of fixed length or an array of these.
    """
    if name not in item.attrs and default is not None:
        return default
    if item.attrs.get_id(name).dtype.base.kind not in PLAIN_KINDS:
        raise FileError(f"'{name}' of '{item.name}' of '{item.file.filename}' is not a plain number: write it again")
    return item.attrs[name]


class DriverFile:
    """An existing file, with the methods that `h5py.File` calls.

    The file driver of HDF5 caches its output and can crash the process on a full disk. Here each write calls the operating
    system directly. Since an exception cannot interrupt HDF5, the first error is stored and nothing is written after it. The
    method `check` raises the error after HDF5 has returned.

    Attributes
    ----------
    failure : BaseException or None
        The first error while HDF5 was reading or writing.
    """

    def __init__(self, path: Path) -> None:
        self._file = open(path, "r+b", buffering=0)  # noqa: SIM115
        self._position = 0
        self.failure: BaseException | None = None

    def check(self) -> None:
        """Raise the first error, if there was one."""
        if self.failure is not None:
            raise self.failure

    def _fail(self, error: BaseException) -> None:
        """Store the first error, without its traceback, whose frames would keep HDF5 objects open."""
        error = error.with_traceback(None)  # a later error may be the same object, and its traceback is removed, too
        self.failure = self.failure or error

    def fileno(self) -> int:
        """Return the descriptor of the file."""
        return self._file.fileno()

    def tell(self) -> int:
        """Return the current position in the file [byte]."""
        return self._position

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Set the position relative to the start, the current position or the end, and return it."""
        base = self._size() if whence == os.SEEK_END else {os.SEEK_SET: 0, os.SEEK_CUR: self._position}[whence]
        self._position = base + offset
        return self._position

    def _size(self) -> int:
        return os.fstat(self.fileno()).st_size

    def read(self, size: int) -> bytes:
        """Return `size` bytes from the current position on, with zeros beyond the end of the file."""
        data = bytearray(size)
        try:
            self._get(self._position, data)
        except BaseException as error:
            self._fail(error)
        self._position += size
        return bytes(data)

    def _get(self, offset: int, data: bytearray) -> None:
        """Fill `data` with bytes of the file from `offset` on; bytes beyond the end of the file are not changed."""
        self._file.seek(offset)
        view = memoryview(data)
        while view and (count := self._file.readinto(view)):
            view = view[count:]

    def write(self, data: bytes) -> int:
        """Write at the current position, unless an earlier operation has failed."""
        try:
            if self.failure is None:
                self._put(self._position, data)
        except BaseException as error:
            self._fail(error)
        self._position += len(data)
        return len(data)

    def _put(self, offset: int, data: bytes) -> None:
        """Write `data` to the file from `offset` on."""
        self._file.seek(offset)
        view = memoryview(data)
        while view:
            view = view[self._file.write(view) :]

    def truncate(self, size: int) -> int:
        """Set the size of the file, unless an earlier operation has failed."""
        try:
            if self.failure is None:
                self._file.truncate(size)
        except BaseException as error:
            self._fail(error)
        return size

    def flush(self) -> None:
        """Do nothing: all writes have gone to the operating system."""

    def close(self) -> None:
        """Close the file; further calls have no effect."""
        self._file.close()


@contextmanager
def new_hdf5(path: Path) -> Iterator[Any]:
    """Open a new HDF5 file for writing in place of the existing file at `path`; OSError if writing fails."""
    import h5py

    driver = DriverFile(path)
    driver.truncate(0)  # HDF5 would interpret the old content
    try:
        with h5py.File(driver, "w") as file:
            yield file
    except Exception:
        driver.check()  # the error of the operating system explains that of HDF5
        raise
    finally:
        driver.close()
    driver.check()
