"""Press fits: two concentric cylinders or hollow spheres with a radial interference (Lame 1852)."""

from __future__ import annotations

from dataclasses import dataclass, replace

from fastcontact.analytic._bodies import plane_kinematics
from fastcontact.analytic._checks import poisson, positive
from fastcontact.analytic.lame import LameShell


@dataclass(frozen=True)
class PressFit:
    """An inner body pressed into an outer one.

    Radii are nominal: the interference is taken to be small against them.

    Attributes
    ----------
    interference : float
        Radius of the inner body less that of the hole, before fitting [length].
    pressure : float
        Contact pressure [pressure].
    inner, outer : LameShell
        The two bodies, with their displacements and stresses.
    """

    interference: float
    pressure: float
    inner: LameShell
    outer: LameShell

    @property
    def interface_radius(self) -> float:
        """Nominal radius of the contact [length]."""
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
    """Return the frictionless press fit of two concentric cylinders (Lame 1852; Timoshenko 1956, article 41).

    Parameters
    ----------
    E_inner, nu_inner, E_outer, nu_outer : float
        Materials [pressure], [-].
    inner_radius, interface_radius, outer_radius : float
        Radii, increasing; `inner_radius` 0 is a solid shaft [length].
    interference : float
        Radius of the shaft less that of the hole [length].
    kinematics : str
        "plane_strain" or "plane_stress"; the latter also holds for long cylinders with free ends.

    Examples
    --------
    >>> steel = dict(E_inner=210e3, nu_inner=0.3, E_outer=210e3, nu_outer=0.3)
    >>> fit = press_fit_cylinders(**steel, interface_radius=50, outer_radius=100, interference=0.05)
    >>> round(fit.pressure, 4)
    86.5385
    """
    plane_kinematics(kinematics)
    radii = inner_radius, interface_radius, outer_radius
    return _pair((E_inner, nu_inner), (E_outer, nu_outer), radii, interference, kinematics)


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
    """Return the press fit of two concentric hollow spheres (Lame 1852); parameters as for `press_fit_cylinders`."""
    radii = inner_radius, interface_radius, outer_radius
    return _pair((E_inner, nu_inner), (E_outer, nu_outer), radii, interference, "sphere")


def _pair(
    inner: tuple[float, float], outer: tuple[float, float], radii: tuple[float, float, float], interference: float,
    kinematics: str,
) -> PressFit:  # fmt: skip
    """Return the fit of an inner and an outer body, each with its E and nu."""
    for side, (E, nu) in (("inner", inner), ("outer", outer)):
        positive(f"E_{side}", E)
        poisson(f"nu_{side}", nu)
    a, b, c = radii
    positive("interface_radius", b)
    # Under a unit pressure on the interface first.
    shaft, hub = LameShell(a, b, 0.0, 1.0, *inner, kinematics), LameShell(b, c, 1.0, 0.0, *outer, kinematics)
    d = positive("interference", interference)
    pressure = d / float(hub.displacement(b) - shaft.displacement(b))
    return PressFit(d, pressure, replace(shaft, outer_pressure=pressure), replace(hub, inner_pressure=pressure))
