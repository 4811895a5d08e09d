"""Temperatures, initial stresses and initial strains of a model.

A `Value` is a number, or a function from reference positions (n, dim) [length] to numbers (n,) [unit of the quantity].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact._tools.paths import PathLike
from fastcontact.arrays import Array
from fastcontact.elasticity.initial_states import StressOffset, initial_state
from fastcontact.elasticity.loads import Value, solid_points
from fastcontact.elasticity.material_axes import Axes
from fastcontact.elasticity.material_field import MaterialField
from fastcontact.elasticity.materials import Constant
from fastcontact.elasticity.recovery import internal_force, stress_at_points
from fastcontact.elasticity.temperature import Temperature, temperature_history
from fastcontact.errors import ModelError
from fastcontact.model.parts.base import Groups, group_names
from fastcontact.model.parts.loads import ModelLoads
from fastcontact.model.ramp import History, Table, sums_by_ramp, table_of


@typed(ModelError)
class ModelInitialStates(ModelLoads):
    """A model with temperatures, initial stresses and initial strains."""

    def add_temperature(
        self,
        value: Value | Array,
        groups: Groups = None,
        *,
        reference: float | None = None,
        times: Sequence[float] | None = None,
        ramp: History = None,
    ) -> None:
        """Prescribe the temperature of groups of solid cells, whose materials need a coefficient of thermal expansion.

        Temperatures are nodal: a cell adjacent to a group has a temperature gradient where it shares nodes with the group.
        If several temperatures act on a node, their rises above the reference temperatures are added.

        Parameters
        ----------
        value : float, callable or ndarray (n_points,) or (n_instants, n_points)
            A number, a function from reference positions (n, dim) [length] to temperatures (n,), nodal values, or nodal
            values at several instants [temperature].
        groups : str or sequence of str, optional
            Groups of solid cells; by default all solid cells.
        reference : float, optional
            Temperature at which the thermal strain is zero [temperature]; by default `reference_temperature` of the model.
        times : sequence of float (n_instants,), optional
            Load factors of the instants, between which temperatures are interpolated linearly [-]; required for values at
            several instants.
        ramp : Ramp or iterable of (float, float), optional
            History of the rise ``value - reference``; by default that of the analysis.

        Raises
        ------
        MeshError, ModelError
            If a group does not exist, the number of values is wrong, or `times` and `ramp` are both given.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_material(fc.LinearElastic(E=210_000.0, nu=0.3, expansion=12e-6))
        >>> model.add_temperature(120.0, reference=20.0)
        >>> model.add_temperature(lambda points: 10.0 * points[:, 1], "BLOCK")
        """
        names = group_names(groups)
        if isinstance(value, (list, tuple, np.ndarray)) and np.ndim(value) > 0:
            value = np.array(value, float)
        reference = self.reference_temperature if reference is None else reference
        if times is not None:
            if ramp is not None:
                raise ModelError("give either times or ramp for a temperature, not both")
            if not isinstance(value, np.ndarray) or value.ndim != 2:
                raise ModelError("a temperature with times must be an array (n_instants, n_points)")
            temperatures = temperature_history(names, value, reference, times)
        else:
            temperatures = [Temperature(names, value, reference, table_of(ramp, "the ramp of the temperature"))]
        for temperature in temperatures:
            temperature.check(self.mesh)
        self.temperatures += temperatures

    def add_temperature_file(
        self,
        file: PathLike | Sequence[PathLike],
        field: str,
        groups: Groups = None,
        *,
        reference: float | None = None,
        instant: float | None = None,
        times: Sequence[float] | None = None,
        ramp: History = None,
    ) -> None:
        """Prescribe the temperature of groups of solid cells by a nodal field that is read from one or several files.

        The file formats are MED, VTKHDF (the format of result files) and the formats of meshio, such as .vtu. If a file
        contains the points of the mesh in the same order, its values are used directly; otherwise points are matched by
        position.

        Parameters
        ----------
        file : path-like or sequence of path-like
            One file with one or several instants, or one file for each instant.
        field : str
            Name of the nodal field.
        groups : str or sequence of str, optional
            Groups of solid cells; by default all solid cells.
        reference : float, optional
            Temperature at which the thermal strain is zero [temperature]; by default `reference_temperature` of the model.
        instant : float, optional
            Use only this time of the file.
        times : sequence of float (n_instants,), optional
            Load factors of the instants, between which temperatures are interpolated linearly [-]; by default the times of
            the file.
        ramp : Ramp or iterable of (float, float), optional
            History of the rise above `reference`, if the field has a single instant.

        Raises
        ------
        FileError, MeshError, ModelError
            If a file cannot be read or lacks the field, a point has no temperature, or instants and times conflict.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_temperature_file("furnace.med", "TEMP", reference=20.0)  # doctest: +SKIP
        """
        from fastcontact.mesh.files.mesh_fields import read_temperatures

        names = self._solid_groups(groups, ": it has no temperature")
        reference = self.reference_temperature if reference is None else reference
        values, times_of_file = read_temperatures(self.mesh, file, field, solid_points(self.mesh, names), instant)
        values = np.where(np.isfinite(values), values, reference)
        if len(values) == 1:
            if times is not None:
                raise ModelError(f"field '{field}' has a single instant: give ramp instead of times")
            self.add_temperature(values[0], names, reference=reference, ramp=ramp)
            return
        if ramp is not None:
            raise ModelError(f"field '{field}' has {len(values)} instants and takes no ramp: give times or one instant")
        times_used = times if times_of_file is None or times is not None else times_of_file.tolist()
        if times_used is None:
            raise ModelError(f"field '{field}' has {len(values)} instants without times: give the load factor of each")
        self.add_temperature(values, names, reference=reference, times=times_used)

    def add_initial_stress(
        self, groups: Groups = None, *, axes: Axes = None, ramp: History = None, **tensor_components: Constant | None
    ) -> None:
        """Prescribe an initial stress in groups of solid cells.

        An initial stress that is not in equilibrium deforms the bodies. In axisymmetry x, y and z denote the radial, axial
        and circumferential directions.

        Parameters
        ----------
        groups : str or sequence of str, optional
            Groups of solid cells; by default all solid cells.
        axes : sequence or callable, optional
            Axes of the components: unit vectors in rows (3, 3) [-], or a function of position, as described for
            `Orthotropic`; by default the axes of the mesh.
        ramp : Ramp or iterable of (float, float), optional
            History of the stress; by default the full stress acts from the first step on.
        **tensor_components : float, callable or ndarray (n,)
            Components ``xx``, ``yy``, ``zz``, ``xy``, ``yz`` and ``xz`` of the stress at multiplier 1, by default zero:
            numbers, functions of position or arrays, as described for the parameter E of `LinearElastic` [pressure].

        Raises
        ------
        MeshError, ModelError
            If a group does not exist or contains no solid cells, or a component is invalid.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_initial_stress(xx=lambda points: 100.0 * (1.0 - 2.0 * points[:, 1]))
        """
        self._add_initial("stress", groups, tensor_components, axes, ramp)

    def add_initial_strain(
        self, groups: Groups = None, *, axes: Axes = None, ramp: History = None, **tensor_components: Constant | None
    ) -> None:
        """Prescribe a stress-free strain, for example shrinkage, swelling or misfit, in groups of solid cells.

        Parameters
        ----------
        groups : str or sequence of str, optional
            Groups of solid cells; by default all solid cells.
        axes : sequence or callable, optional
            Axes of the components: unit vectors in rows (3, 3) [-], or a function of position, as described for
            `Orthotropic`; by default the axes of the mesh.
        ramp : Ramp or iterable of (float, float), optional
            History of the strain; by default the full strain acts from the first step on.
        **tensor_components : float, callable or ndarray (n,)
            Components ``xx``, ``yy``, ``zz``, ``xy``, ``yz`` and ``xz`` of the strain at multiplier 1, by default zero:
            numbers, functions of position or arrays, as described for the parameter E of `LinearElastic`. The components xy,
            yz and xz are engineering shear strains, which are twice the components of the strain tensor [-].

        Raises
        ------
        MeshError, ModelError
            If a group does not exist or contains no solid cells, or a component is invalid.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_initial_strain("BLOCK", xx=-0.002, yy=-0.002, zz=-0.002)  # shrinkage
        """
        self._add_initial("strain", groups, tensor_components, axes, ramp)

    def _add_initial(self, kind: str, groups: Groups, components: Mapping[str, Any], axes: Axes, ramp: History) -> None:
        """Add an initial stress or strain, as `kind` states."""
        names = self._solid_groups(groups, f": it has no initial {kind}")
        table = table_of(ramp, f"the ramp of the initial {kind}")
        cells = self._cells_of(names)
        self.initial_states.append(initial_state(kind, names, cells, components, axes, self.kinematics, table))

    def temperature_rise(self, factors: Sequence[float]) -> Array | None:
        """Return the sum of the temperature rises (n_points,) [temperature], or None if there are none.

        `factors` contains the multiplier of each temperature. In a step result, the multipliers are
        ``step.iterations["temperature_factors"]``.
        """
        if not self.temperatures or not len(factors):
            return None
        rises = [factor * load.rise(self.mesh) for factor, load in zip(factors, self.temperatures, strict=True)]
        return np.asarray(np.sum(rises, axis=0))

    def expanding_rise(self, temperature_factors: Sequence[float], temperature: Array | None) -> Array | None:
        """Return the temperature rise (n_points,) [temperature] that causes thermal strain, or None if there is none.

        `temperature` (n_points,) [temperature] and `temperature_factors` are described for `stress_offset`.
        """
        if temperature is not None and self.expands:
            return np.asarray(temperature - self.reference_temperature)
        return self.temperature_rise(temperature_factors)

    def stress_offset(
        self, temperature_factors: Sequence[float] = (), initial_factors: Sequence[float] = (),
        field: MaterialField | None = None, temperature: Array | None = None,
    ) -> StressOffset | None:  # fmt: skip
        """Return the stresses due to thermal strains and initial states, which are added to those due to displacements.

        Return None if there are no such stresses. `temperature_factors` and `initial_factors` are the multipliers of the
        temperatures and of the initial states, which `StepResult.iterations` contains under these names. With heat
        conduction, `temperature` (n_points,) [temperature] is the nodal temperature of the step. `field` is the
        result of `material_field`, if it has been computed already.
        """
        rise, states = self.expanding_rise(temperature_factors, temperature), []
        if len(initial_factors):
            states = list(zip(initial_factors, self.initial_states, strict=True))
        if rise is None and not states:
            return None
        return (field or self.material_field()).offset(rise, states, self.mesh.n_points)

    def thermal_forces_by_ramp(self) -> dict[Table | None, Array]:
        """Return the nodal forces (n_points, dim) [force] due to thermal strains at multiplier 1, by ramp.

        Raises ModelError if a cell with a temperature rise has a material without a coefficient of thermal expansion.
        """
        if not self.temperatures:
            return {}
        field, forces = self.material_field(), []
        for temperature in self.temperatures:
            rise = temperature.rise(self.mesh)
            missing = field.n_heated_cells_without_expansion(self.mesh, rise)
            if missing:
                raise ModelError(
                    f"{temperature.name} acts on {missing} solid cells whose material has no coefficient of thermal "
                    "expansion: give it expansion=..., 0.0 if it does not expand"
                )
            forces.append((temperature.ramp, self.expansion_forces(field, rise)))
        return sums_by_ramp(forces)

    def expansion_forces(self, field: MaterialField, rise: Array) -> Array:
        """Return the nodal forces (n_points, dim) [force] of the thermal strains of a temperature rise.

        `rise` (n_points,) [temperature] is the temperature minus the reference temperature.
        """
        return self._forces_of(field, field.offset(rise))

    def initial_forces_by_ramp(self) -> dict[Table | None, Array]:
        """Return the nodal forces (n_points, dim) [force] due to initial stresses and strains at multiplier 1, by ramp."""
        if not self.initial_states:
            return {}
        field, n = self.material_field(), self.mesh.n_points
        offsets = ((state.ramp, field.offset(None, [(1.0, state)], n)) for state in self.initial_states)
        return sums_by_ramp((ramp, self._forces_of(field, offset)) for ramp, offset in offsets)

    def _forces_of(self, field: MaterialField, offset: StressOffset | None) -> Array:
        """Return the nodal forces (n_points, dim) [force] equivalent to a stress offset: minus its internal forces."""
        u, treatment = np.zeros(self.mesh.points.shape), field.treatment
        stress = stress_at_points(self.mesh, self.kinematics, field.moduli, field.moduli_rows, u, treatment, offset)
        return -internal_force(self.mesh, self.kinematics, stress)
