"""Quantities of interest: their values in the last step of a run and in a theory, and their titles and units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, cast

import numpy as np

from fastcontact.analytic.pressure_curve import pressure_curve
from fastcontact.arrays import Array
from fastcontact.cases import checks
from fastcontact.cases.case import Case
from fastcontact.cases.checks import defined_names, kind_of_unit, quantity_value
from fastcontact.contact.integration import facet_measure
from fastcontact.contact.surface import Surface, surface
from fastcontact.errors import CaseError, unknown
from fastcontact.mesh import elements, quadrature
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.quality import quality
from fastcontact.mesh.topology import bodies
from fastcontact.results.step import ContactResult, StepResult
from fastcontact.results.units import axis_label

# Title and kind of unit (empty for ratios) of the standard quantities.
LABELS = {
    "force": ("contact force", "force"),
    "pressure_max": ("largest pressure", "pressure"),
    "pressure_pole": ("pressure at the centre", "pressure"),
    "contact_radius": ("contact radius", "length"),
    "von_mises_max": ("largest von Mises stress", "pressure"),
    "von_mises_depth": ("depth of the largest von Mises stress", "length"),
    "pressure_error": ("error of the pressure, relative L2 norm", ""),
    "pressure_error_equal_force": ("error of the pressure at equal force, relative L2 norm", ""),
}
# Quantities of a contact pair that are midpoints of bounds, which are usually positions of nodes.
BRACKETS = ("radius", "stick_radius")
# Name of the force of a pretension section, which follows the name of the section.
BOLT_FORCE = "pretension_force"
# Standard quantities that are relative errors.
RATIOS = tuple(name for name, (_, kind) in LABELS.items() if not kind)


def measure(case: Case, last: StepResult, pair: str | None) -> dict[str, float]:
    """Return the quantities of interest of a solved case and, unless `pair` is None, of this contact pair."""
    quantities = {} if pair is None else _contact_quantities(case, last.contact[pair], pair)
    quantities["von_mises_max"], position = peak(case.mesh, last.von_mises, case.model.kinematics == "axisymmetric")
    if pair is not None:
        quantities["von_mises_depth"] = _depth(case, pair, position)
    for name in _probe_and_pair_names(case):
        if np.isfinite(value := quantity_value(name, last, case.probes)):
            quantities[name] = value
    return quantities | bolt_forces(last)


def bolt_forces(last: StepResult) -> dict[str, float]:
    """Return the force of each pretension section in a step, as the quantity ``"NAME.pretension_force"``."""
    return {f"{name}.{BOLT_FORCE}": float(section["force"]) for name, section in last.pretension.items()}


def check_names(case: Case, names: Iterable[str]) -> None:
    """Raise CaseError if a name is not that of a quantity that `measure` may return for the case."""
    bolts = [f"{section.label}.{BOLT_FORCE}" for section in case.model.pretensions]
    known = [*LABELS, *_probe_and_pair_names(case), *bolts]
    for name in names:
        if name not in known:
            text = unknown("quantity", name, known)
            further = "; those of probes and pairs are, for example, PROBE.stress.yy and PAIR.force.x"
            raise CaseError(text if "did you mean" in text else text + further)


def _probe_and_pair_names(case: Case) -> list[str]:
    """Return the names of the quantities of the probes and contact pairs of a case, such as ``"fit.moment.z"``.

    The checks of a case file use the same names. Quantities that require an option are omitted for pairs without this option.
    """
    kinematics = case.model.kinematics
    probe_kinds = [kind for kind in defined_names(checks.PROBE_QUANTITIES, kinematics) if kind != "shear"]
    names = [f"{probe}.{kind}" for probe in case.probes for kind in probe_kinds]
    for pair in case.model.contact:
        options = {*pair.options, *(["rotation"] if pair.rotation else [])}
        for kind in defined_names(checks.PAIR_QUANTITIES, kinematics):
            if kind not in checks.REQUIRED_OPTIONS or checks.REQUIRED_OPTIONS[kind][0] in options:
                names.append(f"{pair.name}.{kind}")
    return names


def quantities_of_contacts(last: StepResult) -> dict[str, float]:
    """Return the quantities of the first contact pair and of bolts in a step that can be evaluated without its model.

    Those of the pair may be NaN if it is open.
    """
    contact = next(iter(last.contact.values()), None)
    return ({} if contact is None else _pressure_quantities(contact)) | bolt_forces(last)


def _pressure_quantities(contact: ContactResult, share: float = 1.0) -> dict[str, float]:
    """Return the quantities of a contact pair that depend only on the case's fraction `share` of the contact [-]."""
    force = contact.normal_force if contact.cancels else contact.force_against_theory(share)
    quantities = {"force": force, "pressure_max": contact.pressure_max, "contact_radius": contact_radius(contact)}
    at_middle = np.abs(contact.place) <= 1e-9 * np.ptp(contact.coordinates, axis=0).max()
    if at_middle.any():
        quantities["pressure_pole"] = float(contact.pressure[at_middle][0])
    return quantities


def _contact_quantities(case: Case, contact: ContactResult, pair: str) -> dict[str, float]:
    """Return the finite quantities of a contact pair, with the errors of the pressure in 2D if there is a theory."""
    theories = case.theories.get(pair, {})
    share, theory = theories.get("share", 1.0), cast(Any, theories.get("theory"))
    quantities = _pressure_quantities(contact, share)
    if case.mesh.dim == 2 and pressure_curve(theory) is not None:
        side = secondary_surface(case, pair)
        quantities["pressure_error"] = pressure_error(case, side, contact, theory)
        if hasattr(theory, "at_force") and quantities["force"] > 0:
            at_force = theory.at_force(quantities["force"] / share)
            quantities["pressure_error_equal_force"] = pressure_error(case, side, contact, at_force)
    return {name: value for name, value in quantities.items() if np.isfinite(value)}


def secondary_surface(case: Case, pair: str) -> Surface:
    """Return the secondary surface of a contact pair."""
    return surface(case.mesh, next(p.secondary for p in case.model.contact if p.name == pair))


def contact_radius(contact: ContactResult) -> float:
    """Return the distance [length] from the contact centre at which the pressure vanishes.

    It is NaN if the contact is open, if it is a ring, or if it has no edge because it extends to the end of the surface.

    Near the edge of a smooth contact, the square of the pressure is linear in the square of the distance; in Hertzian
    contact it is linear everywhere. A line is fitted to the closed nodes beyond 0.4 of the radius, except for the last two
    (if there are at least five), where the edge divides a facet. The radius is the zero of this line, limited to the bracket
    between the outermost closed node and the first open node. If the pressure does not decrease towards the edge, as below a
    punch, the radius is the upper bound of the bracket. With fewer than three such nodes, it is the midpoint of the bracket.
    """
    lower, upper = contact.radius
    if not np.isfinite(upper) or contact.is_ring:
        return float("nan")
    r = np.abs(contact.across)
    nodes = np.flatnonzero(contact.active & (contact.pressure > 0) & (r > 0.4 * lower) & (r < upper))
    nodes = nodes[np.argsort(r[nodes])]
    if len(nodes) < 3:
        return float(0.5 * (lower + upper))
    nodes = nodes[:-2] if len(nodes) >= 5 else nodes
    slope, intercept = np.polyfit((r[nodes] / upper) ** 2, (contact.pressure[nodes] / contact.pressure.max()) ** 2, 1)
    if slope >= 0:
        return float(upper)
    return float(np.clip(upper * np.sqrt(max(-intercept / slope, 0.0)), lower, upper))


def pressure_error(case: Case, side: Surface, contact: ContactResult, theory: Any) -> float:
    """Return the error [-] of the pressure in the L2 norm over the undeformed secondary surface, relative to the theory.

    The error is NaN if the norm of the theory is zero.
    """
    curve = pressure_curve(theory)
    assert curve is not None
    xi, weights = quadrature.gauss_line(6)
    squares = total = 0.0
    for block in side.blocks:
        shape = elements.get(block.element).shape(xi)
        axisymmetric = case.model.kinematics == "axisymmetric"
        area = facet_measure(block.facets, block.element, case.mesh.points, xi, axisymmetric) * weights
        exact = curve.pressure(np.abs(contact.place[block.local] @ shape.T))
        error = contact.pressure[block.local] @ shape.T - exact
        squares, total = squares + float((area * error**2).sum()), total + float((area * exact**2).sum())
    return float(np.sqrt(squares / total)) if total else float("nan")


def peak(mesh: Mesh, values: Array, axisymmetric: bool) -> tuple[float, Array]:
    """Return the maximum of a nodal field (n_points,), interpolated between nodes, and its position (dim,) [length].

    If the node with the largest value is on the axis, a quartic is fitted to the surrounding nodes of the axis with at least
    97 % of this value, provided that there are at least eight of them. Otherwise, in 2D, a quadratic function is fitted to
    the nodes of the adjacent cells; on the axis it is even in the radius. The result is the maximum of the fitted function.
    If there is no such maximum close to these nodes, the result is the largest nodal value.
    """
    top = int(np.argmax(values))
    on_axis = axisymmetric and abs(mesh.points[top, 0]) <= 1e-9 * np.abs(mesh.points).max()
    on_axis_peak = _peak_on_axis(mesh, values, top) if on_axis else None
    if on_axis_peak is not None:
        return on_axis_peak
    adjacent = np.unique(np.concatenate([block[(block == top).any(axis=1)].ravel() for block in mesh.solids.values()]))
    x = (mesh.points[adjacent] - mesh.points[top]).T
    size = np.abs(x).max()
    vertex = _vertex(x / size, values[adjacent], on_axis) if mesh.dim == 2 and size > 0 else None
    if vertex is None:
        return float(values[top]), mesh.points[top].copy()
    return vertex[0], mesh.points[top] + size * vertex[1]


def _peak_on_axis(mesh: Mesh, values: Array, top: int) -> tuple[float, Array] | None:
    """Return the maximum, and its position, of a quartic fitted to nodes of the axis near node `top`, in its body.

    The result is None if there are fewer than eight nodes, or two on either side of `top`, or if the quartic has no maximum.
    """
    line = np.flatnonzero(np.abs(mesh.points[:, 0]) <= 1e-9 * np.abs(mesh.points).max())
    _, body = bodies(mesh)
    line = line[body[line] == body[top]]
    line = line[np.argsort(mesh.points[line, 1])]
    is_low = values[line] < 0.97 * values[top]
    row = int(np.flatnonzero(line == top)[0])
    first = int(np.flatnonzero(is_low[:row])[-1]) + 1 if is_low[:row].any() else 0
    last = row + int(np.flatnonzero(is_low[row:])[0]) if is_low[row:].any() else len(line)
    nodes = line[first:last]
    if len(nodes) < 8 or not first <= row - 2 or not row + 2 < last:
        return None
    y, size = mesh.points[nodes, 1] - mesh.points[top, 1], np.ptp(mesh.points[nodes, 1])
    quartic = np.polynomial.Polynomial.fit(y / size, values[nodes], 4)
    roots = quartic.deriv().roots()
    extrema = roots[np.isreal(roots)].real
    extrema = extrema[(extrema > (y / size).min()) & (extrema < (y / size).max())]
    if not len(extrema):
        return None
    highest = extrema[np.argmax(quartic(extrema))]
    return float(quartic(highest)), mesh.points[top] + np.array([0.0, highest * size])


def _vertex(x: Array, v: Array, on_axis: bool) -> tuple[float, Array] | None:
    """Return the maximum of a quadratic function fitted to values v (n,) at x (2, n) [-], and its position (2,).

    The result is None if the fit is ill-conditioned, or if the function has no maximum close to the positions and the values.
    """
    a, b = x
    terms = [np.ones_like(a), b, b * b, a * a] if on_axis else [np.ones_like(a), b, b * b, a * a, a, a * b]
    system = np.column_stack(terms)
    if len(v) < len(terms) or np.linalg.cond(system) > 1e4:
        return None
    c = np.linalg.lstsq(system, v, rcond=None)[0]
    c = np.append(c, np.zeros(6 - len(c)))
    hessian = np.array([[2 * c[3], c[5]], [c[5], 2 * c[2]]])
    if on_axis:
        hessian[0, 0] = -1.0  # the vertex lies on the axis, whatever the radial curvature
    if not (np.linalg.eigvalsh(hessian) < 0).all():
        return None
    vertex = np.linalg.solve(hessian, -np.array([c[4], c[1]]))
    value = float(c[0] + 0.5 * (c[4] * vertex[0] + c[1] * vertex[1]))
    if np.abs(vertex).max() > 1.0 or abs(value - v.max()) > 0.5 * np.ptp(v):
        return None
    return value, vertex


def node_spacings(
    last: StepResult, pair: str | None, values: Mapping[str, float], mesh: Mesh | None
) -> dict[str, float]:
    """Return half the distance between neighbouring nodes [length] for each quantity that is only known at nodes.

    These quantities are the midpoints of bounds that are positions of nodes, and the depth of a largest stress that is not
    interpolated. `values` are the quantities of interest, and `mesh` is None if it is unknown. On nested meshes, such
    quantities may agree by chance before they have converged.
    """
    bounds = {f"{name}.{kind}": getattr(contact, kind) for name, contact in last.contact.items() for kind in BRACKETS}
    if pair is not None:
        low, high = last.contact[pair].radius
        if values.get("contact_radius") in (low, 0.5 * (low + high), high):  # not fitted to the pressures
            bounds["contact_radius"] = low, high
    if mesh is not None and values.get("von_mises_max") == last.von_mises.max():
        bounds["von_mises_depth"] = 0.0, _neighbour_distance(mesh, int(np.argmax(last.von_mises)))
    return {name: 0.5 * (high - low) for name, (low, high) in bounds.items() if np.isfinite(high - low)}


def _neighbour_distance(mesh: Mesh, node: int) -> float:
    """Return the largest distance [length] between neighbouring nodes on the edges at a corner node of a cell.

    For other nodes, all edges of their cells are considered.
    """
    distance = 0.0
    for name, block in mesh.solids.items():
        element = elements.get(name)
        for cell in block[(block == node).any(axis=1)]:
            ends = cell[np.array(element.edges)]
            ends = ends[(ends == node).any(axis=1)] if node in ends else ends
            lengths = np.linalg.norm(mesh.points[ends[:, 0]] - mesh.points[ends[:, 1]], axis=1)
            distance = max(distance, float(lengths.max()) / element.order)
    return distance


def _depth(case: Case, pair: str, position: Array) -> float:
    """Return the distance [length] between a position (dim,) [length] and the nearest node of a contact pair."""
    sides = next((p.secondary, *filter(None, [p.primary])) for p in case.model.contact if p.name == pair)
    nodes = np.concatenate([case.mesh.points[case.mesh.points_of(side)] for side in sides])
    return float(np.linalg.norm(nodes - position, axis=1).min())


def mesh_size(case: Case, pair: str | None) -> float:
    """Return the shortest edge [length] of the facets of the secondary surface, or of the mesh if there is no contact."""
    if pair is None:
        return quality(case.mesh).shortest_edge
    shortest = np.inf
    for block in secondary_surface(case, pair).blocks:
        facet, points = elements.get(block.element), case.mesh.points[block.facets]
        for a, b in facet.edges if facet.dim == 2 else ((0, 1),):
            shortest = min(shortest, float(np.linalg.norm(points[:, b] - points[:, a], axis=1).min()))
    return shortest


def theory_quantities(theory: Any, share: float = 1.0) -> dict[str, float]:
    """Return the quantities of interest of a theory; `share` [-] is the fraction of its force that acts on the model."""
    names = {"force": "force", "pressure_max": "pressure_max", "contact_radius": "radius"}
    quantities = {key: float(getattr(theory, name)) for key, name in names.items() if hasattr(theory, name)}
    if "force" in quantities:
        quantities["force"] *= share
    if getattr(theory, "radius_x", None) != getattr(theory, "radius_y", None):
        del quantities["contact_radius"]  # the fit of `contact_radius` is that of a circle
    curve = pressure_curve(theory)
    if curve is not None:
        quantities |= {"pressure_max": curve.pressure_max, "pressure_pole": float(curve.pressure(0.0))}
    if hasattr(theory, "von_mises_maximum"):
        maximum = theory.von_mises_maximum()
        quantities |= {"von_mises_max": maximum.value, "von_mises_depth": maximum.depth}
    return {quantity: value for quantity, value in quantities.items() if np.isfinite(value) and value > 0}


def comparison_values(case: Case | None, pair: str | None, force: float) -> dict[str, dict[str, float]]:
    """Return the quantities of a pair in its theory and in its mesh-converged solution.

    The keys are ``theory`` for the theory at equal approach, ``reference`` for the mesh-converged solution, and
    ``equal_force`` for the theory at the contact force `force` [force]. Their values are empty without a case.
    """
    theories = {} if case is None else case.theories.get(pair or "", {})
    theory: Any = theories.get("theory")
    share = theories.get("share", 1.0)
    at_force = theory.at_force(force / share) if force > 0 and hasattr(theory, "at_force") else None
    compared = {"theory": theory, "reference": theories.get("mesh_converged"), "equal_force": at_force}
    return {name: theory_quantities(solution, share) for name, solution in compared.items()}


def title(quantity: str) -> str:
    """Return the title of a quantity; names such as ``"C1.stress.yy"`` are returned unchanged."""
    return LABELS[quantity][0] if quantity in LABELS else quantity


def unit(quantity: str, units: Mapping[str, str]) -> str:
    """Return the name of the unit of a quantity, or an empty string for ratios and unknown units."""
    return units.get(_kind(quantity) or "", "")


def _kind(quantity: str) -> str | None:
    """Return the kind of unit of a quantity, such as length or force, an empty string for ratios, or None if unknown."""
    if quantity in LABELS:
        return LABELS[quantity][1]
    return "force" if quantity.endswith(f".{BOLT_FORCE}") else kind_of_unit(quantity)


def column(label: str, quantity: str, units: Mapping[str, str]) -> str:
    """Return the header of a column or an axis: a label with the unit of the quantity, if known, or ``[1]`` for a ratio."""
    kind = _kind(quantity)
    return f"{label} [1]" if kind == "" else axis_label(label, units, kind or "")
