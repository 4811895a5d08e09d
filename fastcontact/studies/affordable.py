"""Checks, before the first run of a study, that its runs are not too many or too large."""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence

from fastcontact.cases.case import Case
from fastcontact.errors import CaseError
from fastcontact.studies.levels import make_mesh, recipe
from fastcontact.studies.settings import Combination, Settings

log = logging.getLogger("fastcontact")
MOST_RUNS = 100_000
# Peak memory per unknown of a multigrid analysis with linear hexahedra, which needs the least memory [bytes]. It was measured
# with `fastcontact bench contact`.
BYTES_PER_UNKNOWN = 2500


def check_runs(count: int) -> None:
    """Raise CaseError if a study has more than `MOST_RUNS` runs."""
    if count > MOST_RUNS:
        raise CaseError(f"a study of {count} runs is too large: at most {MOST_RUNS} are possible")
    log.info("%d runs", count)


def check_levels(case: Case, chosen: Settings, members: Sequence[Combination], levels: int) -> None:
    """Raise CaseError if the finest mesh of a study cannot fit into the memory of this machine."""
    memory = _memory()
    for member in members:
        coarsest = make_mesh(recipe(chosen, member.element, 0), case.mesh if chosen.generator is None else None)
        unknowns = [coarsest.n_points * coarsest.dim * 2 ** (coarsest.dim * level) for level in range(levels)]
        fitting = sum(BYTES_PER_UNKNOWN * count <= memory for count in unknowns)
        if fitting < levels:
            raise CaseError(
                f"level {levels - 1} of {member} would have about {unknowns[-1]:.2g} unknowns and take "
                f"{BYTES_PER_UNKNOWN * unknowns[-1] / 1e9:.2g} GB of memory, of which this machine has {memory / 1e9:.2g}: "
                f"give at most {max(fitting, 1)} levels"
            )
        log.info("%s: up to about %d unknowns on level %d", member, unknowns[-1], levels - 1)


def _memory() -> float:
    """Return the physical memory of this machine [bytes], or infinity if it is unknown."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return float("inf")
