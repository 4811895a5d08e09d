# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Winding numbers of closed surfaces of triangles."""

import numpy as np

from fastcontact._jit.decorators import kernel


@kernel
def winding_numbers(points, triangles, winding):
    """Fill how often the surface of ``triangles`` (m, 3, 3) winds around each of ``points`` (n, 3): 1 inside, 0 outside.

    The sum of the solid angles (Van Oosterom and Strackee, 1983, eq. 8); outward normals count positive.
    """
    a, b, c = np.empty(3), np.empty(3), np.empty(3)
    for i in range(points.shape[0]):
        total = 0.0
        for k in range(triangles.shape[0]):
            aa, bb, cc, ab, bc, ca = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for d in range(3):
                a[d] = triangles[k, 0, d] - points[i, d]
                b[d] = triangles[k, 1, d] - points[i, d]
                c[d] = triangles[k, 2, d] - points[i, d]
                aa += a[d] * a[d]
                bb += b[d] * b[d]
                cc += c[d] * c[d]
                ab += a[d] * b[d]
                bc += b[d] * c[d]
                ca += c[d] * a[d]
            triple = (
                a[0] * (b[1] * c[2] - b[2] * c[1])
                + a[1] * (b[2] * c[0] - b[0] * c[2])
                + a[2] * (b[0] * c[1] - b[1] * c[0])
            )
            aa, bb, cc = np.sqrt(aa), np.sqrt(bb), np.sqrt(cc)
            total += 2.0 * np.arctan2(triple, aa * bb * cc + ab * cc + bc * aa + ca * bb)
        winding[i] = total / (4.0 * np.pi)
