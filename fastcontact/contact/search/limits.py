"""Limits of Newton's method for projections on facets, for kernels of two and three dimensions."""

# Step in reference coordinates below which a projection has converged, and the largest number of iterations.
STEP = 1e-13
MAX_ITERATIONS = 100
# Step that is accepted after MAX_ITERATIONS. If facets are much shorter than the surface, the round-off of coordinates,
# divided by the length of a facet, exceeds STEP.
ROUND_OFF_STEP = 1e-10
# Largest overhang of a projection beyond its facet, in facet lengths, at which the projection is accepted.
LARGEST_OVERHANG = 1.0
