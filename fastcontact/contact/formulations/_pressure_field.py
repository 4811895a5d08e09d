r"""Base of formulations with a pressure field: contact status at integration points, pressures at nodes.

The multiplier field :math:`\lambda_h` has the order of the facets. At every integration point the pressure is

.. math:: p = [\lambda_h - \rho g]_+

and the field is its projection, :math:`\int (\lambda_h - p) N_j = 0` for every node j (Alart and Curnier, 1991; with
integration points, Ben Dhia and Zarroug, 2002; code_aster, R5.03.52). Both are the stationarity of one augmented
Lagrangian. With the point forces :math:`y = w p` as unknowns it becomes a linear complementarity problem

.. math:: y \ge 0, \quad g + C y \ge 0, \quad y^T (g + C y) = 0, \quad
          C = \tfrac{1}{\rho} \left( W^{-1} - P (P^T W P)^{-1} P^T \right)

with P the shape functions at the points and W their areas. C is positive semidefinite and vanishes on the fields that
the shape functions can represent, so the multiplier itself is not regularised; C only acts on components finer than the
field. The primal-dual active set solves this exactly (as a semismooth Newton method), for every rho > 0, with the
pairing renewed in every iteration. All multipliers are determined as long as :math:`P^T W P` is regular: a facet needs at
least as many weighted points as it has nodes. Integrals run over the reference surface.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import splu

from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.closed_nodes import NO_AREA
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints, NodalField
from fastcontact.contact.formulations._formulation import Formulation
from fastcontact.contact.multiplier_field import Projection
from fastcontact.contact.pairing import Candidates, Pairing, normals
from fastcontact.errors import ContactError
from fastcontact.linear.sparse_rows import shapes_at
from fastcontact.round_off import LENGTH_ROUND_OFF


@dataclass(frozen=True, eq=False)
class PressureField(NodalField):
    """A pressure field with values at the secondary nodes; see `constraints.NodalField`.

    Attributes
    ----------
    projection : Projection
        From point forces to the independent values of the field.
    nodes : csr_array (n_nodes, k)
        From the independent values to those at all nodes [-].
    independent : ndarray of int (k,)
        Nodes of the independent values.
    around : ndarray of int (m, n)
        Nodes of the facet of each integration point, counted on the secondary side.
    shape : ndarray (m, n)
        Their shape functions there [-].
    renewed : bool
        Whether every pairing creates new integration points.
    nodal_areas : ndarray (n_nodes,)
        Integrals of the nodes' shape functions over the whole secondary side, by the rule of the points [area].
    covered_areas : ndarray (n_nodes,)
        The same over the points that take part [area].
    axes : (ndarray (m, dim, dim), ndarray (n_nodes, dim, dim)), optional
        At points and nodes, the axes (in columns) along which a vector field has components; None for those of the mesh.
    """

    projection: Projection
    nodes: csr_array
    independent: Indices
    around: Indices
    shape: Array
    renewed: bool
    nodal_areas: Array
    covered_areas: Array
    axes: tuple[Array, Array] | None = None

    @classmethod
    def of_points(
        cls, points: tuple[Indices, Array], areas: tuple[Array, Array], rho: float,
        field: tuple[csr_array, Indices], renewed: bool,
    ) -> PressureField:  # fmt: skip
        """Return the field of points in facets with nodes and shape functions (m, n); `field` are `nodes` and `independent`.

        `areas` are those of the points that take part, zero elsewhere, and of all points, both (m,) [area].
        """
        (around, shape), (nodes, independent), (taking_part, full_areas) = points, field, areas
        P = shapes_at(shape, around, nodes.shape[0])
        covered, total = P.T @ taking_part, P.T @ full_areas
        P = csr_array(P @ nodes)
        mass = splu((P.T @ diags_array(taking_part) @ P).tocsc()) if len(independent) else None
        projection = Projection(P, taking_part, rho, mass)
        return cls(projection, nodes, independent, around, shape, renewed, total, covered)

    @property
    def areas(self) -> Array:
        """Areas (m,) of the integration points; infinite for those that take no part [area]."""
        return np.where(self.projection.areas > 0, self.projection.areas, np.inf)

    def pressure(self, force: Array) -> Array:
        """Return the field at the nodes; it may be slightly negative beyond the edge of the contact."""
        return self.nodes @ self.projection.field(force)

    def traction(self, force: Array) -> Array:
        """See `NodalField`."""
        if self.axes is None:
            return super().traction(force)
        at_points, at_nodes = self.axes
        return np.einsum("nde,ne->nd", at_nodes, super().traction(np.einsum("mde,md->me", at_points, force)))

    @property
    def covered(self) -> Array:
        """Covered part of the nodal areas; one for nodes without area."""
        areas = self.nodal_areas
        with_area = np.abs(areas) > LENGTH_ROUND_OFF * np.abs(areas).max(initial=0.0)
        return np.divide(self.covered_areas, areas, out=np.ones_like(areas), where=with_area)

    def shares(self, force: Array) -> Array:
        """Return the field times the areas that take part."""
        return self.pressure(force) * self.covered_areas

    def weighted_gaps(self, gaps: Array) -> tuple[Array, Indices]:
        """Return means of the gaps weighted by nodal shape functions: zero around closed points even if nodal gaps are not.

        Corners of quadratic faces without area have no mean, and no points belong to them.
        """
        usable, n = np.isfinite(gaps), len(self.nodal_areas)
        weight = np.where(usable, self.projection.areas, 0.0)[:, None] * self.shape
        total = np.bincount(self.around.ravel(), weight.ravel(), n)
        sums = np.bincount(self.around.ravel(), (weight * np.where(usable, gaps, 0.0)[:, None]).ravel(), n)
        kept = total > NO_AREA * total.max(initial=0.0)
        near = np.where(kept[self.around], self.shape, -np.inf).argmax(axis=1)
        return np.divide(sums, total, out=np.full(n, np.inf), where=kept), self.around[np.arange(len(gaps)), near]

    def closed_nodes(self, active: Mask, gap: Array, pressure: Array) -> Mask:
        """Return the nodes with a pressure that are nearest to an active point; at least one per facet, if any has one.

        The nodal gap is not used: between facets of different curvature, nodes of facets in contact have open gaps. A node
        without area, at the corner of some quadratic faces, carries no force: the nearest node with an area is closed
        instead. Nodes to which no point with an area is nearest, at an axis or beyond the end of the other side, follow
        their facet.
        """
        usual = self.nodal_areas > NO_AREA * self.nodal_areas.max(initial=0.0)
        near = _nearest(self.around[active], self.shape[active], len(gap))
        near |= _nearest(
            self.around[active], np.where(usual[self.around[active]], self.shape[active], -np.inf), len(gap)
        )
        seen, touched = self.projection.areas > 0, np.zeros(len(gap), bool)
        touched[self.around[active]] = True
        near |= touched & ~_nearest(self.around[seen], self.shape[seen], len(gap))
        near &= pressure > 0
        # Forces at one end of a facet, opposite an edge, may put the nearest node in tension: then the others of its facet.
        isolated = self.around[active][~near[self.around[active]].any(axis=1)]
        near[isolated[pressure[isolated] > 0]] = True
        return near

    def initially_active(self, gap: Array, pressure: Array) -> Mask | None:
        """Return the points where the field exceeds rho times the gap, if the points are new in this pairing."""
        if not self.renewed:
            return None
        field = self.projection.P @ pressure[self.independent]
        return (self.projection.areas > 0) & (field - self.projection.rho * gap > 0)


def _nearest(around: Indices, shape: Array, n_nodes: int) -> Mask:
    """Return the nodes (n_nodes,) with the largest shape functions (m, n) at any of the points; several where equal."""
    nearest = np.zeros(n_nodes, bool)
    nearest[around[shape >= shape.max(axis=1, keepdims=True, initial=-np.inf) - LENGTH_ROUND_OFF]] = True
    return nearest


@dataclass(eq=False)
class PressureFieldFormulation(Formulation):
    """A formulation with a pressure field; further parameters as in `Formulation`.

    Parameters
    ----------
    augmentation : float
        rho times the length of the shortest facet (the root of the smallest area) over the modulus of the bodies [-].
    """

    augmentation: float = 1.0

    geometry_in_loop: ClassVar[bool] = True

    @property
    def eliminable(self) -> bool:
        """See `Formulation`: forces outside the field are compliant, but the field values can be eliminated.

        This holds in three dimensions without friction, which would couple them in all directions.
        """
        return self.points.shape[1] == 3 and not self.friction

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.augmentation > 0:
            raise ContactError(f"augmentation = {self.augmentation} must be positive; 1 suits most problems")

    def repeated(self, field: tuple[csr_array, Indices]) -> tuple[csr_array, Indices]:
        """Return a field with one value for coincident nodes: the matrix to nodal values, and the independent nodes."""
        same, (values, nodes) = self.options.same_place, field
        if same is None:
            return field
        first, column = np.unique(same[self.secondary.points[nodes]], return_inverse=True)
        independent = np.empty(len(first), np.intp)
        independent[column] = nodes
        return csr_array(values @ csr_array((np.ones(len(nodes)), (np.arange(len(nodes)), column)))), independent

    def nodes_of(self, constraints: Constraints, moments: csr_array) -> Indices:
        """See `Formulation`: those of the field, and those nearest to points on an axis."""
        field = constraints.nodal
        assert isinstance(field, PressureField)
        alone = moments.indices[moments.indptr[len(field.independent) : -1]]
        return np.concatenate([field.independent, field.around[alone, field.shape[alone].argmax(axis=1)]])

    def of_points(
        self, candidates: Candidates, pairing: Pairing, field: PressureField, at: Configuration
    ) -> Constraints:
        """Return the constraints of paired integration points whose forces make up a pressure field."""
        projection = replace(field.projection, eliminable=self.eliminable, quadratic=self.secondary.order > 1)
        constraints = self.assembled(candidates, pairing, projection, at)
        along, turning = constraints.directions, self.options.turning
        if constraints.tangents and turning is not None:
            axes = turning.axes(constraints.positions), turning.axes(self.points[self.secondary.points])
            field = replace(field, axes=axes)
            along = tuple(np.einsum("mde,md->me", axes[0], t) for t in along)
        undetermined = self._undetermined(field, along, at) if self.friction else None
        return replace(
            constraints, low_rank_compliance=undetermined, areas=field.areas, nodal=field, coupled_directions=along
        )  # fmt: skip

    def _undetermined(self, field: PressureField, directions: tuple[Array, ...], at: Configuration) -> Array | None:
        """Return a compliance of tangential fields that do no work on any slip, where both sides are held.

        `directions` are tangents in the axes of the field.
        """
        factors = []
        for held, nodes in self.without_slip(at):
            columns = np.flatnonzero(nodes[field.independent])
            if len(columns):
                Z = field.projection.compliant(columns)
                in_axes = held if field.axes is None else np.einsum("nde,nd->ne", field.axes[1], held)
                at_points = field.projection.P @ in_axes[field.independent]
                components = [np.einsum("nd,nd->n", along, at_points) for along in (normals(directions), *directions)]
                factors.append(np.stack([component[:, None] * Z for component in components]))
        return np.concatenate(factors, axis=2) if factors else None
