"""Contact nodes whose prescribed displacements cause penetration, or separation if tied, against which contact cannot act."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array

from fastcontact.arrays import Array, Mask
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.obstacles.rigid_side import Pose
from fastcontact.contact.pairing import Candidates, gap_rows, rows_along
from fastcontact.errors import ModelError
from fastcontact.model.contact_pair import ContactPair, angle_at
from fastcontact.model.ramp import PartHistory, Ramp, combined, multiplier
from fastcontact.round_off import LENGTH_ROUND_OFF

Pairs = Sequence[tuple[ContactPair, Formulation]]
# Coefficients of a gap below this are zero [-].
STILL = 1e-6
# Depths below this fraction of the largest prescribed displacement are admissible.
SMALL = 1e-3
# Number of instants of a ramp that are checked.
SOME = 20


@dataclass(frozen=True, eq=False)
class Supports:
    """Prescribed displacements: components (n_points, dim), values at multiplier 1 by ramp [length], and the global ramp."""

    fixed: Mask
    by_ramp: Mapping[PartHistory, Array]
    ramp: Ramp

    def instants(self) -> list[float]:
        """Return a sample of the instants of the ramp, including the first and the last."""
        instants = list(self.ramp.instants)
        return [instants[k] for k in np.unique(np.linspace(0, len(instants) - 1, SOME).round().astype(int))]

    def at(self, instant: float) -> Array:
        """Return the displacements (n_points, dim), zero where nothing is prescribed [length]."""
        return combined(self.by_ramp, self.ramp, instant, self.fixed.shape)


@dataclass(frozen=True)
class Overlap:
    """`count` of the `total` nodes that face the other side of a pair penetrate by up to `depth` [length], at `point`."""

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
                f"{_described(contact, formulation, worst)}: contact forces cannot change what supports prescribe; prescribe "
                "other values, or the displacement of nodes that are not in contact"
            )


def prescribed_overlap_warnings(pairs: Pairs, supports: Supports) -> list[str]:
    """Return a warning for each contact with nodes whose prescribed displacements cause penetration."""
    return [
        f"{_described(contact, formulation, worst)}: contact forces cannot change what supports prescribe; leave these nodes "
        "out of the support, or out of the contact ('excluded')"
        for contact, formulation, worst in _overlaps(pairs, supports)
    ]


def _described(contact: ContactPair, formulation: Formulation, overlap: Overlap) -> str:
    position = ", ".join(f"{x:.6g}" for x in formulation.points[overlap.point])
    how = "off" if formulation.options.always_closed else "into"
    other = f"'{contact.primary}'" if contact.primary else "the rigid obstacle"
    return (
        f"supports push {overlap.count} of the {overlap.total} nodes of '{contact.secondary}' {how} {other}, contact "
        f"'{contact.name}', by up to {overlap.depth:.4g} (point {overlap.point} at ({position}), instant {overlap.instant:g})"
    )


def _overlaps(pairs: Pairs, supports: Supports) -> Iterator[tuple[ContactPair, Formulation, Overlap]]:
    """Yield the overlap of each pair at the worst instant, if it is inadmissible."""
    for contact, formulation in pairs:
        side = formulation.secondary
        usable = side.points[~formulation.options.excluded_nodes(side)]
        nodes = usable[supports.fixed[usable].any(axis=1)]
        if not len(nodes) or contact.force or formulation.options.penalty is not None:
            continue
        # Nodes without supports count as facing the other side.
        others = len(usable) - len(nodes)
        candidates = Candidates(nodes[:, None], np.ones((len(nodes), 1)))
        before, _, _ = _gaps(formulation, candidates, Configuration.undeformed(formulation.points), bare=True)
        overlaps = [_at(contact, formulation, candidates, before, supports, instant) for instant in supports.instants()]
        worst = max(overlaps, key=lambda overlap: overlap.depth)
        if worst.count:
            yield contact, formulation, replace(worst, total=worst.total + others)


def _at(
    contact: ContactPair, formulation: Formulation, candidates: Candidates, before: Array, supports: Supports, instant: float
) -> Overlap:  # fmt: skip
    """Return the overlap of some secondary nodes (m,) at an instant, from their gaps `before` (m,) all displacements."""
    displacement, ramp = supports.at(instant), supports.ramp
    obstacle = np.zeros(displacement.shape[1])
    if contact.obstacle is not None:
        obstacle = multiplier(contact.ramp, ramp, instant) * np.array(contact.motion)
    factor = 1.0 if contact.clearance_ramp is None else multiplier(contact.clearance_ramp, ramp, instant)
    pose = Pose(obstacle, angle_at(contact, ramp, instant))
    at = replace(Configuration.displaced(displacement), pose=pose, clearance_factor=factor)
    if formulation.options.tied:
        depth, paired = _torn(formulation, candidates, displacement, supports.fixed)
    else:
        depth, paired = _depth(formulation, candidates, before, at, supports.fixed)
    small = max(SMALL * np.abs(displacement).max(), LENGTH_ROUND_OFF * np.ptp(formulation.points, axis=0).max())
    row = int(np.argmax(depth))
    return Overlap(
        int((depth > small).sum()), int(paired.sum()), float(depth[row]), int(candidates.nodes[row, 0]), instant
    )


def _depth(
    formulation: Formulation, candidates: Candidates, before: Array, at: Configuration, fixed: Mask
) -> tuple[Array, Mask]:
    """Return the penetration depths of nodes (m,) due to supports [length], and which nodes face the other side.

    Depths are zero where the gap depends on unsupported components. Initial overlaps, given by the gaps `before` (m,), are
    subtracted.
    """
    gap, rows, paired = _gaps(formulation, candidates, at)
    if formulation.options.always_closed:
        depth = np.abs(gap) - np.abs(before)
    else:
        depth = -gap - np.maximum(-before, 0.0)
    return np.where(paired & _decided(rows, fixed), np.maximum(depth, 0.0), 0.0), paired


def _gaps(
    formulation: Formulation, candidates: Candidates, at: Configuration, bare: bool = False
) -> tuple[Array, csr_array, Mask]:
    """Return the gaps (m,) of nodes, without clearances if `bare`, their rows (m, n_dofs), and which face the other side."""
    pairing = formulation.facing(candidates, at)
    rows, gap = gap_rows(candidates, pairing, formulation.primary, formulation.points)
    gap = gap + rows @ at.displacement.ravel()
    if not bare:
        factor, reference = at.clearance_factor, formulation.points
        gap = gap + formulation.options.added_gap(candidates, pairing, formulation.primary, reference, factor)
    return np.where(pairing.paired, gap, 0.0), rows, pairing.paired


def _torn(formulation: Formulation, candidates: Candidates, displacement: Array, fixed: Mask) -> tuple[Array, Mask]:
    """Return the relative displacements of tied nodes (m,) due to supports [length], and which nodes face the other side."""
    pairing = formulation.facing(candidates, Configuration.undeformed(formulation.points))
    square = np.zeros(len(pairing.paired))
    for axis in np.eye(fixed.shape[1]):
        direction = np.broadcast_to(axis, pairing.normal.shape)
        rows = rows_along(direction, candidates, pairing, formulation.primary, fixed.size)
        square += np.where(_decided(rows, fixed), rows @ displacement.ravel(), 0.0) ** 2
    return np.sqrt(square), pairing.paired


def _decided(rows: csr_array, fixed: Mask) -> Mask:
    """Return whether each of the rows (m, n_dofs) only depends on supported components."""
    free = np.abs(rows.data) > STILL
    free &= ~fixed.ravel()[rows.indices]
    return np.asarray(np.diff(np.concatenate([[0], np.cumsum(free)])[rows.indptr]) == 0)
