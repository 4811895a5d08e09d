"""Nodes constrained to a much stiffer body: corrections of the smoother and of coarser levels.

Equations make the unknowns of one side, the pivots, follow those of the other. If the pivots' side is much stiffer, nodes of
the other side inherit its stiffness, with two consequences:

- Motions that move no pivot are as soft as their own body, while the smoother treats them as stiff. `FreeMotions`
corrects these
  with the stiffness of their body alone.
- Aggregates with softer neighbours would move the stiff body: such coarse motions have far too much energy, and coarse levels
  correct neither side. In coarse corrections the roles are therefore exchanged: the unknowns of stiffened nodes follow the
  pivots, ``u = S u`` (`followers`), and the pivots then follow them as usual, ``u = T u``. Coarse matrices are Galerkin
  products with ``T S P`` (`composed`).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import bsr_array, coo_array, csc_array, csr_array, diags_array, vstack
from scipy.sparse.linalg import splu

from fastcontact.arrays import AnyArray, Array, Indices
from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.round_off import SINGLE_PRECISION

# Unknowns follow the pivots if translations of their side move these by at least this fraction.
LEAST = 0.3


class FreeMotions:
    """Corrections of motions of stiffened nodes that move no pivot.

    With the weights W of the pivots on these nodes and the diagonal blocks D of their body's stiffness, the correction for a
    residual r is ``D^-1 r - D^-1 W.T (W D^-1 W.T)^-1 W D^-1 r``: the solution with D under ``W u = 0``.

    Parameters
    ----------
    weights : csr_array (m, n)
        Weights of the pivots.
    nodes : ndarray of int (k,)
        Those stiffened, without pivots of their own.
    inverse : ndarray (k, size, size)
        Inverses of the diagonal blocks of these nodes without equations.
    """

    def __init__(self, weights: csr_array, nodes: Indices, inverse: Array) -> None:
        size, k = inverse.shape[1], len(nodes)
        self._at = (nodes[:, None] * size + np.arange(size)).ravel()
        self._yielding = csr_array(bsr_array((inverse, np.arange(k), np.arange(k + 1))))
        W = csr_array(weights[:, self._at])
        W = W[np.diff(W.indptr) > 0]
        self._moves = csr_array(self._yielding @ W.T)
        self._pulls = csr_array(self._moves.T)  # stored by rows for fast products
        compliance = csr_array(W @ self._moves)
        # Some are linearly dependent on the stiffened nodes, as far as the cycle's precision tells.
        shifted = compliance + diags_array(SINGLE_PRECISION * compliance.diagonal(), format="csr")
        self._factors = splu(csc_array(shifted), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})

    def correct(self, r: AnyArray, factor: float, step: AnyArray, x: AnyArray) -> None:
        """Add `factor` times the correction for the residual r (n,) to the last `step` (n,) and to x (n,)."""
        residual = r[self._at].astype(float)
        correction = self._yielding @ residual - self._moves @ self._factors.solve(self._pulls @ residual)
        correction = (factor * correction).astype(x.dtype)
        step[self._at] += correction
        x[self._at] += correction


def followers(elimination: Elimination, nodes: Indices, size: int) -> Elimination:
    """Return the transformation S by which the unknowns of stiffened nodes follow the pivots.

    Each unknown follows the mean of its equations, weighted with its coefficients. The other unknowns of its own side are
    assumed to move with it, so that translations of both sides together are preserved.

    Parameters
    ----------
    elimination : Elimination
        T, with sparse weights (m, n).
    nodes : ndarray of int (k,)
        Those stiffened, without pivots of their own.
    size : int
        Unknowns of a node.
    """
    pivots, W = elimination.pivots, coo_array(elimination.weights)
    m, n = W.shape
    opposite, stiffened = np.ones(n // size, bool), np.zeros(n // size, bool)
    opposite[pivots // size], stiffened[nodes] = False, True
    other, along = opposite[W.col // size], W.col % size
    through = stiffened[W.col // size] & (along == (pivots % size)[W.row]) & (W.data > 0.0)
    unknowns, column = np.unique(W.col[through], return_inverse=True)
    share = csr_array((W.data[through], (column, W.row[through])), shape=(len(unknowns), m))
    # Displacement of each pivot for unit translations of the opposite side along each direction.
    together = csr_array((W.data[other], (W.row[other], along[other])), shape=(m, size))
    moved = np.asarray((share @ together).toarray())
    enough = moved[np.arange(len(unknowns)), unknowns % size] >= LEAST * np.asarray(share.sum(axis=1))
    unknowns, share, moved = unknowns[enough], csr_array(share[enough]), moved[enough]
    weights_of_followers = csr_array((-W.data[~other], (W.row[~other], W.col[~other])), shape=(m, n))
    weights_of_followers = weights_of_followers + csr_array((np.ones(m), pivots, np.arange(m + 1)), shape=(m, n))
    beside = unknowns[:, None] // size * size + np.arange(size)
    at, direction = np.nonzero(~np.isin(beside, unknowns))
    across = csr_array((moved[at, direction], (at, beside[at, direction])), shape=(len(unknowns), n))
    by = moved[np.arange(len(unknowns)), unknowns % size]
    weights = csr_array(diags_array(1.0 / by, format="csr") @ (share @ weights_of_followers - across))
    return Elimination(unknowns, weights, np.zeros(len(unknowns)), weights)


def composed(elimination: Elimination, following: Elimination) -> tuple[Indices, csr_array]:
    """Return the unknowns that T S changes, and the weights (m + q, n) of their new values; see `followers`."""
    T, S = elimination.weights, following.weights
    through = csr_array(T[:, following.pivots])
    free = np.ones(T.shape[1])
    free[following.pivots] = 0.0
    pivots = np.concatenate([elimination.pivots, following.pivots])
    return pivots, csr_array(vstack([T @ diags_array(free) + through @ S, S], format="csr"))
