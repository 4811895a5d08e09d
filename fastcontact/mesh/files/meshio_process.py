"""Reading of mesh files with meshio in a child process, with limits of memory and computing time.

meshio allocates memory for the numbers of items that a file states, and some of its readers do not terminate on a truncated
file. In these cases only the child process ends, and the error states the reason. Memory is not limited on Windows and
macOS, and computing time is not limited on Windows. Elapsed time and the size of the answer are limited on all systems.
Frozen applications and programs with embedded Python, which cannot start an interpreter, read files without limits.
"""

from __future__ import annotations

import contextlib
import io
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from fastcontact._tools.packing import pack, unpack
from fastcontact.arrays import AnyArray

# Limits of computing time [s] and of memory [bytes] of the child process: a constant, and a term per byte of the file. meshio
# 5.3.5 takes up to 0.15 s and 9 MB per megabyte (permas, vtu). The process itself takes 130 MB.
SECONDS, SECONDS_PER_BYTE = 5.0, 5e-6
MEMORY, MEMORY_PER_BYTE = 1 << 30, 32
# Limit of the answer of the child process [bytes]. A compressed file of a few kilobytes can contain many equal points.
ANSWER_SIZE, ANSWER_SIZE_PER_BYTE = 1 << 28, 32
# Ratio of the limits of elapsed time and of computing time, for busy machines.
ELAPSED_TO_CPU_TIME = 10

# Integer cell data that define groups, in the formats of Gmsh, Medit and others; 0 means no group.
TAGS = ("gmsh:physical", "medit:ref", "tetgen:ref", "netgen:index", "avsucd:material", "cell_tags")
# In formats with named arrays a group is an array of 0 and 1, whose name is a prefix and the percent-encoded group name.
CELL_PREFIX, POINT_PREFIX = "cell_group:", "point_group:"


def library() -> Any:
    """Return the package meshio, after adding two elements that its table of dimensions lacks."""
    import meshio
    from meshio._mesh import topological_dimension  # meshio 5.3.5 has this table only in a private module

    for name in ("pyramid13", "wedge15"):
        topological_dimension.setdefault(name, 3)
    return meshio


def read_in_process(path: Path, file_format: str, field: str = "") -> dict[str, Any]:
    """Return the result of `plain_content` in a child process, or ``{"error": reason}`` if a limit stopped it."""
    interpreter = Path(sys.executable or "").name.lower()
    if getattr(sys, "frozen", False) or not ("python" in interpreter or "pypy" in interpreter):
        return plain_content(path, file_format, field)
    size = path.stat().st_size
    seconds, memory = SECONDS + SECONDS_PER_BYTE * size, MEMORY + MEMORY_PER_BYTE * size
    limits = f"{seconds:.0f}", str(memory), str(ANSWER_SIZE + ANSWER_SIZE_PER_BYTE * size)
    command = [sys.executable, "-P", "-m", __name__, str(path.resolve()), file_format, *limits, field]
    folders = os.pathsep.join(map(os.path.abspath, sys.path))
    try:
        process = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, timeout=ELAPSED_TO_CPU_TIME * seconds, check=False,
            cwd=path.resolve().parent, env={**os.environ, "PYTHONPATH": folders, "OPENBLAS_NUM_THREADS": "1"},
            creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return {"error": f"it was not read within {ELAPSED_TO_CPU_TIME * seconds:.0f} s"}
    except OSError as error:
        return {"error": f"no process can be started: {error.strerror}"}
    if process.returncode == -getattr(signal, "SIGXCPU", 0):
        return {"error": f"it was not read within {seconds:.0f} s of computing"}
    if process.returncode < 0:
        return {"error": f"the reading process was ended by {signal.Signals(-process.returncode).name}"}
    try:
        return dict(unpack(np.frombuffer(process.stdout, np.uint8)))
    except (ValueError, LookupError, TypeError):
        lines = process.stderr.decode("utf-8", "replace").strip().splitlines()
        return {"error": f"the reading process failed: {lines[-1] if lines else 'no answer'}"}


def plain_content(path: Path, file_format: str, field: str = "") -> dict[str, Any]:
    """Return the content of a file as a dict of lists and arrays, without output of meshio to the standard streams.

    The keys are

    - ``points``: array (n_points, 2 or 3) [length];
    - ``cells``: list of kind, number of cells and nodes (n_cells, n_nodes);
    - ``cell_data`` and ``point_data``: the arrays that define groups;
    - ``cell_sets``, ``point_sets`` and ``field_data``: those of meshio;
    - ``output``: text that meshio has printed;
    - ``fields`` and ``field``, if `field` is given: the names of all fields at points, and the values of this field;
    - ``cell_fields`` and ``cell_field``, if `field` is given: the same for cells, with an array for each block;
    - ``error``, alone: the reason why meshio cannot read the file.

    Arrays that are not numeric, and fields that do not exist, are None.
    """
    output = io.StringIO()
    try:
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
            content = library().read(path, file_format=file_format)
            return {**plain_mesh(content), **(_fields(content, field) if field else {}), "output": output.getvalue()}
    except MemoryError:
        return {"error": "it announces more data than the memory can hold"}
    except (Exception, SystemExit) as error:
        return {"error": (output.getvalue() if isinstance(error, SystemExit) else str(error)) or type(error).__name__}


def _fields(content: Any, field: str) -> dict[str, Any]:
    """Return the fields of a ``meshio.Mesh`` in the format of `plain_content`."""
    blocks = content.cell_data.get(field)
    return {
        "fields": list(content.point_data),
        "field": _numbers(content.point_data.get(field)),
        "cell_fields": list(content.cell_data),
        "cell_field": None if blocks is None else [_numbers(values) for values in blocks],
    }


def plain_mesh(content: Any) -> dict[str, Any]:
    """Return the mesh and the groups of a ``meshio.Mesh`` in the format of `plain_content`."""
    cell_data = {key: data for key, data in content.cell_data.items() if key in TAGS or key.startswith(CELL_PREFIX)}
    point_data = {key: data for key, data in content.point_data.items() if key in TAGS or key.startswith(POINT_PREFIX)}
    return {
        "points": _numbers(content.points),
        "cells": [[block.type, len(block.data), _numbers(block.data)] for block in content.cells],
        "cell_data": {key: [_numbers(values) for values in arrays] for key, arrays in cell_data.items()},
        "point_data": {key: _numbers(data) for key, data in point_data.items()},
        "cell_sets": {name: [_numbers(values) for values in arrays] for name, arrays in content.cell_sets.items()},
        "point_sets": {name: _numbers(values) for name, values in content.point_sets.items()},
        "field_data": {name: _numbers(entry) for name, entry in content.field_data.items()},
    }


def _numbers(values: Any) -> AnyArray | None:
    """Return values as a numeric array, or None if this is impossible, as for cells with different numbers of nodes."""
    try:
        array = np.asarray(values)
    except ValueError:
        return None
    return array if array.dtype.kind in "biuf" else None


def _limit(kind: int, value: int) -> None:
    """Set the resource limit `kind` of this process to `value`, as far as the system allows it."""
    import resource

    hard = resource.getrlimit(kind)[1]
    with contextlib.suppress(ValueError, OSError):  # macOS does not allow such a limit of memory
        resource.setrlimit(kind, (value if hard == resource.RLIM_INFINITY else min(value, hard), hard))


def main() -> None:
    """Read the file named on the command line and write the packed result to the standard output."""
    path, file_format = sys.argv[1:3]
    seconds, memory, answer_size = map(int, sys.argv[3:6])
    library()
    if sys.platform != "win32":
        import resource

        _limit(resource.RLIMIT_CORE, 0)
        _limit(resource.RLIMIT_CPU, int(time.process_time()) + 1 + seconds)
        _limit(resource.RLIMIT_AS, memory)
    answer = pack(plain_content(Path(path), file_format, *sys.argv[6:7]))
    if answer.nbytes > answer_size:
        answer = pack({"error": "it contains more than is plausible for a file of its size"})
    sys.stdout.buffer.write(answer.tobytes())


if __name__ == "__main__":
    main()
