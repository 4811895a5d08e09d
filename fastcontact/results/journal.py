"""Write-ahead journal at the end of a file, whose changes are applied again after a power loss (Mohan et al., 1992).

After a power loss, any of the writes since the last synchronisation of the disk may be missing or incomplete. Incomplete new
data are harmless, since no other data refer to them yet, but incomplete changes in place damage the file. These changes are
therefore first written to a journal, together with checksums of the new data. The journal lies beyond the end of the HDF5
contents, where HDF5 ignores it. The changes are applied when the journal and the new data are on the disk, and are applied
again when the file is opened after a power loss.
"""

from __future__ import annotations

import hashlib
import io
import struct
from collections.abc import Iterable, Iterator, Sequence
from typing import IO

from fastcontact.errors import FileError

Write = tuple[int, bytes]
MAGIC = b"fastcontact journal\n"
FOOTER = struct.Struct(f"<Q32s{len(MAGIC)}s")  # length and SHA-256 of the writes
# Offset and length of a write, and whether its data are new. For new data, only the checksum follows.
HEADER = struct.Struct("<QQ?")
DIGEST = hashlib.sha256().digest_size
# Size of the pieces in which data are read for a checksum [bytes].
PIECE = 1 << 20


def pack(new: Sequence[Write], changes: Sequence[Write]) -> bytes:
    """Return a journal, which is appended to the file, with the changes and the checksums of the new data."""
    checksums = [HEADER.pack(offset, len(data), True) + hashlib.sha256(data).digest() for offset, data in new]
    body = b"".join([*checksums, *(HEADER.pack(offset, len(data), False) + data for offset, data in changes)])
    return body + FOOTER.pack(len(body), hashlib.sha256(body).digest(), MAGIC)


def pending(file: IO[bytes]) -> list[Write]:
    """Return the changes in the journal of a file, which may not have been applied completely.

    The list is empty if there is no journal, or if the journal or the new data are incomplete. Raises FileError for a journal
    with a valid checksum but invalid lengths or offsets; these are checked before the new data are read. A journal is not
    read into memory before its checksum is verified, since a forged footer may declare any length.
    """
    size = file.seek(0, io.SEEK_END)
    if size < FOOTER.size:
        return []
    file.seek(size - FOOTER.size)
    length, digest, magic = FOOTER.unpack(file.read(FOOTER.size))
    if magic != MAGIC or length > size - FOOTER.size:
        return []
    end = size - FOOTER.size - length  # end of the contents before the journal
    if length > PIECE + 2 * end:  # changes replace parts of the contents, and their headers and the checksums are short
        raise _damage_error(file, f"declares {length:.3g} bytes")
    if _digest(file, end, length) != digest:
        return []
    file.seek(end)
    records = list(_records(file, file.read(length)))
    new = [(offset, count, checksum) for offset, count, is_new, checksum in records if is_new]
    if sum(count for _, count, _ in new) > end:
        raise _damage_error(file, "counts data twice")
    if any(count and offset + count > end for offset, count, _, _ in records):
        raise _damage_error(file, "refers to data beyond the contents")
    if any(_digest(file, offset, count) != checksum for offset, count, checksum in new):
        return []
    return [(offset, data) for offset, _, is_new, data in records if not is_new]


def _records(file: IO[bytes], body: bytes) -> Iterator[tuple[int, int, bool, bytes]]:
    """Yield the offset, the length, whether the data are new, and the data or their checksum for each write in a journal."""
    position = 0
    while position < len(body):
        begin = position + HEADER.size
        if begin > len(body):
            raise _damage_error(file, "is cut off")
        offset, count, is_new = HEADER.unpack_from(body, position)
        position = begin + (DIGEST if is_new else count)
        if position > len(body):
            raise _damage_error(file, "is cut off")
        yield offset, count, is_new, body[begin:position]


def _digest(file: IO[bytes], offset: int, count: int) -> bytes:
    """Return the SHA-256 hash of `count` bytes of a file from `offset`, which are read in pieces."""
    digest = hashlib.sha256()
    file.seek(offset)
    while count > 0 and (piece := file.read(min(count, PIECE))):
        digest.update(piece)
        count -= len(piece)
    return digest.digest()


def _damage_error(file: IO[bytes], reason: str) -> FileError:
    """Return the error for an invalid journal."""
    name = getattr(file, "name", "the file")
    return FileError(f"the journal at the end of '{name}' {reason}: it is damaged; compute the file again")


class JournalView:
    """A read-only view of a file with the writes of its journal applied."""

    def __init__(self, file: IO[bytes], writes: Sequence[Write]) -> None:
        self._file, self._writes = file, writes
        self.seek, self.tell, self.close = file.seek, file.tell, file.close

    def read(self, size: int) -> bytes:
        """Return up to `size` bytes from the current position."""
        start, data = self._file.tell(), bytearray(self._file.read(size))
        apply_writes(self._writes, start, data)
        return bytes(data)


def apply_writes(writes: Iterable[Write], start: int, view: memoryview | bytearray) -> None:
    """Apply writes to `view`, which contains a part of a file that begins at `start`."""
    end = start + len(view)
    for offset, data in writes:
        first, last = max(offset, start), min(offset + len(data), end)
        if first < last:
            view[first - start : last - start] = data[first - offset : last - offset]
