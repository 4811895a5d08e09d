"""A cohesive layer between the sides of a contact pair: equality constraints whose compliance follows its law.

In each pairing the law is linearised: by the secant where the layer unloads or reloads, and by a nearly constant traction
where it softens. Matrices then stay positive definite, and the pairings converge to every state that is stable under
prescribed displacements.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array, vstack

from fastcontact.arrays import Array
from fastcontact.contact.cohesion import Bond, CohesiveLaw
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints

# Stiffness of the linearised layer where it softens, over that of the intact layer; with a smaller one, the iteration for a
# beam glued by nodes does not converge.
LEVEL = 1e-2


@dataclass(frozen=True, eq=False)
class Layer:
    """The rows of a cohesive layer, m for openings and m for sliding along each tangent; see `constraints.Tied`.

    Attributes
    ----------
    law : CohesiveLaw
    directions : tuple of ndarray (m, dim)
        Tangents [-].
    areas : ndarray (m,)
        Tributary areas [area].
    before : Bond
        State at the beginning of the load step.
    damage : ndarray (m,)
        Damage at which the law is linearised [-].
    separation, rest : ndarray (1 + k, m)
        Opening and sliding at which the law is linearised, and those of zero traction in the linearised law [length].
    """

    law: CohesiveLaw
    directions: tuple[Array, ...]
    areas: Array
    before: Bond
    damage: Array
    separation: Array
    rest: Array

    def forces(self, multiplier: Array) -> tuple[Array, Array]:
        """Return normal (m,) and tangential (m, k) forces [force]."""
        normal, *along = multiplier.reshape(-1, len(self.damage))
        return normal, np.stack(along, axis=1) if along else np.zeros((len(normal), 0))

    def after(self, constraints: Constraints, u: Array) -> Bond:
        """Return the layer at the end of a step with displacements u (n_dofs,) [length]."""
        end = (constraints.gap0 + constraints.B @ u).reshape(self.rest.shape) + self.rest
        opening, *slides = np.where(self.damage < 1.0, end, self.separation)  # broken: no tangential rows
        sliding = sum((s[:, None] * t for s, t in zip(slides, self.directions)), np.zeros_like(self.before.sliding))
        size, law = np.linalg.norm(sliding, axis=1), self.law
        areas = np.where(np.isfinite(self.areas), self.areas, 0.0)
        integrity = np.where(self.damage < 1.0, 1.0 - self.damage, 0.0)
        stretched = np.where(opening < 0.0, 1.0, integrity) * opening**2 + integrity * size**2
        grown = law.released(opening, size, self.damage) - law.released(opening, size, self.before.damage)
        released = self.before.released + float(areas @ grown)
        return Bond(
            self.before.positions, sliding, self.damage, released, 0.5 * law.stiffness * float(areas @ stretched)
        )


def bonded(law: CohesiveLaw, constraints: Constraints, at: Configuration, lying: Array) -> Constraints:
    """Return `constraints`, which have tangents, as a cohesive layer: equations whose compliance follows its law.

    `lying` (m,) are the initial gaps [length]. Cohesive layers have no traction there, while adhesion acts across them.
    Broken constraints may close again, with the full stiffness.
    """
    assert constraints.areas is not None
    m, u, start = len(constraints), at.displacement.ravel(), at.start.ravel()
    none = np.zeros(m)
    before = at.bond
    if before is None:
        begun = law.damage(lying, none, none) if law.reversible else none
        before = Bond(constraints.positions, np.zeros_like(constraints.positions), begun)
    lying = none if law.reversible else lying
    sliding, damage = before.at(constraints.positions)
    before = Bond(constraints.positions, sliding, damage, before.released)
    known = zip(constraints.tangents, constraints.directions, constraints.slip0, strict=True)
    along = [slip0 + np.einsum("md,md->m", t, sliding) - T @ start for T, t, slip0 in known]
    slides = [rest + T @ u for T, rest in zip(constraints.tangents, along, strict=True)]
    opening = constraints.gaps(at.displacement) - lying
    damage = law.damage(opening, np.sqrt(sum((s**2 for s in slides), none)), damage)
    if at.bond is not None and np.array_equal(
        u, start
    ):  # an obstacle has moved, and the body follows in this pairing only
        damage = np.minimum(damage, before.damage)
    intact, now = damage < 1.0, np.stack([opening, *slides])
    secant = np.tile(np.where(intact, 1.0 - damage, 1.0), (len(now), 1))
    secant[0, opening < 0.0] = 1.0
    falls = intact & (damage > (0.0 if law.reversible else before.damage)) & (secant > LEVEL)
    slope = np.where(falls, LEVEL, secant)
    unused = np.empty(0)
    layer = Layer(law, constraints.directions, constraints.areas, before, damage, now, now * (1.0 - secant / slope))
    return replace(
        constraints,
        B=csr_array(vstack([constraints.B, *constraints.tangents], format="csr")),
        gap0=np.concatenate([constraints.gap0 - np.where(intact, lying, 0.0), *along]) - layer.rest.ravel(),
        equality=np.tile(intact, len(now)),
        softness=1.0 / (slope * law.stiffness * constraints.areas).ravel(),
        positions=np.tile(constraints.positions, (len(now), 1)),
        areas=np.tile(constraints.areas, len(now)),
        nodes=None if constraints.nodes is None else np.tile(constraints.nodes, len(now)),
        compliance=None, tangents=(), directions=(), tied=layer,
        friction=unused, slip0=unused, tangential_softness=unused, elastic_slip=unused, low_rank_compliance=unused,
        branches=(falls + 2 * (opening < 0.0) + 4 * ~intact).ravel().astype(np.int8),
    ).without(np.concatenate([none > 0.0, *[~intact] * len(along)]))  # fmt: skip
