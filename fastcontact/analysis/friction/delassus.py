r"""The Delassus operator F of constraints with friction.

The compliance of n forces at integration points of a pressure field is a diagonal matrix minus a matrix of small rank
(`linear.field_compliance`). Their Delassus operator is therefore kept in the form :math:`F = \mathrm{diag}(d) + U S U^T` with
a sparse matrix U. With ``x = -H (free + U z)`` and ``H = (E + D diag(d))^-1 D``, the equations ``(E + D F) x = -D free`` of
a Newton step are equivalent to ``(1 + S U^T H U) z = -S U^T H free``, where z contains displacements and the values of the
field. On surfaces in 3D, z has fewer components than x. Other operators have the form :math:`F = \mathrm{diag}(d) + S`.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse import csc_array, csr_array, diags_array, hstack

from fastcontact._tools.records import record, replace
from fastcontact.arrays import Array, Indices, mask_at
from fastcontact.contact.constraints import Constraints
from fastcontact.linear.delassus import MAX_ROWS_WITH_FRICTION, check_rows
from fastcontact.linear.protocol import Loaded
from fastcontact.linear.sparse_rows import scaled
from fastcontact.round_off import LENGTH_ROUND_OFF, ROUND_OFF


@record
class Delassus:
    """The symmetric matrix ``F = diag(d) + U S U.T`` (n, n), or ``diag(d) + S`` without U; see the docstring of the module.

    Attributes
    ----------
    d : ndarray (n,)
        Positive if U is given and the compliance of the constraints is included [length / force].
    S : ndarray (r, r)
        [length / force].
    U : csr_array (n, r), optional
        [-].
    """

    d: Array
    S: Array
    U: csr_array | None = None

    def __matmul__(self, x: Array) -> Array:
        product = self.S @ x if self.U is None else self.U @ (self.S @ (self.U.T @ x))
        return np.asarray(product + (self.d * x.T).T)

    def sum_of_magnitudes(self, x: Array) -> Array:
        """Return the sums (n,) of the magnitudes of all terms of the product with x (n,), which bound its round-off."""
        U = None if self.U is None else abs(self.U)
        return Delassus(np.abs(self.d), np.abs(self.S), U) @ np.abs(x)

    def diagonal(self) -> Array:
        """Return the diagonal (n,) of F."""
        added = self.S.diagonal() if self.U is None else self.U.multiply(self.U @ self.S).sum(axis=1)
        return np.asarray(self.d + added)

    def diagonal_blocks(self, number: Indices) -> Array:
        """Return the compliance (1 + k, 1 + k, m) of each constraint.

        `number` (1 + k, m) are the numbers in F of the normal components, then of the components along each tangent.
        Components with negative numbers have no compliance.
        """
        compliant = number >= 0
        if self.U is None:
            values = self.S[number[:, None], number]
        else:
            US = self.U @ self.S
            values = np.array([[self.U[j].multiply(US[i]).sum(axis=1) for j in number] for i in number])
        values = values + np.where(number[:, None] == number, self.d[number], 0.0)
        return np.where(compliant[:, None] & compliant, values, 0.0)

    def scaled(self, units: Array) -> Delassus:
        """Return F with rows and columns multiplied by `units` (n,)."""
        if self.U is None:
            return Delassus(self.d * units**2, units[:, None] * self.S * units)
        return Delassus(self.d * units**2, self.S, scaled(self.U, units))

    def decoupled(self, selected: Indices, diagonal: Array) -> Delassus:
        """Return F with zeros in the rows and columns `selected` (q,), except for `diagonal` (q,) on the diagonal."""
        decoupled = self.scaled(np.where(mask_at(selected, len(self.d)), 0.0, 1.0))
        decoupled.d[selected] = diagonal
        return decoupled

    def rotated(self, Q: csr_array | None) -> Delassus:
        """Return ``Q F Q.T`` for a matrix Q (n, n) that only rotates components with the same value of d; F without Q."""
        if Q is None:
            return self
        if self.U is None:
            return Delassus(self.d, np.asarray(Q @ (Q @ self.S).T))
        return replace(self, U=csr_array(Q @ self.U))

    def submatrix(self, selected: Indices) -> Delassus:
        """Return the submatrix of the rows and columns `selected` (q,)."""
        if self.U is None:
            return Delassus(self.d[selected], self.S[np.ix_(selected, selected)])
        return Delassus(self.d[selected], self.S, self.U[selected])

    def in_accurate_form(self) -> Delassus:
        """Return F, with U only if the solutions of Newton steps are then accurate up to ROUND_OFF.

        Their relative error is about the machine epsilon times the square of the largest ratio of the diagonal of F to d.
        """
        if self.U is None:
            return self
        ratio = float((self.diagonal() / self.d).max(initial=0.0))
        if ratio**2 * np.finfo(float).eps <= ROUND_OFF:
            return self
        return Delassus(self.d, np.asarray(self.U @ (self.U @ self.S).T))

    @property
    def is_singular(self) -> bool:
        """Whether F is singular up to round-off, if it is scaled such that the compliance of each gap is one.

        With U, F can be singular only for forces in the range of the columns of ``diag(d)^-1 U`` with negative values in S.
        """
        if self.U is None:
            matrix = self.S + np.diag(self.d)
        else:
            N = scaled(self.U, 1.0 / self.d)[:, self.S.diagonal() < 0.0]
            size = np.sqrt(N.multiply(N).sum(axis=0))
            N = csr_array(N[:, size > 0.0] @ diags_array(1.0 / size[size > 0.0]))
            V = csr_array((self.U.T @ N).T)
            matrix = V @ (V @ self.S).T + N.T @ scaled(N, self.d)
        try:
            return bool(np.diag(np.linalg.cholesky(matrix)).min(initial=np.inf) ** 2 < LENGTH_ROUND_OFF)
        except np.linalg.LinAlgError:
            return True


def of_rows(loaded: Loaded, R: csr_array, factored: bool) -> tuple[Array, Delassus]:
    """Return the gaps and slips (n,) without contact forces, and their Delassus operator.

    `R` (n, n_unknowns) are their derivatives. If `factored`, U contains the nonempty columns of R, otherwise there is no U.
    """
    if not factored:
        check_rows(R.shape[0], MAX_ROWS_WITH_FRICTION)
        free, F = loaded.delassus(R)
        return free, Delassus(np.zeros(len(F)), F)
    involved = np.unique(R.indices)
    check_rows(len(involved), MAX_ROWS_WITH_FRICTION)
    identity = np.ones(len(involved)), (np.arange(len(involved)), involved)
    u, inverse = loaded.delassus(csr_array(identity, (len(involved), R.shape[1])))
    U = csr_array(R[:, involved])
    return U @ u, Delassus(np.zeros(U.shape[0]), inverse, U)


def with_compliance(F: Delassus, constraints: Constraints, rows: Indices, components: Indices) -> Delassus:
    """Return the sum of the Delassus operator F and the compliance of the constraints `rows` (q,).

    `components` (n,) are the positions, in arrays (1 + k, q), of the components that belong to F.
    """
    number, dim = components % len(rows), constraints.positions.shape[1]  # of the constraint of each component
    Z = np.concatenate(constraints.low_rank_compliance[:, rows])[components]
    if constraints.compliance is not None:
        # C couples force vectors. Their components along normals and tangents are coupled by the scalar products of these
        # directions, which vary from one constraint to the next.
        frame = constraints.compliance_axes[:, rows].reshape(-1, dim)[components]
    if F.U is not None:
        assert constraints.compliance is not None
        d, P, inverse_mass = constraints.compliance.split(rows)
        added = np.where(d > 0.0, 0.0, F.diagonal()[: len(rows)])  # and subtracted in the next term
        (rigid,) = np.nonzero(added[number])
        columns = [scaled(P[number], along_axis) for along_axis in frame.T]
        columns += [csr_array((np.ones(len(rigid)), (rigid, np.arange(len(rigid)))), (len(F.d), len(rigid)))]
        S = block_diag(F.S, *dim * [-inverse_mass], -np.diag(added[number[rigid]]), np.eye(Z.shape[1]))
        U = csc_array(hstack([F.U, *columns, csr_array(Z)], format="csc"))
        used = np.flatnonzero(np.diff(U.indptr))
        F = Delassus(F.d + (d + added)[number], S[np.ix_(used, used)], csr_array(U[:, used])).in_accurate_form()
        check_rows(len(F.d) if F.U is None else len(used), MAX_ROWS_WITH_FRICTION)
    else:
        if constraints.compliance is not None:
            F.S[:] += constraints.compliance.block(rows)[np.ix_(number, number)] * (frame @ frame.T)
        if Z.size:
            F.S[:] += Z @ Z.T
    return replace(F, d=F.d + np.append(constraints.softness[0, rows], np.zeros(len(F.d) - len(rows))))
