"""What the commands that make many runs share: their arguments, progress, and files to write."""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from fastcontact.cli._outputs import check_outputs
from fastcontact.errors import CaseError, FileError


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the files to write and how to run."""
    parser.add_argument("--json", metavar="FILE", help="write all numbers")
    parser.add_argument("--csv", metavar="FILE", help="write the table")
    parser.add_argument("--png", metavar="FILE", help="write a picture")
    parser.add_argument("--html", metavar="FILE", help="write a report in one file, pictures inside")
    parser.add_argument("--workers", type=int, metavar="N", help="processes (default: one a processor; 1: this one)")
    parser.add_argument(
        "--executor",
        default="processes",
        metavar="WHERE",
        help="processes (default), mpi (start with: mpiexec -n N python -m mpi4py.futures -m fastcontact ...), or the "
        "address of a Dask scheduler such as tcp://host:8786",
    )
    parser.add_argument("--store", metavar="DIR", help="folder of finished runs: started again, these are not redone")


def check_targets(options: argparse.Namespace) -> None:
    """Refuse files that cannot be written, before anything runs.

    Raises
    ------
    FileError, FastcontactError
        See `check_outputs`.
    """
    check_outputs(options.case, [options.json, options.csv, options.html], [options.png])


def names(text: str | None) -> list[str] | None:
    """Return names separated by commas."""
    return [name.strip() for name in text.split(",") if name.strip()] if text else None


class Lines:
    """Progress on a terminal: one line that says what has ended, what is left, and for how long."""

    def __init__(self, show: bool) -> None:
        self._show = show
        self._started = time.perf_counter()
        self._stored = 0

    def __call__(self, progress: Any) -> None:
        """Redraw after a run."""
        self._stored += progress.stored
        fresh = progress.done - self._stored
        if not self._show:
            return
        outcome = "failed" if progress.error else "found in the store" if progress.stored else "done"
        left = ""
        if fresh and progress.left:
            seconds = (time.perf_counter() - self._started) / fresh * len(progress.left)
            left = f", {len(progress.left)} left: about {seconds:.0f} s"
        sys.stderr.write(f"\r{f'{progress.done}/{progress.total} {progress.label} {outcome}{left}':<100}")
        sys.stderr.flush()

    def close(self) -> None:
        """Clear the line."""
        if self._show:
            sys.stderr.write("\r" + " " * 100 + "\r")
            sys.stderr.flush()


@contextlib.contextmanager
def executor(where: str) -> Iterator[Any]:
    """Give an executor to run on, None for processes of this machine, and shut it down at the end.

    Raises
    ------
    CaseError
        If the library for it is not installed, nothing answers at the address, or the word is unknown.
    """
    if where == "processes":
        yield None
        return
    if where == "mpi":
        try:
            from mpi4py.futures import MPIPoolExecutor
        except ImportError as error:
            raise CaseError(f"--executor mpi needs mpi4py ({error}): pip install mpi4py") from error
        with MPIPoolExecutor() as pool:
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


def stopped(options: argparse.Namespace) -> str:
    """Return what to say after an interruption."""
    if options.store:
        return f"stopped; the same command goes on where it stopped, with the runs in {options.store}"
    return "stopped; with --store DIR the same command would go on where it stopped"


def write(options: argparse.Namespace, result: Any, save: Callable[[Any, str], None]) -> list[str]:
    """Write what was asked for and return the paths."""
    if options.json:
        text(options.json, json.dumps(result.as_dict(), indent=2) + "\n")
    if options.csv:
        from fastcontact.results.tables import write_csv

        write_csv(options.csv, result.table())
    if options.png:
        save(result.figure(), options.png)
    if options.html:
        text(options.html, result.html())
    return [path for path in (options.json, options.csv, options.png, options.html) if path]


def text(path: str, content: str) -> None:
    """Write a text file.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    try:
        Path(path).write_text(content, encoding="utf-8")
    except OSError as error:
        raise FileError(f"cannot write '{path}': {error.strerror}") from error
