# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Closest points on facets with straight sides: flat triangles in closed form, bilinear quadrangles by a few Newton steps.

Vectors are tuples of three numbers: Numba would count references to arrays in every call. A point whose reference
coordinates are within ROUND_OFF of a side is taken to lie on this side.
"""

import numpy as np

from fastcontact._jit.decorators import kernel
from fastcontact.round_off import LENGTH_ROUND_OFF, ROUND_OFF


@kernel
def dot(a, b):
    """Return the scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def minus(a, b):
    """Return the difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def cross(a, b):
    """Return the vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def unit(a):
    """Return the vector divided by its length."""
    length = np.sqrt(dot(a, a))
    return a[0] / length, a[1] / length, a[2] / length


@kernel
def plus_multiple(o, a, s):
    """Return the vector ``o + s a``."""
    return o[0] + s * a[0], o[1] + s * a[1], o[2] + s * a[2]


@kernel
def residual(r, a, b, c, s, t):
    """Return the vector from the point (s, t) of the facet ``a s + b t + c s t`` to `r`."""
    return (
        r[0] - s * a[0] - t * b[0] - s * t * c[0],
        r[1] - s * a[1] - t * b[1] - s * t * c[1],
        r[2] - s * a[2] - t * b[2] - s * t * c[2],
    )


@kernel
def on_flat(r, a, b):
    """Return (s, t) of the point ``a s + b t`` of a flat triangle closest to `r`.

    By the Voronoi regions of corners and sides (Ericson, 2005, section 5.1.5).
    """
    d1, d2 = dot(a, r), dot(b, r)
    aa, ab, bb = dot(a, a), dot(a, b), dot(b, b)
    d3, d4, d5, d6 = d1 - aa, d2 - ab, d1 - ab, d2 - bb
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        return 0.0, 0.0
    if d3 >= 0.0 and d4 <= d3:
        return 1.0, 0.0
    if d6 >= 0.0 and d5 <= d6:
        return 0.0, 1.0
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return d1 / (d1 - d3), 0.0
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return 0.0, d2 / (d2 - d6)
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 1.0 - t, t
    square = aa * bb - ab * ab
    if not square > ROUND_OFF * aa * bb:
        return _on_longest_side(r, a, b)
    area = va + vb + vc
    s, t = vb / area, vc / area
    if square < LENGTH_ROUND_OFF * aa * bb:  # one step of iterative refinement, since rounding errors are large here
        v = residual(r, a, b, (0.0, 0.0, 0.0), s, t)
        s, t = s + (bb * dot(a, v) - ab * dot(b, v)) / square, t + (aa * dot(b, v) - ab * dot(a, v)) / square
    if s >= -ROUND_OFF and t >= -ROUND_OFF and s + t <= 1.0 + ROUND_OFF:
        return s, t
    return _on_longest_side(r, a, b)


@kernel
def _on_longest_side(r, a, b):
    """Return (s, t) of the closest point of a triangle that degenerates to its longest side."""
    c = minus(b, a)
    aa, bb, cc = dot(a, a), dot(b, b), dot(c, c)
    if aa >= bb and aa >= cc:
        return min(max(dot(a, r) / aa, 0.0), 1.0), 0.0
    if bb >= cc:
        return 0.0, min(max(dot(b, r) / bb, 0.0), 1.0)
    t = min(max(dot(minus(r, a), c) / cc, 0.0), 1.0)
    return 1.0 - t, t


@kernel
def on_bilinear(r, a, b, c, reach):
    """Return (s, t) of the point ``a s + b t + c s t`` of a bilinear facet closest to `r`, and the squared distance.

    The result is exact where the squared distance has only one minimum on the facet (see `uniqueness_bound`); elsewhere it
    is NaN or a stationary point. The distance is infinite where it clearly exceeds `reach`. Newton's method starts from the
    closest point on the plane of a and b, and uses precomputed products of vectors. If it leaves the facet, the result is
    the closest point of the straight sides.
    """
    aa, ab, bb, ac, bc, cc = dot(a, a), dot(a, b), dot(b, b), dot(a, c), dot(b, c), dot(c, c)
    ar, br, cr = dot(a, r), dot(b, r), dot(c, r)
    determinant = aa * bb - ab * ab
    if not determinant > ROUND_OFF * aa * bb:
        return 0.0, 0.0, np.nan
    s, t = (bb * ar - ab * br) / determinant, (aa * br - ab * ar) / determinant
    if abs(s) > 1.0 or abs(t) > 1.0:
        # In-plane distance to the parallelogram, from which the facet deviates by at most |c|.
        distance = max((abs(s) - 1.0) * np.sqrt(determinant / bb), (abs(t) - 1.0) * np.sqrt(determinant / aa))
        if distance > reach + np.sqrt(cc):
            return s, t, np.inf
    # If the first search leaves the facet, a second one starts inside it, since there may still be a minimum inside.
    for _ in range(2):
        s, t, stationary = _stationary(aa, ab, bb, ac, bc, cc, ar, br, cr, s, t)
        if stationary:
            v = residual(r, a, b, c, s, t)
            return s, t, dot(v, v)
        s, t, square = _on_sides(r, a, b, c, aa, ab, bb, ac, bc, cc, ar, br, cr)
        # The minimum over the sides is the global one if the distance does not decrease into the facet.
        v = residual(r, a, b, c, s, t)
        inward = (abs(s) == 1.0 and s * dot(v, plus_multiple(a, c, t)) < 0.0) or (
            abs(t) == 1.0 and t * dot(v, plus_multiple(b, c, s)) < 0.0
        )
        if not inward:
            return s, t, square
        s, t = 0.9 * s, 0.9 * t
    return s, t, np.nan


@kernel
def _stationary(aa, ab, bb, ac, bc, cc, ar, br, cr, s, t):
    """Return the point that Newton's method reaches from (s, t), and whether it is a stationary point inside the facet.

    The other arguments are scalar products of the vectors of `on_bilinear`.
    """
    for _ in range(8):
        if not (abs(s) < 1.0 - ROUND_OFF and abs(t) < 1.0 - ROUND_OFF):
            return s, t, False
        w = cr - s * ac - t * bc - s * t * cc
        gs = ar - s * aa - t * ab - s * t * ac + t * w
        gt = br - s * ab - t * bb - s * t * bc + s * w
        hss, htt = aa + t * (2.0 * ac + t * cc), bb + s * (2.0 * bc + s * cc)
        hst = ab + s * ac + t * bc + s * t * cc - w
        determinant = hss * htt - hst * hst
        ps, pt = (htt * gs - hst * gt) / determinant, (hss * gt - hst * gs) / determinant
        s, t = s + ps, t + pt
        if max(abs(ps), abs(pt)) < LENGTH_ROUND_OFF:  # steps shrink quadratically: the next one is below round-off
            return s, t, abs(s) < 1.0 - ROUND_OFF and abs(t) < 1.0 - ROUND_OFF
    return s, t, False


@kernel
def _on_sides(r, a, b, c, aa, ab, bb, ac, bc, cc, ar, br, cr):
    """Return the closest point (s, t) on the four straight sides of a bilinear facet, and the squared distance."""
    best, best_s, best_t = np.inf, 0.0, 0.0
    for side in range(4):
        sign = 1.0 if side < 2 else -1.0
        if side % 2 == 0:
            s, t = sign, (br - sign * (ab - cr) - ac) / (bb + sign * 2.0 * bc + cc)
            t = min(max(t, -1.0), 1.0)
        else:
            s, t = (ar - sign * (ab - cr) - bc) / (aa + sign * 2.0 * ac + cc), sign
            s = min(max(s, -1.0), 1.0)
        v = residual(r, a, b, c, s, t)
        square = dot(v, v)
        if square < best:
            best, best_s, best_t = square, s, t
    return best_s, best_t, best


@kernel
def uniqueness_bound(a, b, c):
    """Return the bound on |(r - X) . c| below which a local minimum X of the distance to r is the only one on the facet.

    Let r - X = v, and let another point be X + ds p + dt q, with p the tangent along s at the t of that point and q the
    tangent along t at the s of X. The squared distance changes by ``|ds p + dt q|^2 - 2 v . (ds p + dt q)``. At a minimum
    this is at least ``2 |ds dt| (|p| |q| - |p . q| - |v . c|)``, and ``|p| |q| - |p . q| = |p x q|^2 / (|p| |q| + |p . q|)``.
    The vector product and the scalar product are linear in s and in t, so that their bounds are found at the corners.
    """
    normal = cross(a, b)
    area, product, first, second = np.inf, 0.0, 0.0, 0.0
    for corner in range(4):
        s, t = (1.0 if corner < 2 else -1.0), (1.0 if corner % 2 == 0 else -1.0)
        p, q = plus_multiple(a, c, t), plus_multiple(b, c, s)
        area, product = min(area, dot(cross(p, q), normal)), max(product, abs(dot(p, q)))
        first, second = max(first, dot(p, p)), max(second, dot(q, q))
    if not area > 0.0:
        return 0.0
    return area * area / (dot(normal, normal) * (np.sqrt(first * second) + product))
