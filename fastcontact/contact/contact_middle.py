"""Centre of a contact zone, and distances from it on the secondary surface.

In axisymmetry the middle is the axis where no two points of the surface have the same radius. Otherwise it is the centre of
pressure of the contact, completed by reflection at the planes of symmetry that it reaches: a half or quarter model has its
middle on these planes. A plane of symmetry is one in which supports hold the nodes at an end of the surface normal to the
plane.

In the plane, coordinates are arc lengths along the surface: a ring is unrolled. The same holds in axisymmetry where the
surface runs along the axis rather than across it, as in a press fit of cylinders, or closes on itself, as that of an O-ring.
In 3D they are distances from the line through the middle along the mean normal.

The half-width of a contact in the plane is that of its projection along the mean normal: half the chord of a pin in its hole,
not half the arc.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fastcontact._tools.neighbours import nearest
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.formulations._formulation import LEANING
from fastcontact.contact.held_motions import TOGETHER, HeldMotions
from fastcontact.contact.pairing import FACING
from fastcontact.contact.projection import nodal_normals
from fastcontact.contact.surface import Surface
from fastcontact.round_off import LENGTH_ROUND_OFF, SINGLE_PRECISION


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


@dataclass(frozen=True, eq=False)
class ContactMiddle:
    """The middle of a contact in one step.

    Attributes
    ----------
    position : ndarray (dim,)
        On the surface [length].
    line : UnrolledLine, optional
        The surface as a line, where coordinates are arc lengths; `start` is the arc length at the middle [length].
    direction : ndarray (dim,), optional
        Direction of the line from which distances are measured [-].
    ignored : tuple of int
        Coordinates along which the model represents an infinite surface.
    tangent : ndarray (dim,), optional
        Direction along which half-widths are measured [-]. If None, as in axisymmetry, in 3D, and on a ring in contact all
        round, half-widths are measured by the distances of `places`.
    """

    position: Array
    line: UnrolledLine | None = None
    start: float = 0.0
    reversed: bool = False
    direction: Array | None = None
    ignored: tuple[int, ...] = ()
    tangent: Array | None = None

    def across(self, positions: Array) -> Array:
        """Return the distances (n,) of reference positions (n, dim) from the middle, projected along its normal [length]."""
        return self.places(positions) if self.tangent is None else (positions - self.position) @ self.tangent

    def places(self, positions: Array) -> Array:
        """Return the distances (n,) of reference positions (n, dim) from the middle, signed along a line [length]."""
        if self.line is not None:
            along = self.line.lengths(positions) - self.start
            if self.line.closed:
                along -= self.line.length * np.round(along / self.line.length)
            return -along if self.reversed else along
        arm = positions - self.position
        arm[:, list(self.ignored)] = 0.0
        if self.direction is not None:
            arm -= (arm @ self.direction)[:, None] * self.direction
        return np.asarray(np.linalg.norm(arm, axis=1))


def contact_middle(pair: Formulation, normal: Array, force: Array, closed: Mask, gap: Array) -> ContactMiddle:
    """Return the middle of a contact.

    Parameters
    ----------
    pair : Formulation
    normal : ndarray (n_nodes, dim)
        Unit normals that the secondary nodes face [-].
    force : ndarray (n_nodes,)
        Their normal contact forces [force].
    closed : ndarray of bool (n_nodes,)
    gap : ndarray (n_nodes,)
        Gaps; an open contact has its middle where the gap is smallest [length].
    """
    surface, points = pair.secondary, pair.points[pair.secondary.points]
    weight = _weights(force, gap)
    mean = weight @ normal
    dim = points.shape[1]
    meets_axis = np.abs(points[:, 0]).min() <= LENGTH_ROUND_OFF * np.ptp(points, axis=0).max()
    if pair.axisymmetric and (
        meets_axis or (abs(mean[0]) <= abs(mean[1]) and _told_apart_by_radius(surface, pair.points))
    ):
        return ContactMiddle(np.array([0.0, float(weight @ points[:, 1])]), direction=np.array([0.0, 1.0]))
    planes = symmetry_planes(surface, pair.points, pair.held)
    if closed.any():  # only the planes that the contact reaches
        reached = [
            any(closed[block.local[np.isin(block.local, nodes).any(axis=1)]].any() for block in surface.blocks)
            for _, nodes in planes
        ]
        planes = [plane for plane, counts in zip(planes, reached, strict=True) if counts]
    if dim == 2:
        return _along_line(surface, pair.points, weight, planes, mean)
    return _in_space(points, weight, planes, mean)


def _in_space(points: Array, weight: Array, planes: list[tuple[int, Indices]], mean: Array) -> ContactMiddle:
    """Return the centre on a surface in 3D; parallel planes of symmetry at both ends represent an infinite surface."""
    centre = weight @ points
    ends: dict[int, list[float]] = {}
    for axis, nodes in planes:
        ends.setdefault(axis, []).append(float(points[nodes, axis].mean()))
    ignored = tuple(axis for axis, values in ends.items() if len(values) > 1)
    if len(ignored) >= 2:
        ignored = ()
    for axis, values in ends.items():
        if len(values) == 1:
            centre[axis], mean[axis] = values[0], 0.0
    length = float(np.linalg.norm(mean))
    return ContactMiddle(centre, direction=mean / length if length > FACING else None, ignored=ignored)


def _told_apart_by_radius(surface: Surface, coordinates: Array) -> bool:
    """Return whether no two points of a surface have the same radius, or it has no order along it."""
    line = unrolled(surface, coordinates, None)
    if line is None:
        return True
    steps, noise = np.diff(line.nodes[:, 0]), LENGTH_ROUND_OFF * float(np.ptp(line.nodes, axis=0).max())
    return bool(steps.min() >= -noise or steps.max() <= noise)


def symmetry_planes(surface: Surface, coordinates: Array, motions: HeldMotions | None) -> list[tuple[int, Indices]]:
    """Return the planes of symmetry at the ends of a surface: their axis, and the nodes of the surface on them.

    `coordinates` (n_points, dim) are those of all points; without supports there are no planes.
    """
    if motions is None:
        return []
    points = coordinates[surface.points]
    held = np.diagonal(motions.at(surface.points), axis1=1, axis2=2) >= TOGETHER**2
    tolerance, planes = SINGLE_PRECISION * float(np.ptp(points, axis=0).max()), []
    across = np.abs(nodal_normals(surface, coordinates)) < LEANING  # otherwise the plane does not cut the surface
    for axis in range(points.shape[1]):
        x = points[:, axis]
        if np.ptp(x) <= 10 * tolerance:
            continue
        for end in (x.min(), x.max()):
            on_end = np.abs(x - end) <= tolerance
            nodes = np.flatnonzero(on_end & held[:, axis] & ~held.all(axis=1) & across[:, axis])
            if len(nodes) and len(nodes) == np.count_nonzero(on_end & ~held.all(axis=1)):
                planes.append((axis, nodes))
    return planes


def _weights(force: Array, gap: Array) -> Array:
    """Return the weights (n_nodes,) of the nodes in the centre of pressure, with sum 1 [-]."""
    weight, total = force, float(force.sum())
    if total <= 1e-6 * float(np.abs(force).sum()):  # no force, or tension of equal magnitude
        weight = np.abs(force)
        total = float(weight.sum())
    if total > 0:
        return np.asarray(weight / total)
    weight = np.zeros(len(force))
    weight[int(np.argmin(gap))] = 1.0
    return weight


def _along_line(
    surface: Surface, coordinates: Array, weight: Array, planes: list[tuple[int, Indices]], mean: Array
) -> ContactMiddle:
    """Return the middle on a surface in the plane; a surface in several pieces is projected along its mean normal."""
    points, length = coordinates[surface.points], float(np.linalg.norm(mean))
    centre, tangent = weight @ points, np.array([-mean[1], mean[0]]) / (length or 1.0)
    line = unrolled(surface, coordinates, centre if length > FACING else None)
    if line is None:
        line = UnrolledLine.straight(centre, tangent, float(np.ptp(points, axis=0).max()))
    lengths = line.lengths(points)
    if len(planes) == 1 and not line.closed:
        axis, on_plane = planes[0]
        ends = lengths[on_plane]  # both ends of a half ring lie on the plane
        start = float(ends[np.argmin(np.abs(ends - weight @ lengths))])
        other_way = start > 0.5 * (lengths.min() + lengths.max())
        return ContactMiddle(line.at(start), line, start, other_way, tangent=np.eye(2)[axis])
    start = float(weight @ lengths)
    return ContactMiddle(line.at(start), line, start, tangent=tangent if length > FACING else None)
