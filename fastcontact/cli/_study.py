"""Common parts of the commands for studies: arguments, executors, interruption and output files."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from typing import Any

from fastcontact.cli._arguments import Arguments
from fastcontact.cli._executor import executor
from fastcontact.cli._outputs import check_outputs, save, write_json, write_text
from fastcontact.cli._terminal import say, somebody_watches
from fastcontact.errors import FastcontactError

# Arguments for output files and execution.
ARGUMENTS: Arguments = {
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


def check_targets(options: argparse.Namespace, *also: str | None) -> None:
    """Check before the study that its output files can be written; errors as for `check_outputs`."""
    from fastcontact.cases.case import files_of_case

    check_outputs(files_of_case(options.case), [options.json, options.csv, options.html, *also], [options.png])


def names(text: str | None) -> list[str] | None:
    """Return the names in a comma-separated text, or None for None and an empty text."""
    return [name.strip() for name in text.split(",") if name.strip()] if text else None


def finished(options: argparse.Namespace, study: Callable[..., Any]) -> Any:
    """Run a study on the executor of the options and return its result.

    After an interruption, FastcontactError is raised with a message on how to resume.
    """
    from fastcontact.studies.progress import Runs

    progress = Runs(show=somebody_watches() and not options.quiet)
    try:
        with executor(options.executor) as where:
            return study(executor=where, workers=options.workers, store=options.store, on_progress=progress)
    except KeyboardInterrupt:
        raise FastcontactError(stopped(options)) from None
    finally:
        progress.close()


def stopped(options: argparse.Namespace) -> str:
    """Return the message after an interruption."""
    if options.store:
        return f"stopped; the same command continues where it stopped, with the runs in {options.store}"
    return "stopped; with --store DIR the same command would continue where it stopped"


def report(
    options: argparse.Namespace, result: Any, hint: str, failures: Sequence[str] = (), also: Sequence[str] = ()
) -> int:
    """Write the files of the options and return the exit code.

    The messages of failed runs, the lines of the result and the names of the files are printed. `also` are the names of files
    written earlier. The `hint` is printed if no file was written.
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
        written = [path for path in (options.json, options.csv, options.png, options.html, *also) if path]
        say(f"wrote {', '.join(written)}" if written else f"nothing written: {hint}")
    return 2 if failures else 0
