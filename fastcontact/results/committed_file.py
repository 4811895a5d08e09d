"""HDF5 file that is valid after each write.

HDF5 writes the records of its indices in no particular order. If a process is killed between two writes, an index may refer
to addresses beyond the end of the file, or entries may be lost and with them completed steps. The class `CommittedFile`
therefore buffers writes in memory until HDF5 flushes the file, and then executes them in the following order (HDF5 File
Format Specification 3.0, sections II.A and III.A):

1. new blocks, to which no other block refers yet;
2. the superblock with the end of the file;
3. nodes of B-trees (``TREE``) from the root down, so that entries are in their new node before they are removed from the old
one;
4. all other writes;
5. symbol table nodes (``SNOD``), which contain the names of entries;
6. the object header with the number of steps, which completes a step.

HDF5 writes entire B-tree nodes and symbol table nodes, although a step changes only a few of their bytes. The class writes
only the range from the first to the last changed byte.

The order protects the file if the process is killed, but not in the event of a power loss, since disks reorder writes.
If the file is `synchronised`, changes in place are therefore first written to a journal.
"""

from __future__ import annotations

import bisect
import contextlib
import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

import numpy as np

from fastcontact._tools.hdf5 import DriverFile
from fastcontact.results import journal

# Signatures of the superblock, of B-tree nodes and of symbol table nodes in HDF5.
SUPERBLOCK, NODE, NAMES = b"\x89HDF\r\n\x1a\n", b"TREE", b"SNOD"
N_STEPS = b"NSteps\0"  # name of the attribute with the number of steps
# Longest write that is compared with the file [bytes]. In longer writes, which contain data, all bytes change.
LONGEST_COMPARED = 1 << 16
SIGNALS = tuple(map(int, signal.valid_signals()))


class CommittedFile(DriverFile):
    """An existing HDF5 file whose writes are deferred to `flush`, with the methods that `h5py.File` calls.

    Nothing is written after an error, or after another program has written to the file. After an error, the file therefore
    remains as it was after the last successful write.

    Attributes
    ----------
    synchronised : bool
        Whether flushes are atomic on the disk.
    exclusive : bool
        False after another program has written to the file.
    end : int
        End of the contents [bytes]; the file may be longer.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.synchronised = False
        interrupted = journal.pending(self._file)  # changes of a writer that was killed or stopped by a power loss
        for offset, data in interrupted:
            self._put(offset, data)
        self._pending: dict[int, bytes] = {}
        self.exclusive = True
        self._head = self._read_head()
        self.end = self._end_of_contents()
        if interrupted:
            os.fsync(self.fileno())
            self._set_size(self.end)
        self._starts, self._ends = [0], [self.end]  # disjoint written ranges in ascending order

    def _end_of_contents(self) -> int:
        """Return the end of the contents of the file, which the superblock states [bytes]."""
        head, size = self._head, self._file.seek(0, os.SEEK_END)
        supported = head.startswith(SUPERBLOCK) and (head[8], head[13]) == (0, 8)  # version 0, addresses of eight bytes
        return min(int.from_bytes(head[40:48], "little"), size) if supported else size

    def _read_head(self) -> bytes:
        """Return the first 48 bytes of the file, which contain the end of its contents."""
        self._file.seek(0)
        return self._file.read(48)

    def is_intact(self) -> bool:
        """Return whether no other program has truncated the file, or changed the superblock as each flush does."""
        is_truncated = os.fstat(self.fileno()).st_size < self._ends[-1]
        self.exclusive = self.exclusive and not is_truncated and self._read_head() == self._head
        return self.exclusive

    @property
    def writable(self) -> bool:
        """Whether no error has occurred and no other program has written to the file."""
        return self.exclusive and self.failure is None

    def _size(self) -> int:
        pending_end = max((offset + len(data) for offset, data in self._pending.items()), default=0)
        return max(super()._size(), pending_end)

    def _get(self, start: int, data: bytearray) -> None:
        super()._get(start, data)
        journal.apply_writes(self._pending.items(), start, data)

    def write(self, data: bytes) -> int:
        """Buffer data for the current position, where they replace other pending data."""
        data, start = bytes(data), self._position
        end = start + len(data)
        for offset in [p for p, old in self._pending.items() if p < end and start < p + len(old)]:
            old = self._pending.pop(offset)
            if offset < start:
                self._pending[offset] = old[: start - offset]
            if end < offset + len(old):
                self._pending[end] = old[end - offset :]
        self._pending[start] = data
        self._position = end
        return len(data)

    def truncate(self, size: int) -> int:
        """Set the end of the contents; the file itself is truncated when it is closed."""
        self.end = size
        return size

    def flush(self) -> None:
        """Write all pending data, in an order in which the file is valid after each write."""
        try:
            if self.writable:
                self._commit()
        except BaseException as error:
            self._fail(error)
            with contextlib.suppress(OSError):
                self._head = self._read_head()  # the superblock may have been written

    def _commit(self) -> None:
        pending = sorted(self._pending.items(), key=lambda write: self._order(*write))
        n_new = sum(not self._overlaps(offset, offset + len(data)) for offset, data in pending)
        new = pending[:n_new]
        changes = [change for write in pending[n_new:] if (change := self._changed_part(*write))[1]]
        for offset, data in new:
            self._put(offset, data)
        if self.synchronised:
            self._synchronise(new, changes)
        for offset, data in changes:
            self._put(offset, data)
        if self.synchronised:
            os.fsync(self.fileno())
        self._head = self._read_head()
        for offset, data in pending:
            self._record(offset, offset + len(data))
        self._pending.clear()

    def _changed_part(self, offset: int, data: bytes) -> journal.Write:
        """Return the part of a write from the first to the last byte that differs from the file."""
        if len(data) > LONGEST_COMPARED:
            return offset, data
        stored = bytearray(len(data))
        super()._get(offset, stored)
        differs = np.flatnonzero(np.frombuffer(data, np.uint8) != np.frombuffer(stored, np.uint8))
        if not len(differs):
            return offset, b""
        return offset + int(differs[0]), data[differs[0] : differs[-1] + 1]

    def _synchronise(self, new: list[journal.Write], changes: list[journal.Write]) -> None:
        """Wait until the new blocks and a journal of the changes to old blocks are on the disk."""
        end = max([self.end, self._ends[-1], *(offset + len(data) for offset, data in new)])
        log = journal.pack(new, changes)
        self._put(end, log)
        self._set_size(end + len(log))
        os.fsync(self.fileno())

    def _set_size(self, size: int) -> None:
        self._file.truncate(size)

    def _order(self, offset: int, data: bytes) -> tuple[int, int, int]:
        """Return the key that sorts writes in the order of the list in the docstring of the module."""
        if not self._overlaps(offset, offset + len(data)):
            return 0, 0, offset
        if offset == 0:
            return 1, 0, 0
        if data.startswith(NODE):
            return 2, -data[5], offset
        if N_STEPS in data:
            return 5, 0, offset
        return (4 if data.startswith(NAMES) else 3), 0, offset

    def _overlaps(self, start: int, end: int) -> bool:
        """Return whether a range overlaps a written range."""
        number = bisect.bisect_left(self._ends, start + 1)
        return number < len(self._starts) and self._starts[number] < end

    def _record(self, start: int, end: int) -> None:
        """Record a written range."""
        first, last = bisect.bisect_left(self._ends, start), bisect.bisect_right(self._starts, end)
        if first < last:
            start, end = min(start, self._starts[first]), max(end, self._ends[last - 1])
        self._starts[first:last], self._ends[first:last] = [start], [end]

    def close(self) -> None:
        """Truncate the file to its contents and wait until it is on the disk; further calls have no effect."""
        if self._file.closed:
            return
        try:
            if self.failure is not None:  # the end that HDF5 has set may lie beyond the file
                self._head = self._read_head()
                self.end = self._end_of_contents()
            if self.exclusive:
                self._set_size(self.end)
                os.fsync(self.fileno())
        finally:
            self._file.close()


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """Defer signals, such as Ctrl-C, to the end of the block, since an exception in a callback may crash HDF5.

    Python handles signals in its main thread only; in other threads this function has no effect.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    deferred_signals: list[tuple[int, FrameType | None]] = []
    handlers = {number: signal.getsignal(number) for number in SIGNALS}
    try:
        with contextlib.ExitStack() as restored:  # restores all handlers even after an error
            for number, handler in handlers.items():
                if callable(handler):
                    restored.callback(signal.signal, number, handler)
                    signal.signal(number, lambda *signal_and_frame: deferred_signals.append(signal_and_frame))
            yield
    finally:
        for number, frame in deferred_signals:
            handler = handlers[number]
            assert callable(handler)
            handler(number, frame)
