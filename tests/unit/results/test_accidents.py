"""Failures below a result file, and forged, truncated or dismantled files: one line."""

import dataclasses
import errno
import gc
import hashlib
import os
import shutil
import signal
import subprocess
import sys
import textwrap
import threading
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
from refusals import refused
from test_result_files import MESH, assert_holds, step_result
from test_resume import spheres

import fastcontact as fc
from fastcontact import FileError, ResultWriter, open_results
from fastcontact.results import committed_file, journal, layout, write_arrays
from fastcontact.results.committed_file import uninterrupted


def failing_after(count: int, error: BaseException, monkeypatch: pytest.MonkeyPatch, name: str) -> list[int]:
    """Let every call of a method of the file fail after the first `count`; the list tells how many were made."""
    method, calls = getattr(committed_file.CommittedFile, name), []

    def fail(self: committed_file.CommittedFile, *arguments: object) -> object:
        calls.append(len(calls))
        if len(calls) > count:
            raise error
        return method(self, *arguments)

    monkeypatch.setattr(committed_file.CommittedFile, name, fail)
    return calls


def write_until(path: Path, fail: Callable[[], list[int]]) -> list[int]:
    """Write a step, then two more that may fail; return the calls that were made."""
    with ResultWriter(path, MESH) as out:
        out.write(step_result(0))
        calls = fail()
        out.write(step_result(1))
        out.write(step_result(2))
    return calls


@pytest.fixture
def little_garbage() -> Iterator[None]:
    """Collections look at what is made from here on only."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.each_value
@pytest.mark.usefixtures("little_garbage")
@pytest.mark.parametrize("shared", [write_arrays.MAX_SHARED, 0], ids=["steps share a chunk", "a chunk a step"])
@pytest.mark.parametrize("error", [OSError(errno.EIO, "Input/output error"), KeyboardInterrupt()], ids=["disk", "user"])
@pytest.mark.parametrize("apart", [9, pytest.param(1, marks=pytest.mark.slow)])
def test_any_write_may_fail(
    apart: int, error: BaseException, shared: int, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """HDF5, which does not take exceptions well, never sees one."""
    monkeypatch.setattr(write_arrays, "MAX_SHARED", shared)
    with monkeypatch.context() as patch:
        total, lengths = len(write_until(path, lambda: failing_after(10**9, error, patch, "_put"))), set()
    assert total > 60
    for count in range(0, total, apart):
        with monkeypatch.context() as patch:
            told = pytest.raises(FileError if isinstance(error, OSError) else type(error))
            with told as caught:
                write_until(path, lambda count=count, patch=patch: failing_after(count, error, patch, "_put"))
            gc.collect()  # files that nobody knows any more are closed
        with open_results(path) as results:
            lengths.add(len(results))
            assert not results.complete
        assert_holds(path, len(results))
        if isinstance(error, OSError):
            assert f"(Input/output error); {len(results)} steps are complete: check the disk" in str(caught.value)
        assert os.listdir(path.parent) == [path.name]
        del caught, told
    assert lengths == {1, 2, 3}
    with ResultWriter(path, MESH, resume=True) as out:  # now the disk is well again
        for number in range(out.n_steps, 4):
            out.write(step_result(number))
    assert_holds(path, 4)
    assert open_results(path).complete


READS = """
    import errno, sys
    from pathlib import Path
    import pytest
    sys.path[:0] = sys.argv[2:]
    import test_accidents as t
    path = Path(sys.argv[1])
    with t.ResultWriter(path, t.MESH) as out:
        out.write(t.step_result(0))
    before = path.read_bytes()
    for count in (0, 1, 2, 5, 10, 20, 30, 40, 60):
        with pytest.MonkeyPatch.context() as patch:
            out = t.ResultWriter(path, t.MESH, resume=True)
            calls = t.failing_after(count, OSError(errno.EIO, "Input/output error"), patch, "_get")
            with pytest.raises(t.FileError, match=r"step 2 \\(Input/output error\\); 1 steps are complete"), out:
                out.write(t.step_result(1))
            assert len(calls) > count
        assert path.read_bytes() == before
"""


def test_failing_reads_are_told_and_nothing_is_written_any_more(path: Path) -> None:
    """In a process of its own: HDF5 must not crash at its end over what it could not close."""
    folder = Path(__file__).parent
    command = [sys.executable, "-c", textwrap.dedent(READS), path, folder, folder.parents[1]]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert_holds(path, 1)


@pytest.mark.parametrize("count", [0, 1, 5, 12])
def test_a_writer_that_failed_does_not_write_again(count: int, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whichever write fails: among the first ones is the head of the file, by which other writers are noticed."""
    out = ResultWriter(path, MESH)
    out.write(step_result(0))
    with monkeypatch.context() as patch:
        failing_after(count, OSError(errno.ENOSPC, "No space left on device"), patch, "_put")
        with pytest.raises(FileError, match=r"written at step 2 \(No space left on device\); 1 steps are complete"):
            out.write(step_result(1))
    with pytest.raises(FileError, match=r"written at step 2 \(No space left on device\); 1 steps are complete"):
        out.write(step_result(1))
    out.close()
    assert_holds(path, 1)


def test_what_another_program_writes_into_the_file_stays(path: Path) -> None:
    """Copied over, so that the file is the same one for the system."""
    with ResultWriter(path.with_name("other.vtkhdf"), MESH) as other:
        for number in range(5):
            other.write(step_result(number))
    theirs = other.path.read_bytes()

    def overwritten(before_the_end: bool) -> None:
        with ResultWriter(path, MESH) as out:
            out.write(step_result(0))
            shutil.copyfile(other.path, path)
            if not before_the_end:
                out.write(step_result(1))

    message = "was changed by another program after 1 steps, and its contents are left unchanged"
    for before_the_end in (False, True):
        refused(FileError, message, overwritten, before_the_end)
        assert path.read_bytes() == theirs
        assert_holds(path, 5)


def change(path: Path, how: str) -> None:
    if how == "removed":
        path.unlink()
    elif how == "replaced":
        other = path.with_name("other")
        shutil.copy(path, other)
        os.replace(other, path)
    else:
        with ResultWriter(path.with_name("longer.vtkhdf"), MESH) as longer:
            longer.write(step_result(0))
            longer.write(step_result(1))
        shutil.copyfile(longer.path, path)
        longer.path.unlink()


@pytest.mark.parametrize("how", ["removed", "replaced", "changed"])
def test_a_file_that_is_taken_up_and_then_changes_is_left_alone(how: str, path: Path) -> None:
    """The first step of a resumed run may take hours."""
    with ResultWriter(path, MESH) as out:
        out.write(step_result(0))
    out = ResultWriter(path, MESH, resume=True)
    change(path, how)
    before = path.read_bytes() if path.exists() else None
    with (
        pytest.raises(FileError, match=r"is no longer there: .* after 1 steps\. Put it back and resume, or start"),
        out,
    ):
        out.write(step_result(1))
    assert (path.read_bytes() if path.exists() else None) == before
    assert os.listdir(path.parent) == ([path.name] if before else [])


def test_a_pair_is_in_the_file_as_a_whole_or_not_at_all(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped by hand while the first step brings its contact pairs."""
    from fastcontact.results import write_arrays

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    def stopped(which: str) -> None:
        with ResultWriter(path, MESH) as out:
            monkeypatch.setattr(write_arrays, which, stop)
            out.write(step_result(1))

    for which in ("growing_table", "_append_contact"):
        with pytest.raises(KeyboardInterrupt):
            stopped(which)
        monkeypatch.undo()
        with ResultWriter(path, MESH, resume=True) as out:
            out.write(step_result(0))
            out.write(step_result(1))
        assert_holds(path, 2)


# ---------------------------------------------------------------------------------------------- signals


@pytest.fixture
def interruptible() -> Iterator[None]:
    """A process that can be interrupted: shells let those that they start in the background ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
def test_a_signal_waits_for_the_end_of_a_write(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The step that is being written is complete, counted, and in the record of how the run ended."""
    put, seen = committed_file.CommittedFile._put, []

    def interrupted(self: committed_file.CommittedFile, place: int, data: bytes) -> None:
        if not seen:
            signal.raise_signal(signal.SIGINT)
        seen.append(place)
        put(self, place, data)

    def run() -> None:
        with ResultWriter(path, MESH) as out:
            out.write(step_result(0))
            monkeypatch.setattr(committed_file.CommittedFile, "_put", interrupted)
            out.write(step_result(1))
            pytest.fail("the signal was lost")

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        run()
    assert len(seen) > 20
    assert signal.getsignal(signal.SIGINT) is before
    assert_holds(path, 2)
    assert open_results(path).error == "KeyboardInterrupt: "


def fail_uninterrupted() -> None:
    with uninterrupted():
        signal.raise_signal(signal.SIGTERM)
        raise ZeroDivisionError


def test_signals_wait_with_handlers_of_any_kind() -> None:
    arrived = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: arrived.append((number, frame.f_code.co_name)))
    try:
        with uninterrupted():
            signal.raise_signal(signal.SIGTERM)
            signal.raise_signal(signal.SIGTERM)
            assert not arrived
            with uninterrupted():  # one within the other
                signal.raise_signal(signal.SIGTERM)
            assert not arrived
        assert [number for number, _ in arrived] == [signal.SIGTERM] * 3
        signal.raise_signal(signal.SIGTERM)
        assert arrived[-1] == (signal.SIGTERM, "test_signals_wait_with_handlers_of_any_kind")
        with pytest.raises(ZeroDivisionError):
            fail_uninterrupted()
        assert len(arrived) == 5
    finally:
        signal.signal(signal.SIGTERM, before)


def test_other_threads_have_no_signals_to_wait_for(path: Path) -> None:
    found = []

    def work() -> None:
        with ResultWriter(path, MESH) as out:
            out.write(step_result(0))
            found.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert found == [signal.getsignal(signal.SIGINT)]
    assert_holds(path, 1)


def test_each_step_is_written_once_and_in_order(path: Path) -> None:
    with ResultWriter(path, MESH) as out:
        out.write(step_result(1))
        for number in (1, 0):
            with pytest.raises(FileError, match=f"step {number + 1} cannot be written after step 2: write each step"):
                out.write(step_result(number))
        out.write(step_result(2))
    with (
        ResultWriter(path, MESH, resume=True) as out,
        pytest.raises(FileError, match="step 3 cannot be written after step 3"),
    ):
        out.write(step_result(2))
    assert [step.index for step in open_results(path)] == [2, 3]


def test_steps_of_two_cases_need_two_files(path: Path) -> None:
    one, other = ({"case": {"parts": {"model": digest}}} for digest in ("a", "b"))
    with ResultWriter(path, MESH) as out:
        out.write(dataclasses.replace(step_result(0), restart=one))
        with pytest.raises(FileError, match="step 2 belongs to another case than step 1"):
            out.write(dataclasses.replace(step_result(1), restart=other))
        out.write(dataclasses.replace(step_result(1), restart=one))
    assert len(open_results(path)) == 2


def test_masks_are_not_lost_without_a_word(path: Path) -> None:
    step = step_result(0)
    masked = np.ma.masked_less(step.von_mises, 0.5)
    with ResultWriter(path, MESH) as out, pytest.raises(FileError, match="von_mises is a masked array"):
        out.write(dataclasses.replace(step, von_mises=masked))


@pytest.mark.skipif(os.name != "posix", reason="needs links")
@pytest.mark.parametrize("link", [os.symlink, os.link], ids=["symbolic", "hard"])
def test_a_lock_that_is_a_link_changes_nothing(path: Path, link: Callable[..., None]) -> None:
    """Somebody else may have put it there, to have a file of ours overwritten."""
    precious = path.with_name("precious")
    precious.write_text("precious")
    link(precious, path.with_name(f".{path.name}.lock"))
    refused(FileError, "remove it", ResultWriter, path, MESH)
    assert precious.read_text() == "precious"


RAMP = fc.Ramp((0.1, 0.2, 0.3), ((0.0, 0.0), (1.0, 1.0)))


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    path = tmp_path_factory.mktemp("forged") / "sound.vtkhdf"
    model = spheres()
    with fc.ResultWriter(path, model) as out:
        fc.solve(model, fc.Ramp((0.1, 0.2), RAMP.table), on_step=out.write)
    return path


def with_journal(sound, folder, body):
    """A copy with a journal of these bytes at its end, whose checksum is right."""
    path = folder / "forged.vtkhdf"
    shutil.copy(sound, path)
    with path.open("ab") as file:
        file.write(body + journal.FOOTER.pack(len(body), hashlib.sha256(body).digest(), journal.MAGIC))
    return path


def record(place, count, is_new=True, data=b"\0" * 32):
    return journal.HEADER.pack(place, count, is_new) + data


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (record(0, 1 << 62), "counts data twice"),
        (record(1 << 62, 8), "refers to data beyond the contents"),
        (record(1 << 62, 8, False, b"\0" * 8), "refers to data beyond the contents"),
        (record(0, 1 << 40, False, b"\0" * 8), "is cut off"),
        (record(0, 8)[:20], "is cut off"),
        (b"\1" * 7, "is cut off"),
    ],
)
def test_forged_journals(body, said, sound, tmp_path):
    path = with_journal(sound, tmp_path, body)
    refused(fc.FileError, rf"the journal at the end of '.*' {said}", fc.open_results, path)
    refused(fc.FileError, said, fc.ResultWriter, path, spheres(), resume=True)


def test_the_same_data_hashed_for_ever(sound, tmp_path):
    size = sound.stat().st_size
    digest = hashlib.sha256(sound.read_bytes()).digest()
    path = with_journal(sound, tmp_path, record(0, size, True, digest) * 1000)
    refused(fc.FileError, "counts data twice", fc.open_results, path)
    assert len(fc.open_results(with_journal(sound, tmp_path, record(0, size, True, digest)))) == 2


def grown(sound, folder, size, length):
    """A copy of this size, which says that a journal of a length is at its end."""
    path = folder / "grown.vtkhdf"
    shutil.copy(sound, path)
    with path.open("r+b") as file:
        file.truncate(size)
        file.seek(0, os.SEEK_END)
        file.write(journal.FOOTER.pack(length, b"\0" * 32, journal.MAGIC))
    return path


def test_a_journal_of_gigabytes(sound, tmp_path):
    """A sparse file: nothing of it is read."""
    path = grown(sound, tmp_path, 1 << 36, (1 << 36) - 1000)
    refused(fc.FileError, r"declares 6.87e\+10 bytes", fc.open_results, path)


def test_a_long_journal_that_is_none_takes_no_memory(sound, tmp_path):
    length = 1 << 27
    path = grown(sound, tmp_path, 2 * length, length)
    tracemalloc.start()
    try:
        assert len(fc.open_results(path)) == 2
        assert tracemalloc.get_traced_memory()[1] < length / 8
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("name", layout.NEEDED_TO_RESUME)
def test_files_that_lack_what_is_written_on(name, sound, tmp_path):
    path = tmp_path / "parts.vtkhdf"
    shutil.copy(sound, path)
    with h5py.File(path, "r+") as file:
        del file[name]
    refused(fc.FileError, r"^(?!.*\n).*(damaged|lacks)", fc.ResultWriter, path, spheres(), resume=True)


def test_tables_of_another_kind(sound, tmp_path):
    """What shows only as a step is written says that the file is damaged, and not that the disk is full."""
    path = tmp_path / "kind.vtkhdf"
    shutil.copy(sound, path)
    with h5py.File(path, "r+") as file:
        del file["VTKHDF/Steps/Values"]
        file["VTKHDF/Steps/Values"] = 1.0
    model = spheres()
    out = fc.ResultWriter(path, model, resume=True)
    (step,) = fc.solve(model, RAMP, resume=out.done)[2:]
    refused(fc.FileError, "its tables are damaged: name another file", out.write, step)


@pytest.mark.parametrize("lost", ["case", "pairs", "numbers", "solver", "active", "obstacles"])
def test_restart_data_that_lack_a_part(lost, sound):
    last = fc.open_results(sound)[-1]
    del last.restart[lost]
    refused(fc.ModelError, r"the restart data of step 2 are damaged", fc.solve, spheres(), RAMP, resume=[last])
