"""The mesh of a step cut along material interfaces, where nodal stress has a single value at each point."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import AnyArray, Array, Numbers
from fastcontact.elasticity.material_sides import material_sides
from fastcontact.mesh.mesh import Mesh
from fastcontact.results.step import StepResult


def separated(mesh: Mesh, step: StepResult) -> tuple[Mesh, Numbers, Array]:
    """Return the mesh cut along material interfaces, the node (m,) of each of its points, and the stress (m, ...) [pressure].

    The points of `mesh` are the first points of the new mesh, which has only solid cells and no groups. Stress has the
    components of `StepResult.stress`. Without interfaces `mesh` is returned.
    """
    material_stress = step.material_stress
    if material_stress is None:
        return mesh, np.arange(mesh.n_points, dtype=np.int32), step.stress
    sides = material_sides(mesh, cells_by_element(mesh, material_stress.cells))
    stress = step.stress[sides.node]
    stress[sides.place] = material_stress.stress
    return Mesh(mesh.points[sides.node], sides.cells), sides.node, stress


def cells_by_element(mesh: Mesh, values: AnyArray) -> dict[str, AnyArray]:
    """Return the values (n_solids,) of solid cells by element type."""
    ends = np.cumsum([len(block) for block in mesh.solids.values()])[:-1]
    return dict(zip(mesh.solids, np.split(values, ends), strict=True))


def mean_in_cells(mesh: Mesh, step: StepResult) -> Array:
    """Return the mean (n_solids, n_components) [pressure] over the nodes of each cell of the stress of its material."""
    separate_mesh, _, stress = separated(mesh, step)
    return np.concatenate([stress[block].mean(axis=1) for block in separate_mesh.solids.values()])
