"""Waves in a ring of equal sectors, of which one is modelled (Thomas, Int. J. Numer. Meth. Engng 14, 1979).

A mode of d nodal diameters is a wave: the displacement of sector k is that of the first one, rotated k times and
multiplied by ``exp(2 pi i d k / N)``. Complex matrices A are represented by real ones of twice the size,
``[[Re A, -Im A], [Im A, Re A]]``, except for d = 0 and d = N / 2, where the phase factors are real.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np
from scipy.sparse import block_diag, bmat, bsr_array, csr_array, eye_array, vstack

from fastcontact._tools.records import record
from fastcontact.analysis.modal.held_contact import Conditions
from fastcontact.arrays import AnyArray, Array, Indices
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint
from fastcontact.errors import ModelError
from fastcontact.model.model import Model
from fastcontact.model.periodicity import PeriodicInterface, turned_rows
from fastcontact.round_off import LENGTH_ROUND_OFF


@record
class Sectors:
    """The sectors of a ring, or a single sector if the model has no cyclic symmetry.

    Attributes
    ----------
    number : int
        Number N of sectors in the ring; 1 without cyclic symmetry.
    turn : ndarray (dim, dim)
        Rotation of vectors from one sector to the next [-].
    periodic_interfaces : list of PeriodicInterface
        Ends of the modelled sector.
    centre : ndarray (dim,)
        A point of the axis [length].
    """

    number: int
    turn: Array
    periodic_interfaces: list[PeriodicInterface]
    centre: Array

    @classmethod
    def of(cls, model: Model) -> Sectors:
        """Return the sectors of a model. Raises ModelError if the axes or the numbers of sectors of symmetries differ."""
        periodic_interfaces = [interface for interface in model.periodic_interfaces if interface.relation is not None]
        if not periodic_interfaces:
            return cls(1, np.eye(model.mesh.dim), [], np.zeros(model.mesh.dim))
        first = periodic_interfaces[0]
        assert first.turn is not None
        for interface in periodic_interfaces:
            if interface.sectors != first.sectors or _sense(interface, first.turn) == 0:
                raise ModelError("nodal diameters need one axis and number of sectors: the cyclic symmetries differ")
        points = model.mesh.points
        offset = points[first.second].mean(axis=0) - first.turn @ points[first.first].mean(axis=0)
        centre = np.linalg.lstsq(np.eye(len(offset)) - first.turn, offset)[0]
        return cls(first.sectors, first.turn, periodic_interfaces, centre)

    def diameters(self, request: int | str | Sequence[int]) -> list[int]:
        """Return the requested nodal diameters, ascending; ModelError if the ring cannot have one of them."""
        highest = self.number // 2
        if isinstance(request, str):
            if request != "all":
                raise ModelError(f"nodal_diameters = '{request}': write \"all\", or whole numbers from 0 to {highest}")
            return list(range(highest + 1))
        diameters = sorted({request} if isinstance(request, int) else set(request))
        invalid = [d for d in diameters if not 0 <= d <= highest]
        if invalid or not diameters:
            raise ModelError(f"nodal_diameters = {request}: a ring of {self.number} sectors has 0 to {highest}")
        return diameters


def _sense(interface: PeriodicInterface, rotation: Array) -> int:
    """Return 1 if the rotation of an interface is `rotation` (dim, dim), -1 if it is the inverse, and 0 otherwise."""
    assert interface.turn is not None
    if np.allclose(interface.turn, rotation, atol=LENGTH_ROUND_OFF):
        return 1
    return -1 if np.allclose(interface.turn, rotation.T, atol=LENGTH_ROUND_OFF) else 0


@record
class Wave:
    """Motions with a given number of nodal diameters."""

    sectors: Sectors
    diameters: int

    @property
    def angle(self) -> float:
        """Phase angle from a sector to the next [radian]."""
        return 2.0 * np.pi * self.diameters / self.sectors.number

    @property
    def is_standing(self) -> bool:
        """Whether the wave is a standing wave. Other modes occur in pairs that are shifted by a quarter of a wave."""
        return 2 * self.diameters in (0, self.sectors.number)

    def phase(self, interface: PeriodicInterface) -> complex:
        """Return the phase factor from the first to the second end of an interface, in addition to the rotation [-]."""
        if self.is_standing:
            return 1.0 if self.diameters == 0 else -1.0
        return complex(np.exp(1j * _sense(interface, self.sectors.turn) * self.angle))

    def real_form(self, A: AnyArray) -> csr_array:
        """Return the real form of a sparse matrix (m, n), complex or not."""
        blocks = csr_array(A.real if self.is_standing else bmat([[A.real, -A.imag], [A.imag, A.real]], format="csr"))
        blocks.eliminate_zeros()
        return blocks

    def real_block_form(self, K: bsr_array) -> bsr_array:
        """Return the real form of a real block matrix (n, n), with the same block size."""
        if self.is_standing:
            return K
        return block_diag((K, K), format="csr").tobsr(K.blocksize)

    def repeated(self, values: AnyArray) -> AnyArray:
        """Return values (n, ...) of nodes or displacements, repeated for the imaginary part unless the wave is standing."""
        return values if self.is_standing else np.concatenate([values, values])

    def relations(self, model: Model, others: Sequence[MultiPointConstraint]) -> list[MultiPointConstraint]:
        """Return the constraints `others`, and those with phase factors between the ends of the sector, in the real form."""
        rows = [(constraint.name, constraint.rows) for constraint in others]
        for interface in self.sectors.periodic_interfaces:
            rows.append(("cyclic symmetry", turned_rows(interface, self.phase(interface), model.mesh)))
        return [MultiPointConstraint(name, self.real_form(of_constraint)) for name, of_constraint in rows]

    def ring_conditions(self, conditions: Conditions) -> Conditions:
        """Return contact conditions in the real form, one at each point of the ring.

        The test function of a condition at one end of a sector extends into the next sector, which is represented by the
        other end; at the axis it extends over all sectors.
        """
        P, main = self._combination_matrix(conditions)
        nodes, areas = conditions.nodes[main], self.repeated(conditions.areas[main])
        n_points = conditions.rows.shape[1] // self.sectors.turn.shape[0]
        compliance = None if conditions.compliance is None else self.real_form(P @ conditions.compliance @ P.conj().T)
        ring_nodes = nodes if self.is_standing else np.concatenate([nodes, nodes + n_points])
        return Conditions(self.real_form(P @ conditions.rows), ring_nodes, areas, compliance=compliance)

    def _combination_matrix(self, conditions: Conditions) -> tuple[csr_array, Indices]:
        """Return the matrix (k, q) that maps conditions to those of the ring, and the main condition (k,) of each."""
        nodes, identity = conditions.nodes, eye_array(len(conditions.nodes), dtype=complex, format="csr")
        rows, main_conditions, is_single = [], [], np.ones(len(nodes), bool)
        for interface in self.sectors.periodic_interfaces:
            on_interface = np.flatnonzero(np.isin(nodes, interface.first) | np.isin(nodes, interface.second))
            for a, b in zip(interface.first.tolist(), interface.second.tolist(), strict=True):
                first, second = (on_interface[nodes[on_interface] == node] for node in (a, b))
                if a == b and len(first):
                    members, block = first, self._combinations_at_axis(conditions, first)
                elif len(first) and len(second):
                    members = np.concatenate([first, second])
                    block = self._combinations_across(conditions, interface, first, second)
                else:
                    continue
                rows.append(csr_array(block) @ identity[members])
                main_conditions.append(first[: len(block)])
                is_single[members] = False
        single = np.flatnonzero(is_single)
        matrix = csr_array(vstack([identity[single], *rows], format="csr"))
        return matrix, np.concatenate([single, *main_conditions])

    def _combinations_across(
        self, conditions: Conditions, interface: PeriodicInterface, at_first: Indices, at_second: Indices
    ) -> AnyArray:
        """Return the combinations (k, k + l) of the k and l conditions at the first and second node of an interface."""
        assert interface.turn is not None
        areas = np.nan_to_num(conditions.areas[np.concatenate([at_first, at_second])], posinf=0.0)
        first, second = areas[: len(at_first)].max(), areas[len(at_first) :].max()
        weight = first / (first + second) if first + second > 0.0 else 0.5
        products = np.ones((len(at_first), len(at_second)))
        if conditions.directions is not None:
            products = conditions.directions[at_first] @ (conditions.directions[at_second] @ interface.turn).T
        return np.hstack([weight * np.eye(len(at_first)), (1.0 - weight) * np.conj(self.phase(interface)) * products])

    def _combinations_at_axis(self, conditions: Conditions, at_node: Indices) -> AnyArray:
        """Return the combinations (k, q) of the conditions of a node on the axis that do not cancel over the ring."""
        directions = None if conditions.directions is None else conditions.directions[at_node]
        total, rotation = np.zeros((len(at_node), len(at_node)), complex), np.eye(len(self.sectors.turn))
        for k in range(self.sectors.number):
            products = np.eye(len(at_node)) if directions is None else directions @ (directions @ rotation.T).T
            total += np.exp(1j * self.angle * k) * products / self.sectors.number
            rotation = self.sectors.turn @ rotation
        strength, vectors = np.linalg.eigh(0.5 * (total + total.conj().T))
        return np.asarray(vectors[:, strength > 0.5].conj().T)


def open_sector(model: Model, sectors: Sectors) -> Model:
    """Return a model without the constraints between the ends of its sector."""
    open_model = copy.copy(model)
    ends = [interface.relation for interface in sectors.periodic_interfaces]
    open_model.relations = [item for item in model.relations if not any(item is end for end in ends)]
    return open_model


def complex_eigenpairs(vectors: Array, K: bsr_array, M: bsr_array, n: int) -> tuple[Array, AnyArray]:
    """Return the n lowest eigenvalues (n,) and complex vectors (size, n) in the span of real forms (2 size, k).

    In the real form each pair appears twice, shifted by a quarter of a wave, or once if an iteration has missed its twin;
    both are the same complex vector. The pairs are computed by the Rayleigh-Ritz method. Vectors have unit modal mass, and
    their largest component is real and positive.
    """
    Z = _complex(vectors)
    small_K, small_M = (Z.conj().T @ _complex(matrix @ vectors) for matrix in (K, M))
    masses, basis = np.linalg.eigh(small_M)
    # Twins are linearly dependent, so that the mass of their difference is round-off.
    positive = masses > 1e-8 * masses.max()
    basis = basis[:, positive] / np.sqrt(masses[positive])
    values, eigenvectors = np.linalg.eigh(basis.conj().T @ small_K @ basis)
    shapes = Z @ (basis @ eigenvectors[:, :n])
    largest = shapes[np.abs(shapes).argmax(axis=0), np.arange(shapes.shape[1])]
    return values[:n], shapes * (np.abs(largest) / largest)


def _complex(vectors: Array) -> AnyArray:
    half = len(vectors) // 2
    return np.asarray(vectors[:half] + 1j * vectors[half:])
