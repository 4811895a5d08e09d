"""How runs are spread over processes: of this machine, or of any executor; finished runs are kept as they come."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fastcontact import errors
from fastcontact.errors import CaseError, FastcontactError
from fastcontact.studies.job import Job, run
from fastcontact.studies.store import Store

Result = dict[str, Any]
# NumPy and Numba read these when they are imported, so they are set before a worker process starts.
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


@dataclass(frozen=True)
class Progress:
    """Argument of `on_progress`, which is called after every run.

    Attributes
    ----------
    label : str
        The run that has just ended.
    done, total : int
        Runs that have ended, and all.
    left : tuple of str
        Labels of the runs still to come.
    seconds : float
        Time the run took [s]; 0 if it was found in the store.
    error : str
        Why it failed; empty if it did not.
    stored : bool
        Whether it was found in the store.
    """

    label: str
    done: int
    total: int
    left: tuple[str, ...]
    seconds: float
    error: str
    stored: bool


def run_all(
    jobs: Sequence[Job],
    *,
    executor: Executor | None = None,
    workers: int | None = None,
    store: str | Path | None = None,
    on_progress: Callable[[Progress], None] | None = None,
) -> list[Result]:
    """Run jobs side by side and return their results in the order of the jobs.

    Parameters
    ----------
    jobs : sequence of Job
    executor : concurrent.futures.Executor, optional
        Where to run: processes of this machine by default, or e.g. ``Client.get_executor()`` of Dask or an
        ``MPIPoolExecutor`` of mpi4py. It is not shut down here.
    workers : int, optional
        Processes where no executor is given, by default as many as there are processors for this process; 1 runs
        everything in this process.
    store : path-like, optional
        Folder of finished runs: those found there are not run again; new ones are added.
    on_progress : callable, optional
        Called with a `Progress` after every run.

    Raises
    ------
    CaseError
        If the number of workers is wrong.
    FastcontactError
        If no worker process can start.
    """
    kept = None if store is None else Store(store)
    results: list[Result | None] = [None if kept is None else kept.get(job) for job in jobs]
    stored = [index for index, result in enumerate(results) if result is not None]
    waiting = {index: job.label for index, job in enumerate(jobs)}

    def ended(index: int, result: Result, seconds: float, found: bool) -> None:
        results[index] = result
        label = waiting.pop(index)
        if on_progress is not None:
            done, left, error = len(jobs) - len(waiting), tuple(waiting.values()), str(result.get("error", ""))
            on_progress(Progress(label, done, len(jobs), left, seconds, error, found))

    for index in stored:
        ended(index, results[index] or {}, 0.0, True)
    for index, result in _run_rest(jobs, list(waiting), executor, workers):
        if kept is not None and "error" not in result:
            kept.put(jobs[index], result)
        ended(index, result, float(result.get("seconds", 0.0)), False)
    return [result for result in results if result is not None]


def raise_first(what: str, jobs: Sequence[Job], results: Sequence[Result]) -> None:
    """Raise the error of the first run if all runs failed; `what` begins the message."""
    if all("error" in result for result in results):
        kind = getattr(errors, str(results[0].get("kind")), CaseError)
        raise kind(f"{what}; {jobs[0].label}: {results[0]['error']}")


def _run_rest(
    jobs: Sequence[Job], rest: list[int], executor: Executor | None, workers: int | None
) -> Iterator[tuple[int, Result]]:
    if workers is not None and workers < 1:
        raise CaseError(f"workers = {workers} must be at least 1, the number of processes")
    count = min(workers or _processors(), len(rest))
    if executor is not None:
        yield from on_executor(executor, jobs, rest)
    elif count <= 1:
        for index in rest:
            yield index, run(jobs[index])
    else:
        yield from on_processes(count, jobs, rest)


def on_processes(count: int, jobs: Sequence[Job], rest: list[int]) -> Iterator[tuple[int, Result]]:
    """Run on `count` processes of this machine; a run that kills its worker is tried once more alone, then reported."""
    left = list(rest)
    pool = started_pool(count)
    try:
        for index, result in on_executor(pool, jobs, rest):
            left.remove(index)
            yield index, result
    except BrokenProcessPool:
        for index in left:
            yield index, _alone(jobs[index])
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def started_pool(count: int) -> ProcessPoolExecutor:
    """Return a pool of processes of which one has answered.

    Raises FastcontactError if none can start.
    """
    # Forked children of a process with OpenMP threads die, so workers are spawned.
    pool = ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("spawn"))
    try:
        with _environment(_ONE_THREAD, "1"):
            pool.submit(os.getpid).result()
    except BrokenProcessPool as error:
        raise FastcontactError(
            "no worker process could start: in a script, put what calls the study under if __name__ == '__main__':, "
            "or use workers=1"
        ) from error
    return pool


def _alone(job: Job) -> Result:
    pool = started_pool(1)
    try:
        return pool.submit(run, job, 1).result()
    except BrokenProcessPool:
        text = "its worker process was killed, as the system does when the memory is full: use coarser meshes"
        return {"error": text, "kind": "BrokenProcessPool"}
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _processors() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def on_executor(executor: Executor, jobs: Sequence[Job], rest: list[int]) -> Iterator[tuple[int, Result]]:
    """Run on any executor and yield number and result of each job as it ends; cancel the others if one raises."""
    futures: dict[Future[Result], int] = {}
    try:
        with _environment(_ONE_THREAD, "1"):
            # The largest first, so that none keeps the others waiting at the end.
            for index in sorted(rest, key=lambda index: -jobs[index].size):
                futures[executor.submit(run, jobs[index], 1)] = index
        for future in as_completed(futures):
            yield futures[future], future.result()
    except BaseException:
        for future in futures:
            future.cancel()
        raise


@contextlib.contextmanager
def _environment(names: Sequence[str], value: str) -> Iterator[None]:
    """Set environment variables for processes started inside the block, and put them back."""
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, value))
    try:
        yield
    finally:
        for name, old in before.items():
            if old is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = old
