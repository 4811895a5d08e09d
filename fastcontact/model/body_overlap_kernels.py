# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Inside or outside: crossings of a ray with closed curves in the plane, winding numbers of closed surfaces of triangles."""

import numpy as np

from fastcontact._jit.decorators import kernel


@kernel
def _crosses(x, y, ax, ay, bx, by, mx, my, s0, y0, s1, y1):
    """Return whether the ray from (x, y) to the right crosses a parabola between s0 and s1, where its y is monotone.

    The parabola passes through a, m and b at s = -1, 0, 1; y0 and y1 are its ordinates at s0 and s1.
    """
    if (y0 > y) == (y1 > y):
        return False
    ty, cy = 0.5 * (by - ay), ay + by - 2.0 * my
    rise = np.sqrt(max(ty * ty - 2.0 * cy * (my - y), 0.0))
    if y1 < y0:
        rise = -rise
    # The root where y has this slope, in the form that does not cancel.
    s = 2.0 * (y - my) / (ty + rise) if ty * rise > 0.0 else (rise - ty) / cy
    s = min(max(s, s0), s1)
    return mx + 0.5 * s * (bx - ax) + 0.5 * s * s * (ax + bx - 2.0 * mx) > x


@kernel
def count_crossings(points, corners, count):
    """Add to ``count`` (n,) how often a ray to the right from each of ``points`` (n, 2) crosses the facets ``corners``.

    Facets (m, k, 2) are straight (k = 2) or parabolas (k = 3, the middle last). Odd means inside, for closed curves; a
    facet counts its lower end and not its upper one, so that rays through nodes count once. Boxes without the ray's
    height are passed over.
    """
    for f in range(corners.shape[0]):
        ax, ay, bx, by = corners[f, 0, 0], corners[f, 0, 1], corners[f, 1, 0], corners[f, 1, 1]
        curved = corners.shape[1] == 3
        mx, my = (corners[f, 2, 0], corners[f, 2, 1]) if curved else (0.5 * (ax + bx), 0.5 * (ay + by))
        ty, cy = 0.5 * (by - ay), ay + by - 2.0 * my
        top, turn = 1.0, by
        if curved and abs(ty) < abs(cy):  # the curve turns back between its ends
            top = -ty / cy
            turn = my - 0.5 * ty * ty / cy
        low, high = min(ay, by, turn), max(ay, by, turn)
        for i in range(points.shape[0]):
            x, y = points[i, 0], points[i, 1]
            if y < low or y > high:
                continue
            if not curved:
                if (ay > y) != (by > y) and ax + (y - ay) * (bx - ax) / (by - ay) > x:
                    count[i] += 1
                continue
            if _crosses(x, y, ax, ay, bx, by, mx, my, -1.0, ay, top, turn):
                count[i] += 1
            if top < 1.0 and _crosses(x, y, ax, ay, bx, by, mx, my, top, turn, 1.0, by):
                count[i] += 1


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
