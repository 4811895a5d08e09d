"""Initial stresses of a deck by element or element set."""

from __future__ import annotations

from typing import Any

import numpy as np

from fastcontact.cases.decks.meshing import DeckMesh
from fastcontact.mesh.mesh import starts_of
from fastcontact.model.model import Model

# Components in the order of a data line, by the dimension of the mesh.
ORDER = {2: ("xx", "yy", "zz", "xy"), 3: ("xx", "yy", "zz", "xy", "xz", "yz")}


def add_initial_stresses(model: Model, deck_mesh: DeckMesh) -> None:
    """Add the initial stresses to a model; the last of several lines for an element is used.

    Raises CaseError if a line has not all components, or if an element is not a solid or has an orientation.
    """
    content, names = deck_mesh.content, ORDER[deck_mesh.dim]
    if not content.stresses:
        return
    starts = starts_of(model.mesh.solids)
    values = np.zeros((sum(map(len, model.mesh.solids.values())), len(names)))
    for block in content.stresses:
        for row in block.each():
            if len(row.entries) != 1 + len(names):
                raise row.refuse(
                    f"{len(row.entries)} entries, but {1 + len(names)} are needed: an element or a set, and the components "
                    f"{', '.join(names)} of its stress; stresses by integration point are not supported"
                )
            numbers = [row.number(index) for index in range(1, 1 + len(names))]
            for element in deck_mesh.elements_of(row.text(0), row.location):
                if element.type is None:
                    raise row.refuse(f"element {element.number} is not a solid, so it has no initial stress")
                if element.section is not None and element.section.orientation:
                    raise row.refuse(
                        f"element {element.number} has an *ORIENTATION: initial stresses along such axes are not supported"
                    )
                values[starts[element.type.element] + element.row] = numbers
    given: dict[str, Any] = {name: values[:, [k]] for k, name in enumerate(names) if values[:, k].any()}
    if given:
        model.add_initial_stress(**given)
