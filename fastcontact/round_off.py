"""Relative sizes of round-off: what is smaller counts as zero."""

from __future__ import annotations

import numpy as np

# Entries that cancel or are rotated, relative to the largest.
ROUND_OFF = 1e-12
# Lengths and energies from coordinates of meshes, which files keep to about ten digits, relative to their size.
LENGTH_ROUND_OFF = 1e-9
# Of a sum, in units of the sum of the sizes of its terms.
SUM_ROUND_OFF = 16 * float(np.finfo(float).eps)
