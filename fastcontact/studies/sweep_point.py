"""Results of a sweep for one choice of its parameters, and theory between them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from fastcontact.arrays import AnyArray

Value = float | int | str | bool


@dataclass(frozen=True, eq=False)
class Point:
    """Results for one choice of the parameters.

    Attributes
    ----------
    parameters : dict of str to value
    h : float
        Shortest facet of the secondary surface [length].
    n_dofs : int
    values : dict of str to float
        Quantities of interest, in the case's units.
    theory, reference, equal_force : dict of str to float
        By quantity: the theory at equal approach, the mesh-converged solution if the case names one, and the theory at
        equal force.
    profile : dict
        ``r`` [length] and ``pressure`` [pressure], lists (n_nodes,) over the secondary nodes.
    seconds : float
        Time of the run [s].
    warnings : tuple of str
    """

    parameters: dict[str, Value]
    h: float
    n_dofs: int
    values: dict[str, float]
    theory: dict[str, float]
    reference: dict[str, float]
    equal_force: dict[str, float]
    profile: dict[str, list[float]] = field(repr=False)
    seconds: float
    warnings: tuple[str, ...]

    def ratio(self, quantity: str, to: str = "theory") -> float:
        """Return value over ``"theory"``, ``"reference"`` or ``"equal_force"`` [-]; NaN where one is not known."""
        other = getattr(self, to).get(quantity)
        return self.values.get(quantity, math.nan) / other if other else math.nan


@dataclass(frozen=True, eq=False)
class TheoryCurve:
    """What the theory of a case gives over the first parameter of a sweep.

    Attributes
    ----------
    label : str
        The values of the other parameters in words.
    x : ndarray (n,)
        Values of the first parameter, in its unit.
    values : dict of str to ndarray (n,)
        By quantity, in the case's units.
    """

    label: str
    x: AnyArray
    values: dict[str, AnyArray]
