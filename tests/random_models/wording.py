"""Equivalent models: rotated, renumbered, with supports along normals, along axes, or as multi-point constraints."""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from bodies import Array, Random, rotation

import fastcontact as fc

AXES = "xyz"
Call = tuple[str, tuple, dict[str, Any]]


class SpokenModel(fc.Model):
    """A model that remembers by which calls it was built, `calls`."""

    def __init__(self, mesh: fc.Mesh, kinematics: str, strain: str = "small") -> None:
        super().__init__(mesh, kinematics, strain=strain)
        self.calls: list[Call] = []
        self.inside = False


def _remembered(name: str) -> Callable[..., None]:
    method = getattr(fc.Model, name)

    @functools.wraps(method)
    def call(self: SpokenModel, *given: Any, **named: Any) -> None:
        outermost, self.inside = not self.inside, True
        try:
            method(self, *given, **named)
        finally:
            self.inside = not outermost
        if outermost:
            self.calls.append((name, given, named))

    return call


for _name in dir(fc.Model):
    if _name in ("fix", "prescribe", "couple") or (_name.startswith(("add_", "relate")) and _name != "related_points"):
        setattr(SpokenModel, _name, _remembered(_name))


@dataclass(frozen=True)
class Reworded:
    """A model in other words; `Q` and the `new` numbers of points take displacements back."""

    words: str
    model: fc.Model
    Q: Array
    new: Array

    def back(self, displacement: Array) -> Array:
        """Return displacements (n_points, dim) of the model as it was; rotations in the plane are no vectors."""
        found = displacement[self.new] @ self.Q
        if len(self.Q) == 2:
            rotations = [self.new[p] for p in self._rotations()]
            found[self._rotations()] = displacement[rotations]
        return found

    def _rotations(self) -> list[int]:
        names = [name for name in self.model.mesh.point_groups if name.endswith(" rotation")]
        return [int(np.flatnonzero(self.new == p)[0]) for name in names for p in self.model.mesh.points_of(name)]


def reworded(model: SpokenModel, random: Random) -> Reworded | None:
    """Return a model in other words, by chance among those that can say it; None where none can."""
    for words in random.permutation(list(WORDS)):
        if found := WORDS[str(words)](model, random):
            return found
    return None


def _said(words: str, model: SpokenModel, calls: Sequence[Call], mesh: fc.Mesh | None = None, **how: Any) -> Reworded:
    other = fc.Model(mesh or model.mesh, model.kinematics, strain=model.strain)
    for name, given, named in calls:
        getattr(other, name)(*given, **named)
    return Reworded(words, other, how.get("Q", np.eye(model.mesh.dim)), how.get("new", np.arange(model.mesh.n_points)))


# --- points in another order ----------------------------------------------------------------------------------------


def renumbered(model: SpokenModel, random: Random) -> Reworded | None:
    """Points and cells in another order, cells from other corners on; not where points are named by their numbers."""
    mesh = model.mesh
    if any(name == "relate" for name, *_ in model.calls):
        return None
    order = random.permutation(mesh.n_points)
    new = np.argsort(order)
    rows = {name: random.permutation(len(block)) for name, block in mesh.cells.items()}
    number = np.concatenate([np.argsort(rows[name]) + mesh.offsets[name] for name in mesh.cells])
    other = fc.Mesh(
        mesh.points[order],
        {name: new[block[rows[name]]][:, _from_another_corner(name)] for name, block in mesh.cells.items()},
        {name: number[members] for name, members in mesh.cell_groups.items()},
        {name: new[members] for name, members in mesh.point_groups.items()},
    )
    return _said("renumbered", model, model.calls, other, new=new)


# Rotations of reference cells into themselves, the first that suits: of triangles and wedges, of squares, hexahedra and
# pyramids, of tetrahedra.
ROTATIONS = (
    (np.array([[-1.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array([1.0, 0.0, 0.0])),
    (np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.zeros(3)),
    (np.array([[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array([1.0, 0.0, 0.0])),
)


@functools.cache
def _from_another_corner(name: str) -> list[int]:
    """Return the nodes of a cell such that it lies the same way and begins at another corner; lines as they are."""
    nodes = fc.mesh.elements.get(name).nodes
    dim = nodes.shape[1]
    for A, b in ROTATIONS if dim > 1 else ():
        turned = nodes @ A[:dim, :dim].T + b[:dim]
        away = np.linalg.norm(nodes[:, None] - turned, axis=2)
        if away.min(axis=0).max() < 1e-12:
            return [int(k) for k in away.argmin(axis=0)]
    return list(range(len(nodes)))


# --- turned with all its directions ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class TurnedObstacle:
    """A rigid obstacle that is turned about the origin."""

    shape: Any
    Q: Array

    def distance(self, points: Array) -> tuple[Array, Array]:
        distance, normals = self.shape.distance(points @ self.Q)
        return distance, normals @ self.Q.T


class _NotTurnableError(Exception):
    """Words that name coordinates."""


def turned(model: SpokenModel, random: Random) -> Reworded | None:
    """Turned about the origin; supports are then along axes."""
    dim = model.mesh.dim
    if model.kinematics == "axisymmetric":
        return None
    Q = rotation(random, dim)[:dim, :dim]
    try:
        calls = [_turned_call(call, Q) for call in model.calls]
    except _NotTurnableError:
        return None
    return _said("turned", model, calls, model.mesh.replace(points=model.mesh.points @ Q.T), Q=Q)


def _turned_call(call: Call, Q: Array) -> Call:
    name, given, named = call
    if name in ("fix", "prescribe"):
        along = named.get("axes")
        if given[1:] == ("normal",) or ("normal" in named and not _components(named)):
            return call
        return name, given, {**named, "axes": _frame(Q.T) if along is None else _turned_axes(along, Q)}
    if name == "add_obstacle":
        if "force" in named:
            raise _NotTurnableError
        changes = {"obstacle": TurnedObstacle(named["obstacle"], Q)}
        if named.get("motion"):
            changes["motion"] = _along(_vector(named["motion"], Q))
        if named.get("rotation"):
            own = dict(named["rotation"])
            changes["rotation"] = own | {key: tuple(Q @ own[key]) for key in ("centre", "axis") if key in own}
        return name, given, {**named, **changes}
    if name == "add_material" and getattr(given[0], "axes", None) is not None:
        (material, *rest) = given
        return name, (type(material)(**{**vars(material), "axes": _turned_axes(material.axes, Q)}), *rest), named
    if name in ("add_force", "add_traction", "add_body_force"):
        return name, given, {**_without(named), **_along(_vector(_components(named), Q))}
    if name == "add_moment" and len(Q) == 3:
        return name, given, {**_without(named), **_along(_vector(_components(named), Q))}
    if name == "add_periodicity":
        if named.get("free"):
            raise _NotTurnableError
        return name, given, {**_without(named), **_along(_vector(_components(named), Q))}
    if name == "add_cyclic_symmetry" and len(Q) == 3:
        return name, given, {**named, "direction": tuple(Q @ np.array(named.get("direction", (0.0, 0.0, 1.0))))}
    if name in UNTURNED or (name == "add_coupling" and "components" not in named):
        return call
    raise _NotTurnableError


UNTURNED = (
    "add_material", "add_contact", "add_pressure", "add_temperature", "add_pretension", "add_moment", "add_cyclic_symmetry",
)  # fmt: skip


def _components(named: Mapping[str, Any]) -> dict[str, float]:
    return {name: named[name] for name in AXES if name in named}


def _without(named: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in named.items() if name not in AXES}


def _vector(components: Mapping[str, float], Q: Array) -> Array:
    return Q @ np.array([components.get(name, 0.0) for name in AXES[: len(Q)]])


def _along(vector: Array) -> dict[str, float]:
    return {AXES[k]: float(value) for k, value in enumerate(vector)}


def _frame(rows: Array) -> tuple:
    """Return axes (3, 3) of rows (dim, dim)."""
    found = np.eye(3)
    found[: len(rows), : len(rows)] = rows
    return tuple(map(tuple, found))


def _turned_axes(axes: Any, Q: Array) -> Any:
    full = np.array(_frame(Q))
    if isinstance(axes, fc.CylindricalAxes):
        return fc.CylindricalAxes(tuple(full @ axes.origin), tuple(full @ axes.direction))
    return tuple(map(tuple, np.atleast_2d(axes) @ full.T[: np.shape(axes)[-1], :]))


# --- supports in other words ----------------------------------------------------------------------------------------


def along_axes(model: SpokenModel, random: Random) -> Reworded | None:
    """Supports along axes, those of flat sides along normals, too; such that hold all components along any right angles."""
    dim = model.mesh.dim
    cycle = np.roll(np.eye(dim), 1, axis=0)
    cycle[0] *= np.linalg.det(cycle)

    def said(call: Call) -> Call:
        name, given, named = call
        if name != "fix" or "axes" in named:
            return call
        if given[1] == "normal":
            across = _across(model.mesh, given[0])
            return call if across is None else (name, (given[0], "x"), {"axes": _frame(across)})
        if len(given[1]) == dim:
            return name, given, {"axes": _frame(rotation(random, dim)[:dim, :dim])}
        onto = "".join(AXES[(AXES.index(own) + 1) % dim] for own in given[1])
        return name, (given[0], onto), {"axes": _frame(cycle)}

    return _changed("axes", model, said)


def _across(mesh: fc.Mesh, group: str) -> Array | None:
    """Return right-handed axes in rows (dim, dim), the first across the plane of a group; None if it is none."""
    places = mesh.points[mesh.points_of(group)]
    _, sizes, axes = np.linalg.svd(places - places.mean(axis=0))
    if len(places) < mesh.dim or sizes[-1] > 1e-12 * sizes[0]:
        return None
    axes = axes[::-1].copy()
    axes[-1] *= np.linalg.det(axes)
    return axes


def by_normals(model: SpokenModel, random: Random) -> Reworded | None:
    """Supports of flat sides along an axis, along their normals."""

    def said(call: Call) -> Call:
        name, given, named = call
        if name != "fix" or "axes" in named or len(given[1]) != 1 or not _faces(model.mesh, given[0], given[1]):
            return call
        return name, (given[0], "normal"), {}

    return _changed("normal", model, said)


def _faces(mesh: fc.Mesh, group: str, component: str) -> bool:
    """Whether the nodes of a group of facets lie on a plane across an axis."""
    if group not in mesh.cell_groups or not mesh.cells_of(group, dim=mesh.dim - 1):
        return False
    return bool(np.ptp(mesh.points[mesh.points_of(group), AXES.index(component)]) < 1e-12 * np.ptp(mesh.points))


def as_relations(model: SpokenModel, random: Random) -> Reworded | None:
    """Supports along axes, as one linear relation for each node."""
    calls: list[Call] = []
    for call in model.calls:
        name, given, named = call
        if name != "fix" or "axes" in named or given[1] == "normal":
            calls.append(call)
            continue
        for own in given[1]:
            scale = float(random.choice([1.0, -2.0]))
            calls += [("relate", ([(int(p), own, scale)],), {}) for p in model.mesh.points_of(given[0])]
    return None if len(calls) == len(model.calls) else _said("relations", model, calls)


def _changed(words: str, model: SpokenModel, said: Callable[[Call], Call]) -> Reworded | None:
    calls = [said(call) for call in model.calls]
    return None if all(a is b for a, b in zip(calls, model.calls, strict=True)) else _said(words, model, calls)


WORDS: dict[str, Callable[[SpokenModel, Random], Reworded | None]] = {
    "renumbered": renumbered, "turned": turned, "axes": along_axes, "normal": by_normals, "relations": as_relations,
}  # fmt: skip
