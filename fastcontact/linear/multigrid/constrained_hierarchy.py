"""A multigrid hierarchy under eliminated equations: local changes of its levels, made and taken back.

The prolongators stay those without equations, except for the rows of the eliminated unknowns, the pivots. Only Galerkin
products near the pivots change. The changes are stored beside the matrices of the levels, which stay as they are. On the
finest level only diagonal blocks are formed: products with the matrix move displacements and forces at the pivots instead.
Springs between unknowns, such as those across sliding contacts, are added on all levels: beside smooth displacements, which
coarser levels correct, they are far stiffer than the bodies.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, diags_array

from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.multigrid import constrained_kernels, cycle_kernels
from fastcontact.linear.multigrid.hierarchy import Hierarchy, Level
from fastcontact.linear.multigrid.local_change import LocalChange, block_rows, merged, places, renumbered
from fastcontact.linear.multigrid.matrix import BlockMatrix
from fastcontact.linear.springs import Springs

Array = NDArray[np.float64]
Values = NDArray[Any]
Nodes = NDArray[np.intp]
# By how much equations may stiffen a node, beside its own stiffness, before the finest spectrum is estimated again.
STIFFENED = 2.0
# Largest eigenvalue of the finest level, beside its diagonal, from which it counts as wide; 3 to 4 on well-shaped hexahedra.
WIDE = 6.0


class ConstrainedHierarchy:
    """Changes the levels of a hierarchy to those under equations, and back.

    Parameters
    ----------
    hierarchy : Hierarchy
    A : BlockMatrix
        Its finest matrix, all digits.

    Attributes
    ----------
    stiffening : float
        By how much equations stiffen the node that they stiffen most, beside its own stiffness: large where pivots belong to
        a much stiffer body than the unknowns that they follow, which the prolongators of K do not suit.
    """

    def __init__(self, hierarchy: Hierarchy, A: BlockMatrix) -> None:
        self.hierarchy, self.A = hierarchy, A
        self.stiffening = 0.0
        self._kept: list[tuple[Level, Nodes, Values]] = []

    def constrain(self, elimination: Elimination | None, springs: Springs | None = None) -> None:
        """Make the hierarchy that of the matrix under the equations eliminated; None: without equations.

        `springs` are added to the matrix of the hierarchy; only with equations.
        """
        self._undo()
        if elimination is None or not len(elimination.pivots):
            self.hierarchy.coarse.set(None)
            self.hierarchy.set_bounds()
            return
        added = None
        if springs is not None:
            added = SpringChange(springs.under(elimination.pivots, elimination.weights), len(self.A.rows))
        self._change_levels(elimination, added)
        # Equations raise the spectrum of coarser levels, and that of the finest where they or springs stiffen its nodes, or
        # where it is wide already: on flat and on nearly incompressible cells.
        self.hierarchy.set_bounds()
        finest = added is not None or self.stiffening > STIFFENED or self.hierarchy.bounds[0] > WIDE
        self.hierarchy.set_bounds(range(0 if finest else 1, len(self.hierarchy.levels) - 1))

    def _change_levels(self, elimination: Elimination, added: SpringChange | None) -> None:
        top = self.hierarchy.levels[0]
        kind = top.b.dtype
        rounded = elimination.weights.astype(kind)
        top.eliminated = replace(elimination, weights=rounded, force_weights=rounded)
        first = CoarseChange(self.A, elimination)
        if top.P is None:
            self.hierarchy.coarse.set(first.on_finest() + (added.on_finest() if added else 0.0))
            return
        diagonal, change = self._top_diagonal(elimination), first.on_coarse(top.P)
        self.stiffening = self._stiffening(diagonal)
        if added:
            top.springs = added.springs.scaled(1.0, kind)
            diagonal, change = merged(diagonal, added.diagonal()), merged(change, added.on_coarse(top.P))
        self._change_diagonal(top, diagonal)
        for level in self.hierarchy.levels[1:]:
            if level.P is None:
                self.hierarchy.coarse.set(change.scattered(level.n))
                return
            self._change_diagonal(level, change)
            level.change = change.rows(kind)
            change = change.coarser(level.P)

    def _undo(self) -> None:
        for level, nodes, old in self._kept:
            level.inverse.reshape(-1, old.shape[1])[nodes] = old
        self._kept.clear()
        for level in self.hierarchy.levels:
            level.eliminated = level.change = level.springs = None

    def _top_diagonal(self, elimination: Elimination) -> LocalChange:
        """Return by how much the diagonal blocks of the finest level change under the equations."""
        A, W, pivots = self.A, elimination.weights, elimination.pivots
        size, n_nodes = len(A.rows), len(A.indptr) - 1
        nodes = np.unique(np.concatenate([pivots, W.indices]) // size)
        number, place = np.full(n_nodes * size, -1, np.int32), np.full(n_nodes, -1, np.int32)
        number[pivots], place[nodes] = np.arange(len(pivots)), np.arange(len(nodes))
        change = np.zeros(len(nodes) * size * size)
        constrained_kernels.diagonal_change(
            pivots, number, W.indptr, W.indices, W.data, A.indptr, A.indices, A.exact, place, size, change
        )
        return LocalChange.of_diagonal(nodes, change.reshape(-1, size, size))

    def _stiffening(self, change: LocalChange) -> float:
        size = change.size
        of_all = self.hierarchy.levels[0].diagonal.reshape(-1, size * size)[change.nodes]
        own, more = (np.einsum("kii->k", part.reshape(-1, size, size)) for part in (of_all, change.diagonal()))
        return float(np.divide(more, own, out=np.zeros(len(more)), where=own > 0.0).max(initial=0.0))

    def _change_diagonal(self, level: Level, change: LocalChange) -> None:
        """Add the diagonal blocks of a change to those of a level, and remember what the inverses were."""
        size, nodes = len(level.A.rows), change.nodes
        blocks = level.diagonal.reshape(-1, size**2)[nodes].astype(float).ravel() + change.diagonal()
        inverse = np.empty(blocks.size, level.inverse.dtype)
        cycle_kernels.invert_blocks(blocks, size, inverse)
        every = level.inverse.reshape(-1, size**2)
        self._kept.append((level, nodes, every[nodes].copy()))
        every[nodes] = inverse.reshape(-1, size**2)


class SpringChange:
    """What springs add to the finest level and to the next coarser one.

    Parameters
    ----------
    springs : Springs
        Under the equations.
    size : int
        Unknowns of a node.
    """

    def __init__(self, springs: Springs, size: int) -> None:
        self.springs, self._size = springs, size
        self._nodes = np.unique(springs.rows.indices // size)
        self._rows = renumbered(springs.rows, self._nodes, size)

    def on_finest(self) -> csc_array:
        """Return their matrix on all unknowns."""
        return self._matrix(self._nodes, self._rows).scattered(self.springs.rows.shape[1])

    def on_coarse(self, P: BlockMatrix) -> LocalChange:
        """Return their Galerkin product on the next coarser level."""
        size = len(P.cols)
        rows = csr_array(self._rows @ block_rows(P, self._nodes, (int(P.indices.max()) + 1) * size).tocsr())
        nodes = np.unique(rows.indices // size)
        return self._matrix(nodes, renumbered(rows, nodes, size), size)

    def _matrix(self, nodes: Nodes, rows: csr_array, size: int | None = None) -> LocalChange:
        weighted = csr_array(diags_array(self.springs.stiffness) @ rows)
        return LocalChange.of(nodes, csr_array(rows.T @ weighted), size or self._size)

    def diagonal(self) -> LocalChange:
        """Return their diagonal blocks."""
        R, size = self._rows, self._size
        spring = np.repeat(np.arange(R.shape[0]), np.diff(R.indptr))
        pairs, which = np.unique(spring * len(self._nodes) + R.indices // size, return_inverse=True)
        parts = np.zeros((len(pairs), size))
        parts[which, R.indices % size] = R.data
        spring, node = np.divmod(pairs, len(self._nodes))
        blocks = np.zeros((len(self._nodes), size, size))
        np.add.at(blocks, node, self.springs.stiffness[spring, None, None] * parts[:, :, None] * parts[:, None, :])
        return LocalChange.of_diagonal(self._nodes, blocks)


class CoarseChange:
    """What equations change in the Galerkin product of the finest level, ``P.T (T.T A T - A) P``; they say ``u = T u``.

    With D the rows ``weights - 1`` that pivots change by, and K the rows of A at the pivots, it is ``E.T H + H.T E``,
    ``E = D P``, ``H = K P + K[:, pivots] E / 2``.

    Parameters
    ----------
    A : BlockMatrix
    elimination : Elimination
    """

    def __init__(self, A: BlockMatrix, elimination: Elimination) -> None:
        self._size, pivots, m = len(A.rows), elimination.pivots, len(elimination.pivots)
        size, shape = self._size, elimination.weights.shape
        D = csr_array(elimination.weights + csr_array((np.full(m, -1.0), pivots, np.arange(m + 1)), shape=shape))
        own, place = np.unique(pivots // size, return_inverse=True)
        K = csr_array(block_rows(A, own, shape[1]).tocsr()[place * size + pivots % size])
        K.eliminate_zeros()
        self._nodes = np.unique(np.concatenate([D.indices, K.indices]) // size)
        self._D, self._K = (renumbered(M, self._nodes, size) for M in (D, K))
        self._among = self._K[:, places(pivots, self._nodes, size)]
        self._n = shape[1]

    def on_finest(self) -> csc_array:
        """Return ``T.T A T - A``, on all unknowns."""
        half = self._D.T @ (self._K + 0.5 * (self._among @ self._D))
        return LocalChange.of(self._nodes, half + half.T, self._size).scattered(self._n)

    def on_coarse(self, P: BlockMatrix) -> LocalChange:
        """Return the change on the next coarser level."""
        size, rows = len(P.cols), block_rows(P, self._nodes, (int(P.indices.max()) + 1) * len(P.cols)).tocsr()
        E = csr_array(self._D @ rows)
        H = csr_array(self._K @ rows + 0.5 * (self._among @ E))
        nodes = np.unique(np.concatenate([E.indices, H.indices]) // size)
        half = renumbered(E, nodes, size).T @ renumbered(H, nodes, size)
        return LocalChange.of(nodes, half + half.T, size)
