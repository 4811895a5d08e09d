"""Tension between the sides of a contact pair, up to a limit beyond which it falls: cohesive layers, and adhesion.

Traction is ``(1 - damage) stiffness`` times the opening and the sliding of the sides (Camanho and Davila,
NASA/TM-2002-211737, with the mixed-mode limits of Turon, Camanho, Costa and Davila, 2006). Damage grows so that the traction
falls linearly with the largest separation; unloading follows the secant. What is pressed together has the full
stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastcontact.arrays import Array

# Of the opening at which a layer is broken, that of its largest traction, where no stiffness is given.
ELASTIC = 0.01


@dataclass(frozen=True)
class CohesiveLaw:
    """A bilinear law of traction and separation.

    Parameters
    ----------
    strength, shear_strength : float
        Largest traction in pure opening and in pure sliding [pressure].
    energy, shear_energy : float
        What breaking takes by area in pure opening and in pure sliding: the areas below the law [pressure length].
    stiffness : float
        Slope of the law before any damage [pressure / length].
    exponent : float
        Of Benzeggagh and Kenane, between the modes [-].
    reversible : bool
        Whether the law has no memory, and no resistance to sliding: adhesion.
    """

    strength: float
    energy: float
    stiffness: float
    shear_strength: float
    shear_energy: float
    exponent: float = 2.0
    reversible: bool = False

    def limits(self, opening: Array, sliding: Array) -> tuple[Array, Array]:
        """Return the separations (m,) at which damage begins and ends, by the ratio of opening and sliding (m,) [length]."""
        normal, shear = self.strength / self.stiffness, self.shear_strength / self.stiffness
        square = np.maximum(opening, 0.0) ** 2 + sliding**2
        mixed = np.divide(sliding**2, square, out=np.zeros_like(square), where=square > 0.0) ** self.exponent
        onset = np.sqrt(normal**2 + (shear**2 - normal**2) * mixed)
        energy = self.energy + (self.shear_energy - self.energy) * mixed
        return onset, 2.0 * energy / (self.stiffness * onset)

    def damage(self, opening: Array, sliding: Array, before: Array) -> Array:
        """Return the damage (m,) at openings and slidings (m,) [length], after that of `before` (m,) [-]."""
        onset, end = self.limits(opening, sliding)
        separation = np.maximum(np.hypot(np.maximum(opening, 0.0), sliding), onset)
        now = np.minimum(end * (separation - onset) / (separation * (end - onset)), 1.0)
        return now if self.reversible else np.maximum(now, before)

    def released(self, opening: Array, sliding: Array, damage: Array) -> Array:
        """Return the energy by area that damage (m,) has taken, at the ratio of modes of opening and sliding (m,)."""
        onset, end = self.limits(opening, sliding)
        separation = onset * end / (end - damage * (end - onset))
        return 0.5 * self.stiffness * onset * end * (separation - onset) / (end - onset)


def cohesive_law(strength: float, energy: float, *, reversible: bool = False, **given: float) -> CohesiveLaw:
    """Return a law, with shear as opening and a stiffness that reaches its limit at a small part of the opening at break."""
    stiffness = given.pop("stiffness", strength**2 / (2.0 * ELASTIC * energy))
    shear = {"shear_strength": given.pop("shear_strength", strength), "shear_energy": given.pop("shear_energy", energy)}
    return CohesiveLaw(strength, energy, stiffness, **shear, **given, reversible=reversible)


@dataclass(frozen=True, eq=False)
class Bond:
    """What a cohesive layer is like at the end of a load step.

    Attributes
    ----------
    positions : ndarray (m, dim)
        Reference places [length].
    sliding : ndarray (m, dim)
        Relative tangential displacement so far [length].
    damage : ndarray (m,)
        0 as new, 1 broken [-].
    released : float
        Energy that breaking has taken so far [energy]; of adhesion that of the law less `stored`.
    stored : float
        Energy of the springs that are left [energy].
    """

    positions: Array
    sliding: Array
    damage: Array
    released: float = 0.0
    stored: float = 0.0

    def at(self, positions: Array) -> tuple[Array, Array]:
        """Return sliding (n, dim) [length] and damage (n,) at the nearest of other places (n, dim) [length]."""
        if np.array_equal(positions, self.positions):
            return self.sliding, self.damage
        from scipy.spatial import cKDTree

        nearest = cKDTree(self.positions).query(positions)[1]
        return self.sliding[nearest], self.damage[nearest]
