"""Equivalent stress of stress components in the order xx, yy, zz, xy."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class VonMisesMaximum(NamedTuple):
    """Largest equivalent stress under a contact.

    Attributes
    ----------
    value : float
        [pressure].
    depth : float
        Distance below the surface, on the axis [length].
    """

    value: float
    depth: float


def von_mises(stress: Array) -> Array:
    """Return the equivalent stress (...) [pressure] of `stress` (..., 4) [pressure], xx, yy, zz, xy (von Mises 1913)."""
    xx, yy, zz, xy = np.moveaxis(stress, -1, 0)
    return np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3.0 * xy**2)
