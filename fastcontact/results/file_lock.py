"""Exclusive write access for result files."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import sys
import weakref
from pathlib import Path
from typing import IO, Any

from fastcontact.errors import FileError
from fastcontact.results.committed_file import uninterrupted


def file_state(path: Path) -> tuple[int, ...] | None:
    """Return the device, inode, size and modification time of the file at a path, or None if there is no file."""
    try:
        status = os.stat(path)
    except OSError:
        return None
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


class PathLock:
    """Exclusive lock on a path for writing, held by means of a lock file in the same folder.

    The result file itself is not locked, since viewers may lock it. The operating system releases the lock when the process
    ends. The lock file is removed by `release`, or when the last reference to this object disappears.

    Attributes
    ----------
    release : callable
        Releases the lock; further calls have no effect.

    Raises
    ------
    FileError
        If another writer, in this or another process, holds the lock, or the lock file is not a regular file of the user.
    """

    def __init__(self, target: Path) -> None:
        self.path = target.with_name(f".{target.name}.lock")
        with uninterrupted():
            self._acquire(target)

    def _acquire(self, target: Path) -> None:
        while True:
            file = _open_lock_file(self.path)
            if not _lock(file):
                file.seek(0)
                holder = file.read().decode("ascii", "replace").strip() or "unknown"
                file.close()
                raise FileError(f"'{target}' is being written by process {holder}: wait for it or name another file")
            with contextlib.suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(file.fileno()), os.stat(self.path)):
                    break
            file.close()  # the previous holder removed the file between `open` and `lock`
        with contextlib.suppress(OSError):  # the process number is only information, for which a full disk has no space
            file.truncate(0)
            file.write(str(os.getpid()).encode("ascii"))
        # The finalizer also releases the lock if an interrupt prevents the caller from releasing it.
        self.release = weakref.finalize(self, _release, file, self.path, os.getpid())


def _release(file: IO[Any], path: Path, holder: int) -> None:
    """Remove the lock file and release the lock; a process forked from `holder` does not remove the file."""
    if os.getpid() == holder:
        with contextlib.suppress(OSError):  # Windows does not remove open files, so that a harmless lock file remains
            path.unlink()
    file.close()


def is_being_written(target: Path) -> bool:
    """Return whether a writer holds the lock of a path."""
    try:
        file = open(target.with_name(f".{target.name}.lock"), "r+b", buffering=0)  # noqa: SIM115
    except OSError:
        return False
    with file:
        return not _lock(file)


def _open_lock_file(path: Path) -> IO[Any]:
    """Open or create a lock file. Raises FileError for links and files of other users, which must not be modified."""
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o644)
    except OSError as error:
        if error.errno != errno.ELOOP:
            raise
        raise FileError(f"'{path}' is a link, but a lock file must be a regular file: remove it") from error
    status = os.fstat(descriptor)
    if (
        not stat.S_ISREG(status.st_mode)
        or status.st_nlink > 1
        or (hasattr(os, "getuid") and status.st_uid != os.getuid())
    ):
        os.close(descriptor)
        raise FileError(f"'{path}' is a lock file, which must be a regular file that you own: remove it")
    return os.fdopen(descriptor, "r+b", buffering=0)


def _lock(file: IO[Any]) -> bool:
    """Lock an open file without waiting; return False if it is locked, and True if locks are not supported."""
    if sys.platform == "win32":
        import msvcrt

        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True
