"""Results of a sweep at one point, and theory curves between the points."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fastcontact.arrays import AnyArray
from fastcontact.studies.series import Measured

Value = float | int | str | bool


@dataclass(frozen=True, eq=False, kw_only=True)
class Point(Measured):
    """Results for one choice of the parameters, see `Measured`.

    Attributes
    ----------
    parameters : dict of str to value
    theory, reference, equal_force : dict of str to float
        Theory at equal approach, mesh-converged solution if the case names one, and theory at equal force, by
        quantity.
    """

    parameters: dict[str, Value]
    theory: dict[str, float]
    reference: dict[str, float]
    equal_force: dict[str, float]

    def ratio(self, quantity: str, to: str = "theory") -> float:
        """Return the ratio of the value to ``"theory"``, ``"reference"`` or ``"equal_force"`` [-]; NaN if one is unknown."""
        other = getattr(self, to).get(quantity)
        return self.values.get(quantity, math.nan) / other if other else math.nan


@dataclass(frozen=True, eq=False)
class TheoryCurve:
    """Theory of a case over the first parameter of a sweep.

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
