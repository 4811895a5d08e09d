"""Write the steps of an analysis to one VTKHDF file, step by step, so that a crash costs no finished step.

The group /VTKHDF is what viewers read; /fastcontact holds what they have no place for. The order of writing
is the promise: data first, flush, then the step's rows with the number of steps last, flush. Uncompressed
tables grow in place and each step's fields are chunks of their own, so that nothing of a finished step moves.
Room on the disk is reserved before, because HDF5 loses the whole file when one of its writes fails.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.errors import ConvergenceError, FileError, ModelError
from fastcontact.io import _result_layout as layout
from fastcontact.io._commits import CommittedFile
from fastcontact.io._packing import packed
from fastcontact.io._result_header import BYTES, ROWS, as_json, growing_table, write_geometry, write_own
from fastcontact.io._resuming import taken_up
from fastcontact.io._step_checks import check_cell_fields, check_shapes, checked_fields
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
    resume : bool
        Whether to keep the steps of an existing file of this mesh and write after them. A file that is not there yet, or
        holds no complete step, is begun. The file is not touched before there is something to add.

    Attributes
    ----------
    path : pathlib.Path
        The file, absolute.
    n_steps : int
        Number of steps in the file.
    done : list of StepResult
        The steps that the file held when it was taken up, for ``solve(..., resume=out.done)``; none without `resume`.

    Raises
    ------
    FileError
        If the file cannot be written, exists and must not be replaced, is no result file, has another writer, or is
        to be resumed but belongs to another mesh.
    ModelError
        If `mesh` is neither a mesh nor a model.

    Examples
    --------
    >>> with ResultWriter("punch.vtkhdf", model) as out:  # doctest: +SKIP
    ...     fastcontact.solve(model, ramp=fastcontact.linear_ramp(20), on_step=out.write)
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
        resume: bool = False,
    ) -> None:
        if not isinstance(mesh, Mesh):
            if not isinstance(getattr(mesh, "mesh", None), Mesh) or not hasattr(mesh, "kinematics"):
                raise ModelError(f"results need a mesh or a model to stand on, not {type(mesh).__name__}")
            kinematics = mesh.kinematics
            case_text = case_text or getattr(mesh, "case_text", None) or ""
            mesh = mesh.mesh
        self.path = checked_target(path)
        self.n_steps = 0
        self.done: list[StepResult] = []
        self._cell_fields = checked_fields(cell_fields, mesh)
        self._mesh: Mesh = mesh
        self._pairs: dict[str, Any] = {}
        self._file: Any = None
        self._closed = self._ended = False
        self._new_case: str | None = None
        with self._explained("begun"):
            self._lock = PathLock(self.path)
            try:
                if resume:
                    self._take_up(str(kinematics), case_text)
                if not self.done:
                    _check_replaceable(self.path, overwrite or resume)
                    self._begin(str(kinematics), case_text)
            except BaseException:
                self._lock.release()
                raise

    def _take_up(self, kinematics: str, case_text: str) -> None:
        """Look whether the file holds steps to write after."""
        found = taken_up(self.path, self._mesh, kinematics, self._cell_fields)
        if found is not None:
            self.done, self._ended = found.steps, found.complete
            self.n_steps = len(self.done)
            self._new_case = case_text if case_text and case_text != found.case_text else None

    def __enter__(self) -> ResultWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
            return
        if self._file is None and not isinstance(error, ConvergenceError):
            self._give_up()  # nothing was added: whatever went wrong says nothing about the steps that are there
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
        if self._closed:
            raise FileError(f"'{self.path}' is closed: write steps before close, or inside the with block")
        check_shapes(self._mesh, step)
        check_cell_fields(self._mesh, step, self._cell_fields)
        with self._explained(f"written at step {step.index}"):
            self._open()
            self._check_in_place()
            restart = packed({"step": self.n_steps, "restart": step.restart})
            self._reserve(_step_size(self._mesh, step) + restart.nbytes)
            self._append_fields(step)
            self._append_tables(step)
            _set_start(self._file["fastcontact"][layout.restart_table(self.n_steps)], restart)
            self._file.flush()
            self._append_step_rows(step)
            self._file.flush()
            self._file["VTKHDF/Steps"].attrs.modify("NSteps", np.int64(self.n_steps + 1))
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
        if self._closed:
            return
        if self._file is None and self._ended and "error" not in run:
            self._give_up()  # a complete file stays as it is
            return
        text = as_json(run)
        try:
            with self._explained("closed"):
                self._open()
                try:
                    self._reserve(len(text))
                    self._append_run(np.frombuffer(text.encode("ascii"), np.uint8))
                finally:
                    try:
                        self._file.close()
                    finally:
                        self._below.close()
        finally:
            self._file = None
            self._give_up()

    def _give_up(self) -> None:
        self._closed = True
        self._lock.release()

    def _open(self) -> None:
        """Open a file that was taken up, once there is something to add to it."""
        import h5py

        if self._file is None:
            self._below = CommittedFile(self.path)
            self._file = h5py.File(self._below, "r+")
            self._pairs = {json.loads(pair["name"][()]): pair for pair in self._file["fastcontact/contact"].values()}

    def _check_in_place(self) -> None:
        """Refuse to go on writing to a file that nobody would find."""
        with contextlib.suppress(OSError):
            if os.path.samestat(os.fstat(self._below.fileno()), os.stat(self.path)):
                return
        raise FileError(
            f"'{self.path}' is no longer there: the file or its folder was removed, moved or replaced after "
            f"{self.n_steps} steps. Put it back and resume, or start again"
        )

    def _reserve(self, size: int) -> None:
        reserve(self._below.fileno(), self.path.parent, self._below.end, size + MARGIN)

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
        self._open()

    def _append_fields(self, step: StepResult) -> None:
        first = self.n_steps * self._mesh.n_points
        data = self._file["VTKHDF/PointData"]
        for name, values in layout.point_fields(self._mesh, step).items():
            data[name].resize(first + len(values), axis=0)
            data[name][first:] = values
        for name in self._cell_fields:
            field, values = self._file["VTKHDF/CellData"][name], step.cell_fields[name]
            field.resize((self.n_steps + 1) * len(values), axis=0)
            field[self.n_steps * len(values) :] = values

    def _append_tables(self, step: StepResult) -> None:
        own = self._file["fastcontact"]
        for name in step.contact:
            if name not in self._pairs:
                self._pairs[name] = _new_pair(own["contact"], name, self._mesh.dim)
        for name, pair in self._pairs.items():
            _append_contact(pair, self.n_steps, step.contact.get(name))
        notes: dict[str, Any] = {} if self._new_case is None else {"case": self._new_case}
        notes |= {
            "contact": [[name, contact.formulation] for name, contact in step.contact.items()],
            "iterations": step.iterations,
            "warnings": list(step.warnings),
        }
        text = np.frombuffer(as_json(notes).encode("ascii"), np.uint8)
        row = (step.index, step.load_factor, len(own["notes"]), len(text))
        _extend(own["notes"], text)
        _set_row(own["steps"], self.n_steps, np.array(row, layout.STEP_ROW))

    def _append_run(self, text: NDArray[np.uint8]) -> None:
        own = self._file["fastcontact"]
        row = np.array((self.n_steps, len(own["notes"]), len(text)), layout.RUN_ROW)
        _extend(own["notes"], text)
        self._file.flush()
        _set_row(own["runs"], len(own["runs"]), row)
        self._file.flush()

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


def _set_start(table: Any, values: NDArray[Any]) -> None:
    """Overwrite a table from its start; it never shrinks, because HDF5 would give the room to something else."""
    if len(table) < len(values):
        table.resize(len(values), axis=0)
    table[: len(values)] = values
