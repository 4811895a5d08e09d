"""Sag of facets on curved sides, chord against arc, beside the play between the sides.

Where the normals of neighbouring facets with middles d apart differ by the angle t, their arc has the radius R = d / t, and
the middle of a straight facet of length d lies d^2 / (8 R) = d t / 8 beside it. A parabola through three points of the arc
lies off by R (1 - cos(t / 2))^2 / 8, about d t^3 / 512.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastcontact.contact.configuration import Configuration
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.opposite_nodes import opposite
from fastcontact.contact.surface import FacetBlock, Surface
from fastcontact.mesh import elements

if TYPE_CHECKING:
    from fastcontact.model.model import Model

Array = NDArray[np.float64]
# The sag over the play above which there is a warning; normals that differ by more [radian] meet at an edge of the body.
DOUBTFUL, CREASE = 0.1, 0.7
# The play of sides that fit is nearly uniform: its range relative to its median, beside what sag makes of it.
UNIFORM = 0.5
# Parts of the sag, and of lengths, below which sides touch and facets are straight.
TOUCHING, ROUND_OFF = 0.25, 1e-9


@dataclass(frozen=True)
class Sag:
    """The largest sag of facets [length], the distance of their middles there [length], and whether the side is hollow."""

    largest: float
    length: float
    hollow: bool


def facet_sag(side: Surface, points: Array) -> Sag:
    """Return the sag of the facets of a side, from the `points` (n_points, dim) [length] of the mesh."""
    middle, normal = (np.concatenate(parts) for parts in zip(*(_middles(block, points) for block in side.blocks)))
    pairs = _neighbours(side)
    turn, apart = (values[pairs[:, 0]] - values[pairs[:, 1]] for values in (normal, middle))
    angle = 2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(turn, axis=1), 1.0))
    distance = np.linalg.norm(apart, axis=1)
    sag = distance * (angle / 8.0 if side.order == 1 else angle**3 / 512.0)
    sag[angle > CREASE] = 0.0
    if not (sag > ROUND_OFF * distance).any():
        return Sag(0.0, 0.0, False)
    most = sag.argmax()
    return Sag(float(sag[most]), float(distance[most]), bool((turn[most] * apart[most]).sum() < 0.0))


def _middles(block: FacetBlock, points: Array) -> tuple[Array, Array]:
    """Return the middles (n_facets, dim) of facets and their unit normals (n_facets, dim)."""
    element = elements.get(block.element)
    xi = element.nodes[: element.n_corners].mean(axis=0)[None]
    corners = points[block.facets]
    tangents = np.einsum("nk,fnd->fkd", element.gradient(xi)[0], corners)
    if points.shape[1] == 2:
        normal = tangents[:, 0, ::-1] * [1.0, -1.0]
    else:
        normal = np.cross(tangents[:, 0], tangents[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.einsum("n,fnd->fd", element.shape(xi)[0], corners), normal


def _neighbours(side: Surface) -> NDArray[np.intp]:
    """Return the pairs (n, 2) of facets, numbered through the blocks, that share a node in 2D or an edge in 3D."""
    keys, owner, first = [], [], 0
    for block in side.blocks:
        element = elements.get(block.element)
        ends = np.array([[0, 0], [1, 1]] if element.dim == 1 else element.edges)
        keys.append(np.sort(block.facets[:, ends], axis=2).reshape(-1, 2))
        owner.append(np.repeat(first + np.arange(len(block.facets)), len(ends)))
        first += len(block.facets)
    key, facet = np.concatenate(keys), np.concatenate(owner)
    order = np.lexsort(key.T)
    same = np.flatnonzero((key[order[1:]] == key[order[:-1]]).all(axis=1))
    return np.column_stack([facet[order[same]], facet[order[same + 1]]])


def sag_warnings(model: Model) -> list[str]:
    """Return a warning for each contact pair whose clearance or interference is not large beside the sag of its facets."""
    return [text for pair in model.contact if (text := _warning(pair.name, model.bind(pair), model.mesh.points))]


def _warning(name: str, pair: Formulation, points: Array) -> str:
    sags = {side.group: (facet_sag(side, points), side.order) for side in _sagging(pair, points)}
    if not any(found.largest for found, _ in sags.values()):
        return ""
    group = max(sags, key=lambda own: sags[own][0].largest)
    sag, order = sags[group]
    play = _play(pair, points, sag.largest)
    if play == 0.0 or DOUBTFUL * abs(play) >= sag.largest:
        return ""
    size = sag.length * (DOUBTFUL * abs(play) / sag.largest) ** (0.5 if order == 1 else 0.25)
    kind = "clearance" if play > 0 else "interference"
    return (
        f"contact '{name}': the {kind} of {abs(play):.4g} between its sides is not large beside the sag of the facets of "
        f"'{group}', {sag.largest:.3g} between chord and arc ({sag.largest / abs(play):.0%}): gaps are off by up to as much; "
        f"facets of length {size:.3g} instead of {sag.length:.3g} bring it to {DOUBTFUL:.0%}"
        f"{', or quadratic elements' if order == 1 else ''}"
    )


def _play(pair: Formulation, points: Array, sag: float) -> float:
    """Return the play between two sides that fit, the sag taken out of it [length]; zero where they touch or do not fit."""
    at_rest = Configuration.undeformed(points)
    gap, geometric = (pair.nodal_gap(at_rest, with_clearance)[0] for with_clearance in (True, False))
    facing = np.isfinite(gap)
    if not facing.any():
        return 0.0
    gap, geometric = gap[facing], geometric[facing]
    # Nodes stand on the arc: those near nodes of the other side tell the play, and chords lie inside the arc.
    if isinstance(pair.primary, RigidSide):
        own = float(np.median(geometric))
    else:
        own = float(geometric.max() if facet_sag(pair.primary, points).hollow else geometric.min())
    if abs(own) < max(TOUCHING * sag, ROUND_OFF * float(np.ptp(points, axis=0).max())):
        own = 0.0
    play = own + float(np.median(gap - geometric))
    fits = np.ptp(gap) - 2.0 * sag <= UNIFORM * abs(play)
    return play if fits else 0.0


def _sagging(pair: Formulation, points: Array) -> list[Surface]:
    """Return the sides whose sag enters the gaps: those between whose nodes gaps are measured, and not exact shapes."""
    secondary, primary = pair.secondary, pair.primary
    own = [] if pair.name == "node_to_segment" else [secondary]
    if isinstance(primary, RigidSide):
        return own
    if pair.options.tied or opposite(secondary, primary, points):  # chord faces chord
        return []
    return [*own, primary]
