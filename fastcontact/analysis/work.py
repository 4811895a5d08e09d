"""Energy balance of a load step: strain energy, external work, frictional work, penalty energy, and imbalance.

The work of a force in a step is integrated by the trapezoidal rule: it is the mean of the forces at the beginning and at
the end, multiplied by the displacement. There are two exceptions. Sliding friction has its limit traction during the complete
step, whatever it was at the beginning. A normal force does no work on a gap that is open at the beginning or the end of the
step, unless the contact moves over a surface: its force then acts during the complete step, although constraints close and
open.

The external work is the sum of the strain energy, the plastic and frictional work, the energies of penalties and cohesive
layers, the work of contact pressures on the wear depth, and the imbalance. The imbalance is the work of contact forces at
constraints that stay closed or stick. It is an error of long steps, in which normals rotate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array, diags_array

from fastcontact._tools.neighbours import nearest
from fastcontact._tools.records import field, record
from fastcontact.analysis.solution import Solution
from fastcontact.arrays import AnyArray, Array, Mask
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.results.step import ContactResult
from fastcontact.round_off import LENGTH_ROUND_OFF, TINY


@record
class ContactForces:
    """Contact forces of a pair at the end of a load step, from which the work of the next step is integrated.

    Attributes
    ----------
    positions : ndarray (m, dim)
        Reference positions of the m constraints [length].
    pressure, traction : ndarray (m,), ndarray (m, dim)
        Contact pressure and tangential traction at the constraints [pressure].
    energy : ndarray (m,)
        Twice the energy of penalties along the normals [energy].
    rows : sequence of ndarray
        Data, indices and offsets of a sparse matrix (m, n_dofs): the derivatives of the gaps with respect to the
        displacements, times the normal forces [force].
    tangential : ndarray (n_points, dim)
        Nodal forces of the tangential contact forces [force].
    pressing, added : ndarray (n_nodes,)
        Normal forces on the secondary nodes [force], and the contribution of clearances to their gaps [length].
    stored : float
        Energy of penalties, normal and tangential [energy].
    areas : ndarray (m,)
        Areas of the constraints [area]; empty in restart data of early versions.
    """

    positions: Array
    pressure: Array
    traction: Array
    energy: Array
    rows: Sequence[AnyArray]
    tangential: Array
    pressing: Array
    added: Array
    stored: float
    areas: Array = field(default_factory=np.empty(0).copy)

    def at(self, positions: Array, areas: Array) -> tuple[Array, Array]:
        """Return the normal (q,) and tangential (q, dim) forces at `positions` (q, dim) [force].

        At other positions than those of these constraints, they are the tractions of the nearest constraint, times `areas`
        (q,) [area] and a factor that preserves the sum of the normal forces.
        """
        if not len(self.positions):
            return np.zeros(len(positions)), np.zeros_like(positions)
        if np.array_equal(positions, self.positions):
            rows, areas = np.arange(len(positions)), self.areas if self.areas.size else areas
        else:
            rows = nearest(self.positions, positions)[1]
            total = float((areas * np.abs(self.pressure[rows])).sum())
            if self.areas.size and total > 0.0:
                areas = areas * float((self.areas * np.abs(self.pressure)).sum()) / total
        return areas * self.pressure[rows], areas[:, None] * self.traction[rows]

    def carried_to(self, positions: Array, areas: Array) -> tuple[Array, Array]:
        """Return forces as `at` does, but each force acts at the nearest position with an area: resultants are preserved."""
        carrying = np.flatnonzero(areas > 0.0)
        if not (self.areas.size and len(carrying)) or np.array_equal(positions, self.positions):
            return self.at(positions, areas)
        rows, columns = carrying[nearest(positions[carrying], self.positions)[1]], np.arange(len(self.positions))
        transfer = csr_array((self.areas, (rows, columns)), shape=(len(positions), len(columns)))
        return transfer @ self.pressure, transfer @ self.traction

    def passed_on(self, other: ContactForces) -> float:
        """Return the part of the excess of normal forces over those at the other end of the step, `other`, that moves [-].

        A contact that moves over a surface leaves as much force behind as it gains ahead. Such a force acts during the
        complete step, also at constraints that close or open. The part is zero if areas are unknown.
        """
        if not (self.areas.size and other.areas.size):
            return 0.0
        gained, total, total_of_other = self.excess(other), *(float(f.areas @ f.pressure) for f in (self, other))
        lost = gained - total + total_of_other
        return lost / max(gained, lost, TINY)

    def excess(self, other: ContactForces) -> float:
        """Return the sum of what the normal forces exceed those at the other end of the step, `other`, by [force]."""
        return float(np.maximum(self.areas * self.pressure - other.at(self.positions, self.areas)[0], 0.0).sum())

    def pressing_with(self, other: ContactForces, at_one_end: float = 1.0) -> Array:
        """Return the normal forces (n_nodes,) that act on gaps during the step, if `other` are those at its other end.

        Forces of a moving contact at nodes without a force at the other end are multiplied by `at_one_end`.
        """
        return self.pressing * np.where(other.pressing != 0.0, 1.0, at_one_end * self.passed_on(other))

    def normal_work(self, other: ContactForces, displacement: Array) -> tuple[float, float]:
        """Return half the work of normal forces in the step, and the energy of penalties where gaps open or close [energy].

        `other` are the forces at the other end of the step, and `displacement` (n_points, dim) the displacements in the step
        [length]. A constraint without a force at the other end contributes the fraction `passed_on` to the work, and the rest
        to the energy.
        """
        closed = other.at(self.positions, np.ones(len(self.positions)))[0] != 0.0
        fraction = np.where(closed, 1.0, self.passed_on(other))
        data, indices, start = self.rows
        opening = csr_array((data, indices, start), shape=(len(start) - 1, displacement.size)) @ displacement.ravel()
        return -0.5 * float(fraction @ opening), 0.5 * float((1.0 - fraction) @ self.energy)


@dataclass(frozen=True)
class Work:
    """Energies at the end of a load step, and the work of all steps so far [energy].

    Attributes
    ----------
    strain_energy : float
        Strain energy of bodies and springs.
    friction : float
        Frictional work.
    touching : float
        Part of the frictional work that is done in the step in which a gap closes, or in which the contact is lost.
    imbalance : float
        External work that the other terms do not account for.
    stored : float
        Energy of penalties, of cohesive layers and of adhesion.
    released : float
        Energy dissipated by the damage of cohesive layers.
    wear : float
        Work of contact pressures on the increases of the wear depths.
    largest : float
        The largest of these values in all steps so far.
    largest_sliding : float
        The largest of these values in all steps with frictional work.
    plastic : float
        Plastic work.
    """

    strain_energy: float = 0.0
    friction: float = 0.0
    touching: float = 0.0
    imbalance: float = 0.0
    stored: float = 0.0
    largest: float = 0.0
    largest_sliding: float = 0.0
    plastic: float = 0.0
    released: float = 0.0
    wear: float = 0.0

    @property
    def external(self) -> float:
        """External work, done by loads, supports and obstacles [energy]."""
        dissipated = self.plastic + self.friction + self.released + self.wear
        return self.strain_energy + self.stored + dissipated + self.imbalance

    def after(
        self, energy: tuple[float, float], stored: float, added: Sequence[float], released: float = 0.0, wear: float = 0.0
    ) -> Work:  # fmt: skip
        """Return the work after another load step.

        Parameters
        ----------
        energy : (float, float)
            Strain energy and plastic work at the end of the step [energy].
        stored : float
            Energy of penalties, cohesive layers and adhesion at the end of the step [energy].
        added : sequence of three float
            Increments of `friction`, `touching` and the sum of `imbalance` and `wear`, see `contact_work`, of all pairs
            together [energy].
        released : float
            Energy of damage of cohesive layers so far, reversible for adhesion [energy].
        wear : float
            Increment of `wear` [energy].
        """
        friction, touching, contact = added
        sums = self.friction + friction, self.touching + touching, self.imbalance + contact - wear
        work = Work(energy[0], *sums, stored, plastic=energy[1], released=released, wear=self.wear + wear)
        now = max(*energy, work.friction, abs(work.external))
        sliding = max(self.largest_sliding, now) if friction else self.largest_sliding
        return replace(work, largest=max(self.largest, now), largest_sliding=sliding)

    def as_dict(self) -> dict[str, float]:
        """Return these values under the names of `StepResult.work` [energy]."""
        return {
            "strain_energy": self.strain_energy, "plastic_work": self.plastic,
            "external_work": self.external, "friction_work": self.friction,
            "friction_while_touching": self.touching, "penalty_energy": self.stored,
            "energy_released": self.released, "wear_work": self.wear, "imbalance": self.imbalance,
        }  # fmt: skip


def contact_work(
    pair: Formulation, constraints: Constraints, solution: Solution, configuration: Configuration,
    contact: ContactResult, before: ContactForces | None,
) -> tuple[ContactForces, tuple[float, float, float], Array]:  # fmt: skip
    """Return the contact forces of a pair at the end of a load step, and its work in this step.

    Parameters
    ----------
    pair : Formulation
    constraints : Constraints
        Constraints of the pair.
    solution : Solution
        Contact solution of the pair.
    configuration : Configuration
        Configuration at the end of the step.
    contact : ContactResult
        Contact result at the end of the step.
    before : ContactForces, optional
        Contact forces at the beginning of the step; None before the first step.

    Returns
    -------
    forces : ContactForces
    increments : (float, float, float)
        Increments of `Work.friction`, `Work.touching` and the sum of `Work.imbalance` and `Work.wear` [energy].
    slip_integrals : ndarray (m,)
        Integrals of the normal forces over the slips in the step [energy].
    """
    normal, tangents, slip = constraints.contact_forces(solution.multiplier), solution.tangential, solution.slip
    no_tangents = np.zeros((len(constraints), 0, contact.coordinates.shape[1]))
    directions = np.stack(constraints.directions, axis=1) if constraints.tangents else no_tangents
    force, slips = (np.einsum("mk,mkd->md", values, directions) for values in (tangents, slip))
    after = _forces(pair, configuration, constraints, normal, tangents, force, contact)
    if before is None:  # no forces before the first step
        before = replace(
            after, positions=after.positions[:0], pressure=after.pressure[:0], areas=after.areas[:0],
            rows=(np.empty(0), np.empty(0, np.int32), np.zeros(1, np.int32)),
            energy=after.energy[:0], tangential=0.0 * after.tangential, pressing=0.0 * after.pressing, stored=0.0,
        )  # fmt: skip
    normal_before, force_before = before.carried_to(constraints.positions, constraints.finite_areas)
    normals, tangential = (normal_before, normal), (force_before, force)
    left = (normal_before != 0.0) & ~constraints.usable
    if left.any():  # Constraints that slide beyond the end of the other side have no slip there.
        nodes = pair.points[pair.secondary.points]
        slips[left] = pair.nodal_slip(configuration)[nearest(nodes, constraints.positions[left])[1]]
    moved_away = before.passed_on(after)
    left_behind = moved_away and min(moved_away * before.excess(after) / max(float(normal_before.sum()), TINY), 1.0)
    work, touching, slip_integrals = _frictional_work(
        pair, configuration, constraints, solution.work, normals, tangential, slips,
        (after.passed_on(before), moved_away, left_behind),
    )  # fmt: skip
    sliding = -0.5 * float(((tangential[0] + tangential[1]) * slips).sum())
    displacement = configuration.displacement - configuration.start
    if isinstance(pair.primary, RigidSide):  # relative to the obstacle
        displacement[pair.secondary.points] -= pair.rigid_motion(pair.node_candidates.positions, configuration)
    work_after, energy_after = after.normal_work(before, displacement)
    work_before, energy_before = before.normal_work(after, displacement)
    gained = work_after + work_before + energy_after - energy_before
    gained -= 0.5 * float((after.pressing_with(before) + before.pressing_with(after)) @ (after.added - before.added))
    gained -= 0.5 * float(((after.tangential + before.tangential) * displacement).sum())
    return after, (float(work.sum()), touching, gained - (after.stored - before.stored) - sliding), slip_integrals


def _frictional_work(
    pair: Formulation, configuration: Configuration, constraints: Constraints, increments: Array | None,
    normals: tuple[Array, Array], tangential: tuple[Array, Array], slips: Array, passed_on: tuple[float, float, float],
) -> tuple[Array, float, Array]:  # fmt: skip
    """Return the frictional work in a step, its part at constraints that close or open, and integrals of normal forces.

    Parameters
    ----------
    pair : Formulation
    configuration : Configuration
        Configuration of the pair in the step.
    constraints : Constraints
        The m constraints of the pair.
    increments : ndarray (m,), optional
        Frictional work of these constraints by increments, see `Solution.work` [energy].
    normals, tangential : (ndarray (m,), ndarray (m,)), (ndarray (m, dim), ndarray (m, dim))
        Normal and tangential forces at the beginning and at the end of the step [force].
    slips : ndarray (m, dim)
        Slip vectors [length].
    passed_on : (float, float, float)
        `ContactForces.passed_on` of the forces at the end, and of those at the beginning of the step, and the part of the
        latter that leaves its place and acts elsewhere [-].

    Returns
    -------
    work : ndarray (m,)
        Frictional work [energy].
    touching : float
        See `Work.touching` [energy].
    slip_integrals : ndarray (m,)
        Integrals of the normal forces over the slips [energy].
    """
    (normal_before, normal), mu = normals, constraints.friction
    work_at_begin, work_at_end = (-0.5 * np.einsum("md,md->m", forces, slips) for forces in tangential)
    ratio = np.divide(normal_before, normal, out=np.zeros(len(constraints)), where=normal != 0.0)
    moved, moved_away, left_behind = passed_on
    mobilised = np.linalg.norm(tangential[1], axis=1).sum() / max(float(mu @ normal), TINY)
    # Where the contact has left, the surfaces are apart, and tangents are inclined: the slip is that of the new contact.
    slip = float(normal @ np.linalg.norm(slips, axis=1)) / max(float(normal.sum()), TINY)
    leaving = 0.5 * moved_away * mobilised * mu * normal_before * slip
    work = np.where(normal != 0.0, (1.0 + ratio) * work_at_end, np.maximum(work_at_begin, leaving))
    at_once = 1.0
    if increments is not None:
        # In increments, constraints carry no force before they close. Where a contact has moved over the surface, its force
        # acts during the complete step.
        at_once = max(moved, left_behind)
        work = at_once * work + (1.0 - at_once) * increments
    closing = _closing(pair, configuration, constraints, (normal_before == 0.0) & (work_at_end != 0.0))
    touching = (at_once - moved) * float(work_at_end[closing].sum())
    if not normal.any():  # the contact is lost at an unknown instant
        touching += float(work.sum())
    slip_integrals = 0.5 * (1.0 + ratio) * normal * np.linalg.norm(slips, axis=1)
    np.divide(work, mu, out=slip_integrals, where=mu > 0.0)
    return work, touching, slip_integrals


def _closing(pair: Formulation, configuration: Configuration, constraints: Constraints, candidates: Mask) -> Mask:
    """Return which of the candidates (m,) were open at the beginning of the step.

    A constraint was open if this holds for the nearest secondary node that faced the other side at that time.
    """
    if not candidates.any():
        return candidates
    gap = pair.nodal_gap(replace(configuration, displacement=configuration.start, pose=configuration.pose_start))[0]
    facing = np.isfinite(gap)
    if not facing.any():
        return candidates
    was_open = gap[facing] > LENGTH_ROUND_OFF * float(np.ptp(pair.points, axis=0).max())
    return candidates & was_open[nearest(pair.points[pair.secondary.points[facing]], constraints.positions)[1]]


def _forces(
    pair: Formulation, configuration: Configuration, constraints: Constraints, normal: Array, tangents: Array,
    force: Array, contact: ContactResult,
) -> ContactForces:  # fmt: skip
    """Return the contact forces of a pair at the end of a step.

    Parameters
    ----------
    pair : Formulation
    configuration : Configuration
    constraints : Constraints
    normal : ndarray (m,)
        Normal forces [force].
    tangents : ndarray (m, k)
        Tangential forces along each tangent [force].
    force : ndarray (m, dim)
        Tangential forces as vectors [force].
    contact : ContactResult
    """
    size, dim = pair.points.size, contact.coordinates.shape[1]
    rows = csr_array(diags_array(normal) @ constraints.B)[:, :size]
    rows.eliminate_zeros()
    nodal_forces = np.zeros(size)
    for tangent, components in zip(constraints.tangents, tangents.T, strict=False):
        nodal_forces += (tangent.T @ components)[:size]
    force_vectors = rows.sum(axis=0).reshape(-1, dim)[pair.secondary.points]
    normals = np.where(np.isfinite(contact.normal), contact.normal, 0.0)
    inverse_area = 1.0 / np.where(constraints.finite_areas > 0.0, constraints.finite_areas, np.inf)
    penetration = constraints.elastic_gaps(normal) - constraints.wear_softness * normal
    if constraints.law is not None:  # The energy of the law is not that of a linear spring.
        energy = 2.0 * constraints.finite_areas * constraints.law.energy(normal * inverse_area)
        penetration = np.divide(energy, normal, out=np.zeros_like(normal), where=normal != 0.0)
    stored = float(normal @ penetration) + float((constraints.softness[1:] * tangents.T**2).sum())
    all_forces = np.column_stack([normal, tangents]).T
    amplitudes = np.einsum("am,amh->h", all_forces, constraints.low_rank_compliance[: len(all_forces)])
    nodes, added = pair.node_candidates, np.zeros(len(contact.gap))
    if pair.options.clearance is not None or pair.options.clearance_primary is not None:
        pairing = pair.pair_candidates(nodes, configuration, np.inf)
        added = pair.added_gap(nodes, pairing, replace(configuration, wear_depth=None))
    return ContactForces(
        constraints.positions, normal * inverse_area, force * inverse_area[:, None], penetration * normal,
        (rows.data, rows.indices, rows.indptr), nodal_forces.reshape(-1, dim),
        np.einsum("nd,nd->n", force_vectors, normals), added, 0.5 * (stored + float((amplitudes**2).sum())),
        constraints.finite_areas,
    )  # fmt: skip
