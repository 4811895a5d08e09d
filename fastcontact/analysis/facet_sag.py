"""Warnings about straight facets on curved surfaces: the estimated error in pressure due to their sag.

An error of the gap of up to the sag h of the chords changes strains by the order of h / L, and pressures by E h / L with
Young's modulus E, whatever the interference. This estimate is heuristic and calibrated below. L is the length of the
facets if both sides have non-matching facets, and the length of the contact if the other side is an exact rigid shape.
"""

from __future__ import annotations

import numpy as np

from fastcontact.analysis.problem import Problem
from fastcontact.analysis.state import State
from fastcontact.arrays import Array, Mask
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.integration import fine_rule
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.pairing import Candidates
from fastcontact.contact.surface_smoothing import Smoothing, frames
from fastcontact.results.step import ContactResult, StepResult

# Estimated error over the mean pressure above which a warning is given, by the order of facets. On rings the errors of nodal
# pressures were 0.02 to 0.5 of the estimate on linear facets and up to 3 on quadratic ones; against rigid shapes 1.1 to 1.3.
DOUBTFUL, AGAINST_RIGID = {1: 0.5, 2: 0.1}, 0.2


def sag_warnings(problem: Problem, state: State, last: StepResult) -> dict[str, str]:
    """Return, by name, a warning for each pair with a large pressure error due to sag in the `last` step."""
    warnings, load, displacement = {}, problem.load_at(last.load_factor), problem.displacement(state.u)
    for name, pair in problem.pairs.items():
        contact = last.contact[name]
        corrected = pair.smoothing is not None or not isinstance(pair.normals, str)
        if corrected or pair.options.tied or pair.options.gap_only or not (contact.pressure > 0.0).any():
            continue
        at = problem.configuration(name, state, load, displacement, state.u)
        off = _sag_at_points(pair, at, contact.active)
        text = _text(pair, float(np.ptp(off)), contact) if len(off) else ""
        if text:
            warnings[name] = f"contact '{name}': {text}"
    return warnings


def _text(pair: Formulation, spread: float, contact: ContactResult) -> str:
    """Return a warning about the pressure error due to a `spread` of the sag [length]; an empty string if it is small."""
    side, order = pair.secondary, pair.secondary.order
    size = float(
        np.median(np.concatenate([np.linalg.norm(np.ptp(pair.points[b.facets], axis=1), axis=1) for b in side.blocks]))
    )
    doubtful, length, power = DOUBTFUL[order], size, 2 * order - 1
    remedy = "surface_smoothing=True measures the gap between the arcs"
    if isinstance(pair.primary, RigidSide):
        doubtful, power = AGAINST_RIGID, 2 * order
        length = float(np.linalg.norm(np.ptp(pair.points[side.points[contact.active]], axis=0)))
        remedy = "formulation 'node_to_segment' measures the gap at nodes, which lie on the arc"
    mean = float(contact.pressure[contact.pressure > 0.0].mean())
    error = pair.modulus * spread / max(length, size)
    if error <= doubtful * mean:
        return ""
    finer = f"facets of length {size * (doubtful * mean / error) ** (1.0 / power):.2g} instead of {size:.2g}"
    return (
        f"facets of '{side.group}' and of the other side deviate from their arcs by up to {spread:.3g}, which may change "
        f"pressures by about {error:.3g}, compared with a mean of {mean:.3g}: {remedy}; "
        f"{'quadratic elements, or ' if order == 1 else ''}{finer} reduce the error"
    )


def _sag_at_points(pair: Formulation, at: Configuration, active: Mask) -> Array:
    """Return the sag of closed facets at the points where their gap is evaluated (n,) [length]."""
    points, deformed, closed = _points(pair), pair.points + at.displacement, np.zeros(len(pair.points), bool)
    closed[pair.secondary.points[active]] = True
    if isinstance(pair.primary, RigidSide):
        rows = np.flatnonzero(closed[points.nodes].all(axis=1))
        nodes, pose = points.nodes[rows], at.pose
        at_nodes = pair.primary.facing(deformed[nodes].reshape(-1, deformed.shape[1]), pose)[0].reshape(nodes.shape)
        inside = pair.primary.facing(points.positions(deformed)[rows], pose)[0]
        faced = np.isfinite(at_nodes).all(axis=1) & np.isfinite(inside)  # gaps are infinite beyond the edge of a punch
        return np.einsum("nk,nk->n", points.shape[rows[faced]], at_nodes[faced]) - inside[faced]
    smoothing, facing = Smoothing.of(pair.secondary, pair.primary, pair.points), pair.facing(points, at)
    rows = np.flatnonzero(facing.paired & closed[points.nodes].any(axis=1))
    if smoothing is None or points.facet is None or points.xi is None:
        return np.empty(0)
    axes = [frames(side, pair.points, deformed) for side in (pair.secondary, pair.primary)]
    return smoothing.overlap((points.facet[rows], points.xi[rows]), (facing.facet[rows], facing.xi[rows]), axes)


def _points(pair: Formulation) -> Candidates:
    """Return the points of the secondary side where the gap is evaluated: nodes alone, or points inside facets as well."""
    if pair.name == "node_to_segment":
        return Candidates.nodes_of(pair.secondary)
    return Candidates.inside(pair.secondary, [fine_rule(block.element)[0] for block in pair.secondary.blocks])
