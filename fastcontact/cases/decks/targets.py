"""Targets of distributed loads of a deck: elements or faces of elements."""

from __future__ import annotations

from dataclasses import dataclass

from fastcontact.cases.decks.assembled import Assembly, Element, Face
from fastcontact.cases.decks.blocks import Row

# For each keyword, the letter of loads on faces, and the loads on elements with the number of their additional entries.
BODY_FORCES = {"GRAV": 3, "CENTRIF": 6, "BX": 0, "BY": 0, "BZ": 0}
ON_ELEMENTS: dict[str, tuple[str, dict[str, int]]] = {
    "DLOAD": ("P", BODY_FORCES),
    "DFLUX": ("S", {"BF": 0}),
    "FILM": ("F", {}),
}
ON_SURFACES = {"DSLOAD": "P", "DSFLUX": "S", "SFILM": "F"}


@dataclass(frozen=True, slots=True)
class Target:
    """Keyword, kind and target of a distributed load, which is a face or some elements.

    `numbers` contains the direction or the axis of a body force, or the coefficient of a film.
    """

    keyword: str
    kind: str
    face: Face | None = None
    elements: tuple[Element, ...] = ()
    numbers: tuple[float, ...] = ()


def targets(assembly: Assembly, row: Row, numbers: tuple[float, ...] = ()) -> list[Target]:
    """Return the targets of a line of a distributed load; CaseError if the load is not supported."""
    keyword, label = row.location.keyword, row.text(1).upper()
    load = "load " if keyword.endswith("LOAD") else ""
    if keyword in ON_SURFACES:
        letter = ON_SURFACES[keyword]
        if label != letter:
            raise row.refuse(f"{load}{label[:40]} on a surface is not supported, only {letter}")
        faces = assembly.faces(row.text(0), row.location)
        return [Target(keyword, letter, face, (), numbers) for face in faces]
    letter, of_elements = ON_ELEMENTS[keyword]
    every = keyword == "DLOAD" and not row.text(0)
    elements = assembly.solids if every else assembly.elements_of(row.text(0), row.location)
    if label[:1] == letter and label[1:].isdigit():
        faces = [(element, assembly.facet(element, int(label[1:]), row.location)) for element in elements]
        return [Target(keyword, letter, face, (), numbers) for face in faces]
    if label not in of_elements:
        known = ", ".join([f"{letter}1", f"{letter}2", "...", *of_elements])
        raise row.refuse(f"{load}{label[:40]} is not supported; known are {known}")
    vector = tuple(row.number(3 + i, 0.0) for i in range(of_elements[label]))
    if vector and not any(vector[-3:]):
        raise row.refuse(f"the direction of {label} is missing")
    return [Target(keyword, label, None, tuple(elements), vector)]
