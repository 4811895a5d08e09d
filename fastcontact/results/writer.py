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

from fastcontact.errors import ConvergenceError, FileError, ModelError
from fastcontact.mesh.files.targets import PathLike, PathLock, checked_target, left_at, reserve
from fastcontact.mesh.mesh import Mesh
from fastcontact.results import _appending as appending
from fastcontact.results._commits import CommittedFile
from fastcontact.results._header import as_json, write_geometry, write_own
from fastcontact.results._packing import packed
from fastcontact.results._resuming import taken_up
from fastcontact.results._step_checks import check_cell_fields, check_shapes, checked_fields
from fastcontact.results._uninterrupted import uninterrupted
from fastcontact.results.step import StepResult

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
        self._below: Any = None
        self._closed = self._ended = False
        self._new_case: str | None = None
        self._left: tuple[int, ...] | None = None
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
        left = left_at(self.path)
        found = taken_up(self.path, self._mesh, kinematics, self._cell_fields)
        if found is not None:
            self.done, self._ended, self._left = found.steps, found.complete, left
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
            self._reserve(appending.step_size(self._mesh, step) + restart.nbytes)
            appending.append_fields(self._file, self._mesh, self.n_steps, step, self._cell_fields)
            notes = {} if self._new_case is None else {"case": self._new_case}
            appending.append_tables(self._file, self._mesh, self.n_steps, step, self._pairs, notes)
            appending.set_restart(self._file, self.n_steps, restart)
            self._flush()
            self._append_step_rows(step)
            self._flush()
            self._file["VTKHDF/Steps"].attrs.modify("NSteps", np.int64(self.n_steps + 1))
            self._flush()
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
        try:
            with self._explained("closed"):
                self._open()
                try:
                    self._check_ours()
                    if self._below.writable:
                        self._reserve(len(as_json(run)))
                        appending.append_run(self._file, self.n_steps, run, self._flush)
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
            if self._left is not None and self._left != left_at(self.path):
                raise FileError(self._gone())
            self._below = CommittedFile(self.path)
            try:
                self._file = h5py.File(self._below, "r+")
            except BaseException:
                self._below.close()
                raise
            self._pairs = {json.loads(pair["name"][()]): pair for pair in self._file["fastcontact/contact"].values()}

    def _check_in_place(self) -> None:
        """Refuse to go on writing to a file that nobody would find, or that cannot be written any more."""
        self._below.check()
        self._check_ours()
        with contextlib.suppress(OSError):
            if os.path.samestat(os.fstat(self._below.fileno()), os.stat(self.path)):
                return
        raise FileError(self._gone())

    def _check_ours(self) -> None:
        """Refuse to write into what another program has written."""
        if not self._below.intact():
            raise FileError(
                f"'{self.path}' was changed by another program after {self.n_steps} steps, what it holds now is left "
                "alone: let no other program write to it, name another file and start again"
            )

    def _gone(self) -> str:
        return (
            f"'{self.path}' is no longer there: the file or its folder was removed, moved or replaced after "
            f"{self.n_steps} steps. Put it back and resume, or start again"
        )

    def _flush(self) -> None:
        self._file.flush()
        self._below.check()

    def _reserve(self, size: int) -> None:
        reserve(self._below.fileno(), self.path.parent, self._below.end, size + MARGIN)

    @contextlib.contextmanager
    def _explained(self, what: str) -> Iterator[None]:
        """Turn what HDF5 or the system says into one sentence with a remedy; meanwhile signals wait."""
        with uninterrupted():
            try:
                yield
            except (OSError, RuntimeError, LookupError, ValueError) as error:  # HDF5 has many words for a failed read
                failure = self._below.failure if self._below is not None else None
                if failure is None and not isinstance(error, (OSError, RuntimeError)):
                    raise
                told = failure or error
                if not isinstance(told, Exception):
                    raise told from None
                reason = getattr(told, "strerror", None) or next(iter(str(told).splitlines()), type(told).__name__)
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
                size = appending.header_size(self._mesh) + len(case_text) + MARGIN
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

    def _append_step_rows(self, step: StepResult) -> None:
        """Write the rows that make the step one that viewers see, all but the number of steps."""
        appending.append_rows(self._file, self._mesh, self.n_steps, step, self._cell_fields)


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
            # Not `in`, which follows links, also to other files.
            is_result = isinstance(file.get("VTKHDF", getlink=True), h5py.HardLink)
    if not is_result:
        raise FileError(f"'{path}' exists and is no result file: name another file or remove it first")
