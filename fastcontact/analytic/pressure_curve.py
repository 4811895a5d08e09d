"""Pressure of a theory over the distance from the middle of the contact, along its surface."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fastcontact.analytic.cattaneo_mindlin import CattaneoMindlinLine, CattaneoMindlinSphere
from fastcontact.analytic.hertz_line import HertzLine
from fastcontact.analytic.hertz_point import HertzPoint
from fastcontact.analytic.lame import PressFit
from fastcontact.analytic.manufactured import HertzBox
from fastcontact.analytic.persson import PerssonPin
from fastcontact.analytic.punches import PowerLawPunch
from fastcontact.arrays import Array

# Authors after whom the theories are named.
NAMES: dict[type, str] = {
    HertzPoint: "Hertz",
    HertzLine: "Hertz",
    HertzBox: "Hertz",
    CattaneoMindlinLine: "Hertz",
    CattaneoMindlinSphere: "Hertz",
    PressFit: "Lamé",
    PerssonPin: "Persson",
    PowerLawPunch: "Sneddon",
}


@dataclass(frozen=True)
class PressureCurve:
    """A pressure that can be drawn over the distance from the middle of the contact.

    Attributes
    ----------
    name : str
        Author after whom the theory is named.
    pressure : callable
        From distances (...) [length] to pressures (...) [pressure].
    pressure_max : float
        [pressure]
    radius : float
        End of the pressure along the surface [length]; infinite for a uniform pressure.
    """

    name: str
    pressure: Callable[[ArrayLike], Array]
    pressure_max: float
    radius: float


def pressure_curve(theory: Any) -> PressureCurve | None:
    """Return the pressure of a theory as a curve; None where it has none, or it is infinite somewhere.

    Examples
    --------
    >>> from fastcontact.analytic import persson_pin
    >>> pin = persson_pin(E=1000.0, nu=0.3, R=10.0, clearance=0.1, contact_angle=60.0)
    >>> curve = pressure_curve(pin)
    >>> round(float(curve.pressure(0.0) / pin.pressure_max), 12), float(curve.pressure(curve.radius)) < 1e-6
    (1.0, True)
    """
    if theory is None:
        return None
    name = NAMES.get(type(theory), "theory")
    if isinstance(theory, PressFit):
        uniform = theory.pressure
        return PressureCurve(name, lambda s: np.full(np.shape(s), uniform), uniform, math.inf)
    if isinstance(theory, PerssonPin):
        pin = theory
        return PressureCurve(
            name,
            lambda s: pin.pressure(np.minimum(np.degrees(np.abs(np.asarray(s, float)) / pin.R), 180.0)),
            pin.pressure_max,
            pin.R * math.radians(pin.contact_angle),
        )
    theory = theory.normal if isinstance(theory, (CattaneoMindlinLine, CattaneoMindlinSphere)) else theory
    if not all(hasattr(theory, key) for key in ("pressure", "pressure_max", "radius")):
        return None
    if not (callable(theory.pressure) and math.isfinite(theory.pressure_max)):
        return None
    return PressureCurve(name, theory.pressure, float(theory.pressure_max), float(theory.radius))
