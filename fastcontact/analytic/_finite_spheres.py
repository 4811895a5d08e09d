"""Mesh-converged reference values for two equal elastic half-spheres that are pressed together.

Hertz's theory regards each body as a half-space with a parabolic surface. For half-spheres of radius R its relative error is
of the order a/R, where a is the contact radius: at an approach of 8 % of R the force is 12.6 % larger than Hertz's.
"""

from __future__ import annotations

import json
import pkgutil
from dataclasses import dataclass

import numpy as np

from fastcontact.analytic._hertz_point import HertzPoint, hertz_point
from fastcontact.analytic._inputs import number, positive
from fastcontact.arrays import Array
from fastcontact.errors import ModelError

NU = 0.3  # Poisson's ratio for which the table was computed


@dataclass(frozen=True)
class FiniteHalfSpheres:
    """Frictionless contact of two equal half-spheres whose flat faces approach each other.

    Attributes
    ----------
    E : float
        Young's modulus [pressure] of both half-spheres, whose Poisson's ratio is 0.3.
    R : float
        Radius of both half-spheres [length].
    approach : float
        Approach [length] of the two flat faces, on which radial displacements are free.
    force : float
        Normal force [force] of the full circle.
    pressure_max : float
        Pressure [pressure] at the centre, per unit reference area.
    radius : float
        Contact radius [length] in the reference configuration.
    """

    E: float
    R: float
    approach: float
    force: float
    pressure_max: float
    radius: float

    @property
    def hertz(self) -> HertzPoint:
        """Hertzian contact of spheres of the same radius and material at the same approach."""
        return _hertz(self.E, self.R, self.approach)

    def at_approach(self, approach: float) -> FiniteHalfSpheres:
        """Return the contact of the same half-spheres at another approach [length]."""
        return finite_half_spheres(approach, R=self.R, E=self.E)


def _hertz(E: float, R: float, approach: float) -> HertzPoint:
    """Return the Hertzian contact of two spheres with these constants."""
    return hertz_point(E1=E, nu1=NU, R1=R, E2=E, nu2=NU, R2=R, approach=approach)


def _table() -> Array:
    """Return the table with a row for each approach and the columns approach/R, force/(E R^2), pressure/E and radius/R.

    Unknown values are NaN.
    """
    data = json.loads(pkgutil.get_data("fastcontact.analytic", "finite_spheres.json") or "{}")
    R, E = data["R"], data["E"]
    return np.array(data["rows"], dtype=np.float64) / np.array([R, E * R**2, E, R])


def _interpolate(table: Array, x: float) -> tuple[float, float, float]:
    """Return force, pressure and radius at approach/R = x for E = R = 1.

    The interpolated quantities are smooth down to small loads. With s = sqrt(x), the ratios of force and pressure to
    those of Hertz's theory at equal approach behave like 1 + s (A + B ln s). Therefore, (ratio - 1)/s is interpolated
    as a function of ln s. The ratio of the radius to that of Hertz's theory at equal force tends to 1 for small loads,
    which adds a point to its table.
    """
    s = np.sqrt(table[:, 0])
    hertz = [_hertz(1.0, 1.0, approach) for approach in table[:, 0]]
    force_excess = (table[:, 1] / [h.force for h in hertz] - 1.0) / s
    pressure_excess = (table[:, 2] / [h.pressure_max for h in hertz] - 1.0) / s
    radius_excess = table[:, 3] / [h.at_force(F).radius for h, F in zip(hertz, table[:, 1])] - 1.0
    valid = np.isfinite(radius_excess)

    at_approach, root = _hertz(1.0, 1.0, x), np.sqrt(x)
    force = at_approach.force * (1.0 + root * _local_cubic(np.log(root), np.log(s), force_excess))
    pressure = at_approach.pressure_max * (1.0 + root * _local_cubic(np.log(root), np.log(s), pressure_excess))
    excess = _local_cubic(root, np.append(0.0, s[valid]), np.append(0.0, radius_excess[valid]))
    return float(force), float(pressure), float(at_approach.at_force(float(force)).radius * (1.0 + excess))


def _local_cubic(x: float, points: Array, values: Array) -> float:
    """Return the value at x of the cubic polynomial through the `values` at the four of the `points` around x."""
    first = np.clip(np.searchsorted(points, x) - 2, 0, len(points) - 4)
    window = slice(first, first + 4)
    return float(np.polynomial.Polynomial.fit(points[window], values[window], 3)(x))


def finite_half_spheres(approach: float, *, R: float = 50.0, E: float = 20_000.0, nu: float = NU) -> FiniteHalfSpheres:
    """Return the contact of two equal half-spheres, which are modelled as finite bodies.

    The function interpolates in a table of mesh-converged axisymmetric solutions for a half-sphere on a frictionless plane,
    with linear elasticity and gaps in the reference configuration, measured along the axis. Three rows of the table were
    recomputed independently with elements of degree 8 to 10, and 21 rows with elements of degree 4. The relative error of the
    rows is about 3e-6. If a row is interpolated from the others, force and pressure change by less than 2e-5 and the radius
    by less than 4e-5; at approaches from 0.8 % to 8 % of the radius, by less than 4e-6 and 1e-5, respectively.

    Parameters
    ----------
    approach : float
        Approach [length] of the two flat faces, between 4e-5 R and 0.08 R.
    R : float
        Radius of both half-spheres [length].
    E : float
        Young's modulus [pressure] of both half-spheres. The default values of R and E are those of FORMA04 in mm and MPa.
    nu : float
        Poisson's ratio [-] of both half-spheres, which must be 0.3.

    Returns
    -------
    FiniteHalfSpheres

    Raises
    ------
    ModelError
        If a number is out of range.

    Examples
    --------
    >>> spheres = finite_half_spheres(4.0)
    >>> round(spheres.force / spheres.hertz.force, 4)
    1.1257
    """
    R, E, delta = positive("R", R), positive("E", E), positive("approach", approach)
    if abs(number("nu", nu) - NU) > 1e-12:
        raise ModelError(f"nu is {nu:g}: the table of finite half spheres contains only nu = {NU:g}")
    table, x = _table(), delta / R
    low, high = table[0, 0], table[-1, 0]
    if not low * (1.0 - 1e-12) <= x <= high * (1.0 + 1e-12):
        remedy = "use hertz_point below that" if x < low else "strains are not small above that"
        raise ModelError(
            f"approach is {x:g} R: the table of finite half spheres runs from {low:g} to {high:g}; {remedy}"
        )
    force, pressure, radius = _interpolate(table, x)
    return FiniteHalfSpheres(E, R, delta, force * E * R**2, pressure * E, radius * R)
