"""``fastcontact run``: solve a case file or an input deck."""

from __future__ import annotations

import dataclasses
import math
import os
import time
from argparse import Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fastcontact.cli._outputs import check_outputs, profile_picture, write_json
from fastcontact.cli._terminal import say, stderr_is_terminal, warnings_shown
from fastcontact.errors import CaseError, ConvergenceError, FileError, ModelError, in_file, warn

if TYPE_CHECKING:
    from fastcontact.cases.case import Case
    from fastcontact.results.step import StepResult
    from fastcontact.results.writer import ResultWriter

HELP = "solve a case file or an input deck (.inp) and write the results of all steps"
# Name of the cell field with the estimated error.
ERROR_FIELD = "error"
# Smallest number of mesh points for which a step is written in the background while the next one is solved.
LARGE_MESH = 30_000
ARGUMENTS = {
    "case": "case file (TOML), the name of a ready-made case (see 'fastcontact cases'), or a deck (.inp)",
    "-o --output OUTPUT": "result file (default: the name of the case with the suffix .vtkhdf, in this folder)",
    "--resume": "continue after the last complete step of the result file, if there is one",
    "--json FILE": "write a summary of the last step and the iterations, or the reason why the run failed",
    "--plot PNG": "plot the contact pressure of the last step, compared with theory",
    "--modes FILE": "write the natural modes of the state of the last step (.vtkhdf)",
    "--nodal-diameters N[,N...]": "nodal diameters of the modes of a cyclic sector, such as 0,1,2, or all; mode shapes are "
    "those of the full ring",
    "--linear SOLVER": "auto, direct, amg, cholmod or pyamg (default: that of the case)",
    "--estimate-error": "estimate the error of each cell and write it to the result file",
    "--strict": "exit with code 3 if a check of the case fails",
    "--threads N": (int, "number of threads of parallel kernels"),
}


def run(options: Namespace) -> int:
    """Solve the case, write the requested files and print the summary."""
    from fastcontact._jit import decorators
    from fastcontact.cases import summary
    from fastcontact.cases.case import case_path, files_of_case, read_case

    start_time = time.perf_counter()
    if options.threads is not None:
        limit = os.cpu_count() or 1
        if not 1 <= options.threads <= limit:
            raise CaseError(f"--threads {options.threads} must lie between 1 and {limit}, the number of processors")
        decorators.set_threads(options.threads)
    output = Path(options.output or f"{case_path(options.case).stem}.vtkhdf")
    check_outputs(files_of_case(options.case), [output, options.json, options.modes], [options.plot])
    with warnings_shown() as setup_warnings:
        case = read_case(options.case)
        read_end = time.perf_counter()
        with in_file(case_path(options.case)):  # checks the model before existing results are replaced
            new_steps = None if options.resume else _new_steps(options, case)
            if new_steps is None:
                case.model.check(case.ramp)
            if case.deck is None and "study" in case.text:
                from fastcontact.studies.checks import check_study

                check_study(case)
    with warnings_shown() as run_warnings:
        run_warnings += setup_warnings
        n_done, stored_warnings, last, steps = _write_steps(options, case, output, new_steps)
    texts = list(dict.fromkeys([*stored_warnings, *run_warnings]))
    natural_modes = _modes(options, case, last)
    timings = {"read": read_end - start_time, "solve": time.perf_counter() - read_end, "cpu": time.process_time()}
    report = summary.summarise(case, last, steps, timings, texts, natural_modes)
    if options.json:
        write_json(options.json, report)
    if options.plot:
        profile_picture(case, last, options.plot)
    for text in texts:
        if text not in run_warnings:  # warnings of steps from an earlier run
            say(f"warning: {text}", error=True)
    if not options.quiet:
        say("\n".join(summary.lines(report)))
        other_files = [path for path in (options.json, options.plot, options.modes) if path]
        say(f"  {_files_message(output, n_done, len(steps), other_files)}")
    failed = [check["name"] for check in report["checks"] if not check["passed"]]
    if options.strict and failed:
        say(f"{len(failed)} of {len(report['checks'])} checks of the case failed: {', '.join(failed)}", error=True)
        return 3
    return 0


def _modes(options: Namespace, case: Case, last: StepResult) -> Any:
    """Return the natural modes that the case or the command requests, and write them to the file of ``--modes``."""
    arguments = {**(case.modes or {}), **_diameters(options.nodal_diameters)}
    if case.modes is None and not options.modes and not arguments:
        return None
    from fastcontact.analysis.modes import modes
    from fastcontact.results.writer import ResultWriter

    result = modes(case.model, last, **{"linear_solver": options.linear or case.linear_solver, **arguments})
    if options.modes:
        shapes, shape_model = (result, case.model) if result.twins is None else (result.whole_ring(),) * 2
        with ResultWriter(options.modes, shape_model, case_text=case.text) as writer:
            for mode in shapes:
                writer.write(mode)
    return result


def _diameters(text: str | None) -> dict[str, Any]:
    """Return the argument of `fastcontact.modes` for a string such as ``0,1,2`` or ``all``; CaseError for other strings."""
    if text is None:
        return {}
    try:
        return {"nodal_diameters": text if text == "all" else [int(number) for number in text.split(",")]}
    except ValueError:
        raise CaseError(f"--nodal-diameters {text}: write integers separated by commas, or all") from None


def _new_steps(options: Namespace, case: Case, earlier_steps: Sequence[StepResult] = ()) -> Iterator[StepResult]:
    """Check the model, and return an iterator that computes the steps that follow `earlier_steps`."""
    from fastcontact.analysis.run import solve_steps

    settings = {**case.solve_arguments, "linear_solver": options.linear or case.linear_solver}
    return solve_steps(case.model, case.ramp, **settings, resume=earlier_steps)


def _write_steps(
    options: Namespace, case: Case, output: Path, new_steps: Iterator[StepResult] | None
) -> tuple[int, list[str], Any, list[dict[str, Any]]]:
    """Compute and write all steps in `new_steps`, or the remaining steps of a resumed run.

    Returns the number of earlier steps in a resumed file, their warnings, the last step, and the summaries of all steps.
    """
    from fastcontact.analysis.progress import Progress
    from fastcontact.analysis.restart import remaining
    from fastcontact.cases.summary import step_entry
    from fastcontact.results.step import warnings_of_run
    from fastcontact.results.writer import ResultWriter

    if options.estimate_error:
        from fastcontact.studies.error_norms import estimate_error
    fields = (ERROR_FIELD,) if options.estimate_error else ()
    settings = {"cell_fields": fields, "resume": options.resume, "background": case.model.mesh.n_points >= LARGE_MESH}
    with ResultWriter(output, case.model, case_text=case.text, **settings) as writer:
        _check_same_case(case, writer.done, output)
        last = writer.done[-1] if writer.done else None
        # Each step is read only once.
        earlier = [(step_entry(step), warnings_of_run(step.warnings, step.iterations)) for step in writer.done]
        steps = [summary for summary, _ in earlier]
        _warn_of_steps_outside_ramp(case, [summary["load_factor"] for summary in steps], output)
        total = len(steps) + len(remaining(case.ramp, last))
        progress = Progress(total, show=stderr_is_terminal() and not options.quiet, done=len(steps))
        try:
            for last in new_steps or _new_steps(options, case, writer.done):
                last = case.finished(last)
                cell_fields = {ERROR_FIELD: estimate_error(case.model, last).cells} if fields else {}
                writer.write(dataclasses.replace(last, cell_fields=cell_fields) if fields else last)
                steps.append(step_entry(last))
                progress.step(last, writer.n_steps)  # n_steps excludes steps that are still being written
            writer.wait()
        except (ConvergenceError, KeyboardInterrupt) as error:
            _add_note(error, writer, output, options.json)
            raise
        finally:
            progress.close()
    return len(earlier), list(dict.fromkeys(text for _, texts in earlier for text in texts)), last, steps


def _add_note(error: BaseException, writer: ResultWriter, output: Path, summary_path: str | None) -> None:
    """Add a note on the number of complete steps to an error, and write error and number to the file `summary_path`."""
    try:
        writer.wait()
    except FileError as failure:
        error.add_note(str(failure))
    steps = "one complete step" if writer.n_steps == 1 else f"all {writer.n_steps} complete steps"
    content = f"keeps {steps}: 'fastcontact run --resume' continues from there"
    error.add_note(f"'{output}' {content if writer.n_steps else 'contains no complete step'}")
    if summary_path:  # replaces the summary of an earlier run
        reason = str(error) or "interrupted from the keyboard"
        write_json(summary_path, {"failed": reason, "complete_steps": writer.n_steps})


def _check_same_case(case: Any, earlier_steps: Sequence[Any], output: Path) -> None:
    """Raise ModelError if the steps from which a run is resumed belong to another case."""
    from fastcontact.analysis import restart

    if earlier_steps:
        try:
            restart.check(earlier_steps[-1], restart.identity(case.model, case.ramp, case.criteria), case.model)
        except ModelError as error:
            raise ModelError(f"'{output}' cannot be resumed: {error}") from error


def _warn_of_steps_outside_ramp(case: Case, factors: Sequence[float], output: Path) -> None:
    """Warn if a step in the result file has a load factor that the ramp of the case does not contain."""
    instants = case.ramp.instants
    extra = [factor for factor in factors if not any(math.isclose(factor, t, rel_tol=1e-9) for t in instants)]
    if extra:
        warn(
            f"'{output}' contains {len(factors)} steps, but the case now has {len(instants)}: those in the file are kept, "
            f"including that at load factor {extra[0]:g}, which the case lacks; without --resume all steps are solved again"
        )


def _files_message(output: Path, n_done: int, total: int, other_files: list[str]) -> str:
    """Return a message on the files written, with the number of steps `n_done` before the run."""
    if n_done == total:
        message = f"{output} was already complete with {total} steps, so no step was solved"
        return "; wrote ".join([message, ", ".join(other_files)] if other_files else [message])
    resumed = f" (resumed after step {n_done})" if n_done else ""
    return f"wrote {', '.join([f'{output}{resumed}', *other_files])}"
