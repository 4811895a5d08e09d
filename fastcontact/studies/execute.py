"""Execution of runs in local processes or by an executor, with a status line and a store of finished runs."""

from __future__ import annotations

import contextlib
import itertools
import json
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import connection
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext, SpawnProcess
from pathlib import Path
from typing import Any

from fastcontact import errors
from fastcontact._tools.paths import replacing
from fastcontact.analysis.progress import StatusLine
from fastcontact.errors import CaseError, FastcontactError, FileError
from fastcontact.results.committed_file import uninterrupted
from fastcontact.studies.job import QuantityError, Run, execute_run


class StudyStatus(StatusLine):
    """Status line of a study: the last run, the number of remaining runs, and the estimated remaining time."""

    def __init__(self, show: bool) -> None:
        super().__init__(100, show)
        self._stored = 0

    def __enter__(self) -> StudyStatus:
        self.draw("the first runs")
        return super().__enter__()

    def __call__(self, progress: Any) -> None:
        """Redraw the line after a run; `progress` is a `fastcontact.studies.execute.Progress`."""
        self._stored += progress.stored
        solved = progress.done - self._stored
        outcome = "failed" if progress.error else "found in the store" if progress.stored else "done"
        seconds, n_left = (time.perf_counter() - self._started) / max(solved, 1), len(progress.left)
        left = f", {n_left} left: about {seconds * n_left:.0f} s" if solved and n_left else ""
        self.draw(f"{progress.done}/{progress.total} {progress.label} {outcome}{left}")


Result = dict[str, Any]
# Environment variables that must be set before a worker process starts, because NumPy and Numba read them on import.
_THREAD_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


@dataclass(frozen=True)
class Progress:
    """Argument of `on_progress`, which is called after each run.

    Attributes
    ----------
    label : str
        Label of the run that has finished.
    done : int
        Number of finished runs.
    total : int
        Number of runs.
    left : tuple of str
        Labels of the remaining runs.
    seconds : float
        Wall time [s] of the run; 0 if its result is from the store.
    error : str
        Reason for the failure of the run; empty if it succeeded.
    stored : bool
        Whether the result is from the store.
    """

    label: str
    done: int
    total: int
    left: tuple[str, ...]
    seconds: float
    error: str
    stored: bool


def run_study(
    runs: Sequence[Run],
    failure: str,
    *,
    executor: Executor | None = None,
    workers: int | None = None,
    store: str | Path | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    progress: bool = False,
) -> list[Result]:
    """Execute runs in parallel and return their results in the given order; for options see `convergence_study`.

    Raises CaseError if the number of workers is invalid or if the function that computes a quantity fails before any run has
    succeeded, and FastcontactError if no worker process can start. If all runs fail, the error of the first one is raised,
    with `failure`, such as "no level could be solved", before its message.
    """
    storage = None if store is None else Store(store)
    stored = {i: result for i, run in enumerate(runs) if storage and (result := storage.get(run)) is not None}
    waiting, results = {index: run.label for index, run in enumerate(runs)}, dict[int, Result]()
    to_run = [index for index in waiting if index not in stored]
    with StudyStatus(progress) as line:
        for index, result in itertools.chain(stored.items(), _results_of(runs, to_run, executor, workers)):
            if storage is not None and "error" not in result and index not in stored:
                storage.put(runs[index], result)
            if result.get("kind") == QuantityError.__name__ and all("error" in other for other in results.values()):
                raise CaseError(f"{runs[index].label}: {result['error']}")  # it would fail for the other runs as well
            results[index], label, left = result, waiting.pop(index), tuple(waiting.values())
            seconds = 0.0 if index in stored else float(result.get("seconds", 0.0))
            counts, error = (len(results), len(runs)), str(result.get("error", ""))
            state = Progress(label, *counts, left, seconds, error, stored=index in stored)
            line(state)
            if on_progress is not None:
                on_progress(state)
    if all("error" in result for result in results.values()):
        kind = getattr(errors, str(results[0].get("kind")), CaseError)
        raise kind(f"{failure}; {runs[0].label}: {results[0]['error']}")
    return [results[index] for index in range(len(runs))]


class Store:
    """A folder with a JSON file for each finished run, named after the key of the run.

    The folder is created if it does not exist. FileError is raised if this fails.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(
                f"the folder '{folder}' cannot be created: {error.strerror}; choose another folder"
            ) from error

    def path(self, run: Run) -> Path:
        """Return the path of the file for the result of a run."""
        return self.folder / f"{run.key}.json"

    def get(self, run: Run) -> Result | None:
        """Return the stored result of a run, or None if it is missing or incomplete."""
        try:
            stored = json.loads(self.path(run).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        result = stored.get("result") if isinstance(stored, dict) else None
        return result if isinstance(result, dict) and "values" in result else None

    def put(self, run: Run, result: Result) -> None:
        """Store the result of a run in a file that is written atomically."""
        text = json.dumps({"label": run.label, "case": run.name, "marks": run.marks, "result": result}, default=str)
        with replacing(self.path(run)) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")


def _results_of(
    runs: Sequence[Run], indices: list[int], executor: Executor | None, workers: int | None
) -> Iterator[tuple[int, Result]]:
    """Execute the runs with the given `indices`. Yields the index and the result of each run when it ends."""
    if workers is not None and workers < 1:
        raise CaseError(f"workers = {workers} is not allowed: the number of processes must be at least 1")
    count = min(workers or _processors(), len(indices))
    if executor is not None:
        yield from run_on_executor(executor, runs, indices)
    elif count <= 1:
        for index in indices:
            yield index, execute_run(runs[index])
    else:
        yield from run_on_processes(count, runs, indices)


def run_on_processes(count: int, runs: Sequence[Run], indices: list[int]) -> Iterator[tuple[int, Result]]:
    """Execute runs in `count` local processes; yield the index and the result of each run as it ends.

    If a worker process dies, each run that has not ended is repeated in a separate process.
    """
    if sys.modules.get("__mp_main__") not in (None, sys.modules["__main__"]):
        # This process is a worker that imports the script of its parent, which calls the study without
        # "if __name__ == '__main__'". The parent process reports the error.
        raise SystemExit(1)
    left = list(indices)
    try:
        with process_pool(count) as pool:
            for index, result in run_on_executor(pool, runs, indices):
                left.remove(index)
                yield index, result
    except BrokenProcessPool:
        for index in left:
            yield index, _run_alone(runs[index])


class Worker(SpawnProcess):
    """A process whose start cannot be interrupted. A partly started process would print an error."""

    def start(self) -> None:
        """Start the process, with signals deferred until it is started."""
        with uninterrupted():
            super().start()


class RecordingContext(SpawnContext):
    """A multiprocessing context that spawns processes and records them in a list."""

    def __init__(self) -> None:
        super().__init__()
        self.processes: list[Worker] = []

    def Process(self, *arguments: Any, **options: Any) -> Worker:  # type: ignore[override]
        """Return a new process."""
        self.processes.append(Worker(*arguments, **options))
        return self.processes[-1]


class Workers(ProcessPoolExecutor):
    """A process pool whose workers can be terminated while they work, and end when the calling process ends."""

    def __init__(self, count: int) -> None:
        self.context = RecordingContext()
        receiver, self.pipe = self.context.Pipe(duplex=False)
        super().__init__(count, self.context, initializer=end_with_parent, initargs=(receiver,))

    def end(self) -> None:
        """Terminate the processes. Otherwise Python would wait for the end of their current work before it exits."""
        self.pipe.close()
        for process in self.context.processes:
            if process.is_alive():  # a process that is still importing modules does not read from the pipe
                process.terminate()


@contextlib.contextmanager
def process_pool(count: int) -> Iterator[Workers]:
    """Yield a pool of processes, one of which has answered; an error in the ``with`` block terminates the processes.

    Raises FastcontactError if no process can start.
    """
    pool = Workers(count)
    try:
        try:
            with _worker_settings():
                pool.submit(os.getpid).result()
        except BrokenProcessPool:
            raise FastcontactError(
                "no worker process could start: in a script, put the call of the study under if __name__ == '__main__':, "
                "or use workers=1"
            ) from None
        yield pool
        pool.shutdown()  # all work is done, and the processes end normally
    except BrokenProcessPool:
        raise
    except BaseException:
        pool.end()
        raise
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _run_alone(run: Run) -> Result:
    """Return the result of a run in a separate process, or an error if the process dies."""
    try:
        with process_pool(1) as pool:
            return pool.submit(execute_run, run, 1).result()
    except BrokenProcessPool:
        text = "its worker process was killed, probably because it ran out of memory: use coarser meshes"
        return {"error": text, "kind": "BrokenProcessPool"}


def _processors() -> int:
    """Return the number of processors available to this process."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def run_on_executor(executor: Executor, runs: Sequence[Run], indices: list[int]) -> Iterator[tuple[int, Result]]:
    """Execute runs on any executor; yield the index and the result of each run as it ends.

    If a run raises an exception, the other runs are cancelled.
    """
    futures: dict[Future[Result], int] = {}
    try:
        # Threads share the environment of this process, which must not change while they compile.
        with contextlib.nullcontext() if isinstance(executor, ThreadPoolExecutor) else _worker_settings():
            # The largest runs start first, so that no long run remains alone at the end.
            for index in sorted(indices, key=lambda index: -runs[index].size):
                futures[executor.submit(execute_run, runs[index], 1)] = index
        for future in as_completed(futures):
            yield futures[future], future.result()
    except BaseException as error:
        # A pool that is broken or has been shut down sets the results of its futures, which fails for cancelled futures.
        if not isinstance(executor, Workers) and not isinstance(error, BrokenExecutor):
            for future in futures:
                future.cancel()
        raise


def end_with_parent(pipe: Connection) -> None:
    """Let this process end as soon as its parent process ends or closes its end of the `pipe`."""
    parent = multiprocessing.parent_process()

    def wait() -> None:
        if parent is not None:
            connection.wait([parent.sentinel, pipe])
            os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


@contextlib.contextmanager
def _worker_settings() -> Iterator[None]:
    """Let processes that are started in a ``with`` block use one thread each and ignore Ctrl-C.

    A terminal sends Ctrl-C to all processes, and each of them would print a traceback. Only this process handles it.
    """
    original = {name: os.environ.get(name) for name in _THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(_THREAD_VARIABLES, "1"))
    can_block = hasattr(signal, "pthread_sigmask")
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if can_block else None
    try:
        yield
    finally:
        if blocked is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        for name, value in original.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value
