"""Contact at the ends of a period or cyclic sector, where two nodes represent one material point.

Their gaps are one condition (`shared_nodes`) or one value of a pressure field, which only determines the sum of their forces.
Their common traction is the sum of both forces over the sum of both areas.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fastcontact.analysis.problem import Problem
from fastcontact.arrays import Indices
from fastcontact.contact.integration import lumped_areas
from fastcontact.model.periodicity import PeriodicInterface
from fastcontact.results.step import ContactResult


def joined(problem: Problem, results: dict[str, ContactResult]) -> dict[str, ContactResult]:
    """Return the results of contact pairs with one traction for both nodes of a point, closed if one of them is."""
    results_of_pairs = dict(results)
    for name, contact in results.items() if problem.model.periodic_interfaces else ():
        pair = problem.pairs[name]
        areas = lumped_areas(pair.secondary, pair.points, pair.axisymmetric)
        pressure, shear, active = contact.pressure.copy(), contact.shear.copy(), contact.active.copy()
        for interface in problem.model.periodic_interfaces:
            a, b = _rows(problem, contact, interface)
            share = areas[a] / (areas[a] + areas[b])
            turn = np.eye(shear.shape[1]) if interface.turn is None else interface.turn
            pressure[a] = pressure[b] = share * pressure[a] + (1.0 - share) * pressure[b]
            shear[a] = share[:, None] * shear[a] + (1.0 - share[:, None]) * (shear[b] @ turn)
            shear[b] = shear[a] @ turn.T
            active[a] = active[b] = active[a] | active[b]
        results_of_pairs[name] = replace(contact, pressure=pressure, shear=shear, active=active)
    return results_of_pairs


def _rows(problem: Problem, contact: ContactResult, interface: PeriodicInterface) -> tuple[Indices, Indices]:
    """Return the rows of a contact that belong to the two nodes of one point."""
    row = np.full(problem.model.mesh.n_points, -1, np.intp)
    row[contact.points] = np.arange(len(contact.points))
    both = (row[interface.first] >= 0) & (row[interface.second] >= 0)
    return row[interface.first[both]], row[interface.second[both]]
