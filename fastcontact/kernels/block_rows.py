"""The product of a row of blocks with a vector, in the vectors of the processor.

The compiler makes single numbers of a loop over small blocks: twice the time where the matrix comes from memory, three times
where it lies in the cache. Indices are not checked here.
"""

from __future__ import annotations

from typing import Any

import numba.extending
import numpy as np

from fastcontact._jit import compiled
from fastcontact.kernels import block_rows_code


def product_one_by_one(
    indices: Any, numbers: tuple[Any, ...], x: Any, begin: int, end: int, rows: tuple[int, ...], cols: tuple[int, ...]
) -> tuple[Any, ...]:
    """Return what `product` does, in NumPy."""
    m, n = len(rows), len(cols)
    own = slice(begin * m * n, end * m * n)
    blocks = sum(part[own].astype(x.dtype) for part in numbers).reshape(-1, m, n)
    return tuple(np.einsum("kmn,kn->m", blocks, x.reshape(-1, n)[indices[begin:end]]))


# Returns the sums (m,) over the blocks `begin` to `end` - 1 of their products with x (n_columns * n,). Blocks m x n follow
# each other in `numbers`, whole or in halves (see `halves`); `indices` are their columns, and the block size comes as the
# lengths of two tuples.
product = numba.extending.intrinsic(block_rows_code.product) if compiled() else product_one_by_one
