"""An HDF5 file that can be opened after every single write.

HDF5 writes the records of its indices in no particular order. A process that is killed between two writes may leave an index
that points beyond the end of the file or has lost entries, and with them completed steps. Here writes are buffered in memory
until HDF5 flushes, and then executed in an order in which each is harmless: first new blocks, to which nothing refers
yet; the superblock with the end of the file; nodes of indices from the root down, so that entries are in their new node
before they leave the old one; everything else; name tables last (HDF5 File Format Specification 3.0, sections II.A and
III.A).

HDF5 writes whole nodes of indices and parts of tables, of which a step changes a few bytes: only the range from the first to
the last changed byte is written.

This protects against the end of a process, not against a power loss: disks reorder writes. `synchronised` writes are
therefore kept in a journal until they are executed.
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

from fastcontact._tools.hdf5_driver import DriverFile
from fastcontact.results import journal

# Signatures of the superblock, the nodes of indices and the name tables of HDF5.
SUPERBLOCK, NODE, NAMES = b"\x89HDF\r\n\x1a\n", b"TREE", b"SNOD"
# Longest write that is compared with the file [bytes]: longer ones are data of which everything changes.
COMPARED = 1 << 16


class CommittedFile(DriverFile):
    """An existing HDF5 file, with the methods that `h5py.File` calls; writes wait for `flush`.

    After an error nothing is written: the file stays as after the last successful write. Nothing is written either once
    `ours` is False, because another program has written to the file. `end` is the end of the contents; the file may be
    longer. While `synchronised` is True, flushes are atomic on the disk; beyond `journal.LARGEST` bytes of changes they
    are divided into several atomic turns.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.synchronised = False
        repeated = journal.found(self._file)  # left by a writer stopped by a power loss or a kill
        for offset, data in repeated:
            self._put(offset, data)
        self._pending: dict[int, bytes] = {}
        self.ours = True
        self._head = self._read_head()
        self.end = self._contents()
        if repeated:
            os.fsync(self.fileno())
            self._cut(self.end)
        self._starts, self._ends = [0], [self.end]  # disjoint written ranges, ascending

    def _contents(self) -> int:
        """Return the end of the contents of the file."""
        head, size = self._head, self._file.seek(0, os.SEEK_END)
        known = head.startswith(SUPERBLOCK) and head[8] == 0 and head[13] == 8  # version 0, addresses of eight bytes
        return min(int.from_bytes(head[40:48], "little"), size) if known else size

    def _read_head(self) -> bytes:
        self._file.seek(0)
        return self._file.read(48)

    def intact(self) -> bool:
        """Return whether the superblock, which changes with every flush, is unchanged, and the file is not truncated."""
        cut = os.fstat(self.fileno()).st_size < self._ends[-1]
        self.ours = self.ours and not cut and self._read_head() == self._head
        return self.ours

    @property
    def writable(self) -> bool:
        """Whether there was no error, and no other program has written to the file."""
        return self.ours and self.failure is None

    def _size(self) -> int:
        waiting = max((offset + len(data) for offset, data in self._pending.items()), default=0)
        return max(super()._size(), waiting)

    def _get(self, start: int, data: bytearray) -> None:
        super()._get(start, data)
        journal.overlay(self._pending.items(), start, data)

    def write(self, data: bytes) -> int:
        """Buffer data for the current position; later data replace earlier ones."""
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
        """Set the end of the contents; the file is truncated when it is closed."""
        self.end = size
        return size

    def flush(self) -> None:
        """Write all pending data, in an order in which every write may be the last one."""
        try:
            if self.writable:
                self._commit()
        except BaseException as error:
            self._fail(error)
            with contextlib.suppress(OSError):
                self._head = self._read_head()  # may have been written

    def _commit(self) -> None:
        waiting = sorted(self._pending.items(), key=lambda entry: self._turn(*entry))
        n_new = sum(not self._overlaps(offset, offset + len(data)) for offset, data in waiting)
        new = waiting[:n_new]
        changes = [change for write in waiting[n_new:] if (change := self._changed(*write))[1]]
        for offset, data in new:
            self._put(offset, data)
        for turn in journal.turns(changes) if self.synchronised else [changes]:
            if self.synchronised:
                self._synchronise(new, turn)
            for offset, data in turn:
                self._put(offset, data)
            if self.synchronised:
                os.fsync(self.fileno())
        self._head = self._read_head()
        for offset, data in waiting:
            self._note(offset, offset + len(data))
        self._pending.clear()

    def _changed(self, offset: int, data: bytes) -> journal.Write:
        """Return the part of a write that changes the file, from its first byte to its last."""
        if len(data) > COMPARED:
            return offset, data
        stored = bytearray(len(data))
        super()._get(offset, stored)
        differs = np.flatnonzero(np.frombuffer(data, np.uint8) != np.frombuffer(stored, np.uint8))
        if not len(differs):
            return offset, b""
        return offset + int(differs[0]), data[differs[0] : differs[-1] + 1]

    def _synchronise(self, new: list[journal.Write], changes: list[journal.Write]) -> None:
        """Synchronise new blocks, and a journal of the changes to old ones."""
        end = max([self.end, self._ends[-1], *(offset + len(data) for offset, data in new)])
        log = journal.packed(new, changes)
        self._put(end, log)
        self._cut(end + len(log))
        os.fsync(self.fileno())

    def _cut(self, size: int) -> None:
        self._file.truncate(size)

    def _turn(self, offset: int, data: bytes) -> tuple[int, int, int]:
        """Return the sort key of writes: new blocks, superblock, nodes from the root down, everything else, names."""
        if not self._overlaps(offset, offset + len(data)):
            return 0, 0, offset
        if offset == 0:
            return 1, 0, 0
        if data.startswith(NODE):
            return 2, -data[5], offset
        return (4 if data.startswith(NAMES) else 3), 0, offset

    def _overlaps(self, start: int, end: int) -> bool:
        number = bisect.bisect_left(self._ends, start + 1)
        return number < len(self._starts) and self._starts[number] < end

    def _note(self, start: int, end: int) -> None:
        """Record a written range."""
        first, last = bisect.bisect_left(self._ends, start), bisect.bisect_right(self._starts, end)
        if first < last:
            start, end = min(start, self._starts[first]), max(end, self._ends[last - 1])
        self._starts[first:last], self._ends[first:last] = [start], [end]

    def close(self) -> None:
        """Truncate the file after its contents and wait until it is on the disk; a second call does nothing."""
        if self._file.closed:
            return
        try:
            if self.failure is not None:  # the last end set by HDF5 may not be in the file
                self._head = self._read_head()
                self.end = self._contents()
            if self.ours:
                self._cut(self.end)
                os.fsync(self.fileno())
        finally:
            self._file.close()


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """Defer signals, such as Ctrl-C, to the end of the block: an exception in a callback from HDF5 may crash it.

    Python handles signals in its main thread only: in other threads this has no effect.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[tuple[int, FrameType | None]] = []
    handlers = {int(number): signal.getsignal(number) for number in signal.valid_signals()}
    try:
        with contextlib.ExitStack() as restored:  # restores all handlers even after an error
            for number, handler in handlers.items():
                if callable(handler):
                    restored.callback(signal.signal, number, handler)
                    signal.signal(number, lambda *signal_and_frame: arrived.append(signal_and_frame))
            yield
    finally:
        for which, frame in arrived:
            handler = handlers[which]
            assert callable(handler)
            handler(which, frame)
