"""Write-ahead journal: writes with a checksum at the end of the file, replayed after a power loss.

A disk may do what was written since the last synchronisation in any order, in part, or not at all. New data hurt nobody,
since nothing leads to them yet; records of HDF5 that are changed in place do. So these are first written behind the contents
of the file, where no reader of HDF5 looks, with a checksum of the new data. Once both are on the disk the changes are made,
and whoever opens the file after a power loss makes them again (write-ahead logging: Mohan et al., 1992).
"""

from __future__ import annotations

import hashlib
import io
import struct
from collections.abc import Iterable, Sequence
from typing import IO, Any

Write = tuple[int, bytes]
MAGIC = b"fastcontact journal\n"
FOOTER = struct.Struct(f"<Q32s{len(MAGIC)}s")  # length and SHA-256 of the writes
HEADER = struct.Struct("<QQ?")  # place and length of one; whether its checksum stands for it
DIGEST = hashlib.sha256().digest_size


def packed(new: Sequence[Write], changes: Sequence[Write]) -> bytes:
    """Return, as the last bytes of a file, the changes of what was there and the checksums of new data that they lead to."""
    body = b"".join(
        [
            *(HEADER.pack(place, len(data), True) + hashlib.sha256(data).digest() for place, data in new),
            *(HEADER.pack(place, len(data), False) + data for place, data in changes),
        ]
    )
    return body + FOOTER.pack(len(body), hashlib.sha256(body).digest(), MAGIC)


def found(file: IO[bytes]) -> list[Write]:
    """Return the changes that the end of a file holds; none where there are none, or not all of them and their data."""
    size = file.seek(0, io.SEEK_END)
    if size < FOOTER.size:
        return []
    file.seek(size - FOOTER.size)
    length, digest, magic = FOOTER.unpack(file.read(FOOTER.size))
    if magic != MAGIC or length > size - FOOTER.size:
        return []
    file.seek(size - FOOTER.size - length)
    body = file.read(length)
    if hashlib.sha256(body).digest() != digest:
        return []
    changes, position = [], 0
    while position < length:
        place, count, is_new = HEADER.unpack_from(body, position)
        position += HEADER.size
        if is_new:
            file.seek(place)
            if hashlib.sha256(file.read(count)).digest() != body[position : position + DIGEST]:
                return []
        else:
            changes.append((place, body[position : position + count]))
        position += DIGEST if is_new else count
    return changes


class Repeated(io.RawIOBase):
    """A file as it is when the writes of its journal are done; the file itself is only read."""

    def __init__(self, file: IO[bytes], writes: Sequence[Write]) -> None:
        self._file, self._writes = file, writes

    def readable(self) -> bool:
        """Return True."""
        return True

    def seekable(self) -> bool:
        """Return True."""
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Set the position."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """Return the position."""
        return self._file.tell()

    def readinto(self, buffer: Any) -> int:
        """Fill a buffer from the position on; return how many bytes there were."""
        start, view = self._file.tell(), memoryview(buffer).cast("B")
        data = self._file.read(len(view))
        view[: len(data)] = data
        overlay(self._writes, start, view[: len(data)])
        return len(data)

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        self._file.close()
        super().close()


def overlay(writes: Iterable[Write], start: int, view: memoryview | bytearray) -> None:
    """Put into `view`, which holds a file from `start` on, what writes change there."""
    end = start + len(view)
    for place, data in writes:
        first, last = max(place, start), min(place + len(data), end)
        if first < last:
            view[first - start : last - start] = data[first - place : last - place]
