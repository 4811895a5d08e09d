"""Meshes: points, cells, named groups; elements and quadrature, mesh generators, mesh files."""
