"""Contact problem on a finite box whose exact solution is the Hertzian field, for convergence studies.

A rigid parabola is in contact with the top of the box. On the other sides the displacement that the Hertzian pressure
causes in the half-plane or half-space is prescribed. The solution in the box is then the Hertzian field. It has the limited
regularity of contact problems, and there is no model error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fastcontact.analytic._hertz_line import HertzLine, hertz_line
from fastcontact.analytic._hertz_point import HertzPoint, hertz_point
from fastcontact.analytic._inputs import array, poisson, positive
from fastcontact.arrays import Array
from fastcontact.errors import ModelError, check_known

KINEMATICS = ("plane_strain", "plane_stress", "axisymmetric", "3d")


@dataclass(frozen=True)
class HertzBox:
    """Exact solution of a linear contact problem on the box 0 <= x <= width, -height <= y <= 0.

    The conditions of the problem are u_y <= obstacle(x) without friction at the top in the reference configuration,
    `displacement` prescribed on the side x = width and at the bottom, and u_x = 0 on x = 0. For the full box
    ``|x| <= width`` the displacement is prescribed on both sides instead. In 3D z replaces y, and y is a second horizontal
    coordinate like x.

    The object is also the rigid obstacle on top of the box (see `distance`), for a model that is solved with
    ``Criteria(geometry_updates=0)``. Choose a contact radius that does not coincide with a node of the mesh, to avoid
    accidental superconvergence. Methods raise ModelError if a point lies above the top.

    Attributes
    ----------
    hertz : HertzLine or HertzPoint
        The contact that defines the field.
    kinematics : {"plane_strain", "plane_stress", "axisymmetric", "3d"}
        In axisymmetry x is the distance from the axis.
    E, nu, width, height : float
        Young's modulus [pressure] and Poisson's ratio [-], size of the box [length].
    """

    hertz: HertzLine | HertzPoint
    kinematics: str
    E: float
    nu: float
    width: float
    height: float

    @property
    def R(self) -> float:
        """Radius of curvature [length] of the rigid parabola at its apex."""
        return self.hertz.R_effective

    @property
    def radius(self) -> float:
        """Contact radius [length], in the plane half-width."""
        return self.hertz.radius

    @property
    def pressure_max(self) -> float:
        """Pressure at x = 0 [pressure]."""
        return self.hertz.pressure_max

    @property
    def force(self) -> float:
        """Exact force of the entire contact [force], in the plane per unit length [force/length].

        A plane model of x >= 0 carries half of it, and an axisymmetric model the force of the full circle.
        """
        return self.hertz.force

    @property
    def dim(self) -> int:
        """Number of coordinates, 2 or 3."""
        return 3 if self.kinematics == "3d" else 2

    def obstacle(self, x: ArrayLike, y: ArrayLike = 0.0) -> Array:
        """Return the height (x^2 + y^2)/(2 R) (...) [length] of the rigid parabola above the top of the box.

        `x` (...) [length], and in 3D also `y` (...) [length], are horizontal coordinates.
        """
        return (array("x", x) ** 2 + array("y", y) ** 2) / (2.0 * self.R)

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return the gaps (n,) [length] and the normals (n, dim) [-] at `points` (n, dim) [length], as rigid obstacles do.

        The gap is vertical rather than normal to the parabola, and the normals point downwards, since the problem is linear.
        """
        points = array("points", points)
        normal = np.zeros_like(points)
        normal[:, -1] = -1.0
        return self.obstacle(*points[:, :-1].T) - points[:, -1], normal

    def pressure(self, x: ArrayLike, y: ArrayLike = 0.0) -> Array:
        """Return the exact contact pressure (...) [pressure] at `x` (...) [length], in 3D also `y` (...) [length]."""
        return self.hertz.pressure(np.hypot(array("x", x), array("y", y)))

    def displacement(self, points: ArrayLike) -> Array:
        """Return the exact displacements (..., dim) [length] at `points` (..., dim) [length], zero at the origin."""
        position, direction = self._cylindrical(points)
        u = self.hertz.displacement(*position) - self.hertz.displacement(0.0, 0.0)
        u_r = np.where(position[0] == 0.0, 0.0, u[..., 0])  # exactly zero on the axis of symmetry
        return np.stack([*(u_r * cosine for cosine in direction), u[..., 1]], axis=-1)

    def stress(self, points: ArrayLike) -> Array:
        """Return the exact stresses (..., 4), in 3D (..., 6) [pressure] at `points` (..., dim) [length].

        The order is xx, yy, zz, xy; in axisymmetry rr, yy, hoop, ry; in three dimensions xx, yy, zz, xy, yz, xz.
        """
        position, direction = self._cylindrical(points)
        stress = self.hertz.stress(*position)
        if self.dim == 2:
            return stress
        radial, vertical, hoop, shear = np.moveaxis(stress, -1, 0)
        cosine, sine = direction
        xx, yy = radial * cosine**2 + hoop * sine**2, radial * sine**2 + hoop * cosine**2
        xy = (radial - hoop) * sine * cosine
        return np.stack([xx, yy, vertical, xy, shear * sine, shear * cosine], axis=-1)

    def _cylindrical(self, points: ArrayLike) -> tuple[tuple[Array, Array], tuple[Array, ...]]:
        """Return the distances from the axis and the heights [length], and the components of the radial direction [-]."""
        points = array("points", points)
        if points.ndim == 0 or points.shape[-1] != self.dim:
            raise ModelError(f"points has shape {points.shape}: it must be (..., {self.dim})")
        if self.dim == 2:
            return (points[..., 0], points[..., 1]), (np.ones(points.shape[:-1]),)
        r = np.hypot(points[..., 0], points[..., 1])
        cosine = np.divide(points[..., 0], r, out=np.ones_like(r), where=r > 0)
        sine = np.divide(points[..., 1], r, out=np.zeros_like(r), where=r > 0)
        return (r, points[..., 2]), (cosine, sine)


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
    kinematics, E, nu, width, height
        See `HertzBox`.
    radius, pressure_max : float
        Contact radius [length], less than `width`, and pressure at the centre [pressure].

    Raises
    ------
    ModelError
        If a number is out of range.

    Returns
    -------
    HertzBox

    Examples
    --------
    >>> box = hertz_box(kinematics="axisymmetric")
    >>> round(box.force, 6)
    27.483835
    """
    check_known("kinematics", kinematics, KINEMATICS, ModelError)
    E, nu, p0 = positive("E", E), poisson("nu", nu), positive("pressure_max", pressure_max)
    width, height, a = positive("width", width), positive("height", height), positive("radius", radius)
    if a >= width:
        raise ModelError(f"radius is {a:g}: the contact must be narrower than the box, width {width:g}")
    hertz: HertzLine | HertzPoint
    if kinematics in ("axisymmetric", "3d"):
        hertz = hertz_point(E1=E, nu1=nu, R1=2.0 * a * E / ((1.0 - nu**2) * math.pi * p0), radius=a)
    else:
        E_star = E / (1.0 - nu**2) if kinematics == "plane_strain" else E
        hertz = hertz_line(E1=E, nu1=nu, R1=0.5 * E_star * a / p0, radius=a, kinematics=kinematics)
    return HertzBox(hertz, kinematics, E, nu, width, height)
