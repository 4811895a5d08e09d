"""Fingerprints of models, which consist of a short digest of each part. Models with equal fingerprints have equal results.

Numbers must be bitwise identical. Functions are compared by their values at the points on which they act. Names of groups
are included. The order in which loads and supports were added is not included, and neither are settings that may change when
an analysis is resumed: titles, the linear solver, tolerances and limits.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from fastcontact.arrays import Array
from fastcontact.contact.formulations import FORMULATIONS
from fastcontact.elasticity.materials import LinearElastic, Material
from fastcontact.elasticity.temperature import Temperature
from fastcontact.elasticity.varying_constants import Varying
from fastcontact.heat.loads import TemporaryHeat
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import cached_by_mesh
from fastcontact.model.contact_pair import ContactPair
from fastcontact.model.model import Model
from fastcontact.model.parts.base import Support

# Number of hexadecimal digits of a digest.
N_DIGITS = 16
SMOOTHING = "surface_smoothing of contact"
CORNERS = "the integration at corners (in earlier versions: 'gauss') of contact"


def fingerprint(model: Model, options: Mapping[str, Any] | None = None) -> dict[str, str]:
    """Return the digest of each part of a model, and of the options (plain values by name) that change its results.

    Keys are the names of the parts in messages: "the mesh", "the materials", "contact 'hertz'", ...
    """
    mesh = model.mesh
    incompatible_modes = model.uses_incompatible_modes()
    inputs: dict[str, Any] = {
        "the kinematics": model.kinematics,
        **({"the strain": model.strain} if model.strain != "small" else {}),
        "the materials": model.materials,
        "the supports": _unordered(model.supports, mesh),
        "the loads": _unordered(model.loads, mesh),
        **({"the temperatures": _unordered(model.temperatures, mesh)} if model.temperatures else {}),
        **({"the initial states": _unordered(model.initial_states, mesh)} if model.initial_states else {}),
        **({"the heat": [model.reference_temperature, _unordered(model.heat_loads, mesh)]} if model.conducts else {}),
        **{f"the conductance of contact '{name}'": law.signature for name, law in model.conductances().items()},
        **({"the incompatible modes": incompatible_modes} if any(incompatible_modes) else {}),
        "the relations": _unordered(model.relations, mesh),
        "the springs": _unordered(model.springs, mesh),
        **({"the pretension sections": _unordered(model.pretensions, mesh)} if model.pretensions else {}),
        "the list of contact pairs": [pair.name for pair in model.contact],
        **{f"contact '{pair.name}'": _compared(pair) for pair in model.contact},
        **{f"{SMOOTHING} '{pair.name}'": True for pair in model.contact if model.bind(pair).smoothing},
        **{f"{CORNERS} '{pair.name}'": True for pair in model.contact if model.bind(pair).has_nodes_at_corners},
        **{f"the option {name}": value for name, value in (options or {}).items()},
    }
    return {"the mesh": digest_of_mesh(mesh), **{name: _digest(entry, mesh) for name, entry in inputs.items()}}


def differing_parts(first: Mapping[str, str], second: Mapping[str, str]) -> list[str]:
    """Return the names of the parts in which two fingerprints differ."""
    return [name for name in {**first, **second} if first.get(name) != second.get(name)]


def formulation_of_digest(model: Model, name: str, digest: str | None) -> str | None:
    """Return the formulation and its options with which pair `name` has the given `digest`; None if no formulation has it.

    Earlier versions chose other default formulations for pairs whose formulation is not given.
    """
    (pair,) = (candidate for candidate in model.contact if candidate.name == name)
    base_pair = _without(pair, "surface_smoothing", "multipliers")
    choices: list[tuple[str, dict[str, str]]] = [(formulation, {}) for formulation in FORMULATIONS]
    choices += [("mortar", {"multipliers": multipliers}) for multipliers in ("standard", "dual")]
    for formulation, options in choices:
        candidate = dataclasses.replace(base_pair, formulation=formulation, options={**base_pair.options, **options})
        if _digest(candidate, model.mesh) == digest:
            return ", ".join(f"{key}='{value}'" for key, value in {"formulation": formulation, **options}.items())
    return None


def _compared(pair: ContactPair) -> ContactPair:
    """Return a pair without the options that other parts contain, and without Gauss points, the earlier default."""
    gauss = ["integration"] if pair.options.get("integration") == "gauss" else []
    return _without(pair, "surface_smoothing", "conductance", *gauss)


def _without(pair: ContactPair, *options: str) -> ContactPair:
    """Return a pair without some of its options."""
    return dataclasses.replace(pair, options={key: value for key, value in pair.options.items() if key not in options})


def _unordered(items: Iterable[Any], mesh: Mesh) -> list[str]:
    """Return the sorted digests of items whose order has no effect."""
    return sorted(_digest(item, mesh) for item in items)


@cached_by_mesh
def digest_of_mesh(mesh: Mesh) -> str:
    """Return the digest of points, cells and groups."""
    return _digest(mesh, mesh)


def _digest(value: Any, mesh: Mesh) -> str:
    """Return the first N_DIGITS hexadecimal digits of the SHA-256 hash of a value."""
    digest = hashlib.sha256()
    _update(value, digest.update, mesh, mesh.points)
    return digest.hexdigest()[:N_DIGITS]


def _update(value: Any, add: Callable[[bytes], None], mesh: Mesh, points: Array) -> None:
    """Add a value to a digest with the function `add`. A function is represented by its values at `points` (n, dim)."""
    if isinstance(value, Mesh):
        value = [value.points, value.cells, value.cell_groups, value.point_groups]
    if isinstance(value, Varying):
        value = value.source
    if isinstance(value, csr_array):
        value = [value.data, value.indices.astype(np.int64), value.indptr.astype(np.int64)]
    if isinstance(value, np.ndarray):
        add(f"array {value.shape} {value.dtype.kind}".encode())
        add(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, (bool, np.bool_, str)) or value is None:
        add(f"{type(value).__name__} {value}".encode())
    elif isinstance(value, (int, float, np.number)):
        add(f"number {float(value)!r}".encode())
    elif isinstance(value, Mapping):
        _update(sorted(map(str, value)), add, mesh, points)
        for key in sorted(value, key=str):
            _update(value[key], add, mesh, points)
    elif isinstance(value, (list, tuple, range)):
        add(f"sequence {len(value)}".encode())
        for entry in value:
            _update(entry, add, mesh, points)
    else:
        _update_object(value, add, mesh, points)


def _update_object(value: Any, add: Callable[[bytes], None], mesh: Mesh, points: Array) -> None:
    """Add an object to a digest: its type, the fields of a dataclass, and the values of an obstacle or a function."""
    add(type(value).__qualname__.encode())
    points = _points_of(value, mesh, points)
    is_material = isinstance(value, Material)
    fields = list(dataclasses.fields(value)) if dataclasses.is_dataclass(value) else []
    fields = [field for field in fields if field.init or is_material]
    if hasattr(value, "distance"):
        _update(list(value.distance(points)), add, mesh, points)
        fields = [field for field in fields if not callable(getattr(value, field.name))]
    elif not fields and callable(value):
        _update(_function_values(value, points), add, mesh, points)
    # Some fields with default values are left out, so that digests agree with those in files of earlier versions.
    if is_material:
        fields = [field for field in fields if getattr(value, field.name) is not None]
        fields = [field for field in fields if field.name != "incompatible_modes"]
    if isinstance(value, (ContactPair, Support)) and value.rotation is None:
        fields = [field for field in fields if not field.name.startswith("rotation")]
    if isinstance(value, TemporaryHeat):
        fields = [field for field in fields if field.name not in ("begins", "ends", "reached") or value.temporary]
    if isinstance(value, Temperature):  # the ramp of a history contains its instants
        fields = [field for field in fields if field.name not in ("times", "instant")]
    if isinstance(value, ContactPair):
        fields = [f for f in fields if f.name != "detected_gap" and (f.name != "fluid" or value.fluid is not None)]
    if isinstance(value, LinearElastic):  # include only the treatment of dilatation that takes effect
        fields = [field for field in fields if field.name != "volumetric"]
        add(b"mean dilatation" if value.averaged else b"")
    for field in fields:
        add(field.name.encode())
        _update(getattr(value, field.name), add, mesh, points)


def _function_values(function: Callable[[Array], Any], points: Array) -> Any:
    """Return the values (n,) of a function at `points` (n, dim), or its name if it raises an error there."""
    try:
        return np.asarray(function(points), float)
    except Exception:  # `Model.check` reports the errors of a user's function
        return getattr(function, "__qualname__", "function")


def _points_of(value: Any, mesh: Mesh, points: Array) -> Array:
    """Return the positions of the group on which a load, support or contact pair acts; without a group, `points`."""
    group = value.secondary if isinstance(value, ContactPair) else getattr(value, "group", None)
    if isinstance(group, str) and group in mesh.group_names:
        return np.asarray(mesh.points[mesh.points_of(group)])
    return points
