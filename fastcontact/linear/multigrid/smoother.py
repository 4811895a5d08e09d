"""Chebyshev smoother, preconditioned by the diagonal blocks.

It smooths the eigenvalues of ``D^-1 A`` in [SMOOTHED bound, bound], D the diagonal blocks (Adams, Brezina, Hu and Tuminaro,
2003). Unlike Gauss-Seidel it is bitwise reproducible for any number of threads. `Level.relax` makes one of its steps.
"""

from __future__ import annotations

import numpy as np

from fastcontact.linear.multigrid.level import Level
from fastcontact.round_off import ROUND_OFF

# Lanczos steps for the largest eigenvalue, safety margin of the estimate, and the fraction of the spectrum that is smoothed.
LANCZOS_STEPS = 8
SAFETY = 1.08
SMOOTHED = 1 / 24
DEGREE = 3


def chebyshev(bound: float, degree: int) -> list[tuple[float, float]]:
    """Return the factors (of the last step, of the residual) of a Chebyshev iteration for [SMOOTHED bound, bound]."""
    centre, half = 0.5 * (1 + SMOOTHED) * bound, 0.5 * (1 - SMOOTHED) * bound
    factors = [(0.0, 1.0 / centre)]
    rho = half / centre
    for _ in range(1, degree):
        new = 1.0 / (2.0 * centre / half - rho)
        factors.append((new * rho, 2.0 * new / half))
        rho = new
    return factors


def largest_eigenvalue(level: Level) -> float:
    """Return an estimate, from below, of the largest eigenvalue of ``D^-1 A`` from the Lanczos process.

    The process is that behind conjugate gradients with preconditioner D (Golub and Van Loan, section 11.3).
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
