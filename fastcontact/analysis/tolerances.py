"""Forcing terms of inexact solutions in a load step: loose at first with an iterative solver, tight at the end."""

from __future__ import annotations

from fastcontact.analysis.criteria import Criteria
from fastcontact.analysis.solution import Accuracy
from fastcontact.linear.protocol import LinearSolver

# Relative residual of the first solution of a step by an iterative solver, and of later ones relative to the last change of
# the displacement and to the last residual: more accuracy than that of the pairing is useless.
FIRST_RESIDUAL, RESIDUAL = 1e-2, 0.03
# With friction the tolerance falls at least to this fraction of the last one: inaccurate linear solutions may be what
# keeps the residual of the friction law from decreasing.
LEAST_FALL = 0.2
# Largest number of Newton iterations with friction while linear solutions are still inexact: their errors reverse
# slips.
INEXACT_NEWTON_STEPS = 3


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
