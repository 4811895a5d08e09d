"""Executors of the runs of a study: local processes, MPI processes or a Dask cluster."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Iterator
from typing import Any

from fastcontact.cli._interrupts import to_main_thread
from fastcontact.errors import CaseError

MPI_COMMAND = "mpiexec -n N python -m mpi4py.futures -m fastcontact ..."


@contextlib.contextmanager
def executor(where: str) -> Iterator[Any]:
    """Yield an executor, or None for local processes, and shut it down at the end.

    Raises CaseError if `where` is unknown, the library is not installed, no process can be started, a process is lost, or no
    scheduler answers at the address.
    """
    if where == "processes":
        yield None
        return
    if where == "mpi":
        with _mpi() as pool:
            yield pool
        return
    if "://" not in where:
        raise CaseError(f"--executor '{where}' must be processes, mpi, or the address of a Dask scheduler")
    try:
        from dask.distributed import Client
    except ImportError as error:
        raise CaseError(f"--executor {where} needs Dask ({error}): pip install distributed") from error
    try:
        client = Client(where)
    except (OSError, ValueError) as error:
        raise CaseError(f"no Dask scheduler answers at --executor {where}: {error}") from error
    with client:
        yield client.get_executor()


@contextlib.contextmanager
def _mpi() -> Iterator[Any]:
    """Yield the executor of MPI.

    Most launchers end all processes when a process dies. With other launchers the communication thread of mpi4py fails, and
    the main thread would wait for the remaining runs without end.
    """
    try:
        from mpi4py.futures import MPIPoolExecutor
    except ImportError as error:
        raise CaseError(f"--executor mpi needs mpi4py ({error}): pip install mpi4py") from error
    with _failing_threads_interrupt() as failures:
        try:
            with MPIPoolExecutor() as pool:
                pool.submit(os.getpid).result()
                yield pool
        except KeyboardInterrupt:
            if not failures:
                raise
            reason = " ".join(str(failures[0]).split()) or type(failures[0]).__name__
            raise CaseError(
                f"--executor mpi has no processes, or lost one ({reason}): start with '{MPI_COMMAND}'"
            ) from failures[0]


@contextlib.contextmanager
def _failing_threads_interrupt() -> Iterator[list[BaseException]]:
    """Interrupt the main thread when another thread fails; yield a list that collects the errors, which are not printed."""
    failures: list[BaseException] = []
    before = threading.excepthook

    def failed(arguments: threading.ExceptHookArgs) -> None:
        if arguments.exc_value is not None:
            failures.append(arguments.exc_value)
        to_main_thread(signal.SIGINT)

    threading.excepthook = failed
    try:
        yield failures
    finally:
        threading.excepthook = before
