"""Common functions of the commands for studies: arguments, executors, interruption and output files."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from fastcontact.cli._interrupts import send_to_main_thread
from fastcontact.cli._outputs import check_outputs, save, write_json, write_text
from fastcontact.cli._terminal import say, stderr_is_terminal
from fastcontact.errors import CaseError, FastcontactError

MPI_COMMAND = "mpiexec -n N python -m mpi4py.futures -m fastcontact ..."


@contextlib.contextmanager
def executor(name: str) -> Iterator[Any]:
    """Yield the executor that ``--executor`` names, or None for local processes, and shut it down at the end.

    Raises CaseError if the name is unknown, the library is not installed, no process can be started, a process is lost, or no
    scheduler answers at the address.
    """
    if name == "processes":
        yield None
        return
    if name == "mpi":
        with _mpi() as pool:
            yield pool
        return
    if "://" not in name:
        raise CaseError(f"--executor '{name}' must be processes, mpi, or the address of a Dask scheduler")
    try:
        from dask.distributed import Client
    except ImportError as error:
        raise CaseError(f"--executor {name} needs Dask ({error}): pip install distributed") from error
    try:
        client = Client(name)
    except (OSError, ValueError) as error:
        raise CaseError(f"no Dask scheduler answers at --executor {name}: {error}") from error
    with client:
        yield client.get_executor()


@contextlib.contextmanager
def _mpi() -> Iterator[Any]:
    """Yield the MPI executor of mpi4py. Raises CaseError if a process is lost.

    Most launchers end all processes when one of them dies. With other launchers, only the communication thread of mpi4py
    fails. This failure interrupts the main thread, which would otherwise wait for the remaining runs forever.
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
    """Interrupt the main thread when another thread fails. Yields the list of the errors, which are not printed."""
    failures: list[BaseException] = []
    original = threading.excepthook

    def record_failure(arguments: threading.ExceptHookArgs) -> None:
        if arguments.exc_value is not None:
            failures.append(arguments.exc_value)
        send_to_main_thread(signal.SIGINT)

    threading.excepthook = record_failure
    try:
        yield failures
    finally:
        threading.excepthook = original


# Arguments for output files and execution.
ARGUMENTS = {
    "--json FILE": "write all numbers",
    "--csv FILE": "write the table",
    "--png FILE": "write a picture",
    "--html FILE": "write a self-contained HTML report",
    "--workers N": (int, "number of processes (default: one per processor; 1: this process)"),
    "--executor WHERE": (
        "processes",
        "processes (default), mpi (start with: mpiexec -n N python -m mpi4py.futures -m fastcontact ...), or the "
        "address of a Dask scheduler such as tcp://host:8786",
    ),
    "--store DIR": "folder of finished runs, which are not repeated when the study is resumed",
}


def check_targets(options: Namespace, *paths: str | None) -> None:
    """Check before a study that its output files and those in `paths` can be written; errors as for `check_outputs`."""
    from fastcontact.cases.case import files_of_case

    check_outputs(files_of_case(options.case), [options.json, options.csv, options.html, *paths], [options.png])


def split(text: str | None) -> list[str] | None:
    """Return the names in a comma-separated text, or None if there is no text."""
    return [name.strip() for name in text.split(",") if name.strip()] if text else None


def run_interruptibly(options: Namespace, study: Callable[..., Any]) -> Any:
    """Run a study on the executor of the options and return its result.

    After an interruption, FastcontactError is raised with a message on how to resume.
    """
    from fastcontact.studies.execute import StudyStatus

    progress = StudyStatus(show=stderr_is_terminal() and not options.quiet)
    try:
        with executor(options.executor) as pool:
            return study(executor=pool, workers=options.workers, store=options.store, on_progress=progress)
    except KeyboardInterrupt:
        text = "stopped; with --store DIR the same command would continue where it stopped"
        if options.store:
            text = f"stopped; the same command continues where it stopped, with the runs in {options.store}"
        raise FastcontactError(text) from None
    finally:
        progress.close()


def report(options: Namespace, result: Any, hint: str, failures: Sequence[str] = (), paths: Sequence[str] = ()) -> int:
    """Write the requested files, print the result and return the exit code.

    The function prints the messages of failed runs (`failures`), the lines of the result and the names of the files.
    `paths` contains the names of files that were written before, and `hint` is printed if no file was written.
    """
    if options.json:
        write_json(options.json, result.as_dict())
    if options.csv:
        from fastcontact.results.tables import write_csv

        write_csv(options.csv, result.table())
    if options.png:
        save(result.figure(), options.png)
    if options.html:
        write_text(options.html, result.html())
    for text in failures:
        say(f"warning: {text}", error=True)
    if not options.quiet:
        say("\n".join(result.lines()))
        file_names = [path for path in (options.json, options.csv, options.png, options.html, *paths) if path]
        say(f"wrote {', '.join(file_names)}" if file_names else f"nothing written: {hint}")
    return 2 if failures else 0
