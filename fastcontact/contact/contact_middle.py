"""Middle of a contact zone, and distances from it on the secondary surface.

In axisymmetry the middle lies on the axis if the surface reaches the axis, or if the surface faces along the axis and its
radius changes monotonically. Otherwise the middle is the centre of pressure. If the contact reaches planes of symmetry, it
is completed by reflection, so that the middle of a half or quarter model lies on these planes. A plane of symmetry is
recognised by supports that prescribe zero displacement along its normal at an end of the surface, if the opposite body does
not extend beyond the plane.

In plane models, positions are arc lengths along the surface, so that a ring is unrolled. The same holds in axisymmetry if
the surface runs along the axis, as in a press fit of cylinders, or is closed, like that of an O-ring. In 3D, positions are
distances from the line through the middle along the mean normal.

A contact that crosses periodic ends is joined there: its parts at the second end are moved to the first one.

The half-width of a contact in a plane model is measured on its projection along the mean normal. For a pin in a hole it is
half the chord, not half the arc.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import diags_array
from scipy.sparse.csgraph import connected_components

from fastcontact._tools.records import record, replace
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.pairing import FACING
from fastcontact.contact.projection import closest
from fastcontact.contact.surface import Surface
from fastcontact.round_off import LENGTH_ROUND_OFF, SINGLE_PRECISION


@record
class UnrolledLine:
    """Polygonal line through the nodes of a surface in 2D.

    Attributes
    ----------
    nodes : ndarray (k, 2)
        Positions of the nodes in order; the first is repeated at the end of a closed line [length].
    abscissa : ndarray (k,)
        Arc length along the line to each node [length].
    period : float
        Arc length after which the line ends where it begins, or is continued by periodicity; 0 otherwise [length].
    """

    nodes: Array
    abscissa: Array
    period: float = 0.0

    def lengths(self, positions: Array) -> Array:
        """Return the arc length (n,) of the point of the line nearest to each of `positions` (n, 2) [length]."""
        segments = np.stack([self.nodes[:-1], self.nodes[1:]], axis=1)
        segment, xi = closest(positions, segments)[:2]
        segment_lengths = np.linalg.norm(np.diff(self.nodes, axis=0), axis=1)
        return np.asarray(self.abscissa[segment] + 0.5 * (1.0 + xi[:, 0]) * segment_lengths[segment])


def unrolled_line(surface: Surface, coordinates: Array, middle: Array | None) -> UnrolledLine | None:
    """Return the line of a surface in 2D; None if the surface has several pieces or branches.

    `coordinates` (n_points, 2) are those of all points [length]. A closed line is cut at the node farthest from `middle` (2,)
    [length] or, without a middle, at its lowest node.
    """
    if surface.abscissa.any():
        return UnrolledLine(coordinates[surface.points], surface.abscissa)
    order = _nodes_of_closed_line(surface)
    if order is None:
        return None
    nodes = coordinates[surface.points][order]
    distance = -nodes[:, 1] if middle is None else np.linalg.norm(nodes - middle, axis=1)
    nodes = np.roll(nodes, -int(np.argmax(distance)), axis=0)
    nodes = np.concatenate([nodes, nodes[:1]])
    lengths = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    abscissa = np.concatenate([[0.0], np.cumsum(lengths)])
    return UnrolledLine(nodes, abscissa, period=float(abscissa[-1]))


def _nodes_of_closed_line(surface: Surface) -> list[int] | None:
    """Return the nodes, numbered on the surface, in order along its closed line; None if it is not a single closed line."""
    # The nodes of each facet in order along the line, without its end.
    chains = [chain for block in surface.blocks for chain in np.delete(block.local, 1, axis=1).tolist()]
    successors = surface.line_neighbours[:, 1].tolist()
    order = [0]
    while (facet := successors[order[-1]]) > 0 and len(order) < len(chains):
        order.append(facet)
    return [node for facet in order for node in chains[facet]] if facet == 0 and len(order) == len(chains) else None


@record
class ContactMiddle:
    """Middle of a contact zone in a load step.

    Attributes
    ----------
    position : ndarray (dim,)
        Position of the middle on the surface, or on the axis [length].
    line : UnrolledLine, optional
        The surface as a line, along which positions are arc lengths.
    start : float
        Arc length at the middle [length].
    reversed : bool
        Whether arc lengths increase against the direction of the line.
    direction : ndarray (dim,), optional
        Direction of the line from which distances are measured [-].
    ignored : tuple of ndarray (dim,)
        Unit vectors along which the model represents an infinite surface [-].
    tangent : ndarray (dim,), optional
        Direction along which half-widths are measured [-]. If None, half-widths are measured by `distances`: for a middle on
        the axis, in 3D, on a ring that is in contact along its complete circumference, and across periodic ends.
    periods : tuple of (ndarray (dim,), ndarray (dim,), ndarray (dim, dim))
        In 3D, corresponding points at the periodic ends which the contact crosses [length], and the rotation from the first
        to the second end [-].
    """

    position: Array
    line: UnrolledLine | None = None
    start: float = 0.0
    reversed: bool = False
    direction: Array | None = None
    ignored: tuple[Array, ...] = ()
    tangent: Array | None = None
    periods: tuple[tuple[Array, Array, Array], ...] = ()

    def distances(self, positions: Array) -> Array:
        """Return the distances (n,) of reference positions (n, dim) from the middle, signed along a line [length]."""
        if self.line is not None:
            arc_length = self.line.lengths(positions) - self.start
            if self.line.period:
                arc_length -= self.line.period * np.round(arc_length / self.line.period)
            return -arc_length if self.reversed else arc_length
        for first, second, rotation in self.periods:
            images = [positions, first + (positions - second) @ rotation, second + (positions - first) @ rotation.T]
            closest_image = np.linalg.norm(np.array(images) - self.position, axis=2).argmin(axis=0)
            positions = np.array(images)[closest_image, np.arange(len(positions))]
        offset = positions - self.position
        for direction in (*self.ignored, *(() if self.direction is None else (self.direction,))):
            offset -= (offset @ direction)[:, None] * direction
        return np.asarray(np.linalg.norm(offset, axis=1))


def contact_middle(pair: Formulation, normal: Array, force: Array, closed: Mask, gap: Array) -> ContactMiddle:
    """Return the middle of a contact.

    Parameters
    ----------
    pair : Formulation
    normal : ndarray (n_nodes, dim)
        Unit normals of the primary side at the points that the secondary nodes face [-].
    force : ndarray (n_nodes,)
        Normal contact forces at the secondary nodes [force].
    closed : ndarray of bool (n_nodes,)
        Nodes in contact.
    gap : ndarray (n_nodes,)
        Gaps; the middle of an open contact is where the gap is smallest [length].
    """
    surface, nodes, crossed = pair.secondary, pair.points[pair.secondary.points], list[tuple[Array, Array, Array]]()
    points, normal = nodes.copy(), normal.copy()
    for first, second, rotation in surface.periodic_ends:
        if first is second:  # a plane of symmetry
            continue
        moved = _parts_at_second_end(surface, closed | (force != 0.0), first, second)
        if moved.any():
            crossed.append((nodes[first[0]], nodes[second[0]], rotation))
            points[moved] = nodes[first[0]] + (points[moved] - nodes[second[0]]) @ rotation
            normal[moved] = normal[moved] @ rotation
    # Weights of the nodes for the centre of pressure; magnitudes if tension nearly cancels or exceeds compression.
    weight = force if float(force.sum()) > SINGLE_PRECISION * float(np.abs(force).sum()) else np.abs(force)
    if (total := float(weight.sum())) > 0:
        weight = weight / total
    else:
        weight = (np.arange(len(gap)) == np.argmin(gap)).astype(float)
    mean = weight @ normal
    dim = points.shape[1]
    meets_axis = np.abs(points[:, 0]).min() <= LENGTH_ROUND_OFF * np.ptp(points, axis=0).max()
    axial = abs(mean[0]) <= abs(mean[1])
    if pair.axisymmetric and (meets_axis or (axial and _radius_is_monotone(surface, pair.points))):
        return ContactMiddle(np.array([0.0, float(weight @ points[:, 1])]), direction=np.array([0.0, 1.0]))
    planes = pair.symmetry_planes
    if closed.any():  # keep only the planes that the contact reaches
        near_closed = surface.node_adjacency @ closed > 0
        planes = [(axis, nodes) for axis, nodes in planes if near_closed[nodes].any()]
    if dim == 2:
        return _middle_in_2d(surface, pair.points, points, weight, planes, mean, crossed)
    return replace(_middle_in_3d(points, weight, planes, mean), periods=tuple(crossed))


def _parts_at_second_end(surface: Surface, closed: Mask, first: Indices, second: Indices) -> Mask:
    """Return the nodes (n_nodes,) of the parts of a contact at the second of two periodic ends that do not reach the first.

    Only one of two coincident nodes, `first` (k,) and `second` (k,), may be `closed` (n_nodes,).
    """
    closed = closed.copy()
    closed[first] = closed[second] = closed[first] | closed[second]
    in_contact = diags_array(closed.astype(float))
    label = connected_components(in_contact @ surface.node_adjacency @ in_contact, directed=False)[1]
    at_first, at_second = (np.unique(label[end[closed[end]]]) for end in (first, second))
    return np.isin(label, np.setdiff1d(at_second, at_first))


def _middle_in_3d(points: Array, weight: Array, planes: list[tuple[Array, Indices]], mean: Array) -> ContactMiddle:
    """Return the middle on a surface in 3D.

    Parallel planes of symmetry at two opposite ends represent an infinite surface. The parameters are the positions (n_nodes,
    3) of the nodes [length], their weights, the `planes` of symmetry, and the weighted `mean` (3,) of the normals.
    """
    centre, unpaired, ignored = weight @ points, list[tuple[Array, float]](), list[Array]()
    for axis, nodes in planes:
        if sum(axis is other for other, _ in planes) == 1:
            unpaired.append((axis, float(points[nodes].mean(axis=0) @ axis)))
        elif not any(axis is other for other in ignored):
            ignored.append(axis)
    if unpaired:
        axes, values = np.stack([axis for axis, _ in unpaired]), np.array([value for _, value in unpaired])
        onto_planes = np.linalg.pinv(axes)
        centre, mean = centre + onto_planes @ (values - axes @ centre), mean - onto_planes @ (axes @ mean)
    length = float(np.linalg.norm(mean))
    direction = mean / length if length > FACING else None
    return ContactMiddle(centre, direction=direction, ignored=tuple(ignored) if len(ignored) < 2 else ())


def _radius_is_monotone(surface: Surface, coordinates: Array) -> bool:
    """Return whether the radius changes monotonically along a surface; True if the surface is not a single line."""
    line = unrolled_line(surface, coordinates, None)
    if line is None:
        return True
    steps, tolerance = np.diff(line.nodes[:, 0]), LENGTH_ROUND_OFF * float(np.ptp(line.nodes, axis=0).max())
    return bool(steps.min() >= -tolerance or steps.max() <= tolerance)


def _middle_in_2d(
    surface: Surface, coordinates: Array, points: Array, weight: Array, planes: list[tuple[Array, Indices]], mean: Array,
    crossed: list[tuple[Array, Array, Array]],
) -> ContactMiddle:  # fmt: skip
    """Return the middle on a surface in a plane model.

    A surface in several pieces is projected along its mean normal. The positions `points` (n_nodes, 2) of the nodes differ
    from their `coordinates` [length] if the contact has `crossed` periodic ends, see `ContactMiddle.periods`.
    """
    length = float(np.linalg.norm(mean))
    centre, tangent = weight @ points, np.array([-mean[1], mean[0]]) / (length or 1.0)
    line = unrolled_line(surface, coordinates, centre if length > FACING else None)
    if line is None:
        size = float(np.ptp(coordinates[surface.points], axis=0).max())
        line = UnrolledLine(centre + np.outer([-size, size], tangent), np.array([0.0, 2.0 * size]))
    lengths = line.lengths(coordinates[surface.points])
    start, backward, direction = float(weight @ lengths), False, tangent if length > FACING else None
    if crossed:
        jump = float(-np.diff(line.lengths(np.array(crossed[0][:2])))[0])
        start = float(weight @ (lengths + jump * (points != coordinates[surface.points]).any(axis=1)))
        if not 0.0 <= start <= line.abscissa[-1]:
            start -= jump
        line, direction = replace(line, period=abs(jump)), None
    elif len(planes) == 1 and not line.period:
        direction, on_plane = planes[0]
        ends = lengths[on_plane]  # both ends of a half ring lie on the plane
        start = float(ends[np.argmin(np.abs(ends - start))])
        backward = start > 0.5 * (lengths.min() + lengths.max())
    position = np.array([np.interp(start, line.abscissa, line.nodes[:, axis]) for axis in range(2)])
    return ContactMiddle(position, line, start, backward, tangent=direction)
