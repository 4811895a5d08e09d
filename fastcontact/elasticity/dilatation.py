"""Mean dilatation (B-bar method), which avoids volumetric locking.

The dilatation, the trace of the strain, is projected onto polynomials of low degree in each cell: constants in linear
elements (the B-bar method of Hughes, Int. J. Numer. Meth. Engng 15, 1980), and linear functions in quadratic elements. The
deviatoric strain is unchanged. Quadratic triangles, tetrahedra, wedges and pyramids would lock even with a linear dilatation.
In these elements, the full bulk modulus is applied only to the mean dilatation. The bulk modulus for the remainder is at most
that of a material with nu = 0.3 and the same shear modulus. If it were zero, single cells in 3D and in axisymmetry would have
mechanisms (conformal maps, whose deviatoric strain is zero).

The element loops use moduli without the bulk modulus, and the loops of `dilatation_kernels` add the contribution of the
projected dilatation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastcontact.arrays import Array
from fastcontact.elasticity.energy import cell_volumes
from fastcontact.elasticity.incompatible_modes import ELEMENTS_WITH_MODES, MODES
from fastcontact.mesh import elements

# Mask of the moduli with a mean dilatation, or the codes of `MaterialField.treatment`.
Mask = NDArray[np.bool_] | NDArray[np.uint8]
# Ratio of the bulk to the shear modulus at nu = 0.3: 2 (1 + nu) / (3 (1 - 2 nu)).
BULK_TO_SHEAR = 2.6 / 1.2


class Split(NamedTuple):
    """Moduli for an element type, split into a part for the element loops and bulk moduli for the projected dilatation.

    Attributes
    ----------
    moduli : ndarray (n_materials, 4, 4), in 3D (n_materials, 6, 6)
        Moduli for the element loops, without the bulk modulus if the dilatation is projected [pressure].
    bulk : ndarray (n_materials, 2)
        Bulk moduli for the mean dilatation of a cell and for the remainder; zero without projection [pressure].
    """

    moduli: Array
    bulk: Array


def split(name: str, moduli: Array, averaged: Mask | None) -> Split | None:
    """Return the split moduli for an element type; None if its dilatation is not projected for any of the moduli.

    Parameters
    ----------
    name : str
        Element type.
    moduli : ndarray (n_materials, 4, 4), in 3D (n_materials, 6, 6)
        From `LinearElastic.moduli` [pressure].
    averaged : ndarray of bool or uint8 (n_materials,), optional
        Mask of the materials with a mean dilatation, or the codes of `MaterialField.treatment`, of which 1 and, for elements
        not in `ELEMENTS_WITH_MODES`, 3 stand for a mean dilatation. By default, there are no such materials.
    """
    if averaged is not None:
        treatment = np.asarray(averaged).astype(np.uint8)
        averaged = (treatment == 1) | ((treatment == 1 + MODES) & (name not in ELEMENTS_WITH_MODES))
    if averaged is None or not averaged.any() or elements.get(name).dilatation is None:
        return None
    bulk = np.where(averaged, moduli[:, :3, :3].sum(axis=(1, 2)) / 9.0, 0.0)
    deviatoric = moduli.copy()
    deviatoric[:, :3, :3] -= bulk[:, None, None]
    complete = elements.get(name).dilatation == elements.get(name).order - 1
    bulk_remainder = bulk if complete else np.minimum(bulk, BULK_TO_SHEAR * moduli[:, 3, 3])
    return Split(deviatoric, np.column_stack([bulk, bulk_remainder]))


def project_field(name: str, coordinates: Array, values: Array, xi: Array, axisymmetric: bool) -> Array:
    """Return the mean and the remainder (n_cells, 2, n) of a field, projected like the dilatation [unit of the field].

    Parameters
    ----------
    name : str
        Element type.
    coordinates : ndarray (n_cells, n_nodes, dim)
        Nodes of the cells [length].
    values : ndarray (n_cells, n_q)
        The field at the quadrature points [unit of the field].
    xi : ndarray (n, dim)
        Points of the reference cell at which the projection is evaluated [-].
    axisymmetric : bool
    """
    N, dN, weights = elements.get(name).tables
    volume = cell_volumes(coordinates, N, dN, axisymmetric) * weights
    polynomials = basis(name, elements.get(name).quadrature[0])
    mass = np.einsum("cq,qm,qn->cmn", volume, polynomials, polynomials)
    moments = np.einsum("cq,qm,cq->cm", volume, polynomials, values)
    projection = np.linalg.solve(mass, moments[:, :, None])[:, :, 0] @ basis(name, xi).T
    mean = np.broadcast_to(((volume * values).sum(axis=1) / volume.sum(axis=1))[:, None], projection.shape)
    return np.stack([mean, projection - mean], axis=1)


def basis(name: str, xi: Array) -> Array:
    """Return the polynomials (n, m) [-] onto which dilatations are projected, at the points `xi` (n, dim) [-]."""
    element = elements.get(name)
    constant = np.ones((len(xi), 1))
    if element.order == 1:
        return constant
    return np.column_stack([constant, xi - element.nodes[: element.n_corners].mean(axis=0)])
