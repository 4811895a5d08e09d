"""Parallel runs: one that kills its process is tried once more alone, without loss of others."""

import os
import signal
from concurrent.futures import Executor, Future
from types import SimpleNamespace

import pytest

from fastcontact.studies import execute


def test_no_worker_is_left_half_started(monkeypatch):
    """A signal that comes while a process starts is heard when it has."""
    begun = []

    def start(self):
        signal.raise_signal(signal.SIGTERM)
        begun.append(self)

    def heard(number, frame):
        raise KeyboardInterrupt

    monkeypatch.setattr(execute.SpawnProcess, "start", start)
    before = signal.signal(signal.SIGTERM, heard)
    try:
        with pytest.raises(KeyboardInterrupt):
            execute.Spawning().Process(target=print).start()
    finally:
        signal.signal(signal.SIGTERM, before)
    assert len(begun) == 1


def deadly(job, threads):
    if job.label == "deadly":
        os.kill(os.getpid(), signal.SIGKILL)
    return {"label": job.label, "threads": threads}


@pytest.fixture
def jobs(monkeypatch):
    monkeypatch.setattr(execute, "run", deadly)
    return [SimpleNamespace(label=name, size=size) for name, size in (("first", 1), ("deadly", 3), ("last", 2))]


def test_a_run_that_kills_its_worker_is_reported_and_the_others_end(jobs):
    found = dict(execute.on_processes(2, jobs, [0, 1, 2]))
    assert sorted(found) == [0, 1, 2]
    assert found[0] == {"label": "first", "threads": 1}
    assert found[2] == {"label": "last", "threads": 1}
    assert found[1]["kind"] == "BrokenProcessPool"
    assert found[1]["error"].startswith("its worker process was killed")


def test_what_has_not_begun_is_called_off_where_a_study_stops(jobs):
    class Slow(Executor):
        def __init__(self):
            self.futures = []

        def submit(self, function, *arguments):
            self.futures.append(Future())
            if len(self.futures) == 1:
                self.futures[0].set_exception(KeyboardInterrupt())
            return self.futures[-1]

    executor = Slow()
    with pytest.raises(KeyboardInterrupt):
        list(execute.on_executor(executor, jobs, [0, 1, 2]))
    assert [future.cancelled() for future in executor.futures] == [False, True, True]
