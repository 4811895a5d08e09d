"""Attainable accuracy of the geometry loop: it ends where further changes are round-off.

The size of round-off depends on the condition of the stiffness and of the constraints, which is not known beforehand;
it shows in the last displacements. An iteration that still converges, however slowly, goes on in one direction: over a
window of iterations its displacements lie as far apart as all changes together. Round-off oscillates: displacements lie
hardly farther apart than one change. The errors of iterative linear solutions oscillate as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastcontact._jit.norms_kernels import largest, largest_difference
from fastcontact.arrays import Array

# Number of updates in the window, and largest distance of their displacements over the typical change (WINDOW if collinear).
WINDOW, APART = 8, 4.0
# What may scatter at most: displacements relative to the largest one, nodal contact forces relative to the largest one.
DISPLACEMENT, FORCE = 1e-6, 1e-5
# Changes below this fraction of those at the beginning of the window still converge.
DECLINE = 0.5


@dataclass(frozen=True)
class Scatter:
    """Scatter of the last geometries of a load step.

    Attributes
    ----------
    displacement : float
        Scatter of displacements over the largest one [-].
    force : float
        Scatter of nodal contact forces over the largest one [-].
    """

    displacement: float
    force: float


class Watch:
    """Monitor of the last displacements and contact forces that detects when they only scatter."""

    def __init__(self) -> None:
        self._parts: list[Array] = []
        self._forces: list[Array] = []
        self._changes: list[float] = []

    def seen(self, unknowns: Array, force: Array, change: float, size: float) -> Scatter | None:
        """Take the displacements `unknowns` (k,) [length] and contact forces (n,) [force] of an update; return their scatter.

        Parameters
        ----------
        unknowns, force : ndarray
        change : float
            Change of the displacements from the previous ones [length].
        size : float
            Largest displacement [length].

        Returns
        -------
        Scatter or None
            None while the updates may still converge, or scatter by more than is acceptable.
        """
        if not change <= DISPLACEMENT * size:
            self.forget()
            return None
        self._parts.append(unknowns.copy())
        self._forces.append(force.copy())
        self._changes.append(change)
        del self._parts[:-WINDOW], self._forces[:-WINDOW], self._changes[:-WINDOW]
        if len(self._changes) < WINDOW:
            return None
        changes, half = self._changes, WINDOW // 2
        scatter = Scatter(_last_change(self._parts) / size, _last_change(self._forces) / (largest(force) or 1.0))
        declining = np.median(changes[half:]) < DECLINE * np.median(changes[:half])
        if declining or scatter.displacement * size > APART * float(np.median(changes)):
            return None
        return scatter if scatter.displacement <= DISPLACEMENT and scatter.force <= FORCE else None

    def forget(self) -> None:
        """Discard the window."""
        self._parts.clear()
        self._forces.clear()
        self._changes.clear()


def _last_change(vectors: list[Array]) -> float:
    """Return the largest difference of the last of some vectors from the others."""
    return max(float(largest_difference(vectors[-1], other)) for other in vectors[:-1])
