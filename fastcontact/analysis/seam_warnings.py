"""Warnings about contact at the ends of a part that repeats itself."""

from __future__ import annotations

import numpy as np

from fastcontact.analysis.problem import Problem
from fastcontact.results.step import StepResult

# Pressures of the two nodes of one place differ by this part of the largest pressure where their split is arbitrary.
APART = 0.02


def seam_warnings(problem: Problem, last: StepResult) -> list[str]:
    """Return a warning for each contact whose pressures differ at nodes that a period or a sector ties to each other.

    Their gaps are then one and the same condition, which fixes the sum of their forces alone.
    """
    found = []
    for name, contact in last.contact.items():
        largest = contact.pressure_max
        if problem.pairs[name].options.gap_only or not largest > 0.0:
            continue
        pressure = np.full(problem.model.mesh.n_points, np.nan)
        pressure[contact.points] = contact.pressure
        for seam in problem.model.seams:
            apart = np.abs(pressure[seam.first] - pressure[seam.second])
            apart = np.where(np.isfinite(apart), apart, 0.0)
            wrong = apart > APART * largest
            if wrong.any():
                worst = int(np.argmax(apart))
                found.append(
                    f"contact '{name}' is closed where a period or sector begins and ends: at {int(wrong.sum())} places its "
                    f"pressures differ between the two nodes of one place, by up to {apart[worst]:.4g} (points "
                    f"{seam.first[worst]} and {seam.second[worst]}). Only their forces together are right, and those of "
                    "neighbours of a continuous contact may waver: let the period end where the contact is open"
                )
    return found
