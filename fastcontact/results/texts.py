"""Strings of variable length in a result file, read without HDF5, which does not terminate for some damaged files.

Such a string is stored in a global heap collection, which consists of a header of 16 bytes with the size of the collection
and a sequence of objects. Each object has a header of 16 bytes with its number and its size (HDF5 File Format Specification
3.0, section III.E).
"""

from __future__ import annotations

import os
import struct
from typing import Any

SIGNATURE = b"GCOL\x01\0\0\0"  # with version and reserved bytes
HEAD = struct.Struct("<8sQ")  # header of a collection: signature, size
OBJECT = struct.Struct("<H6xQ")  # header of an object: number, size; free space at the end has the number 0
REFERENCE = struct.Struct("<IQI")  # entry of a data set: length of the string, address of the collection, object number


def read_text(dataset: Any, raw: Any) -> str:
    """Return the string in a data set that contains a single string; `raw` is the open file, with addresses of eight bytes.

    Raises ValueError if the data set is of another kind or damaged.
    """
    import h5py

    kind, start = h5py.check_string_dtype(dataset.dtype), dataset.id.get_offset()
    if dataset.shape != () or start is None or kind is None or kind.length is not None:
        raise ValueError(f"'{dataset.name}' is not a string")
    file_size = raw.seek(0, os.SEEK_END)
    length, offset, wanted = _unpacked(REFERENCE, raw, start, file_size)
    signature, size = _unpacked(HEAD, raw, offset, file_size)
    at, end = offset + HEAD.size, min(offset + size, file_size)
    while signature == SIGNATURE and at + OBJECT.size <= end:
        number, size = _unpacked(OBJECT, raw, at, end)
        at += OBJECT.size
        if number == wanted and length <= size and at + length <= end:
            return raw.read(length).decode("utf-8")
        if number in (0, wanted):
            break
        at += -(-size // 8) * 8
    raise ValueError(f"its texts are damaged at byte {at}")


def _unpacked(kind: struct.Struct, raw: Any, offset: int, end: int) -> tuple[Any, ...]:
    if offset + kind.size > end:
        raise ValueError(f"its texts are damaged: they are at byte {offset} of {end}")
    raw.seek(offset)
    return kind.unpack(raw.read(kind.size))
