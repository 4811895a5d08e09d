"""Checks of the inputs of analytic solutions, elastic constants of two bodies, and laws common to normal contacts."""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fastcontact.arrays import MASKED_ENTRIES, Array, is_masked
from fastcontact.errors import ModelError, check_known

# Largest magnitude of an input. Its cube is finite in double precision.
LARGEST = 1e60
PLANE = ("plane_strain", "plane_stress")


def number(name: str, value: object) -> float:
    """Return `value` as a finite float, or raise ModelError, with the `name` of the quantity."""
    # The comparison precedes the conversion, since an integer may exceed the range of floats. NaN compares false.
    magnitude: Any = abs(value) if isinstance(value, numbers.Real) and not isinstance(value, bool) else math.nan
    if not magnitude < math.inf:
        raise ModelError(f"{name} is {value!r}: it must be a finite number")
    if magnitude > LARGEST:
        raise ModelError(f"{name} is out of range: its magnitude must be at most {LARGEST:g}, whatever its unit")
    return float(value)  # type: ignore[arg-type]


def array(name: str, values: ArrayLike) -> Array:
    """Return `values` (...) [unit of the quantity] as floats (...) [unit of the quantity], or raise ModelError."""
    if is_masked(values):
        raise ModelError(f"{name} {MASKED_ENTRIES}")
    try:
        converted = np.asarray(values)
    except ValueError:  # rows of different lengths
        converted = np.empty(0, object)
    if converted.dtype.kind not in "biuf":
        raise ModelError(f"{name} must be a number or an array of real numbers, not {type(values).__name__}")
    return converted.astype(np.float64, copy=False)


def positive(name: str, value: object, *, infinite: bool = False) -> float:
    """Return `value` as a positive float, or raise ModelError; `infinite` admits infinity."""
    if infinite and isinstance(value, numbers.Real) and value == math.inf:
        return math.inf
    checked = number(name, value)
    if checked <= 0.0:
        raise ModelError(f"{name} is {checked:g}: it must be positive")
    if checked < 1.0 / LARGEST:
        raise ModelError(f"{name} is out of range: it must be at least {1.0 / LARGEST:g}, whatever its unit")
    return checked


def not_negative(name: str, value: object) -> float:
    """Return `value` as a non-negative float, or raise ModelError."""
    checked = number(name, value)
    if checked < 0.0:
        raise ModelError(f"{name} is {checked:g}: it must not be negative")
    return checked


def poisson(name: str, value: object) -> float:
    """Return `value` as a Poisson ratio in (-1, 0.5], or raise ModelError."""
    checked = number(name, value)
    if not -1.0 < checked <= 0.5:
        raise ModelError(f"{name} is {checked:g}: a Poisson ratio lies in (-1, 0.5]")
    return checked


def exactly_one(**loads: float | None) -> tuple[str, float]:
    """Return the name and the value of the only argument that is not None; ModelError unless it is a positive number."""
    names = [name for name, value in loads.items() if value is not None]
    if len(names) != 1:
        raise ModelError(f"give exactly one of {', '.join(loads)}: got {' and '.join(names) or 'none'}")
    return names[0], positive(names[0], loads[names[0]])


@dataclass(frozen=True)
class Bodies:
    """Elastic constants of two bodies in contact.

    Attributes
    ----------
    E1 : float
        Young's modulus of the first body [pressure].
    nu1 : float
        Poisson's ratio of the first body [-].
    E2 : float or None
        Young's modulus of the second body [pressure]; None if the body is rigid.
    nu2 : float
        Poisson's ratio of the second body [-].
    """

    E1: float
    nu1: float
    E2: float | None = None
    nu2: float = 0.0

    def __post_init__(self) -> None:
        checked = {"E1": positive("E1", self.E1), "nu1": poisson("nu1", self.nu1), "nu2": poisson("nu2", self.nu2)}
        if self.E2 is not None:
            checked["E2"] = positive("E2", self.E2)
        for name, value in checked.items():
            object.__setattr__(self, name, value)  # the class is frozen

    @property
    def E_star(self) -> float:
        """Contact modulus [pressure], 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2 (Johnson 1985, section 4.2)."""
        return 1.0 / sum((1.0 - nu**2) / E for E, nu in self._elastic_constants)

    @property
    def E_star_plane_stress(self) -> float:
        """Contact modulus [pressure] of two thin discs, 1/E* = 1/E1 + 1/E2."""
        return 1.0 / sum(1.0 / E for E, _ in self._elastic_constants)

    @property
    def G_star(self) -> float:
        """Tangential modulus [pressure], 1/G* = (2 - nu1)/G1 + (2 - nu2)/G2 with shear moduli G (Mindlin 1949)."""
        return 1.0 / sum(2.0 * (2.0 - nu) * (1.0 + nu) / E for E, nu in self._elastic_constants)

    @property
    def dundurs(self) -> float:
        """Dundurs' parameter beta [-] in plane strain; if it is 0, normal and shear tractions decouple (Dundurs 1969)."""
        first = (1.0 - 2.0 * self.nu1) * (1.0 + self.nu1) / self.E1
        second = 0.0 if self.E2 is None else (1.0 - 2.0 * self.nu2) * (1.0 + self.nu2) / self.E2
        return 0.5 * (first - second) * self.E_star

    @property
    def _elastic_constants(self) -> list[tuple[float, float]]:
        """Young's modulus [pressure] and Poisson's ratio [-] of each body that is not rigid."""
        first = [(self.E1, self.nu1)]
        return first if self.E2 is None else [*first, (self.E2, self.nu2)]

    def constants(self, body: int) -> tuple[float, float]:
        """Return E and nu of body 1 or 2; ModelError for other numbers and for a rigid body."""
        if body not in (1, 2):
            raise ModelError(f"body is {body!r}: it must be 1 or 2")
        if body > len(self._elastic_constants):
            raise ModelError("body 2 is rigid (E2 is None): it has no displacement field, request body 1")
        return self._elastic_constants[body - 1]


def effective_radius(R1: float, R2: float, names: tuple[str, str] = ("R1", "R2")) -> float:
    """Return the relative radius R [length], with 1/R = 1/R1 + 1/R2, where radii of concave surfaces are negative.

    Raises ModelError if R is not positive or both radii are infinite.
    """
    for name, R in zip(names, (R1, R2), strict=True):
        positive(name, abs(R) if isinstance(R, (int, float)) and R is not True else R, infinite=True)
    if math.isinf(R1) and math.isinf(R2):
        reason = "two planes have no Hertz contact" if names == ("R1", "R2") else "use hertz_line for line contact"
        raise ModelError(f"{names[0]} and {names[1]} are both infinite: {reason}")
    return positive(f"the relative curvature 1/{names[0]} + 1/{names[1]}", 1.0 / R1 + 1.0 / R2) ** -1


def check_plane(kinematics: str) -> str:
    """Return `kinematics` if it is "plane_strain" or "plane_stress"; otherwise raise ModelError."""
    check_known("kinematics", kinematics, PLANE, ModelError)
    return kinematics


def quantities(laws: Mapping[str, tuple[float, float]], name: str, value: float) -> dict[str, float]:
    """Return the quantities of a contact by name, given the `value` of the one called `name`.

    Each quantity is ``coefficient * radius**exponent``. `laws` contains the coefficients and the exponents by name.

    Examples
    --------
    >>> quantities({"radius": (1.0, 1.0), "area": (3.0, 2.0)}, "area", 12.0)
    {'radius': 2.0, 'area': 12.0}
    """
    coefficient, exponent = laws[name]
    radius = (value / coefficient) ** (1.0 / exponent)
    return {key: factor * radius**power for key, (factor, power) in laws.items()} | {name: value}
