"""Model: a mesh with kinematics, materials, supports and contact pairs; checked whole before any numerics."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.contact.formulations import FORMULATIONS, Formulation
from fastcontact.contact.surface import Surface, surface
from fastcontact.errors import ContactError, ModelError, unknown
from fastcontact.materials import KINEMATICS, LinearElastic
from fastcontact.mesh import Mesh
from fastcontact.mesh_quality import check_cells
from fastcontact.validation import check_overlap, check_supports

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Support:
    """A prescribed displacement component of all nodes of a group: `value` [length] times the ramp."""

    group: str
    component: int
    value: float


@dataclass(frozen=True)
class ContactPair:
    """Two groups of facets that may touch, with a formulation and its options."""

    name: str
    secondary: str
    primary: str
    formulation: str
    options: dict[str, Any] = field(default_factory=dict)


class Model:
    """An elastic contact problem.

    Parameters
    ----------
    mesh : Mesh
    kinematics : str
        ``"axisymmetric"`` (x is the radius, y the axis), ``"plane_strain"``, ``"plane_stress"`` or ``"3d"``.
    case_text : str
        Text kept in result files beside the numbers, usually the case file.

    Raises
    ------
    ModelError
        If the kinematics do not fit the mesh.
    MeshError
        If a cell is degenerate or turned inside out.

    Examples
    --------
    >>> import fastcontact as fc
    >>> model = fc.Model(fc.generate.half_spheres(size=10.0), kinematics="axisymmetric")
    >>> model.add_material(fc.LinearElastic(E=20_000.0, nu=0.3))
    >>> model.fix("A1A2", "x")
    >>> model.prescribe("A2B2", y=-2.0)
    >>> model.prescribe("A1B1", y=+2.0)
    >>> model.add_contact("hertz", secondary="CONT1", primary="CONT2")
    """

    def __init__(self, mesh: Mesh, kinematics: str, case_text: str = "") -> None:
        if kinematics not in KINEMATICS:
            raise ModelError(unknown("kinematics", kinematics, KINEMATICS))
        if (kinematics == "3d") != (mesh.dim == 3):
            fitting = ", ".join(f"'{name}'" for name in KINEMATICS if (name == "3d") == (mesh.dim == 3))
            raise ModelError(f"kinematics '{kinematics}' do not fit a mesh in {mesh.dim} dimensions: use {fitting}")
        if not mesh.solids:
            raise ModelError(f"the mesh has no solid cells, only {', '.join(mesh.cells) or 'points'}")
        check_cells(mesh)
        if kinematics == "axisymmetric":
            radius = mesh.points[:, 0].min()
            if radius < -1e-9 * np.abs(mesh.points).max():
                raise ModelError(
                    f"point {int(mesh.points[:, 0].argmin())} has the radius x = {radius:.6g} < 0: "
                    "an axisymmetric model lies at x >= 0, with y along the axis"
                )
        self.mesh = mesh
        self.kinematics = kinematics
        self.case_text = case_text
        self.materials: list[tuple[LinearElastic, tuple[str, ...] | None]] = []
        self.supports: list[Support] = []
        self.contact: list[ContactPair] = []

    def __repr__(self) -> str:
        pairs = ", ".join(f"{p.name}: {p.secondary} on {p.primary}, {p.formulation}" for p in self.contact)
        return f"Model({self.kinematics}, {self.mesh!r}, {self.n_dofs} degrees of freedom; contact: {pairs or 'none'})"

    @property
    def n_dofs(self) -> int:
        """Number of displacement components of all points."""
        return self.mesh.n_points * self.mesh.dim

    def add_material(self, material: LinearElastic, groups: Sequence[str] | str | None = None) -> None:
        """Give a material to groups of solid cells, by default to all; later calls override earlier ones.

        Raises
        ------
        MeshError, ModelError
            If a group is unknown or holds no solid cells.
        """
        names = (groups,) if isinstance(groups, str) else groups if groups is None else tuple(groups)
        for name in names or ():
            if not self.mesh.cells_of(name, dim=self.mesh.dim):
                raise ModelError(f"group '{name}' holds no solid cells, so it cannot have a material")
        self.materials.append((material, names))

    def fix(self, group: str, components: str) -> None:
        """Hold displacement components (``"x"``, ``"y"``, ``"xy"``, in 3D also ``"z"``) of a group's nodes at zero."""
        if not components:
            raise ModelError(f"fix('{group}', ...) names no component: give for example 'x' or 'xy'")
        self.prescribe(group, **dict.fromkeys(components, 0.0))

    def prescribe(self, group: str, **components: float) -> None:
        """Prescribe displacement components of all nodes of a group, e.g. ``y=-2.0`` [length], times the ramp.

        Raises
        ------
        MeshError, ModelError
            If the group is unknown, a component is not x, y (or z in 3D), or a value is not finite.
        """
        if not len(self.mesh.points_of(group)):
            raise ModelError(f"group '{group}' is empty: no displacement can be prescribed on it")
        if not components:
            raise ModelError(f"prescribe('{group}') names no component: give for example y=-1.0")
        for name, value in components.items():
            axes = "xyz"[: self.mesh.dim]
            if name not in axes:
                raise ModelError(unknown("displacement component", name, axes))
            if not math.isfinite(value):
                raise ModelError(f"the displacement {name} = {value} prescribed on '{group}' is not a finite number")
            self.supports.append(Support(group, axes.index(name), float(value)))

    def add_contact(
        self, name: str, *, secondary: str, primary: str, formulation: str = "node_to_segment", **options: Any
    ) -> None:
        """Let the facets of group `secondary` come into contact with those of group `primary`.

        Parameters
        ----------
        name : str
            Name of the pair in the results.
        secondary, primary : str
            The side whose nodes or integration points are projected and carry the constraints, and the side
            projected upon. Facets are oriented from the solid behind them.
        formulation : str
            ``"node_to_segment"`` or ``"continuous"``.
        **options
            Fields of the formulation, e.g. ``integration="simpson"``.

        Raises
        ------
        ContactError
            If a side is wrong, an option unknown, the name taken, or the model three-dimensional.
        """
        if self.mesh.dim == 3:
            raise ContactError(f"contact '{name}' cannot be set up: contact between bodies is two-dimensional so far")
        if name in {pair.name for pair in self.contact}:
            raise ContactError(f"there is already a contact pair '{name}': names must differ")
        pair = ContactPair(name, secondary, primary, formulation, options)
        self.bind(pair)
        self.contact.append(pair)

    def bind(self, pair: ContactPair) -> Formulation:
        """Return the formulation of a contact pair on this mesh; see `add_contact` for the errors."""
        if pair.formulation not in FORMULATIONS:
            raise ContactError(unknown("contact formulation", pair.formulation, FORMULATIONS))
        kind = FORMULATIONS[pair.formulation]
        given = ("secondary", "primary", "points", "axisymmetric", "modulus")
        known = [f.name for f in dataclasses.fields(kind) if f.init and f.name not in given]
        for option in pair.options:
            if option not in known:
                raise ContactError(unknown(f"option of {pair.formulation}", option, known))
        sides = surface(self.mesh, pair.secondary), surface(self.mesh, pair.primary)
        _check_sides(self.mesh, pair, *sides)
        modulus = min((m.E / (1 - m.nu**2) for m, _ in self.materials), default=1.0)
        return kind(*sides, self.mesh.points, self.kinematics == "axisymmetric", modulus, **pair.options)

    def material_numbers(self) -> tuple[Array, dict[str, NDArray[np.int32]]]:
        """Return moduli (n_materials, 4, 4), in 3D (n_materials, 6, 6), and by element every solid cell's material.

        Raises
        ------
        ModelError
            If cells are left without a material; their groups are named.
        """
        if not self.materials:
            raise ModelError("no material: call add_material(LinearElastic(E=..., nu=...)) for the solid cells")
        numbers = {name: np.full(len(block), -1, np.int32) for name, block in self.mesh.solids.items()}
        for index, (_, groups) in enumerate(self.materials):
            for name in numbers if groups is None else ():
                numbers[name][:] = index
            for group in groups or ():
                for name, rows in self.mesh.split(self.mesh.cell_groups[group]).items():
                    if name in numbers:
                        numbers[name][rows] = index
        self._check_all_have_material(numbers)
        return np.stack([material.moduli(self.kinematics) for material, _ in self.materials]), numbers

    def _check_all_have_material(self, numbers: dict[str, NDArray[np.int32]]) -> None:
        without = {name: np.flatnonzero(values < 0) for name, values in numbers.items()}
        total = sum(map(len, without.values()))
        if not total:
            return
        offsets = self.mesh.offsets
        cells = np.concatenate([rows + offsets[name] for name, rows in without.items()])
        groups = [g for g, members in self.mesh.cell_groups.items() if np.isin(members, cells).any()]
        named = f", in {', '.join(repr(g) for g in groups)}" if groups else ""
        raise ModelError(f"{total} solid cells have no material{named}: add_material for their groups")

    def prescribed(self) -> tuple[NDArray[np.bool_], Array]:
        """Return (fixed, values), both (n_points, dim): supported components, and their displacement at ramp value 1.

        Raises
        ------
        ModelError
            If two supports ask for different values of one component at one node.
        """
        fixed = np.zeros(self.mesh.points.shape, bool)
        values = np.zeros(self.mesh.points.shape)
        owner: dict[tuple[int, int], str] = {}
        for support in self.supports:
            nodes, k = self.mesh.points_of(support.group), support.component
            clash = nodes[fixed[nodes, k] & (values[nodes, k] != support.value)]
            if len(clash):
                raise ModelError(
                    f"'{support.group}' prescribes {'xyz'[k]} = {support.value:g} at point {clash[0]}, but "
                    f"'{owner[int(clash[0]), k]}' prescribes {values[clash[0], k]:g} there: remove one of the two"
                )
            fixed[nodes, k], values[nodes, k] = True, support.value
            owner.update({(int(node), k): support.group for node in nodes})
        return fixed, values

    def check(self) -> None:
        """Check the whole model; `solve` does so before any numerics.

        Raises
        ------
        MeshError, ModelError, ContactError
            One clear line that names the culprit and the remedy.
        """
        self.material_numbers()
        fixed, _ = self.prescribed()
        check_overlap(self.mesh, self.kinematics, [(pair.secondary, pair.primary) for pair in self.contact])
        check_supports(self.mesh, self.kinematics, fixed)


def _check_sides(mesh: Mesh, pair: ContactPair, secondary: Surface, primary: Surface) -> None:
    """Refuse sides that share nodes or cannot face each other."""
    shared = np.intersect1d(secondary.points, primary.points)
    if len(shared):
        raise ContactError(
            f"the two sides of contact '{pair.name}' share {len(shared)} nodes (first: point {shared[0]}): "
            "duplicate the nodes of the interface, one set for each side"
        )
    ours, theirs = _facet_frames(mesh, secondary), _facet_frames(mesh, primary)
    apart = theirs[0][None] - ours[0][:, None]
    facing = np.einsum("id,jd->ij", ours[1], theirs[1]) < 0
    ahead = (np.einsum("ijd,id->ij", apart, ours[1]) > -0.1 * np.linalg.norm(apart, axis=2)) | (
        np.linalg.norm(apart, axis=2) < np.minimum.outer(ours[2], theirs[2])
    )
    if not (facing & ahead).any():
        raise ContactError(
            f"no facet of '{pair.secondary}' faces '{pair.primary}': the outer sides of the two groups look away from "
            "each other; is one of them the wrong face of its body?"
        )


def _facet_frames(mesh: Mesh, side: Surface) -> tuple[Array, Array, Array]:
    """Return centres, unit normals and lengths of at most about 200 facets of a 2D surface."""
    some = side.facets[:: max(1, len(side.facets) // 200)]
    a, b = mesh.points[some[:, 0]], mesh.points[some[:, 1]]
    tangent = b - a
    length = np.linalg.norm(tangent, axis=1)
    return 0.5 * (a + b), np.column_stack([tangent[:, 1], -tangent[:, 0]]) / length[:, None], length
