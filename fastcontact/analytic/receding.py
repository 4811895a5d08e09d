"""Elastic layer pressed on a half plane, without friction and weight: the contact recedes to a fixed width."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastcontact.analytic._bodies import Bodies, plane_kinematics
from fastcontact.analytic._checks import not_negative, positive
from fastcontact.errors import ModelError

Array = NDArray[np.float64]
_TERMS = 40  # of the pressure's Chebyshev series; 60 change the table of the tests by less than 1e-7
_LARGEST_RATIO = 1e3  # of the moduli: beyond, the contact is so wide that the layer is a beam
_LARGEST_LOAD = 10.0  # half-width of the load over thickness


@dataclass(frozen=True)
class RecedingLayer:
    """Contact of a layer under a strip load with a half plane (Keer, Dundurs and Tsai 1972).

    The contact does not depend on the size of the force.

    Attributes
    ----------
    thickness : float
        Of the layer [length].
    load_half_width : float
        The force is spread evenly over |x| <= load_half_width on the top [length].
    force : float
        Force per unit length [force/length].
    radius : float
        Half-width c of the contact [length].
    series : ndarray (n,)
        Coefficients of the pressure: sum of series[k] U_2k(x/c) sqrt(1 - x^2/c^2) [pressure].
    """

    thickness: float
    load_half_width: float
    force: float
    radius: float
    series: tuple[float, ...]

    @property
    def half_width(self) -> float:
        """Half-width c of the contact, another word for `radius` [length]."""
        return self.radius

    @property
    def pressure_max(self) -> float:
        """Pressure at the middle [pressure]."""
        return float(self.pressure(0.0))

    def pressure(self, x: ArrayLike) -> Array:
        """Return the contact pressure at positions `x`, zero outside [pressure]."""
        position = np.abs(np.asarray(x, dtype=np.float64)) / self.radius
        theta = np.arccos(np.minimum(position, 1.0))
        # U_2k(cos theta) sin theta = sin((2 k + 1) theta)
        return sum((b * np.sin((2 * k + 1) * theta) for k, b in enumerate(self.series)), np.zeros_like(theta))


def _layer(xi: Array) -> tuple[Array, Array]:
    """Return A - 1 and 1 - S at wave numbers xi (thickness 1).

    A and S are the normal compliances of the layer's faces, over those of a half plane, under pressures on both faces
    that bend it (A) or squeeze it (S), in Fourier space: with x the wave number, S = (cosh x - 1)/(sinh x + x) and
    A = (cosh x + 1)/(sinh x - x).
    """
    cubic = xi**3 / 6.0 * (1.0 + xi**2 / 20.0 * (1.0 + xi**2 / 42.0 * (1.0 + xi**2 / 72.0 * (1.0 + xi**2 / 110.0))))
    difference = np.where(xi < 0.6, cubic, np.sinh(xi) - xi)
    return (1.0 + xi + np.exp(-xi)) / difference, (1.0 + xi - np.exp(-xi)) / (np.sinh(xi) + xi)


def _pressure(c: float, ratio: float, a: float) -> tuple[Array, Array]:
    """Return angles theta_i in (0, pi/2) and p(c cos theta_i)/sin(theta_i) for a trial half-width c.

    Thickness and force are 1. The slope of the gap vanishes at the collocation points; pressure bounded at both
    ends: Gauss-Chebyshev rule of the second kind (Erdogan and Gupta 1972), folded by symmetry.
    """
    xi, weight = np.polynomial.legendre.leggauss(int(160 + 40 * max(c, a)))
    xi, weight = 20.0 * (xi + 1.0), 20.0 * weight
    bend, squeeze = _layer(xi)
    m = np.arange(1, _TERMS // 2 + 1)
    theta = m * math.pi / (_TERMS + 1)
    t, x = np.cos(theta), np.cos((2 * m - 1) * math.pi / (2 * (_TERMS + 1)))
    sines = np.sin(np.outer(c * x, xi)) * weight
    # The whole force is 1: with its part taken out, the kernel stays bounded at small wave numbers.
    kernel = sines @ (0.5 * (bend - squeeze) * -2.0 * np.sin(0.5 * np.outer(c * t, xi)) ** 2).T
    singular = 1.0 / (x[:, None] - t) + 1.0 / (x[:, None] + t)
    weights = math.pi * np.sin(theta) ** 2 / (_TERMS + 1)
    right = sines @ (squeeze + 0.5 * (bend + squeeze) * (np.sinc(xi * a / math.pi) - 1.0))
    return theta, np.linalg.solve(((1.0 + ratio) * singular + 2.0 * c * kernel) * weights, right)


def _excess(c: float, ratio: float, a: float) -> float:
    """Return the force of the trial contact of half-width c, less the applied one, 1."""
    theta, phi = _pressure(c, ratio, a)
    return 2.0 * c * math.pi / (_TERMS + 1) * float((np.sin(theta) ** 2 * phi).sum()) - 1.0


def receding_layer(
    *,
    E1: float,
    nu1: float,
    thickness: float,
    force: float,
    E2: float | None = None,
    nu2: float = 0.0,
    load_half_width: float = 0.0,
    kinematics: str = "plane_strain",
) -> RecedingLayer:
    """Return the contact of a layer (1) with a half plane (2) under a strip load on the layer's top.

    The singular integral equation of Keer, Dundurs and Tsai (1972), solved by a Chebyshev series of 40 terms.

    Parameters
    ----------
    E1, nu1 : float
        Layer [pressure], [-].
    E2, nu2 : float
        Half plane; `E2` None is rigid [pressure], [-].
    thickness : float
        Of the layer [length].
    force : float
        Force per unit length [force/length].
    load_half_width : float
        The force is spread evenly over |x| <= load_half_width, at most ten thicknesses; 0 is a line force [length].
    kinematics : str
        "plane_strain" or "plane_stress".

    Raises
    ------
    ModelError
        If a number is out of range.
    """
    bodies = Bodies(E1, nu1, E2, nu2)
    plane_kinematics(kinematics)
    h, P = positive("thickness", thickness), positive("force", force)
    a = not_negative("load_half_width", load_half_width) / h
    ratio = _modulus_ratio(bodies, kinematics)
    if ratio > _LARGEST_RATIO:
        raise ModelError(f"the layer is {ratio:g} times stiffer than the half plane: the limit is {_LARGEST_RATIO:g}")
    if a > _LARGEST_LOAD:
        raise ModelError(f"load_half_width is {a:g} thicknesses: the limit is {_LARGEST_LOAD:g}")
    c = _half_width(ratio, a)
    theta, phi = _pressure(c, ratio, a)
    k = np.arange(_TERMS // 2)
    # Sine series of p at the nodes: the discrete sine transform, folded by symmetry.
    series = 4.0 / (_TERMS + 1) * (np.sin(np.outer(2 * k + 1, theta)) @ (phi * np.sin(theta)))
    return RecedingLayer(h, a * h, P, c * h, tuple((series * P / h).tolist()))


def _modulus_ratio(bodies: Bodies, kinematics: str) -> float:
    """Return E1'/E2' of the plane moduli, 0 for a rigid half plane."""
    if bodies.E2 is None:
        return 0.0
    strain = kinematics == "plane_strain"
    first = bodies.E1 / (1.0 - bodies.nu1**2 if strain else 1.0)
    return first * (1.0 - bodies.nu2**2 if strain else 1.0) / bodies.E2


def _half_width(ratio: float, a: float) -> float:
    """Return c over thickness, where the trial contact carries the whole force."""
    from scipy.optimize import brentq

    low = 0.5
    while _excess(low, ratio, a) < 0.0:
        low *= 0.8
    high = 1.25 * low
    while _excess(high, ratio, a) > 0.0:
        high *= 1.25
    return float(brentq(_excess, high / 1.25, high, args=(ratio, a), xtol=1e-13))
