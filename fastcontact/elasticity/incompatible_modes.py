"""Incompatible modes: quadrangles and hexahedra that bend without locking in shear.

Each linear cell gets displacements of its own, 1 - xi^2 along each reference direction, by which its edges may curve;
neighbours do not share them, and static condensation removes them from the stiffness (Wilson, Taylor, Doherty and
Ghaboussi, Numerical and computer methods in structural mechanics, 1973). Their gradients are taken with the Jacobian at the
middle of the cell, so that their mean strain is zero and patches of constant stress are exact (Taylor, Beresford and Wilson,
Int. J. Numer. Meth. Engng 10, 1976). Few cells at a time are worked on, with NumPy.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastcontact.mesh import elements

Array = NDArray[np.float64]
Indices = NDArray[np.int32]
# Elements that have modes, and what tells the materials that ask for them.
BENDING = ("quad4", "hex8")
MODES = 2
BATCH = 20_000
# Components of the strain by those of the gradient: normal strains, and shears as pairs.
SHEARS = ((0, 1), (1, 2), (0, 2))


@dataclass(frozen=True, eq=False)
class Operators:
    """What some cells of an element have at the points of the quadrature.

    Attributes
    ----------
    nodal : ndarray (n_cells, n_q, n_components, n_nodes * dim)
        Strains of unit displacements of the nodes [1 / length].
    modes : ndarray (n_cells, n_q, n_components, dim * dim)
        Strains of unit modes [1 / length].
    measure : ndarray (n_cells, n_q)
        [length^dim].
    """

    nodal: Array
    modes: Array
    measure: Array


def asked(name: str, treatment: NDArray[np.generic] | None, material: Indices) -> NDArray[np.intp]:
    """Return which cells (m,) of an element have modes: linear ones of materials that ask for them."""
    if treatment is None or name not in BENDING or not (np.asarray(treatment) == MODES).any():
        return np.empty(0, np.intp)
    return np.flatnonzero(np.asarray(treatment)[material] == MODES)


def batches(rows: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    """Yield the rows in parts."""
    for first in range(0, len(rows), BATCH):
        yield rows[first : first + BATCH]


def _strains(gradient: Array, components: int) -> Array:
    """Return the strains (..., n_components, n * dim) of unit displacements with gradients (..., n, dim) [1 / length]."""
    *before, n, dim = gradient.shape
    found = np.zeros((*before, components, n, dim))
    for axis in range(dim):
        found[..., axis, :, axis] = gradient[..., axis]
    for row, (i, j) in enumerate(SHEARS[: 1 if dim == 2 else 3], start=3):
        found[..., row, :, i] = gradient[..., j]
        found[..., row, :, j] = gradient[..., i]
    return found.reshape(*before, components, n * dim)


def _jacobians(corners: Array, dN: Array) -> Array:
    """Return the derivatives (n_cells, n, dim, dim) of positions (first) by reference coordinates (last) [length]."""
    return np.einsum("qnk,cni->cqik", dN, corners)


def mode_strains(name: str, corners: Array, xi: Array, components: int) -> Array:
    """Return the strains (n_cells, n, n_components, dim * dim) of unit modes at points `xi` (n, dim) [1 / length].

    `corners` (n_cells, n_nodes, dim) [length].
    """
    element, dim = elements.get(name), corners.shape[2]
    at_middle = _jacobians(corners, element.gradient(np.zeros((1, dim))))[:, 0]
    ratio = np.linalg.det(at_middle)[:, None] / np.linalg.det(_jacobians(corners, element.gradient(xi)))
    inverse = np.linalg.inv(at_middle)  # (c, k, i)
    gradient = -2.0 * np.einsum("cq,qk,cki->cqki", ratio, xi, inverse)
    return _strains(gradient, components)


def operators(name: str, corners: Array, components: int) -> Operators:
    """Return the operators of cells with the nodes `corners` (n_cells, n_nodes, dim) [length]."""
    _, dN, weights = elements.get(name).tables
    jacobians = _jacobians(corners, dN)
    gradient = np.einsum("qnk,cqki->cqni", dN, np.linalg.inv(jacobians))
    measure = np.linalg.det(jacobians) * weights
    return Operators(
        _strains(gradient, components),
        mode_strains(name, corners, elements.get(name).quadrature[0], components),
        measure,
    )


def condensed(found: Operators, moduli: Array) -> Array:
    """Return what the modes take from the stiffness (n_cells, n_dofs, n_dofs) [force / length].

    `moduli` (n_cells, n_components, n_components) [pressure].
    """
    mixed, own = _mode_stiffness(found, moduli)
    return np.einsum("cak,cal->ckl", mixed, np.linalg.solve(own, mixed))


def _mode_stiffness(found: Operators, moduli: Array) -> tuple[Array, Array]:
    """Return the stiffness of modes against nodes (n_cells, n_modes, n_dofs), and against modes [force / length]."""
    stresses = np.einsum("cq,cij,cqja->cqia", found.measure, moduli, found.modes, optimize=True)
    mixed = np.einsum("cqia,cqik->cak", stresses, found.nodal, optimize=True)
    own = np.einsum("cqia,cqib->cab", stresses, found.modes, optimize=True)
    return mixed, own


def amplitudes(found: Operators, moduli: Array, displacement: Array, thermal: Array | None) -> Array:
    """Return the amplitudes of the modes (n_cells, n_modes) that displacements and temperatures bring [length].

    Parameters
    ----------
    found : Operators
    moduli : ndarray (n_cells, n_components, n_components)
        [pressure]
    displacement : ndarray (n_cells, n_dofs)
        Of the nodes [length].
    thermal : ndarray (n_cells, n_q, n_components), optional
        Stresses that the cells lose by their temperature [pressure].
    """
    mixed, own = _mode_stiffness(found, moduli)
    force = -np.einsum("cak,ck->ca", mixed, displacement)
    if thermal is not None:
        force += np.einsum("cq,cqia,cqi->ca", found.measure, found.modes, thermal)
    return np.asarray(np.linalg.solve(own, force[:, :, None])[:, :, 0])
