"""Result of `fastcontact.modes`: frequencies and shapes, of the model and of the whole ring that a sector represents."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact._tools.html_table import html_table
from fastcontact.analysis.criteria import NOTABLE
from fastcontact.analysis.modal.cyclic import Sectors
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.elasticity import recovery
from fastcontact.elasticity.material_axes import rotated_stress
from fastcontact.elasticity.material_field import MaterialField
from fastcontact.elasticity.stiffness import rigid_modes
from fastcontact.errors import ModelError
from fastcontact.mesh.generate import union
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import rigid_parts
from fastcontact.model.model import Model
from fastcontact.results.step import StepResult, StepSequence, phases
from fastcontact.results.tables import data_frame
from fastcontact.round_off import ROUND_OFF, SINGLE_PRECISION

if TYPE_CHECKING:
    import pandas


class Shapes(StepSequence):
    """A sequence of mode shapes, each as a step: displacement, its stress, and the frequency as load factor."""

    @typed(ModelError)
    def phases(self, number: int, count: int = 24) -> list[StepResult]:
        """Return one period of a vibration as `count` steps, for `fastcontact.plot.animate` and result files.

        Parameters
        ----------
        number : int
            Number of the mode, from 0.
        count : int
            Number of steps; their load factors are the phases, from 0 to 1.

        Returns
        -------
        list of StepResult
        """
        return phases(self[number], count)


def _mode_step(number: int, frequency: float, u: Array, stress: Array, model: Model) -> StepResult:
    equivalent = recovery.von_mises(stress)
    signed = recovery.von_mises_signed(stress, equivalent)
    lengths = {key: name for key, name in model.units.items() if key == "length"}  # shapes have no scale
    return StepResult(
        number + 1, float(frequency), u, stress, equivalent, signed, np.zeros_like(u),
        iterations={"parameter": "frequency"}, units=lengths,
    )  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Modes(Shapes):
    """Modes of a model: a sequence of mode shapes as `StepResult`, for pictures and files, that prints as a table.

    Attributes
    ----------
    frequencies : ndarray (n,)
        Natural frequencies, ascending for each number of nodal diameters [1 / time]; about zero for rigid-body modes,
        negative for modes with a negative eigenvalue, see `unstable`.
    eigenvalues : ndarray (n,)
        Squares of the angular frequencies [1 / time^2].
    shapes : ndarray (n, n_points, dim)
        Mode shapes of unit modal mass, ``shape . M shape = 1``; with nodal diameters, M is that of the whole ring [1 /
        mass^(1/2)].
    participation : ndarray (n, dim)
        Participation factors ``shape . M e`` along each axis e [mass^(1/2)].
    mass : ndarray (dim,)
        Mass that can move along each axis [mass]; in axisymmetry zero along the radius.
    nodal_diameters : ndarray of int (n,), optional
        Number of nodal diameters of each mode; None if none were requested.
    twins : ndarray of int (n,), optional
        Number of the mode of equal frequency that is shifted by a quarter of a wave; the number of the mode itself if
        its frequency is simple.

    Examples
    --------
    The first three modes of a free steel plate in mm, tonnes and seconds are rigid motions:

    >>> import fastcontact as fc
    >>> model = fc.Model(fc.generate.block((100.0, 10.0), (20, 2), "quad8"), kinematics="plane_stress")
    >>> model.add_material(fc.LinearElastic(E=210_000.0, nu=0.3, density=7.85e-9))
    >>> modes = fc.modes(model, n=4)
    >>> modes.frequencies[3].round(0)
    np.float64(5139.0)
    """

    frequencies: Array
    eigenvalues: Array
    shapes: Array
    participation: Array
    mass: Array
    _model: Model = field(repr=False)
    _field: MaterialField = field(repr=False)
    nodal_diameters: Indices | None = None
    twins: Indices | None = None
    _sectors: Sectors | None = field(default=None, repr=False)

    @property
    def effective_mass(self) -> Array:
        """Effective modal masses (n, dim) [mass], the squares of the participation factors, whose sum is the total mass."""
        return np.asarray(self.participation**2)

    @cached_property
    def unstable(self) -> Mask:
        """Whether each mode (n,) is unstable: it deforms a body, and its eigenvalue is negative."""
        return (self.eigenvalues < 0.0) & ~self._rigid

    @property
    def _rigid(self) -> Mask:
        """Whether each mode (n,) moves the bodies like rigid bodies."""
        parts, rigid = rigid_parts(self._model.mesh), np.ones(len(self), bool)
        size = np.linalg.norm(self.shapes, axis=(1, 2))
        for nodes in map(parts.nodes_of, range(parts.count)):
            basis = np.linalg.qr(rigid_modes(self._model.mesh.points[nodes], self._model.kinematics))[0]
            u = self.shapes[:, nodes].reshape(len(self), -1).T
            rigid &= np.linalg.norm(u - basis @ (basis.T @ u), axis=0) < NOTABLE * size
        return rigid

    def remarks(self) -> list[str]:
        """Return sentences on modes with negative eigenvalues, without full stops."""
        negative = self.eigenvalues < -SINGLE_PRECISION * np.abs(self.eigenvalues).max()
        unstable, turning = int(self.unstable.sum()), int((negative & ~self.unstable).sum())
        remarks = []
        if unstable:
            remarks.append(
                f"{unstable} of {len(self)} modes are unstable: omega^2 < 0, and the imaginary frequency is given as a "
                "negative one"
            )
        if turning:
            remarks.append(
                f"{turning} of {len(self)} modes with omega^2 < 0 are rotations of rigid bodies that loads of constant "
                "direction overturn"
            )
        return remarks

    def __len__(self) -> int:
        return len(self.frequencies)

    def _step(self, number: int) -> StepResult:
        model, field, u = self._model, self._field, self.shapes[number]
        arguments = field.moduli, field.moduli_rows, u, field.treatment
        stress = recovery.nodal_stress(model.mesh, model.kinematics, *arguments)
        return _mode_step(number, self.frequencies[number], u.copy(), stress, model)

    def whole_ring(self) -> RingModes:
        """Return the same modes on the mesh of the whole ring; ModelError if no nodal diameters were requested."""
        if self._sectors is None:
            raise ModelError("shapes of the whole ring need modes with nodal_diameters of a model with cyclic symmetry")
        return RingModes(self, self._sectors)

    def __repr__(self) -> str:
        rows = [self._columns, *self._rows()]
        widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
        lines = ["  ".join(text.rjust(width) for text, width in zip(row, widths)) for row in rows]
        return "\n".join(lines + self.remarks())

    def _repr_html_(self) -> str:
        remarks = "".join(f"<p>{escape(remark)}</p>" for remark in self.remarks())
        return html_table(self._rows(), self._columns, "Modes") + remarks

    @property
    def _columns(self) -> tuple[str, ...]:
        ring_columns = () if self.nodal_diameters is None else ("nodal diameters", "twin")
        masses = (f"effective mass {axis}" for axis in "xyz"[: len(self.mass)])
        return ("mode", *ring_columns, "frequency", *masses)

    def _rows(self) -> list[tuple[str, ...]]:
        rows, masses_shown = [], np.where(self.effective_mass > ROUND_OFF * self.mass, self.effective_mass, 0.0)
        for k, (f, masses) in enumerate(zip(self.frequencies, masses_shown)):
            ring_columns: tuple[str, ...] = ()
            if self.nodal_diameters is not None and self.twins is not None:
                twin = "" if self.twins[k] == k else str(self.twins[k] + 1)
                ring_columns = (str(self.nodal_diameters[k]), twin)
            rows.append((str(k + 1), *ring_columns, *(f"{value:.6g}" for value in (f, *masses))))
        return rows

    def to_pandas(self) -> pandas.DataFrame:
        """Return the table as a ``pandas.DataFrame``; FileError if pandas is not installed."""
        integer_columns = [np.arange(1, len(self) + 1)]
        if self.nodal_diameters is not None and self.twins is not None:
            integer_columns += [self.nodal_diameters, self.twins + 1]
        data = np.column_stack([*integer_columns, self.frequencies, self.effective_mass])
        return data_frame(data, {}, self._columns).astype(dict.fromkeys(self._columns[: len(integer_columns)], int))


@dataclass(frozen=True, eq=False)
class RingModes(Shapes):
    """Modes on the mesh of a whole ring: a sequence of steps, which ``ResultWriter(path, ring)`` takes as a model.

    Attributes
    ----------
    modes : Modes
        Modes of the sector.
    mesh : Mesh
        All sectors, the modelled one first; their ends are not merged.
    kinematics : str

    Examples
    --------
    See `Modes.whole_ring`.

    >>> import fastcontact as fc
    >>> ring = fc.modes(sector, n=4, nodal_diameters=[2]).whole_ring()  # doctest: +SKIP
    """

    modes: Modes
    _sectors: Sectors = field(repr=False)

    def __len__(self) -> int:
        return len(self.modes)

    @property
    def kinematics(self) -> str:
        """Kinematics of the model."""
        return self.modes._model.kinematics

    @cached_property
    def _rotations(self) -> list[Array]:
        return [np.linalg.matrix_power(self._sectors.turn, k) for k in range(self._sectors.number)]

    @cached_property
    def mesh(self) -> Mesh:
        """Mesh of all sectors, see `RingModes`."""
        sector, centre = self.modes._model.mesh, self._sectors.centre
        return union(*(sector.replace(points=(sector.points - centre) @ R.T + centre) for R in self._rotations))

    def _step(self, number: int) -> StepResult:
        modes = self.modes
        assert modes.nodal_diameters is not None
        assert modes.twins is not None
        twin, d = int(modes.twins[number]), int(modes.nodal_diameters[number])
        mode, twin_mode = modes[number], modes[twin]
        sign = float(np.sign(twin - number))  # the second mode of a pair is the imaginary part
        u, stress = [], []
        for k, rotation in enumerate(self._rotations):
            angle = 2.0 * math.pi * d * k / self._sectors.number
            real, imaginary = math.cos(angle), -sign * math.sin(angle)
            u.append((real * mode.displacement + imaginary * twin_mode.displacement) @ rotation.T)
            stress.append(rotated_stress(real * mode.stress + imaginary * twin_mode.stress, rotation))
        return _mode_step(number, modes.frequencies[number], np.concatenate(u), np.concatenate(stress), modes._model)
