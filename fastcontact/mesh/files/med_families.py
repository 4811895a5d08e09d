"""Families of MED files: each cell or point belongs to one family, and each family lists its groups."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from fastcontact._tools.hdf5 import attribute, values
from fastcontact.arrays import AnyArray, Indices, Numbers
from fastcontact.errors import FileError, warn

GROUP_NAME_SIZE = 80
FAMILY_NAME_SIZE = 64
# Number of folder levels between a mesh and its families: one, for those of points or of cells.
LEVELS = 2

Families = dict[int, tuple[str, ...]]


def checked_name(kind: str, name: str, size: int) -> bytes:
    """Return a name encoded for MED; FileError if it is empty, too long, or cannot be read back unchanged."""
    encoded = name.encode("utf-8")
    if not encoded or len(encoded) > size:
        raise FileError(f"{kind} name '{name}' has {len(encoded)} bytes, and MED takes 1 to {size}: rename it")
    if name.endswith(" ") or "\0" in name:
        raise FileError(f"{kind} name '{name}' ends with a blank, which MED does not keep: rename it")
    return encoded


def decoded(raw: bytes) -> str:
    """Return the name in a field of fixed size, padded with blanks or zero bytes."""
    name = raw.split(b"\0")[0].rstrip(b" ")
    try:
        return name.decode("utf-8")
    except UnicodeDecodeError:
        return name.decode("latin-1")


def read_families(folder: Any, level: int = 0) -> Families:
    """Return the group names of each family number, from an HDF5 group and its subfolders."""
    families: Families = {}
    for entry in folder.values():
        if "NUM" in entry.attrs:
            families[int(attribute(entry, "NUM"))] = _group_names(entry)
        elif hasattr(entry, "values") and level < LEVELS:
            families.update(read_families(entry, level + 1))
    return families


def _group_names(family: Any) -> tuple[str, ...]:
    if "GRO" not in family:
        return ()
    raw = values(family["GRO"], "NOM").tobytes()
    # MED 2 stores one string for all names, later versions a row for each: the same bytes, except for a zero.
    count = -(-len(raw) // GROUP_NAME_SIZE)
    if "NBR" in family["GRO"].attrs:
        count = min(count, int(attribute(family["GRO"], "NBR")))
    fields = (raw[i * GROUP_NAME_SIZE : (i + 1) * GROUP_NAME_SIZE] for i in range(count))
    return tuple(name for name in map(decoded, fields) if name)


def members(numbers: AnyArray, families: Families) -> dict[str, Indices]:
    """Return the rows of each group, from the family number of each row."""
    members_by_group: dict[str, list[Indices]] = {}
    order = np.argsort(np.abs(numbers), kind="stable")
    starts = np.flatnonzero(np.diff(numbers[order])) + 1
    for rows in np.split(order, starts) if len(numbers) else []:
        number = int(numbers[rows[0]])
        if number and number not in families:
            warn(
                f"{len(rows)} cells or points belong to family {number}, which the MED file does not "
                "describe: they are in no group"
            )
        for name in families.get(number, ()):
            members_by_group.setdefault(name, []).append(rows)
    return {name: np.unique(np.concatenate(parts)) for name, parts in members_by_group.items()}


def families_of(groups: Mapping[str, AnyArray], count: int, sign: int) -> tuple[Numbers, Families]:
    """Return the family number of each of `count` cells or points, and the groups of each family.

    There is one family for each combination of groups that occurs, and one for all groups without members.
    Numbers run from `sign`, +1 for points and -1 for cells, away from zero; 0 means no group.
    """
    labels = np.zeros(count, np.intp)
    combinations: list[tuple[str, ...]] = [()]
    for name, rows in groups.items():
        # Only members change family: the cost is proportional to the size of the groups, not to that of the mesh.
        before, position = np.unique(labels[rows], return_inverse=True)
        labels[rows] = len(combinations) + position
        combinations += [(*combinations[label], name) for label in before]
    used, compact = np.unique(np.append(labels, 0), return_inverse=True)
    families = {sign * number: combinations[label] for number, label in enumerate(used.tolist()) if number}
    empty = tuple(name for name, rows in groups.items() if not len(rows))
    if empty:
        families[sign * len(used)] = empty
    return (sign * compact[:-1]).astype(np.int32), families


def write_families(folder: Any, families: Families) -> None:
    """Write the families into an HDF5 group."""
    for number, names in families.items():
        label = re.sub(r"[^A-Za-z0-9_]", "_", f"FAM_{number}_" + "_".join(names)).replace("FAM__", "FAM_-", 1)
        family = folder.create_group(label[:FAMILY_NAME_SIZE])
        family.attrs["NUM"] = np.int32(number)
        group = family.create_group("GRO")
        group.attrs["NBR"] = np.int32(len(names))
        rows = np.zeros((len(names), GROUP_NAME_SIZE), np.int8)
        for row, name in zip(rows, names, strict=True):
            encoded = checked_name("group", name, GROUP_NAME_SIZE)
            row[: len(encoded)] = np.frombuffer(encoded, np.int8)
        dataset = group.create_dataset("NOM", (len(names),), np.dtype((np.int8, (GROUP_NAME_SIZE,))))
        dataset[...] = rows
