"""Warnings about a model before it is solved, with the quantities that cause them: units, poor cells, inexact integrals.

They are sentences for the screen and the result file. The model may still be correct, so that they do not stop an analysis.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from fastcontact._jit.parallel import on_one_blas_thread
from fastcontact._tools.neighbours import close_pairs
from fastcontact._tools.units import in_si, misfit
from fastcontact.arrays import AnyArray, Array, Numbers
from fastcontact.elasticity.energy import gradients_at, integration_rule
from fastcontact.elasticity.loads import BodyForce, Load, Pressure, Traction, Value, evaluated
from fastcontact.mesh import elements, quadrature
from fastcontact.mesh.elements import Element
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.quality import poorest_cell
from fastcontact.mesh.topology import outer_facets, remembered
from fastcontact.model.checks import facet_lengths, initial_gaps
from fastcontact.model.hanging_nodes import hanging_nodes_warning
from fastcontact.model.prescribed_overlap import Pairs, Supports, prescribed_overlap_warnings
from fastcontact.model.ramp import Harmonic, Ramp, Table
from fastcontact.model.repeated_pairs import split_side_warnings
from fastcontact.round_off import LENGTH_ROUND_OFF, ROUND_OFF, SINGLE_PRECISION

if TYPE_CHECKING:
    from fastcontact.model.model import Model

# Largest plausible ratio of Young's moduli: steel to soft rubber is 200 000, MPa to Pa a million.
MODULI = 3e5
# A prescribed displacement beyond this multiple of the size of the model, and strains by the loads outside these bounds, are
# probably mistakes.
DISPLACED, STRAINED, UNSTRAINED = 1.0, 1.0, 1e-12
# Young's moduli of solids, from aerogel to diamond [Pa]. This is the only check that depends on the user's units, if named.
SOLIDS = (1e2, 2e12)
# Number of cells by which integrals are assessed.
SOME = 1000
# Relative error of the integral of a load, and of the stiffness (1.6 % on regular pyramids), above which a warning is given.
INTEGRAL, STIFFNESS = 1e-3, 5e-2
# Nodes nearer to each other than this fraction of the edges there, and than single precision, probably should coincide.
NEAR = 1e-2
# Largest penetration over the facet length that does not count as overlap: eight straight facets of a circle penetrate a
# round side by less.
SAG = 0.1
# Largest plausible coefficient of friction; for rubber on rough ground it is 1 to 2.
RUBBING = 3.0


@on_one_blas_thread
def model_warnings(model: Model, ramp: Ramp) -> list[str]:
    """Return the warnings about a model accepted by `Model.check`, for an analysis along a ramp."""
    supports = Supports(*model.prescribed_by_ramp(), ramp)
    pairs, pushed = [(pair, model.bind(pair)) for pair in model.contact], _pushed(supports)
    texts = [*_moduli(model), *_named_units(model), *_proportions(model, float(pushed.max())), poorest_cell(model.mesh)]
    texts += [hanging_nodes_warning(model), _coincident(model), *_friction(model), *_penetrating(model, pairs, pushed)]
    texts += [*_unramped(model, ramp), *prescribed_overlap_warnings(pairs, supports), *_lost_loads(model)]
    texts += [*_split_sides(model, pairs), *_wetted_twice(model), _stiffness(model.mesh)]
    texts += [text for load in model.loads for text in _load_integral(model, load)]
    return [text for text in texts if text]


def _split_sides(model: Model, pairs: Pairs) -> Iterator[str]:
    """Return a warning for each two contacts that continue each other."""
    touched = {
        pair.name: np.union1d(*(model.mesh.points_of(side) for side in (pair.secondary, pair.primary)))
        for pair in model.contact
        if pair.primary
    }
    points, count = np.unique(np.concatenate([*touched.values(), np.empty(0, np.int32)]), return_counts=True)
    common = points[count > 1]
    return split_side_warnings(
        [(pair, bound) for pair, bound in pairs if pair.primary and np.isin(touched[pair.name], common).any()]
    )


def _lost_loads(model: Model) -> Iterator[str]:
    """Return a warning for each load that only acts on prescribed components."""
    fixed, _ = model.prescribed()
    for load in model.loads:
        forces = model.load_vector(load)
        total = float(np.abs(forces).sum())
        if total > 0.0 and float(np.abs(forces[~fixed]).sum()) <= ROUND_OFF * total:
            yield (
                f"{load.name} acts on {int(forces.any(axis=1).sum())} points whose displacement is prescribed in its "
                "direction: the supports carry all of it. Load other points, or omit the support"
            )


def _moduli(model: Model) -> Iterator[str]:
    """Compare the moduli with each other."""
    values = [value for material, _ in model.materials for value in material.young]
    ratio = max(values) / min(values)
    if ratio > MODULI:
        yield (
            f"Young's moduli differ by a factor of {ratio:.3g} (E = {min(values):g} and {max(values):g}): are both in the "
            "same unit?"
        )


def _named_units(model: Model) -> Iterator[str]:
    """Compare moduli with those of solids, and the units with each other, if these are known."""
    units = model.units
    yield misfit(units)
    pascal = in_si(units, "pressure")
    if pascal is None:
        return
    for material, groups in model.materials:
        low, high = (young * pascal for young in material.young)
        if low < SOLIDS[0] or high > SOLIDS[1]:
            E, limit, quantity = (high, SOLIDS[1], "diamond") if high > SOLIDS[1] else (low, SOLIDS[0], "aerogel")
            where = "all cells" if groups is None else ", ".join(f"'{group}'" for group in groups)
            yield (
                f"Young's modulus E = {E / pascal:g} {units['pressure']} of {where} is {E / limit:.3g} times that of "
                f"{quantity}: is it in another unit?"
            )


def _proportions(model: Model, moved: float) -> Iterator[str]:
    """Compare prescribed displacements with the size of the model, and loads with its stiffness."""
    size = float(np.ptp(model.mesh.points, axis=0).max())
    if moved > DISPLACED * size:
        yield (
            f"a displacement of {moved:g} is prescribed, {moved / size:.3g} times the size of the model ({size:g}): are "
            "mesh and displacement in the same unit?"
        )
    forces = [_peak(ramp) * np.abs(force).sum() for ramp, force in model.forces_by_ramp().items()]
    depth = 1.0 if model.mesh.dim == 2 and model.kinematics != "axisymmetric" else size
    stiffness = min(material.young[0] for material, _ in model.materials) * size * depth
    strain = max(forces, default=0.0) / stiffness
    if strain > STRAINED or 0.0 < strain < UNSTRAINED:
        yield (
            f"the loads strain the model by about {strain:.2g} (all forces over E times its size squared): are loads, "
            "lengths and E in one set of units?"
        )


def _pushed(supports: Supports) -> Array:
    """Return the largest prescribed displacements (dim,) along their ramps, or as given without a ramp [length]."""
    # Rotations are left out.
    straight = {ramp: at for ramp, at in supports.by_ramp.items() if not isinstance(ramp, Harmonic)}
    peaks = [_peak(ramp) * np.abs(values).max(axis=0) for ramp, values in straight.items() if len(values)]
    return np.max([np.zeros(supports.fixed.shape[1]), *peaks], axis=0)


def _peak(ramp: Table | None) -> float:
    """Return the largest magnitude of the multipliers of a ramp [-]."""
    return 1.0 if ramp is None else max(abs(value) for _, value in ramp)


def _coincident(model: Model) -> str:
    """Return a warning if nodes of solid cells nearly coincide without a contact or constraint between them."""
    mesh, size = model.mesh, float(np.ptp(model.mesh.points, axis=0).max())
    edge = np.full(mesh.n_points, np.inf)  # the shortest one at each node on the outside of a body, where cracks lie
    for name, facets in outer_facets(mesh).items():
        corners = mesh.points[facets[:, : elements.get(name).n_corners]]
        lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        np.minimum.at(edge, facets, lengths.min(axis=1)[:, None])
    lone = np.isfinite(edge)
    for pair in model.contact:
        for group in (pair.secondary, pair.primary):
            lone[mesh.points_of(group) if group else []] = False
    lone[model.related_points()] = False
    numbers = np.flatnonzero(lone)
    pairs = numbers[close_pairs(mesh.points[numbers], SINGLE_PRECISION * size)]
    apart = np.linalg.norm(mesh.points[pairs[:, 0]] - mesh.points[pairs[:, 1]], axis=1)
    near = apart < NEAR * edge[pairs].min(axis=1)
    pairs, apart = pairs[near], apart[near]
    count = len(np.unique(pairs[:, 1]))
    if count < mesh.dim:  # bodies that touch only at a corner
        return ""
    first = pairs[np.lexsort(mesh.points[pairs[:, 0]].T)[0]]
    point = ", ".join(f"{x:.6g}" for x in mesh.points[first[0]])
    largest = float(apart.max())
    where = "where another one is" if largest <= LENGTH_ROUND_OFF * size else f"within {largest:.3g} of another one"
    return (
        f"{count} nodes lie {where}, and no contact joins them (first: points {first[0]} and {first[1]} at ({point})): merge "
        "them in the mesher or with generate.transform.merge_points, or define the contact"
    )


def _wetted_twice(model: Model) -> list[str]:
    """Return a warning for two pairs with fluids that have common secondary facets."""
    groups, wet = model.mesh.cell_groups, [pair for pair in model.contact if pair.fluid is not None]
    shared = {
        (one.name, other.name): len(np.intersect1d(groups.get(one.secondary, []), groups.get(other.secondary, [])))
        for one, other in itertools.combinations(wet, 2)
    }
    return [
        f"the fluids of contacts '{one}' and '{other}' both act on {count} secondary facets, and each bypasses the seal of "
        "the other contact: give each pair separate facets"
        for (one, other), count in shared.items()
        if count
    ]


def _friction(model: Model) -> list[str]:
    """Return a warning for each implausible coefficient of friction."""
    return [
        f"the friction of contact '{pair.name}' is {friction:g}, more than the {RUBBING:g} that surfaces have at most: is it "
        "in percent? To exclude sliding, use kind='tied'"
        for pair in model.contact
        if (friction := pair.options.get("friction") or 0.0) > RUBBING
    ]


def _penetrating(model: Model, pairs: Pairs, pushed: Array) -> Iterator[str]:
    """Return a warning for each contact whose initial penetration exceeds the prescribed motions (dim,) [length]."""
    for pair, bound in pairs:
        motion = pushed if not any(pair.motion) else np.maximum(pushed, _peak(pair.ramp) * np.abs(pair.motion))
        if not motion.any():
            continue  # an interference loads the bodies
        gap, normal = initial_gaps(bound)
        along = np.abs(normal) @ motion
        along = np.where(along > SINGLE_PRECISION * motion.max(), along, SAG * facet_lengths(bound))
        row = int(np.argmin(gap + along))
        if -gap[row] > along[row]:
            point = bound.secondary.points[row]
            driver = "supports push" if motion is pushed else "motions push"
            yield (
                f"contact '{pair.name}' begins with a penetration of {-gap[row]:.4g} at point {point} "
                f"{np.array2string(model.mesh.points[point], precision=4)}, more than the {np.abs(normal[row]) @ motion:.4g} "
                f"that {driver} along its normal: "
                "forces are those of the penetration. Move a body apart, or give an interference that is meant as clearance"
            )


def _unramped(model: Model, ramp: Ramp) -> Iterator[str]:
    """Return a warning if some loads have their own histories, and others exceed their given values with the ramp."""
    top = max(ramp.value(instant) for instant in ramp.instants)
    if top <= 1.0 or len(ramp.table) > 2:
        return
    items: list[Any] = [*(s for s in model.supports if s.value), *model.loads, *model.temperatures]
    ramps = [(item.name, item.ramp) for item in items]
    ramps += [(f"the motion of obstacle '{pair.name}'", pair.ramp) for pair in model.contact if any(pair.motion)]
    turning = {s.group: s.rotation_ramp or s.ramp for s in model.supports if s.rotation is not None}
    ramps += [(f"the rotation of '{group}'", history) for group, history in turning.items()]
    ramps += [(f"the force on obstacle '{pair.name}'", pair.ramp) for pair in model.contact if any(pair.force)]
    without = [name for name, history in ramps if history is None]
    if 0 < len(without) < len(ramps):
        yield (
            f"{', '.join(without)} {'has' if len(without) == 1 else 'have'} no ramp, as others have: at load factor {top:g} "
            f"{'it is' if len(without) == 1 else 'they are'} {top:g} times what was given; to hold it from 1 on give "
            f"ramp=[(0, 0), (1, 1), ({top:g}, 1)]"
        )


@remembered
def _stiffness(mesh: Mesh) -> str:
    """Return a warning if the quadrature of the stiffness is inexact on curved or distorted cells.

    The measure is the trace of the stiffness of a scalar field, the integral of all squared gradients of shape functions.
    """
    off = total = 0.0
    for name, block in mesh.solids.items():
        element = elements.get(name)
        if element.order == 1 and element.n_corners == element.dim + 1:
            continue  # gradients are constant there
        corners = mesh.points[_some(block)]
        coarse, fine = (_traces(corners, element, *rule) for rule in (element.quadrature, integration_rule(element)))
        off, total = off + float(np.abs(coarse - fine).sum()), total + float(fine.sum())
    if off <= STIFFNESS * total:
        return ""
    return (
        f"the quadrature of the stiffness is not exact on curved or distorted cells: its error is {off / total:.2%} of the "
        "total; use smaller or better-shaped cells"
    )


def _traces(corners: Array, element: Element, xi: Array, weights: Array) -> Array:
    """Return the integral (n_cells,) of the squared gradients of all shape functions of cells (n_cells, n_nodes, dim)."""
    gradient, volume = gradients_at(corners, element.gradient(xi))
    return np.asarray((gradient**2).sum(axis=(2, 3)) * np.abs(volume) @ weights)


def _some(cells: AnyArray) -> AnyArray:
    """Return a sample of about `SOME` cells, or all if there are fewer."""
    return cells[:: max(1, len(cells) // SOME)]


def _load_integral(model: Model, load: Load) -> Iterator[str]:
    """Return a warning if a load that is a function varies too much within a cell for the quadrature of loads."""
    off = total = 0.0
    for value in (value for value in load.values if callable(value)):
        cells_loaded = load.cells(model.mesh) if isinstance(load, (BodyForce, Pressure, Traction)) else {}
        for element, cells in cells_loaded.items():
            coarse, fine = (
                _integrals(model.mesh, element, _some(cells), value, load.name, finer) for finer in (False, True)
            )
            off, total = off + float(np.abs(coarse - fine).sum()), total + float(np.abs(fine).sum())
    if off > INTEGRAL * total:
        yield (
            f"{load.name} varies within single elements, so that its quadrature is not exact: its error is {off / total:.2%} "
            "of the total; refine the mesh there"
        )


def _integrals(mesh: Mesh, element: str, cells: Numbers, value: Value, name: str, finer: bool) -> Array:
    """Return the integral (n_cells,) of a load over each cell, with about the rule of loads or a finer one."""
    reference = elements.get(element)
    xi, weights = quadrature.product_rule(reference.linear, 9 if finer else 5)
    J = np.einsum("qnk,cnd->cqdk", reference.gradient(xi), mesh.points[cells])
    x = np.einsum("qn,cnd->cqd", reference.shape(xi), mesh.points[cells])
    measure = np.sqrt(np.linalg.det(np.einsum("cqdk,cqdl->cqkl", J, J)))
    return np.asarray((evaluated(value, x, name) * measure) @ weights)
