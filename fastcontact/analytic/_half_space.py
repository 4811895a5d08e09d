"""Elastic half-space under Hertz's axisymmetric pressure: stress and displacement in closed form, and von Mises stress.

The half-space is z <= 0 and carries the pressure p0 sqrt(1 - r^2/a^2) on r <= a. In oblate spheroidal coordinates s >=
0, 0 <= t <= 1 with r^2 = a^2 (1 + s^2)(1 - t^2) and -z = a s t, every quantity is a rational function of s and t and the
Legendre functions of the second kind of i s, without cancellation near the axis or the surface. Huber (1904) gives the
stresses in other coordinates. The displacement follows from Boussinesq's potentials (Johnson 1985, section 3.1).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fastcontact.analytic._inputs import array
from fastcontact.arrays import Array
from fastcontact.errors import ModelError

# Value of s above which series in 1/s replace the closed forms, which cancel as s grows.
_FAR = 4.0


def below_surface(z: ArrayLike, a: float) -> Array:
    """Return the depth -z (...) [length] of points at `z` (...) [length] below the surface z = 0.

    Points that lie above the surface by round-off are moved onto it. Raises ModelError for points farther above it.
    """
    depth = -array("z", z)
    if depth.size and depth.min() < -1e-9 * a:
        raise ModelError(f"a point lies {-depth.min():g} above the surface: the body is z <= 0 (y <= 0 in the plane)")
    return np.maximum(depth, 0.0)


def _spheroidal_coordinates(r: ArrayLike, z: ArrayLike, a: float) -> tuple[Array, Array]:
    """Return the spheroidal coordinates s and t (...) [-]: s - i t is the root of ((r^2 + z^2 - a^2) - 2 i a |z|)/a^2."""
    radial, depth = np.broadcast_arrays(np.abs(array("r", r)) / a, below_surface(z, a) / a)
    root_squared = np.empty(radial.shape, dtype=np.complex128)
    # (r - a)(r + a), unlike r^2 - a^2, does not cancel at the edge of the contact.
    root_squared.real = (radial - 1.0) * (radial + 1.0) + depth**2
    root_squared.imag = 2.0 * depth
    root = np.sqrt(root_squared)
    return root.real, np.minimum(root.imag, 1.0)


def _legendre(s: Array) -> tuple[Array, Array, Array]:
    """Return q0 = acot s, q1 = 1 - s q0 and q2 = ((3 s^2 + 1) q0 - 3 s)/2, where i s is the argument of Q0, Q1 and Q2."""
    q0 = np.arctan2(1.0, s)
    q1 = 1.0 - s * q0
    q2 = 0.5 * ((3.0 * s**2 + 1.0) * q0 - 3.0 * s)
    inverse = 1.0 / np.maximum(s, _FAR)
    series1, series2 = np.zeros_like(inverse), np.zeros_like(inverse)
    for k in range(12, 0, -1):
        series1 = inverse**2 * (1.0 / (2 * k + 1) - series1)
        series2 = inverse**2 * (2.0 * k / ((2 * k + 1) * (2 * k + 3)) - series2)
    far = s > _FAR
    return q0, np.where(far, series1, q1), np.where(far, inverse * series2, q2)


def stress(r: ArrayLike, z: ArrayLike, a: float, p0: float, nu: float) -> Array:
    """Return the stresses (..., 4) rr, zz, hoop, rz [pressure] at `r` (...) [length], `z` (...) [length] (Huber 1904)."""
    s, t = _spheroidal_coordinates(r, z, a)
    _, q1, _ = _legendre(s)
    sum_of_squares = s**2 + t**2
    edge = sum_of_squares == 0.0
    sum_of_squares = np.where(edge, 1.0, sum_of_squares)  # at r = a, z = 0 the numerators below vanish faster
    plane = (1.0 - 2.0 * nu) / 3.0 * (1.0 + t + t**2) / ((1.0 + s**2) * (1.0 + t))
    axial = -(t**3) / sum_of_squares
    radial = plane - axial - t * ((1.0 - nu) / (1.0 + s**2) + (1.0 + nu) * q1)
    hoop = -plane + t * ((1.0 - nu) / (1.0 + s**2) - (1.0 + nu) * q1)
    distance = np.sqrt((1.0 + s**2) * np.maximum(1.0 - t**2, 0.0))
    shear = distance * s * t**2 / (sum_of_squares * (1.0 + s**2))
    return p0 * np.stack([radial, axial, hoop, shear], axis=-1)


def displacement(r: ArrayLike, z: ArrayLike, a: float, p0: float, E: float, nu: float) -> Array:
    """Return the radial and axial displacements (..., 2) [length] at `r` (...) [length], `z` (...) [length].

    The displacements vanish at infinity, and z points out of the body. The radial displacement is r times the hoop strain;
    the axial displacement is (z P - 2 (1 - nu) V)/(2 G) with the potential V of the pressure and P = -dV/d|z|
    (Johnson 1985, eq. 3.2-3.6 without shear tractions).
    """
    radial, height = np.broadcast_arrays(array("r", r), -below_surface(z, a))
    s, t = _spheroidal_coordinates(r, z, a)
    q0, q1, q2 = _legendre(s)
    V = p0 * a / 3.0 * (q0 + 0.5 * q2 * (3.0 * t**2 - 1.0))
    P = p0 * t * q1
    rr, zz, hoop, _ = np.moveaxis(stress(r, z, a, p0, nu), -1, 0)
    u_r = radial * (hoop - nu * (rr + zz)) / E
    u_z = (1.0 + nu) / E * (height * P - 2.0 * (1.0 - nu) * V)
    return np.stack([u_r, u_z], axis=-1)


class VonMisesMaximum(NamedTuple):
    """Maximum von Mises stress below a contact.

    Attributes
    ----------
    value : float
        Von Mises stress [pressure].
    depth : float
        Depth [length] of the maximum below the surface, on the axis.
    """

    value: float
    depth: float


def von_mises(stress: Array) -> Array:
    """Return the von Mises stress (...) [pressure] of `stress` (..., 4) [pressure], xx, yy, zz, xy (von Mises 1913)."""
    xx, yy, zz, xy = np.moveaxis(stress, -1, 0)
    return np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3.0 * xy**2)
