"""Warnings about a model before the solution, such as inconsistent units, poor cells and inexact integrals.

The warnings are printed and stored in the result file. The analysis continues, because the model may still be correct.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from fastcontact._jit.parallel import on_one_blas_thread
from fastcontact._tools.neighbours import close_pairs
from fastcontact._tools.units import inconsistency_message, si_value
from fastcontact.arrays import AnyArray, Array, Numbers
from fastcontact.elasticity.energy import gradients_at, integration_rule
from fastcontact.elasticity.loads import LOAD_POINTS, BodyForce, Load, Pressure, Traction, Value, evaluated
from fastcontact.heat.loads import Film, Heating
from fastcontact.mesh import elements, quadrature
from fastcontact.mesh.elements import Element
from fastcontact.mesh.mesh import Mesh, vector_text
from fastcontact.mesh.quality import poorest_cell
from fastcontact.mesh.topology import bodies, cached_by_mesh, outer_facets
from fastcontact.model.checks import initial_gaps
from fastcontact.model.hanging_nodes import hanging_nodes_warning
from fastcontact.model.prescribed_overlap import Pairs, Supports, prescribed_overlap_warnings
from fastcontact.model.ramp import Harmonic, Ramp, Table
from fastcontact.model.repeated_pairs import split_side_warnings
from fastcontact.round_off import LENGTH_ROUND_OFF, ROUND_OFF, SINGLE_PRECISION

if TYPE_CHECKING:
    from fastcontact.model.model import Model

# Largest plausible ratio of Young's moduli. For steel and soft rubber it is 200 000; a confusion of MPa and Pa gives 1e6.
LARGEST_MODULUS_RATIO = 3e5
# Prescribed displacements above this multiple of the size of the model are probably mistakes [-].
LARGEST_DISPLACEMENT = 1.0
# Strains due to the loads outside these bounds are probably mistakes [-].
PLAUSIBLE_STRAIN = (1e-12, 1.0)
# Young's moduli of solids, from aerogel to diamond [Pa].
SOLIDS = (1e2, 2e12)
# Approximate number of cells on which quadrature errors are estimated.
N_SAMPLE_CELLS = 1000
# Relative quadrature errors above which a warning is given: of a load, and of the stiffness (1.6 % on regular pyramids).
LARGEST_LOAD_ERROR, LARGEST_STIFFNESS_ERROR = 1e-3, 5e-2
# Two nodes are assumed to be meant to coincide if their distance is below this fraction of the adjacent edges and below
# SINGLE_PRECISION times the size of the model.
NEAR = 1e-2
# Largest penetration, relative to the facet length, that is regarded as an effect of straight facets: the midpoints of the
# sides of a regular octagon lie 0.0995 times their length inside the circle.
SAG = 0.1
# Largest plausible coefficient of friction. For rubber on rough ground it is 1 to 2.
LARGEST_FRICTION = 3.0


@on_one_blas_thread
def model_warnings(model: Model, ramp: Ramp) -> list[str]:
    """Return the warnings about a model accepted by `Model.check`, for an analysis along a ramp."""
    supports = Supports(*model.prescribed_by_ramp(), ramp)
    pairs, motion = [(pair, model.bind(pair)) for pair in model.contact], _largest_motion(supports)
    texts = [*_moduli(model), *_units(model), *_proportions(model, float(motion.max())), poorest_cell(model.mesh)]
    texts += [hanging_nodes_warning(model), _close_nodes(model), *_friction(model), *_penetration(model, pairs, motion)]
    texts += [*_missing_ramps(model, ramp), *prescribed_overlap_warnings(pairs, supports), *_loads_on_supports(model)]
    texts += [*split_side_warnings(pairs), *_sector_ends(model), *_shared_fluids(model), *_insulating_contacts(model)]
    texts += [_quadrature(model.mesh), *(text for load in model.loads for text in _load_quadrature(model, load))]
    return [text for text in texts if text]


def _sector_ends(model: Model) -> Iterator[str]:
    """Yield a warning for each contact with nodes at one end of a sector that coincide with no node of the other end."""
    for (name, nodes), pair in itertools.product(model.nodes_on_facets.items(), model.contact):
        n = len(np.intersect1d(nodes, model.mesh.points_of(pair.secondary)))
        if n:
            yield (
                f"at the ends of {name}, contact '{pair.name}' has {n} node{'s' * (n > 1)} without counterpart at the other "
                "end: pressures near them may be wrong by as much as the mean pressure. Use matching meshes where contact "
                "meets the ends"
            )


def _insulating_contacts(model: Model) -> Iterator[str]:
    """Yield a warning if no contact of a model with heat conduction has a conductance, although temperatures differ."""
    if not model.heat_loads or any("conductance" in pair.options for pair in model.contact):
        return
    loads = [load for load in model.heat_loads if not isinstance(load, Heating)]
    temperatures = {load.ambient if isinstance(load, Film) else load.value for load in loads}
    body = bodies(model.mesh)[1]
    of_two_bodies = [
        f"'{pair.name}'" for pair in model.contact
        if pair.obstacle is None
        and not np.isin(body[model.mesh.points_of(pair.secondary)], body[model.mesh.points_of(pair.primary)]).any()
    ]  # fmt: skip
    is_uniform = len(loads) == len(model.heat_loads) and len(temperatures) == 1 and not any(map(callable, temperatures))
    if of_two_bodies and not is_uniform:
        yield (
            f"no heat flows across contact {', '.join(of_two_bodies)}, closed or not: give it a conductance, or "
            "conductance=0.0 if it insulates"
        )


def _loads_on_supports(model: Model) -> Iterator[str]:
    """Yield a warning for each load that acts only on prescribed displacement components."""
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
    """Yield a warning if the ratio of Young's moduli is implausible."""
    values = [value for material, _ in model.materials for value in material.young]
    ratio = max(values) / min(values)
    if ratio > LARGEST_MODULUS_RATIO:
        yield (
            f"Young's moduli differ by a factor of {ratio:.3g} (E = {min(values):g} and {max(values):g}): are both in the "
            "same unit?"
        )


def _units(model: Model) -> Iterator[str]:
    """Yield warnings if the named units are inconsistent, or if a modulus is implausible for a solid in these units."""
    units = model.units
    yield inconsistency_message(units)
    pascal = si_value(units, "pressure")
    if pascal is None:
        return
    for material, groups in model.materials:
        low, high = (young * pascal for young in material.young)
        if low < SOLIDS[0] or high > SOLIDS[1]:
            E, limit, solid = (high, SOLIDS[1], "diamond") if high > SOLIDS[1] else (low, SOLIDS[0], "aerogel")
            cells = "all cells" if groups is None else ", ".join(f"'{group}'" for group in groups)
            yield (
                f"Young's modulus E = {E / pascal:g} {units['pressure']} of {cells} is {E / limit:.3g} times that of "
                f"{solid}: is it in another unit?"
            )


def _proportions(model: Model, motion: float) -> Iterator[str]:
    """Yield warnings if the prescribed `motion` [length] or the strain due to the loads is implausible."""
    size = float(np.ptp(model.mesh.points, axis=0).max())
    if motion > LARGEST_DISPLACEMENT * size:
        yield (
            f"a displacement of {motion:g} is prescribed, {motion / size:.3g} times the size of the model ({size:g}): are "
            "mesh and displacement in the same unit?"
        )
    forces = [_peak(ramp) * np.abs(force).sum() for ramp, force in model.forces_by_ramp().items()]
    depth = size if model.mesh.dim == 3 else 1.0
    if model.kinematics == "axisymmetric":
        depth = 2.0 * np.pi * float(model.mesh.points[:, 0].mean())
    stiffness = min(material.young[0] for material, _ in model.materials) * size * depth
    strain = max(forces, default=0.0) / stiffness
    if strain > PLAUSIBLE_STRAIN[1] or 0.0 < strain < PLAUSIBLE_STRAIN[0]:
        yield (
            f"the loads strain the model by about {strain:.2g} (total force over E times the cross-section of the "
            "model): are loads, lengths and E in consistent units?"
        )


def _largest_motion(supports: Supports) -> Array:
    """Return the largest magnitude of each prescribed displacement component (dim,) [length], without rotations.

    Displacements without a separate ramp are taken at multiplier 1.
    """
    translations = {ramp: values for ramp, values in supports.by_ramp.items() if not isinstance(ramp, Harmonic)}
    peaks = [_peak(ramp) * np.abs(values).max(axis=0) for ramp, values in translations.items() if len(values)]
    return np.max([np.zeros(supports.fixed.shape[1]), *peaks], axis=0)


def _peak(ramp: Table | None) -> float:
    """Return the largest magnitude of the multipliers of a ramp [-]."""
    return 1.0 if ramp is None else max(abs(value) for _, value in ramp)


def _close_nodes(model: Model) -> str:
    """Return a warning if nodes of solid cells nearly coincide without a contact or constraint between them."""
    mesh, size = model.mesh, float(np.ptp(model.mesh.points, axis=0).max())
    # Length of the shortest edge at each node on the surface of a body; infinity at inner nodes, which lie on no crack.
    edge = np.full(mesh.n_points, np.inf)
    for name, facets in outer_facets(mesh).items():
        corners = mesh.points[facets[:, : elements.get(name).n_corners]]
        lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        np.minimum.at(edge, facets, lengths.min(axis=1)[:, None])
    unconnected = np.isfinite(edge)
    for pair in model.contact:
        for group in (pair.secondary, pair.primary):
            unconnected[mesh.points_of(group) if group else []] = False
    unconnected[model.related_points()] = False
    numbers = np.flatnonzero(unconnected)
    pairs = numbers[close_pairs(mesh.points[numbers], SINGLE_PRECISION * size)]
    distance = np.linalg.norm(mesh.points[pairs[:, 0]] - mesh.points[pairs[:, 1]], axis=1)
    is_close = distance < NEAR * edge[pairs].min(axis=1)
    pairs, distance = pairs[is_close], distance[is_close]
    count = len(np.unique(pairs[:, 1]))
    if count < mesh.dim:  # bodies that touch only at a corner
        return ""
    first = pairs[np.lexsort(mesh.points[pairs[:, 0]].T)[0]]
    largest = float(distance.max())
    predicate = "coincide with" if largest <= LENGTH_ROUND_OFF * size else f"lie within {largest:.3g} of"
    return (
        f"{count} nodes {predicate} another node, and no contact joins them (first: points {first[0]} and {first[1]} at "
        f"{vector_text(mesh.points[first[0]])}): merge them in the mesher or with generate.transform.merge_points, or "
        "define the contact"
    )


def _shared_fluids(model: Model) -> list[str]:
    """Return the warnings about contacts with fluids that share secondary facets with each other."""
    groups, fluid_pairs = model.mesh.cell_groups, [pair for pair in model.contact if pair.fluid is not None]
    return [
        f"the fluids of contacts '{first.name}' and '{second.name}' both act on {len(shared)} secondary facets, and each "
        "bypasses the seal of the other contact: give each pair separate facets"
        for first, second in itertools.combinations(fluid_pairs, 2)
        if len(shared := np.intersect1d(groups.get(first.secondary, []), groups.get(second.secondary, [])))
    ]


def _friction(model: Model) -> list[str]:
    """Return a warning for each implausible coefficient of friction."""
    return [
        f"the friction of contact '{pair.name}' is {friction:g}, but plausible values are at most "
        f"{LARGEST_FRICTION:g}: is it in percent? To exclude sliding, use kind='tied'"
        for pair in model.contact
        if (friction := pair.options.get("friction") or 0.0) > LARGEST_FRICTION
    ]


def _penetration(model: Model, pairs: Pairs, prescribed: Array) -> Iterator[str]:
    """Yield a warning for each contact whose initial penetration exceeds the prescribed motion along its normal.

    `prescribed` (dim,) are the largest displacements that supports prescribe [length].
    """
    for pair, bound in pairs:
        motion = prescribed if not any(pair.motion) else np.maximum(prescribed, _peak(pair.ramp) * np.abs(pair.motion))
        if not motion.any():
            continue  # the penetration is an interference, which loads the bodies
        gap, normal = initial_gaps(bound)
        approach = np.abs(normal) @ motion
        sag = SAG * bound.secondary.largest_diameters(bound.points)
        approach = np.where(approach > SINGLE_PRECISION * motion.max(), approach, sag)
        row = int(np.argmin(gap + approach))
        if -gap[row] > approach[row]:
            point = bound.secondary.points[row]
            cause = "supports push" if motion is prescribed else "motions push"
            yield (
                f"contact '{pair.name}' begins with a penetration of {-gap[row]:.4g} at point {point} "
                f"{np.array2string(model.mesh.points[point], precision=4)}, more than the {np.abs(normal[row]) @ motion:.4g} "
                f"that {cause} along its normal: the contact forces are due to this penetration. Separate the bodies, or "
                "specify an intended interference as a clearance"
            )


def _missing_ramps(model: Model, ramp: Ramp) -> Iterator[str]:
    """Yield a warning if some items have separate ramps, and the common ramp multiplies the others by more than 1.

    If the common ramp has more than two points, it is assumed to be intended for these items.
    """
    peak = max(ramp.value(instant) for instant in ramp.instants)
    if peak <= 1.0 or len(ramp.table) > 2:
        return
    items: list[Any] = [*(s for s in model.supports if s.value), *model.loads, *model.temperatures]
    ramps = [(item.name, item.ramp) for item in items]
    ramps += [(f"the motion of obstacle '{pair.name}'", pair.ramp) for pair in model.contact if any(pair.motion)]
    rotations = {s.group: s.rotation_ramp or s.ramp for s in model.supports if s.rotation is not None}
    ramps += [(f"the rotation of '{group}'", history) for group, history in rotations.items()]
    ramps += [(f"the force on obstacle '{pair.name}'", pair.ramp) for pair in model.contact if any(pair.force)]
    missing = [name for name, history in ramps if history is None]
    if 0 < len(missing) < len(ramps):
        yield (
            f"{', '.join(missing)} {'has' if len(missing) == 1 else 'have'} no ramp, unlike others: at load factor {peak:g} "
            f"{'it is' if len(missing) == 1 else 'they are'} {peak:g} times the given value; to hold it from 1 on, give "
            f"ramp=[(0, 0), (1, 1), ({peak:g}, 1)]"
        )


@cached_by_mesh
def _quadrature(mesh: Mesh) -> str:
    """Return a warning if the quadrature of the stiffness is inexact on curved or distorted cells.

    The measure is the trace of the stiffness of a scalar field, the integral of all squared gradients of shape functions.
    """
    error = total = 0.0
    for name, block in mesh.solids.items():
        element = elements.get(name)
        if element.order == 1 and element.n_corners == element.dim + 1:
            continue  # gradients are constant
        nodes = mesh.points[_sample(block)]
        coarse, fine = (_traces(nodes, element, *rule) for rule in (element.quadrature, integration_rule(element)))
        error, total = error + float(np.abs(coarse - fine).sum()), total + float(fine.sum())
    if error <= LARGEST_STIFFNESS_ERROR * total:
        return ""
    return (
        f"the quadrature of the stiffness is not exact on curved or distorted cells: its error is {error / total:.2%} of the "
        "total; use smaller or better-shaped cells"
    )


def _traces(nodes: Array, element: Element, xi: Array, weights: Array) -> Array:
    """Return the integrals (n_cells,) of the squared gradients of all shape functions.

    `nodes` (n_cells, n_nodes, dim) are the node positions of the cells [length], and `xi` and `weights` a quadrature rule.
    """
    gradient, volume = gradients_at(nodes, element.gradient(xi))
    return np.asarray((gradient**2).sum(axis=(2, 3)) * np.abs(volume) @ weights)


def _sample(cells: AnyArray) -> AnyArray:
    """Return one to two times N_SAMPLE_CELLS evenly distributed cells, or all if there are fewer."""
    return cells[:: max(1, len(cells) // N_SAMPLE_CELLS)]


def _load_quadrature(model: Model, load: Load) -> Iterator[str]:
    """Yield a warning if a load that is a function varies too much within cells for the quadrature of loads."""
    error = total = 0.0
    for value in (value for value in load.values if callable(value)):
        cells_loaded = load.cells(model.mesh) if isinstance(load, (BodyForce, Pressure, Traction)) else {}
        for element, cells in cells_loaded.items():
            arguments = model.mesh, element, _sample(cells), value, load.name
            coarse, fine = (_integrals(*arguments, finer) for finer in (False, True))
            error, total = error + float(np.abs(coarse - fine).sum()), total + float(np.abs(fine).sum())
    if error > LARGEST_LOAD_ERROR * total:
        yield (
            f"{load.name} varies within single elements, so that its quadrature is not exact: its error is "
            f"{error / total:.2%} of the total; refine the mesh there"
        )


def _integrals(mesh: Mesh, element: str, cells: Numbers, value: Value, name: str, finer: bool) -> Array:
    """Return the integrals (n_cells,) of a load over cells, with the quadrature of loads, or with 9 points if `finer`."""
    reference = elements.get(element)
    xi, weights = quadrature.product_rule(reference.linear, *((9,) if finer else LOAD_POINTS))
    J = np.einsum("qnk,cnd->cqdk", reference.gradient(xi), mesh.points[cells])
    x = np.einsum("qn,cnd->cqd", reference.shape(xi), mesh.points[cells])
    measure = np.sqrt(np.linalg.det(np.einsum("cqdk,cqdl->cqkl", J, J)))
    return np.asarray((evaluated(value, x, name) * measure) @ weights)
