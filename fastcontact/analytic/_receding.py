"""Receding contact of an elastic layer that is pressed on a half-plane, without friction or weight."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fastcontact.analytic._inputs import Bodies, array, check_plane, not_negative, positive
from fastcontact.arrays import Array
from fastcontact.errors import ModelError

# Number of Gauss-Chebyshev points, for which the errors of half-width and pressure are below 1e-6 within the limits below.
_TERMS = 80
_LARGEST_RATIO = 100.0  # largest ratio of the moduli, beyond which the contact is so wide that the layer acts as a beam
_LARGEST_LOAD = 10.0  # largest ratio of the half-width of the load to the thickness of the layer


@dataclass(frozen=True)
class RecedingLayer:
    """Contact of a layer under a strip load with a half-plane (Keer, Dundurs and Tsai 1972).

    The width of the contact does not depend on the force.

    Attributes
    ----------
    thickness : float
        Thickness of the layer [length].
    load_half_width : float
        Half-width [length] of the uniform load on the top of the layer, which acts on ``|x| <= load_half_width``.
    force : float
        Force per unit length [force/length].
    radius : float
        Half-width c of the contact [length].
    series : tuple of float
        Coefficients of the Chebyshev series p(c cos theta) sin(theta) = sum of series[k] cos(2 k theta) of the contact
        pressure p [pressure].
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
        # The coefficients sum to zero, so that cos(2 k theta) - 1 can replace cos(2 k theta), which avoids 0/0 at the edge.
        terms = sum((b * np.sin(k * theta) ** 2 for k, b in enumerate(self.series)), np.zeros_like(theta))
        return -2.0 * terms / np.maximum(np.sin(theta), 1e-300)


def _compliances(xi: Array) -> tuple[Array, Array]:
    """Return A - 1 and 1 - S at wave numbers xi, for a layer of thickness 1.

    A and S are the normal compliances of the faces of the layer in Fourier space, relative to those of a half-plane, for
    pressures on both faces that bend (A) or compress (S) the layer: A = (cosh xi + 1)/(sinh xi - xi) and
    S = (cosh xi - 1)/(sinh xi + xi).
    """
    cubic = xi**3 / 6.0 * (1.0 + xi**2 / 20.0 * (1.0 + xi**2 / 42.0 * (1.0 + xi**2 / 72.0 * (1.0 + xi**2 / 110.0))))
    difference = np.where(xi < 0.6, cubic, np.sinh(xi) - xi)
    return (1.0 + xi + np.exp(-xi)) / difference, (1.0 + xi - np.exp(-xi)) / (np.sinh(xi) + xi)


def _wave_numbers(panels: int) -> tuple[Array, Array]:
    """Return points and weights of a Gauss rule for wave numbers from 0 to 40, beyond which A and S are 1 to round-off."""
    points, weights = np.polynomial.legendre.leggauss(12)
    width = 40.0 / panels
    start = width * np.arange(panels)[:, None]
    return (start + 0.5 * width * (points + 1.0)).ravel(), np.tile(0.5 * width * weights, panels)


def _series(c: float, ratio: float, a: float) -> Array:
    """Return the coefficients b_k of p(c cos theta) sin(theta) = sum of b_k cos(2 k theta) for a trial half-width c.

    Thickness and force are 1, `ratio` is the ratio of the moduli and `a` the half-width of the load. The slope of the gap
    vanishes at the collocation points, and the pressure balances the force. The integral equation is discretised by the
    Gauss-Chebyshev rule of the first kind (Erdogan and Gupta 1972), reduced to one half by symmetry.
    """
    xi, weight = _wave_numbers(20 + int(5 * max(c, a)))
    bending, compression = _compliances(xi)
    n = _TERMS // 2
    theta = (np.arange(n) + 0.5) * math.pi / _TERMS
    t, x = np.cos(theta), np.cos(np.arange(1, n) * math.pi / _TERMS)
    sines = np.sin(np.outer(c * x, xi)) * weight
    # Without the contribution of the total force, which is known, the kernel is bounded at small wave numbers.
    kernel = sines @ (0.5 * (bending - compression) * -2.0 * np.sin(0.5 * np.outer(c * t, xi)) ** 2).T
    singular = 1.0 / (x[:, None] - t) + 1.0 / (x[:, None] + t)
    load = sines @ (compression + 0.5 * (bending + compression) * (np.sinc(xi * a / math.pi) - 1.0))
    slopes = ((1.0 + ratio) * singular + 2.0 * c * kernel) * math.pi / _TERMS
    force = np.full((1, n), 2.0 * c * math.pi / _TERMS)
    values = np.linalg.solve(np.vstack([slopes, force]), np.append(load, 1.0))
    cosines = np.cos(2.0 * np.outer(np.arange(n), theta))
    coefficients = 2.0 / n * (cosines @ values)
    coefficients[0] *= 0.5
    return coefficients


def _edge_singularity(c: float, ratio: float, a: float) -> float:
    """Return the strength of the singularity of the pressure at the edge of a trial contact with the half-width c.

    It is positive if the trial contact is too narrow, and negative if it is too wide.
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
    """Return the contact of a layer (1) with a half-plane (2) under a strip load on the top of the layer.

    The singular integral equation of Keer, Dundurs and Tsai (1972) is solved by a Chebyshev series with a relative error of
    at most 1e-6.

    Parameters
    ----------
    E1, nu1 : float
        Young's modulus [pressure] and Poisson's ratio [-] of the layer.
    E2, nu2 : float, optional
        Young's modulus [pressure] and Poisson's ratio [-] of the half-plane, which is rigid without `E2`.
    thickness : float
        Thickness of the layer [length].
    force : float
        Force per unit length [force/length].
    load_half_width : float
        Half-width [length] of the uniform load, at most ten times the thickness; 0 for a line force.
    kinematics : {"plane_strain", "plane_stress"}
        Kinematics of both bodies.

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
    >>> round(layer.half_width, 4)  # does not depend on the force
    0.857
    """
    bodies = Bodies(E1, nu1, E2, nu2)
    check_plane(kinematics)
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
    """Return the ratio of the plane-strain or plane-stress moduli of layer and half-plane, 0 for a rigid half-plane."""
    if bodies.E2 is None:
        return 0.0
    plane_strain = kinematics == "plane_strain"
    modulus = bodies.E1 / (1.0 - bodies.nu1**2 if plane_strain else 1.0)
    return modulus * (1.0 - bodies.nu2**2 if plane_strain else 1.0) / bodies.E2


def _half_width(ratio: float, a: float) -> float:
    """Return the half-width c, relative to the thickness, for which the pressure is not singular at the edge."""
    from scipy.optimize import brentq

    upper = 1.0  # a layer on a rigid half-plane under a line force has the smallest half-width, 0.86
    while _edge_singularity(upper, ratio, a) > 0.0:
        upper *= 1.3
    return float(brentq(_edge_singularity, upper / 1.3, upper, args=(ratio, a), xtol=1e-13))
