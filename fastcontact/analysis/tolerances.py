"""Tolerances of the solutions of a load step, and detection of round-off in its geometry loop.

With an iterative linear solver, the tolerances of the first solutions of a step are large. They decrease with the changes
of the displacements, like the forcing terms of an inexact Newton method.

The geometry loop also ends if further changes are round-off. The size of round-off depends on the condition numbers of the
stiffness matrix and of the constraints, which are not known in advance, but the last displacements show it. If an
iteration converges slowly, it moves in one direction: the first and the last displacements of a window of iterations differ
by the sum of all changes. Round-off oscillates, as do the errors of iterative linear solutions: the displacements of the
window then differ by hardly more than one change.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from fastcontact.analysis.criteria import LINEAR_ERROR, Criteria
from fastcontact.analysis.solution import Accuracy
from fastcontact.arrays import Array, largest
from fastcontact.linear.protocol import LinearSolver
from fastcontact.round_off import LENGTH_ROUND_OFF, SINGLE_PRECISION

# Forcing term of iterative solutions: ratio of the relative residual to the last relative change of the displacements, or to
# the last relative residual if that is smaller. More accurate solutions would not help, because the error of contact
# detection is as large as this change. The relative residual of the first solution of a step is NOTABLE, or this fraction of
# it in a step that is extrapolated from earlier ones. With 0.3, "nu 0.499" takes 12 pairings (6 with 0.03), and with 0.003
# it takes 146 iterations (109 with 0.03; `fastcontact bench robustness`, 3 000 unknowns).
RESIDUAL = 0.03
# Number of geometry updates, or of Newton iterations, within which changes must decrease. With 40,
# `test_noise_is_found_soon_and_measured` fails, and with 3, `test_a_side_cut_in_several_is_what_it_is_whole`.
WINDOW = 8
# Changes or distances below this fraction of earlier ones are regarded as decreasing. An iteration is regarded as converging
# if the changes in the second half of the window are below this fraction of those in the first half. If the residual of the
# friction law determines the tolerance of linear solutions, it decreases at least by this factor, because the residual of
# the law may not decrease if linear solutions are inaccurate.
DECLINE = 0.5


@dataclass(eq=False, repr=False)
class Tolerances:
    """The tolerances of a load step.

    Attributes
    ----------
    solver : LinearSolver
    criteria : Criteria
    residual : float
        Relative residual at which the next linear solution stops; not less than the tolerance of the solver [-].
    round_off : float
        Bound of the round-off of gaps [length].
    first_scale : float
        Scale of the displacements in the first step, if only forces act [length].
    """

    solver: LinearSolver
    criteria: Criteria
    residual: float
    round_off: float
    first_scale: float

    def tighten(self, relative_change: float, law_residual: float = 0.0) -> None:
        """Reduce the tolerance of linear solutions according to the last relative change of the displacements.

        `law_residual` is the residual of the friction law, relative to the largest force. It determines the tolerance if it
        exceeds the smaller of the change and the last tolerance, because the next Newton step is not more accurate.
        """
        residual = RESIDUAL * min(self.residual, relative_change)
        if RESIDUAL * law_residual > residual:
            residual = min(RESIDUAL * law_residual, DECLINE * self.residual)
        self.residual = max(self.solver.tolerance, residual)

    def accuracy(self, scale: float) -> Accuracy:
        """Return the tolerances and limits of the next contact solution, for displacements of the size `scale` [length].

        While linear solutions are inexact, because their tolerance is larger than that of the solver, the step cannot
        end. Surfaces are then paired again after one iteration of the active set or one Newton step of friction.
        """
        inexact = self.solver.iterative and self.residual > self.solver.tolerance
        relative_error = max(LINEAR_ERROR * self.solver.tolerance, self.residual if self.solver.iterative else 0.0)
        return Accuracy(
            gap=max(relative_error * (scale or self.first_scale), self.round_off),
            multiplier=relative_error,
            residual=self.residual,
            max_iterations=1 if inexact else self.criteria.max_active_set_iterations,
            inexact=inexact,
        )


@dataclass(eq=False, repr=False)
class ScatterWindow:
    """The last displacements and contact forces of a geometry loop, which show whether they only scatter by round-off."""

    _window: deque[tuple[Array, Array, float]] = field(default_factory=partial(deque, maxlen=WINDOW), init=False)

    def add(
        self, displacement: Array, force: Array, change: float, size: float, contraction: float = np.inf
    ) -> dict[str, float] | None:
        """Add an update whose change may be round-off to the window, and return the scatter of the window.

        Parameters
        ----------
        displacement : ndarray (k,)
            Displacements [length].
        force : ndarray (n,)
            Nodal contact forces [force].
        change : float
            Largest change of the displacements in this update [length].
        size : float
            Largest displacement [length].
        contraction : float
            Factor by which updates are known to contract changes. Half the window then suffices for small changes if it is
            below DECLINE [-].

        Returns
        -------
        dict or None
            Scatter of the displacements, ``displacement``, and of the nodal contact forces, ``force``, each relative to the
            largest one [-]. None if the updates may still converge, or if they scatter by more than is acceptable.
        """
        self._window.append((displacement.copy(), force.copy(), change))
        contracts = contraction <= DECLINE and change <= LENGTH_ROUND_OFF * size
        window = WINDOW // 2 if contracts else WINDOW
        if len(self._window) < window:
            return None
        (displacements, forces, changes), half = zip(*list(self._window)[-window:], strict=True), window // 2
        scatter = {"displacement": _spread(displacements) / size, "force": _spread(forces) / (largest(force) or 1.0)}
        decreasing = np.median(changes[half:]) < DECLINE * np.median(changes[:half])
        # Displacements that move in one direction are about `window` changes apart, those that oscillate about one change.
        if decreasing or scatter["displacement"] * size > half * float(np.median(changes)):
            return None
        # Contact forces are more sensitive to round-off than displacements.
        acceptable = scatter["displacement"] <= SINGLE_PRECISION and scatter["force"] <= 100 * SINGLE_PRECISION
        return scatter if acceptable else None


def _spread(vectors: tuple[Array, ...]) -> float:
    """Return the largest difference of a component between the last vector and one of the others."""
    return max(float(largest(vectors[-1] - other)) for other in vectors[:-1])
