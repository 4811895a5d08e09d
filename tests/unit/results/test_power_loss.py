"""After a loss of power the file opens with all acknowledged steps, whatever part of the last writes is on the disk.

The disk is simulated: what was written before the last synchronisation is there, of later writes any pages of 4 kB, and the
file has any of the sizes that it has had since.
"""

import contextlib
import os
import shutil
import threading
import time
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from pairwise import first_of
from test_result_files import MESH, assert_holds, assert_same, nth_step

import fastcontact as fc
from fastcontact import ConvergenceError, FileError, ResultWriter, open_results
from fastcontact.results import committed_file, journal, write_arrays, writer

PAGE = 4096


@dataclass
class Disk:
    """What a file is made of: what is safe, and what came after it."""

    safe: bytearray
    writes: list[tuple[int, bytes]] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)

    def synchronise(self) -> None:
        self.safe = self.state(np.ones(len(self.pieces()), bool), self.sizes[-1] if self.sizes else len(self.safe))
        self.writes, self.sizes = [], []

    def pieces(self) -> list[tuple[int, bytes]]:
        found = []
        for place, data in self.writes:
            cuts = [place, *range(place + PAGE - place % PAGE, place + len(data), PAGE), place + len(data)]
            found += [(a, data[a - place : b - place]) for a, b in pairwise(cuts)]
        return found

    def state(self, kept: np.ndarray, size: int) -> bytearray:
        whole = bytearray(self.safe)
        for (place, data), keep in zip(self.pieces(), kept, strict=True):
            if keep:
                whole.extend(bytes(max(place + len(data) - len(whole), 0)))
                whole[place : place + len(data)] = data
        whole.extend(bytes(max(size - len(whole), 0)))
        return whole[:size]


@pytest.fixture
def recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[list[tuple[str, object]], Path]:
    """All that was done to a file that takes six steps, each on the disk when its writing ends; and the begun file."""
    events: list[tuple[str, object]] = []
    path, begun = tmp_path / "run.vtkhdf", tmp_path / "begun.vtkhdf"
    real = committed_file.CommittedFile

    class Watched(real):
        def _put(self, place: int, data: bytes) -> None:
            events.append(("write", (place, bytes(data))))
            events.append(("size", max(os.fstat(self.fileno()).st_size, place + len(data))))
            super()._put(place, data)

        def _set_size(self, size: int) -> None:
            events.append(("size", size))
            super()._set_size(size)

    fsync = os.fsync

    def synchronise(descriptor: int) -> None:
        events.append(("synchronise", None))
        fsync(descriptor)

    with monkeypatch.context() as patch:
        patch.setattr(writer, "CommittedFile", Watched)
        with ResultWriter(path, MESH, synchronise=True) as out:
            shutil.copy(path, begun)
            patch.setattr(os, "fsync", synchronise)
            events.clear()
            for number in range(6):
                out.write(nth_step(number))
                events.append(("step", number + 1))
    return events, begun


SHARES = (0.0, 0.95)  # of what was written since the disk was synchronised


@pytest.mark.parametrize("shares", [SHARES, pytest.param(6 * SHARES, marks=pytest.mark.slow)])
def test_a_loss_of_power_costs_no_step(recorded, shares, tmp_path: Path) -> None:
    events, begun = recorded
    random = np.random.default_rng(1)
    disk, steps, tried, repeated = Disk(bytearray(begun.read_bytes())), 0, 0, 0
    crashed = tmp_path / "crashed.vtkhdf"
    for kind, what in events:
        if kind == "write":
            disk.writes.append(what)
        elif kind == "size":
            disk.sizes.append(what)
        elif kind == "step":
            steps = what
        else:
            for share in shares:
                kept = random.random(len(disk.pieces())) < share
                crashed.write_bytes(disk.state(kept, int(random.choice([len(disk.safe), *disk.sizes]))))
                tried += 1
                with open(crashed, "rb") as file:
                    repeated += bool(journal.pending(file))
                with open_results(crashed) as results:
                    assert steps <= len(results) <= steps + 1
                    for number in {0, len(results) // 2, len(results) - 1} if len(results) else ():
                        assert_same(results[number], nth_step(number), f"step {number} of {len(results)}")
            disk.synchronise()
    assert tried > 10 * len(shares)
    assert repeated > 2 * len(shares)


def test_a_run_goes_on_after_a_loss_of_power(recorded, tmp_path: Path) -> None:
    """The writer does again what the journal holds, and leaves a file that needs none."""
    events, begun = recorded
    disk, crashed = Disk(bytearray(begun.read_bytes())), tmp_path / "crashed.vtkhdf"
    syncs = 0
    for kind, what in events:
        if kind == "write":
            disk.writes.append(what)
        elif kind == "size":
            disk.sizes.append(what)
        elif kind == "synchronise":
            syncs += 1
            if syncs == 10:  # the journal of step 5 is safe, its writes are not
                break
            disk.synchronise()
    crashed.write_bytes(disk.safe)
    with fc.ResultWriter(crashed, MESH, resume=True) as out:
        assert len(out.done) == 5
        for number in range(5, 7):
            out.write(nth_step(number))
    with open(crashed, "rb") as file:
        assert not journal.pending(file)
    assert_holds(crashed, 7, nth_step)


@pytest.mark.parametrize("damage", ["cut", "changed", "data", "none"])
def test_a_journal_counts_whole_or_not_at_all(tmp_path: Path, damage: str) -> None:
    writes = [(5, b"abc"), (40, b"")]
    log = journal.pack([(0, b"contents")], writes)
    path = tmp_path / "file"
    data = b"CONTENTS" if damage == "data" else b"contents"
    path.write_bytes(data + {"cut": log[:-1], "changed": log[:3] + b"x" + log[4:]}.get(damage, log))
    with open(path, "rb") as file:
        assert journal.pending(file) == (writes if damage == "none" else [])


@pytest.fixture
def slow(monkeypatch):
    """Writing waits, before the fields of a step, until the returned event is set."""
    go, real = threading.Event(), write_arrays.append_fields

    def append(*given):
        assert go.wait(30)
        real(*given)

    monkeypatch.setattr(write_arrays, "append_fields", append)
    yield go
    go.set()


def failing(monkeypatch, at):
    """Let the disk take no more at the step number `at` of the file."""
    real = write_arrays.append_fields

    def append(file, mesh, number, *given):
        if number == at:
            raise OSError(28, "No space left on device")
        real(file, mesh, number, *given)

    monkeypatch.setattr(write_arrays, "append_fields", append)


def test_the_file_has_the_same_bytes(tmp_path):
    for background in (False, True):
        with ResultWriter(tmp_path / f"{background}.vtkhdf", MESH, background=background) as out:
            for n in range(1, 6):
                out.write(nth_step(n))
    assert (tmp_path / "False.vtkhdf").read_bytes() == (tmp_path / "True.vtkhdf").read_bytes()


def test_the_caller_goes_on_and_only_complete_steps_count(tmp_path, slow):
    path = tmp_path / "run.vtkhdf"
    with ResultWriter(path, MESH, background=True) as out:
        out.write(nth_step(1))  # returns, though the step is held up
        assert out.n_steps == 0
        with open_results(path) as found:
            assert len(found) == 0
        slow.set()
        out.write(nth_step(2))
        assert out.n_steps >= 1
        out.wait()
        assert out.n_steps == 2
        with open_results(path) as found:
            assert_same(found[-1], nth_step(2))
    assert len(open_results(path)) == 2


def test_one_step_at_a_time(tmp_path, slow):
    """The second step waits for the first one."""
    with ResultWriter(tmp_path / "run.vtkhdf", MESH, background=True) as out:
        out.write(nth_step(1))
        second = threading.Thread(target=out.write, args=(nth_step(2),))
        second.start()
        time.sleep(0.05)
        assert second.is_alive()
        slow.set()
        second.join(30)
        assert not second.is_alive()


@pytest.mark.parametrize("end", ["write", "wait", "close", "leave"])
def test_what_went_wrong_is_raised_by_what_comes_next(tmp_path, monkeypatch, end):
    failing(monkeypatch, 1)
    path = tmp_path / "run.vtkhdf"
    out = ResultWriter(path, MESH, background=True)
    out.write(nth_step(1))
    out.write(nth_step(2))
    message = "cannot be written at step 3 .*No space left.* 1 steps are complete"
    with pytest.raises(FileError, match=message):
        {
            "write": lambda: out.write(nth_step(3)),
            "wait": out.wait,
            "close": out.close,
            "leave": lambda: out.__exit__(None, None, None),
        }[end]()
    out.wait()  # the error is raised once
    out.close()
    with open_results(path) as found:
        assert len(found) == 1
        assert_same(found[0], nth_step(1))
    with ResultWriter(path, MESH, resume=True, background=True) as again:  # the lock is free
        assert len(again.done) == 1


def test_another_error_keeps_its_place_and_notes_that_of_the_file(tmp_path, monkeypatch):
    failing(monkeypatch, 0)
    out = ResultWriter(tmp_path / "run.vtkhdf", MESH, background=True)

    def run():
        with out:
            out.write(nth_step(1))
            raise ConvergenceError("does not settle", [])

    with pytest.raises(ConvergenceError, match="does not settle") as found:
        run()
    assert "cannot be written at step 2" in found.value.__notes__[0]


def test_a_step_that_does_not_follow_is_refused_at_once(tmp_path):
    with ResultWriter(tmp_path / "run.vtkhdf", MESH, background=True) as out:
        out.write(nth_step(2))
        with pytest.raises(FileError, match="write each step once, in order"):
            out.write(nth_step(2))


def test_arrays_of_the_caller_may_change(tmp_path, slow):
    with ResultWriter(tmp_path / "run.vtkhdf", MESH, background=True) as out:
        step = nth_step(1)
        out.write(step)
        for field in (step.displacement, step.stress, *(contact.pressure for contact in step.contact.values())):
            field[:] = -1.0
        slow.set()
    with open_results(tmp_path / "run.vtkhdf") as found:
        assert_same(found[0], nth_step(1))


@pytest.mark.parametrize("background", first_of(1, [False, True]))
def test_threads_that_share_a_writer_lose_nothing(tmp_path, background):
    """Each step is written whole or refused, because a later one came first; what was written is there."""
    written, path = [], tmp_path / "run.vtkhdf"

    def write(numbers):
        for number in numbers:
            with contextlib.suppress(FileError):
                out.write(nth_step(number))
                written.append(number)

    with ResultWriter(path, MESH, background=background) as out:
        threads = [threading.Thread(target=write, args=(range(k, 40, 4),)) for k in range(1, 5)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    with open_results(path) as found:
        assert [step.index for step in found] == [nth_step(number).index for number in sorted(written)]
        for step, number in zip(found, sorted(written), strict=True):
            assert_same(step, nth_step(number))
