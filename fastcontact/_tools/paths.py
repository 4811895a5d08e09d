"""Paths of files: one that must exist, one that may be written, one that is replaced whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from fastcontact.errors import FileError

PathLike = str | os.PathLike[str]
# Names of the open files of this process.
_DESCRIPTOR = re.compile(r"/(?:dev|proc/(?:self|thread-self|\d+))/fd/(\d+)")


def existing_file(path: PathLike) -> Path:
    """Return `path` as a Path, or raise FileError if there is no such file or it is no plain one."""
    file = Path(path)
    try:
        file.stat()
    except FileNotFoundError:
        pass
    except (OSError, ValueError) as error:  # a name too long, a folder that is none, a zero in it
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(
            f"'{str(path)[:200]}' cannot be looked for ({reason}): check its name and the folder"
        ) from error
    if file.is_dir():
        raise FileError(f"'{path}' is a folder: name a file in it")
    if not file.exists():
        raise FileError(f"there is no file '{path}': check its name and the folder you are in")
    if not file.is_file():
        raise FileError(f"'{path}' is a device or a pipe: name a plain file")
    return file


def checked_target(path: PathLike) -> Path:
    """Return the real path to write to, that of the file which a link names, or raise FileError if it cannot be written."""
    try:
        target = Path(os.path.realpath(os.fspath(path)))
    except ValueError as error:  # a zero in it
        raise FileError(f"{os.fspath(path)!r} cannot be the name of a file ({error}): name another one") from error
    if descriptor(path) is not None:
        raise FileError(f"'{path}' is a stream: name a plain file")
    try:
        if target.is_dir():
            raise FileError(f"'{target}' is a folder: name a file in it")
        if not target.parent.is_dir():
            raise FileError(f"folder '{target.parent}' does not exist: create it or name another file")
        if target.exists() and not target.is_file():
            raise FileError(f"'{target}' is a device or a pipe: name a plain file")
        if target.exists() and not _may_write(target):
            raise FileError(f"'{target}' is write-protected: remove the protection or name another file")
    except OSError as error:
        raise FileError(f"'{target}' cannot be written ({error.strerror}): name another file") from error
    if not _may_write(target.parent):
        raise FileError(f"folder '{target.parent}' is write-protected: name a file in another folder")
    return target


def descriptor(path: PathLike) -> int | None:
    """Return the number of the open file of this process that a path such as ``/dev/stdout`` names, None of other paths.

    The path of the file behind it says too little: a shell may have opened that file to append to it.
    """
    name = os.path.abspath(os.fspath(path))
    for _ in range(40):  # links, as many as the system follows
        match = _DESCRIPTOR.fullmatch(name)
        if match:
            return int(match[1])
        if not os.path.islink(name):
            break
        name = os.path.normpath(os.path.join(os.path.dirname(name), os.readlink(name)))
    return None


def is_stream(path: PathLike) -> bool:
    """Return whether a path names what is written to from beginning to end: an open file, a device, a pipe."""
    return descriptor(path) is not None or Path(path).is_char_device() or Path(path).is_fifo()


def _may_write(path: Path) -> bool:
    return os.access(path, os.W_OK, effective_ids=os.access in os.supports_effective_ids)


@contextlib.contextmanager
def replacing(path: PathLike) -> Iterator[Path]:
    """Give an empty file beside `path` to write to, which takes its place on success and is removed after a failure.

    Its name cannot be guessed and it is a new file, so that no link put there beforehand is followed. When it takes its
    place it is on the disk. A stream such as ``/dev/stdout`` gets what was written behind all that it holds. What the
    operating system refuses becomes a FileError.
    """
    if is_stream(path):
        with tempfile.TemporaryDirectory() as folder:
            temporary = Path(folder, Path(path).name)
            yield temporary
            _send(temporary, path)
        return
    target = checked_target(path)
    # The suffix stays last, because writers choose the format by it.
    temporary = target.with_name(f".{target.stem[:100]}.{secrets.token_hex(12)}{target.suffix}")
    try:
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        yield temporary
        _synchronise(temporary)
        os.replace(temporary, target)
        _synchronise(target.parent)
    except OSError as error:
        raise FileError(
            f"'{path}' cannot be written ({error.strerror or error}): see whether the disk is full or the folder protected"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def _send(file: Path, stream: PathLike) -> None:
    """Write a file to a stream; through the open file that it names, if it does: it knows where its end is."""
    number = descriptor(stream)
    try:
        if number in (1, 2):
            (sys.stdout if number == 1 else sys.stderr).flush()
        with open(file, "rb") as source, open(stream if number is None else os.dup(number), "wb") as target:
            shutil.copyfileobj(source, target)
    except BrokenPipeError:
        raise
    except OSError as error:
        raise FileError(f"'{stream}' cannot be written ({error.strerror or error}): name another file") from error


def _synchronise(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk; nothing is done where folders cannot be opened."""
    if path.is_dir() and os.name == "nt":
        return
    descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # of file systems without it
            raise
    finally:
        os.close(descriptor)
