"""Warnings about the accuracy and validity of a finished analysis, which result files store."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from fastcontact._tools.records import replace
from fastcontact.analysis.criteria import NOTABLE, WARNING_ERROR, WARNING_RATIO, Criteria
from fastcontact.analysis.facet_sag import facet_length, sag_warning
from fastcontact.analysis.interpenetration import Peak, interpenetration
from fastcontact.analysis.kinematics_warnings import large_rotation, large_strain
from fastcontact.analysis.locking import ALTERNATING, locking_warnings
from fastcontact.analysis.problem import Problem
from fastcontact.analysis.resultants import pose_of
from fastcontact.analysis.state import State
from fastcontact.analysis.wear import ratio_to_elastic_waves
from fastcontact.arrays import Array, Mask, largest
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.held_motions import SAME_DIRECTION
from fastcontact.contact.integration import areas_of_rule, fine_rule, lumped_areas
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.pair_options import ALWAYS_CLOSED
from fastcontact.contact.pairing import Candidates
from fastcontact.contact.projection import DeformedSide
from fastcontact.contact.supported_nodes import nodes_with_undetermined_traction
from fastcontact.contact.surface import Surface
from fastcontact.mesh import elements
from fastcontact.mesh.area_vectors import unit_vectors
from fastcontact.mesh.topology import bodies
from fastcontact.model.body_overlap import depths
from fastcontact.model.model import Model
from fastcontact.results.step import MIN_ELEMENTS_ACROSS_RADIUS, ContactResult, StepResult, coarse_contact_text
from fastcontact.round_off import LENGTH_ROUND_OFF, SINGLE_PRECISION, TINY

# Factor by which load steps are too large for the wear of single facets, above which the coefficient of wear may be wrong.
LARGEST_STEP_FACTOR = 1000
# Alternation of nodal pressures on quadratic lines above which a warning is given, see `pressure_oscillation`. On other
# facets the limit is ALTERNATING.
ALTERNATING_ON_LINES = 0.13
# Sliding past periodic ends, relative to the length of facets, above which a warning is given. On a strip with friction 0.3
# under a uniform pressure, the relative changes of pressures at the ends are 0.03 times this ratio with dual multipliers and
# 0.7 times with standard multipliers. In press fits they are 1.7 times this ratio with standard multipliers.
SLIDE_PAST_ENDS, SLIDE_PAST_ENDS_DUAL = 0.01, 0.3
# Alternation of shear above which a warning is given. It is 0.42 to 1.0 in continuous contact with quadratic facets where a
# contact that sticks grows, and at most 0.1 with mortar.
SHEAR_ALTERNATING = 0.4
# Length of facets at the edge of an adhesive contact, relative to the range of adhesion, above which a warning is given. The
# pull-off force of a ball (JKR theory) changes by up to 1 % with a ratio of 2.5, 4 % with 4.9, and 10 % with 9.8.
LONGEST_ADHESIVE_FACET = 4.0
# Smallest number of nodes for which the median is meaningful.
MIN_NODES = 10
# Number of the first step in which nothing determines the position of some bodies, the free motions of each of them by its
# name, and their largest displacement in this step [length].
FreeBodies = tuple[int, dict[str, list[str]], float]


def result_warnings(
    problem: Problem, state: State, last: StepResult, free_bodies: FreeBodies | None, peaks: Mapping[str, Peak]
) -> list[str]:
    """Return the warnings about an analysis whose `last` step ended in `state`.

    Parameters
    ----------
    problem : Problem
    state : State
    last : StepResult
    free_bodies : FreeBodies or None
    peaks : dict of str to Peak
        Number, displacements and contact results of the step in which the normal force of a pair is largest, by pair.
    """
    earlier = {peak[0]: peak for peak in peaks.values() if peak[0] != last.index}
    warnings = interpenetration(problem, last, list(earlier.values()))
    warnings += [*_loaded_springs(problem, last), *_undetermined_positions(last, free_bodies)]
    if problem.model.strain == "small":
        warnings += [*large_strain(problem, last), *large_rotation(problem, state, last)]
    warnings += locking_warnings(problem, state, last)
    if reason := problem.solver.replacement_reason:
        warnings.append(f'{reason}. linear_solver="direct" factorises the matrix from the start')
    load = problem.load_at(last.load_factor)
    rises = load.rise, state.rise  # by prescribed temperatures of nonlinear bodies, and by heat conduction
    loaded = any(values is not None and values.any() for values in (load.force, load.lift, *rises))
    for name, pair in problem.pairs.items():
        contact = last.contact[name]
        if pair.options.kind == "gap_only":
            continue
        configuration = problem.configuration(name, state, load, state.u)
        undetermined = _undetermined_tractions(pair, contact, nodes_with_undetermined_traction(pair, configuration))
        warnings += [*_deep_penetration(pair, contact, state.u), *_open_contact(problem, state, name, last, loaded)]
        warnings += undetermined
        unresolved = _unresolved(problem, pair, configuration, contact, state)
        oscillation = list(pressure_oscillation(pair, contact, problem.model))
        oscillation = oscillation or list(_quadrature_error(pair, configuration, contact, problem.model))
        pressures = [*unresolved, *oscillation]
        index, displacement, contacts = peaks[name]
        at_edge = list(_pressure_peak_at_edge(pair, last, contact, state.u))
        if not pressures and index != last.index:
            peak = contacts[name]
            at_peak = replace(Configuration.displaced(displacement), pose=pose_of(peak))
            texts = _unresolved(problem, pair, at_peak, peak, state)
            texts += pressure_oscillation(pair, peak, problem.model)
            texts += [] if at_edge else _pressure_peak_at_edge(pair, last, peak, displacement)
            pressures = [f"in load step {index}, where its force is largest, {text}" for text in texts]
        warnings += pressures or _shear_oscillation(pair, contact)
        warnings += [*at_edge, *_sliding_past_ends(pair, contact), *_coarse_adhesion(pair, contacts[name])]
        warnings += _excessive_wear(name, pair, state, not pressures)
    warnings += [*_unconverged_geometry(state), *_loose_criteria(problem, last), *_energy_imbalance(state)]
    return [*warnings, *_slip_before_contact(problem.criteria, state), *_turning_flow(state)]


def _unresolved(
    problem: Problem, pair: Formulation, configuration: Configuration, contact: ContactResult, state: State
) -> list[str]:
    """Return the warnings about contact areas or shapes that the facets do not resolve."""
    edge = [] if problem.criteria.keep_pairing else _past_edge(pair, configuration, contact, problem.model.strain)
    coarse, sag = list(_coarse_contact(pair, contact, state)), sag_warning(pair, configuration, contact)
    # Against rigid shapes, refinement also reduces the sag.
    return [*edge, *(coarse if coarse and isinstance(pair.primary, RigidSide) else sag or coarse)]


def _sliding_past_ends(pair: Formulation, contact: ContactResult) -> Iterator[str]:
    """Yield a warning if surfaces slide past each other at periodic ends, beyond which there is no opposite facet."""
    if isinstance(pair.primary, RigidSide):  # it continues beyond the ends
        return
    distance, points = 0.0, pair.points[pair.secondary.points]
    for first, second, _ in pair.secondary.periodic_ends:
        slip = contact.slip_total[first] * contact.active[first, None]
        distance = max(distance, largest((slip * unit_vectors(points[second] - points[first])).sum(axis=1)))
    ratio, is_dual = distance / facet_length(pair.secondary, pair.points), getattr(pair, "multipliers", "") == "dual"
    if ratio > (SLIDE_PAST_ENDS_DUAL if is_dual else SLIDE_PAST_ENDS):
        yield (
            f"contact '{contact.name}': its sides slide by {distance:.3g}, or {ratio:.1%} of a facet, past each other at the "
            "periodic ends, beyond which there are no opposite facets: pressures of the nodes at the ends may be wrong. "
            "The default formulation is little affected; without sliding at the ends, or without ends, there is no error"
        )


def _deep_penetration(pair: Formulation, contact: ContactResult, displacement: Array) -> Iterator[str]:
    """Yield a warning where the penetration of a penalty is a notable fraction of the largest displacement."""
    size = float(np.abs(displacement).max(initial=0.0))
    penalty, depth = pair.options.penalty, contact.penetration
    if isinstance(penalty, float) and depth > NOTABLE * size:
        yield (
            f"contact '{contact.name}' penetrates by {depth:.4g}, which is {depth / size:.1%} of the largest displacement: "
            f"raise its penalty from {penalty:.4g} to about {2 * penalty * depth / (NOTABLE * size):.2g}, or omit it. If it "
            f"is the stiffness of a layer, such as a gasket, give it as a table: penalty=[(0, 0), (1, {penalty:.4g})]"
        )


def _past_edge(pair: Formulation, configuration: Configuration, contact: ContactResult, strain: str) -> Iterator[str]:
    """Yield a warning where a surface has deformed past the edge of a rigid obstacle, beyond which it carries no force.

    With small strains, areas do not change, so that the area opposite the obstacle decreases as points move past its edge.
    With finite strains it only decreases because facets are cut by the edge. Under a punch on a plastic half-space, the force
    is 17 % too small where the estimate is 16 %.
    """
    side, primary, pose = pair.secondary, pair.primary, configuration.pose
    positions = pair.points, pair.points + configuration.displacement
    if not isinstance(primary, RigidSide) or primary.project(positions[1][side.points], pose)[2].all():
        return
    candidates, areas = Candidates.in_facets(side, [fine_rule(block.element)[0] for block in side.blocks]), []
    before, now = (primary.project(candidates.positions(points), pose)[2] for points in positions)
    for facing, points in ((before, positions[0]), (now, positions[strain == "finite"])):
        of_blocks = [areas_of_rule(block, points, pair.axisymmetric)[1].ravel() for block in side.blocks]
        areas.append(float(np.concatenate(of_blocks)[facing].sum()))
    in_contact = np.isin(candidates.nodes, side.points[contact.active]).any(axis=1)
    if areas[0] - areas[1] > NOTABLE * areas[0] and (in_contact & before & ~now).any():
        remedy = "Criteria(keep_pairing=True), which keeps it in contact" if strain == "small" else "smaller facets"
        yield (
            f"contact '{contact.name}': '{side.group}' has deformed past the edge of the obstacle. "
            f"{1.0 - areas[1] / areas[0]:.1%} of the area below the obstacle therefore carries no force, and the force may "
            f"be too small by as much: use {remedy}"
        )


def _undetermined_tractions(pair: Formulation, contact: ContactResult, undetermined: Mask) -> Iterator[str]:
    """Yield a warning about closed facets whose tractions are undetermined, because supports hold both sides.

    `undetermined` (n_nodes,) are the nodes of such facets.
    """
    nearly_closed = contact.gap <= LENGTH_ROUND_OFF * float(np.ptp(pair.points, axis=0).max())
    nodes = undetermined & (contact.active | nearly_closed | (pair.options.kind in ALWAYS_CLOSED))
    count = sum(int(nodes[block.local].all(axis=1).sum()) for block in pair.secondary.blocks)
    if count:
        where = np.array2string(pair.points[pair.secondary.points[nodes]].mean(axis=0), precision=4)
        friction = ", as is friction that depends on them" if pair.friction else ""
        yield (
            f"contact '{contact.name}': supports hold {count} of the {pair.secondary.n_facets} facets of "
            f"'{pair.secondary.group}' and the opposite facets, near {where}: tractions in the held directions are "
            f"undetermined there and reported as 0{friction}. The reactions include their forces. Free the nodes of one side "
            "there"
        )


def _excessive_wear(name: str, pair: Formulation, state: State, is_smooth: bool) -> Iterator[str]:
    """Yield warnings about a coefficient of wear in a wrong unit, and about a contact that moves too far in a load step.

    The latter is only given where pressures are smooth, since otherwise nodes also open and close in a contact at rest.
    """
    if name not in state.worn:
        return
    worn, factor = state.worn[name], ratio_to_elastic_waves(pair, state.worn[name])
    if is_smooth and (passing := worn.passing / max(float(worn.depth.sum()), TINY)) > WARNING_RATIO:
        yield (
            f"contact '{name}' moves along '{pair.secondary.group}', and {passing:.0%} of the wear there is that of nodes in "
            "the load step in which it reaches or leaves them. Depths deviate by up to this fraction from node to node, but "
            f"the worn volume is accurate: use {passing / WARNING_RATIO:.2g} times as many load steps"
        )
    depth, size = float(worn.depth.max()), float(np.ptp(pair.points, axis=0).max())
    if factor > LARGEST_STEP_FACTOR or (factor > 1.0 and depth > WARNING_RATIO * size):
        yield (
            f"contact '{name}' has a wear depth of {depth:.3g}, {depth / size:.2g} times the size of the model, and load "
            f"steps that are {factor:.2g} times too large for this wear: is the option 'wear' Archard's coefficient divided "
            "by the hardness, in units of 1/pressure?"
        )


def _energy_imbalance(state: State) -> Iterator[str]:
    """Yield a warning where the energy balance of all steps is violated by more than round-off."""
    work, round_off = state.work, LENGTH_ROUND_OFF * state.largest_force * float(np.abs(state.u).max(initial=0.0))
    if work is not None and abs(work.imbalance) > 2 * NOTABLE * work.largest and work.largest > round_off:
        yield (
            f"the energy of these load steps is out of balance by {work.imbalance:.3g}, "
            f"{abs(work.imbalance) / work.largest:.1%} of the largest energy so far (external work {work.external:.4g}, "
            f"strain energy {work.strain_energy:.4g}, frictional work {work.friction:.4g}). If energies matter, use more "
            "load steps. If the contact area moves along the secondary side, exchange the sides, or use smaller facets"
        )


def _slip_before_contact(criteria: Criteria, state: State) -> Iterator[str]:
    """Yield a warning if nodes that close and slide in one step, or slide until contact is lost, do much frictional work.

    Their work must also exceed NOTABLE squared times the largest energy in steps with friction, which is the energy of a
    relative error NOTABLE of the displacement: without friction, hot bodies store energy of free expansion. Under a sphere
    that sticks, with a coefficient of 0.6, the frictional work is 2e-4 of the strain energy in large steps, and 1e-5 if slip
    is measured from first contact.
    """
    work = state.work
    if work is not None and work.touching > max(WARNING_RATIO * work.friction, NOTABLE**2 * work.largest_sliding, 0.0):
        fraction = work.touching / max(work.friction, work.touching)  # elastic slip may take some of the work back
        hint = "" if criteria.friction_while_touching else ", or Criteria(friction_while_touching=0.01) if nodes close"
        yield (
            f"{fraction:.0%} of the work of friction is done at nodes in the load step in which they close, or contact is "
            "lost, where the slip is that of the complete step, not only that in contact: the work of friction is too large "
            "by up to this part, and the shear is inaccurate where contact begins in the step; errors of pressures are "
            f"smaller. If the work or the shear matters, use more load steps{hint}"
        )


def _unconverged_geometry(state: State) -> Iterator[str]:
    """Yield a warning where the last of a fixed number of geometry updates changed the displacement notably."""
    update, change = state.last_change or (0, 0.0)
    if change > NOTABLE:
        yield (
            f"the contact geometry had not converged after the requested number of updates, {update}: the last one changed "
            f"the displacement by {change:.1%} of its largest component. Allow more geometry_updates, or omit the option"
        )


def _turning_flow(state: State) -> Iterator[str]:
    """Yield a warning where the plastic flow changes its direction notably within load steps.

    The change in a single step depends on whether the edge of the contact crosses a node. The mean over the steps decreases
    with their number: under a ball that is pressed in with 4, 8, 16 and 32 steps, the mean changes of stress are 2.3, 1.9,
    1.6 and 0.9 %, and the depth is 7, 4, 2 and 1 % too large. In the first step, the path is unknown, and changes would be
    underestimated.
    """
    size, change = state.flow
    if change > NOTABLE * size:
        yield (
            f"the plastic flow turns so much in load steps that stresses of points that yield change by {change / size:.1%} "
            "(root mean square, mean over the steps so far) if each step is halved, contact forces and displacements by up "
            "to three times as much: compare with twice as many load steps"
        )


def _loose_criteria(problem: Problem, last: StepResult) -> Iterator[str]:
    """Yield warnings where loose criteria let the last step end early."""
    history, criteria, scatter = last.iterations["history"], problem.criteria, last.iterations.get("scatter")
    if not history:
        return
    change, residual = history[-1]["displacement_change"], history[-1]["residual"]
    if problem.until_settled and change > NOTABLE**2:
        yield (
            f"the contact geometry counts as converged although the displacement still changed by {change:.1e} of its "
            f"largest component (Criteria.geometry = {criteria.geometry:g}): results are no more accurate than that"
        )
    last_alternation = next((previous for previous, following in pairwise(history) if "rounded" in following), None)
    if last_alternation is not None:
        yield (
            "nodes alternated between two facets of the primary side, or between open and closed gaps, which changed the "
            f"displacement by {last_alternation['displacement_change']:.1e} of its largest component. To converge, normals "
            "were interpolated between facets over a tenth of each facet, and nodes with a small overlap had no constraint; "
            'normals="averaged" makes this unnecessary'
        )
    if scatter is not None and scatter["force"] > criteria.relative:
        yield (
            f"round-off makes contact forces scatter by {scatter['force']:.1e} of the largest one from update to update, and "
            f"displacements by {scatter['displacement']:.1e}: results are no more accurate than that"
        )
    if residual > min(NOTABLE**2, criteria.relative):
        cause = "by round-off of a stiff body that moves far, for which a rigid obstacle may be substituted; "
        yield (
            f"forces are out of balance by {residual:.1e} of the largest force (Criteria.relative = {criteria.relative:g}): "
            f"{cause if residual > criteria.relative else ''}results are no more accurate than that"
        )


def _loaded_springs(problem: Problem, last: StepResult) -> Iterator[str]:
    report = last.iterations.get("regularised")
    if report is not None and report["relative_to_load"] > problem.criteria.relative:
        yield (
            f"the springs that regularise {'; '.join(report['motions'])} still carry {report['relative_to_load']:.1e} of "
            "the load: rigid motions are so much larger than deformations that round-off permits no higher accuracy"
        )


def _undetermined_positions(last: StepResult, free_bodies: FreeBodies | None) -> Iterator[str]:
    """Yield a warning about bodies whose position is undetermined in a step."""
    if free_bodies is not None:
        index, bodies, moved = free_bodies
        names = "; ".join(f"{body}: {', '.join(motions)}" for body, motions in bodies.items())
        when = "" if index == last.index else f" in load step {index}"
        lost = f". They lost contact in this step, moving by up to {moved:.3g}: smaller load steps may avoid this"
        lost = lost if index > 1 else ""  # contact determined all positions in earlier steps
        yield (
            f"nothing determines the position of bodies{when}, since no contact force acts against their motion ({names}): "
            f"any position without such a force is a solution; hold them by supports or weak springs, or load them{lost}"
        )


def _open_contact(problem: Problem, state: State, name: str, last: StepResult, loaded: bool) -> Iterator[str]:
    """Yield a warning if a pair never closed, or is open although loads still act."""
    pair, contact, touched = problem.pairs[name], last.contact[name], name in state.touched
    search_distance, facing = pair.options.search_distance, contact.gap[np.isfinite(contact.gap)]
    smallest, round_off = float(facing.min(initial=np.inf)), LENGTH_ROUND_OFF * float(np.ptp(pair.points, axis=0).max())
    detected_gaps = {pair.name: pair.detected_gap for pair in problem.model.contact if pair.detected_gap is not None}
    if not touched and detected_gaps.get(name, 0.0) > round_off and state.touched & detected_gaps.keys():
        return  # an automatically detected clearance, such as that of a shank in its hole, may remain open
    gap = f"the smallest gap is {smallest:.4g}" if len(facing) else "no node faces the other side"
    if contact.active.any() or contact.damage is not None or contact.fluid_pressure is not None:  # visible in results
        return
    if search_distance is not None and smallest < -search_distance:
        yield (
            f"contact '{name}' carries nothing where its sides penetrate by {-smallest:.4g}, more than its "
            f"search_distance {search_distance:.4g}: raise that, or use more load steps"
        )
    elif smallest < -round_off and not touched:
        yield (
            f"contact '{name}' carries nothing although its sides penetrate by {-smallest:.4g}: supports or relations "
            "hold its nodes there; leave these nodes free, or out of the contact as 'excluded'"
        )
    elif not touched and pair.options.clearance is None and (depth := _depth_of_primary(problem, pair, last)) > 0.0:
        assert isinstance(pair.primary, Surface)
        yield (
            f"contact '{name}' carries nothing although nodes of '{pair.primary.group}' are up to {depth:.4g} deep in the "
            f"body of '{pair.secondary.group}': refine '{pair.secondary.group}' if they lie between its nodes, or exchange "
            "the sides; otherwise check whether the sides face each other"
        )
    elif not touched:
        yield f"contact '{name}' never closed: {gap}. Check its sides and the direction of the loads"
    elif loaded:
        yield f"contact '{name}' has opened again at the end: {gap}"


def _depth_of_primary(problem: Problem, pair: Formulation, last: StepResult) -> float:
    """Return the largest depth, inside secondary bodies, of the primary nodes that belong to no closed pair [length]."""
    model, secondary_bodies = problem.model, bodies(problem.model.mesh)[1][pair.secondary.points]
    closed = [other.primary.points for name, other in problem.pairs.items() if last.contact[name].active.any()]
    primary = np.setdiff1d(pair.primary.points, np.concatenate([np.empty(0, np.intp), *closed]))
    overlaps = depths(model.mesh, model.kinematics, model.mesh.points + last.displacement)
    inside = (depth[np.isin(points, primary)] for _, body, points, depth in overlaps if body in secondary_bodies)
    return max((float(depth.max(initial=0.0)) for depth in inside), default=0.0)


def _coarse_contact(pair: Formulation, contact: ContactResult, state: State) -> Iterator[str]:
    """Yield a warning where too few elements lie across the radius of a contact that carries a force."""
    if not contact.active.any() and contact.fluid_pressure is not None and (contact.fluid_pressure > 0.0).all():
        yield f"contact '{contact.name}' is blown open: the fluid acts on all of its nodes, so that a seal leaks"
    if count := _too_few_elements(pair, contact, state):
        needed, remedy = f"its pressure needs {MIN_ELEMENTS_ACROSS_RADIUS} or more", f"refine '{pair.secondary.group}'"
        gap = np.where(contact.active & np.isfinite(contact.gap), contact.gap, 0.0).clip(0.0)
        if state.work and contact.normal_forces @ gap > WARNING_RATIO * state.work.largest:
            # Between a fillet and large facets of a plane, forces are twice as large as with exchanged sides.
            needed += (
                f" (its force is too large, since it acts across gaps of up to {gap.max():.3g} between large facets)"
            )
            remedy += "" if isinstance(pair.primary, RigidSide) else " or exchange the sides"
        if count == 1:
            friction = ", its direction and the work of friction" if pair.friction else " and its direction"
            needed += f", and with fewer than 2 the force{friction} may be inaccurate, too"
            # Two balls, hex20: forces 3 to 5 times too large with dual multipliers, up to 35 % too small with continuous
            # contact. On linear facets, none of the formulations is generally more accurate. Where the corner of a disc meets
            # a rigid plane, forces are 0.5 % too large with mortar and 6 % too small with continuous contact.
            if pair.weighs_gaps and pair.secondary.order == 2:
                remedy += ", or, unless it is a sharp corner, use formulation 'continuous', which is then more accurate"
            remedy += (
                ". At a sharp corner, refinement does not widen the contact; compare forces (errors up to 6 %) there"
            )
            depth = -float(contact.gap[contact.active].min())
            if pair.name == "continuous" and depth > LENGTH_ROUND_OFF * float(np.ptp(pair.points, axis=0).max()):
                remedy += (
                    f", with formulation 'mortar', since the integration points let nodes penetrate by {depth:.3g}"
                )
        yield f"{coarse_contact_text(contact.name, count)}: {needed}; {remedy}"


def coarse_contacts(problem: Problem, state: State, step: StepResult) -> dict[str, int]:
    """Return the contacts with too few elements across their radius in a step that ended in `state`, with this number."""
    counts = {name: _too_few_elements(pair, step.contact[name], state) for name, pair in problem.pairs.items()}
    return {name: count for name, count in counts.items() if count}


def _too_few_elements(pair: Formulation, contact: ContactResult, state: State) -> int:
    """Return the number of elements across the radius of a contact that carries a force, or 0 if there are enough.

    Open nodes between closed ones count as closed.
    """
    is_loaded = contact.active.any() and largest(contact.force_vectors) > SINGLE_PRECISION * state.largest_force
    if pair.options.kind in ALWAYS_CLOSED or not is_loaded:
        return 0
    closed = _closed_or_enclosed(contact.active, pair.secondary)
    count = facets_across_radius(pair.secondary, closed, pair.excluded[pair.secondary.points])
    return count if count is not None and count < MIN_ELEMENTS_ACROSS_RADIUS else 0


def _coarse_adhesion(pair: Formulation, contact: ContactResult) -> Iterator[str]:
    """Yield a warning if facets at the edge of an adhesive contact are much longer than the range of adhesion."""
    law = pair.options.cohesion
    if law is None or not law.reversible:
        return
    closed = [contact.active[block.local].mean(axis=1) for block in pair.secondary.blocks]
    at_edge = np.concatenate([(fraction > 0.0) & (fraction < 1.0) for fraction in closed])
    lengths = np.concatenate([block.diameters(pair.points) for block in pair.secondary.blocks])[at_edge]
    reach = 2.0 * law.energy / law.strength
    if len(lengths) and (ratio := float(np.median(lengths)) / reach) > LONGEST_ADHESIVE_FACET:
        yield (
            f"facets at the edge of contact '{contact.name}' are {ratio:.3g} times as long as the range of adhesion, "
            f"{reach:.3g}: forces may be wrong by 5 % with a ratio of 5 and 10 % with 10; refine '{pair.secondary.group}'"
        )


def facets_across_radius(side: Surface, closed: Mask, excluded: Mask) -> int | None:
    """Return the number of facets between the innermost closed node and the edge of the contact; None without an edge.

    This is the radius in elements, for any shape of the contact, and also where symmetry cuts it. The edge lies within
    the last of these facets.

    Parameters
    ----------
    side : Surface
    closed, excluded : ndarray of bool (m,)
        Nodes of the side in contact; nodes excluded by the user, which do not form an edge.
    """
    edge = np.flatnonzero(~closed & ~excluded)
    if not len(edge):
        return None
    distance = dijkstra(side.node_adjacency, indices=edge, unweighted=True, min_only=True)[closed].max(initial=0.0)
    return int(distance) if np.isfinite(distance) else None  # infinite where contact is closed from end to end


def pressure_oscillation(pair: Formulation, contact: ContactResult, model: Model) -> Iterator[str]:
    """Yield a warning where pressures of nodes whose neighbours are all closed oscillate by a large fraction of their mean.

    Open nodes between closed ones count as closed with zero pressure: with wear, every second node may be open. The measure
    is the median of the differences from the mean of the neighbours, each divided by half the sum of the pressure and this
    mean, which is not zero where only the neighbours are open. On quadratic facets, the neighbours of corners are the other
    nodes and vice versa, see `_alternation_matrix`. Values of the measure are, on linear facets,

    - 0.30 on rings of tri3 cells 4.6 times as deep as wide, with pressure errors of 0.16 to 0.27, 0.16 with wider cells and
      errors of 0.09 to 0.13, and 0.002 with quadrangles;
    - 0.10 to 0.12 under punches of hex8 and tet4 cells, whose pressures are singular at the edges;
    - 0.22 under a hex8 block subject to wear;

    and on quadratic facets,

    - at least 0.15 on rings of quad8 and tri6 cells with pressure errors of 0.14 to 1, and less with errors of up to 0.2, or
      up to 0.4 where meshes nearly match: errors then vary along the side, which the median does not show;
    - 0.13 on a stiff quad8 strip that bends on a soft base with larger facets, with errors of 0.3, and 0.1, so that no
      warning is given, if the strip does not bend;
    - at most 0.07 under elastic punches of quad8 and tri6 cells whose facets are as large as the opposite ones;
    - up to 0.18 on coarse faces of hex20 cells under an elastic punch.

    Sides that never separate or that adhere carry tension as well. Their mean may be zero or round-off and is not used.
    """
    if pair.options.kind in ALWAYS_CLOSED or pair.options.cohesion is not None:
        return
    side = pair.secondary
    inside, ratio, difference = _alternation(side, contact.pressure[:, None], _closed_or_enclosed(contact.active, side))
    limit = ALTERNATING_ON_LINES if side.order == 2 and pair.points.shape[1] == 2 else ALTERNATING
    if ratio > limit and contact.pressure[inside].mean() > 0.0:
        yield (
            f"contact '{contact.name}': nodal pressures oscillate from node to node, typically by {0.5 * ratio:.0%} above "
            f"and below their local mean, and by up to {0.5 * difference.max():.3g}: trust means over neighbouring nodes, or "
            f"{_oscillation_remedy(pair, model)}"
        )


def _quadrature_error(
    pair: Formulation, configuration: Configuration, contact: ContactResult, model: Model
) -> Iterator[str]:
    """Yield a warning about a large pressure error due to integration over complete facets.

    The estimate is `Continuous.quadrature_error` times the ratio of the secondary modulus to the sum of both moduli. On
    blocks under a uniform pressure, the errors of nodal pressures were 0.8 to 1.4 times the estimate, and in press fits 0.5
    to 2.5 times. Pairs with a penalty or with excluded nodes are ignored, because the estimate would include other errors.
    """
    if pair.name != "continuous" or isinstance(pair.primary, RigidSide) or pair.options.kind in ALWAYS_CLOSED:
        return
    from fastcontact.contact.formulations.continuous import Continuous

    assert isinstance(pair, Continuous)
    pressure, options = contact.pressure[contact.pressure > 0.0], pair.options
    if options.cohesion is not None or options.penalty is not None or pair.excluded.any() or not len(pressure):
        return
    modulus, other = (model.contact_modulus_at(side.points) for side in (pair.secondary, pair.primary))
    error = modulus / (modulus + other) * float(np.abs(pair.quadrature_error(configuration, contact.pressure)).max())
    if error > WARNING_ERROR * (mean := float(pressure.mean())):
        yield (
            f"contact '{contact.name}': the integration points of complete facets change nodal pressures by about "
            f"{error:.3g}, compared with a mean of {mean:.3g}: use formulation mortar, which integrates up to the edges of "
            "opposite facets"
        )


def _shear_oscillation(pair: Formulation, contact: ContactResult) -> Iterator[str]:
    """Yield a warning where shear on quadratic lines oscillates at nodes whose neighbours all stick.

    The measure is that of `pressure_oscillation`. On faces, shear may vary as much from node to node without oscillating.

    A growing contact keeps the slip at which each integration point closes, which varies within the facet. Under a ball with
    a coefficient of friction of one, with 5, 20 and 80 load steps, the measure is 0.65, 0.96 and 1.0 on quad8 cells, and 0.42
    with half the facets; 0.55 on tri6 cells; 0.14 on quad4 cells; and up to 0.1 with mortar. Local means are accurate.
    """
    is_on_lines = pair.secondary.order == 2 and pair.points.shape[1] == 2
    if not is_on_lines or pair.name == "mortar" or pair.options.kind in ALWAYS_CLOSED:
        return
    inside, ratio, difference = _alternation(pair.secondary, contact.shear, contact.sticking & contact.active)
    if ratio > SHEAR_ALTERNATING and 0.5 * np.median(difference) > NOTABLE * contact.pressure[inside].mean():
        yield (
            f"contact '{contact.name}': nodal shear of sticking nodes oscillates from node to node, typically by "
            f"{0.5 * ratio:.0%} above and below its local mean, and by up to {0.5 * difference.max():.3g}: trust means over "
            "neighbouring nodes, or use formulation mortar. Pressures and resultants are not affected"
        )


def _oscillation_remedy(pair: Formulation, model: Model) -> str:
    """Return the remedy for oscillating pressures of a pair."""
    from fastcontact.contact.found_contacts import NOTABLE_MODULUS_RATIO

    side, group, primary = pair.secondary, pair.secondary.group, pair.primary
    if isinstance(primary, Surface):
        modulus, other = (model.contact_modulus_at(surface.points) for surface in (side, primary))
        if modulus > NOTABLE_MODULUS_RATIO * other:
            return f"exchange the sides, since the body of '{primary.group}' is softer"
    if pair.name != "mortar":
        return "use formulation mortar"
    adjacent = [name for name, block in model.mesh.solids.items() if np.isin(block, side.points).any()]
    if any(name[:3] not in ("qua", "hex") for name in adjacent):
        return f"use quadrangles or hexahedra along '{group}', or triangles or tetrahedra there about as deep as wide"
    if not isinstance(primary, Surface):
        return f"use smaller facets of '{group}'"
    length, opposite = (facet_length(surface, pair.points) for surface in (side, primary))
    if length > (1.0 + WARNING_RATIO) * opposite:
        return f"use facets of '{group}' that are at most as large as the opposite ones"
    return f"use smaller facets of both '{group}' and '{primary.group}'"


def _pressure_peak_at_edge(
    pair: Formulation, last: StepResult, contact: ContactResult, displacement: Array
) -> Iterator[str]:
    """Yield a warning where the largest nodal pressure is a peak near the edge of the contact that facets do not resolve.

    Past yield, the pressure drops within a facet at the edge, where the nodal pressures overshoot, and undershoot and
    overshoot again on the next two facets. Below a ball, with 8, 16 and 32 nodes across the radius, the largest one was 1201,
    1020 and 998 with the continuous formulation, and 845, 920 and 940 with mortar. Means over neighbouring facets do not
    overshoot.

    In elastic bodies, there is such a peak below the rounded edge of a punch. With 1.4, 1.8 and 2.7 quad8 facets between the
    beginning of the rounding and the edge of the contact, the largest pressure was wrong by 27, 5 and 2 % with the continuous
    formulation and by 12, 6 and 1 % with mortar, at most half of the difference from the means. Where the rounding turns by
    more than a quarter of CORNER per facet, so that contact ends in its first facet, the peak was too small by up to 66 %. At
    corners, which no facets resolve, there is no such warning.
    """
    plastic, side = last.cell_fields.get("plastic_strain"), pair.secondary
    peak, is_open = int(contact.pressure.argmax()), ~contact.active & ~pair.excluded[side.points]
    near = np.arange(len(is_open)) == peak
    for _ in range(MIN_ELEMENTS_ACROSS_RADIUS):
        near = side.node_adjacency @ near > 0
    if pair.options.kind in ALWAYS_CLOSED or not (is_open & near).any():
        return
    near_open = side.extended_adjacency @ is_open > 0
    weight = np.where(contact.active, lumped_areas(side, pair.points, pair.axisymmetric), 0.0)
    inside = contact.active & ~near_open
    means = (side.extended_adjacency[inside] @ (weight * contact.pressure)) / (side.extended_adjacency[inside] @ weight)
    mean = float(means.max(initial=0.0))
    if not contact.pressure_max > (1.0 + WARNING_RATIO) * mean > 0.0:
        return
    text = (
        f"contact '{contact.name}': the largest nodal pressure, {contact.pressure_max:.4g}, is within four facets of "
        f"open nodes, and means over neighbouring facets are at most {mean:.4g}"
    )
    if plastic is not None and plastic.max(initial=0.0) >= NOTABLE:
        remedy = ", or formulation mortar" if pair.name != "mortar" and not isinstance(pair.primary, Surface) else ""
        yield (
            f"{text}. Where bodies yield, nodal pressures overshoot near the edge of the contact. Unless the contact ends at "
            f"a corner, the true maximum is between both: use smaller facets{remedy}"
        )
        return
    own_normals = DeformedSide(side, pair.points).nodal_normals
    normals = [own_normals, *([contact.normal] if isinstance(pair.primary, Surface) else [])]
    at_corner = any((normal[near] @ normal[peak]).min() < SAME_DIRECTION for normal in normals)
    # If all of the contact is near its edge, the peak may be that in the middle.
    reaches_inside = (contact.active & (side.extended_adjacency @ near_open == 0)).any()
    facing, closed = np.isfinite(contact.gap), contact.active & near
    if pair.options.cohesion is not None or not reaches_inside or not (at_corner or facing[near].all()):
        return
    error = f"may be wrong by {0.5 * (contact.pressure_max - mean):.2g}"
    if at_corner:
        if not facing[side.node_adjacency @ closed > 0].all() or not _ends_on_rounding(pair, closed, displacement):
            return
        cosine = np.einsum("nd,nd->n", own_normals, contact.normal)[near & facing]
        opening = np.degrees(np.arccos(np.clip(-cosine, -1.0, 1.0)))
        if np.cos(np.radians(opening.max())) >= SAME_DIRECTION:  # both sides turn in the same way, as around a shaft
            return
        i, j = side.node_adjacency[near & facing][:, near & facing].nonzero()
        error = (
            "may be several times as large. At the edge, the sides turn away from each other by up to "
            f"{np.abs(opening[i] - opening[j]).max():.0f} degrees within a facet, with facets of length "
            f"{side.largest_diameters(pair.points)[peak]:.2g}, which do not resolve a rounding"
        )
    groups = f"'{side.group}'" + (f" and '{pair.primary.group}'" if isinstance(pair.primary, Surface) else "")
    yield (
        f"{text}. Facets are too large for such a peak, which {error}. It needs four or more, for example between the "
        f"beginning of the rounding of a punch and the edge of the contact: use smaller facets of {groups}"
    )


def _ends_on_rounding(pair: Formulation, closed: Mask, displacement: Array) -> bool:
    """Return whether the contact ends on the rounding of a side, and not at a corner.

    At a corner, a side turns by more than the angle of SAME_DIRECTION at a single node in contact. A rounding also turns at
    open nodes, and between the nodes of curved facets. `closed` are the nodes (m,) of the secondary side in contact near the
    edge, and those of the primary side are the ones closest to them.
    """
    positions, sides = pair.points + displacement.reshape(pair.points.shape), [(pair.secondary, closed)]
    if isinstance(pair.primary, Surface):
        _, closest = KDTree(positions[pair.secondary.points]).query(positions[pair.primary.points])
        sides.append((pair.primary, closed[closest]))
    turn, bend = 0.0, 0.0
    for side, nodes in sides:
        normal, is_node = (deformed := DeformedSide(side, pair.points)).facet_normals, side.node_weights > 0.0
        means = deformed.nodal_normals[side.all_local], unit_vectors(normal.sum(axis=1))[:, None]
        at_node, in_facet = (2.0 * np.arccos(np.clip((normal * mean).sum(axis=2), -1.0, 1.0)) for mean in means)
        used = nodes[side.all_local] & is_node
        turn = max(turn, largest(at_node[used]))
        bend = max(bend, largest(in_facet[is_node & used.any(axis=1, keepdims=True)]))
    smooth = np.arccos(SAME_DIRECTION)
    # At the beginning of a rounding, straight facets turn by half as much as at its other nodes.
    return bool(turn <= smooth and max(turn, bend) > 0.5 * smooth / MIN_ELEMENTS_ACROSS_RADIUS)


def _alternation(side: Surface, values: Array, selected: Mask) -> tuple[Mask, float, Array]:
    """Return how much vectors (n_nodes, k) at `selected` nodes (n_nodes,) alternate; see `pressure_oscillation`.

    Returns
    -------
    inside : ndarray of bool (n_nodes,)
        Nodes whose neighbours are all selected.
    ratio : float
        Median of the relative differences; zero if there are too few nodes [-].
    difference : ndarray (n_inside,)
        Distances between the vectors inside and the means of their neighbours.
    """
    others = _alternation_matrix(side)
    count = np.asarray(others.sum(axis=1)).ravel()
    inside = selected & (side.node_adjacency @ ~selected == 0) & (count > 0)
    own, mean = values[inside], (others @ values)[inside] / count[inside, None]
    difference, *sizes = (np.linalg.norm(vectors, axis=1) for vectors in (own - mean, own, mean))
    relative = difference / np.maximum(0.5 * (sizes[0] + sizes[1]), TINY)
    return inside, float(np.median(relative)) if inside.sum() >= MIN_NODES else 0.0, difference


def _closed_or_enclosed(closed: Mask, side: Surface) -> Mask:
    """Return the `closed` nodes (n_nodes,) and those whose neighbours in `_alternation_matrix` are all closed."""
    others = _alternation_matrix(side)
    return closed | ((others @ ~closed == 0) & (np.diff(others.indptr) > 0))


def _alternation_matrix(side: Surface) -> csr_array:
    """Return the matrix (m, m) that is 1 for nodes of a facet between which pressures may alternate, otherwise 0.

    On quadratic facets they alternate between corners and other nodes, and on linear ones between any two.
    """
    adjacency = side.node_adjacency
    if side.order == 1:
        return csr_array(adjacency - diags_array(adjacency.diagonal()))
    is_corner = np.zeros(len(side.points))
    for block in side.blocks:
        is_corner[block.local[:, : elements.get(block.element).n_corners]] = 1.0
    corners, others = diags_array(is_corner), diags_array(1.0 - is_corner)
    return csr_array(corners @ adjacency @ others + others @ adjacency @ corners)
