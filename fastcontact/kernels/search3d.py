"""Closest facet to a point in 3D: projection on flat and curved facets (narrow phase) through a tree of boxes.

A facet of m nodes is the polynomial of the first m terms of 1, s, t, st, s^2, t^2, s^2 t, s t^2, s^2 t^2 in its
reference coordinates, ``terms`` (n_facets, m, 3): tri3, quad4, tri6, quad8 and quad9 have 3, 4, 6, 8 and 9. Its domain is
a polygon of ``sides`` (n_sides, 3), rows (a, b, c) for a s + b t <= c. The tree is that of `packed_tree`.
"""

import numpy as np

from fastcontact._jit import kernel

# Facets whose closest points lie nearer together than this, in facet sizes, meet there and are equally close.
SAME_PLACE = 1e-9
# Steps in reference coordinates below which a projection has converged, and a point lies on a side of the domain.
STEP = 1e-13
ON_SIDE = 1e-12
MAX_ITERATIONS = 100
CONVERGED, NOT_CONVERGED, NOT_FINITE = 0, 1, 2
# Steps of Newton's method shrink quadratically: after one like this the next would be lost in rounding.
FINAL = 1e-8
# Points in a run, at whose start the last facet is forgotten; and a squared distance beyond all.
RUN, FRONT, SORTED = 32, 64, 96
FAR = 1e300


@kernel
def _distances(boxes, node, x, y, z, out):
    """Fill the squared distances (WIDTH,) from a point to the boxes in a node of a packed tree."""
    for k in range(out.shape[0]):
        dx = max(boxes[node, 0, k] - x, x - boxes[node, 3, k], 0.0)
        dy = max(boxes[node, 1, k] - y, y - boxes[node, 4, k], 0.0)
        dz = max(boxes[node, 2, k] - z, z - boxes[node, 5, k], 0.0)
        out[k] = dx * dx + dy * dy + dz * dz


@kernel
def _component(terms, f, d, s, t):
    """Return one coordinate of facet `f` at (s, t) with its derivatives: value, s, t, ss, st, tt."""
    m = terms.shape[1]
    c1, c2 = terms[f, 1, d], terms[f, 2, d]
    x, xs, xt, xss, xst, xtt = terms[f, 0, d] + c1 * s + c2 * t, c1, c2, 0.0, 0.0, 0.0
    if m >= 4:
        c = terms[f, 3, d]
        x, xs, xt, xst = x + c * s * t, xs + c * t, xt + c * s, c
    if m >= 6:
        c4, c5 = terms[f, 4, d], terms[f, 5, d]
        x, xs, xt = x + c4 * s * s + c5 * t * t, xs + 2.0 * c4 * s, xt + 2.0 * c5 * t
        xss, xtt = 2.0 * c4, 2.0 * c5
    if m >= 8:
        c6, c7 = terms[f, 6, d], terms[f, 7, d]
        x, xs, xt = (
            x + (c6 * s + c7 * t) * s * t,
            xs + (2.0 * c6 * s + c7 * t) * t,
            xt + (c6 * s + 2.0 * c7 * t) * s,
        )
        xss, xst, xtt = xss + 2.0 * c6 * t, xst + 2.0 * (c6 * s + c7 * t), xtt + 2.0 * c7 * s
    if m >= 9:
        c = terms[f, 8, d]
        x, xs, xt = x + c * s * s * t * t, xs + 2.0 * c * s * t * t, xt + 2.0 * c * s * s * t
        xss, xst, xtt = xss + 2.0 * c * t * t, xst + 4.0 * c * s * t, xtt + 2.0 * c * s * s
    return x, xs, xt, xss, xst, xtt


@kernel
def _half_square(terms, f, s, t, point):
    """Return half the squared distance from `point` to the point (s, t) of facet `f`."""
    dx = point[0] - _component(terms, f, 0, s, t)[0]
    dy = point[1] - _component(terms, f, 1, s, t)[0]
    dz = point[2] - _component(terms, f, 2, s, t)[0]
    return 0.5 * (dx * dx + dy * dy + dz * dz)


@kernel
def _expansion(terms, f, s, t, point):
    """Return half the squared distance with its gradient (2) and Hessian (3: ss, st, tt)."""
    value, gs, gt, hss, hst, htt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for d in range(3):
        x, xs, xt, xss, xst, xtt = _component(terms, f, d, s, t)
        r = point[d] - x
        value += 0.5 * r * r
        gs -= r * xs
        gt -= r * xt
        hss += xs * xs - r * xss
        hst += xs * xt - r * xst
        htt += xt * xt - r * xtt
    return value, gs, gt, hss, hst, htt


@kernel
def _on_triangle(corners, f, a, b, c, point):
    """Return the weights of corners b and c of the point of a flat triangle closest to `point`, and its squared distance.

    By the regions of Voronoi around corners and sides (Ericson, 2005, section 5.1.5).
    """
    d1, d2, d3, d4, d5, d6 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for d in range(3):
        ab, ac = corners[f, b, d] - corners[f, a, d], corners[f, c, d] - corners[f, a, d]
        ap, bp, cp = point[d] - corners[f, a, d], point[d] - corners[f, b, d], point[d] - corners[f, c, d]
        d1 += ab * ap
        d2 += ac * ap
        d3 += ab * bp
        d4 += ac * bp
        d5 += ab * cp
        d6 += ac * cp
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        v, w = 0.0, 0.0
    elif d3 >= 0.0 and d4 <= d3:
        v, w = 1.0, 0.0
    elif d6 >= 0.0 and d5 <= d6:
        v, w = 0.0, 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v, w = d1 / (d1 - d3), 0.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        v, w = 0.0, d2 / (d2 - d6)
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        v, w = vb / (va + vb + vc), vc / (va + vb + vc)
    square = 0.0
    for d in range(3):
        x = corners[f, a, d] + v * (corners[f, b, d] - corners[f, a, d]) + w * (corners[f, c, d] - corners[f, a, d])
        square += (point[d] - x) ** 2
    return v, w, square


@kernel
def _allowed(sides, s, t, ps, pt, size):
    """Return whether a step (ps, pt) from (s, t) leaves the domain through none of the sides that (s, t) lies on."""
    for k in range(sides.shape[0]):
        on = sides[k, 2] - sides[k, 0] * s - sides[k, 1] * t <= ON_SIDE
        if on and sides[k, 0] * ps + sides[k, 1] * pt > 1e-14 * size:
            return False
    return True


@kernel
def _definite(hss, hst, htt):
    """Return the Hessian with the absolute values of its eigenvalues, moved a little off zero if it is not definite.

    For two by two, |H| = (H^2 + |det H| I) / sqrt(tr H^2 + 2 |det H|), by the theorem of Cayley and Hamilton.
    """
    square = hss * hss + 2.0 * hst * hst + htt * htt
    determinant = hss * htt - hst * hst
    if hss > 0.0 and determinant > 1e-10 * square:
        return hss, hst, htt
    root = np.sqrt(square + 2.0 * abs(determinant))
    shift = abs(determinant) / root + 1e-6 * root
    return (hss * hss + hst * hst) / root + shift, hst * (hss + htt) / root, (hst * hst + htt * htt) / root + shift


@kernel
def _newton_step(sides, s, t, gs, gt, hss, hst, htt):
    """Return the step to the minimum of the quadratic model over the directions that stay in the domain."""
    ass, ast, att = _definite(hss, hst, htt)
    determinant = ass * att - ast * ast
    ps, pt = -(att * gs - ast * gt) / determinant, -(ass * gt - ast * gs) / determinant
    if _allowed(sides, s, t, ps, pt, abs(ps) + abs(pt)):
        return ps, pt
    ps, pt, gain = 0.0, 0.0, 0.0
    for k in range(sides.shape[0]):
        if sides[k, 2] - sides[k, 0] * s - sides[k, 1] * t > ON_SIDE:
            continue
        us, ut = -sides[k, 1], sides[k, 0]
        slope = gs * us + gt * ut
        along = hss * us * us + 2.0 * hst * us * ut + htt * ut * ut
        along = max(abs(along), 1e-6 * (ass + att))
        if slope * slope / along > gain:
            length = -slope / along
            if _allowed(sides, s, t, length * us, length * ut, abs(length)):
                ps, pt, gain = length * us, length * ut, slope * slope / along
    return ps, pt


@kernel
def _downhill(terms, f, s, t, sides, point, value, hss, hst, htt):
    """Return a step down from a stationary point (s, t) that is no minimum, else zeros.

    Candidates are the direction in which the Hessian is smallest, and those along the sides.
    """
    middle, radius = 0.5 * (hss + htt), np.sqrt(0.25 * (hss - htt) ** 2 + hst * hst)
    if middle - radius >= -1e-9 * (abs(middle) + radius):
        return 0.0, 0.0
    us, ut = (hst, middle - radius - hss) if abs(hst) > 0.0 else (0.0, 1.0)
    if abs(hst) == 0.0 and hss < htt:
        us, ut = 1.0, 0.0
    for k in range(-1, sides.shape[0]):
        if k >= 0:
            us, ut = -sides[k, 1], sides[k, 0]
        length = 0.1 / np.sqrt(us * us + ut * ut)
        for sign in (length, -length):
            ps, pt = sign * us, sign * ut
            if _fits(sides, s + ps, t + pt) and _half_square(terms, f, s + ps, t + pt, point) < value * (1.0 - 1e-12):
                return ps, pt
    return 0.0, 0.0


@kernel
def _fits(sides, s, t):
    """Return whether (s, t) lies in the domain."""
    for k in range(sides.shape[0]):
        if sides[k, 2] - sides[k, 0] * s - sides[k, 1] * t < -ON_SIDE:
            return False
    return True


@kernel
def _descend(terms, f, s, t, sides, point):
    """Return the local minimum (s, t) of the distance from `point` to facet `f`, and whether the iteration converged.

    Newton's method on the squared distance over the polygon of the reference domain: at its sides it goes on along
    them, as an active-set method does, and it never steps uphill.
    """
    for _ in range(MAX_ITERATIONS):
        value, gs, gt, hss, hst, htt = _expansion(terms, f, s, t, point)
        ps, pt = _newton_step(sides, s, t, gs, gt, hss, hst, htt)
        size = max(abs(ps), abs(pt))
        if not size > STEP:
            ps, pt = _downhill(terms, f, s, t, sides, point, value, hss, hst, htt)
            if size <= STEP and (ps != 0.0 or pt != 0.0):
                s, t = s + ps, t + pt
                continue
            return s, t, size <= STEP
        length = 1.0
        for k in range(sides.shape[0]):
            rate = sides[k, 0] * ps + sides[k, 1] * pt
            if rate > 1e-14 * size:
                room = sides[k, 2] - sides[k, 0] * s - sides[k, 1] * t
                length = min(length, max(room, 0.0) / rate)
        if length * size > 1e-6:  # below, the decrease is lost in rounding
            for _ in range(40):
                if _half_square(terms, f, s + length * ps, t + length * pt, point) <= value * (1.0 + 1e-14):
                    break
                length *= 0.5
        s, t = s + length * ps, t + length * pt
    return s, t, False


@kernel
def _on_bilinear(rx, ry, rz, ax, ay, az, bx, by, bz, cx, cy, cz, reach):
    """Return (s, t) of the point ``a s + b t + c s t`` of a bilinear facet closest to r, and the squared distance.

    Right wherever the squared distance has only one minimum on the facet, else NaN or a stationary point. It is infinite
    where the distance clearly exceeds `reach`. Newton's method from the closest point on the plane of a and b, on products of
    vectors formed once; from where that leaves the facet, to the closest point of its straight sides.
    Numbers go in, no arrays: those would be counted as used and unused in every call, which took a third of the time.
    """
    aa, ab, bb = ax * ax + ay * ay + az * az, ax * bx + ay * by + az * bz, bx * bx + by * by + bz * bz
    ac, bc, cc = ax * cx + ay * cy + az * cz, bx * cx + by * cy + bz * cz, cx * cx + cy * cy + cz * cz
    ar, br, cr = ax * rx + ay * ry + az * rz, bx * rx + by * ry + bz * rz, cx * rx + cy * ry + cz * rz
    determinant = aa * bb - ab * ab
    if not determinant > 1e-12 * aa * bb:
        return 0.0, 0.0, np.nan
    s, t = (bb * ar - ab * br) / determinant, (aa * br - ab * ar) / determinant
    # Beyond a parallelogram by so much in its plane, and the facet strays from it by |c| at most.
    beyond = max((abs(s) - 1.0) * np.sqrt(determinant / bb), (abs(t) - 1.0) * np.sqrt(determinant / aa))
    if beyond > reach + np.sqrt(cc):
        return s, t, np.inf
    # The second time from inside, where the first step left the facet for good although the minimum lies in it.
    for _attempt in range(2):
        for _ in range(8):
            if not (abs(s) < 1.0 - ON_SIDE and abs(t) < 1.0 - ON_SIDE):
                break
            w = cr - s * ac - t * bc - s * t * cc
            gs = ar - s * aa - t * ab - s * t * ac + t * w
            gt = br - s * ab - t * bb - s * t * bc + s * w
            hss, htt = aa + t * (2.0 * ac + t * cc), bb + s * (2.0 * bc + s * cc)
            hst = ab + s * ac + t * bc + s * t * cc - w
            determinant = hss * htt - hst * hst
            ps, pt = (htt * gs - hst * gt) / determinant, (hss * gt - hst * gs) / determinant
            s, t = s + ps, t + pt
            if abs(ps) < FINAL and abs(pt) < FINAL:
                if not (abs(s) < 1.0 - ON_SIDE and abs(t) < 1.0 - ON_SIDE):
                    break
                dx, dy, dz = rx - s * ax - t * bx, ry - s * ay - t * by, rz - s * az - t * bz
                return s, t, (dx - s * t * cx) ** 2 + (dy - s * t * cy) ** 2 + (dz - s * t * cz) ** 2
        best, s, t = np.inf, 0.0, 0.0
        for side in range(4):
            sign = 1.0 if side < 2 else -1.0
            if side % 2 == 0:  # along t at s = sign
                along, square = br - sign * (ab - cr) - ac, bb + sign * 2.0 * bc + cc
                place = min(max(along / square, -1.0), 1.0)
                u, v = sign, place
            else:
                along, square = ar - sign * (ab - cr) - bc, aa + sign * 2.0 * ac + cc
                place = min(max(along / square, -1.0), 1.0)
                u, v = place, sign
            dx = rx - u * ax - v * bx - u * v * cx
            dy = ry - u * ay - v * by - u * v * cy
            dz = rz - u * az - v * bz - u * v * cz
            d = dx * dx + dy * dy + dz * dz
            if d < best:
                best, s, t = d, u, v
                gs = dx * (ax + v * cx) + dy * (ay + v * cy) + dz * (az + v * cz)
                gt = dx * (bx + u * cx) + dy * (by + u * cy) + dz * (bz + u * cz)
        # The least on the sides is the least of all where the facet comes no closer further in.
        if not ((abs(s) == 1.0 and s * gs < 0.0) or (abs(t) == 1.0 and t * gt < 0.0)):
            return s, t, best
        s, t = 0.9 * s, 0.9 * t
    return s, t, np.nan


@kernel
def _on_flat(rx, ry, rz, ax, ay, az, bx, by, bz):
    """Return (s, t) of the point ``a s + b t`` closest to r of a flat triangle, as `_on_triangle` does."""
    d1, d2 = ax * rx + ay * ry + az * rz, bx * rx + by * ry + bz * rz
    aa, ab, bb = ax * ax + ay * ay + az * az, ax * bx + ay * by + az * bz, bx * bx + by * by + bz * bz
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
    area = va + vb + vc
    return vb / area, vc / area


@kernel
def _above(rx, ry, rz, ax, ay, az, bx, by, bz, cx, cy, cz, triangle):
    """Return the squared distance to some point of a facet, often the closest; arguments as those of `_inside`."""
    aa, ab, bb = ax * ax + ay * ay + az * az, ax * bx + ay * by + az * bz, bx * bx + by * by + bz * bz
    ar, br = ax * rx + ay * ry + az * rz, bx * rx + by * ry + bz * rz
    determinant = aa * bb - ab * ab
    s, t = 0.0, 0.0
    if determinant > 1e-12 * aa * bb:
        s, t = (bb * ar - ab * br) / determinant, (aa * br - ab * ar) / determinant
    if triangle:
        s, t = max(s, 0.0), max(t, 0.0)
        s, t = s / max(s + t, 1.0), t / max(s + t, 1.0)
    else:
        s, t = min(max(s, -1.0), 1.0), min(max(t, -1.0), 1.0)
    return (
        (rx - s * ax - t * bx - s * t * cx) ** 2
        + (ry - s * ay - t * by - s * t * cy) ** 2
        + (rz - s * az - t * bz - s * t * cz) ** 2
    )


@kernel
def _project(terms, corners, f, bend, convex, nodes, triangles, sides, point, reach):
    """Return (s, t) of the point of facet `f` closest to `point`, half the squared distance, and whether it converged.

    Where the distance is below `convex`, a minimum is the only one. Else the facet strays from the flat `triangles` between
    its nodes by at most `bend`: the descent starts from the closest one, and then from every other that might hide a closer
    point. The distance is infinite where even a squared distance of `reach` is out of reach.
    """
    s, t, best = 0.0, 0.0, np.inf
    for k in range(triangles.shape[0]):
        v, w, square = _on_triangle(corners, f, triangles[k, 0], triangles[k, 1], triangles[k, 2], point)
        if square < best:
            best = square
            s, t = _place(nodes, triangles, k, v, w)
    if terms.shape[1] == 3:
        return s, t, 0.5 * best, True
    if max(np.sqrt(best) - bend, 0.0) ** 2 > reach:
        return s, t, np.inf, True
    tried_s, tried_t = s, t
    s, t, converged = _descend(terms, f, s, t, sides, point)
    best = _half_square(terms, f, s, t, point)
    if converged and terms.shape[1] > 4 and 2.0 * best < convex:
        return s, t, best, True
    for k in range(triangles.shape[0] if bend > 0.0 else 0):
        v, w, square = _on_triangle(corners, f, triangles[k, 0], triangles[k, 1], triangles[k, 2], point)
        if square > (np.sqrt(2.0 * best) + bend) ** 2:
            continue
        a, b = _place(nodes, triangles, k, v, w)
        if abs(a - tried_s) + abs(b - tried_t) < 1e-3:
            continue
        a, b, good = _descend(terms, f, a, b, sides, point)
        value = _half_square(terms, f, a, b, point)
        if value < best:
            s, t, best, converged = a, b, value, good
    size = 0.0
    for d in range(3):
        size += (corners[f, 1, d] - corners[f, 0, d]) ** 2
    # Near the centres of curvature the distance has several minima on one triangle: start from every node too.
    for k in range(nodes.shape[0] if np.sqrt(2.0 * best) * 16.0 * bend > size else 0):
        a, b, good = _descend(terms, f, nodes[k, 0], nodes[k, 1], sides, point)
        value = _half_square(terms, f, a, b, point)
        if value < best:
            s, t, best, converged = a, b, value, good
    return s, t, best, converged


@kernel
def _place(nodes, triangles, k, v, w):
    """Return the reference coordinates of the point of triangle `k` with the weights v and w of its last corners."""
    a, b, c = triangles[k, 0], triangles[k, 1], triangles[k, 2]
    u = 1.0 - v - w
    return u * nodes[a, 0] + v * nodes[b, 0] + w * nodes[c, 0], u * nodes[a, 1] + v * nodes[b, 1] + w * nodes[c, 1]


@kernel
def _onto_sides(sides, s, t):
    """Return (s, t) moved exactly onto the sides that it lies on but for rounding."""
    for k in range(sides.shape[0]):
        room = sides[k, 2] - sides[k, 0] * s - sides[k, 1] * t
        if room <= ON_SIDE:
            # Of a + b <= c the first coordinate is solved for: it comes out as exact as the other.
            if sides[k, 0] != 0.0:
                s = (sides[k, 2] - sides[k, 1] * t) / sides[k, 0]
            else:
                t = sides[k, 2] / sides[k, 1]
    return s, t


@kernel
def bounds(corners):
    """Return the corners (3,) of the box around all nodes (n_facets, m, 3)."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for f in range(corners.shape[0]):
        for a in range(corners.shape[1]):
            for d in range(3):
                low[d], high[d] = min(low[d], corners[f, a, d]), max(high[d], corners[f, a, d])
    return low, high


@kernel
def _room(ax, ay, az, bx, by, bz, cx, cy, cz):
    """Return how large |(r - X) . c| may be for a local minimum X of the distance to r to be the only one on the facet.

    From X, with r - X = v, to another point X + ds p + dt q, where p and q are the tangents along s and t at the other and at
    this t and s, the squared distance changes by ``|ds p + dt q|^2 - 2 v . (ds p + dt q)``. At a minimum that is at least
    ``2 |ds dt| (|p| |q| - |p . q| - |v . c|)``, and ``|p| |q| - |p . q| = |p x q|^2 / (|p| |q| + |p . q|)``.
    """
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    size = np.sqrt(nx * nx + ny * ny + nz * nz)
    area, product, first, second = np.inf, 0.0, 0.0, 0.0
    for corner in range(4):
        s, t = (1.0 if corner < 2 else -1.0), (1.0 if corner % 2 == 0 else -1.0)
        px, py, pz = ax + t * cx, ay + t * cy, az + t * cz
        qx, qy, qz = bx + s * cx, by + s * cy, bz + s * cz
        along = (py * qz - pz * qy) * nx + (pz * qx - px * qz) * ny + (px * qy - py * qx) * nz
        area, product = min(area, along), max(product, abs(px * qx + py * qy + pz * qz))
        first, second = max(first, px * px + py * py + pz * pz), max(second, qx * qx + qy * qy + qz * qz)
    if not area > 0.0:
        return 0.0
    return (area / size) ** 2 / (np.sqrt(first * second) + product)


@kernel
def prepare(corners, order, begin, end, midst, to_terms, to_hull, weights, terms, nodes, low, high, bend, convex):
    """Fill what the search wants to know of the facets ``order[begin:end]``, in that order.

    Parameters
    ----------
    corners : (n_facets, m, 3), order : (n_facets,)
        Nodes of the facets, and the order to put them in.
    midst : (3,)
        New origin: far from it, rounding would be coarser than the steps of a converged projection.
    to_terms : (m, m), to_hull : (k, m)
        From nodes to terms, and to points whose convex hull holds the facet.
    weights : (3, m)
        For each term of unit size: how far it strays from flat triangles, how much it changes the tangents over the
        domain, and its second derivative, all at most.
    terms, nodes : (n_facets, m, 3), low, high : (n_facets, 3), bend, convex : (n_facets,)
        Filled in place: polynomials, nodes, boxes, how far each facet strays at most from the flat triangles between its
        nodes, and the distance below which the squared distance to a point is a convex function on the domain.
    """
    m = corners.shape[1]
    for i in range(begin, end):
        f = order[i]
        for a in range(m):
            for d in range(3):
                nodes[i, a, d] = corners[f, a, d] - midst[d]
        for d in range(3):
            if m == 3:
                p, q, r = nodes[i, 0, d], nodes[i, 1, d], nodes[i, 2, d]
                terms[i, 0, d], terms[i, 1, d], terms[i, 2, d] = p, q - p, r - p
                low[i, d], high[i, d] = min(p, q, r), max(p, q, r)
            elif m == 4:
                p, q, r, s = nodes[i, 0, d], nodes[i, 1, d], nodes[i, 2, d], nodes[i, 3, d]
                terms[i, 0, d], terms[i, 1, d] = 0.25 * ((p + r) + (q + s)), 0.25 * ((q - p) + (r - s))
                terms[i, 2, d], terms[i, 3, d] = 0.25 * ((r - q) + (s - p)), 0.25 * ((p - q) + (r - s))
                low[i, d], high[i, d] = min(p, q, r, s), max(p, q, r, s)
            else:
                for k in range(m):
                    terms[i, k, d] = 0.0
                    for a in range(m):
                        terms[i, k, d] += to_terms[k, a] * nodes[i, a, d]
                low[i, d], high[i, d] = np.inf, -np.inf
                for k in range(to_hull.shape[0]):
                    value = 0.0
                    for a in range(m):
                        value += to_hull[k, a] * nodes[i, a, d]
                    low[i, d], high[i, d] = min(low[i, d], value), max(high[i, d], value)
        bend[i], convex[i] = 0.0, np.inf
        if m == 3:
            continue
        size, diagonal, ss, st, tt, stray, turn, second = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for d in range(3):
            extent = high[i, d] - low[i, d]
            size, diagonal = max(size, extent), diagonal + extent * extent
            s, t = terms[i, 1, d], terms[i, 2, d]
            ss, st, tt = ss + s * s, st + s * t, tt + t * t
        for k in range(3, m):
            length = np.sqrt(terms[i, k, 0] ** 2 + terms[i, k, 1] ** 2 + terms[i, k, 2] ** 2)
            stray += length * weights[0, k]
            turn += length * weights[1, k]
            second += length * weights[2, k]
        bend[i] = stray if stray >= 1e-9 * size else 0.0
        if m == 4:
            convex[i] = _room(terms[i, 1, 0], terms[i, 1, 1], terms[i, 1, 2], terms[i, 2, 0], terms[i, 2, 1],
                              terms[i, 2, 2], terms[i, 3, 0], terms[i, 3, 1], terms[i, 3, 2])  # fmt: skip
            continue
        # The Hessian of half the squared distance r^2 / 2 is J^T J - r . X'' with the tangents J: positive definite where the
        # smallest singular value of J, squared, exceeds r |X''|, with r the distance to the farthest point of the facet.
        least = np.sqrt(max(0.5 * (ss + tt) - np.sqrt(0.25 * (ss - tt) ** 2 + st * st), 0.0)) - turn
        if second > 0.0 or not least > 0.0:
            room = max(least, 0.0) ** 2 / second - np.sqrt(diagonal)
            convex[i] = room * room if room > 0.0 else 0.0


@kernel
def closest_facets(
    points, points_order, begin, end, midst, terms, corners, bend, convex, nodes, triangles, sides,
    boxes, first, order, facet, xi, normal, overhang, position, distance, status,
):  # fmt: skip
    """Project points on their closest facets; of facets that meet in the closest point the one with the lowest number.

    Parameters
    ----------
    points : (n, 3), points_order : (n,)
        Points, and the order to go through them, along a curve: the facet of the last one is near the next.
    begin, end : int
        Which of that order; multiples of `RUN` make results independent of how the work is shared.
    midst : (3,)
        Origin of the facets.
    terms, corners : (n_facets, m, 3), bend, convex : (n_facets,)
        Facets in the order of the tree, see `prepare`.
    nodes : (m, 2), triangles : (n_triangles, 3), sides : (n_sides, 3)
        Reference nodes, the flat triangles between them, sides of the domain.
    boxes, first
        Tree over the facets, see `packed_tree`.
    order : (n_facets,)
        Numbers of the facets.
    facet : (n,), xi : (n, 2), normal, position : (n, 3), overhang, distance : (n,), status : (n,)
        Filled in place: facet number, reference coordinates, unit normal, projection, how far the point stands out
        beyond the sides of its facet as extended along its tangents, in facet lengths (0 within), distance; CONVERGED,
        NOT_CONVERGED or NOT_FINITE.
    """
    width, root, m, n = boxes.shape[2], boxes.shape[0] - 1, terms.shape[1], points.shape[0]
    n_leaves = (order.shape[0] + width - 1) // width
    stack, bound = np.empty(20 * width + SORTED, np.int64), np.empty(20 * width + SORTED)
    away = np.empty(width)
    front, front_boxes, front_away = np.empty(FRONT, np.int64), np.empty((6, FRONT)), np.empty(FRONT)
    point, unit = np.empty(3), np.empty(3)
    span = 0.0
    for k in range(nodes.shape[0]):
        span = max(span, nodes[k, 0] - nodes[0, 0])
    slack = 0.0
    for d in range(3):
        slack = max(slack, SAME_PLACE * (boxes[root, 3 + d].max() - boxes[root, d].min()))
    for run in range(begin, end, RUN):
        run_end = min(run + RUN, n)
        middle, last, count = (run + run_end) // 2, -1, 0
        for slot in range(run_end - run):
            number = middle if slot == 0 else run + slot - 1 if run + slot <= middle else run + slot
            i = points_order[number]
            x, y, z = points[i, 0] - midst[0], points[i, 1] - midst[1], points[i, 2] - midst[2]
            status[i], facet[i] = NOT_FINITE, -1
            if not (np.isfinite(x) and np.isfinite(y) and np.isfinite(z)):
                continue
            best, found, reach, same, state, within = np.inf, -1, FAR, 0.0, CONVERGED, False
            best_s, best_t, bx, by, bz = 0.0, 0.0, 0.0, 0.0, 0.0
            if last >= 0 and m <= 4:
                # No farther than this point of the last facet.
                rx, ry, rz = x - terms[last, 0, 0], y - terms[last, 0, 1], z - terms[last, 0, 2]
                ux, uy, uz = terms[last, 1, 0], terms[last, 1, 1], terms[last, 1, 2]
                vx, vy, vz = terms[last, 2, 0], terms[last, 2, 1], terms[last, 2, 2]
                wx, wy, wz = 0.0, 0.0, 0.0
                if m == 4:
                    wx, wy, wz = terms[last, 3, 0], terms[last, 3, 1], terms[last, 3, 2]
                reach = (np.sqrt(_above(rx, ry, rz, ux, uy, uz, vx, vy, vz, wx, wy, wz, m == 3)) + slack) ** 2
            elif last >= 0:
                reach = 1.1 * (
                    (x - corners[last, 0, 0]) ** 2 + (y - corners[last, 0, 1]) ** 2 + (z - corners[last, 0, 2]) ** 2
                )
            stack[0], bound[0], top = root, 0.0, 1
            if count > 0:
                top = 0
                for k in range(count):
                    dx = max(front_boxes[0, k] - x, x - front_boxes[3, k], 0.0)
                    dy = max(front_boxes[1, k] - y, y - front_boxes[4, k], 0.0)
                    dz = max(front_boxes[2, k] - z, z - front_boxes[5, k], 0.0)
                    front_away[k] = dx * dx + dy * dy + dz * dz
                for k in range(count):
                    if front_away[k] <= reach:
                        at = top
                        while at > 0 and bound[at - 1] < front_away[k]:
                            stack[at], bound[at] = stack[at - 1], bound[at - 1]
                            at -= 1
                        stack[at], bound[at] = front[k], front_away[k]
                        top += 1
            while top > 0:
                top -= 1
                node = stack[top]
                if bound[top] > reach:
                    continue
                if node < 0:
                    f = -1 - node
                    simple = False
                    if m <= 4:
                        rx, ry, rz = x - terms[f, 0, 0], y - terms[f, 0, 1], z - terms[f, 0, 2]
                        ux, uy, uz = terms[f, 1, 0], terms[f, 1, 1], terms[f, 1, 2]
                        vx, vy, vz = terms[f, 2, 0], terms[f, 2, 1], terms[f, 2, 2]
                        if m == 3:
                            s, t = _on_flat(rx, ry, rz, ux, uy, uz, vx, vy, vz)
                            px = terms[f, 0, 0] + s * ux + t * vx
                            py = terms[f, 0, 1] + s * uy + t * vy
                            pz = terms[f, 0, 2] + s * uz + t * vz
                            simple = True
                        else:
                            wx, wy, wz = terms[f, 3, 0], terms[f, 3, 1], terms[f, 3, 2]
                            s, t, d = _on_bilinear(rx, ry, rz, ux, uy, uz, vx, vy, vz, wx, wy, wz, np.sqrt(reach))
                            if d == np.inf:
                                continue
                            px = terms[f, 0, 0] + s * ux + t * vx + s * t * wx
                            py = terms[f, 0, 1] + s * uy + t * vy + s * t * wy
                            pz = terms[f, 0, 2] + s * uz + t * vz + s * t * wz
                            simple = abs((x - px) * wx + (y - py) * wy + (z - pz) * wz) < convex[f] and d >= 0.0
                        d = (x - px) ** 2 + (y - py) ** 2 + (z - pz) ** 2
                        converged = True
                    if not simple:
                        point[0], point[1], point[2] = x, y, z
                        s, t, d, converged = _project(
                            terms, corners, f, bend[f], convex[f], nodes, triangles, sides, point, reach
                        )
                        if d == np.inf:
                            continue
                        px = _component(terms, f, 0, s, t)[0]
                        py = _component(terms, f, 1, s, t)[0]
                        pz = _component(terms, f, 2, s, t)[0]
                        d = (x - px) ** 2 + (y - py) ** 2 + (z - pz) ** 2
                    meet = (px - bx) ** 2 + (py - by) ** 2 + (pz - bz) ** 2 <= same * same
                    if (order[f] < order[found]) if found >= 0 and (meet or d == best) else d < best:
                        found, best_s, best_t, bx, by, bz = f, s, t, px, py, pz
                        if m == 3:
                            within = s > ON_SIDE and t > ON_SIDE and 1.0 - s - t > ON_SIDE
                        else:
                            within = simple and abs(s) < 1.0 and abs(t) < 1.0
                        state = CONVERGED if converged else NOT_CONVERGED
                        same = 0.0
                        for j in range(3):
                            same = max(same, boxes[f // width, 3 + j, f % width] - boxes[f // width, j, f % width])
                        same *= SAME_PLACE
                    if d < best:
                        best = d
                        reach = (np.sqrt(best) + same) ** 2
                    continue
                for k in range(width):
                    dx = max(boxes[node, 0, k] - x, x - boxes[node, 3, k], 0.0)
                    dy = max(boxes[node, 1, k] - y, y - boxes[node, 4, k], 0.0)
                    dz = max(boxes[node, 2, k] - z, z - boxes[node, 5, k], 0.0)
                    away[k] = dx * dx + dy * dy + dz * dz
                if node < n_leaves:
                    # Facets have numbers below zero.
                    child, sign = -1 - first[node], -1
                else:
                    child, sign = first[node], 1
                # The list stays sorted, with the nearest box on top; a long one no more, lest that take longest.
                bottom = 0 if top < SORTED else top
                for k in range(width):
                    if away[k] <= reach:
                        at = top
                        while at > bottom and bound[at - 1] < away[k]:
                            stack[at], bound[at] = stack[at - 1], bound[at - 1]
                            at -= 1
                        stack[at], bound[at] = child + sign * k, away[k]
                        top += 1
                continue
            last = found
            if found < 0:
                continue
            if slot == 0:
                farthest = 0.0
                for other in range(run, run_end):
                    j = points_order[other]
                    square = 0.0
                    for d in range(3):
                        square += (points[j, d] - points[i, d]) ** 2
                    farthest = max(farthest, square)
                # Nothing that any point of the run may be closest to lies farther from this one.
                radius = (np.sqrt(best) + 2.0 * np.sqrt(farthest) + same) * (1.0 + 1e-9)
                count = _front(boxes, first, order.shape[0], x, y, z, radius * radius, stack, front, front_boxes, away)
            if within:
                ux, uy, uz = terms[found, 1, 0], terms[found, 1, 1], terms[found, 1, 2]
                vx, vy, vz = terms[found, 2, 0], terms[found, 2, 1], terms[found, 2, 2]
                if m == 4:
                    wx, wy, wz = terms[found, 3, 0], terms[found, 3, 1], terms[found, 3, 2]
                    ux, uy, uz = ux + best_t * wx, uy + best_t * wy, uz + best_t * wz
                    vx, vy, vz = vx + best_s * wx, vy + best_s * wy, vz + best_s * wz
                nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
                size = np.sqrt(nx * nx + ny * ny + nz * nz)
                normal[i, 0], normal[i, 1], normal[i, 2], overhang[i] = nx / size, ny / size, nz / size, 0.0
            else:
                point[0], point[1], point[2] = x, y, z
                best_s, best_t = _onto_sides(sides, best_s, best_t)
                overhang[i] = _frame(terms, found, best_s, best_t, point, sides, span, unit)
                normal[i, 0], normal[i, 1], normal[i, 2] = unit[0], unit[1], unit[2]
                if not np.isfinite(unit[0]):
                    state = NOT_CONVERGED
            facet[i], xi[i, 0], xi[i, 1], status[i] = order[found], best_s, best_t, state
            position[i, 0], position[i, 1], position[i, 2] = bx + midst[0], by + midst[1], bz + midst[2]
            distance[i] = np.sqrt((x - bx) ** 2 + (y - by) ** 2 + (z - bz) ** 2)


@kernel
def _front(boxes, first, n, x, y, z, square, stack, front, front_boxes, away):
    """Fill `front` with the nodes above the leaves within a squared distance of a point, with their boxes (6, FRONT).

    Returns their number, or 0 where there are more than have room, or no such nodes.
    """
    width, root = boxes.shape[2], boxes.shape[0] - 1
    n_leaves = (n + width - 1) // width
    upper = n_leaves + (n_leaves + width - 1) // width  # nodes from here on are above those above the leaves
    if root < upper:
        return 0
    stack[0], top, count = root, 1, 0
    while top > 0:
        top -= 1
        node = stack[top]
        _distances(boxes, node, x, y, z, away)
        for k in range(width):
            if not away[k] <= square:
                continue
            child = first[node] + k
            if child >= upper:
                stack[top] = child
                top += 1
                continue
            if count == front.shape[0]:
                return 0
            front[count] = child
            for d in range(6):
                front_boxes[d, count] = boxes[node, d, k]
            count += 1
    return count


@kernel
def _frame(terms, f, s, t, point, sides, span, normal):
    """Fill the unit normal of facet `f` at (s, t) and return the overhang of `point` beyond the domain's sides.

    The point's reference coordinates on the plane tangent to the facet tell how far it lies outside, in spans of the
    domain.
    """
    x, xs, xt, _, _, _ = _component(terms, f, 0, s, t)
    y, ys, yt, _, _, _ = _component(terms, f, 1, s, t)
    z, zs, zt, _, _, _ = _component(terms, f, 2, s, t)
    nx, ny, nz = ys * zt - zs * yt, zs * xt - xs * zt, xs * yt - ys * xt
    area = np.sqrt(nx * nx + ny * ny + nz * nz)
    normal[0], normal[1], normal[2] = nx / area, ny / area, nz / area
    rx, ry, rz = point[0] - x, point[1] - y, point[2] - z
    gs, gt = rx * xs + ry * ys + rz * zs, rx * xt + ry * yt + rz * zt
    jss, jst, jtt = xs * xs + ys * ys + zs * zs, xs * xt + ys * yt + zs * zt, xt * xt + yt * yt + zt * zt
    determinant = jss * jtt - jst * jst
    ds, dt = (jtt * gs - jst * gt) / determinant, (jss * gt - jst * gs) / determinant
    overhang = 0.0
    for k in range(sides.shape[0]):
        a, b = sides[k, 0], sides[k, 1]
        if sides[k, 2] - a * s - b * t <= ON_SIDE:
            overhang = max(overhang, (a * ds + b * dt) / span)
    return overhang
