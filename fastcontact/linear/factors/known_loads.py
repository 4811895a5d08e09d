"""Reuse of solutions for right-hand sides that are linear combinations of earlier ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from fastcontact.arrays import Array
from fastcontact.round_off import SUM_ROUND_OFF

# Number of stored right-hand sides: loads and supports seldom have more independent ramps.
KEPT = 4


class KnownLoads:
    """Stores the last right-hand sides and solutions, and combines them where that is exact to round-off."""

    def __init__(self) -> None:
        self._loads: list[Array] = []
        self._solutions: list[Array] = []

    def solution(self, f: Array, solve: Callable[[Array], Array]) -> Array:
        """Return the solution (n,) for f (n,); `solve` computes new ones."""
        size = float(np.linalg.norm(f))
        if size == 0.0:
            return np.zeros_like(f)
        weights, left = self._projected(f)
        if len(weights) and np.linalg.norm(left) <= SUM_ROUND_OFF * size:
            return sum((w * u for w, u in zip(weights, self._solutions, strict=True)), np.zeros_like(f))
        f = f / size
        u = solve(f)
        self._keep(f, u)
        return size * u

    def _projected(self, f: Array) -> tuple[Array, Array]:
        """Return the least-squares weights of the stored loads for f, and the remainder (n,)."""
        weights, left = np.zeros(len(self._loads)), f
        if self._loads:
            gram = np.array([[one @ other for other in self._loads] for one in self._loads])
            for _ in range(2):  # a second pass recovers digits lost in the normal equations
                weights = weights + np.linalg.lstsq(gram, [load @ left for load in self._loads], rcond=None)[0]
                left = f - sum((w * load for w, load in zip(weights, self._loads, strict=True)), np.zeros_like(f))
        return weights, left

    def _keep(self, f: Array, u: Array) -> None:
        self._loads, self._solutions = [*self._loads[1 - KEPT :], f], [*self._solutions[1 - KEPT :], u]

    def snapshot(self) -> list[dict[str, Any]]:
        """Return the stored right-hand sides in sparse form: ``places`` and ``values``."""
        places = [np.flatnonzero(f) for f in self._loads]
        return [{"places": at, "values": f[at]} for at, f in zip(places, self._loads, strict=True)]

    def put_back(self, snapshot: Sequence[Mapping[str, Any]], n: int, solve: Callable[[Array], Array]) -> None:
        """Restore the right-hand sides of a `snapshot`, for the same matrix (n, n); solve only for missing ones."""
        now = list(zip(self._loads, self._solutions, strict=True))
        self._loads, self._solutions = [], []
        for entry in snapshot:
            f = np.zeros(n)
            f[entry["places"]] = entry["values"]
            known = [u for load, u in now if np.array_equal(load, f)]
            self._keep(f, known[0] if known else solve(f))
