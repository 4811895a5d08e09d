"""Hertz in a box: a contact problem on a finite body whose exact solution is known, for convergence studies.

The boundary of the box, apart from its top, is given the displacement that Hertz's pressure causes in the
infinite body; a rigid parabola lies on the top. The solution in the box is then Hertz's field itself, with
the limited regularity that contact really has and without any model error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastcontact.analytic._checks import one_of, poisson, positive
from fastcontact.analytic.hertz_line import HertzLine, hertz_line
from fastcontact.analytic.hertz_point import HertzPoint, hertz_point
from fastcontact.errors import ModelError

Array = NDArray[np.float64]
KINEMATICS = ("plane_strain", "plane_stress", "axisymmetric")


@dataclass(frozen=True)
class HertzBox:
    """Exact solution of a linear contact problem on the box 0 <= x <= width, -height <= y <= 0.

    The problem: u_y <= obstacle(x) at the top, without friction, on the reference geometry; `displacement`
    prescribed on the side x = width and at the bottom; u_x = 0 on x = 0 (in the full box |x| <= width:
    prescribed on both sides). Choose a contact radius that no mesh node hits, or results superconverge by
    chance.

    Attributes
    ----------
    hertz : HertzLine or HertzPoint
        The contact whose field this is.
    kinematics : str
        "plane_strain", "plane_stress" or "axisymmetric" (x is the distance from the axis).
    E, nu : float
        Material of the box [pressure], [-].
    width, height : float
        Size of the box [length].
    """

    hertz: HertzLine | HertzPoint
    kinematics: str
    E: float
    nu: float
    width: float
    height: float

    @property
    def R(self) -> float:
        """Radius of curvature of the rigid parabola [length]."""
        return self.hertz.R_effective

    @property
    def radius(self) -> float:
        """Contact radius (half-width in the plane) [length]."""
        return self.hertz.radius

    @property
    def pressure_max(self) -> float:
        """Pressure at x = 0 [pressure]."""
        return self.hertz.pressure_max

    @property
    def force(self) -> float:
        """Exact contact force of the whole contact; half of it acts on a plane model of x >= 0 only.

        Full circle [force] in axisymmetry, per unit length [force/length] in the plane.
        """
        return self.hertz.force

    def obstacle(self, x: ArrayLike) -> Array:
        """Return the height x^2/(2 R) of the rigid parabola over the top (n,) [length]."""
        return np.asarray(x, dtype=np.float64) ** 2 / (2.0 * self.R)

    def pressure(self, x: ArrayLike) -> Array:
        """Return the exact contact pressure at positions `x` of the top [pressure]."""
        return self.hertz.pressure(x)

    def displacement(self, points: ArrayLike) -> Array:
        """Return the exact displacements (..., 2) at `points` (..., 2), zero at the point (0, 0) [length].

        Raises
        ------
        ModelError
            If the points are not of shape (..., 2) or one lies above y = 0.
        """
        x, y = self._coordinates(points)
        return self.hertz.displacement(x, y) - self.hertz.displacement(0.0, 0.0)

    def stress(self, points: ArrayLike) -> Array:
        """Return the exact stresses (..., 4) at `points` (..., 2) [pressure].

        The order is xx, yy, zz, xy; in axisymmetry rr, yy, hoop, ry.

        Raises
        ------
        ModelError
            If the points are not of shape (..., 2) or one lies above y = 0.
        """
        return self.hertz.stress(*self._coordinates(points))

    @staticmethod
    def _coordinates(points: ArrayLike) -> tuple[Array, Array]:
        array = np.asarray(points, dtype=np.float64)
        if array.ndim == 0 or array.shape[-1] != 2:
            raise ModelError(f"points has shape {array.shape}: it must be (..., 2)")
        return array[..., 0], array[..., 1]


def hertz_box(
    *,
    kinematics: str = "plane_strain",
    E: float = 1000.0,
    nu: float = 0.3,
    radius: float = 0.5123,
    pressure_max: float = 50.0,
    width: float = 1.0,
    height: float = 1.0,
) -> HertzBox:
    """Return the exact solution of the box under a rigid parabola with a given contact radius and pressure.

    The fields are those of McEwen (1949) in the plane and of Huber (1904) in axisymmetry; the radius of the
    parabola follows from Johnson (1985), eqs 4.45 and 4.24.

    Parameters
    ----------
    kinematics : str
        "plane_strain", "plane_stress" or "axisymmetric".
    E, nu : float
        Material of the box [pressure], [-].
    radius : float
        Contact radius, less than `width` [length].
    pressure_max : float
        Pressure at the centre [pressure].
    width, height : float
        Size of the box [length].

    Raises
    ------
    ModelError
        If a number is out of range or the contact is wider than the box.

    Examples
    --------
    >>> box = hertz_box(kinematics="axisymmetric")
    >>> round(box.force, 6)
    27.483835
    """
    one_of("kinematics", kinematics, KINEMATICS)
    E, nu, p0 = positive("E", E), poisson("nu", nu), positive("pressure_max", pressure_max)
    width, height, a = positive("width", width), positive("height", height), positive("radius", radius)
    if a >= width:
        raise ModelError(f"radius is {a:g}: the contact must be narrower than the box, width {width:g}")
    hertz: HertzLine | HertzPoint
    if kinematics == "axisymmetric":
        hertz = hertz_point(E1=E, nu1=nu, R1=2.0 * a * E / ((1.0 - nu**2) * math.pi * p0), radius=a)
    else:
        E_star = E / (1.0 - nu**2) if kinematics == "plane_strain" else E
        hertz = hertz_line(E1=E, nu1=nu, R1=0.5 * E_star * a / p0, radius=a, kinematics=kinematics)
    return HertzBox(hertz, kinematics, E, nu, width, height)
