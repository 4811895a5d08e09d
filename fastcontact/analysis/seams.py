"""Contact at the ends of a period or cyclic sector, where two nodes represent one material point.

Their gaps are one and the same condition (`shared_nodes`) or one value of a field of pressures, which fixes the sum of their
forces alone. Their traction is that of the place: the sum of both forces over both areas.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fastcontact.analysis.problem import Problem
from fastcontact.arrays import Indices
from fastcontact.contact.integration import lumped_areas
from fastcontact.model.periodicity import Seam
from fastcontact.results.step import ContactResult


def joined(problem: Problem, results: dict[str, ContactResult]) -> dict[str, ContactResult]:
    """Return the results of contact pairs with one traction for both nodes of a point, closed where one of them is."""
    found = dict(results)
    for name, contact in results.items() if problem.model.seams else ():
        pair = problem.pairs[name]
        areas = lumped_areas(pair.secondary, pair.points, pair.axisymmetric)
        pressure, shear, active = contact.pressure.copy(), contact.shear.copy(), contact.active.copy()
        for seam in problem.model.seams:
            a, b = _rows(problem, contact, seam)
            part, turn = areas[a] / (areas[a] + areas[b]), np.eye(shear.shape[1]) if seam.turn is None else seam.turn
            pressure[a] = pressure[b] = part * pressure[a] + (1.0 - part) * pressure[b]
            shear[a] = part[:, None] * shear[a] + (1.0 - part[:, None]) * (shear[b] @ turn)
            shear[b] = shear[a] @ turn.T
            active[a] = active[b] = active[a] | active[b]
        found[name] = replace(contact, pressure=pressure, shear=shear, active=active)
    return found


def _rows(problem: Problem, contact: ContactResult, seam: Seam) -> tuple[Indices, Indices]:
    """Return the rows of a contact that belong to the two nodes of one point."""
    row = np.full(problem.model.mesh.n_points, -1, np.intp)
    row[contact.points] = np.arange(len(contact.points))
    both = (row[seam.first] >= 0) & (row[seam.second] >= 0)
    return row[seam.first[both]], row[seam.second[both]]
