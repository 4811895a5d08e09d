"""Mesh-convergence study of FORMA04 C in one process, by number of levels, in units of its coarsest mesh alone."""

from pathlib import Path

from fastcontact.studies.runs import convergence_study

SIZES = (500, 2_000, 8_000)
CASE = Path(__file__).resolve().parents[2] / "data" / "cases" / "forma04c.toml"


def works(size):
    levels = 2 + sum(size >= bound for bound in SIZES[1:])
    study = convergence_study(CASE, levels, ["quad4"], workers=1)
    return study.series[0].levels[-1].n_dofs, {
        "study": lambda: convergence_study(CASE, levels, ["quad4"], workers=1),
        "one level": lambda: convergence_study(CASE, 1, ["quad4"], workers=1),
    }
