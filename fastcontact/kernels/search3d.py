"""Closest facet to a point in 3D: projection on flat and curved facets (narrow phase) through a tree of boxes.

A facet of m nodes is the polynomial of the first m terms of 1, s, t, st, s^2, t^2, s^2 t, s t^2, s^2 t^2 in its
reference coordinates, ``terms`` (n_facets, m, 3): tri3, quad4, tri6, quad8 and quad9 have 3, 4, 6, 8 and 9. Its domain is
a polygon of ``sides`` (n_sides, 3), rows (a, b, c) for a s + b t <= c. The tree is that of `box_tree`.
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


@kernel
def _distance_to_box(x, y, z, low, high, box):
    dx = max(low[box, 0] - x, 0.0, x - high[box, 0])
    dy = max(low[box, 1] - y, 0.0, y - high[box, 1])
    dz = max(low[box, 2] - z, 0.0, z - high[box, 2])
    return dx * dx + dy * dy + dz * dz


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
def _project(terms, corners, f, bend, nodes, triangles, sides, point, reach):
    """Return (s, t) of the point of facet `f` closest to `point`, half the squared distance, and whether it converged.

    The facet strays from the flat `triangles` between its nodes by at most `bend`: the descent starts from the closest
    one, and then from every other that might hide a closer point. The distance is infinite where even a squared
    distance of `reach` is out of reach.
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
def closest_facets(
    points, terms, corners, bend, nodes, triangles, sides, box_low, box_high,
    low, high, child, span, order, facet, xi, normal, overhang, position, status,
):  # fmt: skip
    """Project every point on its closest facet; of facets that meet in the closest point the one with the lowest number.

    Parameters
    ----------
    points : (n, 3)
    terms, corners : (n_facets, m, 3)
        Polynomials and nodes of the facets.
    bend : (n_facets,)
        How far each strays at most from the flat triangles between its nodes.
    nodes : (m, 2), triangles : (n_triangles, 3), sides : (n_sides, 3)
        Reference nodes, the flat triangles between them, sides of the domain.
    box_low, box_high : (n_facets, 3)
        Boxes of the facets.
    low, high, child, span, order
        Tree over them.
    facet : (n,), xi : (n, 2), normal : (n, 3), overhang : (n,), position : (n, 3), status : (n,)
        Filled in place: facet number, reference coordinates, unit normal, how far the point stands out beyond the
        sides of its facet as extended along its tangents, in facet lengths (0 within), projection; CONVERGED,
        NOT_CONVERGED or NOT_FINITE.
    """
    stack = np.empty(128, np.int64)
    span_s = 0.0
    for k in range(nodes.shape[0]):
        span_s = max(span_s, nodes[k, 0] - nodes[0, 0])
    best_facet = 0
    for i in range(points.shape[0]):
        point = points[i]
        x, y, z = point[0], point[1], point[2]
        status[i] = CONVERGED
        if not (np.isfinite(x) and np.isfinite(y) and np.isfinite(z)):
            status[i] = NOT_FINITE
            facet[i] = -1
            continue
        # Neighbours in the list are often neighbours in space: the facet of the last point is a good first guess.
        guess = best_facet
        best, best_facet, reach, same = np.inf, -1, np.inf, 0.0
        best_s, best_t, bx, by, bz = 0.0, 0.0, 0.0, 0.0, 0.0
        stack[0], top = -1, 1  # -1: the guess, which is looked at before the tree
        while top > 0:
            top -= 1
            box = stack[top]
            first, last = 0, 1
            if box >= 0:
                if _distance_to_box(x, y, z, low, high, box) > reach:
                    continue
                if child[box] >= 0:
                    near, far = child[box], child[box] + 1
                    if _distance_to_box(x, y, z, low, high, far) < _distance_to_box(x, y, z, low, high, near):
                        near, far = far, near
                    stack[top], stack[top + 1] = far, near
                    top += 2
                    continue
                first, last = span[box, 0], span[box, 1]
            for k in range(first, last):
                f = order[k] if box >= 0 else guess
                if (box >= 0 and f == guess) or _distance_to_box(x, y, z, box_low, box_high, f) > reach:
                    continue
                s, t, d, converged = _project(terms, corners, f, bend[f], nodes, triangles, sides, point, reach)
                if d == np.inf:
                    continue
                px = _component(terms, f, 0, s, t)[0]
                py = _component(terms, f, 1, s, t)[0]
                pz = _component(terms, f, 2, s, t)[0]
                d = (x - px) ** 2 + (y - py) ** 2 + (z - pz) ** 2
                meet = (px - bx) ** 2 + (py - by) ** 2 + (pz - bz) ** 2 <= same * same
                if (f < best_facet) if (meet or d == best) and best_facet >= 0 else d < best:
                    best_facet, best_s, best_t, bx, by, bz = f, s, t, px, py, pz
                    status[i] = CONVERGED if converged else NOT_CONVERGED
                    same = 0.0
                    for j in range(3):
                        same = max(same, SAME_PLACE * (box_high[f, j] - box_low[f, j]))
                if d < best:
                    best = d
                    reach = (np.sqrt(best) + same) ** 2
            if box < 0:
                stack[0], top = 0, 1
        best_s, best_t = _onto_sides(sides, best_s, best_t)
        facet[i], xi[i, 0], xi[i, 1] = best_facet, best_s, best_t
        position[i, 0], position[i, 1], position[i, 2] = bx, by, bz
        overhang[i] = _frame(terms, best_facet, best_s, best_t, point, sides, span_s, normal[i])
        if not np.isfinite(normal[i, 0]):
            status[i] = NOT_CONVERGED


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
