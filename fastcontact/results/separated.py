"""The mesh of a step cut along material interfaces, so that nodal stress has one value at every point."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import AnyArray, Array, Numbers
from fastcontact.elasticity.material_sides import material_sides
from fastcontact.mesh.mesh import Mesh
from fastcontact.results.step import StepResult


def separated(mesh: Mesh, step: StepResult) -> tuple[Mesh, Numbers, Array]:
    """Return the mesh cut along material interfaces, the node (m,) of each of its points, and the stress (m, ...) there.

    The points of `mesh` come first. Stress [pressure] has the components of `StepResult.stress`. The mesh has only solid
    cells and no groups; without interfaces it is `mesh` itself.
    """
    material_stress = step.material_stress
    if material_stress is None:
        return mesh, np.arange(mesh.n_points, dtype=np.int32), step.stress
    sides = material_sides(mesh, cells_by_element(mesh, material_stress.cells))
    stress = step.stress[sides.node]
    stress[sides.place] = material_stress.stress
    return Mesh(mesh.points[sides.node], sides.cells), sides.node, stress


def cells_by_element(mesh: Mesh, values: AnyArray) -> dict[str, AnyArray]:
    """Return values of all solid cells (n_solids,) by element type."""
    ends = np.cumsum([len(block) for block in mesh.solids.values()])[:-1]
    return dict(zip(mesh.solids, np.split(values, ends), strict=True))


def mean_in_cells(mesh: Mesh, step: StepResult) -> Array:
    """Return the mean (n_solids, n_components) of each solid cell's nodal stress on its own side [pressure]."""
    separate_mesh, _, stress = separated(mesh, step)
    return np.concatenate([stress[block].mean(axis=1) for block in separate_mesh.solids.values()])
