"""Reference points: points of a mesh without cells, each with a second one for its rotation."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from fastcontact._tools.argument_types import typed
from fastcontact.errors import MeshError
from fastcontact.mesh.companion_groups import ROTATION
from fastcontact.mesh.mesh import Mesh


@typed(MeshError)
def with_reference_points(mesh: Mesh, places: Mapping[str, ArrayLike]) -> Mesh:
    """Return the mesh with reference points, which `Model.add_coupling` relates to groups.

    Parameters
    ----------
    mesh : Mesh
    places : mapping of str to array_like (dim,)
        Position of each reference point by name [length].

    Returns
    -------
    Mesh
        With groups of one point each: ``"<name>"``, and ``"<name> rotation"``, whose displacement is the rotation [radian],
        in the plane its first component.

    Raises
    ------
    MeshError
        If a name exists already, or a position has the wrong dimension or is not finite.

    Examples
    --------
    >>> from fastcontact.mesh.generate import block
    >>> mesh = with_reference_points(block(), {"HANDLE": (0.5, 3.0)})
    >>> mesh.points[mesh.point("HANDLE")].tolist()
    [0.5, 3.0]
    """
    points = [mesh.points]
    groups: dict[str, list[int]] = {}
    for name, coordinates in places.items():
        position = np.asarray(coordinates, float)
        if position.shape != (mesh.dim,) or not np.isfinite(position).all():
            raise MeshError(f"the place {coordinates!r} of reference point '{name}' must be {mesh.dim} numbers")
        for group in (name, name + ROTATION):
            if group in mesh.group_names:
                raise MeshError(f"there is already a group '{group}': give the reference point another name")
            groups[group] = [mesh.n_points + len(groups)]
            points.append(position[None])
    return mesh.replace(points=np.concatenate(points), point_groups={**mesh.point_groups, **groups})
