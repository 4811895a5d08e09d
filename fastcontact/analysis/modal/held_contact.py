"""The contact of a settled step as linear conditions on small motions about it.

What is closed stays closed, and what sticks does not slip either; what is open or slides is free (Wriggers, Computational
Contact Mechanics, 2006, section 5.3: the active set held). Penalties are springs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import bsr_array, csr_array, diags_array, vstack

from fastcontact.arrays import Array, Indices
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.formulations._pressure_field import PressureField
from fastcontact.contact.held_motions import HeldMotions
from fastcontact.contact.tied import TiedPair, moments_of
from fastcontact.errors import ModelError
from fastcontact.model.model import Model
from fastcontact.results.step import ContactResult, StepResult


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


def held_contact(model: Model, step: StepResult | None, held: HeldMotions, hold_sliding: bool) -> HeldContact:
    """Return the conditions of all pairs at the end of a step; without one those of tied and bilateral pairs, at rest."""
    n_dofs = model.force_driven.n_dofs
    equations, nodes, springs = [csr_array((0, n_dofs))], [np.empty(0, np.intp)], []
    for pair in model.contact:
        bound, contact = model.bind(pair, held), None if step is None else step.contact[pair.name]
        if bound.options.gap_only:
            continue
        if bound.options.cohesion is not None:
            raise ModelError(f"modes know no cohesion or adhesion: tie contact '{pair.name}', or leave it out")
        at = _configuration(model, step, contact)
        position = at.obstacle if contact is not None else np.zeros(model.mesh.dim)
        constraints = model.force_driven.constraints(pair.name, bound.constraints(at), position)
        for rows, owners, softness in _rows(bound, constraints, contact, hold_sliding):
            kept = np.flatnonzero(np.diff(rows.indptr) > 0)
            if softness is None:
                equations.append(csr_array(rows[kept]))
                nodes.append(owners[kept])
            elif len(kept):
                springs.append((csr_array(rows[kept]), softness.toarray()[np.ix_(kept, kept)]))
    return HeldContact(csr_array(vstack(equations, format="csr")), np.concatenate(nodes), springs)


def _configuration(model: Model, step: StepResult | None, contact: ContactResult | None) -> Configuration:
    """Return the configuration of both sides of a pair."""
    if step is None or contact is None:
        return Configuration.undeformed(model.mesh.points)
    still = np.zeros(model.mesh.dim)
    obstacle = still if contact.obstacle_displacement is None else contact.obstacle_displacement
    angle, u = contact.obstacle_angle or 0.0, step.displacement
    return Configuration(u, u, obstacle, obstacle, angle=angle, angle_start=angle, worn=_worn(model, contact))


def _worn(model: Model, contact: ContactResult) -> Array | None:
    if contact.wear is None:
        return None
    depth = np.zeros(model.mesh.n_points)
    depth[contact.points] = contact.wear
    return depth


def _rows(
    pair: Formulation, constraints: Constraints, contact: ContactResult | None, hold_sliding: bool
) -> Iterator[tuple[csr_array, Indices, csr_array | None]]:
    """Yield rows along the normal and along each tangent, their nodes, and their compliance matrix, if any.

    They are tested with the formulation's multipliers, as those of tied pairs are, see `contact.tied`.
    """
    if isinstance(constraints.tied, TiedPair):
        node = _nodes(pair, constraints, constraints.tied.moments)
        yield constraints.B, np.tile(pair.secondary.points[node].astype(np.intp), len(constraints) // len(node)), None
        return
    moments = moments_of(constraints)
    node = _nodes(pair, constraints, moments)
    owners = pair.secondary.points[node].astype(np.intp)
    always = np.zeros(len(constraints), bool) if constraints.equality is None else constraints.equality
    closed = abs(moments) @ always.astype(float) > 0.0
    sticking = np.zeros(len(closed), bool)
    if contact is not None:
        closed |= contact.active[node]
        rubs = abs(moments) @ (constraints.coefficients > 0.0).astype(float) > 0.0
        sticking = (contact.active & (contact.sticking | hold_sliding))[node] & rubs
    for along, held, softness in (
        (constraints.B, closed, constraints.softness),
        *((tangent, sticking, constraints.tangential_softness) for tangent in constraints.tangents),
    ):
        tested = csr_array(moments[np.flatnonzero(held)])
        gives = softness is not None and (tested @ softness).any()
        compliance = csr_array(tested @ diags_array(softness) @ tested.T) if gives else None
        yield csr_array(tested @ along), owners[held], compliance


def _nodes(pair: Formulation, constraints: Constraints, moments: csr_array) -> Indices:
    """Return the secondary node (q,), as an index on its side, of each row of the moments (q, m)."""
    if isinstance(constraints.nodal, PressureField):
        field = constraints.nodal
        alone = moments.indices[moments.indptr[len(field.independent) : -1]]  # points on an axis
        nearest = field.around[alone, field.shape[alone].argmax(axis=1)]
        return np.concatenate([field.independent, nearest])
    points = pair.secondary.points
    if constraints.nodes is None:
        return np.arange(len(points))
    order = np.argsort(points)
    return np.asarray(order[np.searchsorted(points, constraints.nodes[: moments.shape[0]], sorter=order)])
