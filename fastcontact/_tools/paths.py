"""Paths of files: checks of input and output paths, and atomic replacement of files."""

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
# Paths that name an open file of this process by its descriptor.
_DESCRIPTOR = re.compile(r"/(?:dev|proc/(?:self|thread-self|\d+))/fd/(\d+)")


def existing_file(path: PathLike) -> Path:
    """Return `path` as a Path, or raise FileError if it is not the path of a regular file."""
    file = Path(path)
    try:
        file.stat()
    except FileNotFoundError:
        pass
    except (OSError, ValueError) as error:  # too long a name, a file as a folder, a null byte
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(f"'{str(path)[:200]}' cannot be accessed ({reason}): check its name and the folder") from error
    if file.is_dir():
        raise FileError(f"'{path}' is a folder: name a file in it")
    if not file.exists():
        raise FileError(f"file '{path}' does not exist: check its name and the current folder")
    if not file.is_file():
        raise FileError(f"'{path}' is a device or a pipe: name a regular file")
    return file


def checked_target(path: PathLike) -> Path:
    """Return a path with links resolved, or raise FileError if no regular file can be written there."""
    try:
        target = Path(os.path.realpath(os.fspath(path)))
    except ValueError as error:  # a null byte
        raise FileError(f"{os.fspath(path)!r} cannot be the name of a file ({error}): choose another name") from error
    if descriptor(path) is not None:
        raise FileError(f"'{path}' is a stream: name a regular file")
    try:
        if target.is_dir():
            raise FileError(f"'{target}' is a folder: name a file in it")
        if not target.parent.is_dir():
            raise FileError(f"folder '{target.parent}' does not exist: create it or name another file")
        if target.exists() and not target.is_file():
            raise FileError(f"'{target}' is a device or a pipe: name a regular file")
        if target.exists() and not _may_write(target):
            raise FileError(f"'{target}' is write-protected: remove the protection or name another file")
    except OSError as error:
        raise FileError(f"'{target}' cannot be written ({error.strerror}): name another file") from error
    if not _may_write(target.parent):
        raise FileError(f"folder '{target.parent}' is write-protected: name a file in another folder")
    return target


def descriptor(path: PathLike) -> int | None:
    """Return the file descriptor to which a path such as ``/dev/stdout`` refers, or None for other paths.

    The path of the redirected file does not suffice, since a shell may have opened the file in append mode.
    """
    name = os.path.abspath(os.fspath(path))
    for _ in range(40):  # limit of the operating system
        match = _DESCRIPTOR.fullmatch(name)
        if match:
            return int(match[1])
        if not os.path.islink(name):
            break
        name = os.path.normpath(os.path.join(os.path.dirname(name), os.readlink(name)))
    return None


def is_stream(path: PathLike) -> bool:
    """Return whether a path names a stream: an open file, a device or a pipe."""
    return descriptor(path) is not None or Path(path).is_char_device() or Path(path).is_fifo()


def _may_write(path: Path) -> bool:
    """Return whether the effective user of this process may write to a file or a folder."""
    return os.access(path, os.W_OK, effective_ids=os.access in os.supports_effective_ids)


@contextlib.contextmanager
def replacing(path: PathLike) -> Iterator[Path]:
    """Yield the path of an empty temporary file beside `path`, which replaces it on success and is removed after a failure.

    The file is new and its name is unpredictable, so that no existing link is followed. It is synchronised to disk before it
    replaces `path`. If `path` is a stream such as ``/dev/stdout``, the file is created in a temporary folder and copied to
    the stream. Errors of the operating system, except for a broken pipe, are raised as FileError.
    """
    if is_stream(path):
        with tempfile.TemporaryDirectory() as folder:
            temporary = Path(folder, Path(path).name)
            yield temporary
            _copy_to_stream(temporary, path)
        return
    target = checked_target(path)
    # The suffix is kept, because writers derive the format from it.
    temporary = target.with_name(f".{target.stem[:100]}.{secrets.token_hex(12)}{target.suffix}")
    try:
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        yield temporary
        _synchronise(temporary)
        os.replace(temporary, target)
        _synchronise(target.parent)
    except OSError as error:
        raise FileError(
            f"'{path}' cannot be written ({error.strerror or error}): check the disk space and the permissions of the folder"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def _copy_to_stream(file: Path, stream: PathLike) -> None:
    """Write a file to a stream; if the stream is a descriptor of this process, its write position is kept."""
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
    """Synchronise a file or the entries of a folder to disk. Folders are ignored on Windows, which cannot open them."""
    if path.is_dir() and os.name == "nt":
        return
    opened = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(opened)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # file systems without synchronisation
            raise
    finally:
        os.close(opened)
