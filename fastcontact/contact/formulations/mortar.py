r"""Mortar contact: gaps are integrated over the segments in which two facets overlap.

There are two mortar methods. In 3D, or with dual multipliers, each secondary node has one weighted gap, see
`_weighted_mortar`. In 2D with standard multipliers, the contact status is determined at integration points. This module
contains the second method.

In each pairing the secondary facets are divided into segments with Gauss points, see `_cut_lines` (Puso and Laursen, 2004).
The integrals are thus exact, and a uniform pressure is transmitted exactly between non-matching meshes. Neither
node-to-segment contact nor quadrature over complete facets achieves this.

Segments without an opposite facet carry no pressure, and the projection of the pressure field is integrated over the other
segments only. If the primary surface ends within a secondary facet, the pressure ends at this point. The pressure at an
integration point and the complementarity conditions are those of `_pressure_field`.

If only a strip of a facet faces the other side, the integration points in this strip hardly determine a field over the
complete facet. On a strip of the fraction :math:`\theta` at one end of a line, the value of a polynomial of degree k at the
other end has a weight proportional to :math:`\theta^{2k+1}`. Whether the covered part determines a field is decided by the
smallest generalised eigenvalue of two mass matrices of the facet, one integrated over the covered part and one over the
complete facet. If this eigenvalue is too small, the field is simplified. It becomes linear between the corners of a quadratic
facet. If a linear field is not determined either, values at the corners that no other facet determines are the mean of those
that other facets determine. Constant fields remain representable, so that a uniform pressure is transmitted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array, lil_array

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.formulations._cut_lines import line_points
from fastcontact.contact.formulations._formulation import Formulation
from fastcontact.contact.formulations._pressure_field import PressureField, PressureFieldFormulation
from fastcontact.contact.formulations._weighted_mortar import WeightedMortar
from fastcontact.contact.integration import NEGLIGIBLE_AREA, areas_of_rule, facet_measure
from fastcontact.contact.pair_options import nodal_map
from fastcontact.contact.pairing import Candidates, Normals
from fastcontact.contact.surface import FacetBlock, Surface
from fastcontact.errors import ContactError
from fastcontact.mesh import elements, quadrature
from fastcontact.round_off import SINGLE_PRECISION

# Smallest generalised eigenvalue at which a field counts as determined. For a linear field about a seventh of the length of
# a line must be covered, for a quadratic field two fifths. Errors at the uncovered end are then amplified by at most 30.
SMALLEST_EIGENVALUE = 1e-3


@record
class CompleteFacets:
    """Mass matrices of the complete facets of a block, which have k nodes each.

    Attributes
    ----------
    block : FacetBlock
    to_corners : ndarray (n_corners, k)
        Coefficients of the linear shape functions of the corners in terms of the k shape functions of the facet [-].
    mass : ndarray (n_facets, k, k)
        Integrals of products of two shape functions over each facet [area].
    """

    block: FacetBlock
    to_corners: Array
    mass: Array

    @classmethod
    def of(cls, block: FacetBlock, points: Array, axisymmetric: bool) -> CompleteFacets:
        """Integrate over the facets of a block at reference `points` (n_points, dim) [length]."""
        element = elements.get(block.element)
        N, dA = areas_of_rule(block, points, axisymmetric)
        to_corners = elements.get(element.linear).shape(element.nodes).T
        return cls(block, to_corners, np.einsum("fq,qa,qb->fab", dA, N, N))

    def degrees(self, mass: Array) -> Indices:
        """Return the degree (n_facets,) of the field that the covered part of each facet determines.

        The degree is 2 for the field of the shape functions, 1 for a field linear between the corners, 0 if neither is
        determined, and -1 if no part of the facet is covered. `mass` (n_facets, k, k) are the integrals over the covered part
        [area].
        """
        degrees = np.full(len(mass), 2)
        degrees[~mass.any(axis=(1, 2))] = -1
        size = np.einsum("fkk->f", self.mass)
        partly = np.flatnonzero((degrees == 2) & (np.abs(mass - self.mass).max(axis=(1, 2)) > SINGLE_PRECISION * size))
        if not len(partly):
            return degrees
        full, partial, T = self.mass[partly], mass[partly], self.to_corners
        linear = _smallest_eigenvalues(T @ full @ T.T, T @ partial @ T.T) > SMALLEST_EIGENVALUE
        complete = _smallest_eigenvalues(full, partial) > SMALLEST_EIGENVALUE
        degrees[partly] = np.where(complete, 2, np.where(linear, 1, 0))
        return degrees


def _smallest_eigenvalues(full: Array, mass: Array) -> Array:
    """Return the smallest eigenvalue (n_facets,) of ``mass x = eigenvalue * full x`` for each pair of mass matrices [-]."""
    inverse = np.linalg.inv(np.linalg.cholesky(full))
    return np.asarray(np.linalg.eigvalsh(inverse @ mass @ inverse.transpose(0, 2, 1))[:, 0])


def independent_values(
    side: Surface, complete_facets: CompleteFacets, mass: Array, excluded: Mask
) -> tuple[csr_array, Indices]:
    """Return the map from the independent values of the field to all nodal values, and the nodes of the independent values.

    Parameters
    ----------
    side : Surface
        The secondary side, with m nodes.
    complete_facets : CompleteFacets
        Mass matrices of the complete facets.
    mass : ndarray (n_facets, n_nodes, n_nodes)
        Integrals of products of two shape functions over the covered part of each facet [area].
    excluded : ndarray of bool (m,)
        Nodes that have no independent value.

    Returns
    -------
    value_map : csr_array (m, k)
        Map from independent to nodal values [-].
    nodes : ndarray of int (k,)
        Node of each independent value.
    """
    degree, local = complete_facets.degrees(mass), complete_facets.block.local
    n_corners, is_independent = len(complete_facets.to_corners), np.zeros(len(side.points), bool)
    is_independent[local[degree == 2]] = True
    is_independent[local[degree == 1][:, :n_corners]] = True
    is_independent &= ~excluded
    # In a facet without an independent node, the node with the largest covered area becomes independent.
    for facet in np.flatnonzero((degree >= 0) & ~is_independent[local].any(axis=1)):
        nodes = local[facet]
        if not (is_independent[nodes].any() or excluded[nodes].all()):
            is_independent[nodes[np.argmax(np.where(excluded[nodes], -np.inf, mass[facet].sum(axis=1)))]] = True
    independent = np.flatnonzero(is_independent)
    value_map = nodal_map(side, excluded, independent)
    if (degree[degree >= 0] < 2).any():
        value_map = _with_interpolated_rows(value_map, complete_facets, local[degree >= 0], is_independent, excluded)
    return csr_array(value_map[:, independent]), independent


def _with_interpolated_rows(
    value_map: csr_array, complete_facets: CompleteFacets, local: Indices, is_independent: Mask, excluded: Mask
) -> csr_array:
    """Return the map `value_map` (m, m) with rows added for nodes that are neither independent nor excluded.

    The value at a corner is the mean of those at the independent nodes of its facets. The values at mid-side nodes are
    interpolated linearly between the corners. `local` (n, k) are the nodes of the facets that are at least partly covered.
    """
    m, has_value = len(is_independent), is_independent | excluded
    to_corners = complete_facets.to_corners
    corners = local[:, : len(to_corners)]
    row, column = np.repeat(corners, local.shape[1], axis=1).ravel(), np.tile(local, corners.shape[1]).ravel()
    selected = ~has_value[row] & is_independent[column]
    row, column = np.unique(np.column_stack([row[selected], column[selected]]), axis=0).T
    count = np.bincount(row, minlength=m)
    value_map = csr_array(diags_array(has_value.astype(float)) @ value_map)
    value_map = csr_array(value_map + coo_array((1.0 / count[row], (row, column)), shape=(m, m)))
    interpolation = lil_array((m, m))
    for facet, k in zip(*np.nonzero(~has_value[local[:, corners.shape[1] :]]), strict=True):
        # The facets on both sides of an edge have the same row.
        interpolation[local[facet, corners.shape[1] + k], corners[facet]] = to_corners[:, corners.shape[1] + k]
    return csr_array(value_map + csr_array(interpolation) @ value_map)


@dataclass(eq=False)
class SegmentMortar(PressureFieldFormulation):
    """Mortar contact of lines with standard multipliers. The parameters of `PressureFieldFormulation` apply as well.

    Parameters
    ----------
    n_gauss : int, optional
        Number of Gauss points per segment; by default 3 on linear and 4 on quadratic facets.
    multipliers : str
        ``"standard"``: the multiplier field is interpolated with the shape functions of the secondary facets.
    """

    projection_tolerance: float = SINGLE_PRECISION
    normals: Normals | None = "averaged"
    surface_smoothing: bool = True
    n_gauss: int | None = None
    multipliers: str = "standard"

    name: ClassVar[str] = "mortar"
    allows_obstacles: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.n_gauss is not None and self.n_gauss < 2:
            raise ContactError(f"n_gauss = {self.n_gauss} points per segment do not integrate exactly: use at least 2")
        block, (xi, weights) = self.secondary.only_block, quadrature.gauss_line(3)
        lengths = facet_measure(block.facets, block.element, self.points, xi, False) @ weights
        self._borders = _excluded_borders(block, self.excluded)
        self._complete_facets = CompleteFacets.of(block, self.points, self.axisymmetric)
        self._rho = self.augmentation * self.modulus / float(lengths.min())

    @classmethod
    def variant(cls, dim: int, options: Mapping[str, Any]) -> type[Formulation]:
        """Return the class of the method for `dim` dimensions and the option `multipliers`."""
        has_standard = str(options.get("multipliers", "standard")) == "standard"
        return SegmentMortar if dim == 2 and has_standard else WeightedMortar

    def unilateral(self, config: Configuration) -> Constraints:
        """Intersect the facets in the deformed configuration, and return one constraint per integration point."""
        assert isinstance(self.primary, Surface)
        block, primary = self.secondary.blocks[0], config.deformed(self.primary, self.points)
        n_gauss = block.facets.shape[1] + 1 if self.n_gauss is None else self.n_gauss
        options = self.axisymmetric, n_gauss, self.projection_tolerance, self._borders
        samples = line_points(block, primary, self.points, *options)
        facet, shape, area = samples.facet, samples.shape, samples.area
        candidates = Candidates(block.facets[facet], shape, facet, samples.xi[:, None])
        pairing_of_points = self.pair_candidates(candidates, config)
        paired = np.repeat(pairing_of_points.paired.reshape(-1, n_gauss).mean(axis=1) > 0.5, n_gauss)
        total = np.bincount(facet, weights=area)
        covered = np.bincount(facet, weights=np.where(paired, area, 0.0))
        usable = paired & (covered > NEGLIGIBLE_AREA * total)[facet] & (area > 0)
        if self.excluded.any():
            usable &= ~candidates.belonging_to(self.excluded)
        pairing = replace(pairing_of_points, paired=usable)
        usable_area, (n, k) = np.where(usable, area, 0.0), block.facets.shape
        mass = np.zeros((n, k, k))
        np.add.at(mass, facet, usable_area[:, None, None] * shape[:, :, None] * shape[:, None, :])
        points, areas = (block.local[facet], shape), (usable_area, area)
        values = independent_values(self.secondary, self._complete_facets, mass, self.dependent_nodes(config))
        field = PressureField.of_points(points, areas, self._rho, self.with_common_values(values), has_new_points=True)
        return self.constraints_of_points(candidates, pairing, field, config)


def _excluded_borders(block: FacetBlock, excluded: Mask) -> tuple[Indices, Array]:
    """Return the ends of the part `excluded` (n_points,) of a line, as facets (n,) and reference coordinates xi (n,)."""
    order = np.argsort(elements.get(block.element).nodes[:, 0])
    excluded = excluded[block.facets[:, order]]
    # The border lies where the shape functions of two adjacent nodes are equal: at 0 on linear lines, and at -2/3 and 2/3
    # on quadratic lines.
    crossover = np.linspace(-2 / 3, 2 / 3, 2) if len(order) == 3 else np.zeros(1)
    facet, edge = np.nonzero(excluded[:, 1:] != excluded[:, :-1])
    return facet, crossover[edge]


FORMULATION = SegmentMortar
