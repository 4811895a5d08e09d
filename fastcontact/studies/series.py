"""One element and formulation on all meshes of a convergence study: values, limits, model error and mesh error."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from fastcontact.cases.summary import finite
from fastcontact.studies.fit import Limit, step_orders
from fastcontact.studies.settings import Combination

# Relative differences below this stem from straight facets and tolerances, not from the formulation [-].
EXACT = 1e-4


@dataclass(frozen=True)
class Split:
    """Differences from a theory, relative to it; ``total = model + mesh``.

    Attributes
    ----------
    theory : float
        Value of the theory, in the unit of the quantity.
    model : float
        Model error: difference of the limit from the theory.
    mesh : float
        Mesh error: difference of the finest mesh from the limit.
    uncertainty : float
        Uncertainty of both errors, from that of the limit, at 95 %.
    """

    theory: float
    model: float
    mesh: float
    uncertainty: float

    @property
    def total(self) -> float:
        """Difference of the finest mesh from the theory."""
        return self.model + self.mesh

    @property
    def resolved(self) -> bool:
        """Whether the model error is larger than its error bar."""
        return abs(self.model) > self.uncertainty


def split(finest: float, limit: Limit, theory: float) -> Split:
    """Split the difference between the finest mesh and a theory into model error and mesh error.

    Examples
    --------
    >>> found = split(104.5, Limit(104.0, 0.1, 1.0, 0.1, 5, True), 100.0)
    >>> round(found.model, 12), round(found.mesh, 12)
    (0.04, 0.005)
    """
    return Split(
        theory=theory,
        model=limit.value / theory - 1.0,
        mesh=(finest - limit.value) / theory,
        uncertainty=limit.uncertainty / abs(theory),
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class Measured:
    """Results of one run.

    Attributes
    ----------
    h : float
        Shortest facet of the secondary surface; without contact the shortest edge; NaN if unknown [length].
    n_dofs : int
    values : dict of str to float
        Quantities of interest, in the case's units.
    profile : dict
        ``r`` [length] and ``pressure`` [pressure], lists (n_nodes,) over the secondary nodes.
    seconds : float
        Time of the run [s].
    warnings : tuple of str
    """

    h: float
    n_dofs: int
    values: dict[str, float]
    profile: dict[str, list[float]] = field(repr=False)
    seconds: float
    warnings: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return sizes, quantities, time and warnings for JSON; without an unknown mesh size, and None for NaN."""
        size = {} if math.isnan(self.h) else {"h": self.h}
        values = {name: finite(value) for name, value in self.values.items()}
        return {**size, "n_dofs": self.n_dofs, **values, "seconds": self.seconds, "warnings": list(self.warnings)}


@dataclass(frozen=True, eq=False, kw_only=True)
class Level(Measured):
    """Results of one mesh, see `Measured`; its `number` is 0 for the coarsest."""

    number: int


@dataclass(frozen=True, eq=False)
class Series:
    """Results of one element and formulation on all levels.

    Attributes
    ----------
    combination : Combination
    levels : list of Level
        Levels that could be solved, coarsest first.
    failed : dict of int to str
        Reason why a level failed, by its number.
    theory, reference : dict of str to float
        Theory at equal approach, and mesh-converged solution if the case names one, by quantity.
    equal_force, equal_force_spread : dict of str to float
        Theory at the limit of the force, and its variation within the error bar of the force, by quantity.
    quantities : tuple of str
        Quantities that are fitted if there are enough levels.
    limits : dict of str to Limit
        Limits by quantity; empty with fewer than three levels.
    exact_theory : bool
        Whether the theory describes exactly the bodies of the model, so that there is no model error.
    compared : str
        Condition of the comparison with theory: "at equal approach" or "under the given load".
    share : float
        Modelled fraction of the theory's contact [-].
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
        """Return the quantities to show: the requested ones, then the `standard` ones that are known."""
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
        """Return a quantity on every level (n_levels,), in its unit; NaN if it is unknown."""
        return [level.values.get(quantity, math.nan) for level in self.levels]

    def errors(self, quantity: str) -> list[float]:
        """Return (value - limit) / limit on every level (n_levels,) [-]; NaN without a limit."""
        limit = self.limits.get(quantity)
        return [value / limit.value - 1.0 if limit and limit.value else math.nan for value in self.values(quantity)]

    def orders(self, quantity: str) -> list[float]:
        """Return the observed orders of successive levels (n_levels,) [-], the first being NaN."""
        limit = self.limits.get(quantity)
        return step_orders(self.h, self.values(quantity), limit.value) if limit else [math.nan] * len(self.levels)

    def from_theory(self, quantity: str) -> list[float]:
        """Return value / theory - 1 at equal approach on every level (n_levels,) [-]; NaN without a theory."""
        theory = self.theory.get(quantity)
        return [value / theory - 1.0 if theory else math.nan for value in self.values(quantity)]

    def split(self, quantity: str) -> Split | None:
        """Return model and mesh error at equal approach, if there are a limit and a theory."""
        limit, theory = self.limits.get(quantity), self.theory.get(quantity)
        return split(self.values(quantity)[-1], limit, theory) if limit and theory else None

    def converges_to_theory(self, quantity: str) -> bool | None:
        """Return whether the limit agrees with an exact theory within its error bar; None without such a theory."""
        split, limit = self.split(quantity), self.limits.get(quantity)
        if split is None or limit is None or not self.exact_theory:
            return None
        return bool(limit.converging and abs(split.model) <= max(split.uncertainty, EXACT))

    def split_equal_force(self, quantity: str) -> Split | None:
        """Return model and mesh error relative to the theory at the limit of the force."""
        limit, theory = self.limits.get(quantity), self.equal_force.get(quantity)
        if not (limit and theory):
            return None
        # The value of the theory inherits the uncertainty of the force.
        error_bar = math.hypot(limit.uncertainty, self.equal_force_spread.get(quantity, 0.0))
        return split(self.values(quantity)[-1], dataclasses.replace(limit, uncertainty=error_bar), theory)

    def mesh_error(self, quantity: str) -> float:
        """Return the error of the finest mesh [-], relative to the theory, or to the limit if there is no theory."""
        split = self.split(quantity)
        return split.mesh if split else self.errors(quantity)[-1]
