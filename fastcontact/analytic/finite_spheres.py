"""Two equal elastic half-spheres pressed together as finite bodies: mesh-converged reference values.

Hertz's theory takes each body for a half-space with a parabolic surface. Real half spheres differ from that
by terms of the order a/R: at an approach of 8 % of the radius the force is 12.6 % above Hertz's.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from importlib import resources

import numpy as np

from fastcontact.analytic._inputs import number, positive
from fastcontact.analytic.hertz_point import HertzPoint, hertz_point
from fastcontact.arrays import Array
from fastcontact.errors import ModelError

NU = 0.3  # the table was computed for this Poisson ratio only


@dataclass(frozen=True)
class FiniteHalfSpheres:
    """Frictionless contact of two equal half spheres whose flat faces approach each other.

    Attributes
    ----------
    E, R : float
        Young's modulus [pressure] and radius [length] of both; nu is 0.3.
    approach, force : float
        Approach of the two flat faces, which are free to move sideways [length]; force over the full circle [force].
    pressure_max, radius : float
        Pressure at the centre per reference area [pressure], contact radius on the reference geometry [length].
    """

    E: float
    R: float
    approach: float
    force: float
    pressure_max: float
    radius: float

    @property
    def hertz(self) -> HertzPoint:
        """Hertz's contact of the same spheres at the same approach; see also its `at_force`."""
        return _hertz(self.E, self.R, self.approach)

    def at_approach(self, approach: float) -> FiniteHalfSpheres:
        """Return the same spheres at another approach [length]."""
        return finite_half_spheres(approach, R=self.R, E=self.E)


def _hertz(E: float, R: float, approach: float) -> HertzPoint:
    return hertz_point(E1=E, nu1=NU, R1=R, E2=E, nu2=NU, R2=R, approach=approach)


def _table() -> Array:
    """Return approach/R, force/(E R^2), pressure/E and radius/R, one row per approach; NaN where unknown."""
    text = resources.files("fastcontact.analytic").joinpath("finite_spheres.json").read_text(encoding="utf-8")
    data = json.loads(text)
    R, E = data["R"], data["E"]
    return np.array(data["rows"], dtype=np.float64) / np.array([R, E * R**2, E, R])


def _interpolated(table: Array, x: float) -> tuple[float, float, float]:
    """Return force, pressure and radius at approach/R = x, for E = R = 1.

    The interpolated quantities are smooth down to small loads: with s = sqrt(x), the ratios to Hertz at equal
    approach behave as 1 + s (A + B ln s), so (ratio - 1)/s is taken against ln s; the radius over Hertz's at
    equal force tends to 1, which gives one more point.
    """
    from scipy.interpolate import CubicSpline

    s = np.sqrt(table[:, 0])
    hertz = [_hertz(1.0, 1.0, approach) for approach in table[:, 0]]
    force_excess = (table[:, 1] / [h.force for h in hertz] - 1.0) / s
    pressure_excess = (table[:, 2] / [h.pressure_max for h in hertz] - 1.0) / s
    radius_excess = table[:, 3] / [h.at_force(F).radius for h, F in zip(hertz, table[:, 1])] - 1.0
    known = np.isfinite(radius_excess)

    here, root = _hertz(1.0, 1.0, x), np.sqrt(x)
    force = here.force * (1.0 + root * CubicSpline(np.log(s), force_excess)(np.log(root)))
    pressure = here.pressure_max * (1.0 + root * CubicSpline(np.log(s), pressure_excess)(np.log(root)))
    excess = CubicSpline(np.append(0.0, s[known]), np.append(0.0, radius_excess[known]))(root)
    return float(force), float(pressure), float(here.at_force(float(force)).radius * (1.0 + excess))


def finite_half_spheres(approach: float, *, R: float = 50.0, E: float = 20_000.0, nu: float = NU) -> FiniteHalfSpheres:
    """Return the contact of two equal half spheres as finite bodies.

    Interpolates the mesh-converged axisymmetric solution of a half sphere on a frictionless plane (linear elasticity on the
    reference geometry, gap measured along the axis), computed independently twice with elements of degree 8 to 10 at three
    approaches, and with degree 4 at 21 others. Leaving out any one row of the table and interpolating it from the others
    changes force and pressure by less than 2e-5 and the radius by less than 4e-5, relatively; at approaches from 0.8 % to
    8 % of the radius by less than 4e-6 and 1e-5. The rows themselves are good to about 3e-6.

    Parameters
    ----------
    approach : float
        Of the two flat faces, between 4e-5 R and 0.08 R [length].
    R, E, nu : float
        Radius [length] and Young's modulus [pressure], by default those of FORMA04 in mm and MPa; nu is 0.3 [-].

    Returns
    -------
    FiniteHalfSpheres

    Examples
    --------
    >>> spheres = finite_half_spheres(4.0)
    >>> round(spheres.force / spheres.hertz.force, 4)
    1.1257
    """
    R, E, delta = positive("R", R), positive("E", E), positive("approach", approach)
    if abs(number("nu", nu) - NU) > 1e-12:
        raise ModelError(f"nu is {nu:g}: the table of finite half spheres holds nu = {NU:g} only")
    table, x = _table(), delta / R
    low, high = table[0, 0], table[-1, 0]
    if not low * (1.0 - 1e-12) <= x <= high * (1.0 + 1e-12):
        remedy = "use hertz_point, which is close to it there" if x < low else "small strain ends about there"
        raise ModelError(
            f"approach is {x:g} R: the table of finite half spheres runs from {low:g} to {high:g}; {remedy}"
        )
    row = table[np.argmin(np.abs(table[:, 0] - x))]
    if abs(row[0] - x) <= 1e-12 * x and np.isfinite(row).all():
        force, pressure, radius = row[1:].tolist()
    else:
        force, pressure, radius = _interpolated(table, x)
    return FiniteHalfSpheres(E, R, delta, force * E * R**2, pressure * E, radius * R)
