"""Results at a point of a sweep, and theory between the points."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fastcontact.arrays import AnyArray
from fastcontact.studies.series import Measured

Value = float | int | str | bool


@dataclass(frozen=True, eq=False, kw_only=True)
class Point(Measured):
    """Results for one choice of the parameters, with the attributes of `Measured` and the following.

    Attributes
    ----------
    parameters : dict of str to value
        Value of each parameter.
    theory : dict of str to float
        Theory at equal approach, by quantity.
    reference : dict of str to float
        Mesh-converged solution of the case, by quantity; empty if the case has none.
    equal_force : dict of str to float
        Theory at equal force, by quantity.
    """

    parameters: dict[str, Value]
    theory: dict[str, float]
    reference: dict[str, float]
    equal_force: dict[str, float]

    def ratio(self, quantity: str, to: str = "theory") -> float:
        """Return the ratio of a quantity to theory or to the mesh-converged solution.

        Parameters
        ----------
        quantity : str
            Name of the quantity.
        to : {"theory", "reference", "equal_force"}
            Attribute with the denominator.

        Returns
        -------
        float
            Ratio [-]; NaN if one of the values is unknown.
        """
        other = getattr(self, to).get(quantity)
        return self.values.get(quantity, math.nan) / other if other else math.nan


@dataclass(frozen=True, eq=False)
class TheoryCurve:
    """Theory of a case over the first parameter of a sweep.

    Attributes
    ----------
    label : str
        Text with the values of the other parameters.
    x : ndarray (n,)
        Values of the first parameter [unit of the parameter].
    values : dict of str to ndarray (n,)
        Values of the theory by quantity [units of the case].
    """

    label: str
    x: AnyArray
    values: dict[str, AnyArray]
