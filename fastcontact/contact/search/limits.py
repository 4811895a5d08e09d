"""Limits of Newton's method for projections on facets, for kernels of two and three dimensions."""

# Largest number of iterations of a projection.
MAX_ITERATIONS = 100
# A projection that ends farther beyond its facet than this, in facet lengths, is not trusted.
BEYOND = 1.0
