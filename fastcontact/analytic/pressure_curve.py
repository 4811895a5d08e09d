"""Contact pressures of theories as functions of the distance from the middle of the contact, for plots."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fastcontact.analytic._cattaneo_mindlin import CattaneoMindlinLine, CattaneoMindlinSphere
from fastcontact.analytic._lame import PressFit
from fastcontact.analytic._manufactured import HertzBox
from fastcontact.analytic._persson import PerssonPin
from fastcontact.analytic._punches import PowerLawPunch
from fastcontact.analytic.hertz_line import HertzLine
from fastcontact.analytic.hertz_point import HertzPoint
from fastcontact.arrays import Array

# Names of the theories, after their authors.
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
    """A contact pressure as a function of the distance from the middle of the contact, which can be plotted.

    Attributes
    ----------
    name : str
        Name of the theory.
    pressure : callable
        Function from distances (...) [length] along the surface to pressures (...) [pressure].
    pressure_max : float
        Largest pressure [pressure].
    radius : float
        Distance along the surface beyond which the pressure is zero [length]; infinite for a uniform pressure.
    """

    name: str
    pressure: Callable[[ArrayLike], Array]
    pressure_max: float
    radius: float


def pressure_curve(theory: Any) -> PressureCurve | None:
    """Return the contact pressure of a theory as a curve; None if it has no pressure or an unbounded one.

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
