"""Cohesive layers between the sides of contact pairs, as equality constraints whose compliance follows a traction law.

The law is linearised in each pairing: by the secant where the layer unloads or reloads, and by a nearly constant traction
along the separation where it softens. At right angles to the separation, the derivative of the traction is the secant. The
constraints are therefore formulated along the separation and at right angles to it. The matrices then remain positive
definite, and the iteration over pairings converges to every state that is stable under prescribed displacements.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import block_array, csr_array, diags_array, vstack

from fastcontact.arrays import Array, Indices
from fastcontact.contact.cohesion import ELASTIC, Bond, CohesiveLaw
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints
from fastcontact.round_off import DIFFERENCES, SINGLE_PRECISION, TINY

# Stiffness of the linearised layer where it softens, relative to that of the intact layer. It is the magnitude of the ratio
# of the two slopes of the default law. With a smaller ratio, the iteration for a beam glued at its nodes does not converge.
SOFTENING_SLOPE = ELASTIC
# Stiffness per area of adhering sides that are pressed together, relative to the modulus of the bodies over the length of
# the shortest facet. The penetration is then about a hundredth of the elastic deformation of a facet.
COMPRESSION = 100.0


@dataclass(frozen=True, eq=False)
class Layer:
    """Cohesive layer with m constraints for its openings and m for sliding along each tangent; see `constraints.Tied`.

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
    separation : ndarray (1 + k, m)
        Opening and sliding at which the law is linearised [length].
    axes : ndarray (1 + k, 1 + k, m)
        Symmetric orthogonal matrices from the normal and the tangents to the axes of the constraints [-].
    rest : ndarray (1 + k, m)
        Separation along these axes at which the linearised traction vanishes [length].
    compression : float
        Stiffness in compression, relative to that of the intact layer [-].
    """

    law: CohesiveLaw
    directions: tuple[Array, ...]
    areas: Array
    before: Bond
    damage: Array
    separation: Array
    axes: Array
    rest: Array
    compression: float

    def forces(self, multiplier: Array) -> tuple[Array, Array]:
        """Return normal (m,) and tangential (m, k) forces [force]."""
        normal, *tangential = np.einsum("abm,bm->am", self.axes, multiplier.reshape(-1, len(self.damage)))
        return normal, np.stack(tangential, axis=1) if tangential else np.zeros((len(normal), 0))

    def after(self, constraints: Constraints, u: Array) -> Bond:
        """Return the state of the layer at the end of a step with displacements u (n_dofs,) [length]."""
        separation = (constraints.gap0 + constraints.B @ u).reshape(self.rest.shape) + self.rest
        separation = np.einsum("abm,bm->am", self.axes, separation)
        # The tangential rows of broken constraints are zero, so that `separation` does not contain their slips.
        opening, *slips = np.where(self.damage < 1.0, separation, self.separation)
        sliding = sum((s[:, None] * t for s, t in zip(slips, self.directions)), np.zeros_like(self.before.sliding))
        slip, law = np.linalg.norm(sliding, axis=1), self.law
        areas = np.where(np.isfinite(self.areas), self.areas, 0.0)
        integrity = np.where(self.damage < 1.0, 1.0 - self.damage, 0.0)
        squares = np.where(opening < 0.0, self.compression, integrity) * opening**2 + integrity * slip**2
        dissipated = law.released(opening, slip, self.damage) - law.released(opening, slip, self.before.damage)
        released = self.before.released + float(areas @ dissipated)
        return Bond(self.before.positions, sliding, self.damage, released, 0.5 * law.stiffness * float(areas @ squares))


@dataclass(frozen=True, eq=False)
class Softening:
    """Derivatives of the gaps of the linearised law with respect to the separations at which it is linearised.

    Attributes
    ----------
    rows : csr_array ((1 + k) m, n_dofs)
        Derivatives of the separations along the axes of the constraints [-].
    correction : ndarray (1 + k, 1 + k, m)
        Derivatives of the gaps with respect to these separations, zero where the layer does not soften [-].
    """

    rows: csr_array
    correction: Array

    def along(self, du: Array) -> tuple[Array, Array]:
        """Return the directional derivatives along `du` of forces, which are omitted, and of gaps; see `Linearised`."""
        jump = (self.rows @ du.ravel()).reshape(self.correction.shape[1:])
        return np.empty(0), np.einsum("abm,bm->am", self.correction, jump).reshape(1, -1)


def cohesive_rows(
    law: CohesiveLaw, constraints: Constraints, config: Configuration, initial_gap: Array, body_stiffness: float
) -> Constraints:
    """Return equations of a cohesive layer at the points of `constraints`, which must have tangents.

    The compliance of the equations follows the traction law. A cohesive layer is free of stress at the initial gaps
    `initial_gap` (m,) [length], whereas adhesion acts across them. Broken constraints may close again, with the stiffness of
    the intact layer. Adhering sides are stiffer in compression, at least by the factor COMPRESSION than the bodies. The
    `body_stiffness` is the modulus over the length of the shortest facet [pressure / length].
    """
    assert constraints.areas is not None
    m, u, start = len(constraints), config.displacement.ravel(), config.start.ravel()
    zeros = np.zeros(m)
    before = config.bond
    if before is None:
        initial_damage = law.damage(initial_gap, zeros, zeros) if law.reversible else zeros
        before = Bond(constraints.positions, np.zeros_like(constraints.positions), initial_damage)
    initial_gap = zeros if law.reversible else initial_gap
    sliding, damage = before.at(constraints.positions)
    before = Bond(constraints.positions, sliding, damage, before.released)
    tangential = zip(constraints.tangents, constraints.directions, constraints.slip0, strict=True)
    slip0 = [s0 + np.einsum("md,md->m", t, sliding) - T @ start for T, t, s0 in tangential]
    slips = [s0 + T @ u for T, s0 in zip(constraints.tangents, slip0, strict=True)]
    opening = constraints.gaps(config.displacement) - initial_gap
    damage = law.damage(opening, np.sqrt(sum((s**2 for s in slips), zeros)), damage)
    # In the first pairing of a step, an obstacle may have moved while the body has not. This opening causes no damage.
    if config.bond is not None and np.array_equal(u, start):
        damage = np.minimum(damage, before.damage)
    intact, jump = damage < 1.0, np.stack([opening, *slips])
    secant = np.tile(np.where(intact, 1.0 - damage, 1.0), (len(jump), 1))
    compression = max(1.0, COMPRESSION * body_stiffness / law.stiffness) if law.reversible else 1.0
    # Otherwise the sign of an opening that is round-off would change the branch of the law.
    stiffened = (opening < 0.0) & (secant[0] != compression)
    secant[0, stiffened] = compression
    growing = intact & (damage > (0.0 if law.reversible else before.damage))
    softening = growing & (1.0 - damage > SOFTENING_SLOPE)
    axes, axis = _axes_along(np.where(softening, np.stack([np.maximum(opening, 0.0), *slips]), 0.0))
    slope = secant.copy()
    slope[axis[softening], np.flatnonzero(softening)] = SOFTENING_SLOPE
    rest = np.einsum("abm,bm->am", axes, jump) * (1.0 - secant / slope)
    rotation = csr_array(block_array([[diags_array(entries) for entries in row] for row in axes], format="csr"))
    gap0 = rotation @ np.concatenate([constraints.gap0 - np.where(intact, initial_gap, 0.0), *slip0])
    B = csr_array(rotation @ vstack([constraints.B, *constraints.tangents], format="csr"))
    at = np.flatnonzero(growing)
    derivative = _derivative(law, jump[:, at], compression)
    correction = np.zeros_like(axes)
    correction[..., at] = np.einsum("acm,cdm,dbm->abm", axes[..., at], derivative, axes[..., at]) / slope[:, None, at]
    correction[..., at] -= np.eye(len(jump))[..., None]
    default = np.empty(0)
    layer = Layer(law, constraints.directions, constraints.areas, before, damage, jump, axes, rest, compression)
    return replace(
        constraints,
        B=B,
        gap0=gap0 - rest.ravel(),
        equality=np.tile(intact, len(jump)),
        prescribed=np.zeros(jump.size, bool),
        softness=1.0 / (slope * law.stiffness * constraints.areas).ravel(),
        positions=np.tile(constraints.positions, (len(jump), 1)),
        areas=np.tile(constraints.areas, len(jump)),
        nodes=None if constraints.nodes is None else np.tile(constraints.nodes, len(jump)),
        compliance=None, tangents=(), directions=(), tied=layer, geometry=lambda *_: Softening(B, correction),
        friction=default, slip0=default, tangential_softness=default, elastic_slip=default, low_rank_compliance=default,
        branches=np.where(growing, 1 + axis, 0) + 4 * stiffened + 8 * ~intact,
    ).without(np.concatenate([zeros > 0.0, *[~intact] * len(slip0)]))  # fmt: skip


def _derivative(law: CohesiveLaw, jump: Array, compression: float) -> Array:
    """Return the derivatives (1 + k, 1 + k, q) of the tractions at separations (1 + k, q) where the layer softens.

    They are relative to the stiffness of the intact layer. `compression` is the relative stiffness in compression.
    """

    def traction(jump: Array) -> Array:
        sliding = np.linalg.norm(jump[1:], axis=0)
        traction = (1.0 - law.damage(jump[0], sliding, np.zeros_like(sliding))) * jump
        traction[0] = np.where(jump[0] < 0.0, compression * jump[0], traction[0])
        return traction

    step = DIFFERENCES * np.linalg.norm(jump, axis=0)
    units = np.eye(len(jump))[:, :, None] * step
    return np.stack([(traction(jump + unit) - traction(jump - unit)) / (2.0 * step) for unit in units], axis=1)


def _axes_along(vectors: Array) -> tuple[Array, Indices]:
    """Return symmetric orthogonal matrices (n, n, m) that map vectors (n, m) to coordinate axes, and these axes (m,).

    They are Householder reflections that map each vector to the axis nearest to it, and the identity for zero vectors.
    """
    size = np.abs(vectors)
    axis = np.argmax(size >= (1.0 - SINGLE_PRECISION) * size.max(axis=0), axis=0)  # irrespective of round-off
    columns = np.arange(len(axis))
    w = vectors / np.maximum(np.linalg.norm(vectors, axis=0), TINY)
    w[axis, columns] -= np.sign(w[axis, columns])
    w /= np.maximum(np.linalg.norm(w, axis=0), TINY)
    return np.eye(len(w))[:, :, None] - 2.0 * w[:, None] * w[None], axis
