"""Elastic layer pressed on a half-plane, without friction or weight: the contact recedes as soon as a load acts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fastcontact.analytic._inputs import Bodies, array, not_negative, plane_kinematics, positive
from fastcontact.arrays import Array
from fastcontact.errors import ModelError

_TERMS = 80  # terms of the Chebyshev series: errors of half-width and pressure below 1e-6 in the range below
_LARGEST_RATIO = 100.0  # largest ratio of the moduli: beyond it, contact is so wide that the layer acts as a beam
_LARGEST_LOAD = 10.0  # largest half-width of the load over thickness


@dataclass(frozen=True)
class RecedingLayer:
    """Contact of a layer under a strip load with a half-plane (Keer, Dundurs and Tsai 1972).

    The contact width does not depend on the force.

    Attributes
    ----------
    thickness, load_half_width : float
        Thickness of the layer, and half-width of the uniform load ``|x| <= load_half_width`` on its top [length].
    force, radius : float
        Force per unit length [force/length], and half-width c of the contact [length].
    series : tuple of float
        Coefficients of the pressure, p(c cos theta) sin(theta) = sum of series[k] cos(2 k theta) [pressure].
    """

    thickness: float
    load_half_width: float
    force: float
    radius: float
    series: tuple[float, ...]

    @property
    def half_width(self) -> float:
        """Half-width c of the contact, an alias of `radius` [length]."""
        return self.radius

    @property
    def pressure_max(self) -> float:
        """Largest pressure, at the middle of the contact [pressure]."""
        return float(self.pressure(0.0))

    def pressure(self, x: ArrayLike) -> Array:
        """Return the contact pressure (...) [pressure] at positions `x` (...) [length], zero outside."""
        position = np.abs(array("x", x)) / self.radius
        theta = np.arccos(np.minimum(position, 1.0))
        # The coefficients sum to zero: cos(2 k theta) - 1 in place of cos(2 k theta) avoids 0/0 at the edge.
        terms = sum((b * np.sin(k * theta) ** 2 for k, b in enumerate(self.series)), np.zeros_like(theta))
        return -2.0 * terms / np.maximum(np.sin(theta), 1e-300)


def _compliances(xi: Array) -> tuple[Array, Array]:
    """Return A - 1 and 1 - S at wave numbers xi (thickness 1).

    A and S are the normal compliances of the layer's faces in Fourier space, relative to those of a half-plane, under
    pressures on both faces that bend it (A) or squeeze it (S): S = (cosh xi - 1)/(sinh xi + xi) and
    A = (cosh xi + 1)/(sinh xi - xi).
    """
    cubic = xi**3 / 6.0 * (1.0 + xi**2 / 20.0 * (1.0 + xi**2 / 42.0 * (1.0 + xi**2 / 72.0 * (1.0 + xi**2 / 110.0))))
    difference = np.where(xi < 0.6, cubic, np.sinh(xi) - xi)
    return (1.0 + xi + np.exp(-xi)) / difference, (1.0 + xi - np.exp(-xi)) / (np.sinh(xi) + xi)


def _wave_numbers(panels: int) -> tuple[Array, Array]:
    """Return points and weights on (0, 40); above 40 all compliances are those of a half-plane."""
    points, weights = np.polynomial.legendre.leggauss(12)
    width = 40.0 / panels
    start = width * np.arange(panels)[:, None]
    return (start + 0.5 * width * (points + 1.0)).ravel(), np.tile(0.5 * width * weights, panels)


def _series(c: float, ratio: float, a: float) -> Array:
    """Return b_k of p(c cos theta) sin(theta) = sum of b_k cos(2 k theta) for a trial half-width c.

    Thickness and force are 1. The slope of the gap vanishes at the collocation points and the pressure
    carries the force: Gauss-Chebyshev rule of the first kind (Erdogan and Gupta 1972), folded by symmetry.
    """
    xi, weight = _wave_numbers(20 + int(5 * max(c, a)))
    bend, squeeze = _compliances(xi)
    half = _TERMS // 2
    theta = (np.arange(half) + 0.5) * math.pi / _TERMS
    t, x = np.cos(theta), np.cos(np.arange(1, half) * math.pi / _TERMS)
    sines = np.sin(np.outer(c * x, xi)) * weight
    # The total force is 1: without its contribution, the kernel stays bounded at small wave numbers.
    kernel = sines @ (0.5 * (bend - squeeze) * -2.0 * np.sin(0.5 * np.outer(c * t, xi)) ** 2).T
    singular = 1.0 / (x[:, None] - t) + 1.0 / (x[:, None] + t)
    right = sines @ (squeeze + 0.5 * (bend + squeeze) * (np.sinc(xi * a / math.pi) - 1.0))
    slopes = ((1.0 + ratio) * singular + 2.0 * c * kernel) * math.pi / _TERMS
    force = np.full((1, half), 2.0 * c * math.pi / _TERMS)
    values = np.linalg.solve(np.vstack([slopes, force]), np.append(right, 1.0))
    cosines = np.cos(2.0 * np.outer(np.arange(half), theta))
    coefficients = 2.0 / half * (cosines @ values)
    coefficients[0] *= 0.5
    return coefficients


def _edge_singularity(c: float, ratio: float, a: float) -> float:
    """Return the strength of the pressure's singularity at the edge of the trial contact of half-width c.

    Positive where the contact is too narrow, negative where it is too wide.
    """
    return float(_series(c, ratio, a).sum())


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
    """Return the contact of a layer (1) with a half-plane (2) under a strip load on the layer's top.

    The singular integral equation of Keer, Dundurs and Tsai (1972), solved by a Chebyshev series to a
    relative 1e-6 or better.

    Parameters
    ----------
    E1, nu1 : float
        Young's modulus [pressure] and Poisson's ratio [-] of the layer.
    E2, nu2 : float, optional
        Those of the half-plane; without `E2` it is rigid.
    thickness, force : float
        Thickness of the layer [length], and force per unit length [force/length].
    load_half_width : float
        Half-width of the uniform load, at most ten thicknesses; 0 is a line force [length].
    kinematics : {"plane_strain", "plane_stress"}

    Returns
    -------
    RecedingLayer

    Raises
    ------
    ModelError
        If a number is out of range, or the layer is more than 100 times stiffer than the half-plane.

    Examples
    --------
    >>> from fastcontact import analytic
    >>> layer = analytic.receding_layer(E1=1000.0, nu1=0.3, thickness=1.0, force=10.0)
    >>> round(layer.half_width, 4)  # whatever the force
    0.857
    """
    bodies = Bodies(E1, nu1, E2, nu2)
    plane_kinematics(kinematics)
    h, P = positive("thickness", thickness), positive("force", force)
    a = not_negative("load_half_width", load_half_width) / h
    ratio = _modulus_ratio(bodies, kinematics)
    if ratio > _LARGEST_RATIO:
        raise ModelError(f"the layer is {ratio:g} times stiffer than the half-plane: the limit is {_LARGEST_RATIO:g}")
    if a > _LARGEST_LOAD:
        raise ModelError(f"load_half_width is {a:g} thicknesses: the limit is {_LARGEST_LOAD:g}")
    c = _half_width(ratio, a)
    return RecedingLayer(h, a * h, P, c * h, tuple((_series(c, ratio, a) * P / h).tolist()))


def _modulus_ratio(bodies: Bodies, kinematics: str) -> float:
    """Return E1'/E2' of the plane moduli, 0 for a rigid half-plane."""
    if bodies.E2 is None:
        return 0.0
    strain = kinematics == "plane_strain"
    first = bodies.E1 / (1.0 - bodies.nu1**2 if strain else 1.0)
    return first * (1.0 - bodies.nu2**2 if strain else 1.0) / bodies.E2


def _half_width(ratio: float, a: float) -> float:
    """Return the half-width c, relative to the thickness, for which the pressure is not singular at the edge."""
    from scipy.optimize import brentq

    high = 1.0  # the contact of a soft layer under a line force has 0.86
    while _edge_singularity(high, ratio, a) > 0.0:
        high *= 1.3
    return float(brentq(_edge_singularity, high / 1.3, high, args=(ratio, a), xtol=1e-13))
