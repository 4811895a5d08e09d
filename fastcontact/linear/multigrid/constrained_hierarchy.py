"""Multigrid hierarchy for eliminated equations, obtained by local changes of its levels that can be undone.

The prolongators differ from those without equations only in the rows of the eliminated unknowns, called pivots. Therefore,
only the blocks of the Galerkin products near pivots change. These changes are stored separately, and the matrices of the
levels are not modified. On the finest level, only the changes of diagonal blocks are computed, which the smoother uses.
Products with the matrix of the finest level transfer displacements and forces between the pivots and the other unknowns.

Springs between unknowns, such as penalties and the springs of sliding contact, are added on all levels, because they
are much stiffer than the bodies for the smooth displacements that coarser levels correct.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import csc_array

from fastcontact.arrays import AnyArray, Array, Indices
from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.multigrid import cycle_kernels
from fastcontact.linear.multigrid.hierarchy import Hierarchy, Level
from fastcontact.linear.multigrid.local_change import LocalChange, SymmetricChange, sum_of_changes
from fastcontact.linear.multigrid.matrix import BlockMatrix
from fastcontact.linear.multigrid.stiffened_nodes import FreeMotions, compose, follower_elimination
from fastcontact.linear.springs import Springs

# Smallest stiffening factor of a node for which the smoother and the coarser levels are corrected, see `stiffened_nodes`.
# Without the correction, "modulus ratio 0.0001" takes 163 iterations (18 with it; `fastcontact bench robustness`,
# 3 000 unknowns).
SMALLEST_STIFFENING = 4.0


class ConstrainedHierarchy:
    """A multigrid hierarchy whose levels are changed for eliminated equations and springs.

    Parameters
    ----------
    hierarchy : Hierarchy
    A : BlockMatrix
        Matrix of the finest level in double precision.

    Attributes
    ----------
    stiffening : float
        Largest factor by which equations stiffen a node [-]. It is large if the body of the pivots is much stiffer than the
        body of the unknowns on which the pivots depend. The prolongators of the hierarchy are then unsuitable.
    """

    def __init__(self, hierarchy: Hierarchy, A: BlockMatrix) -> None:
        self.hierarchy, self.A = hierarchy, A
        self.stiffening = 0.0
        self._saved: list[tuple[Level, Indices, AnyArray]] = []

    def constrain(self, elimination: Elimination | None, springs: Springs | None = None) -> None:
        """Change the hierarchy to that of the matrix with `springs` added and the equations eliminated.

        None means no equations, or no springs. Earlier changes are reverted.
        """
        self._restore()
        self.stiffening = 0.0
        if elimination is not None and not len(elimination.pivots):
            elimination = None
        reduced = springs
        if springs is not None and elimination is not None:
            reduced = springs.reduced(elimination.pivots, elimination.weights)
        if reduced is not None and not reduced.rows.nnz:  # The springs act only on supported unknowns or on pivots.
            reduced = None
        if elimination is None and reduced is None:
            self.hierarchy.coarse.factorise(None)
            self.hierarchy.set_bounds()
            return
        self._change_levels(elimination, reduced)
        # Equations and springs widen the spectra of all levels. If the bound of the finest level is too low by a tenth, an
        # analysis of blocks with nu = 0.45 takes three times as many iterations.
        self.hierarchy.set_bounds(estimated=True)

    def _change_levels(self, elimination: Elimination | None, springs: Springs | None) -> None:
        """Change all levels for the equations, and for springs to which the elimination has been applied."""
        finest = self.hierarchy.levels[0]
        dtype = finest.b.dtype
        changes = []
        if elimination is not None:
            rounded = elimination.weights.astype(dtype)
            finest.eliminated = replace(elimination, weights=rounded, force_weights=rounded)
            changes.append(SymmetricChange.of_equations(self.A, elimination.pivots, elimination.weights))
        if springs is not None:
            finest.springs = springs.scaled(1.0, dtype)
            changes.append(SymmetricChange.of_springs(springs, len(self.A.rows)))
        if finest.P is None:
            self.hierarchy.coarse.factorise(csc_array(sum(change.matrix() for change in changes)))
            return
        diagonals = [change.diagonal() for change in changes]
        stiffened = None if elimination is None else self._stiffened_nodes(diagonals[0], elimination)
        self._change_diagonal(finest, sum_of_changes(*diagonals))
        if elimination is not None and stiffened is not None and len(stiffened):
            changes = self._exchange_roles(elimination, springs, stiffened, diagonals[1:])
        change = sum_of_changes(*(change.galerkin_product(finest.P) for change in changes))
        for level in self.hierarchy.levels[1:]:
            if level.P is None:
                self.hierarchy.coarse.factorise(change.padded(np.arange(level.n // change.size)).tocsc())
                return
            self._change_diagonal(level, change)
            level.change = change.rows(dtype)
            change = change.galerkin_product(level.P)

    def _restore(self) -> None:
        """Restore the levels to their state without equations and springs."""
        for level, nodes, old in self._saved:
            level.inverse_diagonal.reshape(-1, old.shape[1])[nodes] = old
        self._saved.clear()
        for level in self.hierarchy.levels:
            level.eliminated = level.change = level.springs = None
            level.followers = level.free_motions = None

    def _stiffened_nodes(self, change: LocalChange, elimination: Elimination) -> Indices:
        """Return the nodes without pivots that equations stiffen by more than SMALLEST_STIFFENING, and set `stiffening`.

        `change` is the change of the diagonal blocks due to the equations.
        """
        size = change.size
        old = self.hierarchy.levels[0].diagonal.reshape(-1, size * size)[change.nodes]
        trace, added = (np.einsum("kii->k", blocks.reshape(-1, size, size)) for blocks in (old, change.diagonal()))
        factors = np.divide(added, trace, out=np.zeros(len(added)), where=trace > 0.0)
        self.stiffening = float(factors.max(initial=0.0))
        return change.nodes[(factors > SMALLEST_STIFFENING) & ~np.isin(change.nodes, elimination.pivots // size)]

    def _exchange_roles(
        self, elimination: Elimination, springs: Springs | None, nodes: Indices, spring_changes: list[LocalChange]
    ) -> list[SymmetricChange]:
        """Make stiffened nodes follow the pivots in corrections from coarser levels, and return the changes of these levels.

        `nodes` (k,) contains the numbers of the stiffened nodes, and `spring_changes` the changes of diagonal blocks due to
        springs. See `stiffened_nodes`.
        """
        finest, size = self.hierarchy.levels[0], len(self.A.rows)
        finest.free_motions = FreeMotions(elimination.weights, nodes, self._inverse_blocks(nodes, spring_changes))
        followers = follower_elimination(elimination, nodes, size)
        rounded = followers.weights.astype(finest.b.dtype)
        finest.followers = replace(followers, weights=rounded, force_weights=rounded)
        changes = [SymmetricChange.of_equations(self.A, *compose(elimination, followers))]
        if springs is not None:
            changes.append(SymmetricChange.of_springs(springs.reduced(followers.pivots, followers.weights), size))
        return changes

    def _inverse_blocks(self, nodes: Indices, spring_changes: list[LocalChange]) -> Array:
        """Return the inverses (k, size, size) of the diagonal blocks of `nodes` (k,) on the finest level.

        The blocks include springs, but not the effect of equations.
        """
        size = len(self.A.rows)
        blocks = np.zeros((self.hierarchy.n // size, size**2))
        blocks[nodes] = self.hierarchy.levels[0].diagonal.reshape(-1, size**2)[nodes]
        for change in spring_changes:
            blocks[change.nodes] += change.diagonal().reshape(-1, size**2)
        inverses = np.empty(len(nodes) * size**2)
        cycle_kernels.invert_blocks(blocks[nodes].ravel(), size, inverses)
        return inverses.reshape(-1, size, size)

    def _change_diagonal(self, level: Level, change: LocalChange) -> None:
        """Add the diagonal blocks of `change` to those of a level, update their inverses, and save the old inverses."""
        size, nodes = len(level.A.rows), change.nodes
        blocks = level.diagonal.reshape(-1, size**2)[nodes].astype(float).ravel() + change.diagonal()
        inverse = np.empty(blocks.size, level.inverse_diagonal.dtype)
        cycle_kernels.invert_blocks(blocks, size, inverse)
        inverses = level.inverse_diagonal.reshape(-1, size**2)
        self._saved.append((level, nodes, inverses[nodes].copy()))
        inverses[nodes] = inverse.reshape(-1, size**2)
