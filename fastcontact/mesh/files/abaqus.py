"""Abaqus input files: detection of content that meshio misreads, and output of groups that meshio writes incorrectly."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from fastcontact.errors import FileError
from fastcontact.mesh.mesh import Mesh

NUMBERS_PER_LINE = 8


def check_readable(path: Path) -> None:
    """Raise FileError if meshio would silently drop points of a file or misread its sets."""
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        raise FileError(f"cannot read '{path}': {error}") from error
    if any(line.partition(",")[0].replace("*", "").strip().upper() == "INCLUDE" for line in lines):
        raise FileError(f"'{path}' includes another file, which is not read: copy its lines in place of *INCLUDE")
    sections = [_keyword(line) for line in lines if line.startswith("*") and not line.startswith("**")]
    n_node_sections = sum(keyword == "NODE" for keyword, _ in sections)
    if n_node_sections > 1:
        raise FileError(f"'{path}' has {n_node_sections} *NODE sections, of which meshio keeps one: join them")
    for option in ("ELSET", "NSET"):
        names = [options[option].casefold() for keyword, options in sections if options.get(option)
                 and keyword in (option, "ELEMENT")]  # fmt: skip
        repeated = [name for name, count in Counter(names).items() if count > 1]
        if repeated:
            raise FileError(
                f"'{path}' defines the {option} '{repeated[0]}' in several places, of which meshio keeps one: "
                "define it once, or convert the mesh to .med"
            )
    has_set = [bool(options.get("ELSET")) for keyword, options in sections if keyword == "ELEMENT"]
    if sorted(has_set, reverse=True) != has_set:
        raise FileError(
            f"'{path}' has an *ELEMENT section with ELSET after one without, and meshio assigns this set to wrong cells: "
            "name a set in each section, or define the sets by *ELSET"
        )


def _keyword(line: str) -> tuple[str, dict[str, str]]:
    """Return the keyword of a line and its options, with upper-case names."""
    keyword, *options = line.lstrip("*").split(",")
    pairs = (word.partition("=") for word in options)
    return keyword.strip().upper(), {name.strip().upper(): value.strip() for name, _, value in pairs}


def append_cell_sets(path: Path, mesh: Mesh) -> None:
    """Append the groups of cells to a file as sets. The writer of meshio would divide each group by element type."""
    for name in mesh.group_names:
        if any(character in name for character in ",=*\n") or name != name.strip():
            raise FileError(f"group name '{name}' contains a character that Abaqus files do not permit: rename it")
    with open(path, "a", encoding="utf-8") as file:
        for name, members in mesh.cell_groups.items():
            file.write(f"*ELSET, ELSET={name}\n")
            numbers = [str(number + 1) for number in members.tolist()]
            for start in range(0, len(numbers), NUMBERS_PER_LINE):
                file.write(",".join(numbers[start : start + NUMBERS_PER_LINE]) + "\n")
