"""Results of contact pairs at the end of a load step: pressures, contact status, forces, friction, centre and width."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array, diags_array, eye_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from fastcontact.analysis.geometry_loop import SettledContact
from fastcontact.analysis.inequalities import StepContext
from fastcontact.analysis.solution import Solution
from fastcontact.analysis.work import ContactForces, contact_work
from fastcontact.arrays import Array, Indices, Mask, Numbers, largest
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.contact_middle import contact_middle
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.integration import lumped_areas, nodes_with_area
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.pair_options import ALWAYS_CLOSED
from fastcontact.contact.pairing import normals
from fastcontact.contact.surface import Surface
from fastcontact.results.step import ContactResult, half_width
from fastcontact.round_off import LENGTH_ROUND_OFF, SUM_ROUND_OFF


def contact_results(
    step: StepContext, settled: SettledContact, u: Array, first_contact: Mapping[str, tuple[Array, Array]]
) -> dict[str, ContactResult]:
    """Return the results of all contact pairs at the end of a load step.

    Parameters
    ----------
    step : StepContext
    settled : SettledContact
    u : ndarray (n_dofs,)
        Displacements at the end of the step [length].
    first_contact : dict of str to (ndarray (dim,), ndarray (dim,))
        See `State.first_contact`.
    """
    problem, displacement, results = step.problem, step.problem.displacement(u), {}
    slip_error = min(problem.criteria.geometry, LENGTH_ROUND_OFF) * max(largest(u), largest(step.state.u))
    for name, (constraints, solution) in settled.parts.items():
        solution = _without_undetermined_slip(constraints, solution, max(slip_error, step.state.gap_round_off))
        configuration = problem.pairing_configuration(name, step.state, step.load, u)
        arguments = constraints, solution, configuration, displacement, first_contact.get(name)
        results[name] = contact_result(name, problem.pairs[name], *arguments)
        if problem.model.periodic_interfaces:
            results[name] = _with_periodic_nodes(problem.pairs[name], results[name])
        if problem.model.strain == "finite":
            results[name] = _on_deformed_surface(problem.pairs[name], results[name], displacement)
    return results


def _without_undetermined_slip(constraints: Constraints, solution: Solution, slip_error: float) -> Solution:
    """Return the solution of a pair in which constraints whose slips in the step do not exceed `slip_error` [length] stick.

    If a constraint has slid in an earlier step and does not slide in this one, its force remains at the limit of friction.
    Whether the law of friction regards it as sticking or sliding then depends on round-off.
    """
    if not constraints.tangents:
        return solution
    at_rest = solution.active & (constraints.friction > 0.0) & (np.linalg.norm(solution.slip, axis=1) <= slip_error)
    return replace(solution, sticking=solution.sticking | at_rest)


def contact_result(
    name: str, pair: Formulation, constraints: Constraints, solution: Solution, configuration: Configuration,
    displacement: Array, axis: tuple[Array, Array] | None,
) -> ContactResult:  # fmt: skip
    """Return the result of one pair at the end of a load step.

    Parameters
    ----------
    name : str
    pair : Formulation
    constraints : Constraints
        Constraints of the pair in the last pairing.
    solution : Solution
        Solution of the pair.
    configuration : Configuration
        Configuration of the last pairing of the step.
    displacement : ndarray (n_points, dim)
        Displacement at which gaps are evaluated [length].
    axis : (ndarray (dim,), ndarray (dim,)), optional
        In 3D, the point of first contact [length] and the normal there [-].
    """
    points = pair.secondary.points
    coordinates = pair.points[points]
    multiplier, active = solution.multiplier, solution.active
    active = active if constraints.wetted is None else active & ~constraints.wetted.rows
    gap, normal = pair.nodal_gap(configuration, displacement=displacement)
    active_gaps = active[: len(constraints.normal_forces(multiplier))]
    closed, pressure, field, scale = _closed_nodes(pair, constraints, multiplier, active_gaps, gap, configuration)
    if pair.options.kind == "tied":  # normals of the undeformed configuration
        normal = pair.nodal_gap(replace(configuration, displacement=np.zeros_like(configuration.displacement)))[1]
    shear, sticking, tangential = _tangential_results(constraints, solution, normal, closed, scale)
    finite_normal = np.where(np.isfinite(normal), normal, 0.0)
    if tangential is not None:
        shear = _within_cone(constraints, shear, pressure, finite_normal, pair.secondary)
    if pair.axisymmetric:  # The radial traction is an odd function of the radius.
        shear[coordinates[:, 0] <= LENGTH_ROUND_OFF * np.ptp(coordinates)] = 0.0
    forces, total, primary_points, primary_forces = _nodal_forces(pair, constraints, multiplier, tangential)
    contact_forces, fluid = forces, dict[str, Any]()
    if pair.options.source is not None:
        contact_forces = _nodal_forces(pair, constraints, constraints.contact_forces(multiplier), tangential)[0]
        fluid_pressure = np.zeros(len(points)) if constraints.wetted is None else constraints.wetted.pressure
        fluid = {"fluid_pressure": fluid_pressure, "fluid_force_vectors": forces - contact_forces}
    middle = contact_middle(pair, finite_normal, np.einsum("nd,nd->n", contact_forces, finite_normal), closed, gap)
    place, tangent = middle.distances(coordinates), middle.tangent
    distances = middle.distances(constraints.positions)
    along_tangent = distances if tangent is None else (constraints.positions - middle.position) @ tangent
    radius = half_width(distances, active, along_tangent)
    stick_bounds, sticking = None, closed & sticking
    if coordinates.shape[1] == 3:
        radius = _radius_in_facets(pair, place, closed, *radius)
        stick_bounds = _radius_in_facets(pair, place, sticking, *half_width(place, sticking))
    abscissa, obstacle_results = pair.secondary.abscissa, dict[str, Any]()
    if axis is not None:  # distance from the axis
        offset = coordinates - axis[0]
        abscissa = np.linalg.norm(offset - (offset @ axis[1])[:, None] * axis[1], axis=1)
    if isinstance(side := pair.primary, RigidSide):
        obstacle_results = {
            "obstacle_displacement": configuration.pose.displacement.copy(),
            "obstacle_angle": None if side.rotation is None else configuration.pose.angle,
            "torque": side.torque(coordinates + configuration.displacement[points], forces, configuration.pose),
        }
    return ContactResult(
        name=name, formulation=pair.name, points=points, coordinates=coordinates, abscissa=abscissa, gap=gap,
        pressure=pressure, multiplier=field, force_vectors=forces, normal=normal, active=closed, force=total, radius=radius,
        shear=shear, sticking=sticking, stick_bounds=stick_bounds, middle=middle.position, place=place, tangent=tangent,
        direction=middle.direction if coordinates.shape[1] == 3 else None,
        primary_points=primary_points, primary_force_vectors=primary_forces, **fluid, **obstacle_results,
    )  # fmt: skip


def _radius_in_facets(pair: Formulation, place: Array, zone: Mask, low: float, high: float) -> tuple[float, float]:
    """Return bounds of the radius of the contact or stick zone in 3D, given the bounds `low` and `high` from nodes [length].

    The edge of the `zone` (n_nodes,) need not be a circle, and it crosses the facets that connect the zone with other nodes.
    `place` (n_nodes,) are the distances of the nodes from the middle [length]. The bounds of a ring are not changed.
    """
    if not zone[place.argmin()]:
        return low, high
    side = pair.secondary
    outside = ~zone & ~pair.excluded[side.points]
    low = min(low, float(place[zone & (side.node_adjacency @ outside > 0)].min(initial=np.inf)))
    return low, max(high, float(place[outside & (side.node_adjacency @ zone > 0)].max(initial=0.0)))


def _nodal_forces(
    pair: Formulation, constraints: Constraints, multiplier: Array, tangential: Array | None
) -> tuple[Array, Array, Numbers, Array]:
    """Return the forces on secondary nodes, their sum, the primary nodes, and the forces on these [force].

    There are no primary nodes if the other side is a rigid obstacle.
    """
    nodal_forces = constraints.force(multiplier, tangential).reshape(-1, pair.points.shape[1])
    opposite = pair.primary.points if isinstance(pair.primary, Surface) else np.empty(0, np.int32)
    forces = np.where(np.isin(pair.secondary.points, opposite)[:, None], 0.0, nodal_forces[pair.secondary.points])
    total = forces.sum(axis=0)
    if pair.axisymmetric:
        total[0] = 0.0  # radial forces cancel over the full circle
    return forces, total, opposite, nodal_forces[opposite]


def _tangential_results(
    constraints: Constraints, solution: Solution, normal: Array, closed: Mask, scale: Array
) -> tuple[Array, Mask, Array | None]:
    """Return nodal shear (n_nodes, dim) [pressure], sticking nodes, and tangential forces (m, k) [force] or None."""
    multiplier, all_nodes = solution.multiplier, np.ones(len(normal), bool)
    if constraints.tied is not None and constraints.tied.directions:
        _, tangential = constraints.tied.forces(multiplier)
        shear = _nodal_shear(constraints, constraints.tied.directions, tangential, normal)
        return np.where(closed[:, None], shear, 0.0), all_nodes, None
    if not constraints.tangents:
        return np.zeros_like(normal), all_nodes, None
    tangential = solution.tangential
    normal_forces = constraints.normal_forces(constraints.contact_forces(multiplier))
    shear = _nodal_shear(constraints, constraints.directions, tangential, normal, normal_forces)
    sticking, pressure = solution.sticking, constraints.pressure(multiplier)
    if len(sticking) != len(pressure):  # a node sticks if most of its pressure is due to sticking constraints
        sticking = constraints.nodal_field.pressure(np.where(sticking, multiplier, 0.0)) > 0.5 * pressure
    elif not constraints.usable.all():
        # A mid-side node without a multiplier sticks if all corners whose forces contribute to its pressure stick.
        forces = np.abs(multiplier)
        total, sliding = map(constraints.nodal_field.pressure, (forces, np.where(sticking, 0.0, forces)))
        sticking = np.where(constraints.usable, sticking, (total > 0.0) & (sliding <= SUM_ROUND_OFF * total))
    return shear * scale[:, None], sticking, tangential


def _closed_nodes(
    pair: Formulation, constraints: Constraints, multiplier: Array, active: Mask, gap: Array,
    configuration: Configuration,
) -> tuple[Mask, Array, Array, Array]:  # fmt: skip
    """Return the closed nodes of a pair, and pressures that integrate to the contact force.

    Returns
    -------
    closed : ndarray of bool (n_nodes,)
        Secondary nodes in contact, due to their pressure or because they cannot separate.
    pressure : ndarray (n_nodes,)
        Pressures at closed nodes [pressure].
    multiplier : ndarray (n_nodes,)
        The pressure field over the whole side [pressure].
    scale : ndarray (n_nodes,)
        Ratio of the reported pressures to the pressures of the formulation at closed nodes, by which tractions are scaled as
        well; zero at open nodes. If the formulation has negative pressures anywhere, the ratio is at most 1, since the
        pressure of the formulation at a node may then nearly vanish [-].
    """
    field, excluded = constraints.nodal_field, pair.excluded[pair.secondary.points]
    forces = constraints.normal_forces(constraints.contact_forces(multiplier))
    side_pressure, covered = field.side_pressure(forces), field.covered
    if pair.options.kind in ALWAYS_CLOSED:
        # Nodes beyond the end of the other side are unpaired, but parts of their facets may face it.
        closed = np.isfinite(gap) if isinstance(covered, float) else np.isfinite(gap) | (covered > 0.0)
    else:
        magnitude = side_pressure
        if constraints.tied is not None:  # nodes of a cohesive layer are closed under tension and shear as well
            tangential = constraints.tied.forces(multiplier)[1]
            magnitude = sum((np.abs(field.side_pressure(t)) for t in tangential.T), np.abs(side_pressure))
        closed = field.closed_nodes(active, gap, magnitude)
        never_opening = pair.never_opening(pair.points[pair.secondary.points], configuration)
        closed = closed | (never_opening & np.isfinite(gap))
    closed, pressure = closed_node_pressures(constraints, forces, closed & ~excluded, pair.secondary)
    ratio = np.divide(pressure, side_pressure, out=np.ones_like(pressure), where=side_pressure > 0.0)
    scale = np.where(closed, np.minimum(ratio, 1.0) if side_pressure.min() < 0.0 else ratio, 0.0)
    return closed, pressure, np.where(excluded, 0.0, side_pressure), scale


def closed_node_pressures(constraints: Constraints, forces: Array, closed: Mask, side: Surface) -> tuple[Mask, Array]:
    r"""Return the closed nodes (n,) without tension, and pressures (n,) at them whose resultant is the contact force.

    A pressure field :math:`p_h` with the nodal values :math:`p_j`, which is obtained by projection, is not zero beyond the
    edge of the contact. Its values at open nodes also contribute to the contact force :math:`\int p_h\,dA = \sum_j A_j p_j`,
    where :math:`A_j` are the integrals of the shape functions. The share :math:`A_j p_j` of an open node is therefore moved
    to the closed nodes of its facets and of the adjacent facets. The pressures of all these nodes change by the same amount,
    which is the smallest change for this set of nodes. A smaller set would cause a kink of the pressure, and a larger one
    would change pressures far from the error. A closed node with a negative pressure becomes open.

    Parameters
    ----------
    constraints : Constraints
        The m constraints of the pair. If some are equations, pressures of closed nodes may be negative.
    forces : ndarray (m,)
        Normal forces of the constraints [force].
    closed : ndarray of bool (n,)
        Nodes in contact.
    side : Surface
        The secondary side.
    """
    field, may_pull = constraints.nodal_field, bool(constraints.equality.any())
    nodal_pressure, shares, areas = field.side_pressure(forces), field.nodal_forces(forces), field.nodal_areas
    # Nodes that may receive shares of others.
    with_area = nodes_with_area(areas, [block.local for block in side.blocks])
    while True:
        if not may_pull:
            closed = closed & (nodal_pressure >= 0.0)
            if shares.sum() > 0.0 and not (closed & with_area).any():
                largest = np.argmax(np.where(with_area, shares, -np.inf))
                single_node = np.arange(len(areas)) == largest
                return single_node, np.where(single_node, shares.sum() / areas[largest], 0.0)
        receivers = closed & with_area
        excess = np.where(closed, shares - nodal_pressure * areas, shares)
        excess[receivers | (np.abs(excess) <= SUM_ROUND_OFF * np.abs(shares).max(initial=0.0))] = 0.0
        pressure = nodal_pressure + _received_pressures(receivers, excess, areas, side)
        tension = closed & (pressure < 0.0)
        if may_pull or not tension.any():
            return closed, np.where(closed, pressure, 0.0)
        closed = closed & ~tension


def _received_pressures(receivers: Mask, excess: Array, areas: Array, side: Surface) -> Array:
    """Return the changes (n,) of pressures at the `receivers` (n,) due to the shares `excess` (n,) of other nodes [pressure].

    The other nodes form rings of neighbours around the receivers. Shares move inward from ring to ring, beginning with the
    outermost ring.
    """
    rings, visited = [receivers], receivers.copy()
    while (excess[~visited] != 0.0).any():
        ring = (side.extended_adjacency @ rings[-1].astype(np.float64) > 0.0) & ~visited
        if not ring.any():
            break
        rings.append(ring)
        visited |= ring
    for inner, outer in zip(rings[-2::-1], rings[:0:-1], strict=True):
        weights = np.where(inner, areas if inner is receivers else 1.0, 0.0)
        per_weight = np.divide(excess, side.extended_adjacency @ weights, out=np.zeros_like(excess), where=outer)
        excess = np.where(outer, 0.0, excess) + weights * (side.extended_adjacency @ per_weight)
    return np.divide(excess, areas, out=np.zeros_like(excess), where=receivers)


def _nodal_shear(
    constraints: Constraints, directions: tuple[Array, ...], tangential: Array, normal: Array,
    normal_forces: Array | None = None,
) -> Array:  # fmt: skip
    """Return the tangential traction on the secondary nodes (n_nodes, dim) [pressure].

    Because tangents vary from point to point, the traction is computed from Cartesian components of the `tangential` and
    `normal_forces` of the constraints. Its component along the nodal normals is then removed.
    """
    forces = np.einsum("nk,ndk->nd", tangential, np.stack(directions, axis=2))
    if normal_forces is not None:
        forces += normal_forces[:, None] * normals(directions)
    traction = constraints.nodal_field.traction(forces)
    return traction - np.einsum("nd,nd->n", traction, normal)[:, None] * normal


def _within_cone(constraints: Constraints, shear: Array, pressure: Array, normal: Array, side: Surface) -> Array:
    """Return nodal shear (n, dim) that satisfies Coulomb's law with the nodal pressures (n,) [pressure].

    The constraints obey this law, but a projection onto nodal values does not preserve inequalities, and the normals of the
    constraints differ from those of the nodes. The excess over the limit is moved to nearby nodes that can carry it, which
    preserves the resultant. The shear is a continuous function of the forces: many sliding nodes are exactly at the limit,
    and round-off must not decide whether they receive an excess.
    """
    areas, limit = constraints.nodal_field.nodal_areas, constraints.friction.max() * np.maximum(pressure, 0.0)
    receivers = (limit > 0.0) & nodes_with_area(areas, [block.local for block in side.blocks])
    while True:
        size = np.linalg.norm(shear, axis=1)
        over, receivers = size > (1.0 + SUM_ROUND_OFF) * limit, receivers & (size < (1.0 - SUM_ROUND_OFF) * limit)
        within = shear * np.divide(limit, size, out=np.ones_like(size), where=over)[:, None]
        if not (receivers.any() and over.any()):
            return within
        free = np.where(receivers, (limit - size) * areas, 0.0)
        force = _absorbed((shear - within) * areas[:, None], free, np.flatnonzero(limit > 0.0), side)
        received = np.divide(force, areas[:, None], out=np.zeros_like(force), where=receivers[:, None])
        shear = within + received - np.einsum("nd,nd->n", received, normal)[:, None] * normal


def _absorbed(excess: Array, free: Array, nodes: Indices, side: Surface) -> Array:
    """Return the forces (n, dim) that nodes receive from the `excess` (n, dim) of others [force].

    The excess moves between neighbours among the closed `nodes` (k,). The fraction that stays at a node on each visit
    increases from zero to one with its `free` capacity (n,) [force], compared with the largest excess. A connected part of
    the contact without free capacity receives nothing.
    """
    part = connected_components(side.extended_adjacency[nodes][:, nodes])[1]
    nodes = nodes[np.bincount(part, free[nodes])[part] > 0.0]
    neighbours, absorbed = csr_array(side.extended_adjacency[nodes][:, nodes]), np.zeros_like(excess)
    staying = free[nodes] / (free[nodes] + np.linalg.norm(excess, axis=1).max())
    walk = eye_array(len(nodes)) - neighbours @ diags_array((1.0 - staying) / neighbours.sum(axis=0))
    absorbed[nodes] = staying[:, None] * splu(walk.tocsc()).solve(excess[nodes])
    return absorbed


def mean_slip_before_closing(constraints: Constraints, solution: Solution, result: ContactResult) -> Array:
    """Return the part (n_nodes, dim) of the nodal slips in this step that precedes the closing of the nodes [length].

    The step must have been solved in increments. The slip at a node is a mean over nearby constraints, weighted by their
    contact forces. For parameters see `contact_result`.
    """
    assert solution.slip_before_closing is not None
    forces = np.maximum(constraints.normal_forces(solution.multiplier), 0.0)
    slips = np.einsum("mk,kmd->md", solution.slip_before_closing, np.stack(constraints.directions))
    pressure, mean = constraints.nodal_field.side_pressure(forces)[:, None], np.zeros_like(result.coordinates)
    np.divide(constraints.nodal_field.traction(forces[:, None] * slips), pressure, out=mean, where=pressure > 0.0)
    # The nodal values of a field may exceed the values from which it is computed.
    largest, length = np.linalg.norm(slips, axis=1).max(initial=0.0), np.linalg.norm(mean, axis=1)
    return mean * np.divide(largest, length, out=np.ones_like(length), where=length > largest)[:, None]


def with_work(
    pair: Formulation, constraints: Constraints, solution: Solution, configuration: Configuration,
    contact: ContactResult, before: ContactForces | None,
) -> tuple[ContactResult, ContactForces, tuple[float, float, float]]:  # fmt: skip
    """Return the result of a pair with its frictional work, its contact forces, and its work in the step.

    For the parameters, and for the last two values, see `contact_work`.
    """
    forces, work, slip_integrals = contact_work(pair, constraints, solution, configuration, contact, before)
    sliding_load = None
    if pair.friction:
        # If the step is solved at once, slips of sticking constraints are elastic. If it is solved in increments, a
        # constraint that sticks at the end may have slid before.
        at_once = solution.work is None
        sliding = np.where(solution.sticking, 0.0, slip_integrals) if at_once else slip_integrals
        # Like the contact force, the integral is distributed to nodes that are closed at the beginning or at the end.
        closed = contact.active if before is None else contact.active | (before.pressing > 0.0)
        pressures = closed_node_pressures(constraints, constraints.normal_forces(sliding), closed, pair.secondary)[1]
        sliding_load = np.maximum(pressures, 0.0)
    return replace(contact, dissipation=work[0], sliding_load=sliding_load), forces, work


def _on_deformed_surface(pair: Formulation, contact: ContactResult, displacement: Array) -> ContactResult:
    """Return a contact result with displacements, Cauchy instead of nominal tractions, and deformed widths.

    The force of each node is preserved (lumped form of Nanson's formula: Bonet and Wood, 2008, equation 4.68).

    Parameters
    ----------
    pair : Formulation
    contact : ContactResult
        Result per reference area.
    displacement : ndarray (n_points, dim)
        Displacement of the mesh [length].
    """
    before, after = areas(pair, displacement)
    ratio, stretch = before / after, _stretch(contact, displacement[contact.points], before, after)
    return replace(
        contact, pressure=contact.pressure * ratio, multiplier=contact.multiplier * ratio,
        shear=contact.shear * ratio[:, None], radius=(contact.radius[0] * stretch[0], contact.radius[1] * stretch[1]),
        displacement=displacement[contact.points],
    )  # fmt: skip


def areas(pair: Formulation, displacement: Array) -> tuple[Array, Array]:
    """Return the tributary areas (n_nodes,) of secondary nodes before and after a displacement (n_points, dim) [area]."""
    configurations = pair.points, pair.points + displacement
    before, after = (lumped_areas(pair.secondary, points, pair.axisymmetric) for points in configurations)
    return before, after


def _stretch(contact: ContactResult, displacement: Array, before: Array, after: Array) -> tuple[float, float]:
    """Return the ratios of the deformed to the undeformed contact width, for both bounds of the width [-].

    In 3D both are the square root of the area ratio of the closed nodes, in plane models without a tangent the ratio itself.
    """
    if not contact.active.any():
        return 1.0, 1.0
    if (dim := contact.coordinates.shape[1]) == 3 or (contact.tangent is None and not contact.measured_from_axis):
        stretch = float((after[contact.active].sum() / before[contact.active].sum()) ** (1.0 / (dim - 1)))
        return stretch, stretch
    tangential = displacement[:, 0] if contact.tangent is None else displacement @ contact.tangent
    widths = (half_width(contact.place, contact.active, contact.across + k * tangential) for k in (0.0, 1.0))
    low, high = (after / before if 0.0 < before < np.inf else 1.0 for before, after in zip(*widths, strict=True))
    return low, high


def _with_periodic_nodes(pair: Formulation, contact: ContactResult) -> ContactResult:
    """Return a contact result in which corresponding nodes at periodic ends have the same traction and contact status.

    If only one of the two nodes has an opposite facet, because the sides slide past the ends, both are given its gap.
    """
    areas = lumped_areas(pair.secondary, pair.points, pair.axisymmetric)
    pressure, shear, active = contact.pressure.copy(), contact.shear.copy(), contact.active.copy()
    gap = contact.gap.copy()
    for a, b, rotation in pair.secondary.periodic_ends:
        if a is b:  # nodes in a plane of symmetry
            continue
        weight = areas[a] / (areas[a] + areas[b])
        pressure[a] = pressure[b] = weight * pressure[a] + (1.0 - weight) * pressure[b]
        shear[a] = weight[:, None] * shear[a] + (1.0 - weight[:, None]) * (shear[b] @ rotation)
        shear[b] = shear[a] @ rotation.T
        active[a] = active[b] = active[a] | active[b]
        gap[a], gap[b] = np.where(np.isinf(gap[a]), gap[b], gap[a]), np.where(np.isinf(gap[b]), gap[a], gap[b])
    return replace(contact, pressure=pressure, shear=shear, active=active, gap=gap)
