"""The materials of a model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array, Mask, Numbers
from fastcontact.elasticity.material_field import MaterialField, material_field
from fastcontact.elasticity.materials import Material
from fastcontact.elasticity.nonlinear_bodies import NonlinearBodies, check_law, field_names, nonlinear_bodies
from fastcontact.elasticity.nonlinear_materials import NonlinearElastic
from fastcontact.elasticity.stiffness import stiffness
from fastcontact.errors import ModelError
from fastcontact.model.parts.base import ModelBase


@typed(ModelError)
class ModelMaterials(ModelBase):
    """A model with materials."""

    def add_material(self, material: Material, groups: Sequence[str] | str | None = None) -> None:
        """Assign a material to groups of solid cells.

        Parameters
        ----------
        material : LinearElastic, Orthotropic, ...
        groups : str or sequence of str, optional
            By default all solid cells; the material of a group overrides that of all cells.

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
        """Names of the `StepResult.cell_fields` in steps of this model: none for linear elasticity."""
        return field_names([material for material, _ in self.materials], self.strain)

    @property
    def nonlinear(self) -> bool:
        """Whether bodies have nonlinear laws or finite strains."""
        return self.strain != "small" or any(isinstance(law, NonlinearElastic) for law, _ in self.materials)

    def nonlinear_bodies(self, field: MaterialField) -> NonlinearBodies | None:
        """Return the solid cells as nonlinear bodies; None if they are linear."""
        return nonlinear_bodies(self.mesh, self.kinematics, self.strain, field)

    def refuse_nonlinear(self, feature: str) -> None:
        """Raise ModelError if bodies are nonlinear, since `feature` is limited to linear elasticity."""
        nonlinear = [type(law).__name__ for law, _ in self.materials if isinstance(law, NonlinearElastic)]
        if self.nonlinear:
            named = nonlinear[0] if nonlinear else f"strain='{self.strain}'"
            raise ModelError(f"{feature} available for linear elasticity only, not with {named}")

    def material_numbers(self) -> tuple[Array, dict[str, Numbers]]:
        """Return moduli (n_moduli, 4, 4), in 3D (n_moduli, 6, 6) [pressure], and by element type the row of each solid cell.

        The first rows are those of the materials; materials that vary have further rows for the centre of each cell.
        """
        field = self.material_field()
        return field.moduli, field.rows

    def material_field(self) -> MaterialField:
        """Return the materials of all solid cells; ModelError if a cell has none or two."""
        return material_field(
            self.mesh, self.kinematics, [material for material, _ in self.materials], self.material_of_cells()
        )

    def material_of_cells(self) -> dict[str, Numbers]:
        """Return the material of every solid cell (n_cells,), by element type."""
        if not self.materials:
            raise ModelError("no material: call add_material(LinearElastic(E=..., nu=...)) for the solid cells")
        numbers = {name: np.full(len(block), -1, np.int32) for name, block in self.mesh.solids.items()}
        for index, (_, groups) in enumerate(self.materials):
            for name in numbers if groups is None else ():
                self._check_material(index, None, numbers[name])
                numbers[name][:] = index
            for group in groups or ():
                for name, rows in self.mesh.split(self.mesh.cell_groups[group]).items():
                    if name in numbers:
                        self._check_material(index, group, numbers[name][rows])
                        numbers[name][rows] = index
        self._check_all_have_material(numbers)
        return numbers

    def averaged_materials(self) -> Mask:
        """Return which moduli (n_moduli,) have a mean dilatation; none in plane stress, which does not lock."""
        return self.material_field().averaged

    def _check_material(self, index: int, group: str | None, numbers: Numbers) -> None:
        """Refuse a material for cells that already have another one, unless that was assigned to all cells."""
        new = self.materials[index][0]
        for number in np.unique(numbers[numbers >= 0]):
            old, groups = self.materials[number]
            if old != new and (groups is not None or group is None):
                raise ModelError(
                    f"{int((numbers == number).sum())} cells of {'the mesh' if group is None else repr(group)} have two "
                    f"materials, {old.described} and {new.described}: give each group one; "
                    "one for all other cells comes first, without groups"
                )

    def _check_all_have_material(self, numbers: dict[str, Numbers]) -> None:
        without = {name: np.flatnonzero(values < 0) for name, values in numbers.items()}
        total = sum(map(len, without.values()))
        if not total:
            return
        offsets = self.mesh.offsets
        cells = np.concatenate([rows + offsets[name] for name, rows in without.items()])
        groups = [g for g, members in self.mesh.cell_groups.items() if np.isin(members, cells).any()]
        named = f", in {', '.join(repr(g) for g in groups)}" if groups else ""
        raise ModelError(f"{total} solid cells have no material{named}: add_material for their groups")

    def internal_forces(self, displacement: Array) -> Array:
        """Return the internal nodal forces (n_points, dim) [force] of the solid cells at a displacement.

        They balance the forces of loads, contact, supports, multi-point constraints, springs, thermal strains and initial
        states (`thermal_forces_by_ramp`, `initial_forces_by_ramp`). In axisymmetry they are those over the full circle.

        Parameters
        ----------
        displacement : ndarray (n_points, dim)
            Displacements of a step result [length].

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
        field = self.material_field()
        if np.size(displacement) != self.n_dofs:
            raise ModelError(
                f"the displacement has the shape {np.shape(displacement)}, but the mesh {self.mesh.points.shape}"
            )
        bodies = self.nonlinear_bodies(field)
        if bodies is not None:
            if self.strain == "small":
                raise ModelError("forces of plastic bodies depend on their history, not on the displacement alone")
            if self.temperatures or self.heat_loads:
                raise ModelError(
                    "forces of bodies that heat expands depend on their temperature, too: see step.reaction"
                )
            return bodies.at(np.reshape(displacement, self.mesh.points.shape), bodies.beginning).force
        K = stiffness(self.mesh, self.kinematics, field.moduli, field.loops, None, field.treatment)
        return np.asarray(K @ np.ravel(displacement)).reshape(-1, self.mesh.dim)
