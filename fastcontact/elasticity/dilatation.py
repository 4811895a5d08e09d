"""Mean dilatation (B-bar): elements free of volumetric locking.

The dilatation, the trace of the strain, is projected on polynomials of low degree in each cell: its mean in linear elements
(the B-bar method: Hughes, Int. J. Numer. Meth. Engng 15, 1980), a linear function in quadratic ones. The rest of the
strain is unchanged. Quadratic triangles, tetrahedra, wedges and pyramids would still be over-constrained by a linear
dilatation. There, only the mean dilatation has the full bulk modulus; the remainder has the bulk modulus of a material with
nu = 0.3 and the same shear modulus, without which single cells in 3D and in axisymmetry would have mechanisms (conformal
maps, whose deviatoric strain is zero).

The element loops use moduli without the bulk modulus, and the loops of `dilatation_kernels` add the contribution of the
projected dilatation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastcontact.arrays import Array
from fastcontact.elasticity.energy import cell_volumes
from fastcontact.elasticity.incompatible_modes import BENDING, MODES
from fastcontact.mesh import elements

# Type of the flags of moduli with a mean dilatation: True or 1, see `MaterialField.treatment`.
Mask = NDArray[np.bool_] | NDArray[np.uint8]
# Bulk over shear modulus at nu = 0.3: 2 (1 + nu) / (3 (1 - 2 nu)).
REMAINDER = 2.6 / 1.2


class Split(NamedTuple):
    """Moduli without the volumetric part, and bulk moduli.

    Attributes
    ----------
    moduli : ndarray (n_materials, 4, 4), in 3D (n_materials, 6, 6)
        Moduli for the element loops [pressure].
    bulk : ndarray (n_materials, 2)
        Bulk moduli of the mean dilatation of a cell and of the remainder, zero if included in `moduli` [pressure].
    """

    moduli: Array
    bulk: Array


def split(name: str, moduli: Array, averaged: Mask | None) -> Split | None:
    """Return the split moduli of an element; None where no dilatation is projected.

    Parameters
    ----------
    name : str
        The element.
    moduli : ndarray (n_materials, 4, 4), in 3D (n_materials, 6, 6)
        From `LinearElastic.moduli` [pressure].
    averaged : ndarray of bool (n_materials,), optional
        Materials with a mean dilatation: flag 1, and flag 3 for elements outside `BENDING` (`MaterialField.treatment`);
        none by default.
    """
    if averaged is not None:
        treatment = np.asarray(averaged).astype(np.uint8)
        averaged = (treatment == 1) | ((treatment == 1 + MODES) & (name not in BENDING))
    if averaged is None or not averaged.any() or elements.get(name).dilatation is None:
        return None
    bulk = np.where(averaged, moduli[:, :3, :3].sum(axis=(1, 2)) / 9.0, 0.0)
    deviatoric = moduli.copy()
    deviatoric[:, :3, :3] -= bulk[:, None, None]
    complete = elements.get(name).dilatation == elements.get(name).order - 1
    rest = bulk if complete else np.minimum(bulk, REMAINDER * moduli[:, 3, 3])
    return Split(deviatoric, np.column_stack([bulk, rest]))


def projected(name: str, corners: Array, values: Array, xi: Array, axisymmetric: bool) -> Array:
    """Return mean and remainder (n_cells, 2, n) of a field, projected as the dilatation is [unit of the field].

    Parameters
    ----------
    name : str
        The element.
    corners : ndarray (n_cells, n_nodes, dim)
        Nodes of the cells [length].
    values : ndarray (n_cells, n_q)
        The field at the quadrature points [unit of the field].
    xi : ndarray (n, dim)
        Points of the reference cell at which to evaluate it [-].
    axisymmetric : bool
    """
    N, dN, weights = elements.get(name).tables
    volume = cell_volumes(corners, N, dN, axisymmetric) * weights
    at = basis(name, elements.get(name).quadrature[0])
    mass = np.einsum("cq,qm,qn->cmn", volume, at, at)
    projection = (
        np.linalg.solve(mass, np.einsum("cq,qm,cq->cm", volume, at, values)[:, :, None])[:, :, 0] @ basis(name, xi).T
    )
    mean = np.broadcast_to(((volume * values).sum(axis=1) / volume.sum(axis=1))[:, None], projection.shape)
    return np.stack([mean, projection - mean], axis=1)


def basis(name: str, xi: Array) -> Array:
    """Return the polynomials (n, m) [-] on which an element projects its dilatation, at the points `xi` (n, dim) [-]."""
    element = elements.get(name)
    one = np.ones((len(xi), 1))
    if element.order == 1:
        return one
    return np.column_stack([one, xi - element.nodes[: element.n_corners].mean(axis=0)])
