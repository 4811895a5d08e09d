"""Meshes: points, cells, named groups; elements and quadrature, mesh makers, mesh files."""
