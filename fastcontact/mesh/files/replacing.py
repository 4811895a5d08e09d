"""Files on disk: one that must exist, and one that is replaced whole or not at all."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from fastcontact.errors import FileError
from fastcontact.mesh.files.targets import PathLike, checked_target


def existing_file(path: PathLike) -> Path:
    """Return `path` as a Path.

    Raises
    ------
    FileError
        If there is no such file, or if it is a folder.
    """
    found = Path(path)
    try:
        found.stat()
    except FileNotFoundError:
        pass
    except (OSError, ValueError) as error:  # a name too long, a folder that is none, a zero in it
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(
            f"'{str(path)[:200]}' cannot be looked for ({reason}): check its name and the folder"
        ) from error
    if found.is_dir():
        raise FileError(f"'{path}' is a folder: name a file in it")
    if not found.exists():
        raise FileError(f"there is no file '{path}': check its name and the folder you are in")
    if not found.is_file():
        raise FileError(f"'{path}' is a device or a pipe: name a plain file")
    return found


@contextlib.contextmanager
def replacing(path: PathLike) -> Iterator[Path]:
    """Give a temporary path beside `path`, for a library that opens files itself; move it there on success.

    What stood at `path` is untouched until the new file is complete; after a failure the temporary file is
    gone.

    Raises
    ------
    FileError
        If the folder is missing, `path` is a folder, or the operating system refuses to write.
    """
    target = checked_target(path)
    # The suffix stays last, because writers choose the format by it.
    temporary = target.with_name(f".{target.stem[:100]}.{os.getpid()}-{secrets.token_hex(4)}{target.suffix}")
    try:
        yield temporary
        os.replace(temporary, target)
    except OSError as error:
        raise FileError(f"'{target}' cannot be written: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
