"""Warnings about bodies that interpenetrate at the end of an analysis, without or outside the defined contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fastcontact.analysis.criteria import NOTABLE
from fastcontact.analysis.problem import Problem
from fastcontact.analysis.state import State
from fastcontact.arrays import Array, Mask
from fastcontact.contact.obstacles.rigid_side import Pose, RigidSide
from fastcontact.contact.surface import Surface
from fastcontact.mesh.topology import bodies, outer_facets
from fastcontact.model.body_overlap import depths
from fastcontact.model.rigid_motions import body_name
from fastcontact.results.step import StepResult
from fastcontact.round_off import LENGTH_ROUND_OFF

Indices = NDArray[np.signedinteger]
# Numbers of two bodies, outer nodes of the first (n,), and the depths of these nodes in the second (n,) [length].
Inside = tuple[int, int, Indices, Array]
# Depth beside the facets of a contact above which a warning is given, relative to that of nodes in contact.
HELD = 2.0


def interpenetration(problem: Problem, state: State, last: StepResult) -> list[str]:
    """Return warnings about bodies inside each other or inside rigid obstacles, at the end of the `last` step."""
    mesh, u = problem.model.mesh, problem.displacement(state.u)
    joined = _joined(problem)
    inside = list(depths(mesh, problem.model.kinematics, mesh.points + u))
    return [
        *_without_contact(problem, joined, inside), *_beside_contact(problem, last, joined, inside),
        *_through_obstacles(problem, state, last),
    ]  # fmt: skip


def _joined(problem: Problem) -> Mapping[frozenset[int], Sequence[str]]:
    """Return the contact pairs between each two bodies; none where these are the sides of a pretension section."""
    body = bodies(problem.model.mesh)[1]
    groups: dict[frozenset[int], list[str]] = {}
    for name, pair in problem.pairs.items():
        if isinstance(pair.primary, Surface):
            for a in np.unique(body[pair.secondary.points]).tolist():
                for b in np.unique(body[pair.primary.points]).tolist():
                    groups.setdefault(frozenset((a, b)), []).append(name)
    for cut in problem.model.pretensions:
        groups[frozenset((int(body[cut.nodes[0]]), int(body[cut.opposite[0]])))] = []
    return groups


def _without_contact(
    problem: Problem, joined: Mapping[frozenset[int], Sequence[str]], inside: Sequence[Inside]
) -> list[str]:
    """Return warnings about bodies without a contact pair between them, the deepest first, one for each two bodies."""
    mesh = problem.model.mesh
    _, body = bodies(mesh)
    texts: dict[frozenset[int], str] = {}
    for number, other, points, depth in sorted(inside, key=lambda entry: -float(entry[3].max())):
        both, row = frozenset((number, other)), int(np.argmax(depth))
        if (
            both not in joined
            and both not in texts
            and depth[row] > LENGTH_ROUND_OFF * np.ptp(mesh.points, axis=0).max()
        ):
            where = mesh.points[points[row]]
            texts[both] = (
                f"bodies {body_name(mesh, body, number)} and {body_name(mesh, body, other)} interpenetrate by "
                f"{depth[row]:.6g} near {np.array2string(where, precision=4)}, and no contact is defined between them: "
                "add_contact for the groups that meet"
            )
    return list(texts.values())


def _beside_contact(
    problem: Problem, last: StepResult, joined: Mapping[frozenset[int], Sequence[str]], inside: Sequence[Inside]
) -> list[str]:
    """Return warnings about bodies that pass through each other where the groups of their contact pairs lack facets."""
    mesh, texts = problem.model.mesh, []
    _, body = bodies(mesh)
    for both, names in joined.items():
        entries = [entry for entry in inside if names and {*entry[:2]} == both]
        if not entries or any(problem.pairs[name].options.wear for name in names):  # worn material is still in the mesh
            continue
        points, depth = np.concatenate([entry[2] for entry in entries]), np.concatenate([entry[3] for entry in entries])
        held, faced = (mask[points] for mask in _held(problem, last, names))
        deformed = max(float(np.ptp(last.displacement[body == number], axis=0).max()) for number in both)
        limit = max(NOTABLE * deformed, HELD * float(depth[held].max(initial=0.0)))
        depth[held | faced] = 0.0
        row = int(np.argmax(depth))
        if depth[row] > limit and depth[row] - _at_rest(problem, entries, int(points[row])) > limit:
            label = " and ".join(body_name(mesh, body, number) for number in sorted(both))
            texts.append(
                _lacking(problem, names[0], f"bodies {label} pass through each other", depth[row], points[row])
            )
    return texts


def _held(problem: Problem, last: StepResult, names: Sequence[str]) -> tuple[Mask, Mask]:
    """Return masks (n_points,) of secondary points that face the other side or are excluded, and of all primary points."""
    held, faced = np.zeros((2, problem.model.mesh.n_points), bool)
    for name in names:
        pair = problem.pairs[name]
        facing = np.isfinite(last.contact[name].gap) | pair.options.excluded_nodes(pair.secondary)
        held[pair.secondary.points[facing]] = True
        faced[pair.primary.points] = True
    return held, faced


def _at_rest(problem: Problem, bodies_of: Sequence[Inside], point: int) -> float:
    """Return the depth of a point of one of two bodies in the other before any load [length]."""
    mesh = problem.model.mesh
    for number, other, points, depth in depths(mesh, problem.model.kinematics, mesh.points):
        if any((number, other) == entry[:2] for entry in bodies_of) and point in points:
            return float(depth[points == point][0])
    return 0.0


def _through_obstacles(problem: Problem, state: State, last: StepResult) -> list[str]:
    """Return warnings about nodes beside a contact surface that pass through its rigid obstacle."""
    mesh, u, texts = problem.model.mesh, problem.displacement(state.u), []
    for name, pair in problem.pairs.items():
        if not isinstance(pair.primary, RigidSide) or pair.options.wear:  # worn material is still in the mesh
            continue
        nodes = pair.secondary.points
        facets = [block[np.isin(block, nodes).any(axis=1)].ravel() for block in outer_facets(mesh).values()]
        points = np.setdiff1d(np.concatenate(facets), nodes)
        if not len(points):
            continue
        at_rest = pair.primary.facing(mesh.points[points], Pose(np.zeros(mesh.dim)))[0]
        now = Pose(state.obstacles[name], state.angles.get(name, 0.0))
        gap = pair.primary.facing(mesh.points[points] + u[points], now)[0]
        inside = last.contact[name].gap
        deepest = -float(np.min(inside, initial=0.0, where=np.isfinite(inside)))
        limit = max(NOTABLE * float(np.ptp(u, axis=0).max()), HELD * deepest)
        row = int(np.argmin(np.where(at_rest >= 0.0, gap, np.inf)))
        if at_rest[row] >= 0.0 and -gap[row] > limit:
            texts.append(_lacking(problem, name, "the body passes through the obstacle", -gap[row], points[row]))
    return texts


def _lacking(problem: Problem, name: str, subject: str, depth: float, point: int) -> str:
    where, pair = np.array2string(problem.model.mesh.points[point], precision=4), problem.pairs[name]
    between = "' and '".join(side.group for side in (pair.secondary, pair.primary) if isinstance(side, Surface))
    return (
        f"contact '{name}' lacks facets: {subject} by {depth:.4g} at point {point} {where}, beside '{between}'; "
        "its force is too small, add the facets there"
    )
