"""Incompatible modes: quadrangles and hexahedra free of shear and volumetric locking.

Each linear cell gets internal displacements, 1 - xi^2 along each reference direction, with which its edges may curve;
neighbours do not share them, and static condensation eliminates them (Wilson, Taylor, Doherty and Ghaboussi, Numerical and
computer methods in structural mechanics, 1973). Their gradients are computed with the Jacobian at the middle of the cell, so
that their mean strain is zero and patches of constant stress are exact (Taylor, Beresford and Wilson, Int. J. Numer. Meth.
Engng 10, 1976). Hexahedra have four additional enhanced dilatations, the products of two and three reference
coordinates, without which they lock from nu = 0.49 on (Simo, Armero and Taylor, Comput. Methods Appl. Mech. Engng 110, 1993).
The loops over cells are in `incompatible_modes_kernels`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fastcontact.arrays import AnyArray, Array, Indices, Mask
from fastcontact.mesh import elements

# Elements with incompatible modes, and the flag of the moduli that select them.
BENDING = ("quad4", "hex8")
MODES = 2
# Number of the stress component of two directions.
PAIRS = {2: np.array([[0, 3], [3, 1]]), 3: np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])}


class Tables(NamedTuple):
    """Constants of an element for the loops in `incompatible_modes_kernels`.

    Attributes
    ----------
    dN, xi, weights, middle : ndarray
        Quadrature data, and shape derivatives in the middle [-].
    pairs : ndarray of int (dim, dim)
        Number of the stress component of two directions.
    """

    dN: Array
    xi: Array
    weights: Array
    middle: Array
    pairs: Indices


def tables(name: str) -> Tables:
    """Return the constants of an element for the loops."""
    element = elements.get(name)
    _, dN, weights = element.tables
    return Tables(dN, element.quadrature[0], weights, element.gradient(np.zeros((1, element.dim))), PAIRS[element.dim])


def asked(name: str, treatment: AnyArray | None) -> Mask | None:
    """Return which moduli (n_moduli,) have modes in an element; None if none has."""
    if treatment is None or name not in BENDING:
        return None
    bends = (np.asarray(treatment).astype(np.uint8) & MODES) > 0
    return bends if bends.any() else None
