"""Cholesky factors with the contact unknowns last: what they look like first, then their numbers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csc_array

from fastcontact._jit.parallel import on_one_blas_thread
from fastcontact.linear.cholesky import elimination_tree_kernels, factorisation_kernels
from fastcontact.linear.cholesky.ordering import fill_reducing, reordered
from fastcontact.linear.cholesky.singular import indefinite, singular
from fastcontact.linear.cholesky.symmetric import Shape, SymmetricFactors

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# Zeros that supernodes may take in so that there are fewer of them, as shares of their entries, by their width.
WIDTHS, SHARES = np.array([4, 16, 48]), np.array([0.8, 0.5, 0.1, 0.05])
# Pivots that are smaller than this in units of what was on the diagonal are round-off.
ROUND_OFF = 1e-10


@on_one_blas_thread
def factors(K: bsr_array, last: Indices) -> SymmetricFactors:
    """Return the factors of the symmetric matrix K (n, n) with the unknowns `last` (m,) last.

    Raises
    ------
    ModelError
        If K is singular or not positive definite.
    """
    n = K.shape[0]
    order = fill_reducing(K, last)
    A = reordered(K, order)
    late = np.zeros(n, bool)
    late[last] = True
    tree = _tree(A)
    nodes = _supernodes(A, tree, late[order[tree.order]])
    width, below = np.diff(nodes.first), np.diff(nodes.begin)
    start = np.concatenate([[0], np.cumsum(np.repeat(nodes.first[1:] + below, width) - np.arange(n))])
    values, d = np.empty(start[-1]), np.empty(n)
    sizes = factorisation_kernels.room(tree.parent, nodes.first, nodes.begin)
    bad = factorisation_kernels.factorise(
        A.indptr, A.indices, A.data, tree.order, tree.place, tree.parent, *nodes, sizes, start, values, d
    )
    if bad >= 0:
        raise singular() if abs(d[bad]) <= ROUND_OFF * A.diagonal()[tree.order[bad]] else indefinite()
    place = np.empty(n, np.intp)
    place[order[tree.order]] = np.arange(n)
    return SymmetricFactors(Shape(start, values, *nodes), d, place, last)


class _Tree(NamedTuple):
    """Elimination tree: its order, the inverse of that, and parents and entries of columns in this order."""

    order: NDArray[np.int32]
    place: NDArray[np.int32]
    parent: NDArray[np.int32]
    entries: NDArray[np.int32]


class _Supernodes(NamedTuple):
    """First columns, where the rows below begin, and these; see `kernels.triangular`."""

    first: NDArray[np.int64]
    begin: NDArray[np.int64]
    rows: NDArray[np.int32]


def _tree(A: csc_array) -> _Tree:
    n = A.shape[0]
    parent, order, count, place = (np.empty(n, np.intc) for _ in range(4))
    elimination_tree_kernels.parents(A.indptr, A.indices, parent)
    elimination_tree_kernels.postordered(parent, order)
    elimination_tree_kernels.counts(A.indptr, A.indices, parent, order, count)
    place[order] = np.arange(n, dtype=np.intc)
    above = parent[order]
    return _Tree(order, place, np.where(above < 0, np.intc(-1), place[above]), count[order])


def _supernodes(A: csc_array, tree: _Tree, late: NDArray[np.bool_]) -> _Supernodes:
    """Return the supernodes, none of which has both columns that are `late` (n,) and others."""
    n = A.shape[0]
    first, below = np.empty(n + 1, np.int64), np.empty(n + 1, np.int64)
    count = elimination_tree_kernels.supernodes(tree.parent, tree.entries, late, WIDTHS, SHARES, first, below)
    first, begin = first[: count + 1].copy(), np.concatenate([[0], np.cumsum(below[:count])])
    rows = np.empty(begin[-1], np.intc)
    elimination_tree_kernels.rows_below(A.indptr, A.indices, tree.order, tree.place, tree.parent, first, begin, rows)
    return _Supernodes(first, begin, rows)
