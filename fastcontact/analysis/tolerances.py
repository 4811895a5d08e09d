"""Forcing terms of inexact solutions in a load step: loose at first with an iterative solver, tight at the end."""

from __future__ import annotations

from fastcontact.analysis.criteria import Criteria
from fastcontact.analysis.solution import Accuracy
from fastcontact.linear.protocol import LinearSolver

# Relative residual of the first solution of a step by an iterative solver, and of later ones relative to the last change of
# the displacement and to the last residual: more accuracy than that of the pairing is useless.
FIRST_RESIDUAL, RESIDUAL = 1e-2, 0.03
# With friction the residual decreases at least to this fraction of the last one, unless the residual of the friction law
# failed this many times to decrease to the fraction CONTRACTS: loose solutions may then be the reason.
LEAST_FALL, CONTRACTS, STILL = 0.2, 0.7, 2
# Number of Newton iterations with friction while the residual is larger than the last one: errors reverse slips.
INEXACT_NEWTON_STEPS = 3
# Number of pairings after which errors of full solutions are assumed.
PATIENT_UPDATES = 25
# Changes of the displacement, over an iterative solver's tolerance, that its errors alone may cause beside much stiffer
# parts.
LEFT = 1e3


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
        self._law_residual, self._still = 1.0, 0

    @property
    def inexact(self) -> bool:
        """Whether a solution to the current residual cannot be the last one of a step."""
        return self._solver.iterative and self._residual > self._solver.tolerance

    def tighten(self, relative_change: float, law_residual: float = 0.0) -> None:
        """Lower the residual to the forcing term of the last relative change of the displacement.

        Where the residual of the friction law (`law_residual`, over the largest force) is larger and Newton's method
        converges, the forcing term follows from it: the next Newton step is no more accurate.
        """
        worth = RESIDUAL * min(self._residual, relative_change)
        self._still = 0 if law_residual < CONTRACTS * self._law_residual else self._still + 1
        if self._still < STILL and RESIDUAL * law_residual > worth:
            worth = min(RESIDUAL * law_residual, LEAST_FALL * self._residual)
        self._residual, self._law_residual = max(self._solver.tolerance, worth), law_residual

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

    def noise(self, size: float) -> float:
        """Return the change of a displacement of given size that errors of linear solutions may cause [length]."""
        return LEFT * self._solver.tolerance * size if self._solver.iterative else 0.0

    def enough(self, update: int, size: float) -> float:
        """Return the change of a displacement of given size below which the geometry has converged [length]."""
        # Iterative solvers leave noise of their tolerance times the contrast of cells; a smaller tolerance is not attainable.
        least = self._solver.tolerance * (self._solver.contrast if self._solver.iterative else 1.0)
        accuracy = max(self._criteria.geometry, least)
        if update >= PATIENT_UPDATES:
            accuracy = max(accuracy, self._solver.error)
        return max(accuracy * size, self._round_off)
