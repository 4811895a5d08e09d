"""Lower the tolerance of an iterative solver whose solutions leave forces out of balance."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any

from fastcontact.linear.protocol import LinearSolver

log = logging.getLogger("fastcontact")
# Target of the residual relative to its admissible value, and the smallest relative residual that round-off allows.
LEFT, LEAST = 0.1, 1e-15


def tighten(solver: LinearSolver, excess: float) -> bool:
    """Lower the tolerance of `solver`, whose residual exceeds its bound by the factor `excess`; False at the lower limit."""
    tolerance = max(solver.tolerance * LEFT / excess, LEAST)
    if not tolerance < solver.tolerance:
        return False
    log.info(
        "linear solver: forces are out of balance by %.1e times the bound, its tolerance falls from %.1e to %.1e",
        excess, solver.tolerance, tolerance,
    )  # fmt: skip
    solver.asked = solver.tolerance if solver.asked is None else solver.asked
    solver.tolerance = tolerance
    return True


def put_back_tolerance(solver: LinearSolver, snapshot: Mapping[str, Any]) -> None:
    """Restore the tolerance of a snapshot, lowered or not."""
    requested = solver.tolerance if solver.asked is None else solver.asked
    solver.tolerance = snapshot.get("tolerance", requested)
    solver.asked = None if solver.tolerance == requested else requested
