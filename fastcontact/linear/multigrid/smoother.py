"""Chebyshev smoother, preconditioned by the diagonal blocks.

Let A be the matrix of a level, D its diagonal blocks, and `bound` an upper bound of the eigenvalues of ``D^-1 A``. The
smoother reduces the components of the error that belong to eigenvalues between ``SMOOTHED * bound`` and `bound` (Adams,
Brezina, Hu and Tuminaro, 2003). Unlike with the Gauss-Seidel method, results do not depend on the number of threads.
`Level.relax` makes one step.
"""

from __future__ import annotations

import numpy as np

from fastcontact.linear.multigrid.level import Level
from fastcontact.round_off import ROUND_OFF

# Number of Lanczos steps for the largest eigenvalue, and safety factor of its estimate.
LANCZOS_STEPS = 8
SAFETY = 1.08
# Lower end of the interval of eigenvalues that is smoothed, relative to its upper end; number of Chebyshev steps.
SMOOTHED = 1 / 24
DEGREE = 3


def chebyshev(bound: float, degree: int) -> list[tuple[float, float]]:
    """Return the coefficients of `degree` Chebyshev steps for eigenvalues between ``SMOOTHED * bound`` and `bound`.

    The two coefficients of a step multiply the last step and the preconditioned residual, see `cycle_kernels.relax`.
    """
    centre, half = 0.5 * (1 + SMOOTHED) * bound, 0.5 * (1 - SMOOTHED) * bound
    factors = [(0.0, 1.0 / centre)]
    rho = half / centre
    for _ in range(1, degree):
        new = 1.0 / (2.0 * centre / half - rho)
        factors.append((new * rho, 2.0 * new / half))
        rho = new
    return factors


def largest_eigenvalue(level: Level) -> float:
    """Return a lower estimate of the largest eigenvalue of ``D^-1 A`` by the Lanczos method.

    The tridiagonal matrix of the Lanczos method follows from the coefficients of the conjugate gradient method with the
    preconditioner D (Golub and Van Loan, Matrix Computations, 2013, section 11.3).
    """
    r = np.random.default_rng(0).normal(size=level.n).astype(level.b.dtype)
    z, q, p = np.empty_like(r), np.empty_like(r), np.zeros_like(r)
    scratch, zero = np.empty_like(r), np.zeros_like(r)
    if level.eliminated is not None:
        level.eliminated.move_forces(r)
    diagonal, off_diagonal = [], []
    old_alpha, beta, rz = 1.0, 0.0, 0.0
    kind = r.dtype.type
    for step in range(min(LANCZOS_STEPS, level.n)):
        level.scale(r, kind(0), kind(1), scratch, z, True)
        if level.free_motions is not None:
            level.free_motions.correct(r, 1.0, scratch, z)
        if level.eliminated is not None:
            level.eliminated.complete(z)
        new = float(r @ z)
        if not new > ROUND_OFF * abs(rz):
            break
        beta = new / rz if step else 0.0
        rz = new
        p = z + kind(beta) * p
        level.subtract_product(p, zero, q)
        q *= -1
        alpha = rz / float(p @ q)
        diagonal.append(1 / alpha + beta / old_alpha)
        off_diagonal.append(np.sqrt(beta) / old_alpha)
        r -= kind(alpha) * q
        old_alpha = alpha
    T = np.diag(diagonal) + np.diag(off_diagonal[1:], 1) + np.diag(off_diagonal[1:], -1)
    return float(np.linalg.eigvalsh(T).max()) if diagonal else 1.0
