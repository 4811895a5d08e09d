"""Results of runs: the series of meshes of a convergence study with limits and errors, and the points of a sweep."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fastcontact.arrays import AnyArray
from fastcontact.cases.summary import finite_or_none
from fastcontact.studies.fit import Limit, step_orders
from fastcontact.studies.settings import Combination

# Largest relative difference [-] from an exact theory that is attributed to straight facets and solver tolerances.
EXACT = 1e-4


@dataclass(frozen=True)
class Split:
    """The model error and the mesh error of a quantity, both relative to the value of a theory.

    Attributes
    ----------
    theory : float
        Value of the theory, in the unit of the quantity.
    model : float
        Model error, the difference between the limit of mesh refinement and the theory [-].
    mesh : float
        Mesh error, the difference between the value of the finest mesh and the limit [-].
    uncertainty : float
        Half-width of the 95 % interval of both errors, which follows from the uncertainty of the limit [-].
    """

    theory: float
    model: float
    mesh: float
    uncertainty: float

    @property
    def total(self) -> float:
        """Difference between the value of the finest mesh and the theory, ``model + mesh`` [-]."""
        return self.model + self.mesh

    @property
    def resolved(self) -> bool:
        """Whether the magnitude of the model error is larger than its uncertainty."""
        return abs(self.model) > self.uncertainty


def split(finest: float, limit: Limit, theory: float) -> Split:
    """Split the difference between the value of the finest mesh and a theory into model error and mesh error.

    Parameters
    ----------
    finest : float
        Value of the finest mesh, in the unit of the quantity.
    limit : Limit
        Limit of mesh refinement.
    theory : float
        Value of the theory, in the same unit.

    Returns
    -------
    Split

    Examples
    --------
    >>> errors = split(104.5, Limit(104.0, 0.1, 1.0, 0.1, 5, True), 100.0)
    >>> round(errors.model, 12), round(errors.mesh, 12)
    (0.04, 0.005)
    """
    errors = limit.value / theory - 1.0, (finest - limit.value) / theory
    return Split(theory, *errors, uncertainty=limit.uncertainty / abs(theory))


@dataclass(frozen=True, eq=False, kw_only=True)
class RunResult:
    """Results of one run.

    Attributes
    ----------
    h : float
        Shortest edge [length] of the facets of the secondary surface or, without contact, of the mesh; NaN if unknown.
    n_dofs : int
        Number of degrees of freedom.
    values : dict of str to float
        Quantities of interest by name, in the units of the case.
    spacings : dict of str to float
        Half the distance between neighbouring nodes [length], by the names of quantities that are only known at nodes.
    profile : dict
        Lists ``r`` [length] and ``pressure`` [pressure] of the secondary nodes, with the distance from the middle of the
        contact and the contact pressure.
    seconds : float
        Duration of the run [s].
    warnings : tuple of str
        Warnings of the run.
    """

    h: float
    n_dofs: int
    values: dict[str, float]
    spacings: dict[str, float] = field(default_factory=dict, repr=False)
    profile: dict[str, list[float]] = field(repr=False)
    seconds: float
    warnings: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return sizes, quantities, duration and warnings for JSON, with None for NaN and without an unknown mesh size."""
        size = {} if math.isnan(self.h) else {"h": self.h}
        values = {name: finite_or_none(value) for name, value in self.values.items()}
        return {**size, "n_dofs": self.n_dofs, **values, "seconds": self.seconds, "warnings": list(self.warnings)}


@dataclass(frozen=True, eq=False, kw_only=True)
class Level(RunResult):
    """Results of one mesh, see `RunResult`; the coarsest mesh has the `number` 0."""

    number: int


@dataclass(frozen=True, eq=False)
class Series:
    """Results of one element type and formulation on all meshes.

    Attributes
    ----------
    combination : Combination
        The element type and the formulation.
    levels : list of Level
        Results of the meshes on which the case could be solved, the coarsest first.
    failed : dict of int to str
        Reason of the failure on each other mesh, by the number of its level.
    theory : dict of str to float
        Values of the theory at equal approach, by quantity.
    reference : dict of str to float
        Values of the mesh-converged solution, by quantity; empty if the case does not name one.
    equal_force : dict of str to float
        Values of the theory at the limit of the force, by quantity.
    equal_force_spread : dict of str to float
        Variation of the values in `equal_force` within the error bar of the force, by quantity.
    quantities : tuple of str
        Quantities with a limit, if there are at least three levels.
    limits : dict of str to Limit
        Limits of mesh refinement by quantity; empty with fewer than three levels.
    exact_theory : bool
        Whether the theory describes the bodies of the model exactly, so that there is no model error.
    compared : str
        Condition of the comparison with the theory, ``"at equal approach"`` or ``"under the given load"``.
    share : float
        Fraction of the contact of the theory that the model represents [-].
    asked : tuple of str
        Requested quantities, which tables, figures and sentences show before the standard ones.
    """

    combination: Combination
    levels: list[Level]
    failed: dict[int, str]
    theory: dict[str, float]
    reference: dict[str, float]
    equal_force: dict[str, float]
    equal_force_spread: dict[str, float]
    quantities: tuple[str, ...]
    limits: dict[str, Limit]
    exact_theory: bool = False
    compared: str = "at equal approach"
    share: float = 1.0
    asked: tuple[str, ...] = ()

    def shown(self, standard: Sequence[str]) -> list[str]:
        """Return the names of the quantities to show: the requested ones, and then those of `standard` that are known."""
        return [name for name in dict.fromkeys((*self.asked, *standard)) if name in self.quantities]

    @property
    def finest(self) -> Level:
        """The finest level that was solved."""
        return self.levels[-1]

    @property
    def h(self) -> list[float]:
        """Mesh size of every level (n_levels,) [length]."""
        return [level.h for level in self.levels]

    def values(self, quantity: str) -> list[float]:
        """Return the values of a quantity on all levels (n_levels,), in its unit; unknown values are NaN."""
        return [level.values.get(quantity, math.nan) for level in self.levels]

    def errors(self, quantity: str) -> list[float]:
        """Return the relative errors (value - limit) / limit on all levels (n_levels,) [-]; NaN without a limit."""
        limit = self.limits.get(quantity)
        return [value / limit.value - 1.0 if limit and limit.value else math.nan for value in self.values(quantity)]

    def orders(self, quantity: str) -> list[float]:
        """Return the observed orders of convergence (n_levels,) [-] from level to level; the first one is NaN."""
        limit = self.limits.get(quantity)
        return step_orders(self.h, self.values(quantity), limit.value) if limit else [math.nan] * len(self.levels)

    def from_theory(self, quantity: str) -> list[float]:
        """Return value / theory - 1 at equal approach on all levels (n_levels,) [-]; NaN without a theory."""
        theory = self.theory.get(quantity)
        return [value / theory - 1.0 if theory else math.nan for value in self.values(quantity)]

    def split(self, quantity: str) -> Split | None:
        """Return the model and the mesh error at equal approach; None without a limit or a theory."""
        limit, theory = self.limits.get(quantity), self.theory.get(quantity)
        return split(self.values(quantity)[-1], limit, theory) if limit and theory else None

    def known_at_nodes(self, quantity: str) -> bool:
        """Return whether the error bar of the limit is half the distance between neighbouring nodes."""
        return quantity in self.limits and self.limits[quantity].uncertainty == self.finest.spacings.get(quantity)

    def has_model_error(self, quantity: str) -> bool:
        """Return whether the model error at equal approach is known.

        The theory is exact, or the values converge and either change monotonically on successive meshes or have a range
        smaller than the model error. Otherwise they do not support an extrapolation.
        """
        split, values = self.split(quantity), np.array(self.values(quantity))
        if split is None or not (self.exact_theory or self.limits[quantity].converging):
            return False
        values = values[np.isfinite(values)]
        changes = np.diff(values)
        monotonic = (changes >= 0.0).all() or (changes <= 0.0).all()
        return bool(self.exact_theory or monotonic or np.ptp(values) < abs(split.model * split.theory))

    def converges_to_theory(self, quantity: str) -> bool | None:
        """Return whether the limit is settled and agrees with an exact theory; None without an exact theory.

        The admissible difference is the error bar of the limit, at least EXACT.
        """
        split, limit = self.split(quantity), self.limits.get(quantity)
        if split is None or limit is None or not self.exact_theory:
            return None
        return bool(limit.converging and abs(split.model) <= max(split.uncertainty, EXACT))

    def split_equal_force(self, quantity: str) -> Split | None:
        """Return the model and the mesh error relative to the theory at the limit of the force; None if not converging."""
        limit, theory = self.limits.get(quantity), self.equal_force.get(quantity)
        if not (limit and limit.converging and theory):
            return None
        # The theory is evaluated at the limit of the force, whose uncertainty adds to that of the quantity.
        error_bar = math.hypot(limit.uncertainty, self.equal_force_spread.get(quantity, 0.0))
        return split(self.values(quantity)[-1], dataclasses.replace(limit, uncertainty=error_bar), theory)

    def mesh_error(self, quantity: str) -> float:
        """Return the error of the finest mesh [-], relative to the theory, or to the limit if there is no theory."""
        split = self.split(quantity)
        return split.mesh if split else self.errors(quantity)[-1]


Value = float | int | str | bool


@dataclass(frozen=True, eq=False, kw_only=True)
class Point(RunResult):
    """Results for one choice of the parameters, with the attributes of `RunResult` and the following.

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
            Attribute that contains the denominator.

        Returns
        -------
        float
            Ratio [-]; NaN if one of the values is unknown.
        """
        denominator = getattr(self, to).get(quantity)
        return self.values.get(quantity, math.nan) / denominator if denominator else math.nan


@dataclass(frozen=True, eq=False)
class TheoryCurve:
    """Theory of a case as a function of the parameter over which a sweep is drawn.

    Attributes
    ----------
    label : str
        Text with the values of the other parameters.
    x : ndarray (n,)
        Values of this parameter, in its unit.
    values : dict of str to ndarray (n,)
        Values of the theory by quantity, in the units of the case.
    """

    label: str
    x: AnyArray
    values: dict[str, AnyArray]
