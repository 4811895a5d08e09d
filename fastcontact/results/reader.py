"""Reading of result files, which requires neither the model nor the mesh file."""

from __future__ import annotations

import contextlib
import json
import os
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fastcontact._tools import toml_text
from fastcontact._tools.argument_types import typed
from fastcontact._tools.hdf5 import check_contents
from fastcontact._tools.html_table import html_table
from fastcontact._tools.packing import unpack
from fastcontact._tools.paths import PathLike, existing_file
from fastcontact.arrays import Array, Numbers
from fastcontact.errors import FileError
from fastcontact.mesh.mesh import Mesh
from fastcontact.results import journal, layout, tables
from fastcontact.results.file_lock import is_being_written
from fastcontact.results.step import ContactResult, MaterialStress, StepResult, StepSequence, warnings_of_run
from fastcontact.results.units import units_of_results

# HDF5 stores strings of variable length in global heap collections (HDF5 File Format Specification 3.0, section III.E). A
# collection consists of a header of 16 bytes with its size and a sequence of objects, each of which has a header of 16 bytes.
# Strings are read without the HDF5 library, which does not terminate for some damaged files.
SIGNATURE = b"GCOL\x01\0\0\0"  # with version and reserved bytes
COLLECTION_HEADER = struct.Struct("<8sQ")  # header of a collection: signature, size
OBJECT_HEADER = struct.Struct("<H6xQ")  # header of an object: number, size; free space at the end has the number 0
REFERENCE = struct.Struct("<IQI")  # entry of a data set: length of the string, address of the collection, object number


def read_text(dataset: Any, raw: Any) -> str:
    """Return the string of a data set that contains a single string of variable length.

    `raw` is the open file, whose offsets and lengths have eight bytes. Raises ValueError if the data set does not contain
    such a string or is damaged.
    """
    import h5py

    string_type, start = h5py.check_string_dtype(dataset.dtype), dataset.id.get_offset()
    if dataset.shape != () or start is None or string_type is None or string_type.length is not None:
        raise ValueError(f"'{dataset.name}' is not a string")
    file_size = raw.seek(0, os.SEEK_END)
    length, offset, object_number = _unpack(REFERENCE, raw, start, file_size)
    signature, size = _unpack(COLLECTION_HEADER, raw, offset, file_size)
    position, end = offset + COLLECTION_HEADER.size, min(offset + size, file_size)
    while signature == SIGNATURE and position + OBJECT_HEADER.size <= end:
        number, size = _unpack(OBJECT_HEADER, raw, position, end)
        position += OBJECT_HEADER.size
        if number == object_number and length <= size and position + length <= end:
            return raw.read(length).decode("utf-8")
        if number in (0, object_number):
            break
        position += -(-size // 8) * 8
    raise ValueError(f"its strings are damaged at byte {position}")


def _unpack(kind: struct.Struct, raw: Any, offset: int, end: int) -> tuple[Any, ...]:
    if offset + kind.size > end:
        raise ValueError(f"its strings are damaged: byte {offset} lies beyond the end at {end}")
    raw.seek(offset)
    return kind.unpack(raw.read(kind.size))


if TYPE_CHECKING:
    import pandas

# In these columns of the table of steps of a contact pair, NaN stands for None.
NAN_FOR_NONE = ("obstacle_displacement", "obstacle_angle", "torque", "tangent", "direction", "stick_bounds")


@typed(FileError)
def open_results(path: PathLike) -> Results:
    """Open a result file.

    Parameters
    ----------
    path : path-like
        A file that a ``ResultWriter`` has written or is still writing; all complete steps can be read.

    Returns
    -------
    Results
        A sequence of ``StepResult``, which reads a step on access. Use it in a ``with`` statement, or call ``close``.

    Raises
    ------
    FileError
        If the file does not exist, is not a result file, is damaged, or was written by a newer version of fastcontact.

    Examples
    --------
    >>> import fastcontact as fc
    >>> model = fc.Model(fc.generate.block(), "plane_strain")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    >>> model.fix("BOTTOM", "xy")
    >>> model.add_pressure("TOP", 2.0)
    >>> with fc.ResultWriter("block.vtkhdf", model) as out:
    ...     steps = fc.solve(model, 2, on_step=out.write)
    >>> with fc.open_results("block.vtkhdf") as results:
    ...     last = results[-1]
    >>> last.load_factor
    1.0
    """
    return Results(path)


class Results(StepSequence):
    """The steps of a result file, each of which is read on access, and data of the mesh and of the run.

    Steps contain NumPy arrays and remain valid after the file is closed.

    Attributes
    ----------
    path : pathlib.Path
        Path of the file.
    schema : int
        Version of the layout of the file.
    mesh : Mesh
        The mesh with its groups.
    kinematics : str
        Kinematics of the analysis, see `Model`.
    case_text : str
        Text of the case file, empty if there was none. If the run was resumed with a changed case file, it is the text with
        which the last steps were computed.
    versions : dict of str to str
        Versions of the packages that computed the results.
    load_factors : ndarray (n_steps,)
        Load factor at the end of each step [-].
    units : dict of str to str
        Names of units from the model or the case file, as described for `ContactResult`; empty if none were given.
    warnings : tuple of str
        All distinct warnings of the run and of its steps, except those that apply to a single step.
    log : object
        Log of the run, None without a log. If the run did not converge, it is ``{"failed_step": history}`` with the
        iterations of the step, or of the substep, that failed.
    complete : bool
        Whether the run has finished; False during the run and after a crash.
    error : str
        Error that stopped the run; empty if there was no error or it could not be written.
    """

    def __init__(self, path: PathLike, *, always_apply_journal: bool = False) -> None:
        """Open the file.

        Changes in the journal, which a power loss may have interrupted, are applied to the data that are read, but not
        to the file. They are ignored while another program writes to the file, unless `always_apply_journal` is true: the
        caller then guarantees that no other program writes to it, and they are always applied.
        """
        import h5py

        self.path: Path = existing_file(path)
        if not os.access(path, os.R_OK, effective_ids=os.access in os.supports_effective_ids):
            raise FileError(f"'{path}' is not readable: ask its owner for read permission")
        if not h5py.is_hdf5(self.path):
            raise FileError(f"'{path}' is not an HDF5 file: name a result file that fastcontact wrote (.vtkhdf)")
        # The file is opened by a separate file object. Given its name, HDF5 would reuse an open file with its cached state.
        self._raw: Any = open(path, "rb")  # noqa: SIM115
        self._file: Any = None
        try:
            writes = journal.pending(self._raw) if always_apply_journal or not is_being_written(self.path) else []
            if writes:
                self._raw = journal.JournalView(self._raw, writes)
            with self._as_file_errors():
                self._file = h5py.File(self._raw, "r")
                self._read_header(self._checked_group())
        except BaseException:
            self.close()
            raise

    def _checked_group(self) -> Any:
        """Return the HDF5 group of fastcontact after a check of the file and of its schema."""
        if self._file.userblock_size or self._file.id.get_create_plist().get_sizes() != (8, 8):
            raise ValueError("its superblock differs from that of result files")
        check_contents(self._file, self.path)
        if "fastcontact" not in self._file:
            raise FileError(f"'{self.path}' has no fastcontact results: name a file that fastcontact wrote (.vtkhdf)")
        self.schema = _integer(self._file["fastcontact"], "schema")
        if self.schema > layout.SCHEMA:
            raise FileError(
                f"'{self.path}' has schema {self.schema}, but this version reads schemas up to {layout.SCHEMA}: update it"
            )
        return self._file["fastcontact"]

    def _read_header(self, group: Any) -> None:
        self._n_steps = _integer(self._file["VTKHDF/Steps"], "NSteps")
        self.mesh = _read_mesh(group["mesh"], self._raw)
        self.kinematics: str = _read_json(group["kinematics"], self._raw)
        self.case_text: str = _read_json(group["case"], self._raw)
        self.versions: dict[str, str] = _read_json(group["versions"], self._raw)
        self._rows = group["steps"][: self._n_steps]
        if len(self._rows) != self._n_steps or self._rows.ndim != 1:
            raise ValueError(f"only {len(self._rows)} of {self._n_steps} steps")
        if not isinstance(self.kinematics, str) or not isinstance(self.case_text, str):
            raise ValueError("its kinematics or its case is not text")
        self.load_factors: Array = np.ascontiguousarray(self._rows["load_factor"])
        run = self._run_record(group)
        self.log: Any = (run or {}).get("log")
        self.error: str = (run or {}).get("error", "")
        self.complete = run is not None and not self.error
        notes = [self._notes_of_step(number) for number in range(self._n_steps)]
        self.case_text = next((note["case"] for note in reversed(notes) if "case" in note), self.case_text)
        step_warnings = [text for note in notes for text in warnings_of_run(note["warnings"], note["iterations"])]
        unit_names = _read_json(group["units"], self._raw) if "units" in group else self._units_of_case()
        if not isinstance(unit_names, dict) or not all(isinstance(text, str) for text in unit_names.values()):
            raise ValueError("its units are not names")
        self.units: dict[str, str] = units_of_results(unit_names, self.kinematics) if unit_names else {}
        self.warnings: tuple[str, ...] = tuple(dict.fromkeys([*(run or {}).get("warnings", ()), *step_warnings]))

    def _run_record(self, group: Any) -> dict[str, Any] | None:
        """Return the record of the end of the run; None during the run, after a crash, and if steps were added later."""
        if "runs" not in group:  # schema 1
            return _read_json(group["run"], self._raw) if "run" in group else None
        rows = group["runs"][-1:]
        if not len(rows) or rows["n_steps"][0] != self._n_steps or not rows["count"][0]:
            return None
        return self._record(int(rows["first"][0]), int(rows["count"][0]))

    def __len__(self) -> int:
        return self._n_steps

    def _positions(self, number: int | slice) -> int | range:
        try:
            return super()._positions(number)
        except IndexError:
            raise IndexError(
                f"'{self.path}' has {self._n_steps} steps, so there is no step at position {number}"
            ) from None
        except (TypeError, ValueError) as error:
            text = f"a slice of '{self.path}' needs integers and a nonzero increment, not {number} ({error})"
            if not isinstance(number, slice):
                text = f"a step of '{self.path}' is selected by an integer or a slice, not {number!r}"
            raise FileError(text) from None

    def missing_paths(self, names: Sequence[str]) -> list[str]:
        """Return the HDF5 paths in `names` that the file does not contain."""
        return [name for name in names if name not in self._file]

    def __enter__(self) -> Results:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def __del__(self) -> None:
        """Close the file if the caller has not closed it."""
        with contextlib.suppress(Exception):  # the constructor may have failed, or the interpreter may be exiting
            self.close()

    def __repr__(self) -> str:
        state = "complete" if self.complete else "incomplete"
        return f"Results('{self.path}': {self._n_steps} steps, {state}, {self.kinematics}, {self.mesh!r})"

    def _repr_html_(self) -> str:
        """Return tables of the contents and of the last step for notebooks."""
        steps = f"{self._n_steps}, to load factor {self.load_factors[-1]:.6g}" if self._n_steps else "none yet"
        cells = [f"{len(block)} {name}" for name, block in self.mesh.cells.items()]
        rows = [
            ("steps", steps),
            ("run", "complete" if self.complete else self.error or "incomplete"),
            ("kinematics", self.kinematics),
            ("mesh", ", ".join([f"{self.mesh.n_points} points", *cells])),
            ("groups", ", ".join(self.mesh.group_names)),
            *(("warning", text) for text in self.warnings),
        ]
        last = self[-1]._repr_html_() if self._n_steps and self._file else ""
        return html_table(rows, (), str(self.path)) + last

    def close(self) -> None:
        """Close the file; steps that were read before remain valid, and no further steps can be read."""
        if self._file is not None:
            self._file.close()
        self._raw.close()

    def to_pyvista(self, step: int | StepResult | None = None) -> Any:
        """Return all steps as a ``pyvista.MultiBlock``, or a single step as a ``pyvista.UnstructuredGrid``.

        A grid contains the solid cells with their fields and groups, and the load factor as ``field_data["load_factor"]``.
        The blocks of all steps are named ``"step 1"``, ``"step 2"``, and so on.

        Parameters
        ----------
        step : int or StepResult, optional
            A step, or its index in this sequence, which may be negative; by default all steps.

        Raises
        ------
        FileError
            If PyVista is not installed.
        """
        if step is None:
            return tables.series(self.mesh, self)
        return tables.grid(self.mesh, step if isinstance(step, StepResult) else self[step])

    def to_pandas(self) -> pandas.DataFrame:
        """Return the contact tables of all steps as one ``pandas.DataFrame``.

        The table has a row for each secondary node of each contact pair in each step. Its columns are ``step``,
        ``load_factor``, ``contact`` (the name of the pair) and the columns of `contact_table`; ``attrs["units"]`` contains
        the units by column.

        Raises
        ------
        FileError
            If pandas is not installed.
        """
        return tables.contact_frame(self, self.units)

    def to_xarray(self) -> Any:
        """Return the fields of all steps as an ``xarray.Dataset``, which is held in memory.

        The dimensions are ``step``, ``point``, ``axis``, ``stress_component`` and ``contact``. The variables at the points
        are ``displacement`` [length], ``stress``, ``von_mises``, ``von_mises_signed`` [pressure], ``reaction`` [force],
        ``contact_pressure`` [pressure], ``contact_slip``, ``contact_slip_total`` [length] and, in models with wear, cohesive
        layers or fluid pressures, ``contact_wear`` [length], ``contact_damage`` [-] or ``contact_fluid_pressure`` [pressure].
        The variables of the pairs are ``contact_force`` [force] and ``contact_pressure_max`` [pressure]. The coordinates
        ``x``, ``y`` and, in 3D, ``z`` are the reference positions [length]. The attribute ``units`` of a variable is the name
        of its unit, if known.

        Raises
        ------
        FileError
            If xarray is not installed.
        """
        return tables.dataset(self.mesh, self, self.units)

    def _units_of_case(self) -> dict[str, str]:
        """Return the names of units in the case text, for files of earlier versions."""
        try:
            unit_names = toml_text.parse(self.case_text or "").get("units", {})
        except ValueError:
            return {}
        return {key: str(value) for key, value in unit_names.items()} if isinstance(unit_names, dict) else {}

    def _notes_of_step(self, number: int) -> dict[str, Any]:
        row = self._rows[number]
        return self._record(int(row["notes_first"]), int(row["notes_count"]))

    def _record(self, first: int, count: int) -> dict[str, Any]:
        return json.loads(self._file["fastcontact/notes"][first : first + count].tobytes())

    def _step(self, number: int) -> StepResult:
        if not self._file:
            raise FileError(f"'{self.path}' is closed: open it again to read more steps")
        with self._as_file_errors():
            notes, cells = self._notes_of_step(number), self._file["VTKHDF/Types"].shape
            stored = {k: v for k, v in layout.step_shapes(self.mesh).items() if k in self.point_field_names}
            return StepResult(
                index=int(self._rows["index"][number]),
                load_factor=float(self._rows["load_factor"][number]),
                contact=self._read_contacts(number, dict(notes["contact"])),
                iterations=notes["iterations"],
                warnings=tuple(notes["warnings"]),
                cell_fields={k: self._read_field("CellData", k, number, cells, "biuf") for k in self.cell_field_names},
                restart=self._restart(number) if number == self._n_steps - 1 else None,
                material_stress=self._material_stress(number),
                units=self.units,
                **{k: self._read_field("PointData", k, number, shape) for k, shape in stored.items()},
            )

    def _restart(self, number: int) -> dict[str, Any] | None:
        """Return the restart data of step `number`.

        Only the last step has restart data. Return None if there are none, or if steps were written after the file was
        opened.
        """
        group, name = self._file["fastcontact"], layout.restart_table(number)
        try:
            stored = unpack(group[name][()]) if name in group else {}
        except (ValueError, LookupError, TypeError):
            return None
        return stored["restart"] if stored.get("step") == number else None

    def _material_stress(self, number: int) -> MaterialStress | None:
        """Return the stress in each material at nodes where materials meet; None if the step has no such stress."""
        group = self._file["fastcontact"]
        if "materials" not in group:
            return None
        steps, cells = group["materials/steps"][number : number + 1], group["materials/cells"][()]
        if not len(steps) or not steps["count"][0]:
            return None
        rows = _rows_of_step(group["materials/rows"], steps[0], "", "the table of stresses by material")
        if len(cells) != len(self._file["VTKHDF/Types"]):
            raise ValueError("the table of stresses by material is truncated")
        if rows["points"].min() < 0 or rows["points"].max() >= self.mesh.n_points:
            raise ValueError("the table of stresses by material refers to points that do not exist")
        columns = (np.ascontiguousarray(rows[name]) for name in ("points", "material", "stress"))
        return MaterialStress(cells, *columns)

    @property
    def point_field_names(self) -> list[str]:
        """Names of the point fields that the file contains for each step; earlier versions wrote fewer fields."""
        return [name for name in layout.POINT_FIELDS if name in self._file["VTKHDF/PointData"]]

    @property
    def cell_field_names(self) -> list[str]:
        """Names of the cell fields that the file contains for each step."""
        constant = {*layout.cell_fields(self.mesh), *layout.MATERIAL_FIELDS, "material"}
        return [name for name in self._file["VTKHDF/CellData"] if name not in constant]

    def _read_field(self, group: str, name: str, number: int, shape: tuple[int, ...], kinds: str = "f") -> Array:
        """Return a field of step `number` after a check of its `shape` and of the kind of its data type."""
        rows = slice(number * shape[0], (number + 1) * shape[0])
        values = self._file[f"VTKHDF/{group}/{name}"][(rows, *map(slice, shape[1:]))]
        if values.shape != shape or values.dtype.kind not in kinds:
            raise ValueError(f"{name} of step {number} is truncated, or has the wrong shape or type")
        return values

    def _read_contacts(self, number: int, formulations: Mapping[str, str]) -> dict[str, ContactResult]:
        pairs = {_read_json(pair["name"], self._raw): pair for pair in self._file["fastcontact/contact"].values()}
        contacts = {name: _read_contact(pairs[name], number, name, kind) for name, kind in formulations.items()}
        for name, contact in contacts.items():
            if contact.force.shape != (self.mesh.dim,) or contact.points.dtype.kind not in "iu":
                raise ValueError(f"the contact table of '{name}' has the wrong shape or type")
            layout.check_contact(f"step {number}, contact '{name}'", contact, self.mesh)
        return contacts

    @contextlib.contextmanager
    def _as_file_errors(self) -> Iterator[None]:
        """Convert errors of HDF5, and errors due to damaged data, to a FileError."""
        try:
            yield
        except (FileError, Warning):
            raise
        except Exception as error:  # HDF5 and invalid numbers may raise errors of any kind
            lines = str(error).splitlines()
            reason = lines[0][:200] if lines else type(error).__name__
            raise FileError(
                f"'{self.path}' is truncated or damaged ({reason}): repeat the run or restore a copy"
            ) from error


def _integer(group: Any, name: str) -> int:
    if group.attrs.get_id(name).dtype.kind not in "iu":
        raise ValueError(f"'{name}' of '{group.name}' is not a whole number")
    return int(group.attrs[name])


def _read_json(dataset: Any, raw: Any) -> Any:
    return json.loads(read_text(dataset, raw))


def _read_mesh(stored: Any, raw: Any) -> Mesh:
    return Mesh(
        points=stored["points"][:, : _integer(stored, "dim")],
        cells={name: stored["cells"][name][()] for name in _read_json(stored["elements"], raw)},
        cell_groups=_read_groups(stored["cell_groups"], raw),
        point_groups=_read_groups(stored["point_groups"], raw),
    )


def _read_groups(group: Any, raw: Any) -> dict[str, Numbers]:
    names = _read_json(group["names"], raw)
    if group["sizes"].shape != (len(names),):
        raise ValueError(f"'{group.name}' has {len(names)} names for sizes of shape {group['sizes'].shape}")
    members = np.split(group["members"][()], np.cumsum(group["sizes"][()])[:-1])
    return dict(zip(names, members))


def _rows_of_step(table: Any, step: Any, prefix: str, name: str) -> Any:
    """Return the rows of the table called `name` that belong to a step. Raises ValueError if rows are missing.

    The columns ``first`` and ``count`` of the row `step`, whose names begin with `prefix`, contain the index of the first row
    and the number of rows.
    """
    first, count = int(step[f"{prefix}first"]), int(step[f"{prefix}count"])
    rows = table[first : first + count]
    if len(rows) != count or first < 0:
        raise ValueError(f"{name} is truncated")
    return rows


def _read_contact(pair: Any, number: int, name: str, formulation: str) -> ContactResult:
    step = pair["steps"][number]
    rows = _rows_of_step(pair["rows"], step, "", f"the contact table of '{name}'")
    columns: dict[str, Any] = {column: np.ascontiguousarray(rows[column]) for column in rows.dtype.names}
    for mask in {"active", "sticking"} & set(columns):
        columns[mask] = columns[mask].astype(bool)
    # For data that files of earlier versions lack, the defaults of ContactResult apply.
    resultants: dict[str, Any] = {}
    for column in set(step.dtype.names).difference(layout.ROW_COLUMNS):
        value = step[column]
        if column in NAN_FOR_NONE and np.isnan(value).any():
            value = None
        elif column in ("radius", "stick_bounds"):
            value = tuple(value.tolist())
        resultants[column] = value.item() if isinstance(value, np.generic) else value
    primary_forces: dict[str, Any] = {}
    if "primary_first" in step.dtype.names:
        table = _rows_of_step(pair["primary"], step, "primary_", f"the table of primary forces of '{name}'")
        primary_forces = {f"primary_{key}": np.ascontiguousarray(table[key]) for key in ("points", "force_vectors")}
    return ContactResult(name=name, formulation=formulation, **resultants, **primary_forces, **columns)


class StoredSteps(StepSequence):
    """The steps that a file contains when it is opened; each step is read on access.

    The last step, with its `restart`, is kept in memory. `release` must be called before the file is changed, because HDF5
    does not update its view of an open file. Access to another step opens the file again.
    """

    def __init__(self, results: Results) -> None:
        self._path: Path = results.path
        self._results: Results | None = results
        self._count = len(results)
        self._last = results[-1]

    def release(self) -> None:
        """Close the file; further calls have no effect."""
        if self._results is not None:
            self._results.close()
            self._results = None

    def __len__(self) -> int:
        return self._count

    def _step(self, position: int) -> StepResult:
        if position == self._count - 1:
            return self._last
        if self._results is None:
            self._results = Results(self._path)
        return self._results[position]

    def __repr__(self) -> str:
        return f"StoredSteps('{self._path}': {self._count} steps)"
