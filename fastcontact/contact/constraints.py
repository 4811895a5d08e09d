"""Contact constraints: ``gap >= 0``, ``multiplier >= 0``, ``gap * multiplier = 0`` row by row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Protocol

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse import csr_array, diags_array, vstack

from fastcontact.arrays import AnyArray, Array, Indices, Mask
from fastcontact.contact.linearised_geometry import Geometry
from fastcontact.contact.overclosure import OverclosureLaw
from fastcontact.contact.pairing import normals
from fastcontact.linear.field_compliance import FieldCompliance
from fastcontact.round_off import LENGTH_ROUND_OFF


class Compliance(Protocol):
    """A symmetric positive semidefinite matrix C (m, m) over all constraints."""

    def block(self, rows: Indices) -> Array:
        """Return the dense rows and columns `rows` of C, or, where C is diagonal, its diagonal there."""
        ...

    def among(self, rows: Indices) -> Array | FieldCompliance:
        """Return the same, or an equivalent form that a linear solver can use without forming the block."""
        ...

    def apply(self, multiplier: Array) -> Array:
        """Return ``C multiplier`` (m,)."""
        ...


class NodalField(Protocol):
    """Nodal interpretation of the forces of constraints.

    Attributes
    ----------
    nodal_areas : ndarray (n_nodes,)
        Integrals of the nodes' shape functions over the whole secondary side [area].
    covered : ndarray (n_nodes,) or float
        Fraction of each node's area that faces the primary side, or takes part in contact at all [-].
    """

    nodal_areas: Array

    @property
    def covered(self) -> Array | float:
        """See the class: 1, unless a formulation integrates over parts of facets."""
        return 1.0

    def pressure(self, force: Array) -> Array:
        """Return nodal pressures (n_nodes,) per reference area [pressure] from normal forces (m,) [force]."""
        ...

    def traction(self, force: Array) -> Array:
        """Return nodal tractions (n_nodes, dim) per reference area [pressure] from forces (m, dim) [force]."""
        return np.column_stack([self.pressure(component) for component in force.T])

    def over_whole_side(self, force: Array) -> Array:
        """Return nodal pressures (n_nodes,) per area of the whole secondary side, whether or not it faces the primary side.

        The integral of this field over the side is the sum of the forces.
        """
        return self.pressure(force) * self.covered

    def shares(self, force: Array) -> Array:
        """Return the shares (n_nodes,) of the nodes in the sum of the forces [force].

        The pressures over the whole side times the areas, except at nodes whose areas vanish.
        """
        return self.over_whole_side(force) * self.nodal_areas

    def weighted_gaps(self, gaps: Array) -> tuple[Array, Indices]:
        """Return the nodal gaps (n_nodes,) from those (m,) of constraints, and the node nearest to each constraint (m,).

        Infinite where a node faces nothing [length].
        """
        return gaps, np.arange(len(gaps))

    def closed_nodes(self, active: Mask, gap: Array, pressure: Array) -> Mask:
        """Return the nodes in contact (n_nodes,) for active constraints (m,), nodal gaps [length], pressures [pressure].

        These are the nodes of active constraints, unless a formulation does not have one constraint per node.
        """
        return active

    def initially_active(self, gap: Array, pressure: Array) -> Mask | None:
        """Return an initial active set (m,) from gaps (m,) [length] and the last nodal pressures (n_nodes,) [pressure].

        None where the constraints are the same in every pairing: then the last active set is the better guess.
        """
        return None


class Wetted(Protocol):
    """Region reached by fluid; see `fluid_pressure.Wetted`."""

    @property
    def rows(self) -> Mask:
        """Constraints in that region (m,)."""
        ...

    @property
    def pressure(self) -> Array:
        """Fluid pressure at the secondary nodes (n_nodes,) [pressure]."""
        ...

    def force(self, displacement: Array) -> Array:
        """Return the forces (n_points, dim) on the secondary side at a `displacement` (n_points, dim) [length] [force]."""
        ...

    def stiffness(self, displacement: Array) -> csr_array:
        """Return the symmetric part (n_dofs, n_dofs) of minus the derivative of `force` [force / length]."""
        ...


class Tied(Protocol):
    """Linear equations that replace contact; see `tied.TiedPair`."""

    @property
    def directions(self) -> tuple[Array, ...]:
        """Tangents (m, dim) at the constraints of the formulation."""
        ...

    def forces(self, multiplier: Array) -> tuple[Array, Array]:
        """Return normal (m,) and tangential (m, k) forces at the constraints of the formulation [force]."""
        ...


@dataclass(frozen=True, eq=False)
class Constraints:
    """Inequality constraints ``gap = gap0 + B u + C multiplier >= 0``, each with a multiplier >= 0.

    Attributes
    ----------
    B : csr_array (m, n_dofs)
        Rows [-]; an empty row is a constraint that cannot close now.
    gap0 : ndarray (m,)
        Gap at u = 0 [length].
    positions : ndarray (m, dim)
        Where the gap is measured, on the reference surface [length].
    compliance : Compliance, optional
        C [length / force]; None stands for zero.
    tangents : tuple of csr_array (m, n_dofs)
        Rows of the tangential displacement relative to the primary side, a matrix for each tangent [-]; empty without
        friction.
    directions : tuple of ndarray (m, dim)
        Unit tangents [-].
    coupled_directions : tuple of ndarray (m, dim)
        The same in the axes in which C couples the components of forces, where these are not those of the mesh [-].
    slip0 : ndarray (len(tangents), m), optional
        Slip of the step due to the motion of a rigid primary side [length]; None stands for zero.
    friction : ndarray (m,), optional
        Coefficient of friction of each constraint [-]; None stands for zero.
    equality : ndarray of bool (m,), optional
        Constraints that are equations, with multipliers of either sign; None stands for none.
    softness : ndarray (m,), optional
        Compliance of each constraint along its normal alone, beside C [length / force]; None stands for zero.
    tangential_softness : ndarray (m,), optional
        Compliance of each constraint along its tangents [length / force]; None stands for zero.
    elastic_slip : ndarray (len(tangents), m), optional
        Elastic slip of the tangential compliance under the forces at the beginning of the step, which the slip of the step
        is reduced by: only the change of the forces since then adds elastic slip [length].
    low_rank_compliance : ndarray (1 + len(tangents), m, h), optional
        Z of a compliance ``Z Z.T`` beside C, of normal forces and then of tangential ones; None stands for zero.
    driven : ndarray (len(tangents), m), optional
        Slips imposed by supports and obstacles, over the largest imposed displacement [-]; None stands for none.
    law : OverclosureLaw, optional
        Law whose linearisation `gap0` and `softness` are.
    branches : ndarray of int, optional
        Branch of its law at each point of a cohesive layer.
    wetted : Wetted, optional
        Region reached by fluid between the sides.
    areas : ndarray (m,), optional
        Area of each constraint [area]; infinite where it takes no part.
    nodes : ndarray of int (m,), optional
        The secondary node of each constraint, where each has one.
    nodal : NodalField, optional
        Interpretation of normal forces at the secondary nodes.
    tied : Tied, optional
        Given where the constraints are the equations of a tied pair, or of a cohesive layer.
    geometry : Geometry, optional
        Derivatives of rows and gaps with respect to the displacements; None where they are zero or not available.
    """

    B: csr_array
    gap0: Array
    positions: Array
    compliance: Compliance | None = None
    tangents: tuple[csr_array, ...] = ()
    directions: tuple[Array, ...] = ()
    friction: Array | None = None
    slip0: Array | None = None
    equality: Mask | None = None
    softness: Array | None = None
    low_rank_compliance: Array | None = None
    tangential_softness: Array | None = None
    elastic_slip: Array | None = None
    areas: Array | None = None
    nodes: Indices | None = None
    nodal: NodalField | None = None
    tied: Tied | None = None
    driven: Array | None = None
    law: OverclosureLaw | None = None
    branches: AnyArray | None = None
    wetted: Wetted | None = None
    coupled_directions: tuple[Array, ...] = ()
    geometry: Geometry | None = None

    def __len__(self) -> int:
        return len(self.gap0)

    @property
    def usable(self) -> Mask:
        """Constraints (m,) that may close at all."""
        return np.asarray(np.diff(self.B.indptr) > 0)

    @property
    def normal_compliance(self) -> Compliance | None:
        """Total compliance along the normals: C and `softness`."""
        return self.compliance if self.softness is None else _Softened(self.compliance, self.softness)

    @property
    def coupled(self) -> bool:
        """Whether a compliance couples constraints."""
        return self.compliance is not None or self.low_rank_compliance is not None

    @property
    def coefficients(self) -> Array:
        """Coefficients of friction (m,), zero where there are none [-]."""
        return np.zeros(len(self)) if self.friction is None else self.friction

    @property
    def finite_areas(self) -> Array:
        """Areas (m,), zero where a constraint takes no part or has none [area]."""
        return np.zeros(len(self)) if self.areas is None else np.where(np.isfinite(self.areas), self.areas, 0.0)

    def moved_past(self, rows: Indices, Q: csr_array | None) -> Mask:
        """Return for which tangents (k, q) of constraints (q,), rotated by Q, supports and obstacles impose a slip."""
        if self.driven is None:
            return np.zeros((len(self.tangents), len(rows)), bool)
        slips = np.vstack([np.zeros(len(rows)), self.driven[:, rows]])
        turned = slips if Q is None else (Q @ slips.ravel()).reshape(slips.shape)
        return np.asarray(np.abs(turned[1:]) > LENGTH_ROUND_OFF)

    def gaps(self, displacement: Array) -> Array:
        """Return the gaps (m,) [length] for displacements (n_points, dim) [length], without the compliance."""
        return np.asarray(self.gap0 + self.B @ displacement.ravel())

    def without(self, open_for_now: Mask) -> Constraints:
        """Return a copy in which the constraints `open_for_now` (m,) cannot close."""
        if not open_for_now.any():
            return self
        keep = diags_array((~open_for_now).astype(float))
        rows = [csr_array(keep @ matrix) for matrix in (self.B, *self.tangents)]
        for matrix in rows:
            matrix.eliminate_zeros()
        return replace(self, B=rows[0], tangents=tuple(rows[1:]))

    def gaps_at_rest(self) -> Array:
        """Return gaps and slips (1 + k, m) at u = 0 [length]."""
        slip0 = np.zeros((len(self.tangents), len(self))) if self.slip0 is None else self.slip0
        return np.vstack([self.gap0, slip0 if self.elastic_slip is None else slip0 + self.elastic_slip])

    def force(self, multiplier: Array, tangential: Array | None = None) -> Array:
        """Return the nodal contact forces (n_dofs,) of normal forces (m,) and tangential ones (m, k) [force]."""
        total: Array = self.B.T @ multiplier
        for tangent, along in zip(self.tangents, () if tangential is None else tangential.T, strict=True):
            total += tangent.T @ along
        return total

    def normal_forces(self, multiplier: Array) -> Array:
        """Return the normal forces (m,) at the constraints of the formulation [force]."""
        return multiplier if self.tied is None else self.tied.forces(multiplier)[0]

    def contact_forces(self, multiplier: Array) -> Array:
        """Return the multipliers (m,) without those of the fluid [force]."""
        return multiplier if self.wetted is None else np.where(self.wetted.rows, 0.0, multiplier)

    def elastic_slips(self, multiplier: Array, tangential: Array) -> Array:
        """Return the elastic slips (m, dim) under normal forces (m,) and tangential ones (m, k) [length].

        These are the products of the constraints' compliance and the forces, along the tangents.
        """
        slips = np.zeros_like(tangential)
        if self.tangential_softness is not None:
            slips += self.tangential_softness[:, None] * tangential
        if self.compliance is not None:
            along = self.coupled_directions or self.directions
            forces = multiplier[:, None] * normals(along) + np.einsum("mk,kmd->md", tangential, np.stack(along))
            elastic = np.column_stack([self.compliance.apply(component) for component in forces.T])
            slips += np.einsum("md,kmd->mk", elastic, np.stack(along))
        return np.einsum("mk,kmd->md", slips, np.stack(self.directions))

    def pressure(self, multiplier: Array) -> Array:
        """Return nodal pressures (n_nodes,) per reference area from the multipliers (m,) [pressure]."""
        assert self.nodal is not None
        return self.nodal.pressure(self.normal_forces(multiplier))

    def initially_active(self, u: Array, pressure: Array) -> Mask | None:
        """Return an initial active set (m,); see `NodalField`. `u` (n_dofs,) are displacements [length]."""
        assert self.nodal is not None
        if self.tied is not None and self.equality is not None:
            return self.equality | (self.gap0 + self.B @ u < 0.0)
        return self.nodal.initially_active(self.gap0 + self.B @ u, pressure)


@dataclass(frozen=True, eq=False)
class StackedConstraints(Constraints):
    """The constraints of several pairs, one below the other.

    Attributes
    ----------
    parts : dict of str to Constraints
        The constraints of each pair, by its name.
    """

    parts: Mapping[str, Constraints] = field(default_factory=dict)

    def state(self, active: Mask) -> AnyArray:
        """Return the set `active` (m,) with the `branches` of all pairs: while these are equal, the problem is smooth."""
        branches = (pair.branches for pair in self.parts.values() if pair.branches is not None)
        return np.concatenate([active.astype(np.int8), *branches])

    def rows(self) -> dict[str, slice]:
        """Return the rows of each pair, by its name."""
        ends = np.cumsum([0, *(len(pair) for pair in self.parts.values())]).tolist()
        return {name: slice(first, end) for name, first, end in zip(self.parts, ends[:-1], ends[1:], strict=True)}


def stacked(by_pair: Mapping[str, Constraints]) -> StackedConstraints:
    """Return the constraints of pairs, by their names, as one."""
    pairs = list(by_pair.values())
    if len(pairs) == 1:
        values = {entry.name: getattr(pairs[0], entry.name) for entry in fields(Constraints)}
        return StackedConstraints(**values, parts=by_pair)
    count = max(len(pair.tangents) for pair in pairs)
    numbers, still = [np.zeros(len(pair)) for pair in pairs], [np.zeros((count, len(pair))) for pair in pairs]
    return StackedConstraints(
        csr_array(vstack([pair.B for pair in pairs], format="csr")),
        np.concatenate([pair.gap0 for pair in pairs]),
        np.vstack([pair.positions for pair in pairs]),
        _BlockDiagonal(pairs) if any(pair.compliance is not None for pair in pairs) else None,
        tuple(
            csr_array(vstack([p.tangents[j] if p.tangents else csr_array(p.B.shape) for p in pairs], format="csr"))
            for j in range(count)
        ),
        _stacked_directions(pairs),
        np.concatenate([pair.coefficients for pair in pairs]),
        _stacked_values([pair.slip0 for pair in pairs], still),
        _stacked_values([pair.equality for pair in pairs], [zero > 0.0 for zero in numbers]),
        _stacked_values([pair.softness for pair in pairs], numbers),
        _stacked_low_rank(pairs, count),
        _stacked_values([pair.tangential_softness for pair in pairs], numbers),
        _stacked_values([pair.elastic_slip for pair in pairs], still),
        nodes=_stacked_nodes(pairs),
        coupled_directions=_stacked_directions(pairs, coupled=True),
        parts=by_pair,
    )


def _stacked_values(values: Sequence[Any], zeros: Sequence[AnyArray]) -> Any:
    """Concatenate values (..., m) of all pairs, `zeros` where a pair has none; None where no pair has any."""
    if all(value is None for value in values):
        return None
    return np.concatenate(
        [zero if value is None else value for value, zero in zip(values, zeros, strict=True)], axis=-1
    )


def _stacked_nodes(pairs: list[Constraints]) -> Indices | None:
    """Return the nodes of all pairs; None where a pair has none."""
    nodes = [pair.nodes for pair in pairs if pair.nodes is not None]
    return np.concatenate(nodes) if len(nodes) == len(pairs) else None


def _stacked_directions(pairs: list[Constraints], coupled: bool = False) -> tuple[Array, ...]:
    """Return the tangents of all pairs, zero where a pair has none; with `coupled`, those of the compliances."""
    directions = [(part.coupled_directions if coupled else ()) or part.directions for part in pairs]
    return tuple(
        np.vstack(
            [along[j] if along else np.zeros_like(p.positions) for along, p in zip(directions, pairs, strict=True)]
        )
        for j in range(max(map(len, directions)))
    )


def _stacked_low_rank(pairs: list[Constraints], count: int) -> Array | None:
    """Return the compliances beside C side by side; `count` is the number of tangents."""
    if all(pair.low_rank_compliance is None for pair in pairs):
        return None
    none = [np.zeros((1 + count, len(pair), 0)) for pair in pairs]
    factors = [z if p.low_rank_compliance is None else p.low_rank_compliance for p, z in zip(pairs, none, strict=True)]
    return np.stack([block_diag(*component) for component in zip(*factors, strict=True)])


class _Softened:
    """The sum of a compliance, or none, and a diagonal one; see `Compliance`."""

    def __init__(self, inner: Compliance | None, softness: Array) -> None:
        self._inner, self._softness = inner, softness

    def block(self, rows: Indices) -> Array:
        softness = self._softness[rows]
        return softness if self._inner is None else np.diag(softness) + self._inner.block(rows)

    def among(self, rows: Indices) -> Array | FieldCompliance:
        inner = None if self._inner is None else self._inner.among(rows)
        if isinstance(inner, FieldCompliance):
            return inner.softened(self._softness[rows], lambda: self.block(rows))
        return self.block(rows)

    def apply(self, multiplier: Array) -> Array:
        compliance = self._softness * multiplier
        return compliance if self._inner is None else compliance + self._inner.apply(multiplier)


class _BlockDiagonal:
    """Block-diagonal compliance of several pairs; see `Compliance`."""

    def __init__(self, pairs: list[Constraints]) -> None:
        self._parts = [pair.compliance for pair in pairs]
        self._start = np.cumsum([0] + [len(pair) for pair in pairs])

    def block(self, rows: Indices) -> Array:
        values = np.zeros((len(rows), len(rows)))
        for compliance, first, end in zip(self._parts, self._start[:-1], self._start[1:], strict=True):
            in_block = np.flatnonzero((rows >= first) & (rows < end))
            if compliance is not None and len(in_block):
                values[np.ix_(in_block, in_block)] = compliance.block(rows[in_block] - first)
        return values

    def among(self, rows: Indices) -> Array | FieldCompliance:
        blocks = []
        for part, first, end in zip(self._parts, self._start[:-1], self._start[1:], strict=True):
            in_block = rows[(rows >= first) & (rows < end)] - first
            compliance = (
                FieldCompliance.none(len(in_block)) if part is None or not len(in_block) else part.among(in_block)
            )
            if not isinstance(compliance, FieldCompliance):
                return self.block(rows)
            blocks.append(compliance)
        return FieldCompliance.stacked(blocks, lambda: self.block(rows))

    def apply(self, multiplier: Array) -> Array:
        values = np.zeros(len(multiplier))
        for part, first, end in zip(self._parts, self._start[:-1], self._start[1:], strict=True):
            if part is not None:
                values[first:end] = part.apply(multiplier[first:end])
        return values
