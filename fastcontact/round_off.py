"""Relative sizes of round-off: what is smaller counts as zero."""

from __future__ import annotations

import numpy as np

# Entries that cancel or are rotated, relative to the largest.
ROUND_OFF = 1e-12
# Lengths, and energies, directions and shape functions that follow from coordinates of meshes, which files keep to about ten
# digits, relative to their size.
LENGTH_ROUND_OFF = 1e-9
# Coordinates and vectors that files or users may give in single precision, relative to their size.
SINGLE_PRECISION = 1e-6
# Of a sum, in units of the sum of the sizes of its terms.
SUM_ROUND_OFF = 16 * float(np.finfo(float).eps)
# Step of central differences, relative to the size of the argument: their error of second order is then about what round-off
# makes of them.
DIFFERENCES = float(np.finfo(float).eps) ** (1.0 / 3.0)
# In place of a divisor that may be zero.
TINY = 1e-300
