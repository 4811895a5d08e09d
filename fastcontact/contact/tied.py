"""Tied contact: no opening and no slip, as linear equations that hold from the beginning.

The sides are paired once, in the undeformed configuration; the relative displacement of points that face each other stays
zero in every direction. The test functions are the formulation's multipliers: one set of equations per node where forces
are nodal; moments with the functions of the multiplier field where forces act at integration points, which is the mortar
method (Bernardi, Maday and Patera, 1994), so that complementarity parameters have no influence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, diags_array, eye_array, vstack

from fastcontact.arrays import Array, Indices
from fastcontact.contact.constraints import Constraints, NodalField
from fastcontact.contact.multiplier_field import Projection
from fastcontact.round_off import ROUND_OFF, TINY


@dataclass(frozen=True, eq=False)
class TiedPair:
    """The equations of a tied pair.

    Attributes
    ----------
    moments : csr_array (q, m)
        From the gaps at the m constraint points of the formulation to the q gaps that vanish.
    rows : tuple of csr_array (q, n_dofs)
        Relative displacement along the normal and each tangent.
    directions : tuple of ndarray (m, dim)
        The tangents.
    positions : ndarray (q, dim)
        Approximate positions of the equations on the reference surface [length].
    nodal : NodalField
        Nodal interpretation of the forces at the constraint points.
    nodes : ndarray of int (q,), optional
        The secondary nodes that the gaps belong to, see `Constraints`.
    areas : ndarray (q,), optional
        Integrals of the functions that the equations are tested with [area].
    reduction : csr_array (q dim, q dim), optional
        All multipliers by those that are left where supports hold both sides, see `tied_at_supports`.
    """

    moments: csr_array
    rows: tuple[csr_array, ...]
    directions: tuple[Array, ...]
    positions: Array
    nodal: NodalField
    nodes: Indices | None = None
    areas: Array | None = None
    reduction: csr_array | None = None

    def constraints(self) -> Constraints:
        """Return the equations."""
        B = csr_array(vstack(self.rows, format="csr"))
        positions = np.tile(self.positions, (len(self.rows), 1))
        always = np.ones(B.shape[0], bool)
        nodes = None if self.nodes is None else np.tile(self.nodes, len(self.rows))
        return Constraints(
            B, np.zeros(B.shape[0]), positions, equality=always, nodes=nodes, nodal=self.nodal, tied=self
        )

    def forces(self, multiplier: Array) -> tuple[Array, Array]:
        """Return normal (m,) and tangential (m, k) forces at the constraint points of the formulation."""
        multiplier = multiplier if self.reduction is None else self.reduction @ multiplier
        components = [self.moments.T @ component for component in multiplier.reshape(len(self.rows), -1)]
        return components[0], np.column_stack(components[1:])


def tied(constraints: Constraints, moments: csr_array, areas: Array | None, reduction: csr_array | None) -> TiedPair:
    """Return the tying equations of `constraints`, which have tangents; see `moments_of` and `TiedPair`."""
    size = np.maximum(np.asarray(abs(moments).sum(axis=1)).ravel(), TINY)
    positions = abs(moments) @ constraints.positions / size[:, None]
    rows = [csr_array(moments @ along) for along in (constraints.B, *constraints.tangents)]
    if reduction is not None:
        whole, q = csr_array(reduction.T @ vstack(rows, format="csr")), len(size)
        rows = [csr_array(whole[first : first + q]) for first in range(0, whole.shape[0], q)]
    assert constraints.nodal is not None
    return TiedPair(
        moments, tuple(map(_cleaned, rows)), constraints.directions, positions, constraints.nodal, constraints.nodes, areas,
        reduction,
    )  # fmt: skip


def moments_of(constraints: Constraints) -> tuple[csr_array, Array | None]:
    """Return the matrix (q, m) whose rows are the basis functions of the multipliers.

    The second result are the integrals (q,) of these functions, if known [area].
    """
    if not isinstance(constraints.compliance, Projection):
        return csr_array(eye_array(len(constraints.gap0), format="csr")), constraints.areas
    P, areas = constraints.compliance.P, constraints.compliance.areas
    weighted = csr_array(P.T @ diags_array(areas))
    scale = np.asarray(abs(weighted).sum(axis=1)).ravel()
    on_axis = np.flatnonzero((areas == 0.0) & constraints.usable)  # at the axis
    single = csr_array((np.ones(len(on_axis)), (np.arange(len(on_axis)), on_axis)), shape=(len(on_axis), len(areas)))
    scales = np.concatenate([scale, np.zeros(len(on_axis))])
    return csr_array(vstack([diags_array(1.0 / np.maximum(scale, TINY)) @ weighted, single])), scales


def _cleaned(rows: csr_array) -> csr_array:
    rows.data[np.abs(rows.data) < ROUND_OFF * np.abs(rows.data).max(initial=0.0)] = 0.0
    rows.eliminate_zeros()
    return rows
