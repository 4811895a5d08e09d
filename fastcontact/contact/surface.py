"""One side of a contact pair: the facets of a group, turned outward from the solid that carries them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastcontact import elements
from fastcontact.errors import ContactError, MeshError
from fastcontact.mesh import Mesh
from fastcontact.topology import ordered_line, outer_facets

Array = NDArray[np.float64]
Indices = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Surface:
    """Facets of one side of a contact pair.

    Attributes
    ----------
    group : str
        Name of the group in the mesh.
    element : str
        Element of the facets, one kind.
    facets : ndarray (n_facets, n_nodes)
        Connectivity, normals pointing out of the solid.
    points : ndarray (m,)
        The nodes; in order along the line where the facets form one open line, else ascending.
    abscissa : ndarray (m,)
        Length along the surface to each node [length]; zero where there is no such order.
    local : ndarray (n_facets, n_nodes)
        `facets` as positions in `points`.
    """

    group: str
    element: str
    facets: Indices
    points: Indices
    abscissa: Array
    local: NDArray[np.intp]


def surface(mesh: Mesh, group: str) -> Surface:
    """Return the facets of `group` oriented from the solid behind them, as ORIE_PEAU of code_aster does.

    Raises
    ------
    MeshError
        If there is no such group.
    ContactError
        If the group holds no facets, facets of several kinds, or a facet inside a solid or without one.
    """
    blocks = mesh.cells_of(group, dim=mesh.dim - 1)
    if not blocks:
        raise ContactError(
            f"group '{group}' holds no facets (cells of dimension {mesh.dim - 1}): name a boundary group"
        )
    if len(blocks) > 1:
        raise ContactError(f"group '{group}' mixes facets of {' and '.join(blocks)}: make the mesh of one order there")
    name, block = next(iter(blocks.items()))
    facets = _outward(mesh, group, name, block)
    points, abscissa = _ordered(mesh, group, facets)
    position = np.full(mesh.n_points, -1, np.intp)
    position[points] = np.arange(len(points))
    return Surface(group, name, facets, points, abscissa, position[facets])


def _outward(mesh: Mesh, group: str, name: str, block: Indices) -> Indices:
    """Return the outer facets of the solid that match `block`, with the solid's orientation."""
    outer = outer_facets(mesh).get(name, np.empty((0, elements.get(name).n_nodes), np.int32))
    keys = {tuple(sorted(facet)): row for row, facet in enumerate(outer.tolist())}
    rows = [keys.get(tuple(sorted(facet)), -1) for facet in block.tolist()]
    missing = [i for i, row in enumerate(rows) if row < 0]
    if missing:
        where = mesh.points[block[missing[0]]].mean(axis=0)
        raise ContactError(
            f"{len(missing)} of {len(block)} facets of '{group}' do not lie on the outside of a solid "
            f"(first near {where}): contact needs boundary facets that share their nodes with solid cells"
        )
    return np.ascontiguousarray(outer[np.unique(rows)])


def _ordered(mesh: Mesh, group: str, facets: Indices) -> tuple[Indices, Array]:
    if mesh.dim == 2:
        try:
            line = ordered_line(mesh, group)
            return line.points, line.abscissa
        except MeshError:  # closed, or in several pieces: no order along it
            pass
    points = np.unique(facets)
    return points, np.zeros(len(points))
