"""Hertzian contact of two parallel cylinders, or of a cylinder and a plane, per unit length."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fastcontact.analytic import _half_plane
from fastcontact.analytic._half_space import VonMisesMaximum, von_mises
from fastcontact.analytic._inputs import Bodies, array, check_plane, effective_radius, exactly_one, poisson, quantities
from fastcontact.arrays import Array


@dataclass(frozen=True)
class HertzLine:
    """Frictionless contact of two parallel cylinders (Johnson 1985, section 4.2(c)).

    Each body is regarded as the half-plane y <= 0, where x is tangential to the surface and y is the coordinate along the
    outward normal of the body. Methods raise ModelError for y > 0. Stress components are xx, yy, zz, xy, positive in
    tension. The component zz is nu (xx + yy) in plane strain and zero in plane stress; the parameter `nu` of several
    methods defaults to the Poisson's ratio of the first body. The solution does not include the approach of the bodies,
    which in 2D depends on their shapes and supports far from the contact.

    Attributes
    ----------
    bodies : Bodies
        Elastic constants of the two bodies.
    kinematics : {"plane_strain", "plane_stress"}
        Plane strain (long cylinders) or plane stress (thin discs).
    E_star : float
        Contact modulus for `kinematics`, `Bodies.E_star` or `Bodies.E_star_plane_stress` [pressure].
    R_effective : float
        Relative radius of curvature R, with 1/R = 1/R1 + 1/R2 [length].
    radius : float
        Half-width b of the contact [length].
    force : float
        Normal force per unit length [force/length].
    pressure_max : float
        Pressure p0 at the centre [pressure].
    """

    bodies: Bodies
    kinematics: str
    E_star: float
    R_effective: float
    radius: float
    force: float
    pressure_max: float

    @property
    def half_width(self) -> float:
        """Half-width b of the contact, an alias of `radius` [length]."""
        return self.radius

    def at_force(self, force: float) -> HertzLine:
        """Return the same contact under another force per unit length [force/length]."""
        return _solve(self.bodies, self.kinematics, self.R_effective, *exactly_one(force=force))

    def pressure(self, x: ArrayLike) -> Array:
        """Return the contact pressure (...) [pressure] at positions `x` (...) [length], zero outside (Johnson, eq. 4.44)."""
        inside = 1.0 - (array("x", x) / self.radius) ** 2
        return self.pressure_max * np.sqrt(np.maximum(inside, 0.0))

    def stress(self, x: ArrayLike, y: ArrayLike, nu: float | None = None) -> Array:
        """Return the stresses (..., 4) [pressure] at points `x` (...) [length], `y` (...) [length] (Johnson, eq. 4.49)."""
        return _half_plane.stress(x, y, self.radius, self.pressure_max, self._nu(nu), self.kinematics)

    def stress_on_axis(self, depth: ArrayLike, nu: float | None = None) -> Array:
        """Return the stresses (..., 4) [pressure] on the line x = 0 at `depth` (...) [length], >= 0 (Johnson, eqs 4.46)."""
        return self.stress(np.zeros_like(depths := array("depth", depth)), -depths, nu)

    def surface_stress(self, x: ArrayLike, nu: float | None = None) -> Array:
        """Return the stresses (..., 4) [pressure] of the surface at `x` (...) [length], where xx = yy = -pressure."""
        return self.stress(x, np.zeros_like(array("x", x)), nu)

    def von_mises(self, x: ArrayLike, y: ArrayLike, nu: float | None = None) -> Array:
        """Return the von Mises stress (...) [pressure] at points `x` (...) [length], `y` (...) [length]."""
        return von_mises(self.stress(x, y, nu))

    def displacement(self, x: ArrayLike, y: ArrayLike, *, body: int = 1) -> Array:
        """Return the displacements (..., 2) [length] of body 1 or 2 at points `x` (...) [length], `y` (...) [length].

        Displacements are relative to that of the point (0, 0), because the displacement of a half-plane is unbounded at
        infinity. They are obtained by integrating the stresses of McEwen (1949). Raises ModelError for a rigid body.
        """
        E, nu = self.bodies.constants(body)
        return _half_plane.displacement(x, y, self.radius, self.pressure_max, E, nu, self.kinematics)

    def surface_displacement(self, x: ArrayLike, *, body: int = 1) -> Array:
        """Return the displacements (..., 2) [length] of the surface at `x` (...) [length], relative to the point (0, 0)."""
        return self.displacement(x, np.zeros_like(array("x", x)), body=body)

    def von_mises_maximum(self, nu: float | None = None) -> VonMisesMaximum:
        """Return the largest von Mises stress on the line x = 0 and its depth.

        At the depth s b, with w = sqrt(1 + s^2) and e = 1 - 2 nu (e = 1 in plane stress), the von Mises stress is
        p0 (w - s) sqrt(3 s^2/w^2 + e^2) by eqs 4.46 of Johnson (1985). Its maximum lies at the surface, or where
        3 s = 3 s^2 w + e^2 w^3.
        """
        from scipy.optimize import brentq

        e = 1.0 - 2.0 * self._nu(nu) if self.kinematics == "plane_strain" else 1.0

        def slope(s: float) -> float:
            w = math.hypot(1.0, s)
            return 3.0 * s - 3.0 * s * s * w - e * e * w**3

        # A maximum below the surface that exceeds the value at the surface, |e|, lies at 0.58 < s < 0.79.
        s = float(brentq(slope, 0.4, 0.9, xtol=1e-15)) if slope(0.4) > 0.0 else 0.0
        w = math.hypot(1.0, s)
        subsurface = (w - s) * math.sqrt(3.0 * (s / w) ** 2 + e * e)
        if subsurface <= abs(e):
            return VonMisesMaximum(abs(e) * self.pressure_max, 0.0)
        return VonMisesMaximum(subsurface * self.pressure_max, s * self.radius)

    def _nu(self, nu: float | None) -> float:
        return self.bodies.nu1 if nu is None else poisson("nu", nu)


def _solve(bodies: Bodies, kinematics: str, R: float, name: str, value: float) -> HertzLine:
    """Return the contact in which the quantity called `name` has the given value."""
    E_star = bodies.E_star if kinematics == "plane_strain" else bodies.E_star_plane_stress
    # Coefficients and exponents of powers of the radius.
    laws = {"radius": (1.0, 1.0), "force": (0.25 * math.pi * E_star / R, 2.0), "pressure_max": (0.5 * E_star / R, 1.0)}
    return HertzLine(bodies, kinematics, E_star, R, **quantities(laws, name, value))


def hertz_line(
    *,
    E1: float,
    nu1: float,
    R1: float,
    E2: float | None = None,
    nu2: float = 0.0,
    R2: float = math.inf,
    force: float | None = None,
    radius: float | None = None,
    pressure_max: float | None = None,
    kinematics: str = "plane_strain",
) -> HertzLine:
    """Return the Hertzian contact of two parallel cylinders (Johnson 1985, eqs 4.43 to 4.45).

    Parameters
    ----------
    E1, nu1, R1, E2, nu2, R2 : float
        See `hertz_point`.
    force, radius, pressure_max : float
        Normal force per unit length [force/length], half-width of the contact [length] or largest pressure [pressure].
        Exactly one of them must be given.
    kinematics : {"plane_strain", "plane_stress"}
        Plane strain is for long cylinders, plane stress for thin discs.

    Returns
    -------
    HertzLine

    Raises
    ------
    ModelError
        If a number is out of range, or not exactly one of `force`, `radius` and `pressure_max` is given.

    Examples
    --------
    >>> roller = hertz_line(E1=210_000.0, nu1=0.3, R1=50.0, E2=70_000.0, nu2=0.3, force=35_000.0)
    >>> round(roller.half_width, 4), round(roller.pressure_max, 2)
    (6.2146, 3585.36)
    """
    load = exactly_one(force=force, radius=radius, pressure_max=pressure_max)
    return _solve(Bodies(E1, nu1, E2, nu2), check_plane(kinematics), effective_radius(R1, R2), *load)
