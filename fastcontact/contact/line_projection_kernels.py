# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Projection of points onto a curve in 2D along normals interpolated between its nodes."""

from fastcontact._jit.decorators import interpretable_kernel, kernel
from fastcontact.contact.search.limits import BEYOND, MAX_ITERATIONS
from fastcontact.round_off import LENGTH_ROUND_OFF, ROUND_OFF


@kernel
def _shape(count, s, values, slopes):
    """Fill shape functions and their derivatives of a line of two or three nodes at s."""
    if count == 2:
        values[0], values[1], values[2] = 0.5 * (1.0 - s), 0.5 * (1.0 + s), 0.0
        slopes[0], slopes[1], slopes[2] = -0.5, 0.5, 0.0
    else:
        values[0], values[1], values[2] = 0.5 * s * (s - 1.0), 0.5 * s * (s + 1.0), 1.0 - s * s
        slopes[0], slopes[1], slopes[2] = s - 0.5, s + 0.5, -2.0 * s


@kernel
def _newton(x, y, corners, normals, f, count, s, values, slopes):
    """Return s where (x, y) lies on the normal of facet f, extended beyond its ends, and whether the iteration converged."""
    for _ in range(MAX_ITERATIONS):
        _shape(count, s, values, slopes)
        px, py, tx, ty, nx, ny, mx, my = x, y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(count):
            px -= values[k] * corners[f, k, 0]
            py -= values[k] * corners[f, k, 1]
            tx += slopes[k] * corners[f, k, 0]
            ty += slopes[k] * corners[f, k, 1]
            nx += values[k] * normals[f, k, 0]
            ny += values[k] * normals[f, k, 1]
            mx += slopes[k] * normals[f, k, 0]
            my += slopes[k] * normals[f, k, 1]
        slope = (px * my - py * mx) - (tx * ny - ty * nx)
        # The slope vanishes at a centre of curvature, where the foot of the normal is not unique.
        if not abs(slope) > LENGTH_ROUND_OFF * abs(tx * ny - ty * nx):
            return s, False
        step = -(px * ny - py * nx) / slope
        step = min(1.0, max(-1.0, step))
        s += step
        if 0.5 * (abs(s) - 1.0) > 2.0 * BEYOND:
            return s, False
        if abs(step) <= ROUND_OFF * (1.0 + abs(s)):
            return s, True
    return s, abs(step) <= 1e-10


@interpretable_kernel
def along_normals(points, corners, normals, counts, neighbour, facet, xi, overhang, values, slopes):
    """Replace closest-point projections (facet, xi) by projections along the interpolated normals.

    Parameters
    ----------
    points : ndarray (n, 2)
        [length].
    corners, normals : ndarray (n_facets, 3, 2)
        Nodes of the facets and unit normals there, ends first.
    counts : ndarray of int (n_facets,)
        Nodes of each facet, 2 or 3.
    neighbour : ndarray of int (n_facets, 2)
        The facet beyond each end, or -1. Its end 1 is shared beyond end 0, and its end 0 beyond end 1.
    facet, xi, overhang : ndarray (n,)
        Closest points, changed in place where the projection succeeds.
    values, slopes : ndarray (3,)
        Working space.
    """
    for i in range(points.shape[0]):
        f, s, before = facet[i], xi[i], -1
        for _ in range(MAX_ITERATIONS):
            s, converged = _newton(points[i, 0], points[i, 1], corners, normals, f, counts[f], s, values, slopes)
            if not converged or 0.5 * (abs(s) - 1.0) > BEYOND:
                break
            if abs(s) <= 1.0:
                facet[i], xi[i], overhang[i] = f, s, 0.0
                break
            end = 1 if s > 0.0 else 0
            beyond = neighbour[f, end]
            if beyond < 0:
                facet[i], xi[i], overhang[i] = f, 2.0 * end - 1.0, 0.5 * (abs(s) - 1.0)
                break
            if beyond == before:  # at the node between both facets
                facet[i], xi[i], overhang[i] = f, 2.0 * end - 1.0, 0.0
                break
            before, f, s = f, beyond, 1.0 - 2.0 * end
