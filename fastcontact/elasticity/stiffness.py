"""Stiffness matrix of a mesh, its sparsity, and rigid-body modes."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from fastcontact._jit import parallel
from fastcontact._tools.records import field, record
from fastcontact.arrays import Array, Mask, Numbers
from fastcontact.elasticity import dilatation, element_2d_kernels, element_3d_kernels, incompatible_modes
from fastcontact.elasticity import stiffness_kernels as pattern_kernels
from fastcontact.errors import MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh

Indices = NDArray[np.int64]
Tables = tuple[Array, Array, Array]  # N, dN and weights at quadrature points
# Modules with the element loops `add_stiffness` and `stress`, by dimension.
LOOPS = {2: element_2d_kernels, 3: element_3d_kernels}


class Owners(NamedTuple):
    """Division of the assembly into parts, one per thread.

    Attributes
    ----------
    owner : ndarray of uint8 (n_points,)
        Number of the part that computes the rows of the matrix of each point.
    cells : list of (int, int)
        First cell of each part, and the number after its last cell.
    """

    owner: NDArray[np.uint8]
    cells: list[tuple[int, int]]


@record
class Sparsity:
    """Sparsity of a stiffness matrix: the node pairs with a common cell.

    Attributes
    ----------
    indptr, indices : ndarray of int (n_points + 1,), (n_blocks,)
        Row pointers and sorted column indices of the nodal blocks.
    slots : dict of str to ndarray (n_cells, n_nodes, n_nodes)
        Position in `indices` of each node pair of each cell, by solid element type.
    """

    indptr: Numbers
    indices: Numbers
    slots: dict[str, Numbers]
    _owners: dict[tuple[str, int], Owners] = field(default_factory=dict, init=False, repr=False)

    def owners(self, mesh: Mesh, name: str) -> Owners:
        """Return the division of the assembly of an element type; results are cached by number of parts."""
        key = name, len(parallel.portions(*mesh.cells[name].shape))
        if key not in self._owners:
            self._owners[key] = owners(mesh.cells[name], mesh.n_points)
        return self._owners[key]


def sparsity(mesh: Mesh) -> Sparsity:
    """Return the sparsity of the stiffness matrix of `mesh`; points without cells have a diagonal block."""
    blocks = mesh.solids
    nodes = np.concatenate([np.empty(0, np.int32), *(block.ravel() for block in blocks.values())])
    isolated = np.flatnonzero(np.bincount(nodes, minlength=mesh.n_points) == 0)
    cell_sizes = (np.full(len(block), block.shape[1]) for block in blocks.values())
    sizes = np.concatenate([[0], *cell_sizes, np.ones_like(isolated)])
    # SciPy preserves the type of index arrays. The indices of all matrices are therefore 32-bit integers, like the nodes.
    nodes, first = np.concatenate([nodes, isolated.astype(np.int32)]), np.cumsum(sizes, dtype=np.int32)
    incidence = csr_array((np.ones(len(nodes), bool), nodes, first), shape=(len(sizes) - 1, mesh.n_points))
    pattern = csr_array(incidence.T @ incidence)
    pattern.sort_indices()
    indptr, indices = pattern.indptr, pattern.indices
    return Sparsity(indptr, indices, {name: _slots(block, indptr, indices) for name, block in blocks.items()})


def _slots(cells: Numbers, indptr: Numbers, indices: Numbers) -> Numbers:
    """Return the `slots` of `Sparsity` for one element type."""
    slots = np.empty((*cells.shape, cells.shape[1]), np.int32)

    def find(portion: tuple[int, int]) -> None:
        rows = slice(*portion)
        pattern_kernels.find_slots(cells[rows], indptr, indices, slots[rows])

    parallel.parallel_map(find, parallel.portions(*cells.shape))
    return slots


def stiffness(
    mesh: Mesh, kinematics: str, moduli: Array, material: dict[str, Numbers], pattern: Sparsity | None = None,
    averaged: dilatation.Mask | None = None,
) -> bsr_array:  # fmt: skip
    """Assemble the stiffness matrix of the solid cells.

    Parameters
    ----------
    mesh : Mesh
    kinematics : str
        ``"axisymmetric"`` (forces over the full circle), ``"plane_strain"`` or ``"plane_stress"`` (unit thickness),
        or ``"3d"``.
    moduli : ndarray (n_materials, 4, 4), in 3D (n_materials, 6, 6)
        From `LinearElastic.moduli` [pressure].
    material : dict of str to ndarray of int (n_cells,) or (n_cells, n_q)
        Material number of each cell, or of each quadrature point, by solid element type.
    pattern : Sparsity, optional
        The result of `sparsity`, if it is already available.
    averaged : ndarray of bool or uint8 (n_materials,), optional
        Whether each material has a mean dilatation, see `dilatation`; or the codes of `MaterialField.treatment`, which also
        state whether it has incompatible modes. By default, no material has either.

    Returns
    -------
    bsr_array (n_points * dim, n_points * dim)
        Symmetric matrix with blocks of dim x dim entries [force / length].

    Raises
    ------
    MeshError
        If a cell is degenerate or inverted.
    """
    pattern = pattern or sparsity(mesh)
    data = np.zeros((len(pattern.indices), mesh.dim, mesh.dim))
    isotropic = is_isotropic(moduli)
    for name, block in mesh.solids.items():
        split = dilatation.split(name, moduli, averaged)
        element_moduli = moduli, isotropic, split, incompatible_modes.with_modes(name, averaged)
        add_part = partial(
            _add_part, mesh=mesh, name=name, material=material[name], moduli=element_moduli,
            axisymmetric=kinematics == "axisymmetric", pattern=pattern, data=data,
        )  # fmt: skip
        bad_cells = parallel.parallel_map(add_part, range(len(pattern.owners(mesh, name).cells)))
        bad_cell = min((number for number in bad_cells if number >= 0), default=-1)
        if bad_cell >= 0:
            x = mesh.points[block[bad_cell]].mean(axis=0)
            raise MeshError(f"cell {bad_cell} of {name} near {x} is degenerate or inverted (Jacobian not positive)")
    size = mesh.n_points * mesh.dim
    return bsr_array((data, pattern.indices, pattern.indptr), shape=(size, size))


def is_isotropic(moduli: Array) -> Mask:
    """Return a mask (n_materials,) of moduli that are isotropic up to round-off, with which loops in 3D are faster.

    Parameters
    ----------
    moduli : ndarray (n_materials, 4, 4), in 3D (n_materials, 6, 6)
        Moduli [pressure].
    """
    shear, size = moduli[:, 3, 3, None], moduli.shape[1]
    isotropic = np.zeros_like(moduli)
    isotropic[:, :3, :3] = moduli[:, 0, 1, None, None]
    isotropic[:, range(3), range(3)] += 2.0 * shear
    isotropic[:, range(3, size), range(3, size)] = shear
    return np.asarray(np.abs(moduli - isotropic).max(axis=(1, 2)) <= 1e-14 * np.abs(moduli[:, 0, 0]))


def cell_materials(material: Numbers) -> Numbers:
    """Return one material number for each cell (n_cells,).

    If `material` (n_cells,) contains numbers of cells, it is returned unchanged. If it contains numbers of quadrature points
    (n_cells, n_q), those of the first point of each cell are returned.
    """
    return material if material.ndim == 1 else np.ascontiguousarray(material[:, 0])


def _passes(tables: Tables, material: Numbers) -> Iterator[tuple[Tables, Numbers]]:
    """Yield quadrature tables, each with the material numbers (n_cells,) at its points.

    If the material varies within cells, there is a table for each quadrature point; otherwise, a single table for all points.
    """
    if material.ndim == 1:
        yield tables, material
        return
    for q in range(material.shape[1]):
        N, dN, weights = (table[q : q + 1] for table in tables)
        yield (N, dN, weights), np.ascontiguousarray(material[:, q])


def _add_part(
    number: int, mesh: Mesh, name: str, material: Numbers, moduli: tuple[Array, Mask, dilatation.Split | None, Mask | None],
    axisymmetric: bool, pattern: Sparsity, data: Array,
) -> int:  # fmt: skip
    """Add the stiffness of one element type to `data` (n_blocks, dim, dim), in the rows of part `number` of `Owners`.

    The tuple `moduli` contains the moduli, a mask of the isotropic ones, their split, and a mask of those with incompatible
    modes. Returns the number of the first cell whose Jacobian is not positive, or -1.
    """
    (D, isotropic, split, with_modes), tables = moduli, elements.get(name).tables
    owner, row_ranges = pattern.owners(mesh, name)
    rows = slice(*row_ranges[number])
    cells, material, slots = mesh.cells[name][rows], material[rows], pattern.slots[name][rows]
    target = axisymmetric, slots, owner, number, data
    for tables_of_pass, numbers in _passes(tables, material):
        bad_cell = LOOPS[mesh.dim].add_stiffness(
            mesh.points, cells, *tables_of_pass, D if split is None else split.moduli, isotropic, numbers, *target
        )
        if bad_cell >= 0:
            return int(bad_cell) + rows.start
    if with_modes is not None:
        from fastcontact.elasticity import incompatible_modes_kernels

        incompatible_modes_kernels.subtract_stiffness(
            mesh.points, cells, *incompatible_modes.tables(name), D, with_modes, material.reshape(len(cells), -1), slots,
            owner, number, data,
        )  # fmt: skip
    if split is not None:
        from fastcontact.elasticity import dilatation_kernels

        integrands = *tables, dilatation.basis(name, elements.get(name).quadrature[0]), split.bulk
        dilatation_kernels.add_stiffness(mesh.points, cells, *integrands, cell_materials(material), *target)
    return -1


def owners(cells: Numbers, n_points: int) -> Owners:
    """Return the division of the assembly of `cells` (n_cells, n_nodes) into parts.

    The cells are divided into consecutive portions, and a point belongs to the first portion that contains it. A part
    computes the cells of its portion, and those cells of later portions that contain its points. The portions are chosen such
    that all parts compute about the same number of cells.
    """
    portions = parallel.portions(*cells.shape)
    if len(portions) == 1:
        return Owners(np.zeros(n_points, np.uint8), portions)
    ends = np.array([0, *(end for _, end in portions)])
    work = _owners(cells, n_points, ends)[1]
    extra = work - np.diff(ends)
    ends[1:-1] = np.cumsum(np.maximum(work.mean() - extra, 0.0))[:-1]
    return _owners(cells, n_points, np.minimum(ends, len(cells)))[0]


def _owners(cells: Numbers, n_points: int, ends: Indices) -> tuple[Owners, Indices]:
    """Return the owners for the portions of cells bounded by `ends`, and the number of cells that each part computes."""
    owner = np.full(n_points, parallel.MAX_THREADS, np.uint8)
    last, work = np.zeros((2, len(ends) - 1), np.int64)
    pattern_kernels.first_parts(cells, ends, parallel.MAX_THREADS, owner, last, work)
    return Owners(owner, list(zip(ends[:-1].tolist(), np.maximum(last, ends[:-1]).tolist(), strict=True))), work


def rigid_modes(points: Array, kinematics: str) -> Array:
    """Return the rigid-body modes (n_points * dim, n_modes) at `points` (n_points, dim) [length].

    The columns are the translation along the axis in axisymmetry, two translations and one rotation in plane models, and
    three translations and three rotations in 3D. The unit of the translations is [-]. The rotations are about the mean of the
    points, and their unit is [length].
    """
    (n, dim), x = points.shape, points - points.mean(axis=0)
    planes = [(0, 1)] if dim == 2 else [(1, 2), (2, 0), (0, 1)]
    modes = np.zeros((n, dim, dim + len(planes)))
    modes[:, range(dim), range(dim)] = 1.0
    for rotation, (i, j) in enumerate(planes, start=dim):
        modes[:, i, rotation], modes[:, j, rotation] = -x[:, j], x[:, i]
    return (modes[:, :, 1:2] if kinematics == "axisymmetric" else modes).reshape(n * dim, -1)
