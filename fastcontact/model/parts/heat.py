"""Heat conduction in a model: prescribed temperatures, heat fluxes, films and heat sources, with their checks.

A `Value` is a number, or a function from reference positions (n, dim) [length] to numbers (n,) [unit of the quantity].
"""

from __future__ import annotations

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array, Indices, Mask, largest
from fastcontact.contact.conductance import Conductance
from fastcontact.elasticity.loads import Value, evaluated
from fastcontact.errors import ModelError
from fastcontact.heat.conduction import Conduction, undetermined_bodies
from fastcontact.heat.loads import Film, FixedTemperature, HeatFlux, Heating, HeatSource, NodalHeat
from fastcontact.mesh.topology import bodies
from fastcontact.model.parts.base import Groups, ModelBase, group_names
from fastcontact.model.periodicity import representatives
from fastcontact.model.ramp import History, Table, table_of
from fastcontact.model.rigid_motions import body_name
from fastcontact.round_off import ROUND_OFF

HEAT_FLUX = ("heat_flux_x", "heat_flux_y", "heat_flux_z")


@typed(ModelError)
class ModelHeat(ModelBase):
    """A model with optional heat conduction, which adds temperatures, heat fluxes and thermal strains to the results."""

    def fix_temperature(
        self, group: str, value: Value, *, ramp: History = None, begins: float | None = None, ends: float | None = None
    ) -> None:
        """Prescribe the temperature of all nodes of a group.

        Parameters
        ----------
        group : str
        value : float or callable
            A number, or a function from reference positions (n, dim) [length] to temperatures (n,) [temperature].
        ramp : Ramp or iterable of (float, float), optional
            History of the rise above `Model.reference_temperature`; by default that of the analysis.
        begins, ends : float, optional
            Load factors [-] between which the temperature is prescribed; both must be ends of load steps. By default it
            is prescribed in all steps. A temperature that is prescribed from a later step on changes linearly from the
            current values to the next point of its `ramp`.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain", reference_temperature=20.0)
        >>> model.fix_temperature("TOP", 120.0)
        """
        table = table_of(ramp, f"the ramp of the temperature on '{group}'")
        self._add_heat(FixedTemperature(group, value, table, *_interval(begins, ends)))

    def add_heat_flux(self, group: str, value: Value, *, ramp: History = None) -> None:
        """Apply a heat flux to a group of facets.

        Parameters
        ----------
        group : str
        value : float or callable
            Heat flux into the body per unit area at multiplier 1: a number, or a function from reference positions
            (n, dim) [length] to fluxes (n,) [power / area].
        ramp : Ramp or iterable of (float, float), optional
            History of the flux.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_heat_flux("TOP", 3.0)
        """
        self._add_heat(HeatFlux(group, value, table_of(ramp, f"the ramp of the heat flux on '{group}'")))

    def add_heat_source(self, value: Value, groups: Groups = None, *, ramp: History = None) -> None:
        """Apply a volumetric heat source to groups of solid cells.

        Parameters
        ----------
        value : float or callable
            Power per unit volume at multiplier 1: a number, or a function from reference positions (n, dim) [length] to
            numbers (n,) [power / length^3].
        groups : str or sequence of str, optional
            Groups of solid cells; by default all solid cells.
        ramp : Ramp or iterable of (float, float), optional
            History of the source.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_heat_source(0.1, "BLOCK")
        """
        self._add_heat(HeatSource(group_names(groups), value, table_of(ramp, "the ramp of the heat source")))

    def add_nodal_heat(self, group: str, value: Value, *, ramp: History = None) -> None:
        """Apply a concentrated heat source to every node of a group.

        Parameters
        ----------
        group : str
        value : float or callable
            Power of each node at multiplier 1: a number, or a function from reference positions (n, dim) [length] to
            numbers (n,). In axisymmetry it is integrated over the full circle [power].
        ramp : Ramp or iterable of (float, float), optional
            History of the source.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_nodal_heat("TOP_LEFT", 5.0)
        """
        self._add_heat(NodalHeat(group, value, table_of(ramp, f"the ramp of the heat at nodes of '{group}'")))

    def add_film(
        self, group: str, coefficient: Value, ambient: Value, *, ramp: History = None, begins: float | None = None,
        ends: float | None = None,
    ) -> None:  # fmt: skip
        """Apply convection to a group of facets: the outward flux is ``coefficient * (temperature - ambient)``.

        Parameters
        ----------
        group : str
        coefficient : float or callable
            Film coefficient, zero or positive [power / (area temperature)].
        ambient : float or callable
            Temperature of the surroundings [temperature].
        ramp : Ramp or iterable of (float, float), optional
            History of the rise of the ambient temperature above `Model.reference_temperature`.
        begins, ends : float, optional
            Load factors between which the film acts; both must be ends of load steps. By default it acts in all steps [-].

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_film("TOP", 1.5, 20.0)
        """
        table = table_of(ramp, f"the ramp of the film on '{group}'")
        self._add_heat(Film(group, coefficient, ambient, table, *_interval(begins, ends)))

    def _add_heat(self, load: FixedTemperature | Heating | Film) -> None:
        """Add a heat load after checking it."""
        load.check(self.mesh, self.kinematics)
        self.heat_loads.append(load)

    @property
    def conducts(self) -> bool:
        """Whether heat conduction is solved: the model has a heat load, a fixed temperature or a contact conductance."""
        return bool(self.heat_loads) or any("conductance" in pair.options for pair in self.contact)

    @property
    def cell_fields(self) -> tuple[str, ...]:
        """Names of the `StepResult.cell_fields` of this model, for nonlinear bodies and heat conduction."""
        return (*super().cell_fields, *(HEAT_FLUX[: self.mesh.dim] if self.conducts else ()))

    @property
    def point_fields(self) -> list[str]:
        """Names of those point data of result files that only some models have."""
        options = {option for pair in self.contact for option in pair.options}
        present = {
            **dict.fromkeys(("temperature", "heat_reaction"), self.conducts),
            "contact_wear": "wear" in options,
            "contact_damage": bool({"cohesion", "adhesion"} & options),
            "contact_fluid_pressure": any(pair.fluid is not None for pair in self.contact),
        }
        return [name for name, is_present in present.items() if is_present]

    @property
    def expands(self) -> bool:
        """Whether a material has a coefficient of thermal expansion."""
        return any(material.expansion is not None for material, _ in self.materials)

    def conduction(self) -> Conduction:
        """Return the heat conduction problem of the solid cells."""
        return Conduction(self.mesh, self.kinematics, [m for m, _ in self.materials], self.material_of_cells())

    def nodes_of_temperatures(self) -> Indices:
        """Return for each node (n_points,) the first of the nodes that share its temperature.

        Nodes share their temperature at the ends of a period or sector and on the two sides of a pretension section.
        """
        cuts = [(cut.nodes, cut.opposite) for cut in self.pretensions]
        representative = representatives([*self.periodic_interfaces, *cuts], self.mesh.n_points)  # type: ignore[list-item]
        return np.arange(self.mesh.n_points) if representative is None else representative

    def fixed_temperatures(self) -> tuple[Mask, dict[Table | None, Array]]:
        """Return the mask (n_points,) of nodes with a prescribed temperature, and their rises at multiplier 1, by history.

        Rises above the reference temperature have the shape (n_points,) [temperature]. Of nodes that share their
        temperature only the first is marked, see `nodes_of_temperatures`. Raises ModelError if two prescribed temperatures
        differ at a node.
        """
        fixed, values = np.zeros(self.mesh.n_points, bool), np.zeros(self.mesh.n_points)
        by_ramp: dict[Table | None, Array] = {}
        support_number = np.full(self.mesh.n_points, -1)
        supports = [load for load in self.heat_loads if isinstance(load, FixedTemperature)]
        shared_node = self.nodes_of_temperatures()
        for number, support in enumerate(supports):
            nodes = self.mesh.points_of(support.group)
            rise = evaluated(support.value, self.mesh.points[nodes], support.name) - self.reference_temperature
            nodes = shared_node[nodes]
            repeated = np.flatnonzero(fixed[nodes])
            round_off = ROUND_OFF * max(largest(values), largest(rise))
            for row in repeated[np.abs(values[nodes[repeated]] - rise[repeated]) > round_off][:1]:
                earlier_support = supports[support_number[nodes[row]]]
                groups = f"'{support.group}' and '{earlier_support.group}'"
                raise ModelError(f"{groups} prescribe different temperatures at point {nodes[row]}")
            new_nodes, (ramp, initial_ramp) = nodes[~fixed[nodes]], support.history()
            by_ramp.setdefault(ramp, np.zeros(self.mesh.n_points))[new_nodes] = rise[~fixed[nodes]]
            if support.reached is not None and initial_ramp:
                by_ramp.setdefault(initial_ramp, np.zeros(self.mesh.n_points))[new_nodes] = support.reached[new_nodes]
            fixed[nodes], values[nodes], support_number[new_nodes] = True, rise, number
        return fixed, by_ramp

    def check_heat(self) -> None:
        """Raise ModelError if data of the heat conduction problem are missing or its solution is not unique."""
        for pair in self.contact:
            if "friction_heat" in pair.options and not self.conducts:
                raise ModelError(f"contact '{pair.name}' has friction_heat, but no heat conduction: fix a temperature")
        if not self.conducts:
            return
        if self.temperatures:
            raise ModelError("temperatures are both given by add_temperature and computed: use fix_temperature")
        if self.nodes_on_facets:
            raise ModelError(
                f"{next(iter(self.nodes_on_facets))} connects different meshes and conducts no heat: use matching meshes"
            )
        self.conduction().check()
        without_expansion = [material for material, _ in self.materials if material.expansion is None]
        if self.expands and without_expansion:
            raise ModelError(
                "some materials have a coefficient of thermal expansion, but that with "
                f"{without_expansion[0].described} has none: give it expansion=..., 0.0 if it does not expand"
            )
        determined, _ = self.fixed_temperatures()
        for load in self.heat_loads:
            if isinstance(load, Film):
                determined[self.mesh.points_of(load.group)] = True
        _, body = bodies(self.mesh)
        links = [np.stack([np.arange(len(body)), self.nodes_of_temperatures()], axis=1)]
        for pair in self.contact:
            if pair.options.get("obstacle_temperature") is not None:
                determined[self.mesh.points_of(pair.secondary)] = True
            elif pair.options.get("conductance") is not None:
                ends = np.concatenate([self.mesh.points_of(pair.secondary), self.mesh.points_of(pair.primary)])
                links.append(np.stack([np.full(len(ends), ends[0]), ends], axis=1))
        undetermined = undetermined_bodies(body, determined, np.concatenate(links))
        if len(undetermined):
            raise ModelError(
                f"nothing determines the temperature of body {body_name(self.mesh, body, undetermined[0])}: fix a "
                "temperature, add a film, or specify the conductance of a contact with another body"
            )

    def conductances(self) -> dict[str, Conductance]:
        """Return the thermal conductances of the contact pairs, by name of the pair."""
        values = {pair.name: pair.options.get("conductance") for pair in self.contact}
        return {name: Conductance(name, value) for name, value in values.items() if value is not None}


def _interval(begins: float | None, ends: float | None) -> tuple[float, float]:
    """Return the load factors between which a load acts, by default minus and plus infinity."""
    return -np.inf if begins is None else float(begins), np.inf if ends is None else float(ends)
