"""The contact of a converged step for small motions about it: linear conditions, and the stiffness of contact forces.

The active set is fixed: closed constraints stay closed, sticking ones do not slip, open and sliding ones are free (Wriggers,
Computational Contact Mechanics, 2006, section 5.3). Penalties are springs. Contact forces follow the motion of the surfaces.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from scipy.sparse import block_diag, bsr_array, csr_array, diags_array, vstack

from fastcontact._tools.records import record, replace
from fastcontact.analysis.resultants import end_of
from fastcontact.arrays import Array, Indices, scattered
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.held_motions import HeldMotions
from fastcontact.contact.integration import areas_of_rule, fine_rule
from fastcontact.contact.pairing import Candidates
from fastcontact.contact.tied import TiedPair, moments_of, split_rows
from fastcontact.errors import ModelError
from fastcontact.model.model import Model
from fastcontact.results.step import ContactResult, StepResult


@record
class Conditions:
    """Relative displacements of a contact pair along its normals or tangents, which vanish or have a compliance.

    Attributes
    ----------
    rows : csr_array (m, n_dofs)
        Derivatives of the relative displacements with respect to all displacements [-].
    nodes : ndarray of int (m,)
        Secondary node of each condition.
    areas : ndarray (m,)
        Area of each condition, where known [area].
    directions : ndarray (m, dim), optional
        Tangents, for conditions along them [-].
    compliance : csr_array (m, m), optional
        Compliance of the conditions [length / force].
    """

    rows: csr_array
    nodes: Indices
    areas: Array
    directions: Array | None = None
    compliance: csr_array | None = None


@record
class HeldContact:
    """Constraints and compliance of closed contact for small motions.

    Attributes
    ----------
    rows : csr_array (m, n_dofs)
        Relative displacements that vanish [-].
    nodes : ndarray of int (m,)
        Secondary node of each relative displacement.
    springs : list of (csr_array (m, n_dofs), ndarray (m, m))
        Compliant rows [-], and their compliance [length / force].
    """

    rows: csr_array
    nodes: Indices
    springs: list[tuple[csr_array, Array]]

    def stiffened(self, K: bsr_array) -> bsr_array:
        """Return the stiffness K (n_dofs, n_dofs) with the springs [force / length]."""
        for rows, compliance in self.springs:
            K = bsr_array(K + csr_array(rows.T @ csr_array(np.linalg.inv(compliance)) @ rows).tobsr(K.blocksize))
        return K


def assembled(all_conditions: Iterable[Conditions], n_dofs: int) -> HeldContact:
    """Return the held contact that consists of all conditions, for `n_dofs` displacements."""
    equations, nodes, springs = [csr_array((0, n_dofs))], [np.empty(0, np.intp)], []
    for conditions in all_conditions:
        nonempty = np.flatnonzero(np.diff(conditions.rows.indptr) > 0)
        if conditions.compliance is None:
            equations.append(csr_array(conditions.rows[nonempty]))
            nodes.append(conditions.nodes[nonempty])
        elif len(nonempty):
            compliance = conditions.compliance.toarray()[np.ix_(nonempty, nonempty)]
            springs.append((csr_array(conditions.rows[nonempty]), compliance))
    return HeldContact(csr_array(vstack(equations, format="csr")), np.concatenate(nodes), springs)


def held_contact(model: Model, step: StepResult | None, held: HeldMotions, hold_sliding: bool) -> list[Conditions]:
    """Return the conditions of all pairs at the end of a step; without a step, those of tied and bilateral pairs."""
    conditions: list[Conditions] = []
    for pair in model.contact:
        formulation = model.bind(pair, held, sectors_alike=False)
        contact = None if step is None else step.contact[pair.name]
        if formulation.options.kind == "gap_only":
            continue
        if formulation.options.cohesion is not None:
            raise ModelError(f"modes do not support cohesion or adhesion: tie contact '{pair.name}', or leave it out")
        configuration = configuration_of(step, pair.name, formulation)
        constraints = formulation.constraints(configuration)
        if model.force_driven.pairs:
            constraints = model.force_driven.constraints(pair.name, constraints, configuration.pose.displacement)
        conditions += _conditions(formulation, constraints, contact, hold_sliding)
    return conditions


def configuration_of(step: StepResult | None, name: str, pair: Formulation) -> Configuration:
    """Return the configuration of a pair at the end of a step, or at rest."""
    if step is None:
        return Configuration.undeformed(pair.points)
    contact = step.contact[name]
    configuration = replace(end_of(step, step, name), pressure=contact.pressure)
    if contact.wear is None:
        return configuration
    return replace(configuration, wear_depth=scattered(contact.wear, contact.points, len(pair.points)))


def _conditions(
    pair: Formulation, constraints: Constraints, contact: ContactResult | None, hold_sliding: bool
) -> Iterator[Conditions]:
    """Yield conditions along the normals and along the tangents.

    The test functions are the formulation's multipliers, as for tied pairs, see `contact.tied`.
    """
    tied = constraints.tied if isinstance(constraints.tied, TiedPair) else None
    moments, areas = moments_of(constraints) if tied is None else (tied.moments, tied.areas)
    side_rows = pair.nodes_of(constraints, moments)
    nodes, n = pair.secondary.points[side_rows].astype(np.intp), len(side_rows)
    areas = np.ones(n) if areas is None else areas
    tangents = constraints.directions if tied is None else tied.directions
    directions = [np.asarray(moments @ tangent) for tangent in tangents]
    if tied is not None:
        normal_rows, *tangential_rows = split_rows(constraints.B, 1 + len(directions))
        yield Conditions(normal_rows, nodes, areas)
        if directions:
            yield _tangential_conditions(directions, tangential_rows, np.arange(n), nodes, areas)
        return
    closed = abs(moments) @ constraints.equality.astype(float) > 0.0
    sticking = np.zeros(len(closed), bool)
    if contact is not None:
        closed |= contact.active[side_rows]
        frictional = abs(moments) @ (constraints.friction > 0.0).astype(float) > 0.0
        sticking = (contact.active & (contact.sticking | hold_sliding))[side_rows] & frictional
    closed_rows, sticking_rows = np.flatnonzero(closed), np.flatnonzero(sticking)
    weights = csr_array(moments[closed_rows])
    compliance = _compliance(weights, constraints.softness[0])
    yield Conditions(csr_array(weights @ constraints.B), nodes[closed_rows], areas[closed_rows], compliance=compliance)
    if constraints.tangents:
        weights = csr_array(moments[sticking_rows])
        rows = [weights @ T for T in constraints.tangents]
        compliance = _compliance(weights, constraints.softness[1])
        yield _tangential_conditions(directions, rows, sticking_rows, nodes, areas, compliance)


def _tangential_conditions(
    directions: Sequence[Array], rows: Sequence[csr_array], selected: Indices, nodes: Indices, areas: Array,
    compliance: csr_array | None = None,
) -> Conditions:  # fmt: skip
    """Return the conditions along k tangents, given the rows (q, n_dofs) of each for the `selected` (q,) multipliers."""
    k = len(rows)
    repeated_compliance = None if compliance is None else csr_array(block_diag([compliance] * k, format="csr"))
    stacked = csr_array(vstack(rows, format="csr"))
    tangents = np.concatenate([direction[selected] for direction in directions])
    return Conditions(stacked, np.tile(nodes[selected], k), np.tile(areas[selected], k), tangents, repeated_compliance)


def _compliance(weights: csr_array, softness: Array) -> csr_array | None:
    if not (weights @ softness).any():
        return None
    return csr_array(weights @ diags_array(softness) @ weights.T)


def contact_stiffness(model: Model, step: StepResult, held: HeldMotions) -> csr_array:
    """Return the stiffness (n_dofs, n_dofs) of the contact forces of a step, with the degrees of freedom of obstacles.

    Its unit is [force / length]. The multipliers are constant, so that the second variation of the energy is that of
    ``-multiplier @ gap``: the normals of the primary side rotate, and the secondary side slides along its curvature.
    """
    driven = model.force_driven
    K = csr_array((driven.n_dofs, driven.n_dofs))
    for pair in model.contact:
        formulation = model.bind(pair, held, sectors_alike=False)
        if formulation.options.kind not in ("gap_only", "tied"):
            stiffness = _pair_stiffness(formulation, step, pair.name, model.strain == "finite")
            K += driven.contact_stiffness(pair.name, stiffness)
    return K


def _pair_stiffness(pair: Formulation, step: StepResult, name: str, finite: bool) -> csr_array:
    """Return the stiffness (n_dofs, n_dofs) of the pressure on the secondary side of a pair [force / length]."""
    configuration, deformed, pressure = configuration_of(step, name, pair), pair.points + step.displacement, []
    for block in pair.secondary.blocks:
        shape, areas = areas_of_rule(block, deformed if finite else pair.points, pair.axisymmetric)
        pressure.append((areas * (step.contact[name].pressure[block.local] @ shape.T)).ravel())
    force = np.concatenate(pressure)
    candidates = Candidates.in_facets(pair.secondary, [fine_rule(block.element)[0] for block in pair.secondary.blocks])
    pairing = pair.pair_candidates(candidates, configuration)
    rows = np.flatnonzero(pairing.paired & (force != 0.0))
    normals = "facet" if pair.normals == "secondary" else pair.normals
    return pair.linearised_points(candidates, pairing, rows, configuration, normals).stiffness(force[rows])
