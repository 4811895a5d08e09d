"""Nonlinear material laws: von Mises plasticity, and hyperelasticity at finite strains.

For `constitutive_kernels`, a law is a row of constants: the number of the law, the shear modulus, the bulk modulus of the
volumetric part ``U(J) = K (J - 1)^2 / 2``, and further constants. Other modules, such as those of loads and contact, use the
isotropic moduli at small strains.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import number_pairs, typed
from fastcontact.arrays import Array
from fastcontact.elasticity.constitutive_kernels import INVARIANTS, OGDEN, PLASTIC
from fastcontact.elasticity.materials import Constant, LinearElastic, check_positive
from fastcontact.errors import ModelError

STRAINS = ("small", "finite")
# Largest plastic strain of a cell that causes no warning under linear kinematics. If a ball is pressed into a material
# without hardening, the mean contact pressure is 2.6 times the yield stress when the largest plastic strain is 0.1, 2.3
# times when it is 0.5, and 2.1 times when it is 1.1. At plastic strains from 0.13 to 0.24, the pressure is 8 to 10 % lower
# and the force 4 to 7 % lower than with finite strains.
LARGEST_PLASTIC_STRAIN = 0.2


class NonlinearElastic(LinearElastic):
    """Base class of nonlinear laws, which inherit the isotropic elasticity at small strains from `LinearElastic`."""

    strains: tuple[str, ...] = STRAINS  # kinds of strain that the law supports

    def _check_numbers(self) -> None:
        """Raise ModelError if E or nu is not a number, because the constants of these laws do not vary."""
        for name in ("E", "nu"):
            if not isinstance(getattr(self, name), (int, float)):
                raise ModelError(f"{name} of {type(self).__name__} must be a number: its constants do not vary")

    @property
    def bulk_modulus(self) -> float:
        """Bulk modulus [pressure]."""
        return float(self.E / (3.0 * (1.0 - 2.0 * self.nu)))

    @property
    def averaged(self) -> bool:  # type: ignore[override]
        """Whether elements that support a mean dilatation use it, except in plane stress."""
        return super().averaged or (self.volumetric == "auto" and "small" in self.strains)

    @property
    def constants(self) -> list[float]:
        """Row of constants of the law for `constitutive_kernels`."""
        raise NotImplementedError


@typed(ModelError)
@dataclass(frozen=True)
class ElasticPlastic(NonlinearElastic):
    """Von Mises plasticity with associated flow (Simo and Hughes, 1998, chapter 3).

    With ``strain="finite"``, the deformation gradient is split multiplicatively, and the same law relates the logarithmic
    elastic strain to the Kirchhoff stress (Simo, Comput. Methods Appl. Mech. Engrg. 99, 1992). Stresses and strains in
    uniaxial tension are then true stresses and logarithmic strains, apart from the elastic change of volume. Load steps must
    be small if the principal axes of strain rotate. In simple shear, for example, steps of 0.1 cause a spurious normal stress
    of 5 % of the shear stress.

    Parameters
    ----------
    E, nu : float
        Young's modulus [pressure] and Poisson's ratio [-].
    yield_stress : float
        Initial yield stress in uniaxial tension [pressure].
    hardening : sequence of (float, float), optional
        Isotropic hardening: pairs of equivalent plastic strain [-], ascending from zero, and yield stress [pressure]. The
        yield stress is interpolated linearly, and is constant beyond the last pair. By default, the material is perfectly
        plastic. The first pair, (0, `yield_stress`), may be omitted.
    kinematic : float
        Modulus of linear kinematic hardening (Prager, 1956), the slope of the curve of stress versus plastic strain in
        uniaxial tension [pressure]. It is available only for small strains.
    volumetric : str
        As for `LinearElastic`, but ``"auto"`` always selects the mean dilatation, because plastic flow preserves the volume.
    density, expansion, conductivity : float, optional
        As for `LinearElastic`.

    Raises
    ------
    ModelError
        If a constant is outside its range.

    Examples
    --------
    >>> import fastcontact as fc
    >>> steel = fc.ElasticPlastic(E=210e3, nu=0.3, yield_stress=250.0, hardening=[(0.0, 250.0), (0.1, 400.0)])
    >>> steel.described
    'E = 210000, nu = 0.3, yield stress 250'
    """

    yield_stress: float = field(kw_only=True)
    hardening: Any = field(default=(), kw_only=True)
    kinematic: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_numbers()
        check_positive("the yield stress", self.yield_stress)
        if not 0.0 <= self.kinematic < math.inf:
            raise ModelError(f"the modulus of kinematic hardening = {self.kinematic} must be zero or more")
        object.__setattr__(self, "hardening", self._table())

    def _table(self) -> tuple[tuple[float, float], ...]:
        """Return the hardening table, which begins at zero plastic strain; raise ModelError if it is not valid."""
        rows = number_pairs(() if self.hardening is None else self.hardening)
        if rows is None:
            is_slope = isinstance(self.hardening, float | int) and 0.0 <= self.hardening <= sys.float_info.max
            slope = self.hardening if is_slope else self.yield_stress
            raise ModelError(
                "hardening must be pairs (equivalent plastic strain, yield stress), for example "
                f"[(0.0, {self.yield_stress}), (0.1, {self.yield_stress + 0.1 * slope:g})] for the slope {slope:g}"
            )
        if not len(rows) or rows[0, 0] > 0.0:
            rows = np.vstack([[0.0, float(self.yield_stress)], rows])
        if not (np.isfinite(rows).all() and (np.diff(rows[:, 0]) > 0.0).all() and (rows[:, 1] > 0.0).all()):
            raise ModelError("hardening needs ascending, non-negative plastic strains and positive yield stresses")
        if rows[0, 0] < 0.0 or not math.isclose(rows[0, 1], self.yield_stress):
            raise ModelError(
                f"hardening begins with the yield stress {rows[0, 1]:g} at the plastic strain {rows[0, 0]:g}, where "
                f"yield_stress = {self.yield_stress:g}: the first pair must be (0, yield_stress), or be omitted"
            )
        slopes = np.diff(rows[:, 1]) / np.diff(rows[:, 0])
        if slopes.min(initial=0.0) <= -(3.0 * self.shear_modulus + self.kinematic):
            raise ModelError("the yield stress decreases too fast: its slope must be greater than -(3 G + kinematic)")
        return tuple((float(p), float(s)) for p, s in rows)

    @property
    def described(self) -> str:
        """Text with E, nu and the yield stress, for messages."""
        return f"{super().described}, yield stress {self.yield_stress:g}"

    @property
    def constants(self) -> list[float]:
        """Row of constants of the law for `constitutive_kernels`."""
        table = [value for row in self.hardening for value in row]
        return [PLASTIC, self.shear_modulus, self.bulk_modulus, self.kinematic, len(self.hardening), *table]

    def yield_at(self, plastic_strain: Array) -> Array:
        """Return the yield stress (...) [pressure] at the equivalent plastic strains `plastic_strain` (...) [-]."""
        return np.interp(plastic_strain, *np.transpose(self.hardening))


class Hyperelastic(NonlinearElastic):
    """Base class of hyperelastic laws, whose energy is an isochoric part plus ``U(J) = K (J - 1)^2 / 2``."""

    strains = ("finite",)


@typed(ModelError)
@dataclass(frozen=True)
class NeoHookean(Hyperelastic):
    """Neo-Hookean hyperelasticity, ``mu / 2 (J^(-2/3) tr C - 3) + K (J - 1)^2 / 2`` (Bonet and Wood, 2008, section 6.5).

    Parameters
    ----------
    E, nu : float
        Young's modulus [pressure] and Poisson's ratio [-] at small strains: mu = E / (2 (1 + nu)), K = E / (3 (1 - 2
        nu)).
    volumetric, density, expansion, conductivity
        As for `LinearElastic`.

    Raises
    ------
    ModelError
        If a constant is outside its range.

    Examples
    --------
    >>> import fastcontact as fc
    >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain", strain="finite")
    >>> model.add_material(fc.NeoHookean(E=1.5, nu=0.4995))
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_numbers()

    @property
    def constants(self) -> list[float]:
        """Row of constants of the law for `constitutive_kernels`."""
        return [INVARIANTS, self.shear_modulus, self.bulk_modulus, 0.5 * self.shear_modulus, 0.0, 0.0, 0.0]


@dataclass(frozen=True)
class FromConstants(Hyperelastic):
    """Base class of laws whose constants determine E and nu.

    Parameters
    ----------
    volumetric, density, expansion, conductivity
        Further properties, as for `LinearElastic`.
    """

    E: Constant = field(init=False, default=0.0)
    nu: Constant = field(init=False, default=0.0)
    volumetric: str = field(default="auto", kw_only=True)
    density: Constant | None = field(default=None, kw_only=True)
    expansion: Constant | None = field(default=None, kw_only=True)
    incompatible_modes: bool = field(init=False, default=False)
    conductivity: Constant | None = field(default=None, kw_only=True)

    def _set_initial_moduli(self, mu: float, formula: str, bulk: float) -> None:
        """Set E and nu, given the shear modulus `mu` at small strains and the bulk modulus `bulk` [pressure].

        Raises ModelError if one of the moduli is not positive; the message contains the `formula` of mu.
        """
        if not (0.0 < mu < math.inf):
            raise ModelError(f"the shear modulus {formula} = {mu:g} of {type(self).__name__} must be positive")
        check_positive("the bulk modulus", bulk)
        object.__setattr__(self, "E", 9.0 * bulk * mu / (3.0 * bulk + mu))
        object.__setattr__(self, "nu", (3.0 * bulk - 2.0 * mu) / (2.0 * (3.0 * bulk + mu)))
        super().__post_init__()


class Polynomial(FromConstants):
    """Base class of laws ``C10 (I1 - 3) + C01 (I2 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3`` of the isochoric invariants."""

    bulk: float

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, self._coefficients)):
            raise ModelError(f"the constants of {type(self).__name__} must be finite numbers")
        C10, C01, _, _ = self._coefficients
        self._set_initial_moduli(2.0 * (C10 + C01), "2 (C10 + C01)" if C01 else "2 C10", self.bulk)

    @property
    def _coefficients(self) -> list[float]:
        return [float(getattr(self, name, 0.0)) for name in ("C10", "C01", "C20", "C30")]

    @property
    def constants(self) -> list[float]:
        """Row of constants of the law for `constitutive_kernels`."""
        return [INVARIANTS, self.shear_modulus, self.bulk_modulus, *self._coefficients]


@typed(ModelError)
@dataclass(frozen=True)
class MooneyRivlin(Polynomial):
    """Mooney-Rivlin hyperelasticity (Mooney, 1940; Rivlin, 1948): C10 (I1 - 3) + C01 (I2 - 3) + K (J - 1)^2 / 2.

    I1 and I2 are the invariants of the isochoric stretches, and J is the volume ratio.

    Parameters
    ----------
    C10, C01 : float
        Constants [pressure]; the shear modulus at small strains is 2 (C10 + C01).
    bulk : float
        Bulk modulus K [pressure].
    volumetric, density, expansion, conductivity
        As for `NeoHookean`.

    Raises
    ------
    ModelError
        If a constant is outside its range.

    Examples
    --------
    >>> import fastcontact as fc
    >>> rubber = fc.MooneyRivlin(C10=0.3, C01=0.1, bulk=1000.0)
    """

    C10: float
    C01: float
    bulk: float


@typed(ModelError)
@dataclass(frozen=True)
class Yeoh(Polynomial):
    """Yeoh hyperelasticity (Yeoh, 1993): C10 (I1 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3 + K (J - 1)^2 / 2.

    I1 is the first invariant of the isochoric stretches, and J is the volume ratio.

    Parameters
    ----------
    C10, C20, C30 : float
        Constants [pressure]; the shear modulus at small strains is 2 C10.
    bulk : float
        Bulk modulus K [pressure].
    volumetric, density, expansion, conductivity
        As for `NeoHookean`.

    Raises
    ------
    ModelError
        If a constant is outside its range.

    Examples
    --------
    >>> import fastcontact as fc
    >>> rubber = fc.Yeoh(C10=0.4, C20=-0.02, C30=0.002, bulk=1000.0)
    """

    C10: float
    C20: float
    C30: float
    bulk: float


@typed(ModelError)
@dataclass(frozen=True)
class Ogden(FromConstants):
    """Ogden hyperelasticity (Ogden, 1972): the sum of ``2 mu / alpha^2 (l1^alpha + l2^alpha + l3^alpha - 3)``.

    l1, l2 and l3 are the isochoric stretches. The volumetric energy is ``K (J - 1)^2 / 2`` with the volume ratio J.

    Parameters
    ----------
    mu : float or sequence of float
        Modulus of each term [pressure]; the sum is the shear modulus at small strains.
    alpha : float or sequence of float
        Exponents, which must not be zero [-].
    bulk : float
        Bulk modulus K of ``K (J - 1)^2 / 2`` [pressure].
    volumetric, density, expansion, conductivity
        As for `NeoHookean`.

    Raises
    ------
    ModelError
        If a constant is outside its range.

    Examples
    --------
    >>> import fastcontact as fc
    >>> rubber = fc.Ogden(mu=[0.6, 0.1], alpha=[1.3, 5.0], bulk=1000.0)
    """

    mu: Any
    alpha: Any
    bulk: float

    def __post_init__(self) -> None:
        try:
            terms = [tuple(map(float, np.atleast_1d(np.asarray(value, float)))) for value in (self.mu, self.alpha)]
        except (TypeError, ValueError, OverflowError):
            raise ModelError("mu and alpha of Ogden must be numbers, or lists with a number for each term") from None
        if len(terms[0]) != len(terms[1]) or not terms[0]:
            raise ModelError(f"Ogden has {len(terms[0])} mu and {len(terms[1])} alpha: their numbers must be equal")
        if not all(map(math.isfinite, terms[0] + terms[1])) or 0.0 in terms[1]:
            raise ModelError("mu and alpha of Ogden must be finite, and alpha must not be zero")
        object.__setattr__(self, "mu", terms[0])
        object.__setattr__(self, "alpha", terms[1])
        self._set_initial_moduli(sum(terms[0]), "(the sum of mu)", self.bulk)

    @property
    def constants(self) -> list[float]:
        """Row of constants of the law for `constitutive_kernels`."""
        terms = [value for term in zip(self.mu, self.alpha, strict=True) for value in term]
        return [OGDEN, self.shear_modulus, self.bulk_modulus, len(self.mu), *terms]
