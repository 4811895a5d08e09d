"""Predictor of a load step: displacements are extrapolated by polynomials in the load, gaps and contact forces linearly."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fastcontact._tools.records import record, replace
from fastcontact.analysis.tolerances import DECLINE
from fastcontact.arrays import Array, Mask, largest, scattered

# Gaps (m,) [length] and multipliers (m,) [force] of a pair.
GapsAndForces = tuple[Array, Array]
# Largest ratio of the current load increment to the last one at which steps are extrapolated. Substeps grow by this factor
# at most (`step_halving`); `test_displacements_go_on_with_the_loads_but_not_far_and_not_back`.
MAX_RATIO = 2.0
# Highest degree of the extrapolation polynomial. Each degree stores the displacements of one more step;
# `test_a_smooth_path_is_continued_by_polynomials_of_ascending_degree`.
MAX_DEGREE = 4


@record
class Extrapolation:
    """The last converged load steps, at most MAX_DEGREE + 1, and their extrapolation to the current load.

    Attributes
    ----------
    ratios : tuple of float
        Ratio of each load increment to the increment before it, the current one last; zero where earlier steps must not be
        extrapolated into this increment [-].
    degree : int
        Degree of the extrapolation polynomial.
    loads : tuple of tuples of ndarray
        The loads of the last steps and of the current one: prescribed displacements [length] and forces [force].
    states : tuple of (ndarray (n,), dict of str to GapsAndForces)
        Displacements [length], and gaps and multipliers of each pair, at the end of the last steps.
    """

    ratios: tuple[float, ...] = ()
    degree: int = 1
    loads: tuple[tuple[Array, ...], ...] = ()
    states: tuple[tuple[Array, Mapping[str, GapsAndForces]], ...] = ()

    @property
    def ratio(self) -> float:
        """Ratio of the current load increment to the last one; zero means no extrapolation [-]."""
        return self.ratios[-1] if self.ratios else 0.0

    def to_loads(self, *quantities: Array) -> Extrapolation:
        """Return the extrapolation to the loads of the next step.

        `quantities` are arrays of prescribed displacements [length] and of forces [force].
        """
        loads = (*self.loads[-2:], tuple(quantity.copy() for quantity in quantities))
        ratio = _increment_ratio(loads) if len(self.states) >= 2 else 0.0
        return replace(self, ratios=(*self.ratios[1 - MAX_DEGREE :], ratio), loads=loads)

    def after(self, u: Array, contact: Mapping[str, GapsAndForces], curved: bool = False) -> Extrapolation:
        """Return a copy to which the solution of a step is added.

        `u` (n,) are its displacements [length], and `contact` the gaps and multipliers of each pair. If the load path is
        `curved`, enough steps are stored for polynomials of more than the first degree. The degree increases from 0 as
        long as the next degree would have predicted this step with less than DECLINE times the error. If the highest
        possible degree is reached, the next step uses one more. The degree is at least 1.
        """
        degree, highest = 0, self._highest_degree
        distances = [largest(u - self._polynomial_at_load(k)) for k in range(highest + 1)] if curved else []
        while degree < len(distances) - 1 and distances[degree + 1] < DECLINE * distances[degree]:
            degree += 1  # without the factor DECLINE, indentations past yield take 5 % more iterations
        degree = max(1, degree + (degree == highest))
        return replace(self, degree=degree, states=(*self.states[-MAX_DEGREE if curved else -1 :], (u.copy(), contact)))

    def predicted(self, u: Array, degree: int | None = None) -> Array:
        """Return initial displacements (n,) of a step [length]; without extrapolation `u` (n,).

        The polynomial has the given `degree`, by default the attribute of this name.
        """
        degree = min(self.degree, self._highest_degree) if degree is None else degree
        return self._polynomial_at_load(degree) if self.ratio else u

    def midway(self, begin: Array, u: Array) -> Array:
        """Return displacements (n,) in the middle of the step from `begin` (n,) to u (n,) [length].

        They lie on the parabola through both states and the one before, or on a line if steps are not extrapolated.
        """
        middle, ratio = 0.5 * (begin + u), self.ratio
        if not ratio:
            return middle
        curvature = ((u - begin) / ratio - (begin - self.states[-2][0])) / (1.0 + ratio)
        return middle - 0.25 * ratio**2 * curvature

    @property
    def _highest_degree(self) -> int:
        """Highest possible degree: the number of last increments without a zero ratio, and at most that of states less 1."""
        n_extrapolated = next((k for k, ratio in enumerate(self.ratios[::-1]) if not ratio), len(self.ratios))
        return min(n_extrapolated, len(self.states) - 1)

    def _polynomial_at_load(self, degree: int) -> Array:
        """Return the displacements (n,) of the polynomial through the last ``degree + 1`` states, at the current load."""
        states, extrapolated = [u for u, _ in self.states[-degree - 1 :][::-1]], self.states[-1][0]
        increments = 1.0 / np.cumprod([1.0, *self.ratios[len(self.ratios) - degree : -1][::-1]])
        loads = np.append(0.0, -np.cumsum(increments))  # relative to the last load, in units of the last increment
        for k in range(1, degree + 1):  # Lagrange polynomials
            others = np.delete(loads[: degree + 1], k)
            extrapolated = extrapolated + np.prod((self.ratio - others) / (loads[k] - others)) * (states[k] - states[0])
        return extrapolated

    def active(self, name: str, last_active: Mask) -> Mask:
        """Return the initial active set (m,) of the pair `name`; without extrapolation `last_active` (m,)."""
        if not self.ratio:
            return last_active
        (_, first), (_, second) = self.states[-2:]
        if name not in first or name not in second:
            return last_active
        (gap0, force0), (gap1, force1) = first[name], second[name]
        if not len(gap0) == len(gap1) == len(last_active):
            return last_active
        with np.errstate(invalid="ignore"):  # gaps of unpaired nodes are infinite
            gap, force = gap1 + self.ratio * (gap1 - gap0), force1 + self.ratio * (force1 - force0)
        return np.where(last_active, force > 0.0, gap < 0.0)

    def to_dict(self) -> dict[str, Any]:
        """Return the data as numbers, lists and arrays, without the last displacements, which are saved elsewhere."""
        return {
            "loads": [[_sparse(quantity) for quantity in load] for load in self.loads[-2:]],
            "before": [u for u, _ in self.states[:-1]],
            "ratios": list(self.ratios),
            "degree": self.degree,
            "contact": [{name: list(values) for name, values in contact.items()} for _, contact in self.states[-2:]],
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], u: Array) -> Extrapolation:
        """Return the extrapolation for data of `to_dict`; `u` (n,) are the last displacements [length]."""
        before = data["before"]
        if not isinstance(before, list):  # earlier versions saved one array, or none
            before = [] if before is None else [before]
        contacts = [{name: (values[0], values[1]) for name, values in contact.items()} for contact in data["contact"]]
        contacts = [{}] * (len(before) + 1 - len(contacts)) + contacts
        states: tuple[Any, ...] = tuple(zip([*before, u], contacts)) if data["contact"] else ()
        # Earlier versions saved one array per step, either of displacements or of forces, and did not save which.
        loads = tuple(tuple(map(_dense, load)) for load in data["loads"] if isinstance(load, list))
        return cls(tuple(data.get("ratios", ())), int(data.get("degree", 1)), loads, states)


def _increment_ratio(loads: tuple[tuple[Array, ...], ...]) -> float:
    """Return the ratio of the last increment of the loads to the one before it; zero if steps are not extrapolated.

    `loads` are the quantities of three successive steps. The first quantity whose earlier increment is not zero determines
    the ratio.
    """
    for first, second, third in zip(*loads) if len(loads) == 3 else ():
        increment, last_increment = third - second, second - first
        if squared_norm := float(np.sum(last_increment * last_increment)):
            ratio = float(np.sum(increment * last_increment)) / squared_norm
            return ratio if 0.0 < ratio <= MAX_RATIO else 0.0
    return 0.0


def _sparse(values: Array) -> dict[str, Any]:
    """Return the size (n) and the nonzero entries of an array (n,), with their indices."""
    return {"size": len(values), "places": np.flatnonzero(values), "values": values[values != 0.0]}


def _dense(data: Mapping[str, Any]) -> Array:
    """Return the array (n,) from the result of `_sparse`."""
    return scattered(data["values"], data["places"], data["size"])
