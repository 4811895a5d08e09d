"""Single load steps, for tests of the analysis."""

from collections.abc import Iterator
from contextlib import contextmanager
from unittest.mock import patch

import fastcontact as fc
from fastcontact.analysis import load_step as page
from fastcontact.analysis import step_halving
from fastcontact.analysis.problem import prepare


class Watched:
    """The settled contact and the displacements (n_dofs,) of the last load step, see `watching`."""

    settled = u = None


@contextmanager
def watching() -> Iterator[Watched]:
    """Keep the settled contact of the last load step that is solved inside."""
    found = Watched()

    def watched(*given, solve=page.newton_with_wear):
        solution = solve(*given)
        found.settled, found.u = solution.settled, solution.u
        return solution

    with patch.object(page, "newton_with_wear", watched):  # not in the search for other equilibria
        yield found


class Stepping:
    """A problem and its present state."""

    def __init__(self, model, solver="direct", tolerance=1e-10, criteria=None, ramp=None):
        self.problem = prepare(
            model, ramp or fc.linear_ramp(), criteria or fc.Criteria(), linear_solver=solver, linear_tolerance=tolerance
        )
        self.state = self.problem.initial_state()
        self.settled = None

    def __getattr__(self, name):
        return getattr(self.__dict__["problem"], name)

    @property
    def K(self):
        return self.problem.system.K

    @property
    def u(self):
        return self.state.u

    @property
    def displacement(self):
        return self.problem.displacement(self.state.u)

    def step(self, index, instant):
        """Go on to the end of a load step; `settled` is then its contact."""

        with watching() as found:
            self.state, result = page.load_step(self.problem, self.state, index, instant)
        self.settled = found.settled
        return result

    def advance(self, index, begin, end):
        """The same, halved where it does not converge."""
        self.state, result = step_halving.advance(self.problem, self.state, index, begin, end)
        return result
