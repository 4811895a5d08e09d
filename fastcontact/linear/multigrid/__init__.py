"""Algebraic multigrid: a hierarchy built once, and a compiled cycle over it."""
