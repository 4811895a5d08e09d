"""Write the steps of an analysis to one VTKHDF file, step by step, so that a crash costs no finished step.

The group /VTKHDF is what viewers read; /fastcontact holds what they have no place for. The order of writing
is the promise: data first, flush, then the step's rows with the number of steps last, flush. Uncompressed
tables grow in place and each step's fields are chunks of their own, so that nothing of a finished step moves.
Room on the disk is reserved before, because HDF5 loses the whole file when one of its writes fails.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.errors import ConvergenceError, FileError, ModelError
from fastcontact.io import _result_layout as layout
from fastcontact.io._result_header import BYTES, ROWS, as_json, growing_table, write_geometry, write_own
from fastcontact.io._targets import PathLike, PathLock, checked_target, reserve
from fastcontact.mesh import Mesh
from fastcontact.results import ContactResult, StepResult

# Room for HDF5's own records [bytes].
MARGIN = 1 << 19


class ResultWriter:
    """A result file that takes one step after the other.

    The file is begun at once: whatever forbids it shows before any step is computed. From then on it can be
    opened at any time, by viewers too, and shows all steps so far, even after an exception or a crash.

    Parameters
    ----------
    path : path-like
        File to write; the suffix ``.vtkhdf`` is the one that viewers know.
    mesh : Mesh or model
        The mesh, or any object with `mesh` and `kinematics`, and maybe `case_text`, such as a ``Model``.
    kinematics : str
        Kinematics of a bare mesh; a model brings its own.
    case_text : str
        The case file, kept as it is.
    overwrite : bool
        Whether an existing result file may be replaced.
    cell_fields : iterable of str
        Names of the `StepResult.cell_fields` that every step brings; viewers show them, the XDMF sidecar does not.

    Attributes
    ----------
    path : pathlib.Path
        The file, absolute.
    n_steps : int
        Number of steps written.

    Raises
    ------
    FileError
        If the file cannot be written, exists and must not be replaced, is no result file, or has another
        writer.
    ModelError
        If `mesh` is neither a mesh nor a model.

    Examples
    --------
    >>> with ResultWriter("punch.vtkhdf", model) as out:  # doctest: +SKIP
    ...     fastcontact.analysis(model, ramp=fastcontact.linear_ramp(20), on_step=out.write)
    """

    def __init__(
        self,
        path: PathLike,
        mesh: Any,
        *,
        kinematics: str = "axisymmetric",
        case_text: str = "",
        overwrite: bool = True,
        cell_fields: Iterable[str] = (),
    ) -> None:
        if not isinstance(mesh, Mesh):
            if not isinstance(getattr(mesh, "mesh", None), Mesh) or not hasattr(mesh, "kinematics"):
                raise ModelError(f"results need a mesh or a model to stand on, not {type(mesh).__name__}")
            kinematics = mesh.kinematics
            case_text = case_text or getattr(mesh, "case_text", None) or ""
            mesh = mesh.mesh
        self.path = checked_target(path)
        self.n_steps = 0
        self._cell_fields = _checked_fields(cell_fields, mesh)
        self._mesh: Mesh = mesh
        self._pairs: dict[str, Any] = {}
        self._file: Any = None
        with self._explained("begun"):
            self._lock = PathLock(self.path)
            try:
                _check_replaceable(self.path, overwrite)
                self._begin(str(kinematics), case_text)
            except BaseException:
                self._lock.release()
                raise

    def __enter__(self) -> ResultWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
            return
        with contextlib.suppress(FileError):  # the first error is the one to tell
            run: dict[str, Any] = {"error": f"{type(error).__name__}: {error}"}
            if isinstance(error, ConvergenceError):
                run["log"] = {"failed_step": error.history}
            self._finish(run)

    def write(self, step: StepResult) -> None:
        """Append a step; when this returns the step is safe from a crash of the process.

        Raises
        ------
        FileError
            If the file is closed, the step does not fit the mesh, or the disk takes no more.
        """
        if self._file is None:
            raise FileError(f"'{self.path}' is closed: write steps before close, or inside the with block")
        _check_shapes(self._mesh, step)
        _check_cell_fields(self._mesh, step, self._cell_fields)
        with self._explained(f"written at step {step.index}"):
            self._reserve(_step_size(self._mesh, step))
            self._append_fields(step)
            self._append_tables(step)
            self._file.flush()
            self._append_step_rows(step)
            self._file.flush()
        self.n_steps += 1

    def close(self, log: Any = None, warnings: Iterable[str] = ()) -> None:
        """Finish the file; a second call does nothing.

        Parameters
        ----------
        log : str, list or dict, optional
            Log of the whole run: whatever JSON can hold.
        warnings : iterable of str
            Warnings of the run that belong to no step.

        Raises
        ------
        FileError
            If the disk takes no more.
        """
        self._finish({"log": log, "warnings": [str(warning) for warning in warnings]})

    def _finish(self, run: dict[str, Any]) -> None:
        if self._file is None:
            return
        text = as_json(run)
        try:
            with self._explained("closed"):
                try:
                    self._reserve(len(text))
                    self._file["fastcontact"].create_dataset("run", data=text)
                    self._file.flush()
                finally:
                    _close_trimmed(self._file)
        finally:
            self._file = None
            self._lock.release()

    def _reserve(self, size: int) -> None:
        start, descriptor = self._file.id.get_filesize(), self._file.id.get_vfd_handle()
        reserve(descriptor, self.path.parent, start, size + MARGIN)

    @contextlib.contextmanager
    def _explained(self, what: str) -> Iterator[None]:
        """Turn what HDF5 or the system says into one sentence with a remedy."""
        try:
            yield
        except (OSError, RuntimeError) as error:
            reason = getattr(error, "strerror", None) or next(iter(str(error).splitlines()), type(error).__name__)
            raise FileError(
                f"'{self.path}' cannot be {what} ({reason}), {self.n_steps} steps are complete: "
                "see whether the disk is full or the folder protected"
            ) from error

    def _begin(self, kinematics: str, case_text: str) -> None:
        """Write all but the steps under another name, then put it in the place of the old file."""
        import h5py

        temporary = self.path.with_name(f".{self.path.name}.tmp")
        try:
            with open(temporary, "wb") as probe:
                size = _header_size(self._mesh) + len(case_text) + MARGIN
                reserve(probe.fileno(), temporary.parent, 0, size)
            with h5py.File(temporary, "w", locking=False) as file:
                write_geometry(file, self._mesh, self._cell_fields)
                write_own(file, self._mesh, kinematics, case_text)
            os.replace(temporary, self.path)
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink()
        # Closed in between because Windows renames no open file; without locks viewers may follow.
        self._file = h5py.File(self.path, "r+", locking=False)

    def _append_fields(self, step: StepResult) -> None:
        first = self.n_steps * self._mesh.n_points
        data = self._file["VTKHDF/PointData"]
        for name, values in layout.point_fields(self._mesh, step).items():
            data[name].resize(first + len(values), axis=0)
            data[name][first:] = values
        for name in self._cell_fields:
            _extend(self._file["VTKHDF/CellData"][name], step.cell_fields[name])

    def _append_tables(self, step: StepResult) -> None:
        own = self._file["fastcontact"]
        for name in step.contact:
            if name not in self._pairs:
                self._pairs[name] = _new_pair(own["contact"], name, self._mesh.dim)
        for name, pair in self._pairs.items():
            _append_contact(pair, self.n_steps, step.contact.get(name))
        notes = {
            "contact": [[name, contact.formulation] for name, contact in step.contact.items()],
            "iterations": step.iterations,
            "warnings": list(step.warnings),
        }
        text = np.frombuffer(as_json(notes).encode("ascii"), np.uint8)
        row = (step.index, step.load_factor, len(own["notes"]), len(text))
        _extend(own["notes"], text)
        _set_row(own["steps"], self.n_steps, np.array(row, layout.STEP_ROW))

    def _append_step_rows(self, step: StepResult) -> None:
        steps = self._file["VTKHDF/Steps"]
        _set_row(steps["Values"], self.n_steps, step.load_factor)
        _set_row(steps["NumberOfParts"], self.n_steps, 1)
        _set_row(steps["PartOffsets"], self.n_steps, 0)
        _set_row(steps["CellOffsets"], self.n_steps, 0)
        _set_row(steps["PointDataOffsets/displacement"], self.n_steps, self.n_steps * self._mesh.n_points)
        for name in self._cell_fields:
            first = self.n_steps * len(self._file["VTKHDF/Types"])
            _set_row(steps["CellDataOffsets"][name], self.n_steps, first)
        steps.attrs.modify("NSteps", np.int64(self.n_steps + 1))


def _check_replaceable(path: Any, overwrite: bool) -> None:
    """Refuse to replace a file on request, or when it is plainly something else than a result."""
    import h5py

    if not path.exists() or not path.stat().st_size:
        return
    if not overwrite:
        raise FileError(f"'{path}' exists already: name another file or allow it to be overwritten")
    is_result = h5py.is_hdf5(path)
    if is_result:
        with contextlib.suppress(OSError), h5py.File(path, "r", locking=False) as file:
            is_result = "VTKHDF" in file
    if not is_result:
        raise FileError(f"'{path}' exists and is no result file: name another file or remove it first")


def _header_size(mesh: Mesh) -> int:
    """Return an upper bound for what a file without steps takes [bytes]."""
    n_groups = len(mesh.cell_groups) + len(mesh.point_groups)
    arrays: list[NDArray[Any]] = [mesh.points]
    for named in (mesh.cells, mesh.cell_groups, mesh.point_groups):
        arrays.extend(named.values())
    return 6 * sum(array.nbytes for array in arrays) + n_groups * (mesh.n_cells + mesh.n_points + BYTES)


def _step_size(mesh: Mesh, step: StepResult) -> int:
    """Return an upper bound for what a step takes in the file [bytes]."""
    fields = 8 * sum(layout.POINT_FIELDS.values()) * mesh.n_points
    row = layout.contact_row(mesh.dim).itemsize
    fields += 8 * sum(map(np.size, step.cell_fields.values()))
    contact = sum((len(pair.points) + 2 * ROWS) * row + BYTES for pair in step.contact.values())
    return int(1.01 * fields) + contact + len(as_json([step.iterations, step.warnings]))


def _check_shapes(mesh: Mesh, step: StepResult) -> None:
    n, dim = mesh.n_points, mesh.dim
    vector, scalar = (n, dim), (n,)
    expected = {
        "displacement": vector,
        "reaction": vector,
        "stress": (n, 4 if dim == 2 else 6),
        "von_mises": scalar,
        "von_mises_signed": scalar,
    }
    for name, shape in expected.items():
        found = np.shape(getattr(step, name))
        if found != shape:
            raise FileError(f"step {step.index}: {name} has shape {found}, but the mesh of the file needs {shape}")
    for name, contact in step.contact.items():
        _check_contact(f"step {step.index}, contact '{name}'", contact, mesh)


def _checked_fields(names: Iterable[str], mesh: Mesh) -> tuple[str, ...]:
    """Return names of cell fields that neither stand in a file already nor cannot be written."""
    found = tuple(names)
    for name in found:
        if name in layout.cell_fields(mesh) or not name.isidentifier():
            raise FileError(
                f"'{name}' cannot be the name of a cell field: it is taken or no plain word; choose another"
            )
    return found


def _check_cell_fields(mesh: Mesh, step: StepResult, names: Iterable[str]) -> None:
    count = sum(map(len, mesh.solids.values()))
    for name in names:
        found = np.shape(step.cell_fields.get(name, ()))
        if found != (count,):
            raise FileError(
                f"step {step.index}: the cell field '{name}' that was announced has shape {found}, but ({count},) is "
                "needed, a number for each solid cell"
            )


def _check_contact(where: str, contact: ContactResult, mesh: Mesh) -> None:
    row = layout.contact_row(mesh.dim)
    for name in row.names or ():
        found, shape = np.shape(getattr(contact, name)), (len(contact.points), *row[name].shape)
        if found != shape:
            raise FileError(f"{where}: {name} has shape {found}, but {shape} is needed")
    outside = np.asarray(contact.points)[(contact.points < 0) | (contact.points >= mesh.n_points)]
    if len(outside):
        raise FileError(f"{where}: point {outside[0]} is not in the mesh of {mesh.n_points} points")


def _new_pair(parent: Any, name: str, dim: int) -> Any:
    pair = parent.create_group(str(len(parent)))
    pair["name"] = as_json(name)
    growing_table(pair, "rows", layout.contact_row(dim))
    growing_table(pair, "steps", layout.contact_step(dim))
    return pair


def _append_contact(pair: Any, number: int, contact: ContactResult | None) -> None:
    """Append a pair's state; a step without it gets a row of zeros."""
    row = np.zeros((), pair["steps"].dtype)
    if contact is not None:
        table = np.zeros(len(contact.points), pair["rows"].dtype)
        for name in table.dtype.names or ():
            table[name] = getattr(contact, name)
        row["first"], row["count"] = len(pair["rows"]), len(table)
        row["force"], row["radius"] = contact.force, contact.radius
        row["dissipation"] = contact.dissipation
        row["obstacle_displacement"] = (
            np.nan if contact.obstacle_displacement is None else contact.obstacle_displacement
        )
        _extend(pair["rows"], table)
    _set_row(pair["steps"], number, row)


def _extend(table: Any, values: NDArray[Any]) -> None:
    first = len(table)
    table.resize(first + len(values), axis=0)
    table[first:] = values


def _set_row(table: Any, number: int, value: Any) -> None:
    table.resize(number + 1, axis=0)
    table[number] = value


def _close_trimmed(file: Any) -> None:
    """Close an HDF5 file, cut what was reserved in vain, and see it to the disk, against a power failure."""
    size, descriptor = file.id.get_filesize(), os.dup(file.id.get_vfd_handle())
    try:
        file.close()
        os.ftruncate(descriptor, size)
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
