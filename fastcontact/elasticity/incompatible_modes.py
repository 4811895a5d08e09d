"""Incompatible modes, which avoid shear locking and volumetric locking of quadrangles and hexahedra.

Each linear cell has additional displacement modes 1 - xi^2 along each reference direction, which permit its edges to curve.
The modes are internal to the cell and are eliminated by static condensation (Wilson, Taylor, Doherty and Ghaboussi, Numerical
and computer methods in structural mechanics, 1973). Their gradients are computed with the Jacobian at the centre of the cell,
so that their mean strain is zero and the patch test is passed (Taylor, Beresford and Wilson, Int. J. Numer. Meth. Engng 10,
1976). Hexahedra have four additional modes of enhanced dilatation, the products of two and of three reference coordinates.
Without these, hexahedra lock if nu is 0.49 or more (Simo, Armero and Taylor, Comput. Methods Appl. Mech. Engng 110, 1993).
The loops over cells are in `incompatible_modes_kernels`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fastcontact.arrays import AnyArray, Array, Indices, Mask
from fastcontact.mesh import elements

# Elements that support incompatible modes.
ELEMENTS_WITH_MODES = ("quad4", "hex8")
# Bit of the codes of `MaterialField.treatment` that selects the modes.
MODES = 2
# Voigt number of the stress component (i, j), by the dimension of the mesh.
VOIGT = {2: np.array([[0, 3], [3, 1]]), 3: np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])}


class Tables(NamedTuple):
    """Constants of an element type for the loops in `incompatible_modes_kernels`.

    Attributes
    ----------
    dN, xi, weights : ndarray (n_q, n_nodes, dim), (n_q, dim), (n_q,)
        Derivatives of the shape functions at the quadrature points, these points, and their weights [-].
    middle : ndarray (1, n_nodes, dim)
        Derivatives of the shape functions at the centre of the cell [-].
    voigt : ndarray of int (dim, dim)
        Voigt number of the stress component (i, j).
    """

    dN: Array
    xi: Array
    weights: Array
    middle: Array
    voigt: Indices


def tables(name: str) -> Tables:
    """Return the constants of the element type `name`."""
    element = elements.get(name)
    _, dN, weights = element.tables
    return Tables(dN, element.quadrature[0], weights, element.gradient(np.zeros((1, element.dim))), VOIGT[element.dim])


def with_modes(name: str, treatment: AnyArray | None) -> Mask | None:
    """Return a mask (n_moduli,) of the moduli of materials that use incompatible modes in elements of type `name`.

    None is returned if the element type does not support these modes, or no material uses them.
    """
    if treatment is None or name not in ELEMENTS_WITH_MODES:
        return None
    has_modes = (np.asarray(treatment).astype(np.uint8) & MODES) > 0
    return has_modes if has_modes.any() else None
