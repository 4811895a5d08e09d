# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Closest point of a flat or curved facet in 3D, by minimisation of the distance from several starting points.

A facet is a polynomial with the ``coefficients`` (n_facets, m, 3) of the terms in `facet_tables`. Its domain is a polygon
with the ``sides`` (n_sides, 3), rows (a, b, c) for a s + b t <= c.
"""

from typing import NamedTuple

import numpy as np

from fastcontact._jit.decorators import inlined_kernel, kernel
from fastcontact.arrays import Array, Indices
from fastcontact.contact.search.limits import MAX_ITERATIONS, ROUND_OFF_STEP, STEP
from fastcontact.contact.search.straight_3d_kernels import cross, dot, minus, on_flat, residual, unit
from fastcontact.round_off import ROUND_OFF


class Facets(NamedTuple):
    """Facets of one element type. Polynomials are relative to `centre`: round-off far from the origin would exceed STEP.

    Up to `convexity_bound`, a local minimum of the distance is unique on the facet. With four nodes, the bound is
    `straight_3d_kernels.uniqueness_bound`. With more nodes, it is a squared distance from the facet.
    """

    nodes: Array  # (n_facets, m, 3), relative to the origin [length]
    centre: Array  # (3,): centre of all nodes [length]
    coefficients: Array  # (n_facets, m, 3): coefficients of the polynomials [length]
    deviation: Array  # (n_facets,): bound on a facet's deviation from the flat triangles between its nodes [length]
    convexity_bound: Array  # (n_facets,) [length^2]


class Domain(NamedTuple):
    """Reference nodes (m, 2), flat triangles between them (n_triangles, 3), and sides (n_sides, 3) of one element type."""

    nodes: Array
    triangles: Indices
    sides: Array


@inlined_kernel
def vector(vectors, f, k):
    """Return vector `k` of facet `f` in `vectors` (n_facets, m, 3) as a tuple."""
    return vectors[f, k, 0], vectors[f, k, 1], vectors[f, k, 2]


@inlined_kernel
def node(facets, f, k):
    """Return node `k` of facet `f`, relative to the centre."""
    return minus(vector(facets.nodes, f, k), (facets.centre[0], facets.centre[1], facets.centre[2]))


@kernel
def component(coefficients, f, d, s, t):
    """Return coordinate `d` of facet `f` at (s, t), and its derivatives with respect to s, t, ss, st and tt."""
    m = coefficients.shape[1]
    c1, c2 = coefficients[f, 1, d], coefficients[f, 2, d]
    x, xs, xt, xss, xst, xtt = coefficients[f, 0, d] + c1 * s + c2 * t, c1, c2, 0.0, 0.0, 0.0
    if m >= 4:
        c = coefficients[f, 3, d]
        x, xs, xt, xst = x + c * s * t, xs + c * t, xt + c * s, c
    if m >= 6:
        c4, c5 = coefficients[f, 4, d], coefficients[f, 5, d]
        x, xs, xt = x + c4 * s * s + c5 * t * t, xs + 2.0 * c4 * s, xt + 2.0 * c5 * t
        xss, xtt = 2.0 * c4, 2.0 * c5
    if m >= 8:
        c6, c7 = coefficients[f, 6, d], coefficients[f, 7, d]
        x, xs, xt = (x + (c6 * s + c7 * t) * s * t, xs + (2.0 * c6 * s + c7 * t) * t, xt + (c6 * s + 2.0 * c7 * t) * s)
        xss, xst, xtt = xss + 2.0 * c6 * t, xst + 2.0 * (c6 * s + c7 * t), xtt + 2.0 * c7 * s
    if m >= 9:
        c = coefficients[f, 8, d]
        x, xs, xt = x + c * s * s * t * t, xs + 2.0 * c * s * t * t, xt + 2.0 * c * s * s * t
        xss, xst, xtt = xss + 2.0 * c * t * t, xst + 4.0 * c * s * t, xtt + 2.0 * c * s * s
    return x, xs, xt, xss, xst, xtt


@kernel
def half_square(coefficients, f, s, t, point):
    """Return half the squared distance from `point` to the point (s, t) of facet `f`."""
    dx = point[0] - component(coefficients, f, 0, s, t)[0]
    dy = point[1] - component(coefficients, f, 1, s, t)[0]
    dz = point[2] - component(coefficients, f, 2, s, t)[0]
    return 0.5 * (dx * dx + dy * dy + dz * dz)


@kernel
def _expansion(coefficients, f, s, t, point):
    """Return half the squared distance with its gradient (2) and Hessian (3: ss, st, tt)."""
    value, gs, gt, hss, hst, htt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for d in range(3):
        x, xs, xt, xss, xst, xtt = component(coefficients, f, d, s, t)
        r = point[d] - x
        value += 0.5 * r * r
        gs -= r * xs
        gt -= r * xt
        hss += xs * xs - r * xss
        hst += xs * xt - r * xst
        htt += xt * xt - r * xtt
    return value, gs, gt, hss, hst, htt


@kernel
def _is_feasible(sides, s, t, ps, pt, size):
    """Return whether a step (ps, pt) of length `size` from (s, t) stays in the domain at all sides on which (s, t) lies."""
    for k in range(sides.shape[0]):
        on_side = sides[k, 2] - sides[k, 0] * s - sides[k, 1] * t <= ROUND_OFF
        if on_side and sides[k, 0] * ps + sides[k, 1] * pt > 1e-14 * size:
            return False
    return True


@kernel
def _positive_definite(hss, hst, htt):
    """Return the Hessian if it is positive definite, otherwise with absolute eigenvalues, shifted slightly from zero.

    For a 2 x 2 matrix, |H| = (H^2 + |det H| I) / sqrt(tr H^2 + 2 |det H|), by the theorem of Cayley and Hamilton.
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
    ass, ast, att = _positive_definite(hss, hst, htt)
    determinant = ass * att - ast * ast
    ps, pt = -(att * gs - ast * gt) / determinant, -(ass * gt - ast * gs) / determinant
    if _is_feasible(sides, s, t, ps, pt, abs(ps) + abs(pt)):
        return ps, pt
    ps, pt, gain = 0.0, 0.0, 0.0
    for k in range(sides.shape[0]):
        if sides[k, 2] - sides[k, 0] * s - sides[k, 1] * t > ROUND_OFF:
            continue
        us, ut = -sides[k, 1], sides[k, 0]
        slope = gs * us + gt * ut
        curvature = hss * us * us + 2.0 * hst * us * ut + htt * ut * ut
        curvature = max(abs(curvature), 1e-6 * (ass + att))
        if slope * slope / curvature > gain:
            length = -slope / curvature
            if _is_feasible(sides, s, t, length * us, length * ut, abs(length)):
                ps, pt, gain = length * us, length * ut, slope * slope / curvature
    return ps, pt


@kernel
def _downhill(coefficients, f, s, t, sides, point, value, hss, hst, htt):
    """Return a step that decreases the distance from a stationary point (s, t); zeros if the point is a minimum.

    Candidates are the direction of the smallest curvature of the Hessian, and those along the sides. `value` is half the
    squared distance at (s, t).
    """
    middle, radius = 0.5 * (hss + htt), np.sqrt(0.25 * ((hss - htt) * (hss - htt)) + hst * hst)
    if middle - radius >= -1e-9 * (abs(middle) + radius):
        return 0.0, 0.0
    us, ut = (hst, middle - radius - hss) if abs(hst) > 0.0 else (0.0, 1.0)
    if abs(hst) == 0.0 and hss < htt:
        us, ut = 1.0, 0.0
    for k in range(-1, sides.shape[0]):
        if k >= 0:
            us, ut = -sides[k, 1], sides[k, 0]
        length = 0.1 / np.sqrt(us * us + ut * ut)
        for step in (length, -length):
            ps, pt = step * us, step * ut
            is_lower = half_square(coefficients, f, s + ps, t + pt, point) < value * (1.0 - 1e-12)
            if is_lower and _inside(sides, s + ps, t + pt):
                return ps, pt
    return 0.0, 0.0


@kernel
def _inside(sides, s, t):
    """Return whether (s, t) lies in the domain."""
    for k in range(sides.shape[0]):
        if sides[k, 2] - sides[k, 0] * s - sides[k, 1] * t < -ROUND_OFF:
            return False
    return True


@kernel
def descend(coefficients, f, s, t, sides, point):
    """Return the local minimum (s, t) of the distance from `point` to facet `f`, and whether the iteration converged.

    Newton's method minimises the squared distance over the polygon of the reference domain. It is an active-set method that
    continues along a side once it has reached this side, and that never increases the distance.
    """
    size = np.inf
    for _ in range(MAX_ITERATIONS):
        value, gs, gt, hss, hst, htt = _expansion(coefficients, f, s, t, point)
        ps, pt = _newton_step(sides, s, t, gs, gt, hss, hst, htt)
        size = max(abs(ps), abs(pt))
        if not size > STEP:
            ps, pt = _downhill(coefficients, f, s, t, sides, point, value, hss, hst, htt)
            if size <= STEP and (ps != 0.0 or pt != 0.0):
                s, t = s + ps, t + pt
                continue
            return s, t, size <= STEP
        length = 1.0
        for k in range(sides.shape[0]):
            rate = sides[k, 0] * ps + sides[k, 1] * pt
            if rate > ROUND_OFF * size:  # the rate of a step along the side is round-off
                distance = sides[k, 2] - sides[k, 0] * s - sides[k, 1] * t
                length = min(length, max(distance, 0.0) / rate)
        if length * size > 1e-6:  # in smaller steps round-off exceeds the decrease
            for _ in range(40):
                if half_square(coefficients, f, s + length * ps, t + length * pt, point) <= value * (1.0 + 1e-14):
                    break
                length *= 0.5
        s, t = s + length * ps, t + length * pt
    return s, t, size <= ROUND_OFF_STEP


@kernel
def project(facets, f, domain, point, reach):
    """Return (s, t) of the point of facet `f` closest to `point`, half the squared distance, and whether it converged.

    The facet deviates from the flat triangles between its nodes by at most `deviation`. The descent starts from the closest
    triangle. With more than four nodes, a minimum within `convexity_bound` is unique. Otherwise the descent is restarted on
    every triangle that may contain a closer point. The returned distance is infinite if its square exceeds `reach`.
    """
    coefficients, deviation = facets.coefficients, facets.deviation[f]
    nodes, triangles, sides = domain
    s, t, flat_square = 0.0, 0.0, np.inf
    for k in range(triangles.shape[0]):
        a, b, square = _on_triangle(facets, f, nodes, triangles, k, point)
        if square < flat_square:
            s, t, flat_square = a, b, square
    least = max(np.sqrt(flat_square) - deviation, 0.0)
    if least * least > reach:
        return s, t, np.inf, True
    tried_s, tried_t = s, t
    s, t, converged = descend(coefficients, f, s, t, sides, point)
    best = half_square(coefficients, f, s, t, point)
    if converged and coefficients.shape[1] > 4 and 2.0 * best < facets.convexity_bound[f]:
        return s, t, best, True
    for k in range(triangles.shape[0] if deviation > 0.0 else 0):
        a, b, square = _on_triangle(facets, f, nodes, triangles, k, point)
        largest = np.sqrt(2.0 * best) + deviation
        if square > largest * largest or abs(a - tried_s) + abs(b - tried_t) < 1e-3:
            continue
        a, b, success = descend(coefficients, f, a, b, sides, point)
        value = half_square(coefficients, f, a, b, point)
        if value < best:
            s, t, best, converged = a, b, value, success
    side = minus(node(facets, f, 1), node(facets, f, 0))
    # Near the centres of curvature the distance has several minima on one triangle, so that the descent starts at every node.
    for k in range(nodes.shape[0] if np.sqrt(2.0 * best) * 16.0 * deviation > dot(side, side) else 0):
        a, b, success = descend(coefficients, f, nodes[k, 0], nodes[k, 1], sides, point)
        value = half_square(coefficients, f, a, b, point)
        if value < best:
            s, t, best, converged = a, b, value, success
    return s, t, best, converged


@kernel
def _on_triangle(facets, f, nodes, triangles, k, point):
    """Return (s, t) of the point of flat triangle `k` of facet `f` that is closest to `point`, and its squared distance."""
    a, b, c = triangles[k, 0], triangles[k, 1], triangles[k, 2]
    origin = node(facets, f, a)
    p, q, r = minus(node(facets, f, b), origin), minus(node(facets, f, c), origin), minus(point, origin)
    v, w = on_flat(r, p, q)
    u, away = 1.0 - v - w, residual(r, p, q, (0.0, 0.0, 0.0), v, w)
    s = u * nodes[a, 0] + v * nodes[b, 0] + w * nodes[c, 0]
    t = u * nodes[a, 1] + v * nodes[b, 1] + w * nodes[c, 1]
    return s, t, dot(away, away)


@kernel
def onto_sides(sides, s, t):
    """Return (s, t) moved exactly onto the sides that it lies on up to round-off."""
    for k in range(sides.shape[0]):
        distance = sides[k, 2] - sides[k, 0] * s - sides[k, 1] * t
        if distance <= ROUND_OFF:
            # The equation a s + b t = c is solved for s unless a = 0; s is then as accurate as t.
            if sides[k, 0] != 0.0:
                s = (sides[k, 2] - sides[k, 1] * t) / sides[k, 0]
            else:
                t = sides[k, 2] / sides[k, 1]
    return s, t


@kernel
def normal_and_overhang(coefficients, f, s, t, point, sides, nodes):
    """Return the unit normal of facet `f` at (s, t) and the overhang of `point` beyond the domain's sides.

    The overhang, in facet lengths, follows from the point's reference coordinates on the tangent plane of the facet.
    """
    x, xs, xt, _, _, _ = component(coefficients, f, 0, s, t)
    y, ys, yt, _, _, _ = component(coefficients, f, 1, s, t)
    z, zs, zt, _, _, _ = component(coefficients, f, 2, s, t)
    p, q, r = (xs, ys, zs), (xt, yt, zt), minus(point, (x, y, z))
    pp, pq, qq, pr, qr = dot(p, p), dot(p, q), dot(q, q), dot(p, r), dot(q, r)
    determinant = pp * qq - pq * pq
    ds, dt = (qq * pr - pq * qr) / determinant, (pp * qr - pq * pr) / determinant
    overhang, span = 0.0, nodes[1, 0] - nodes[0, 0]
    for k in range(sides.shape[0]):
        a, b = sides[k, 0], sides[k, 1]
        if sides[k, 2] - a * s - b * t <= ROUND_OFF:
            overhang = max(overhang, (a * ds + b * dt) / span)
    return unit(cross(p, q)), overhang
