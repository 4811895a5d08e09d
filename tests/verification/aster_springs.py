"""Springs of code_aster's specs: discrete elements with a diagonal translational stiffness."""

from __future__ import annotations

from collections.abc import Iterator

from aster_mesh import Entry, MissingError, listed, nodes_of

import fastcontact as fc

# Between two nodes, and from a node to the ground.
LINES, POINTS = "K_T_D_L", "K_T_D_N"


def missing_in_springs(run: Entry) -> Iterator[str]:
    """Yield the reasons why the discrete elements of a run cannot be translated."""
    for entry in (run.get("elementary_characteristics") or {}).get("DISCRET", ()):
        if entry["CARA"] not in (LINES, POINTS):
            yield f"springs {entry['CARA']}"
        elif _local(entry) and (entry["CARA"] == POINTS or any(entry["VALE"][1:])):
            yield f"springs {entry['CARA']} in a frame of their own"


def add_springs(model: fc.Model, run: Entry) -> None:
    """Add the discrete elements of AFFE_CARA_ELEM; components without stiffness do nothing."""
    for entry in (run.get("elementary_characteristics") or {}).get("DISCRET", ()):
        values = [float(value) for value in entry["VALE"]]
        stiffness = {axis: value for axis, value in zip("xyz", values, strict=False) if value}
        if _local(entry):
            stiffness = {"axial": values[0]} if values[0] else {}
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
