"""Thick-walled cylinders and spheres under pressure, and press fits of two such bodies (Lamé 1852)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from fastcontact.analytic._inputs import array, check_plane, not_negative, number, poisson, positive
from fastcontact.arrays import Array
from fastcontact.errors import ModelError


@dataclass(frozen=True)
class LameShell:
    """A thick-walled cylinder or sphere under pressure on its inner and outer surfaces.

    With m = 2 for a cylinder and m = 3 for a sphere, the radial stress is C - (m - 1) D/r^m and the hoop stress
    C + D/r^m, where the constants C and D follow from the pressures (Lamé 1852; Timoshenko and Goodier 1970, articles 28
    and 136). Methods raise ModelError for a radius outside the body.

    Attributes
    ----------
    inner_radius, outer_radius : float
        Radii of the inner surface (0 for a solid body) and of the outer surface [length].
    inner_pressure, outer_pressure : float
        Pressures on the inner and on the outer surface [pressure].
    E, nu : float
        Young's modulus [pressure] and Poisson's ratio [-].
    kinematics : {"plane_strain", "plane_stress", "sphere"}
        Kinematics of a cylinder, or ``"sphere"``. The in-plane solution in plane stress also describes a long cylinder with
        free ends.
    """

    inner_radius: float
    outer_radius: float
    inner_pressure: float
    outer_pressure: float
    E: float
    nu: float
    kinematics: str

    def __post_init__(self) -> None:
        not_negative("inner_radius", self.inner_radius)
        positive("outer_radius", self.outer_radius)
        if self.inner_radius >= self.outer_radius:
            raise ModelError(
                f"outer_radius is {self.outer_radius:g}: it must exceed inner_radius, {self.inner_radius:g}"
            )
        number("inner_pressure", self.inner_pressure)
        number("outer_pressure", self.outer_pressure)
        positive("E", self.E)
        poisson("nu", self.nu)
        if self.inner_radius == 0.0 and self.inner_pressure != 0.0:
            raise ModelError("inner_pressure must be 0 for a solid body (inner_radius 0): there is no bore to press on")

    def displacement(self, r: ArrayLike) -> Array:
        """Return the radial displacement (...) [length] at radii `r` (...) [length], which is r times the hoop strain."""
        radii, _, uniform, varying = self._fields(r)
        compliance = {  # of the uniform part, times E
            "plane_strain": (1.0 + self.nu) * (1.0 - 2.0 * self.nu),
            "plane_stress": 1.0 - self.nu,
            "sphere": 1.0 - 2.0 * self.nu,
        }[self.kinematics]
        return radii * (compliance * uniform + (1.0 + self.nu) * varying) / self.E

    def radial_stress(self, r: ArrayLike) -> Array:
        """Return the radial stress (...) [pressure] at radii `r` (...) [length]."""
        _, m, uniform, varying = self._fields(r)
        return uniform - (m - 1) * varying

    def hoop_stress(self, r: ArrayLike) -> Array:
        """Return the hoop stress (...) [pressure] at radii `r` (...) [length]."""
        _, _, uniform, varying = self._fields(r)
        return uniform + varying

    def axial_stress(self, r: ArrayLike) -> Array:
        """Return the axial stress (...) [pressure] of a cylinder at radii `r` (...) [length]; ModelError for a sphere."""
        if self.kinematics == "sphere":
            raise ModelError("a sphere has no axial stress: use radial_stress or hoop_stress")
        radii, _, uniform, _ = self._fields(r)
        return np.full(radii.shape, 2.0 * self.nu * uniform if self.kinematics == "plane_strain" else 0.0)

    def _fields(self, r: ArrayLike) -> tuple[Array, int, float, Array]:
        """Return the radii, m, C and D/r^m of the formulas in the docstring of the class."""
        radii = array("r", r)
        tolerance = 1e-9 * self.outer_radius  # the coordinates of meshes are rounded
        outside = (radii < self.inner_radius - tolerance) | (radii > self.outer_radius + tolerance)
        if outside.any():
            raise ModelError(
                f"r = {radii[outside].flat[0]:g} lies outside the body: "
                f"its radii run from {self.inner_radius:g} to {self.outer_radius:g}"
            )
        m = 3 if self.kinematics == "sphere" else 2
        if self.inner_radius == 0.0:
            return radii, m, -self.outer_pressure, np.zeros_like(radii)
        a_m, b_m = self.inner_radius**m, self.outer_radius**m
        uniform = (self.inner_pressure * a_m - self.outer_pressure * b_m) / (b_m - a_m)
        varying = (self.inner_pressure - self.outer_pressure) * a_m / ((m - 1) * (b_m - a_m))
        return radii, m, uniform, varying * b_m / radii**m


def thick_cylinder(
    *,
    E: float,
    nu: float,
    inner_radius: float,
    outer_radius: float,
    inner_pressure: float = 0.0,
    outer_pressure: float = 0.0,
    kinematics: str = "plane_strain",
) -> LameShell:
    """Return a thick-walled cylinder under pressure (Lamé 1852).

    Parameters
    ----------
    E, nu, inner_radius, outer_radius, inner_pressure, outer_pressure
        See `LameShell`.
    kinematics : {"plane_strain", "plane_stress"}
        Plane stress is for thin discs and for long cylinders with free ends.

    Returns
    -------
    LameShell

    Examples
    --------
    >>> from fastcontact import analytic
    >>> tube = analytic.thick_cylinder(E=1000.0, nu=0.3, inner_radius=1.0, outer_radius=2.0, inner_pressure=1.0)
    >>> round(float(tube.hoop_stress(1.0)), 9)  # (b^2 + a^2) / (b^2 - a^2)
    1.666666667
    """
    check_plane(kinematics)
    return LameShell(inner_radius, outer_radius, inner_pressure, outer_pressure, E, nu, kinematics)


def thick_sphere(
    *,
    E: float,
    nu: float,
    inner_radius: float,
    outer_radius: float,
    inner_pressure: float = 0.0,
    outer_pressure: float = 0.0,
) -> LameShell:
    """Return a thick-walled sphere under pressure (Lamé 1852).

    Parameters
    ----------
    E, nu, inner_radius, outer_radius, inner_pressure, outer_pressure
        See `LameShell`.

    Returns
    -------
    LameShell

    Examples
    --------
    >>> from fastcontact import analytic
    >>> shell = analytic.thick_sphere(E=1000.0, nu=0.3, inner_radius=1.0, outer_radius=2.0, inner_pressure=1.0)
    >>> float(shell.radial_stress(1.0))
    -1.0
    """
    return LameShell(inner_radius, outer_radius, inner_pressure, outer_pressure, E, nu, "sphere")


@dataclass(frozen=True)
class PressFit:
    """Press fit of an inner body in an outer body.

    The interference is assumed to be small compared with the radii.

    Attributes
    ----------
    interference : float
        Radius of the inner body minus the radius of the hole, before assembly [length].
    pressure : float
        Contact pressure [pressure].
    inner, outer : LameShell
        The two bodies, with methods for their displacements and stresses.
    """

    interference: float
    pressure: float
    inner: LameShell
    outer: LameShell

    @property
    def interface_radius(self) -> float:
        """Nominal radius of the interface [length]."""
        return self.inner.outer_radius


def press_fit_cylinders(
    *,
    E_inner: float,
    nu_inner: float,
    E_outer: float,
    nu_outer: float,
    interface_radius: float,
    outer_radius: float,
    interference: float,
    inner_radius: float = 0.0,
    kinematics: str = "plane_strain",
) -> PressFit:
    """Return the frictionless press fit of two concentric cylinders (Lamé 1852; Timoshenko 1956, article 41).

    Parameters
    ----------
    E_inner, nu_inner, E_outer, nu_outer : float
        Young's moduli [pressure] and Poisson's ratios [-] of the inner and of the outer cylinder.
    interface_radius, outer_radius : float
        Radii of the interface and of the outer surface of the outer cylinder [length].
    interference : float
        Radius of the inner cylinder minus the radius of the hole, before assembly [length].
    inner_radius : float
        Radius [length] of the bore of the inner cylinder; 0 for a solid shaft.
    kinematics : {"plane_strain", "plane_stress"}
        Plane stress is for thin discs and for long cylinders with free ends.

    Returns
    -------
    PressFit

    Examples
    --------
    >>> steel = dict(E_inner=210e3, nu_inner=0.3, E_outer=210e3, nu_outer=0.3)
    >>> fit = press_fit_cylinders(**steel, interface_radius=50, outer_radius=100, interference=0.05)
    >>> round(fit.pressure, 4)
    86.5385
    """
    check_plane(kinematics)
    radii = inner_radius, interface_radius, outer_radius
    return _press_fit((E_inner, nu_inner), (E_outer, nu_outer), radii, interference, kinematics)


def press_fit_spheres(
    *,
    E_inner: float,
    nu_inner: float,
    E_outer: float,
    nu_outer: float,
    interface_radius: float,
    outer_radius: float,
    interference: float,
    inner_radius: float = 0.0,
) -> PressFit:
    """Return the press fit of two concentric spheres (Lamé 1852).

    Parameters
    ----------
    E_inner, nu_inner, E_outer, nu_outer, interface_radius, outer_radius, interference, inner_radius : float
        As for `press_fit_cylinders`, for spheres.

    Returns
    -------
    PressFit

    Examples
    --------
    >>> from fastcontact import analytic
    >>> fit = analytic.press_fit_spheres(
    ...     E_inner=1000.0, nu_inner=0.3, E_outer=1000.0, nu_outer=0.3,
    ...     interface_radius=1.0, outer_radius=2.0, interference=0.001,
    ... )
    >>> round(fit.pressure, 6)
    0.833333
    """
    radii = inner_radius, interface_radius, outer_radius
    return _press_fit((E_inner, nu_inner), (E_outer, nu_outer), radii, interference, "sphere")


def _press_fit(
    inner: tuple[float, float], outer: tuple[float, float], radii: tuple[float, float, float], interference: float,
    kinematics: str,
) -> PressFit:  # fmt: skip
    """Return the press fit of an inner and an outer body with E and nu, and with three `radii` in ascending order."""
    for side, (E, nu) in (("inner", inner), ("outer", outer)):
        positive(f"E_{side}", E)
        poisson(f"nu_{side}", nu)
    a, b, c = radii
    positive("interface_radius", b)
    # Displacements are proportional to the pressure on the interface; they are first computed for a pressure of 1.
    shaft, hub = LameShell(a, b, 0.0, 1.0, *inner, kinematics), LameShell(b, c, 1.0, 0.0, *outer, kinematics)
    d = positive("interference", interference)
    pressure = d / float(hub.displacement(b) - shaft.displacement(b))
    return PressFit(d, pressure, replace(shaft, outer_pressure=pressure), replace(hub, inner_pressure=pressure))
