"""Files that a case reads: meshes, fields, obstacle surfaces, and the files that these include."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fastcontact.mesh.files.meshio_files import files_of


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
