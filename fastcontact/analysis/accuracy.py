"""How accurately the inequalities of contact are solved."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Accuracy:
    """Tolerances and limits of one solution of the inequalities of contact.

    Attributes
    ----------
    gap : float
        A gap above minus this counts as open or closed, not as penetration [length].
    multiplier : float
        A multiplier above minus this fraction of the largest one counts as compression [-].
    residual : float, optional
        Relative residual of iterative linear solvers where less than their own tolerance will do [-].
    max_iterations : int
        Linear solutions allowed without friction; the result may then not be settled.
    max_newton_steps : int, optional
        Newton steps with friction after which a state that is not settled will do; None where it will not.
    """

    gap: float
    multiplier: float = 1e-12
    residual: float | None = None
    max_iterations: int = 200
    max_newton_steps: int | None = None
