"""A result file that is to be written on: does it hold steps, and do they belong to what is computed now?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fastcontact.errors import FileError
from fastcontact.mesh.mesh import Mesh
from fastcontact.results import _layout as layout
from fastcontact.results.reader import Results
from fastcontact.results.step import StepResult


@dataclass(frozen=True, eq=False)
class TakenUp:
    """What a file holds: its steps, whether its run came to its end, and its case file."""

    steps: list[StepResult]
    complete: bool
    case_text: str


def taken_up(path: Path, mesh: Mesh, kinematics: str, cell_fields: Sequence[str]) -> TakenUp | None:
    """Return what the file at `path` holds; None if there is none, or none with a complete step.

    Raises
    ------
    FileError
        If the file is no result file or damaged, or its steps cannot be followed by steps of this mesh.
    """
    if not path.exists() or not path.stat().st_size:
        return None
    with Results(path) as old:
        if not len(old):
            return None
        begin_anew = "or start anew without resuming, which replaces the file"
        if old.schema < layout.SCHEMA:
            raise FileError(
                f"'{path}' was written by an earlier fastcontact, which kept nothing to go on from: name another file "
                f"{begin_anew}"
            )
        if not same_mesh(old.mesh, mesh) or old.kinematics != kinematics:
            what = "kinematics" if same_mesh(old.mesh, mesh) else "mesh"
            raise FileError(f"'{path}' belongs to another {what}: resume the case it was begun for, {begin_anew}")
        names = sorted(old.cell_field_names)
        if names != sorted(cell_fields):
            raise FileError(
                f"the steps in '{path}' hold the cell fields {names or 'none'}, not {sorted(cell_fields) or 'none'}: ask "
                f"for the same ones, {begin_anew}"
            )
        return TakenUp(list(old), old.complete, old.case_text)


def same_mesh(one: Mesh, other: Mesh) -> bool:
    """Return whether points, cells and groups of two meshes are the same."""
    if not np.array_equal(one.points, other.points):
        return False
    for kind in ("cells", "cell_groups", "point_groups"):
        ours, theirs = getattr(one, kind), getattr(other, kind)
        if list(ours) != list(theirs) or not all(np.array_equal(ours[name], theirs[name]) for name in ours):
            return False
    return True
