"""Hertzian contact of two bodies with different curvatures in two directions, which has an elliptical contact area."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fastcontact.analytic._inputs import Bodies, array, effective_radius, exactly_one, quantities
from fastcontact.arrays import Array
from fastcontact.errors import ModelError

_SMALLEST_AXIS_RATIO = 1e-6  # ratio of the axes b/a below which the contact is regarded as a line


@dataclass(frozen=True)
class HertzElliptical:
    """Frictionless contact with an elliptical contact area (Hertz 1881; Johnson 1985, section 4.2(b)).

    Attributes
    ----------
    bodies : Bodies
        Elastic constants of the two bodies.
    E_star : float
        Contact modulus [pressure].
    R_x, R_y : float
        Relative principal radii of curvature [length], with 1/R_x = 1/R1x + 1/R2x and 1/R_y = 1/R1y + 1/R2y.
    radius_x, radius_y : float
        Semi-axes of the contact area along x and y [length].
    approach : float
        Approach of distant points of the two bodies [length].
    force : float
        Normal force [force].
    pressure_max : float
        Pressure p0 at the centre [pressure].
    """

    bodies: Bodies
    E_star: float
    R_x: float
    R_y: float
    radius_x: float
    radius_y: float
    approach: float
    force: float
    pressure_max: float

    @property
    def radius(self) -> float:
        """Radius sqrt(radius_x radius_y) [length] of the circle whose area is equal to the contact area."""
        return math.sqrt(self.radius_x * self.radius_y)

    @property
    def radius_mean(self) -> float:
        """Mean of the two semi-axes [length], to which the mean of the bounds of `ContactResult.radius` tends."""
        return 0.5 * (self.radius_x + self.radius_y)

    def at_force(self, force: float) -> HertzElliptical:
        """Return the same contact under another force [force]."""
        return _solve(self.bodies, self.R_x, self.R_y, *exactly_one(force=force))

    def at_approach(self, approach: float) -> HertzElliptical:
        """Return the same contact at another approach [length]."""
        return _solve(self.bodies, self.R_x, self.R_y, *exactly_one(approach=approach))

    def pressure(self, x: ArrayLike, y: ArrayLike = 0.0) -> Array:
        """Return the contact pressure (...) [pressure] at positions `x` (...) [length], `y` (...) [length], zero outside.

        The formula is eq. 3.58 of Johnson (1985).
        """
        x, y = array("x", x) / self.radius_x, array("y", y) / self.radius_y
        return self.pressure_max * np.sqrt(np.maximum(1.0 - x**2 - y**2, 0.0))


def _ratio_of_radii(ratio: float) -> float:
    """Return the ratio R'/R'' >= 1 of the relative radii for an ellipse with semi-axes b <= a (Johnson 1985, eq. 4.28).

    `ratio` is b/a. Textbooks use [(a/b)^2 E - K]/[K - E] with complete elliptic integrals K and E, whose differences
    suffer from cancellation for nearly circular ellipses. Carlson's integral R_D avoids this cancellation.
    """
    from scipy.special import elliprd

    return float(elliprd(0.0, 1.0, ratio**2) / elliprd(0.0, ratio**2, 1.0))


def _ratio_of_axes(ratio_of_radii: float) -> float:
    """Return the ratio b/a <= 1 of the semi-axes of the contact ellipse for a ratio R'/R'' >= 1 of the relative radii."""
    from scipy.optimize import brentq

    if ratio_of_radii > _ratio_of_radii(_SMALLEST_AXIS_RATIO):
        raise ModelError(
            f"the relative radii differ by a factor of {ratio_of_radii:g}: use hertz_line for line contact"
        )
    logarithm, interval = math.log(ratio_of_radii), (math.log(_SMALLEST_AXIS_RATIO), 0.0)
    return math.exp(brentq(lambda x: math.log(_ratio_of_radii(math.exp(x))) - logarithm, *interval, xtol=1e-15))


def _solve(bodies: Bodies, R_x: float, R_y: float, name: str, value: float) -> HertzElliptical:
    """Return the contact in which the quantity called `name` has the given value."""
    from scipy.special import ellipkm1, elliprd

    E_star, R_mean = bodies.E_star, math.sqrt(R_x * R_y)
    k = _ratio_of_axes(max(R_x, R_y) / min(R_x, R_y))
    integrals = math.sqrt(elliprd(0.0, 1.0, k**2) * elliprd(0.0, k**2, 1.0)) / 3.0
    # Quantities at a mean radius sqrt(a b) of 1, which grow with the powers in `laws`; k is the ratio b/a.
    force = 1.0 / (0.75 * R_mean / E_star * 4.0 / math.pi * k**1.5 * integrals)
    pressure = 1.5 * force / math.pi
    approach = pressure * math.sqrt(k) * float(ellipkm1(k**2)) / E_star
    laws = {"mean": (1.0, 1.0), "approach": (approach, 2.0), "force": (force, 3.0), "pressure_max": (pressure, 1.0)}
    values = quantities(laws, name, value)
    mean = values.pop("mean")
    axes = (mean / math.sqrt(k), mean * math.sqrt(k))
    return HertzElliptical(bodies, E_star, R_x, R_y, *(axes if R_x >= R_y else axes[::-1]), **values)


def hertz_elliptical(
    *,
    E1: float,
    nu1: float,
    R1x: float,
    R1y: float,
    E2: float | None = None,
    nu2: float = 0.0,
    R2x: float = math.inf,
    R2y: float = math.inf,
    force: float | None = None,
    approach: float | None = None,
    pressure_max: float | None = None,
) -> HertzElliptical:
    """Return the Hertzian contact of two bodies with parallel principal curvatures (Johnson 1985, eqs 4.24 to 4.31).

    Parameters
    ----------
    E1, nu1, E2, nu2
        See `hertz_point`.
    R1x, R1y, R2x, R2y : float
        Principal radii of curvature [length] of bodies 1 and 2 in the planes through the normal and x or y; infinity for a
        straight section, and negative for a concave one, such as a groove.
    force, approach, pressure_max : float
        Normal force [force], approach [length] or largest pressure [pressure]; give exactly one of them.

    Returns
    -------
    HertzElliptical

    Raises
    ------
    ModelError
        If a number is out of range, or both bodies are straight in one direction, which is a line contact.

    Examples
    --------
    Two crossed cylinders of equal radius have a circular contact area, like a sphere of this radius on a plane:

    >>> hertz = hertz_elliptical(E1=1e5, nu1=0.3, R1x=10.0, R1y=float("inf"), R2y=10.0, force=1e3)
    >>> hertz.radius_x == hertz.radius_y
    True
    """
    load = exactly_one(force=force, approach=approach, pressure_max=pressure_max)
    R_x = effective_radius(R1x, R2x, ("R1x", "R2x"))
    R_y = effective_radius(R1y, R2y, ("R1y", "R2y"))
    return _solve(Bodies(E1, nu1, E2, nu2), R_x, R_y, *load)
