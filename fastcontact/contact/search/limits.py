"""Limits of Newton's method for projections on facets, for kernels of two and three dimensions."""

# Step in reference coordinates below which a projection has converged, and the largest number of iterations.
STEP = 1e-13
MAX_ITERATIONS = 100
# Largest overhang of a projection beyond its facet, in facet lengths, at which the projection is accepted.
LARGEST_OVERHANG = 1.0
