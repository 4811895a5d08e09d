"""Rigid flat punch on an elastic half plane: frictionless, bonded, and how far it sticks with friction."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastcontact.analytic._checks import poisson, positive

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FlatPunch2D:
    """Flat rigid punch on a half plane in plane strain (Muskhelishvili 1949; Johnson 1985, section 2.8).

    Attributes
    ----------
    nu, half_width, force : float
        Poisson ratio of the half plane [-], half-width a of the punch [length], force per unit length [force/length].
    bonded : bool
        The punch sticks to the half plane.
    """

    nu: float
    half_width: float
    force: float
    bonded: bool

    @property
    def radius(self) -> float:
        """Half-width of the contact, another word for `half_width` [length]."""
        return self.half_width

    def pressure(self, x: ArrayLike) -> Array:
        """Return the pressure (...) [pressure] at `x` (...) [length], infinite at the edges, zero outside.

        Johnson (1985), eqs 2.64 and 2.69. Bonded, it changes sign ever faster towards the edge: the field oscillates there.
        """
        amplitude, phase = self._polar(x)
        return amplitude * np.cos(phase)

    def shear(self, x: ArrayLike) -> Array:
        """Return the shear traction (...) [pressure] along x on the half plane at `x` (...) [length] (Johnson, eq. 2.69).

        It pulls the surface outward; without bond it is zero.
        """
        amplitude, phase = self._polar(x)
        inside = np.abs(np.asarray(x, dtype=np.float64)) < self.half_width
        return np.where(inside, np.where(inside, amplitude, 0.0) * np.sin(phase), 0.0)

    def _polar(self, x: ArrayLike) -> tuple[Array, Array]:
        """Return amplitude and phase of pressure + i shear."""
        position = np.asarray(x, dtype=np.float64) / self.half_width
        inside = np.abs(position) < 1.0
        t = np.where(inside, position, 0.0)
        hardness = 3.0 - 4.0 * self.nu if self.bonded else 1.0
        factor = 2.0 * (1.0 - self.nu) / math.sqrt(hardness) if self.bonded else 1.0
        edge = np.where(np.abs(position) == 1.0, math.inf, 0.0)
        amplitude = factor * self.force / (math.pi * self.half_width * np.sqrt((1.0 - t) * (1.0 + t)))
        return np.where(inside, amplitude, edge), math.log(hardness) / math.pi * np.arctanh(t)


def flat_punch_2d(*, nu: float, half_width: float, force: float, bonded: bool = False) -> FlatPunch2D:
    """Return the tractions under a flat rigid punch on a half plane in plane strain.

    There is no indentation: in a half plane it depends on the supports far away.

    Parameters
    ----------
    nu, half_width, force, bonded
        As the attributes of `FlatPunch2D`; without bond there is no friction.
    """
    return FlatPunch2D(poisson("nu", nu), positive("half_width", half_width), positive("force", force), bool(bonded))


def spence_stick_ratio(*, nu: float, friction: float) -> float:
    """Return the half-width of the stick zone under a flat rigid punch over that of the punch, c/a.

    The root of K(sqrt(1 - k^2))/K(k) = beta/f with k = c/a, beta = (1 - 2 nu)/(2 (1 - nu)) and the complete elliptic
    integral K of modulus k (Spence 1973; Johnson 1985, eq. 2.73), for a monotonic load in plane strain. The formula
    leaves out what the shear does to the pressure; solutions with that coupling by boundary elements stick less far, by
    3 % at nu = 0.3, f = 0.5, by 26 % at nu = 0, f = 0.5, and by more for less friction.

    Parameters
    ----------
    nu, friction : float
        Poisson ratio of the half plane and Coulomb's coefficient f > 0 [-].
    """
    from scipy.optimize import brentq
    from scipy.special import ellipk, ellipkm1

    goal = (1.0 - 2.0 * poisson("nu", nu)) / (2.0 * (1.0 - nu)) / positive("friction", friction)
    if goal == 0.0:
        return 1.0

    # The unknown is ln(k/k'), which spreads both ends of (0, 1); the two integrals swap when its sign changes.
    def residual(x: float) -> float:
        m = 1.0 / (1.0 + math.exp(-2.0 * x))
        m1 = 1.0 / (1.0 + math.exp(2.0 * x))
        K = ellipkm1(m1) if m > 0.5 else ellipk(m)
        K_complement = ellipkm1(m) if m1 > 0.5 else ellipk(m1)
        return math.log(K_complement / K) - math.log(goal)

    if residual(-300.0) < 0.0:
        return 0.0
    if residual(300.0) > 0.0:
        return 1.0
    x = float(brentq(residual, -300.0, 300.0, xtol=1e-14))
    return 1.0 / math.sqrt(1.0 + math.exp(-2.0 * x))
