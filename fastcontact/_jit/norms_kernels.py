# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Norms of long vectors without temporary copies."""

from __future__ import annotations

from fastcontact._jit.decorators import interpretable_kernel
from fastcontact.arrays import Array


def largest(x: Array) -> float:
    """Return the largest ``|x|`` (n,), 0 for an empty array; NaN if an entry is NaN."""
    return float(max(x.max(initial=0.0), -x.min(initial=0.0)))


@interpretable_kernel
def largest_difference(x: Array, y: Array) -> float:
    """Return the largest ``|x - y|`` (n,), 0 for empty arrays; NaN if an entry is NaN."""
    largest = 0.0
    for k in range(len(x)):
        value = x[k] - y[k]
        largest = max(largest, abs(value))
        if value != value:
            return value
    return largest
