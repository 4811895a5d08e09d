# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Block Gauss-Seidel sweeps for contact with Coulomb friction on a dense Delassus operator."""

import numpy as np

from fastcontact._jit.decorators import kernel


@kernel
def sweep(F, free, mu, y, gaps, tolerance, most):
    """Correct one constraint after the other until a sweep changes no force by more than `tolerance` of the largest.

    Each constraint first takes the normal force that closes its gap, then the tangential one that stops its slip, cut
    back to the cone (Moreau, 1988; Jean, 1999).

    Parameters
    ----------
    F : (p m, p m)
        Compliance; unknowns (p, m) in order, normal first, p = 2 or 3.
    free : (p, m)
        Gaps and slips without forces.
    mu : (m,)
    y, gaps : (p, m)
        Forces, in place; filled with their gaps and slips.
    tolerance : float
    most : int
        Sweeps allowed; those made are returned.
    """
    parts, m = free.shape
    _fill_gaps(F, free, y, gaps)
    change = np.zeros(parts)
    for count in range(most):
        largest_change = largest = 0.0
        for i in range(m):
            new = max(0.0, y[0, i] - gaps[0, i] / F[i, i])
            change[0] = new - y[0, i]
            # The slip after the normal correction, and the force that would stop it.
            stiff = 0.0
            for a in range(1, parts):
                stiff = max(stiff, F[a * m + i, a * m + i])
            size = 0.0
            for a in range(1, parts):
                slip = gaps[a, i] + F[a * m + i, i] * change[0]
                change[a] = y[a, i] - slip / stiff
                size += change[a] * change[a]
            size = np.sqrt(size)
            limit = mu[i] * new
            for a in range(1, parts):
                wanted = change[a] * (limit / size) if size > limit else change[a]
                change[a] = wanted - y[a, i]
            moved = False
            for a in range(parts):
                y[a, i] += change[a]
                largest_change = max(largest_change, abs(change[a]))
                moved = moved or change[a] != 0.0
            largest = max(largest, abs(y[0, i]))
            if moved:
                for b in range(parts):
                    for j in range(m):
                        total = 0.0
                        for a in range(parts):
                            total += F[a * m + i, b * m + j] * change[a]
                        gaps[b, j] += total
        if largest_change <= tolerance * largest:
            return count + 1
    return most


@kernel
def _fill_gaps(F, free, y, gaps):
    """Fill `gaps` (p, m) with the gaps and slips under forces y (p, m)."""
    parts, m = free.shape
    for a in range(parts):
        for i in range(m):
            total = free[a, i]
            for b in range(parts):
                for j in range(m):
                    total += F[a * m + i, b * m + j] * y[b, j]
            gaps[a, i] = total
