r"""Segment-based mortar contact in 2D with a multiplier field.

In each pairing the secondary facets are divided into segments, see `_cut_lines`, and each segment gets Gauss points (Puso
and Laursen, 2004). The integrals are thus exact, and a uniform pressure is transmitted exactly between non-matching meshes.
Neither node-to-segment contact nor quadrature over complete facets achieves this.

Segments without an opposite facet carry no pressure, and the pressure field is projected over the other segments. If the
primary surface ends within a secondary facet, the pressure ends at this point. The pressure at an integration point and the
complementarity conditions are those of `_pressure_field`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from fastcontact.arrays import Array, Indices
from fastcontact.contact.closed_nodes import NO_AREA
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.formulations._cut_lines import line_points
from fastcontact.contact.formulations._determined_field import WholeFacets, determined
from fastcontact.contact.formulations._pressure_field import PressureField, PressureFieldFormulation
from fastcontact.contact.integration import facet_measure
from fastcontact.contact.pairing import Candidates
from fastcontact.contact.prescribed_normals import Normals
from fastcontact.contact.surface import Surface
from fastcontact.errors import ContactError
from fastcontact.mesh import quadrature
from fastcontact.round_off import SINGLE_PRECISION


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
    against_obstacles: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.n_gauss is not None and self.n_gauss < 2:
            raise ContactError(f"n_gauss = {self.n_gauss} points per piece do not integrate it exactly: use at least 2")
        facets, element = self.secondary.facets, self.secondary.element
        xi, weights = quadrature.gauss_line(3)
        lengths = facet_measure(facets, element, self.points, xi, False) @ weights
        self._whole = [WholeFacets.of(self.secondary.blocks[0], self.points, self.axisymmetric)]
        self._rho = self.augmentation * self.modulus / float(lengths.min())

    def unilateral(self, at: Configuration) -> Constraints:
        """Intersect the facets on the deformed configuration, and return one constraint per integration point."""
        deformed = self.points + at.displacement
        assert isinstance(self.primary, Surface)
        block, borders = self.secondary.blocks[0], self.options.borders(self.secondary)
        n_gauss = block.facets.shape[1] + 1 if self.n_gauss is None else self.n_gauss
        points = line_points(
            block, self.primary, self.points, deformed, self.axisymmetric, n_gauss, self.projection_tolerance, borders
        )
        facet, shape, area = points.facet, points.shape, points.area
        candidates = Candidates(self.secondary.facets[facet], shape, facet, points.xi[:, None])
        faced = self.facing(candidates, at)
        paired = np.repeat(faced.paired.reshape(-1, n_gauss).mean(axis=1) > 0.5, n_gauss)
        total = np.bincount(facet, weights=area)
        covered = np.bincount(facet, weights=np.where(paired, area, 0.0))
        kept = paired & (covered > NO_AREA * total)[facet] & (area > 0) & ~self.options.out(candidates)
        pairing = replace(faced, paired=kept)
        field = self._pressure_field(facet, shape, np.where(kept, area, 0.0), area)
        return self.of_points(candidates, pairing, field, at)

    def _pressure_field(self, facet: Indices, shape: Array, area: Array, whole: Array) -> PressureField:
        """Return the pressure field of m integration points.

        Parameters
        ----------
        facet : ndarray of int (m,)
            Number of the facet of each point.
        shape : ndarray (m, n)
            Shape functions of the n nodes of the facet at the point [-].
        area : ndarray (m,)
            Areas of the points, zero if a point cannot carry forces [area].
        whole : ndarray (m,)
            Areas of all points [area].
        """
        n, k = self.secondary.facets.shape
        mass = np.zeros((n, k, k))
        np.add.at(mass, facet, area[:, None, None] * shape[:, :, None] * shape[:, None, :])
        field = determined(self.secondary, self._whole, [mass], self.options.excluded_nodes(self.secondary))
        points = self.secondary.local[facet], shape
        return PressureField.of_points(points, (area, whole), self._rho, self.repeated(field), renewed=True)
