"""Fill-reducing order of the unknowns, found without a factorisation, and a matrix in such an order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csc_array, eye_array
from scipy.sparse.linalg import spilu


def fill_reducing(K: bsr_array, last: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the unknowns (n,) in an order of elimination that keeps factors small, those in `last` at the end.

    The order is that of the points, by minimum degree on the pattern of K (Liu, 1985). SciPy offers it only as a part of
    SuperLU's factorisations; an incomplete one that drops every entry costs little more than the order itself.
    """
    size = K.blocksize[0]
    n = K.shape[0] // size
    pattern = csc_array((np.ones(len(K.indices)), K.indices, K.indptr), shape=(n, n))
    # A dominant diagonal, so that nothing is pivoted.
    pattern = csc_array(pattern + 2.0 * n * eye_array(n))
    # Nothing is to be gained from several columns at a time where nearly nothing is computed.
    found = spilu(
        pattern, drop_tol=1.0, fill_factor=1.0, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, panel_size=1,
        options={"SymmetricMode": True},
    )  # fmt: skip
    order = (np.argsort(found.perm_c)[:, None] * size + np.arange(size)).ravel()
    late = np.zeros(len(order), bool)
    late[last] = True
    return np.concatenate([order[~late[order]], order[late[order]]])


def reordered(K: bsr_array, order: NDArray[np.intp]) -> csc_array:
    """Return the symmetric matrix K (n, n) with its unknowns in the given order (n,)."""
    rows = K.tocsr()[order][:, order]
    return csc_array((rows.data, rows.indices, rows.indptr), shape=K.shape)  # its rows are its columns
