"""Conforming contact of a pin and the hole of an infinite plate of the same material (Persson 1964)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fastcontact.analytic._inputs import array, check_plane, exactly_one, not_negative, poisson, positive
from fastcontact.arrays import Array
from fastcontact.errors import ModelError


@dataclass(frozen=True)
class PerssonPin:
    """Frictionless contact of a pin and a hole (Persson 1964; Ciavarella and Decuzzi 2001).

    Attributes
    ----------
    R : float
        Radius of the hole [length].
    clearance : float
        Radius of the hole minus the radius of the pin [length].
    force : float
        Force on the pin per unit length [force/length].
    contact_angle : float
        Angle between the middle and the end of the contact, half of the angle of the arc [degrees].
    """

    R: float
    clearance: float
    force: float
    contact_angle: float

    @property
    def radius(self) -> float:
        """Half of the chord of the contact arc [length]."""
        return self.R * math.sin(math.radians(self.contact_angle))

    @property
    def pressure_max(self) -> float:
        """Largest pressure, at the middle of the contact [pressure]."""
        return float(self.pressure(0.0))

    def pressure(self, angle: ArrayLike) -> Array:
        """Return the contact pressure (...) [pressure] at angles `angle` (...) [degrees] from the middle, zero outside.

        The formula is given by Persson (1964) and by Ciavarella and Decuzzi (2001) for bodies of the same material.
        """
        b = _half_tangent(self.contact_angle)
        y = np.tan(0.5 * np.radians(array("angle", angle)))
        root, hypotenuse = np.sqrt(np.maximum(b**2 - y**2, 0.0)), math.hypot(1.0, b)
        first = 2.0 / math.pi * root / (hypotenuse * (1.0 + y**2))
        second = np.arctanh(root / hypotenuse) / (math.pi * b**2 * (1.0 + b**2))
        return self.force / self.R * (first + second)


def _half_tangent(angle: float) -> float:
    """Return the tangent of half an angle [degrees], the parameter b of Persson (1964)."""
    return math.tan(0.5 * math.radians(angle))


def _clearance_ratio(angle: float) -> float:
    """Return E dR/Q for a contact angle, with the clearance dR and the force per unit length Q (Persson 1964).

    The integrand is periodic. The midpoint rule therefore converges exponentially.
    """
    b = _half_tangent(angle)
    theta = (np.arange(256) + 0.5) * math.pi / 256 - 0.5 * math.pi
    integrand = 2.0 * np.arctanh(b * np.cos(theta) / math.hypot(1.0, b)) / (1.0 + (b * np.sin(theta)) ** 2)
    integral = float((integrand * np.cos(theta)).mean()) * math.pi * b
    return 2.0 / math.pi * (1.0 - b**2) / b**2 - integral / (math.pi**2 * (1.0 + b**2) * b**2)


def persson_limit_angle() -> float:
    """Return the contact angle of a pin without clearance, which does not depend on the force.

    Returns
    -------
    float
        Angle [degrees] between the middle and the end of the contact.

    Examples
    --------
    >>> from fastcontact import analytic
    >>> round(analytic.persson_limit_angle(), 2)
    84.83
    """
    from scipy.optimize import brentq

    return float(brentq(_clearance_ratio, 60.0, 89.0, xtol=1e-13))


def persson_pin(
    *,
    E: float,
    R: float,
    clearance: float,
    nu: float = 0.0,
    force: float | None = None,
    contact_angle: float | None = None,
    kinematics: str = "plane_stress",
) -> PerssonPin:
    """Return the contact of a pin with the hole of an infinite plate of the same material (Persson 1964).

    Parameters
    ----------
    E, nu : float
        Young's modulus [pressure] and Poisson's ratio [-] of both bodies; in plane stress `nu` has no effect.
    R : float
        Radius of the hole [length].
    clearance : float
        Radius of the hole minus the radius of the pin [length], at least 0.
    force, contact_angle : float
        Force per unit length [force/length], or angle between the middle and the end of the contact [degrees]; give exactly
        one of them.
    kinematics : {"plane_stress", "plane_strain"}
        Kinematics of both bodies.

    Returns
    -------
    PerssonPin

    Raises
    ------
    ModelError
        If a number is out of range, or if `contact_angle` is given without clearance or is not below `persson_limit_angle`.

    Examples
    --------
    >>> from fastcontact import analytic
    >>> pin = analytic.persson_pin(E=210_000.0, R=10.0, clearance=0.01, nu=0.3, force=1000.0)
    >>> round(pin.contact_angle, 2)
    49.66
    """
    from scipy.optimize import brentq

    modulus = positive("E", E)
    if check_plane(kinematics) == "plane_strain":
        modulus /= 1.0 - poisson("nu", nu) ** 2
    R, clearance = positive("R", R), not_negative("clearance", clearance)
    name, value = exactly_one(force=force, contact_angle=contact_angle)
    limit = persson_limit_angle()
    if name == "contact_angle":
        if clearance == 0.0:
            raise ModelError("contact_angle cannot be given without clearance: any force gives the same angle")
        if value >= limit:
            raise ModelError(f"contact_angle is {value:g}: with clearance it must be below {limit:.4f} degrees")
        return PerssonPin(R, clearance, modulus * clearance / _clearance_ratio(value), value)
    if clearance == 0.0:
        return PerssonPin(R, clearance, value, limit)
    ratio = modulus * clearance / value
    # The angle of Hertzian line contact is larger than the solution. The smaller of half this angle and half of `limit` is
    # a lower bound.
    start = min(0.5 * limit, 0.5 * math.degrees(math.sqrt(8.0 / (math.pi * ratio))))
    angle = brentq(lambda a: math.log(max(_clearance_ratio(a), 1e-300) / ratio), start, limit - 1e-12, xtol=1e-13)
    return PerssonPin(R, clearance, value, float(angle))
