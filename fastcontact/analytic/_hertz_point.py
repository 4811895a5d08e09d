"""Hertzian contact of two spheres, or of a sphere and a plane."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fastcontact.analytic import _half_space
from fastcontact.analytic._half_space import VonMisesMaximum, von_mises
from fastcontact.analytic._inputs import Bodies, array, effective_radius, exactly_one, poisson, quantities
from fastcontact.arrays import Array


@dataclass(frozen=True)
class HertzPoint:
    """Frictionless contact of two spheres (Hertz 1881; Johnson 1985, sections 3.4 and 4.2).

    Each body is regarded as the half-space z <= 0, where r is the distance from the axis and z is the coordinate along the
    outward normal of the body. Methods raise ModelError for z > 0. Stress components are rr, zz, hoop, rz, positive in
    tension. The parameter `nu` of several methods defaults to the Poisson's ratio of the first body.

    Attributes
    ----------
    bodies : Bodies
        Elastic constants of the two bodies.
    E_star : float
        Contact modulus [pressure].
    R_effective : float
        Relative radius of curvature R, with 1/R = 1/R1 + 1/R2 [length].
    radius : float
        Contact radius a [length].
    approach : float
        Approach of distant points of the two bodies [length].
    force : float
        Normal force [force].
    pressure_max : float
        Pressure p0 at the centre [pressure].
    """

    bodies: Bodies
    E_star: float
    R_effective: float
    radius: float
    approach: float
    force: float
    pressure_max: float

    def at_force(self, force: float) -> HertzPoint:
        """Return the same contact under another force [force]."""
        return _solve(self.bodies, self.R_effective, *exactly_one(force=force))

    def at_approach(self, approach: float) -> HertzPoint:
        """Return the same contact at another approach [length]."""
        return _solve(self.bodies, self.R_effective, *exactly_one(approach=approach))

    def pressure(self, r: ArrayLike) -> Array:
        """Return the contact pressure (...) [pressure] at radii `r` (...) [length], zero outside (Johnson, eq. 3.39)."""
        inside = 1.0 - (array("r", r) / self.radius) ** 2
        return self.pressure_max * np.sqrt(np.maximum(inside, 0.0))

    def stress(self, r: ArrayLike, z: ArrayLike, nu: float | None = None) -> Array:
        """Return the stresses (..., 4) [pressure] at points `r` (...) [length], `z` (...) [length] (Huber 1904)."""
        return _half_space.stress(r, z, self.radius, self.pressure_max, self._nu(nu))

    def stress_on_axis(self, depth: ArrayLike, nu: float | None = None) -> Array:
        """Return the stresses (..., 4) [pressure] on the axis at `depth` (...) [length], >= 0 (Johnson 1985, eq. 3.45)."""
        return self.stress(np.zeros_like(depths := array("depth", depth)), -depths, nu)

    def surface_stress(self, r: ArrayLike, nu: float | None = None) -> Array:
        """Return the stresses (..., 4) [pressure] of the surface at `r` (...) [length] (Johnson 1985, eqs 3.43 and 3.44)."""
        return self.stress(r, np.zeros_like(array("r", r)), nu)

    def von_mises(self, r: ArrayLike, z: ArrayLike, nu: float | None = None) -> Array:
        """Return the von Mises stress (...) [pressure] at points `r` (...) [length], `z` (...) [length]."""
        return von_mises(self.stress(r, z, nu))

    def displacement(self, r: ArrayLike, z: ArrayLike, *, body: int = 1) -> Array:
        """Return the displacements (..., 2) [length] of body 1 or 2 along r and z, which vanish at infinity.

        They are evaluated at points `r` (...) [length], `z` (...) [length] from Boussinesq's potentials of the pressure
        (Johnson 1985, eqs 3.2 to 3.6). Raises ModelError for a rigid body.
        """
        return _half_space.displacement(r, z, self.radius, self.pressure_max, *self.bodies.constants(body))

    def surface_displacement(self, r: ArrayLike, *, body: int = 1) -> Array:
        """Return the displacements (..., 2) [length] of the surface at `r` (...) [length] (Johnson 1985, eqs 3.41, 3.42)."""
        return self.displacement(r, np.zeros_like(array("r", r)), body=body)

    def von_mises_maximum(self, nu: float | None = None) -> VonMisesMaximum:
        """Return the largest von Mises stress on the axis and its depth.

        It is the stationary value of ``|rr - zz|`` in eq. 3.45 of Johnson (1985), computed to round-off. It is
        the maximum in the entire body except for nu < -0.342, where the stress at the edge of the contact is larger.
        """
        from scipy.optimize import brentq

        ratio = self._nu(nu)

        def slope(s: float) -> float:
            return (1.0 + ratio) * (math.atan2(1.0, s) - s / (1.0 + s * s)) - 3.0 * s / (1.0 + s * s) ** 2

        depth = float(brentq(slope, 0.0, 10.0, xtol=1e-15)) * self.radius
        return VonMisesMaximum(float(self.von_mises(0.0, -depth, ratio)), depth)

    def _nu(self, nu: float | None) -> float:
        return self.bodies.nu1 if nu is None else poisson("nu", nu)


def _solve(bodies: Bodies, R: float, name: str, value: float) -> HertzPoint:
    """Return the contact in which the quantity called `name` has the given value."""
    E_star = bodies.E_star
    force, pressure = 4.0 / 3.0 * E_star / R, 2.0 * E_star / (math.pi * R)
    laws = {"radius": (1.0, 1.0), "approach": (1.0 / R, 2.0), "force": (force, 3.0), "pressure_max": (pressure, 1.0)}
    return HertzPoint(bodies, E_star, R, **quantities(laws, name, value))


def hertz_point(
    *,
    E1: float,
    nu1: float,
    R1: float,
    E2: float | None = None,
    nu2: float = 0.0,
    R2: float = math.inf,
    force: float | None = None,
    approach: float | None = None,
    radius: float | None = None,
    pressure_max: float | None = None,
) -> HertzPoint:
    """Return the Hertzian contact of two spheres (Hertz 1881; Johnson 1985, eqs 4.22 to 4.24).

    Parameters
    ----------
    E1, nu1 : float
        Young's modulus [pressure] and Poisson's ratio [-], -1 < nu1 <= 0.5, of body 1.
    R1 : float
        Radius of body 1 [length]; infinity for a plane. At most one of the two radii may be infinite.
    E2, nu2 : float, optional
        Young's modulus [pressure] and Poisson's ratio [-], -1 < nu2 <= 0.5, of body 2, which is rigid without `E2`.
    R2 : float
        Radius of body 2 [length]; by default infinity, a plane. It is negative for a concave surface, such as a socket.
    force, approach, radius, pressure_max : float
        Normal force [force], approach [length], contact radius [length] or largest pressure [pressure]; give exactly one of
        them.

    Returns
    -------
    HertzPoint

    Raises
    ------
    ModelError
        If a number is out of range, or not exactly one of `force`, `approach`, `radius` and `pressure_max` is given.

    Examples
    --------
    >>> hertz = hertz_point(E1=20_000.0, nu1=0.3, R1=50.0, E2=20_000.0, nu2=0.3, R2=50.0, approach=4.0)
    >>> round(hertz.pressure_max, 4), hertz.radius
    (2798.3287, 10.0)
    """
    load = exactly_one(force=force, approach=approach, radius=radius, pressure_max=pressure_max)
    return _solve(Bodies(E1, nu1, E2, nu2), effective_radius(R1, R2), *load)
