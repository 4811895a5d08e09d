"""Contact pressures of theories as functions of the distance from the middle of the contact, for plots."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fastcontact import analytic
from fastcontact.arrays import Array

# Authors of the theories, by the name of the class.
_AUTHORS = {
    "HertzPoint": "Hertz",
    "HertzLine": "Hertz",
    "HertzBox": "Hertz",
    "CattaneoMindlinLine": "Hertz",
    "CattaneoMindlinSphere": "Hertz",
    "PressFit": "Lamé",
    "PerssonPin": "Persson",
    "PowerLawPunch": "Sneddon",
}


def author(theory: Any) -> str:
    """Return the name of a theory, which is that of its author."""
    return _AUTHORS.get(type(theory).__name__, "theory")


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
    name = author(theory)
    if isinstance(theory, analytic.PressFit):
        uniform = theory.pressure
        return PressureCurve(name, lambda s: np.full(np.shape(s), uniform), uniform, math.inf)
    if isinstance(theory, analytic.PerssonPin):
        pin = theory
        return PressureCurve(
            name,
            lambda s: pin.pressure(np.minimum(np.degrees(np.abs(np.asarray(s, float)) / pin.R), 180.0)),
            pin.pressure_max,
            pin.R * math.radians(pin.contact_angle),
        )
    if isinstance(theory, (analytic.CattaneoMindlinLine, analytic.CattaneoMindlinSphere)):
        theory = theory.normal
    if not all(hasattr(theory, key) for key in ("pressure", "pressure_max", "radius")):
        return None
    if not (callable(theory.pressure) and math.isfinite(theory.pressure_max)):
        return None
    return PressureCurve(name, theory.pressure, float(theory.pressure_max), float(theory.radius))


def has_ellipse(theory: Any) -> bool:
    """Return whether a theory is that of an elliptical contact with different semi-axes."""
    return isinstance(theory, analytic.HertzElliptical) and theory.radius_x != theory.radius_y


def curves_along_axes(theory: Any) -> dict[str, PressureCurve]:
    """Return the curves of a theory by the suffixes of their labels: of an ellipse, those along the major and minor axis.

    Examples
    --------
    >>> from fastcontact.analytic import hertz_elliptical
    >>> hertz = hertz_elliptical(E1=1000.0, nu1=0.3, R1x=10.0, R1y=20.0, force=1.0)
    >>> curves = curves_along_axes(hertz)
    >>> list(curves)
    [', major axis', ', minor axis']
    >>> curves[", major axis"].radius == hertz.radius_y > hertz.radius_x
    True
    """
    curve = pressure_curve(theory)
    if curve is None or not has_ellipse(theory):
        return {} if curve is None else {"": curve}
    along_x = replace(curve, radius=theory.radius_x)
    along_y = replace(curve, radius=theory.radius_y, pressure=partial(theory.pressure, 0.0))
    ordered = (along_x, along_y) if theory.radius_x > theory.radius_y else (along_y, along_x)
    return dict(zip((", major axis", ", minor axis"), ordered, strict=True))
