"""Writing of the results of all load steps as fields of a MED file, for Salome and code_aster."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact._tools.paths import PathLike
from fastcontact.arrays import Array
from fastcontact.errors import FileError, MeshError
from fastcontact.mesh.files.med import AXES, add_field, add_mesh, new_file
from fastcontact.mesh.mesh import Mesh
from fastcontact.results.layout import contact_fields, step_shapes
from fastcontact.results.step import StepResult

# Index of each MED component in the order xx, yy, zz, xy, yz, xz of this package; in MED files xz precedes yz.
STRESSES = {"SIXX": 0, "SIYY": 1, "SIZZ": 2, "SIXY": 3, "SIXZ": 5, "SIYZ": 4}
# For each contact field, the name of the MED field and of its component.
CONTACT = {
    "contact_pressure": ("PRES_CONT", "PRES"),
    "contact_wear": ("USUR_CONT", "USUR"),
    "contact_damage": ("ENDO_CONT", "ENDO"),
    "contact_fluid_pressure": ("PRES_FLUI", "PRES"),
}


@typed(FileError)
def write_med_results(path: PathLike, mesh: Mesh, steps: Iterable[StepResult], *, mesh_name: str = "mesh") -> None:
    """Write a mesh and the nodal results of all steps to a MED file, for Salome and ParaVis.

    The file contains the following fields. Their instants are the load factors, and their order numbers are the indices
    of the steps:

    - DEPL (DX, DY [, DZ]): displacement [length].
    - SIEF_NOEU (SIXX, SIYY, SIZZ, SIXY [, SIXZ, SIYZ]): stress, in axisymmetry radial, axial, hoop and shear [pressure].
    - SIEQ_NOEU (VMIS, VMIS_SG): von Mises stress, and von Mises stress with the sign of the trace [pressure].
    - REAC_NODA (DX, DY [, DZ]): reactions [force]. In axisymmetry they are integrated over the full circle, in code_aster
      over one radian.
    - PRES_CONT (PRES): contact pressure, zero at nodes outside the contact surfaces [pressure].
    - USUR_CONT (USUR), in models with wear: wear depth, zero at nodes outside the contact surfaces [length].
    - ENDO_CONT (ENDO), in models with cohesive layers or adhesion: damage, zero at nodes outside the contact surfaces
      [-].
    - PRES_FLUI (PRES), in models with fluid pressures: fluid pressure, zero at nodes outside the contact surfaces
      [pressure].
    - TEMP (TEMP), with heat conduction: temperature [temperature].

    Parameters
    ----------
    path : path-like
        File to write; an existing file is replaced.
    mesh : Mesh
        The mesh of the steps.
    steps : iterable of StepResult
        Steps, of which only one is in memory at a time if a generator is passed.
    mesh_name : str
        Name of the mesh in the file, at most 64 bytes.

    Raises
    ------
    FileError
        If the file cannot be written, there are no steps, or two steps have the same index.
    MeshError
        If a step does not belong to the mesh.

    Examples
    --------
    >>> import fastcontact as fc
    >>> mesh = fc.generate.block_on_block()
    >>> model = fc.Model(mesh, kinematics="plane_strain")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.0))
    >>> model.fix("LOWER_BOTTOM", "xy")
    >>> model.fix("UPPER_LEFT", "x")
    >>> model.add_pressure("UPPER_TOP", 2.0)
    >>> model.add_contact("joint", secondary="CONT_UPPER", primary="CONT_LOWER")
    >>> steps = fc.solve(model, 2)
    >>> fc.write_med_results("blocks.med", mesh, steps)
    >>> times, displacements = fc.read_med_field("blocks.med", "DEPL")
    >>> times
    array([0.5, 1. ])
    """
    with new_file(path, mesh) as file:
        add_mesh(file, mesh, mesh_name)
        indices: set[int] = set()
        for step in steps:
            if step.index in indices:
                raise FileError(f"two steps have the index {step.index}: give them different ones to write '{path}'")
            indices.add(step.index)
            for name, (components, field) in _fields(mesh, step).items():
                add_field(file, name, components, field, (step.index, step.load_factor), mesh_name)
        if not indices:
            raise FileError(f"there is no step to write to '{path}': solve first, or use write_med_mesh")


def _fields(mesh: Mesh, step: StepResult) -> dict[str, tuple[tuple[str, ...], Array]]:
    """Return the names of the components and the values (n_points, n_components) of each field, by name."""
    directions = tuple(f"D{axis}" for axis in AXES[: mesh.dim])
    stresses = tuple(STRESSES)[: 4 if mesh.dim == 2 else 6]
    stress = _nodal_array(mesh, step, "stress")
    equivalent = [_nodal_array(mesh, step, name) for name in ("von_mises", "von_mises_signed")]
    has_temperature = step.temperature is not None
    return {
        "DEPL": (directions, _nodal_array(mesh, step, "displacement")),
        "SIEF_NOEU": (stresses, stress[:, [STRESSES[name] for name in stresses]]),
        "SIEQ_NOEU": (("VMIS", "VMIS_SG"), np.column_stack(equivalent)),
        "REAC_NODA": (directions, _nodal_array(mesh, step, "reaction")),
        **{CONTACT[k][0]: (CONTACT[k][1:], v[:, None]) for k, v in contact_fields(mesh, step, CONTACT).items()},
        **({"TEMP": (("TEMP",), _nodal_array(mesh, step, "temperature")[:, None])} if has_temperature else {}),
    }


def _nodal_array(mesh: Mesh, step: StepResult, name: str) -> Array:
    """Return the nodal array `name` of a step after a check of its shape."""
    field, shape = np.asarray(getattr(step, name), np.float64), step_shapes(mesh)[name]
    if field.shape != shape:
        raise MeshError(
            f"{name} of step {step.index} has shape {field.shape} where the mesh needs {shape}: write results with the mesh "
            "they were computed on"
        )
    return field
