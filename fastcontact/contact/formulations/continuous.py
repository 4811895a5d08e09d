r"""Continuous formulation: a multiplier field on the secondary side, with the contact status at integration points.

The integration points are fixed on the secondary facets. See `_pressure_field` for the equations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.sparse import csr_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.formulations._pressure_field import PressureField, PressureFieldFormulation
from fastcontact.contact.integration import (
    NEGLIGIBLE_AREA,
    all_nodes_carry_pressure,
    areas_of_rule,
    even_at_axis,
    facet_measure,
    fine_rule,
    gauss_rule,
    mass_matrix,
)
from fastcontact.contact.pair_options import nodal_map
from fastcontact.contact.pairing import Candidates, Normals, relative_motion
from fastcontact.contact.projection import DeformedSide, smooth_ends
from fastcontact.contact.surface import FacetBlock, Surface
from fastcontact.errors import ContactError, unknown
from fastcontact.linear.sparse_rows import rows_of, shapes_at
from fastcontact.mesh import elements, quadrature
from fastcontact.round_off import ROUND_OFF

RULES = ("gauss", "simpson", "node")
# Number of points in each direction of the rule with which others are compared, see `Continuous.quadrature_error`.
FINE_POINTS = 10


@dataclass(eq=False)
class Continuous(PressureFieldFormulation):
    """Continuous contact with a multiplier field. The parameters of `PressureFieldFormulation` apply as well.

    Parameters
    ----------
    integration : str, optional
        Quadrature rule of the integration points. By default they are Gauss points, except on facets in 2D that end at a
        corner of the secondary side opposite a rigid obstacle. There they are the nodes, so that corners do not penetrate.

        - ``"gauss"``: Gauss points.
        - ``"simpson"``: Simpson's rule, on each half or quarter of a quadratic facet; a seven-point rule on triangles.
        - ``"node"``: the nodes, so that no node penetrates the other side, including nodes on the axis, whose area is zero.
          This rule is rejected for six-node triangles and eight-node quadrangles, whose corners have no positive areas.

    n_gauss : int, optional
        Number of Gauss points in each direction of a facet; by default 3 on linear and 4 on quadratic facets. On triangles
        the numbers 2 to 5 select rules with 3, 6, 12 and 16 points in total. Fewer points than determine the pressure field
        are rejected.
    normals : str or sequence of float
        See `Formulation`. The default is ``"averaged"``, because with discontinuous normals the pairing of a point opposite a
        node may not converge.
    """

    normals: Normals | None = "averaged"
    surface_smoothing: bool = True

    integration: str | None = None
    n_gauss: int | None = None

    name: ClassVar[str] = "continuous"
    _candidates: Candidates = field(init=False, repr=False)
    _field: PressureField = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        smallest_size = np.inf
        for block in self.secondary.blocks:
            xi, weights = self._rule(block.element)
            size = facet_measure(block.facets, block.element, self.points, xi, False) @ weights
            smallest_size = min(smallest_size, size.min() ** (1 / xi.shape[1]))
        rho = self.augmentation * self.modulus / smallest_size
        self._candidates, full_areas = self._integration_points()
        usable_areas = np.where(self._candidates.belonging_to(self.excluded), 0.0, full_areas)
        points = self.number_on_side[self._candidates.nodes], self._candidates.shape
        P = shapes_at(points[1], points[0], len(self.secondary.points))
        field = self.with_common_values(self._independent_values(P, usable_areas))
        flags = {"has_new_points": False, "eliminable": self.eliminable, "quadratic": self.secondary.order > 1}
        self._field = PressureField.of_points(points, (usable_areas, full_areas), float(rho), field, **flags)

    def _integration_points(self) -> tuple[Candidates, Array]:
        """Return the integration points, and their areas (m,) [area]."""
        points, areas = self._points_of(self._rule)
        at_corner = self._facets_at_corners()
        if not at_corner.any():
            return points, areas
        nodes, nodal_areas = self._points_of(_at_nodes)
        selected = np.concatenate([~at_corner[points.facet], at_corner[nodes.facet]])
        arrays = [(getattr(points, f.name), getattr(nodes, f.name)) for f in fields(Candidates)]
        *merged, areas = (np.concatenate(both)[selected] for both in [*arrays, (areas, nodal_areas)])
        return Candidates(*merged), areas

    @property
    def has_nodes_at_corners(self) -> bool:
        """See `Formulation`."""
        return bool(self._facets_at_corners().any())

    def _points_of(self, rule: Callable[[str], quadrature.Rule]) -> tuple[Candidates, Array]:
        """Return the points on all facets of a quadrature `rule`, given by element type, and their areas (m,) [area]."""
        rules = [rule(block.element) for block in self.secondary.blocks]
        areas = [self._areas(block, *of_block) for block, of_block in zip(self.secondary.blocks, rules, strict=True)]
        return Candidates.in_facets(self.secondary, [xi for xi, _ in rules]), np.concatenate(areas)

    def _facets_at_corners(self) -> Mask:
        """Return the lines (n_facets,) that end at a corner opposite a rigid obstacle, see the option `integration`.

        If only the corner touches, it would penetrate by the distance of the closest Gauss point times the slope.
        """
        if self.integration is not None or self.points.shape[1] == 3 or isinstance(self.primary, Surface):
            return np.zeros(self.secondary.n_facets, bool)
        smooth = smooth_ends(self.secondary, DeformedSide(self.secondary, self.points).smooth_normals)
        for _, nodes in self.symmetry_planes:
            smooth |= np.isin(self.secondary.ends, nodes)
        return np.asarray(~smooth.all(axis=1))

    def _rule(self, element: str) -> quadrature.Rule:
        """Return the integration points and weights on the reference facet of an element type."""
        if self.integration not in (None, *RULES):
            raise ContactError(unknown("integration rule", self.integration, RULES))
        rules = {"simpson": _simpson, "node": _at_nodes}
        return rules.get(self.integration or "gauss", self._gauss)(element)

    def _gauss(self, element: str) -> quadrature.Rule:
        """Return the Gauss rule with `n_gauss` points in each direction of the reference facet."""
        reference = elements.get(element)
        smallest = reference.order + 1
        count = reference.order + 2 if self.n_gauss is None else self.n_gauss
        if self.n_gauss is None and self.options.source is not None:
            # Fluid wets the points nearest to a node. A point in the middle of a facet would be nearest to several nodes.
            count += count % 2
        if count < smallest:
            raise ContactError(
                f"n_gauss = {count} on facets with {reference.n_nodes} nodes leaves a multiplier undetermined: "
                f"use at least {smallest}"
            )
        if reference.n_corners == 3 and count > 5:
            raise ContactError(f"n_gauss = {count} is too large for triangles: there are rules for 2 to 5")
        return gauss_rule(element, count)

    def _areas(self, block: FacetBlock, xi: Array, weights: Array) -> Array:
        """Return the area (n_facets * n_q,) of each integration point [area].

        If the points `xi` are the nodes, the areas are the integrals of the shape functions. A pressure field and its point
        forces then have the same resultant, also in axisymmetric models, where the radius varies along the facet.
        """
        if not np.array_equal(xi, elements.get(block.element).nodes):
            measure = facet_measure(block.facets, block.element, self.points, xi, self.axisymmetric)
            return np.maximum(measure * weights, 0.0).ravel()
        N, measure = areas_of_rule(block, self.points, self.axisymmetric)
        areas = measure @ N
        if block.element == "line3":  # at the axis the integral vanishes, except for the curvature of the facet
            areas[np.abs(areas) < NEGLIGIBLE_AREA * areas[:, 2:]] = 0.0
        return areas.ravel()

    def _independent_values(self, P: csr_array, areas: Array) -> tuple[csr_array, Indices]:
        """Return the map (n_nodes, k) from independent to nodal values of the field, and the nodes (k,) of the former.

        All nodal values are independent, except at nodes without area, at excluded nodes, and with friction at ends of
        quadratic lines on the axis, see `integration.even_at_axis`. Without friction, the value on the axis is independent,
        as in code_aster, and deviates by a few percent from the even continuation of the field.
        """
        weight = np.asarray((P.T @ diags_array(areas) @ P).diagonal())
        excluded = self.dependent_nodes(Configuration.undeformed(self.points))
        even = even_at_axis(self.secondary, self.points) if self.axisymmetric else csr_array(eye_array(P.shape[1]))
        if not self.friction:
            has_weight = (weight != 0.0).astype(float)
            even = csr_array(diags_array(has_weight) + diags_array(1.0 - has_weight) @ even)
        values = csr_array(diags_array((~excluded).astype(float)) @ even + diags_array(excluded.astype(float)))
        independent = np.flatnonzero((weight != 0.0) & ~excluded & (even.diagonal() != 0.0))
        return csr_array((values @ nodal_map(self.secondary, excluded, independent))[:, independent]), independent

    def unilateral(self, config: Configuration) -> Constraints:
        """Pair the integration points on the deformed configuration, and return one constraint per point."""
        pairing = self.pair_candidates(self._candidates, config)
        areas = self._field.projection.areas
        at_axis = self._at_axis
        pairing = replace(pairing, paired=pairing.paired & ((areas > ROUND_OFF * areas.max()) | at_axis))
        constraints = self.constraints_of_points(self._candidates, pairing, self._field, config)
        if at_axis.any():  # There is no slip on the axis.
            constraints = replace(constraints, friction=np.where(at_axis, 0.0, constraints.friction))
        return constraints

    def quadrature_error(self, config: Configuration, pressure: Array) -> Array:
        """Return the part (n_nodes,) of nodal pressures that the integration points do not transmit correctly [pressure].

        The shape functions of the primary side have kinks within the secondary facets. The forces of the nodal `pressure`
        (n_nodes,) on primary nodes therefore differ from those of a finer rule. The difference is converted to a pressure
        with the mass matrix of the primary side, and projected onto the pressure field. On a uniform pressure, it does not
        depend on the size of the facets.
        """
        primary, used = self.primary, self._field
        assert isinstance(primary, Surface)
        points, areas = self._points_of(lambda name: quadrature.product_rule(elements.get(name).linear, FINE_POINTS))
        local = self.number_on_side[points.nodes], points.shape
        fine = PressureField.of_points(local, (areas, areas), 1.0, (used.nodal_map, used.independent), False)
        values, forces, rows = pressure[used.independent], [], csr_array((0, 0))
        for candidates, projection in ((self._candidates, used.projection), (points, fine.projection)):
            pairing = self.pair_candidates(candidates, config)
            rows = rows_of(relative_motion(candidates, pairing, len(self.points)), pairing.normal)
            forces.append((rows.T @ (projection.areas * (projection.P @ values))).reshape(self.points.shape))
        mass, error = mass_matrix(primary, self.points, self.axisymmetric).tocsc(), np.zeros_like(self.points)
        error[primary.points] = splu(mass).solve((forces[0] - forces[1])[primary.points])
        return fine.pressure(areas * (rows @ error.ravel()))

    @cached_property
    def _at_axis(self) -> Mask:
        """The integration points (m,) that are nodes on the axis.

        They have no area, but only their own constraints prevent their penetration. With a penalty, which is proportional
        to areas, the result is False for all points.
        """
        areas = self._field.projection.areas
        if self.integration != "node" or not self.axisymmetric or self.options.penalty is not None:
            return np.zeros(len(areas), bool)
        return (areas == 0.0) & ~self._candidates.belonging_to(self.excluded)


def _simpson(element: str) -> quadrature.Rule:
    """Return a quadrature rule that includes the corners of a facet.

    It is Simpson's rule on lines, its tensor product on quadrangles, and a seven-point rule on triangles. Quadratic facets
    are subdivided.
    """
    reference = elements.get(element)
    if reference.n_corners == 3:
        closed = quadrature.triangle_7_closed()
        return closed if reference.order == 1 else quadrature.quartered_triangle(closed)
    line = quadrature.subdivided(quadrature.simpson_line(), reference.order)
    return line if reference.dim == 1 else quadrature.tensor_product(line, line)


def _at_nodes(element: str) -> quadrature.Rule:
    """Return the nodes of the reference facet, with the integrals of their shape functions as weights."""
    reference = elements.get(element)
    xi, weights = fine_rule(element)
    areas = weights @ reference.shape(xi)
    if not all_nodes_carry_pressure(element):
        raise ContactError(
            f"integration = 'node' makes no sense on facets of {element}: their corners have no positive area. Use "
            "'gauss' or 'simpson'"
        )
    return reference.nodes, areas


FORMULATION = Continuous
