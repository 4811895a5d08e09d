r"""Base class of formulations with a pressure field, which is interpolated between nodes.

The contact status is determined at integration points.

The multiplier field :math:`\lambda_h` is interpolated with the shape functions :math:`N_j` of the secondary facets. With
the gap g and a constant :math:`\rho > 0`, the pressure at an integration point is

.. math:: p = \max(\lambda_h - \rho g, 0)

and the field is the projection of p, :math:`\int (\lambda_h - p) N_j = 0` for every node j (Alart and Curnier, 1991; with
integration points, Ben Dhia and Zarroug, 2002; code_aster, R5.03.52). Both equations are the stationarity conditions of an
augmented Lagrangian. Let w be the areas of the integration points, and let the point forces :math:`y = w p` be the unknowns.
The conditions then form a linear complementarity problem

.. math:: y \ge 0, \quad g + C y \ge 0, \quad y^T (g + C y) = 0, \quad
          C = \tfrac{1}{\rho} \left( W^{-1} - P (P^T W P)^{-1} P^T \right)

where P contains the shape functions at the points, and W is the diagonal matrix of their areas. C is positive semidefinite.
It vanishes for point forces of a pressure field that the shape functions can represent, so that the field is not
regularised. C acts only on the remaining components of the point forces.

The primal-dual active set method, a semismooth Newton method, solves this problem exactly for every :math:`\rho > 0`. The
surfaces are paired again in each iteration. The field is determined if :math:`P^T W P` is regular: a facet must have
at least as many points with an area as nodes. Integrals are taken over the undeformed surface.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import splu

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, Mask, mask_at
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints, NodalField
from fastcontact.contact.formulations._formulation import Formulation
from fastcontact.contact.integration import nodes_with_area
from fastcontact.contact.multiplier_field import Projection
from fastcontact.contact.overclosure import OverclosureLaw
from fastcontact.contact.pairing import Candidates, Pairing, normals
from fastcontact.contact.supported_nodes import directions_without_slip, nodes_with_prescribed_gap
from fastcontact.contact.surface import Surface
from fastcontact.errors import ContactError
from fastcontact.linear.sparse_rows import shapes_at
from fastcontact.round_off import LENGTH_ROUND_OFF

# Largest ratio of the component of a pressure along a support to the limit of friction; see `_compliance_at_supports`. With a
# ratio of one and a coefficient of friction of 0.3, facets at 22 degrees to a plane of symmetry penetrate by 0.5 % of the
# displacement.
LARGEST_PRESSURE_COMPONENT = 0.5


@record
class PressureField(NodalField):
    """A pressure field with values at the secondary nodes; see `constraints.NodalField`.

    Attributes
    ----------
    projection : Projection
        Map from point forces to the independent values of the field.
    nodal_map : csr_array (n_nodes, k)
        Map from the k independent values to the values at all nodes [-].
    independent : ndarray of int (k,)
        Node of each independent value, numbered on the secondary side.
    facet_nodes : ndarray of int (m, n)
        The n nodes of the facet of each of m integration points, numbered on the secondary side.
    shape : ndarray (m, n)
        Values of their shape functions at the point [-].
    has_new_points : bool
        Whether each pairing creates new integration points.
    nodal_areas : ndarray (n_nodes,)
        Integrals of the shape functions over the complete secondary side, by quadrature at the integration points [area].
    covered_areas : ndarray (n_nodes,)
        The same integrals with only those points that can carry forces [area].
    axes : (ndarray (m, dim, dim), ndarray (n_nodes, dim, dim)), optional
        Axes at points and at nodes, as columns, along which the components of a vector field are interpolated; by default
        the axes of the mesh.
    """

    projection: Projection
    nodal_map: csr_array
    independent: Indices
    facet_nodes: Indices
    shape: Array
    has_new_points: bool
    nodal_areas: Array
    covered_areas: Array
    axes: tuple[Array, Array] | None = None

    @classmethod
    def of_points(
        cls, points: tuple[Indices, Array], areas: tuple[Array, Array], rho: float,
        field: tuple[csr_array, Indices], has_new_points: bool, eliminable: bool = False, quadratic: bool = False,
    ) -> PressureField:  # fmt: skip
        """Return the pressure field of m integration points.

        Parameters
        ----------
        points : (ndarray of int (m, n), ndarray (m, n))
            `facet_nodes` and `shape`.
        areas : (ndarray (m,), ndarray (m,))
            Areas of the points, first with zeros at points that cannot carry forces, then of all points [area].
        rho : float
            The constant of the augmented Lagrangian [pressure / length].
        field : (csr_array (n_nodes, k), ndarray of int (k,))
            `nodal_map` and `independent`.
        has_new_points, eliminable, quadratic : bool
            See `PressureField` and `Projection`.
        """
        (facet_nodes, shape), (nodal_map, independent), (usable_areas, full_areas) = points, field, areas
        P = shapes_at(shape, facet_nodes, nodal_map.shape[0])
        covered, total = P.T @ usable_areas, P.T @ full_areas
        P = csr_array(P @ nodal_map)
        mass = splu((P.T @ diags_array(usable_areas) @ P).tocsc()) if len(independent) else None
        projection = Projection(P, usable_areas, rho, mass, eliminable, quadratic)
        return cls(projection, nodal_map, independent, facet_nodes, shape, has_new_points, total, covered)

    def pressure(self, force: Array) -> Array:
        """Return the field (n_nodes, ...) at the nodes [pressure]; it may be slightly negative outside the contact."""
        return self.nodal_map @ self.projection.field(force)

    def traction(self, force: Array) -> Array:
        """Return nodal tractions (n_nodes, dim) for point forces (m, dim); see `NodalField`."""
        if self.axes is None:
            return super().traction(force)
        at_points, at_nodes = self.axes
        return np.einsum("nde,ne->nd", at_nodes, super().traction(np.einsum("mde,md->me", at_points, force)))

    @cached_property
    def covered(self) -> Array:
        """Covered fractions (n_nodes,) of the nodal areas; one for nodes without area [-]."""
        areas = self.nodal_areas
        with_area = np.abs(areas) > LENGTH_ROUND_OFF * np.abs(areas).max(initial=0.0)
        return np.divide(self.covered_areas, areas, out=np.ones_like(areas), where=with_area)

    def uncovered(self, side: Surface, usable: Mask) -> list[Array]:
        """Return the complement of `covered` or, at permanent points, the fraction of unusable ones; see `NodalField`."""
        if self.has_new_points:
            return [1.0 - self.covered[block.local] for block in side.blocks]
        numbers = np.unique(np.vstack([side.all_local, self.facet_nodes]), axis=0, return_inverse=True)[1].ravel()
        of_facet, of_point = np.split(numbers, [side.n_facets])
        areas, n = self.projection.areas, int(numbers.max()) + 1
        total, usable_area = np.bincount(of_point, areas, n), np.bincount(of_point, usable * areas, n)
        fraction = (1.0 - usable_area / np.where(total > 0.0, total, np.inf))[of_facet]
        blocks = zip(np.split(fraction, side.offsets[1:-1]), side.blocks, strict=True)
        return [np.broadcast_to(of_block[:, None], block.local.shape) for of_block, block in blocks]

    def nodal_forces(self, force: Array) -> Array:
        """Return the products (n_nodes,) of the field and the covered areas [force]."""
        return self.pressure(force) * self.covered_areas

    def weighted_gaps(self, gaps: Array) -> tuple[Array, Indices]:
        """Return the means of gaps, weighted by areas and positive values of shape functions; see `NodalField`.

        The mean at a node is zero if the points around it are closed, although the gap at the node itself may be open.
        Negative weights are omitted. With them, the weights at a corner of a quadratic facet may sum to nearly zero, so that
        the mean could have any value.
        """
        usable, n = np.isfinite(gaps), len(self.nodal_areas)
        weight = np.where(usable, self.projection.areas, 0.0)[:, None] * np.maximum(self.shape, 0.0)
        total = np.bincount(self.facet_nodes.ravel(), weight.ravel(), n)
        sums = np.bincount(self.facet_nodes.ravel(), (weight * np.where(usable, gaps, 0.0)[:, None]).ravel(), n)
        valid = nodes_with_area(total, [self.facet_nodes])
        largest = (self.shape + 2.0 * valid[self.facet_nodes]).argmax(axis=1)
        nearest = self.facet_nodes[np.arange(len(gaps)), largest]
        return np.divide(sums, total, out=np.full(n, np.inf), where=valid), nearest

    def closed_nodes(self, active: Mask, gap: Array, pressure: Array) -> Mask:
        """Return the nodes in contact; see `NodalField`.

        A node is in contact if its pressure is positive and if it is the nearest node of an active point, with these
        additions:

        - Corners of some quadratic facets have no area and carry no force. The nearest node with an area is then also closed.
        - A node that is not nearest to any point with an area, such as on an axis or beyond the end of the primary side, is
          closed if its facet has an active point.
        - If no node of a facet with an active point would be closed, all its nodes with a positive pressure are closed.

        Nodal gaps are not used: between facets of different curvature, nodes of facets in contact have open gaps.
        """
        with_area = nodes_with_area(self.nodal_areas, [self.facet_nodes])
        nodes, shape, n = self.facet_nodes[active], self.shape[active], len(gap)
        closed = _nearest(nodes, shape, n) | _nearest(nodes, np.where(with_area[nodes], shape, -np.inf), n)
        usable = self.projection.areas > 0
        closed |= mask_at(nodes, n) & ~_nearest(self.facet_nodes[usable], self.shape[usable], n)
        closed &= pressure > 0
        # Forces at one end of a facet, opposite an edge, may cause a negative pressure at the nearest node.
        nodes_of_open_facets = nodes[~closed[nodes].any(axis=1)]
        closed[nodes_of_open_facets[pressure[nodes_of_open_facets] > 0]] = True
        return closed

    def at_points(self, pressure: Array) -> Array:
        """Return the field (m,) at the integration points [pressure] for nodal values `pressure` (n_nodes,) [pressure]."""
        return np.asarray(self.projection.P @ pressure[self.independent])

    def initial_active_set(self, gap: Array, pressure: Array, previous: Mask) -> Mask:
        """Return the points (m,) at which the field exceeds rho times the gap, as an initial active set.

        If all pairings have the same points, the result is `previous`.
        """
        if not self.has_new_points:
            return previous
        return (self.projection.areas > 0) & (self.at_points(pressure) - self.projection.rho * gap > 0)


def _nearest(facet_nodes: Indices, shape: Array, n_nodes: int) -> Mask:
    """Return the nodes (n_nodes,) whose shape function is the largest one at any of m points.

    `facet_nodes` (m, n) are the nodes of the facet of each point, and `shape` (m, n) their shape functions. If several shape
    functions are equally large, all of their nodes count.
    """
    largest = shape.max(axis=1, keepdims=True, initial=-np.inf)
    return mask_at(facet_nodes[shape >= largest - LENGTH_ROUND_OFF], n_nodes)


@dataclass(eq=False)
class PressureFieldFormulation(Formulation):
    """A formulation with a pressure field. The parameters of `Formulation` apply as well.

    Parameters
    ----------
    augmentation : float
        The constant rho of the augmented Lagrangian, multiplied by the size of the smallest facet (the length of a line, the
        root of the area of a face) and divided by the modulus of the bodies [-].
    """

    augmentation: float = 1.0

    # This reduces the error of a Newton step to a tenth.
    linearised_at_mean: ClassVar[bool] = True

    @property
    def eliminable(self) -> bool:
        """Whether iterative solvers can eliminate closed constraints; see `Formulation`.

        In 3D without friction they can eliminate the values of the field, which friction would couple in all directions.
        """
        return self.points.shape[1] == 3 and not self.friction

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.augmentation > 0:
            raise ContactError(f"augmentation = {self.augmentation} must be positive; 1 suits most problems")

    def dependent_nodes(self, config: Configuration) -> Mask:
        """Return the nodes (n_nodes,) whose values follow from those of their neighbours.

        They are excluded nodes, and nodes with a prescribed gap. However, values on facets at whose nodes all gaps are
        prescribed remain independent.
        """
        prescribed, excluded = nodes_with_prescribed_gap(self, config), self.excluded[self.secondary.points]
        on_prescribed_facets = np.zeros_like(prescribed)
        for block in self.secondary.blocks:
            on_prescribed_facets[block.local[prescribed[block.local].all(axis=1)]] = True
        return excluded | (prescribed & ~on_prescribed_facets)

    def with_common_values(self, field: tuple[csr_array, Indices]) -> tuple[csr_array, Indices]:
        """Return a pressure field in which nodes with the same `PairOptions.representatives` have a common value.

        Both `field` and the result consist of the map (n_nodes, k) from independent to nodal values, and the nodes (k,) of
        the independent values.
        """
        (nodal_map, nodes), representatives = field, self.options.representatives
        if representatives is None:
            return field
        first, column = np.unique(representatives[self.secondary.points[nodes]], return_inverse=True)
        independent = np.empty(len(first), np.intp)
        independent[column] = nodes
        common = csr_array((np.ones(len(nodes)), (np.arange(len(nodes)), column)))
        return csr_array(nodal_map @ common), independent

    def nodes_of(self, constraints: Constraints, moments: csr_array) -> Indices:
        """Return the node (q,) of each row of `moments`; see `Formulation`.

        The first rows belong to the independent nodes of the field. The others belong to single points on an axis, for which
        the nearest node is returned.
        """
        field = constraints.nodal
        assert isinstance(field, PressureField)
        points = moments.indices[moments.indptr[len(field.independent) : -1]]
        return np.concatenate([field.independent, field.facet_nodes[points, field.shape[points].argmax(axis=1)]])

    def constraints_of_points(
        self, candidates: Candidates, pairing: Pairing, field: PressureField, config: Configuration
    ) -> Constraints:
        """Return the constraints of paired integration points, with the compliance C of the pressure field."""
        projection, rotation = field.projection, self.options.sector_rotation
        if self.has_tangents and rotation is not None:
            axes = rotation.axes(candidates.positions(self.points)), rotation.axes(self.points[self.secondary.points])
            field = replace(field, axes=axes)
        constraints = self.assembled(candidates, pairing, (projection, field.axes), config)
        directions, Z = constraints.directions, np.empty(0)
        if field.axes is not None:
            directions = tuple(np.einsum("mde,md->me", field.axes[0], t) for t in directions)
        if self.friction and len(self.held_nodes):
            Z = self._compliance_at_supports(field, constraints, directions, config)
        areas = np.where(projection.areas > 0, projection.areas, np.inf)
        return replace(constraints, low_rank_compliance=Z, areas=areas, nodal=field, coupled_directions=directions)

    def tangent_of_law(
        self, law: OverclosureLaw, constraints: Constraints, config: Configuration
    ) -> tuple[Array, Array]:
        r"""See `Formulation`. The overclosure of the law is that of the gap minus that of the compliance C.

        With the pressure p of a point, the latter is :math:`(p - \lambda_h) / \rho`. For given gaps and a given field, the
        law determines p, so that the tangent depends on the displacements and the field to second order only.
        """
        field = constraints.nodal
        if not isinstance(field, PressureField):
            return super().tangent_of_law(law, constraints, config)
        overclosure, compliance = -constraints.gaps(config.displacement), 1.0 / field.projection.rho
        if config.pressure is not None:
            overclosure = overclosure + compliance * field.at_points(config.pressure)
        return law.tangent(overclosure, compliance)

    def _compliance_at_supports(
        self, field: PressureField, constraints: Constraints, directions: tuple[Array, ...], config: Configuration
    ) -> Array:
        """Return the factor of a compliance that determines the tangential tractions at nodes where both sides are held.

        Supports prevent slip at these nodes, so that the tractions do no work, and no equation determines them. The
        compliance makes the tractions vanish, together with the tangential components of pressures that are slightly
        inclined to the support. If such a component is a large part of the limit of friction, as on facets that meet a plane
        of symmetry at an angle, the support carries it. The compliance must then not act on the pressure, because the bodies
        would penetrate. `directions` are the tangents (m, dim) in the axes of the field. The result is a
        `Constraints.low_rank_compliance`, or an empty array if no such node exists.
        """
        factors = []
        for direction, nodes in directions_without_slip(self, config):
            columns = np.flatnonzero(nodes[field.independent])
            if len(columns):
                Z = field.projection.compliance_factor(columns)
                in_axes = direction if field.axes is None else np.einsum("nde,nd->ne", field.axes[1], direction)
                at_points = field.projection.P @ in_axes[field.independent]
                axes = normals(directions), *directions
                components = np.stack([np.einsum("nd,nd->n", axis, at_points) for axis in axes])
                factor = components[:, :, None] * Z
                pressure, shear = (np.linalg.norm(values, axis=(0, 1)) for values in (factor[:1], factor[1:]))
                factor[0, :, pressure > LARGEST_PRESSURE_COMPONENT * constraints.friction.max() * shear] = 0.0
                factors.append(factor)
        return np.concatenate(factors, axis=2) if factors else np.empty(0)
