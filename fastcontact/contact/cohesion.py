"""Traction-separation laws of cohesive layers and of adhesion.

Traction is ``(1 - damage) stiffness`` times the opening and the sliding of the sides (Camanho and Davila,
NASA/TM-2002-211737, with the mixed-mode limits of Turon, Camanho, Costa and Davila, 2006). Damage grows so that the traction
decreases linearly as the separation increases. Unloading follows the secant. In compression the layer has its undamaged
stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fastcontact._tools.neighbours import nearest
from fastcontact._tools.records import record
from fastcontact.arrays import Array

# Default ratio of the opening at the largest traction to that at break. With 0.2,
# `test_an_end_loaded_split_grows_as_linear_elastic_fracture_mechanics_predicts` fails.
INITIATION_RATIO = 0.01


@dataclass(frozen=True)
class CohesiveLaw:
    """Bilinear traction-separation law.

    Parameters
    ----------
    strength, shear_strength : float
        Largest traction in pure opening and in pure sliding [pressure].
    energy, shear_energy : float
        Fracture energies per area in pure opening and in pure sliding, the areas under the traction curves
        [pressure length].
    stiffness : float
        Slope of the traction curves before any damage [pressure / length].
    exponent : float
        Exponent of the interpolation of Benzeggagh and Kenane, or of the power law [-].
    reversible : bool
        Whether damage heals when the sides approach each other, as for adhesion.
    initiation : str
        Criterion of damage initiation in mixed mode. With ``"bk"``, the squares of the limits are interpolated like the
        energies; with ``"quadratic"``, the squares of the ratios of traction to strength sum to one; with ``"maximum"``, the
        largest of these ratios is one.
    mixed_mode : str
        Fracture energy in mixed mode: ``"bk"`` for the interpolation of Benzeggagh and Kenane, or ``"power"`` for the power
        law, in which powers of the ratios of the energies to their limits sum to one.
    """

    strength: float
    energy: float
    stiffness: float
    shear_strength: float
    shear_energy: float
    exponent: float = 2.0
    reversible: bool = False
    initiation: str = "bk"
    mixed_mode: str = "bk"

    def limits(self, opening: Array, sliding: Array) -> tuple[Array, Array]:
        """Return the separations (m,) at damage initiation and at break [length].

        They depend only on the mode ratio, the ratio of `opening` to `sliding` (m,) [length].
        """
        opening_onset, sliding_onset = self.strength / self.stiffness, self.shear_strength / self.stiffness
        square = np.maximum(opening, 0.0) ** 2 + sliding**2
        shear_fraction = np.divide(sliding**2, square, out=np.zeros_like(square), where=square > 0.0)
        interpolation = shear_fraction**self.exponent
        if self.initiation == "quadratic":
            onset = ((1.0 - shear_fraction) / opening_onset**2 + shear_fraction / sliding_onset**2) ** -0.5
        elif self.initiation == "maximum":
            onset = np.maximum((1.0 - shear_fraction) / opening_onset**2, shear_fraction / sliding_onset**2) ** -0.5
        else:
            onset = np.sqrt(opening_onset**2 + (sliding_onset**2 - opening_onset**2) * interpolation)
        if self.mixed_mode == "power":
            opening_term = ((1.0 - shear_fraction) / self.energy) ** self.exponent
            energy = (opening_term + (shear_fraction / self.shear_energy) ** self.exponent) ** (-1.0 / self.exponent)
        else:
            energy = self.energy + (self.shear_energy - self.energy) * interpolation
        return onset, 2.0 * energy / (self.stiffness * onset)

    def damage(self, opening: Array, sliding: Array, previous: Array) -> Array:
        """Return the damage (m,) [-] at normal and tangential separations `opening` and `sliding` (m,) [length].

        Unless the law is reversible, the damage is at least `previous` (m,).
        """
        onset, final = self.limits(opening, sliding)
        separation = np.maximum(np.hypot(np.maximum(opening, 0.0), sliding), onset)
        damage = np.minimum(final * (separation - onset) / (separation * (final - onset)), 1.0)
        return damage if self.reversible else np.maximum(damage, previous)

    def dissipated_energy(self, opening: Array, sliding: Array, damage: Array) -> Array:
        """Return the energy (m,) per area that is dissipated until the damage reaches `damage` (m,) [pressure length].

        The separation grows at the mode ratio of `opening` and `sliding` (m,) [length].
        """
        onset, final = self.limits(opening, sliding)
        separation = onset * final / (final - damage * (final - onset))  # at which `damage` is reached
        return 0.5 * self.stiffness * onset * final * (separation - onset) / (final - onset)


def cohesive_law(strength: float, energy: float, *, reversible: bool = False, **options: Any) -> CohesiveLaw:
    """Return the law with a strength [pressure], a fracture energy [pressure length], and other parameters in `options`.

    By default, the limits in sliding are those in opening, and in pure opening damage begins at the fraction INITIATION_RATIO
    of the opening at break.
    """
    stiffness = options.pop("stiffness", strength**2 / (2.0 * INITIATION_RATIO * energy))
    options = {"shear_strength": strength, "shear_energy": energy, **options}
    return CohesiveLaw(strength, energy, stiffness, **options, reversible=reversible)


@record
class Bond:
    """State of a cohesive layer of m points at the end of a load step.

    Attributes
    ----------
    positions : ndarray (m, dim)
        Reference positions [length].
    sliding : ndarray (m, dim)
        Relative tangential displacement since the beginning of the analysis [length].
    damage : ndarray (m,)
        Damage, from 0 (intact) to 1 (broken) [-].
    released : float
        Energy dissipated by damage so far; for adhesion, it is recovered as damage heals [energy].
    stored : float
        Elastic energy of the undamaged fraction [energy].
    """

    positions: Array
    sliding: Array
    damage: Array
    released: float = 0.0
    stored: float = 0.0

    def at(self, positions: Array) -> tuple[Array, Array]:
        """Return the sliding (n, dim) [length] and damage (n,) at the points of the layer nearest to `positions` (n, dim)."""
        if np.array_equal(positions, self.positions):
            return self.sliding, self.damage
        points = nearest(self.positions, positions)[1]
        return self.sliding[points], self.damage[points]
