"""Serialisation of plain data with arrays. Reading executes no code and detects damage.

The format is a line of ASCII JSON with sizes and a checksum, followed by the data as JSON, with offsets in place of arrays,
and by the arrays.
"""

from __future__ import annotations

import io
import json
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Key of the offset, the type and the shape of an array.
_ARRAY = "__array__"
# Allowed kinds of arrays: Boolean, signed and unsigned integers, floating-point numbers.
_KINDS = "biuf"


def pack(data: Any) -> NDArray[np.uint8]:
    """Return data as bytes (n,).

    The data consist of dictionaries with string keys, lists, strings, numbers, None and arrays of numbers.
    """
    arrays = io.BytesIO()
    text = json.dumps(_without_arrays(data, arrays)).encode("ascii")
    body = text + arrays.getbuffer()
    head = json.dumps({"text": len(text), "size": len(body), "checksum": zlib.crc32(body)}).encode("ascii")
    return np.frombuffer(head + b"\n" + body, np.uint8)


def unpack(values: NDArray[np.uint8]) -> Any:
    """Return the data from the bytes (n,) that `pack` has returned; further bytes are ignored.

    Raises ValueError, LookupError or TypeError if the bytes are incomplete, or not from `pack`.
    """
    buffer = np.ascontiguousarray(values, np.uint8).data
    line, separator, _ = bytes(buffer[:200]).partition(b"\n")
    if not separator:
        raise ValueError("no packed data")
    head = json.loads(line)
    body = buffer[len(line) + 1 : len(line) + 1 + int(head["size"])]
    if len(body) != head["size"] or zlib.crc32(body) != head["checksum"]:
        raise ValueError("packed data are cut off or changed")
    text = int(head["text"])
    return _with_arrays(json.loads(bytes(body[:text])), body[text:])


def _without_arrays(data: Any, arrays: io.BytesIO) -> Any:
    """Return data with offsets in place of arrays, which are appended to `arrays`."""
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


def _with_arrays(data: Any, arrays: memoryview) -> Any:
    """Return data with arrays in place of their offsets in `arrays`."""
    if isinstance(data, dict):
        if _ARRAY not in data:
            return {key: _with_arrays(value, arrays) for key, value in data.items()}
        offset, dtype_string, shape = data[_ARRAY]
        dtype = np.dtype(dtype_string)
        if dtype.kind not in _KINDS:
            raise ValueError(f"an array of {dtype_string} is not a packed array")
        count = int(np.prod(shape, dtype=np.int64))
        return np.frombuffer(arrays, dtype, count, offset).reshape(shape).copy()
    if isinstance(data, list):
        return [_with_arrays(value, arrays) for value in data]
    return data
