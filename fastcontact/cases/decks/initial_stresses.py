"""Initial stresses of a deck, by element or set, as Abaqus takes them."""

from __future__ import annotations

from typing import Any

import numpy as np

from fastcontact.cases.decks.meshing import DeckMesh
from fastcontact.model.model import Model

# Components in the order of a data line, by how many there are.
ORDER = {2: ("xx", "yy", "zz", "xy"), 3: ("xx", "yy", "zz", "xy", "xz", "yz")}


def add_initial_stresses(model: Model, found: DeckMesh) -> None:
    """Add the initial stresses to a model; the last line of several for an element counts."""
    content, names = found.made.content, ORDER[found.dim]
    if not content.stresses:
        return
    starts, total = {}, 0
    for name, cells in model.mesh.solids.items():
        starts[name], total = total, total + len(cells)
    values = np.zeros((total, len(names)))
    turned = _turned(found)
    for block in content.stresses:
        for row in block.rows:
            if len(row.entries) != 1 + len(names):
                raise row.place.refuse(
                    f"{len(row.entries)} entries where {1 + len(names)} are needed: an element or a set, and the components "
                    f"{', '.join(names)} of its stress; stresses by integration point are not supported"
                )
            numbers = [row.number(index) for index in range(1, 1 + len(names))]
            for key in found.made.keys("element", row.text(0), row.place):
                if key not in found.solid_rows:
                    raise row.place.refuse(f"element {key[1]} is no solid, so it has no initial stress")
                if key in turned:
                    raise row.place.refuse(
                        f"element {key[1]} has an *ORIENTATION: initial stresses along such axes are not supported"
                    )
                element, number = found.solid_rows[key]
                values[starts[element] + number] = numbers
    given: dict[str, Any] = {name: values[:, [k]] for k, name in enumerate(names) if values[:, k].any()}
    if given:
        model.add_initial_stress(**given)


def _turned(found: DeckMesh) -> set[tuple[str, int]]:
    """Return the elements whose section has an orientation."""
    made, keys = found.made, set()
    for scope in made.scopes:
        for section in made.part(scope).sections:
            if section.orientation:
                name = f"{scope}.{section.elements}" if scope else section.elements
                keys.update(made.keys("element", name, section.place))
    return keys
