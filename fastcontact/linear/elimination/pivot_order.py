"""Choice of the pivot of each linear equation, the unknown to be eliminated, and inverse of the pivot columns.

Equations are grouped by nodes, or each equation is a group. Pivots are chosen by the first of the following rules that
succeeds:

1. unknowns that no other group involves, or no other group of the same layer or of later layers (`pivots_of_groups`);
2. among the unknowns of the node of an equation, those with sufficiently large entries (`pivots_of_nodes`);
3. the unknowns of rule 1 where there are enough of them, and a matching for the remaining equations
   (`pivots_of_most_groups`);
4. a matching of all equations and unknowns (`matched_pivots`).

The matrix of the pivot columns is inverted block by block if it is block diagonal or block triangular with small blocks.
Otherwise, it is factorised (`coupled_pivots`).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import qr
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, min_weight_full_bipartite_matching

from fastcontact.arrays import Indices, Mask
from fastcontact.linear.elimination.coupled_pivots import (
    CoupledError,
    CoupledPivots,
    DependenceError,
    Inverse,
    SparseInverse,
    block_inverse,
)
from fastcontact.linear.sparse_rows import entry_rows, without_zeros

# Smallest ratio of a pivot to the largest entry of its equation. Without it, `test_weak_unknowns_are_no_pivots` fails.
SMALLEST_PIVOT = 0.25
# Largest size of a block that is inverted instead of being factorised, and largest size of a block that is inverted if it
# cannot be factorised (`test_many_coupled_equations_are_assigned_unknowns`). The latter is also the largest number of
# equations whose pivots are chosen by a dense QR factorisation.
LARGEST_BLOCK, LARGEST_DENSE = 64, 500
# Largest number of layers of equations. The inverse is a sum with one product of sparse matrices for each layer. With one,
# `test_nodes_in_layers_have_a_sparse_inverse` fails.
MAX_LAYERS = 4


def choose_pivots(B: csr_array, nodes: Indices | None = None, size: int = 1) -> tuple[Indices, Inverse]:
    """Return the pivot of each equation, and the inverse of the pivot columns.

    Parameters
    ----------
    B : csr_array (m, n)
        Matrix of the equations, in canonical format, without stored zeros.
    nodes : ndarray of int (m,), optional
        The node of each equation.
    size : int
        Number of unknowns of a node.

    Returns
    -------
    pivots : ndarray of int (m,)
        The unknown that is eliminated from each equation.
    inverse : SparseInverse or CoupledPivots
        Inverse of ``B[:, pivots]`` (m, m).

    Raises
    ------
    DependenceError
        If the equations are linearly dependent.
    """
    if not B.shape[0]:
        return np.empty(0, np.intp), SparseInverse(csr_array((0, 0)))
    pivots = pivots_of_groups(B, np.arange(B.shape[0]) if nodes is None else nodes)
    if pivots is None and nodes is not None:
        pivots = pivots_of_nodes(B, nodes, size)
        pivots = pivots_of_most_groups(B, nodes) if pivots is None else pivots
    pivots = matched_pivots(B) if pivots is None else pivots
    return pivots, column_inverse(B, pivots, size)


def column_inverse(B: csr_array, pivots: Indices, size: int) -> Inverse:
    """Return the inverse of ``B[:, pivots]`` (m, m) as a sparse matrix, or its LU factors.

    B (m, n) is the matrix of the equations, `pivots` (m,) are the eliminated unknowns, and `size` is the number of unknowns
    per node.

    Raises
    ------
    DependenceError
        If the matrix is singular.
    """
    P = csr_array(B[:, pivots])
    if (inverse := _triangular_inverse(P, LARGEST_BLOCK, MAX_LAYERS)) is not None:
        return inverse
    block_size = np.bincount(connected_components(P, directed=False)[1]).max(initial=0)
    if block_size > LARGEST_BLOCK:
        try:
            return CoupledPivots(P, pivots, size)
        except CoupledError:
            if (inverse := _triangular_inverse(P, LARGEST_DENSE, 2 * MAX_LAYERS)) is not None:
                return inverse
            if block_size > LARGEST_DENSE:
                raise
    return SparseInverse(block_inverse(P))


def _triangular_inverse(P: csr_array, max_block_size: int, max_terms: int) -> SparseInverse | None:
    """Return the inverse of P (m, m) if P is block triangular after a permutation, None otherwise.

    The diagonal blocks must have at most `max_block_size` rows, and the inverse must be a sum of at most `max_terms` terms.
    """
    label = connected_components(P, connection="strong")[1]
    if np.bincount(label).max(initial=0) > max_block_size:
        return None
    in_diagonal_block = label[entry_rows(P)] == label[P.indices]
    masks = in_diagonal_block, ~in_diagonal_block
    parts = (csr_array((P.data * mask, P.indices, P.indptr), shape=P.shape, copy=True) for mask in masks)
    diagonal, off_diagonal = map(without_zeros, parts)
    # The inverse of a block triangular matrix is a finite Neumann series.
    total = term = diagonal_inverse = block_inverse(diagonal)
    for _ in range(max_terms):
        term = csr_array(-(diagonal_inverse @ off_diagonal @ term))
        if not term.nnz:
            return SparseInverse(total)
        total = csr_array(total + term)
    return None


def pivots_of_groups(B: csr_array, groups: Indices, layers: int = MAX_LAYERS) -> Indices | None:
    """Return the pivots (m,), chosen among the exclusive unknowns of groups; None if a group has too few of them.

    An unknown is exclusive to a group if no other group of the same or of a later layer involves it. The first layer
    contains the groups with enough exclusive unknowns among all groups, the second layer those with enough among the
    remaining ones, and so on, up to `layers` layers. An example is the set of weighted gaps of quadratic facets with dual
    multipliers: no other midside node involves the unknowns of a midside node, and without the midside nodes the same holds
    for the corners.

    Parameters
    ----------
    B : csr_array (m, n)
        Equations.
    groups : ndarray of int (m,)
        Number of the group of each equation.
    layers : int
        Largest number of layers.
    """
    pivots = _pivots_in_layers(B, groups, layers)
    return pivots if (pivots >= 0).all() else None


def pivots_of_most_groups(B: csr_array, groups: Indices) -> Indices | None:
    """Return the pivots (m,), chosen as by `pivots_of_groups` where possible, and for the other equations by a matching.

    For example, the equations for the slip at supported nodes that stick to a moving side have no exclusive unknowns. The
    result is None if no group has enough exclusive unknowns, or if more than LARGEST_DENSE equations remain. For the
    parameters see `pivots_of_groups`.
    """
    pivots = _pivots_in_layers(B, groups, MAX_LAYERS)
    remaining = np.flatnonzero(pivots < 0)
    if len(remaining) == len(pivots):
        return None
    # A single equation may have an exclusive unknown although its group has too few of them.
    pivots[remaining] = _pivots_in_layers(csr_array(B[remaining]), np.arange(len(remaining)), layers=1)
    remaining = remaining[pivots[remaining] < 0]
    if len(remaining) > LARGEST_DENSE:
        return None
    if len(remaining):
        pivots[remaining] = matched_pivots(csr_array(B[remaining]))
    return pivots


def _pivots_in_layers(B: csr_array, groups: Indices, layers: int) -> Indices:
    """Return the pivots (m,), chosen in up to `layers` layers, and -1 for equations without pivot; see `pivots_of_groups`."""
    m, n = B.shape
    group, row = np.unique(groups, return_inverse=True)[1], entry_rows(B)
    pivots = np.full(m, -1, np.intp)
    for _ in range(layers):
        unassigned = pivots[row] < 0
        lowest, highest = np.full(n, m), np.full(n, -1)
        np.minimum.at(lowest, B.indices[unassigned], group[row[unassigned]])
        np.maximum.at(highest, B.indices[unassigned], group[row[unassigned]])
        pivots_of_group = _pivots_in_groups(B, group, unassigned & (lowest[B.indices] == highest[B.indices]))
        pivots = np.where(pivots < 0, pivots_of_group, pivots)
        if (pivots >= 0).all() or not (pivots_of_group >= 0).any():
            break
    return pivots


def pivots_of_nodes(B: csr_array, nodes: Indices, size: int) -> Indices | None:
    """Return the pivots (m,), chosen among the unknowns of the node of each equation; None if a pivot is too small."""
    row = entry_rows(B)
    pivots = _pivots_in_groups(B, np.unique(nodes, return_inverse=True)[1], B.indices // size == nodes[row])
    return pivots if (pivots >= 0).all() else None


def _pivots_in_groups(B: csr_array, group: Indices, eligible: Mask) -> Indices:
    """Return the pivots (m,) by complete pivoting within each group, in all groups simultaneously.

    A pivot must be at least SMALLEST_PIVOT times the largest entry of its row. If a group has fewer pivots than rows, the
    result is -1 for all its rows.

    Parameters
    ----------
    B : csr_array (m, n)
        Equations.
    group : ndarray of int (m,)
        Number of the group of each equation.
    eligible : ndarray of bool (nnz,)
        Mask of the entries of B that may be pivots. The eligible entries of a column must belong to a single group.
    """
    m, n = B.shape
    row, entries = entry_rows(B), np.flatnonzero(eligible)
    pivots = np.full(m, -1, np.intp)
    if not len(entries):
        return pivots
    pivot_columns = B.indices[np.sort(entries[np.unique(B.indices[entries], return_index=True)[1]])]
    row_rank, col_rank, group_of = _rank_in_group(group), np.zeros(n, np.intp), np.zeros(n, np.intp)
    group_of[B.indices[entries]] = group[row[entries]]
    col_rank[pivot_columns] = _rank_in_group(group_of[pivot_columns])
    blocks = np.zeros((group.max() + 1, row_rank.max() + 1, col_rank.max() + 1))
    blocks[group[row[entries]], row_rank[row[entries]], col_rank[B.indices[entries]]] = B.data[entries]
    equation, unknown = np.zeros(blocks.shape[:2], np.intp), np.zeros((len(blocks), blocks.shape[2]), np.intp)
    equation[group, row_rank], unknown[group_of[pivot_columns], col_rank[pivot_columns]] = np.arange(m), pivot_columns
    count, largest = np.bincount(group), abs(B).max(axis=1).toarray().ravel()
    failed = np.zeros(len(count), bool)
    for n_chosen in range(blocks.shape[1]):
        unfinished = np.flatnonzero((count > n_chosen) & ~failed)
        if not len(unfinished):
            break
        r, c = np.divmod(np.abs(blocks[unfinished]).reshape(len(unfinished), -1).argmax(axis=1), blocks.shape[2])
        chosen_row, pivot = equation[unfinished, r], blocks[unfinished, r, c]
        accepted = (np.abs(pivot) >= SMALLEST_PIVOT * largest[chosen_row]) & (pivot != 0.0)
        failed[unfinished[~accepted]] = True
        unfinished, r, c, chosen_row, pivot = (array[accepted] for array in (unfinished, r, c, chosen_row, pivot))
        pivots[chosen_row] = unknown[unfinished, c]
        # The row of the pivot is eliminated as well, so that it is not selected again.
        factor = blocks[unfinished, :, c] / pivot[:, None]
        blocks[unfinished] -= factor[:, :, None] * blocks[unfinished, r][:, None]
    pivots[failed[group]] = -1
    return pivots


def _rank_in_group(group: Indices) -> Indices:
    """Return, for each entry of `group` (m,), the number (m,) of earlier entries with the same value."""
    order = np.argsort(group, kind="stable")
    position = np.empty(len(group), np.intp)
    position[order] = np.arange(len(group)) - np.searchsorted(group[order], group[order])
    return position


def matched_pivots(B: csr_array) -> Indices:
    """Return pivots (m,) of the equations B (m, n) for which the matrix of the pivot columns is well conditioned.

    The pivots are chosen by a QR factorisation with column pivoting. For more than LARGEST_DENSE equations, they are chosen
    by the bipartite matching of equations and unknowns with the largest product of entries.

    Raises
    ------
    DependenceError
        If there are no m different pivots.
    """
    if B.shape[0] <= LARGEST_DENSE:
        columns = np.unique(B.indices)
        if len(columns) < B.shape[0]:
            raise DependenceError()
        *_, order = qr(B[:, columns].toarray(), mode="r", pivoting=True)
        return np.asarray(columns[order[: B.shape[0]]], np.intp)
    largest = np.abs(B.data).max()
    cost = csr_array((1.0 + np.log(largest) - np.log(np.abs(B.data)), B.indices, B.indptr), shape=B.shape)
    try:
        row, pivots = min_weight_full_bipartite_matching(cost)
    except ValueError:
        raise DependenceError() from None
    return np.asarray(pivots[np.argsort(row)], np.intp)
