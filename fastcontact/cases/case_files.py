"""Files of cases: ready-made cases by name, and the meshes and fields that a case reads."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fastcontact.errors import CaseError, check_known
from fastcontact.mesh.files.meshio_files import files_of

_PACKAGE = Path(__file__).resolve().parents[1]
# Folders of the case files in an installed package and in a checkout.
_FOLDERS = (_PACKAGE / "data" / "cases", _PACKAGE.parent / "data" / "cases")


def shipped_cases() -> dict[str, Path]:
    """Return the case files of the package by name, in alphabetical order."""
    folder = next((folder for folder in _FOLDERS if folder.is_dir()), None)
    return {} if folder is None else {path.stem: path for path in sorted(folder.glob("*.toml"))}


def shipped_case(name: str) -> Path:
    """Return the path of a ready-made case; CaseError with the nearest names if there is none."""
    cases = shipped_cases()
    check_known("ready-made case", name, cases, CaseError)
    return cases[name]


def case_path(given: str | Path) -> Path:
    """Return a path or, for the name of a ready-made case, the path of its file.

    A file with the name takes precedence, and "-" is the standard input. Raises CaseError if `given` is neither a path nor
    the name of a ready-made case.
    """
    path = Path(given)
    try:
        if path.exists() or path.suffix or path.name != str(given):
            return path
        if path.name == "-":  # the usual notation for the standard input
            return Path("/dev/stdin")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise CaseError(f"cannot look for the case file '{str(given)[:200]}' ({reason}): check its name") from None
    try:
        return shipped_case(path.name)
    except CaseError as error:
        raise CaseError(f"cannot read the case file '{given}': it does not exist, and {error}") from None


def files_named(data: dict[str, Any], folder: Path) -> Iterator[Path]:
    """Yield the files named in the parsed data of a case file, relative to `folder`, and the files that they include."""
    for key, value in data.items():
        entries = value if isinstance(value, list) else [value]
        for entry in entries:
            if isinstance(entry, dict):
                yield from files_named(entry, folder)
            elif key == "file" and isinstance(entry, str):
                path = folder / entry
                yield from files_of(path) if path.is_file() else [path]


def digest(paths: Iterator[Path]) -> str:
    """Return the SHA-256 hash of the contents of files; files that cannot be read are hashed as missing."""
    hash_of_all = hashlib.sha256()
    for path in paths:
        try:
            with open(path, "rb") as file:
                hash_of_all.update(hashlib.file_digest(file, "sha256").digest())
        except OSError:
            hash_of_all.update(b"missing")
    return hash_of_all.hexdigest()
