"""Nodes that constraint equations couple to a much stiffer body: corrections of the smoother and of the coarser levels.

Constraint equations make the unknowns of one side, the pivots, follow the unknowns of the other side: ``u = T u``. If the
body of the pivots is much stiffer, its stiffness is transferred to the nodes of the other side. This has two consequences:

- Motions of these nodes that move no pivot are as soft as their body, but the smoother treats them as stiff. `FreeMotions`
  corrects them with the stiffness of their body alone.
- Motions of aggregates of these nodes and their softer neighbours would move the stiff body, and would have far too much
  energy. Therefore, coarse levels would correct neither side. In corrections from coarser levels, the roles are exchanged:
  the unknowns of the stiffened nodes follow the pivots, ``u = S u`` (`follower_elimination`), and the pivots then follow
  these unknowns as usual. With the prolongator P, the coarse matrices are Galerkin products with ``T S P`` (`compose`).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import bsr_array, coo_array, csc_array, csr_array, diags_array, vstack
from scipy.sparse.linalg import splu

from fastcontact.arrays import AnyArray, Array, Indices
from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.sparse_rows import substituted
from fastcontact.round_off import SINGLE_PRECISION


class FreeMotions:
    """Smoother corrections for motions of stiffened nodes that move no pivot.

    Let W be the weights by which the pivots depend on the stiffened nodes, and D the diagonal blocks of the stiffness
    matrix at these nodes before the elimination of equations. The correction for a residual r is
    ``D^-1 r - D^-1 W.T (W D^-1 W.T)^-1 W D^-1 r``, the solution of ``D u = r`` under the constraints ``W u = 0``.

    Parameters
    ----------
    weights : csr_array (m, n)
        Weights of all m pivots on all n unknowns [-].
    nodes : ndarray of int (k,)
        The stiffened nodes, none of which has a pivot.
    inverse : ndarray (k, size, size)
        Inverses of the diagonal blocks D.
    """

    def __init__(self, weights: csr_array, nodes: Indices, inverse: Array) -> None:
        size, k = inverse.shape[1], len(nodes)
        self._dofs = (nodes[:, None] * size + np.arange(size)).ravel()
        self._inverse = csr_array(bsr_array((inverse, np.arange(k), np.arange(k + 1))))
        W = csr_array(weights[:, self._dofs])
        W = W[np.diff(W.indptr) > 0]
        self._inverse_WT = csr_array(self._inverse @ W.T)
        self._W_inverse = csr_array(self._inverse_WT.T)  # stored by rows for fast products
        compliance = csr_array(W @ self._inverse_WT)
        # Rows of W may be linearly dependent in the precision of the cycle. A small shift keeps the matrix nonsingular.
        shifted = compliance + diags_array(SINGLE_PRECISION * compliance.diagonal(), format="csr")
        self._factors = splu(csc_array(shifted), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})

    def correct(self, r: AnyArray, factor: float, step: AnyArray, x: AnyArray) -> None:
        """Add `factor` times the correction for the residual r (n,) to the last `step` (n,) and to x (n,), in place."""
        residual = r[self._dofs].astype(float)
        multiplier = self._factors.solve(self._W_inverse @ residual)
        correction = (factor * (self._inverse @ residual - self._inverse_WT @ multiplier)).astype(x.dtype)
        step[self._dofs] += correction
        x[self._dofs] += correction


def follower_elimination(elimination: Elimination, nodes: Indices, size: int) -> Elimination:
    """Return the transformation S by which the unknowns of stiffened nodes follow the pivots.

    Each of these unknowns satisfies a mean of the equations that contain it, weighted by its coefficients in them. The other
    unknowns of its side are assumed to have the same displacement, so that common translations of both sides are preserved.

    Parameters
    ----------
    elimination : Elimination
        The transformation T, with sparse weights (m, n).
    nodes : ndarray of int (k,)
        The stiffened nodes, none of which has a pivot.
    size : int
        Number of unknowns of a node.
    """
    pivots, W = elimination.pivots, coo_array(elimination.weights)
    m, n = W.shape
    opposite, stiffened = np.ones(n // size, bool), np.zeros(n // size, bool)
    opposite[pivots // size], stiffened[nodes] = False, True
    is_opposite, direction = opposite[W.col // size], W.col % size
    is_follower = stiffened[W.col // size] & (direction == (pivots % size)[W.row]) & (W.data > 0.0)
    unknowns, column = np.unique(W.col[is_follower], return_inverse=True)
    mean = csr_array((W.data[is_follower], (column, W.row[is_follower])), shape=(len(unknowns), m))
    # Displacement of each pivot due to unit translations of the opposite side along each direction.
    translation = csr_array((W.data[is_opposite], (W.row[is_opposite], direction[is_opposite])), shape=(m, size))
    pivot_motion = np.asarray((mean @ translation).toarray())
    # Unknowns of which translations move no pivot do not follow.
    coupled = pivot_motion[np.arange(len(unknowns)), unknowns % size] >= SINGLE_PRECISION * np.asarray(mean.sum(axis=1))
    unknowns, mean, pivot_motion = unknowns[coupled], csr_array(mean[coupled]), pivot_motion[coupled]
    pivot_terms = csr_array((-W.data[~is_opposite], (W.row[~is_opposite], W.col[~is_opposite])), shape=(m, n))
    pivot_terms = pivot_terms + csr_array((np.ones(m), pivots, np.arange(m + 1)), shape=(m, n))
    dofs_of_nodes = unknowns[:, None] // size * size + np.arange(size)
    row, axis = np.nonzero(~np.isin(dofs_of_nodes, unknowns))
    other_terms = csr_array((pivot_motion[row, axis], (row, dofs_of_nodes[row, axis])), shape=(len(unknowns), n))
    divisor = pivot_motion[np.arange(len(unknowns)), unknowns % size]
    weights = csr_array(diags_array(1.0 / divisor, format="csr") @ (mean @ pivot_terms - other_terms))
    return Elimination(unknowns, weights, np.zeros(len(unknowns)), weights)


def compose(elimination: Elimination, followers: Elimination) -> tuple[Indices, csr_array]:
    """Return the product T S of the transformations, see `follower_elimination`.

    Parameters
    ----------
    elimination : Elimination
        T, with m pivots.
    followers : Elimination
        S, for the q unknowns that follow the pivots.

    Returns
    -------
    unknowns : ndarray of int (m + q,)
        Unknowns whose values T S sets.
    weights : csr_array (m + q, n)
        Weights of all n unknowns in these values [-].
    """
    pivots, S = np.concatenate([elimination.pivots, followers.pivots]), followers.weights
    return pivots, csr_array(vstack([substituted(elimination.weights, followers.pivots, S), S], format="csr"))
