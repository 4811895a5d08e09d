"""Contact constraints: ``gap >= 0``, ``multiplier >= 0`` and ``gap * multiplier = 0`` for each row of a matrix B.

In this module m is the number of constraints, n_dofs the number of displacement components of the mesh, n_nodes the number of
secondary nodes, and k the number of tangents, which is one in 2D, two in 3D, and zero without friction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse import csr_array, hstack, vstack

from fastcontact._tools.records import field, record, replace
from fastcontact.arrays import AnyArray, Array, Indices, Mask
from fastcontact.contact.overclosure import OverclosureLaw
from fastcontact.contact.pairing import normals
from fastcontact.contact.surface import Surface, by_block
from fastcontact.linear.field_compliance import FieldCompliance
from fastcontact.linear.sparse_rows import scaled
from fastcontact.round_off import LENGTH_ROUND_OFF


class Compliance(Protocol):
    """A symmetric positive semidefinite matrix C (m, m) that is diagonal except for a small rank [length / force]."""

    def block(self, rows: Indices) -> Array:
        """Return the submatrix (q, q) of C for the constraints `rows` (q,)."""

    def block_operator(self, rows: Indices) -> Array | FieldCompliance:
        """Return the value of `block`, or an equivalent object that linear solvers can use without forming the submatrix."""

    def apply(self, multiplier: Array) -> Array:
        """Return ``C @ multiplier`` [length] for multipliers (m,) or vectors of forces (m, dim) [force]."""

    def split(self, rows: Indices) -> tuple[Array, csr_array, Array]:
        """Return d (q,), P (q, k) and S (k, k) of the submatrix ``diag(d) - P S P.T`` for the constraints `rows` (q,)."""


class NodalField(Protocol):
    """Map from the forces of constraints to pressures at the secondary nodes.

    Attributes
    ----------
    nodal_areas : ndarray (n_nodes,)
        Integrals of the shape functions of the nodes over the secondary side [area].
    covered : ndarray (n_nodes,) or float
        Fraction of the area of each node in which contact is possible. It is less than 1 if parts of its facets face no
        primary facet, or if options of the pair exclude them [-].
    """

    nodal_areas: Array

    @property
    def covered(self) -> Array | float:
        """Covered fraction of the nodal areas, see `NodalField`; 1 if a formulation integrates over complete facets only."""
        return 1.0

    def pressure(self, force: Array) -> Array:
        """Return nodal pressures (n_nodes,) per unit reference area [pressure] for normal forces (m,) [force].

        In partly covered facets the pressure refers to the covered part of the area.
        """

    def traction(self, force: Array) -> Array:
        """Return nodal tractions (n_nodes, dim) [pressure] for forces (m, dim) [force], like `side_pressure`."""
        return np.column_stack(list(map(self.side_pressure, force.T)))

    def side_pressure(self, force: Array) -> Array:
        """Return nodal pressures (n_nodes,) [pressure] per unit of the complete area of each node.

        The area includes parts without an opposite facet. The integral of these pressures over the complete secondary side
        is the sum of `force` (m,) [force].
        """
        return self.pressure(force) * self.covered

    def at_nodes(self, coefficients: Array) -> Array:
        """Return the nodal values (n_nodes,) of a field with `coefficients` (n_nodes,).

        They are the coefficients unless the functions by which the forces of the nodes are weighted are no shape functions.
        """
        return coefficients

    def nodal_forces(self, force: Array) -> Array:
        """Return the normal forces `force` (m,) of the constraints, distributed to the nodes (n_nodes,) [force].

        The result is the product of `side_pressure` and the nodal areas, except at nodes whose areas vanish.
        """
        return self.side_pressure(force) * self.nodal_areas

    def uncovered(self, side: Surface, usable: Mask) -> list[Array]:
        """Return the fraction (n_facets, n_nodes) of the area of each node where no contact is possible [-].

        The fractions are nodal values of a field, whose integral is the area where no contact is possible. They may be
        negative on quadratic facets.

        `side` is the secondary side; there is an array for each block of its facets. `usable` (m,) are the constraints that
        can close.
        """
        uncovered = self.at_nodes(np.clip(1.0 - np.broadcast_to(self.covered, self.nodal_areas.shape), 0.0, 1.0))
        return [uncovered[block.local] for block in side.blocks]

    def weighted_gaps(self, gaps: Array) -> tuple[Array, Indices]:
        """Return nodal gaps and the node of each constraint.

        Parameters
        ----------
        gaps : ndarray (m,)
            Gaps of the constraints, infinite if unpaired [length].

        Returns
        -------
        nodal : ndarray (n_nodes,)
            Gaps at the nodes, infinite for nodes without an opposite facet [length].
        nearest : ndarray of int (m,)
            Number, on the secondary side, of the node nearest to each constraint.
        """
        return gaps, np.arange(len(gaps))

    def closed_nodes(self, active: Mask, gap: Array, pressure: Array) -> Mask:
        """Return the nodes in contact.

        For formulations with one constraint per node, they are the nodes of the active constraints.

        Parameters
        ----------
        active : ndarray of bool (m,)
            Active set.
        gap : ndarray (n_nodes,)
            Nodal gaps [length].
        pressure : ndarray (n_nodes,)
            Nodal pressures [pressure].

        Returns
        -------
        ndarray of bool (n_nodes,)
        """
        return active

    def initial_active_set(self, gap: Array, pressure: Array, previous: Mask) -> Mask:
        """Return an initial guess (m,) of the active set.

        `gap` (m,) are the gaps [length]. `pressure` (n_nodes,) are the nodal pressures [pressure], and `previous` (m,) is the
        active set of the previous pairing. If all pairings have the same constraints, `previous` is the best guess.
        """
        return previous


class WettedRegion(Protocol):
    """Part of a contact that fluid fills; see `fluid_pressure.WettedRegion`."""

    @property
    def rows(self) -> Mask:
        """Constraints (m,) in the part that fluid fills."""

    @property
    def pressure(self) -> Array:
        """Fluid pressure at the secondary nodes (n_nodes,) [pressure]."""

    def force(self, displacement: Array) -> Array:
        """Return the nodal forces (n_points, dim) of the fluid on the secondary side [force].

        `displacement` (n_points, dim) are the displacements of all points [length].
        """

    def stiffness(self, displacement: Array) -> csr_array:
        """Return the symmetric part (n_dofs, n_dofs) of the negative derivative of `force` [force / length]."""


class Linearised(Protocol):
    """Contact forces, gaps and slips of one pair, linearised about a pairing and its solution; see `linearised_geometry`."""

    def derivatives_along(self, du: Array) -> tuple[Array, Array]:
        """Return the directional derivatives along `du` (n_points, dim) [length].

        They are those of the nodal forces (n_points, dim) [force] and of the gaps and slips (1 + k, m) [length].
        """
        ...


# A function that returns the linearised geometry for the multipliers (m,) [force], the tangential forces (m, k) [force] and
# the displacements (n_points, dim) [length] of a solution.
Geometry = Callable[[Array, Array, Array], Linearised]


class Tied(Protocol):
    """Linear equations that replace the contact inequalities of a pair, see `tied.TiedPair`."""

    @property
    def directions(self) -> tuple[Array, ...]:
        """Tangents (m, dim) at the constraints of the formulation."""

    def forces(self, multiplier: Array) -> tuple[Array, Array]:
        """Return the normal (m,) and tangential (m, k) forces at the constraints of the formulation [force].

        `multiplier` are the multipliers of the equations [force].
        """


_SCALARS = "friction", "equality", "wear_softness", "prescribed"


@record
class Constraints:
    """Contact constraints ``gap0 + B u + C multiplier >= 0`` with multipliers >= 0, or equations.

    An optional attribute is None if it is zero or if the constraints lack the feature. Other attributes have zeros for all
    constraints if an empty array is passed.

    Attributes
    ----------
    B : csr_array (m, n_dofs)
        Derivatives of the gaps with respect to the displacements u [-]. A constraint with an empty row cannot close.
    gap0 : ndarray (m,)
        Gaps at u = 0 without contact forces [length].
    positions : ndarray (m, dim)
        Points of the undeformed secondary surface at which the gaps are measured [length].
    compliance : Compliance, optional
        Compliance C of the constraints themselves [length / force].
    tangents : tuple of k csr_array (m, n_dofs)
        For each tangent, derivatives of the tangential displacement relative to the primary side with respect to the
        displacements [-]; empty without friction.
    directions : tuple of k ndarray (m, dim)
        Unit tangents [-].
    coupled_directions : tuple of k ndarray (m, dim)
        Unit tangents in the axes in which C couples the components of force vectors; empty if these are the axes of the mesh
        [-].
    slip0 : ndarray (k, m)
        Part of the slips of the load step that does not depend on the displacements u: minus the motion of a rigid primary
        side in the step, or minus the tangential displacement that closes the gap [length].
    friction : ndarray (m,)
        Coefficients of friction [-].
    equality : ndarray of bool (m,)
        Whether each constraint is an equation, with a multiplier of either sign.
    softness : ndarray (1 + k, m)
        Compliance of each constraint along its normal and its tangents, in addition to C [length / force].
    wear_softness : ndarray (m,)
        Part of the compliance along the normal that is due to wear and stores no energy [length / force].
    elastic_slip : ndarray (k, m)
        Minus the elastic slip of the tangential compliance at the beginning of the load step. It is added to the slip of the
        step, so that only the change of the forces in the step causes elastic slip [length].
    low_rank_compliance : ndarray (1 + k, m, h)
        Factor Z of a compliance ``Z @ Z.T`` in addition to C. ``Z[0]`` belongs to the normal forces, ``Z[1:]`` to the forces
        along the tangents [(length / force)^(1/2)].
    driven : ndarray (k, m), optional
        Slips that supports and obstacles impose, divided by the largest imposed displacement [-].
    law : OverclosureLaw, optional
        Pressure-overclosure law of which `gap0` and `softness` are the linearisation.
    branches : ndarray of int, optional
        Branch of the cohesive law at each point of a cohesive layer.
    wetted : WettedRegion, optional
        Part of the contact that fluid fills.
    areas : ndarray (m,), optional
        Area of each constraint, infinite for constraints that cannot carry forces [area].
    nodes : ndarray of int (m,), optional
        The secondary node of each constraint, for formulations with one constraint per node.
    nodal : NodalField, optional
        Map from normal forces to pressures at the secondary nodes.
    tied : Tied, optional
        Data of a tied pair or a cohesive layer, if the constraints are its equations.
    geometry : Geometry, optional
        Derivatives of B and of the gaps with respect to the displacements; None if they are zero or not available.
    prescribed : ndarray of bool (m,)
        Whether supports prescribe the gap of each constraint, whose row of B is then empty. Its softness determines its
        force.
    """

    B: csr_array
    gap0: Array
    positions: Array
    compliance: Compliance | None = None
    tangents: tuple[csr_array, ...] = ()
    directions: tuple[Array, ...] = ()
    friction: Array = field(default_factory=np.empty(0).copy)
    slip0: Array = field(default_factory=np.empty(0).copy)
    equality: Mask = field(default_factory=np.empty(0, bool).copy)
    softness: Array = field(default_factory=np.empty(0).copy)
    wear_softness: Array = field(default_factory=np.empty(0).copy)
    low_rank_compliance: Array = field(default_factory=np.empty(0).copy)
    elastic_slip: Array = field(default_factory=np.empty(0).copy)
    areas: Array | None = None
    nodes: Indices | None = None
    nodal: NodalField | None = None
    tied: Tied | None = None
    driven: Array | None = None
    law: OverclosureLaw | None = None
    branches: AnyArray | None = None
    wetted: WettedRegion | None = None
    coupled_directions: tuple[Array, ...] = ()
    geometry: Geometry | None = None
    prescribed: Mask = field(default_factory=np.empty(0, bool).copy)

    def __post_init__(self) -> None:
        k, m = len(self.tangents), len(self.gap0)
        shapes: dict[str, tuple[int, ...]] = dict.fromkeys(_SCALARS, (m,))
        shapes |= {"slip0": (k, m), "elastic_slip": (k, m)}
        shapes |= {"softness": (1 + k, m), "low_rank_compliance": (1 + k, m, 0)}
        for name, shape in shapes.items():
            if not (values := getattr(self, name)).any():  # also zeros for another number of tangents
                object.__setattr__(self, name, np.zeros(shape, values.dtype))

    def __len__(self) -> int:
        return len(self.gap0)

    @property
    def usable(self) -> Mask:
        """Constraints (m,) that can close."""
        return np.asarray((np.diff(self.B.indptr) > 0) | self.prescribed)

    def normal_compliance(self, rows: Indices) -> Array | None:
        """Return the compliance along the normals of the constraints `rows` (q,), None if all have none [length / force].

        It is the sum (q, q) of C and `softness`, or only the diagonal (q,) without C.
        """
        softness = self.softness[0]
        if self.compliance is None:
            return softness[rows] if softness.any() else None
        return np.diag(softness[rows]) + self.compliance.block(rows)

    def normal_compliance_operator(self, rows: Indices) -> Array | FieldCompliance | None:
        """Return `normal_compliance`, or an equivalent object, see `Compliance.block_operator`."""
        softness, C = self.softness[0, rows], self.compliance
        if C is None or not isinstance(operator := C.block_operator(rows), FieldCompliance):
            return self.normal_compliance(rows)
        if not softness.any():
            return operator
        return operator.softened(softness, lambda: np.diag(softness) + C.block(rows))

    def elastic_gaps(self, multiplier: Array) -> Array:
        """Return the changes (m,) of the gaps due to the compliance along the normals under multipliers (m,) [length]."""
        gaps = self.softness[0] * multiplier
        return gaps if self.compliance is None else gaps + self.compliance.apply(multiplier)

    @property
    def coupled(self) -> bool:
        """Whether a compliance couples different constraints."""
        return self.compliance is not None or self.low_rank_compliance.size > 0

    @property
    def finite_areas(self) -> Array:
        """Areas (m,), zero for constraints that have no area or cannot carry forces [area]."""
        return np.zeros(len(self)) if self.areas is None else np.where(np.isfinite(self.areas), self.areas, 0.0)

    def imposes_slip(self, rows: Indices, Q: csr_array | None) -> Mask:
        """Return whether supports or obstacles impose a slip along each tangent (k, q) of the constraints `rows` (q,).

        The tangents are rotated by Q ((1 + k) q, (1 + k) q) if it is given, see `cone_newton.aligning_rotation`.
        """
        if self.driven is None:
            return np.zeros((len(self.tangents), len(rows)), bool)
        slips = np.vstack([np.zeros(len(rows)), self.driven[:, rows]])
        rotated = slips if Q is None else (Q @ slips.ravel()).reshape(slips.shape)
        return np.asarray(np.abs(rotated[1:]) > LENGTH_ROUND_OFF)

    def gaps(self, displacement: Array) -> Array:
        """Return the gaps ``gap0 + B u`` (m,) for displacements (n_points, dim), without the compliance [length]."""
        return np.asarray(self.gap0 + self.B @ displacement.ravel())

    def without(self, open_constraints: Mask) -> Constraints:
        """Return a copy in which the constraints that the mask `open_constraints` (m,) marks cannot close."""
        if not open_constraints.any():
            return self
        B, *tangents = (scaled(matrix, 1.0 - open_constraints) for matrix in (self.B, *self.tangents))
        return replace(self, B=B, tangents=tuple(tangents))

    def gaps_at_rest(self) -> Array:
        """Return the gaps and the slips along each tangent (1 + k, m) at u = 0 without contact forces [length]."""
        return np.vstack([self.gap0, self.slip0 + self.elastic_slip])

    def force(self, multiplier: Array, tangential: Array | None = None) -> Array:
        """Return the nodal contact forces (n_dofs,) for multipliers (m,) and tangential forces (m, k) [force]."""
        total: Array = self.B.T @ multiplier
        for tangent, forces in zip(self.tangents, () if tangential is None else tangential.T, strict=True):
            total += tangent.T @ forces
        return total

    def normal_forces(self, multiplier: Array) -> Array:
        """Return the normal forces (m,) at the constraints of the formulation [force].

        These are the multipliers, except in tied pairs and cohesive layers, see `Tied.forces`.
        """
        return multiplier if self.tied is None else self.tied.forces(multiplier)[0]

    def contact_forces(self, multiplier: Array) -> Array:
        """Return the multipliers (m,), set to zero at constraints where fluid separates the surfaces [force]."""
        return multiplier if self.wetted is None else np.where(self.wetted.rows, 0.0, multiplier)

    def elastic_slips(self, multiplier: Array, tangential: Array) -> Array:
        """Return the vectors of elastic slip (m, dim) under multipliers (m,) and tangential forces (m, k) [length].

        Elastic slips are the tangential components of the product of compliance and forces.
        """
        slips = self.softness[1:] * tangential.T
        if self.compliance is not None:
            slips += self._products_with_compliance(self.compliance, np.vstack([multiplier, tangential.T]))[1:]
        return np.einsum("km,kmd->md", slips, np.stack(self.directions))

    def coupled_gaps(self, forces: Array) -> Array:
        """Return the gaps and slips (1 + k, m) due to the compliances that couple constraints under `forces` (1 + k, m)."""
        Z = self.low_rank_compliance
        gaps = np.einsum("amh,h->am", Z, np.einsum("amh,am->h", Z, forces))
        return gaps if self.compliance is None else gaps + self._products_with_compliance(self.compliance, forces)

    def _products_with_compliance(self, C: Compliance, forces: Array) -> Array:
        """Return the products (1 + k, m) of C and `forces` (1 + k, m) along normals and tangents [length]."""
        axes = self.compliance_axes
        return np.einsum("md,amd->am", C.apply(np.einsum("am,amd->md", forces, axes)), axes)

    @property
    def compliance_axes(self) -> Array:
        """Normals and tangents (1 + k, m, dim) along which C couples the components of force vectors [-].

        The normals of constraints without friction are any unit vectors.
        """
        along = np.stack(self.coupled_directions or self.directions)
        normal = normals(list(along))
        normal[~along.any(axis=(0, 2)), 0] = 1.0
        return np.concatenate([normal[None], along])

    @property
    def nodal_field(self) -> NodalField:
        """The field `nodal`, which the constraints of every contact pair have."""
        assert self.nodal is not None
        return self.nodal

    def pressure(self, multiplier: Array) -> Array:
        """Return nodal pressures (n_nodes,) per unit reference area for multipliers (m,) [pressure]."""
        return self.nodal_field.pressure(self.normal_forces(multiplier))


@record
class StackedConstraints(Constraints):
    """The constraints of several contact pairs, whose rows are stacked.

    Attributes
    ----------
    parts : dict of str to Constraints
        The constraints of each pair, by the name of the pair.
    rows : dict of str to slice
        Range of rows of each pair.
    """

    parts: Mapping[str, Constraints] = field(default_factory=dict)
    rows: Mapping[str, slice] = field(default_factory=dict)


def stacked(by_pair: Mapping[str, Constraints]) -> StackedConstraints:
    """Return the stacked constraints of contact pairs, given the constraints of each pair by its name."""
    pairs = list(by_pair.values())
    ends = np.cumsum([0, *map(len, pairs)]).tolist()
    rows_of_pairs = dict(zip(by_pair, map(slice, ends[:-1], ends[1:]), strict=True))
    if len(pairs) == 1:
        return StackedConstraints(**vars(pairs[0]), parts=by_pair, rows=rows_of_pairs)
    k, nodes = max(len(pair.tangents) for pair in pairs), [pair.nodes for pair in pairs if pair.nodes is not None]
    branches = [pair.branches for pair in pairs if pair.branches is not None]
    tangents = [pair.tangents or (csr_array(pair.B.shape),) * k for pair in pairs]
    names = "gap0", "positions", "friction", "equality"
    concatenated: dict[str, Any] = {name: np.concatenate([getattr(pair, name) for pair in pairs]) for name in names}
    for name in ("slip0", "elastic_slip"):  # zero for pairs without tangents
        concatenated[name] = np.hstack([np.resize(getattr(pair, name), (k, len(pair))) for pair in pairs])
    softness = [np.pad(pair.softness, ((0, k - len(pair.tangents)), (0, 0))) for pair in pairs]
    factors = [pair.low_rank_compliance for pair in pairs]  # empty for pairs without tangents
    factors = [np.resize(factor, (1 + k, *factor.shape[1:])) for factor in factors]
    return StackedConstraints(
        B=csr_array(vstack([pair.B for pair in pairs], format="csr")),
        compliance=_BlockDiagonal(pairs) if any(pair.compliance is not None for pair in pairs) else None,
        tangents=tuple(csr_array(vstack(rows, format="csr")) for rows in zip(*tangents, strict=True)),
        directions=_stacked_directions(pairs),
        softness=np.hstack(softness),
        low_rank_compliance=np.stack([block_diag(*factor) for factor in zip(*factors, strict=True)]),
        nodes=None if len(nodes) < len(pairs) else np.concatenate(nodes),
        branches=np.concatenate(branches) if branches else None,
        coupled_directions=_stacked_directions(pairs, coupled=True),
        parts=by_pair,
        rows=rows_of_pairs,
        **concatenated,
    )


def _stacked_directions(pairs: list[Constraints], coupled: bool = False) -> tuple[Array, ...]:
    """Return k tangents (m, dim) of the constraints of all pairs; they are zero for pairs without tangents.

    With `coupled`, `coupled_directions` take precedence over `directions`.
    """
    directions = [(pair.coupled_directions if coupled else ()) or pair.directions for pair in pairs]
    k = max(map(len, directions))
    tangents = [t or (np.zeros_like(pair.positions),) * k for t, pair in zip(directions, pairs, strict=True)]
    return tuple(map(np.vstack, zip(*tangents, strict=True)))


class _BlockDiagonal:
    """Block-diagonal compliance of several pairs; see `Compliance`."""

    def __init__(self, pairs: list[Constraints]) -> None:
        self._compliances = [pair.compliance for pair in pairs]
        self._sizes = [len(pair) for pair in pairs]

    def block(self, rows: Indices) -> Array:
        values = np.zeros((len(rows), len(rows)))
        for compliance, (in_block, rows_of_pair) in zip(self._compliances, by_block(rows, self._sizes), strict=True):
            if compliance is not None and len(in_block):
                values[np.ix_(in_block, in_block)] = compliance.block(rows_of_pair)
        return values

    def block_operator(self, rows: Indices) -> Array | FieldCompliance:
        blocks = []
        for compliance, (_, rows_of_pair) in zip(self._compliances, by_block(rows, self._sizes), strict=True):
            n = len(rows_of_pair)
            block = FieldCompliance.none(n) if compliance is None or not n else compliance.block_operator(rows_of_pair)
            if not isinstance(block, FieldCompliance):
                return self.block(rows)
            blocks.append(block)
        return FieldCompliance.stacked(blocks, lambda: self.block(rows))

    def split(self, rows: Indices) -> tuple[Array, csr_array, Array]:
        d, P_blocks, S_blocks = np.zeros(len(rows)), [csr_array((len(rows), 0))], []
        for inner, (in_block, rows_of_pair) in zip(self._compliances, by_block(rows, self._sizes), strict=True):
            if inner is not None and len(in_block):
                d[in_block], P, S = inner.split(rows_of_pair)
                entries = np.ones(len(in_block)), (in_block, np.arange(len(in_block)))
                P_blocks.append(csr_array(csr_array(entries, (len(rows), len(in_block))) @ P))
                S_blocks.append(S)
        S = block_diag(np.zeros((0, 0)), *S_blocks)  # without any argument, the shape would be (1, 0)
        return d, csr_array(hstack(P_blocks, format="csr")), S

    def apply(self, multiplier: Array) -> Array:
        blocks = zip(self._compliances, np.split(multiplier, np.cumsum(self._sizes)[:-1]), strict=True)
        return np.concatenate([np.zeros_like(y) if C is None else C.apply(y) for C, y in blocks])
