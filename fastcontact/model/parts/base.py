"""Base class of a model: the mesh, the kinematics, the lists of added items, and the materials of the solid cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from fastcontact._jit import ahead
from fastcontact._tools.argument_types import typed, unit_vector
from fastcontact._tools.units import named_units
from fastcontact.arrays import AnyArray, Array, Indices, Mask, Numbers
from fastcontact.contact.obstacles.rigid_side import Rotation
from fastcontact.elasticity.incompatible_modes import ELEMENTS_WITH_MODES
from fastcontact.elasticity.initial_states import InitialState
from fastcontact.elasticity.loads import Load, Value, check_number, check_solids, evaluated, solid_rows
from fastcontact.elasticity.material_field import MaterialField, material_field
from fastcontact.elasticity.materials import KINEMATICS, Material
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint
from fastcontact.elasticity.nonlinear_bodies import NonlinearBodies, check_law, field_names
from fastcontact.elasticity.nonlinear_materials import STRAINS, NonlinearElastic
from fastcontact.elasticity.springs import Springs
from fastcontact.elasticity.stiffness import stiffness
from fastcontact.elasticity.temperature import Temperature
from fastcontact.elasticity.varying_constants import Cells
from fastcontact.errors import ModelError, NameSuggestions, check_known
from fastcontact.heat.loads import Film, FixedTemperature, Heating
from fastcontact.linear.sparse_rows import stacked_rows
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.quality import check_cells
from fastcontact.model.contact_pair import ContactPair
from fastcontact.model.periodicity import PeriodicInterface
from fastcontact.model.pretension import Pretension
from fastcontact.model.ramp import Harmonic, PartHistory, Table, interpolation_tables, linear_ramp, multiplier
from fastcontact.round_off import LENGTH_ROUND_OFF

# Names of groups; None means all solid cells.
Groups = Sequence[str] | str | None


def displacement_name(kind: str, group: str) -> str:
    """Return the name of a displacement component of kind ``"x"``, ``"y"``, ``"z"`` or ``"normal"`` prescribed on a group.

    Result files identify prescribed displacements by this name, so its text must not change.
    """
    return f"the displacement {kind} prescribed on '{group}'"


@dataclass(frozen=True)
class Support:
    """A displacement component prescribed at all nodes of a group.

    Attributes
    ----------
    group : str
        Name of the group.
    component : int
        Number of the component, from 0.
    value : float, callable or tuple of (float, float or callable)
        Displacement at multiplier 1 [length]: a number, a function of position, or pairs of load factor and
        displacement, between which displacements are interpolated linearly.
    ramp : Table, optional
        History of `value`; None means the history of the analysis.
    rotation : Rotation, optional
        Rigid rotation of the group, whose displacement is added to `value`.
    rotation_ramp : Table, optional
        History of the angle of rotation; None means `ramp`.
    """

    group: str
    component: int
    value: Value | tuple[tuple[float, Value], ...]
    ramp: Table | None = None
    rotation: Rotation | None = None
    rotation_ramp: Table | None = None

    @property
    def name(self) -> str:
        """Name of the component and of the group, for messages."""
        return displacement_name("xyz"[self.component], self.group)

    def by_history(self, points: Array) -> dict[PartHistory, Array]:
        """Return the displacements (n,) [length] at the positions `points` (n, dim) at multiplier 1, by history."""
        if isinstance(self.value, tuple):
            instants, displacements = zip(*self.value, strict=True)
            tables = interpolation_tables(instants, self.name)
            return {t: evaluated(u, points, self.name) for t, u in zip(tables, displacements, strict=True)}
        values: dict[PartHistory, Array] = {self.ramp: evaluated(self.value, points, self.name)}
        if self.rotation is not None:
            arms, angle = points - np.array(self.rotation.centre), self.rotation.angle
            ramp = self.ramp if self.rotation_ramp is None else self.rotation_ramp
            for versine, generator in enumerate(self.rotation.generators):
                values[Harmonic(ramp, angle, bool(versine))] = arms @ generator[self.component]
        return values

    def last_value(self, point: Array) -> float:
        """Return the displacement [length] at the end of the history at a position (1, dim); `ramp` counts as 1."""
        parts = self.by_history(point).items()
        return sum(u.item() * (1.0 if h == self.ramp else multiplier(h, linear_ramp(1), np.inf)) for h, u in parts)


def group_names(groups: Groups) -> tuple[str, ...] | None:
    """Return the names of groups as a tuple, or None, which stands for all cells."""
    if groups is None:
        return None
    names = (groups,) if isinstance(groups, str) else tuple(groups)
    if not names:
        raise ModelError("the list of groups is empty: name a group, or leave the argument out for all cells")
    return names


@typed(ModelError)
class ModelBase(NameSuggestions):
    """A model with a mesh, kinematics and materials, and with lists of the items that its subclasses add."""

    def __init__(
        self,
        mesh: Mesh,
        kinematics: str,
        case_text: str = "",
        *,
        strain: str = "small",
        reference_temperature: float = 0.0,
        units: str | Mapping[str, str] = "",
    ) -> None:
        check_known("kinematics", kinematics, KINEMATICS, ModelError)
        check_known("strain", strain, STRAINS, ModelError)
        if kinematics != "3d" and mesh.dim == 3 and not mesh.solids:
            raise ModelError(
                f"kinematics '{kinematics}' needs a mesh in the x-y plane, and this one has a third coordinate: turn it, or "
                "keep two coordinates, those of the x-z plane by mesh.replace(points=mesh.points[:, [0, 2]])"
            )
        if (kinematics == "3d") != (mesh.dim == 3):
            possible = ", ".join(f"'{name}'" for name in KINEMATICS if (name == "3d") == (mesh.dim == 3))
            raise ModelError(f"kinematics '{kinematics}' cannot be used with a {mesh.dim}D mesh: use {possible}")
        if not mesh.solids:
            raise ModelError(f"the mesh has no solid cells, only {', '.join(mesh.cells) or 'points'}")
        ahead.request_helpers([f"{mesh.dim}d"])
        check_cells(mesh)
        if kinematics == "axisymmetric":
            radius = mesh.points[:, 0].min()
            if radius < -LENGTH_ROUND_OFF * np.abs(mesh.points).max():
                raise ModelError(
                    f"point {int(mesh.points[:, 0].argmin())} has the radius x = {radius:.6g} < 0: "
                    "an axisymmetric model lies at x >= 0, with y along the axis"
                )
        check_number("the reference_temperature", reference_temperature)
        self.mesh, self.kinematics, self.strain, self.case_text = mesh, kinematics, strain, case_text
        self.reference_temperature = reference_temperature
        self.units = named_units(units) if units else {}
        self.materials: list[tuple[Material, tuple[str, ...] | None]] = []
        self.supports: list[Support] = []
        self.loads: list[Load] = []
        self.temperatures: list[Temperature] = []
        self.heat_loads: list[FixedTemperature | Heating | Film] = []
        self.initial_states: list[InitialState] = []
        self.relations: list[MultiPointConstraint] = []
        self.related_supports: list[tuple[str, MultiPointConstraint]] = []  # (group, constraint)
        self.springs: list[Springs] = []
        self.pretensions: list[Pretension] = []
        self.nodes_on_facets: dict[str, Indices] = {}  # nodes on cyclic interfaces that are tied to facets
        self.periodic_interfaces: list[PeriodicInterface] = []  # coincident nodes of periodic parts
        self.contact: list[ContactPair] = []

    @property
    def n_dofs(self) -> int:
        """Number of displacement components of all points."""
        return self.mesh.n_points * self.mesh.dim

    def _solid_groups(self, groups: Groups, consequence: str) -> tuple[str, ...] | None:
        """Return the names of groups of solid cells, or None for all cells.

        Raises a ModelError whose message ends with `consequence` if a group contains no solid cell.
        """
        names = group_names(groups)
        check_solids(self.mesh, names, consequence)
        return names

    def _cells_of(self, groups: Sequence[str] | None) -> Cells:
        """Return the solid cells of `groups`, or all solid cells if it is None."""
        return Cells(self.mesh, solid_rows(self.mesh, groups))

    def _nodes(self, point_or_group: str | int) -> AnyArray:
        """Return the numbers (n,) of the points of a group, or the number of a point as an array (1,)."""
        if isinstance(point_or_group, str):
            return self.mesh.points_of(point_or_group)
        if (point := point_or_group) != int(point) or not 0 <= point < self.mesh.n_points:
            raise ModelError(f"point {point} is not in the mesh of {self.mesh.n_points} points, numbered from 0")
        return np.array([point])

    def _direction(
        self, name: str, stiffness: Mapping[str, float], has_two_nodes: bool, direction: Sequence[float] | None
    ) -> Array | None:
        """Return the unit vector (dim,) of the axial direction of a spring, or None if no `direction` is given.

        `stiffness` contains its axial and transverse stiffnesses. If the spring `has_two_nodes`, it acts along the line
        between them by default; otherwise it is fixed to the ground.
        """
        if direction is None:
            if stiffness and not has_two_nodes:
                raise ModelError(
                    f"{name} has an axial or transverse stiffness but no second node: specify it by `to`, give a "
                    "direction, or give stiffnesses along x, y or z instead"
                )
            return None
        if not stiffness:
            raise ModelError(f"{name} has a direction, but no axial or transverse stiffness that would use it")
        return unit_vector("direction", direction, name, self.mesh.dim, ModelError)

    def related_points(self) -> Mask:
        """Return the mask (n_points,) of the points on which a multi-point constraint or a spring acts."""
        related = np.zeros(self.mesh.n_points, bool)
        related[self.constraint_rows().indices // self.mesh.dim] = True
        return related

    def constraint_rows(self) -> csr_array:
        """Return the rows (m, n_dofs) [units of the items] of all multi-point constraints and springs.

        A rigid-body mode that neither constraints nor springs prevent is in the null space of these rows.
        """
        return stacked_rows([*self.relations, *self.springs], self.n_dofs)

    def add_material(self, material: Material, groups: Groups = None) -> None:
        """Assign a material to groups of solid cells.

        Parameters
        ----------
        material : Material or nonlinear law
            For example `LinearElastic`, `Orthotropic` or `NeoHookean`.
        groups : str or sequence of str, optional
            Groups of solid cells; by default all solid cells. A material assigned to groups replaces, in these groups, the
            material that was assigned to all cells before.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block_on_block(), kinematics="plane_strain")
        >>> model.add_material(fc.LinearElastic(E=210_000.0, nu=0.3))
        >>> model.add_material(fc.LinearElastic(E=70_000.0, nu=0.33), groups="UPPER")
        >>> print(model.describe().splitlines()[1])
        Material: E = 210000, nu = 0.3 in all solid cells.
        """
        names = self._solid_groups(groups, ", so it cannot have a material")
        check_law(material, self.strain)
        self.materials.append((material.bound(self._cells_of(names)), names))

    @property
    def cell_fields(self) -> tuple[str, ...]:
        """Names of the `StepResult.cell_fields` in steps of this model; empty for linear elasticity."""
        return field_names([material for material, _ in self.materials], self.strain)

    def uses_incompatible_modes(self) -> list[bool]:
        """Return for each material whether linear quadrangles and hexahedra of this material have incompatible modes."""
        possible = self.kinematics != "axisymmetric" and any(name in ELEMENTS_WITH_MODES for name in self.mesh.solids)
        return [possible and material.incompatible_modes for material, _ in self.materials]

    @property
    def nonlinear(self) -> bool:
        """Whether a material is nonlinear or strains are finite."""
        return self.strain != "small" or any(isinstance(law, NonlinearElastic) for law, _ in self.materials)

    def nonlinear_bodies(self, field: MaterialField) -> NonlinearBodies | None:
        """Return the solid cells as nonlinear bodies with the materials of `field`; None if the bodies are linear elastic."""
        return NonlinearBodies(self.mesh, self.kinematics, self.strain, field) if self.nonlinear else None

    def refuse_nonlinear(self, feature: str) -> None:
        """Raise ModelError if bodies are nonlinear. The message begins with `feature`, for example "sensitivities are"."""
        nonlinear = [type(law).__name__ for law, _ in self.materials if isinstance(law, NonlinearElastic)]
        if self.nonlinear:
            cause = nonlinear[0] if nonlinear else f"strain='{self.strain}'"
            raise ModelError(f"{feature} available for linear elasticity only, not with {cause}")

    def material_numbers(self) -> tuple[Array, dict[str, Numbers]]:
        """Return the matrices of moduli and, by element type, the index of the matrix of each solid cell.

        Moduli have the shape (n_moduli, 4, 4), in 3D (n_moduli, 6, 6) [pressure]. The first matrices are those of the
        materials, in the order of `materials`. Each cell of a material with varying constants has a further matrix, for
        the centre of the cell.
        """
        field = self.material_field()
        return field.moduli, field.rows

    def material_field(self) -> MaterialField:
        """Return the materials of all solid cells. Raises ModelError if a cell has no material or two different materials."""
        materials = [material for material, _ in self.materials]
        return material_field(self.mesh, self.kinematics, materials, self.material_of_cells())

    def material_of_cells(self) -> dict[str, Numbers]:
        """Return the index in `materials` of the material of each solid cell (n_cells,), by element type."""
        if not self.materials:
            raise ModelError("no material: call add_material(LinearElastic(E=..., nu=...)) for the solid cells")
        numbers = {name: np.full(len(block), -1, np.int32) for name, block in self.mesh.solids.items()}
        for index, (_, groups) in enumerate(self.materials):
            for group in groups or (None,):
                for name, rows in solid_rows(self.mesh, None if group is None else (group,)).items():
                    self._check_material(index, group, numbers[name][rows])
                    numbers[name][rows] = index
        self._check_all_have_material(numbers)
        return numbers

    def contact_moduli(self) -> dict[str, Array]:
        """Return the contact modulus of each solid cell (n_cells,), by element type [pressure]."""
        moduli = np.array([material.contact_modulus for material, _ in self.materials])
        return {name: moduli[rows] for name, rows in self.material_of_cells().items()}

    def contact_modulus_at(self, points: Numbers) -> float:
        """Return the mean contact modulus of the cells at `points` (m,) [pressure]."""
        solids, moduli = self.mesh.solids, self.contact_moduli()
        at_points = [values[np.isin(solids[name], points).any(axis=1)] for name, values in moduli.items()]
        return float(np.concatenate(at_points).mean())

    def _check_material(self, index: int, group: str | None, numbers: Numbers) -> None:
        """Raise ModelError if cells already have another material than number `index`, unless that was assigned to all cells.

        `numbers` contains the numbers of the present materials of the cells, -1 for none, and `group` names the cells.
        """
        new_material = self.materials[index][0]
        for number in np.unique(numbers[numbers >= 0]):
            old_material, groups = self.materials[number]
            if old_material != new_material and (groups is not None or group is None):
                raise ModelError(
                    f"{int((numbers == number).sum())} cells of {'the mesh' if group is None else repr(group)} have two "
                    f"materials, {old_material.described} and {new_material.described}: assign one to each group; "
                    "the material of all other cells must be assigned first, without groups"
                )

    def _check_all_have_material(self, numbers: dict[str, Numbers]) -> None:
        """Raise ModelError if a solid cell has no material, which is denoted by the number -1."""
        missing = {name: np.flatnonzero(values < 0) for name, values in numbers.items()}
        total = sum(map(len, missing.values()))
        if not total:
            return
        offsets = self.mesh.offsets
        cells = np.concatenate([rows + offsets[name] for name, rows in missing.items()])
        groups = [g for g, members in self.mesh.cell_groups.items() if np.isin(members, cells).any()]
        groups_text = f" in {', '.join(repr(g) for g in groups)}" if groups else ""
        raise ModelError(
            f"{total} solid cells{groups_text} have no material: assign one to their groups by add_material or [[material]]"
        )

    def internal_forces(self, displacement: Array) -> Array:
        """Return the internal nodal forces (n_points, dim) [force] of the solid cells at a displacement.

        In equilibrium they balance the forces of loads, contact, supports, multi-point constraints and springs, and the
        equivalent nodal forces of thermal strains and initial states (`thermal_forces_by_ramp`,
        `initial_forces_by_ramp`). In axisymmetry they are integrated over the full circle.

        Parameters
        ----------
        displacement : ndarray (n_points, dim)
            Nodal displacements, such as ``StepResult.displacement`` [length].

        Raises
        ------
        ModelError
            If the displacement has the wrong shape, or forces do not depend on the displacement alone.

        Examples
        --------
        A uniform strain of 0.001 in plane stress needs a force of 0.001 E on each end of a unit square.

        >>> import numpy as np
        >>> import fastcontact as fc
        >>> mesh = fc.generate.block()
        >>> model = fc.Model(mesh, kinematics="plane_stress")
        >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.0))
        >>> forces = model.internal_forces(np.column_stack([0.001 * mesh.points[:, 0], 0.0 * mesh.points[:, 1]]))
        >>> round(float(forces[mesh.points_of("RIGHT"), 0].sum()), 12)
        1.0
        """
        field, shape = self.material_field(), self.mesh.points.shape
        if np.size(displacement) != self.n_dofs:
            raise ModelError(f"the displacement has shape {np.shape(displacement)}, but the mesh requires {shape}")
        bodies = self.nonlinear_bodies(field)
        if bodies is not None:
            if bodies.yields:
                raise ModelError("forces of plastic bodies depend on their history, not on the displacement alone")
            if self.temperatures or self.heat_loads:
                raise ModelError("forces of bodies with thermal expansion depend on the temperature: see step.reaction")
            return bodies.at(np.reshape(displacement, shape), bodies.initial_history).force
        K = stiffness(self.mesh, self.kinematics, field.moduli, field.moduli_rows, None, field.treatment)
        return np.asarray(K @ np.ravel(displacement)).reshape(-1, self.mesh.dim)
