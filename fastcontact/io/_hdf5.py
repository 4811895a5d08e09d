"""HDF5 files from elsewhere, opened with care: nothing outside the file is read, and damage is named."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.errors import FileError
from fastcontact.io._files import existing_file
from fastcontact.io._targets import PathLike


@contextmanager
def opened(path: PathLike) -> Iterator[Any]:
    """Open an HDF5 file for reading, for the length of a block.

    Raises
    ------
    FileError
        If the file is missing, is not HDF5, links to other files, or turns out damaged inside the block.
    """
    import h5py

    found = existing_file(path)
    try:
        if not h5py.is_hdf5(found):
            raise FileError(f"'{path}' is not an HDF5 file: check that it is complete and has the right suffix")
        with h5py.File(found, "r") as file:
            _refuse_links_outside(file, path)
            yield file
    except (OSError, LookupError, ValueError, TypeError, AttributeError, RuntimeError) as error:
        raise FileError(f"cannot read '{path}', it is damaged or incomplete ({error}): write it anew") from error


def _refuse_links_outside(file: Any, path: PathLike) -> None:
    """Refuse every link that is neither hard nor soft: only those two stay inside the file."""
    from h5py import h5l

    outside: list[str] = []

    def look(name: bytes, info: Any) -> None:
        if info.type not in (h5l.TYPE_HARD, h5l.TYPE_SOFT):
            outside.append(name.decode("utf-8", "replace"))

    file.id.links.visit(look, info=True)
    if outside:
        raise FileError(
            f"'{path}' refers to another file at '{outside[0]}' ({len(outside)} such links): "
            "copy the data into one file"
        )


def values(group: Any, name: str) -> NDArray[Any]:
    """Return a dataset of `group` as an array.

    Raises
    ------
    FileError
        If it is missing, or if its values are stored in another file.
    """
    where = f"'{group.name}/{name}' of '{group.file.filename}'"
    if name not in group:
        raise FileError(f"{where} is missing: the file is incomplete, write it anew")
    dataset = group[name]
    if dataset.is_virtual or dataset.external:
        raise FileError(f"{where} stores its values in another file: copy the data into one file")
    return np.asarray(dataset[()])
