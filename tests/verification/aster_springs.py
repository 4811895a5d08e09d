"""Springs of code_aster's specs: discrete elements with a diagonal translational stiffness."""

from collections.abc import Iterator

from aster_mesh import Entry, MissingError, listed, nodes_of

import fastcontact as fc

# Between two nodes, and from a node to the ground.
LINES, POINTS = "K_T_D_L", "K_T_D_N"
KEYWORDS = {"DISCRET", "DISCRET_2D"}
KNOWN = {"CARA", "VALE", "REPERE", "GROUP_MA", "GROUP_NO", "NOEUD", "SYME"}


def _entries(run: Entry) -> list[Entry]:
    found = run.get("elementary_characteristics") or {}
    return [entry for keyword in sorted(KEYWORDS) for entry in listed(found.get(keyword, []))]


def missing_in_springs(run: Entry) -> Iterator[str]:
    """Yield the reasons why the discrete elements of a run cannot be translated."""
    for keyword in run.get("elementary_characteristics") or {}:
        if keyword not in {*KEYWORDS, "MODELE"}:
            yield f"{keyword} of AFFE_CARA_ELEM"
    for entry in _entries(run):
        yield from (f"{key} of discrete elements" for key in entry if key not in KNOWN)
        if entry["CARA"] not in (LINES, POINTS):
            yield f"springs {entry['CARA']}"
        elif _local(entry) and entry["CARA"] == POINTS:
            yield "springs of a node in a frame of their own"
        elif _local(entry) and len(set(entry["VALE"][1:])) > 1:
            yield "springs with two stiffnesses across their line"


def add_springs(model: fc.Model, run: Entry) -> None:
    """Add the discrete elements of AFFE_CARA_ELEM; components without stiffness do nothing."""
    for entry in _entries(run):
        values = [float(value) for value in entry["VALE"]]
        names = ("axial", "transverse") if _local(entry) else "xyz"
        stiffness = {name: value for name, value in zip(names, values, strict=False) if value}
        if not stiffness:
            continue
        if entry["CARA"] == POINTS:
            for node in nodes_of(model.mesh, entry):
                model.add_spring(int(node), **stiffness)
        else:
            for first, second in _lines(model.mesh, entry):
                model.add_spring(first, second, **stiffness)


def _local(entry: Entry) -> bool:
    return entry.get("REPERE", "GLOBAL") == "LOCAL"


def _lines(mesh: fc.Mesh, entry: Entry) -> Iterator[tuple[int, int]]:
    for group in listed(entry.get("GROUP_MA", ())):
        blocks = mesh.cells_of(group)
        if set(blocks) != {"line2"}:
            raise MissingError(f"needs springs on {', '.join(blocks) or 'no cells'} ({group})")
        for first, second in blocks["line2"]:
            yield int(first), int(second)
