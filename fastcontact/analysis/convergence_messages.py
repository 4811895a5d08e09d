"""Messages of load steps that do not converge: the cause, with its nodes, and the remedy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fastcontact.analysis.criteria import NOTABLE
from fastcontact.analysis.floating_bodies import FloatingBodies, RigidPosition
from fastcontact.analysis.problem import Problem
from fastcontact.analysis.solution import Solution
from fastcontact.analysis.state import State
from fastcontact.analysis.tolerances import DECLINE, WINDOW
from fastcontact.arrays import Array, Indices, largest
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import StackedConstraints
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.elasticity.nonlinear_bodies import PLASTIC_STRAIN
from fastcontact.elasticity.nonlinear_materials import LARGEST_PLASTIC_STRAIN
from fastcontact.mesh.mesh import Mesh
from fastcontact.model.rigid_motions import NEARLY_SLIDING, grouped_by_body, least_restrained
from fastcontact.round_off import SINGLE_PRECISION

Nodes = dict[str, list[int]]


def geometry_not_converged(problem: Problem, history: list[dict[str, Any]], change: Array, limit: int) -> str:
    """Return the message for a contact geometry that did not converge.

    `change` (n_dofs,) is the change of the displacements in the last update [length]. The nodes with the largest changes, by
    pair in descending order, are added to the last entry of the history.
    """
    last = history[-1]
    magnitude = np.linalg.norm(change.reshape(problem.shape), axis=1)
    sides = {name: pair.secondary.points for name, pair in problem.pairs.items()}
    nodes = {name: points[np.argsort(-magnitude[points], kind="stable")[:3]].tolist() for name, points in sides.items()}
    last["nodes"] = dict(sorted(nodes.items(), key=lambda item: -magnitude[item[1][0]]))
    changes = [entry["displacement_change"] for entry in history]
    decreasing = len(changes) <= WINDOW or min(changes[-WINDOW:]) <= DECLINE * min(changes[:-WINDOW])
    size = changes[-1] if decreasing else max(changes[-WINDOW:])
    # Changes need not decrease while a crack grows through a cohesive layer.
    layers = [pair for pair in problem.pairs.values() if pair.options.cohesion is not None]
    more = ["more updates (Criteria.max_geometry_updates)"] if decreasing or layers else []
    advice = [*more, *_advice_for_pairs(problem, last["nodes"])]
    advice.append("a fixed number of updates (Criteria.geometry_updates)")
    if float(f"{size:.0e}") < NOTABLE:  # otherwise `Criteria` refuses it
        criterion = f"Criteria.geometry, which is {problem.criteria.geometry:g}, above {size:.0e}"
        advice.append(f"accept changes of that size ({criterion})")
    remedies = " or ".join(filter(None, [", ".join(advice[:-1]), advice[-1]]))
    return (
        f"the contact geometry did not converge in {limit} updates: the displacement still changes by "
        f"{changes[-1]:.1e} of its largest component, most at "
        f"{named_nodes(problem, last['nodes'])}, {last['active']} constraints are active. "
        f"{'' if decreasing else 'These changes do not decrease. '}Use {remedies}"
    )


def active_set_cycles(
    problem: Problem, constraints: StackedConstraints, solution: Solution, history: list[dict[str, Any]]
) -> str:
    """Return the message for an active set that did not converge, and add the nodes that change to the last entry."""
    changed = np.flatnonzero(solution.active != solution.next_active)
    nodes, count = nearest_nodes(problem, constraints, changed), len(changed)
    history[-1]["nodes"] = nodes
    if constraints.tangents:
        return (
            f"contact with friction did not converge in {solution.iterations} Newton iterations from several starts: the "
            f"residual of its equations is {solution.residual:.1e} of the largest force. With the coefficient of friction "
            f"{constraints.friction.max():g} there may be no solution: use less friction"
        )
    constraints_text = "1 constraint still changes" if count == 1 else f"{count} constraints still change"
    cause = f"{constraints_text}, at {named_nodes(problem, nodes)}" if count else "directions of slip still change"
    remedy = "the direct linear solver or " if problem.solver.iterative else ""
    return (
        f"the active set did not converge in {solution.iterations} iterations: {cause}. Use {remedy}more "
        "iterations (max_active_set_iterations)"
    )


def friction_exceeded(factor: float, bodies: list[str], coefficients: Array, at_least: bool = False) -> str:
    """Return the message for loads under which friction cannot hold `bodies`.

    To hold the bodies, the friction `coefficients` would have to be `factor` times as large, or `at_least` so if the factor
    is that of the most favourable distribution of the normal forces.
    """
    distinct = np.unique(coefficients[coefficients > 0.0])
    numbers = (factor, 1.0), (factor * distinct[0], distinct[0])  # which the message must distinguish
    digits = next((n for n in range(3, 12) if all(f"{a:.{n}g}" != f"{b:.{n}g}" for a, b in numbers)), 12)
    bound = "at least" if at_least else "about"
    needed = (
        f"a coefficient of {bound} {factor * distinct[0]:.{digits}g} where the largest is {distinct[0]:.{digits}g}"
        if np.isclose(distinct[0], distinct[-1])
        else f"{bound} {factor:.{digits}g} times the coefficients given, from {distinct[0]:.3g} to {distinct[-1]:.3g}"
    )
    verb, elastic_remark = "cannot hold", ""
    if factor < 1.0:
        verb, elastic_remark = "hardly holds", ", if the bodies were rigid, and more for elastic bodies"
    return (
        f"friction {verb} {', '.join(bodies)} against the loads: this would require {needed}{elastic_remark}. Lower "
        "the loads along the contact, press harder, or support the bodies along the contact"
    )


def not_restrained(bodies: FloatingBodies, rigid: RigidPosition, load: float, friction: bool, gaps: Array) -> str:
    """Return the message for floating bodies whose springs still carry forces.

    Parameters
    ----------
    bodies : FloatingBodies
    rigid : RigidPosition
        The last position of the bodies.
    load : float
        Generalised load; zero if only obstacles, prescribed displacements or fluid pressures in contacts act [force].
    friction : bool
        Whether contact has friction.
    gaps : ndarray (m, k)
        Changes of the gaps in each free motion, which show whether contact hardly resists one of the motions [-].
    """
    if len(bodies.dofs) > 1:
        weakest, ratio = least_restrained(bodies.motions, gaps)
        if ratio < NOTABLE:
            return (
                f"contact hardly resists one motion, {weakest}, which changes the gaps {ratio:.1g} times as much as other "
                "motions: fix or prescribe a displacement component that stops it"
            )
    remedy = "Add a support or more friction, for which the loads may be too large" if friction else "Add a support"
    return (
        f"contact does not hold {grouped_by_body(bodies.moving(rigid))}: after {rigid.positions} trial "
        f"positions, a force of {np.abs(rigid.spring_force).max():.3g} is still missing for equilibrium"
        f"{f' under a load of {load:.3g}' if load else ''}. {remedy}"
    )


def limit_load_note(problem: Problem, state: State) -> str:
    """Return the end of the message of a load step that fails after `state` if bodies yield, otherwise an empty string."""
    strain = max((largest(values[..., PLASTIC_STRAIN]) for values in state.history.values()), default=0.0)
    if not strain:
        return ""
    validity = (
        f", beyond the {LARGEST_PLASTIC_STRAIN} up to which linear kinematics are valid: "
        "the model then carries smaller loads than the real body"
        if strain > LARGEST_PLASTIC_STRAIN and problem.model.strain == "small"
        else ""
    )
    return (
        f"; at its beginning, the largest plastic strain is {strain:.2g}{validity}. Bodies that yield may not carry larger "
        "forces: prescribe displacements instead of forces to find the limit load"
    )


def friction_note(problem: Problem, state: State) -> str:
    """Return the end of the message of a load step that fails after `state` if floating bodies nearly slide."""
    if problem.floating_bodies is None:
        return ""
    ratios = []
    for name, forces in state.forces.items():
        pair = problem.pairs[name]
        capacity = float((pair.friction or 0.0) * np.maximum(forces.pressing, 0.0).sum())
        tangential = np.linalg.norm(forces.tangential[pair.secondary.points], axis=1)
        ratios += [float(tangential.sum()) / capacity] if capacity else []
    if not ratios or min(ratios) < NEARLY_SLIDING:
        return ""
    return (
        f"; at its beginning, contact uses {min(ratios):.0%} of its frictional capacity, and larger loads may move "
        f"{', '.join(problem.floating_bodies.motions.by_body())}. Add a support, or prescribe displacements instead of forces"
    )


def fluid_note(problem: Problem, end: float) -> str:
    """Return the end of the message of a load step that fails at the instant `end` if a fluid acts on nonlinear bodies.

    The front of a fluid advances by complete facets. Where a body without friction gives way to the jump of the force, there
    may be no equilibrium, neither with the node at the front wet nor with it dry. The tangent of such a body is not positive
    definite, so that regularised iterations converge slowly, and alternate with each change of the node.
    """
    names = [name for name, pressure in problem.load_at(end).fluids.items() if pressure > 0.0]
    if not names or problem.bodies is None:
        return ""
    return (
        f"; if smaller steps do not help, the cause may be the fluid in contact {', '.join(map(repr, names))}, whose force "
        "jumps where its front advances by a facet: use shorter facets at the front, or friction"
    )


def nearest_nodes(problem: Problem, constraints: StackedConstraints, rows: Indices) -> Nodes:
    """Return by contact pair the secondary nodes nearest to constraints, given by their row numbers over all pairs."""
    nodes: Nodes = {}
    for name, rows_of_pair in constraints.rows.items():
        rows_in_pair = rows[(rows >= rows_of_pair.start) & (rows < rows_of_pair.stop)] - rows_of_pair.start
        if len(rows_in_pair):
            points = problem.pairs[name].secondary.points
            offsets = constraints.parts[name].positions[rows_in_pair][:, None] - problem.model.mesh.points[points][None]
            nodes[name] = np.unique(points[np.linalg.norm(offsets, axis=2).argmin(axis=1)]).tolist()
    return nodes


def named_nodes(problem: Problem, nodes: Mapping[str, list[int]]) -> str:
    """Return a description of nodes by contact pair, with the coordinates of the first three."""
    mesh = problem.model.mesh
    return "; ".join(f"{first_points(mesh, points)} of contact '{name}'" for name, points in nodes.items())


def first_points(mesh: Mesh, points: Sequence[int]) -> str:
    """Return the numbers and coordinates of the first three points of a list, and the number of the others."""
    listed = ", ".join(f"{p} {np.array2string(mesh.points[p], precision=4)}" for p in points[:3])
    return f"points {listed}{f' and {len(points) - 3} more' if len(points) > 3 else ''}"


def _advice_for_pairs(problem: Problem, nodes: Nodes) -> list[str]:
    """Return the remedy for a bilateral pair whose initial gaps exceed round-off, since such pairs close gaps of any width.

    Without such a pair, return remedies for pairs whose constraints may alternate: at the edge of an obstacle, between facets
    at a node, between supports of dual functions, or between branches of a cohesive law. Each remedy is for the first such
    pair in `nodes`, in which displacements change most.
    """
    for name, pair in problem.pairs.items():
        if pair.options.kind == "bilateral":
            gap = pair.nodal_gap(Configuration.undeformed(pair.points))[0]
            widest = float(gap.max(where=np.isfinite(gap), initial=0.0))
            if widest > SINGLE_PRECISION * np.ptp(pair.points, axis=0).max():
                return [f"kind=\"bilateral_once_closed\" for contact '{name}', whose gaps of up to {widest:.3g} close"]
    pairs = {name: problem.pairs[name] for name in nodes}
    rigid = [name for name, pair in pairs.items() if isinstance(pair.primary, RigidSide)]
    edged = [
        name for name in rigid if np.isinf(pairs[name].nodal_gap(Configuration.undeformed(pairs[name].points))[0]).any()
    ]
    between_bodies = {name: pair for name, pair in pairs.items() if len(pair.primary.points)}
    faceted = [name for name, pair in between_bodies.items() if pair.normals == "facet"]
    dual = [name for name, pair in between_bodies.items() if getattr(pair, "multipliers", "") == "dual"]
    laws = {name: pair.options.cohesion for name, pair in pairs.items() if pair.options.cohesion is not None}
    ranges = {name: 2.0 * law.energy / law.strength for name, law in laws.items() if law.reversible}
    pairs_by_remedy = {
        "Criteria(keep_pairing=True), since nodes move past the edge of the obstacle,": edged,
        'normals="averaged"': faceted, 'multipliers="standard"': dual,
        f"facets no longer than the range of adhesion, {min(ranges.values(), default=0.0):.3g},": list(ranges),
        "facets shorter than the cohesive zone": [name for name in laws if name not in ranges],
    }  # fmt: skip
    return [f"{remedy} for contact {names[0]!r}" for remedy, names in pairs_by_remedy.items() if names]
