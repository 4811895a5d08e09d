"""Predictor of a load step: displacements and contact forces extrapolated linearly in the load."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fastcontact.arrays import Array, Mask

# Gaps (m,) [length] and multipliers (m,) [force] of a pair.
GapsAndForces = tuple[Array, Array]
# Largest ratio of the current load increment to the last one at which steps are extrapolated.
FARTHEST = 2.0


@dataclass(frozen=True, eq=False)
class Extrapolation:
    """The last converged load steps, at most two, and their linear extrapolation to the current load.

    Attributes
    ----------
    ratio : float
        Ratio of the current load increment to the last one; zero means no extrapolation [-].
    loads : tuple of tuples of ndarray
        The loads of the last two steps and of the current one: prescribed displacements [length] and forces [force].
    states : tuple of (ndarray (n,), dict of str to GapsAndForces)
        Displacements [length], and gaps and multipliers of each pair, at the end of the last two steps.
    """

    ratio: float = 0.0
    loads: tuple[tuple[Array, ...], ...] = ()
    states: tuple[tuple[Array, Mapping[str, GapsAndForces]], ...] = ()

    def to(self, *parts: Array) -> Extrapolation:
        """Return the extrapolation to the loads of the next step.

        `parts` are arrays of prescribed displacements [length] and of forces [force].
        """
        loads, ratio = (*self.loads[-2:], tuple(part.copy() for part in parts)), 0.0
        if len(self.states) == 2 and len(loads) == 3:
            growth = next((r for r in map(_ratio, *loads) if r is not None), 0.0)
            ratio = growth if 0.0 < growth <= FARTHEST else 0.0
        return Extrapolation(ratio, loads, self.states)

    def converged(self, u: Array, contact: Mapping[str, GapsAndForces]) -> Extrapolation:
        """Return a copy to which the solution of a step is added.

        `u` (n,) are its displacements [length], and `contact` the gaps and multipliers of each pair.
        """
        return replace(self, states=(*self.states[-1:], (u.copy(), contact)))

    def displacement(self, u: Array) -> Array:
        """Return initial displacements (n,) of a step [length]; without extrapolation the last ones, `u` (n,)."""
        if not self.ratio:
            return u
        (before, _), (last, _) = self.states
        return last + self.ratio * (last - before)

    def active(self, name: str, last_active: Mask) -> Mask:
        """Return the initial active set (m,) of the pair `name`; without extrapolation `last_active` (m,)."""
        if not self.ratio:
            return last_active
        (_, first), (_, second) = self.states
        if name not in first or name not in second:
            return last_active
        (gap0, force0), (gap1, force1) = first[name], second[name]
        if not len(gap0) == len(gap1) == len(last_active):
            return last_active
        with np.errstate(invalid="ignore"):  # gaps of nodes that face nothing are infinite
            gap, force = gap1 + self.ratio * (gap1 - gap0), force1 + self.ratio * (force1 - force0)
        return np.where(last_active, force > 0.0, gap < 0.0)

    def to_dict(self) -> dict[str, Any]:
        """Return the data as numbers, lists and arrays, without the last displacements, which are saved elsewhere."""
        return {
            "loads": [
                [{"size": len(part), "places": np.flatnonzero(part), "values": part[part != 0.0]} for part in load]
                for load in self.loads[-2:]
            ],
            "before": self.states[0][0] if len(self.states) == 2 else None,
            "contact": [{name: list(both) for name, both in contact.items()} for _, contact in self.states],
        }

    @classmethod
    def from_dict(cls, kept: Mapping[str, Any], u: Array) -> Extrapolation:
        """Return the extrapolation for data of `to_dict`; `u` (n,) are the last displacements [length]."""
        displacements = [u] if kept["before"] is None else [kept["before"], u]
        contacts = [{name: (both[0], both[1]) for name, both in contact.items()} for contact in kept["contact"]]
        states = tuple(zip(displacements, contacts)) if contacts else ()
        # Earlier versions saved one array per step, either of displacements or of forces, and did not save which.
        loads = tuple(tuple(map(_dense, load)) for load in kept["loads"] if isinstance(load, list))
        return cls(0.0, loads, states)


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
