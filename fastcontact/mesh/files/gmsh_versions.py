"""Conversion of Gmsh files of versions that meshio does not read."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from fastcontact.errors import FileError

# Files begin with $MeshFormat and a line of version, file type and data size. Files of version 1 begin with their nodes.
VERSION_1 = b"$NOD"
# Gmsh writes 4.0 as "4", which meshio 5.3.5 mistakes for 4.1.
VERSION_4, VERSION_4_0 = b"4", b"4.0"
# Position of the number of physical groups in a line of $Entities, after the number of the entity and its bounding box.
GROUPS_OF_ENTITY = 7
# Largest number of words into which the line of a cell is split, more than the largest element has.
MOST_WORDS = 200


def readable_file(path: Path, folder: Path) -> Path:
    """Return the path of a file that meshio can read: `path`, or a converted copy in the temporary `folder`."""
    with open(path, "rb") as file:
        first, second = (file.readline(256).strip() for _ in range(2))
    converted = folder / "newer.msh"
    if first == VERSION_1:
        _write_version_2(path, converted)
        return converted
    version = b"".join(second.split()[:1])
    if version in (VERSION_4, VERSION_4_0):
        _check_groups(path)
    if version == VERSION_4:
        converted.write_bytes(path.read_bytes().replace(b"4 ", b"4.0 ", 1))
        return converted
    return path


def _check_groups(path: Path) -> None:
    """Raise FileError for a file of version 4.0 in which cells belong to several groups, because meshio keeps only one."""
    in_entities = False
    for line in path.read_text(encoding="ascii", errors="replace").splitlines():
        if line.startswith("$"):
            in_entities = line.strip() == "$Entities"
        words = line.split(None, GROUPS_OF_ENTITY + 1)  # a damaged file may consist of a single line
        if in_entities and len(words) > GROUPS_OF_ENTITY and words[GROUPS_OF_ENTITY] not in ("0", "1"):
            raise FileError(
                f"'{path}' is of version 4.0, with cells in several physical groups, of which one would be read: open it in "
                "Gmsh and save it as version 4.1"
            )


def _write_version_2(path: Path, target: Path) -> None:
    """Convert a file of version 1 to version 2.2.

    In version 1 a cell is a line of number, kind, physical group, geometric entity, number of nodes, and the nodes.
    """
    lines = path.read_text(encoding="ascii", errors="replace").splitlines()
    with open(target, "w", encoding="ascii", errors="replace") as file:
        file.write("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n")
        file.writelines(f"{line}\n" for line in _section(path, lines, "NOD"))
        file.write("$EndNodes\n$Elements\n")
        for number, line in enumerate(_section(path, lines, "ELM")):
            words = line.split(None, MOST_WORDS)
            if number and (len(words) < 6 or not words[4].isdigit() or len(words) != 5 + int(words[4])):
                raise FileError(f"'{path}': the line of its cell {number} is damaged: '{line[:60]}'")
            file.write(" ".join([*words[:2], "2", *words[2:4], *words[5:]] if number else words) + "\n")
        file.write("$EndElements\n")


def _section(path: Path, lines: list[str], name: str) -> Iterator[str]:
    """Yield the lines between $NAME and $ENDNAME."""
    stripped = [line.strip() for line in lines]
    if f"${name}" not in stripped or f"$END{name}" not in stripped:
        raise FileError(f"'{path}' has no complete section ${name}: it is truncated, or not a Gmsh file of version 1")
    yield from stripped[stripped.index(f"${name}") + 1 : stripped.index(f"$END{name}")]
