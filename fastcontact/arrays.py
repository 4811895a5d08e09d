"""Types of arrays, the maximum norm, and a test for masked entries, which most functions of NumPy treat as valid numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Mask: TypeAlias = NDArray[np.bool_]
# Indices into arrays; numbers of the points and cells of meshes; arrays of any type.
Indices: TypeAlias = NDArray[np.intp]
Numbers: TypeAlias = NDArray[np.int32]
AnyArray: TypeAlias = NDArray[Any]

# End of the error message about an argument with masked entries.
MASKED_ENTRIES = "has masked entries, which are not supported: fill or remove them"


def largest(x: Array) -> float:
    """Return the maximum norm of an array: the largest ``|x|``, 0 for an empty array, and NaN if an entry is NaN."""
    return float(max(x.max(initial=0.0), -x.min(initial=0.0)))


def is_masked(value: Any) -> bool:
    """Return whether an array, or an array nested in sequences or dictionaries, has masked entries."""
    if isinstance(value, np.ndarray):
        return isinstance(value, np.ma.MaskedArray) and bool(np.ma.is_masked(value))
    if isinstance(value, Mapping):
        return any(map(is_masked, value.values()))
    return isinstance(value, list | tuple) and any(map(is_masked, value))


def scattered(values: Array | float, at: Indices | Numbers, shape: int | tuple[int, ...]) -> Array:
    """Return an array of a `shape` with the `values` (n,), or one value, at the positions `at` (n,), and zeros elsewhere."""
    result = np.zeros(shape)
    result.ravel()[at] = values
    return result


def numbers_at(at: Indices | Numbers, shape: int | tuple[int, ...]) -> Indices:
    """Return an array of a `shape` with the numbers 0 to n - 1 at the positions `at` (n,), and -1 elsewhere."""
    result = np.full(shape, -1, np.intp)
    result.ravel()[at] = np.arange(len(at))
    return result


def mask_at(at: AnyArray, n: int) -> Mask:
    """Return the mask (n,) that is true at the positions `at`."""
    return np.isin(np.arange(n), at)
