"""Warnings about bodies that interpenetrate, without a contact pair or beside its facets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fastcontact.analysis.criteria import NOTABLE
from fastcontact.analysis.problem import Problem
from fastcontact.analysis.resultants import pose_of
from fastcontact.arrays import Array, Mask
from fastcontact.contact.obstacles.rigid_side import Pose, RigidSide
from fastcontact.contact.surface import Surface
from fastcontact.mesh.topology import bodies, outer_facets
from fastcontact.model.body_overlap import depths
from fastcontact.model.rigid_motions import body_name
from fastcontact.results.step import ContactResult, StepResult
from fastcontact.round_off import LENGTH_ROUND_OFF

Indices = NDArray[np.signedinteger]
# Numbers of two bodies, outer nodes of the first (n,), and the depths of these nodes in the second (n,) [length].
Overlap = tuple[int, int, Indices, Array]
Contacts = Mapping[str, ContactResult]
# Names of the contact pairs between two bodies, by the numbers of the bodies.
PairsBetween = Mapping[frozenset[int], Sequence[str]]
# Number, displacements (n_points, dim) and contact results of a step.
Peak = tuple[int, Array, Contacts]
# Depth of nodes beside the facets of a contact above which a warning is given, relative to the largest depth of its nodes.
DEPTH_RATIO = 2.0


def interpenetration(problem: Problem, last: StepResult, peaks: Sequence[Peak]) -> list[str]:
    """Return warnings about bodies inside each other or inside rigid obstacles.

    Parameters
    ----------
    problem : Problem
    last : StepResult
        The last step.
    peaks : list of (int, ndarray (n_points, dim), dict of str to ContactResult)
        Numbers, displacements and contact results of earlier steps in which the forces of contact pairs are largest.
    """
    mesh, pairs_between = problem.model.mesh, _pairs_between(problem)
    warnings: list[str] = []
    for index, u, contact in ((last.index, last.displacement, last.contact), *peaks):
        overlaps = list(depths(mesh, problem.model.kinematics, mesh.points + u))
        texts = _outside_groups(problem, u, contact, pairs_between, overlaps) + _through_obstacles(problem, u, contact)
        if index != last.index:
            warnings += [f"in load step {index}, where its force is largest, {text}" for text in texts]
            continue
        warnings = _without_contact(problem, pairs_between, overlaps) + texts
        if texts:
            break
    return warnings


def _pairs_between(problem: Problem) -> PairsBetween:
    """Return the names of the contact pairs between any two bodies, none for the two sides of a pretension section."""
    body = bodies(problem.model.mesh)[1]
    groups: dict[frozenset[int], list[str]] = {}
    for name, pair in problem.pairs.items():
        if isinstance(pair.primary, Surface):
            for a in np.unique(body[pair.secondary.points]).tolist():
                for b in np.unique(body[pair.primary.points]).tolist():
                    groups.setdefault(frozenset((a, b)), []).append(name)
    for section in problem.model.pretensions:
        groups[frozenset((int(body[section.nodes[0]]), int(body[section.opposite[0]])))] = []
    return groups


def _without_contact(problem: Problem, pairs_between: PairsBetween, overlaps: Sequence[Overlap]) -> list[str]:
    """Return a warning for any two overlapping bodies without a contact pair between them, the deepest overlap first."""
    mesh, texts = problem.model.mesh, dict[frozenset[int], str]()
    _, body = bodies(mesh)
    for first, second, points, depth in sorted(overlaps, key=lambda entry: -float(entry[3].max())):
        body_pair, row = frozenset((first, second)), int(np.argmax(depth))
        notable = depth[row] > LENGTH_ROUND_OFF * np.ptp(mesh.points, axis=0).max()
        if notable and body_pair not in pairs_between and body_pair not in texts:
            where = mesh.points[points[row]]
            texts[body_pair] = (
                f"bodies {body_name(mesh, body, first)} and {body_name(mesh, body, second)} interpenetrate by "
                f"{depth[row]:.6g} near {np.array2string(where, precision=4)}, and no contact is defined between them: "
                "add_contact for the groups that meet"
            )
    return list(texts.values())


def _outside_groups(
    problem: Problem, displacement: Array, contact: Contacts, pairs_between: PairsBetween,
    overlaps: Sequence[Overlap],
) -> list[str]:  # fmt: skip
    """Return warnings about bodies that pass through each other where the groups of their contact pairs lack facets."""
    mesh, texts = problem.model.mesh, []
    _, body = bodies(mesh)
    for body_pair, names in pairs_between.items():
        entries = [entry for entry in overlaps if names and {*entry[:2]} == body_pair]
        if not entries or any(problem.pairs[name].options.wear for name in names):  # worn material is still in the mesh
            continue
        points, depth = np.concatenate([entry[2] for entry in entries]), np.concatenate([entry[3] for entry in entries])
        secondary, primary = (mask[points] for mask in _points_of_sides(problem, contact, names))
        deformed = max(float(np.ptp(displacement[body == number], axis=0).max()) for number in body_pair)
        limit = max(NOTABLE * deformed, DEPTH_RATIO * float(depth[secondary].max(initial=0.0)))
        depth[secondary | primary] = 0.0
        row = int(np.argmax(depth))
        if depth[row] > limit and depth[row] - _depth_at_rest(problem, entries, int(points[row])) > limit:
            label = " and ".join(body_name(mesh, body, number) for number in sorted(body_pair))
            subject = f"bodies {label} pass through each other"
            texts.append(_lacking_facets(problem, names[0], subject, depth[row], points[row]))
    return texts


def _points_of_sides(problem: Problem, contact: Contacts, names: Sequence[str]) -> tuple[Mask, Mask]:
    """Return masks (n_points,) of secondary points that face the other side or are excluded, and of all primary points."""
    secondary, primary = np.zeros((2, problem.model.mesh.n_points), bool)
    for name in names:
        pair = problem.pairs[name]
        facing = np.isfinite(contact[name].gap) | pair.excluded[pair.secondary.points]
        secondary[pair.secondary.points[facing]] = True
        primary[pair.primary.points] = True
    return secondary, primary


def _depth_at_rest(problem: Problem, overlaps: Sequence[Overlap], point: int) -> float:
    """Return the depth of a point of one of two bodies in the other before any load [length]."""
    mesh = problem.model.mesh
    for first, second, points, depth in depths(mesh, problem.model.kinematics, mesh.points):
        if any((first, second) == entry[:2] for entry in overlaps) and point in points:
            return float(depth[points == point][0])
    return 0.0


def _through_obstacles(problem: Problem, displacement: Array, contact: Contacts) -> list[str]:
    """Return warnings about nodes beside a contact surface that pass through its rigid obstacle."""
    mesh, u, texts = problem.model.mesh, displacement, []
    for name, pair in problem.pairs.items():
        if not isinstance(pair.primary, RigidSide) or pair.options.wear:  # worn material is still in the mesh
            continue
        nodes = pair.secondary.points
        facets = [block[np.isin(block, nodes).any(axis=1)].ravel() for block in outer_facets(mesh).values()]
        points = np.setdiff1d(np.concatenate(facets), nodes)
        if not len(points):
            continue
        at_rest = pair.primary.project(mesh.points[points], Pose(np.zeros(mesh.dim)))[0]
        # Depths are those of the geometry, of which a clearance is not part.
        pose = pose_of(contact[name])
        gap, contact_gap = (pair.primary.project(mesh.points[at] + u[at], pose)[0] for at in (points, nodes))
        facing = np.isfinite(contact[name].gap)
        contact_depth = -float(np.min(contact_gap, initial=0.0, where=facing))
        limit = max(NOTABLE * float(np.ptp(u, axis=0).max()), DEPTH_RATIO * contact_depth)
        row = int(np.argmin(np.where(at_rest >= 0.0, gap, np.inf)))
        if at_rest[row] >= 0.0 and -gap[row] > limit:
            texts.append(_lacking_facets(problem, name, "the body passes through the obstacle", -gap[row], points[row]))
    return texts


def _lacking_facets(problem: Problem, name: str, subject: str, depth: float, point: int) -> str:
    """Return the warning that `subject` penetrates by a depth [length] at a point beside the facets of a contact pair."""
    where, pair = np.array2string(problem.model.mesh.points[point], precision=4), problem.pairs[name]
    between = "' and '".join(side.group for side in (pair.secondary, pair.primary) if isinstance(side, Surface))
    return (
        f"contact '{name}' lacks facets: {subject} by {depth:.4g} at point {point} {where}, beside '{between}'; "
        "its force is too small, add the facets there"
    )
