"""Tested values of a code_aster spec, taken from results of fastcontact, and their deviation from the reference.

A value is read as code_aster writes it: LAGS_C and PRES are negative in compression, forces of axisymmetric models are
per radian, a reduction runs over all nodes that carry the component.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from aster_mesh import Entry, MissingError, nodes_of
from aster_spec import Problem
from mechanics import contact_forces
from scipy.spatial import cKDTree

import fastcontact as fc
from fastcontact.mesh import elements

Field = dict[int, float]
STRESS = {"SIXX": 0, "SIYY": 1, "SIZZ": 2, "SIXY": 3, "SIYZ": 4, "SIXZ": 5}
REDUCTIONS: dict[str, Callable[[np.ndarray], float]] = {
    "MIN": np.min,
    "MAX": np.max,
    "SOMM": np.sum,
    "SOMM_ABS": lambda values: float(np.abs(values).sum()),
    "MIN_ABS": lambda values: float(np.abs(values).min()),
    "MAX_ABS": lambda values: float(np.abs(values).max()),
}


@dataclass(frozen=True)
class Verdict:
    """A found value against an expected one; `ratio` is the deviation over the tolerance."""

    label: str
    found: float
    expected: float
    tolerance: float
    relative: bool

    @property
    def deviation(self) -> float:
        """Relative or absolute, as the criterion says."""
        apart = abs(self.found - self.expected)
        if self.relative and self.expected:
            return apart / abs(self.expected)
        return apart

    @property
    def ratio(self) -> float:
        """One at the tolerance."""
        return float(np.nan_to_num(self.deviation / self.tolerance, nan=np.inf))

    def __str__(self) -> str:
        kind = "relative" if self.relative else "absolute"
        return (
            f"{self.label}: found {self.found:.10g}, expected {self.expected:.10g}, {kind} deviation "
            f"{self.deviation:.3e}, {self.ratio:.3g} times the tolerance {self.tolerance:g}"
        )


def verdict(
    test: Entry, reference: float, tolerance: float, problem: Problem, steps: Sequence[fc.StepResult]
) -> Verdict:
    """Return the verdict on one tested value; of several values that all must hold, the worst.

    Raises
    ------
    MissingError
        If the results do not hold the value.
    """
    relative = test["criterion"] == "RELATIF"
    unsigned = test.get("VALE_ABS") == "OUI"
    expected = abs(reference) if unsigned else reference
    found = [abs(value) if unsigned else value for value in values(test, problem, steps)]
    return max(
        (Verdict(label(test), float(value), expected, tolerance, relative) for value in found), key=lambda v: v.ratio
    )


def label(test: Entry) -> str:
    """Return what is tested, where and when."""
    field, component = _field_of(test)
    place = test.get("location") or {}
    where = next((f"at {place[key]}" for key in ("GROUP_NO", "GROUP_MA", "NOEUD") if key in place), "")
    return " ".join(part for part in (field, component, test.get("reduction", ""), where) if part)


def values(test: Entry, problem: Problem, steps: Sequence[fc.StepResult]) -> list[float]:
    """Return the tested value; several where a value must hold at several places."""
    step = _step(test, problem, steps)
    name, component = _field_of(test)
    if name not in FIELDS:
        raise MissingError(f"needs the field {name}")
    found = _in_frame(test, problem, lambda c: FIELDS[name](problem, step, c, test), component)
    nodes = _location(test, problem, found)
    outside = [node for node in nodes if node not in found]
    if outside:
        raise MissingError(f"needs {name} {component} at points outside the contact surface (first: {outside[0] + 1})")
    there = np.array([found[node] for node in nodes])
    reduction = test.get("reduction")
    if not reduction:
        return there.tolist()
    kind = reduction.split()[0]
    if kind not in REDUCTIONS:
        raise MissingError(f"needs the reduction {kind}")
    return [float(REDUCTIONS[kind](there))]


def _table(test: Entry) -> Entry:
    """Return what POST_RELEVE_T was asked for, of a value that went through a table."""
    actions = [test.get("extraction") or {}]
    actions += [made["kw"].get("ACTION") for made in test.get("provenance") or () if made["cmd"] == "POST_RELEVE_T"]
    return next((a for a in actions if isinstance(a, dict) and a.get("OPERATION") == "EXTRACTION"), {})


def _in_frame(test: Entry, problem: Problem, field: Callable[[str], Field], component: str) -> Field:
    """Return a component in the frame that a table was written in; see REPERE in the README of the cases."""
    frame = _table(test).get("REPERE", "GLOBAL")
    if frame == "GLOBAL":
        return field(component)
    if problem.mesh.dim != 2:
        raise MissingError(f"needs the frame {frame} in 3D")
    points = problem.mesh.points
    if frame == "POLAIRE" and component == "SIXX":
        xx, yy, xy = (field(name) for name in ("SIXX", "SIYY", "SIXY"))
        radial = {node: points[node] / np.linalg.norm(points[node]) for node in xx if points[node].any()}
        return {n: float(r[0] ** 2 * xx[n] + r[1] ** 2 * yy[n] + 2 * r[0] * r[1] * xy[n]) for n, r in radial.items()}
    if frame == "LOCAL" and component in ("DX", "DY"):
        nodes = [number - 1 for number in test["location"]["nodes_1based"]]
        line = points[nodes[-1]] - points[nodes[0]]
        along = line / np.linalg.norm(line)
        if np.abs(np.cross(points[nodes] - points[nodes[0]], along)).max() > 1e-6 * np.linalg.norm(line):
            raise MissingError("needs the frame LOCAL along a line that is not straight")
        axis = along if component == "DX" else np.array([-along[1], along[0]])
        x, y = field("DX"), field("DY")
        return {node: float(axis[0] * x[node] + axis[1] * y[node]) for node in nodes}
    raise MissingError(f"needs {component} in the frame {frame}")


def _field_of(test: Entry) -> tuple[str, str]:
    """Return the field and the component, also of values that went through a table."""
    if "field" in test:
        return test["field"], test["component"]
    table = _table(test)
    if "NOM_CHAM" in table and (test.get("location") or not test.get("filter")):
        return table["NOM_CHAM"], test["table_column"]
    named = {entry["NOM_PARA"]: entry for entry in test.get("filter") or ()}
    if test.get("table_column") == "VALE" and {"NOM_CHAM", "NOM_CMP"} <= set(named):
        return named["NOM_CHAM"]["VALE_K"], named["NOM_CMP"]["VALE_K"]
    raise MissingError(f"needs the table {test.get('result')}, column {test.get('table_column')}")


def _step(test: Entry, problem: Problem, steps: Sequence[fc.StepResult]) -> fc.StepResult:
    instant = test.get("instant")
    if instant is None:
        instant = problem.times[test["order"]]
    for step in steps:
        if abs(step.load_factor - instant) <= 1e-9 * max(1.0, abs(instant)):
            return step
    raise MissingError(f"needs the instant {instant}")


def _location(test: Entry, problem: Problem, found: Field) -> list[int]:
    place = test.get("location") or {}
    if "nodes_1based" in place:
        return [number - 1 for number in place["nodes_1based"]]
    unresolved = [
        entry["unresolved_cell_group"]["NOM"]
        for mesh in problem.spec["meshes"]
        for entry in mesh.get("derived_groups") or ()
        if "unresolved_cell_group" in entry
    ]
    if not place or place.get("GROUP_MA") in unresolved:
        return sorted(found)  # a value without a known place must hold everywhere
    return nodes_of(problem.mesh, place).tolist()


# Fields: component by point


def _displacement(problem: Problem, step: fc.StepResult, component: str, test: Entry) -> Field:
    if component == "LAGS_C":
        return _contact_values(step, lambda contact: -contact.pressure)
    axis = ("DX", "DY", "DZ").index(component) if component in ("DX", "DY", "DZ") else problem.mesh.dim
    if axis >= problem.mesh.dim:
        raise MissingError(f"needs DEPL {component}")
    return dict(enumerate(step.displacement[:, axis]))


def _stress(problem: Problem, step: fc.StepResult, component: str, test: Entry) -> Field:
    if component not in STRESS or STRESS[component] >= step.stress.shape[1]:
        raise MissingError(f"needs SIEF_NOEU {component}")
    solid = np.unique(np.concatenate([block.ravel() for block in problem.mesh.solids.values()]))
    return dict(zip(solid.tolist(), step.stress[solid, STRESS[component]], strict=True))


def _element_stress(problem: Problem, step: fc.StepResult, component: str, test: Entry) -> Field:
    """Return stresses of the elements at their own nodes: of one cell, or the mean over the elements at each node."""
    if component not in STRESS or STRESS[component] >= step.stress.shape[1]:
        raise MissingError(f"needs SIGM_ELNO {component}")
    group = (test.get("location") or {}).get("GROUP_MA")
    return _mean_of_elements(problem, step, lambda stress: stress[..., STRESS[component]], group)


def _equivalent(problem: Problem, step: fc.StepResult, component: str, test: Entry) -> Field:
    """Return nodal means of the equivalent stresses of the elements, not those of the mean stress."""
    equivalent = {"VMIS": fc.recovery.von_mises, "VMIS_SG": fc.recovery.von_mises_signed}.get(component)
    if equivalent is None:
        raise MissingError(f"needs SIEQ_NOEU {component}")
    return _mean_of_elements(problem, step, equivalent)


def _mean_of_elements(
    problem: Problem, step: fc.StepResult, of: Callable[[np.ndarray], np.ndarray], group: str | None = None
) -> Field:
    """Return the mean over the elements at each node, those of a group alone, of a function of their stresses."""
    mesh = problem.mesh
    moduli, material = problem.model.material_numbers()
    at_points = fc.recovery.stress_at_points(mesh, problem.model.kinematics, moduli, material, step.displacement)
    chosen = None if group is None else mesh.split(mesh.cell_groups[group])
    total, count = np.zeros(mesh.n_points), np.zeros(mesh.n_points)
    for name, stress in fc.recovery.stress_at_element_nodes(at_points).items():
        rows = np.arange(len(stress)) if chosen is None else chosen.get(name, np.empty(0, int))
        np.add.at(total, mesh.cells[name][rows], of(stress[rows]))
        np.add.at(count, mesh.cells[name][rows], 1.0)
    return {int(node): float(total[node] / count[node]) for node in np.flatnonzero(count)}


def _surface_pressure(problem: Problem, step: fc.StepResult, component: str, test: Entry) -> Field:
    """Return normal stresses n s n on the contact surfaces, n the mean normal of the facets at each node.

    Facets are those of the deformed mesh, as code_aster takes them, unless the test says otherwise.
    """
    if component != "PRES":
        raise MissingError(f"needs PRES_NOEU {component}")
    mesh, found = problem.mesh, {}
    deformed = mesh.points if test.get("geometry") == "reference" else mesh.points + step.displacement
    for pair in problem.model.contact:
        for group in filter(None, (pair.secondary, pair.primary)):
            for node, normal in _normals(mesh, group, deformed).items():
                found[node] = float(normal @ _tensor(step.stress[node]) @ normal)
    return found


def _normals(mesh: fc.Mesh, group: str, coordinates: np.ndarray) -> dict[int, np.ndarray]:
    """Return unit means of the facets' normals at the nodes of a group; the sign does not matter here."""
    total: dict[int, np.ndarray] = {}
    for name, block in fc.topology.outer_facets(mesh).items():
        element = elements.get(name)
        inside = np.isin(block, nodes_of(mesh, {"GROUP_MA": group})).all(axis=1)
        tangent = np.einsum("akj,fkd->fajd", element.gradient(element.nodes), coordinates[block[inside]])
        if mesh.dim == 2:
            normal = np.stack([tangent[:, :, 0, 1], -tangent[:, :, 0, 0]], axis=2)
        else:
            normal = np.cross(tangent[:, :, 0], tangent[:, :, 1])
        normal /= np.linalg.norm(normal, axis=2, keepdims=True)
        for node, vector in zip(block[inside].ravel().tolist(), normal.reshape(-1, mesh.dim), strict=True):
            total[node] = total.get(node, 0.0) + vector
    return {node: vector / np.linalg.norm(vector) for node, vector in total.items()}


def _tensor(stress: np.ndarray) -> np.ndarray:
    if len(stress) == 4:
        xx, yy, _, xy = stress
        return np.array([[xx, xy], [xy, yy]])
    xx, yy, zz, xy, yz, xz = stress
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _contact_values(step: fc.StepResult, of: Callable[[fc.ContactResult], np.ndarray]) -> Field:
    """Return what a function gives for the secondary nodes of all pairs."""
    found: Field = {}
    for contact in step.contact.values():
        found.update(zip(contact.points.tolist(), np.asarray(of(contact), float).tolist(), strict=True))
    return found


OF_CONTACT_ELEMENTS: dict[str, Callable[[fc.ContactResult], np.ndarray]] = {
    "PRES": lambda contact: -contact.pressure,
    "JEU": lambda contact: contact.gap,
    "CONT": lambda contact: contact.active,
}


def _contact_element(problem: Problem, step: fc.StepResult, component: str, test: Entry) -> Field:
    """Return the fields of code_aster's mortar facets, at the nodes: a uniform one is the same there."""
    if component not in OF_CONTACT_ELEMENTS:
        raise MissingError(f"needs CONT_ELEM {component}")
    return _contact_values(step, OF_CONTACT_ELEMENTS[component])


def _contact_node(problem: Problem, step: fc.StepResult, component: str, test: Entry) -> Field:
    per_radian = _per_radian(problem)
    if component == "JEU":
        return _contact_values(step, OF_CONTACT_ELEMENTS["JEU"])
    if component == "CONT":
        return _status(problem, step)
    if component in ("RX", "RY", "RZ"):
        axis = "XYZ".index(component[1])
        return _contact_values(step, lambda contact: per_radian * contact.force_vectors[:, axis])
    if component == "RN":
        return _contact_values(
            step, lambda contact: per_radian * np.einsum("nd,nd->n", contact.force_vectors, contact.normal)
        )
    if component in ("PROJ_X", "PROJ_Y", "PROJ_Z"):
        axis = "XYZ".index(component[-1])
        return _contact_values(step, lambda contact: _projection(problem, contact, step)[:, axis])
    raise MissingError(f"needs CONT_NOEU {component}")


def _status(problem: Problem, step: fc.StepResult) -> Field:
    """Return 0 open, 1 closed and sticking, 2 closed and sliding, also without friction; watched: 3 penetrating, -1 lost."""
    found: Field = {}
    for pair in problem.model.contact:
        contact = step.contact[pair.name]
        if pair.options.get("kind") == "gap_only":
            status = np.where(np.isfinite(contact.gap), np.where(contact.gap < 0, 3, 0), -1)
        else:
            sticking = contact.sticking & bool(pair.options.get("friction"))
            status = np.where(contact.active, 2 - sticking, 0)
        found.update(zip(contact.points.tolist(), status.astype(float).tolist(), strict=True))
    return found


def _projection(problem: Problem, contact: fc.ContactResult, step: fc.StepResult) -> np.ndarray:
    """Return where the secondary nodes project to, (m, dim); with NODAL that is the nearest node."""
    position = contact.coordinates + step.displacement[contact.points]
    zone = problem.run["contact"]["zones"][list(step.contact).index(contact.name)]
    if zone.get("APPARIEMENT") != "NODAL":
        return position - contact.gap[:, None] * contact.normal
    nodes = nodes_of(problem.mesh, {"GROUP_MA": zone["master"]})
    opposite = (problem.mesh.points + step.displacement)[nodes]
    return opposite[cKDTree(opposite).query(position)[1]]


def _reaction(problem: Problem, step: fc.StepResult, component: str, test: Entry) -> Field:
    """Return forces of supports, relations and contact, on both sides of it; code_aster counts springs as elements."""
    axis = ("DX", "DY", "DZ").index(component)
    if any(springs.grounded for springs in problem.model.springs):
        raise MissingError("needs REAC_NODA with springs to the ground")
    return dict(enumerate((step.reaction + contact_forces(step))[:, axis] * _per_radian(problem)))


def _internal(problem: Problem, step: fc.StepResult, component: str, test: Entry) -> Field:
    """Return forces that hold the elements as they are, springs among them."""
    axis = ("DX", "DY", "DZ").index(component)
    total = problem.model.internal_forces(step.displacement)
    for springs in problem.model.springs:
        total += (springs.rows.T @ springs.tension(step.displacement)).reshape(total.shape)
    return dict(enumerate(total[:, axis] * _per_radian(problem)))


def _per_radian(problem: Problem) -> float:
    return 1 / (2 * np.pi) if problem.model.kinematics == "axisymmetric" else 1.0


FIELDS: dict[str, Callable[[Problem, fc.StepResult, str, Entry], Field]] = {
    "DEPL": _displacement,
    "SIEF_NOEU": _stress,
    "SIGM_NOEU": _stress,
    "SIGM_ELNO": _element_stress,
    "SIEQ_NOEU": _equivalent,
    "PRES_NOEU": _surface_pressure,
    "CONT_ELEM": _contact_element,
    "CONT_NOEU": _contact_node,
    "REAC_NODA": _reaction,
    "FORC_NODA": _internal,
}
