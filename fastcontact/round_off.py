"""Relative tolerances for round-off, below which values are treated as zero, and related constants."""

from __future__ import annotations

import numpy as np

# Entries of arrays after cancellation or rotation, relative to the largest entry.
ROUND_OFF = 1e-12
# Lengths, energies, directions and shape functions computed from coordinates of meshes, which files store with about ten
# digits, relative to their magnitude.
LENGTH_ROUND_OFF = 1e-9
# Coordinates and vectors that may be given in single precision, relative to their magnitude.
SINGLE_PRECISION = 1e-6
# Round-off of a sum, relative to the sum of the magnitudes of its terms.
SUM_ROUND_OFF = 16 * float(np.finfo(float).eps)
# Step of central differences, relative to the magnitude of the argument, for which truncation and round-off errors are of the
# same order.
DIFFERENCE_STEP = float(np.finfo(float).eps) ** (1.0 / 3.0)
# Lower bound of divisors that may vanish.
TINY = 1e-300
