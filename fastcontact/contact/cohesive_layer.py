"""Cohesive layers between the sides of contact pairs, as equality constraints whose compliance follows a traction law.

The law is linearised each time the contact surfaces are paired: by the secant where the layer unloads or reloads, and by a
nearly constant traction along the separation where it softens. At right angles to the separation, the derivative of the
traction is the secant. The constraints are therefore formulated along the separation and at right angles to it. The stiffness
matrix of bodies and layer then remains positive definite, and every state that is stable under prescribed displacements can
be a limit of the iteration over pairings.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import block_array, csr_array, diags_array, vstack

from fastcontact._tools.records import record, replace
from fastcontact.arrays import Array, Indices
from fastcontact.contact.cohesion import INITIATION_RATIO, Bond, CohesiveLaw
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints
from fastcontact.round_off import DIFFERENCE_STEP, SINGLE_PRECISION, TINY

# Stiffness of the linearised layer where it softens, relative to that of the intact layer. It must be positive, and is
# approximately the ratio of the magnitudes of the falling and the rising slope of the default law. With a smaller ratio, the
# iteration for a beam glued at its nodes does not converge.
SOFTENING_SLOPE = INITIATION_RATIO
# Stiffness per area of adhering sides that are pressed together, relative to the modulus of the bodies over the length of
# the shortest facet. The penetration is then about a hundredth of the elastic deformation of a facet. With 1,
# `test_adhering_blocks_are_as_stiff_in_compression_as_one` fails.
COMPRESSION_FACTOR = 100.0


@record
class CohesiveLayer:
    """Cohesive layer with m equations for its openings and m for sliding along each of k tangents; see `constraints.Tied`.

    Attributes
    ----------
    law : CohesiveLaw
    directions : tuple of k ndarray (m, dim)
        Unit tangents [-].
    areas : ndarray (m,)
        Tributary areas [area].
    initial_bond : Bond
        State at the beginning of the load step.
    damage : ndarray (m,)
        Damage at which the law is linearised [-].
    separation : ndarray (1 + k, m)
        Opening and sliding at which the law is linearised [length].
    axes : ndarray (1 + k, 1 + k, m)
        Symmetric orthogonal matrices from components along the normal and the tangents to those along the axes of the
        equations [-].
    unstressed_separation : ndarray (1 + k, m)
        Separation along these axes at which the linearised traction vanishes [length].
    compression : float
        Stiffness in compression, relative to that of the intact layer [-].
    """

    law: CohesiveLaw
    directions: tuple[Array, ...]
    areas: Array
    initial_bond: Bond
    damage: Array
    separation: Array
    axes: Array
    unstressed_separation: Array
    compression: float

    def forces(self, multiplier: Array) -> tuple[Array, Array]:
        """Return normal (m,) and tangential (m, k) forces for multipliers ((1 + k) m,) of the equations [force]."""
        normal, *tangential = np.einsum("abm,bm->am", self.axes, multiplier.reshape(-1, len(self.damage)))
        return normal, np.stack(tangential, axis=1) if tangential else np.zeros((len(normal), 0))

    def bond_after(self, constraints: Constraints, u: Array) -> Bond:
        """Return the state of the layer at the end of a step with displacements u (n_dofs,) [length].

        `constraints` are the equations of the layer.
        """
        gaps = (constraints.gap0 + constraints.B @ u).reshape(self.unstressed_separation.shape)
        separation = np.einsum("abm,bm->am", self.axes, gaps + self.unstressed_separation)
        # The tangential rows of broken points are zero, so that `separation` does not contain their slips.
        opening, *slips = np.where(self.damage < 1.0, separation, self.separation)
        before = self.initial_bond
        sliding = sum((s[:, None] * t for s, t in zip(slips, self.directions)), np.zeros_like(before.sliding))
        slip, law = np.linalg.norm(sliding, axis=1), self.law
        areas = np.where(np.isfinite(self.areas), self.areas, 0.0)
        integrity = np.where(self.damage < 1.0, 1.0 - self.damage, 0.0)
        squares = np.where(opening < 0.0, self.compression, integrity) * opening**2 + integrity * slip**2
        energies = [law.dissipated_energy(opening, slip, damage) for damage in (self.damage, before.damage)]
        released = before.released + float(areas @ (energies[0] - energies[1]))
        return Bond(before.positions, sliding, self.damage, released, 0.5 * law.stiffness * float(areas @ squares))


@record
class Softening:
    """Change of the gaps of the equations with the separations at which the law is linearised.

    Attributes
    ----------
    B : csr_array ((1 + k) m, n_dofs)
        Derivatives of the separations along the axes of the equations with respect to the displacements [-].
    correction : ndarray (1 + k, 1 + k, m)
        Derivatives of the gaps with respect to these separations, in addition to those at a fixed linearisation; zero where
        the damage does not grow [-].
    """

    B: csr_array
    correction: Array

    def derivatives_along(self, du: Array) -> tuple[Array, Array]:
        """Return an empty array instead of the derivatives of forces, and the derivatives of gaps; see `Linearised`."""
        d_separation = (self.B @ du.ravel()).reshape(self.correction.shape[1:])
        return np.empty(0), np.einsum("abm,bm->am", self.correction, d_separation).reshape(1, -1)


def cohesive_rows(
    law: CohesiveLaw, constraints: Constraints, config: Configuration, initial_gap: Array, body_stiffness: float
) -> Constraints:
    """Return the equations of a cohesive layer at the points of `constraints`.

    The compliance of the equations follows the traction law. A layer with an irreversible law is free of stress at the
    initial gaps `initial_gap` (m,) [length], and its constraints must have tangents. Adhesion, whose law is reversible, acts
    across the gaps. Broken points may close again, with the stiffness of the intact layer. The stiffness of adhering sides in
    compression is at least COMPRESSION_FACTOR times `body_stiffness`, the modulus of the bodies over the length of the
    shortest facet [pressure / length].
    """
    assert constraints.areas is not None
    m, u, start = len(constraints), config.displacement.ravel(), config.start.ravel()
    zeros = np.zeros(m)
    bond = config.bond
    if bond is None:
        initial_damage = law.damage(initial_gap, zeros, zeros) if law.reversible else zeros
        bond = Bond(constraints.positions, np.zeros_like(constraints.positions), initial_damage)
    initial_gap = zeros if law.reversible else initial_gap
    sliding, damage = bond.at(constraints.positions)
    bond = Bond(constraints.positions, sliding, damage, bond.released)
    tangential = zip(constraints.tangents, constraints.directions, constraints.slip0, strict=True)
    slip0 = [s0 + np.einsum("md,md->m", t, sliding) - T @ start for T, t, s0 in tangential]
    slips = [s0 + T @ u for T, s0 in zip(constraints.tangents, slip0, strict=True)]
    opening = constraints.gaps(config.displacement) - initial_gap
    damage = law.damage(opening, np.sqrt(sum((s**2 for s in slips), zeros)), damage)
    # In the first pairing of a step, an obstacle may have moved and the body not yet. The resulting opening causes no damage.
    if config.bond is not None and np.array_equal(u, start):
        damage = np.minimum(damage, bond.damage)
    intact, separation = damage < 1.0, np.stack([opening, *slips])
    secant = np.tile(np.where(intact, 1.0 - damage, 1.0), (len(separation), 1))
    compression = max(1.0, COMPRESSION_FACTOR * body_stiffness / law.stiffness) if law.reversible else 1.0
    # Where the secant is `compression` already, the branch must not depend on the sign of an opening that is round-off.
    stiffened = (opening < 0.0) & (secant[0] != compression)
    secant[0, stiffened] = compression
    growing = intact & (damage > (0.0 if law.reversible else bond.damage))
    softening = growing & (1.0 - damage > SOFTENING_SLOPE)
    axes, nearest_axis = _axes_along(np.where(softening, np.stack([np.maximum(opening, 0.0), *slips]), 0.0))
    slope = secant.copy()
    slope[nearest_axis[softening], np.flatnonzero(softening)] = SOFTENING_SLOPE
    unstressed_separation = np.einsum("abm,bm->am", axes, separation) * (1.0 - secant / slope)
    rotation = csr_array(block_array([[diags_array(entries) for entries in row] for row in axes], format="csr"))
    gap0 = rotation @ np.concatenate([constraints.gap0 - np.where(intact, initial_gap, 0.0), *slip0])
    B = csr_array(rotation @ vstack([constraints.B, *constraints.tangents], format="csr"))
    points = np.flatnonzero(growing)
    derivative, Q = _traction_derivatives(law, separation[:, points], compression), axes[..., points]
    correction = np.zeros_like(axes)
    correction[..., points] = np.einsum("acm,cdm,dbm->abm", Q, derivative, Q) / slope[:, None, points]
    correction[..., points] -= np.eye(len(separation))[..., None]
    no_values = np.empty(0)
    state = bond, damage, separation, axes, unstressed_separation, compression
    layer = CohesiveLayer(law, constraints.directions, constraints.areas, *state)
    return replace(
        constraints,
        B=B,
        gap0=gap0 - unstressed_separation.ravel(),
        equality=np.tile(intact, len(separation)),
        prescribed=np.zeros(separation.size, bool),
        softness=1.0 / (slope * law.stiffness * constraints.areas).reshape(1, -1),
        positions=np.tile(constraints.positions, (len(separation), 1)),
        areas=np.tile(constraints.areas, len(separation)),
        nodes=None if constraints.nodes is None else np.tile(constraints.nodes, len(separation)),
        compliance=None, tangents=(), directions=(), coupled_directions=(), tied=layer,
        geometry=lambda *_: Softening(B, correction), friction=no_values, slip0=no_values, elastic_slip=no_values,
        low_rank_compliance=no_values, branches=np.where(growing, 1 + nearest_axis, 0) + 4 * stiffened + 8 * ~intact,
    ).without(np.concatenate([np.zeros(m, bool), *[~intact] * len(slip0)]))  # fmt: skip


def _traction_derivatives(law: CohesiveLaw, separation: Array, compression: float) -> Array:
    """Return the derivatives (1 + k, 1 + k, q) of the tractions with respect to separations (1 + k, q) [-].

    The damage is that of monotonic loading to these separations. Tractions and `compression`, the stiffness in compression,
    are divided by the stiffness of the intact layer.
    """

    def traction(separation: Array) -> Array:
        opening, sliding = separation[0], np.linalg.norm(separation[1:], axis=0)
        traction = (1.0 - law.damage(opening, sliding, np.zeros_like(sliding))) * separation
        traction[0] = np.where(opening < 0.0, compression * opening, traction[0])
        return traction

    size = DIFFERENCE_STEP * np.linalg.norm(separation, axis=0)
    steps = np.eye(len(separation))[:, :, None] * size
    return np.stack([(traction(separation + h) - traction(separation - h)) / (2.0 * size) for h in steps], axis=1)


def _axes_along(vectors: Array) -> tuple[Array, Indices]:
    """Return symmetric orthogonal matrices (n, n, m) that map vectors (n, m) to coordinate axes, and their numbers (m,).

    They are Householder reflections that map each vector to the axis nearest to it, and the identity for zero vectors.
    """
    magnitude = np.abs(vectors)
    # The first of the largest components, which may be equal up to round-off.
    axis = np.argmax(magnitude >= (1.0 - SINGLE_PRECISION) * magnitude.max(axis=0), axis=0)
    columns = np.arange(len(axis))
    w = vectors / np.maximum(np.linalg.norm(vectors, axis=0), TINY)
    w[axis, columns] -= np.sign(w[axis, columns])
    w /= np.maximum(np.linalg.norm(w, axis=0), TINY)
    return np.eye(len(w))[:, :, None] - 2.0 * w[:, None] * w[None], axis
