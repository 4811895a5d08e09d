"""Where two facets face each other in 3D: one polygon clipped by the other in the plane of the first."""

import numpy as np

from fastcontact._jit import kernel

# A polygon of up to 4 corners clipped by one of up to 4 has at most 8.
MOST = 12
# Pieces smaller than this fraction of the facet are rounding errors of the cut.
SLIVER = 1e-12


@kernel
def _plane(corners, count, origin, axes):
    """Fill `origin` (3,) with the centre of a polygon and `axes` (3, 3) with two tangents and its unit normal."""
    origin[:] = 0.0
    for k in range(count):
        for d in range(3):
            origin[d] += corners[k, d] / count
    normal = axes[2]
    normal[:] = 0.0
    for k in range(count):  # area vector (Newell), which also serves facets that are not flat
        m = (k + 1) % count
        for d in range(3):
            e, f = (d + 1) % 3, (d + 2) % 3
            normal[d] += (corners[k, e] - origin[e]) * (corners[m, f] - origin[f])
            normal[d] -= (corners[k, f] - origin[f]) * (corners[m, e] - origin[e])
    length = np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    for d in range(3):
        normal[d] /= length
        axes[0, d] = corners[0, d] - origin[d]
    along = axes[0, 0] * normal[0] + axes[0, 1] * normal[1] + axes[0, 2] * normal[2]
    for d in range(3):
        axes[0, d] -= along * normal[d]
    size = np.sqrt(axes[0, 0] ** 2 + axes[0, 1] ** 2 + axes[0, 2] ** 2)
    for d in range(3):
        axes[0, d] /= size
    for d in range(3):
        e, f = (d + 1) % 3, (d + 2) % 3
        axes[1, d] = normal[e] * axes[0, f] - normal[f] * axes[0, e]


@kernel
def _project(corners, count, origin, axes, flat):
    """Fill `flat` (count, 2) with the coordinates of a polygon in a plane."""
    for k in range(count):
        for a in range(2):
            flat[k, a] = 0.0
            for d in range(3):
                flat[k, a] += (corners[k, d] - origin[d]) * axes[a, d]


@kernel
def _area(flat, count):
    area = 0.0
    for k in range(count):
        m = (k + 1) % count
        area += 0.5 * (flat[k, 0] * flat[m, 1] - flat[m, 0] * flat[k, 1])
    return area


@kernel
def _clip(subject, count, window, n_window, spare):
    """Clip `subject` in place by a convex, counter-clockwise `window`; return its number of corners."""
    for w in range(n_window):
        ax, ay = window[w, 0], window[w, 1]
        bx, by = window[(w + 1) % n_window, 0], window[(w + 1) % n_window, 1]
        kept = 0
        for k in range(count):
            m = (k + 1) % count
            here = (bx - ax) * (subject[k, 1] - ay) - (by - ay) * (subject[k, 0] - ax)
            there = (bx - ax) * (subject[m, 1] - ay) - (by - ay) * (subject[m, 0] - ax)
            if here >= 0.0:
                spare[kept, 0], spare[kept, 1] = subject[k, 0], subject[k, 1]
                kept += 1
            if (here > 0.0 and there < 0.0) or (here < 0.0 and there > 0.0):
                t = here / (here - there)
                spare[kept, 0] = subject[k, 0] + t * (subject[m, 0] - subject[k, 0])
                spare[kept, 1] = subject[k, 1] + t * (subject[m, 1] - subject[k, 1])
                kept += 1
        count = kept
        for k in range(count):
            subject[k, 0], subject[k, 1] = spare[k, 0], spare[k, 1]
        if count < 3:
            return 0
    return count


@kernel
def facing_triangles(secondary, n_secondary, primary, n_primary, pairs, facing, owner, triangles):
    """Cut secondary facets by the primary facets they face and split the pieces into triangles.

    Parameters
    ----------
    secondary, primary : (n_facets, 4, 3)
        Corners; the fourth one of triangles is not read.
    n_secondary, n_primary : (n_facets,)
        Number of corners.
    pairs : (n_pairs, 2)
        Facets that may face each other: secondary, primary.
    facing : float
        Largest cosine between the normals of facets that face each other, e.g. -0.1.
    owner : (n,), triangles : (n, 3, 3)
        Filled in place: secondary facet and corners, in its plane, of each triangle.

    Returns
    -------
    int
        Number of triangles; larger than n where the room did not suffice, and then only the first n are filled.
    """
    origin, axes = np.empty(3), np.empty((3, 3))
    other_origin, other_axes = np.empty(3), np.empty((3, 3))
    subject, window, spare = np.empty((MOST, 2)), np.empty((MOST, 2)), np.empty((MOST, 2))
    found = 0
    for i in range(pairs.shape[0]):
        s, p = pairs[i, 0], pairs[i, 1]
        _plane(secondary[s], n_secondary[s], origin, axes)
        _plane(primary[p], n_primary[p], other_origin, other_axes)
        cosine = 0.0
        for d in range(3):
            cosine += axes[2, d] * other_axes[2, d]
        if cosine > facing:
            continue
        _project(secondary[s], n_secondary[s], origin, axes, subject)
        whole = _area(subject, n_secondary[s])
        count = n_primary[p]
        _project(primary[p], count, origin, axes, spare)
        for k in range(count):  # facets that face each other turn opposite ways
            window[k, 0], window[k, 1] = spare[count - 1 - k, 0], spare[count - 1 - k, 1]
        count = _clip(subject, n_secondary[s], window, count, spare)
        if count < 3 or _area(subject, count) <= SLIVER * whole:
            continue
        for k in range(1, count - 1):
            ux, uy = subject[k, 0] - subject[0, 0], subject[k, 1] - subject[0, 1]
            vx, vy = subject[k + 1, 0] - subject[0, 0], subject[k + 1, 1] - subject[0, 1]
            if 0.5 * (ux * vy - uy * vx) <= SLIVER * whole:
                continue
            if found < owner.shape[0]:
                owner[found] = s
                for c in range(3):
                    corner = 0 if c == 0 else k + c - 1
                    for d in range(3):
                        triangles[found, c, d] = (
                            origin[d] + subject[corner, 0] * axes[0, d] + subject[corner, 1] * axes[1, d]
                        )
            found += 1
    return found
