"""Contact results of bodies in finite strain, per area of the deformed surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fastcontact.arrays import Array
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.integration import lumped_areas
from fastcontact.results.step import ContactResult, half_width


def on_deformed_surface(pair: Formulation, contact: ContactResult, displacement: Array) -> ContactResult:
    """Return a contact result with Cauchy instead of nominal tractions, and widths in the deformed configuration.

    The force of each node is preserved (lumped form of Nanson's formula: Bonet and Wood, 2008, equation 4.68).

    Parameters
    ----------
    pair : Formulation
    contact : ContactResult
        Result per reference area.
    displacement : ndarray (n_points, dim)
        Displacement of the mesh [length].
    """
    before, after = areas(pair, displacement)
    ratio, stretch = before / after, _stretch(contact, displacement[contact.points], before, after)
    return replace(
        contact, pressure=contact.pressure * ratio, multiplier=contact.multiplier * ratio,
        shear=contact.shear * ratio[:, None], radius=(contact.radius[0] * stretch[0], contact.radius[1] * stretch[1]),
    )  # fmt: skip


def areas(pair: Formulation, displacement: Array) -> tuple[Array, Array]:
    """Return the tributary areas (n_nodes,) of secondary nodes before and after a displacement (n_points, dim) [area]."""
    places = pair.points, pair.points + displacement
    before, after = (lumped_areas(pair.secondary, points, pair.axisymmetric) for points in places)
    return before, after


def _stretch(contact: ContactResult, displacement: Array, before: Array, after: Array) -> tuple[float, float]:
    """Return the stretch of both bounds of the contact width [-].

    In 3D it is the square root of the area ratio of the closed nodes.
    """
    if not contact.active.any():
        return 1.0, 1.0
    if contact.coordinates.shape[1] == 3:
        grown = float(np.sqrt(after[contact.active].sum() / before[contact.active].sum()))
        return grown, grown
    moved = displacement[:, 0] if contact.tangent is None else displacement @ contact.tangent
    widths = (half_width(contact.place, contact.active, contact.across + fraction * moved) for fraction in (0.0, 1.0))
    ratios = [now / then if then > 0.0 and np.isfinite(then) else 1.0 for then, now in zip(*widths, strict=True)]
    return ratios[0], ratios[1]
