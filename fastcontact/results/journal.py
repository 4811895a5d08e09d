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

from fastcontact.errors import FileError

Write = tuple[int, bytes]
MAGIC = b"fastcontact journal\n"
FOOTER = struct.Struct(f"<Q32s{len(MAGIC)}s")  # length and SHA-256 of the writes
HEADER = struct.Struct("<QQ?")  # place and length of one; whether its checksum stands for it
DIGEST = hashlib.sha256().digest_size
# Bytes of a journal, which holds what changes in place: restart data, at most some hundred bytes an unknown.
LARGEST = 1 << 31
PIECE = 1 << 20


def packed(new: Sequence[Write], changes: Sequence[Write]) -> bytes:
    """Return, as the last bytes of a file, the changes of what was there and the checksums of new data that they lead to."""
    body = b"".join(
        [
            *(HEADER.pack(offset, len(data), True) + hashlib.sha256(data).digest() for offset, data in new),
            *(HEADER.pack(offset, len(data), False) + data for offset, data in changes),
        ]
    )
    return body + FOOTER.pack(len(body), hashlib.sha256(body).digest(), MAGIC)


def found(file: IO[bytes]) -> list[Write]:
    """Return the changes that the end of a file holds; none where there are none, or not all of them and their data.

    Raises FileError for a journal that no writer makes: nothing is read of it before its bounds are checked.
    """
    size = file.seek(0, io.SEEK_END)
    if size < FOOTER.size:
        return []
    file.seek(size - FOOTER.size)
    length, digest, magic = FOOTER.unpack(file.read(FOOTER.size))
    if magic != MAGIC or length > size - FOOTER.size:
        return []
    end = size - FOOTER.size - length  # of what was there before
    if length > LARGEST:
        raise _forged(file, f"declares {length:.3g} bytes")
    if _digest(file, end, length) != digest:
        return []
    records = _records(file, end, end + length)
    if sum(count for _, count, is_new, _ in records if is_new) > end:
        raise _forged(file, "counts data twice")
    changes = []
    for offset, count, is_new, data in records:
        if count and offset + count > end:
            raise _forged(file, "leads beyond the contents")
        file.seek(data)
        kept = file.read(DIGEST if is_new else count)
        if not is_new:
            changes.append((offset, kept))
        elif _digest(file, offset, count) != kept:
            return []
    return changes


def _records(file: IO[bytes], offset: int, end: int) -> list[tuple[int, int, bool, int]]:
    """Return place, length and kind of each write of a journal, and where its data or checksum stand."""
    records = []
    while offset < end:
        file.seek(offset)
        head = file.read(min(HEADER.size, end - offset))
        if len(head) < HEADER.size:
            raise _forged(file, "is cut off")
        at, count, is_new = HEADER.unpack(head)
        offset += HEADER.size
        records.append((at, count, is_new, offset))
        offset += DIGEST if is_new else count
    if offset > end:
        raise _forged(file, "is cut off")
    return records


def _digest(file: IO[bytes], offset: int, count: int) -> bytes:
    """Return the SHA-256 of a part of a file, read piece by piece."""
    hashed = hashlib.sha256()
    file.seek(offset)
    while count > 0 and (piece := file.read(min(count, PIECE))):
        hashed.update(piece)
        count -= len(piece)
    return hashed.digest()


def _forged(file: IO[bytes], reason: str) -> FileError:
    name = getattr(file, "name", "the file")
    return FileError(f"the journal at the end of '{name}' {reason}: no writer leaves that, compute the file again")


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
    for offset, data in writes:
        first, last = max(offset, start), min(offset + len(data), end)
        if first < last:
            view[first - start : last - start] = data[first - offset : last - offset]
