"""Files that HDF5 writes through Python, so that a full or failing disk raises a Python error.

HDF5's own driver maps and caches its output and can crash the process on a full disk. Here each write is an ordinary one.
HDF5 cannot be interrupted by an exception: the first error is stored, nothing is written after it, and it is raised once
HDF5 has returned.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


class DriverFile:
    """An existing file, with the methods that `h5py.File` calls.

    Attributes
    ----------
    failure : BaseException or None
        The first error while HDF5 read or wrote.
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
        """Store the first error, without its frames, which would keep HDF5 objects open."""
        error = error.with_traceback(None)  # also for later errors, which may be the same object
        self.failure = self.failure or error

    def fileno(self) -> int:
        """Return the descriptor of the file."""
        return self._file.fileno()

    def tell(self) -> int:
        """Return the position."""
        return self._position

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Set the position from the start, from itself or from the end."""
        base = self._size() if whence == os.SEEK_END else {os.SEEK_SET: 0, os.SEEK_CUR: self._position}[whence]
        self._position = base + offset
        return self._position

    def _size(self) -> int:
        return os.fstat(self.fileno()).st_size

    def read(self, size: int) -> bytes:
        """Return `size` bytes from the position on, zeros beyond the end of the file."""
        data = bytearray(size)
        try:
            self._get(self._position, data)
        except BaseException as error:
            self._fail(error)
        self._position += size
        return bytes(data)

    def _get(self, start: int, data: bytearray) -> None:
        self._file.seek(start)
        view = memoryview(data)
        while view and (count := self._file.readinto(view)):
            view = view[count:]

    def write(self, data: bytes) -> int:
        """Write at the position, unless something has failed."""
        try:
            if self.failure is None:
                self._put(self._position, data)
        except BaseException as error:
            self._fail(error)
        self._position += len(data)
        return len(data)

    def _put(self, offset: int, data: bytes) -> None:
        self._file.seek(offset)
        view = memoryview(data)
        while view:
            view = view[self._file.write(view) :]

    def truncate(self, size: int) -> int:
        """Set the size of the file, unless something has failed."""
        try:
            if self.failure is None:
                self._file.truncate(size)
        except BaseException as error:
            self._fail(error)
        return size

    def flush(self) -> None:
        """Do nothing: all writes have gone to the operating system."""

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        self._file.close()


@contextmanager
def new_hdf5(path: Path) -> Iterator[Any]:
    """Write an HDF5 file over the existing file at `path`; OSError if the operating system reports an error."""
    import h5py

    driver = DriverFile(path)
    driver.truncate(0)  # HDF5 would parse the old content
    try:
        with h5py.File(driver, "w") as file:
            yield file
    except Exception:
        driver.check()  # the error of the system is more informative than that of HDF5
        raise
    finally:
        driver.close()
    driver.check()
