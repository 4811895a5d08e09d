"""Checks of a model before the solution: rigid-body motions, supports, loads, initial penetration and overlapping bodies."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from fastcontact.arrays import Array, Mask
from fastcontact.contact.configuration import Configuration
from fastcontact.errors import ContactError, ModelError
from fastcontact.mesh.mesh import Mesh, node_at
from fastcontact.mesh.topology import bodies
from fastcontact.model.body_overlap import penetration
from fastcontact.model.ramp import Table
from fastcontact.model.rigid_motions import FreeMotions, body_name, grouped_by_body
from fastcontact.round_off import SINGLE_PRECISION

if TYPE_CHECKING:
    from fastcontact.contact.formulations import Formulation


def check_motions(mesh: Mesh, motions: FreeMotions, tipping: str = "") -> None:
    """Raise ModelError with the names of bodies and motions if any rigid-body motion is unrestrained.

    `tipping` names bodies that the loads tip over.
    """
    if not len(motions):
        return
    if tipping:
        raise ModelError(tips_over(tipping))
    total, hinges = len(motions), ""
    if len(motions.hinges):
        hinges = (
            f". Parts of bodies are connected only at nodes (number: {len(motions.hinges)}, first: "
            f"{node_at(mesh, motions.hinges[0])}): merge whole facets, or leave the parts separate and define the contact"
        )
    raise ModelError(
        f"{total} rigid-body motion{'s are' if total > 1 else ' is'} not restrained: {grouped_by_body(motions.names())}. "
        "Fix or prescribe a displacement component that stops each, or let a load press the body against a contact"
        f"{hinges}"
    )


def tips_over(motions: str) -> str:
    """Return the message for bodies that tip over, given with their motions."""
    return (
        f"the loads tip bodies over, and there is no equilibrium ({motions}, which opens the contact): lower the loads or "
        "their lever arms, or add supports or weak springs (add_spring)"
    )


def check_ramps(named_tables: Iterable[tuple[str, Table | None]], load_factors: Iterable[float]) -> None:
    """Raise ModelError if one of the tables (name, table) of loads, supports and constraints does not cover the steps.

    The steps end at the `load_factors`.
    """
    load_factors = list(load_factors)
    for name, table in named_tables:
        outside = [t for t in load_factors if table is not None and not table[0][0] <= t <= table[-1][0]]
        if outside and table is not None:
            raise ModelError(
                f"the ramp of {name} covers {table[0][0]:g} to {table[-1][0]:g}, but a load step ends at "
                f"{outside[0]:g}: extend the table"
            )


def check_forces(mesh: Mesh, forces: Array, related: Mask, name: str) -> None:
    """Raise ModelError if `forces` (n_points, dim) [force] of load `name` act on points that belong to no solid cell.

    Points with multi-point constraints or springs, which the mask `related` (n_points,) marks, are exempt.
    """
    isolated = np.flatnonzero(forces.any(axis=1) & ~related & (bodies(mesh)[1] < 0))
    if len(isolated):
        raise ModelError(
            f"{name} acts on points that belong to no solid cell (number: {len(isolated)}, first: point {isolated[0]}): "
            "name a group of the body, or tie the points to it with couple or relate"
        )


def check_supports(mesh: Mesh, supports: Iterable[tuple[str, str]], related: Mask) -> None:
    """Raise ModelError if no point of one of the supports (name, group) belongs to a solid cell.

    Points with multi-point constraints or springs, which the mask `related` (n_points,) marks, are exempt.
    """
    connected = related | (bodies(mesh)[1] >= 0)
    for name, group in supports:
        points = mesh.points_of(group)
        if not connected[points].any():
            raise ModelError(
                f"{name} contains only points that belong to no solid cell (number: {len(points)}, first: point "
                f"{points[0]}): name a group of the body, or connect the points to it with add_coupling or relate"
            )


def check_penetration(name: str, pair: Formulation) -> None:
    """Raise ContactError if the initial penetration of contact pair `name` exceeds the facet length at a node.

    An intended interference is smaller than a facet, or is specified by the option `clearance`.
    """
    gap, _ = initial_gaps(pair)
    size = pair.secondary.largest_diameters(pair.points)
    row = int(np.argmin(gap / size))
    if gap[row] < -size[row]:
        point = pair.secondary.points[row]
        raise ContactError(
            f"contact '{name}' begins with a penetration of {-gap[row]:.4g} at point {point} {pair.points[point]}, more than "
            f"the length of the element there ({size[row]:.4g}): separate the bodies, reverse the orientation of a surface, "
            "or specify an intended interference as a clearance"
        )


def initial_gaps(pair: Formulation) -> tuple[Array, Array]:
    """Return the gaps (n_nodes,) of the secondary nodes before any load [length], and the normals (n_nodes, dim).

    Clearances are included where they increase the gap. Gaps are infinite at nodes that are unpaired or excluded, and in
    pairs of the kinds that admit penetration, tied and gap_only.
    """
    if pair.options.kind in ("tied", "gap_only"):
        shape = len(pair.secondary.points), pair.points.shape[1]
        return np.full(shape[0], np.inf), np.zeros(shape)
    undeformed = Configuration.undeformed(pair.points)
    gap, normal = pair.nodal_gap(replace(undeformed, clearance_factor=0.0))
    if pair.options.clearance is not None or pair.options.clearance_primary is not None:
        gap = np.maximum(gap, pair.nodal_gap(undeformed)[0])
    return np.where(pair.excluded[pair.secondary.points], np.inf, gap), normal


def check_overlap(mesh: Mesh, kinematics: str, groups: Iterable[tuple[str, str]]) -> None:
    """Raise ModelError if bodies overlap in the reference configuration without a contact pair between them.

    `groups` contains the names (secondary, primary) of the groups of the contact pairs.
    """
    _, body_of = bodies(mesh)
    pairs = {frozenset((int(body_of[mesh.points_of(a)[0]]), int(body_of[mesh.points_of(b)[0]]))) for a, b in groups}
    size = float(np.ptp(mesh.points, axis=0).max())
    for first, second, depth, position in penetration(mesh, kinematics, mesh.points):
        if depth > SINGLE_PRECISION * size and frozenset((first, second)) not in pairs:
            raise ModelError(
                f"body {body_name(mesh, body_of, first)} overlaps body {body_name(mesh, body_of, second)} by {depth:.3g} "
                f"near {position} before any load, and no contact pair joins them: add the contact or move one of them"
            )
