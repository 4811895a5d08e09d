"""Elimination of linear constraints: choice of pivots, and the transformation of vectors."""
