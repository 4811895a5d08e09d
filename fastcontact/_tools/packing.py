"""Serialisation of plain data with arrays: nothing in the bytes is executed, and damage is detected.

The format is a line of ASCII JSON with sizes and checksum, the data as JSON with offsets in place of arrays, then the arrays.
"""

from __future__ import annotations

import io
import json
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.arrays import AnyArray

_ARRAY = "__array__"
# Allowed kinds of arrays: bool, signed and unsigned integers, floats.
_KINDS = "biuf"


def packed(data: Any) -> NDArray[np.uint8]:
    """Return `data` as bytes (n,): dictionaries with string keys, lists, strings, numbers, None and arrays of numbers."""
    arrays = io.BytesIO()
    text = json.dumps(_without_arrays(data, arrays)).encode("ascii")
    body = text + arrays.getbuffer()
    head = json.dumps({"text": len(text), "size": len(body), "checksum": zlib.crc32(body)}).encode("ascii")
    return np.frombuffer(head + b"\n" + body, np.uint8)


def unpacked(values: NDArray[np.uint8]) -> Any:
    """Return the data from the bytes (n,) of `packed`; bytes beyond its end are ignored.

    Raises ValueError if the bytes are incomplete, or not from `packed`.
    """
    raw = np.ascontiguousarray(values, np.uint8).data
    line, separator, _ = bytes(raw[:200]).partition(b"\n")
    if not separator:
        raise ValueError("no packed data")
    head = json.loads(line)
    body = raw[len(line) + 1 : len(line) + 1 + int(head["size"])]
    if len(body) != head["size"] or zlib.crc32(body) != head["checksum"]:
        raise ValueError("packed data are cut off or changed")
    text = int(head["text"])
    return _with_arrays(json.loads(bytes(body[:text])), body[text:])


def _without_arrays(data: Any, arrays: io.BytesIO) -> Any:
    if isinstance(data, np.ndarray):
        offset = arrays.tell()
        arrays.write(np.ascontiguousarray(data).data)
        return {_ARRAY: [offset, data.dtype.str, list(data.shape)]}
    if isinstance(data, np.generic):
        return data.item()
    if isinstance(data, dict):
        return {str(key): _without_arrays(value, arrays) for key, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [_without_arrays(value, arrays) for value in data]
    return data


def _with_arrays(data: Any, raw: memoryview) -> Any:
    if isinstance(data, dict):
        if _ARRAY in data:
            return _array(raw, *data[_ARRAY])
        return {key: _with_arrays(value, raw) for key, value in data.items()}
    if isinstance(data, list):
        return [_with_arrays(value, raw) for value in data]
    return data


def _array(raw: memoryview, offset: int, kind: str, shape: list[int]) -> AnyArray:
    dtype = np.dtype(kind)
    if dtype.kind not in _KINDS:
        raise ValueError(f"an array of {kind} is not a packed array")
    count = int(np.prod(shape, dtype=np.int64))
    return np.frombuffer(raw, dtype, count, offset).reshape(shape).copy()
