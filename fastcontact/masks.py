"""Masked arrays of NumPy: most of its functions hand on what lies behind a mask as if it were valid, so they are refused."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

REFUSAL = "has entries that are masked, and masks are not kept: fill them first, or leave them out"


def is_masked(value: Any) -> bool:
    """Return whether an array, or one in a series or by name at any depth, has masked entries."""
    if isinstance(value, np.ndarray):
        return isinstance(value, np.ma.MaskedArray) and bool(np.ma.is_masked(value))
    if isinstance(value, Mapping):
        return any(map(is_masked, value.values()))
    return isinstance(value, list | tuple) and any(map(is_masked, value))
