"""A cohesive layer between the sides of a contact pair: equations that give way by the secants of its law.

In each pairing the traction is a line of positive slope, the secant: the energy of a layer is concave in the square of the
separation, so that the quadratic function of the secant lies above it, and every pairing lowers the energy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from fastcontact.contact.cohesion import Bond, CohesiveLaw
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Layer:
    """The rows of a cohesive layer: of m openings, then of m slidings along each tangent; see `constraints.Tied`.

    Attributes
    ----------
    law : CohesiveLaw
    directions : tuple of ndarray (m, dim)
        The tangents [-].
    areas : ndarray (m,)
        [area]
    before : Bond
        At the beginning of the load step.
    damage : ndarray (m,)
        That the rows give way by [-].
    """

    law: CohesiveLaw
    directions: tuple[Array, ...]
    areas: Array
    before: Bond
    damage: Array

    def forces(self, multiplier: Array) -> tuple[Array, Array]:
        """Return normal (m,) and tangential (m, k) forces [force]."""
        normal, *along = multiplier.reshape(-1, len(self.damage))
        return normal, np.stack(along, axis=1) if along else np.zeros((len(normal), 0))

    def after(self, part: Constraints, u: Array) -> Bond:
        """Return the layer at the end of a step with displacements u (n_dofs,) [length]."""
        opening, *along = (part.gap0 + part.B @ u).reshape(-1, len(self.damage))
        slides = np.stack(along) if along else np.zeros((0, len(opening)))
        sliding = sum((s[:, None] * t for s, t in zip(slides, self.directions)), np.zeros_like(self.before.sliding))
        size, law = np.sqrt((slides**2).sum(axis=0)), self.law
        if law.reversible:
            return replace(self.before, damage=self.damage)
        grown = law.released(opening, size, self.damage) - law.released(opening, size, self.before.damage)
        areas = np.where(np.isfinite(self.areas), self.areas, 0.0)
        return Bond(self.before.positions, sliding, self.damage, self.before.released + float(areas @ grown))


def bonded(law: CohesiveLaw, part: Constraints, at: Configuration, lying: Array | float) -> Constraints:
    """Return constraints `part`, with tangents, as a cohesive layer: equations that give way by its secants.

    `lying` (m,) are the gaps at which the layer is without traction [length]. What is broken may close again, and gives way
    by the full stiffness then.
    """
    assert part.areas is not None
    m, u, start = len(part), at.displacement.ravel(), at.start.ravel()
    before = at.bond or Bond(part.positions, np.zeros_like(part.positions), np.zeros(m))
    sliding, damage = before.at(part.positions)
    before = Bond(part.positions, sliding, damage, before.released)
    drifts = np.zeros((len(part.tangents), m)) if part.drift is None else part.drift
    known = zip(part.tangents, part.directions, drifts, strict=True)
    along = [drift + np.einsum("md,md->m", t, sliding) - T @ start for T, t, drift in known]
    slides = [rest + T @ u for T, rest in zip(part.tangents, along, strict=True)]
    opening = part.gaps(at.displacement) - lying
    damage = law.damage(opening, np.sqrt(sum((s**2 for s in slides), np.zeros(m))), damage)
    whole, stiffness = damage < 1.0, law.stiffness * part.areas
    secant = np.where(whole, 1.0 - damage, 1.0) * stiffness
    pressed = np.where(opening < 0.0, stiffness, secant)
    layer = Layer(law, part.directions, part.areas, before, damage)
    return replace(
        part,
        B=csr_array(vstack([part.B, *part.tangents], format="csr")),
        gap0=np.concatenate([part.gap0 - np.where(whole, lying, 0.0), *along]),
        equality=np.tile(whole, 1 + len(along)),
        softness=1.0 / np.concatenate([pressed, *[secant] * len(along)]),
        positions=np.tile(part.positions, (1 + len(along), 1)),
        areas=np.tile(part.areas, 1 + len(along)),
        nodes=None if part.nodes is None else np.tile(part.nodes, 1 + len(along)),
        compliance=None, tangents=(), directions=(), drift=None, friction=None, tied=layer,
    ).without(np.concatenate([np.zeros(m, bool), *[~whole] * len(along)]))  # fmt: skip
