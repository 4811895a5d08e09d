"""``fastcontact converge``: mesh-convergence study of a case, on uniform or on adaptive meshes."""

from __future__ import annotations

import dataclasses
from argparse import Namespace
from functools import partial

from fastcontact.cli import _study
from fastcontact.cli._terminal import stderr_is_terminal, warnings_shown
from fastcontact.errors import CaseError

HELP = "mesh-convergence study: orders, limits with error bars, model error and mesh error"
HINT = "--html FILE writes a report"
ARGUMENTS = {
    "case": "case file (TOML); its table [study] defines the meshes",
    "--levels N": (5, "number of meshes (default 5)"),
    "--elements NAMES": "elements to compare, e.g. quad4,quad8, or all",
    "--formulations NAMES": "e.g. node_to_segment,continuous, or all",
    "--quantities NAMES": "further quantities, e.g. C1.stress.yy,C1.displacement.y",
    "adaptive meshes (2D)": {
        "--adaptive QUANTITY": (
            {"nargs": "?", "const": "pressure_max"},
            "refine where the error is large until this quantity is accurate (default pressure_max)",
        ),
        "--tolerance T": (1e-3, "relative error (default 0.001)"),
        "--max-dofs N": (400_000, "largest number of degrees of freedom (default 400000)"),
        "-o --output FILE": "result file of the last mesh, with the error of each cell",
    },
    **_study.ARGUMENTS,
}


def run(options: Namespace) -> int:
    """Run the study, write the requested files and print the results; return 2 if a run failed."""
    from fastcontact.studies.runs import convergence_study

    _study.check_targets(options, options.output)
    if options.adaptive:
        return _run_adaptive(options)
    elements, formulations, quantities = map(_study.split, (options.elements, options.formulations, options.quantities))
    study_of_case = partial(convergence_study, options.case, options.levels, elements, formulations)
    study = _study.run_interruptibly(options, partial(study_of_case, quantities=quantities or ()))
    failures = [text for series in study.series for text in series.failed.values()] + list(study.failed.values())
    return _study.report(options, study, HINT, failures)


def _run_adaptive(options: Namespace) -> int:
    """Run an adaptive study, write the requested files and print the table; return 2 if the tolerance is not met."""
    from fastcontact.studies.adaptive import adaptive_study

    with warnings_shown():
        study = adaptive_study(
            options.case,
            options.adaptive,
            options.tolerance,
            element=_single_name(options.elements, "element"),
            formulation=_single_name(options.formulations, "formulation"),
            max_dofs=options.max_dofs,
            progress=stderr_is_terminal() and not options.quiet,
        )
    if options.output:
        from fastcontact.results.writer import ResultWriter

        with ResultWriter(options.output, study.case.model, case_text=study.text, cell_fields=("error",)) as out:
            out.write(dataclasses.replace(study.last, cell_fields={"error": study.error.cells}))
    _study.report(options, study, HINT, paths=[options.output])
    return 0 if study.reached else 2


def _single_name(text: str | None, option: str) -> str | None:
    """Return the only name in a string, or None if there is none. Raises CaseError if there are several names."""
    names = _study.split(text) or []
    if len(names) > 1:
        raise CaseError(f"adaptive refinement takes one {option}, not {len(names)}: {text}")
    return names[0] if names else None
