"""Warnings about facets on curved surfaces: estimated pressure errors due to their sag, the deviation from the true arc.

On an elastic half plane, a gap that varies by d over the length L changes pressures by the order of E d / L with Young's
modulus E, independently of the interference. This estimate is heuristic and calibrated below. Between linear facets, d is
the difference of the gaps of neighbouring nodes, and L the length of the facet. The gaps are those of the formulation: at
the nodes, or means weighted by the shape functions, in which sags of facets of equal length nearly cancel. The mean sag over
the contact changes the interference; d is then this mean, and L the length of the contact. On quadratic facets, d is the
range of the sag. If the other side is an exact rigid shape, d is this range, and L the length of the contact.
"""

from __future__ import annotations

import numpy as np

from fastcontact.analysis.criteria import NOTABLE, WARNING_ERROR
from fastcontact.arrays import Array, Mask, mask_at
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.integration import fine_rule, gauss_rule
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.pairing import Candidates
from fastcontact.contact.surface import Surface
from fastcontact.contact.surface_smoothing import Smoothing
from fastcontact.mesh import elements, quadrature
from fastcontact.results.step import ContactResult
from fastcontact.round_off import TINY

# Estimated error over the mean pressure above which a warning is given, by the order of facets. On rings the errors of nodal
# pressures were 0.2 to 3.2 times the estimate on linear facets, except where contact opens due to the error, and up to 3
# times on quadratic ones. Against rigid shapes the ratio is 0.9 to 1.3, and the limit is WARNING_ERROR.
RELATIVE_ERROR_LIMIT = {1: 0.2, 2: 0.1}
# Ratio of the estimate to E d / L if the gaps are weighted means: the inverse mass matrix amplifies gaps that alternate from
# node to node.
MEAN_GAP_FACTOR = 2.0


def sag_warning(pair: Formulation, configuration: Configuration, contact: ContactResult) -> list[str]:
    """Return a warning if the pressure error of a pair due to sag is large in a step, otherwise an empty list.

    `configuration` and `contact` are the configuration and the result of the pair at the end of the step.
    """
    corrected = pair.smoothing is not None or not isinstance(pair.normals, str)
    if corrected or pair.options.kind in ("tied", "gap_only") or not (contact.pressure > 0.0).any():
        return []
    text = _warning(pair, *_sag(pair, configuration, contact.active), contact)
    text = text or _inclination(pair, configuration, contact)
    return [f"contact '{contact.name}': {text}"] if text else []


def _warning(pair: Formulation, spread: float, slope: float, contact: ContactResult) -> str:
    """Return a warning about the pressure error due to the sag, see `_sag`; an empty string if it is small."""
    side, order = pair.secondary, pair.secondary.order
    length = facet_length(pair.secondary, pair.points)
    limit, power = RELATIVE_ERROR_LIMIT[order], 2 * order - 1
    remedy = "surface_smoothing=True measures the gap between the arcs"
    if isinstance(pair.primary, RigidSide):
        limit, power = WARNING_ERROR, 2 * order
        remedy = "formulation 'node_to_segment' measures the gap at nodes, which lie on the arc"
    mean = float(contact.pressure[contact.pressure > 0.0].mean())
    error = pair.modulus * slope
    if error <= limit * mean:
        return ""
    finer = f"facets of length {length * (limit * mean / error) ** (1.0 / power):.2g} instead of {length:.2g}"
    return (
        f"facets of '{side.group}' and of the other side deviate from their arcs by up to {spread:.3g}, which may change "
        f"pressures by about {error:.3g}, compared with a mean of {mean:.3g}: {remedy}; "
        f"{'quadratic elements, or ' if order == 1 else ''}{finer} reduce the error"
    )


def _inclination(pair: Formulation, configuration: Configuration, contact: ContactResult) -> str:
    """Return a warning if facets that are inclined to the smooth surface change friction; an empty string otherwise.

    Node-to-segment contact acts along the normals of primary facets. If the nodes of both sides coincide, all facets may be
    inclined in the same direction relative to the smooth surface, like the teeth of a ratchet.
    """
    if pair.name != "node_to_segment" or pair.normals != "facet" or not pair.friction:
        return ""
    smooth = -configuration.deformed(pair.secondary, pair.points).nodal_normals
    force, traction = (contact.force_vectors * contact.normal).sum(axis=1), np.linalg.norm(contact.shear, axis=1)
    along = contact.shear / np.maximum(traction, TINY)[:, None]
    inclination = ((contact.normal - smooth) * along).sum(axis=1)
    error, total = abs(float(force @ inclination)), float(force.sum())
    fraction = error / max(pair.friction * total, TINY)
    if fraction <= RELATIVE_ERROR_LIMIT[1] or error <= NOTABLE * total:
        return ""
    return (
        f"facets of the primary side are inclined to the smooth surface, by {np.abs(inclination).max():.2g} rad along the "
        f"friction, which changes tangential forces by about {fraction:.0%} of the friction limit: use the default "
        "formulation, surface_smoothing=True, or smaller facets"
    )


def facet_length(side: Surface, points: Array) -> float:
    """Return the median diameter of the facets of a side, for coordinates `points` (n_points, dim) [length]."""
    return float(np.median(np.concatenate([block.diameters(points) for block in side.blocks])))


def _sag(pair: Formulation, configuration: Configuration, active: Mask) -> tuple[float, float]:
    """Return the range of the sag at closed facets [length], and the ratio d / L of the module's docstring [-]."""
    rules = [_rule(pair, block.element) for block in pair.secondary.blocks]
    points = Candidates.in_facets(pair.secondary, [xi for xi, _ in rules])
    deformed = pair.points + configuration.displacement
    closed = mask_at(pair.secondary.points[active], len(pair.points))
    extent = max(float(np.linalg.norm(np.ptp(pair.points[closed], axis=0))), facet_length(pair.secondary, pair.points))
    if isinstance(pair.primary, RigidSide):
        rows = np.flatnonzero(closed[points.nodes].all(axis=1))
        nodes, pose = points.nodes[rows], configuration.pose
        node_gaps = pair.primary.project(deformed[nodes].reshape(-1, deformed.shape[1]), pose)[0].reshape(nodes.shape)
        point_gaps = pair.primary.project(points.positions(deformed)[rows], pose)[0]
        # Gaps are infinite beyond the edge of a punch.
        facing = np.isfinite(node_gaps).all(axis=1) & np.isfinite(point_gaps)
        sag = np.einsum("nk,nk->n", points.shape[rows[facing]], node_gaps[facing]) - point_gaps[facing]
        spread = float(np.ptp(sag)) if len(sag) else 0.0
        return spread, spread / extent
    smoothing = Smoothing.of(pair.secondary, pair.primary, pair.points)
    pairing = pair.pair_candidates(points, configuration)
    rows = np.flatnonzero(pairing.paired)
    in_contact = closed[points.nodes[rows]].any(axis=1)
    if smoothing is None or not in_contact.any():
        return 0.0, 0.0
    sag = np.full(len(points.nodes), np.nan)
    on_primary = pairing.facet[rows], pairing.xi[rows]
    sag[rows] = smoothing.overlap((points.facet[rows], points.xi[rows]), on_primary, deformed)
    sag_in_contact = sag[rows[in_contact]]
    spread, offset = float(np.ptp(sag_in_contact)), abs(float(sag_in_contact.mean())) / extent
    if pair.secondary.order == 2:
        return spread, spread / facet_length(pair.secondary, pair.points)
    blocks = zip(pair.secondary.blocks, rules, strict=True)
    weights = [np.outer(block.diameters(pair.points), w).ravel() for block, (_, w) in blocks]
    return spread, max(offset, _slope(pair, points, np.concatenate(weights), sag, closed))


def _slope(pair: Formulation, points: Candidates, weights: Array, sag: Array, closed: Mask) -> float:
    """Return the largest difference of the sags of the nodes of a closed linear facet, divided by its length [-].

    `sag` (n,) is the sag at the `points` with integration `weights` (n,), NaN where there is no opposite facet [length]. The
    sag of a node is the mean weighted by its shape function, multiplied by MEAN_GAP_FACTOR. With node-to-segment contact,
    whose points are the nodes, it is the value at the node.
    """
    nodes, n, largest = points.nodes.ravel(), len(pair.points), 0.0
    portions = np.where(np.isnan(sag), 0.0, weights)[:, None] * points.shape
    total = np.bincount(nodes, portions.ravel(), n)
    sums = np.bincount(nodes, (portions * np.nan_to_num(sag)[:, None]).ravel(), n)
    mean = np.divide(sums, total, out=np.full(n, np.nan), where=total > 0.0)
    for block in pair.secondary.blocks:
        slopes = np.ptp(mean[block.facets], axis=1) / block.diameters(pair.points)
        largest = max(largest, float(np.nan_to_num(slopes[closed[block.facets].any(axis=1)]).max(initial=0.0)))
    return largest * (1.0 if pair.name == "node_to_segment" else MEAN_GAP_FACTOR)


def _rule(pair: Formulation, element: str) -> quadrature.Rule:
    """Return the points of a facet where the gap is evaluated, and their weights; its nodes for node-to-segment contact."""
    if pair.name == "node_to_segment":
        nodes = elements.get(element).nodes
        return nodes, np.ones(len(nodes))
    integrates_segments = pair.weighs_gaps and not isinstance(pair.primary, RigidSide)
    return gauss_rule(element, 5) if integrates_segments else fine_rule(element)
