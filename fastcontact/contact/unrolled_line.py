"""A contact line as a polyline, parametrised by arc length."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fastcontact._tools.neighbours import nearest
from fastcontact.arrays import Array
from fastcontact.contact.surface import Surface


@dataclass(frozen=True, eq=False)
class UnrolledLine:
    """A line through nodes.

    Attributes
    ----------
    nodes : ndarray (k, 2)
        In order; the first is repeated at the end of a closed line [length].
    abscissa : ndarray (k,)
        Length along the line to each of them [length].
    closed : bool
    """

    nodes: Array
    abscissa: Array
    closed: bool = False

    @property
    def length(self) -> float:
        """Length of the whole line [length]."""
        return float(self.abscissa[-1])

    @classmethod
    def straight(cls, middle: Array, direction: Array, reach: float) -> UnrolledLine:
        """Return a straight line on both sides of `middle` (2,) along `direction` (2,), each `reach` long [length]."""
        return cls(middle + np.outer([-reach, reach], direction), np.array([0.0, 2.0 * reach]))

    def at(self, length: float) -> Array:
        """Return the point (2,) at an arc length along the line [length]."""
        return np.array([np.interp(length, self.abscissa, component) for component in self.nodes.T])

    def lengths(self, positions: Array) -> Array:
        """Return the arc length (n,) of the point of the line nearest to each of `positions` (n, 2) [length]."""
        last = len(self.nodes) - 1
        node = nearest(self.nodes, positions)[1]
        best, arc_length = np.full(len(positions), np.inf), np.zeros(len(positions))
        for piece in (np.clip(node - 1, 0, last - 1), np.clip(node, 0, last - 1)):
            begin, along = self.nodes[piece], self.nodes[piece + 1] - self.nodes[piece]
            size = np.einsum("nd,nd->n", along, along)
            fraction = np.clip(np.einsum("nd,nd->n", positions - begin, along) / size, 0.0, 1.0)
            away = np.linalg.norm(begin + fraction[:, None] * along - positions, axis=1)
            nearer = away < best
            best[nearer] = away[nearer]
            arc_length[nearer] = (self.abscissa[piece] + fraction * np.sqrt(size))[nearer]
        return arc_length


def unrolled(surface: Surface, coordinates: Array, middle: Array | None) -> UnrolledLine | None:
    """Return a surface in the plane as one line; None where it is in several pieces or branches.

    A closed line is cut open opposite to `middle` (2,) [length], or at its lowest point without one.
    """
    if surface.abscissa.any():
        return UnrolledLine(coordinates[surface.points], surface.abscissa)
    order = _loop(surface)
    if order is None:
        return None
    nodes = coordinates[surface.points][order]
    away = -nodes[:, 1] if middle is None else np.linalg.norm(nodes - middle, axis=1)
    nodes = np.roll(nodes, -int(np.argmax(away)), axis=0)
    nodes = np.concatenate([nodes, nodes[:1]])
    lengths = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    return UnrolledLine(nodes, np.concatenate([[0.0], np.cumsum(lengths)]), closed=True)


def _loop(surface: Surface) -> list[int] | None:
    """Return the nodes of a surface, as rows of its points, in order around one closed line; None if it is open."""
    following: dict[int, int] = {}
    for block in surface.blocks:
        middles = block.local[:, 2:]
        chains = np.concatenate([block.local[:, :1], middles, block.local[:, 1:2]], axis=1).tolist()
        for chain in chains:
            for begin, end in pairwise(chain):
                if begin in following:
                    return None
                following[begin] = end
    first = next(iter(following))
    order, here = [first], following.get(first)
    while here is not None and here != first and len(order) <= len(following):
        order.append(here)
        here = following.get(here)
    return order if here == first and len(order) == len(surface.points) else None
