r"""The base of formulations with a pressure field: contact decided at integration points, pressures at nodes.

The multiplier field :math:`\lambda_h` has the order of the facets. At every integration point the pressure is

.. math:: p = [\lambda_h - \rho g]_+

and the field is its projection, :math:`\int (\lambda_h - p) N_j = 0` for every node j (Alart and Curnier, 1991; with
integration points, Ben Dhia and Zarroug, 2002; code_aster, R5.03.52). Both are the stationarity of one augmented
Lagrangian. With the point forces :math:`y = w p` as unknowns it becomes a linear complementarity problem

.. math:: y \ge 0, \quad g + C y \ge 0, \quad y^T (g + C y) = 0, \quad
          C = \tfrac{1}{\rho} \left( W^{-1} - P (P^T W P)^{-1} P^T \right)

with P the shape functions at the points and W their areas. C is positive semidefinite and vanishes on the fields that
the shape functions can represent, so the multiplier itself is not softened; it only decides what is finer than the
field. The primal-dual active set solves this exactly (as a semismooth Newton method), for every rho > 0, with the
pairing renewed in every iteration. No multiplier can stay undetermined as long as :math:`P^T W P` is regular: that
takes at least as many points with a weight on a facet as it has nodes. Integrals run over the reference surface.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints, NodalField
from fastcontact.contact.formulations._formulation import Formulation
from fastcontact.contact.multiplier_field import Projection
from fastcontact.contact.pairing import Candidates, Pairing, normals
from fastcontact.errors import ContactError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class PressureField(NodalField):
    """A pressure field with values at the secondary nodes; see `constraints.NodalField`.

    Attributes
    ----------
    projection : Projection
        From point forces to the independent values of the field.
    nodes : csr_array (n_nodes, k)
        From those to the values at all nodes [-].
    independent : ndarray of int (k,)
        Nodes of the independent values.
    around : ndarray of int (m, n)
        Nodes of the facet of each integration point, counted on the secondary side.
    renewed : bool
        Whether every pairing has integration points of its own.
    """

    projection: Projection
    nodes: csr_array
    independent: NDArray[np.intp]
    around: NDArray[np.intp]
    renewed: bool

    @classmethod
    def of_points(
        cls, P: csr_array, areas: Array, rho: float, field: tuple[csr_array, NDArray[np.intp]],
        around: NDArray[np.intp], renewed: bool,
    ) -> PressureField:  # fmt: skip
        """Return the field of points with shape functions P (m, n_nodes); `field` are `nodes` and `independent`."""
        nodes, independent = field
        P = csr_array(P @ nodes)
        mass = splu((P.T @ diags_array(areas) @ P).tocsc()) if len(independent) else None
        return cls(Projection(P, areas, rho, mass), nodes, independent, around, renewed)

    @property
    def areas(self) -> Array:
        """Areas (m,) of the integration points; infinite for those that take no part [area]."""
        return np.where(self.projection.areas > 0, self.projection.areas, np.inf)

    def pressure(self, force: Array) -> Array:
        """Return the field at the nodes; it may be slightly negative beyond the edge of the contact."""
        return self.nodes @ self.projection.field(force)

    def closed_nodes(self, active: Mask, gap: Array, pressure: Array) -> Mask:
        """Return the nodes where ``pressure - rho gap`` is positive, on facets with an active point."""
        touched = np.zeros(len(gap), bool)
        touched[self.around[active]] = True
        return touched & (pressure - self.projection.rho * np.where(np.isfinite(gap), gap, np.inf) > 0)

    def initially_active(self, gap: Array, pressure: Array) -> Mask | None:
        """Return the points where the field exceeds rho times the gap, if they were not there in the last pairing."""
        if not self.renewed:
            return None
        field = self.projection.P @ pressure[self.independent]
        return (self.projection.areas > 0) & (field - self.projection.rho * gap > 0)


def shapes_at(shape: Array, local: NDArray[np.intp], n_nodes: int) -> csr_array:
    """Return the shape functions (m, n_nodes) of all nodes at points, from those (m, n) of the nodes `local` (m, n)."""
    row = np.broadcast_to(np.arange(len(shape))[:, None], shape.shape)
    return coo_array((shape.ravel(), (row.ravel(), local.ravel())), shape=(len(shape), n_nodes)).tocsr()


@dataclass(eq=False)
class PressureFieldFormulation(Formulation):
    """A formulation with a pressure field; further parameters as in `Formulation`.

    Parameters
    ----------
    augmentation : float
        rho times the length of the shortest facet (the root of the smallest area) over the modulus of the bodies [-].
    """

    augmentation: float = 1.0

    geometry_in_loop: ClassVar[bool] = True

    @property
    def eliminable(self) -> bool:
        """See `Formulation`: the pressure field gives way."""
        return False

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.augmentation > 0:
            raise ContactError(f"augmentation = {self.augmentation} must be positive; 1 suits most problems")

    def of_points(
        self, candidates: Candidates, pairing: Pairing, field: PressureField, at: Configuration
    ) -> Constraints:
        """Return the constraints of paired integration points whose forces make up a pressure field."""
        part = self.assembled(candidates, pairing, field.projection, at)
        undetermined = self._undetermined(candidates, pairing, field, part.directions) if self.friction else None
        return replace(part, low_rank_compliance=undetermined, areas=field.areas, nodal=field)

    def _undetermined(
        self, candidates: Candidates, pairing: Pairing, field: PressureField, directions: tuple[Array, ...]
    ) -> Array | None:
        """Return a compliance of tangential fields that do no work on any slip, where supports prescribe nodes."""
        factors = []
        for axis in range(directions[0].shape[1]):
            columns = np.flatnonzero(self.supported_along(axis, candidates, pairing)[field.independent])
            if len(columns):
                Z = field.projection.compliant(columns)
                factors.append(np.stack([along[:, axis, None] * Z for along in (normals(directions), *directions)]))
        return np.concatenate(factors, axis=2) if factors else None
