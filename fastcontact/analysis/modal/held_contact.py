"""The contact of a converged step as linear conditions on small motions about it.

The active set is fixed: closed constraints stay closed, sticking ones do not slip, open and sliding ones are free (Wriggers,
Computational Contact Mechanics, 2006, section 5.3). Penalties are springs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import block_diag, bsr_array, csr_array, diags_array, vstack

from fastcontact.analysis.resultants import end_of
from fastcontact.analysis.wear import at_points
from fastcontact.arrays import Array, Indices
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.held_motions import HeldMotions
from fastcontact.contact.tied import TiedPair, moments_of
from fastcontact.errors import ModelError
from fastcontact.model.model import Model
from fastcontact.results.step import ContactResult, StepResult


@dataclass(frozen=True, eq=False)
class Conditions:
    """Relative displacements of one contact pair, along its normals or along its tangents, that vanish or have a compliance.

    Attributes
    ----------
    rows : csr_array (m, n_dofs)
        [-].
    nodes : ndarray of int (m,)
        The secondary node of each.
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


@dataclass(frozen=True, eq=False)
class HeldContact:
    """Constraints and compliance of closed contact for small motions.

    Attributes
    ----------
    rows : csr_array (m, n_dofs)
        Relative displacements that vanish [-].
    nodes : ndarray of int (m,)
        The secondary node of each.
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


def joined(
    held: Sequence[Conditions], n_dofs: int, join: Callable[[Conditions], Conditions] = lambda conditions: conditions
) -> HeldContact:
    """Return all conditions as one, for `n_dofs` displacements; `join` first maps each to conditions of a whole ring."""
    equations, nodes, springs = [csr_array((0, n_dofs))], [np.empty(0, np.intp)], []
    for conditions in map(join, held):
        kept = np.flatnonzero(np.diff(conditions.rows.indptr) > 0)
        if conditions.compliance is None:
            equations.append(csr_array(conditions.rows[kept]))
            nodes.append(conditions.nodes[kept])
        elif len(kept):
            springs.append((csr_array(conditions.rows[kept]), conditions.compliance.toarray()[np.ix_(kept, kept)]))
    return HeldContact(csr_array(vstack(equations, format="csr")), np.concatenate(nodes), springs)


def held_contact(model: Model, step: StepResult | None, held: HeldMotions, hold_sliding: bool) -> list[Conditions]:
    """Return the conditions of all pairs at the end of a step; without a step, those of tied and bilateral pairs."""
    conditions: list[Conditions] = []
    for pair in model.contact:
        bound, contact = model.bind(pair, held, sectors_alike=False), None if step is None else step.contact[pair.name]
        if bound.options.gap_only:
            continue
        if bound.options.cohesion is not None:
            raise ModelError(f"modes do not support cohesion or adhesion: tie contact '{pair.name}', or leave it out")
        at = Configuration.undeformed(model.mesh.points) if step is None else end_of(step, step, pair.name)
        if contact is not None and contact.wear is not None:
            at = replace(at, worn=at_points(contact.points, contact.wear, model.mesh.n_points))
        constraints = bound.constraints(at)
        if model.force_driven.pairs:
            constraints = model.force_driven.constraints(pair.name, constraints, at.pose.displacement)
        conditions += _conditions(bound, constraints, contact, hold_sliding)
    return conditions


def _conditions(
    pair: Formulation, part: Constraints, contact: ContactResult | None, hold_sliding: bool
) -> Iterator[Conditions]:
    """Yield conditions along the normals and along the tangents.

    The test functions are the formulation's multipliers, as for tied pairs, see `contact.tied`.
    """
    tied = part.tied if isinstance(part.tied, TiedPair) else None
    moments, areas = moments_of(part) if tied is None else (tied.moments, tied.areas)
    node = pair.nodes_of(part, moments)
    owners, n = pair.secondary.points[node].astype(np.intp), len(node)
    areas = np.ones(n) if areas is None else areas
    along = part.directions if tied is None else tied.directions
    directions = [np.asarray(moments @ tangent) for tangent in along]
    if tied is not None:
        yield Conditions(tied.rows[0], owners, areas)
        if directions:
            yield _along(directions, tied.rows[1:], np.arange(n), owners, areas)
        return
    closed = abs(moments) @ part.equality.astype(float) > 0.0
    sticking = np.zeros(len(closed), bool)
    if contact is not None:
        closed |= contact.active[node]
        rubs = abs(moments) @ (part.friction > 0.0).astype(float) > 0.0
        sticking = (contact.active & (contact.sticking | hold_sliding))[node] & rubs
    held, stuck = np.flatnonzero(closed), np.flatnonzero(sticking)
    tested = csr_array(moments[held])
    yield Conditions(
        csr_array(tested @ part.B), owners[held], areas[held], compliance=_compliance(tested, part.softness)
    )
    if part.tangents:
        tested = csr_array(moments[stuck])
        rows, give = [tested @ T for T in part.tangents], _compliance(tested, part.tangential_softness)
        yield _along(directions, rows, stuck, owners, areas, give)


def _along(
    directions: Sequence[Array], rows: Sequence[csr_array], kept: Indices, owners: Indices, areas: Array,
    compliance: csr_array | None = None,
) -> Conditions:  # fmt: skip
    """Return the conditions along all tangents, with rows (k, n_dofs) for the `kept` (k,) of the q multipliers of a pair."""
    count = len(rows)
    give = None if compliance is None else csr_array(block_diag([compliance] * count, format="csr"))
    stacked = csr_array(vstack(rows, format="csr"))
    tangents = np.concatenate([direction[kept] for direction in directions])
    return Conditions(stacked, np.tile(owners[kept], count), np.tile(areas[kept], count), tangents, give)


def _compliance(tested: csr_array, softness: Array) -> csr_array | None:
    if not (tested @ softness).any():
        return None
    return csr_array(tested @ diags_array(softness) @ tested.T)
