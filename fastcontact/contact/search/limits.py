"""Limits of Newton's method for projections on facets, for kernels of two and three dimensions."""

# Step in reference coordinates below which a projection has converged, and the largest number of iterations.
STEP = 1e-13
MAX_ITERATIONS = 100
# A projection that ends farther beyond its facet than this, in facet lengths, is not trusted.
BEYOND = 1.0
