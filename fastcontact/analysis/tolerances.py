"""Accuracy of the solutions of a load step, and the accuracy of its geometry that round-off allows.

Forcing terms of inexact solutions are loose at first with an iterative solver, tight at the end. The geometry loop also ends
where further changes are round-off. The size of round-off depends on the condition of the stiffness and of the constraints,
which is not known beforehand; it shows in the last displacements. An iteration that still converges, however slowly, goes on
in one direction: over a window of iterations its displacements lie as far apart as all changes together. Round-off
oscillates, as do the errors of iterative linear solutions: displacements lie hardly farther apart than one change.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastcontact._jit.norms_kernels import largest, largest_difference
from fastcontact.analysis.criteria import Criteria
from fastcontact.analysis.solution import Accuracy
from fastcontact.arrays import Array
from fastcontact.linear.protocol import LinearSolver
from fastcontact.round_off import SINGLE_PRECISION

# Relative residual of the first solution of a step by an iterative solver, and of later ones relative to the last change of
# the displacement and to the last residual: more accuracy than that of the pairing is useless.
FIRST_RESIDUAL, RESIDUAL = 1e-2, 0.03
# With friction the tolerance falls at least to this fraction of the last one: inaccurate linear solutions may be what
# keeps the residual of the friction law from decreasing.
LEAST_FALL = 0.2
# Largest number of Newton iterations with friction while linear solutions are still inexact: their errors reverse
# slips.
INEXACT_NEWTON_STEPS = 3
# Number of updates in the window, and largest distance of their displacements over the typical change (WINDOW if collinear).
WINDOW, APART = 8, 4.0
# What nodal contact forces may scatter at most, relative to the largest one.
FORCE = 1e-5
# Changes below this fraction of those at the beginning of the window still converge.
DECLINE = 0.5


class Tolerances:
    """The tolerances of a load step.

    Parameters
    ----------
    solver : LinearSolver
    criteria : Criteria
    begin_inexact : bool
        Whether the first solutions may have a larger residual than the last one.
    round_off : float
        Accuracy of gaps [length].
    expected : float
        Expected displacement in the first step, if only forces act [length].
    """

    def __init__(
        self, solver: LinearSolver, criteria: Criteria, begin_inexact: bool, round_off: float, expected: float
    ) -> None:
        self._solver, self._criteria, self._round_off, self._expected = solver, criteria, round_off, expected
        self._residual = max(solver.tolerance, FIRST_RESIDUAL) if begin_inexact else solver.tolerance

    @property
    def inexact(self) -> bool:
        """Whether a solution to the current residual cannot be the last one of a step."""
        return self._solver.iterative and self._residual > self._solver.tolerance

    def tighten(self, relative_change: float, law_residual: float = 0.0) -> None:
        """Lower the residual to the forcing term of the last relative change of the displacement.

        Where the friction law is off by more (`law_residual`, over the largest force), to what that is worth: the next step
        of Newton's method is no more accurate.
        """
        worth = RESIDUAL * min(self._residual, relative_change)
        if RESIDUAL * law_residual > worth:
            worth = min(RESIDUAL * law_residual, LEAST_FALL * self._residual)
        self._residual = max(self._solver.tolerance, worth)

    def accuracy(self, scale: float, single_iteration: bool) -> Accuracy:
        """Return the accuracy of a solution.

        Parameters
        ----------
        scale : float
            Size of the displacements [length].
        single_iteration : bool
            Whether the surfaces are paired again after every active-set iteration.
        """
        noise = max(10 * self._solver.tolerance, self._residual if self._solver.iterative else 0.0)
        limit = 1 if single_iteration else self._criteria.max_active_set_iterations
        return Accuracy(
            gap=max(noise * (scale or self._expected), self._round_off),
            multiplier=noise,
            residual=max(self._residual, self._solver.tolerance),
            max_iterations=limit,
            max_newton_steps=1 if limit == 1 else INEXACT_NEWTON_STEPS if self.inexact else None,
        )

    def enough(self, size: float) -> float:
        """Return the change of the displacement, whose size is given, below which the geometry has settled [length]."""
        # Iterative solvers leave a noise of their tolerance, times the contrast of cells; asking for less would never end.
        least = self._solver.tolerance * (self._solver.contrast if self._solver.iterative else 1.0)
        return max(max(self._criteria.geometry, least) * size, self._round_off)


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
        if not change <= SINGLE_PRECISION * size:
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
        return scatter if scatter.displacement <= SINGLE_PRECISION and scatter.force <= FORCE else None

    def forget(self) -> None:
        """Discard the window."""
        self._parts.clear()
        self._forces.clear()
        self._changes.clear()


def _last_change(vectors: list[Array]) -> float:
    """Return the largest difference of the last of some vectors from the others."""
    return max(float(largest_difference(vectors[-1], other)) for other in vectors[:-1])
