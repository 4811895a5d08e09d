"""Contact of rigid punches with a flat or power-law profile on a half-space, and of flat punches on a half-plane."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fastcontact.analytic._inputs import array, exactly_one, poisson, positive, quantities
from fastcontact.arrays import Array
from fastcontact.errors import ModelError


@dataclass(frozen=True)
class FlatPunch:
    """Flat-ended rigid cylinder on a half-space (Boussinesq 1885; Sneddon 1946; Johnson 1985, section 3.4).

    Attributes
    ----------
    E_star : float
        Plane-strain modulus E/(1 - nu^2) of the half-space [pressure].
    radius : float
        Radius a of the punch [length].
    approach : float
        Indentation [length].
    force : float
        Normal force F [force].
    bonded : bool
        True if the punch adheres to the half-space instead of being frictionless.
    """

    E_star: float
    radius: float
    approach: float
    force: float
    bonded: bool = False

    @property
    def stiffness(self) -> float:
        """Stiffness [force/length]: the normal force divided by the indentation, which does not depend on the force."""
        return self.force / self.approach

    def pressure(self, r: ArrayLike) -> Array:
        """Return the contact pressure (...) [pressure] at distances `r` (...) [length] from the axis.

        It is F/(2 pi a sqrt(a^2 - r^2)) under the punch, infinite at its edge and zero outside (Johnson 1985, eq. 3.34).
        Raises ModelError for a bonded punch, to which this formula does not apply.
        """
        self._check_frictionless("pressure")
        inside = self.radius**2 - array("r", r) ** 2
        with np.errstate(divide="ignore"):
            value = self.force / (2.0 * math.pi * self.radius * np.sqrt(np.maximum(inside, 0.0)))
        return np.where(inside < 0.0, 0.0, value)

    def normal_displacement(self, r: ArrayLike) -> Array:
        """Return the displacement (...) [length] of the surface along its outward normal at `r` (...) [length], at most 0.

        The formula is eq. 3.38 of Johnson (1985). Raises ModelError for a bonded punch, to which it does not apply.
        """
        self._check_frictionless("normal displacement")
        ratio = self.radius / np.maximum(np.abs(array("r", r)), self.radius)
        return -2.0 * self.approach / math.pi * np.arcsin(ratio)

    def _check_frictionless(self, quantity: str) -> None:
        """Raise ModelError if the punch is bonded."""
        if self.bonded:
            raise ModelError(f"a bonded flat punch has no closed form for its {quantity}: use bonded=False")


@dataclass(frozen=True)
class PowerLawPunch:
    """Frictionless rigid punch with the profile A r^n on a half-space (Galin 1946; Sneddon 1965).

    The punch is a cone for n = 1 and a paraboloid for n = 2; the flat punch is the limit for large n.

    Attributes
    ----------
    E_star : float
        Plane-strain modulus E/(1 - nu^2) of the half-space [pressure].
    coefficient : float
        Coefficient A of the profile [length^(1 - n)].
    exponent : float
        Exponent n of the profile [-].
    radius : float
        Contact radius a [length].
    approach : float
        Indentation delta of the tip [length].
    force : float
        Normal force [force].
    """

    E_star: float
    coefficient: float
    exponent: float
    radius: float
    approach: float
    force: float

    @property
    def pressure_max(self) -> float:
        """Largest contact pressure [pressure], infinite for a cone."""
        return float(self.pressure(0.0)) if self.exponent > 1.0 else math.inf

    def at_force(self, force: float) -> PowerLawPunch:
        """Return the same contact under another force [force]."""
        return _solve(self.E_star, self.coefficient, self.exponent, *exactly_one(force=force))

    def at_approach(self, approach: float) -> PowerLawPunch:
        """Return the same contact at another indentation [length]."""
        return _solve(self.E_star, self.coefficient, self.exponent, *exactly_one(approach=approach))

    def pressure(self, r: ArrayLike) -> Array:
        """Return the contact pressure (...) [pressure] at distances `r` (...) [length] from the axis, zero outside.

        With k = delta/(A a^n) it is the integral E*/pi int_r^a k n A x^(n-1)/sqrt(x^2 - r^2) dx (Sneddon 1965, eq. 4.8),
        which is equal to E* k n A a^(n-2) sqrt(a^2 - r^2)/pi 2F1(1 - n/2, 1; 3/2; 1 - r^2/a^2) with the hypergeometric
        function 2F1.
        """
        from scipy.special import hyp2f1

        n, a = self.exponent, self.radius
        inside = np.maximum(1.0 - (array("r", r) / a) ** 2, 0.0)
        scale = self.E_star * self.approach * n / (math.pi * a)
        shape = np.sqrt(inside) * hyp2f1(1.0 - 0.5 * n, 1.0, 1.5, inside)
        return scale * np.where((inside == 1.0) & (n <= 1.0), math.inf, shape)

    def normal_displacement(self, r: ArrayLike) -> Array:
        """Return the displacement (...) [length] of the surface along its outward normal at `r` (...) [length], at most 0.

        The formula is due to Sneddon (1965).
        """
        from scipy.special import hyp2f1

        n, a = self.exponent, self.radius
        distance = np.abs(array("r", r))
        ratio = a / np.maximum(distance, a)
        profile = ratio / (n + 1.0) * hyp2f1(0.5, 0.5 * (n + 1.0), 0.5 * (n + 3.0), ratio**2)
        outside = 2.0 * self.approach / math.pi * (np.arcsin(ratio) - profile)
        inside = self.approach - self.coefficient * distance**n
        return -np.where(distance <= a, inside, outside)


def _solve(E_star: float, A: float, n: float, name: str, value: float) -> PowerLawPunch:
    """Return the contact in which the quantity called `name` has the given value."""
    # delta/(A a^n) = sqrt(pi) Gamma(n/2 + 1)/Gamma(n/2 + 1/2) (Sneddon 1965)
    coefficient = A * (math.sqrt(math.pi) * math.exp(math.lgamma(0.5 * n + 1.0) - math.lgamma(0.5 * n + 0.5)))
    force = 2.0 * E_star * coefficient * n / (n + 1.0), n + 1.0
    laws = {"radius": (1.0, 1.0), "approach": (coefficient, n), "force": force}
    return PowerLawPunch(E_star, A, n, **quantities(laws, name, value))


def _modulus(E: float, nu: float) -> float:
    """Return the plane-strain modulus E/(1 - nu^2) [pressure] from checked constants."""
    return positive("E", E) / (1.0 - poisson("nu", nu) ** 2)


def bonded_stiffness_ratio(nu: float) -> float:
    """Return the ratio of the stiffnesses of a bonded and a frictionless flat punch, (1 - nu) ln(3 - 4 nu)/(1 - 2 nu).

    The formula is due to Mossakovskii (1954) and Spence (1968). The ratio is 1 for nu = 0.5.

    Parameters
    ----------
    nu : float
        Poisson's ratio of the half-space [-].

    Examples
    --------
    >>> from fastcontact import analytic
    >>> round(analytic.bonded_stiffness_ratio(0.5), 9)  # friction has no effect on an incompressible half-space
    1.0
    """
    compressibility = 1.0 - 2.0 * poisson("nu", nu)
    if compressibility == 0.0:
        return 1.0
    return 0.5 * (1.0 + compressibility) * math.log1p(2.0 * compressibility) / compressibility


def flat_punch(
    *,
    E: float,
    nu: float,
    radius: float,
    force: float | None = None,
    approach: float | None = None,
    bonded: bool = False,
) -> FlatPunch:
    """Return the contact of a flat rigid cylinder with a half-space, F = 2 E* a delta (Johnson 1985, section 3.4).

    Parameters
    ----------
    E, nu : float
        Young's modulus [pressure] and Poisson's ratio [-] of the half-space.
    radius : float
        Radius a of the punch [length].
    force, approach : float
        Normal force F [force] or indentation delta [length]; give exactly one of them.
    bonded : bool
        If true, the punch adheres to the half-space, which increases the stiffness by the factor `bonded_stiffness_ratio`.

    Returns
    -------
    FlatPunch

    Raises
    ------
    ModelError
        If a number is out of range, or not exactly one of `force` and `approach` is given.

    Examples
    --------
    >>> from fastcontact import analytic
    >>> punch = analytic.flat_punch(E=1000.0, nu=0.3, radius=1.0, force=10.0)
    >>> round(punch.approach, 9)  # F (1 - nu^2) / (2 E a)
    0.00455
    """
    name, value = exactly_one(force=force, approach=approach)
    E_star, a = _modulus(E, nu), positive("radius", radius)
    stiffness = 2.0 * E_star * a * (bonded_stiffness_ratio(nu) if bonded else 1.0)
    if name == "force":
        return FlatPunch(E_star, a, value / stiffness, value, bonded)
    return FlatPunch(E_star, a, value, stiffness * value, bonded)


def power_law_punch(
    *,
    E: float,
    nu: float,
    coefficient: float,
    exponent: float,
    force: float | None = None,
    approach: float | None = None,
    radius: float | None = None,
) -> PowerLawPunch:
    """Return the frictionless contact of a rigid punch of profile A r^n with a half-space (Galin 1946; Sneddon 1965).

    Parameters
    ----------
    E, nu : float
        Young's modulus [pressure] and Poisson's ratio [-] of the half-space.
    coefficient : float
        Coefficient A > 0 of the profile [length^(1 - n)].
    exponent : float
        Exponent n > 0 of the profile [-].
    force, approach, radius : float
        Normal force [force], indentation [length] or contact radius [length]; give exactly one of them.

    Returns
    -------
    PowerLawPunch

    Raises
    ------
    ModelError
        If a number is out of range, or not exactly one of `force`, `approach` and `radius` is given.

    Examples
    --------
    >>> from fastcontact import analytic
    >>> punch = analytic.power_law_punch(E=1000.0, nu=0.3, coefficient=0.01, exponent=4.0, approach=0.1)
    """
    load = exactly_one(force=force, approach=approach, radius=radius)
    return _solve(_modulus(E, nu), positive("coefficient", coefficient), positive("exponent", exponent), *load)


def cone_punch(
    *,
    E: float,
    nu: float,
    slope_angle: float | None = None,
    slope: float | None = None,
    force: float | None = None,
    approach: float | None = None,
    radius: float | None = None,
) -> PowerLawPunch:
    """Return the contact of a rigid cone with a half-space (Love 1939; Sneddon 1965).

    Parameters
    ----------
    E, nu, force, approach, radius : float
        See `power_law_punch`.
    slope_angle : float, optional
        Angle [degrees] between the side of the cone and the surface, greater than 0 and less than 90. The solution is valid
        for small angles.
    slope : float, optional
        Tangent [-] of this angle, which can be given instead of `slope_angle`.

    Returns
    -------
    PowerLawPunch

    Examples
    --------
    >>> from fastcontact import analytic
    >>> cone = analytic.cone_punch(E=1000.0, nu=0.3, slope=0.1, force=10.0)
    """
    name, value = exactly_one(slope_angle=slope_angle, slope=slope)
    if name == "slope_angle" and not 0.0 < value < 90.0:
        raise ModelError(f"slope_angle is {value:g}: it must lie between 0 and 90 degrees")
    load = exactly_one(force=force, approach=approach, radius=radius)
    tangent = math.tan(math.radians(value)) if name == "slope_angle" else value
    return _solve(_modulus(E, nu), tangent, 1.0, *load)


def paraboloid_punch(
    *,
    E: float,
    nu: float,
    R: float,
    force: float | None = None,
    approach: float | None = None,
    radius: float | None = None,
) -> PowerLawPunch:
    """Return the contact of a rigid paraboloid of profile r^2/(2 R) with a half-space, as in Hertz's theory (Sneddon 1965).

    Parameters
    ----------
    E, nu, force, approach, radius : float
        See `power_law_punch`.
    R : float
        Radius of curvature at the tip [length].

    Returns
    -------
    PowerLawPunch

    Examples
    --------
    Hertz's solution for a rigid sphere:

    >>> from fastcontact import analytic
    >>> ball = analytic.paraboloid_punch(E=1000.0, nu=0.3, R=10.0, approach=0.1)
    >>> round(ball.radius, 9)  # sqrt(R * approach)
    1.0
    """
    load = exactly_one(force=force, approach=approach, radius=radius)
    return _solve(_modulus(E, nu), 0.5 / positive("R", R), 2.0, *load)


@dataclass(frozen=True)
class FlatPunch2D:
    """Flat rigid punch on a half-plane in plane strain (Muskhelishvili 1949; Johnson 1985, section 2.8).

    Attributes
    ----------
    nu : float
        Poisson's ratio of the half-plane [-].
    half_width : float
        Half-width a of the punch [length].
    force : float
        Normal force per unit length [force/length].
    bonded : bool
        True if the punch adheres to the half-plane instead of being frictionless.
    """

    nu: float
    half_width: float
    force: float
    bonded: bool

    @property
    def radius(self) -> float:
        """Half-width of the contact, an alias of `half_width` [length]."""
        return self.half_width

    def pressure(self, x: ArrayLike) -> Array:
        """Return the contact pressure (...) [pressure] at positions `x` (...) [length] from the centre of the punch.

        It is infinite at the edges and zero outside (Johnson 1985, eqs 2.64 and 2.69). Under a bonded punch it oscillates
        with increasing frequency towards the edges.
        """
        amplitude, phase = self._polar(x)
        return amplitude * np.cos(phase)

    def shear(self, x: ArrayLike) -> Array:
        """Return the shear traction (...) [pressure] along x on the half-plane at positions `x` (...) [length].

        It is directed outwards, and zero unless the punch is bonded (Johnson 1985, eq. 2.69).
        """
        amplitude, phase = self._polar(x)
        inside = np.abs(array("x", x)) < self.half_width
        return np.where(inside, np.where(inside, amplitude, 0.0) * np.sin(phase), 0.0)

    def _polar(self, x: ArrayLike) -> tuple[Array, Array]:
        """Return the amplitude (...) [pressure] and the phase (...) [radian] of the complex traction, pressure + i shear."""
        position = array("x", x) / self.half_width
        inside = np.abs(position) < 1.0
        t = np.where(inside, position, 0.0)
        kappa = 3.0 - 4.0 * self.nu if self.bonded else 1.0  # Kolosov's constant; 1 makes the phase zero
        factor = 2.0 * (1.0 - self.nu) / math.sqrt(kappa) if self.bonded else 1.0
        edge = np.where(np.abs(position) == 1.0, math.inf, 0.0)
        amplitude = factor * self.force / (math.pi * self.half_width * np.sqrt((1.0 - t) * (1.0 + t)))
        return np.where(inside, amplitude, edge), math.log(kappa) / math.pi * np.arctanh(t)


def flat_punch_2d(*, nu: float, half_width: float, force: float, bonded: bool = False) -> FlatPunch2D:
    """Return the tractions under a flat rigid punch on a half-plane in plane strain.

    The solution does not include the indentation, which in a half-plane depends on distant supports.

    Parameters
    ----------
    nu, half_width, force, bonded
        See `FlatPunch2D`.

    Returns
    -------
    FlatPunch2D

    Examples
    --------
    >>> from fastcontact import analytic
    >>> punch = analytic.flat_punch_2d(nu=0.3, half_width=1.0, force=10.0)
    >>> round(float(punch.pressure(0.0)), 6)  # F / (pi a)
    3.183099
    """
    return FlatPunch2D(poisson("nu", nu), positive("half_width", half_width), positive("force", force), bool(bonded))


def spence_stick_ratio(*, nu: float, friction: float) -> float:
    """Return the ratio c/a of the half-width c of the stick zone under a flat rigid punch to the half-width a of the punch.

    The load increases monotonically, in plane strain. The ratio is the root k = c/a of K(sqrt(1 - k^2))/K(k) = beta/f with
    beta = (1 - 2 nu)/(2 (1 - nu)), the coefficient of friction f, and the complete elliptic integral K of the first kind of
    modulus k (Spence 1973; Johnson 1985, eq. 2.73). The formula neglects the effect of the shear traction on the pressure.
    In boundary-element solutions with this coupling the stick zone is smaller: by 3 % for nu = 0.3 and f = 0.5, by 26 % for
    nu = 0 and f = 0.5, and by more for less friction.

    Parameters
    ----------
    nu, friction : float
        Poisson's ratio of the half-plane, and Coulomb's coefficient of friction f > 0 [-].

    Returns
    -------
    float
        Ratio c/a [-].

    Examples
    --------
    >>> from fastcontact import analytic
    >>> round(analytic.spence_stick_ratio(nu=0.3, friction=0.1), 4)
    0.045
    """
    from scipy.optimize import brentq
    from scipy.special import ellipk, ellipkm1

    ratio = (1.0 - 2.0 * poisson("nu", nu)) / (2.0 * (1.0 - nu)) / positive("friction", friction)
    if ratio == 0.0:
        return 1.0

    # The unknown ln(k/k') with k' = sqrt(1 - k^2) resolves both ends of the interval (0, 1); a change of its sign exchanges
    # the two integrals. SciPy's integrals are functions of m = k^2 or of m1 = k'^2.
    def residual(x: float) -> float:
        m = 1.0 / (1.0 + math.exp(-2.0 * x))
        m1 = 1.0 / (1.0 + math.exp(2.0 * x))
        K = ellipkm1(m1) if m > 0.5 else ellipk(m)
        K_complement = ellipkm1(m) if m1 > 0.5 else ellipk(m1)
        return math.log(K_complement / K) - math.log(ratio)

    if residual(-300.0) < 0.0:
        return 0.0
    if residual(300.0) > 0.0:
        return 1.0
    x = float(brentq(residual, -300.0, 300.0, xtol=1e-14))
    return 1.0 / math.sqrt(1.0 + math.exp(-2.0 * x))
