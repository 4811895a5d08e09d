"""Elastic energy due to stresses, volumes and gradients at quadrature points, and a quadrature rule of higher order."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Array
from fastcontact.mesh import quadrature
from fastcontact.mesh.elements import Element


def twice_energy_density(stress: Array, compliance: Array) -> Array:
    """Return twice the elastic energy density, ``stress : strain``, at points of cells (n_cells, n) [pressure].

    Parameters
    ----------
    stress : ndarray (n_cells, n, n_components)
        Stress [pressure].
    compliance : ndarray (n_cells, m, n_components, n_components)
        Compliance of cells (m = 1) or of points (m = n), see `Material.compliance_at` [1 / pressure].
    """
    (n_cells, n, n_components), m = stress.shape, compliance.shape[1]
    strain = stress.reshape(n_cells, m, n // m, n_components) @ compliance
    return np.einsum("cni,cni->cn", stress, strain.reshape(stress.shape))


def cell_volumes(coordinates: Array, N: Array, dN: Array, axisymmetric: bool) -> Array:
    """Return det J (n_cells, n_q) [length^dim], the ratio of the volume of a cell to that of the reference cell at points.

    In axisymmetry, det J is multiplied by the circumference 2 pi r [length^3].

    The arguments are the nodes of the cells, `coordinates` (n_cells, n_nodes, dim) [length], the shape functions
    `N` (n_q, n_nodes) [-], and their derivatives `dN` (n_q, n_nodes, dim) [-].
    """
    n_q, n_nodes, dim = dN.shape
    J = coordinates.transpose(0, 2, 1) @ dN.transpose(1, 0, 2).reshape(n_nodes, -1)
    volume = quadrature.determinants(J.reshape(-1, dim, n_q, dim).transpose(0, 2, 1, 3))
    if axisymmetric:
        volume *= 2.0 * np.pi * np.einsum("qa,ca->cq", N, coordinates[:, :, 0])
    return np.asarray(volume)


def gradients_at(coordinates: Array, dN: Array) -> tuple[Array, Array]:
    """Return the gradients (n_cells, n_q, n_nodes, dim) of shape functions [1 / length], and det J (n_cells, n_q).

    The arguments are the nodes of the cells, `coordinates` (n_cells, n_nodes, dim) [length], and the derivatives of the shape
    functions `dN` (n_q, n_nodes, dim) [-].
    """
    inverse, determinant = _inverses(derivatives_at(coordinates, dN))
    return np.einsum("qak,cqkd->cqad", dN, inverse, optimize=True), determinant


def slopes_at(displacement: Array, coordinates: Array, dN: Array) -> tuple[Array, Array]:
    """Return the gradients (n_cells, n_q, dim, dim) of a displacement field [-], and det J (n_cells, n_q).

    The arguments are the nodal displacements `displacement` (n_cells, n_nodes, dim) [length], and those of `gradients_at`,
    `coordinates` (n_cells, n_nodes, dim) [length] and `dN` (n_q, n_nodes, dim) [-]. The last index of the gradients is the
    direction of differentiation.
    """
    inverse, determinant = _inverses(derivatives_at(coordinates, dN))
    return np.asarray(derivatives_at(displacement, dN) @ inverse), determinant


def _inverses(J: Array) -> tuple[Array, Array]:
    """Return the inverses (n_cells, n_q, dim, dim) and determinants (n_cells, n_q) of Jacobians (n_cells, n_q, dim, dim)."""
    if J.shape[-1] == 2:
        return np.asarray(np.linalg.inv(J)), quadrature.determinants(J)
    # Cramer's rule takes a quarter of the time of `inv` and `det`.
    a, b, c = np.moveaxis(J, 2, 0)
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=3)
    determinant = np.einsum("cqk,cqk->cq", a, cofactors[..., 0])
    return np.asarray(cofactors / determinant[..., None, None]), np.asarray(determinant)


def derivatives_at(values: Array, dN: Array) -> Array:
    """Return the derivatives (n_cells, n_q, dim, dim) of a vector field with respect to reference coordinates [length].

    The arguments are the vectors at the nodes, `values` (n_cells, n_nodes, dim) [length], and `dN` (n_q, n_nodes, dim) [-].
    """
    return np.einsum("qak,cad->cqdk", dN, values, optimize=True)


def integration_rule(element: Element, n_points: int | None = None) -> quadrature.Rule:
    """Return a product rule with `n_points` points in each direction of the reference cell, by default order + 3."""
    return quadrature.product_rule(element.linear, element.order + 3 if n_points is None else n_points)
