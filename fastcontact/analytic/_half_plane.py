"""Elastic half-plane under Hertz's pressure: closed-form stress and displacement.

The half-plane is y <= 0 and carries the pressure p0 sqrt(1 - x^2/b^2) on |x| <= b. With k = |y| + i x and the root w =
sqrt(b^2 + k^2), Re w >= 0, the harmonic function that equals the pressure on the surface is p0/b Re(w - k) (McEwen
1949; Johnson 1985, eq. 4.49). Displacements are relative to the point (0, 0), since the displacement of a half-plane is
unbounded at infinity. The displacements in plane stress are obtained by replacing nu by nu/(1 + nu), with the same
shear modulus.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastcontact.analytic._half_space import below_surface
from fastcontact.analytic._inputs import array
from fastcontact.arrays import Array

ComplexArray = NDArray[np.complex128]


def _roots(x: ArrayLike, y: ArrayLike, b: float) -> tuple[Array, ComplexArray, ComplexArray, ComplexArray]:
    """Return the depth, k, w and q = w - k (...) [-], each divided by b."""
    lateral, depth = np.broadcast_arrays(array("x", x) / b, below_surface(y, b) / b)
    k = depth + 1j * lateral
    w_squared = np.empty(k.shape, dtype=np.complex128)
    w_squared.real = (1.0 - lateral) * (1.0 + lateral) + depth**2
    w_squared.imag = 2.0 * lateral * depth
    w = np.sqrt(w_squared)
    w = w.real + 1j * np.copysign(w.imag, lateral)  # on the surface outside the contact, Im w has the sign of x
    return depth, k, w, 1.0 / (w + k)  # (w - k)(w + k) = b^2; the difference w - k cancels far from the contact


def stress(x: ArrayLike, y: ArrayLike, b: float, p0: float, nu: float, kinematics: str) -> Array:
    """Return the stresses (..., 4) xx, yy, zz, xy [pressure] at `x` (...) [length], `y` (...) [length] (McEwen 1949)."""
    depth, _, w, q = _roots(x, y, b)
    # Depth times -dq/dk; w vanishes only on the surface, at the edges of the contact.
    gradient = depth * q / np.where(depth > 0.0, w, 1.0)
    xx, yy = -(q - gradient).real, -(q + gradient).real
    zz = nu * (xx + yy) if kinematics == "plane_strain" else np.zeros_like(xx)
    return p0 * np.stack([xx, yy, zz, -gradient.imag], axis=-1)


def displacement(x: ArrayLike, y: ArrayLike, b: float, p0: float, E: float, nu: float, kinematics: str) -> Array:
    """Return the displacements (..., 2) [length] at `x` (...) [length], `y` (...) [length], relative to the point (0, 0).

    With the integral H of w - k over k, 2 G u_x = (p0/b) [y Im(w - k) - (1 - 2 nu) Im H] and
    2 G u_y = (p0/b) [y Re(w - k) + 2 (1 - nu) Re H].
    """
    depth, k, w, q = _roots(x, y, b)
    H = 0.5 * (k * q + np.log(k + w))
    nu_plane = nu if kinematics == "plane_strain" else nu / (1.0 + nu)
    u_x = -depth * q.imag - (1.0 - 2.0 * nu_plane) * H.imag
    u_y = -depth * q.real + 2.0 * (1.0 - nu_plane) * H.real
    return p0 * b * (1.0 + nu) / E * np.stack([u_x, u_y], axis=-1)
