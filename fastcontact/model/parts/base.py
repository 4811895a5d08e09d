"""Base of all parts of a model: mesh, kinematics, and lists of added items."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, vstack

from fastcontact._jit import ahead
from fastcontact._tools.argument_types import finite_vector, typed
from fastcontact.arrays import AnyArray, Array, Mask
from fastcontact.contact.obstacles.rigid_side import Rotation
from fastcontact.elasticity.initial_states import InitialState
from fastcontact.elasticity.loads import Load, Value, check_number, check_solids, evaluated, solid_rows
from fastcontact.elasticity.materials import KINEMATICS, Material
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint, stacked_rows
from fastcontact.elasticity.nonlinear_materials import STRAINS
from fastcontact.elasticity.springs import Springs, stacked
from fastcontact.elasticity.temperature import Temperature
from fastcontact.elasticity.varying_constants import Cells
from fastcontact.errors import ModelError, check_known
from fastcontact.heat.loads import Film, FixedTemperature, Heating
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.quality import check_cells
from fastcontact.model.contact_pair import ContactPair
from fastcontact.model.periodicity import PeriodicInterface
from fastcontact.model.pretension import Pretension
from fastcontact.model.ramp import Harmonic, PartHistory, Table
from fastcontact.model.units import named_units
from fastcontact.round_off import LENGTH_ROUND_OFF


def displacement_name(kind: str, group: str) -> str:
    """Return the name of a prescribed displacement, ``"x"``, ``"y"``, ``"z"`` or ``"normal"``; result files depend on it."""
    return f"the displacement {kind} prescribed on '{group}'"


@dataclass(frozen=True)
class Support:
    """A prescribed displacement component of all nodes of a group: `value` [length] times the ramp.

    `value` is a number or a function of position, `ramp` its history or None. A `rotation` about an axis is added, with the
    history of its angle.
    """

    group: str
    component: int
    value: Value
    ramp: Table | None = None
    rotation: Rotation | None = None
    rotation_ramp: Table | None = None

    @property
    def name(self) -> str:
        """Component and group, for messages."""
        return displacement_name("xyz"[self.component], self.group)

    def by_history(self, points: Array) -> dict[PartHistory, Array]:
        """Return the displacements (n,) of `points` (n, dim) at multiplier 1, by history [length]."""
        values: dict[PartHistory, Array] = {self.ramp: evaluated(self.value, points, self.name)}
        if self.rotation is not None:
            arms, angle = points - np.array(self.rotation.centre), self.rotation.angle
            ramp = self.ramp if self.rotation_ramp is None else self.rotation_ramp
            for versine, generator in enumerate(self.rotation.generators):
                values[Harmonic(ramp, angle, bool(versine))] = arms @ generator[self.component]
        return values


def group_names(groups: Sequence[str] | str | None) -> tuple[str, ...] | None:
    """Return names of groups, given as one or several, as a tuple; None for all."""
    if groups is None:
        return None
    names = (groups,) if isinstance(groups, str) else tuple(groups)
    if not names:
        raise ModelError("the list of groups is empty: name a group, or leave the argument out for all cells")
    return names


@typed(ModelError)
class ModelBase:
    """Mesh, kinematics, and lists of the added items."""

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
        if (kinematics == "3d") != (mesh.dim == 3):
            fitting = ", ".join(f"'{name}'" for name in KINEMATICS if (name == "3d") == (mesh.dim == 3))
            raise ModelError(f"kinematics '{kinematics}' do not fit a mesh in {mesh.dim} dimensions: use {fitting}")
        if not mesh.solids:
            raise ModelError(f"the mesh has no solid cells, only {', '.join(mesh.cells) or 'points'}")
        ahead.expect([f"{mesh.dim}d"])
        check_cells(mesh)
        if kinematics == "axisymmetric":
            radius = mesh.points[:, 0].min()
            if radius < -LENGTH_ROUND_OFF * np.abs(mesh.points).max():
                raise ModelError(
                    f"point {int(mesh.points[:, 0].argmin())} has the radius x = {radius:.6g} < 0: "
                    "an axisymmetric model lies at x >= 0, with y along the axis"
                )
        check_number("the reference_temperature", reference_temperature)
        self.mesh = mesh
        self.kinematics = kinematics
        self.strain = strain
        self.reference_temperature = reference_temperature
        self.case_text = case_text
        self.units = named_units(units) if units else {}
        self.materials: list[tuple[Material, tuple[str, ...] | None]] = []
        self.supports: list[Support] = []
        self.loads: list[Load] = []
        self.temperatures: list[Temperature] = []
        self.heat_loads: list[FixedTemperature | Heating | Film] = []
        self.initial_states: list[InitialState] = []
        self.relations: list[MultiPointConstraint] = []
        self.related_supports: list[tuple[str, MultiPointConstraint]] = []  # supports by group, as constraints
        self.springs: list[Springs] = []
        self.pretensions: list[Pretension] = []
        self.interpolated: list[str] = []  # cyclic symmetries whose nodes follow facets
        self.periodic_interfaces: list[PeriodicInterface] = []  # coincident nodes of periodic parts
        self.contact: list[ContactPair] = []

    @property
    def n_dofs(self) -> int:
        """Number of displacement components of all points."""
        return self.mesh.n_points * self.mesh.dim

    def _solid_groups(self, groups: Sequence[str] | str | None, otherwise: str) -> tuple[str, ...] | None:
        """Return groups of solid cells by name, None for all; ModelError that ends with `otherwise` if one is empty."""
        names = group_names(groups)
        check_solids(self.mesh, names, otherwise)
        return names

    def _cells_of(self, groups: Sequence[str] | None) -> Cells:
        """Return the solid cells of groups, or all."""
        return Cells(self.mesh, solid_rows(self.mesh, groups))

    def _nodes(self, point: str | int) -> AnyArray:
        if isinstance(point, str):
            return self.mesh.points_of(point)
        if point != int(point) or not 0 <= point < self.mesh.n_points:
            raise ModelError(f"point {point} is not in the mesh of {self.mesh.n_points} points (numbers from 0)")
        return np.array([point])

    def _direction(
        self, name: str, along: Mapping[str, float], joined: bool, direction: Sequence[float] | None
    ) -> Array | None:
        """Return the unit vector (dim,) along which a spring is axial; None for the line between its nodes, or for none."""
        if direction is None:
            if along and not joined:
                raise ModelError(
                    f"{name} has an axial or transverse stiffness but no second node: name it by `to`, give a direction, "
                    "or x, y or z"
                )
            return None
        if not along:
            raise ModelError(f"{name} has a direction, but no axial or transverse stiffness that would use it")
        vector = finite_vector(direction, self.mesh.dim)
        if vector is None or not vector.any():
            raise ModelError(
                f"the direction {direction} of {name} must be a vector of {self.mesh.dim} numbers, not all zero"
            )
        return np.asarray(vector / np.linalg.norm(vector))

    def _related(self) -> Mask:
        """Return which points (n_points,) have constraints or springs."""
        related = np.zeros(self.mesh.n_points, bool)
        related[self.holding_rows().indices // self.mesh.dim] = True
        return related

    def holding_rows(self) -> csr_array:
        """Return rows (m, n_dofs) [unit of the caller] of constraints and springs, zero on free rigid-body modes."""
        relations = stacked_rows(self.relations, self.n_dofs)
        return csr_array(vstack([relations, stacked(self.springs, self.n_dofs)], format="csr"))
