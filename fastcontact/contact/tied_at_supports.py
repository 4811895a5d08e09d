"""Equations of a tied pair at nodes that supports hold on both sides.

There the secondary side has one displacement less than the multipliers, which then are not determined: multipliers that
alternate from node to node and die out along the surface do no work. They are reduced as at the ends of mortar lines
(Bernardi, Maday and Patera, 1994, section 3): in a direction that is held on both sides, the multiplier of a node is the
mean of its neighbours', so that uniform tractions remain among them.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csr_array

from fastcontact.arrays import Array, Indices
from fastcontact.round_off import ROUND_OFF


def reduction(frames: Array, held: Array, nodes: Indices, areas: Array, beside: csr_array) -> csr_array:
    """Return the matrix (q dim, q dim) of the multipliers of all equations by those that are left, others being empty.

    Multipliers are forces, component by component along the frames.

    Parameters
    ----------
    frames : ndarray (q, dim, dim)
        Unit vectors along which the equations of the nodes hold, the normal and then tangents [-].
    held : ndarray (q, dim, dim)
        Projectors on the directions in which both sides are held [-].
    nodes : ndarray of int (q,)
        Secondary nodes of the equations.
    areas : ndarray (q,)
        Integrals of their test functions, zero where they hold nothing [area].
    beside : csr_array (n_nodes, n_nodes)
        Which nodes lie in one facet.
    """
    q, dim = held.shape[:2]
    taken = np.trace(held, axis1=1, axis2=2).round().astype(np.intp)
    takers, free = np.flatnonzero(taken), np.eye(dim) - held
    along = np.linalg.norm(np.einsum("qde,qke->qkd", held, frames), axis=2)
    left = np.argsort(np.argsort(-along, axis=1, kind="stable"), axis=1) >= taken[:, None]
    own = np.where(left[:, None], np.einsum("qde,qke->qdk", free, frames), 0.0)
    around = coo_array(csr_array(beside[nodes])[:, nodes][takers])
    gives = (areas[around.col] > 0.0) & (areas[takers[around.row]] > 0.0) & (takers[around.row] != around.col)
    taker, giver = around.row[gives], around.col[gives]
    whole = np.zeros((len(takers), dim, dim))
    np.add.at(whole, taker, free[giver])
    share = held[takers] @ np.linalg.pinv(whole, hermitian=True)
    rows, columns = np.append(np.arange(q), takers[taker]), np.append(np.arange(q), giver)
    size = np.where(areas > 0.0, areas, 1.0)
    tractions = np.concatenate([own, share[taker] @ own[giver]]) * (size[rows] / size[columns])[:, None, None]
    blocks = frames[rows] @ tractions
    blocks[np.abs(blocks) < ROUND_OFF] = 0.0
    row, column = (np.arange(dim) * q + nodes_of[:, None] for nodes_of in (rows, columns))
    row, column = np.broadcast_arrays(row[:, :, None], column[:, None, :])
    reduced = csr_array((blocks.ravel(), (row.ravel(), column.ravel())), shape=(q * dim, q * dim))
    reduced.eliminate_zeros()
    return reduced
