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
from fastcontact.model.periodicity import PeriodicInterface
from fastcontact.results.step import ContactResult, StepResult

# Pressures of the two nodes of one place differ by this part of the largest pressure where their split is arbitrary.
APART = 0.02


def joined(problem: Problem, results: dict[str, ContactResult]) -> dict[str, ContactResult]:
    """Return the results of contact pairs with one traction for both nodes of a point, closed where one of them is."""
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


def periodicity_warnings(problem: Problem, last: StepResult) -> list[str]:
    """Return a warning for each contact whose forces are split unevenly between the two nodes of a point.

    Formulations with a condition a node know of such nodes (`shared_nodes`), fields of pressures unless tractions turn.
    """
    warnings = []
    for name, contact in last.contact.items():
        largest, pair = contact.pressure_max, problem.pairs[name]
        if pair.options.gap_only or not hasattr(pair, "augmentation") or not largest > 0.0:
            continue
        for interface in problem.model.periodic_interfaces:
            a, b = _rows(problem, contact, interface)
            apart = np.where(contact.active[a], np.abs(contact.multiplier[a] - contact.multiplier[b]), 0.0)
            wrong = apart > APART * largest
            if wrong.any():
                worst = int(np.argmax(apart))
                warnings.append(
                    f"contact '{name}' is closed where a period or sector begins and ends: at {int(wrong.sum())} places its "
                    f"forces are split unevenly between the two nodes of one place, by {apart[worst]:.4g} in pressure "
                    f"(points {contact.points[a[worst]]} and {contact.points[b[worst]]}). Their pressure is the mean, but "
                    "that of neighbours may waver: let the period end where the contact is open, or use "
                    'formulation="mortar" with multipliers="dual"'
                )
    return warnings
