"""Partial slip of Hertzian contacts under a tangential force, and full sliding of a block."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from fastcontact.analytic._hertz_line import HertzLine, hertz_line
from fastcontact.analytic._hertz_point import HertzPoint, hertz_point
from fastcontact.analytic._inputs import array, not_negative, number, poisson, positive
from fastcontact.arrays import Array
from fastcontact.errors import ModelError, warn


@dataclass(frozen=True)
class _PartialSlip:
    """Base class of line and point contact under a tangential load up to a peak, possibly followed by unloading.

    The theory is that of Mindlin and Deresiewicz (1953). Let F be the normal force, f the coefficient of friction and a the
    contact radius. On first loading, that is under a tangential force T which has increased from zero, the shear
    traction is f times the difference between the contact pressure and the pressure of a smaller contact, the stick zone,
    whose radius is a (1 - T/(f F))^p with p = `_POWER`. Unloading from a peak T* to T subtracts twice the traction that first
    loading by (T* - T)/2 causes.
    """

    friction: float
    tangential_force: float
    tangential_force_peak: float
    normal: HertzLine | HertzPoint

    _POWER: ClassVar[float]

    @property
    def stick_radius(self) -> float:
        """Radius of the stick zone, or its half-width in line contact [length] (Cattaneo 1938; Mindlin 1949)."""
        return self._stick_radius(self._half_reduction if self._half_reduction > 0.0 else self.tangential_force)

    def unloaded_to(self, tangential_force: float) -> Self:
        """Return the contact after the tangential force has been reduced from its peak to `tangential_force`.

        Raises ModelError if the force is larger than the current force, or smaller than the negative peak.
        """
        force = number("tangential_force", tangential_force)
        if not -self.tangential_force_peak <= force <= self.tangential_force:
            raise ModelError(
                f"tangential_force is {force:g}: unloading runs from {self.tangential_force:g} "
                f"down to the opposite peak {-self.tangential_force_peak:g}"
            )
        return replace(self, tangential_force=force)

    @property
    def _half_reduction(self) -> float:
        """Half of the reduction of the tangential force, (T* - T)/2, from the peak T* to the current force T."""
        return 0.5 * (self.tangential_force_peak - self.tangential_force)

    @property
    def _limit(self) -> float:
        """Tangential force f F at which the bodies slide."""
        return self.friction * self.normal.force

    def _stick_radius(self, load: float) -> float:
        """Return the radius or half-width [length] of the stick zone on first loading by the tangential force `load`."""
        return self.normal.radius * max(1.0 - load / self._limit, 0.0) ** self._POWER

    def _at_current_force(self, quantity: Callable[[float], Any]) -> Any:
        """Return a quantity at the current force; `quantity` is its function of the tangential force on first loading."""
        return quantity(self.tangential_force_peak) - 2.0 * quantity(self._half_reduction)

    def _traction(self, name: str, position: ArrayLike) -> Array:
        """Return the shear traction [pressure] at the current force; error messages call the position `name`.

        On first loading, it is f p0 [sqrt(1 - x^2/a^2) - (c/a) sqrt(1 - x^2/c^2)] with the stick radius c, where the
        root of a negative number is replaced by zero.
        """
        x2, a = array(name, position) ** 2, self.normal.radius

        def traction_on_loading(load: float) -> Array:
            roots = np.sqrt(np.maximum(a**2 - x2, 0.0)) - np.sqrt(np.maximum(self._stick_radius(load) ** 2 - x2, 0.0))
            return self.friction * self.normal.pressure_max / a * roots

        return np.asarray(self._at_current_force(traction_on_loading))


@dataclass(frozen=True)
class CattaneoMindlinLine(_PartialSlip):
    """Two cylinders under a normal and a tangential force per unit length (Cattaneo 1938; Mindlin 1949).

    The formulas are those of Johnson (1985), section 7.2(a). The attribute `normal` is the normal contact, a `HertzLine`,
    and `friction` the coefficient of friction. `tangential_force` is the current tangential force and
    `tangential_force_peak` its largest value so far; they are equal on first loading [force/length].
    """

    normal: HertzLine

    _POWER = 0.5

    def traction(self, x: ArrayLike) -> Array:
        """Return the shear traction (...) [pressure] along the force at `x` (...) [length] (Johnson 1985, section 7.2a)."""
        return self._traction("x", x)

    def slip(self, x: ArrayLike) -> Array:
        """Return the relative tangential displacement (...) [length] of the surfaces at `x` (...) [length].

        For ``c <= |x| <= a`` it is the integral of f p0/a (2/E*) sqrt(x^2 - c^2) from the edge c of the stick zone to
        ``|x|``; it is zero in the stick zone and outside the contact (from Johnson 1985, eq. 2.25 and section 7.2(a)).
        """
        return np.asarray(self._at_current_force(lambda load: self._slip(self._stick_radius(load), x)))

    @property
    def slip_displacement(self) -> float:
        """Part [length] of the tangential displacement of distant points that is due to slip.

        On first loading it is f F/(pi E*) [(1 - t) ln(1 - t) + t] with t = T/(f F). This is the integral over the tangential
        force of the compliance of a strip that sticks for ``|x| < c = a sqrt(1 - t)``, which is -2/(pi E*) ln c up to a
        constant (from Johnson 1985, eq. 2.25). The elastic part of the displacement is proportional to the force and depends
        on the distant supports of the bodies; it is not included.
        """

        def slip_on_loading(load: float) -> float:
            remainder = max(1.0 - load / self._limit, 0.0)
            logarithm = remainder * math.log(remainder) if remainder > 0.0 else 0.0
            return self._limit / (math.pi * self.normal.E_star) * (logarithm + 1.0 - remainder)

        return float(self._at_current_force(slip_on_loading))

    def _slip(self, c: float, x: ArrayLike) -> Array:
        """Return the slip (...) [length] at `x` (...) [length] for a stick zone of half-width c."""
        a = self.normal.radius
        distance = np.abs(array("x", x))
        clipped = np.clip(distance, c, a)
        root = clipped * np.sqrt((clipped - c) * (clipped + c))
        hyperbolic = c**2 * np.arccosh(clipped / c) if c > 0.0 else 0.0
        slip = self.friction * self.normal.pressure_max / (a * self.normal.E_star) * (root - hyperbolic)
        return np.where(distance <= a, slip, 0.0)


@dataclass(frozen=True)
class CattaneoMindlinSphere(_PartialSlip):
    """Two spheres under a normal and a tangential force (Cattaneo 1938; Mindlin 1949).

    The formulas are those of Johnson (1985), sections 7.2(b) and 7.4(b). They assume that the slip is parallel to the
    force, which is exact for nu = 0 and otherwise causes a relative error of the order nu/(4 - 2 nu). The attribute
    `normal` is the normal contact, a `HertzPoint`, and `friction` the coefficient of friction. `tangential_force` is the
    current tangential force and `tangential_force_peak` its largest value so far [force].
    """

    normal: HertzPoint

    _POWER = 1.0 / 3.0

    @property
    def G_star(self) -> float:
        """Tangential modulus [pressure], 1/G* = (2 - nu1)/G1 + (2 - nu2)/G2."""
        return self.normal.bodies.G_star

    @property
    def tangential_displacement(self) -> float:
        """Relative tangential displacement [length] of distant points (Mindlin 1949; Johnson 1985, section 7.2(b)).

        On first loading it is 3 f F/(16 a G*) [1 - (1 - T/(f F))^(2/3)].
        """
        factor, a = 3.0 * self._limit / (16.0 * self.normal.radius * self.G_star), self.normal.radius
        return float(self._at_current_force(lambda load: factor * (1.0 - (self._stick_radius(load) / a) ** 2)))

    @property
    def dissipation_per_cycle(self) -> float:
        """Frictional work of a cycle between the peak and the negative peak (Mindlin and Deresiewicz 1953) [force length]."""
        load = self.tangential_force_peak / self._limit
        remainder = max(1.0 - load, 0.0)
        bracket = 1.0 - remainder ** (5.0 / 3.0) - 5.0 * load / 6.0 * (1.0 + remainder ** (2.0 / 3.0))
        return 9.0 * self._limit**2 / (10.0 * self.normal.radius) * bracket / self.G_star

    def traction(self, r: ArrayLike) -> Array:
        """Return the shear traction (...) [pressure] along the force at `r` (...) [length] (Johnson 1985, section 7.2b)."""
        return self._traction("r", r)


def _checked_loads(normal: HertzLine | HertzPoint, friction: float, tangential_force: float) -> tuple[float, float]:
    """Return the checked coefficient of friction and tangential force.

    Warns if the bodies have different materials, which couple the normal and the tangential contact.
    """
    f = positive("friction", friction)
    T = not_negative("tangential_force", tangential_force)
    limit = f * normal.force
    if limit < T:
        raise ModelError(f"tangential_force is {T:g}: the bodies slide above friction times normal force, {limit:g}")
    beta = normal.bodies.dundurs
    if abs(beta) > 1e-12:
        warn(f"Cattaneo-Mindlin theory is exact for elastically similar bodies: Dundurs' beta is {beta:.4g}, not 0")
    return f, T


def cattaneo_mindlin_line(
    *,
    E1: float,
    nu1: float,
    R1: float,
    friction: float,
    tangential_force: float,
    E2: float | None = None,
    nu2: float = 0.0,
    R2: float = math.inf,
    force: float | None = None,
    radius: float | None = None,
    pressure_max: float | None = None,
) -> CattaneoMindlinLine:
    """Return the partial slip of two parallel cylinders in plane strain (Cattaneo 1938; Mindlin 1949).

    The normal force is constant, and the tangential force increases from zero.

    Parameters
    ----------
    E1, nu1, R1, E2, nu2, R2, force, radius, pressure_max : float
        Parameters of the normal contact, see `hertz_line`.
    friction : float
        Coulomb's coefficient of friction f > 0 [-].
    tangential_force : float
        Tangential force per unit length [force/length], between 0 and f times the normal force, at which the bodies slide.

    Returns
    -------
    CattaneoMindlinLine

    Raises
    ------
    ModelError
        If a number is out of range.

    Warns
    -----
    FastcontactWarning
        If the bodies have different materials, for which the theory is an approximation.

    Examples
    --------
    >>> from fastcontact import analytic
    >>> contact = analytic.cattaneo_mindlin_line(
    ...     E1=1000.0, nu1=0.3, R1=10.0, friction=0.5, force=8.0, tangential_force=2.0, E2=1000.0, nu2=0.3
    ... )
    >>> round(contact.stick_radius / contact.normal.radius, 6)  # (1 - T / (f F))^(1/2)
    0.707107
    """
    normal = hertz_line(
        E1=E1, nu1=nu1, R1=R1, E2=E2, nu2=nu2, R2=R2, force=force, radius=radius, pressure_max=pressure_max
    )
    f, T = _checked_loads(normal, friction, tangential_force)
    return CattaneoMindlinLine(f, T, T, normal)


def cattaneo_mindlin_sphere(
    *,
    E1: float,
    nu1: float,
    R1: float,
    friction: float,
    tangential_force: float,
    E2: float | None = None,
    nu2: float = 0.0,
    R2: float = math.inf,
    force: float | None = None,
    approach: float | None = None,
    radius: float | None = None,
    pressure_max: float | None = None,
) -> CattaneoMindlinSphere:
    """Return the partial slip of two spheres (Cattaneo 1938; Mindlin 1949).

    The normal force is constant, and the tangential force increases from zero.

    Parameters
    ----------
    E1, nu1, R1, E2, nu2, R2, force, approach, radius, pressure_max : float
        Parameters of the normal contact, see `hertz_point`.
    friction : float
        Coulomb's coefficient of friction f > 0 [-].
    tangential_force : float
        Tangential force [force], between 0 and f times the normal force, at which the bodies slide.

    Returns
    -------
    CattaneoMindlinSphere

    Raises
    ------
    ModelError
        If a number is out of range.

    Warns
    -----
    FastcontactWarning
        If the bodies have different materials, for which the theory is an approximation.

    Examples
    --------
    >>> from fastcontact import analytic
    >>> contact = analytic.cattaneo_mindlin_sphere(
    ...     E1=1000.0, nu1=0.3, R1=10.0, friction=0.5, force=8.0, tangential_force=2.0, E2=1000.0, nu2=0.3
    ... )
    >>> round(contact.stick_radius / contact.normal.radius, 6)  # (1 - T / (f F))^(1/3)
    0.793701
    """
    normal = hertz_point(
        E1=E1, nu1=nu1, R1=R1, E2=E2, nu2=nu2, R2=R2,
        force=force, approach=approach, radius=radius, pressure_max=pressure_max,
    )  # fmt: skip
    f, T = _checked_loads(normal, friction, tangential_force)
    return CattaneoMindlinSphere(f, T, T, normal)


@dataclass(frozen=True)
class BlockSliding:
    """A block that is pressed onto a plane by a uniform pressure and whose top is displaced tangentially.

    The shear strain gamma is uniform. The shear traction is the smaller of G gamma, with the shear modulus G, and f p, with
    the coefficient of friction f and the pressure p.

    Attributes
    ----------
    shear_traction : float
        Shear traction on the interface [pressure].
    slip : float
        Sliding distance of the block on the plane [length].
    sliding : bool
        True if the shear traction has reached f p.
    dissipation : float
        Frictional work per unit area [force/length].
    """

    shear_traction: float
    slip: float
    sliding: bool
    dissipation: float


def block_sliding(
    *, E: float, nu: float, height: float, pressure: float, friction: float, displacement: float
) -> BlockSliding:
    """Return the state of a block under uniform pressure whose top is displaced tangentially (Coulomb's law).

    Parameters
    ----------
    E, nu : float
        Young's modulus [pressure] and Poisson's ratio [-] of the block.
    height : float
        Height of the block [length].
    pressure : float
        Uniform contact pressure [pressure].
    friction : float
        Coulomb's coefficient of friction, at least 0 [-].
    displacement : float
        Tangential displacement of the top, at least 0 [length].

    Returns
    -------
    BlockSliding

    Examples
    --------
    >>> from fastcontact import analytic
    >>> block = analytic.block_sliding(E=1000.0, nu=0.0, height=1.0, pressure=2.0, friction=0.5, displacement=0.01)
    >>> block.sliding, round(block.shear_traction, 9), round(block.slip, 9)
    (True, 1.0, 0.008)
    """
    G = positive("E", E) / (2.0 * (1.0 + poisson("nu", nu)))
    H, u = positive("height", height), not_negative("displacement", displacement)
    limit = not_negative("friction", friction) * not_negative("pressure", pressure)
    elastic = G * u / H
    sliding = elastic >= limit
    traction = limit if sliding else elastic
    slip = u - traction * H / G if sliding else 0.0
    return BlockSliding(traction, slip, sliding, traction * slip)
