"""Predictor of a load step: polynomial extrapolation of displacements in the load, linear of contact forces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fastcontact._jit.norms_kernels import largest_difference
from fastcontact.analysis.tolerances import DECLINE
from fastcontact.arrays import Array, Mask

# Gaps (m,) [length] and multipliers (m,) [force] of a pair.
GapsAndForces = tuple[Array, Array]
# Largest ratio of the current load increment to the last one at which steps are extrapolated.
FARTHEST = 2.0
# Highest degree of the polynomial that continues steps.
DEGREE = 4


@dataclass(frozen=True, eq=False)
class Extrapolation:
    """The last converged load steps, at most DEGREE + 1, and their extrapolation to the current load.

    Attributes
    ----------
    ratios : tuple of float
        Ratio of each load increment to the one before it, that of the current increment last; zero means that steps are not
        extrapolated across it [-].
    degree : int
        Degree of the polynomial in the load that continues the steps.
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

    def to(self, *parts: Array) -> Extrapolation:
        """Return the extrapolation to the loads of the next step.

        `parts` are arrays of prescribed displacements [length] and of forces [force].
        """
        loads = (*self.loads[-2:], tuple(part.copy() for part in parts))
        ratio = _growth(loads) if len(self.states) >= 2 else 0.0
        return replace(self, ratios=(*self.ratios[1 - DEGREE :], ratio), loads=loads)

    def converged(self, u: Array, contact: Mapping[str, GapsAndForces], curve: bool = False) -> Extrapolation:
        """Return a copy to which the solution of a step is added.

        `u` (n,) are its displacements [length], and `contact` the gaps and multipliers of each pair. `curve` keeps enough
        steps for polynomials of more than the first degree. The next step is continued with the highest degree up to which
        every one came clearly closer to this step than the one below, and with one more where all of them did.
        """
        degree, highest = 0, self._highest
        distances = [largest_difference(u, self._continued(k)) for k in range(highest + 1)] if curve else []
        while degree < len(distances) - 1 and distances[degree + 1] < DECLINE * distances[degree]:
            degree += 1  # with any closer one, indentations past yield, which are not smooth, take 5 % more iterations
        degree = max(1, degree + (degree == highest))
        return replace(self, degree=degree, states=(*self.states[-DEGREE if curve else -1 :], (u.copy(), contact)))

    def displacement(self, u: Array) -> Array:
        """Return initial displacements (n,) of a step [length]; without extrapolation the last ones, `u` (n,)."""
        return self._continued(1) if self.ratio else u

    def predicted(self, u: Array) -> Array:
        """Return initial displacements (n,) as `displacement`, by the polynomial of the chosen degree."""
        return self._continued(min(self.degree, self._highest)) if self.ratio else u

    @property
    def _highest(self) -> int:
        """Highest possible degree, negative without states: the number of last increments that are all extrapolated."""
        unbroken = next((k for k, ratio in enumerate(self.ratios[::-1]) if not ratio), len(self.ratios))
        return min(unbroken, len(self.states) - 1)

    def _continued(self, degree: int) -> Array:
        """Return the displacements (n,) of the polynomial through the last ``degree + 1`` states, at the current load."""
        states, out = [u for u, _ in self.states[-degree - 1 :][::-1]], self.states[-1][0]
        increments = 1.0 / np.cumprod([1.0, *self.ratios[len(self.ratios) - degree : -1][::-1]])
        loads = np.concatenate([[0.0], -np.cumsum(increments)])  # from the last one, in increments
        for k in range(1, degree + 1):  # Lagrange polynomials
            others = np.delete(loads[: degree + 1], k)
            out = out + np.prod((self.ratio - others) / (loads[k] - others)) * (states[k] - states[0])
        return out

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
            "loads": [
                [{"size": len(part), "places": np.flatnonzero(part), "values": part[part != 0.0]} for part in load]
                for load in self.loads[-2:]
            ],
            "before": [u for u, _ in self.states[:-1]],
            "ratios": list(self.ratios),
            "degree": self.degree,
            "contact": [{name: list(both) for name, both in contact.items()} for _, contact in self.states[-2:]],
        }

    @classmethod
    def from_dict(cls, kept: Mapping[str, Any], u: Array) -> Extrapolation:
        """Return the extrapolation for data of `to_dict`; `u` (n,) are the last displacements [length]."""
        before = kept["before"]
        if not isinstance(before, list):  # earlier versions saved one array, or none
            before = [] if before is None else [before]
        contacts = [{name: (both[0], both[1]) for name, both in contact.items()} for contact in kept["contact"]]
        contacts = [{}] * (len(before) + 1 - len(contacts)) + contacts
        states: tuple[Any, ...] = tuple(zip([*before, u], contacts)) if kept["contact"] else ()
        # Earlier versions saved one array per step, either of displacements or of forces, and did not save which.
        loads = tuple(tuple(map(_dense, load)) for load in kept["loads"] if isinstance(load, list))
        return cls(tuple(kept.get("ratios", ())), int(kept.get("degree", 1)), loads, states)


def _growth(loads: tuple[tuple[Array, ...], ...]) -> float:
    """Return the ratio of the last of two increments of the loads to the first; zero if steps are not extrapolated."""
    growth = next((r for r in map(_ratio, *loads) if r is not None), 0.0) if len(loads) == 3 else 0.0
    return growth if 0.0 < growth <= FARTHEST else 0.0


def _ratio(first: Array, second: Array, third: Array) -> float | None:
    """Return the ratio of the last increment of a load to the one before it; None if the latter is zero.

    The load has the values `first`, `second` and `third` (n,) in successive steps.
    """
    now, last = third - second, second - first
    size = float(np.sum(last * last))
    return float(np.sum(now * last)) / size if size else None


def _dense(kept: Mapping[str, Any]) -> Array:
    """Return the array (n,) whose nonzero entries `to_dict` has saved."""
    values = np.zeros(kept["size"])
    values[kept["places"]] = kept["values"]
    return values
