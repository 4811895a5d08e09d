"""Constants of the element types of facets in 3D: sides, polynomials, and bounds on the curvature.

A facet of m nodes is a polynomial of its reference coordinates s and t, with the first m of the terms 1, s, t, st, s^2, t^2,
s^2 t, s t^2, s^2 t^2.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from fastcontact.arrays import Array
from fastcontact.errors import ContactError
from fastcontact.mesh import elements
from fastcontact.mesh.flat_pieces import flat_triangles

_NAMES = {3: "tri3", 4: "quad4", 6: "tri6", 8: "quad8", 9: "quad9"}
_TRIANGLE_SIDES = np.array([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [1.0, 1.0, 1.0]])
_SQUARE_SIDES = np.array([[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, -1.0, 1.0], [0.0, 1.0, 1.0]])
# Powers of s and t in the terms.
_POWERS = np.array([[0, 0], [1, 0], [0, 1], [1, 1], [2, 0], [0, 2], [2, 1], [1, 2], [2, 2]])
# The largest change of the gradient of each term from that at (0, 0), and the largest second derivative (its spectral
# norm), for s and t up to 1.
_GRADIENT_CHANGES = np.sqrt([0, 0, 0, 2, 4, 4, 5, 5, 8])
_SECOND_DERIVATIVES = np.array([0, 0, 0, 1, 2, 2, 1 + 5**0.5, 1 + 5**0.5, 6])


class Tables(NamedTuple):
    """Constants of facets with m nodes, all [-].

    The rows of `weights` are bounds on the contributions of terms of unit size: to the distance from the flat triangles, to
    the change of the tangents, and to the second derivative.
    """

    nodes: Array  # (m, 2): reference coordinates
    sides: Array  # (n_sides, 3): rows (a, b, c) of a s + b t <= c on the facet
    to_terms: Array  # (m, m): from nodes to coefficients of the terms
    weights: Array  # (3, m)


@cache
def tables(n_nodes: int) -> Tables:
    """Return the constants of facets with `n_nodes` nodes; ContactError if there are no such facets."""
    if n_nodes not in _NAMES:
        raise ContactError(f"there are no facets of {n_nodes} nodes in 3D: expected one of {sorted(_NAMES)}")
    nodes = elements.get(_NAMES[n_nodes]).nodes
    sides = _TRIANGLE_SIDES if n_nodes in (3, 6) else _SQUARE_SIDES
    to_terms = np.ascontiguousarray(np.linalg.inv(terms(nodes, n_nodes)))
    weights = np.stack([_interpolation_errors(nodes), _GRADIENT_CHANGES[:n_nodes], _SECOND_DERIVATIVES[:n_nodes]])
    return Tables(nodes, sides, to_terms, weights)


def terms(xi: Array, n_nodes: int) -> Array:
    """Return the terms (n, n_nodes) of a facet's polynomial at reference coordinates (n, 2) [-]."""
    return np.prod(xi[:, None] ** _POWERS[None, :n_nodes], axis=2)


def polynomial_degree(n_nodes: int) -> int:
    """Return the degree of a facet's polynomial in both reference coordinates together."""
    return int(_POWERS[:n_nodes].sum(axis=1).max())


def _interpolation_errors(nodes: Array) -> Array:
    """Return, for each term of the polynomial, the largest error (m,) of its interpolation on the flat triangles [-].

    It is sampled on a grid of 21 points along each side of a triangle.
    """
    weights = np.array([[i, j, 20 - i - j] for i in range(21) for j in range(21 - i)]) / 20.0
    n = len(nodes)
    error = [weights @ terms(nodes[flat], n) - terms(weights @ nodes[flat], n) for flat in flat_triangles(n)]
    return np.abs(error).max(axis=(0, 1))
