"""HDF5's heaps of texts, looked through before HDF5 itself walks along them: on some damaged ones it never ends.

A text of variable length stands in a "global heap collection": a head with its size, then objects one after the other,
each with a number and a size; number 0 is the free room that is left (HDF5 File Format Specification 3.0, III.E).
"""

from __future__ import annotations

import mmap
import struct
from typing import Any, Protocol

from fastcontact.errors import FileError
from fastcontact.mesh.files.targets import PathLike

# Signature and version 1 with its reserved bytes.
HEAD = b"GCOL\x01\0\0\0"
SMALLEST = 4096
# A text as it stands in its data set: length, address of the heap, number of the object.
REFERENCE = struct.Struct("<IQI")


class Bytes(Protocol):
    """A file open for reading, or what can be read like one."""

    def seek(self, position: int, /) -> Any:
        """Go to a position."""
        ...

    def read(self, size: int, /) -> bytes:
        """Return the next bytes."""
        ...


def check_all(path: PathLike, length_size: int) -> None:
    """Look through every heap of a file; `length_size` is how many bytes a length takes in it.

    Raises
    ------
    FileError
        If HDF5 would not find the end of one.
    """
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as raw:
        place = raw.find(HEAD)
        while place >= 0:
            _check(raw, place, length_size, path)
            place = raw.find(HEAD, place + len(HEAD))


def check_texts(raw: Bytes, start: int, count: int, path: PathLike) -> None:
    """Look through the heaps of `count` texts whose references stand at `start` of a file with lengths of 8 bytes.

    Raises
    ------
    FileError
        If HDF5 would not find the end of one.
    """
    raw.seek(start)
    references = raw.read(count * REFERENCE.size)
    whole = len(references) // REFERENCE.size * REFERENCE.size
    for address in {address for _, address, _ in REFERENCE.iter_unpack(references[:whole])}:
        if address < 1 << 62:  # beyond is what HDF5 writes for none; it checks by itself that there is a heap
            _check(raw, address, 8, path)


def _check(raw: Bytes, place: int, length_size: int, path: PathLike) -> None:
    head = (8 + length_size + 7) // 8 * 8
    raw.seek(place)
    found = raw.read(head)
    if len(found) < head or not found.startswith(HEAD):
        return
    end = int.from_bytes(found[8 : 8 + length_size], "little")
    at = head
    while at + head <= end:
        raw.seek(place + at)
        entry = raw.read(head)
        size = int.from_bytes(entry[8 : 8 + length_size], "little")
        taken = head + (size + 7) // 8 * 8 if entry[:2] != b"\0\0" else size
        if len(entry) < head or taken < head or at + taken > end:
            raise FileError(f"'{path}' is damaged where it keeps its texts, at byte {place + at}: write it anew")
        at += taken
