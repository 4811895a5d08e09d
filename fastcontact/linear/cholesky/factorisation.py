"""Sparse Cholesky factorisation: elimination order, symbolic factorisation, and numeric factorisation.

The unknowns that may occur in contact constraints are eliminated last, see `linear.factor_solver`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, coo_array, csc_array, eye_array
from scipy.sparse.linalg import spilu

from fastcontact._jit.parallel import on_one_blas_thread
from fastcontact.arrays import Array, Indices, Mask, Numbers, mask_at, numbers_at
from fastcontact.errors import ModelError
from fastcontact.linear.cholesky import elimination_tree_kernels, factorisation_kernels
from fastcontact.linear.cholesky.symmetric_factors import LowerTriangle, SymmetricFactors
from fastcontact.round_off import LENGTH_ROUND_OFF

# Largest fractions of explicit zeros in merged supernodes (SHARES), for widths up to each of WIDTHS and for larger widths.
WIDTHS, SHARES = np.array([4, 16, 48]), np.array([0.8, 0.5, 0.1, 0.05])


def singular_matrix_error() -> ModelError:
    """Return the error for a matrix with a pivot of zero."""
    return ModelError("the stiffness matrix is singular: support the rigid-body motions of every body")


def fill_reducing_order(K: bsr_array, last: Indices, connected: bool = False) -> Indices:
    """Return the unknowns (n,) of K in a fill-reducing elimination order, with the unknowns `last` (m,) at the end.

    If `connected` is true, the order takes into account that the unknowns `last` are coupled with each other after the
    elimination of all others. Nodes are ordered by the minimum degree algorithm for the pattern of K (Liu, 1985). SciPy
    provides this order only as part of a factorisation by SuperLU. Therefore, an incomplete factorisation is computed that
    drops all entries, which takes little more time than the ordering alone.
    """
    size = K.blocksize[0]
    n = K.shape[0] // size
    pattern = csc_array((np.ones(len(K.indices)), K.indices, K.indptr), shape=(n, n))
    if connected:
        pairs = np.stack(np.meshgrid(nodes := np.unique(last // size), nodes)).reshape(2, -1)
        pattern = pattern + coo_array((np.ones(pairs.shape[1]), pairs), shape=(n, n))
    # A dominant diagonal prevents pivoting. Panels of a single column suffice, because almost nothing is computed.
    pattern = csc_array(pattern + 2.0 * n * eye_array(n))
    incomplete = spilu(
        pattern, drop_tol=1.0, fill_factor=1.0, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, panel_size=1,
        options={"SymmetricMode": True},
    )  # fmt: skip
    order = (np.argsort(incomplete.perm_c)[:, None] * size + np.arange(size)).ravel()
    is_last = np.isin(order, last)
    return np.concatenate([order[~is_last], order[is_last]])


def reordered(K: bsr_array, order: Indices) -> csc_array:
    """Return the symmetric matrix K (n, n) with its unknowns in the order `order` (n,)."""
    rows = K.tocsr()[order][:, order]
    return csc_array((rows.data, rows.indices, rows.indptr), shape=K.shape)  # K is symmetric: its rows are its columns


class OldFactors(NamedTuple):
    """Results of the previous factorisation that the next one may reuse.

    Attributes
    ----------
    entries : ndarray (nnz,)
        Entries of the matrix.
    offsets : ndarray of int (n_supernodes,)
        Offset of the update matrix of each supernode, or -1 if it is not stored.
    factors : tuple of three ndarray
        Entries of L, of D, and of the stored update matrices; see `factorisation_kernels`.
    """

    entries: Array
    offsets: NDArray[np.int64]
    factors: tuple[Array, Array, Array]


NO_FACTORS = np.empty(0), np.empty(0), np.empty(0)


class SymbolicFactors:
    """Symbolic factorisation of symmetric matrices with the same pattern.

    From the second matrix on, those parts of the last factors are reused that depend only on unchanged entries of the matrix,
    for example in the elastic region around a plastic zone. The result is bitwise equal to that of a complete factorisation.

    Parameters
    ----------
    K : bsr_array (n, n)
        A matrix with the common pattern.
    last : ndarray of int (m,)
        Unknowns that are eliminated last.
    repeated : bool, optional
        Whether many matrices will be factorised. In this case, two orders are compared, and the better one is used.
    """

    def __init__(self, K: bsr_array, last: Indices, repeated: bool = False) -> None:
        n = K.shape[0]
        self._pattern, self._last = (K.indptr, K.indices), last
        self._previous = OldFactors(np.empty(0), np.empty(0, np.int64), NO_FACTORS)
        self._entry_numbers: csc_array | None = None
        self._A: csc_array | None  # K in the elimination order, until its factors have been computed
        orders = [fill_reducing_order(K, last, connected) for connected in (False, True)[: 1 + repeated]]
        candidates = [(order, A := reordered(K, order), elimination_tree(A)) for order in orders]
        order, self._A, self._tree = min(candidates, key=lambda entry: np.square(entry[2].entries, dtype=float).sum())
        self._unknowns = order[self._tree.order]
        self._position = numbers_at(self._unknowns, n)
        self._supernodes = supernodes(self._A, self._tree, mask_at(self._position[last], n))
        parent = self._tree.parent[self._supernodes.first[1:] - 1].astype(np.int64)
        self._parent = np.where(parent < 0, -1, np.searchsorted(self._supernodes.first, parent, side="right") - 1)

    def matches(self, K: bsr_array, last: Indices) -> bool:
        """Return whether K has the pattern of this factorisation, and `last` are the unknowns that are eliminated last."""
        return all(map(np.array_equal, (*self._pattern, self._last), (K.indptr, K.indices, last)))

    @on_one_blas_thread
    def factors(self, K: bsr_array) -> SymmetricFactors:
        """Return the factors of a matrix K (n, n) with the pattern of this factorisation [force / length].

        Raises
        ------
        ModelError
            If K is singular or not positive definite.
        """
        (A, *permutation), nodes, n = self._in_elimination_order(K), self._supernodes, K.shape[0]
        width, below = np.diff(nodes.first), np.diff(nodes.row_start)
        start = np.concatenate([[0], np.cumsum(np.repeat(nodes.first[1:] + below, width) - np.arange(n))])
        values, d = np.empty(start[-1]), np.empty(n)
        sizes = factorisation_kernels.work_sizes(self._tree.parent, nodes.first, nodes.row_start)
        reused, saved, updates = self._plan(A, permutation[0])
        failed = factorisation_kernels.factorise(
            A.indptr, A.indices, A.data, *permutation, self._tree.parent, *nodes, sizes, start,
            reused, self._previous.factors, saved, updates, values, d,
        )  # fmt: skip
        if failed >= 0:
            if abs(d[failed]) <= LENGTH_ROUND_OFF * A.diagonal()[permutation[0][failed]]:
                raise singular_matrix_error()
            raise ModelError("the stiffness matrix is not positive definite: check the material and the cells")
        if self._entry_numbers is not None:
            self._previous = OldFactors(A.data, saved, (values, d, updates) if (saved >= 0).any() else NO_FACTORS)
        return SymmetricFactors(LowerTriangle(start, values, *nodes), d, self._position, self._last)

    def _plan(self, A: csc_array, order: Numbers) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
        """Return the offsets `reused` and `saved` of `factorisation_kernels.plan`, and an array for update matrices."""
        nodes, previous, size = self._supernodes, self._previous, 0
        reused, saved = np.full((2, len(self._parent)), -1)
        if len(previous.entries):
            size = factorisation_kernels.plan(
                A.indptr, A.data, previous.entries, order, self._parent, nodes.first, nodes.row_start, previous.offsets,
                reused, saved,
            )  # fmt: skip
        return reused, saved, np.empty(size)

    def _in_elimination_order(self, K: bsr_array) -> tuple[csc_array, Numbers, Numbers]:
        """Return K, its columns in the order of elimination, and the inverse; see `factorisation_kernels.factorise`.

        From the second matrix on, only the lower triangle in this order is returned, for which the positions of the entries
        are cached.
        """
        if self._A is not None:
            A, self._A = self._A, None
            return A, self._tree.order, self._tree.position
        if self._entry_numbers is None:
            numbers = np.arange(K.data.size, dtype=np.int64).reshape(K.data.shape)
            A = reordered(bsr_array((numbers, K.indices, K.indptr), shape=K.shape), self._unknowns).tocoo()
            lower = A.row >= A.col
            self._entry_numbers = csc_array((A.data[lower], (A.row[lower], A.col[lower])), shape=K.shape)
        A, identity = self._entry_numbers, np.arange(K.shape[0], dtype=np.intc)
        return csc_array((K.data.ravel()[A.data], A.indices, A.indptr), shape=K.shape), identity, identity


class Tree(NamedTuple):
    """Elimination tree of a matrix (n, n).

    Attributes
    ----------
    order, position : ndarray of int (n,)
        Postorder of the columns, and its inverse.
    parent : ndarray of int (n,)
        Parent of each column in postorder, -1 for roots.
    entries : ndarray of int (n,)
        Number of entries of each column of L, in postorder.
    """

    order: Numbers
    position: Numbers
    parent: Numbers
    entries: Numbers


class Supernodes(NamedTuple):
    """Supernodes: sets of consecutive columns of L with the same rows below; see `triangular_kernels`.

    Attributes
    ----------
    first : ndarray of int (n_supernodes + 1,)
        First column of each supernode.
    row_start : ndarray of int (n_supernodes + 1,)
        Offset of the rows of each supernode in `rows`.
    rows : ndarray of int
        Rows below the columns of the supernodes.
    """

    first: NDArray[np.int64]
    row_start: NDArray[np.int64]
    rows: Numbers


def elimination_tree(A: csc_array) -> Tree:
    """Return the elimination tree of a symmetric matrix (n, n)."""
    n = A.shape[0]
    parent, count, position, order = (np.empty(n, np.intc) for _ in range(4))
    elimination_tree_kernels.tree_and_counts(A.indptr, A.indices, parent, count)
    elimination_tree_kernels.postorder_positions(parent, position)
    order[position] = np.arange(n, dtype=np.intc)
    ordered_parent = parent[order]
    return Tree(order, position, np.where(ordered_parent < 0, np.intc(-1), position[ordered_parent]), count[order])


def supernodes(A: csc_array, tree: Tree, is_last: Mask) -> Supernodes:
    """Return the supernodes of A (n, n); columns marked in `is_last` (n,) do not share supernodes with other columns."""
    n = A.shape[0]
    first, below = np.empty(n + 1, np.int64), np.empty(n + 1, np.int64)
    count = elimination_tree_kernels.supernodes(tree.parent, tree.entries, is_last, WIDTHS, SHARES, first, below)
    first, row_start = first[: count + 1].copy(), np.concatenate([[0], np.cumsum(below[:count])])
    rows = np.empty(row_start[-1], np.intc)
    order, position, parent = tree.order, tree.position, tree.parent
    elimination_tree_kernels.rows_below(A.indptr, A.indices, order, position, parent, first, row_start, rows)
    return Supernodes(first, row_start, rows)
