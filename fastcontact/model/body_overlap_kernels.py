# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Winding numbers of closed polygons and of closed surfaces of triangles, which distinguish inside from outside."""

import numpy as np

from fastcontact._jit.decorators import kernel
from fastcontact.contact.search.projection_3d_kernels import vector
from fastcontact.contact.search.straight_3d_kernels import cross, dot, minus


@kernel
def _solid_angle(triangles, k, point):
    """Return half the solid angle of triangle `k` seen from `point` (Van Oosterom and Strackee, 1983, eq. 8)."""
    a, b = minus(vector(triangles, k, 0), point), minus(vector(triangles, k, 1), point)
    c = minus(vector(triangles, k, 2), point)
    aa, bb, cc = np.sqrt(dot(a, a)), np.sqrt(dot(b, b)), np.sqrt(dot(c, c))
    return np.arctan2(dot(a, cross(b, c)), aa * bb * cc + dot(a, b) * cc + dot(b, c) * aa + dot(c, a) * bb)


@kernel
def winding_numbers(points, pieces, winding):
    """Fill `winding` (n,) with the winding number of a closed surface around each of ``points`` (n, dim).

    The winding number is 1 inside and 0 outside. It is the sum of the angles, or solid angles, of the ``pieces``
    (m, dim, dim) of the surface, which are lines or triangles, divided by a full angle. Angles are positive for outward
    normals.
    """
    for i in range(points.shape[0]):
        total = 0.0
        for k in range(pieces.shape[0]):
            if points.shape[1] == 3:
                total += _solid_angle(pieces, k, (points[i, 0], points[i, 1], points[i, 2]))
            else:
                x, y = pieces[k, 0, 0] - points[i, 0], pieces[k, 0, 1] - points[i, 1]
                u, v = pieces[k, 1, 0] - points[i, 0], pieces[k, 1, 1] - points[i, 1]
                total += np.arctan2(x * v - y * u, x * u + y * v)
        winding[i] = total / (2.0 * np.pi)
