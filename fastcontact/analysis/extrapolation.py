"""Predictor of a load step: displacements and contact forces extrapolated linearly in the load, or quadratically."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fastcontact._jit.norms_kernels import largest_difference
from fastcontact.arrays import Array, Mask

# Gaps (m,) [length] and multipliers (m,) [force] of a pair.
GapsAndForces = tuple[Array, Array]
# Largest ratio of the current load increment to the last one at which steps are extrapolated.
FARTHEST = 2.0


@dataclass(frozen=True, eq=False)
class Extrapolation:
    """The last converged load steps, at most three, and their extrapolation to the current load.

    Attributes
    ----------
    ratio : float
        Ratio of the current load increment to the last one; zero means no extrapolation [-].
    earlier : float
        Ratio of the last load increment to the one before it; zero means no quadratic extrapolation [-].
    curved : bool
        Whether quadratic extrapolation was closer than linear in the last step in which both were possible.
    loads : tuple of tuples of ndarray
        The loads of the last three steps and of the current one: prescribed displacements [length] and forces [force].
    states : tuple of (ndarray (n,), dict of str to GapsAndForces)
        Displacements [length], and gaps and multipliers of each pair, at the end of the last steps.
    """

    ratio: float = 0.0
    earlier: float = 0.0
    curved: bool = False
    loads: tuple[tuple[Array, ...], ...] = ()
    states: tuple[tuple[Array, Mapping[str, GapsAndForces]], ...] = ()

    def to(self, *parts: Array) -> Extrapolation:
        """Return the extrapolation to the loads of the next step.

        `parts` are arrays of prescribed displacements [length] and of forces [force].
        """
        loads = (*self.loads[-3:], tuple(part.copy() for part in parts))
        ratio = _growth(loads[-3:]) if len(self.states) >= 2 else 0.0
        earlier = _growth(loads[-4:-1]) if ratio and len(self.states) == 3 else 0.0
        return replace(self, ratio=ratio, earlier=earlier, loads=loads)

    def converged(self, u: Array, contact: Mapping[str, GapsAndForces], curve: bool = False) -> Extrapolation:
        """Return a copy to which the solution of a step is added.

        `u` (n,) are its displacements [length], and `contact` the gaps and multipliers of each pair. `curve` keeps three
        steps, for quadratic extrapolation, instead of two.
        """
        curved = self.curved
        if self.earlier:
            curved = largest_difference(u, self._quadratic()) < largest_difference(u, self.displacement(u))
        return replace(self, curved=curved, states=(*self.states[-2 if curve else -1 :], (u.copy(), contact)))

    def displacement(self, u: Array) -> Array:
        """Return initial displacements (n,) of a step [length]; without extrapolation the last ones, `u` (n,)."""
        if not self.ratio:
            return u
        (before, _), (last, _) = self.states[-2:]
        return last + self.ratio * (last - before)

    def predicted(self, u: Array) -> Array:
        """Return initial displacements (n,) [length], extrapolated quadratically if this was closer in the last step."""
        return self._quadratic() if self.earlier and self.curved else self.displacement(u)

    def _quadratic(self) -> Array:
        """Return the displacements (n,) of the parabola through the last three steps (Newton's divided differences)."""
        first, before, last = (u for u, _ in self.states)
        bend = (last - before - self.earlier * (before - first)) / (1.0 + 1.0 / self.earlier)
        return self.displacement(last) + self.ratio * (1.0 + self.ratio) * bend

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
                for load in self.loads[-3:]
            ],
            "before": self.states[-2][0] if len(self.states) >= 2 else None,
            "first": self.states[-3][0] if len(self.states) == 3 else None,
            "curved": self.curved,
            "contact": [{name: list(both) for name, both in contact.items()} for _, contact in self.states[-2:]],
        }

    @classmethod
    def from_dict(cls, kept: Mapping[str, Any], u: Array) -> Extrapolation:
        """Return the extrapolation for data of `to_dict`; `u` (n,) are the last displacements [length]."""
        displacements = [u] if kept["before"] is None else [kept["before"], u]
        contacts = [{name: (both[0], both[1]) for name, both in contact.items()} for contact in kept["contact"]]
        states: tuple[Any, ...] = tuple(zip(displacements, contacts)) if contacts else ()
        if kept.get("first") is not None:
            states = ((kept["first"], {}), *states)
        # Earlier versions saved one array per step, either of displacements or of forces, and did not save which.
        loads = tuple(tuple(map(_dense, load)) for load in kept["loads"] if isinstance(load, list))
        return cls(curved=bool(kept.get("curved", False)), loads=loads, states=states)


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
