"""Types of arrays by what they hold, and masked arrays, which are refused.

Most functions of NumPy hand on what lies behind a mask as if it were valid.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Mask: TypeAlias = NDArray[np.bool_]
# Places in other arrays; numbers of points and cells, as meshes hold them; numbers of any kind.
Indices: TypeAlias = NDArray[np.intp]
Numbers: TypeAlias = NDArray[np.int32]
AnyArray: TypeAlias = NDArray[Any]

REFUSAL = "has entries that are masked, and masks are not kept: fill them first, or leave them out"


def is_masked(value: Any) -> bool:
    """Return whether an array, or one in a series or by name at any depth, has masked entries."""
    if isinstance(value, np.ndarray):
        return isinstance(value, np.ma.MaskedArray) and bool(np.ma.is_masked(value))
    if isinstance(value, Mapping):
        return any(map(is_masked, value.values()))
    return isinstance(value, list | tuple) and any(map(is_masked, value))
