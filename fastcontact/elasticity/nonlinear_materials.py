"""Nonlinear material laws: von Mises plasticity (small strain) and hyperelasticity (finite strain).

A law is a row of constants for `constitutive_kernels`: its number, the shear modulus, the bulk modulus of the volumetric
part ``U(J) = K (J - 1)^2 / 2``, then its own. Loads, contact and checks see the isotropic elasticity of small strains that
the law begins with.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array
from fastcontact.elasticity.constitutive_kernels import INVARIANTS, OGDEN, PLASTIC
from fastcontact.elasticity.materials import NEARLY_INCOMPRESSIBLE, LinearElastic, check_positive
from fastcontact.errors import ModelError

STRAINS = ("small", "finite")
# Plastic strain, which concentrates in a few cells, beyond which linear kinematics are worth a warning: under a ball without
# hardening the mean contact pressure falls from 2.6 times the yield stress, where it reaches 0.1, to 2.3 at 0.5, 2.1 at 1.1.
LARGEST_PLASTIC_STRAIN = 0.5


class NonlinearElastic(LinearElastic):
    """What laws beyond Hooke's have in common; as `LinearElastic` it is their elasticity at the beginning."""

    strain: str  # of the kinematics that the law is for

    def _begins_with(self, mu: float, bulk: float) -> None:
        """Set E and nu of a shear modulus and a bulk modulus [pressure]."""
        object.__setattr__(self, "E", 9.0 * bulk * mu / (3.0 * bulk + mu))
        object.__setattr__(self, "nu", (3.0 * bulk - 2.0 * mu) / (2.0 * (3.0 * bulk + mu)))
        super().__post_init__()

    def _check_numbers(self) -> None:
        """Raise ModelError where E or nu is not a number: constants of these laws do not vary."""
        for name in ("E", "nu"):
            if not isinstance(getattr(self, name), (int, float)):
                raise ModelError(f"{name} of {type(self).__name__} must be a number: its constants do not vary")

    @property
    def bulk_modulus(self) -> float:
        """Bulk modulus [pressure]."""
        return float(self.E / (3.0 * (1.0 - 2.0 * self.nu)))

    @property
    def averaged(self) -> bool:  # type: ignore[override]
        """Whether elements project the dilatation, where they can and kinematics are not plane stress."""
        nearly = self.strain == "small" or self.nu >= NEARLY_INCOMPRESSIBLE
        return self.volumetric == "mean_dilatation" or (self.volumetric == "auto" and nearly)

    @property
    def constants(self) -> list[float]:
        """The law's row for `constitutive_kernels`."""
        raise NotImplementedError


@typed(ModelError)
@dataclass(frozen=True)
class ElasticPlastic(NonlinearElastic):
    """Von Mises plasticity with associated flow, for small strains (Simo and Hughes, 1998, chapter 3).

    ModelError if a constant is outside its range.

    Parameters
    ----------
    E, nu : float
        Young's modulus [pressure] and Poisson's ratio [-].
    yield_stress : float
        In uniaxial tension, before any plastic strain [pressure].
    hardening : sequence of (float, float)
        Isotropic hardening: equivalent plastic strains [-], ascending from zero, and yield stresses there [pressure], linear
        in between and constant beyond the last; none by default, which is perfect plasticity. The first pair may be left out:
        it is (0, `yield_stress`).
    kinematic : float
        Modulus of linear kinematic hardening: slope of the stress over the plastic strain in uniaxial tension (Prager,
        1956) [pressure].
    volumetric : str
        As of `LinearElastic`; ``"auto"`` projects the dilatation wherever elements can, since plastic flow keeps the volume.
    density, expansion, conductivity : float, optional
        As of `LinearElastic`.

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

    strain = "small"

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_numbers()
        check_positive("the yield stress", self.yield_stress)
        if not 0.0 <= self.kinematic < math.inf:
            raise ModelError(f"the modulus of kinematic hardening = {self.kinematic} must be zero or more")
        object.__setattr__(self, "hardening", self._table())

    def _table(self) -> tuple[tuple[float, float], ...]:
        """Return the hardening table from zero on; ModelError if it is not one."""
        try:
            rows = np.array([[float(value) for value in row] for row in self.hardening]).reshape(-1, 2)
        except (TypeError, ValueError, OverflowError):
            raise ModelError(
                "hardening must be pairs (equivalent plastic strain, yield stress), such as [(0.0, 250.0), (0.1, 400.0)]"
            ) from None
        if not len(rows) or rows[0, 0] > 0.0:
            rows = np.vstack([[0.0, float(self.yield_stress)], rows])
        if not (np.isfinite(rows).all() and (np.diff(rows[:, 0]) > 0.0).all() and (rows[:, 1] > 0.0).all()):
            raise ModelError("hardening must have ascending plastic strains, from zero on, and positive yield stresses")
        if rows[0, 0] < 0.0 or not math.isclose(rows[0, 1], self.yield_stress):
            raise ModelError(
                f"hardening begins with the yield stress {rows[0, 1]:g} at the plastic strain {rows[0, 0]:g}, where "
                f"yield_stress = {self.yield_stress:g}: the first pair is (0, yield_stress), or left out"
            )
        slopes = np.diff(rows[:, 1]) / np.diff(rows[:, 0])
        if slopes.min(initial=0.0) <= -(3.0 * self.shear_modulus + self.kinematic):
            raise ModelError("hardening falls faster than the elastic stress can: softening must be slower than 3 G")
        return tuple((float(p), float(s)) for p, s in rows)

    @property
    def described(self) -> str:
        """E, nu and the yield stress, for messages."""
        return f"{super().described}, yield stress {self.yield_stress:g}"

    @property
    def constants(self) -> list[float]:
        """The law's row for `constitutive_kernels`."""
        table = [value for row in self.hardening for value in row]
        return [PLASTIC, self.shear_modulus, self.bulk_modulus, self.kinematic, len(self.hardening), *table]

    def yield_at(self, plastic_strain: Array) -> Array:
        """Return the yield stress (...) [pressure] at the equivalent plastic strains `plastic_strain` (...) [-]."""
        return np.interp(plastic_strain, *np.transpose(self.hardening))


class Hyperelastic(NonlinearElastic):
    """Hyperelasticity of finite strains: an isochoric part and ``U(J) = K (J - 1)^2 / 2``."""

    strain = "finite"

    def _set(self, mu: float, how: str, constants: dict[str, Any]) -> None:
        """Set the constants, those of the law and of `LinearElastic`.

        ModelError if the bulk modulus, or the shear modulus `mu` at the beginning, `how` it is found, is not positive.
        """
        for name, value in {**constants, "incompatible_modes": False}.items():
            object.__setattr__(self, name, value)
        bulk = constants["bulk"]
        if not (0.0 < mu < math.inf):
            raise ModelError(f"the shear modulus {how} = {mu:g} of {type(self).__name__} must be positive")
        check_positive("the bulk modulus", bulk)
        self._begins_with(mu, bulk)


@typed(ModelError)
@dataclass(frozen=True)
class NeoHookean(Hyperelastic):
    """Neo-Hookean hyperelasticity, ``mu / 2 (J^(-2/3) tr C - 3) + K (J - 1)^2 / 2`` (Bonet and Wood, 2008, section 6.5).

    ModelError if a constant is outside its range.

    Parameters
    ----------
    E, nu : float
        Young's modulus [pressure] and Poisson's ratio [-] of small strains: mu = E / (2 (1 + nu)), K = E / (3 (1 - 2 nu)).
    volumetric, density, expansion, conductivity
        As of `LinearElastic`: from nu = 0.49 on the dilatation is projected, so that elements do not lock.

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
        """The law's row for `constitutive_kernels`."""
        return [INVARIANTS, self.shear_modulus, self.bulk_modulus, 0.5 * self.shear_modulus, 0.0, 0.0, 0.0]


class Polynomial(Hyperelastic):
    """A polynomial of isochoric invariants of C: C10 (I1 - 3) + C01 (I2 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3."""

    _coefficients: tuple[float, float, float, float]

    def _take(self, coefficients: dict[str, float], constants: dict[str, Any]) -> None:
        """Set the `coefficients` by name, those that are missing being zero, and the other constants."""
        if not all(map(math.isfinite, coefficients.values())):
            raise ModelError(f"the constants of {type(self).__name__} must be finite numbers")
        C10, C01, C20, C30 = (float(coefficients.get(name, 0.0)) for name in ("C10", "C01", "C20", "C30"))
        object.__setattr__(self, "_coefficients", (C10, C01, C20, C30))
        self._set(2.0 * (C10 + C01), "2 (C10 + C01)" if C01 else "2 C10", {**coefficients, **constants})

    @property
    def constants(self) -> list[float]:
        """The law's row for `constitutive_kernels`."""
        return [INVARIANTS, self.shear_modulus, self.bulk_modulus, *self._coefficients]


@typed(ModelError)
@dataclass(frozen=True, init=False)
class MooneyRivlin(Polynomial):
    """Mooney-Rivlin hyperelasticity (Mooney, 1940; Rivlin, 1948): C10 (I1 - 3) + C01 (I2 - 3) + K (J - 1)^2 / 2.

    ModelError if a constant is outside its range.

    Parameters
    ----------
    C10, C01 : float
        [pressure]; the shear modulus of small strains is 2 (C10 + C01).
    bulk : float
        Bulk modulus K [pressure].
    volumetric, density, expansion, conductivity
        As of `NeoHookean`.

    Examples
    --------
    >>> import fastcontact as fc
    >>> rubber = fc.MooneyRivlin(C10=0.3, C01=0.1, bulk=1000.0)
    """

    C10: float = 0.0
    C01: float = 0.0
    bulk: float = 0.0

    def __init__(
        self, C10: float, C01: float, bulk: float, *, volumetric: str = "auto", density: Any = None,
        expansion: Any = None, conductivity: Any = None,
    ) -> None:  # fmt: skip
        rest = {
            "bulk": float(bulk), "volumetric": volumetric, "density": density, "expansion": expansion,
            "conductivity": conductivity,
        }  # fmt: skip
        self._take({"C10": C10, "C01": C01}, rest)


@typed(ModelError)
@dataclass(frozen=True, init=False)
class Yeoh(Polynomial):
    """Yeoh hyperelasticity (Yeoh, 1993): C10 (I1 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3 + K (J - 1)^2 / 2.

    ModelError if a constant is outside its range.

    Parameters
    ----------
    C10, C20, C30 : float
        [pressure]; the shear modulus of small strains is 2 C10.
    bulk : float
        Bulk modulus K [pressure].
    volumetric, density, expansion, conductivity
        As of `NeoHookean`.

    Examples
    --------
    >>> import fastcontact as fc
    >>> rubber = fc.Yeoh(C10=0.4, C20=-0.02, C30=0.002, bulk=1000.0)
    """

    C10: float = 0.0
    C20: float = 0.0
    C30: float = 0.0
    bulk: float = 0.0

    def __init__(
        self, C10: float, C20: float, C30: float, bulk: float, *, volumetric: str = "auto", density: Any = None,
        expansion: Any = None, conductivity: Any = None,
    ) -> None:  # fmt: skip
        rest = {
            "bulk": float(bulk), "volumetric": volumetric, "density": density, "expansion": expansion,
            "conductivity": conductivity,
        }  # fmt: skip
        self._take({"C10": C10, "C20": C20, "C30": C30}, rest)


@typed(ModelError)
@dataclass(frozen=True, init=False)
class Ogden(Hyperelastic):
    """Ogden hyperelasticity (Ogden, 1972): the sum of ``2 mu / alpha^2 (l1^alpha + l2^alpha + l3^alpha - 3)``, l isochoric.

    ModelError if a constant is outside its range.

    Parameters
    ----------
    mu : float or sequence of float
        Of each term [pressure]; their sum is the shear modulus of small strains.
    alpha : float or sequence of float
        Exponents [-], none of them zero.
    bulk : float
        Bulk modulus K of ``K (J - 1)^2 / 2`` [pressure].
    volumetric, density, expansion, conductivity
        As of `NeoHookean`.

    Examples
    --------
    >>> import fastcontact as fc
    >>> rubber = fc.Ogden(mu=[0.6, 0.1], alpha=[1.3, 5.0], bulk=1000.0)
    """

    mu: Any = ()
    alpha: Any = ()
    bulk: float = 0.0

    def __init__(
        self, mu: Any, alpha: Any, bulk: float, *, volumetric: str = "auto", density: Any = None,
        expansion: Any = None, conductivity: Any = None,
    ) -> None:  # fmt: skip
        try:
            terms = [tuple(float(v) for v in np.atleast_1d(np.asarray(value, float))) for value in (mu, alpha)]
        except (TypeError, ValueError, OverflowError):
            raise ModelError("mu and alpha of Ogden must be numbers, or lists with a number for each term") from None
        if len(terms[0]) != len(terms[1]) or not terms[0]:
            raise ModelError(f"Ogden has {len(terms[0])} mu and {len(terms[1])} alpha: give as many of both")
        if not all(map(math.isfinite, terms[0] + terms[1])) or 0.0 in terms[1]:
            raise ModelError("mu and alpha of Ogden must be finite, and no alpha zero")
        rest = {
            "bulk": bulk, "volumetric": volumetric, "density": density, "expansion": expansion,
            "conductivity": conductivity,
        }  # fmt: skip
        self._set(sum(terms[0]), "(the sum of mu)", {"mu": terms[0], "alpha": terms[1], **rest})

    @property
    def constants(self) -> list[float]:
        """The law's row for `constitutive_kernels`."""
        terms = [value for term in zip(self.mu, self.alpha, strict=True) for value in term]
        return [OGDEN, self.shear_modulus, self.bulk_modulus, len(self.mu), *terms]
