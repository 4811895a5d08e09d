"""Contact nodes whose prescribed displacements cause penetration or, in tied pairs, relative displacements of the sides.

Contact forces cannot change prescribed displacements.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.sparse import csr_array

from fastcontact._tools.records import record, replace
from fastcontact.arrays import Array, Mask
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.obstacles.rigid_side import Pose
from fastcontact.contact.pair_options import ALWAYS_CLOSED
from fastcontact.contact.pairing import Candidates, gap_rows, relative_motion
from fastcontact.errors import ModelError
from fastcontact.linear.sparse_rows import rows_of
from fastcontact.mesh.mesh import vector_text
from fastcontact.model.contact_pair import ContactPair, angle_at
from fastcontact.model.ramp import PartHistory, Ramp, combined, multiplier
from fastcontact.round_off import LENGTH_ROUND_OFF

Pairs = Sequence[tuple[ContactPair, Formulation]]
# Coefficients of displacements in a gap are regarded as zero below this [-].
ZERO_COEFFICIENT = 1e-6
# Depths below this fraction of the largest prescribed displacement are admissible [-].
ADMISSIBLE_DEPTH = 1e-3
# Largest number of instants of a ramp that are checked.
MAX_INSTANTS = 20


@record
class Supports:
    """Prescribed displacements: components (n_points, dim), values at multiplier 1 by ramp [length], and the global ramp."""

    fixed: Mask
    by_ramp: Mapping[PartHistory, Array]
    ramp: Ramp

    def instants(self) -> list[float]:
        """Return at most MAX_INSTANTS evenly distributed instants of the ramp, including the first and the last."""
        instants = self.ramp.instants
        return [instants[k] for k in np.unique(np.linspace(0, len(instants) - 1, MAX_INSTANTS).round().astype(int))]

    def at(self, instant: float) -> Array:
        """Return the displacements (n_points, dim), zero where nothing is prescribed [length]."""
        return combined(self.by_ramp, self.ramp, instant, self.fixed.shape)


@record
class Overlap:
    """Penetration of a contact pair at an instant.

    The number of secondary nodes that face the other side is `total`, and `count` of them penetrate it. The
    largest `depth` [length] occurs at the node `point`.
    """

    count: int
    total: int
    depth: float
    point: int
    instant: float


def check_prescribed(pairs: Pairs, supports: Supports) -> None:
    """Raise ModelError if prescribed displacements make all facing nodes of a contact penetrate the other side."""
    for contact, formulation, worst in _overlaps(pairs, supports):
        if worst.count == worst.total:
            raise ModelError(
                f"{_summary(contact, formulation, worst)}: contact forces cannot change what supports prescribe; prescribe "
                "other values, or the displacement of nodes that are not in contact"
            )


def prescribed_overlap_warnings(pairs: Pairs, supports: Supports) -> list[str]:
    """Return a warning for each contact with nodes whose prescribed displacements cause penetration."""
    return [
        f"{_summary(contact, formulation, worst)}: contact forces cannot change what supports prescribe; leave these nodes "
        "out of the support, or out of the contact ('excluded')"
        for contact, formulation, worst in _overlaps(pairs, supports)
    ]


def _summary(contact: ContactPair, formulation: Formulation, overlap: Overlap) -> str:
    """Return the first part of a message: the number of nodes, the sides and the largest depth."""
    position = vector_text(formulation.points[overlap.point])
    preposition = "off" if formulation.options.kind in ALWAYS_CLOSED else "into"
    side = f"'{contact.primary}'" if contact.primary else "the rigid obstacle"
    return (
        f"supports push {overlap.count} of the {overlap.total} nodes of '{contact.secondary}' {preposition} {side}, contact "
        f"'{contact.name}', by up to {overlap.depth:.4g} (point {overlap.point} at {position}, instant {overlap.instant:g})"
    )


def _overlaps(pairs: Pairs, supports: Supports) -> Iterator[tuple[ContactPair, Formulation, Overlap]]:
    """Yield each pair with inadmissible overlap, its formulation, and its overlap at the instant of the largest depth."""
    for contact, formulation in pairs:
        side = formulation.secondary
        contact_nodes = side.points[~formulation.excluded[side.points]]
        nodes = contact_nodes[supports.fixed[contact_nodes].any(axis=1)]
        if not len(nodes) or contact.force or formulation.options.penalty is not None:
            continue
        # Nodes without supports are included in the total, whether they face the other side or not.
        unsupported = len(contact_nodes) - len(nodes)
        candidates = Candidates.from_nodes(nodes)
        undeformed = replace(Configuration.undeformed(formulation.points), clearance_factor=0.0)
        gap0, _, _ = _gaps(formulation, candidates, undeformed)
        overlaps = [_overlap_at(contact, formulation, candidates, gap0, supports, t) for t in supports.instants()]
        worst = max(overlaps, key=lambda overlap: overlap.depth)
        if worst.count:
            yield contact, formulation, replace(worst, total=worst.total + unsupported)


def _overlap_at(
    contact: ContactPair, formulation: Formulation, candidates: Candidates, gap0: Array, supports: Supports, instant: float
) -> Overlap:  # fmt: skip
    """Return the overlap at an instant of secondary nodes (m,) with the initial gaps `gap0` (m,)."""
    displacement, ramp = supports.at(instant), supports.ramp
    translation = np.zeros(displacement.shape[1])
    if contact.obstacle is not None:
        translation = multiplier(contact.ramp, ramp, instant) * np.array(contact.motion)
    factor = 1.0 if contact.clearance_ramp is None else multiplier(contact.clearance_ramp, ramp, instant)
    pose = Pose(translation, angle_at(contact, ramp, instant))
    configuration = replace(Configuration.displaced(displacement), pose=pose, clearance_factor=factor)
    if formulation.options.kind == "tied":
        depth, paired = _jumps(formulation, candidates, displacement, supports.fixed)
    else:
        depth, paired = _depths(formulation, candidates, gap0, configuration, supports.fixed)
    size = np.ptp(formulation.points, axis=0).max()
    admissible = max(ADMISSIBLE_DEPTH * np.abs(displacement).max(), LENGTH_ROUND_OFF * size)
    row, count = int(np.argmax(depth)), int((depth > admissible).sum())
    return Overlap(count, int(paired.sum()), float(depth[row]), int(candidates.nodes[row, 0]), instant)


def _depths(
    formulation: Formulation, candidates: Candidates, gap0: Array, configuration: Configuration, fixed: Mask
) -> tuple[Array, Mask]:
    """Return the penetration depths (m,) of nodes due to supports [length], and the mask (m,) of paired nodes.

    Depths are zero where the gap depends on unsupported components. Initial penetration, given by the gaps `gap0` (m,),
    is subtracted. In contact that is always closed, the depth is the change in the magnitude of the gap.
    """
    gap, rows, paired = _gaps(formulation, candidates, configuration)
    if formulation.options.kind in ALWAYS_CLOSED:
        depth = np.abs(gap) - np.abs(gap0)
    else:
        depth = -gap - np.maximum(-gap0, 0.0)
    return np.where(paired & _determined_by_supports(rows, fixed), np.maximum(depth, 0.0), 0.0), paired


def _gaps(
    formulation: Formulation, candidates: Candidates, configuration: Configuration
) -> tuple[Array, csr_array, Mask]:
    """Return the gaps (m,) of nodes [length], their rows (m, n_dofs), and the mask (m,) of paired nodes."""
    pairing = formulation.pair_candidates(candidates, configuration)
    motion = relative_motion(candidates, pairing, len(formulation.points))
    rows, gap = gap_rows(motion, pairing, formulation.points)
    gap = gap + rows @ configuration.displacement.ravel()
    gap = gap + formulation.added_gap(candidates, pairing, configuration)
    return np.where(pairing.paired, gap, 0.0), rows, pairing.paired


def _jumps(formulation: Formulation, candidates: Candidates, displacement: Array, fixed: Mask) -> tuple[Array, Mask]:
    """Return the displacement jumps (m,) at tied nodes due to supports [length], and the mask (m,) of paired nodes."""
    pairing = formulation.pair_candidates(candidates, Configuration.undeformed(formulation.points))
    motion = relative_motion(candidates, pairing, len(formulation.points))
    square = np.zeros(len(pairing.paired))
    for axis in np.eye(fixed.shape[1]):
        rows = rows_of(motion, np.broadcast_to(axis, pairing.normal.shape))
        square += np.where(_determined_by_supports(rows, fixed), rows @ displacement.ravel(), 0.0) ** 2
    return np.sqrt(square), pairing.paired


def _determined_by_supports(rows: csr_array, fixed: Mask) -> Mask:
    """Return whether each of the rows (m, n_dofs) depends only on supported components."""
    free = np.abs(rows.data) > ZERO_COEFFICIENT
    free &= ~fixed.ravel()[rows.indices]
    return np.asarray(np.diff(np.concatenate([[0], np.cumsum(free)])[rows.indptr]) == 0)
