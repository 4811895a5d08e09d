"""Writing of result files, in which a crash does not damage completed steps.

Each step is flushed once. `CommittedFile` writes the number of steps last, and nothing beyond it is read. Data of completed
steps are never moved: uncompressed tables and small fields grow in place, and larger fields have a
separate chunk for each step. If the disk is full, the new blocks cannot be written. Since no other data refer to them
yet, the file remains as it was.
"""

from __future__ import annotations

import contextlib
import copy
import json
import os
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact._tools.hdf5 import new_hdf5
from fastcontact._tools.packing import pack
from fastcontact._tools.paths import PathLike, checked_target, replacing
from fastcontact.elasticity.material_sides import material_sides
from fastcontact.errors import ConvergenceError, FastcontactError, FileError, ModelError
from fastcontact.mesh.mesh import Mesh
from fastcontact.results import layout, write_arrays
from fastcontact.results.committed_file import CommittedFile, uninterrupted
from fastcontact.results.file_lock import PathLock, file_state
from fastcontact.results.reader import Results, StoredSteps, read_text
from fastcontact.results.step import StepResult

# Age of a file [s] from which each step is synchronised to the disk. A run that is lost earlier can be repeated in less
# time than this.
SYNCHRONISED_FROM = 10.0
# Size of HDF5's metadata cache, measured in the file [bytes].
METADATA_CACHE = 1 << 18
# Suffixes of other formats, in which results cannot be written.
OTHER_FORMATS = {".vtu", ".vtk", ".pvd", ".med", ".rmed", ".xdmf"}


@typed(FileError)
class ResultWriter:
    """A result file to which steps are appended.

    The constructor creates the file, so that an invalid path is reported before any step is computed. From then on, viewers
    and other programs can open the file at any time. It contains all steps that have been written, even after an exception or
    a crash. Several threads may share a writer.

    Parameters
    ----------
    path : path-like
        File to write; viewers recognise the suffix ``.vtkhdf``.
    mesh : Mesh or model
        A mesh or a ``Model``. Any object with the attributes `mesh` and `kinematics`, and optionally `case_text`, can
        replace the model.
    kinematics : str
        Kinematics if `mesh` is a mesh; otherwise those of the model are used.
    case_text : str
        Text of the case file, which the result file stores.
    overwrite : bool
        Whether an existing result file may be replaced.
    cell_fields : iterable of str
        Names of further `StepResult.cell_fields` that every step contains, in addition to those of the model. Viewers show
        these fields if they read the VTKHDF file, not if they read its XDMF sidecar.
    resume : bool
        Whether to keep the steps of an existing file with the same mesh and to append further steps. If the file does not
        exist or contains no complete step, it is created. An existing file is not changed before a step is added.
    synchronise : bool, optional
        Whether `write` waits until the step is on the disk, so that the step survives a power loss. By default, `write`
        waits only if the file was opened more than ten seconds ago, so that short runs are not slowed down. Steps survive
        a crash of the process in any case.
    background : bool
        Whether a step is written while the next one is computed. A step is then complete when the next call of `write`,
        `wait` or `close` returns; this call also raises the errors of the previous one. `n_steps` counts complete steps.
        The writer copies the step, so that the arrays of the caller may change.

    Attributes
    ----------
    path : pathlib.Path
        Absolute path of the file.
    n_steps : int
        Number of steps in the file.
    done : sequence of StepResult
        With `resume` the steps of the existing file, which are read on access, for ``solve(..., resume=out.done)``;
        otherwise empty.

    Raises
    ------
    FileError
        If the file cannot be written, or another writer is writing to it; if it exists, but may not be replaced or is not
        a result file; or if it is to be resumed, but belongs to another mesh.
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
        synchronise: bool | None = None,
        background: bool = False,
    ) -> None:
        self._material: Any = None
        self._point_fields, self._units = getattr(mesh, "point_fields", ()), dict(getattr(mesh, "units", {}))
        cell_fields = dict.fromkeys((*getattr(mesh, "cell_fields", ()), *cell_fields))
        if not isinstance(mesh, Mesh):
            if not isinstance(getattr(mesh, "mesh", None), Mesh) or not hasattr(mesh, "kinematics"):
                raise ModelError(f"a result file needs a mesh or a model, not {type(mesh).__name__}")
            kinematics, self._material = mesh.kinematics, _materials_at_interfaces(mesh)
            case_text = case_text or getattr(mesh, "case_text", None) or ""
            mesh = mesh.mesh
        self.path = checked_target(path)
        if self.path.suffix.lower() in OTHER_FORMATS and not self.path.exists():
            raise FileError(
                f"'{path}': results are written in the format VTKHDF: name it {self.path.stem}.vtkhdf (ParaView opens it); "
                "'fastcontact export' makes a MED or XDMF file from it"
            )
        self.n_steps = 0
        self.done: Sequence[StepResult] = []
        self._synchronise, self._started = synchronise, time.monotonic()
        self._cell_fields = _checked_names(cell_fields, mesh)
        self._mesh: Mesh = mesh
        self._pairs: dict[str, dict[str, Any]] = {}
        self._file: Any = None
        self._committed: Any = None
        self._closed = self._ended = False
        self._background = ThreadPoolExecutor(1, "fastcontact-writer") if background else None
        self._writing: Future[None] | None = None
        self._access = threading.RLock()
        self._last: tuple[int, Any] = (0, None)  # index and case of the last step
        self._notes: dict[str, str] = {}  # the text of the case file, if it differs from that of the resumed run
        self._resumed_state: tuple[int, ...] | None = None
        with self._as_file_errors("opened for writing"):
            self._lock = PathLock(self.path)
            try:
                if resume:
                    state = file_state(self.path)
                    self.done, self._ended, text = _steps_to_resume(self.path, mesh, str(kinematics), self._cell_fields)
                if self.done:
                    self._resumed_state, self.n_steps = state, len(self.done)
                    self._last = self.done[-1].index, _case_fingerprint(self.done[-1])
                    self._notes = {"case": case_text} if case_text not in ("", text) else {}
                else:
                    _check_replaceable(self.path, overwrite or resume)
                    self._begin(str(kinematics), case_text)
            except BaseException:
                self._lock.release()
                raise

    def __enter__(self) -> ResultWriter:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is None:
            self.close()
            return
        try:
            self.wait()
        except FileError as failure:
            error.add_note(str(failure))
        if self._file is None and not isinstance(error, ConvergenceError):
            self._abandon()  # no step was added, and the error does not concern the existing steps
            return
        with contextlib.suppress(FileError):  # only the first error is raised
            run: dict[str, Any] = {"error": f"{type(error).__name__}: {error}"}
            if isinstance(error, ConvergenceError):
                run["log"] = {"failed_step": error.history}
            self._finish(run)

    def write(self, step: StepResult) -> None:
        """Append a step.

        When this method returns, the step survives a crash of the process, unless the writer works in the background.

        Parameters
        ----------
        step : StepResult
            The step after the last one of the file.

        Raises
        ------
        FileError
            If the file is closed; if the step does not follow the previous one, belongs to another case or does not fit
            the mesh; or if the disk is full or fails.
        """
        with self._access:
            self.wait()
            if self._closed:
                raise FileError(f"'{self.path}' is closed: write steps before close, or inside the with block")
            layout.check_step(self._mesh, step, self._cell_fields)
            self._check_next(step)
            self._release_done()
            if self._background is None:
                self._append(step)
            else:
                self._writing = self._background.submit(self._append, copy.deepcopy(step))

    def wait(self) -> None:
        """Wait until all steps given to `write` are complete.

        Raises
        ------
        FileError
            If the disk was full or failed.
        """
        if self._background is not None:
            with self._access, uninterrupted():
                writing, self._writing = self._writing, None
                if writing is not None:
                    writing.result()

    def _append(self, step: StepResult) -> None:
        with self._as_file_errors(f"written at step {step.index}"):
            self._open()
            self._check_in_place()
            by_default = time.monotonic() - self._started > SYNCHRONISED_FROM
            self._committed.synchronised = by_default if self._synchronise is None else self._synchronise
            restart = pack({"step": self.n_steps, "restart": step.restart})
            write_arrays.append_fields(self._objects, self._mesh, self.n_steps, step, self._cell_fields)
            write_arrays.append_tables(self._objects, self._mesh, self.n_steps, step, self._pairs, self._notes)
            write_arrays.set_restart(self._objects, self.n_steps, restart)
            write_arrays.append_offsets(self._objects, self._mesh, self.n_steps, step, self._cell_fields)
            self._objects["VTKHDF/Steps"].attrs.modify("NSteps", np.int64(self.n_steps + 1))
            self._flush()
            self.n_steps += 1
            self._last = step.index, _case_fingerprint(step)

    def _check_next(self, step: StepResult) -> None:
        """Raise FileError unless the step follows the last one and was computed for the same case."""
        index, case = self._last
        if step.index <= index:
            raise FileError(f"step {step.index} cannot be written after step {index}: write each step once, in order")
        if None not in (case, _case_fingerprint(step)) and case != _case_fingerprint(step):
            raise FileError(f"step {step.index} belongs to another case than step {index}: write it to a separate file")

    def close(self, log: Any = None, warnings: Iterable[str] = ()) -> None:
        """Finish the file; further calls have no effect.

        Parameters
        ----------
        log : str, list or dict, optional
            Log of the run, which must be convertible to JSON.
        warnings : iterable of str
            Warnings of the run that do not belong to a single step.

        Raises
        ------
        FileError
            If the disk is full or fails.
        """
        try:
            self.wait()
        except FileError as error:
            self.__exit__(type(error), error, None)
            raise
        self._finish({"log": log, "warnings": [str(warning) for warning in warnings]})

    def _finish(self, run: dict[str, Any]) -> None:
        with self._access, contextlib.ExitStack() as closing:
            closing.callback(self._abandon)
            if self._closed or (self._file is None and self._ended and "error" not in run):
                return  # closed, or a complete file to which no step was added
            self._release_done()
            closing.enter_context(self._as_file_errors("closed"))
            self._open()
            closing.callback(self._committed.close)
            closing.callback(self._file.close)
            self._check_exclusive()
            if self._committed.writable:
                write_arrays.append_run(self._objects, self.n_steps, run, self._flush)

    def _abandon(self) -> None:
        self._closed, self._file = True, None
        if self._background is not None:
            self._background.shutdown(wait=False)
        self._release_done()
        self._lock.release()

    def _release_done(self) -> None:
        """Close the reader of the existing steps before the file changes."""
        if isinstance(self.done, StoredSteps):
            self.done.release()

    def _open(self) -> None:
        """Open the file of a resumed run for writing, before the first step is added."""
        import h5py

        if self._file is None:
            if self._resumed_state is not None and self._resumed_state != file_state(self.path):
                raise FileError(self._moved_message())
            self._committed = CommittedFile(self.path)
            try:
                self._file = h5py.File(self._committed, "r+")
                # By default, the metadata cache grows with the steps, to ten times the size of its data in the file.
                settings = self._file.id.get_mdc_config()
                settings.set_initial_size = True
                settings.initial_size = settings.min_size = settings.max_size = METADATA_CACHE
                self._file.id.set_mdc_config(settings)
            except BaseException:
                self._committed.close()
                raise
            self._objects = write_arrays.OpenObjects(self._file)
            pairs = self._file["fastcontact/contact"].values()
            self._pairs = {json.loads(read_text(pair["name"], self._committed)): dict(pair) for pair in pairs}

    def _check_in_place(self) -> None:
        """Raise FileError if the file is no longer at its path, or an earlier write has failed."""
        self._committed.check()
        self._check_exclusive()
        with contextlib.suppress(OSError):
            if os.path.samestat(os.fstat(self._committed.fileno()), os.stat(self.path)):
                return
        raise FileError(self._moved_message())

    def _check_exclusive(self) -> None:
        """Raise FileError if another program has changed the file."""
        if not self._committed.is_intact():
            raise FileError(
                f"'{self.path}' was changed by another program after {self.n_steps} steps, and its contents are left "
                "unchanged: let no other program write to it, name another file and start again"
            )

    def _moved_message(self) -> str:
        return (
            f"'{self.path}' is no longer there: the file or its folder was removed, moved or replaced after "
            f"{self.n_steps} steps. Put it back and resume, or start again"
        )

    def _flush(self) -> None:
        self._file.flush()
        self._committed.check()

    @contextlib.contextmanager
    def _as_file_errors(self, action: str) -> Iterator[None]:
        """Convert errors of HDF5 and of the operating system to a FileError with a remedy, and defer signals."""
        with uninterrupted():
            try:
                yield
            except Exception as error:  # errors of HDF5 have many types
                failure = self._committed.failure if self._committed is not None else None
                if isinstance(error, (FastcontactError, MemoryError)):
                    raise
                cause = failure or error
                if not isinstance(cause, Exception):
                    raise cause from None
                reason = getattr(cause, "strerror", None) or next(iter(str(cause).splitlines()), type(cause).__name__)
                remedy = "check the disk space and the permissions of the folder"
                if not isinstance(cause, (OSError, RuntimeError)):
                    remedy = "its tables are damaged: name another file, or start anew without resuming"
                raise FileError(
                    f"'{self.path}' cannot be {action} ({reason}); {self.n_steps} steps are complete: {remedy}"
                ) from error

    def _begin(self, kinematics: str, case_text: str) -> None:
        """Write all data except the steps to a temporary file, then replace the old file by it."""
        with replacing(self.path) as temporary, new_hdf5(temporary) as file:
            write_arrays.write_geometry(file, self._mesh, self._cell_fields, self._material, self._point_fields)
            write_arrays.write_case(file, self._mesh, kinematics, case_text, self._units)
        # The file was closed, because Windows does not rename open files. `_open` sets no lock, so that viewers can read it.
        self._open()


def _materials_at_interfaces(model: Any) -> Any:
    """Return the numbers of the materials of all solid cells (n_solids,); None for a model without material interfaces."""
    if not getattr(model, "materials", None) or not hasattr(model, "material_numbers"):
        return None
    material = model.material_field().distinct_materials
    if not len(material_sides(model.mesh, material).points):
        return None
    return np.concatenate(list(material.values()))


def _steps_to_resume(
    path: Path, mesh: Mesh, kinematics: str, cell_fields: Sequence[str]
) -> tuple[Sequence[StepResult], bool, str]:
    """Return the steps of the file at `path`, whether its run is complete, and the text of its case file.

    If there is no file, there are no steps. Raises FileError if steps of this mesh cannot be appended to the file.
    """
    if not path.exists() or not path.stat().st_size:
        return [], False, ""
    with contextlib.ExitStack() as closing:
        old = closing.enter_context(Results(path, always_apply_journal=True))
        if not len(old):
            return [], False, ""
        start_anew = "or start anew without resuming, which replaces the file"
        if old.schema < layout.OLDEST_RESUMABLE:
            raise FileError(
                f"'{path}' was written by an earlier fastcontact, which stored no data to resume from: name another file "
                f"{start_anew}"
            )
        if missing := old.missing_paths(layout.NEEDED_TO_RESUME):
            raise FileError(f"'{path}' is damaged, since it lacks '{missing[0]}': restore a copy, {start_anew}")
        if not _same_mesh(old.mesh, mesh) or old.kinematics != kinematics:
            difference = "kinematics" if _same_mesh(old.mesh, mesh) else "mesh"
            raise FileError(f"'{path}' belongs to another {difference}: resume the case of the file, {start_anew}")
        names = sorted(old.cell_field_names)
        if names != sorted(cell_fields):
            raise FileError(
                f"the steps in '{path}' contain the cell fields {names or 'none'}, not {sorted(cell_fields) or 'none'}: ask "
                f"for the same ones, {start_anew}"
            )
        steps = StoredSteps(old)
        closing.pop_all()  # the file stays open, because steps are read on access
        return steps, old.complete, old.case_text


def _case_fingerprint(step: StepResult) -> Any:
    """Return the fingerprint of the case for which a step was computed; None if it is unknown."""
    return (step.restart or {}).get("case", {}).get("parts")


def _same_mesh(old: Mesh, other: Mesh) -> bool:
    """Return whether points, cells and groups of two meshes are equal."""
    if not np.array_equal(old.points, other.points):
        return False
    pairs = [(getattr(old, kind), getattr(other, kind)) for kind in ("cells", "cell_groups", "point_groups")]
    return all(list(a) == list(b) and all(np.array_equal(a[name], b[name]) for name in a) for a, b in pairs)


def _checked_names(cell_fields: Iterable[str], mesh: Mesh) -> tuple[str, ...]:
    """Return the names of cell fields, after a check that all can be written."""
    names = tuple(cell_fields)
    for name in names:
        reserved = {*layout.cell_fields(mesh), *layout.MATERIAL_FIELDS, "material"}
        if name in reserved or not name.isidentifier():
            raise FileError(
                f"'{name}' cannot be the name of a cell field: it is reserved or not an identifier; choose another"
            )
    return names


def _check_replaceable(path: Any, overwrite: bool) -> None:
    """Raise FileError if the file exists and `overwrite` is False, or if it is not a result file."""
    import h5py

    if not path.exists() or not path.stat().st_size:
        return
    if not overwrite:
        raise FileError(f"'{path}' already exists: name another file or allow it to be overwritten")
    is_result = h5py.is_hdf5(path)
    if is_result:
        with contextlib.suppress(OSError), h5py.File(path, "r", locking=False) as file:
            # The operator `in` would follow links, even to other files.
            is_result = isinstance(file.get("VTKHDF", getlink=True), h5py.HardLink)
    if not is_result:
        raise FileError(f"'{path}' exists and is not a result file: name another file or remove it first")
