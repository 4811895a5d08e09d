"""Steps written while the next one is computed: the same file, no step lost, and errors reported."""

import contextlib
import threading
import time

import pytest
from pairwise import first_of
from test_result_files import MESH, assert_same, nth_step

from fastcontact import ConvergenceError, FileError, ResultWriter, open_results
from fastcontact.results import write_arrays


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


def test_an_error_is_raised_once(tmp_path, monkeypatch):
    failing(monkeypatch, 0)
    out = ResultWriter(tmp_path / "run.vtkhdf", MESH, background=True)
    out.write(nth_step(1))
    with pytest.raises(FileError, match="No space left"):
        out.wait()
    out.wait()
    out.close()


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
